"""What can be chosen, by kind, as ``testbench list`` shows it."""

import json

from rich.console import Console

from identification.differentiation import differentiation_methods
from identification.estimators import estimators
from identification.excitation.criteria import CRITERIA
from identification.excitation.trajectories import TRAJECTORIES

MODELS = ("inverse_dynamic",)


def catalogue() -> dict[str, list[str]]:
    """Names by kind: models, estimators, differentiation, trajectories, criteria, effects."""
    return {
        "models": list(MODELS),
        "estimators": sorted(estimators()),
        "differentiation": sorted(differentiation_methods()),
        "trajectories": sorted(TRAJECTORIES),
        "criteria": sorted(CRITERIA),
        "effects": [],
    }


def print_catalogue(as_json: bool) -> None:
    """Print the catalogue on stdout, for a person or as JSON."""
    names = catalogue()
    if as_json:
        print(json.dumps(names))
        return
    console = Console()
    for kind, members in names.items():
        console.print(f"[bold]{kind}[/bold]  {', '.join(members) or 'none yet'}")
