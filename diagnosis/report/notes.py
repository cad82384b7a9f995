"""Notes of a diagnosis in sentences: how its runs differ, what they leave open, and what was mended."""

from collections.abc import Sequence

import numpy as np

from testbench.robot import Robot

from ..decision.findings import Diagnosis
from ..held_out.difference import Difference
from .words import listed, title

# A drive's gain is reported where its relative deviation is below this.
KNOWN = 0.05


def differences(found: Sequence[Difference], robot: Robot) -> list[str]:
    """Sentences on payload, offsets or friction in which runs differ; empty where they are alike."""
    names, units, said = robot.joint_names, robot.units(), []
    if known := [each for each in found if each.gains is not None]:
        said.append(_gains_in_words(known, names))
    weighed = [(each.run, each.mass) for each in found if each.mass is not None and each.gains is None]
    if weighed:
        (first, own), *others = weighed
        carried = [f"{first} carries {own.value:.3g} ± {own.std:.1g} kg"]
        carried += [f"{run} {mass.value:.3g} ± {mass.std:.1g} kg" for run, mass in others]
        said.append(f"{', '.join(carried)} that other runs do not; it is taken off before the fit.")
    for each in found:
        if each.friction is not None:
            largest = int(np.argmax(np.abs(each.friction[1])))
            more = f"{each.friction[1, largest]:+.3g} {units[largest]} at {names[largest]}"
            said.append(
                f"{each.run} has other friction than other runs, Coulomb {more}, as warm or cold joints "
                "have; it is taken off before the fit."
            )
        elif each.mass is None:
            largest = int(np.argmax(np.abs(each.offsets)))
            said.append(
                f"{each.run} has other offsets of torque than other runs, {each.offsets[largest]:.3g} "
                f"{units[largest]} at {names[largest]}; they are taken off before the fit."
            )
    return said


def _gains_in_words(known: Sequence[Difference], names: Sequence[str]) -> str:
    """The drives' gains by payloads of known masses, which determine them together."""
    gains, deviations = known[0].gains, known[0].deviations
    assert gains is not None
    assert deviations is not None
    found = [
        f"{names[j]} {1 + gains[j]:.3f} ± {deviations[j]:.1g}"
        for j in np.flatnonzero(deviations < KNOWN).tolist()
    ]
    carried = " and ".join(
        f"the {each.mass.value:g} kg that {each.run} carries" for each in known if each.mass
    )
    by = f"true over reported torque is {', '.join(found)}" if found else "no drive's gain is determined"
    return f"By {carried}, {by}."


def late(diagnosis: Diagnosis) -> list[str]:
    """By how much the logs had their torque late, and that it was taken back; nothing where they had not."""
    lag = diagnosis.prepared.lag
    if lag.seconds == 0:
        return []
    through = f", as through a low-pass at {lag.corner:.3g} Hz" if lag.order else ""
    how_late = f"{1e3 * lag.seconds:.3g} ms late against the positions{through}"
    return [f"The logs have all torque {how_late}; it was taken back."]


def silent(diagnosis: Diagnosis) -> list[str]:
    """The joints whose torque the logs do not have; nothing where they have all."""
    names = [diagnosis.robot.joint_names[joint] for joint in sorted(diagnosis.prepared.silent)]
    said = f"The logged torque of {', '.join(names)} never changes: nothing can be said of it."
    return [said] if names else []


def too_little_motion(diagnosis: Diagnosis) -> list[str]:
    """The joints that move too little for an effect to be reported, and why; empty where all move enough."""
    names, said = diagnosis.robot.joint_names, []
    if still := [names[joint] for joint in sorted(diagnosis.prepared.still)]:
        stay = "it stays as the model has it" if len(still) == 1 else "they stay as the model has them"
        said.append(f"In these runs {listed(still)} stood still: {stay}.")
    if short := [names[joint] for joint in diagnosis.too_little_motion]:
        said.append(f"These runs hold too few seconds of motion for a name at {listed(short)}.")
    if sines := [names[joint] for joint in sorted(diagnosis.one_sine)]:
        place = "every joint" if len(sines) == len(names) else listed(sines)
        said.append(
            f"One sine at {place}: inertia, gravity and springs there are collinear. "
            "Record a motion of several frequencies."
        )
    return said


def everywhere(diagnosis: Diagnosis) -> list[str]:
    """Sentence on fitted effects that are not reported, as other joints have them too; empty without any."""
    places: dict[str, list[str]] = {}
    for name, joint in sorted(diagnosis.everywhere, key=str):
        assert joint is not None
        places.setdefault(name, []).append(diagnosis.robot.joint_names[joint])
    named = "; ".join(f"{title(name)} ({', '.join(joints)})" for name, joints in places.items())
    return [f"Fitted, but no one joint's fault, since others are as imperfect: {named}."] if named else []


def mended(diagnosis: Diagnosis) -> list[str]:
    """The samples that were lost on the way to the log; nothing where none were."""
    lost = [f"{count} of {name}" for name, count in diagnosis.mended.items()]
    return [f"Samples held or spoiled, and interpolated: {', '.join(lost)}."] if lost else []


def recurrence(diagnosis: Diagnosis) -> list[str]:
    """Sentence on a push that every run has, and so predictions have; empty where there is none."""
    if diagnosis.recurrence is None:
        return []
    shape = diagnosis.recurrence.pushed.member.shape
    when = f"from {shape['first']:.2f} to {shape['last']:.2f} s"
    return [f"The push comes in every run alike, {when}: predictions along other logs repeat it."]


def noise_unseen(diagnosis: Diagnosis) -> list[str]:
    """The joints whose noise floor is a bound, since their logs were low-passed; nothing where none was."""
    names = [diagnosis.robot.joint_names[joint] for joint in np.flatnonzero(diagnosis.gap.unseen)]
    if not names:
        return []
    place = "all joints" if len(names) == len(diagnosis.robot.joint_names) else ", ".join(names)
    return [
        f"The torque of {place} was low-passed before it was logged: its noise is at most the stated floor."
    ]


def near_rest(diagnosis: Diagnosis) -> list[str]:
    """Sentences on friction near rest: soft joints, friction that turns ahead."""
    names, width = diagnosis.robot.joint_names, diagnosis.prepared.coulomb_smoothing
    soft = [f"{names[joint]} {width[joint]:.2g}" for joint in np.flatnonzero(width).tolist()]
    law = "Coulomb friction is soft near rest, fc tanh(v / w) with w in rad/s (m/s)"
    said = [f"{law}: {', '.join(soft)}."] if soft else []
    if (lead := diagnosis.prepared.coulomb_lead) > 0:
        ahead = f"All Coulomb friction changes sign {1e3 * lead:.1f} ms ahead of the joints"
        said.append(f"{ahead}, as a soft constraint has it: these logs seem to be of MuJoCo's frictionloss.")
    return said
