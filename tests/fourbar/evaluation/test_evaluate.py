"""Error bars against the true error in ball arithmetic, where they once were too small,
too large or missing.
"""

from dataclasses import replace

import numpy as np
from pytest import mark

from fourbar import (
    Bar,
    FourBar,
    Gravity,
    Load,
    Motion,
    Place,
    Scene,
    Spring,
    Springs,
    Table,
    Torsion,
    command,
    limit_positions,
    solve,
)
from fourbar.formulas import longer
from fourbar.quantities import PIN_FORCES
from fourbar_lab import families, fault_scenes, stability
from fourbar_lab.tally import TOO_LARGE
from fourbar_validation.compare.tolerance import magnitude
from fourbar_validation.engines.balls import BallArithmetic
from tests.support.scenes import UNIFORM, WEIGHT

TURNS = 2000.0 * np.pi
BARS = 10.0
"""Error bars: 2 in 100 million normal errors exceed ten of them."""


def sized(k=1.0, turns=0.0):
    """A crank-rocker with lengths times k under what grows with them.

    Mass centres at angles of so many rad more.
    """
    linkage = FourBar(
        0.3 * k,
        Bar(0.1 * k, 0.2, centre=(0.04 * k, 0.4 + turns)),
        Bar(0.25 * k, 0.5, 0.004 * k * k, (0.13 * k, 0.3 + turns)),
        Bar(0.22 * k, 0.4, 0.002 * k * k, (0.12 * k, -0.2 + turns)),
        ground_angle=0.2,
    )
    spring = Spring(
        Place(1, (0.2 * k, 0.6)), Place(3, (0.15 * k, -0.4)), 80.0, 0.1 * k, 2.0 * k
    )
    effects = (
        Gravity(9.81 * k, -1.3),
        Springs((spring,)),
        Torsion.at(B=(0.5 * k * k, 0.7, 0.1 * k * k)),
    )
    loads = (
        Load(4, (3.0 * k, 0.7), arm=(0.05 * k, 1.0)),
        Load(3, (2.0 * k, 0.3), from_centre=(0.01 * k, 1.0)),
    )
    motion = Motion(np.linspace(0.1, 6.0, 15), 3.0, 2.0)
    return Scene(linkage, motion, 2, loads, effects)


def near_a_limit(effect):
    """Scene near a limit whose springs alone act: their pull is as uncertain as the
    directions of bars 3 and 4, which are nearly in line.
    """
    linkage = FourBar(0.3, Bar(0.25), Bar(0.1), Bar(0.22))
    limit = limit_positions(linkage)[0].theta_2
    angles = limit + np.sign(1.0 - limit) * 10.0 ** -np.arange(2.0, 9.0)
    return Scene(linkage, Motion(angles, 1.0), effects=(effect,))


def far_away(angle, ground_angle):
    """Move the angles of a crank-rocker; less a ground at 0 rad they are exact."""
    scene = sized()
    linkage = replace(scene.linkage, ground_angle=ground_angle)
    angles = angle + np.linspace(0.0, 6.0, 25)
    return replace(scene, linkage=linkage, motion=scene.motion.replace(angle=angles))


SCENES = {f"{k:g} m": sized(k) for k in (1.0, 1e60, 1e-60, 1e-75, 1e100)}
SCENES["centres of many turns"] = sized(turns=TURNS)
# force and couple of 1 at the crank's own pin: nothing is rounded but the result
SCENES["one"] = Scene(
    FourBar(0.3, Bar(0.1, centre=(0.0, 0.0)), Bar(0.25), Bar(0.22)),
    Motion([0.3, 1.0], 1.0),
    loads=(Load(2, (1.0, 0.0), moment=1.0),),
)
SCENES |= {
    f"{angle:g} rad, ground at {ground_angle} rad": far_away(angle, ground_angle)
    for angle in (1e3, 1e6, 1e8, 4e9)
    for ground_angle in (0.0, 0.2)
}
SPRINGS = Springs(
    (Spring(Place(2, (0.1, 0.6)), Place(3, (0.05, -0.4)), 80.0, 0.01, 2.0),)
)
SCENES |= {
    f"{effect.key} near a limit": near_a_limit(effect)
    for effect in (SPRINGS, Torsion.at(B=(0.5, 0.7, 0.1)))
}
# the slope of the forces would be taken beyond the table
SCENES["end of a table"] = Scene(
    UNIFORM,
    Motion([0.7, 1.0], 3.0),
    loads=(Load(4, moment=1.0, table=Table((0.5, 1.0), (1.0, 2.0))),),
)
# cos(-pi/2) as a double is 6e-17, and taken for zero
SCENES["heavy crank beside its equilibrium"] = Scene(
    FourBar(0.3, Bar(0.1, 1e6), Bar(0.25, 0.5), Bar(0.22, 0.4)),
    Motion(1.5 * np.pi + np.linspace(-1e-3, 1e-3, 101), 1.0),
    effects=WEIGHT,
)
for name in (
    "crank-rocker",
    "near a limit",
    "short output",
    "ends of a spring nearly meet",
):
    SCENES[name] = fault_scenes.FAULT_SCENES[name]


@mark.parametrize("kind", ["long doubles", "pairs of doubles"])
@mark.parametrize("name", SCENES)
def test_error_bars_are_of_the_size_of_the_error(name, kind, monkeypatch):
    scene = SCENES[name]
    if kind == "pairs of doubles":
        monkeypatch.setattr(longer, "HAS_LONG_DOUBLES", False)
    ours = solve(scene, "error")
    exact = BallArithmetic().answer(scene, command(scene))
    for bar, quantities in (("torque_error", ("torque",)), ("force_error", PIN_FORCES)):
        width = ours[bar]
        largest = np.max([magnitude(ours[q]) for q in quantities], axis=0)
        missed = [magnitude(ours[q] - exact.quantities[q]) for q in quantities]
        error, half_a_digit = np.max(missed, axis=0), 0.5 * np.spacing(largest)
        assert (error <= BARS * width).all(), name
        assert (width >= half_a_digit).all()
        assert np.median(width / np.maximum(error, half_a_digit)) < 5.0


@mark.slow
@mark.parametrize("family", families.FAMILY_DRAWERS)
def test_error_bars_hold_with_pairs_of_doubles(family, monkeypatch):
    """The numbers of a machine whose long doubles are no longer than doubles."""
    monkeypatch.setattr(longer, "HAS_LONG_DOUBLES", False)
    tally = stability.judge_samples(family, range(3))
    assert "force_error" in tally.worst and not tally.warned
    assert not [name for name in tally.list_beyond() if name.endswith("_error")]
    assert not any(tally.counts[name] for name in tally.counts if TOO_LARGE in name)


@mark.parametrize("angle", [2.0**24, 2.0**40])
def test_an_error_bar_grows_with_the_angle(angle):
    """A crank under its weight, m g r cos(theta): theta less the ground's angle has 64
    bits.
    """
    linkage = FourBar(0.3, Bar(0.1, 1.0), Bar(0.25), Bar(0.22), 0.2)
    scene = Scene(linkage, Motion(angle, 1.0), effects=WEIGHT)
    slope = abs(9.80665 * 0.05 * np.sin(angle))
    lost = 0.5 * angle * np.finfo(np.longdouble).eps * slope
    assert solve(scene, "error").torque_error[0] >= lost
