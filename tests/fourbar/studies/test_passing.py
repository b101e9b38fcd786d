"""Positions by a named angle, a stroke or a time.

Solved back, of every kind of motion.
"""

import re
from dataclasses import replace
from math import cos, pi, radians, sqrt

import numpy as np
from pytest import approx, mark, raises

from fourbar import (
    Load,
    Motion,
    Scene,
    Sweep,
    Torsion,
    equilibrium,
    limit_positions,
    load,
    solve,
    units,
)
from fourbar.effects import Table
from fourbar.errors import (
    FourBarError,
    InputError,
    NotAssembledError,
    state_messages_in,
)
from fourbar.files import loads
from fourbar.formulas.mobility import find_intervals
from fourbar.scene import command_at, say_range
from fourbar.show.located import locate
from fourbar.studies.passing import (
    INSIDE_LIMIT,
    extend_motion,
    find_commanded,
    meet_limit,
    say_nowhere,
)
from fourbar_validation.places import MODELS
from tests.support.scenes import bare, crank_rocker, find_angle, recommand, thesis

LOCATED = 1e-12
"""rad, m or s: a place is found to its last digits, and solved back with a few
eps/condition.
"""


AT_LIMIT = 10.0 * INSIDE_LIMIT
"""rad: the other bars turn by about as much as the bar from its limit, on average."""

STROKES = load(MODELS / "capabilities/stroke_input.toml")


def find_positions(scene, name, value):
    unit = "m" if name == "stroke" else "rad"
    return locate(extend_motion(scene), name, f"{value!r} {unit}")


@mark.parametrize(
    "scene, name",
    [
        (crank_rocker(Motion()), "theta_4"),
        (replace(STROKES, motion=Motion(), tolerances=()), "stroke"),
        (STROKES, "theta_4"),
    ],
)
def test_every_position_with_a_value_is_found_in_rising_order(scene, name):
    values = solve(scene, "position")[name]
    value = float(values[3:5].mean())
    found = find_positions(scene, name, value)
    solved = getattr(solve(scene, "position", at=found), name)
    assert solved == approx([value] * len(solved), abs=LOCATED)
    passes = np.count_nonzero(np.diff(np.sign(values - value)))
    if scene is STROKES:  # a value beyond the sweep is a position too
        assert len(solved) > passes == 1
    else:
        assert len(solved) == passes == 2
        assert 0.0 <= found.angle[0] < found.angle[1] <= 2.0 * pi


@mark.parametrize("beside", [0.0, 5e-7, -5e-7])
@mark.parametrize("side", [1.0, -1.0])
def test_a_limit_of_the_output_is_one_position(side, beside):
    """Input and coupler are in line: O2 B is their sum, or their difference."""
    scene = crank_rocker()
    d, a, b, c = scene.linkage.lengths
    theta_1 = scene.linkage.ground_angle
    reach = b + side * a
    at_O2 = find_angle(c, d, reach)
    at_O4 = find_angle(reach, d, c)
    found = find_positions(scene, "theta_4", theta_1 + pi - at_O4 + beside)
    theta_2 = theta_1 + at_O2 + (0.0 if side > 0.0 else pi)
    assert found.angle == approx([theta_2], abs=AT_LIMIT)


def test_at_a_limit_of_the_coupler_input_and_output_are_parallel():
    scene = Scene(bare(0.42, 0.6, 0.56, 0.45))
    ((_, limit),) = find_intervals(scene.linkage, 3)
    there = solve(scene, at=find_positions(scene, "theta_3", limit))
    assert np.sin(there.theta_4 - there.theta_2) == approx([0.0], abs=AT_LIMIT)


def test_a_commanded_angle_out_of_range_is_refused_with_the_range():
    with raises(FourBarError, match=r"theta_2 goes from 84\.6\d* to 365"):
        find_commanded(thesis(), radians(30.0))


REFUSED = [
    (crank_rocker(), "theta_4", 0.0, "no position has it"),
    (crank_rocker(), "stroke", 0.3, "must be among time"),
]


@mark.parametrize("scene, name, value, words", REFUSED)
def test_a_place_out_of_range_is_refused_with_the_range(scene, name, value, words):
    with raises(FourBarError, match=words):
        find_positions(scene, name, value)


def test_the_range_of_a_refusal_is_that_of_the_motion_and_not_the_other_one():
    """Bar 2 has two ranges; the extent of bar 4 is that of the second, which moves."""
    linkage = bare(0.3, 0.2, 0.25, 0.1)
    ranges = limit_positions(linkage)
    assert len(ranges) == 4
    low, high = sorted(2.0 * pi - limit.theta_2 for limit in ranges[:2])
    scene = Scene(linkage, Motion(Sweep(low + 0.1, high - 0.1, 20)))
    theta_4 = np.degrees(solve(scene).theta_4)
    opposite = radians(0.5 * (theta_4.min() + theta_4.max())) + pi
    with state_messages_in(units("deg")), raises(NotAssembledError) as caught:
        find_positions(scene, "theta_4", opposite)
    assert "no position has it" in str(caught.value)
    ends = re.findall(r"(-?[\d.]+) (?:to|deg)", str(caught.value))[-2:]
    least, most = map(float, ends)
    ends = limit_positions(linkage)[:2]
    extent = sorted(-np.degrees(limit.theta_4) % 360.0 for limit in ends)
    assert least < theta_4.min() and theta_4.max() < most
    assert (least % 360.0, most % 360.0) == approx(extent, rel=2e-3)


@mark.parametrize("turned", [0.0, 2.0 * pi, -4.0 * pi])
@mark.parametrize("lengths", [(0.3, 0.2, 0.25, 0.1), (0.3, 0.1, 0.25, 0.22)])
def test_positions_are_counted_as_the_motion_that_enters_its_range(lengths, turned):
    """Of the second range of bar 2, or of a crank; a load is stated for a part."""
    linkage = bare(*lengths)
    low, high = np.array(find_intervals(linkage)[-1]) + turned
    angles = Sweep(low - 0.1, low + 0.3, 8)
    part = Table((low % (2.0 * pi), low % (2.0 * pi) + 0.3), (1.0, 1.0))
    load = Load(4, moment=1.0, table=part)
    scene = Scene(linkage, Motion(angles, 1.0), loads=(load,))
    found = find_positions(scene, "theta_4", float(solve(scene, "position").theta_4[6]))
    assert low + 0.2 == approx(found.angle[0], abs=1e-9)
    assert (found.angle < high).all()


ROCKER_WITH_RAM = """\
[lengths]
ground = "7 in"
input = "2 in"
coupler = "4 in"
output = "4.5 in"
[motion]
stroke = "3.5 in"
side = "right"
[drive]
from = { bar = 1, from_pin = ["3 in", "-60 deg"] }
to = { bar = 2, from_pin = ["1 in", "0 deg"] }
"""


def test_strokes_that_assemble_are_named_where_none_requested_does():
    """The input's limits by cosines, and the cylinder from them by cosines.

    From the line of the cylinder's ground pin bar 2 turns clockwise to the one limit
    and anticlockwise, by the rest of a turn, to the other.
    """
    limit = find_angle(8.5, 7.0, 2.0)
    from_line = radians(60.0)
    first, last = (
        sqrt(3.0**2 + 1.0 - 6.0 * cos(limit + away)) for away in (-from_line, from_line)
    )
    scene = loads(ROCKER_WITH_RAM)
    assert not solve(scene).assembled.any()
    said = (
        "motion.stroke: the linkage assembles at none of the positions requested;"
        f" this cylinder can have 2 to {first:.6g} in and {last:.6g} to 4 in"
    )
    with state_messages_in(units("imperial")):
        assert say_nowhere(scene) == said
        with raises(NotAssembledError) as raised:
            equilibrium(scene)
        assert str(raised.value) == said
    other = recommand(scene, side="left")
    assert say_range(other) == "this cylinder can have 0.0508 to 0.1016 m"
    with raises(InputError, match="this cylinder can have"):
        command_at(other, np.array([-0.0762]))
    narrow = ROCKER_WITH_RAM.replace('"7 in"', '"10.3 in"').replace("-60 deg", "90 deg")
    none = loads(narrow.replace('"right"', '"left"'))
    assert say_range(none) == "this cylinder can have none with motion.side = left"


@mark.parametrize("beyond, met", [(4e-6, True), (6e-6, False)])
def test_an_angle_beyond_a_limit_by_its_rounding_is_the_limit(beyond, met):
    """Printed with six digits a limit may lie beyond itself."""
    linkage = crank_rocker().linkage
    (low, high), *_ = find_intervals(linkage, 4)
    for limit, outwards in ((low, -1.0), (high, 1.0)):
        angle = limit + 4.0 * pi + outwards * beyond
        kept = meet_limit(linkage, 4, angle, rounding=5e-6)
        assert abs(kept - angle) == approx(beyond if met else 0.0, rel=1e-6)
        inside = limit - outwards * beyond
        assert meet_limit(linkage, 4, inside, rounding=5e-6) == inside


def test_a_turn_begins_no_further_on_than_the_motion_needs():
    """A torsion spring is wound a turn away from the position that is stated."""
    effects = (Torsion.at(O2=(1.0, 0.0, 0.0)),)
    scene = crank_rocker(Motion(radians(90.0), 0.0), effects=effects)
    there = solve(scene, "position", at=command_at(scene, np.array([radians(65.0)])))
    near = find_positions(scene, "theta_4", float(there.theta_4[0]))
    assert near.angle.max() == approx(radians(65.0), abs=LOCATED)
    assert np.isfinite(solve(scene, at=near).torque).all()
