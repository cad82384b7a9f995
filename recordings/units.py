"""Units that recordings are in, by what is measured, and what one of them is in SI units."""

import math
import re
from collections.abc import Mapping

KGF = 9.80665
DEGREE, TURN = math.pi / 180, 2 * math.pi

_ANGLE = {"rad": 1.0, "deg": DEGREE, "turn": TURN, "mrad": 1e-3}
_LENGTH = {"m": 1.0, "mm": 1e-3, "cm": 1e-2}
_TORQUE = {"N·m": 1.0, "mN·m": 1e-3, "N·cm": 1e-2, "kgf·cm": KGF / 100, "kgf·m": KGF}
_FORCE = {"N": 1.0, "mN": 1e-3, "kN": 1e3, "kgf": KGF}


def _rates(units: Mapping[str, float], of: str) -> dict[str, float]:
    return {f"{unit}/{of}": factor for unit, factor in units.items()}


_SPEED = {**_rates(_ANGLE, "s"), "rpm": TURN / 60}
_CURRENT, _VOLTAGE = {"A": 1.0, "mA": 1e-3}, {"V": 1.0, "mV": 1e-3}
_DUTY, _DEGC = {"-": 1.0, "%": 1e-2, "‰": 1e-3}, {"degC": 1.0}
TIME = {"s": 1.0, "ms": 1e-3, "µs": 1e-6, "ns": 1e-9}
# By quantity: of a hinge, of a slide joint.
UNITS: Mapping[str, tuple[Mapping[str, float], Mapping[str, float]]] = {
    "position": (_ANGLE, _LENGTH),
    "velocity": (_SPEED, _rates(_LENGTH, "s")),
    "torque": (_TORQUE, _FORCE),
    "torque_command": (_TORQUE, _FORCE),
    "temperature": (_DEGC, _DEGC),
    "reference_position": (_ANGLE, _LENGTH),
    "reference_velocity": (_SPEED, _rates(_LENGTH, "s")),
    "reference_acceleration": (_rates(_ANGLE, "s²"), _rates(_LENGTH, "s²")),
    "current": (_CURRENT, _CURRENT),
    "duty": (_DUTY, _DUTY),
    "voltage": (_VOLTAGE, _VOLTAGE),
}
SI = "SI"

_OTHER_SPELLINGS = {
    "deg": "degree degrees degs °",
    "rad": "radian radians rads",
    "turn": "turns rev revs revolutions",
    "m": "meter meters",
    "mrad": "milliradians",
    "deg/s": "dps",
    "turn/s": "rps",
    "rpm": "r/min",
    "mN·m": "nmm mnm",
    "kgf·cm": "kgcm kgfcm",
    "kgf·m": "kgfm",
    "N·m": "nm",
    "N·cm": "ncm",
    "A": "amp amps ampere",
    "mA": "milliamps mamp",
    "V": "volt volts",
    "%": "percent pct",
    "‰": "permille",
    "s": "sec secs second seconds",
    "ms": "msec millis milliseconds",
    "µs": "us μs usec micros microseconds",
    "ns": "nsec nanos nanoseconds",
    "degC": "celsius °c c",
}


def _plain(text: str) -> str:
    """A unit's spelling without what people vary: case, blanks, dots, and ways to write per second."""
    text = re.sub(r"[\s·⋅.*]+", "", text).lower()
    text = re.sub(r"_?per_?", "/", text)
    text = re.sub(r"/(sec(ond)?|s)?\^?(2|²)$|/s/s$", "/s²", text)
    return re.sub(r"/sec(ond)?s?$", "/s", text)


def _all_spellings() -> dict[str, str]:
    units = {unit for pair in UNITS.values() for each in pair for unit in each} | set(TIME)
    found = {_plain(unit): unit for unit in sorted(units)}
    for unit, spelling in (
        (unit, each) for unit, known in _OTHER_SPELLINGS.items() for each in known.split()
    ):
        found[spelling] = unit
        for end in ("/s", "/s²"):
            if unit + end in units:
                found[spelling + end] = unit + end
    return found


_SPELLINGS = _all_spellings()


def known_unit(text: str) -> str:
    """The unit that a text spells, as it is spelled here; empty where it spells none."""
    return _SPELLINGS.get(_plain(text), "")


def factor_of(quantity: str, unit: str, is_slide: bool) -> float | None:
    """Factor from a unit to the SI unit of this quantity; None where it is no unit of the quantity."""
    return 1.0 if unit == SI else UNITS[quantity][is_slide].get(known_unit(unit) or unit)
