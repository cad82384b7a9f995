"""The one table that a benchmark prints."""

from dataclasses import dataclass

from rich.console import Console
from rich.table import Table


@dataclass(frozen=True)
class Goal:
    """A figure to reach: what it is, what was reached, and the bound; ``at_least`` or else at most."""

    what: str
    reached: float
    bound: float
    at_least: bool = True

    @property
    def met(self) -> bool:
        """Whether the bound is kept."""
        return self.reached >= self.bound if self.at_least else self.reached <= self.bound


@dataclass(frozen=True)
class Report:
    """columns: headings. rows: a cell a column. goals: what the figures are held against. notes: how."""

    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    goals: tuple[Goal, ...] = ()
    notes: tuple[str, ...] = ()


def show(name: str, title: str, report: Report) -> None:
    """Print the table, its goals and its notes."""
    # A file or pipe has no width of its own; a table must not be folded there.
    console = Console(highlight=False, width=None if Console().is_terminal else 120)
    table = Table()
    for index, column in enumerate(report.columns):
        table.add_column(column, justify="right" if index else "left")
    for row in report.rows:
        table.add_row(*row)
    console.print(f"\n[bold]{name}[/bold]: {title}")
    console.print(table)
    for goal in report.goals:
        sign, verdict = ("≥", "<") if goal.at_least else ("≤", ">")
        verdict = "met" if goal.met else f"NOT met ({verdict} {goal.bound:g})"
        console.print(f"  {goal.what}: {goal.reached:.3g}, goal {sign} {goal.bound:g}: {verdict}")
    for note in report.notes:
        console.print(f"  {note}", style="dim")
