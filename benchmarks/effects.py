"""Simulated runs of a robot with a background on every joint and three effects, against one without any."""

import os
from dataclasses import replace

from testbench.background import background
from testbench.effects import injection
from testbench.simulation import SensorOptions, SimulationOptions, sample_reference, simulate

from ._arms import random_motion, tx90
from ._report import Goal, Report
from ._timing import alternate

RATE, ROUNDS = 1000.0, 7
# The physics step that scenarios use.
PLAIN = SimulationOptions(
    sensors=SensorOptions(encoder_bits=17, torque_noise=0.01), physics_timestep=1 / (5 * RATE)
)
EFFECTS = (("joint_elasticity", 2), ("backlash", 3), ("presliding_hysteresis", 1))


def measure() -> Report:
    robot, cores = tx90(), os.cpu_count() or 1
    runs = 4 * cores
    references = [sample_reference(random_motion(), RATE)] * runs
    seconds = runs * (references[0].samples - 1) / RATE
    healthy = background(robot, 0)
    three = tuple(injection(robot, name, joint) for name, joint in EFFECTS)
    ways = {
        "no effects": PLAIN,
        "background on every joint": replace(PLAIN, effects=healthy.effects, sensors=healthy.sensors),
        "background and three effects": replace(
            PLAIN, effects=healthy.effects + three, sensors=healthy.sensors
        ),
    }
    rivals = {
        name: lambda options=options: simulate(robot, references, options) for name, options in ways.items()
    }
    times = alternate(rivals, ROUNDS)
    rows = tuple(
        (
            name,
            str(len(options.effects)),
            f"{times.median(name):.3f}",
            f"{seconds / times.median(name):.0f}",
            f"{times.speedup(name, 'no effects'):.2f}",
        )
        for name, options in ways.items()
    )
    share = 1 / times.speedup("background and three effects", "no effects")
    return Report(
        columns=("robot", "effects", "s", "times real time", "times as long as without"),
        rows=rows,
        goals=(Goal("throughput with background and three effects, share of that without", share, 0.5),),
        notes=(
            f"TX-90, {runs} runs on {cores} cores, physics at 5 kHz.",
            f"The three: {', '.join(f'{name} on joint {joint}' for name, joint in EFFECTS)}.",
        ),
    )
