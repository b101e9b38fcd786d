"""Tables whose rows are found by another angle than theta_2.

The second derivation of a position is the intersection of two circles.
"""

from dataclasses import replace
from math import pi, radians

import numpy as np
from pytest import fixture, mark, raises

from fourbar import Motion, Rise, Sine, Sweep, solve
from fourbar.errors import FAILED, HOLDS, InputError
from fourbar.scene import Command, Scene
from fourbar_validation.check.check import Judgement
from fourbar_validation.check.judge_table import Judge
from fourbar_validation.check.row_commands import find_row_commands
from tests.support.rows import read_rows, refused
from tests.support.scenes import (
    CYLINDER,
    UNIFORM_PARALLELOGRAM,
    WEIGHT,
    cis,
    crank_rocker,
    meet_circles,
    recommand,
)

SAME_PLACE = 1e-9
"""rad: a position by two circles and one by the formulas, 0.1 rad off a limit."""


def find_crank(scene, theta_4, side):
    """Return theta_2 at which the output has these angles, by two circles.

    A lies at the distances of input and coupler from O2 and B. `side`: +1 if A lies to
    the left of the line from O2 to B, -1 to the right.
    """
    d, a, b, c = scene.linkage.lengths
    B = d * cis(scene.linkage.ground_angle) + c * cis(theta_4)
    return np.angle(meet_circles(0.0, B, a, b, side))


def write(heading, *columns):
    """Write columns in full under a heading."""
    rows = (",".join(map(repr, row)) for row in np.transpose(columns).tolist())
    return "\n".join([heading, *rows])


def tabulate(angle, angles, torque, form="{:.12g}"):
    """Write angles in deg with torques in N m."""
    rows = [f"{angle} [deg],torque"]
    for place, number in zip(np.degrees(angles), torque, strict=True):
        rows.append(f"{form.format(place)},{float(number)!r}")
    return "\n".join([*rows, ""])


@fixture
def judged(read):
    """Judges a table whose rows are found by an angle."""

    def judge(scene, *columns):
        return Judgement(scene, read(tabulate(*columns), scene.motion.commanded))

    return judge


def commanding(bar, first, last, steps=8):
    """A crank-rocker whose bar `bar` is commanded and driven over a range in deg."""
    sweep = Sweep(radians(first), radians(last), steps)
    names = (f"theta_{bar}", f"omega_{bar}", f"alpha_{bar}")
    motion = Motion(**dict(zip(names, (sweep, 2.0, -1.0), strict=True)))
    return replace(crank_rocker(motion), drive_bar=bar)


def at_angles(angles):
    """Return the command of `commanding` at these angles."""
    return Command(np.array(angles), np.ones(len(angles), np.int8), 2.0, -1.0)


@mark.parametrize("bar, ends", [(4, (115.0, 155.0)), (3, (40.0, 75.0))])
@mark.parametrize("same", [True, False])
def test_a_table_of_the_commanded_bar_is_judged(bar, ends, same, judged):
    scene = commanding(bar, *ends)
    angles = np.radians(np.linspace(*ends, 9 if same else 6))
    at = recommand(scene, angle=angles)
    solution = solve(at)
    assert set(solution.status) == {"ok"}
    name = f"theta_{bar}"
    faster = solve(recommand(at, speed=2.0 * 30.0 / pi))
    torques = solution.torque, -solution.torque, faster.torque
    good, bad, slip = (judged(scene, name, angles, torque) for torque in torques)
    assert good.status == HOLDS and good.compared == len(angles)
    assert bad.status == FAILED
    assert bad.explanations[0].text.startswith("sign reversed")
    words = f"omega_{bar} in rev/min taken for rad/s"
    assert words in [one.text for one in slip.explanations]


def test_a_mistake_in_the_velocity_terms_of_a_driven_rocker_is_named(read):
    """The other bars' accelerations follow that of the output alone."""
    scene = commanding(4, 115.0, 155.0)
    right = solve(scene)
    columns = right.theta_4, -0.5 * right.omega_2, -0.5 * right.omega_3
    table = read(write("theta_4,alpha_2,alpha_3", *columns), "theta_4")
    left_out, first = Judgement(scene, table).explanations[:2]
    assert left_out.complete and left_out.text == "omega_4 is left out"
    assert first.complete and "(dJ/dt) v is missing" in first.text


def test_the_scenes_own_positions_may_be_listed_by_another_bar(judged):
    """The angles of the output are printed to a hundredth of a degree, twice a turn."""
    scene = crank_rocker(Motion(Sweep(0.0, 6.0, 24), 10.0))
    right = solve(scene)
    off = right.torque * (1.0 + 1e-9 * (np.arange(25) == 7))
    for torque, lines in ((right.torque, []), (off, [9])):
        found = judged(scene, "theta_4", right.theta_4, torque, "{:.2f}")
        assert [finding.line for finding in found.differing] == lines


@mark.parametrize(
    "name, form, shift",
    read_rows("""
theta_2 [deg] | .2f | 0
theta_2 [deg] | .0f | 0
theta_2 [deg] | .1f | 0.1
time | .3f | 0
time | .3f | 0.001
"""),
)
def test_rows_that_round_to_the_scenes_own_positions_are_at_them(
    name, form, shift, read
):
    """A sweep of steps of 20/3 deg, and times along a law; 47 deg is none of it."""
    swept = crank_rocker(Motion(Sweep(0.0, radians(120.0), 18), 10.0))
    for scene in (swept, SERVO)[: 1 + (name == "time")]:
        right = solve(scene)
        places = np.degrees(right.theta_2)
        if name == "time":
            places = right.theta_2 / 10.0 if scene is swept else right.time
        rows = [
            f"{place + float(shift):{form}},{torque!r}"
            for place, torque in zip(places, right.torque.tolist(), strict=True)
        ]
        table = read("\n".join([f"{name},torque", *rows[1 :: len(rows) // 4]]))
        agree = {one.agrees for one in Judge(scene, table).findings}
        assert agree == {shift == "0"}


@mark.parametrize("ends, side", [((60.0, 220.0), 1.0), ((245.0, 395.0), -1.0)])
def test_an_angle_of_the_output_is_a_position_of_a_crank(ends, side, read, judged):
    """It is passed twice a turn, and once within the range of the scene."""
    scene = commanding(2, *ends)
    limits = np.sort(solve(scene, "position").theta_4[[0, -1]])
    theta_4 = np.radians(np.arange(*np.ceil(np.degrees(limits)), 5.0))
    assert len(theta_4) > 3
    table = read(tabulate("theta_4", theta_4, theta_4, "{:.0f}"))
    angles = find_row_commands(scene, table).at.angle
    apart = np.angle(cis(angles - find_crank(scene, theta_4, side)))
    np.testing.assert_allclose(apart, 0.0, atol=SAME_PLACE)
    turned = radians(ends[0]) - 0.1, radians(ends[1]) + 0.1
    assert ((angles > turned[0]) & (angles < turned[1])).all()
    torque = solve(scene, at=at_angles(angles)).torque
    assert judged(scene, "theta_4", theta_4, torque, "{:.0f}").status == HOLDS


def test_the_rounding_of_another_bars_angle_is_allowed_for(judged):
    """Six decimals are a rounded number; what half a unit changes is allowed."""
    scene = commanding(2, 60.0, 220.0)
    right = solve(scene, at=at_angles([1.2, 1.7, 2.4]))
    for off, code in ((0.0, HOLDS), (1e-5, FAILED)):
        torque = right.torque * (1.0 + off)
        assert judged(scene, "theta_4", right.theta_4, torque, "{:.6f}").status == code


def test_an_angle_that_is_passed_twice_needs_the_commanded_one(judged):
    scene = commanding(2, 0.0, 360.0)
    theta_4 = np.radians([120.0, 140.0])
    first, _ = np.degrees(find_crank(scene, theta_4, -1.0)) % 360.0
    words = "line 2, theta_4", "120 deg", f"{first:.6g}", "add a column theta_2"
    with refused(*words):
        judged(scene, "theta_4", theta_4, theta_4, "{:.0f}")


def test_a_parallelogram_is_found_on_both_halves_of_its_turn(judged):
    scene = Scene(
        UNIFORM_PARALLELOGRAM, Motion(Sweep(0.1, 4.1, 20), 5.0), effects=WEIGHT
    )
    angles = np.radians([20.0, 100.0, 200.0, 250.0, 340.0])
    expected = (0.1 + 0.3) * 9.81 * 0.1 * np.cos(angles)
    assert judged(scene, "theta_4", angles, expected, "{:.0f}").status == HOLDS


@mark.parametrize(
    "name, commanded, angle",
    read_rows("""
Angle | theta_4 | theta_4
Angle | theta_2 | theta_2
output angle | theta_2 | theta_4
"""),
)
def test_the_word_angle_means_what_the_scene_commands(name, commanded, angle, read):
    assert read(f"{name} [deg],torque\n100,1.0\n", commanded).found_by == angle


LOGGED = read_rows("""
time theta_2 torque |
theta_2 omega_2 alpha_2 torque |
time theta_2 omega_2 alpha_2 torque |
time beyond theta_2 torque |
theta_2 torque | needs a column time beside theta_2, or columns omega_2 and
theta_2 omega_2 torque | needs a column time beside theta_2, or columns
late theta_2 torque | the law is at 20.0067 deg then, and the table at 20.0043
rounded theta_2 torque |
coarse theta_2 torque |
rounded degrees torque |
step theta_2 torque | needs a column time
exact torque |
minutes torque |
beyond torque | time = 0.836: the law lasts from 0 to 0.8 s
step torque | needs a column theta_2
""")
"""Columns of a table, and why it is refused if it is."""


COLUMNS = {
    row[0]: row
    for row in read_rows("""
time | time | t [ms] | 1e3 | .1f
exact | time | time [ms] | 1e3 | .4f
minutes | time | t [min] | 0.016666666666666666 | .7f
beyond | beyond | time | 1 | .3f
late | late | time [s] | 1 | .4f
rounded | time | time | 1 | .3f
coarse | time | time | 1 | .1f
step | time | time [rev] | 1e4 | .0f
theta_2 | theta_2 | theta_2 | 1 | .15g
degrees | theta_2 | theta_2 [deg] | 57.29577951308232 | .0f
omega_2 | omega_2 | omega_2 | 1 | .15g
alpha_2 | alpha_2 | alpha_2 [deg/s^2] | 57.29577951308232 | .15g
torque | torque | torque | 1 | .15g
""")
}
"""Name of a column, what is in it, its heading, a factor and how it is written."""
SERVO = crank_rocker(
    Motion(law=Rise("345", ("120 deg", "0.8 s"), theta_2="20 deg")),
    title="Servo",
)


def follow_rise(time):
    """Return angle and rates of 10 u^3 - 15 u^4 + 6 u^5, by hand, and the torque."""
    u, h = time / 0.8, radians(120.0)
    theta = radians(20.0) + h * u**3 * (10.0 - 15.0 * u + 6.0 * u * u)
    omega = h / 0.8 * 30.0 * u * u * (1.0 - 2.0 * u + u * u)
    alpha = h / 0.64 * 60.0 * u * (1.0 - 3.0 * u + 2.0 * u * u)
    at = at_angles(theta)._replace(speed=omega, acceleration=alpha)
    return theta, omega, alpha, solve(SERVO, at=at).torque


@mark.parametrize("names, said", LOGGED)
def test_rows_along_a_law_have_its_rates_at_their_own_times(names, said, read):
    time = np.arange(0.0123, 0.79, 0.0517)
    theta, omega, alpha, torque = follow_rise(time)
    numbers = {
        "time": time,
        "beyond": time + 0.1,
        "late": time + 2e-3,
        "theta_2": theta,
        "omega_2": omega,
        "alpha_2": alpha,
        "torque": torque,
    }
    heads, columns = [], []
    for _, of, head, factor, form in (COLUMNS[name] for name in names.split()):
        heads.append(head)
        columns.append([format(x, form) for x in numbers[of] * float(factor)])
    rows = [",".join(cells) for cells in zip(*columns, strict=True)]
    text = "\n".join([",".join(heads), *rows, ""])
    if said:
        with raises(InputError, match=said) as caught:
            Judgement(SERVO, read(text))
        assert "Servo" not in str(caught.value)
        return
    judgement = Judgement(SERVO, read(text))
    assert judgement.status == HOLDS and judgement.compared >= len(time)
    assert not judgement.table.left_out or "omega_2" in names
    wrong = text.replace(f"{torque[3]:.15g}", f"{1.3 * torque[3]:.15g}")
    findings = Judge(SERVO, read(wrong)).findings
    assert [one.line for one in findings if not one.agrees] == [5]


@mark.parametrize("speed, start", [(3.0, 20.0), (-2.0, 80.0)])
def test_rows_at_one_speed_are_found_by_their_time(speed, start, read):
    theta = np.radians([20.0, 35.0, 50.0, 80.0])
    scene = crank_rocker(Motion(theta.tolist(), speed))
    time = (theta - radians(start)) / speed
    judgement = Judgement(scene, read(write("time,torque", time, solve(scene).torque)))
    assert judgement.agreeing == 4 and judgement.digits >= "12"


@mark.parametrize("times", [(0.0,), (0.1, 0.8)])
def test_times_that_nobody_rounded_leave_all_digits(times, read):
    theta, _, _, torque = follow_rise(np.array(times))
    rows = zip(times, np.degrees(theta), torque, strict=True)
    lines = [f"{time:g},{angle:.4f},{number:.8f}" for time, angle, number in rows]
    judgement = Judgement(SERVO, read("\n".join(["time,theta_2 [deg],torque", *lines])))
    assert judgement.status == HOLDS and judgement.digits[0] >= "7"


def test_rows_of_a_commanded_stroke_are_found_by_it_or_are_its_own(read, judged):
    """The angle by the triangle of O2 and both ends of the cylinder."""
    motion = Motion(stroke=Sweep(0.22, 0.28, 4), side="left")
    scene = crank_rocker(motion, drive=CYLINDER)
    far, near = (end.distance for _, end in CYLINDER.ends)
    stroke = np.array([0.28, 0.223, 0.25])
    cosine = (far * far + near * near - stroke * stroke) / (2.0 * far * near)
    first = scene.linkage.ground_angle + CYLINDER.ends[0][1].angle
    theta = first + np.arccos(cosine) - CYLINDER.ends[1][1].angle
    theta[1] += 1e-6
    judgement = Judgement(scene, read(write("stroke,theta_2", stroke, theta), "stroke"))
    assert [finding.line for finding in judgement.differing] == [3]
    assert judgement.compared == 3 and judgement.table.found_by == "theta_2"
    own = solve(scene, "position")
    text = tabulate("theta_2", own.theta_2, own.stroke).replace("torque", "stroke")
    assert Judgement(scene, read(text)).status == HOLDS
    with refused("needs a column stroke"):
        judged(scene, "theta_2", theta, theta)


def test_a_table_without_an_angle_names_the_commanded_one(read):
    with refused("needs a column theta_4 (say theta_4 [deg"):
        read("torque\n1.0\n", "theta_4")


@mark.parametrize("decimals, rounded", [(1, True), (15, False)])
def test_a_time_on_both_sides_of_a_peak_of_the_law_is_refused(decimals, rounded, read):
    law = Sine(1.0, 0.5, 2.0 * pi, 1.0, 0.1 * pi)  # its peak: 0.2 s
    scene = crank_rocker(Motion(law=law))
    times = np.array([0.05, 0.12, 0.22, 0.31, 0.47])
    theta, omega, alpha = law.at(times)
    at = at_angles(theta)._replace(speed=omega, acceleration=alpha)
    columns = np.round(times, decimals), theta, solve(scene, at=at).torque
    rows = [",".join(map(repr, row)) for row in np.transpose(columns).tolist()]
    table = read("\n".join(["time,theta_2,torque", *rows, ""]))
    if rounded:
        with refused("line 4, time = 0.2: the law is at"):
            Judgement(scene, table)
    else:
        assert Judgement(scene, table).status == HOLDS


@mark.parametrize(
    "speeds, alphas, said", [((3, 4), (), 1), ((3, 3), (), 0), ((3, 4), (0, 5), 0)]
)
def test_an_acceleration_that_no_row_states_is_said_to_be_zero(
    speeds, alphas, said, read
):
    """Speeds that differ may be those of a motion that speeds up."""
    scene = crank_rocker(Motion(0.4))
    rates = [list(map(float, each)) for each in (speeds, alphas) if each]
    torque = solve(replace(scene, motion=Motion([0.4, 0.8], *rates))).torque
    heading = ",".join(["theta_2,torque", "omega_2", "alpha_2"][: 1 + len(rates)])
    table = read(write(heading, [0.4, 0.8], torque, *rates))
    judgement = Judgement(scene, table)
    text = "alpha_2 is not in the table: it is taken as 0"
    assert judgement.table.notes == (text,) * said and judgement.agreeing == 2
