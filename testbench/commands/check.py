"""A look at logs before anything is fitted to them."""

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from .options import Model


def check(
    logs: Annotated[list[Path], Parameter(help="robot-log files", consume_multiple=True, negative=())],
    /,
    *,
    model: Model,
    json: Annotated[bool, Parameter(help="for machines", negative=())] = False,
) -> None:
    """Say what an experienced engineer looks at first: units, order, signs, zeros, torque, excitation."""
    from recordings.check import check_logs

    check_logs(model, logs, json)
