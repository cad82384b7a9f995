"""A diagnosis read in Python: verdict, effects, how far the gap shrinks, what to run next.

The logs are of a simulated arm whose elbow has a ripple that its model lacks; put yours in their place.
``python examples/read_a_diagnosis.py FOLDER`` leaves corrected.xml.
"""

import sys
from pathlib import Path

import numpy as np

import testbench

MODEL = Path(__file__).parent / "two_joint_arm.xml"


def main(folder: Path) -> testbench.DiagnosisResult:
    """Diagnose two runs, and predict the torque of a third that the diagnosis never saw."""
    robot = testbench.load_robot(MODEL)
    one, two, unseen = (record(robot, seed) for seed in range(3))

    why = testbench.diagnose(robot, {"one": one, "two": two})
    print(why.verdict, "-", why.sentence)
    for effect in why.effects:
        where = "the whole robot" if effect.joint is None else robot.joint_names[effect.joint]
        print(f"{effect.effect} at {where}: {effect.probability:.0%}")
        for name, value in effect.parameters.items():
            print(f"  {name} = {value.value} ± {value.std} {value.unit}")
    for joint, name in enumerate(robot.joint_names):
        before, after = why.gap.nominal[joint], why.gap.effects[joint]
        print(f"{name}: torque error {before:.3g} N·m as given, {after:.3g} N·m corrected")

    experiment = why.next_experiment()
    print("next:", "nothing is open" if experiment is None else experiment.why)

    torque = testbench.predict(why, unseen)
    assert torque.measured is not None
    error = np.sqrt(np.mean((torque.measured - torque.torque.corrected) ** 2, axis=0))
    print("error on a run that was not diagnosed, N·m:", error.round(3))
    testbench.export(why, folder / "corrected.xml")
    return why


def record(robot: testbench.Robot, seed: int) -> testbench.Recording:
    """Stand in for the real arm: a motion of its own for each seed."""
    motion = testbench.excite(robot, harmonics=4, base_frequency=0.25, starts=1, iterations=20, seed=seed)
    return testbench.simulate(robot, motion, effects=["transmission_ripple:elbow"], periods=1, seed=seed)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
