"""Numbers with slopes.

Every function of NumPy is followed as differences say, or refused by its name.
"""

import math
from dataclasses import dataclass
from typing import Annotated, ClassVar

import numpy as np
from pytest import approx, mark, raises

from fourbar import Motion, equilibrium, sensitivity, solve
from fourbar.effects.effect import Effect
from fourbar.errors import LimitError
from fourbar.linkage import Declared
from fourbar.studies.sloped import Sloped
from tests.support.scenes import crank_rocker

STEP = 2.0**-20
"""Step of central differences: their error is about STEP^2, 1e-12."""
DIFFERENCES = 1e-9
"""Relative error allowed to a difference, whose values lose eps/STEP, 2e-10, by
rounding.
"""
POINTS = (-1.7, -0.4, 0.3, 2.6)
"""Arguments off all jumps."""


def ufuncs(arguments):
    every = {f.__name__: f for f in vars(np).values() if isinstance(f, np.ufunc)}
    return [every[name] for name in sorted(every) if every[name].nin == arguments]


def check_against_differences(function, x):
    """A function of one number has the slope of its differences, or is refused."""
    try:
        outcome = function(Sloped(np.array([x]), np.array([[1.0]])))
    except LimitError as error:
        assert function.__name__.strip("_") in str(error) or "numpy." in str(error)
        return
    ahead, behind = function(x + STEP), function(x - STEP)
    for part, after, before in zip(
        *(
            one if isinstance(one, tuple) else (one,)
            for one in (outcome, ahead, behind)
        ),
        strict=True,
    ):
        if not isinstance(part, Sloped):  # constant, or a truth value
            assert np.equal(after, before).all()
            continue
        slope = (float(after) - float(before)) / (2.0 * STEP)
        if math.isfinite(slope):
            size = max(abs(slope), abs(float(after)), 1.0)
            assert abs(part.slopes[0, 0] - slope) <= DIFFERENCES * size


@mark.filterwarnings("ignore::RuntimeWarning")  # roots of negative numbers
@mark.parametrize("function", ufuncs(1), ids=lambda f: f.__name__)
@mark.parametrize("x", POINTS)
def test_a_function_of_one_number_has_its_slope_or_is_refused(function, x):
    check_against_differences(function, x)


@mark.filterwarnings("ignore::RuntimeWarning")  # powers of negative numbers
@mark.parametrize("function", ufuncs(2), ids=lambda f: f.__name__)
@mark.parametrize("x", POINTS)
@mark.parametrize("constant", [0.7, -1.1])
def test_a_function_of_two_numbers_has_its_slopes_or_is_refused(function, x, constant):
    def of_first(x):
        return function(x, constant)

    def of_second(x):
        return function(constant, x)

    for one in (of_first, of_second):
        one.__name__ = function.__name__
        check_against_differences(one, x)


@mark.parametrize(
    "change",
    [
        lambda x: np.maximum(x, 0.0),
        lambda x: np.clip(x, 0.0, 1.0),
        lambda x: np.interp(x, [0.0, 1.0], [0.0, 1.0]),
        np.sum,
        np.add.reduce,
        lambda x: np.add(x, 1.0, out=np.zeros(1)),
        np.asarray,
        float,
        math.sin,
        bool,
    ],
)
def test_what_slopes_cannot_follow_raises(change):
    with raises(LimitError):
        change(Sloped(np.array([0.3]), np.array([[1.0]])))


@dataclass(frozen=True)
class Drag(Effect):
    """A couple on the input that grows with its speed squared, by a function."""

    strength: Annotated[float, Declared("N m s^2/rad^2")]
    form: str
    key: ClassVar[str] = "drag"

    def act(self, actions, state):
        omega = state.omega(2)
        actions.couple(2, -getattr(np, self.form)(self.strength * omega * omega, omega))


@mark.parametrize("speed", [-2.0, 2.0])
def test_an_effect_that_copies_a_sign_keeps_its_derivatives(speed):
    def dragged(form, speed):
        return crank_rocker(Motion(1.0, speed), effects=(Drag(0.5, form),))

    by_speed = sensitivity(dragged("copysign", speed)).of("torque", "motion.omega_2")
    ahead, behind = (
        solve(dragged("copysign", speed + h)).torque for h in (STEP, -STEP)
    )
    assert by_speed == approx((ahead - behind) / (2.0 * STEP), rel=1e-7)
    for study in (sensitivity, equilibrium):
        with raises(LimitError, match=r"cannot follow numpy\.maximum"):
            study(dragged("maximum", speed))


def test_a_number_is_zero_only_where_its_slopes_are_too():
    x = Sloped(np.array([0.0, 0.0, 1.0]), np.array([[0.0, 1.0, 0.0]]))
    assert (x == 0.0).tolist() == [True, False, False]
    assert (x != 0.0).tolist() == [False, True, True]
