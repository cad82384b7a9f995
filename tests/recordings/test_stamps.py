"""Time stamps that people's logs have: interleaved, repeated, coarse, and set back."""

import numpy as np
import pytest

from identification.errors import InputError
from recordings.stamps import sampled

COUNT, STEP = 200, 0.002


def stamps() -> np.ndarray:
    return STEP * np.arange(COUNT)


def values() -> np.ndarray:
    return np.column_stack([np.sin(stamps()), np.cos(stamps())])


def test_stamps_in_nanoseconds_since_1970_lose_no_digit() -> None:
    whole = 1_700_000_000_123_456_789 + np.arange(COUNT) * 2_000_000
    found = sampled(whole, 1e-9, values(), "run", "time")
    np.testing.assert_allclose(found.time, stamps(), atol=1e-12)
    assert found.start == 1_700_000_000_123_456_789


def test_two_publishers_that_interleave_are_sorted() -> None:
    order = np.arange(COUNT).reshape(-1, 4)[:, [0, 2, 1, 3]].ravel()
    found = sampled(stamps()[order], 1.0, values()[order], "run", "time")
    np.testing.assert_array_equal(order[found.rows], np.arange(COUNT))
    np.testing.assert_array_equal(found.time, stamps())
    assert "sorted" in found.notes[0]


def test_a_clock_that_was_set_back_is_refused_with_the_place() -> None:
    broken = stamps()
    broken[120:] -= 0.15
    with pytest.raises(InputError, match=r"time: .*a step back of 0\.148 s at sample 121"):
        sampled(broken, 1.0, values(), "run", "time")


def test_samples_that_are_sent_again_count_once() -> None:
    again = np.repeat(np.arange(COUNT), 3)
    found = sampled(stamps()[again], 1.0, values()[again], "run", "time")
    np.testing.assert_array_equal(found.time, stamps())
    np.testing.assert_array_equal(values()[again][found.rows], values())


def test_values_that_are_held_between_stamps_that_go_on_are_kept() -> None:
    held = np.repeat(values()[::10], 10, axis=0)
    found = sampled(stamps(), 1.0, held, "run", "time")
    np.testing.assert_array_equal(found.rows, np.arange(COUNT))
    assert found.notes == ()


def test_stamps_coarser_than_the_samples_are_spread_evenly() -> None:
    fine = 0.0005 * np.arange(COUNT)
    found = sampled(np.floor(fine * 1000), 1e-3, values(), "run", "time")
    np.testing.assert_allclose(found.time, fine, atol=1e-3)
    assert np.ptp(np.diff(found.time)) < 1e-12
    assert "evenly" in found.notes[0]


@pytest.mark.parametrize("stand", [np.zeros(COUNT), np.repeat([0.0, 1.0, 9.0, 10.0], COUNT // 4)])
def test_a_clock_that_stands_is_refused(stand: np.ndarray) -> None:
    with pytest.raises(InputError, match="a time stamp for each sample"):
        sampled(stand, 1.0, values(), "run", "time")


def test_samples_without_a_stamp_are_left_out() -> None:
    some = stamps()
    some[[3, 50]] = np.nan
    found = sampled(some, 1.0, values(), "run", "time")
    assert len(found.rows) == COUNT - 2
    assert {3, 50}.isdisjoint(found.rows.tolist())
