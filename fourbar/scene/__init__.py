"""A scene: linkage, motion, drive, loads and effects; and the command of its motion.

`Command` lists the positions that a motion names; `command` makes it of a scene.
"""

import math
from collections.abc import Callable, Iterator
from dataclasses import field
from importlib import import_module
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from fourbar.effects.effect import Effect
from fourbar.effects.place import Place, change_each, settler
from fourbar.errors import InputError, LimitError, expect, write_in_units
from fourbar.formulas.arithmetic import (
    PI_LOW,
    Number,
    angle,
    exact_difference,
    polar,
    select,
)
from fourbar.formulas.longer import change_numbers, lengthen, shorten
from fourbar.formulas.mobility import (
    ANGLE_FROM_LIMITS,
    TURN,
    choose_range,
    find_intervals,
    find_limit_angles,
    turns_fully,
)
from fourbar.formulas.path import NO_DIGIT_LEFT, count_turns, prepare_path
from fourbar.formulas.position import vanish
from fourbar.linkage import BAR_NAMES, Entries, FourBar, copy_with, record, require_bar
from fourbar.quantities import Array, Indices, Signs
from fourbar.scene.drawing import DrawnPins
from fourbar.scene.motion import (
    COMMAND_NAMES,
    DEFAULT_STEPS,
    SIDES,
    STROKE_COMMAND,
    FromLimit,
    Motion,
    Sweep,
)
from fourbar.scene.numbers import Point, Tolerance
from fourbar.scene.pictures import Picture, TracedPicture

if TYPE_CHECKING:
    from fourbar.effects import ForceDrive, LinearDrive, Load


def load_show(module: str) -> Any:
    """Import a module of `fourbar.show`.

    Scenes and solutions display themselves when asked to, though `fourbar.show` lies
    above this layer.
    """
    return import_module(f"fourbar.show.{module}")


@record
class Scene:
    """A linkage and everything that is stated about it.

    Two scenes that state the same are equal.

    Parameters
    ----------
    linkage : bars and ground, as `uniform` or `FourBar` make them.
    motion : what the commanded bar does: angles, speed, branch.
    drive_bar : 2, 3 or 4, on which the drive's torque acts; left out: 2.
    loads : forces and couples, `Load`.
    effects : `Gravity`, `Viscous`, `Friction`, ...: only what acts, each kind once.
    title, source : words.
    pictures : of bars, as a scene file names them.
    points : points of bars whose paths are wanted, `Point`.
    tolerances : of numbers by their keys in a scene file, `Tolerance`.
    drive : a force in place of a torque on a bar: `LinearDrive` or `PointDrive`.
    drawing : the pins as they are drawn, `DrawnPins`: places are shown in its
        coordinates.
    picture : that lies under the drawing in the workbench.
    met_lengths : lengths that a scene file states and those that are read for them, m,
        if these have an equality that the stated ones miss by rounding.
    """

    linkage: FourBar
    motion: Motion = field(default_factory=Motion)
    drive_bar: int = None  # type: ignore[assignment]  # resolved below
    """2, where nothing is stated; None where the drive exerts a force."""
    loads: "tuple[Load, ...]" = ()
    effects: "tuple[Effect, ...]" = ()
    title: str = ""
    source: str = ""
    pictures: tuple[Picture, ...] = ()
    points: tuple[Point, ...] = ()
    tolerances: tuple[Tolerance, ...] = ()
    drive: "ForceDrive | None" = None
    drawing: DrawnPins | None = None
    picture: TracedPicture | None = None
    met_lengths: tuple[tuple[float, ...], tuple[float, ...]] | None = field(
        default=None,
        repr=False,
        compare=False,
    )

    def __post_init__(self) -> None:
        for name, kinds in _PARTS.items():
            expect(name, getattr(self, name), *kinds)
        for name, kind in _ENTRIES.items():
            entries = Entries(kind).check(name, getattr(self, name))
            object.__setattr__(self, name, entries)
        names = [point.name for point in self.points]
        bars = [picture.bar for picture in self.pictures]
        for key, values, allowed in (
            ("points", names, "each point has a name of its own"),
            ("pictures", bars, "a bar has one picture"),
        ):
            if len({*values}) < len(values):
                raise InputError(key, values, allowed)
        if self.drive is None:
            stated = 2 if self.drive_bar is None else self.drive_bar
            object.__setattr__(self, "drive_bar", require_bar("drive.bar", stated))
        else:
            from fourbar.effects.force_drive import ForceDrive

            expect("drive", self.drive, ForceDrive)
            if self.drive_bar is not None:
                allowed = (
                    "a drive is a couple on a bar or a force: state drive_bar or drive"
                )
                raise InputError("drive.bar", self.drive_bar, allowed)
        self._require_points()
        drive = self.settled_drive()
        if drive is not None:
            drive.require_motion(self.linkage)
        if self.motion.stroke is not None:
            bar = _find_triangle(self).bar
            object.__setattr__(self, "motion", copy_with(self.motion, bar=bar))

    def plot(
        self,
        figure: str = "overview",
        *,
        position: float | None = None,
        units: Any = None,
        dimensions: bool = False,
    ) -> Any:
        """Draw a figure that a notebook shows, and that `.save("a.pdf")` writes.

        Parameters
        ----------
        figure : "overview", "linkage", "coupler", "kinematics", "points", "torque",
            "stroke", "forces", "energy", "transmission", "shaking", "ratios",
            "centres", "freebody" or "bars".
        position : what is commanded where linkage, free bodies and what is inside the
            bars are drawn, rad or m; left out: the scene's own, and a motion's bars
            each where it bends most.
        units : in which numbers are drawn, as `fourbar.units` makes them; left out: SI
            with the prefix that suits, deg.
        dimensions : write the lengths of the bars at them.

        Raises
        ------
        InputError : unknown figure; a figure of forces without omega_2; dimensions for
            a figure that shows none.
        NotAssembledError : there is no position to draw.
        DependencyError : matplotlib is missing.
        """
        options = {"position": position, "dimensions": dimensions}
        if units is not None:
            options["units"] = units
        return load_show("plot").draw_figure(self, figure, **options)

    def _repr_html_(self) -> Any:
        return load_show("notebook").show_scene(self)

    def with_places(self, change: "Callable[[Place], Place]") -> "Scene":
        """Return the scene with each place changed.

        The places are those of its points, loads, effects and drive.
        """
        return copy_with(
            self,
            points=change_each(self.points, change),
            loads=change_each(self.loads, change),
            effects=change_each(self.effects, change),
            drive=None if self.drive is None else self.drive.with_places(change),
        )

    def settled(self) -> "Scene":
        """Return the scene with every place from the first pin of its bar.

        `Place.settle` does the same for one place.
        """
        return self.with_places(settler(self.linkage, self.points))

    def settled_drive(self) -> "ForceDrive | None":
        """Return the drive as the settled scene has it; None: it is a couple."""
        return self.settled().drive

    def in_pairs_from_pins(self) -> "Scene":
        """Return the scene with every place as a pair (distance, angle).

        The pair is from the first pin of the place's bar.
        """
        return self.settled().with_places(
            lambda place: Place(place.bar, place.polar_from_pin())
        )

    def _require_points(self) -> None:
        """Raise InputError for a place at a missing point, or another bar's."""
        bars = {point.name: point.bar for point in self.points}

        def check(place: "Place") -> "Place":
            name = place.point
            if name is not None and bars.get(name) != place.bar:
                allowed = "is no point of [points]"
                if name in bars:
                    allowed = f"is a point of bar {bars[name]}, not of bar {place.bar}"
                raise InputError("point", name, allowed)
            return place

        self.with_places(check)

    @property
    def origin(self) -> tuple[float, float]:
        """Return the place of O2 in the coordinates that places are shown in, m."""
        if self.drawing is None:
            return (0.0, 0.0)
        return self.drawing.O2

    @property
    def counts_turns(self) -> bool:
        """Return True if an effect depends on where the motion begins."""
        return any(effect.counts_turns for effect in self.effects)


_PARTS: dict[str, tuple[type, ...]] = {
    "linkage": (FourBar,),
    "motion": (Motion,),
    "title": (str,),
    "source": (str,),
    "drawing": (DrawnPins, type(None)),
    "picture": (TracedPicture, type(None)),
}
_ENTRIES = {
    "loads": Effect,
    "effects": Effect,
    "pictures": Picture,
    "points": Point,
    "tolerances": Tolerance,
}
"""Classes of a scene's fields, and of the entries of those that hold many."""


class LimitOrigin(NamedTuple):
    """Limit position, plus an offset, that a commanded angle is."""

    remainder: Any
    """Exact angle (mpmath) minus its double, rad."""


class StrokeOrigin(NamedTuple):
    """Strokes of a cylinder, from which angles and rates of its bar follow."""

    stroke: Array
    """(n,), m."""
    speed: float | Array | None
    """m/s; None: positions only."""
    acceleration: float | Array
    """m/s^2."""
    condition: float | Array = 1.0
    """How well the stroke determines the angle, in [0, 1]."""
    lost: Array | None = None
    """Round-off left out of the bar's angle, speed and acceleration as doubles, (n, 3).
    None: positions only.
    """


class ReleaseOrigin(NamedTuple):
    """Angle in which a released motion is read at each of n instants.

    Bar 2 or 4 has this angle, whichever does not stop. At a limit of theta_2 bar 4's
    alone holds the forces, and dry friction at a standstill has a side of its own.
    """

    bar: Signs
    """2 or 4, (n,), as all that follows."""
    angle: Array
    """rad."""
    speed: Array
    """rad/s."""
    acceleration: Array
    """rad/s^2."""
    sign: Array
    """Sign of the root on the path."""
    side: Array
    """Fraction of its torque, -1 to 1, with which dry friction holds at a standstill.
    +-1: the linkage moves on; otherwise 0.
    """

    def commands(self) -> "Iterator[tuple[Indices, Command, Array]]":
        """List the commands of bars 2 and 4 that the motion is made of.

        An entry has the indices of its instants, the command and their side.
        """
        for bar in (2, 4):
            index = np.flatnonzero(self.bar == bar)
            if index.size:
                sign = self.sign[index].astype(np.int8)
                stated = self.speed[index], self.acceleration[index]
                at = Command(self.angle[index], sign, *stated, bar)
                yield index, at, self.side[index]


class Command(NamedTuple):
    """Command of one bar, by default the input, at each of n independent positions."""

    angle: Array
    """(n,), rad."""
    branch: Signs
    """Assembly, +1 or -1, (n,), as `Motion` has it."""
    speed: float | Array | None
    """rad/s; None: positions only."""
    acceleration: float | Array
    """rad/s^2."""
    bar: int = 2
    time: Array | None = None
    """(n,), s; where the motion is given over time."""
    origin: LimitOrigin | StrokeOrigin | ReleaseOrigin | None = None
    """What angle, speed and acceleration follow from; None: they are stated."""

    @property
    def names(self) -> tuple[str, str, str]:
        """Names of the commanded position, speed and acceleration."""
        return STROKE_COMMAND if self.moves_stroke else COMMAND_NAMES[self.bar]

    @property
    def commanded(self) -> str:
        """Name of what is commanded: the angle, or the stroke."""
        return self.names[0]

    @property
    def stated(self) -> tuple[Any, Any, Any]:
        """Commanded angles or strokes, their speed and their acceleration."""
        if isinstance(self.origin, StrokeOrigin):
            return self.origin[:3]
        return self.angle, self.speed, self.acceleration

    @property
    def places(self) -> Array:
        """Commanded angles, strokes, or times of a law, at each position."""
        places: Array = self.stated[0] if self.time is None else self.time
        return places

    @property
    def unit(self) -> str:
        """Unit of what is commanded: "rad", or "m" of a stroke."""
        return "m" if self.moves_stroke else "rad"

    @property
    def moves_stroke(self) -> bool:
        """True if a stroke is commanded."""
        return isinstance(self.origin, StrokeOrigin)

    @property
    def remainder(self) -> Any:
        """Exact angle (mpmath) minus its double, rad; None: the double is exact."""
        return getattr(self.origin, "remainder", None)

    @property
    def condition(self) -> Any:
        """How well the command determines the angle, in [0, 1]; 1: it is the angle."""
        return getattr(self.origin, "condition", 1.0)

    @property
    def lost(self) -> Array:
        """Round-off left out of angle, speed and acceleration, (3,) or (n, 3)."""
        lost: Array | None = getattr(self.origin, "lost", None)
        if lost is not None:
            return lost
        return np.array([float(self.remainder or 0.0), 0.0, 0.0])

    @property
    def margin(self) -> float:
        """Sine at or below which a position is singular: 0 in many digits."""
        return 0.0 if isinstance(self.origin, LimitOrigin) else NO_DIGIT_LEFT

    def with_arrays(self, change: Callable[[Any], Any]) -> "Command":
        """Return a copy with every field, those of the origin too, changed."""
        origin: Any = self.origin
        if origin is not None:
            origin = type(origin)(*map(change, origin))
        fields: list[Any] = [*map(change, self[:-1]), origin]
        return Command(*fields)

    def part(self, index: Any) -> "Command":
        """Return the command at some of the positions."""

        def take(value: Any) -> Any:
            is_array = isinstance(value, np.ndarray) and value.ndim
            return value[index] if is_array else value

        return self.with_arrays(take)

    def as_doubles(self) -> "Command":
        """Return the command with the doubles of its angles, where limits lie near."""
        if isinstance(self.origin, LimitOrigin):
            return self._replace(origin=None)
        return self

    @property
    def theta_2(self) -> Array:
        """Commanded angle of the input, rad.

        Raises InputError if the input is not commanded.
        """
        self._require_input()
        return self.angle

    @property
    def omega_2(self) -> float | Array | None:
        """Commanded speed of the input, rad/s.

        Raises InputError if the input is not commanded.
        """
        self._require_input()
        return self.speed

    @property
    def alpha_2(self) -> float | Array:
        """Commanded acceleration of the input, rad/s^2.

        Raises InputError if the input is not commanded.
        """
        self._require_input()
        return self.acceleration

    def _require_input(self) -> None:
        if self.bar != 2:
            raise InputError("at", self.commanded, "is commanded, and theta_2 is not")


def require_input(scene: Scene, what: str) -> None:
    """Raise a LimitError if another bar than the input is commanded.

    `what`: what takes a command of the input alone.
    """
    motion = scene.motion
    if motion.commanded != "theta_2":
        raise LimitError(
            f"motion.{motion.commanded}: {what} takes a command of theta_2 alone"
        )
    if motion.has_rate_of_each:
        raise LimitError(f"motion.omega_2: {what} takes one speed and acceleration")


class _Triangle(NamedTuple):
    """Triangle of a cylinder: pivot of its bar, end on the bar, end on the ground.

    With the stroke it gives the angle.

    With l from the pivot to the end on the bar, r to the end on the ground, beta the
    angle between them, s the stroke,
        s^2 = l^2 + r^2 - 2 l r cos beta,
        ds/dbeta = l r sin beta/s: the lever from the pivot to the line.
    """

    bar: int
    length: Number
    """l, m."""
    reach: Number
    """r, m."""
    angle: Number
    """theta of the bar where both ends are in one direction from the pivot, rad."""

    def find_strokes(self, first: float, last: float) -> tuple[float, float]:
        """Return the strokes at two values of beta between 0 and pi, m."""
        fold = abs(self.length - self.reach)
        twice_mean = 2.0 * math.sqrt(self.length * self.reach)
        least = math.hypot(fold, twice_mean * math.sin(0.5 * first))
        return least, math.hypot(fold, twice_mean * math.sin(0.5 * last))

    def turn_bar(
        self,
        stroke: Any,
        speed: Any,
        acceleration: Any,
        side: Any,
    ) -> tuple[Any, Any, Any, Any]:
        """Compute angle, speed and acceleration of the bar, and the condition.

        The condition is the lever over the longer of l and r. NaN where the cylinder
        cannot have the stroke. All may be arrays, and numbers with slopes.
        """
        length = self.length
        reach = self.reach
        sign = SIDES[side]

        def exceed(first: Any, second: Any, third: Any) -> Any:
            sides = first, second, third
            return vanish(exact_difference(*sides, 0.0 * length), sides)

        with np.errstate(all="ignore"):
            near = exceed(stroke, reach, length) * exceed(stroke, length, reach)
            far = exceed(length, reach, stroke) * (length + reach + stroke)
            near = np.sqrt(select(stroke >= 0.0, near, np.nan))
            far = np.sqrt(far)
            beta = 2.0 * np.arctan2(near, far)
            lever = near * far / (2.0 * stroke)
            longer = 0.5 * (length + reach + abs(length - reach))
            theta = self.angle + sign * beta
            condition = lever / longer
            if speed is None:
                return theta, None, np.zeros(np.shape(theta)), condition
            rate = speed / lever
            growth = (
                speed * speed
                + stroke * acceleration
                - length * reach * np.cos(beta) * rate * rate
            )
            growth = growth / (lever * stroke)
        return theta, sign * rate, sign * growth, condition


def require_cylinder(drive: "ForceDrive | None") -> "LinearDrive":
    """Return a drive that a stroke can command.

    Raises InputError for any but a cylinder between the ground and bar 2 or 4.
    """
    from fourbar.effects.force_drive import LinearDrive

    drives = "no cylinder"
    if isinstance(drive, LinearDrive):
        if drive.may_be_commanded:
            return drive
        drives = f"one from bar {drive.start.bar} to bar {drive.end.bar}"
    raise InputError(
        "motion.stroke",
        drives,
        "is of a cylinder ([drive]) between the ground and bar 2 or 4",
    )


def _find_triangle(scene: Scene) -> _Triangle:
    """Return the triangle of a scene's cylinder, as `require_cylinder` has it."""
    linkage = scene.linkage
    drive = require_cylinder(scene.settled_drive())
    fixed, moving = sorted((drive.start, drive.end), key=lambda end: end.bar)
    if moving.bar == 2:  # points of the ground are polar about O2
        reach = abs(fixed.distance)
        towards = fixed.angle + linkage.ground_angle + _reverse(fixed)
    else:
        end = fixed.vector() * polar(1.0, linkage.ground_angle)
        across = end - polar(linkage.ground, linkage.ground_angle)
        reach = abs(across)
        towards = angle(across)
    return _Triangle(
        moving.bar,
        abs(moving.distance),
        reach,
        towards - moving.angle - _reverse(moving),
    )


def _reverse(point: "Place") -> Any:
    """Return half a turn for a point at a distance that is negative."""
    forwards = 0.0 * point.distance  # zero of the same kind of number
    return select(point.distance >= 0.0, forwards, np.pi + forwards + PI_LOW)


def default_places(
    scene: Scene,
    holding: float | None = None,
    margin: float = ANGLE_FROM_LIMITS,
) -> Array:
    """List the angles or strokes that are swept if a scene names none, (n,).

    The angles are those of the range that holds one, less a margin at its limits. With
    a single change point they go through two turns, after which the assembly repeats.
    """
    steps = DEFAULT_STEPS
    if scene.motion.stroke is not None:
        triangle = _find_triangle(scene)
        first, last = triangle.find_strokes(margin, np.pi - margin)
    else:
        linkage = scene.linkage
        bar = scene.motion.bar
        first, last = choose_range(linkage, bar, holding, margin)
        if turns_fully(linkage, bar):
            turns = int(count_turns(linkage.lengths, bar))
            last = first + turns * (last - first)
            steps = turns * DEFAULT_STEPS
    return np.linspace(first, last, steps + 1)


def compute_bar_motion(
    scene: Scene,
    place: Any,
    speed: Any,
    acceleration: Any,
) -> tuple[Any, Any, Any, Any]:
    """Compute angle, speed and acceleration of the commanded bar, and the condition.

    A stroke and its rates become those of the bar here; angles stay, with a condition
    of 1. All may be arrays of any library, and numbers that carry their derivatives.
    """
    if scene.motion.stroke is None:
        return place, speed, acceleration, 1.0
    side = scene.motion.side
    return _find_triangle(scene).turn_bar(place, speed, acceleration, side)


def command_stroke(
    scene: Scene,
    stroke: Array,
    speed: Any,
    acceleration: Any,
) -> Command:
    """Command the bar that a cylinder turns, from strokes and their rates.

    The branch is that of the motion.
    """
    stated = stroke, speed, acceleration
    angle, omega, alpha, condition = compute_bar_motion(scene, *stated)
    lost = None
    if speed is not None:  # what angle, speed and acceleration leave out as doubles
        with np.errstate(all="ignore"):
            linkage, drive = change_numbers(
                (scene.linkage, scene.settled_drive()), lengthen
            )
            longer = copy_with(scene, linkage=linkage, drive=drive)
            *turned, _ = compute_bar_motion(longer, *map(lengthen, stated))
            gaps = [
                shorten(after - before)
                for before, after in zip((angle, omega, alpha), turned, strict=True)
            ]
        lost = np.stack(np.broadcast_arrays(*gaps), axis=-1)
    branch = np.full(np.shape(angle), scene.motion.branch, dtype=np.int8)
    origin = StrokeOrigin(*stated, condition, lost)
    return Command(angle, branch, omega, alpha, scene.motion.bar, origin=origin)


def find_stroke_ranges(scene: Scene) -> list[tuple[float, float]]:
    """Find the ranges of a cylinder's stroke in which the linkage assembles, m.

    In each the loop of the bars closes, and the triangle of the cylinder on its side.
    """
    triangle = _find_triangle(scene)
    assert scene.motion.side is not None
    sign = SIDES[scene.motion.side]
    ranges: list[tuple[float, float]] = []
    for interval in find_intervals(scene.linkage, triangle.bar):
        if interval[1] - interval[0] >= TURN:
            return [triangle.find_strokes(0.0, math.pi)]
        low, high = sorted(sign * (end - triangle.angle) for end in interval)
        turn = TURN * math.floor(low / TURN)
        for start in (turn, turn + TURN):
            first = max(low - start, 0.0)
            last = min(high - start, math.pi)
            if first < last:
                ranges.append(triangle.find_strokes(first, last))
    return sorted(ranges)


def say_range(scene: Scene) -> str:
    """Say between which angles the commanded bar can be, or between which strokes."""
    motion = scene.motion
    if motion.commanded == "stroke":
        strokes = " and ".join(
            write_in_units("m", *ends, between=" to ")
            for ends in find_stroke_ranges(scene)
        )
        none = f"none with motion.side = {motion.side}"
        return f"this cylinder can have {strokes or none}"
    ranges = [
        f"{math.degrees(low):.9g} to {math.degrees(high):.9g} deg"
        for low, high in find_intervals(scene.linkage, motion.bar)
    ]
    return f"theta_{motion.bar} goes from {' and from '.join(ranges)}"


def command_at(scene: Scene, places: Array) -> Command:
    """Return the command of the scene's motion at other angles, strokes or times."""
    motion = scene.motion
    bar = motion.bar
    if motion.commanded == "stroke":
        at = command_stroke(scene, places, *motion.find_rates(places))
        outside = places[np.isnan(at.angle)].tolist()
        if outside:
            keys = {}  # of what is typed
            if isinstance(motion.angle, Sweep):
                keys[motion.angle.stop] = "motion.stroke.to"
                keys[motion.angle.start] = "motion.stroke.from"
            stroke = next(filter(keys.get, outside), outside[0])
            key = keys.get(stroke, "motion.stroke")
            raise InputError(key, stroke, say_range(scene), unit="m")
        return at
    branch = np.full(places.shape, motion.branch, dtype=np.int8)
    if motion.law is None:
        return Command(places, branch, *motion.find_rates(places), bar)
    angle, speed, acceleration = motion.law.at(places)
    return Command(angle, branch, speed, acceleration, bar, places)


def with_signs(linkage: FourBar, at: Command) -> Command:
    """Return a command as engines are told it, with signs in the place of assemblies.

    The sign is that of the bar's own sine at each position. It follows from the lengths
    and the angle alone. The function is its own inverse: of signs it makes assemblies.
    """
    signs = find_signs(linkage, at.angle, at.branch, at.bar)
    return at._replace(branch=signs)


def find_signs(
    linkage: FourBar,
    angle: Array,
    branch: Signs | int,
    bar: int = 2,
) -> Signs:
    """Return the sign of a bar's sine at each of its angles, (n,).

    `branch`: of the assembly, one for all or (n,). Given signs, it returns assemblies.
    """
    path = prepare_path(linkage.lengths, linkage.ground_angle, bar)
    assemblies = np.full(np.shape(angle), branch, dtype=np.int8)
    return np.asarray(path.sign(angle, assemblies)).astype(np.int8)


def command(scene: Scene) -> Command:
    """List the positions that the scene's motion names, each with its branch."""
    expect("scene", scene, Scene)
    motion = scene.motion
    bar = motion.bar
    stated = motion.angle
    if isinstance(stated, FromLimit):
        return _command_from_limit(scene, stated)
    if motion.law is not None:
        places = motion.law.times()
    elif stated is None:
        drawn = None if scene.drawing is None else scene.drawing.angle(bar)
        places = default_places(scene, drawn)
    elif isinstance(stated, Sweep):
        places = np.linspace(stated.start, stated.stop, stated.steps + 1)
    else:
        places = np.array(stated, dtype=float, ndmin=1)
    return command_at(scene, places)


def _command_from_limit(scene: Scene, stated: FromLimit) -> Command:
    """Command the one position that a motion states from a limit of its bar."""
    bar = scene.motion.bar
    limits = find_limit_angles(scene.linkage, bar)
    if stated.limit > len(limits):
        allowed = f"must be from 1 to {len(limits)}"
        if not limits:
            allowed = f"the {BAR_NAMES[bar]} of this linkage has no limit positions"
        raise InputError(f"motion.theta_{bar}.limit", stated.limit, allowed)
    from fourbar.formulas.many_digits import limit_remainder

    limit = limits[stated.limit - 1]
    angle = float(limit + stated.offset)
    remainder = limit_remainder(scene.linkage, limit, angle, stated.offset, bar)
    at = command_at(scene, np.array([angle]))
    return at._replace(origin=LimitOrigin(remainder))
