"""Effects and their signatures: the torque that each adds along one motion, over what it follows.

``python examples/effects_and_signatures.py FOLDER`` leaves a picture of each effect. An exact encoder and no
noise, so that two runs differ by the effect alone.
"""

import sys
from pathlib import Path

import numpy as np
import plotly.graph_objects as go

import testbench

MODEL = Path(__file__).parent / "two_joint_arm.xml"
JOINT = 1
# An effect of the catalogue at the elbow, and what its torque follows there.
EFFECTS = {
    "stribeck_friction:elbow:extra=2,velocity=0.2": "velocity, rad/s",
    "transmission_ripple:elbow": "position, rad",
    "cable_spring:elbow": "position, rad",
}


def main(folder: Path) -> dict[str, float]:
    """Write a picture of each effect; the RMS that it adds to the elbow's torque, N·m, by its name."""
    robot = testbench.load_robot(MODEL)
    motion = testbench.excite(robot, harmonics=4, base_frequency=0.25, starts=1, iterations=20)
    without = exact(robot, motion)
    added = {}
    for effect, label in EFFECTS.items():
        run = exact(robot, motion, effect)
        torque = (run.torque - without.torque)[:, JOINT]
        name = effect.partition(":")[0]
        added[name] = float(np.sqrt(np.mean(torque**2)))
        print(f"{name}: {added[name]:.2g} N·m RMS")
        velocity = np.gradient(run.position[:, JOINT], run.time)
        follows = velocity if label.startswith("velocity") else run.position[:, JOINT]
        figure = go.Figure(go.Scattergl(x=follows, y=torque, mode="markers", marker={"size": 3}))
        figure.update_layout(title=name, xaxis_title=label, yaxis_title="added torque, N·m")
        figure.write_html(folder / f"{name}.html")
    return added


def exact(robot: testbench.Robot, motion: testbench.Motion, *effects: str) -> testbench.Recording:
    """A run of exact sensors along one period."""
    return testbench.simulate(robot, motion, effects=effects, periods=1, encoder_bits=0, torque_noise=0.0)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
