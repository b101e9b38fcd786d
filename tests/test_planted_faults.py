"""A harness that cannot catch a planted fault is not a harness.

Each fault is put into the formulas (or, for the missing J-dot v, into the engines), one at a
time; the run alone, through `judge`, must then contain a failing row. No unit test of a formula
takes part. The same scenes without a fault must pass, or nothing would be shown.
"""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from importlib import import_module
from typing import Any

import numpy as np
import pytest

import validation.run.judge
from fourbar.formulas import motion, path
from fourbar.formulas.motion import State
from fourbar.linkage import Bar
from fourbar.scene import Scene
from fourbar.scene.motion import Motion, Sweep
from fourbar.solution import Solution
from tests.scenes import crank_rocker, thesis
from validation.engines.mujoco.inverse import MujocoTree
from validation.engines.pinocchio import PinocchioTree
from validation.engines.witnesses import WITNESSES
from validation.run.judge import judge

EXACT = {name: [w for w in WITNESSES if w.name in name] for name in ("pinocchio-inverse, mujoco-inverse", "free-body")}
"""The engines, and the witness that needs none: each has to notice by itself."""

SCENE = crank_rocker(motion=Motion(Sweep(0.1, 0.1 + 2 * np.pi, 24), 10.0, 5.0))
"""One scene for every fault: what rounding must be expected to do to it is computed once."""


def outcome(scene: Scene, engines: str = "pinocchio-inverse, mujoco-inverse") -> tuple[bool, set[str]]:
    """Whether the run passes, and which quantities fail."""
    rows = judge("scene", scene, EXACT[engines]).rows
    return all(row.passed for row in rows), {row.quantity for row in rows if not row.passed}


@contextmanager
def formulas_see(change: Callable[[Scene], Scene]) -> Iterator[None]:
    """The formulas work on a changed scene (a fault in how they read it), the engines on the true one."""
    true = validation.run.judge.solve

    def faulty(scene: Scene, *arguments: Any, **keywords: Any) -> Solution:
        return true(change(scene), *arguments, **keywords)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(validation.run.judge, "solve", faulty)
        yield


@contextmanager
def formulas_say(change: Callable[[Solution], None]) -> Iterator[None]:
    """The formulas' result is spoilt after it was computed."""
    true = validation.run.judge.solve

    def faulty(*arguments: Any, **keywords: Any) -> Solution:
        solution = true(*arguments, **keywords)
        change(solution)
        return solution

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(validation.run.judge, "solve", faulty)
        yield


@contextmanager
def replaced(owner: Any, name: str, value: Any) -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(owner, name, value)
        yield


def with_bars(change: Callable[[Bar], Bar]) -> Callable[[Scene], Scene]:
    def changed(scene: Scene) -> Scene:
        link = scene.linkage
        bars = {"input": change(link.input), "coupler": change(link.coupler), "output": change(link.output)}
        return replace(scene, linkage=replace(link, **bars))

    return changed


def inertia_about_the_pin(bar: Bar) -> Bar:
    return replace(bar, inertia=bar.moment_of_inertia + bar.mass * bar.mass_centre[0] ** 2)


def inertia_shifted_twice(bar: Bar) -> Bar:
    """m d^2 with d from mid-bar, added to an inertia that is already about G."""
    r, phi = bar.mass_centre
    squared = r * r + bar.length**2 / 4 - r * bar.length * np.cos(phi)
    return replace(bar, inertia=bar.moment_of_inertia + bar.mass * float(squared))


def centre_from_the_other_pin(bar: Bar) -> Bar:
    return replace(bar, centre=(bar.length - bar.mass_centre[0], bar.mass_centre[1]))


def load_on_another_bar(scene: Scene) -> Scene:
    if not scene.loads:  # the run with inertia alone
        return scene
    first, *others = scene.loads
    return replace(scene, loads=(replace(first, bar=2 if first.bar == 3 else 3), *others))


def gravity_flipped(scene: Scene) -> Scene:
    flipped = tuple(replace(effect, magnitude=-effect.magnitude) for effect in scene.effects)
    return replace(scene, effects=flipped)


def flip(name: str) -> Callable[[Solution], None]:
    def change(solution: Solution) -> None:
        getattr(solution, name)[:] *= -1.0

    return change


def torque_off(solution: Solution) -> None:
    assert solution.torque is not None
    solution.torque *= 1.0 + 1e-9


solving = import_module("fourbar.scene.case")
"""Where the forces of a scene are put together."""
close_loop, inertia_wrenches, half_slope, inertia = (
    path.close_loop,
    solving.inertia_wrenches,
    solving.half_slope,
    solving.inertia,
)


def on_the_other_branch(lengths: Any, u1: Any, u2: Any, half: Any, branch: Any) -> Any:
    return close_loop(lengths, u1, u2, half, -branch)


def alpha_for_acceleration(true: Callable[..., Any]) -> Callable[..., Any]:
    """The thesis's index slip: a_G4x read as alpha_3 (its Java program takes element 5 for element 6)."""

    def faulty(self: Any, bar: int, z: Any) -> Any:
        a = true(self, bar, z)
        return self.alpha(3) + 1j * a.imag if bar == 4 else a

    return faulty


def alpha_for_acceleration_in_a_force(a: Any, bodies: Any, at: Any, moving: Any) -> Any:
    wrenches, at_A = inertia_wrenches(a, bodies, at, moving)
    return wrenches._replace(R4=-bodies[2].m * moving.alpha_3 + 1j * wrenches.R4.imag), at_A


def swing_without_centripetal(arm: Any, omega: Any, alpha: Any) -> Any:
    return 1j * alpha * arm


def swing_with_alpha_reversed(arm: Any, omega: Any, alpha: Any) -> Any:
    return (-1j * alpha - omega * omega) * arm


def inertia_without_centripetal(a: Any, bodies: Any, at: Any, moving: Any) -> Any:
    return inertia_wrenches(a, bodies, at, moving._replace(omega_2=0.0, omega_3=0.0, omega_4=0.0))


def inertia_with_alpha_reversed(a: Any, bodies: Any, at: Any, moving: Any) -> Any:
    back = moving._replace(alpha_2=-moving.alpha_2, alpha_3=-moving.alpha_3, alpha_4=-moving.alpha_4)
    return inertia_wrenches(a, bodies, at, back)


def kilogram_centimetres(a: Any, bodies: Any, at: Any, moving: Any) -> Any:
    """The thesis's unit slip: m a in kg cm/s^2 added to newtons."""
    wrenches, at_A = inertia_wrenches(a, bodies, at, moving)
    return wrenches._replace(R2=100.0 * wrenches.R2, R3=100.0 * wrenches.R3, R4=100.0 * wrenches.R4), 100.0 * at_A


def work_of_bars_3_and_4_alone(true: Callable[..., Any]) -> Callable[..., Any]:
    def faulty(self: Any) -> Any:
        _, others = true(self)
        return others, others

    return faulty


FAULTS = {
    "force sign flipped": lambda: formulas_say(flip("F43")),
    "F32 for F23": lambda: formulas_say(flip("F32")),
    "F12 sign flipped": lambda: formulas_say(flip("F12")),
    "branch swapped": lambda: replaced(path, "close_loop", on_the_other_branch),
    "inertia about the pin": lambda: formulas_see(with_bars(inertia_about_the_pin)),
    "m d^2 added to an inertia about G": lambda: formulas_see(with_bars(inertia_shifted_twice)),
    "mass centre from the wrong pin": lambda: formulas_see(with_bars(centre_from_the_other_pin)),
    "load on the wrong bar": lambda: formulas_see(load_on_another_bar),
    "gravity missing": lambda: formulas_see(lambda scene: replace(scene, effects=())),
    "gravity flipped": lambda: formulas_see(gravity_flipped),
    "sign of the alpha term of a point": lambda: replaced(motion, "swing", swing_with_alpha_reversed),
    "sign of the alpha terms of the forces": lambda: replaced(solving, "inertia_wrenches", inertia_with_alpha_reversed),
    "omega^2 r of a point dropped": lambda: replaced(motion, "swing", swing_without_centripetal),
    "m omega^2 r dropped": lambda: replaced(solving, "inertia_wrenches", inertia_without_centripetal),
    "alpha_3 used for an acceleration": lambda: replaced(
        State, "acceleration", alpha_for_acceleration(State.acceleration)
    ),
    "alpha_3 used for an acceleration in a force": lambda: replaced(
        solving, "inertia_wrenches", alpha_for_acceleration_in_a_force
    ),
    "m a in kg cm/s^2": lambda: replaced(solving, "inertia_wrenches", kilogram_centimetres),
    "J'/2 omega^2 of the torque dropped": lambda: replaced(solving, "half_slope", lambda *_: 0.0),
    "J' for J'/2 in the torque": lambda: replaced(solving, "half_slope", lambda *of: 2.0 * half_slope(*of)),
    "J of the coupler and output left out of the torque": lambda: replaced(
        solving, "inertia", lambda *of: (inertia(*of)[0], 0.0)
    ),
    "work on the input left out of the torque": lambda: replaced(
        solving.Actions, "work", work_of_bars_3_and_4_alone(solving.Actions.work)
    ),
    "torque off by 1e-9": lambda: formulas_say(torque_off),
}


def test_without_a_fault_the_run_passes() -> None:
    for scene in (SCENE, thesis()):
        for engines in EXACT:
            passed, failing = outcome(scene, engines)
            assert passed, failing


@pytest.mark.parametrize("engines", EXACT)
@pytest.mark.parametrize("fault", FAULTS)
def test_each_planted_fault_fails_the_run(fault: str, engines: str) -> None:
    with FAULTS[fault]():
        passed, failing = outcome(SCENE, engines)
    assert not passed, f"{fault}: not noticed"
    assert failing


@pytest.mark.parametrize("tree", [MujocoTree, PinocchioTree])
def test_a_loop_without_the_drift_of_its_jacobian_fails_the_run(tree: type) -> None:
    """MuJoCo before 3.7.0 left (dJ/dt) v out of its loop: 29 of 274 N m wrong, and no warning."""
    with replaced(tree, "drift", lambda self, v: np.zeros(2)):
        passed, failing = outcome(SCENE)
    assert not passed
    assert {"alpha_3", "torque"} <= failing


def test_positions_outside_the_range_fail_the_run() -> None:
    def pretend(solution: Solution) -> None:
        solution.status_code[:] = 0

    scene = thesis(np.radians([80.0, 135.0]))  # the range starts at 84.6 deg
    for engines in EXACT:
        with formulas_say(pretend):
            passed, failing = outcome(scene, engines)
        assert not passed
        assert "assembled" in failing
