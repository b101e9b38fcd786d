"""Every quantity of linkages, commands, drives and effects against 320-bit balls.

Newton-Euler equations and a loop closed by a quadratic share nothing with the formulas.
"""

import json
from dataclasses import replace
from itertools import combinations, cycle, product
from math import pi, tau

import numpy as np
import pytest

from fourbar import (
    Flywheel,
    Friction,
    Gravity,
    LinearDrive,
    Load,
    Motion,
    Place,
    PointDrive,
    Scene,
    Spring,
    Springs,
    Table,
    Viscous,
    solve,
)
from fourbar.formulas.mobility import choose_range, limit_positions
from fourbar.linkage import MOVING_BARS, Bar, FourBar
from fourbar.quantities import (
    NO_TORQUE,
    NOT_ASSEMBLED,
    PIN_FORCES,
    SINGULAR,
    STAGE_OF,
)
from fourbar_lab.fault_scenes import FAULT_SCENES
from fourbar_validation.engines.description import find_unknown
from tests.support.balls import answer_in_balls
from tests.support.rows import read_rows
from tests.support.scenes import EPS, bare, draw_linkage

ROUNDINGS = {
    "position": (32.0, 1),
    "velocity": (32.0, 2),
    "acceleration": (128.0, 4),
}
"""Roundings of a quantity, and the power of 1/condition that magnifies them: one of a
direction, one more from the division by the root of the area, twice that of a second
derivative.
"""
BARS, FEW_ROUNDINGS = 10.0, 16.0 * EPS
"""Error bars: 2 in 100 million normal errors exceed ten of them; some are too small by
chance, where double and long double agree.
"""
FORCES = dict.fromkeys(PIN_FORCES, "force_error")
FORCES |= {name: f"{name}_error" for name in ("torque", "drive_force")}
LEAST_CONDITION = 1e-4
"""Nearer to a singular position the error bars alone say what is left."""
OF_A_LINE = 2e-11
"""Relative to the largest value: eps over the conditions of drives along a line, 1e-4.
"""
LENGTHS = read_rows("""
crank-rocker | 0.3 0.1 0.25 0.22 0.2
a = d | 0.3 0.3 0.25 0.22 -2
b = c | 0.3 0.1 0.25 0.25 1
input longer than ground | 0.1 0.3 0.25 0.32
short ground | 0.01 0.3 0.28 0.31 1
parallelogram | 0.3 0.1 0.3 0.1 0.4
kite b = c, a = d | 0.3 0.3 0.2 0.2 0.4
kite a = b, c = d | 0.2 0.3 0.3 0.2
change point in line | 0.3 0.1 0.2 0.2 0.4
touching folded | 0.2 0.1 0.4 0.3 0.4
rocker | 0.5 0.4 0.3 0.25 0.2
4 a d > 4 b c | 0.4 0.35 0.1 0.08
""")
"""Lengths, and the ground's angle where it is not 0."""
LINKAGES = {name: bare(*map(float, stated.split())) for name, stated in LENGTHS}
LINKAGES |= {f"drawn {n}": draw_linkage(np.random.default_rng(n)) for n in range(4)}
BODIES = read_rows("""
[0.2, 1e-3, [0.03, 0.4]] | [0.5, null, [0.1, -0.2]] | [0.4, 2e-3, [0.12, 0.3]]
[0.2] | [0.5, 0.004, [0.13, 0.3]] | [0.4]
[0.0, 1.0, [0.1, 1.0]] | [0.0, 0.0] | [0.4, 1.0, [0.0, 0.0]]
[0.0, 0.0] | [0.5, 0.0, [0.1, 2.0]] | [0.0, 0.7]
""")
"""Mass, inertia and centre of bars 2, 3 and 4."""
ON_3 = Place(3, (0.08, 0.2))
FACTORS = Table((0.0, 2.0, 5.0, tau), (1.0, 3.0, -1.0, 1.0))
ACTING = [
    ((), ()),
    (
        (
            Load(2, (3.0, 0.7), arm=(0.05, 1.0)),
            Load(3, (2.0, 0.3), from_centre=(0.1, 2.0), moment=0.4, frame="bar"),
            Load(4, (1.0, 0.9), moment=-0.3),
        ),
        (Gravity(), Viscous.at(O2=0.1, A=0.2, B=0.3, O4=0.1)),
    ),
    (
        (Load(3, (2.0, 0.3), arm=(0.1, 2.0), moment=0.4, table=FACTORS),),
        (Friction.at(O2=0.1, B=0.3), Flywheel(0.02, 4)),
    ),
    (
        (Load(4, (2.0, 0.3), from_pin=(0.1, 2.0), frame="bar"),),
        (
            Springs(
                (
                    Spring(Place(1, (0.2, 0.3)), Place(4, (0.15, 0.2)), 300.0, 0.05),
                    Spring(Place(1, (0.1, -1.5)), ON_3, 200.0, 0.05, 3.0),
                    Spring(Place(2, (0.1, 2.0)), ON_3, 90.0, 0.2, acts="push"),
                    Spring.gas(Place(1, (0.2, 2.0)), ON_3, 0.9, 0.3, 40.0, 70.0),
                )
            ),
        ),
    ),
    ((), (Gravity(9.81, 0.4), Flywheel(0.02, 2))),
]
"""Loads and effects."""
LINES = [
    LinearDrive(Place(i, (0.17, -1.1)), Place(j, (0.09, 0.7)))
    for i, j in combinations((1, 2, 3, 4), 2)
]
PUSHES = [
    PointDrive(Place(bar, (0.15, 0.3)), 1.1, frame)
    for bar, frame in product(MOVING_BARS, ("world", "bar"))
]


def embody(linkage, bodies):
    """Give the moving bars these masses, inertias and centres."""
    moving = zip(linkage.moving, bodies, strict=True)
    bars = (Bar(bar.length, *json.loads(body)) for bar, body in moving)
    return FourBar(linkage.ground, *bars, linkage.ground_angle)


def make_scenes():
    """Combine linkages, commanded bars, assemblies, bodies, effects and drives."""
    bodies, acting = cycle(BODIES), cycle(ACTING)
    drives = cycle([*MOVING_BARS, *LINES, *PUSHES])
    for (name, linkage), bar, branch in product(LINKAGES.items(), MOVING_BARS, (1, -1)):
        low, high = choose_range(linkage, bar)
        angles = [low + (high - low) * part for part in (0.03, 0.21, 0.45, 0.7, 0.96)]
        for other in set(MOVING_BARS) - {bar}:
            angles += [limit[bar - 2] for limit in limit_positions(linkage, other)]
        loads, effects = next(acting)
        rates = {f"omega_{bar}": -3.0, f"alpha_{bar}": 7.0, "branch": branch}
        drive = next(drives)
        driven = {"drive_bar": drive} if isinstance(drive, int) else {"drive": drive}
        yield (
            f"{name}, bar {bar}, {branch}",
            Scene(
                embody(linkage, next(bodies)),
                Motion(**{f"theta_{bar}": angles}, **rates),
                loads=loads,
                effects=effects,
                **driven,
            ),
        )


SCENES = dict(make_scenes()) | {
    name: scene
    for name, scene in FAULT_SCENES.items()
    if scene.motion.speed is not None
    and scene.motion.law is None
    and scene.motion.free is None
    and not find_unknown(scene, lambda effect: effect.in_balls)
}
STROKE = FAULT_SCENES["stroke_input"]
SCENES["a stroke from the bar"] = replace(
    STROKE, drive=LinearDrive(STROKE.drive.end, STROKE.drive.start)
)


def find_allowed(s, name, size):
    """Return by how much a quantity may differ from the balls."""
    if name in FORCES:
        return BARS * s[FORCES[name]] + FEW_ROUNDINGS * size
    largest = size[s.status_code == 0].max(initial=0.0)
    if name.startswith(("stroke", "drive")):
        return OF_A_LINE * largest
    lengths, bar = s.scene.linkage.lengths, s.scene.motion.bar
    stage = STAGE_OF.get(name, "position")
    roundings, power = ROUNDINGS[stage]
    speed, growth = (abs(s[f"{rate}_{bar}"]).max() for rate in ("omega", "alpha"))
    rate = {"position": 1.0, "velocity": speed, "acceleration": speed**2 + growth}
    reach = 1.0
    if STAGE_OF.get(name) is not None and s[name].ndim > 1:
        reach = max(*lengths, largest / rate[stage])
    ratio = 1.0 + max(lengths) / min(lengths)
    magnified = (ratio / np.fmax(s.condition, LEAST_CONDITION)) ** power
    return roundings * EPS * reach * rate[stage] * magnified


@pytest.mark.parametrize("name", SCENES)
def test_every_quantity_is_that_of_balls(name):
    scene = SCENES[name]
    s, exact = solve(scene, "error"), answer_in_balls(scene)
    ok = (s.status_code == 0) & (s.condition > LEAST_CONDITION)
    regular = np.isfinite(exact.get("power", np.nan * s.theta_2))
    regular &= exact["condition"] > LEAST_CONDITION
    regular &= exact["drive_condition"] > LEAST_CONDITION
    assert not set(s.status_code[regular]) & {SINGULAR, NOT_ASSEMBLED, NO_TORQUE}
    compared = [name for name in s.evaluated() if name in exact and name != "power"]
    assert len(compared) > 10
    for quantity in compared:
        apart = s[quantity] - exact[quantity]
        if quantity.startswith("theta"):  # balls have no whole turns
            apart = np.remainder(apart + pi, tau) - pi
        apart, size = (
            np.hypot(*values.T) if values.ndim > 1 else abs(values)
            for values in (apart, exact[quantity])
        )
        assert (apart <= find_allowed(s, quantity, size))[ok].all(), quantity
    driving, speed = s.torque, s[f"omega_{scene.drive_bar or 2}"]
    if scene.drive is not None:
        driving, speed = s.drive_force, s.stroke_speed
    assert s.power[ok] == pytest.approx((driving * speed)[ok], rel=4.0 * EPS)
