"""What the residual says: which parameters matter, and whether it looks like noise.

Residuals of a real arm are strongly coloured, so every test here counts independent samples (the
effective sample size), never rows.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import special

from .estimate import Estimate
from .observations import Observations
from .problem import Problem

Array = NDArray[np.float64]

# A p-value below this is an objection.
SIGNIFICANCE = 0.05
# Lags of the whiteness test.
LAGS = 10
# Cut-off periods in a lag: by then the low-pass leaves white noise an autocorrelation below 0.02.
PERIODS_A_LAG = 2
# Samples that the normality test needs.
SMALLEST_SAMPLE = 20


@dataclass(frozen=True)
class EssentialParameters:
    """The base parameters that the data cannot do without.

    kept: (k,) their indices, ascending. values: (b,), 0 where dropped. std: (b,), 0 where dropped.
    dropped: indices in the order in which they were dropped.
    p_value: of the F test of all that was dropped together; 1 where nothing was.
    """

    kept: NDArray[np.int64]
    values: Array
    std: Array
    dropped: tuple[int, ...]
    p_value: float


def essential_parameters(
    problem: Problem, estimate: Estimate, significance: float = SIGNIFICANCE
) -> EssentialParameters:
    """Drop the base parameter of largest %sigma, fit the rest anew, and so on until an F test objects.

    Pham, Gautier & Poignet (2001), "Identification of joint stiffness with bandpass filtering", section
    on essential parameters. The test is of everything dropped so far against the full fit,
    F = ((S_k - S_b) / (b - k)) / (S_b / (N - b)), with N the effective samples and S the sum of squares
    in units of each equation's own deviation at ``estimate``.
    """
    weights = problem.residual_weights(estimate.values)
    upper, norms = problem.weighted_triangle(weights)
    count = problem.base.count
    matrix, target = upper[:count, :count], upper[:count, -1]
    full = float(upper[-1, -1] ** 2)
    freedom = max(1.0, float(np.sum(problem.independent_samples(estimate.values))) - count)
    variance = full / freedom
    kept, dropped, p_value = list(range(count)), [], 1.0
    values, std = _fit(matrix, target, kept, variance)
    while len(kept) > 1:
        worst = kept[least_certain(values[kept], std[kept])]
        fewer = [index for index in kept if index != worst]
        fewer_values, fewer_std = _fit(matrix, target, fewer, variance)
        excess = float(np.sum((matrix @ fewer_values - target) ** 2))
        degrees = count - len(fewer)
        statistic = excess / degrees / max(variance, np.finfo(float).tiny)
        p = float(special.fdtrc(degrees, freedom, statistic))
        if p < significance:
            break
        kept, values, std, p_value = fewer, fewer_values, fewer_std, p
        dropped.append(worst)
    return EssentialParameters(np.array(kept), values / norms, std / norms, tuple(dropped), p_value)


def least_certain(values: Array, std: Array) -> int:
    """Index of the value (k,) that is least sure to be other than zero, by its deviation (k,)."""
    # Ascends with std over |value|, and is finite where a value is zero.
    return int(np.argmax(std / np.maximum(np.hypot(values, std), np.finfo(float).tiny)))


def _fit(matrix: Array, target: Array, kept: Sequence[int], variance: float) -> tuple[Array, Array]:
    """Least squares by the kept columns alone: values and deviations (b,), 0 elsewhere."""
    q, r = np.linalg.qr(matrix[:, kept])
    inverse = np.linalg.inv(r)
    values, std = np.zeros(matrix.shape[1]), np.zeros(matrix.shape[1])
    values[kept] = inverse @ (q.T @ target)
    std[kept] = np.sqrt(variance * np.sum(inverse**2, axis=1))
    return values, std


@dataclass(frozen=True)
class ResidualTests:
    """Whether the residual of each equation (joint) looks like white normal noise; each (e,).

    whiteness: p-value of the Ljung-Box test. normality: p-value of the D'Agostino-Pearson test.
    first_autocorrelation: at the first lag tested, two cut-off periods.
    independent_samples: effective sample size.
    A p-value is NaN where there are too few samples to test.
    """

    whiteness: Array
    normality: Array
    first_autocorrelation: Array
    independent_samples: Array


def residual_tests(problem: Problem, estimate: Estimate) -> ResidualTests:
    """Test the residual of every run together, equation by equation.

    Whiteness (Ljung & Box 1978) is tested on samples two cut-off periods apart, where the low-pass has
    left white noise uncorrelated; pairs with an unused sample do not count. Normality (D'Agostino &
    Pearson 1973) is tested on samples so far apart that they are independent.
    """
    _, inflation = problem.residual_std(estimate.values)
    whiteness, normality, first = (np.full(problem.equations, np.nan) for _ in range(3))
    for equation in range(problem.equations):
        residuals = [run.residual(estimate.values)[:, equation] for run in problem.observations]
        used = [run.used[:, equation] for run in problem.observations]
        steps = [
            _lag(run, problem.preprocessing.at(motion.sample_rate).cutoff)
            for run, motion in zip(problem.observations, problem.motions, strict=True)
        ]
        rho, pairs = _autocorrelation(
            [r[::step] for r, step in zip(residuals, steps, strict=True)],
            [u[::step] for u, step in zip(used, steps, strict=True)],
        )
        if len(rho) > 1:
            first[equation] = rho[1]
            whiteness[equation] = _ljung_box(rho, pairs)
        apart = int(np.ceil(inflation[equation]))
        normality[equation] = _dagostino_pearson(
            np.concatenate([r[::apart][u[::apart]] for r, u in zip(residuals, used, strict=True)])
        )
    return ResidualTests(whiteness, normality, first, problem.independent_samples(estimate.values))


def _lag(run: Observations, cutoff: float) -> int:
    """Decimated samples in one lag of the whiteness test."""
    return max(1, round(PERIODS_A_LAG * run.sample_rate / cutoff))


def _autocorrelation(series: Sequence[Array], used: Sequence[NDArray[np.bool_]]) -> tuple[Array, Array]:
    """Autocorrelation at lags 0..LAGS about zero, pooled over runs, and the pairs behind each.

    Lags with fewer pairs than LAGS are cut off.
    """
    products, pairs = np.zeros(LAGS + 1), np.zeros(LAGS + 1)
    for r, u in zip(series, used, strict=True):
        masked = np.where(u, r, 0.0)
        for lag in range(min(LAGS, len(r) - 1) + 1):
            products[lag] += masked[: len(r) - lag] @ masked[lag:]
            pairs[lag] += np.count_nonzero(u[: len(r) - lag] & u[lag:])
    enough = int(np.argmax(np.append(pairs < LAGS, True)))
    if enough == 0 or products[0] == 0:
        return np.empty(0), np.empty(0)
    rho = products[:enough] / pairs[:enough] / (products[0] / pairs[0])
    return rho, pairs[:enough]


def _ljung_box(rho: Array, pairs: Array) -> float:
    """p-value of Q = (N + 2) / N sum pairs_k rho_k²; without missing samples pairs_k = N - k.

    Ljung & Box weigh by N² / (N - k) where rho_k is a sum over N; here it is a mean over pairs_k.
    """
    samples = pairs[0]
    statistic = np.sum(pairs[1:] * rho[1:] ** 2) * (samples + 2) / samples
    return float(special.chdtrc(len(rho) - 1, statistic))


def _dagostino_pearson(sample: Array) -> float:
    """p-value of the omnibus test of skewness and kurtosis; NaN below SMALLEST_SAMPLE samples."""
    # Slow to import.
    from scipy.stats import normaltest

    if len(sample) < SMALLEST_SAMPLE or np.ptp(sample) == 0:
        return float("nan")
    return float(normaltest(sample).pvalue)
