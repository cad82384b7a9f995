"""What can be chosen, by kind, as ``testbench list`` shows it."""

import json

from rich.table import Table
from rich.text import Text

from identification.differentiation import differentiation_methods
from identification.estimators import estimators
from identification.excitation.criteria import CRITERIA
from identification.excitation.trajectories import TRAJECTORIES
from identification.models import identification_models

from .effects import effects
from .terminal import console


def catalogue() -> dict[str, list[str]]:
    """Names by kind: models, estimators, differentiation, trajectories, criteria, effects."""
    return {
        "models": sorted(identification_models()),
        "estimators": sorted(estimators()),
        "differentiation": sorted(differentiation_methods()),
        "trajectories": sorted(TRAJECTORIES),
        "criteria": sorted(CRITERIA),
        "effects": sorted(effects()),
    }


def print_catalogue(as_json: bool) -> None:
    """Print the catalogue on stdout, for a person or as JSON."""
    names = catalogue()
    if as_json:
        print(json.dumps(names))
        return
    table = Table(box=None, pad_edge=False, show_header=False)
    for kind, members in names.items():
        table.add_row(Text(kind, "bold"), ", ".join(members))
    console().print(table)
