"""Positions at which a column has a value, against closed forms."""

from dataclasses import replace
from math import acos, asin, pi, radians, sin, sqrt, tau

import numpy as np
from pytest import approx, mark, raises

from fourbar import (
    Bar,
    FourBar,
    Free,
    InputError,
    Law,
    Load,
    Motion,
    NotAssembledError,
    Place,
    Point,
    PointDrive,
    Scene,
    Spring,
    Springs,
    Sweep,
    release,
    solve,
    uniform,
)
from fourbar.errors import FourBarError
from fourbar.files import loads
from fourbar.show.columns import choose_columns
from fourbar.show.located import list_positions, locate
from fourbar.studies.passing import join_commands
from tests.support.rows import read_rows, refused
from tests.support.scenes import (
    UNIFORM_PARALLELOGRAM,
    WEIGHT,
    bare,
    crank_rocker,
    find_angle,
)

LOCATED = 1e-11
"""rad or s: a place is located to round-off, times the slope of what is asked for."""
TOUCHED = 1e-6
"""rad: where a curve is flat, its extreme is located to the root of round-off."""
PARALLELOGRAM = """\
[lengths]
ground = "0.8 m"
input = "0.5 m"
coupler = "0.8 m"
output = "0.5 m"
[motion]
theta_2 = {motion}
omega_2 = "1 rad/s"
[effects]
[[effects.springs]]
from = {{ bar = 1 }}
to = {{ bar = 4 }}
stiffness = "20 N/m"
length = "0.7 m"
[[loads]]
bar = 2
moment = "3 N m"
table = {{ theta_2 = ["0 deg", "90 deg", "180 deg"], factor = [0.0, 1.0, 0.0] }}
"""
"""B = (0.8 + 0.5 cos theta_2, 0.5 sin theta_2), and bar 3 does not turn. The spring
joins O2 and O4.
"""
SWEEP = '{ from = "0 deg", to = "180 deg", steps = 180 }'
STILL = PARALLELOGRAM.split("[motion]", maxsplit=1)[0]
DWELL = f"""\
{STILL}[motion]
law = {{ kind = "345", theta_2 = "30 deg", rise = ["60 deg", "1 s"], dwell = "1 s", \
fall = "1 s", steps = 30 }}
"""
"""At 0.5 s and 2.5 s bar 2 is at 60 deg, by the symmetry of the polynomial."""


def parallelogram(motion=SWEEP):
    return loads(PARALLELOGRAM.format(motion=motion))


@mark.parametrize(
    "motion",
    [
        SWEEP,
        '{ from = "0 deg", to = "180 deg", steps = 3 }',
        '{ from = "180 deg", to = "0 deg", steps = 7 }',
    ],
)
@mark.parametrize(
    "name, value, places",
    [
        ("B_x", "0.855 m", [acos(0.11)]),
        ("B_y", "499.9 mm", [asin(0.9998), pi - asin(0.9998)]),
        ("B_x-B_y", "80 cm", [pi / 4]),
        ("theta_2-theta_3", "-330 deg", [pi / 6]),
        ("v_B_x", "-0.25 m/s", [pi / 6, 5 * pi / 6]),
        ("v_B_x/v_B_y", "-1", [pi / 4]),
        ("torque", "-1 N m", [pi / 6, 5 * pi / 6]),
    ],
)
def test_every_position_with_a_value_is_located(name, value, places, motion):
    """By cosines; two of one step of the sweep too, in the order of the motion."""
    assert locate(parallelogram(motion), name, value).places == approx(
        places if '"0 deg", to' in motion else places[::-1], abs=LOCATED
    )


EXTREMES = read_rows("""
B_y | 0.5 m | 90
transmission | 90 deg | 90
B_y | max | 90
v_B_x | min | 90
B_x-B_y | min | 135
theta_4 | max | 178
transmission | max | 90
""")
"""Columns, their values, and the angle of the input, deg."""


@mark.parametrize("name, value, place", EXTREMES)
def test_the_least_and_the_greatest_value_are_located(name, value, place):
    """Between the steps by sines, and at the end of what grows all the way.

    B_y is flat at 90 deg, where the transmission angle has a corner.
    """
    sweep = '{ from = "0.3 deg", to = "178 deg", steps = 7 }'
    found = locate(parallelogram(sweep), name, value).places
    assert found == approx([radians(float(place))], abs=TOUCHED)


def test_the_first_of_equal_extremes_is_located():
    """A law that goes back as it came is as fast then as on its way out."""
    assert locate(loads(DWELL), "v_B", "max").time == approx([0.5], abs=TOUCHED)


def test_an_extreme_halfway_between_two_places_of_the_grid_is_located():
    scene = parallelogram('{ from = "0 deg", to = "180 deg", steps = 2001 }')
    assert locate(scene, "B_y", "0.5 m").places == approx([pi / 2], abs=TOUCHED)


def test_a_spring_that_seldom_pushes_has_a_least_force():
    """O4 and A come nearer than 0.31 m within 7 deg alone, and are 0.3 m apart at 0."""
    (springs,) = parallelogram().effects
    ends = Place(1, (0.8, 0.0)), Place(2, (0.5, 0.0))
    (spring,) = springs.springs
    pushing = Spring(*ends, spring.stiffness, length=0.31, acts="push")
    scene = replace(parallelogram(), effects=(Springs((pushing,)),))
    assert locate(scene, "spring_0_force", "min").places == approx([0.0])
    with raises(NotAssembledError, match=r"goes from -0\.2 to 0 N"):
        locate(scene, "spring_0_force", "1 N")


def test_the_ends_of_a_motion_are_positions_and_one_position_is_one():
    """B_y is 0.25 m at 30 deg and at 150 deg, B_x 1.3 m at 0 and again at 360 deg."""
    scene = parallelogram('{ from = "10 deg", to = "150 deg", steps = 20 }')
    assert np.degrees(locate(scene, "B_y", "0.25 m").places) == approx([30, 150])
    turn = loads(STILL + '[motion]\ntheta_2 = "90 deg"\n')
    assert locate(turn, "B_x", "1.3 m").places == approx([0.0], abs=TOUCHED)


def test_a_law_has_a_value_at_times_and_none_while_it_dwells():
    scene = loads(DWELL)
    at = locate(scene, "B_x", "1.05 m")
    assert at.time == approx([0.5, 2.5], abs=LOCATED)
    assert list_positions("B_x=1.05 m", at)[0] == "B_x=1.05 m at 2 positions:"
    with raises(NotAssembledError, match="it is constant there; B_x goes"):
        locate(scene, "B_x", "0.8 m")


@mark.parametrize("omega", [0.5, -0.5])
def test_a_steady_sweep_has_a_place_at_each_time(omega):
    """A backward sweep begins at its other end, as its column of times has it."""
    scene = crank_rocker(Motion(Sweep(0.2, 1.2, 10), omega))
    found = locate(scene, "time", "1.3 s")
    begin = 0.2 if omega > 0.0 else 1.2
    assert found.angle == approx([begin + 1.3 * omega], abs=1e-12)
    with raises(NotAssembledError, match=r"no position has it; time goes from 0 to 2"):
        locate(scene, "time", "2.1 s")


LAW = crank_rocker(
    Motion(law=Law((0.0, 1.0, 2.0), (0.3, 2.0, 0.5), steps=20, ends="rest"))
)
DROPPED = crank_rocker(
    Motion(1.0, 0.0, free=Free(1.0, 50)),
    effects=WEIGHT,
)


def test_a_law_passes_an_angle_up_and_down():
    wanted = ("theta_2", "1.5 rad"), ("time", "0.5 s")
    found = join_commands([locate(LAW, *at) for at in wanted])
    assert len(found.angle) == 3
    assert found.angle[:2] == approx(1.5, abs=LOCATED)
    assert found.time[0] < 1.0 < found.time[1] and found.time[2] == 0.5
    assert locate(LAW, "theta_2", "0.3 rad").time[0] == 0.0


def test_a_knot_of_a_law_is_one_place():
    """Its steps have the knot too, apart by a rounding of their times."""
    knots = Law((-0.1, 0.1, 0.2, 0.5), (1.9, 2.0, 2.2, 2.5), steps=12, ends="rest")
    found = locate(crank_rocker(Motion(law=knots)), "time", "0.1 s")
    assert found.time == approx([0.1], abs=LOCATED)


@mark.slow
def test_a_release_is_met_when_it_first_passes():
    """By a much finer release: the angle lies between two of its instants."""
    free = DROPPED.motion.replace(free=Free(1.0, 20000))
    fine = release(replace(DROPPED, motion=free)).command
    value = float(fine.theta_2[3001])
    wanted = ("time", "0 s"), ("time", "0.25 s"), ("theta_2", f"{value!r} rad")
    found = [locate(DROPPED, *at) for at in wanted]
    begin, there, passing = found[0], found[1], found[2].part(slice(0, 1))
    first = int(np.flatnonzero(np.diff(np.sign(fine.theta_2 - value)) != 0)[0])
    assert begin.angle == approx([1.0]) and passing.angle == approx([value], abs=1e-9)
    assert [*begin.time, *there.time] == approx([0.0, 0.25])
    assert passing.time == approx([fine.time[first]], abs=fine.time[1] * (1.0 + 1e-6))
    state = solve(DROPPED, at=join_commands([begin, passing]))
    assert state.omega_2[0] == approx(0.0, abs=1e-6)
    assert state.omega_2[1] == approx(fine.omega_2[first], rel=1e-3)


@mark.slow
def test_a_release_has_a_value_at_times():
    """A parallelogram of massless cranks swings its coupler as a point mass on one.

    From rest at -30 deg its speed is sqrt(2 g (sin 30 deg - sin theta_2')/a) there.
    """
    scene = loads(
        f'{STILL}[motion]\ntheta_2 = "-30 deg"\n'
        'free = { duration = "1 s", steps = 40 }\n'
        '[bars.coupler]\nmass = "1 kg"\n[effects]\n'
        'gravity = ["9.81 m/s^2", "-90 deg"]\n'
    )
    speed = sqrt(2.0 * 9.81 * (sin(radians(50.0)) - 0.5) / 0.5)
    at = locate(scene, "omega_2", f"{-speed!r} rad/s")
    assert np.degrees(at.angle) == approx([-50.0, -130.0], abs=1e-6)


def test_times_and_angles_that_a_law_does_not_pass_are_refused():
    beyond = Law((0.0, 1.0), (0.4, 2.0), ends="rest")
    stops = Scene(bare(0.6, 0.3, 0.35, 0.25), Motion(law=beyond))
    still = crank_rocker(Motion(Sweep(0.2, 1.2, 10)))
    for scene, name, value, words in (
        (LAW, "theta_2", "3 rad", "no position has it; theta_2 goes from"),
        (stops, "theta_2", "1.5 rad", "goes from .* to 1.31812"),  # acos(1/4)
        (LAW, "time", "3 s", "no position has it; time goes from 0 to 2 s"),
        (still, "time", "1 s", "at no one speed"),
    ):
        with raises(FourBarError, match=words):
            locate(scene, name, value)


REFUSED = read_rows("""
B_y | 0.6 m | no position has it; B_y goes from 0 to
omega_4 | 1 rad/s | constant; omega_4 is 1 rad/s
omega_4 | max | constant; omega_4 is 1 rad/s
alpha_4 | max | constant; alpha_4 is 0 rad/s
alpha_4 | 1 rad/s^2 | constant; alpha_4 is 0 rad/s
tork | 1 N m | --at = .tork.: must be among torque
B_y | 0.6 | unit is missing; did you mean "0.6 m"
B_y | 6 s | --at
omega_4/omega_2 | 1 s | --at
B_x-theta_2 | 1 m | difference is of two columns of one kind
""")


@mark.parametrize("name, value, words", REFUSED)
def test_what_no_position_has_is_refused_with_the_range(name, value, words):
    kind = NotAssembledError if "constant" in words or "no pos" in words else InputError
    with raises(kind, match=words):
        locate(parallelogram(), name, value)


@mark.slow
def test_a_column_that_jumps_over_a_value_does_not_have_it():
    """Dry friction alone: the torque is 2 N m up to 1 s and -2 N m from there."""
    scene = loads(
        DWELL.replace('dwell = "1 s", ', "")
        + '[effects]\nfriction = { O2 = "2 N m" }\n'
    )
    with raises(NotAssembledError, match="jumps over it at time = 0 s, 1 s;"):
        locate(scene, "torque", "0.5 N m")


def test_a_motion_without_any_value_is_refused_without_a_warning():
    open_loop = Scene(bare(0.6, 0.3, 0.35, 0.25), Motion(Sweep(2.0, 2.5, 9), 1.0))
    with raises(NotAssembledError):
        locate(open_loop, "torque", "max")


def test_a_column_without_a_value_at_its_pole_jumps_there():
    """At its dead point a force of constant power has no value, nor the other sign."""
    drive = PointDrive(Place(3, (0.1, 0.2)), 0.5, "bar")
    motion = Motion(Sweep(0.3, 2.9, 100), 2.0)
    scene = crank_rocker(motion=motion, drive=drive, loads=(Load(2, moment=-1.0),))
    with raises(NotAssembledError, match=r"theta_2 = [\d.]+ rad, and grows"):
        locate(scene, "drive_force", "0 N")


@mark.slow
def test_a_column_with_poles_says_that_it_grows_without_bound():
    """omega_2/omega_4 of a crank-rocker is never small, and infinite at its limits."""
    scene = crank_rocker(Motion())
    for value, why in (("1", "jumps"), ("max", "has none")):
        with raises(NotAssembledError, match=f"{why}.*, and grows without"):
            locate(scene, "mechanical_advantage", value)


def test_rounding_beside_a_vanishing_lever_is_no_value():
    """A force up on a parallelogram's coupler bears its weight everywhere."""
    scene = loads("""
lengths = { ground = "0.2 m", input = "0.4 m", coupler = "0.2 m", output = "0.4 m" }
bars.coupler.mass = "3 kg"
motion.omega_2 = "0 rad/s"
motion.theta_2 = { from = "20 deg", to = "160 deg", steps = 140 }
drive = { bar = 3, from_pin = ["0.15 m", "0 deg"], direction = "90 deg" }
effects.gravity = ["9.81 m/s^2", "-90 deg"]
""")
    with raises(NotAssembledError, match=r"no pos.* goes from 29\.43 to 29\.43 N"):
        locate(scene, "drive_force", "29.4301 N")


def test_a_linkage_is_searched_up_to_where_it_ceases_to_assemble():
    """There theta_3 grows as the root of the angle: by cosines, 0.01 deg from the end.

    Beyond the end of the range it has no value.
    """
    lengths = (
        '[lengths]\nground = "50 mm"\ninput = "20 mm"\ncoupler = "40 mm"\n'
        'output = "25 mm"\n[motion]\ntheta_2 = '
    )
    scene = loads(lengths + '{ from = "30 deg", to = "170 deg", steps = 20 }')
    limit = find_angle(65, 50, 20)
    place = limit - radians(0.001)
    at = solve(loads(f'{lengths}"{place!r} rad"'))
    found = locate(scene, "transmission", f"{float(asin(at.sin_mu[0]))!r} rad")
    assert found.places == approx([place], abs=1e-9)
    for name, value in (("A_x", "min"), ("theta_2", "max")):
        assert locate(scene, name, value).places == approx([limit], abs=1e-9)


def test_springs_have_their_length_and_pull_as_columns():
    """20 N/m over the ground of 0.8 m; and by cosines to a point of bar 4."""
    scene = loads(
        PARALLELOGRAM.format(motion=SWEEP).replace(
            "to = { bar = 4 }",
            'to = { bar = 4, from_pin = ["0.5 m", "0 deg"] }\npreload = "-1 N"',
        )
    )
    solution = solve(scene)
    length, force = choose_columns(solution, "spring_0_length,spring_0_force")
    distance = np.sqrt(0.8**2 + 0.5**2 + 0.8 * np.cos(solution.theta_2))
    assert length.unit == "m" and length.values == approx(distance, rel=1e-13)
    assert force.unit == "N"
    assert force.values == approx(20.0 * (distance - 0.7) - 1.0, abs=1e-12)
    with refused("is the name of a quantity"):
        Point("spring_1_force", 3, (0.1, 0.0))


def test_a_force_grows_without_bound_beside_a_change_point():
    scene = Scene(
        UNIFORM_PARALLELOGRAM, Motion(Sweep(0.0, tau, 12), 1.0), effects=WEIGHT
    )
    found = locate(scene, "F14", "5 kN").places
    assert len(found) == 4 and abs(np.sin(found)).max() < 0.01
    forces = solve(replace(scene, motion=Motion(found, 1.0))).F14
    assert np.hypot(*forces.T) == approx(5e3, rel=1e-9)
    with raises(NotAssembledError, match="it has none, and grows without bound"):
        locate(scene, "F14", "max")


def test_what_crowds_beside_a_pole_leaves_the_other_extremes_apart():
    """A kite has both ends of its range, and a change point, at its positions."""
    scene = Scene(
        uniform(0.2, 0.2, 0.1, 0.1),
        Motion(Sweep(0.0, tau, 12), 1.0),
        effects=WEIGHT,
    )
    for text in ("1 N", "2 N"):
        found = locate(scene, "F14", text).places
        forces = solve(replace(scene, motion=Motion(found, 1.0))).F14
        assert np.hypot(*forces.T) == approx(float(text[0]), rel=1e-9)
    assert locate(scene, "F14", "min").places == approx([1.02719453])


def test_a_pure_number_is_read_as_any_other():
    plain, minus, fraction = (
        locate(crank_rocker(), "omega_4/omega_2", text).angle
        for text in ("-0.25", "\N{MINUS SIGN}0.25", "-1/4")
    )
    assert minus == approx(plain) and fraction == approx(plain)


def test_a_zero_at_a_position_of_the_sweep_is_no_rounding():
    """The weight of a crank has no lever at 90 deg, where its error bar exceeds it."""
    crank = Bar(0.1, 2.0, 0.0, (0.1, 0.0))
    linkage = FourBar(0.3, crank, Bar(0.25), Bar(0.22))
    scene = Scene(linkage, Motion(Sweep(0.0, pi, 4), 1.0), effects=WEIGHT)
    assert locate(scene, "torque", "0 N m").places == approx([0.5 * pi], abs=LOCATED)
