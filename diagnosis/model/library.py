"""Regressor columns of all catalogue effects and of free functions of the motion, made once for a load.

Linearised anew, most runs carry the load that they did: what is known of friction near rest, a warming joint
or a late sensor moves next to nothing of it. Then only those columns are made again that friction is in. Free
functions are of the motion, which stays: those of torque alone are made again.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from testbench.effects import effects

from ..data.run import Prepared
from .candidate import Candidate
from .candidates import candidates
from .free_functions import generic_candidates

# Columns are the same where no joint's load differs by more than this share of it.
SAME_LOAD = 0.05


@dataclass
class Library:
    """The catalogue without some effects, along runs that are linearised again and again.

    motions: free functions of the motion. catalogue: all members of all families, but of effects that act at
    times only, which are searched for in ways of their own. Both as of the last ``along``.
    """

    without: Sequence[str]
    motions: list[Candidate] = field(default_factory=list)
    catalogue: list[Candidate] = field(default_factory=list)
    _loaded: Prepared | None = None

    def along(self, prepared: Prepared) -> None:
        """Make the columns along these runs: the same runs as before, linearised anew."""
        if self._loaded is None or not _have_one_load(self._loaded, prepared):
            # Old and new ones together would be too much for the memory of a small machine.
            self.catalogue, self._loaded = [], prepared
        self.motions = generic_candidates(prepared, self.motions)
        apart = [name for name, each in effects().items() if each.DESCRIPTION.at_times]
        without = [*self.without, *apart]
        self.catalogue = candidates(prepared, without, known=self.catalogue)


def _have_one_load(one: Prepared, other: Prepared) -> bool:
    """Whether in two linearisations of the same runs all joints carry next to the same, by the same zeros."""
    if not np.array_equal(one.zeros, other.zeros):
        return False
    loads, others = (np.concatenate([run.logged.load for run in each.runs]) for each in (one, other))
    return bool(np.all(np.mean((loads - others) ** 2, axis=0) <= SAME_LOAD**2 * np.mean(loads**2, axis=0)))
