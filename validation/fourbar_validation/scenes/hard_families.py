"""The hard cases: families of scenes that lie near singular positions.

A family is a generator, and one line on what must happen.
"""

import math
import tomllib
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import numpy as np

from fourbar.effects import Gravity, Load
from fourbar.linkage import Bar, FourBar, Lengths
from fourbar.quantities import Array
from fourbar.scene import Scene
from fourbar.scene.motion import BRANCH_NAMES, Free, Motion, Sweep
from fourbar_validation.scenes.bars import list_moving, replace_bars
from fourbar_validation.scenes.random import (
    DrawnType,
    Ranges,
    draw_bars,
    draw_lengths,
    draw_uniform,
)
from fourbar_validation.scenes.suites import Suite

HEAVY_BARS = Ranges(
    mass=draw_uniform(0.2, 2.0),
    inertia=draw_uniform(0.05, 0.2),
    centre=draw_uniform(0.2, 0.8),
    centre_angle=draw_uniform(-0.5, 0.5),
)
Scenes = Iterator[tuple[str, Scene]]
_ROCKERS = (DrawnType.DOUBLE_ROCKER, DrawnType.TRIPLE_ROCKER)
TYPES_WITH_A_CRANK = DrawnType.CRANK_ROCKER
TYPES_WITH_A_ROCKER = DrawnType.TRIPLE_ROCKER
REGULAR = (0.5, 0.4, 0.3)
"""rad from the singular position: positions that set the scale of each quantity."""
TOGGLE = tuple(10.0**-k for k in range(1, 13))
NEAR_DISTANCES = (1e-1, 3e-2, 1e-2, 3e-3)
"""rad; as far as a simulation in time follows."""
_POLE = tuple(10.0**-k for k in range(1, 10))
ORDINARY_LENGTHS = (0.3, 0.1, 0.25, 0.22)
"""Lengths of an ordinary crank-rocker, m."""
CHANGE = tuple(10.0**-k for k in range(1, 9))


def draw_lengths_of_type(kind: DrawnType, seed: int) -> Lengths:
    """Draw random lengths of a type, from its seed alone."""
    number = list(DrawnType).index(kind)
    rng = np.random.default_rng([seed, number])
    return draw_lengths(rng, kind)


def dress(lengths: Lengths, seed: int = 0) -> Scene:
    """Return a scene on these lengths that moves at 3 rad/s and 2 rad/s^2 under loads.

    The mass centres are offset; gravity, a force and a couple act.
    """
    rng = np.random.default_rng([seed, 4])
    d, *moving = lengths
    bars = draw_bars(rng, moving, HEAVY_BARS)
    weight = 9.81 * sum(bar.mass for bar in bars)
    direction = float(rng.uniform(-3, 3))
    arm = (0.2 * moving[2], float(rng.uniform(-3, 3)))
    loads = (
        Load(4, (weight, direction), arm=arm),
        Load(3, moment=0.1 * weight * moving[1]),
    )
    linkage = FourBar(
        d,
        bars[0],
        bars[1],
        bars[2],
        float(rng.uniform(-1, 1)),
    )
    return Scene(
        linkage,
        Motion(0.0, 3.0, 2.0),
        drive_bar=2,
        loads=loads,
        effects=(Gravity(),),
    )


def set_angles(scene: Scene, psi: object, branch: int = 1, **changes: object) -> Scene:
    """Set the scene to angles psi = theta_2 - theta_1 (rad) on a branch."""
    theta_2 = scene.linkage.ground_angle + np.atleast_1d(np.asarray(psi, dtype=float))
    motion = scene.motion.replace(angle=theta_2, branch=branch)
    return replace(scene, motion=motion, **changes)  # type: ignore[arg-type]


def _compute_corners(
    side: float,
    second_side: float,
    opposite: float,
) -> list[float]:
    """Return both signs of the angle between two sides of a triangle; [] if none.

    `opposite` is the third side.
    """
    if not second_side:
        return []
    squares = side * side + second_side * second_side - opposite * opposite
    cosine = squares / (2 * side * second_side)
    if not abs(cosine) < 1.0:
        return []
    corner = math.acos(cosine)
    return [corner, -corner]


def find_collinear_3_4(lengths: Lengths) -> list[tuple[float, bool]]:
    """Find psi in (0, pi) with bars 3, 4 stretched (True) or folded.

    At these angles a^2 + d^2 - 2 a d cos psi = (b +- c)^2.
    """
    d, a, b, c = lengths
    return [
        (psi, stretched)
        for joined, stretched in ((b + c, True), (b - c, False))
        for psi in _compute_corners(d, a, joined)[:1]
    ]


def find_collinear_2_3(lengths: Lengths) -> list[tuple[float, int]]:
    """Find (psi, branch) where bars 2, 3 are collinear, so omega_4 = 0.

    The triangle O2, B, O4 with O2 B = |a +- b| gives psi.
    """
    d, a, b, c = lengths
    places = []
    for along in (a + b, a - b):
        for psi in _compute_corners(d, along, c):
            u = complex(math.cos(psi), math.sin(psi))
            branch = _find_sense(d - a * u, (along - a) * u)
            places.append((psi, branch))
    return places


def _find_parallel_2_4(lengths: Lengths) -> list[tuple[float, int]]:
    """Find (psi, branch) where bars 2, 4 are parallel, so omega_3 = 0.

    Loop closure is then (a -+ c) e^{i psi} + b e^{i psi_3} = d.
    """
    d, a, b, c = lengths
    places = []
    for joined, side in ((a - c, 1.0), (a + c, -1.0)):
        for psi in _compute_corners(d, joined, b):
            u = complex(math.cos(psi), math.sin(psi))
            branch = _find_sense(d - joined * u, side * c * u)
            places.append((psi, branch))
    return places


def _find_sense(one: complex, second: complex) -> int:
    """Return the sign of the rotation from one direction to another."""
    if (one.conjugate() * second).imag > 0.0:
        return 1
    return -1


def toggle(*, distances: tuple[float, ...] = TOGGLE, seeds: range = range(2)) -> Scenes:
    """Approach bars 3, 4 in line from inside, and the same distances beyond it."""
    for kind in _ROCKERS:
        for seed in seeds:
            lengths = draw_lengths_of_type(kind, seed)
            scene = dress(lengths, seed)
            for psi, stretched in find_collinear_3_4(lengths):
                inward = -1.0 if stretched else 1.0
                inside = psi + inward * np.array([*REGULAR, *distances])
                beyond = psi - inward * np.array(distances)
                angles = [*inside, *beyond[::-1]]
                in_line = "stretched" if stretched else "folded"
                for branch, name in BRANCH_NAMES.items():
                    label = f"{kind.value} {seed} {in_line} {name}"
                    yield label, set_angles(scene, angles, branch)


def _list_both_sides(distances: tuple[float, ...]) -> Array:
    """List offsets from a singular position: up to it, and on from it, rad."""
    towards = [*REGULAR, *distances]
    before = [-distance for distance in towards]
    return np.array([*before, *reversed(towards)])


def _approach_poles(bar: int) -> Scenes:
    """Approach from both sides positions where the driven bar 3 or 4 stands still."""
    offsets = _list_both_sides(_POLE)
    for seed in range(2):
        lengths = draw_lengths_of_type(TYPES_WITH_A_CRANK, seed)
        scene = dress(lengths, seed)
        if bar == 3:
            poles = _find_parallel_2_4(lengths)
        else:
            poles = find_collinear_2_3(lengths)
        for number, (psi, branch) in enumerate(poles[:3]):
            near = set_angles(scene, psi + offsets, branch, drive_bar=bar)
            yield f"{seed} {number}", near


def _driven_output() -> Scenes:
    """Drive on bar 4 through a whole turn of the input.

    The turn leads across both positions where omega_4 = 0.
    """
    for seed in range(2):
        scene = dress(draw_lengths_of_type(TYPES_WITH_A_CRANK, seed), seed)
        turn = Sweep(0.05, 0.05 + 2 * math.pi, 180)
        for branch, name in BRANCH_NAMES.items():
            motion = Motion(turn, 3.0, 0.0, branch)
            yield f"{seed} {name}", replace(scene, motion=motion, drive_bar=4)


CHANGE_POINTS: dict[str, tuple[Lengths, tuple[float, ...]]] = {
    "parallelogram": ((0.3, 0.1, 0.3, 0.1), (0.0, math.pi)),
    "parallelogram a > d": ((0.1, 0.3, 0.1, 0.3), (0.0, math.pi)),
    "kite a = b": ((0.3, 0.1, 0.1, 0.3), (0.0, math.pi)),
    "kite a = d": ((0.1, 0.1, 0.3, 0.3), (0.0,)),
    "a + d = b + c": ((0.4, 0.1, 0.27, 0.23), (math.pi,)),
}
"""Lengths and change points psi. "Open" a parallelogram stays one, "crossed" it is the
antiparallelogram. The kite a = d has A on O4 at its change point.
"""


def approach_change_point(*, distances: tuple[float, ...] = CHANGE) -> Scenes:
    """Close to a change point, on both sides and in both assemblies."""
    offsets = _list_both_sides(distances)
    for kind, (lengths, points) in CHANGE_POINTS.items():
        scene = dress(lengths)
        for psi in points:
            for branch, name in BRANCH_NAMES.items():
                label = f"{kind} {math.degrees(psi):.0f} {name}"
                yield label, set_angles(scene, psi + offsets, branch)


def sweep_change_point(*, steps: int = 145) -> Scenes:
    """Sweep two turns through the change points in both assemblies."""
    for kind, (lengths, _) in CHANGE_POINTS.items():
        scene = dress(lengths)
        start = scene.linkage.ground_angle + 0.3
        turns = Sweep(start, start + 4 * math.pi, steps)
        for branch, name in BRANCH_NAMES.items():
            motion = Motion(turns, 3.0, 0.0, branch)
            yield f"{kind} {name}", replace(scene, motion=motion)


def _miss_grashof() -> Scenes:
    """Miss s + l = p + q by a hair on either side.

    The sweep passes close to where it would change.
    """
    d = 0.4
    a = 0.1
    b = 0.25
    for gap in (1e-3, 1e-6, 1e-9, 1e-12):
        for sign in (1.0, -1.0):
            scene = dress((d, a, b, d + a - b + sign * gap))
            start = scene.linkage.ground_angle
            sweep = Sweep(start, start + 2 * math.pi, 60)
            motion = scene.motion.replace(angle=sweep, acceleration=0.0)
            yield f"{sign * gap:+.0e}", replace(scene, motion=motion)


def sweep_turn(scene: Scene, steps: int = 36) -> Scene:
    """Sweep through one turn of the input."""
    turn = Sweep(0.1, 0.1 + 2 * math.pi, steps)
    motion = scene.motion.replace(angle=turn, acceleration=0.0)
    return replace(scene, motion=motion)


def _shorten_crank() -> Scenes:
    """Shorten the crank against the coupler, again and again."""
    for k in range(-6, 0):
        crank = 0.25 * 10.0**k
        yield f"1e{k}", sweep_turn(dress((0.3, crank, 0.25, 0.22)))


def _vary_mass_ratio() -> Scenes:
    """Make one bar heavier or lighter than the others by up to 1e6."""
    base = sweep_turn(dress(ORDINARY_LENGTHS))
    for name, bar in list_moving(base):
        for k in (-6, -3, 3, 6):
            times = 10.0**k
            inertia = bar.moment_of_inertia * times
            heavy = replace(bar, mass=bar.mass * times, inertia=inertia)
            yield f"{name} 1e{k:+d}", replace_bars(base, **{name: heavy})


def _remove_inertia() -> Scenes:
    """Take bars without rotational inertia, and without mass.

    Some have loads only on massless bars.
    """
    base = sweep_turn(dress(ORDINARY_LENGTHS))
    massless = {}
    for name, bar in list_moving(base):
        point_mass = replace(bar, inertia=0.0)
        massless[name] = Bar(bar.length)
        yield f"{name} point mass", replace_bars(base, **{name: point_mass})
        yield f"{name} massless", replace_bars(base, **{name: massless[name]})
    yield "all massless", replace_bars(base, **massless)


def _move_centres_out() -> Scenes:
    """Put mass centres far outside the bar."""
    base = sweep_turn(dress(ORDINARY_LENGTHS))
    for name, bar in list_moving(base):
        for k in (3.0, 100.0, 1e4):
            far = replace(bar, centre=(k * bar.length, 2.0))
            yield f"{name} {k:g}", replace_bars(base, **{name: far})


def _scale_sizes() -> Scenes:
    """Scale the same shape from micrometres to a thousand kilometres."""
    for k in range(-6, 7, 2):
        size = 10.0**k
        d, a, b, c = ORDINARY_LENGTHS
        lengths = (d * size, a * size, b * size, c * size)
        yield f"1e{k:+d} m", sweep_turn(dress(lengths))


def _scale_speeds() -> Scenes:
    """Vary omega_2 from 1e-6 to 1e6 rad/s, in both senses."""
    base = sweep_turn(dress(ORDINARY_LENGTHS))
    for k in (-6, -3, 0, 3, 6):
        for sign, name in ((1.0, "+"), (-1.0, "-")):
            motion = base.motion.replace(speed=sign * 10.0**k)
            yield f"{name}1e{k:+d}", replace(base, motion=motion)


def scale_loads(*, exponents: tuple[int, ...] = (-9, -3, 3, 9)) -> Scenes:
    """Load from 1e-9 to 1e9 of the weights."""
    base = sweep_turn(dress(ORDINARY_LENGTHS))
    for k in exponents:
        times = 10.0**k
        scaled = []
        for load in base.loads:
            force = None
            if load.force is not None:
                size, angle = load.force
                force = (size * times, angle)
            scaled.append(replace(load, force=force, moment=load.moment * times))
        yield f"1e{k:+d}", replace(base, loads=tuple(scaled))


def _sweep_out_and_back() -> Scenes:
    """Sweep out of the range in which the linkage assembles, and back."""
    for seed in range(2):
        lengths = draw_lengths_of_type(TYPES_WITH_A_ROCKER, seed)
        scene = dress(lengths, seed)
        (psi, stretched), *_ = find_collinear_3_4(lengths)
        outward = 1.0 if stretched else -1.0
        inside = psi - outward * 0.6
        outside = psi + outward * 0.5
        out = np.linspace(inside, outside, 40)
        angles = [*out, *out[::-1]]
        for branch, name in BRANCH_NAMES.items():
            yield f"{seed} {name}", set_angles(scene, angles, branch)


def _drive_thesis_to_limits() -> Scenes:
    """Drive the thesis's double rocker from one limit position to the other.

    Bars are 20, 48, 55 and 20 cm long.
    """
    linkage = FourBar(
        0.20,
        Bar(0.48, 57.0, 11.119275, (0.765, 0.0)),
        Bar(0.55, 0.544),
        Bar(0.20, 0.2),
        math.radians(45.0),
    )
    (psi, _), *_ = find_collinear_3_4(linkage.lengths)
    theta_1 = linkage.ground_angle
    sweep = Sweep(theta_1 + psi, theta_1 + 2 * math.pi - psi, 120)
    for branch, name in BRANCH_NAMES.items():
        yield name, Scene(linkage, Motion(sweep, 0.2244, branch=branch), 4)


def released(
    *,
    durations: tuple[float, ...] = (10.0, 100.0),
    steps: int = 100,
) -> Scenes:
    """Release IFToMM benchmark A02 with one window.

    The links are of 1 m and 1 kg; upright, the first pin moves at 1 m/s; gravity is
    9.81.
    """
    bar = Bar(1.0, 1.0)
    linkage = FourBar(1.0, bar, bar, bar)
    for duration in durations:
        motion = Motion(math.pi / 2, -1.0, free=Free(duration, steps))
        yield f"{duration:g} s", Scene(linkage, motion, effects=(Gravity(),))


@dataclass(frozen=True, slots=True)
class Family:
    """Scenes of one kind of difficulty."""

    name: str
    statement: str
    """Statement of what must happen; printed with every scene of the family."""
    scenes: Callable[[], Scenes]


_STATEMENTS = tomllib.loads(
    Path(__file__).with_suffix(".toml").read_text(encoding="utf-8")
)
HARD_FAMILIES = tuple(
    Family(name, _STATEMENTS[name], scenes)
    for name, scenes in {
        "toggle": toggle,
        "toggle-near": lambda: toggle(distances=NEAR_DISTANCES),
        "pole-T3": lambda: _approach_poles(3),
        "pole-T4": lambda: _approach_poles(4),
        "driven-output": _driven_output,
        "change-point": approach_change_point,
        "change-point-through": sweep_change_point,
        "near-grashof": _miss_grashof,
        "bar-ratio": _shorten_crank,
        "mass-ratio": _vary_mass_ratio,
        "no-inertia": _remove_inertia,
        "far-centres": _move_centres_out,
        "sizes": _scale_sizes,
        "speeds": _scale_speeds,
        "loads": scale_loads,
        "out-and-back": _sweep_out_and_back,
        "thesis-limits": _drive_thesis_to_limits,
        "released": released,
    }.items()
)


class Hard(Suite):
    """Every scene of every family, by name.

    A worker makes them again from the parameters alone.
    """

    def __len__(self) -> int:
        return len(_make_scenes())

    def name(self, index: int) -> str:
        """Name a scene; ascending."""
        return _make_scenes()[index][0]

    def scene(self, index: int) -> Scene:
        """Return the scene itself."""
        return _make_scenes()[index][1]

    def fingerprint(self) -> str:
        """Name the families and count their scenes."""
        return f"hard {' '.join(family.name for family in HARD_FAMILIES)} {len(self)}"


@cache
def _make_scenes() -> list[tuple[str, Scene]]:
    """Make the scenes, by name."""
    scenes = []
    for family in HARD_FAMILIES:
        for label, scene in family.scenes():
            titled = replace(
                scene,
                title=f"{family.name}: {label}",
                source=family.statement,
            )
            scenes.append((f"{family.name} {label}".replace(" ", "-"), titled))
    return sorted(scenes, key=lambda pair: pair[0])
