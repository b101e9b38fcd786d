"""Errors that the advice goes by, of answers that are off by a known part."""

from math import inf, nan
from types import SimpleNamespace

import numpy as np
from pytest import approx, mark

import fourbar
from fourbar.mjcf import Settings
from fourbar_validation.advise import advise
from fourbar_validation.advise.matters import (
    ERROR_NAMES,
    INFINITE_ERRORS,
    compute_errors,
    find_greatest,
)
from fourbar_validation.engines.mujoco.trial import JudgedSetup, Trial
from tests.support.scenes import crank_rocker

SCENE = crank_rocker(fourbar.Motion(fourbar.Sweep(0.1, 5.9, 39), 10.0))
COMMAND = fourbar.command(SCENE)


def answer(**off):
    """Return the right torque and pin forces, off at the last position by a part of
    their largest value.
    """
    solution = fourbar.solve(SCENE)
    quantities = {name: np.array(getattr(solution, name)) for name in ERROR_NAMES}
    for name, part in off.items():
        values = quantities[name]
        size = abs(values) if values.ndim == 1 else np.hypot(*values.T)
        values[(-1, 0) if values.ndim == 2 else -1] += part * size.max()
    return quantities


@mark.parametrize("name", ERROR_NAMES)
@mark.parametrize("part", (5e-6, 1e-9))
def test_each_error_is_the_part_that_an_answer_is_off(name, part):
    errors = compute_errors(SCENE, COMMAND, answer(**{name: part}))
    for field, error in zip(ERROR_NAMES, errors, strict=True):
        assert error == approx(
            part if field == name else 0.0,
            rel=1e-4,
            abs=1e-12,
        )
    assert errors.worst == approx(part, rel=1e-4)
    assert errors.force == approx(0.0 if name == "torque" else part, abs=1e-12)


def test_what_is_no_number_is_no_small_error():
    for name in ("torque", "F32"):
        errors = compute_errors(SCENE, COMMAND, answer(**{name: nan}))
        assert getattr(errors, name) == errors.worst == inf
    assert find_greatest([0.0, nan]) == find_greatest([]) == inf
    lost = COMMAND._replace(angle=np.full(40, nan))
    assert compute_errors(SCENE, lost, answer()) == INFINITE_ERRORS


def test_a_run_is_read_at_every_step_and_judged_between_them():
    """The scene's own 40 positions, and 180 more, are fewer than the steps."""
    trial = JudgedSetup(SCENE).try_out(Settings(steps_per_revolution=250.0))
    assert trial.steps > 200
    assert trial.readings == trial.steps + 1


class Pretended:
    """A setup whose error falls with the fourth power of the steps, to a floor."""

    course = SimpleNamespace(speed=10.0, acceleration=0.0)

    def __init__(self, floor=0.0, broken=""):
        self.floor, self.broken = floor, broken

    def steps(self, settings):
        return round(settings.steps_per_revolution)

    def try_out(self, settings):
        n = settings.steps_per_revolution
        error = (10.0 / n) ** 4 + self.floor
        return Trial(
            COMMAND, answer(F43=error), self.steps(settings), n, (), self.broken
        )

    def make_clocks(self, settings, edit=None):
        return (lambda steps: 1e-6 * steps), (lambda readings: 1e-6 * readings)


@mark.parametrize("wanted", (1e-4, 1e-6))
def test_advice_reaches_the_error_with_room_and_with_few_steps(wanted):
    advice = advise.advise(SCENE, wanted, Pretended())  # type: ignore[arg-type]
    assert advice.reached and advice.best.errors.worst <= 0.7 * wanted
    least = 10.0 * (0.7 * wanted) ** -0.25
    assert advice.best.steps <= 1.3 * least


@mark.parametrize("setup", (Pretended(floor=1e-3), Pretended(broken="it came apart")))
def test_what_no_setting_reaches_is_not_advised(setup):
    advice = advise.advise(SCENE, 1e-5, setup)  # type: ignore[arg-type]
    assert not advice.reached and "No setting of plain MJCF" in advice.reason
    assert advice.cells()[0].endswith("(not reached)")


def test_the_greatest_deviation_of_the_speed_is_said():
    speed = np.full(40, 10.0)
    speed[7] = 10.5
    trial = SimpleNamespace(at=COMMAND._replace(speed=speed))
    found = advise._find_speed_error(Pretended(), trial)  # type: ignore[arg-type]
    assert found == approx(0.05)
