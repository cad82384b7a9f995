"""Advice, in words, on which experiment distinguishes which effects."""

from collections.abc import Sequence

from testbench.effects import effect
from testbench.effects.experiment import Experiment

# Separation in noise units that one run shows beyond doubt; below it a motion alone separates nothing.
ENOUGH = 4.0


def why(open_: Sequence[str], chosen: Sequence[str], separation: float | None, reason: str) -> str:
    """Why and how to record again, in one or two sentences.

    open_: effects that stay open, "none" among them where it is whether there is one. chosen: those
    that the motion separates. separation: of the proposed motion in noise units, None where there is no
    motion for the given reason.
    """
    hidden = "none" in open_
    question = f"These runs do not distinguish {_listed(open_)}"
    if hidden:
        question = f"These runs would not show {_listed(open_)}"
    if separation is None:
        return _sentences(question + _advice(open_), reason[0].upper() + reason[1:])
    if separation < ENOUGH:
        outcome = f"The best motion found would part them by only {separation:.2g} times the noise"
        return _sentences(question + _advice(open_), outcome)
    if not hidden:
        outcome = f"The proposed motion parts them by {separation:.3g} times the noise"
        outcome += "" if set(chosen) == set(open_) else f" if it is {_listed(chosen)}"
        return _sentences(question + _advice(open_), outcome)
    left = [name for name in open_ if name not in chosen]
    outcome = f"The proposed motion shows {_listed(chosen)} at {separation:.3g} times the noise or more"
    return _sentences(question, outcome, *([f"Left: {_listed(left)}{_advice(left)}"] if left else []))


def _advice(names: Sequence[str]) -> str:
    """Advice on what to record to distinguish these effects, after a colon; empty without any."""
    shown_by = [each for name in set(names) - {"none"} for each in effect(name).DESCRIPTION.shown_by]
    advised = (each for each in Experiment if shown_by.count(each) >= each.fewest)
    return next((f": {each.words}" for each in advised), "")


def _sentences(*sentences: str) -> str:
    return ". ".join(sentences) + "."


def _listed(names: Sequence[str]) -> str:
    """Titles of effects in a sentence."""
    titles = [effect(name).DESCRIPTION.title.lower() for name in names if name != "none"]
    return titles[0] if len(titles) == 1 else ", ".join(titles[:-1]) + " and " + titles[-1]
