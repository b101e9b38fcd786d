"""No value, and a status that names it.

Where the status is ok every requested quantity is a number.
"""

import warnings
from dataclasses import replace
from functools import partial
from math import isfinite, pi

import numpy as np
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from pytest import approx, mark

from fourbar import (
    Bar,
    FourBar,
    Friction,
    Gravity,
    LinearDrive,
    Load,
    Motion,
    PinFriction,
    Place,
    Point,
    Scene,
    Spring,
    Springs,
    Sweep,
    Torsion,
    Viscous,
    solve,
    uniform,
)
from fourbar.evaluation.case import POSITIONS_OF_A_BLOCK
from fourbar.linkage import MOVING_BARS, PINS
from fourbar.quantities import JAMMED, OK, STAGE_OF, STAGES
from tests.support.rows import refused
from tests.support.scenes import (
    UNIFORM,
    WEIGHT,
    bare,
    crank_rocker,
    recommand,
)

EXAMPLES = settings(
    max_examples=120,
    deadline=None,
    derandomize=True,
    suppress_health_check=list(HealthCheck),
)
"""The same examples on every run: what is new is looked for by fuzzing."""
FORCES = ("F12", "F32", "F43", "F14", "torque", "torque_error", "force_error")


def solved(scene, stage="error"):
    """Solved, with every warning an error."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        return solve(scene, stage)


def without_value(solution):
    """Return what stands at positions whose status is ok and is no number."""
    ok, missing = solution.status_code == OK, {}
    for name in STAGE_OF:
        values = getattr(solution, name)
        if values is not None and not np.isfinite(values[ok]).all():
            missing[name] = [str(value) for value in values[ok]]
    return missing


def lost(solution, *names):
    return all(np.isnan(getattr(solution, name)).all() for name in names)


def finite(solution, *names):
    return all(np.isfinite(getattr(solution, name)).all() for name in names)


powers = st.floats(-320.0, 308.0).map(lambda power: 10.0**power)
magnitudes = powers | st.sampled_from([0.0, 1.0])
signs = st.sampled_from([1.0, -1.0])
numbers = st.builds(lambda sign, size: sign * size, signs, magnitudes)
numbers |= st.floats(-10.0, 10.0)
sizes = magnitudes | st.floats(0.0, 10.0)
stiff = sizes.filter(bool)
angles = st.floats(-7.0, 7.0) | st.sampled_from([0.0, pi, pi / 2]) | numbers
pairs = st.tuples(numbers, angles)
per_pin = st.dictionaries(st.sampled_from(list(PINS)), sizes, min_size=1)


@st.composite
def linkages(draw):
    """Lengths that close somewhere.

    Of a few round numbers, so that bars are equal, or of any size.
    """
    length = st.sampled_from([1.0, 2.0, 3.0]) | st.floats(0.5, 3.0)
    lengths = draw(st.lists(length, min_size=4, max_size=4))
    if draw(st.booleans()):  # pairs of equal bars
        lengths = 2 * lengths[:2]
    *others, longest = sorted(lengths)
    closing = min(longest, (1.0 - 1e-12) * sum(others))
    lengths = draw(st.permutations([*others, closing]))
    scale = draw(st.just(1.0) | st.floats(-300.0, 306.0).map(lambda power: 10.0**power))
    bars = []
    for length in lengths[1:]:
        mass, inertia = draw(sizes), draw(st.none() | sizes)
        if inertia is None and not isfinite(mass * scale * length * scale * length):
            inertia = 0.0
        bars.append(Bar(scale * length, mass, inertia, draw(st.none() | pairs)))
    return FourBar(scale * lengths[0], *bars, draw(st.just(0.0) | st.floats(-7.0, 7.0)))


@st.composite
def scenes(draw):
    """Every drive bar and every effect.

    Magnitudes go from the least double to the greatest.
    """
    linkage = draw(linkages())
    bars, pins = st.sampled_from(MOVING_BARS), st.sampled_from(list(PINS))
    load = st.builds(Load, bars, pairs, from_pin=pairs, moment=numbers)
    loads = draw(st.lists(load, max_size=2))
    ends = [
        st.tuples(numbers, angles).map(partial(Place, bar))
        for bar in draw(st.permutations([1, *MOVING_BARS]))[:2]
    ]
    possible = [
        st.builds(Gravity, numbers, angles),
        per_pin.map(lambda pins: Viscous.at(**pins)),
        per_pin.map(lambda pins: Friction.at(**pins)),
        st.dictionaries(pins, st.tuples(sizes, sizes), min_size=1, max_size=2).map(
            lambda pins: PinFriction.at(**pins)
        ),
        st.dictionaries(pins, st.tuples(stiff, angles, numbers), min_size=1).map(
            lambda pins: Torsion.at(**pins)
        ),
        st.builds(Spring, *ends, stiff, sizes, numbers).map(
            lambda spring: Springs((spring,))
        ),
    ]
    effects = [draw(strategy) for strategy in possible if draw(st.integers(0, 3)) == 0]
    away = draw(st.lists(angles, min_size=1, max_size=4))
    omega_2 = draw(numbers.filter(lambda omega: isfinite(omega * omega)))
    rates = omega_2, draw(numbers), draw(st.sampled_from([1, -1]))
    motion = Motion(linkage.ground_angle + np.array(away), *rates)
    return Scene(linkage, motion, draw(bars), tuple(loads), tuple(effects))


@mark.slow
@EXAMPLES
@given(scenes(), st.sampled_from(STAGES))
def test_where_the_status_is_ok_every_requested_quantity_is_a_number(scene, stage):
    solution = solved(scene, stage)
    assert without_value(solution) == {}
    infinite = [
        name
        for name in STAGE_OF
        if (values := getattr(solution, name)) is not None and np.isinf(values).any()
    ]
    assert infinite == [], "no value is NaN, never infinite"


@mark.parametrize("kind", ("angle", "stroke"))
def test_where_the_loop_does_not_close_only_what_is_commanded_has_a_value(kind):
    """Bar 2 alone, its points and the stroke of its cylinder would go on."""
    cylinder = LinearDrive(Place(1, (0.25, -1.0)), Place(2, (0.2, 0.0)))
    motion = Motion(Sweep(0.0, 1.5, 20), 1.0)
    if kind == "stroke":
        motion = Motion(stroke=Sweep(0.3, 0.44, 20), stroke_speed=0.1, side="left")
    points = (Point("P", 2, (0.3, 0.1)),)
    linkage = bare(0.6, 0.3, 0.35, 0.25)
    solution = solve(Scene(linkage, motion, points=points, drive=cylinder))
    open_ = ~solution.assembled
    commanded = {"theta_2", "omega_2", "alpha_2"}
    assert 0 < open_.sum() < len(solution)
    commanded |= {"stroke", "stroke_speed"} if kind == "stroke" else set()
    names = [*solution.evaluated(), "P", "v_P", "a_P"]
    with_value = {name for name in names if np.isfinite(solution[name][open_]).any()}
    assert with_value == commanded


PARALLELOGRAM = uniform(1.0, 0.5, 1.0, 0.5)
KITE = uniform(1.0, 0.5, 0.5, 1.0)


@mark.parametrize("linkage, branch, drive_bar", [(PARALLELOGRAM, 1, 3), (KITE, -1, 4)])
def test_a_bar_that_does_not_turn_takes_no_torque(linkage, branch, drive_bar):
    """T3 of a parallelogram and T4 of a folded kite would have a pole at every
    position.
    """
    motion = Motion(np.linspace(0.3, 2.0, 5), 1.0, 2.0, branch)
    rubbing = Friction.at(A=0.1), PinFriction.at(B=(0.1, 0.01))
    for effects in ((), WEIGHT, rubbing):
        solution = solved(Scene(linkage, motion, drive_bar, effects=effects))
        assert solution.status == ["no_torque"] * 5
        rows = solution.to_csv().splitlines()[1:]
        assert [row.split(",")[0] for row in rows] == solution.status
        assert getattr(solution, f"omega_{drive_bar}") == approx(np.zeros(5))
        assert lost(solution, *FORCES) and finite(solution, "alpha_4")
        assert not solution.drive_condition.any()
    for drive, stage in ((drive_bar, "acceleration"), (2, "error")):
        assert solved(Scene(linkage, motion, drive), stage).status == ["ok"] * 5


def test_on_a_change_point_the_pin_forces_alone_have_no_value():
    motion = Motion(np.array([-0.4, 0.0, 0.4]), 1.0)
    solution = solved(Scene(PARALLELOGRAM, motion))
    assert solution.status == ["ok", "change_point", "ok"]
    assert finite(solution, "torque") and np.isnan(solution.F12[1]).all()
    # the drive on 3: bars 2 and 4 of the parallelogram are parallel, those of the
    # antiparallelogram are not
    for branch, expected in {1: "no_torque", -1: "ok"}.items():
        motion = motion.replace(branch=branch)
        at_all = solved(Scene(PARALLELOGRAM, motion, 3)).status
        assert at_all == [expected, "change_point", expected]


def test_beyond_the_range_of_doubles_the_status_says_so_from_that_stage_on():
    angles = np.linspace(0.3, 2.0, 5)
    heavy = FourBar(3.0, Bar(1.0, 1.0), Bar(2.5, 1e308, 1.0), Bar(2.2, 1.0))
    scene = Scene(heavy, Motion(angles, 10.0))
    solution = solved(scene)
    assert solution.status == ["overflow"] * 5
    assert lost(solution, *FORCES)
    assert finite(solution, "theta_3", "omega_3", "alpha_3", "a_G3")
    assert solved(scene, "acceleration").status == ["ok"] * 5
    assert solved(replace(scene, motion=Motion(angles, 0.0))).status == ["ok"] * 5
    long = uniform(30.0, 10.0, 25.0, 22.0)
    fast = solved(Scene(long, Motion(np.array([0.3]), 1e154)))
    assert fast.status == ["overflow"] and fast.omega_2 == [1e154]
    assert finite(fast, "omega_4") and lost(fast, "alpha_3", "a_A", "torque")


def test_lengths_and_sweeps_beyond_the_range_of_doubles_are_refused():
    with refused("lengths = "):
        FourBar(1e308, *[Bar(1e308, inertia=0.0)] * 3)
    large = FourBar(4e307, *[Bar(4e307)] * 3)
    assert solved(Scene(large, Motion(1.0, 1e-200))).status == ["ok"]
    with refused("motion.theta_2.to = 1e+308"):
        Motion(Sweep(-1e308, 1e308, 3))


def test_where_friction_jams_the_motion_that_would_begin_the_status_says_so():
    """At rest with a large pin.

    One of the two torques does not exist, torque and forces at rest do.
    """
    friction = PinFriction.at(A=(0.9, 0.2))
    motion = Motion(np.linspace(0.1, 6.2, 60), 0.0)
    solution = solved(Scene(UNIFORM, motion, 4, effects=(Gravity(), friction)))
    jammed = solution.status_code == JAMMED
    assert jammed.any() and np.isfinite(solution.torque).all()
    lost = np.isnan(solution.torque_low) | np.isnan(solution.torque_high)
    assert np.array_equal(lost, jammed)


def test_the_blocks_of_a_sweep_are_solved_like_its_positions():
    """Ends of two blocks, with error bars too, whose blocks are shorter."""
    few = crank_rocker(Motion(np.linspace(0.1, 6.0, 7), 10.0, 5.0))
    for stage in ("force", "error"):
        n = POSITIONS_OF_A_BLOCK // {"force": 1, "error": 4}[stage]
        rows = np.resize(np.arange(7), n + 5)
        many = recommand(few, angle=few.motion.angle[rows])
        ends = np.array([0, n - 1, n, n + 4])
        blocks, alone = solve(many, stage), solve(few, stage)
        for name in alone.evaluated():
            together, right = blocks[name][ends], alone[name][rows[ends]]
            if not name.startswith("theta"):  # a sweep counts whole turns
                assert together == approx(right, rel=1e-12, abs=1e-12), name
