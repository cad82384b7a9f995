"""Units, stamps, orders and NaN that can mean only one thing are understood, and said."""

from dataclasses import replace

import h5py
import numpy as np
import pytest

from identification.errors import InputError
from testbench.log import in_model_order, read_log, write_log
from testbench.runs import read_runs

from ..synthetic import synthetic_result, synthetic_robot


@pytest.fixture(scope="module")
def robot(tmp_path_factory):
    return synthetic_robot(tmp_path_factory.mktemp("arm"))


@pytest.fixture
def healthy(robot):
    return synthetic_result(robot).fit_recordings[0]


@pytest.fixture
def path(healthy, tmp_path):
    write_log(healthy, tmp_path / "run.h5")
    return tmp_path / "run.h5"


@pytest.mark.parametrize(("unit", "second"), [("ms", 1e-3), ("us", 1e-6), ("ns", 1e-9)])
def test_stamps_in_another_unit_are_read_as_seconds(healthy, path, unit, second):
    with h5py.File(path, "a") as file:
        file["time"][...] = healthy.time / second
    read = read_log(path)
    assert np.allclose(read.time, healthy.time)
    assert read.provenance["understood"] == [f"time stamps are in {unit}: read as seconds"]


@pytest.mark.parametrize("spelling", ["Nm", "N m", "newton meter", "N*m"])
def test_other_spellings_of_a_unit_are_the_unit(healthy, path, spelling):
    with h5py.File(path, "a") as file:
        file["joint/torque"].attrs["unit"] = spelling
    assert np.array_equal(read_log(path).torque, healthy.torque)


def test_another_unit_is_refused(path):
    with h5py.File(path, "a") as file:
        file["joint/torque"].attrs["unit"] = "mNm"
    with pytest.raises(InputError, match="joint/torque"):
        read_log(path)


def test_a_few_nan_are_interpolated_and_many_are_refused(healthy, path):
    with h5py.File(path, "a") as file:
        file["joint/torque"][100:103, 1] = np.nan
    read = read_log(path)
    assert np.isfinite(read.torque).all()
    assert np.array_equal(read.torque[:, 0], healthy.torque[:, 0])
    assert "joint/torque has NaN in 3 samples" in read.provenance["understood"][0]
    with h5py.File(path, "a") as file:
        file["joint/torque"][100:200, 1] = np.nan
    with pytest.raises(InputError, match="finite values"):
        read_log(path)


def test_joints_in_another_order_are_sorted_by_name(healthy, robot):
    order = [2, 0, 1]
    mixed = replace(
        healthy,
        joint_names=tuple(healthy.joint_names[joint] for joint in order),
        position=healthy.position[:, order],
        torque=healthy.torque[:, order],
        reference_position=None,
        reference_velocity=None,
    )
    read = in_model_order(mixed, robot.joint_names)
    assert read.joint_names == robot.joint_names
    assert np.array_equal(read.torque, healthy.torque)


def test_degrees_are_converted_where_nothing_else_fits_the_ranges(healthy, robot, tmp_path):
    turned = np.rad2deg(healthy.position)
    turned[:, 2] = healthy.position[:, 2]
    write_log(replace(healthy, position=turned, reference_position=None), tmp_path / "degrees.h5")
    (read,) = read_runs([tmp_path / "degrees.h5"], robot)
    assert np.allclose(read.position, healthy.position)
    assert "degrees" in read.provenance["understood"][0]
