"""The exact engines.

Published figures, round-off agreement, the right branch, limits, faults that must show.
"""

from dataclasses import dataclass, replace
from importlib.util import find_spec
from itertools import combinations, product, starmap
from math import isnan, pi
from typing import ClassVar

import numpy as np
from pytest import approx, mark, param

from fourbar import Sweep, solve
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
from fourbar.linkage import Bar, FourBar, uniform
from fourbar.scene import Scene, command
from fourbar.scene.motion import Motion
from fourbar_validation.compare.compare import COMPARED_QUANTITIES, Comparison, Demands
from fourbar_validation.compare.rows import AGREES, REFUSES
from fourbar_validation.compare.tolerance import EQUIVALENCE
from fourbar_validation.engines import free_body_closure, loop
from fourbar_validation.engines.balls import compute_directions, make_balls, wedge
from fourbar_validation.engines.registry import ENGINES, load_further
from fourbar_validation.scenes.random import DrawnType
from fourbar_validation.scenes.suites import Random
from tests.support.here import judge_by
from tests.support.rows import each_branch, slow_but
from tests.support.scenes import (
    UNIFORM,
    crank_rocker,
    find_angle,
    recommand,
    relink,
    thesis,
)
from tests.validation.engines.test_tree import ACTING, scene

ENGINE = {
    engine.name: engine
    for engine in (*ENGINES, *load_further())
    if not engine.through_time
}
TREES = ("pinocchio-inverse", "mujoco-inverse", "drake-inverse")
BARS = (*TREES, "exudyn-constraints", "opensim-constraints")
PRINTED = 5e-10
"""The last digit of the figures, which were computed with ten."""

SIX = np.linspace(0.1, 6.0, 6)
"""Angles of the input, rad."""
LOADS = (
    Load(
        2,
        (10.0, 1.0),
        arm=(0.05, 2.0),
        moment=-0.15,
    ),
    Load(
        3,
        (4.0, 0.3),
        from_centre=(0.1, 0.5),
        moment=0.3,
        frame="bar",
    ),
    Load(
        4,
        (3.0, 0.1),
        arm=(0.02, 2.0),
        moment=1.0,
    ),
)
EFFECTS = (
    Gravity(),
    Viscous.at(
        O2=0.1,
        A=0.2,
        B=0.3,
        O4=0.1,
    ),
    Friction.at(
        O2=0.2,
        A=0.5,
        B=0.7,
        O4=0.1,
    ),
)
MECHANISMS = {  # ground, input, coupler, output
    "crank-rocker": (0.3, 0.1, 0.25, 0.22),
    "drag link": (0.1, 0.3, 0.25, 0.22),
    "Grashof double rocker": (0.3, 0.25, 0.1, 0.22),
    "triple rocker": (0.3, 0.25, 0.22, 0.3),
}


def present(*names):
    """Parametrize by engines, each skipped by its name where it is not installed."""

    def skip(engine):
        absent = bool(engine.library) and find_spec(engine.library) is None
        return mark.skipif(absent, reason=str(engine.missing()))

    some = [param(name, marks=skip(ENGINE[name])) for name in names]
    return mark.parametrize("name", some)


each_engine = present(*BARS)


def bars(lengths, ground_angle=0.4):
    """Bars whose mass centres lie off their lines."""
    d, *moving = lengths
    two, three, four = (
        Bar(x, 1.0 + x, 0.3 * x * x, (0.6 * x, 0.5 + x)) for x in moving
    )
    return FourBar(
        d,
        two,
        three,
        four,
        ground_angle,
    )


CRANK_ROCKER = bars(MECHANISMS["crank-rocker"])
TRIPLE_ROCKER = bars(MECHANISMS["triple rocker"], 0.0)


def answered(name, case, at=None):
    return ENGINE[name].start().answer(case, at or command(case))


def at_limit(linkage, offset, branch=1):
    """A scene at an angle before bars 3 and 4 are stretched."""
    d, a, b, c = linkage.lengths
    return Scene(linkage, Motion(find_angle(b + c, d, a) - offset, 1.0, branch=branch))


def failures(name, case, every=1):
    """Quantities on which an engine and the formulas disagree, or its refusal."""
    commanded = command(case).part(slice(None, None, every))
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
    assert {"F12", "torque" if case.drive is None else "stroke_speed"} <= {
        row.quantity for row in rows
    }
    return [(row.quantity, row.reason) for row in rows if not row.passed]


FIGURES = {
    "torque": 3.0930935923,
    "F12": (7.033117757, -2.121209407),
    "F32": (-15.480491243, 0.568582894),
    "F43": (-15.476569658, 0.555136181),
    "F14": (-15.476837016, 0.551901654),
}
"""Published figures of the thesis's mechanism."""


@each_engine
def test_thesis_figures(name):
    got = answered(name, thesis()).quantities
    for quantity, figure in FIGURES.items():
        assert got[quantity][0] == approx(figure, abs=PRINTED, rel=0.0)


def turn(lengths, **parts):
    """A whole turn or range of a mechanism under all loads."""
    parts = {"loads": LOADS, "effects": EFFECTS} | parts
    return Scene(bars(lengths), **{"motion": Motion(None, 10.0, 3.0)} | parts)


def at_once(drive, branch):
    case = recommand(scene(*ACTING), branch=branch, speed=-7.0)
    return replace(case, drive_bar=drive)


def driven(one, other, branch, effects):
    """A crank-rocker with a cylinder between places of two bars."""
    drive = LinearDrive(Place(one, (0.17, -1.1)), Place(other, (0.09, 0.7)))
    motion = Motion(
        np.linspace(0.1, 6.2, 25),
        10.0,
        5.0,
        branch,
    )
    return crank_rocker(motion, drive=drive, effects=effects)


DRIVES, BRANCHES = (2, 3, 4), (1, -1)
SLIDING = PinFriction.at(A=(0.1, 0.005), O4=(0.2, 0.004))
AGREEING = {
    "mechanisms": lambda: [
        turn(lengths, drive_bar=drive, motion=Motion(None, 10.0, 3.0, branch))
        for lengths, drive, branch in product(MECHANISMS.values(), DRIVES, BRANCHES)
    ],
    "loads and effects": lambda: map(scene, ACTING),
    "all at once": lambda: starmap(at_once, product(DRIVES, BRANCHES)),
    "random": lambda: map(RANDOM.scene, range(len(RANDOM))),
    "force at a point": lambda: [
        turn(lengths, drive=PointDrive(Place(bar, (0.17, 0.6)), 1.1, frame))
        for lengths, bar, frame in product(
            MECHANISMS.values(), DRIVES, ("world", "bar")
        )
    ],
    "cylinder": lambda: [
        driven(*pair, branch, (Gravity(), effect))
        for pair, branch, effect in product(
            combinations((1, 2, 3, 4), 2), BRANCHES, (Viscous.at(B=0.02), SLIDING)
        )
    ],
}
"""Scenes on which every engine agrees to round-off."""
EVERY = {"mechanisms": 12, "random": 6, "force at a point": 12}
"""One position of so many is asked, of another kind each."""
RANDOM = Random(20, 3, tuple(DrawnType))


@mark.slow
@present(*BARS, "free-body")
@mark.parametrize("kind", AGREEING)
def test_agrees_to_round_off(name, kind):
    for case in AGREEING[kind]():
        assert failures(name, case, EVERY.get(kind, 1)) == []


@each_engine
@mark.parametrize("offset", [1e-3, 1e-6, 1e-9, 1e-12])
@each_branch
def test_assembles_up_to_a_limit_and_not_beyond(name, offset, branch):
    for sign in (1, -1):
        answer = answered(name, at_limit(TRIPLE_ROCKER, sign * offset, branch))
        if answer.refusal is not None:  # Simbody's declared limit
            assert "dependent" in answer.refusal and offset < 1e-6
            continue
        (assembled,) = answer.assembled
        assert assembled == (sign > 0)
        assert np.isnan(answer.quantities["torque"][0]) == (not assembled)


@present(*TREES, "free-body")
@mark.parametrize("commanded", ["theta_2", "theta_3", "theta_4"])
def test_newtons_steps_close_a_loop_whose_start_is_off(name, commanded, monkeypatch):
    """And leave one that cannot close open."""
    for module, start in (
        (loop, "_compute_triangle_angle"),
        (free_body_closure, "_compute_angle_between"),
    ):
        right = getattr(module, start)
        monkeypatch.setattr(module, start, lambda *sides, f=right: f(*sides) + 0.02)
    motion = Motion(**{commanded: np.linspace(0.05, 6.25, 40)})
    answer = answered(name, Scene(TRIPLE_ROCKER, motion))
    right = solve(Scene(TRIPLE_ROCKER, motion), "position")
    np.testing.assert_array_equal(answer.assembled, right.assembled)
    assert right.assembled.any()
    for bar in {2, 3, 4} - {int(commanded[-1])}:
        theta = getattr(right, f"theta_{bar}")
        got = answer.quantities[f"theta_{bar}"]
        assert abs(np.sin(got - theta))[right.assembled].max() < 1e-14
        assert np.isnan(got)[~right.assembled].all()


@present(*TREES, "free-body")
@mark.parametrize(
    "lengths, motion",
    [
        ((0.1, 0.1, 0.3, 0.3), {"theta_2": np.array([0.0, 1.0, 2.0, 3.0])}),
        (
            (
                0.2847894033060021,
                0.18418422905598003,
                0.6865587568491892,
                0.5859535825991671,
            ),
            {"theta_3": np.array([9.03e-13])},
        ),
    ],
)
def test_a_loop_closes_on_its_change_points_and_beside(name, lengths, motion):
    """What rounds there must not leave it open: nothing would be compared."""
    scene = Scene(uniform(*lengths), Motion(**motion))
    assert solve(scene, "position").assembled.all()
    assert answered(name, scene).assembled.all()


def with_bar(number, **values):
    """A crank-rocker with another mass, inertia or mass centre of one bar."""
    bars = {2: Bar(0.1, 0.2), 3: Bar(0.25, 0.5), 4: Bar(0.22, 0.4)}
    bars[number] = Bar(bars[number].length, **values)
    return Scene(
        FourBar(0.3, *bars.values()),
        Motion(SIX, 10.0, 3.0),
        2,
        LOADS,
    )


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
@mark.parametrize("number", [2, 3, 4])
def test_bars_without_mass_or_inertia(name, number):
    """Exudyn and Pinocchio hold them.

    MuJoCo and OpenSim would drop them, and OpenSim and Drake divide by some.
    """
    without_mass, without_inertia = REFUSED[name]
    for values in ({"mass": 0.0}, {"mass": 0.0, "inertia": 0.1}, POINT):
        failed = failures(name, with_bar(number, **values))
        if number in (without_inertia if values is POINT else without_mass):
            assert failed[0][0] == "refusal" and f"bar {number}" in failed[0][1]
        else:
            assert failed == []


@each_engine
def test_light_bars_are_held_or_refused(name):
    """Below 2.2e-16 kg Pinocchio, which sums two inertias, puts the mass centre
    elsewhere.
    """
    light = FourBar(0.3, *(Bar(length, 1e-18) for length in (0.1, 0.25, 0.22)))
    failed = failures(name, Scene(light, Motion(SIX, 10.0, 3.0)))
    refused = name == "mujoco-inverse" and failed[0][0] == "refusal"
    assert failed == [] or refused


@dataclass(frozen=True)
class Wind(Effect):
    """An effect that no engine knows."""

    key: ClassVar[str] = "wind"


@each_engine
def test_what_has_no_model_is_refused_by_name(name):
    assert "'wind'" in answered(name, replace(scene(), effects=(Wind(),))).refusal


PLANTED = {
    "rotation": (
        lambda right: lambda *arguments: right(*arguments) * (1.0 + 1e-9),
        {"F43", "torque"},
    ),
    "couple": (
        lambda right: (
            lambda self, bar, couple: None if bar == 3 else right(self, bar, couple)
        ),
        {"torque"},
    ),
    "angle": (
        lambda right: lambda self, bar: right(self, bar) + 1e-13,
        {"theta_3", "theta_4"},
    ),
}
"""By method: what is put in its place, and the quantities on which that must show."""


SPOILED = Scene(
    CRANK_ROCKER, Motion(np.linspace(0.3, 6.0, 6), 10.0, 3.0), 4, LOADS, EFFECTS
)
find_right = loop.Assembler.find


def find_other_branch(self, angle, branch):
    return find_right(self, angle, -branch)


def judged(name):
    return {failed_quantity for failed_quantity, _ in failures(name, SPOILED)}


@each_engine
def test_a_planted_fault_shows(name, monkeypatch):
    owner = type(ENGINE[name].start().build(SPOILED))
    assert judged(name) == set()
    for method, (fault, seen) in PLANTED.items():
        with monkeypatch.context() as patch:
            patch.setattr(owner, method, fault(getattr(owner, method)))
            assert seen <= judged(name), method
    monkeypatch.setattr(loop.Assembler, "find", find_other_branch)
    assert {"theta_3", "theta_4", "torque"} <= judged(name)


MOVED = {"A", "theta_3", "theta_4", "omega_2", "omega_3", "alpha_2", "alpha_4", "a_B"}
MOVED |= {"F12", "F32", "F43", "F14", "closure"}
LATER = 20.0 * pi
COMMANDED = {
    "theta_3": (np.linspace(0.4, 0.8, 8) + LATER, 3.0, -2.0),
    "theta_4": (np.linspace(1.8, 2.5, 8) + LATER, 3.0, -2.0),
    "stroke of bar 2": (Sweep(0.25, 0.35, 8), 0.2, 0.1),
    "stroke of bar 4": (Sweep(0.33, 0.36, 8), 0.2, 0.1),
}
"""Values and two rates of what is commanded."""
CYLINDERS = {
    "stroke of bar 2": (
        LinearDrive(Place(1, (0.3, 2.2)), Place(2, (0.12, 0.4))),
        "left",
    ),
    "stroke of bar 4": (
        LinearDrive(Place(1, (0.5, -0.5)), Place(4, (0.09, 0.7))),
        "right",
    ),
}


def commanded(what, branch):
    """A crank-rocker commanded at another bar than the input, or by a stroke.

    The stroke is that of the cylinder that drives it.
    """
    if what in CYLINDERS:
        drive, side = CYLINDERS[what]
        names = ("stroke", "stroke_speed", "stroke_acceleration")
        driven = {"drive": drive}
    else:
        side, bar = None, what[-1]
        names = (what, f"omega_{bar}", f"alpha_{bar}")
        driven = {"drive_bar": int(bar)}
    stated = dict(zip(names, COMMANDED[what], strict=True))
    return crank_rocker(Motion(**stated, side=side, branch=branch), **driven)


@each_engine
@mark.parametrize("what", COMMANDED)
@mark.parametrize("branch", slow_but({-1}, [1, -1]))
def test_an_engine_closes_its_own_loop_from_whatever_is_commanded(
    name, what, branch, monkeypatch
):
    case = commanded(what, branch)
    if name == "opensim-constraints" and what == "theta_3":
        (row,) = judge_by(ENGINE[name], case).values()
        assert row.verdict == REFUSES and "theta_3 is commanded" in row.reason
        return
    right = judge_by(ENGINE[name], case).values()
    assert not [row for row in right if row.failed]
    drive = "torque" if case.drive is None else "drive_force"
    agreeing = {row.quantity for row in right if row.verdict == AGREES}
    assert {*MOVED, drive} <= agreeing
    monkeypatch.setattr(loop.Assembler, "find", find_other_branch)
    assert any(row.failed for row in judge_by(ENGINE[name], case).values())


@each_engine
@mark.parametrize("index", [63, 97])
def test_a_steady_input_keeps_its_digits_beside_bars_that_are_fast(name, index):
    """The acceleration of A is judged by what bar 2 does alone.

    Bars 3 and 4 accelerate up to 4000 rad/s^2 there, and what is solved for all bars at
    once must not leave their rounding in bar 2.
    """
    assert failures(name, Random(index + 1, 3, tuple(DrawnType)).scene(index)) == []


@mark.parametrize(
    "drive, mu, r, theta_2",
    [
        (4, 0.3, 0.1, 1.0891061452513966),
        (4, 0.5, 0.05, 1.0198324022346368),
        (3, 0.5, 0.05, 5.106983240223463),
    ],
)
def test_near_a_jam_an_engine_finds_the_one_solution_that_there_is(
    drive, mu, r, theta_2
):
    motion = Motion(np.array([theta_2]), 3.0, 2.0)
    for arms, jams in ((r, False), (50.0, True)):
        case = Scene(
            UNIFORM,
            motion,
            drive,
            (),
            (Gravity(), PinFriction.at(**dict.fromkeys(("A", "B", "O4"), (mu, arms)))),
        )
        engine, bodies = (
            answered(name, case).quantities["torque"][0]
            for name in ("pinocchio-inverse", "free-body")
        )
        assert isnan(engine) is isnan(bodies) is jams
        # rounding leaves some 1e-12 near a jam
        assert jams or abs(engine - bodies) <= 1e-9 * abs(bodies)


@mark.parametrize("ground_angle", [0.0, 1.0, 2.5])
def test_a_loop_that_just_closes_closes_however_the_ground_is_turned(ground_angle):
    """Its discriminant is 0 exactly.

    From turned directions it was undecided, and read as open.
    """
    bars = (Bar(length) for length in (1.0, 2.0, 4.0))
    linkage = FourBar(3.0, *bars, ground_angle=ground_angle)
    folded = Scene(linkage, Motion(ground_angle, 1.0))
    closed = compute_directions(make_balls(folded, ground_angle), 1)
    assert abs(float(wedge(*closed[1:]).mid())) < 1e-60
    apart = relink(folded, ground=3.0 - 1e-15)
    assert compute_directions(make_balls(apart, ground_angle), 1) is None
