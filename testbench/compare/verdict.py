"""What a comparison says in words, computed from its rows."""

from collections.abc import Sequence

import numpy as np

from . import criteria, estimators
from .case import Row
from .figures import numbers

# Two medians this near to each other are called equal.
NEAR = 1.1
# So near to the best of all starts by -log det a design must come.
WITHIN = 0.05
# Seconds: a share of less is one of start-up times.
SHORTEST = 1.0


def verdict(question: str, rows: Sequence[Row]) -> list[str]:
    """One sentence a finding, the most important first."""
    if question == "criteria":
        return _criteria(rows)
    simulated = [row for row in rows if row["level"] != estimators.RECORDED]
    lines = []
    for level in dict.fromkeys(str(row["level"]) for row in simulated):
        lines.append(_best([row for row in simulated if row["level"] == level], level))
    if question == "estimators":
        lines += _against_ordinary(simulated) + _recorded(rows)
    if question == "differentiation":
        lines.append(_lowest(simulated, "acceleration_error", "The acceleration is nearest to the truth by"))
    if question == "trajectories":
        lines.append(_lowest(simulated, "minus_logdet", "The most information is in", least=True))
    return lines


def medians(rows: Sequence[Row], metric: str) -> dict[str, float]:
    """Median of a metric by choice, smallest first; choices without one are left out."""
    found = {}
    for choice in dict.fromkeys(str(row["choice"]) for row in rows):
        values = [row.get(metric) for row in rows if row["choice"] == choice]
        known = [value for value in values if isinstance(value, float | int) and np.isfinite(value)]
        if known:
            found[choice] = float(np.median(known))
    return dict(sorted(found.items(), key=lambda pair: pair[1]))


def _best(rows: Sequence[Row], level: str) -> str:
    error, seconds = medians(rows, "prediction_error"), medians(rows, "seconds")
    if not error:
        return f"At {level} nothing could be compared."
    best = next(iter(error.values()))
    equal = [name for name, value in error.items() if value <= NEAR * best]
    quickest = min(equal, key=lambda name: seconds.get(name, np.inf))
    text = f"At {level} torque is predicted best by {', '.join(equal)} ({100 * best:.2g} % of its RMS)"
    if len(equal) > 1:
        text += f", of which {quickest} is quickest ({seconds[quickest]:.2g} s)"
    worst = max(error, key=lambda name: error[name])
    return text + f"; {worst} is {error[worst] / best:.3g} times as far off."


def _against_ordinary(rows: Sequence[Row]) -> list[str]:
    """Where errors in the regressor make ordinary least squares fall behind."""
    lines = []
    for level in dict.fromkeys(str(row["level"]) for row in rows):
        error = medians([row for row in rows if row["level"] == level], "prediction_error")
        if "ols" not in error:
            continue
        better = {
            name: error["ols"] / value
            for name, value in error.items()
            if name in ("instrumental_variable", "maximum_likelihood", "tls") and error["ols"] > NEAR * value
        }
        if better:
            factors = ", ".join(f"{name} {ratio:.2g} times" for name, ratio in better.items())
            weighted = (
                f" (by weighting alone, wls, {error['ols'] / error['wls']:.2g} times)"
                if "wls" in error
                else ""
            )
            lines.append(f"At {level} ordinary least squares is beaten by {factors}{weighted}.")
    bound = medians([row for row in rows if row["level"] == rows[0]["level"]], "over_bound")
    reach = [f"{name} {value:.2f}" for name, value in bound.items() if value <= 1.5]
    if reach:
        lines.append(
            f"At {rows[0]['level']} these come within 1.5 times the Cramér-Rao bound: {', '.join(reach)}."
        )
    return lines


def _recorded(rows: Sequence[Row]) -> list[str]:
    error = medians([row for row in rows if row["level"] == estimators.RECORDED], "validation_residual")
    if not error:
        return []
    residuals = ", ".join(f"{name} {100 * value:.1f} %" for name, value in error.items())
    return [f"On the recorded robot, residual over RMS torque on the half not fitted: {residuals}."]


def _lowest(rows: Sequence[Row], metric: str, text: str, least: bool = False) -> str:
    found = medians(rows, metric)
    best = next(iter(found))
    others = ", ".join(f"{name} {value:.3g}" for name, value in list(found.items())[1:])
    unit = "-log det" if least else "relative error"
    return f"{text} {best} ({unit} {found[best]:.3g}; {others})."


def _criteria(rows: Sequence[Row]) -> list[str]:
    lines = []
    alone = next((row for row in rows if row["choice"] == criteria.ALONE), None)
    if alone is not None:
        cost = {
            name.removesuffix("_ms"): value
            for name, value in alone.items()
            if name.endswith("_ms") and isinstance(value, float)
        }
        ratio = {name: cost[name] / cost["hadamard"] for name in ("logdet", "condition_by_svd")}
        lines.append(
            f"Alone, Hadamard's criterion costs {cost['hadamard']:.2g} ms, -log det"
            f" {ratio['logdet']:.1f} times and the condition number by SVD"
            f" {ratio['condition_by_svd']:.1f} times as much."
        )
    seconds = {name: float(np.mean(numbers(_of(rows, name), "seconds"))) for name in _designs(rows)}
    bound = medians([row for row in rows if row["choice"] in seconds], "relative_bound")
    costs = ", ".join(f"{name} {seconds[name]:.2g} s to {100 * value:.2g} %" for name, value in bound.items())
    lines.append(f"One start takes, to this median Cramér-Rao deviation of the parameters: {costs}.")
    return lines + _fewest_starts(rows, seconds)


def _designs(rows: Sequence[Row]) -> list[str]:
    names = dict.fromkeys(str(row["choice"]) for row in rows if row["choice"] != criteria.ALONE)
    return [name for name in names if len(numbers(_of(rows, name), "seconds"))]


def _of(rows: Sequence[Row], choice: str) -> list[Row]:
    return [row for row in rows if row["choice"] == choice]


def _fewest_starts(rows: Sequence[Row], seconds: dict[str, float]) -> list[str]:
    """Which design does soonest what the best of all starts by -log det does, and how soon."""
    reference = _finished(rows, "logdet")
    if not reference:
        return []
    goal = _bound_of_best(reference)
    spent = {}
    for name in ("hadamard", "condition", "logdet", criteria.TWO_STAGE):
        count = _starts_to(goal, _finished(rows, name))
        if count is not None:
            spent[name] = count, count * seconds[name]
    if not spent:
        return ["No design comes near the best of -log det from fewer starts."]
    starts = len(reference)
    needs = ", ".join(f"{name} needs {count} ({time:.3g} s)" for name, (count, time) in spent.items())
    missing = [name for name in ("hadamard", "condition") if name in seconds and name not in spent]
    text = (
        f"The best of {starts} starts by -log det has a median deviation of {100 * goal:.3g} %."
        f" To come within {100 * WITHIN:.0f} % of it, {needs}"
    )
    if missing:
        text += f"; {' and '.join(missing)} never {'do' if len(missing) > 1 else 'does'}"
    best = min(spent, key=lambda name: spent[name][1])
    rivals = []
    for name in criteria.DIFFERENCES:
        if name in seconds:
            whole = starts * seconds[name]
            if whole >= SHORTEST:
                share = 100 * spent[best][1] / whole
                rivals.append(f"{share:.2g} % of the {whole:.0f} s of {starts} starts by {name}")
    compared = f" {best} takes {' and '.join(rivals)}." if rivals else ""
    return [f"{text}.{compared}"]


def _finished(rows: Sequence[Row], choice: str) -> list[Row]:
    return [row for row in _of(rows, choice) if "relative_bound" in row]


def _starts_to(goal: float, rows: Sequence[Row]) -> int | None:
    """How many starts a design needs on average, None where all of them do not do."""
    for count in range(1, len(rows) + 1):
        # As a user would: so many starts, the one of least -log det. The mean over disjoint groups.
        groups = [rows[start : start + count] for start in range(0, len(rows) - count + 1, count)]
        if float(np.mean([_bound_of_best(group) for group in groups])) <= (1 + WITHIN) * goal:
            return count
    return None


def _bound_of_best(rows: Sequence[Row]) -> float:
    best = min(rows, key=lambda row: _figure(row, "minus_logdet"))
    return _figure(best, "relative_bound")


def _figure(row: Row, metric: str) -> float:
    """A figure that every finished design has."""
    value = row[metric]
    assert value is not None
    return float(value)
