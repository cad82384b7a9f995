"""MuJoCo's memory for compiled callbacks: where mjData keeps its fields, and which callbacks run.

A compiled callback receives the addresses of mjModel and mjData. Where a field's pointer lies in
mjData differs between MuJoCo releases, so it is found in this process by looking for the addresses
that the Python bindings report.
"""

import ctypes
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, fields
from functools import cache
from typing import Any

import llvmlite.binding
import mujoco
from numba import types

# Far beyond mjData's size; the scan ends at the last field found, well inside the struct.
SCAN_LIMIT = 1 << 21
# No array between the fields is empty here: an empty one would share the address of the next.
PROBE = """
<mujoco>
  <size nuserdata="3"/>
  <worldbody>
    <body mocap="true"/>
    <body><inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/><joint name="hinge"/></body>
  </worldbody>
  <actuator><general joint="hinge" dyntype="integrator"/></actuator>
</mujoco>
"""

_library = ctypes.CDLL(mujoco._functions.__file__)
_installing = threading.Lock()

llvmlite.binding.add_symbol("mj_solveM", ctypes.cast(_library.mj_solveM, ctypes.c_void_p).value)
# mj_solveM(model, data, x, y, k): x = M^-1 y for k right-hand sides, with M's current factor.
solve_mass_matrix = types.ExternalFunction(
    "mj_solveM", types.void(types.int64, types.int64, types.int64, types.int64, types.int32)
)


@dataclass(frozen=True)
class DataOffsets:
    """Where in mjData the pointer of each field lies, in bytes."""

    qpos: int
    qvel: int
    qfrc_applied: int
    qfrc_bias: int
    qfrc_passive: int
    xfrc_applied: int


@cache
def data_offsets() -> DataOffsets:
    """Offsets in this process's MuJoCo. Raises RuntimeError when a field is not found."""
    data = mujoco.MjData(mujoco.MjModel.from_xml_string(PROBE))
    missing = {getattr(data, field.name).ctypes.data: field.name for field in fields(DataOffsets)}
    found: dict[str, int] = {}
    for offset in range(0, SCAN_LIMIT, 8):
        name = missing.pop(_word(data._address + offset), None)
        if name is not None:
            found[name] = offset
        if not missing:
            return DataOffsets(**found)
    raise RuntimeError(f"MuJoCo {mujoco.__version__}: no pointer in mjData to {', '.join(missing.values())}")


def check_offsets(offsets: DataOffsets, data: Any) -> None:
    """Raise RuntimeError unless the offsets lead to the fields of this mjData."""
    for field in fields(offsets):
        if _word(data._address + getattr(offsets, field.name)) != getattr(data, field.name).ctypes.data:
            raise RuntimeError(f"MuJoCo {mujoco.__version__}: mjData.{field.name} was not found")


def _word(address: int) -> int:
    return ctypes.c_uint64.from_address(address).value


@contextmanager
def installed_control(callback: Any) -> Iterator[None]:
    """Run MuJoCo with a compiled mjcb_control, given as a ctypes function; what was there is put back.

    MuJoCo's callbacks are global: until the block ends, whatever steps or compiles a model elsewhere in the
    process calls it too, and it must do nothing there (see loop_callback).
    mjcb_time is taken out meanwhile: reading clocks for its profile takes a quarter of a small step.
    """
    time = ctypes.c_void_p.in_dll(_library, "mjcb_time")
    with _installing:
        before, clock = mujoco.get_mjcb_control(), time.value
        mujoco.set_mjcb_control(callback)
        time.value = None
        try:
            yield
        finally:
            time.value = clock
            mujoco.set_mjcb_control(before)
