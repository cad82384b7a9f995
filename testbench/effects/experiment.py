"""Records that distinguish effects which look alike: how to make them, and which is the most informative."""

from enum import Enum


class Experiment(Enum):
    """A record that distinguishes effects, the most informative first: (how to make it, ``fewest``).

    No motion replaces a known load, or time to warm up. fewest: how many of the
    effects in question it has to identify to be advised.
    """

    KNOWN_LOAD = ("record the same motion with a known payload on and off: no motion alone shows a gain", 1)
    WARM_UP = ("repeat the first run after the arm has worked for as long as it takes to warm up", 1)
    HIGH_FREQUENCIES = ("move with content at 5 to 30 Hz, where their phases part", 1)
    SMALL_REVERSALS = ("make small reversals of several amplitudes", 2)
    TWO_LOADS = ("repeat the same velocities at two poses that gravity loads differently", 1)
    TWO_SLOW_SPEEDS = (
        "move slowly at constant speed, at two speeds, over as much of the range as there is",
        1,
    )
    WHOLE_RANGE = (
        "sweep the joints slowly through their whole range, the first one at several poses of the others",
        1,
    )
    CONSTANT_SPEEDS = (
        "hold many constant speeds in both directions, from creeping to the fastest allowed",
        1,
    )
    ONCE_MORE = ("repeat the run: a contact will not", 1)

    @property
    def words(self) -> str:
        """How to make it."""
        return self.value[0]

    @property
    def fewest(self) -> int:
        """How many of the effects in question it has to identify to be advised."""
        return self.value[1]
