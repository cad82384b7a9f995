"""The loop in ten lines for the terminal."""

from rich.text import Text

from testbench.terminal import console

from . import wording
from .outcome import Outcome

MOST_LINES, LAST_ROUNDS, MOST_EFFECTS = 10, 3, 1


def print_summary(found: Outcome) -> None:
    """Print the summary on standard output, 110 columns wide where that is not a terminal."""
    console().print(summary(found), soft_wrap=True)


def summary(found: Outcome) -> Text:
    """How it ended, what the last rounds said and proposed, what acts, what was found; ten lines at most."""
    lines = [Text(wording.headline(found), style="bold")]
    for each in found.rounds[-LAST_ROUNDS:]:
        lines.append(_line(f"round {each.number}", f"{wording.said(each)}"))
        lines.append(_line("", f"next: {wording.proposed(each)}"))
    for place, values in list(zip(found.acts, found.values, strict=True))[:MOST_EFFECTS]:
        lines.append(_line("acts", wording.truth(place, values)))
    for named in found.rounds[-1].document["effects"][:MOST_EFFECTS]:
        lines.append(_line("found", wording.estimated(named)))
    return Text("\n").join(lines[:MOST_LINES])


def _line(label: str, text: str) -> Text:
    return Text.assemble((f"{label:9}", "dim"), text)
