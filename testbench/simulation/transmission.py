"""A joint split into motor and link, joined by a spring with damping and play.

    I_m dv_m = drive - friction - s,   s = K w + D dw/dt,   w = (q_m - q_l) without the play,

with the rotor's inertia I_m; MuJoCo carries the link, driven by s (Spong, "Modeling and control of
elastic joint robots", J. Dyn. Sys. 1987). The motor steps like MuJoCo's links do, v+ = v + h a(q),
q+ = q + h v+. Explicit, that is stable for small h only. With s divided by 1 + h d / 2 + (h w0 / 2)²
(w0² = K / I, d = D / I, I the reduced inertia) it is stable for any K and D, an undamped swing keeps
its energy and has the frequency of the trapezoidal rule, and the error is of second order in h.
"""

from identification.kinematics import kernel

# A contact without a compliance of its own: the rotor swings against a locked link with this frequency.
CONTACT_FREQUENCY = 60.0  # Hz
CONTACT_DAMPING_RATIO = 0.3


@kernel
def spring_torque(
    windup: float,
    rate: float,
    stiffness: float,
    damping: float,
    half_gap: float,
    compliance: float,
    timestep: float,
) -> float:
    """Torque s that the transmission carries, N·m.

    windup: q_m - q_l, rad. rate: of the windup, rad/s. half_gap: play to each side, rad.
    compliance: 1/I_m + 1/I_l, the inverse of the reduced inertia.
    """
    wound = windup
    if half_gap > 0.0:
        if windup > half_gap:
            wound = windup - half_gap
        elif windup < -half_gap:
            wound = windup + half_gap
        else:
            return 0.0
    slow = 1.0 + timestep * compliance * (0.5 * damping + 0.25 * timestep * stiffness)
    torque = (stiffness * wound + damping * rate) / slow
    # Teeth push and never pull.
    if half_gap > 0.0 and torque * wound < 0.0:
        return 0.0
    return torque


@kernel
def motor_friction(velocity: float, force: float, level: float, inertia: float, timestep: float) -> float:
    """Coulomb friction on the motor in this step: what stops it, within ± level; N·m.

    force: every other torque on the motor.
    """
    stopping = force + inertia * velocity / timestep
    if stopping > level:
        return level
    if stopping < -level:
        return -level
    return stopping
