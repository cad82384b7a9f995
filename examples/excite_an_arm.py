"""An excitation for an arm like a UR: within its limits, clear of itself and the floor.

``python examples/excite_an_arm.py FOLDER`` leaves motion.json for your controller, set points at 125 Hz as
set_points.csv, and motion.html.
"""

import sys
from pathlib import Path

import numpy as np

import testbench

MODEL = Path(__file__).parent / "ur_like_arm.xml"
# Hz, of the set points.
RATE = 125.0


def main(folder: Path, starts: int = 3, iterations: int = 100) -> testbench.Motion:
    """Design the motion, show its peaks beside the limits, and write it. iterations: of each start."""
    robot = testbench.load_robot(MODEL)
    motion = testbench.excite(robot, starts=starts, iterations=iterations, clearance=0.02)
    values, peaks = motion.excitation.values, motion.excitation.margins.peaks
    print(f"condition number {values.condition_number:.3g}")
    for joint, name in enumerate(robot.joint_names):
        speed, limit = peaks.velocity[joint], robot.limits.velocity[joint]
        print(f"{name}: {speed:.2f} of {limit:.2f} rad/s")

    testbench.export(motion, folder / "motion.json")
    trajectory = motion.excitation.trajectory
    time = np.arange(0.0, trajectory.duration, 1 / RATE)
    position, _, _ = trajectory.evaluate(time)
    header = ",".join(["time", *robot.joint_names])
    np.savetxt(folder / "set_points.csv", np.column_stack([time, position]), "%.9g", ",", header=header)
    motion.plot().write_html(folder / "motion.html")
    return motion


if __name__ == "__main__":
    main(Path(sys.argv[1]))
