"""What an error of a bad input says."""

import math
import pickle

import numpy as np
import pytest

from fourbar.errors import InputError, name_unit, state_messages_in, write_in_units


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


INCHES = {"m": ("in", 1.0 / 0.0254), "rad": ("deg", 180.0 / math.pi)}


def test_numbers_are_stated_in_the_units_of_messages():
    with state_messages_in(INCHES):
        error = InputError("lengths", (0.0508, 0.254), "must close", unit="m")
        within = write_in_units("m", 0.0254)
        assert (within, write_in_units("kg", 0.5)) == ("1 in", "0.5 kg")
        assert (name_unit("m"), name_unit("N", "lbf")) == ("in", "lbf")
        moved = error.moved_to("pins", "scene.toml")
        assert str(moved) == "scene.toml: pins = 2, 10 in: must close"
    assert write_in_units("m", 0.0254) == "0.0254 m"
    assert str(error) == "lengths = 2, 10 in: must close"
