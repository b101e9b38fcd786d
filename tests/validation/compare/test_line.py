"""A drive along a line before the free bodies.

Every pair of bars holds, faults show, who cannot do it says so.
"""

from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest

import fourbar
from fourbar.effects import LinearDrive, Place
from fourbar_validation.compare.rows import AGREES, FAILS
from fourbar_validation.engines.exact import BallArithmetic
from fourbar_validation.engines.guests import GuestClient, Hello, Program
from fourbar_validation.engines.registry import ENGINES, load_further
from fourbar_validation.run.judge import judge
from tests.support.scenes import crank_rocker

FREE_BODY = [engine for engine in ENGINES if engine.name == "free-body"]
EXACT = [
    engine
    for engine in (*ENGINES, *load_further())
    if not engine.through_time and engine not in FREE_BODY
]
PAIRS = list(combinations((1, 2, 3, 4), 2))
PINS = fourbar.PinFriction.at(A=(0.1, 0.005), O4=(0.2, 0.004))


def driven(one, other, **changes):
    ends = Place(one, (0.17, -1.1)), Place(other, (0.09, 0.7))
    motion = fourbar.Motion(
        np.linspace(0.1, 6.2, 25),
        10.0,
        5.0,
    )
    return crank_rocker(motion=motion, drive=LinearDrive(*ends), **changes)


@pytest.mark.slow
@pytest.mark.parametrize(("one", "other"), PAIRS)
def test_every_pair_of_bars_agrees_with_thirteen_equations(one, other):
    for effects in (
        (fourbar.Gravity(), fourbar.Viscous.at(B=0.02)),
        (fourbar.Gravity(), PINS),
    ):
        for branch in (1, -1):
            scene = driven(one, other, effects=effects)
            rows = judge(
                "",
                replace(scene, motion=scene.motion.replace(branch=branch)),
                FREE_BODY,
            ).rows
            assert not [row for row in rows if row.failed]
            agreeing = {
                row.quantity
                for row in rows
                if row.engine == "free-body" and row.verdict == AGREES
            }
            assert agreeing >= {
                "drive_force",
                "stroke",
                "drive_line",
                "stroke_speed",
                "drive_condition",
                "F12",
            }
            assert "drive_force_inertia" in agreeing and "torque" not in agreeing


@pytest.mark.slow
@pytest.mark.parametrize("engine", EXACT, ids=lambda engine: engine.name)
@pytest.mark.parametrize(("one", "other"), PAIRS)
def test_every_pair_of_bars_agrees_with_the_multipliers_of_an_engine(
    engine, one, other
):
    if missing := engine.missing():
        pytest.skip(missing)
    for effects in (
        (fourbar.Gravity(), fourbar.Viscous.at(B=0.02)),
        (fourbar.Gravity(), PINS),
    ):
        rows = judge("", driven(one, other, effects=effects), [*FREE_BODY, engine]).rows
        assert not [row for row in rows if row.failed]
        agreeing = {
            row.quantity
            for row in rows
            if row.engine == engine.name and row.verdict == AGREES
        }
        assert agreeing >= {
            "drive_force",
            "stroke",
            "stroke_speed",
            "drive_force_inertia",
            "F12",
            "F32",
            "F43",
            "F14",
        }


@pytest.mark.parametrize("engine", [*FREE_BODY, *EXACT], ids=lambda engine: engine.name)
@pytest.mark.parametrize("gap", [1e-2, 1e-4, 1e-6])
def test_the_direction_of_a_line_is_as_uncertain_as_its_ends_are_near(engine, gap):
    if missing := engine.missing():
        pytest.skip(missing)
    linkage = crank_rocker().linkage
    (theta_4,) = fourbar.solve(
        crank_rocker(motion=fourbar.Motion(1.0)), "position"
    ).theta_4
    on_bar = linkage.ground + 0.2 * np.exp(1j * (theta_4 + 0.4 - linkage.ground_angle))
    drive = LinearDrive(
        Place(1, (abs(on_bar + gap), np.angle(on_bar + gap))), Place(4, (0.2, 0.4))
    )
    scene = crank_rocker(
        motion=fourbar.Motion(1.0 + gap * np.linspace(-1.0, 1.0, 7), 10.0),
        drive=drive,
    )
    assert fourbar.solve(scene, "position").stroke == pytest.approx(gap, rel=0.5)
    rows = {
        row.quantity: row
        for row in judge("", scene, [engine]).rows
        if row.engine == engine.name
    }
    for quantity in ("stroke", "drive_line", "stroke_speed", "drive_force", "F14"):
        assert (
            rows[quantity].verdict == AGREES and rows[quantity].allowed < 1e-12 / gap
        ), quantity


def test_positions_alone_have_a_stroke_that_is_judged():
    scene = driven(3, 4)
    rows = judge(
        "", replace(scene, motion=scene.motion.replace(speed=None)), FREE_BODY
    ).rows
    assert not [row for row in rows if row.failed]
    assert {"stroke", "drive_line"} <= {
        row.quantity for row in rows if row.verdict == AGREES
    }


def test_statics_and_friction_at_rest_agree_too():
    scene = driven(
        1,
        3,
        effects=(fourbar.Gravity(), fourbar.Friction.at(A=0.05, O4=0.02)),
    )
    rows = judge(
        "",
        replace(scene, motion=scene.motion.replace(speed=0.0, acceleration=0.0)),
        FREE_BODY,
    ).rows
    assert not [row for row in rows if row.failed]
    assert {"drive_force_low", "drive_force_high"} <= {
        row.quantity for row in rows if row.verdict == AGREES
    }


def _reversed(self, actions, force, act=LinearDrive.act):
    act(self, actions, -force)


def _of_one_end(self, actions, force):
    push = force * self.line(actions.state)[1]
    actions.force(self.end.bar, push, self.end.in_bar)


def _of_the_wrong_bar(self, actions, force):
    push = force * self.line(actions.state)[1]
    actions.force(2, -push, self.start.in_bar)
    actions.force(3, push, self.end.in_bar)


FAULTS = {
    "line reversed": ("act", _reversed),
    "one of its two ends": ("act", _of_one_end),
    "lever of the wrong bar": ("act", _of_the_wrong_bar),
    "sign of the speed": (
        "gain",
        lambda self, state, true=LinearDrive.gain: -true(self, state),
    ),
    "half the leverage": (
        "leverage",
        lambda *arguments, true=LinearDrive.leverage: (
            0.5 * true(*arguments)[0],
            true(*arguments)[1],
        ),
    ),
}


@pytest.mark.slow
@pytest.mark.parametrize("fault", FAULTS)
def test_a_fault_in_the_drive_is_caught(monkeypatch, fault):
    monkeypatch.setattr(LinearDrive, *FAULTS[fault])
    rows = judge("", driven(2, 4), FREE_BODY).rows
    assert [row for row in rows if row.verdict == FAILS]


def test_who_cannot_do_it_refuses_in_one_line_that_names_it():
    scene = driven(1, 4)
    assert (
        "a drive that exerts a force"
        in BallArithmetic().answer(scene, fourbar.command(scene)).refusal
    )
    outside = GuestClient("outside", Program(("none",)), Hello("outside"))
    assert (
        outside.answer(scene, fourbar.command(scene)).refusal
        == "the engine's hello does not list gravity, loads, cylinder in effects"
    )
