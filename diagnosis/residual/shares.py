"""Shares of a gap: a joint's, of it those of the regimes of the motion, and what no effect explains."""

from dataclasses import dataclass

# A joint's gap that is in no regime more than in others.
EVERYWHERE = "everywhere"
# What an unexplained residual follows: no function of the motion, or effects that these runs leave unsure.
NOTHING, UNCERTAIN = "nothing that was tried", "effects that these runs do not determine for sure"


@dataclass(frozen=True)
class RegimeShare:
    """A part of one joint's gap.

    aspect: what the gap is divided by (speed, position, frequency, ...). part: which part of it.
    regime: both in words. share: of the joint's squared residual, 0 to 1; low, high: its 90 % interval.
    expected: what the share would be if the residual had nothing to do with the regime. rms: N·m; over the
    regime's samples, or of the regime's part of the residual where that is one of its spectrum. cycles: of a
    period in the joint's position, a revolution (a metre of a slide joint).
    """

    aspect: str
    part: str
    regime: str
    share: float
    low: float
    high: float
    expected: float
    rms: float
    cycles: float | None = None

    @property
    def concentration(self) -> float:
        """Share over the expected one."""
        return self.share / max(self.expected, 1e-12)

    @property
    def excess(self) -> float:
        """Share beyond the expected one: of one measure for regimes of every kind."""
        return self.share - self.expected


@dataclass(frozen=True)
class Share:
    """One joint's share of the gap.

    joint: index. regime: the densest, in words. share: 0 to 1. gap_rms, noise_rms: N·m. regimes: all of them.
    """

    joint: int
    regime: str
    share: float
    gap_rms: float
    noise_rms: float
    regimes: tuple[RegimeShare, ...] = ()


@dataclass(frozen=True)
class Unclaimed:
    """A residual that no effect explains: a joint's index, the regime in words, and the share of its gap.

    frequency: Hz, where most of that shakes at one. period: in words, where much of it repeats with the
    position.
    """

    joint: int
    regime: str
    share: float
    frequency: float | None = None
    period: str | None = None
