"""estimate.json of identified drives: for machines, and all that simulating the corrected robot needs."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from identification.chain import Chain
from identification.errors import InputError
from identification.output_error.plant import COLUMNS, LIMIT, STALL, WIDTH

from ..chain_json import chain_document, read_chain
from ..containment.json_text import read_bounded_json
from ..files import require_file
from ..model_reading.limits import Limits
from .differences import Difference
from .identified import IdentifiedDrives

Array = NDArray[np.float64]

DOCUMENT, FORMAT, VERSION = "estimate.json", "drive-estimate", 1


@dataclass(frozen=True)
class Errors:
    """RMS (n,) rad (m) of simulated less measured position, by the model as given and as identified."""

    role: str
    given: Array
    identified: Array


@dataclass(frozen=True)
class ReadDrives:
    """An estimate as predicting needs it. given, identified: tables (n, WIDTH). kp, kd: (n,) as stated."""

    chain: Chain
    limits: Limits
    given: Array
    identified: Array
    kp: Array
    kd: Array

    @property
    def joint_names(self) -> tuple[str, ...]:
        """n names."""
        return self.chain.joint_names


def drives_document(
    found: IdentifiedDrives,
    errors: Sequence[Errors],
    remarks: Sequence[str],
    differing: Sequence[Difference],
) -> dict[str, Any]:
    """The estimate as plain JSON types; null for values that are infinite or not known."""
    chain, servo = found.robot.chain, found.servo
    return {
        "format": FORMAT,
        "format_version": VERSION,
        "robot": found.robot.name,
        "joint_names": list(chain.joint_names),
        "drive": {"kind": "position_servo", "kp": servo.kp.tolist(), "kd": servo.kd.tolist()},
        "figures": [
            {
                "name": each.name,
                "joint": each.joint,
                "value": each.value,
                "std": each.std,
                "unit": each.unit,
                "prior": each.prior,
                "prior_std": each.prior_std,
                "determined": None if each.is_determined is None else bool(each.is_determined),
            }
            for each in found.figures
        ],
        "alike": [
            {
                "name": each.name,
                "joints": list(each.joints),
                "value": each.value,
                "std": each.std,
                "unit": each.unit,
                "p_value": each.p_value,
            }
            for each in found.alike
        ],
        "tied": [
            {"name": each.name, "joints": list(each.joints), "is_one": each.is_one} for each in found.tied
        ],
        "differences": [
            {
                "joint": each.joint,
                "name": each.name,
                "stated": each.stated,
                "value": each.value,
                "std": each.std,
                "unit": each.unit,
                "evidence": each.evidence if np.isfinite(each.evidence) else None,
                "not_distinguished_from": list(each.alike),
            }
            for each in differing
        ],
        "judged_by": errors[-1].role,
        "position_rms": {
            each.role: {"given": each.given.tolist(), "identified": each.identified.tolist()}
            for each in errors
        },
        "effective_samples": np.concatenate([each.effective_samples for each in found.fits]).tolist(),
        "remarks": list(remarks),
        "plant": {
            "columns": list(COLUMNS),
            "given": _table(found.given),
            "identified": _table(found.identified),
            "chain": chain_document(chain),
        },
        "units": "SI at the joint",
    }


def as_read(found: IdentifiedDrives) -> ReadDrives:
    """Identified drives as they would be read from the document."""
    return _of_plant(found.robot.chain, found.given, found.identified, found.servo.kp, found.servo.kd)


def _of_plant(chain: Chain, given: Array, identified: Array, kp: Array, kd: Array) -> ReadDrives:
    endless = np.full(chain.joints, np.inf)
    limits = Limits(-endless, endless, endless, endless, identified[:, LIMIT])
    return ReadDrives(chain, limits, given, identified, kp, kd)


def _table(table: Array) -> list[list[float | None]]:
    return [[float(value) if np.isfinite(value) else None for value in row] for row in table]


def is_drives(directory: Path) -> bool:
    """Whether a folder holds identified drives."""
    path = directory / DOCUMENT
    if not path.is_file():
        return False
    document = read_bounded_json(path, "estimate")
    return isinstance(document, dict) and document.get("format") == FORMAT


def read_drives(directory: Path) -> ReadDrives:
    """The identified drives of a folder. Raises InputError for anything but what ``identify`` writes."""
    path = directory / DOCUMENT
    require_file(path, "estimate", "a folder in which identify has written of drives")
    document = read_bounded_json(path, "estimate")
    try:
        plant, drive = document["plant"], document["drive"]
        if document["format"] != FORMAT or plant["columns"] != list(COLUMNS):
            raise ValueError(f"{document['format']} with {len(plant['columns'])} columns")
        chain = read_chain(plant["chain"])
        n = chain.joints
        given, identified = (
            np.array(
                [[np.inf if value is None else value for value in row] for row in plant[name]],
                dtype=np.float64,
            )
            for name in ("given", "identified")
        )
        kp, kd = (np.array(drive[name], dtype=np.float64) for name in ("kp", "kd"))
        shapes = {"plant": (given, identified), "gains": (kp, kd)}
        expected = {"plant": (n, WIDTH), "gains": (n,)}
        for name, arrays in shapes.items():
            for each in arrays:
                finite = np.delete(each, [LIMIT, STALL], axis=1) if name == "plant" else each
                if each.shape != expected[name] or not np.isfinite(finite).all():
                    raise ValueError(f"{name} of shape {each.shape}, or not finite")
    except (KeyError, TypeError, ValueError, AttributeError, IndexError, OverflowError) as error:
        expected_text = "drives as identify writes them"
        raise InputError(path, "plant", expected_text, f"{type(error).__name__}: {error}") from None
    return _of_plant(chain, given, identified, kp, kd)
