"""What many tests ask of the same robot, worked out once."""

from collections import OrderedDict
from collections.abc import Callable
from functools import wraps
from typing import Any, TypeVar

Result = TypeVar("Result")
# Results that are kept of each function, the latest: recordings are large.
KEPT = 8


def once_per_robot(work: Callable[..., Result]) -> Callable[..., Result]:
    """The function, whose first argument is a robot, with its latest results kept.

    A robot is known by being the same object, which is held so that no other takes its place; the other
    arguments by their values. Nobody may change what is kept.
    """
    done: OrderedDict[tuple[Any, ...], tuple[object, Result]] = OrderedDict()

    @wraps(work)
    def kept(robot: object, *arguments: Any) -> Result:
        key = (id(robot), *arguments)
        if key not in done:
            done[key] = robot, work(robot, *arguments)
        done.move_to_end(key)
        if len(done) > KEPT:
            done.popitem(last=False)
        return done[key][1]

    return kept
