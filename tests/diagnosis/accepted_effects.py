"""An effect that was taken in, with a name or without."""

from diagnosis.model.candidate import Candidate
from diagnosis.plausibility.accepted import Accepted


def accepted_of(candidate: Candidate, named: bool = True) -> Accepted:
    return Accepted(candidate, probability=1.0, rivals=(), score=100.0, share=0.8, worth=0.01, named=named)
