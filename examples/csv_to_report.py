"""Your own CSV to a report: the columns are guessed, the runs checked, the arm identified.

Degrees, milliseconds and column names are as some controller wrote them; nothing is converted by hand.
``python examples/csv_to_report.py FOLDER`` leaves report.html and estimate.json in FOLDER/report.
"""

import sys
from pathlib import Path

import numpy as np

import testbench

MODEL = Path(__file__).parent / "two_joint_arm.xml"


def main(folder: Path) -> testbench.IdentificationResult:
    """Identify the arm by the first CSV, and judge it by the second."""
    robot = testbench.load_robot(MODEL)
    for seed, name in enumerate(("monday", "tuesday")):
        record_csv(robot, folder / f"{name}.csv", seed)

    runs = testbench.read_logs([folder / "monday.csv", folder / "tuesday.csv"], robot)
    for finding in testbench.check(robot, runs):
        print(finding.severity, finding.run, finding.sentence)
    found = testbench.identify(robot, {"monday": runs["monday"]}, validate={"tuesday": runs["tuesday"]})
    testbench.export(found, folder / "report")
    testbench.export(found, folder / "identified.xml")

    for joint, fit in zip(robot.joint_names, found.validations[0].relative, strict=True):
        print(f"{joint}: torque of the other run is predicted to {100 * fit:.2g} %")
    return found


def record_csv(robot: testbench.Robot, path: Path, seed: int) -> None:
    """Stand in for the controller: drive the simulated arm, and write what it measured as a CSV."""
    motion = testbench.excite(robot, harmonics=4, base_frequency=0.25, starts=1, iterations=20, seed=seed)
    run = testbench.simulate(robot, motion, seed=seed)
    names = robot.joint_names
    header = ["timestamp_ms", *(f"{n}_pos_deg" for n in names), *(f"{n}_torque" for n in names)]
    table = np.column_stack([1e3 * run.time, np.degrees(run.position), run.torque])
    np.savetxt(path, table, delimiter=",", header=",".join(header), comments="", fmt="%.9g")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
