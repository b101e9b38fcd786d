"""Derivatives against the oracle, differences of studies, and cases known by hand."""

import json
import re

import numpy as np
from numpy.testing import assert_allclose, assert_array_equal
from pytest import approx, mark, raises

from fourbar import (
    Free,
    Friction,
    FromLimit,
    Gravity,
    InputError,
    Load,
    Motion,
    PinFriction,
    Scene,
    load,
    sensitivity,
    solve,
    uniform,
    vary,
)
from fourbar.show.lines import BLOCK_WIDTH
from fourbar.show.studies import write_sensitivity
from fourbar.studies.keys import list_entries, read_place
from fourbar_validation.places import MODELS
from tests.fourbar.studies.test_study import ANGLES, LINK, RUBBING, scene
from tests.support.rows import each_branch
from tests.support.scenes import PARALLELOGRAM, WEIGHT, cis, find_angle

EXACT = 1e-10
"""Of the derivative, or of what the quantity would change by if it were proportional to
the number.
"""


def test_a_drawn_coordinate_counts_by_a_hundredth_of_the_longest_bar():
    """Others count by a hundredth of themselves, angles by a degree."""
    slopes = sensitivity(load(MODELS / "capabilities/drawn.toml"))
    assert slopes.value("A")[0] == approx([0.095, 0.060])
    longest = max(slopes.solution.scene.linkage.lengths)
    numbers = dict(zip(slopes.keys, slopes.numbers, strict=True))
    for key, step in {
        "pins.B.0": 0.01 * longest,
        "points.P.drawn.1": 0.01 * longest,
        "bars.input.mass": 0.01 * numbers["bars.input.mass"],
        "motion.omega_2": 0.01 * numbers["motion.omega_2"],
    }.items():
        (change,) = (row.change for row in slopes.influences("|F12|") if row.key == key)
        most = np.nanmax(abs(slopes.of("|F12|", key)))
        assert abs(change) == approx(step * most, rel=EXACT)


def test_where_there_is_no_derivative_a_status_says_why():
    d, a, b, c = LINK.lengths
    in_line = find_angle(c, d, a + b)
    stops = sensitivity(
        scene((Friction.at(O4=0.05),), theta_2=LINK.ground_angle + in_line)
    )
    assert stops.status == ["at_rest"]
    assert np.isnan(stops.by["torque"]).all() and np.isfinite(stops.by["a_G3"]).all()
    jammed = sensitivity(scene((PinFriction.at(A=(9.0, 2.0)),), 2))
    assert set(jammed.status) <= {"jammed", "several"}
    assert np.isnan(jammed.by["F12"]).all()
    apart = Scene(
        uniform(0.2, 0.48, 0.55, 0.2),
        Motion(np.array([0.0, 1.2, np.pi]), 1.0),
    )
    slopes = sensitivity(apart)
    assert slopes.status == solve(apart).status
    lost = np.array(slopes.status) != "ok"
    assert lost.any() and not lost.all()
    for name, rows in slopes.by.items():
        assert np.isnan(rows[:, lost]).all() and np.isfinite(rows[:, ~lost]).all(), name


@mark.parametrize("dry", [Friction.at(B=0.05), RUBBING[1]])
def test_a_linkage_that_stands_has_the_derivatives_without_dry_friction(dry):
    """Torque and pin forces are those with friction 0; the speed makes them jump."""
    nominal = scene((Gravity(), dry), omega_2=0.0)
    rest = sensitivity(nominal)
    smooth = sensitivity(scene(WEIGHT, omega_2=0.0))
    assert rest.status == ["at_rest"] * len(ANGLES)
    for name in ("torque", "F12", "F43", "power"):
        assert np.isnan(rest.of(name, "motion.omega_2")).all()
        for key in smooth.keys.keys() - {"motion.omega_2"}:
            assert_allclose(rest.of(name, key), smooth.of(name, key), atol=1e-13)
    for name in ("torque_low", "torque_high"):
        for key in (key for key in rest.keys if "friction" in key):
            differences = differ_by_a_study(nominal, key, name)
            assert abs(differences).max() > 0.0
            assert_allclose(rest.of(name, key), differences, rtol=1e-6, atol=1e-9)
    text = write_sensitivity(rest, None)
    assert max(map(len, text.split("\n"))) <= BLOCK_WIDTH and "torque_low" in text
    said = f"without derivatives by motion.omega_2: {len(ANGLES)} at rest"
    assert said in text


def test_the_largest_share_comes_first_and_rounding_is_no_influence():
    """The coupler of a parallelogram does not turn: its load may act at any place."""
    motion = Motion(theta_4=np.array([0.5, 0.9]), omega_4=1.0)
    load = Load(3, (5.0, -1.0), from_pin=(0.1, 0.2))
    slopes = sensitivity(Scene(uniform(*PARALLELOGRAM), motion, loads=(load,)))
    moving = {row.key for row in slopes.influences("torque")}
    assert "loads.0.force.0" in moving and "loads.0.from_pin.0" not in moving
    text = write_sensitivity(slopes, None)
    rows = text[text.index("largest value") :].splitlines()
    cells = np.array([row.split()[-5:] for row in rows if row]).astype(float)
    assert (np.diff(np.max(abs(cells[1:]) / cells[0], axis=1)) < 1e-3).all()


def differ_by_a_study(nominal, key, name="theta_3"):
    """Difference a quantity of the members of a study on both sides of a number."""
    step = 1e-6
    number = read_place(nominal, list_entries(nominal)[key].place)
    beside = {key: np.array([number - step, number + step])}
    below, above = solve(vary(nominal, beside))[name]
    return np.angle(cis(above - below)) / (2.0 * step)


@each_branch
@mark.parametrize(
    "lengths, command",
    [
        (PARALLELOGRAM, "theta_2"),
        (PARALLELOGRAM, "theta_4"),
        ((0.3, 0.1, 0.1, 0.3), "theta_2"),
    ],
)
def test_derivatives_are_the_differences_of_a_study_at_change_points(
    lengths, branch, command
):
    """Those past a change point are of the same assembly."""
    motion = Motion(**{command: np.array([0.7, 2.4, 4.0, 5.5])}, branch=branch)
    nominal = Scene(uniform(*lengths), motion)
    slopes = sensitivity(nominal)
    assert "torque" not in slopes.by and "bars.input.mass" not in slopes.keys
    for key in ("lengths.ground", "lengths.input", "lengths.coupler"):
        differences = differ_by_a_study(nominal, key)
        assert_allclose(slopes.of("theta_3", key), differences, rtol=1e-6, atol=1e-6)


@mark.parametrize(
    "motion, word",
    [
        ({"theta_2": FromLimit(1, 0.1)}, "limit moves"),
        ({"theta_2": 1.0, "free": Free(1.0, 2)}, "free motion"),
    ],
)
def test_what_has_no_sensitivities(motion, word):
    with raises(InputError, match=word):
        sensitivity(Scene(LINK, Motion(**motion, omega_2=1.0)))


@mark.slow
def test_the_command_ranks_the_numbers_and_writes_them_all(show, run):
    model = MODELS / "crank_rocker.toml"
    command = "analyze", model, "--sensitivity"
    text = show(*command)
    # the torque of inertia grows with the square of the speed, that of weight and loads
    # does not
    (row,) = re.findall("bars.input.mass.*", text)
    assert row.split()[3:] == ["0", "0", "0"]
    document = json.loads(show(*command, "--json"))
    assert document["schema"] == "fourbar-sensitivity/1"
    assert document["keys"]["lengths.input"]["unit"] == "m"
    slopes = sensitivity(load(model)).of("F12", "lengths.input")
    assert_array_equal(document["by"]["F12"]["lengths.input"], slopes)
    assert run(*command, "--csv")[0] == 2
