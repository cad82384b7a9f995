"""What the signatures of drive, sensing and body have in common."""

from dataclasses import replace

import numpy as np
import pytest

from testbench.effects import effect, effects
from testbench.effects.columns import ColumnsByInstant, ColumnsByRun, WindowedColumns
from testbench.effects.signature import amplitude_and_phase, places

NAMES = (
    "torque_gain_error",
    "torque_delay",
    "actuator_lag",
    "torque_saturation",
    "encoder_offset",
    "encoder_eccentricity",
    "payload",
    "base_tilt",
    "external_contact",
)


def test_every_signature_fits_its_runs_and_two_of_them_together(exact):
    command = replace(exact, torque_command=exact.tau)
    for name in NAMES:
        joint = None if effect(name).DESCRIPTION.scope == "robot" else 3
        family = effect(name).signature([exact, command], joint, None)
        for member in family.members:
            assert [c.shape for c in member.columns] == [(exact.samples, len(member.rows), member.count)] * 2
            assert (member.lower <= member.upper).all()
            assert all(np.isfinite(columns).all() for columns in member.columns)


def test_columns_are_made_when_they_are_read_and_of_parts_of_a_run_too(exact):
    runs = [replace(exact, torque_command=exact.tau)]
    for each in effects().values():
        joint, into = places(each.DESCRIPTION, exact.chain.is_slide)[-1]
        for member in each.signature(runs, joint, into).members:
            assert isinstance(member.columns, ColumnsByRun | WindowedColumns)
            if isinstance(member.columns, ColumnsByInstant):
                part = slice(100, 300)
                np.testing.assert_array_equal(member.columns.of_part(0, part), member.columns[0][part])


def test_amplitude_and_phase_have_first_order_deviations():
    covariance = np.array([[4e-4, 1e-4], [1e-4, 9e-4]])
    rng = np.random.default_rng(0)
    draws = rng.multivariate_normal([1.0, 2.0], covariance, 20000)
    sizes = np.hypot(draws[:, 0], draws[:, 1])
    phases = np.arctan2(draws[:, 0], draws[:, 1])
    amplitude, amplitude_std, phase, phase_std = amplitude_and_phase(1.0, 2.0, covariance)
    assert amplitude * np.sin(0.3 + phase) == pytest.approx(np.cos(0.3) + 2 * np.sin(0.3))
    # The deviation of 20000 draws is itself uncertain by half a per cent.
    assert amplitude_std == pytest.approx(sizes.std(), rel=0.03)
    assert phase_std == pytest.approx(phases.std(), rel=0.03)
