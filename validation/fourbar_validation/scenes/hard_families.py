"""The hard cases: families of scenes that lie near singular positions.

A family is a generator, and one line on what must happen.
"""

import math
import tomllib
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import cache
from itertools import product
from pathlib import Path

import numpy as np

from fourbar.effects import Gravity, Load
from fourbar.linkage import Bar, FourBar, Lengths, record
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
REGULAR = (0.5, 0.4, 0.3)
"""rad from the singular position: positions that set the scale of each quantity."""
TOGGLE = tuple(10.0**-k for k in range(1, 13))
NEAR_DISTANCES = (1e-1, 3e-2, 1e-2, 3e-3)
"""rad; as far as a simulation in time follows."""
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
    two, three, four = draw_bars(rng, moving, HEAVY_BARS)
    weight = 9.81 * sum(bar.mass for bar in (two, three, four))
    force = (weight, float(rng.uniform(-3, 3)))
    arm = (0.2 * moving[2], float(rng.uniform(-3, 3)))
    loads = (
        Load(4, force, arm=arm),
        Load(3, moment=0.1 * weight * moving[1]),
    )
    linkage = FourBar(d, two, three, four, float(rng.uniform(-1, 1)))
    motion = Motion(0.0, 3.0, 2.0)
    return Scene(linkage, motion, loads=loads, effects=(Gravity(),))


def set_angles(scene: Scene, psi: object, branch: int = 1, **changes: object) -> Scene:
    """Set the scene to angles psi = theta_2 - theta_1 (rad) on a branch."""
    theta_2 = scene.linkage.ground_angle + np.atleast_1d(np.asarray(psi, dtype=float))
    motion = scene.motion.replace(angle=theta_2, branch=branch)
    return replace(scene, motion=motion, **changes)  # type: ignore[arg-type]


def _take_both_branches(scene: Scene, label: str = "") -> Scenes:
    """Yield a scene in both of its assemblies."""
    for branch, name in BRANCH_NAMES.items():
        motion = scene.motion.replace(branch=branch)
        yield f"{label} {name}".strip(), replace(scene, motion=motion)


def _sweep(scene: Scene, start: float, stop: float, steps: int) -> Scene:
    """Sweep the input evenly from one angle to another, rad."""
    sweep = Sweep(start, stop, steps)
    return replace(scene, motion=scene.motion.replace(angle=sweep, acceleration=0.0))


def _compute_corners(
    side: float,
    second_side: float,
    opposite: float,
) -> list[float]:
    """Return both signs of the angle between two sides of a triangle; [] if none.

    `opposite` is the third side.
    """
    if second_side:
        squares = side * side + second_side * second_side - opposite * opposite
        cosine = squares / (2 * side * second_side)
        if abs(cosine) < 1.0:
            corner = math.acos(cosine)
            return [corner, -corner]
    return []


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
            places.append((psi, _find_sense(psi, d, a, along - a)))
    return places


def _find_parallel_2_4(lengths: Lengths) -> list[tuple[float, int]]:
    """Find (psi, branch) where bars 2, 4 are parallel, so omega_3 = 0.

    Loop closure is then (a -+ c) e^{i psi} + b e^{i psi_3} = d.
    """
    d, a, b, c = lengths
    places = []
    for joined, along in ((a - c, c), (a + c, -c)):
        for psi in _compute_corners(d, joined, b):
            places.append((psi, _find_sense(psi, d, joined, along)))
    return places


def _find_sense(psi: float, ground: float, offset: float, along: float) -> int:
    """Return the sign of the rotation from ground - offset u to along u.

    Here u is e^{i psi}.
    """
    u = complex(math.cos(psi), math.sin(psi))
    turned = (ground - offset * u).conjugate() * (along * u)
    return 1 if turned.imag > 0.0 else -1


def toggle(*, distances: tuple[float, ...] = TOGGLE, seeds: range = range(2)) -> Scenes:
    """Approach bars 3, 4 in line from inside, and the same distances beyond it."""
    for kind, seed in product(_ROCKERS, seeds):
        lengths = draw_lengths_of_type(kind, seed)
        scene = dress(lengths, seed)
        for psi, stretched in find_collinear_3_4(lengths):
            inward = -1.0 if stretched else 1.0
            inside = psi + inward * np.array([*REGULAR, *distances])
            beyond = psi - inward * np.array(distances)
            in_line = "stretched" if stretched else "folded"
            label = f"{kind.value} {seed} {in_line}"
            near = set_angles(scene, [*inside, *beyond[::-1]])
            yield from _take_both_branches(near, label)


def _list_both_sides(distances: tuple[float, ...]) -> Array:
    """List offsets from a singular position: up to it, and on from it, rad."""
    towards = np.array([*REGULAR, *distances])
    return np.concatenate((-towards, towards[::-1]))


def _approach_poles(bar: int) -> Scenes:
    """Approach from both sides positions where the driven bar 3 or 4 stands still."""
    offsets = _list_both_sides(tuple(10.0**-k for k in range(1, 10)))
    for seed in range(2):
        lengths = draw_lengths_of_type(TYPES_WITH_A_CRANK, seed)
        scene = dress(lengths, seed)
        find = _find_parallel_2_4 if bar == 3 else find_collinear_2_3
        poles = find(lengths)
        for number, (psi, branch) in enumerate(poles[:3]):
            near = set_angles(scene, psi + offsets, branch, drive_bar=bar)
            yield f"{seed} {number}", near


def _driven_output() -> Scenes:
    """Drive on bar 4 through a whole turn of the input.

    The turn leads across both positions where omega_4 = 0.
    """
    for seed in range(2):
        scene = dress(draw_lengths_of_type(TYPES_WITH_A_CRANK, seed), seed)
        turn = _sweep(replace(scene, drive_bar=4), 0.05, 0.05 + 2 * math.pi, 180)
        yield from _take_both_branches(turn, str(seed))


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
            near = set_angles(scene, psi + offsets)
            yield from _take_both_branches(near, f"{kind} {math.degrees(psi):.0f}")


def sweep_change_point(*, steps: int = 145) -> Scenes:
    """Sweep two turns through the change points in both assemblies."""
    for kind, (lengths, _) in CHANGE_POINTS.items():
        scene = dress(lengths)
        start = scene.linkage.ground_angle + 0.3
        turns = _sweep(scene, start, start + 4 * math.pi, steps)
        yield from _take_both_branches(turns, kind)


def _miss_grashof() -> Scenes:
    """Miss s + l = p + q by a hair on either side.

    The sweep passes close to where it would change.
    """
    d = 0.4
    a = 0.1
    b = 0.25
    for gap, sign in product((1e-3, 1e-6, 1e-9, 1e-12), (1.0, -1.0)):
        scene = dress((d, a, b, d + a - b + sign * gap))
        start = scene.linkage.ground_angle
        turn = _sweep(scene, start, start + 2 * math.pi, 60)
        yield f"{sign * gap:+.0e}", turn


def sweep_turn(scene: Scene, steps: int = 36) -> Scene:
    """Sweep through one turn of the input."""
    return _sweep(scene, 0.1, 0.1 + 2 * math.pi, steps)


def _shorten_crank() -> Scenes:
    """Shorten the crank against the coupler, again and again."""
    for k in range(-6, 0):
        crank = 0.25 * 10.0**k
        yield f"1e{k}", sweep_turn(dress((0.3, crank, 0.25, 0.22)))


def _vary_mass_ratio() -> Scenes:
    """Make one bar heavier or lighter than the others by up to 1e6."""
    base = sweep_turn(dress(ORDINARY_LENGTHS))
    for (name, bar), k in product(list_moving(base), (-6, -3, 3, 6)):
        times = 10.0**k
        inertia = bar.moment_of_inertia * times
        heavy = replace(bar, mass=bar.mass * times, inertia=inertia)
        yield f"{name} 1e{k:+d}", replace_bars(base, **{name: heavy})


def _remove_inertia() -> Scenes:
    """Take bars without rotational inertia, and without mass.

    Some have loads only on massless bars.
    """
    base = sweep_turn(dress(ORDINARY_LENGTHS))
    massless = {name: Bar(bar.length) for name, bar in list_moving(base)}
    for name, bar in list_moving(base):
        point_mass = replace(bar, inertia=0.0)
        yield f"{name} point mass", replace_bars(base, **{name: point_mass})
        yield f"{name} massless", replace_bars(base, **{name: massless[name]})
    yield "all massless", replace_bars(base, **massless)


def _move_centres_out() -> Scenes:
    """Put mass centres far outside the bar."""
    base = sweep_turn(dress(ORDINARY_LENGTHS))
    for (name, bar), k in product(list_moving(base), (3.0, 100.0, 1e4)):
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
    senses = (("+", 1.0), ("-", -1.0))
    for k, (name, sign) in product((-6, -3, 0, 3, 6), senses):
        motion = base.motion.replace(speed=sign * 10.0**k)
        yield f"{name}1e{k:+d}", replace(base, motion=motion)


def scale_loads(*, exponents: tuple[int, ...] = (-9, -3, 3, 9)) -> Scenes:
    """Load from 1e-9 to 1e9 of the weights."""
    base = sweep_turn(dress(ORDINARY_LENGTHS))
    for k in exponents:
        times = 10.0**k
        pushed, turned = base.loads
        assert pushed.force is not None
        size, angle = pushed.force
        scaled = (
            replace(pushed, force=(size * times, angle)),
            replace(turned, moment=turned.moment * times),
        )
        yield f"1e{k:+d}", replace(base, loads=scaled)


def _sweep_out_and_back() -> Scenes:
    """Sweep out of the range in which the linkage assembles, and back."""
    for seed in range(2):
        lengths = draw_lengths_of_type(DrawnType.TRIPLE_ROCKER, seed)
        scene = dress(lengths, seed)
        (psi, stretched), *_ = find_collinear_3_4(lengths)
        outward = 1.0 if stretched else -1.0
        out = np.linspace(psi - outward * 0.6, psi + outward * 0.5, 40)
        crossing = set_angles(scene, [*out, *out[::-1]])
        yield from _take_both_branches(crossing, str(seed))


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
    yield from _take_both_branches(Scene(linkage, Motion(sweep, 0.2244), 4))


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


@record
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
