"""Random scenes: a family is data.

Every scene follows from its family and a random generator alone.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from enum import Enum
from functools import partial
from typing import Any

import numpy as np

from fourbar.effects import (
    Flywheel,
    Friction,
    Gravity,
    Load,
    Place,
    PointDrive,
    Spring,
    Springs,
    Torsion,
    Viscous,
    list_kinds,
)
from fourbar.effects.load import FRAMES
from fourbar.formulas.mobility import choose_range
from fourbar.linkage import MOVING_BARS, PINS, Bar, FourBar, Lengths, record
from fourbar.scene import Scene
from fourbar.scene.motion import CROSSED, OPEN, Motion, Sweep

Draw = Callable[[np.random.Generator], float]
"""A number drawn at random."""


def draw_uniform(low: float, high: float) -> Draw:
    """Return a draw that is uniform between two numbers."""
    return lambda rng: float(rng.uniform(low, high))


def draw_decades(low: float, high: float) -> Draw:
    """Return a draw of ten to a power between two numbers."""
    return lambda rng: float(10.0 ** rng.uniform(low, high))


def draw_chance(
    share: float,
    draw: Draw,
    otherwise: float = 0.0,
) -> Draw:
    """Return a draw that is made in this share of all cases."""
    return lambda rng: draw(rng) if rng.random() < share else otherwise


def draw_product(*draws: Draw) -> Draw:
    """Return a draw of the product of several draws."""
    return lambda rng: math.prod(draw(rng) for draw in draws)


_ANY_ANGLE = draw_uniform(-math.pi, math.pi)
_ANY_PART = draw_uniform(0.0, 1.0)
_EITHER_SIGN = draw_uniform(-1.0, 1.0)


PUSHED = 0.2
"""Share of the scenes of the suites that a force at a point drives."""


@record
class Ranges:
    """Distributions from which a random scene is drawn."""

    mass: Draw
    """kg per metre of bar, or kg."""
    inertia: Draw
    """Moment of inertia about G, in parts of mass times length squared."""
    centre: Draw
    """Distance of the mass centre, in parts of the length."""
    centre_angle: Draw
    ground_angle: Draw = _ANY_ANGLE
    load: Draw = _ANY_PART
    """Load: a force in parts of the weight of all bars, and a moment. The moment is in
    parts of that weight at the bar's length.
    """
    arm: Draw = _ANY_PART
    """Distance from G at which a load acts, in parts of the length."""
    without_force: float = 0.0
    """Share of the loads that are a moment alone."""
    speed: Draw = draw_decades(-1.0, 2.0)
    """|omega_2|, rad/s."""
    acceleration: Draw = _EITHER_SIGN
    """alpha_2 where there is one, of omega_2 squared."""
    gravity: float = 0.5
    viscous: float = 0.0
    friction: float = 0.0
    """Shares of the scenes that have such an effect."""
    sprung: float = 0.0
    """Share of the scenes that have a spring. Likewise of a torsion spring, and of a
    flywheel.
    """
    pushed: float = 0.0
    """Share of the scenes that a force at a point drives."""
    by_length: bool = True
    """True if the mass is per metre."""


DrawAngle = Callable[[np.random.Generator, FourBar], Any]
"""Commanded theta_2, rad, of a linkage whose bars are drawn."""
DrawnLinkage = tuple[Sequence[float], DrawAngle]
"""Lengths (ground, input, coupler, output), m, and the angles commanded."""


@record
class RandomFamily:
    """Random scenes of one kind."""

    draw_linkage: Callable[[np.random.Generator], DrawnLinkage]
    ranges: Ranges

    def draw(self, rng: np.random.Generator) -> Scene:
        """Draw a scene."""
        lengths, draw_angles = self.draw_linkage(rng)
        scene = draw_scene(rng, lengths, self.ranges)
        return replace(
            scene,
            motion=scene.motion.replace(angle=draw_angles(rng, scene.linkage)),
        )


def draw_bars(
    rng: np.random.Generator,
    lengths: Sequence[float],
    ranges: Ranges,
) -> list[Bar]:
    """Draw bars 2, 3, 4 of these lengths (m)."""
    bars = []
    for length in lengths:
        mass = ranges.mass(rng) * (length if ranges.by_length else 1.0)
        centre = (length * ranges.centre(rng), ranges.centre_angle(rng))
        inertia = mass * length**2 * ranges.inertia(rng)
        bars.append(Bar(length, mass, inertia, centre))
    return bars


def draw_scene(
    rng: np.random.Generator,
    lengths: Sequence[float],
    ranges: Ranges,
) -> Scene:
    """Draw a scene on (ground, input, coupler, output), m, at theta_2 = 0."""
    d, *moving = (float(length) for length in lengths)
    bars = draw_bars(rng, moving, ranges)
    two, three, four = bars
    linkage = FourBar(d, two, three, four, ranges.ground_angle(rng))
    weight = 9.81 * (math.fsum(bar.mass for bar in bars) or 1.0)
    count = int(rng.integers(0, 3))
    loads = [_draw_load(rng, linkage, weight, ranges) for _ in range(count)]
    effects: list[Any] = []
    if rng.random() < ranges.gravity:
        effects.append(Gravity())
    couple = 0.1 * weight * max(moving)
    for kind, share in ((Viscous, ranges.viscous), (Friction, ranges.friction)):
        if rng.random() < share:
            effects.append(kind.at(**_draw_at_pins(rng, couple)))
    if ranges.sprung:
        effects += _draw_springs(rng, linkage, weight, ranges)
    drawn = (kind.draw(rng, couple) for kind in list_kinds().values())
    effects += [effect for effect in drawn if effect is not None]
    omega = float(rng.choice([-1.0, 1.0])) * ranges.speed(rng)
    alpha = float(rng.choice([0.0, omega**2 * ranges.acceleration(rng)]))
    branch = OPEN if rng.random() < 0.5 else CROSSED
    bar = int(rng.choice(MOVING_BARS))
    drive: dict[str, Any] = {"drive_bar": bar}
    if ranges.pushed and rng.random() < ranges.pushed:
        length = linkage.bar(bar).length
        place = Place(bar, (length * (1.0 + ranges.arm(rng)), _ANY_ANGLE(rng)))
        direction = _ANY_ANGLE(rng)
        drive = {"drive": PointDrive(place, direction, str(rng.choice(FRAMES)))}
    return Scene(
        linkage,
        Motion(0.0, omega, alpha, branch),
        loads=tuple(loads),
        effects=tuple(effects),
        **drive,
    )


def _draw_at_pins(rng: np.random.Generator, most: float) -> dict[str, float]:
    """Draw a number up to the most at each pin, or none there."""
    numbers = {}
    for pin in PINS:
        if rng.random() < 0.5:
            numbers[pin] = most * float(rng.random())
    return numbers


_PLACES_OF_A_FORCE = ("from_pin", "from_centre", "arm")
"""Forms in which a drawn load states where it acts; an arm is for a fixed direction."""


def _draw_load(
    rng: np.random.Generator,
    linkage: FourBar,
    weight: float,
    ranges: Ranges,
) -> Load:
    """Draw a force and a moment, or one of them, on any bar."""
    bar = int(rng.choice(MOVING_BARS))
    length = linkage.bar(bar).length
    size = weight * ranges.load(rng)
    force = None if rng.random() < ranges.without_force else (size, _ANY_ANGLE(rng))
    place = (length * ranges.arm(rng), _ANY_ANGLE(rng))
    moment = float(rng.choice([0.0, size * length * _EITHER_SIGN(rng)]))
    frame = "bar" if rng.random() < 0.5 else "world"
    forms = _PLACES_OF_A_FORCE if frame == "world" else _PLACES_OF_A_FORCE[:2]
    form = str(rng.choice(forms))
    at: Any = {} if force is None else {form: place}
    return Load(bar, force, moment=moment, frame=frame, **at)


def _draw_springs(
    rng: np.random.Generator,
    linkage: FourBar,
    weight: float,
    ranges: Ranges,
) -> list[Any]:
    """Draw springs, torsion springs and flywheels.

    Springs are about as strong as the loads.
    """
    effects: list[Any] = []
    size = weight * abs(ranges.load(rng))
    lengths = linkage.lengths
    if rng.random() < ranges.sprung:
        start, end = (
            Place(bar, (lengths[bar - 1] * ranges.arm(rng), _ANY_ANGLE(rng)))
            for bar in rng.choice([1, *MOVING_BARS], 2, replace=False).tolist()
        )
        longest = max(lengths)
        stiffness = (size or 1.0) / longest
        free = longest * _ANY_PART(rng)
        spring = Spring(start, end, stiffness, free, size * _EITHER_SIGN(rng))
        effects.append(Springs((spring,)))
    if rng.random() < ranges.sprung:
        couple = size * max(lengths[1:])
        pin = str(rng.choice(list(PINS)))
        rest = _ANY_ANGLE(rng)
        preload = couple * _EITHER_SIGN(rng)
        effects.append(Torsion.at(**{pin: (couple or 1.0, rest, preload)}))
    if rng.random() < ranges.sprung:
        bar = int(rng.choice([2, 4]))
        inertia = (linkage.bar(bar).mass or 1.0) * lengths[bar - 1] ** 2
        effects.append(Flywheel(inertia * ranges.inertia(rng), bar))
    return effects


class DrawnType(Enum):
    """Type of a linkage by the motion of its input and output."""

    CRANK_ROCKER = "crank-rocker"
    DRAG_LINK = "drag-link"
    DOUBLE_ROCKER = "double-rocker"
    ROCKER_CRANK = "rocker-crank"
    TRIPLE_ROCKER = "triple-rocker"


SHORTEST_BAR = {
    DrawnType.DRAG_LINK: 0,
    DrawnType.CRANK_ROCKER: 1,
    DrawnType.DOUBLE_ROCKER: 2,
    DrawnType.ROCKER_CRANK: 3,
}
"""Index in (ground, input, coupler, output) of the shortest bar, by type. The linkage
is a Grashof one.
"""
UNEVEN_TYPE = "uneven"
"""Name that stands for the family `_UNEVEN_FAMILY` in place of types."""
POSITIONS_OF_A_SWEEP = 37
_CLEARANCE = 0.02
"""Distance of a random linkage from a change point: the least |s + l - p - q| as a part
of the longest bar.
"""


def draw_lengths(
    rng: np.random.Generator,
    kind: DrawnType,
) -> Lengths:
    """Draw (ground, input, coupler, output) of the given type.

    The longest bar is 1, and change points are kept away from.
    """
    while True:
        lengths = np.sort(rng.uniform(0.1, 1.0, 4))
        lengths[3] = 1.0
        shortest, p, q, longest = lengths
        surplus = p + q - shortest - longest
        if p + q + shortest - longest < _CLEARANCE:
            continue
        if kind is DrawnType.TRIPLE_ROCKER and surplus < -_CLEARANCE:
            drawn = rng.permutation(lengths)
        elif kind is not DrawnType.TRIPLE_ROCKER and surplus > _CLEARANCE:
            others = rng.permutation(lengths[1:])
            drawn = np.insert(others, SHORTEST_BAR[kind], shortest)
        else:
            continue
        d, a, b, c = drawn.tolist()
        return d, a, b, c


def draw_uneven_lengths(
    rng: np.random.Generator,
    crank: Draw,
    coupler: Draw,
) -> tuple[Sequence[float], float]:
    """Draw (ground, input, coupler, output), m, and an angle at which they close.

    The angle is theta_2 - theta_1, rad. `crank` and `coupler`: of the ground, and of
    the diagonal from A to O4 at that angle.
    """
    d = float(rng.uniform(0.1, 1.0))
    a = d * crank(rng)
    angle = float(rng.uniform(-7.0, 7.0))
    diagonal = abs(d - a * complex(math.cos(angle), math.sin(angle)))
    b = diagonal * coupler(rng)
    c = abs(diagonal - b) + 2.0 * min(diagonal, b) * rng.uniform(0.02, 0.98)
    return (d, a, b, c), angle


_TEN_DECADES = draw_decades(-5.0, 5.0)
UNEVEN_RANGES = Ranges(
    pushed=PUSHED,
    mass=draw_chance(0.9, _TEN_DECADES),
    inertia=draw_product(draw_uniform(0.02, 0.4), draw_chance(0.5, _TEN_DECADES, 1.0)),
    centre=draw_product(draw_uniform(-1.0, 2.0), draw_chance(0.3, _TEN_DECADES, 1.0)),
    centre_angle=draw_chance(0.5, draw_uniform(-3.0, 3.0)),
    load=draw_product(_EITHER_SIGN, _TEN_DECADES),
    arm=draw_product(_ANY_PART, draw_chance(0.3, _TEN_DECADES, 1.0)),
    without_force=0.2,
    speed=_TEN_DECADES,
    viscous=0.3,
    friction=0.2,
    sprung=0.3,
    by_length=False,
)
"""Masses, inertias, arms, loads and speeds each over ten decades."""


def _draw_uneven_place(rng: np.random.Generator) -> DrawnLinkage:
    lengths, psi = draw_uneven_lengths(rng, _TEN_DECADES, _TEN_DECADES)
    size = 10.0 ** rng.uniform(-3.0, 3.0)

    def draw_angles(rng: np.random.Generator, linkage: FourBar) -> Any:
        return (
            linkage.ground_angle + psi + np.array([0.0, 1e-3, rng.uniform(-3.0, 3.0)])
        )

    return [size * x for x in lengths], draw_angles


_UNEVEN_FAMILY = RandomFamily(_draw_uneven_place, UNEVEN_RANGES)
"""Linkages with ratios of 1e-5 to 1e5, and with every kind of effect. The ratios are
those of lengths, masses, arms and loads.
"""


MACHINES = Ranges(
    pushed=PUSHED,
    mass=draw_decades(-1.0, 1.0),
    inertia=draw_uniform(1.0 / 24.0, 1.0 / 6.0),
    centre=draw_uniform(0.2, 0.8),
    centre_angle=draw_uniform(-1.0, 1.0),
    arm=draw_uniform(0.0, 0.5),
    speed=draw_decades(-0.5, 1.5),
    acceleration=draw_uniform(-0.1, 0.1),
)
"""Bars as machines have them."""


def _draw_machine_place(kind: DrawnType, rng: np.random.Generator) -> DrawnLinkage:
    """Draw a linkage of a type, and POSITIONS_OF_A_SWEEP angles over its range."""
    size = 10.0 ** rng.uniform(-1.5, 1.0)
    lengths = [size * x for x in draw_lengths(rng, kind)]
    return lengths, lambda _, linkage: Sweep(
        *choose_range(linkage), POSITIONS_OF_A_SWEEP - 1
    )


def draw_random_scene(
    seed: int,
    index: int,
    types: tuple[DrawnType, ...],
) -> Scene:
    """Draw a scene of one of the types, taken in turn; without types an uneven one."""
    rng = np.random.default_rng([seed, index])
    family = _UNEVEN_FAMILY
    name = UNEVEN_TYPE
    if types:
        kind = types[index % len(types)]
        family = RandomFamily(partial(_draw_machine_place, kind), MACHINES)
        name = kind.value
    return replace(family.draw(rng), title=f"{name} {index}")
