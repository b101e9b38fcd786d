"""The exact engines.

Published figures, round-off agreement, the right branch, limits, faults that must show.
"""

import math
from dataclasses import dataclass, replace
from functools import partial
from importlib.util import find_spec
from typing import Any, ClassVar

import numpy as np
import pytest

import fourbar
from fourbar.effects import (
    Effect,
    Friction,
    Gravity,
    LinearDrive,
    Load,
    PinFriction,
    Place,
    PointDrive,
    Viscous,
)
from fourbar.errors import InputError
from fourbar.linkage import Bar, FourBar, uniform
from fourbar.scene import Command, Scene, command
from fourbar.scene.motion import Motion
from fourbar.solving import solve
from fourbar_validation.compare.compare import COMPARED_QUANTITIES, Comparison, Demands
from fourbar_validation.compare.rows import AGREES, REFUSES
from fourbar_validation.compare.tolerance import EQUIVALENCE
from fourbar_validation.engines import loop, tree
from fourbar_validation.engines.balls import compute_directions, make_balls, wedge
from fourbar_validation.engines.effects import TERM_OF
from fourbar_validation.engines.limits import LIGHTEST
from fourbar_validation.engines.loop import Exact
from fourbar_validation.engines.mujoco.inverse import MujocoInverse, MujocoTree
from fourbar_validation.engines.pinocchio import PinocchioTree
from fourbar_validation.engines.registry import ENGINES, load_further
from fourbar_validation.engines.tree import keep_tree
from fourbar_validation.run.judge import judge
from fourbar_validation.scenes.random import DrawnType
from fourbar_validation.scenes.suites import Random
from tests.support.engine_limits import compile_body
from tests.support.scenes import crank_rocker, thesis
from tests.validation.engines.test_effects import ACTING, scene

ENGINE = {
    engine.name: engine
    for engine in (*ENGINES, *load_further())
    if not engine.through_time
}
TREES = ("pinocchio-inverse", "mujoco-inverse", "drake-inverse")
BARS = (*TREES, "exudyn-constraints", "opensim-constraints")
OWN = {"exudyn-constraints": {"viscous", "torsion", "springs"}}
"""Effects that an engine has elements for."""
PRINTED = 5e-10
"""The last digit of the figures, which were computed with ten."""

LOADS = (
    Load(2, (10.0, 1.0), arm=(0.05, 2.0), moment=-0.15),
    Load(3, (4.0, 0.3), from_centre=(0.1, 0.5), moment=0.3, frame="bar"),
    Load(4, (3.0, 0.1), arm=(0.02, 2.0), moment=1.0),
)
EFFECTS = (
    Gravity(),
    Viscous.at(O2=0.1, A=0.2, B=0.3, O4=0.1),
    Friction.at(O2=0.2, A=0.5, B=0.7, O4=0.1),
)
MECHANISMS = {  # ground, input, coupler, output
    "crank-rocker": (0.3, 0.1, 0.25, 0.22),
    "drag link": (0.1, 0.3, 0.25, 0.22),
    "Grashof double rocker": (0.3, 0.25, 0.1, 0.22),
    "triple rocker": (0.3, 0.25, 0.22, 0.3),
}


def present(*names):
    """Engines, each skipped by its name where it is not installed."""
    libraries = {name: ENGINE[name].library for name in names}
    return [
        pytest.param(
            name,
            marks=pytest.mark.skipif(
                bool(lib) and find_spec(lib) is None,
                reason=str(ENGINE[name].missing()),
            ),
        )
        for name, lib in libraries.items()
    ]


each_engine = pytest.mark.parametrize("name", present(*BARS))
each_tree = pytest.mark.parametrize("name", present(*TREES))
further = pytest.mark.parametrize(
    "name", present(*(engine.name for engine in load_further()))
)


def bars(lengths, ground_angle=0.4):
    """Bars whose mass centres lie off their lines."""
    d, *moving = lengths
    two, three, four = (
        Bar(x, 1.0 + x, 0.3 * x * x, (0.6 * x, 0.5 + x)) for x in moving
    )
    return FourBar(d, two, three, four, ground_angle)


def random_linkage(rng, shortest):
    """Draw lengths from 10^shortest to 1."""
    while True:
        try:
            return bars(
                tuple(10.0 ** rng.uniform(shortest, 0.0, 4)), rng.uniform(-3.0, 3.0)
            )
        except InputError:
            continue


def answered(name, case, at=None):
    return ENGINE[name].start().answer(case, at or command(case))


def failures(name, case, every=1):
    """Quantities on which an engine and the formulas disagree, or its refusal."""
    commanded = command(case)
    commanded = commanded._replace(
        angle=commanded.theta_2[::every],
        branch=commanded.branch[::every],
    )
    answer = answered(name, case, commanded)
    if answer.refusal is not None:
        return [("refusal", answer.refusal)]
    comparison = Comparison(
        "scene",
        case,
        answer,
        solve(case, "force", at=commanded),
        Demands(EQUIVALENCE, COMPARED_QUANTITIES),
    )
    rows = [*comparison.rows(), comparison.closure()]
    return [(row.quantity, row.reason) for row in rows if not row.passed]


@each_engine
def test_thesis_figures(name):
    got = answered(name, thesis()).quantities
    assert got["torque"][0] == pytest.approx(3.0930935923, abs=PRINTED, rel=0.0)
    figures = {"F12": (7.033117757, -2.121209407), "F32": (-15.480491243, 0.568582894)}
    figures |= {
        "F43": (-15.476569658, 0.555136181),
        "F14": (-15.476837016, 0.551901654),
    }
    for force, figure in figures.items():
        assert got[force][0] == pytest.approx(figure, abs=PRINTED, rel=0.0), force


@pytest.mark.slow
@each_engine
@pytest.mark.parametrize("lengths", MECHANISMS.values(), ids=MECHANISMS.keys())
def test_agrees_to_round_off(name, lengths):
    for drive in (2, 3, 4):
        for branch in (1, -1):
            case = Scene(
                bars(lengths), Motion(None, 10.0, 3.0, branch), drive, LOADS, EFFECTS
            )
            assert failures(name, case, every=12) == [], (drive, branch)


@pytest.mark.slow
@further
def test_each_load_and_effect(name):
    assert {effect: failures(name, scene(effect)) for effect in ACTING} == {
        effect: [] for effect in ACTING
    }
    case = scene(*ACTING)
    for drive in (2, 3, 4):
        for branch in (1, -1):
            motion = case.motion.replace(branch=branch, speed=-7.0)
            assert (
                failures(name, replace(case, drive_bar=drive, motion=motion)) == []
            ), (drive, branch)


@further
def test_random_linkages(name):
    suite = Random(20, 3, tuple(DrawnType))
    for index in range(len(suite)):
        drawn = suite.scene(index)
        assert failures(name, drawn, every=6) == [], suite.name(index)


@pytest.mark.slow
@further
@pytest.mark.parametrize("frame", ["world", "bar"])
@pytest.mark.parametrize("bar", [2, 3, 4])
def test_a_force_at_a_point_drives(name, bar, frame):
    drive = PointDrive(Place(bar, (0.17, 0.6)), 1.1, frame)
    for lengths in MECHANISMS.values():
        motion = Motion(None, 10.0, 3.0)
        case = Scene(bars(lengths), motion, None, LOADS, EFFECTS, drive=drive)
        assert failures(name, case, every=12) == []


@pytest.mark.slow
@pytest.mark.parametrize("name", present(*TREES, "free-body"))
def test_it_assembles_where_the_circles_meet_and_on_the_commanded_branch(name):
    """On random linkages, bars up to a million times shorter than others.

    B lies left of the diagonal on branch +1.
    """
    rng = np.random.default_rng(7)
    missing = 0
    for number in range(200):
        linkage = random_linkage(rng, -6.0 if number % 2 else -1.0)
        theta_2 = rng.uniform(-10.0, 10.0, 8)
        branch = rng.choice(np.array([1, -1], dtype=np.int8), 8)
        answer = answered(
            name, Scene(linkage, Motion(theta_2)), Command(theta_2, branch, None, 0.0)
        )
        a, b = answer.quantities["A"], answer.quantities["B"]
        foot = linkage.ground * np.array(
            [math.cos(linkage.ground_angle), math.sin(linkage.ground_angle)]
        )
        side = (foot - a)[:, 0] * (b - a)[:, 1] - (foot - a)[:, 1] * (b - a)[:, 0]
        # circles about A and O4 meet: the criterion, from squares of lengths alone
        squared = (
            (foot - linkage.input.length * np.c_[np.cos(theta_2), np.sin(theta_2)]) ** 2
        ).sum(axis=1)
        lengths = linkage.coupler.length, linkage.output.length
        miss = np.maximum(
            squared - sum(lengths) ** 2, (lengths[0] - lengths[1]) ** 2 - squared
        )
        sure = np.abs(miss) > 1e-14 * sum(linkage.lengths) ** 2
        here = answer.assembled
        assert np.array_equal(here[sure], miss[sure] < 0.0)
        assert np.array_equal(np.sign(side[here & sure]), branch[here & sure])
        assert np.isnan(b[~here]).all()
        missing += int((~here).sum())
    assert missing > 100, "the sample must hold positions that do not assemble"


@each_engine
@pytest.mark.parametrize("offset", [1e-3, 1e-6, 1e-9, 1e-12])
def test_assembles_up_to_a_limit_and_not_beyond(name, offset):
    linkage = bars(MECHANISMS["triple rocker"], 0.0)
    d, a, b, c = linkage.lengths
    limit = math.acos(
        (d * d + a * a - (b + c) ** 2) / (2.0 * d * a)
    )  # bars 3 and 4 stretched
    for sign in (1, -1):
        for branch in (1, -1):
            answer = answered(
                name, Scene(linkage, Motion(limit - sign * offset, 1.0, branch=branch))
            )
            if answer.refusal is not None:  # Simbody's declared limit
                assert "dependent" in answer.refusal and offset < 1e-6
                continue
            assert bool(answer.assembled[0]) == (sign > 0)
            assert np.isnan(answer.quantities["torque"][0]) == (not answer.assembled[0])


@each_engine
def test_positions_only(name):
    quantities = answered(
        name, Scene(bars(MECHANISMS["crank-rocker"]), Motion(np.array([0.5, 1.0])))
    ).quantities
    assert (
        "theta_3" in quantities
        and "torque" not in quantities
        and "omega_3" not in quantities
    )


@each_tree
def test_angles_are_continuous(name):
    theta_4 = answered(
        name,
        Scene(bars(MECHANISMS["drag link"]), Motion(np.linspace(0.0, 12.0, 240), 1.0)),
    )
    theta_4 = theta_4.quantities["theta_4"]
    assert -math.pi < theta_4[0] <= math.pi
    assert np.abs(np.diff(theta_4)).max() < 1.0
    assert np.ptp(theta_4) > math.tau


def with_bar(number, **values):
    """A crank-rocker with another mass, inertia or mass centre of one bar."""
    bars = {2: Bar(0.1, 0.2), 3: Bar(0.25, 0.5), 4: Bar(0.22, 0.4)}
    bars[number] = Bar(bars[number].length, **values)
    return Scene(
        FourBar(0.3, bars[2], bars[3], bars[4]),
        Motion(np.linspace(0.1, 6.0, 6), 10.0, 3.0),
        2,
        LOADS,
    )


MASSLESS = {"mass": 0.0}, {"mass": 0.0, "inertia": 0.1}
POINT = {"mass": 1.0, "inertia": 0.0, "centre": (0.0, 0.0)}
REFUSED = {
    "pinocchio-inverse": ((), ()),
    "mujoco-inverse": ((2, 3, 4), (2, 3, 4)),
    "exudyn-constraints": ((), ()),
    "opensim-constraints": ((2, 3, 4), (2,)),
    "drake-inverse": ((2, 3, 4), (3, 4)),
}
"""The bars that an engine refuses without mass, and without inertia about their pin."""


@each_engine
def test_bars_without_mass_or_inertia(name):
    """Exudyn and Pinocchio hold them.

    MuJoCo and OpenSim would drop them, and OpenSim and Drake divide by some.
    """
    without_mass, without_inertia = REFUSED[name]
    for number in (2, 3, 4):
        for values, refused in (
            *((massless, without_mass) for massless in MASSLESS),
            (POINT, without_inertia),
        ):
            failed = failures(name, with_bar(number, **values))
            if number in refused:
                assert failed[0][0] == "refusal" and f"bar {number}" in failed[0][1]
            else:
                assert failed == []


@each_engine
def test_light_bars_are_held_or_refused(name):
    """Below 2.2e-16 kg Pinocchio, which sums two inertias, puts the mass centre
    elsewhere.
    """
    linkage = with_bar(2, mass=0.2).linkage
    light = {
        bar: replace(getattr(linkage, bar), mass=1e-18)
        for bar in ("input", "coupler", "output")
    }
    case = Scene(replace(linkage, **light), Motion(np.linspace(0.1, 6.0, 6), 10.0, 3.0))
    assert failures(name, case) == [] or (
        name == "mujoco-inverse" and failures(name, case)[0][0] == "refusal"
    )


def test_the_floor_of_mujoco_is_where_it_is_stated_to_be():
    d, a, b, c = MECHANISMS["crank-rocker"]
    case = Scene(
        FourBar(
            d, Bar(a, 1.0), Bar(b, 1.0), Bar(c, LIGHTEST.boundary, LIGHTEST.boundary)
        )
    )
    assert MujocoInverse().answer(case, command(case)).refusal is None
    compile_body(LIGHTEST.boundary, LIGHTEST.boundary)
    for mass, inertia in (
        (0.9 * LIGHTEST.boundary, LIGHTEST.boundary),
        (LIGHTEST.boundary, 0.9 * LIGHTEST.boundary),
    ):
        below = replace(
            case,
            linkage=replace(case.linkage, output=Bar(c, mass, inertia)),
        )
        assert MujocoInverse().answer(below, command(below)).refusal is not None
        with pytest.raises(ValueError, match="mass and inertia"):
            compile_body(mass, inertia)


@pytest.mark.parametrize("name", present("opensim-constraints"))
def test_simbody_loses_a_constraint_where_the_limit_says(name, monkeypatch):
    """Bars 3 and 4 nearly in one line.

    Just inside the limit it is exact, well beyond it the force is lost.
    """
    from fourbar_lab.engines import opensim

    linkage = with_bar(2, mass=0.2).linkage
    linkage = replace(
        linkage,
        input=Bar(0.25, 0.2),
        coupler=Bar(0.22, 0.5),
        output=Bar(0.3, 0.4),
    )
    d, a, b, c = linkage.lengths
    limit = math.acos((d * d + a * a - (b + c) ** 2) / (2.0 * d * a))

    def near(offset):
        return Scene(linkage, Motion(limit - offset, 1.0))

    assert failures(name, near(1e-6)) == []
    assert "drops" in failures(name, near(1e-13))[0][1]
    monkeypatch.setattr(opensim, "LEAST_CONDITIONED", 0.0)
    assert {"F12", "F32", "F43", "F14", "torque"} <= {
        quantity for quantity, _ in failures(name, near(1e-13))
    }


@dataclass(frozen=True)
class Wind(Effect):
    """An effect that no engine knows."""

    key: ClassVar[str] = "wind"


@each_engine
def test_what_has_no_model_is_refused_by_name(name):
    assert "'wind'" in (
        answered(name, replace(scene(), effects=(Wind(),))).refusal or ""
    )


def scaled(method, factor):
    """A method that answers another number."""
    return lambda *arguments: method(*arguments) * factor


def wrong_loop_force(right):
    return lambda self, force, torque: right(self, (-force[0], -force[1]), torque)


def no_drift(_):
    return lambda self, v: (0.0, 0.0)


def nothing_on_bar_3(right):
    return lambda self, bar, couple: None if bar == 3 else right(self, bar, couple)


def longer(right):
    return lambda self: {
        bar: [axis * (1.0 + 1e-9) for axis in force]
        for bar, force in right(self).items()
    }


def larger(right):
    return lambda self, bar: right(self, bar) + 1e-13


IN_A_TREE = {
    "drift": (no_drift, {"alpha_3", "alpha_4", "torque", "F12"}),
    "turn": (partial(scaled, factor=1.0 + 1e-9), {"alpha_3", "a_B", "torque"}),
    "rotation": (partial(scaled, factor=1.0 + 1e-9), {"F43", "torque"}),
    "forces": (wrong_loop_force, {"F12", "F32", "F14"}),
    "carried": (longer, {"F12", "F32", "F14"}),
    "couple": (nothing_on_bar_3, {"torque"}),
    "angle": (larger, {"theta_3", "theta_4"}),
}
PLANTED = {
    **dict.fromkeys(TREES, IN_A_TREE),
    "exudyn-constraints": {
        "_sum_applied": (
            partial(scaled, factor=1.0 + 1e-9),
            {"F12", "F32", "F43", "F14", "torque"},
        ),
        "acceleration": (partial(scaled, factor=0.0), {"alpha_3", "alpha_4", "torque"}),
        "_read_constraint_jacobian": (
            partial(scaled, factor=1.0 + 1e-9),
            {"omega_3", "omega_4", "torque"},
        ),
        "rotation": (partial(scaled, factor=1.0 + 1e-9), {"F43", "torque"}),
        "couple": (nothing_on_bar_3, {"torque"}),
        "angle": (larger, {"theta_3", "theta_4"}),
    },
    "opensim-constraints": {
        "_differentiate_constraints": (
            partial(scaled, factor=1.0 + 1e-9),
            {"omega_3", "omega_4", "torque"},
        ),
        "_read_reaction": (partial(scaled, factor=1.0 + 1e-9), {"F12", "F43", "F14"}),
        "_compute_closing_force": (partial(scaled, factor=-1.0), {"F32"}),
        "rotation": (partial(scaled, factor=1.0 + 1e-9), {"F43", "torque"}),
        "couple": (nothing_on_bar_3, {"torque"}),
        "angle": (larger, {"theta_3", "theta_4"}),
    },
}
"""By engine and method: what is put in its place, and the quantities on which that must
show.
"""


SPOILED = Scene(
    bars(MECHANISMS["crank-rocker"]),
    Motion(np.linspace(0.3, 6.0, 6), 10.0, 3.0),
    4,
    LOADS,
    EFFECTS,
)


def judged(name):
    return {failed_quantity for failed_quantity, _ in failures(name, SPOILED)}


@each_engine
def test_a_planted_fault_shows(name, monkeypatch):
    owner: Any = type(ENGINE[name].start().build(SPOILED))  # type: ignore[attr-defined]
    assert judged(name) == set()
    for method, (fault, seen) in PLANTED[name].items():
        with monkeypatch.context() as patch:
            patch.setattr(tree, "_KEPT", {})  # a tree is asked once for its turns
            patch.setattr(owner, method, fault(getattr(owner, method)))
            assert seen <= judged(name), method
    right = loop.Assembler.find
    monkeypatch.setattr(
        loop.Assembler,
        "find",
        lambda self, theta_2, branch: right(self, theta_2, -branch),
    )
    assert {"theta_3", "theta_4", "torque"} <= judged(name)


MOVED = (
    "A",
    "theta_3",
    "theta_4",
    "omega_2",
    "omega_3",
    "alpha_2",
    "alpha_4",
    "a_B",
    "F12",
    "F32",
    "F43",
    "F14",
)
OUTPUT, COUPLER = np.linspace(1.8, 2.5, 8), np.linspace(0.4, 0.8, 8)
STROKES = {
    2: (
        LinearDrive(Place(1, (0.3, 2.2)), Place(2, (0.12, 0.4))),
        fourbar.Sweep(0.25, 0.35, 8),
        "left",
    ),
    4: (
        LinearDrive(Place(1, (0.5, -0.5)), Place(4, (0.09, 0.7))),
        fourbar.Sweep(0.33, 0.36, 8),
        "right",
    ),
}


def commanded(what, branch):
    """A crank-rocker commanded at another bar than the input, or by a stroke.

    The stroke is that of the cylinder that drives it.
    """
    if what in ("theta_3", "theta_4"):
        bar, angles = (
            int(what[-1]),
            (OUTPUT if what == "theta_4" else COUPLER) + 20.0 * math.pi,
        )
        stated = {
            what: angles,
            f"omega_{bar}": 3.0,
            f"alpha_{bar}": -2.0,
            "branch": branch,
        }
        return crank_rocker(motion=Motion(**stated), drive_bar=bar)
    drive, sweep, side = STROKES[int(what[-1])]
    stated = {
        "stroke": sweep,
        "stroke_speed": 0.2,
        "stroke_acceleration": 0.1,
        "side": side,
        "branch": branch,
    }
    return crank_rocker(motion=Motion(**stated), drive=drive)


@each_engine
@pytest.mark.parametrize(
    "what", ["theta_3", "theta_4", "stroke of bar 2", "stroke of bar 4"]
)
def test_an_engine_closes_its_own_loop_from_whatever_is_commanded(
    name, what, monkeypatch
):
    for branch in (1, -1):
        case = commanded(what, branch)
        rows = [
            row for row in judge("", case, [ENGINE[name]]).rows if row.engine == name
        ]
        if name == "opensim-constraints" and what == "theta_3":
            assert [
                (row.verdict, "theta_3 is commanded" in row.reason) for row in rows
            ] == [(REFUSES, True)]
            continue
        assert not [row for row in rows if row.failed], branch
        held = {row.quantity for row in rows if row.verdict == AGREES}
        assert {
            *MOVED,
            "torque" if case.drive is None else "drive_force",
            "closure",
        } <= held
        right = loop.Assembler.find
        with monkeypatch.context() as patch:
            patch.setattr(
                loop.Assembler,
                "find",
                lambda self, theta, branch, find=right: find(self, theta, -branch),
            )
            assert [
                row
                for row in judge("", case, [ENGINE[name]]).rows
                if row.engine == name and row.failed
            ]


def twice(row):
    """A row of a table that acts two times."""
    return lambda effect, bars: (row(effect, bars), row(effect, bars))


@further
@pytest.mark.parametrize("key", sorted(TERM_OF.keys() - {"gravity"}))
def test_a_fault_in_a_row_shows_but_where_an_engine_has_its_own(name, key, monkeypatch):
    """Also in what depends on the load of a pin."""
    monkeypatch.setitem(TERM_OF, key, twice(TERM_OF[key]))
    shown = {quantity for quantity, _ in failures(name, scene(key))}
    assert shown == set() if key in OWN.get(name, ()) else "torque" in shown


@pytest.mark.parametrize("name", present("exudyn-constraints"))
def test_a_fault_in_an_element_of_exudyn_shows(name, monkeypatch):
    from fourbar_lab.engines.exudyn_elements import ELEMENT_OF

    assert ELEMENT_OF.keys() == OWN[name]
    for key in OWN[name]:
        monkeypatch.setitem(ELEMENT_OF, key, twice(ELEMENT_OF[key]))
        assert {"F43", "torque"} <= {
            quantity for quantity, _ in failures(name, scene(key))
        }, key


@each_engine
@pytest.mark.parametrize("index", [63, 97])
def test_a_steady_input_keeps_its_digits_beside_bars_that_are_fast(name, index):
    """The acceleration of A is judged by what bar 2 does alone.

    Bars 3 and 4 accelerate up to 4000 rad/s^2 there, and what is solved for all bars at
    once must not leave their rounding in bar 2.
    """
    case = Random(index + 1, 3, tuple(DrawnType)).scene(index)
    assert failures(name, case) == []


@each_engine
def test_a_thousand_turns_take_no_position(name):
    linkage, angles = bars(MECHANISMS["crank-rocker"]), np.array([1.0, 4.0])
    near, far = (
        answered(name, Scene(linkage, Motion(x, 10.0, 3.0)))
        for x in (angles, angles + 2000.0 * math.pi)
    )
    assert far.assembled is not None and far.assembled.all()
    np.testing.assert_allclose(
        far.quantities["torque"],
        near.quantities["torque"],
        rtol=1e-9,
    )


@each_engine
def test_a_position_before_leaves_nothing_behind(name):
    fast = Scene(
        bars(MECHANISMS["crank-rocker"]), Motion(np.array([1.0, 2.0]), 3e4, 1e9)
    )
    quantities, commanded = answered(name, fast).quantities, command(fast)
    alone = answered(
        name,
        fast,
        commanded._replace(angle=commanded.theta_2[1:], branch=commanded.branch[1:]),
    ).quantities
    for quantity in ("omega_3", "alpha_4", "F12", "F43", "torque"):
        np.testing.assert_array_equal(
            quantities[quantity][1:],
            alone[quantity],
            err_msg=quantity,
        )
        assert np.isfinite(alone[quantity]).all(), quantity


@pytest.mark.parametrize("kind", [PinocchioTree, MujocoTree])
def test_a_scene_before_leaves_nothing_behind(kind):
    """An engine keeps one tree for all its scenes."""
    linkage, motion = (
        bars(MECHANISMS["crank-rocker"]),
        Motion(np.linspace(0.0, 6.0, 5), 10.0, 3.0),
    )
    plain, loaded = (
        Scene(linkage, motion),
        Scene(replace(linkage, ground=0.31), motion, 4, LOADS, EFFECTS),
    )
    kept = Exact("kept", partial(keep_tree, kind))
    kept.answer(loaded, command(loaded))
    after, fresh = (
        engine.answer(plain, command(plain)).quantities
        for engine in (kept, Exact("fresh", kind))
    )
    for name, values in fresh.items():
        np.testing.assert_array_equal(after[name], values, err_msg=name)


@pytest.mark.parametrize(
    ("drive", "mu", "r", "theta_2"),
    [
        (4, 0.3, 0.1, 1.0891061452513966),
        (4, 0.5, 0.05, 1.0198324022346368),
        (3, 0.5, 0.05, 5.106983240223463),
    ],
)
def test_near_a_jam_an_engine_finds_the_one_solution_that_there_is(
    drive, mu, r, theta_2
):
    link, motion = uniform(0.3, 0.1, 0.25, 0.22), Motion(np.array([theta_2]), 3.0, 2.0)
    for arms, jams in ((r, False), (50.0, True)):
        friction = PinFriction.at(**dict.fromkeys(("A", "B", "O4"), (mu, arms)))
        case_of_link = Scene(link, motion, drive, (), (Gravity(), friction))
        names = ("pinocchio-inverse", "free-body")
        answers = [
            ENGINE[name].start().answer(case_of_link, command(case_of_link))
            for name in names
        ]
        engine, bodies = (answer.quantities["torque"][0] for answer in answers)
        assert math.isnan(engine) is math.isnan(bodies) is jams
        assert jams or abs(engine - bodies) <= 1e-9 * abs(
            bodies
        )  # of some 1e-12 that rounding leaves near a jam


@pytest.mark.parametrize("ground_angle", [0.0, 1.0, 2.5])
def test_a_loop_that_just_closes_closes_however_the_ground_is_turned(ground_angle):
    """Its discriminant is 0 exactly.

    From turned directions it was undecided, and read as open.
    """
    bars = (Bar(length) for length in (1.0, 2.0, 4.0))
    folded = Scene(
        FourBar(3.0, *bars, ground_angle=ground_angle), Motion(ground_angle, 1.0)
    )  # type: ignore[misc]
    closed = compute_directions(make_balls(folded, ground_angle), 1)
    assert closed is not None and abs(float(wedge(*closed[1:]).mid())) < 1e-60
    apart = replace(folded, linkage=replace(folded.linkage, ground=3.0 - 1e-15))
    assert compute_directions(make_balls(apart, ground_angle), 1) is None
