"""Effects put into MJCF, and their page."""

from pathlib import Path
from typing import Annotated

from cyclopts import App, Parameter

from .options import Jobs, Model

app = App(name="effects", help="Effects that a model leaves out: put them into MJCF, or document them.")


@app.command(name="write")
def write_effects(
    *,
    model: Model,
    effect: Annotated[list[str], Parameter(help="NAME[:joint[:key=value,...]]; repeatable", negative=())],
    out: Annotated[Path, Parameter(help="MJCF to write")],
) -> None:
    """Write a model that plain MuJoCo runs with the effects; says what MJCF cannot carry."""
    from ..effects_page import write_effects_model

    for sentence in write_effects_model(model, effect, out):
        print(sentence)


@app.command
def page(
    *,
    model: Model,
    out: Annotated[Path, Parameter(help="Markdown to write; pictures go to the folder of its name")],
    joint: Annotated[int, Parameter(help="number from 1 of the joint that is shown")] = 2,
    jobs: Jobs = None,
) -> None:
    """Simulate every effect and write the catalogue's page with measured pictures."""
    from ..effects_page import write_effects_page

    write_effects_page(model, out, joint, jobs)
