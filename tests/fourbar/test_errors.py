"""What an error of a bad input says."""

import pickle

import numpy as np
import pytest

from fourbar import InputError


@pytest.mark.parametrize(
    "value, shown",
    [
        (np.float64(0.21), "0.21"),
        (np.int64(3), "3"),
        (np.bool_(True), "True"),
        (0.21, "0.21"),
        ("3 kg", "'3 kg'"),
    ],
)
def test_a_number_of_numpy_is_shown_as_a_plain_one(value, shown):
    error = InputError("lengths.input", value, "must be less")
    assert str(error) == f"lengths.input = {shown}: must be less"
    assert str(pickle.loads(pickle.dumps(error))) == str(error)
