"""The figures of a study: shares with intervals, calibration, detection limits, risk against coverage."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import isotonic_regression
from scipy.stats import norm

from .case import BESIDE, LITTLE, NOT_DRIVEN
from .judge import Row

Array = NDArray[np.float64]

SEVERE = 0.35
# An effect that moves this share of a joint's torque is about as large as the drive's noise.
VISIBLE = 0.01
# A gap this much above the floor is worth closing, and so much error of a size is too much.
MATERIAL, PARAMETER_ERROR = 0.05, 0.15
CLOSED = 0.8
BINS = 10
CONFIDENCE = 0.95
SPLITS: dict[str, Callable[[Row], bool]] = {
    "all": lambda row: True,
    "clean": lambda row: row["background"] == 0,
    "background": lambda row: row["background"] > 0,
}


@dataclass(frozen=True)
class Share:
    """So many of so many, with the bounds of Wilson's interval; None where there are none."""

    count: int
    of: int

    @property
    def value(self) -> float | None:
        """The share, 0 to 1."""
        return self.count / self.of if self.of else None

    @property
    def interval(self) -> tuple[float, float] | None:
        """Wilson's interval at 95 %."""
        if not self.of:
            return None
        z = float(norm.ppf((1 + CONFIDENCE) / 2))
        p, n = self.count / self.of, self.of
        centre = (p + z**2 / (2 * n)) / (1 + z**2 / n)
        half = z / (1 + z**2 / n) * float(np.sqrt(p * (1 - p) / n + z**2 / (4 * n**2)))
        return max(centre - half, 0.0), min(centre + half, 1.0)


def share(rows: Sequence[Row], holds: Callable[[Row], bool]) -> Share:
    """How many of the rows it holds for."""
    return Share(sum(bool(holds(row)) for row in rows), len(rows))


def shares(rows: Sequence[Row]) -> dict[str, Share]:
    """Every figure that is a share, by name."""
    of = {
        kind: [row for row in rows if row["kind"] == kind]
        for kind in ("single", "pair", "triple", "none", "unknown")
    }
    severe = [row for row in of["single"] if row["severity"] >= SEVERE]
    named = [row for kind in ("single", "pair", "triple") for row in of[kind]]
    placed = [row for row in of["single"] if row["joint_right"] is not None]
    sized = [row for row in of["single"] if row["parameter_error"] is not None]
    reducible = material(rows)
    return {
        "singles, first effect and joint right, severity .35 and up": share(severe, lambda r: r["right"]),
        "singles, first effect and joint exact, severity .35 and up": share(severe, lambda r: r["exact"]),
        "singles, first effect and joint right, 1 % of the torque and up": share(
            [row for row in of["single"] if row["moved"] >= VISIBLE], lambda r: r["right"]
        ),
        "singles, first effect and joint right": share(of["single"], lambda r: r["right"]),
        "singles, effect right": share(of["single"], lambda r: r["effect_right"]),
        "singles, joint right": share(placed, lambda r: r["joint_right"]),
        "singles, nothing named": share(of["single"], lambda r: r["first"] is None),
        "pairs, both effects found": share(of["pair"], lambda r: r["all_found"]),
        "pairs, both found, severities .35 and up": share(
            [row for row in of["pair"] if row["least_severity"] >= SEVERE], lambda r: r["all_found"]
        ),
        "pairs, one effect found first": share(of["pair"], lambda r: r["exact"]),
        "triples, all effects found": share(of["triple"], lambda r: r["all_found"]),
        "wrong name given": share(named, lambda r: r["wrong"]),
        "an effect named that does not act": share(named, lambda r: r["extra"] > 0),
        "healthy, false alarm": share(of["none"], lambda r: r["verdict"] in ("effect", "unknown")),
        "healthy, effect named": share(of["none"], lambda r: r["verdict"] == "effect"),
        "unknown, reported as unknown": share(of["unknown"], lambda r: r["verdict"] == "unknown"),
        "unknown, joint right": share(of["unknown"], lambda r: r["where_joint"] == r["joint"]),
        "size of the effect within 15 %": share(sized, lambda r: r["parameter_error"] <= PARAMETER_ERROR),
        "at least 80 % of the gap closed": share(reducible, lambda r: r["closed"] >= CLOSED),
    }


def material(rows: Sequence[Row]) -> list[Row]:
    """Cases with effects of the catalogue whose gap on the hidden run is worth closing."""
    return [
        row
        for row in rows
        if row["kind"] in ("single", "pair", "triple")
        and row["closed"] is not None
        and row["hidden_parameters"] > (1 + MATERIAL) * row["hidden_floor"]
    ]


def median_closed(rows: Sequence[Row]) -> float | None:
    """Median share of the reducible gap closed on the hidden run."""
    found = [row["closed"] for row in material(rows)]
    return float(np.median(found)) if found else None


@dataclass(frozen=True)
class Reliability:
    """Named effects by stated probability: mean stated, share that act, number; a bin each.

    error: expected calibration error, None where nothing was named.
    """

    stated: tuple[float, ...]
    correct: tuple[Share, ...]
    error: float | None


def reliability(rows: Sequence[Row]) -> Reliability:
    """Over every effect named in every case, healthy and unknown ones too."""
    pairs = [(float(p), bool(hit)) for row in rows for p, hit in row["calibration"]]
    stated, correct, error = [], [], 0.0
    for index in range(BINS):
        inside = [(p, hit) for p, hit in pairs if min(int(p * BINS), BINS - 1) == index]
        if inside:
            stated.append(float(np.mean([p for p, _ in inside])))
            correct.append(Share(sum(hit for _, hit in inside), len(inside)))
            error += abs(sum(hit for _, hit in inside) - sum(p for p, _ in inside)) / len(pairs)
    return Reliability(tuple(stated), tuple(correct), error if pairs else None)


@dataclass(frozen=True)
class Limit:
    """How small an effect of one kind may be and still be found in half and in nine tenths of the singles.

    severity_*: 0 to 1; torque_*: share of the joint's torque that it moves; None where that is not reached.
    """

    cases: Share
    severity_half: float | None
    severity_most: float | None
    torque_half: float | None
    torque_most: float | None


def detection_limits(rows: Sequence[Row]) -> dict[str, Limit]:
    """By effect, of the single cases; found: named first, at its joint, or stated as confusable."""
    singles = [row for row in rows if row["kind"] == "single"]
    out = {}
    for name in sorted({row["effect"] for row in singles}):
        own = [row for row in singles if row["effect"] == name]
        hits = np.array([bool(row["right"]) for row in own])
        severity = np.array([row["severity"] for row in own])
        torque = np.array([row["moved"] for row in own])
        limits = [detection_limit(x, hits, level) for x in (severity, torque) for level in (0.5, 0.9)]
        out[name] = Limit(share(own, lambda r: r["right"]), *limits)
    return out


def detection_limit(size: Array, found: NDArray[np.bool_], level: float) -> float | None:
    """Smallest size from which a share of ``level`` is found, by isotonic regression; None if never."""
    order = np.argsort(size, kind="stable")
    rising = isotonic_regression(found[order].astype(float)).x
    above = np.flatnonzero(rising >= level)
    return float(size[order][above[0]]) if above.size else None


@dataclass(frozen=True)
class Rejections:
    """How often an effect was drawn, moved too little, stood beside one that did, made no robot to drive."""

    drawn: int
    little: int
    beside: int
    not_driven: int


def rejections(rows: Sequence[Row]) -> dict[str, Rejections]:
    """How often every effect was drawn, and drawn again, by name."""
    draws = [(name, why) for row in rows for name, why in row["draws"]]
    found = {}
    for name in sorted({name for name, _ in draws}):
        own = [why for each, why in draws if each == name]
        found[name] = Rejections(len(own), own.count(LITTLE), own.count(BESIDE), own.count(NOT_DRIVEN))
    return found


def unknown_by_effect(rows: Sequence[Row]) -> dict[str, tuple[Share, Share]]:
    """Of the effects that the diagnosis does not know: reported as unknown, and the joint right; by name."""
    unknown = [row for row in rows if row["kind"] == "unknown"]
    out = {}
    for name in sorted({row["effect"] for row in unknown}):
        own = [row for row in unknown if row["effect"] == name]
        joints = share(own, lambda r: r["where_joint"] == r["joint"])
        out[name] = share(own, lambda r: r["verdict"] == "unknown"), joints
    return out


def risk_and_coverage(rows: Sequence[Row]) -> tuple[Array, Array]:
    """Coverage and risk (K,) as ever less probable first names are believed, of all cases.

    coverage: share of cases that get a name. risk: share of those names that do not act.
    """
    named = sorted((row for row in rows if row["probability"] is not None), key=lambda r: -r["probability"])
    wrong = np.cumsum([not row["exact"] for row in named], dtype=float)
    count = np.arange(1, len(named) + 1)
    return count / max(len(rows), 1), wrong / count


def confusion(rows: Sequence[Row]) -> tuple[list[str], list[str], NDArray[np.int64]]:
    """Confusion matrix of single, healthy and unknown cases: true effects, first reported ones, and counts.

    Rows are the true effects, columns the reported ones.
    """

    def truth(row: Row) -> str:
        return str(row["effect"]) if row["kind"] == "single" else str(row["kind"])

    def said(row: Row) -> str:
        if row["first"] is None:
            return "nothing" if row["verdict"] in ("none", "parameters") else "unknown"
        return str(row["first"])

    chosen = [row for row in rows if row["kind"] in ("single", "none", "unknown")]
    last = ("none", "unknown")
    truths = sorted({truth(row) for row in chosen}, key=lambda name: (name in last, name))
    names = sorted(
        {said(row) for row in chosen} | {name for name in truths if name not in last},
        key=lambda name: (name in ("nothing", "unknown"), name),
    )
    counts = np.zeros((len(truths), len(names)), dtype=np.int64)
    for row in chosen:
        counts[truths.index(truth(row)), names.index(said(row))] += 1
    return truths, names, counts
