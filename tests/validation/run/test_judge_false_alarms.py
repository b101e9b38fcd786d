"""Scenes that once failed with engines that are right.

The harness holds them, and what is wrong there still fails.
"""

import re
from dataclasses import replace

import numpy as np
from pytest import importorskip, mark

from fourbar.effects import PinFriction
from fourbar.formulas.mobility import TURN
from fourbar.linkage import Bar, FourBar, uniform
from fourbar.scene import Scene
from fourbar.scene.motion import Free, Law, Motion, Rise
from fourbar_lab.fault_scenes import FAULT_SCENES
from fourbar_validation.compare.rows import DEGRADED, FAILS
from fourbar_validation.compare.tolerance import EQUIVALENCE
from fourbar_validation.engines.registry import Engine, hold_fully, list_engines
from fourbar_validation.run import released
from fourbar_validation.run.judge import judge, make_question
from fourbar_validation.run.law import check_law
from fourbar_validation.scenes.hard_families import Hard
from fourbar_validation.scenes.random import draw_random_scene
from tests.support.here import EXACT, THROUGH_TIME, list_failed, spoil_formulas
from tests.support.rows import read_rows
from tests.support.scenes import WEIGHT, crank_rocker, recommand
from tests.support.textbook import Textbook

BY_ITSELF = [engine for engine in EXACT if not engine.library]
POSITIONS = np.array([0.14, 1.75, 4.03, 4.73])


def bars(d, a, b, c, theta_1=0.0, r=None):
    far = None if r is None else (r, 0.35)
    return FourBar(
        d,
        Bar(a, 0.01),
        Bar(b, 1.0, centre=far),
        Bar(c, 0.5),
        theta_1,
    )


ORDINARY, TINY = (0.2, 0.08, 0.18, 0.15), (20e-6, 8e-6, 18e-6, 15e-6)
SHORT_INPUT = bars(0.5, 0.002, 0.48, 0.12)
SCENES = {
    "short input": Scene(SHORT_INPUT, Motion(POSITIONS, 10.0), effects=WEIGHT),
    "centre 100 m away": Scene(bars(*ORDINARY, r=100.0), Motion([0.63, 0.94], 10.0)),
    "ground at 1e7 rad": Scene(bars(*ORDINARY, 1e7), Motion([0.63, 1.57], 10.0)),
    "bars of micrometres": Scene(bars(*TINY), Motion(POSITIONS, 10.0)),
    # the compiler would move what is within 1e-6 m of a pin onto it
    "bars below a micrometre": Scene(
        uniform(2e-7, 8e-8, 1.8e-7, 1.5e-7, per_metre=1e11), Motion(POSITIONS, 10.0)
    ),
    "positions alone": Scene(bars(*TINY), Motion(POSITIONS)),
    "friction beside a change point": Scene(
        bars(0.18, 0.1, 0.26, 0.18),
        Motion(np.radians([-5.0, 40.0]), 10.0, 10.0),
        effects=(PinFriction.at(O4=(0.15, 0.006)),),
    ),
    "two turns of a kite": Scene(bars(0.1, 0.1, 0.2, 0.2), Motion()),
}


@mark.parametrize("name", SCENES)
def test_engines_that_are_right_raise_no_alarm(name):
    assert not list_failed(SCENES[name], EXACT)


@mark.slow
def test_ratios_over_ten_decades_raise_no_alarm():
    """As `run --random N --type uneven`.

    In the last the forces were summed more strictly than its coupler allows.
    """
    drawn = (1, 6, 8, 9, 10, 32, 36, 61)
    scenes = [draw_random_scene(0, index, ()) for index in drawn]
    lengths = [scene.linkage.lengths for scene in scenes]
    assert max(max(bars) / min(bars) for bars in lengths) > 1e8
    kinds = {effect.key for scene in scenes for effect in scene.effects}
    assert kinds == {"gravity", "viscous", "friction", "springs", "torsion", "flywheel"}
    for scene in scenes:
        assert not list_failed(scene, EXACT)


@mark.parametrize(
    "why, seed, index",
    read_rows("""
bar 3 passes mjMAXVAL | 36 | 13
the servo passes mjMAXVAL | 811 | 57
a soft loop | 77 | 15
a flywheel whose torque is rounded | 24 | 48
a torque beyond the joints' | 25 | 12
slow friction | 811 | 2
a load at its pin | 45 | 1
a file that loads hold | 22 | 28
"""),
)
def test_a_simulation_of_uneven_bars_raises_no_alarm(why, seed, index):
    assert not list_failed(draw_random_scene(int(seed), int(index), ()), THROUGH_TIME)


@mark.parametrize(
    "library, name, drawn",
    [
        ("opensim", "opensim-constraints", (3, 19)),
        ("pydrake", "drake-inverse", (811, 26)),
    ],
)
def test_a_large_acceleration_and_a_light_crank_raise_no_alarm(library, name, drawn):
    importorskip(library)
    engine = list_engines()[name]
    importorskip(engine.library)
    assert not list_failed(draw_random_scene(*drawn, ()), [engine])


@mark.slow
def test_a_free_motion_near_a_limit_raises_no_alarm(monkeypatch):
    """The engines get theta_2, omega_2 and alpha_2 of the independent theta_4, rounded.

    What that costs is computed.
    """
    monkeypatch.setattr(released, "FORWARD", {})
    # nearer to its limits
    often = recommand(FAULT_SCENES["double rocker released"], free=Free(1.0, 4000))
    rows = judge("released", often, BY_ITSELF).rows
    assert not [row for row in rows if row.failed]
    assert DEGRADED in {row.verdict for row in rows}


def test_what_is_wrong_by_more_than_is_predicted_fails(monkeypatch):
    """The law in the condition is too strict in places.

    What is computed in its place there is no licence.
    """

    def miss(solution):
        if solution.omega_3 is not None:
            return replace(solution, omega_3=solution.omega_3 * (1.0 + 1e-11))

    spoil_formulas(monkeypatch, miss)
    rows = judge("short", SCENES["short input"], BY_ITSELF).rows
    assert {row.verdict for row in rows if row.quantity == "omega_3"} == {FAILS}


class AboutCentres(Textbook):
    """Newton and Euler in doubles: moments are about the mass centres."""

    name = "about centres"
    newton_steps = 0  # far centres would cost the angles their digits


class AMillionthOff(AboutCentres):
    name = "a millionth off"

    def answer(self, scene, command):
        answer = super().answer(scene, command)
        answer.quantities["torque"] *= 1.0 + 1e-6
        return answer


@mark.slow
def test_moments_about_far_centres_are_right_to_full_accuracy():
    """The digits that such a method loses are computed.

    The reason says for which.
    """
    importorskip("flint")
    suite = Hard()
    names = [suite.name(index) for index in range(len(suite))]
    far = [
        i for i, name in enumerate(names) if re.fullmatch("far-centres.*-10000", name)
    ]
    assert far
    answers = ("theta_3", "theta_4", "F12", "F32", "F43", "F14", "torque")
    right, wrong = (
        hold_fully(Engine(one.name, one, EQUIVALENCE, answers))
        for one in (AboutCentres, AMillionthOff)
    )
    reasons = ""
    for index in far:
        rows = judge(
            names[index],
            replace(suite.scene(index), loads=()),
            [right, wrong],
        ).rows
        failed = {(row.engine, row.quantity) for row in rows if row.failed}
        torques = {(wrong.name, "torque"), (wrong.name, "torque_inertia")}
        assert failed and failed <= torques
        reasons += " ".join(row.reason for row in rows if row.engine == right.name)
    assert "by a method in world axes or about the mass centres" in reasons


def judge_law(law):
    (row,) = check_law(make_question("law", crank_rocker(Motion(law=law)), ()))
    return row


def draw_rise(rng, kind):
    rise, duration = rng.uniform(0.1, 3.0, 2)
    return Rise(kind, (rise, duration), 0.0, steps=100)


def draw_table(rng, ends):
    """Steps of 1 ms to 1 s throw the cubic far beyond the angles between them."""
    steps = 10.0 ** rng.uniform(-3.0, 0.0, 6)
    angles = rng.uniform(-1.0, 1.0, 7) * 10.0 ** rng.uniform(-3.0, 0.5)
    angles[-1] = angles[0] + 2.0 * np.pi * rng.integers(-1, 2)
    time = (0.0, *np.cumsum(steps).tolist())
    return Law(time=time, theta_2=tuple(angles.tolist()), ends=ends)


@mark.parametrize(
    "draw, kind",
    [
        (draw_table, "free"),
        (draw_table, "rest"),
        (draw_table, "periodic"),
        (draw_rise, "345"),
        (draw_rise, "cycloidal"),
    ],
)
def test_a_right_law_is_right_at_every_step(draw, kind):
    """The acceleration of a 3-4-5 law was once told by a sum of far larger terms."""
    rng = np.random.default_rng(5)
    for _ in range(20):
        row = judge_law(draw(rng, kind))
        assert not row.failed, row


@mark.parametrize("ends", ["free", "rest", "periodic"])
def test_a_wrong_acceleration_along_a_table_of_uneven_steps_is_none_of_the_law(
    ends, monkeypatch
):
    steps = np.full(40, 0.1)
    steps[7] = 3e-5
    time = np.concatenate(([0.0], np.cumsum(steps)))
    angles = np.sin(TURN * time / time[-1])
    angles[-1] = angles[0]
    law = Law(time=tuple(time), theta_2=tuple(angles), ends=ends)

    def be_wrong(law, time, at=Law.at):
        angle, speed, acceleration = at(law, time)
        return angle, speed, 1.05 * acceleration

    assert judge_law(law).passed
    monkeypatch.setattr(Law, "at", be_wrong)
    assert judge_law(law).failed


@mark.parametrize(
    "ends, other", [("rest", "free"), ("free", "rest"), ("periodic", "free")]
)
def test_a_spline_with_other_ends_is_not_the_law(ends, other, monkeypatch):
    """Its pieces fit each other, and its speeds are those of its angles."""
    law = draw_table(np.random.default_rng(5), ends)
    at = Law.at
    monkeypatch.setattr(Law, "at", lambda law, time: at(replace(law, ends=other), time))
    assert judge_law(law).failed
