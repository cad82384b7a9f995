"""A loop in sentences, for the terminal and the page."""

from collections.abc import Mapping, Sequence
from typing import Any

from diagnosis.report import words
from testbench.effects import effect
from testbench.effects.signature import Quantity
from testbench.findings import significant

from .outcome import Outcome, Place, Round


def labelled(place: Place) -> str:
    """An effect with its joint."""
    return f"{words.title(place.effect)}, {place.joint or 'whole robot'}"


def listed(places: Sequence[Place]) -> str:
    """Several effects with their joints."""
    return "; ".join(labelled(place) for place in places)


def headline(found: Outcome) -> str:
    """How the loop ended."""
    last = found.rounds[-1]
    after = f"after {last.number} round{'s' if last.number > 1 else ''}, {last.runs} runs"
    if not found.is_resolved:
        if last.confused:
            return f"Still open {after}: {listed((*last.named, *last.confused))}."
        return f"Nothing is named {after}, though {listed(found.acts) or 'nothing'} acts."
    ending = "which is what acts" if found.is_right else f"though {listed(found.acts) or 'nothing'} acts"
    return f"Resolved {after}: {listed(last.named)}, {ending}."


def said(each: Round) -> str:
    """Phrase on the effects that a round reported, with their probabilities and open rivals."""
    if not each.named:
        return f"nothing named ({each.document['verdict']}), {len(each.hidden)} effects would not have shown"
    shares = [f"{labelled(place)} {100 * each.probabilities[place]:.0f} %" for place in each.named]
    others = [f"{labelled(place)} {100 * each.probabilities[place]:.0f} %" for place in each.confused]
    return "; ".join(shares) + (f", or {'; '.join(others)}" if others else "")


def proposed(each: Round) -> str:
    """Phrase on the next experiment that a round proposed."""
    experiment = each.document["next_experiment"]
    if experiment is None:
        return "nothing is left open"
    if experiment["file"] is None:
        return "no motion would help"
    now, then = (significant(experiment[key], 2) for key in ("separation_now", "separation"))
    return f"a motion that takes the separation from {now} to {then} times the noise"


def truth(place: Place, values: Mapping[str, float]) -> str:
    """Phrase on a true effect, with its parameters."""
    parameters = effect(place.effect).DESCRIPTION.parameters
    phrases = [
        f"{each.name.replace('_', ' ')} {significant(values[each.name], 3)}"
        + ("" if each.unit == "-" else f" {each.unit}")
        for each in parameters
        if each.name in values
    ]
    return f"{labelled(place)}: {', '.join(phrases)}"


def estimated(named: Mapping[str, Any]) -> str:
    """Phrase on a reported effect, with its parameters, from its entry in diagnosis.json."""
    phrases = []
    for name, value in named["parameters"].items():
        if not isinstance(value, Mapping):
            phrases.append(f"{name} {value}")
        elif isinstance(value["value"], float):
            known = Quantity(value["value"], value["std"], value["unit"])
            phrases.append(f"{name.replace('_', ' ')} {words.quantity(known)}")
    return f"{labelled(Place(named['effect'], named['joint']))}: {', '.join(phrases)}"
