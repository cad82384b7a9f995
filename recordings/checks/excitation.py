"""Check of the excitation: joints whose motion identifies too little, and a motion that would do."""

import numpy as np

from identification.single_sine import sine_frequency

from .finding import Finding, Severity
from .samples import MOVING, Samples
from .subject import Subject

STAGE = 3

# Frequencies of joints that are one.
SAME = 0.05
# A joint that moves one way in all but this share of its moving samples.
ONE_WAY = 0.02
# Share of a range that is little, of joints with a range; rad (m) of the others.
LITTLE, LITTLE_WAY = 0.05, 0.1
# s of motion, all runs together, that are too short.
SHORT = 10.0
FEWEST = 12


def check(subject: Subject) -> list[Finding]:
    """Joints that stand still, sines of one frequency, ways that are short or go one way alone."""
    samples = subject.samples
    if samples is None:
        return [
            Finding(
                Severity.WARN, "short", "The runs are too short to check signs, order and scale: record 10 s"
            )
        ]
    found = []
    moving = np.flatnonzero(samples.moves.sum(axis=0) >= FEWEST).tolist()
    still = [joint for joint in range(subject.robot.joints) if joint not in moving]
    if still:
        names = subject.names(still)
        stood = (
            "stood still: its parameters stay" if len(still) == 1 else "stood still: their parameters stay"
        )
        sentence = f"{', '.join(names)} {stood} as the model has them; move each over most of its range"
        found.append(Finding(Severity.WARN, "still", sentence, names))
    found += _sines(subject, samples, moving)
    found += _ways(subject, samples, moving)
    if samples.seconds < SHORT:
        sentence = (
            f"{samples.seconds:.2g} s are little: inertias stay as the model has them; record a motion of "
            "20 s with several frequencies, as testbench excite designs"
        )
        found.append(Finding(Severity.NOTE, "short", sentence))
    return found


def _sines(subject: Subject, samples: Samples, moving: list[int]) -> list[Finding]:
    """Joints that swing at one frequency, in every run in which they move."""
    hertz: dict[int, list[float]] = {}
    for joint in moving:
        frequencies = [_frequency(samples, joint, run) for run in np.unique(samples.run).tolist()]
        known = [each for each in frequencies if each is not None]
        # One run that is no sine is enough.
        if known and all(each > 0 for each in known):
            hertz[joint] = known
    if not hertz:
        return []
    names = subject.names(list(hertz))
    everything = np.concatenate(list(hertz.values()))
    if list(hertz) == moving and everything.max() < (1 + SAME) * everything.min():
        where = "of one frequency on every joint" if len(moving) > 1 else f"at {names[0]}"
        whose = f"One sine {where} ({everything.mean():.2g} Hz)"
    elif list(hertz) == moving:
        values = ", ".join(dict.fromkeys(f"{value:.2g}" for value in np.sort(everything)))
        whose = f"One sine on every joint in each run ({values} Hz)"
    else:
        each = ", ".join(
            f"{name} ({hertz[joint][0]:.2g} Hz)" for name, joint in zip(names, hertz, strict=True)
        )
        whose = f"One sine alone at {each}"
    sentence = (
        f"{whose}: inertia and gravity there can hardly be distinguished; record several frequencies, as "
        "testbench excite designs"
    )
    return [Finding(Severity.WARN, "one_sine", sentence, names)]


def _frequency(samples: Samples, joint: int, run: int) -> float | None:
    """Hz of the one sine that a joint follows in a run; 0 where it is none, None where it stands still."""
    own = samples.run == run
    if np.count_nonzero(samples.moves[own, joint]) < FEWEST:
        return None
    return sine_frequency(samples.time[own], samples.q[own, joint]) or 0.0


def _ways(subject: Subject, samples: Samples, moving: list[int]) -> list[Finding]:
    """Joints that move one way alone, or hardly."""
    found = []
    one_way = [
        joint
        for joint in moving
        if min(np.mean(samples.dq[:, joint] > MOVING), np.mean(samples.dq[:, joint] < -MOVING))
        < ONE_WAY * np.mean(samples.moves[:, joint])
    ]
    if one_way:
        names = subject.names(one_way)
        sentence = f"{', '.join(names)} moved one way alone: friction and offset there cannot be"
        found.append(Finding(Severity.WARN, "one_way", f"{sentence} distinguished; move it both ways", names))
    limits = subject.robot.limits
    way = np.ptp(samples.q, axis=0)
    span = limits.upper - limits.lower
    least = np.where(np.isfinite(span), LITTLE * span, LITTLE_WAY)
    little = [joint for joint in moving if way[joint] < least[joint]]
    if little:
        names = subject.names(little)
        each = ", ".join(
            f"{name} {way[joint]:.2g} {'m' if subject.robot.chain.is_slide[joint] else 'rad'}"
            for name, joint in zip(names, little, strict=True)
        )
        sentence = f"Short ways: {each}; gravity there can hardly be distinguished from offsets"
        found.append(Finding(Severity.NOTE, "short_way", sentence, names))
    return found
