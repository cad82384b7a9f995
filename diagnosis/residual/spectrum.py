"""Spectra of a residual: over time in bands of frequency, over position in cycles.

Unlike a set of samples, a part of a spectrum says nothing by being large: a gap that goes with the motion
lies where the motion does, noise is flat, and the largest of many lines is large by chance. So every part is
held against the share that it would have then.
"""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.fft import dct, idct

from ..data.run import Prepared, Run
from .intervals import drawn_sums, interval
from .shares import RegimeShare

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

# What the two spectra are called as aspects of a gap.
FREQUENCY, PERIODIC = "frequency", "period"
# Hz, where bands meet.
EDGES = (1.0, 5.0, 10.0)
# Positions are put into so many bins a turn (or metre); lines are resolved up to a tenth of that.
BINS, HIGHEST = 2048, 150.0
# A period must fit so often into the joint's range, and lines searched are this much finer than it resolves.
FEWEST_PERIODS, FINER = 2.0, 4
# Chance is the largest line of so many residuals whose blocks have been given signs at random.
BY_CHANCE = 20
# What is slow lies below the last of these edges that leaves noise a fourth beyond it.
MOST_OF_WHITE = 0.75
SMALLEST = np.finfo(float).tiny


def above_band(prepared: Prepared) -> Array:
    """RMS (n,) N·m (N) of the logged torque above each joint's band, over the samples that count."""
    squares, counts = np.zeros(prepared.joints), np.zeros(prepared.joints)
    for run in prepared.runs:
        above = run.logged.tau[run.kept] - run.filtered(run.logged.tau, range(prepared.joints))
        squares += np.sum(np.where(run.used, above, 0.0) ** 2, axis=0)
        counts += run.used.sum(axis=0)
    return np.sqrt(squares / np.maximum(counts, 1))


def band_shares(
    runs: Sequence[Run], joint: int, residual: Sequence[Array], used: Sequence[Mask], block: NDArray[np.int64]
) -> list[RegimeShare]:
    """A joint's residual by bands of frequency up to the low-pass and a little beyond.

    residual, used: a run, (M,). block: (K,) of the used samples of all runs. expected: the larger of the
    band's share in white noise that has passed the low-pass, and in the joint's own torque.
    """
    squares = _squares(runs, residual, used)
    torque = _squares(runs, [run.torque[:, joint] for run in runs], used)
    white = _white(runs, joint, used)
    expected = np.maximum(white, torque.sum(axis=0) / max(float(torque.sum()), SMALLEST))
    sums: Array = np.stack([np.bincount(block, column) for column in squares.T], axis=1)
    total = sums.sum(axis=0)
    share = total / max(float(total.sum()), SMALLEST)
    drawn = drawn_sums(sums)
    drawn /= np.maximum(drawn.sum(axis=1, keepdims=True), SMALLEST)
    found = []
    for index, name in enumerate(band_names()):
        low, high = interval(drawn[:, index])
        rms = float(np.sqrt(total[index] / max(len(squares), 1)))
        found.append(
            RegimeShare(FREQUENCY, name, name, float(share[index]), low, high, float(expected[index]), rms)
        )
    return found


def slow_share(
    runs: Sequence[Run], joint: int, residual: Sequence[Array], used: Sequence[Mask]
) -> tuple[float, float]:
    """The share of a joint's squared residual in its lower bands, and white noise's.

    Those are all but the highest, or fewer where the joint's own low-pass leaves noise little beyond them.
    residual, used: a run, (M,), some of it used.
    """
    squares = _squares(runs, residual, used).sum(axis=0)
    white = np.cumsum(_white(runs, joint, used))
    bands = max(int(np.sum(white <= MOST_OF_WHITE)), 1)
    return float(squares[:bands].sum() / max(float(squares.sum()), SMALLEST)), float(white[bands - 1])


def band_names() -> tuple[str, ...]:
    """The bands in words, from low to high."""
    between = [f"{a:g} to {b:g} Hz" for a, b in pairwise(EDGES)]
    return (f"below {EDGES[0]:g} Hz", *between, f"above {EDGES[-1]:g} Hz")


def kept_rate(run: Run) -> float:
    """Samples a second after decimation, Hz."""
    return run.logged.sample_rate / run.filters[0].step


def _in_bands(values: Array, used: Mask, rate: float) -> Array:
    """A series (M,) divided into bands, (M, bands), that add up to it where it is used.

    Bridged where it is not used, and mirrored at its ends by the cosine transform, lest steps there be taken
    for high frequencies.
    """
    index = np.arange(len(values))
    if not used.any():
        return np.zeros((len(values), len(EDGES) + 1))
    bridged = np.interp(index, index[used], values[used])
    band = np.digitize(index * rate / (2 * len(values)), EDGES)
    members = band[:, None] == np.arange(len(EDGES) + 1)
    return idct(dct(bridged, norm="ortho")[:, None] * members, axis=0, norm="ortho")


def _squares(runs: Sequence[Run], values: Sequence[Array], used: Sequence[Mask]) -> Array:
    """Squares of one series a run (M,), divided into bands, where it is used: (K, bands) of all runs."""
    parts = zip(runs, values, used, strict=True)
    return np.concatenate([_in_bands(each, u, kept_rate(run))[u] ** 2 for run, each, u in parts])


def _white(runs: Sequence[Run], joint: int, used: Sequence[Mask]) -> Array:
    """Each band's share of white noise behind the joint's low-pass, (bands,), where all runs are used."""
    weights = [float(u.sum()) for u in used]
    return np.average([_white_of(run, joint) for run in runs], axis=0, weights=weights)


def _white_of(run: Run, joint: int) -> Array:
    """The same of one run, all of it."""
    length = 1 << int(np.ceil(np.log2(8 * run.logged.sample_rate)))
    passed = np.abs(np.fft.rfft(run.filters[joint].taps, length)) ** 2
    band = np.digitize(np.fft.rfftfreq(length, 1 / run.logged.sample_rate), EDGES)
    shares = np.bincount(band, passed, minlength=len(EDGES) + 1)
    return shares / shares.sum()


def periodic_share(
    position: Array,
    velocity: Array,
    residual: Array,
    block: NDArray[np.int64],
    cutoff: float,
    slide: bool = False,
) -> RegimeShare | None:
    """The strongest period of a residual in its joint's position, by least squares at each number of cycles.

    position, velocity: (K,) rad and rad/s (m, m/s for a slide joint). residual: (K,) N·m. block: (K,).
    cutoff: Hz, of the residual. What is smooth in the position, or goes with its direction, is no period and
    is taken off first. expected: the largest line of residuals whose blocks are as they are but for random
    signs, so that nothing but the phases' agreement from block to block is judged. None where the joint's
    range holds no two periods, or its residual is nothing.
    """
    unit = 1.0 if slide else 2 * np.pi
    turns = (position - position.min()) / unit
    spread, total = float(np.ptp(turns)), float(residual @ residual)
    speed = float(np.sqrt(np.mean(velocity**2))) / unit
    if total == 0 or spread * HIGHEST < FEWEST_PERIODS or speed == 0:
        return None
    # Whole cycles are among the lines. A line beyond the low-pass at common speeds cannot be seen.
    finer = 1 << max(int(np.ceil(np.log2(FINER * spread))), 0)
    lowest, highest = FEWEST_PERIODS / spread, min(HIGHEST, cutoff / speed)
    lines = np.arange(int(np.ceil(lowest * finer)), int(highest * finer) + 1)
    if not len(lines):
        return None
    scaled = 2 * turns / spread - 1
    smooth = np.column_stack([np.polynomial.legendre.legvander(scaled, 3), np.sign(velocity)])
    left = residual - smooth @ np.linalg.lstsq(smooth, residual, rcond=None)[0]
    blocks = int(block.max()) + 1
    signs = np.random.default_rng(0).choice((-1.0, 1.0), (BY_CHANCE, blocks))
    trials = np.concatenate([left[None], left * signs[:, block]])
    explained = _explained((turns * BINS).astype(np.int64), trials, BINS * finer, lines)
    best = int(np.argmax(explained[0]))
    cycles = float(lines[best] / finer)
    wave = np.exp(2j * np.pi * cycles * turns)
    c, s = wave.real, wave.imag
    products = (left * c, left * s, c * c, c * s, s * s, residual**2)
    drawn = drawn_sums(np.stack([np.bincount(block, each) for each in products], axis=1))
    low, high = interval(_fitted(*drawn[:, :5].T) / np.maximum(drawn[:, 5], SMALLEST))
    share = float(explained[0, best]) / total
    words = f"position, {cycles:.3g} cycles per {'metre' if slide else 'revolution'}"
    chance = float(explained[1:].max()) / total
    rms = float(np.sqrt(share * total / len(residual)))
    return RegimeShare(PERIODIC, "in position", words, share, low, high, chance, rms, cycles)


def _explained(place: NDArray[np.int64], trials: Array, length: int, lines: NDArray[np.int64]) -> Array:
    """Sum of squares (T, L) that a sinusoid of each line fits of each trial (T, K), binned by place (K,)."""
    binned = np.stack([np.bincount(place, trial, minlength=length) for trial in trials])
    spectrum = np.fft.rfft(binned, axis=1)[:, lines].conj()
    doubled = np.fft.rfft(np.bincount(place, minlength=length).astype(float))[2 * lines].conj()
    half = len(place) / 2
    cc, ss, cs = half + doubled.real / 2, half - doubled.real / 2, doubled.imag / 2
    return _fitted(spectrum.real, spectrum.imag, cc, cs, ss)


def _fitted(rc: Array, rs: Array, cc: Array, cs: Array, ss: Array) -> Array:
    """Sum of squares that a cosine and a sine fit, from their products with the residual and each other."""
    determinant = np.maximum(cc * ss - cs**2, SMALLEST)
    return (ss * rc**2 - 2 * cs * rc * rs + cc * rs**2) / determinant
