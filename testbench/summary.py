"""The result of an identification as tables for the terminal."""

from rich.console import Group
from rich.table import Table
from rich.text import Text

from recordings.checks.finding import Finding, Severity

from .findings import headline, left_open, parameter_rows, significant, torque_error
from .results import IdentificationResult
from .terminal import WIDTH as WIDTH
from .terminal import console

LONGEST_NAME = 28
COLOURS = {Severity.STOP: "bold red", Severity.WARN: "yellow", Severity.NOTE: "dim"}


def print_summary(result: IdentificationResult) -> None:
    """Print the summary on standard output, 110 columns wide where that is not a terminal."""
    console().print(summary(result))


def summary(result: IdentificationResult) -> Group:
    """The headline, the base parameters and the torque error a joint, to print with rich; 110 columns."""
    found = [finding_line(each) for each in result.log_findings]
    remarks = (Text(remark) for remark in left_open(result))
    return Group(*found, Text(headline(result)), *remarks, _parameters(result), _torque(result))


def finding_line(finding: Finding) -> Text:
    """A finding of the checks of the logs, its severity in colour."""
    run = f"{finding.run}: " if finding.run else ""
    return labelled_line(finding.severity, f"{run}{finding.sentence}", COLOURS[finding.severity])


def labelled_line(label: str, text: str, style: str = "dim") -> Text:
    """A line with its label before it, in a column of its own."""
    return Text.assemble((f"{label:8}", style), text)


def _parameters(result: IdentificationResult) -> Table:
    known = result.comparison is not None
    table = _table("Base parameters")
    table.add_column("parameter", no_wrap=True, max_width=LONGEST_NAME)
    table.add_column("unit", no_wrap=True)
    for name in ("value", "σ", "%σ") + (("truth", "error", "error/σ", "Cramér-Rao") if known else ()):
        table.add_column(name, justify="right", no_wrap=True)
    for row in parameter_rows(result):
        name = row.name if len(row.name) <= LONGEST_NAME else row.name[: LONGEST_NAME - 1] + "…"
        cells: list[str | Text] = [
            name,
            row.unit,
            significant(row.value),
            significant(row.std, 2),
            significant(row.percent_sigma, 2),
        ]
        if known:
            outside = row.error_std is not None and abs(row.error_std) > 2
            cells += [
                significant(row.truth),
                significant(row.error, 2),
                Text(significant(row.error_std, 2), "red" if outside else ""),
                significant(row.cramer_rao, 2),
            ]
        table.add_row(*cells)
    return table


def _torque(result: IdentificationResult) -> Table:
    fit, validation = torque_error(result.fits), torque_error(result.validations)
    table = _table("Torque residual, RMS")
    table.add_column("joint")
    table.add_column("unit")
    shown = [] if result.bands is None else [("band, Hz", result.bands.cutoff)]
    for role, error in (("fit", fit), ("validation", validation)):
        if error is not None:
            shown += [(role, error.rms), (f"{role}, % of torque", 100 * error.relative)]
            if result.bands is not None:
                shown.append(("over all", error.unfiltered))
    if result.comparison is not None:
        shown.append(("noise floor", result.comparison.noise_floor))
    for heading, _ in shown:
        table.add_column(heading, justify="right")
    for joint, (name, unit) in enumerate(zip(result.robot.joint_names, result.robot.units(), strict=True)):
        table.add_row(name, unit, *(significant(values[joint], 3) for _, values in shown))
    return table


def _table(title: str) -> Table:
    return Table(title=title, title_justify="left", title_style="bold", box=None, pad_edge=False)
