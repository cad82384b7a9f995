"""One step of a bristle, the state behind presliding friction.

    dz/dt = v - a stiffness |v| z / level,

which is Dahl's model for a = 1 (Dahl, "A solid friction model", 1968), LuGre where the level falls with
speed (Canudas de Wit, Olsson, Åström & Lischinsky, IEEE TAC 40(3), 1995), and the elasto-plastic model
where a = 0 up to a breakaway deflection (Dupont, Hayward, Armstrong & Altpeter, IEEE TAC 47(5), 2002).
For a velocity held over the step the solution is exponential and exact, so any stiffness is stable. So is
that of Dahl's model with another exponent (Dahl, "Solid friction damping of mechanical vibrations", AIAA
Journal 14(12), 1976),

    dz/dt = v (1 - sgn(v) stiffness z / level)^exponent,

below one of a bristle that hardly gives before it breaks, above one of one that gives long.
"""

import numpy as np
from numpy.typing import NDArray

from identification.kinematics import kernel

Array = NDArray[np.float64]


@kernel
def bristle_step(
    deflection: float, velocity: float, level: float, stiffness: float, slipping: float, timestep: float
) -> float:
    """Deflection z after ``timestep``, in the unit of the joint's position.

    level: N·m, of friction when sliding. stiffness: N·m/rad. slipping: a, from 0 (elastic) to 1.
    """
    if level <= 0.0:
        return 0.0
    path = velocity * timestep
    if slipping <= 0.0:
        moved = deflection + path
    else:
        steady = np.sign(velocity) * level / (slipping * stiffness)
        moved = steady + (deflection - steady) * np.exp(-abs(path) * slipping * stiffness / level)
    # Friction never exceeds its level, even where that has just fallen.
    limit = level / stiffness
    return min(max(moved, -limit), limit)


@kernel
def dahl_step(
    deflection: float, velocity: float, level: float, stiffness: float, exponent: float, timestep: float
) -> float:
    """The same of Dahl's bristle with an exponent."""
    if exponent == 1.0 or level <= 0.0:
        return bristle_step(deflection, velocity, level, stiffness, 1.0, timestep)
    sign, limit = np.sign(velocity), level / stiffness
    # What is left to yield, as a share of the level: as much as two where the motion has just turned.
    left = 1.0 - sign * deflection / limit
    moved = deflection
    if sign != 0.0 and left > 0.0:
        powered = left ** (1.0 - exponent) + (exponent - 1.0) * abs(velocity) * timestep / limit
        left = powered ** (1.0 / (1.0 - exponent)) if powered > 0.0 else 0.0
        moved = sign * limit * (1.0 - left)
    return min(max(moved, -limit), limit)


@kernel
def unit_bristle(velocity: Array, displacement: Array, exponent: float, timestep: float, out: Array) -> None:
    """out (N, d): friction per unit of level along a velocity (N,), for each presliding displacement (d,).

    displacement: level / stiffness, rad. exponent: of ``dahl_step``. The bristle starts relaxed; velocities
    lie half a step apart from deflections, so the mean of two samples moves it.
    """
    for k in range(displacement.size):
        deflection = 0.0
        out[0, k] = 0.0
        for t in range(1, velocity.size):
            middle = 0.5 * (velocity[t - 1] + velocity[t])
            deflection = dahl_step(deflection, middle, 1.0, 1.0 / displacement[k], exponent, timestep)
            out[t, k] = deflection / displacement[k]
