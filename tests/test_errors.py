"""The one error that means "the input is wrong"."""

import pickle

from identification.errors import InputError


def test_a_complaint_survives_the_way_from_a_worker_process():
    error = InputError("log.h5", "tau", "finite values", "NaN", ["q", "dq"])
    copy = pickle.loads(pickle.dumps(error))
    assert str(copy) == str(error)
    assert copy.located("other.h5").choices == ("q", "dq")
