"""A look at logs before anything is fitted to them."""

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from .options import AS_LOGGED, Chosen, Map, Model


def check(
    logs: Annotated[
        list[Path], Parameter(help="robot-logs, or recordings", consume_multiple=True, negative=())
    ],
    /,
    *,
    model: Model,
    map: Map = None,
    chosen: Chosen = AS_LOGGED,
    json: Annotated[bool, Parameter(help="for machines", negative=())] = False,
) -> None:
    """Say what an experienced engineer looks at first: units, order, signs, zeros, torque, excitation."""
    from recordings.check import check_logs

    from ..runs import logged_joints

    choice = chosen.choice()
    check_logs(model, logs, json, map, choice, logged_joints(logs[0], model, choice, map))
