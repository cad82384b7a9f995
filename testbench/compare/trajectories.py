"""Which kind of trajectory: how informative its designs are, and the parameters found from them."""

from identification.base_parameters import base_parameters
from identification.estimators import estimate
from identification.excitation.design import DesignOptions, design_excitation
from identification.excitation.trajectories import TRAJECTORIES, trajectory_from_dict

from ..jobs.excite import design_room
from .case import Case, Row
from .experiment import accuracy, experiment, robot_of, scenario_of, timed

METRICS = ("minus_logdet", "condition_number", "prediction_error", "parameter_error", "seconds")


def choices() -> tuple[str, ...]:
    """Every kind of trajectory."""
    return tuple(sorted(TRAJECTORIES))


def run(case: Case) -> Row:
    """One design of one kind, from one start, and the identification along it."""
    scenario, robot = scenario_of(case), robot_of(case)
    section = scenario.excitation
    options = DesignOptions(
        trajectory=case.choice,
        harmonics=section.harmonics,
        base_frequency=section.base_frequency,
        groups=scenario.identification.parameters,
        starts=section.starts,
        limit_share=section.limit_share,
        seed=case.seed,
    )
    room = design_room(robot, section.limit_share, section.velocity_limit, section.clearance)
    # Loads compiled kernels, so that the design is timed alone.
    base_parameters(robot.chain)
    design, seconds = timed(
        lambda: design_excitation(
            robot.chain, robot.parameters, room.limits, section.criterion, options, room.clearance, threads=1
        )
    )
    known = experiment(case, design.trajectory, trajectory_from_dict(case.settings["validation"]))
    found = estimate(known.problem, scenario.identification.estimator)
    return accuracy(found, known) | {
        "seconds": seconds,
        "evaluations": design.evaluations,
        "minus_logdet": design.values.logdet,
        "slack": design.values.slack,
        "condition_number": design.values.condition_number,
        "limits_kept": int(design.margins.kept),
    }
