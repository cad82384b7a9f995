"""Parser of column names: their unit, their quantity, whether measured or commanded."""

import re
from collections.abc import Collection, Sequence
from dataclasses import dataclass

from ..units import known_unit


def _words(text: str) -> frozenset[str]:
    return frozenset(text.split())


# Words by quantity; where a name has several, the first quantity here that has one of them.
QUANTITY_WORDS = {
    "temperature": {"temp", "temps", "temperature", "temperatures"},
    "current": {"current", "currents", "cur", "curr", "amps", "amperage"},
    "voltage": {"voltage", "voltages", "volt", "volts"},
    "duty": {"pwm", "duty", "load"},
    "acceleration": {"ddq", "qdd", "acc", "accel", "acceleration", "accelerations", "qacc"},
    "torque": {
        "tau",
        "torque",
        "torques",
        "effort",
        "efforts",
        "eff",
        "moment",
        "trq",
        "tor",
        "force",
        "forces",
    },
    "velocity": {"dq", "qd", "vel", "vels", "velocity", "velocities", "speed", "speeds", "qvel", "dtheta"},
    "position": {"q", "pos", "poss", "position", "positions", "angle", "angles", "theta", "qpos", "state"},
}
# Words of what was asked for, and those that may say so beside a quantity alone.
REFERENCE_WORDS = _words(
    """
    target targets des desired ref reference references goal goals cmd command commands commanded
    setpoint setpoints sp action actions output d
    """
)
MEASURED_WORDS = {
    "actual",
    "act",
    "present",
    "measured",
    "meas",
    "feedback",
    "fb",
    "state",
    "observation",
    "obs",
}
# Words of what is no signal of a joint's drive.
OTHER_WORDS = _words(
    """
    error err errors ext external tcp pose cartesian cart imu gripper finger fingers wheel wheels base
    index seq count id enable enabled status mode flag limit limits dtau std
    model gravity coriolis wrench success rate
    """
)
# Words of what is no joint's where a name has neither a joint nor a number.
ALONE_WORDS = frozenset({"robot", "main", "input", "supply", "bus"})
TIME_WORDS = {
    "time",
    "timestamp",
    "timestamps",
    "stamp",
    "stamps",
    "t",
    "ts",
    "clock",
    "elapsed",
    "secs",
    "sec",
}
BESIDE_TIME = {
    "header",
    "field",
    "ros",
    "unix",
    "epoch",
    "system",
    "receive",
    "received",
    "sample",
    "log",
    "robot",
}

_REFERENCE_QUANTITY = {
    "position": "reference_position",
    "velocity": "reference_velocity",
    "acceleration": "reference_acceleration",
    "torque": "torque_command",
}
_BRACKETS = re.compile(r"\s*[\[({]([^\[\](){}]*)[\])}]\s*$")
_PARTS = re.compile(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+|\d+|[°µ%]+")
# Units that a name may end with, without brackets; shorter ones are as likely words.
_ENDINGS = _words(
    """
    deg degs degree degrees rad rads radians mrad mm ms us ns msec usec nsec sec secs seconds nm mnm ma
    turns revs rpm percent pct dps rps
    """
)
_SECONDS_ENDINGS = {("s",), ("per", "s"), ("per", "sec")}


@dataclass(frozen=True)
class Name:
    """A name as lower-case words and numbers, and the unit that it states, or an empty one."""

    words: tuple[str, ...]
    unit: str


def parsed(text: str) -> Name:
    """A name in parts: at capitals, digits and anything else that is no letter; its unit set apart."""
    unit = ""
    bracket = _BRACKETS.search(text)
    if bracket is not None and known_unit(bracket[1]):
        unit, text = known_unit(bracket[1]), text[: bracket.start()]
    words = [part.lower() for part in _PARTS.findall(text)]
    if not unit:
        words, unit = _unit_at_end(words)
    return Name(tuple(words), unit)


def _unit_at_end(words: list[str]) -> tuple[list[str], str]:
    """The words without a unit that they end with, and it."""
    for ending in sorted(_SECONDS_ENDINGS, key=len, reverse=True):
        count = len(ending)
        if len(words) > count + 1 and tuple(words[-count:]) == ending and words[-count - 1] in _ENDINGS:
            return words[: -count - 1], known_unit(f"{words[-count - 1]}/s")
    if len(words) > 1 and words[-1] in _ENDINGS and known_unit(words[-1]):
        return words[:-1], known_unit(words[-1])
    if len(words) == 2 and words[0] in TIME_WORDS and words[1] == "s":
        return words[:1], "s"
    return words, ""


def is_time(words: Sequence[str]) -> bool:
    """Whether a name may be of time stamps."""
    given = set(words)
    return bool(given & TIME_WORDS) and given <= TIME_WORDS | BESIDE_TIME


def quantity_word(words: Sequence[str]) -> str:
    """The quantity that the words name, or an empty one."""
    return next((name for name, known in QUANTITY_WORDS.items() if set(words) & known), "")


def quantity_of(words: Sequence[str], context: Collection[str] = ()) -> tuple[str, str]:
    """The quantity of a signal with these words in its name, without its joint's; and why, or why none.

    context: words of its topic, which may say that it was asked for.
    """
    given = set(words)
    other = sorted(given & OTHER_WORDS)
    if other:
        return "", f"{other[0]!r} is no signal of a joint's drive"
    asked = sorted(given & REFERENCE_WORDS) or sorted(
        set(context) & (REFERENCE_WORDS - {"d", "output", "action"})
    )
    kind = quantity_word([word for word in words if word not in MEASURED_WORDS]) or quantity_word(words)
    if not kind:
        if asked and given <= REFERENCE_WORDS | MEASURED_WORDS | {"joint", "joints"}:
            return "reference_position", f"{asked[0]!r} without a quantity is where to go"
        if not given - {"joint", "joints", "j", "motor", "motors", "column", "dof", *MEASURED_WORDS}:
            return "position", "named as the joint alone"
        return "", "its name is no known quantity"
    if not asked:
        return ("", "measured acceleration is not used") if kind == "acceleration" else (kind, "")
    if kind not in _REFERENCE_QUANTITY:
        return "", f"{kind} that was asked for, not measured"
    return _REFERENCE_QUANTITY[kind], ""
