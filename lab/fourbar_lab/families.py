"""Families of hard positions: each sample is one position of a random scene.

A sample depends on its random generator alone.
"""

import cmath
import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.random import Generator

from fourbar.effects import (
    LinearDrive,
    Load,
    Place,
    PointDrive,
    Spring,
    Springs,
    Table,
    Torsion,
)
from fourbar.effects.load import FRAMES
from fourbar.linkage import MOVING_BARS, PINS, SECOND_PIN, Bar, FourBar
from fourbar.scene import Scene
from fourbar.scene.motion import Motion
from fourbar.scene.numbers import Point
from fourbar.solving import solve
from fourbar.studies.keys import list_entries, read_number, replace_numbers
from fourbar_validation.scenes.random import (
    DrawAngle,
    DrawnLinkage,
    RandomFamily,
    Ranges,
    draw_chance,
    draw_decades,
    draw_product,
    draw_uneven_lengths,
    draw_uniform,
)


def command_angle(psi: float) -> DrawAngle:
    """Command the angle theta_2 - theta_1, rad."""
    return lambda _, linkage: linkage.ground_angle + psi


def _spread_masses(spread: float) -> Ranges:
    """Spread masses over decades, one bar of ten without any.

    Centres lie anywhere about the bar.
    """
    return Ranges(
        mass=draw_chance(
            0.9, draw_product(draw_decades(-spread, spread), draw_uniform(0.2, 5.0))
        ),
        inertia=draw_uniform(0.0, 0.5),
        centre=draw_uniform(-0.5, 1.5),
        centre_angle=draw_chance(0.5, draw_uniform(-3.0, 3.0)),
        ground_angle=draw_chance(0.5, draw_uniform(-3.0, 3.0)),
        viscous=0.3,
        friction=0.2,
        by_length=False,
    )


_EVEN = _spread_masses(0.0)
UNEVEN_DRAWERS = _spread_masses(3.0)


def _draw_anywhere(rng: Generator) -> DrawnLinkage:
    """Draw lengths within a factor of ten, theta_2 anywhere it assembles."""
    while True:
        d, a = rng.uniform(0.1, 1.0, 2)
        angle = rng.uniform(-7.0, 7.0)
        diagonal = abs(d - a * complex(math.cos(angle), math.sin(angle)))
        b, c = rng.uniform(0.1, 1.0, 2)
        if abs(b - c) < diagonal < b + c:
            return (d, a, b, c), command_angle(angle)


def _draw_signed(rng: Generator, low: float, high: float) -> float:
    """Draw a number of either sign, whose size is uniform over decades."""
    return float(rng.choice([-1.0, 1.0]) * 10.0 ** rng.uniform(low, high))


def _draw_near_limit(rng: Generator) -> DrawnLinkage:
    """Draw a position within 1e-12..1e-2 rad of a limit of the input."""
    while True:
        d, a, b, c = rng.uniform(0.1, 1.0, 4)
        folded = bool(rng.random() < 0.5)
        diagonal = b - c if folded else b + c
        cosine = (a * a + d * d - diagonal**2) / (2 * a * d)
        if abs(cosine) < 0.999:
            offset = 10.0 ** rng.uniform(-12, -2)
            if not folded:
                offset = -offset
            side = float(rng.choice([-1.0, 1.0]))
            angle = side * (math.acos(cosine) + offset)
            return (d, a, b, c), command_angle(angle)


_BESIDE_ROUNDING = 1e-13
"""Least miss of a change point, as a part of a length. By less a linkage has one,
within the rounding.
"""


def _draw_near_change_point(rng: Generator) -> DrawnLinkage:
    """Draw a linkage 1e-8 to 1 rad from a change point, at that position.

    Parallelograms, kites and any s + l = p + q are drawn; some lengths miss the change
    point by as little.
    """
    x, y = rng.uniform(0.1, 1.0, 2)
    kind = rng.integers(0, 4)
    straight = 0.0
    if kind == 0:  # parallelogram, antiparallelogram
        lengths = (x, y, x, y)
        straight = float(rng.choice([0.0, math.pi]))
    elif kind == 1:  # kite a = b, c = d
        lengths = (x, y, y, x)
        straight = math.pi
    elif kind == 2:  # kite a = d, b = c
        lengths = (x, x, y, y)
    else:
        # multiples of 2^-20 so that d + a = b + c, or d - a = b - c, holds exactly
        d, a, b = (
            float(round(v * 2**20)) / 2**20
            for v in sorted(rng.uniform(0.1, 1.0, 3), reverse=True)
        )
        b = float(min(b, d + a - 0.01))
        lengths = (d, a, d - a + b, b)
        if rng.random() < 0.5:
            lengths = (d, a, b, d + a - b)
            straight = math.pi
    distance = _draw_signed(rng, -8.0, 0.0)
    changed = [*lengths]
    if rng.random() < 0.3:
        k = int(rng.integers(0, 4))
        missed = 0.1 * distance**2
        if missed >= _BESIDE_ROUNDING:
            changed[k] *= 1.0 + missed
    return changed, command_angle(straight + distance)


def _draw_with_ratios(rng: Generator) -> DrawnLinkage:
    """Draw lengths and masses in ratios from 1e-6 to 1e6.

    The ratios are crank to ground, coupler to diagonal, and those of masses.
    """
    lengths, angle = draw_uneven_lengths(
        rng,
        draw_decades(-6.0, 6.0),
        draw_decades(-1.0, 1.0),
    )
    return lengths, command_angle(angle)


ANYWHERE = RandomFamily(_draw_anywhere, _EVEN)


_GROWS = {"m": 1, "N m": 1, "kg m^2": 2}
"""Powers of the factor on lengths by which numbers of bars and loads grow, by unit."""


def scales(rng: Generator) -> Scene:
    """Multiply all lengths by 1e-9..1e9."""
    scene = ANYWHERE.draw(rng)
    k = float(10.0 ** rng.uniform(-9, 9))
    numbers = {}
    for key, number in list_entries(scene).items():
        if not key.startswith("effects."):
            factors = [k] * _GROWS.get(number.unit, 0)
            numbers[key] = math.prod([read_number(scene, number), *factors])
    return replace_numbers(scene, numbers)


def speeds(rng: Generator) -> Scene:
    """Draw omega_2 up to 1e6 rad/s, alpha_2 up to 1e12 rad/s^2, and the static case."""
    scene = ANYWHERE.draw(rng)
    omega = _draw_signed(rng, -3.0, 6.0) * bool(rng.random() < 0.9)
    alpha = float(rng.choice([0.0, _draw_signed(rng, -3.0, 12.0)]))
    return replace(scene, motion=scene.motion.replace(speed=omega, acceleration=alpha))


def _draw_deviation(rng: Generator) -> float:
    """Draw a relative deviation of 1e-5 to 3e-2, to either side."""
    return _draw_signed(rng, -5.0, math.log10(3e-2))


def massless(rng: Generator) -> Scene:
    """Draw a linkage of the random family without masses, loads and effects.

    Only what is added makes forces.
    """
    scene = ANYWHERE.draw(rng)
    d, a, b, c = scene.linkage.lengths
    return replace(
        scene,
        linkage=FourBar(d, Bar(a), Bar(b), Bar(c), scene.linkage.ground_angle),
        loads=(),
        effects=(),
    )


def _draw_place(
    bar: int,
    rng: Generator,
    nearest: float,
) -> Place:
    """Draw a place of a bar, from `nearest` to 1 m away from its first pin."""
    distance, angle = rng.uniform((nearest, -3.0), (1.0, 3.0)).tolist()
    return Place(bar, (distance, angle))


def springs(rng: Generator) -> Scene:
    """Draw a spring near the length at which its force is zero.

    Every other spring on average has a preload.
    """
    scene = massless(rng)
    first, second = rng.choice((1, *MOVING_BARS), 2, replace=False).tolist()
    start, end = (_draw_place(bar, rng, 0.0) for bar in (first, second))
    points = Point("P", first, start.from_pin), Point("Q", second, end.from_pin)
    places = solve(replace(scene, points=points), "position").points
    distance = math.hypot(*(places["Q"] - places["P"])[0])
    stiffness = rng.uniform(10.0, 1000.0)
    preload = 0.0
    if rng.random() < 0.5:
        preload = rng.uniform(-0.5, 2.0) * stiffness * distance
    length = distance * (1.0 + _draw_deviation(rng)) + preload / stiffness
    spring = Spring(start, end, stiffness, max(length, 0.0), preload)
    return replace(scene, effects=(Springs((spring,)),))


def torsion(rng: Generator) -> Scene:
    """Draw a torsion spring near the angle at which its couple is zero.

    The rest angle is often whole turns away. No spring is at O2: the angle there is
    given in doubles and comes back from the directions to the last digit more often
    than not, and an error that is zero by chance says nothing of the bar.
    """
    scene = massless(rng)
    solution = solve(scene, "position")
    pin = str(rng.choice(["A", "B", "O4"]))
    theta = [scene.linkage.ground_angle, solution.theta_2[0]]
    theta += [solution.theta_3[0], solution.theta_4[0]]
    first, second = PINS[pin]
    stiffness = rng.uniform(0.1, 10.0)
    preload = 0.0
    if rng.random() < 0.5:
        preload = rng.uniform(-2.0, 2.0) * stiffness
    many = int(rng.integers(-100, 100))
    turns = math.tau * float(rng.choice([0, 0, many]))
    relative = float(theta[second - 1] - theta[first - 1])
    rest = relative * (1.0 + _draw_deviation(rng)) + preload / stiffness + turns
    spring = Torsion.at(**{pin: (stiffness, rest, preload)})
    return replace(scene, effects=(spring,))


def tables(rng: Generator) -> Scene:
    """Draw a load over a table, many turns from its angles or none.

    Every other one is near where its factor is zero. The ground is level: against
    another theta_2 loses digits of all directions after many turns.
    """
    scene = massless(rng)
    linkage = scene.linkage
    angle = float(np.asarray(scene.motion.theta_2)) - linkage.ground_angle
    before, after = 10.0 ** rng.uniform(-3.0, 0.3, 2)
    rise = rng.uniform(-2.0, 2.0)
    if rng.random() < 0.5:
        factor = 1.0 + _draw_deviation(rng)
    else:
        factor = rng.uniform(-2.0, 2.0)
    first = -rise * before * factor
    last = first + rise * (before + after)
    table = Table((angle - before, angle + after), (first, last))
    many = int(10.0 ** rng.uniform(0.0, 9.0))
    turns = int(rng.choice([0, 1, -1, many]))
    size = rng.uniform(0.1, 10.0)
    arm = rng.uniform(0.0, 1.0)
    turned = (float(x) for x in rng.uniform(-3.0, 3.0, 2))
    frame = str(rng.choice(["world", "bar"]))
    moment = float(rng.choice([0.0, size]))
    form = "arm" if frame == "world" else "from_centre"
    place: Any = {form: (arm, next(turned))}
    load = Load(
        int(rng.choice(MOVING_BARS)),
        (size, next(turned)),
        moment=moment,
        frame=frame,
        table=table,
        **place,
    )
    motion = scene.motion.replace(angle=angle + math.tau * turns)
    level = replace(linkage, ground_angle=0.0)
    return replace(scene, linkage=level, loads=(load,), motion=motion)


def drives(rng: Generator) -> Scene:
    """Draw a cylinder between any two bars."""
    scene = ANYWHERE.draw(rng)
    bars = rng.choice((1, *MOVING_BARS), 2, replace=False)
    return _put_cylinder(scene, rng, *bars.tolist())


def _drive_by(scene: Scene, drive: LinearDrive | PointDrive) -> Scene:
    """Drive a scene by a cylinder or a push instead of a couple."""
    return replace(scene, drive_bar=None, drive=drive)  # type: ignore[arg-type]


def strokes(rng: Generator) -> Scene:
    """Command the stroke of a cylinder from the ground to bar 2 or 4.

    The stroke (m) and its speed are those of a random scene at its input's position.
    """
    bar = int(rng.choice([2, 4]))
    scene = _put_cylinder(ANYWHERE.draw(rng), rng, 1, bar)
    solution = solve(scene, "acceleration")
    directions = [solution.theta_2, solution.theta_3, solution.theta_4]
    turning = solution.omega_4[0]
    if bar == 2:
        turning = float(scene.motion.speed or 0.0)
        del directions[0]
    first, second, *_ = directions
    grows = solution.stroke_speed[0] * turning > 0.0
    motion = Motion(
        stroke=float(solution.stroke[0]),
        stroke_speed=float(solution.stroke_speed[0]),
        stroke_acceleration=rng.uniform(-2.0, 2.0),
        side="left" if grows else "right",
        branch=1 if math.sin(second[0] - first[0]) > 0.0 else -1,
    )
    return replace(scene, motion=motion)


def _put_cylinder(
    scene: Scene,
    rng: Generator,
    one: int,
    other: int,
) -> Scene:
    start, end = (_draw_place(bar, rng, 0.05) for bar in (one, other))
    return _drive_by(scene, LinearDrive(start, end))


def pushes(rng: Generator) -> Scene:
    """Draw a driving force at a point of a bar, along a fixed or turning line."""
    bar = int(rng.choice(MOVING_BARS))
    frame = str(rng.choice(FRAMES))
    place = _draw_place(bar, rng, 0.05)
    direction = rng.uniform(-3.0, 3.0)
    drive = PointDrive(place, direction, frame)
    return _drive_by(ANYWHERE.draw(rng), drive)


def _near_pins(rng: Generator) -> Scene:
    """Draw a spring or a cylinder with an end near a pin, or a load there.

    The end is at 1e-1 to 1e-11 m from the pin that joins its two bars. The line of the
    force then passes the pin at that distance, though its other end lies far off.
    """
    scene = massless(rng)
    pin = str(rng.choice(list(PINS)))
    near = {"O2": 1, "A": 3, "B": 3, "O4": 4}[pin]
    (far,) = {*PINS[pin]} - {near}
    distance = float(10.0 ** rng.uniform(-11.0, -1.0))
    angle = rng.uniform(-3.0, 3.0)
    if pin == SECOND_PIN[near]:
        distance, angle = cmath.polar(
            scene.linkage.lengths[near - 1] - cmath.rect(distance, angle)
        )
    start = Place(near, (distance, angle))
    end = _draw_place(far, rng, 0.1)
    if rng.random() < 0.5:
        start, end = end, start
    kind = rng.integers(0, 3)
    if kind == 0 and pin in ("A", "B", "O4"):
        two, three, four = (
            replace(scene.linkage.bar(bar), centre=(0.0, 0.0)) for bar in MOVING_BARS
        )
        force = (1.0, rng.uniform(-3.0, 3.0))
        frame = str(rng.choice(["world", "bar"]))
        linkage = replace(scene.linkage, input=two, coupler=three, output=four)
        load = Load(near, force, from_pin=(distance, angle), frame=frame)
        return replace(scene, linkage=linkage, loads=(load,))
    if kind == 1:
        return _drive_by(ANYWHERE.draw(rng), LinearDrive(start, end))
    stiffness = rng.uniform(10.0, 1000.0)
    length = rng.uniform(0.0, 2.0)
    spring = Spring(start, end, stiffness, length)
    return replace(scene, effects=(Springs((spring,)),))


FAMILY_DRAWERS: dict[str, Callable[[Generator], Scene]] = {
    "random": ANYWHERE.draw,
    "limit": RandomFamily(_draw_near_limit, _EVEN).draw,
    "change_point": RandomFamily(_draw_near_change_point, _EVEN).draw,
    "ratios": RandomFamily(_draw_with_ratios, UNEVEN_DRAWERS).draw,
    "scales": scales,
    "speeds": speeds,
    "springs": springs,
    "torsion": torsion,
    "tables": tables,
    "drives": drives,
    "strokes": strokes,
    "pushes": pushes,
    "near_pins": _near_pins,
}
