"""The same linkage mirrored, turned, scaled, read from its other end, and in parts.

A symmetry of mechanics takes the formulas' numbers of one scene into those of another,
which other branches of the code compute; no reference is needed. Scaling by powers of
two changes no digit at all.
"""

import cmath
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from fourbar.effects import (
    Flywheel,
    Friction,
    Gravity,
    LinearDrive,
    Load,
    PinFriction,
    Place,
    PointDrive,
    Spring,
    Springs,
    Torsion,
    Viscous,
)
from fourbar.linkage import MOVING_BARS, Bar, FourBar, copy_with
from fourbar.quantities import OK, PIN_FORCES, UNITS, Array
from fourbar.scene import Command, Scene, with_signs
from fourbar.scene.motion import Motion
from fourbar.solution import Solution
from fourbar.solving import solve
from fourbar_validation.compare.line import place_line
from fourbar_validation.compare.pins import (
    find_centre,
    find_inertia,
    find_mass,
    state_from_pins,
)
from fourbar_validation.compare.rows import Row
from fourbar_validation.compare.scales import TermSizes
from fourbar_validation.compare.tolerance import (
    EQUIVALENCE,
    WELL_CONDITIONED,
    Mask,
    compute_differences,
    count_half_turns,
    divide,
    find_conditions,
    find_worst,
    join_components,
    magnitude,
    magnitudes,
    mark_touching,
    sum_lengths,
)
from fourbar_validation.run.question import NotAskedError, Question, spread_evenly

POSITIONS_STATED_OTHERWISE = 5
"""Positions of a scene that are stated otherwise."""
TURNED = 0.7
"""Angle by which a scene is turned, rad."""
SCALE = 2.0**7
"""Factor of every length."""
PART, MASSES_APART = 0.3, 0.4
"""Part of a bar's mass that is split off, and the distance of both parts. The distance
is in radii of gyration of the bar.
"""
_AT_A_REVERSAL = 1e-3
"""Part of its speeds below which a pin with dry friction may reverse."""
SCALED_FORCES = (*PIN_FORCES, "torque", "drive_force")
_TRANSFORMED_QUANTITIES = (
    *(f"{name}_{bar}" for name in ("theta", "omega", "alpha") for bar in MOVING_BARS),
    *SCALED_FORCES,
    "power",
)
"""Quantities that are compared, as far as the scene has them."""
_OTHER_BAR = {1: 1, 2: 4, 3: 3, 4: 2}
OTHER_PIN = {"O2": "O4", "A": "B", "B": "A", "O4": "O2"}
"""Bars and pins by their names in a linkage read from its other end."""
_OTHER_FORCE = {
    "F12": ("F14", 1.0),
    "F14": ("F12", 1.0),
    "F32": ("F43", -1.0),
    "F43": ("F32", -1.0),
}
"""Pin forces there: F34 = -F43, F23 = -F32."""


class _QuantitySizes(NamedTuple):
    """Scale, condition and sum of the terms of several quantities, (q, n) each."""

    scale: Array
    condition: Array
    terms: Array

    def select(self, rows: slice) -> "_QuantitySizes":
        """Select the sizes of some of the quantities."""
        return _QuantitySizes(*(sizes[rows] for sizes in self))


@dataclass(frozen=True)
class _Few:
    """A scene at a few well-conditioned positions, with the formulas' solution."""

    scene: Scene
    command: Command
    solution: Solution
    question: Question
    fit: Mask
    """Positions that are compared. The first, from which springs count their turns,
    need not be.
    """

    @cached_property
    def quantities(self) -> list[str]:
        """List the quantities that the scene has, those of forces in one piece."""
        return [
            name
            for name in _TRANSFORMED_QUANTITIES
            if getattr(self.solution, name, None) is not None
        ]

    @cached_property
    def forces(self) -> slice:
        """Return which of the quantities are forces and torques."""
        of_forces = [
            self.quantities.index(name)
            for name in SCALED_FORCES
            if name in self.quantities
        ]
        return slice(of_forces[0], of_forces[-1] + 1)

    @cached_property
    def numbers(self) -> list[Array]:
        """Return the numbers of each quantity."""
        return [getattr(self.solution, name) for name in self.quantities]

    @cached_property
    def sizes(self) -> _QuantitySizes:
        """Return the sizes of all quantities."""
        sizes = TermSizes(self.scene, self.solution)
        linkage = self.scene.linkage
        conditions = find_conditions(self.quantities, linkage, self.solution)
        return _QuantitySizes(
            sizes.scales(self.quantities, self.numbers).of_terms,
            np.minimum(conditions, 1.0),
            sizes.sum_terms_of(self.quantities),
        )

    def solve(self, scene: Scene, **changed: Any) -> Solution:
        """Solve another scene at the same positions.

        Some entries of the command are changed.
        """
        return _solve_from_first(scene, self.command._replace(**changed))

    def solve_alike(self, scene: Scene, sense: int, **changed: Any) -> Solution:
        """Solve another scene whose loop lies on the same side, or on the other.

        The side is that at each position.

        An assembly of a linkage with change points has another sign beyond each of
        them, and the rounding of the lengths decides whether there are any: the sign is
        the same in both scenes, the name of the assembly need not be.
        """
        signs = with_signs(self.scene.linkage, self.command).branch
        signed = self.command._replace(branch=sense * signs, **changed)
        return _solve_from_first(scene, with_signs(scene.linkage, signed))

    def compare(self, convert: Callable[[str], Array]) -> Array:
        """Compare all quantities with those of another scene, converted; (q, n)."""
        theirs = [convert(name) for name in self.quantities]
        apart = compute_differences(self.quantities, self.numbers, theirs)
        return divide(apart, self.sizes.scale) * self.sizes.condition

    def row(self, name: str, transformation: "_Transformation") -> Row:
        """Make the row of a transformation, of the quantity that is worst."""
        errors = transformation.measure(self)
        first = 0
        if transformation.of_forces:
            first = self.forces.start
        theta_1 = self.scene.linkage.ground_angle
        condition = 1.0 / count_half_turns(theta_1, self.command.angle)
        if transformation.exact:
            allowed = 0.0
        else:
            allowed = EQUIVALENCE.factor / condition
        worst = find_worst(errors[:, self.fit].max(axis=1))
        return self.question.row(
            name,
            errors[worst],
            allowed,
            f"identity: {transformation.reason}; times the condition; worst in"
            f" {self.quantities[first + worst]}",
            self.fit,
            condition,
            self.solution.theta_2,
        )


def check_transformed(question: Question) -> Iterator[Row]:
    """Hold a scene to what it is when it is stated otherwise."""
    try:
        few = _take_plain_positions(question)
    except NotAskedError as reason:
        question.leave_out("scenes stated otherwise", reason)
        return
    for name, transformation in TRANSFORMATIONS.items():
        try:
            yield few.row(name, transformation)
        except NotAskedError as reason:
            question.leave_out(name, reason)


def _take_plain_positions(question: Question) -> _Few:
    """Take a scene at a few positions, with plain numbers of its bars and places.

    Raises NotAskedError where it cannot be stated otherwise.
    """
    solution = question.solution
    at = question.at
    scene = question.scene
    if at.speed is None:
        raise NotAskedError("the scene states positions only")
    if at.moves_stroke or at.time is not None:
        raise NotAskedError("a stroke or a motion law is commanded")
    placed = state_from_pins(scene)
    convert = _SceneConversion(scene.linkage).term
    for term in (*placed.loads, *placed.effects):
        if isinstance(term, Load) and term.table is not None:
            raise NotAskedError("a load over a table has no counterpart")
        if convert(term) is None:
            raise NotAskedError(f"the effect {term.key!r} has no counterpart")
    in_line = scene.linkage.ground_angle + np.array([0.0, math.pi])
    if scene.counts_turns and mark_touching(scene.linkage, in_line).any():
        raise NotAskedError("rounding decides how far its torsion springs are wound")
    fit = (
        (solution.status_code == OK)
        & (solution.condition >= WELL_CONDITIONED)
        & (solution.drive_condition >= WELL_CONDITIONED)
        & ~question.reversing(_AT_A_REVERSAL)
        & _mark_long_springs(placed, solution)
    )
    indices = np.flatnonzero(fit)
    if not len(indices):
        raise NotAskedError("no position is well-conditioned")
    begin = int(np.argmax(solution.assembled))
    chosen = spread_evenly(indices, POSITIONS_STATED_OTHERWISE)
    positions = np.concatenate([[begin], chosen[chosen != begin]])
    command = at.part(positions).as_doubles()
    link = scene.linkage
    bars = [
        Bar(
            bar.length,
            find_mass(bar),
            find_inertia(bar),
            find_centre(bar),
        )
        for bar in link.moving
    ]
    few = Scene(
        _put_bars(link, bars, link.ground, link.ground_angle),
        Motion(),
        scene.drive_bar,
        placed.loads,
        placed.effects,
        drive=placed.drive,
    )
    return _Few(
        few,
        command,
        _solve_from_first(few, command),
        question,
        fit[positions],
    )


def _mark_long_springs(scene: Scene, solution: Solution) -> Mask:
    """Mark where the ends of each spring lie apart, (n,).

    Where they nearly meet rounding turns its line, whatever the loop's condition. The
    places are pairs from first pins.
    """
    least = WELL_CONDITIONED * sum_lengths(scene.linkage)
    theta = {bar: getattr(solution, f"theta_{bar}") for bar in MOVING_BARS}
    long = np.ones(len(solution), dtype=bool)
    for effect in scene.effects:
        if not isinstance(effect, Springs):
            continue
        for spring in effect.springs:
            line = place_line(
                scene.linkage,
                LinearDrive(spring.start, spring.end),
                theta,
            )
            long &= line.stroke >= least
    return long


def _solve_from_first(scene: Scene, command: Command) -> Solution:
    """Solve a scene whose motion begins at the first position.

    Springs count their turns from there.
    """
    if scene.counts_turns:
        branch = int(command.branch[0])
        begin: Any = {
            f"theta_{command.bar}": float(command.angle[0]),
            "branch": branch,
        }
        scene = copy_with(scene, motion=Motion(**begin))
    return solve(scene, "force", at=command)


@dataclass(frozen=True)
class _SceneConversion:
    """Conversion of each number of a scene."""

    linkage: FourBar
    """Linkage of the scene."""
    length: float = 1.0
    """Factor of lengths, accelerations and forces. Of couples and inertias it is its
    square.
    """
    sense: float = 1.0
    """-1: angles and couples change their signs."""
    turn: float = 0.0
    """Angle that is added to directions in the world, rad."""
    exchanged: bool = False
    """Read from the other end."""

    @property
    def square(self) -> float:
        """Return the factor of couples and inertias."""
        return self.length * self.length

    def number(self, bar: int | None) -> int | None:
        """Convert the number of a bar."""
        return _OTHER_BAR.get(bar or 0, bar) if self.exchanged else bar

    def pin(self, pin: str) -> str:
        """Convert the name of a pin."""
        return OTHER_PIN[pin] if self.exchanged else pin

    def pair(self, pair: tuple[float, float]) -> tuple[float, float]:
        """Convert a place or an arm of fixed direction from its bar's line."""
        return self.length * pair[0], self.sense * pair[1]

    def direction(self, angle: float, frame: str = "world", bar: int = 0) -> float:
        """Convert the direction of a force, in the world or from a bar's line."""
        if frame == "world":
            return self.sense * angle + self.turn
        # the coupler's line points the other way
        return self.sense * angle + math.pi * (self.exchanged and bar == 3)

    def place(self, place: Place) -> Place:
        """Convert a place, which is a pair from the first pin of its bar."""
        assert place.from_pin is not None
        if not self.exchanged:
            return Place(place.bar, self.pair(place.from_pin))
        if place.bar in (2, 4):
            return Place(_OTHER_BAR[place.bar], place.from_pin)
        length = self.linkage.lengths[place.bar - 1]
        return Place(place.bar, _from_other_end(length, place.from_pin))

    def bar(self, number: int) -> Bar:
        """Convert a bar; the coupler is read from its second pin."""
        bar = self.linkage.bar(number)
        assert bar.inertia is not None and bar.centre is not None
        centre = bar.centre
        if self.exchanged and number == 3:
            centre = _from_other_end(bar.length, centre)
        return copy_with(
            bar,
            length=self.length * bar.length,
            inertia=self.square * bar.inertia,
            centre=self.pair(centre),
        )

    def torsion(self, row: tuple[str, float, float, float]) -> tuple[Any, ...]:
        """Convert the spring at a pin.

        Read from the other end two bars at A or B change their order.
        """
        pin, stiffness, rest, preload = row
        sense = self.sense
        line = 0.0
        if self.exchanged:
            sense = -1.0 if pin in ("A", "B") else 1.0
            line = -math.pi
        couple = self.square * sense * preload
        return self.pin(pin), self.square * stiffness, sense * rest + line, couple

    def load(self, load: Load) -> Load:
        """Convert a load that is no table."""
        force = None
        places: dict[str, Any] = {}
        if load.force is not None:
            size, angle = load.force
            direction = self.direction(angle, load.frame, load.bar)
            force = (self.length * size, direction)
        if load.arm is not None:
            distance, angle = load.arm
            places["arm"] = (self.length * distance, self.direction(angle))
        elif load.place is not None:
            places["from_pin"] = self.place(load.place).from_pin
        moment = self.square * self.sense * load.moment
        bar = self.number(load.bar) or load.bar
        return Load(bar, force, **places, moment=moment, frame=load.frame)

    def term(self, term: Any) -> Any:
        """Convert a load, an effect or the drive; None if it has no counterpart."""
        match term:
            case Load(table=None):
                return self.load(term)
            case Gravity():
                size = self.length * term.magnitude
                return Gravity(size, self.direction(term.angle))
            case Viscous() | Friction():  # their couples have no sense of their own
                rows = {self.pin(pin): self.square * x for pin, x in term.rows}
                return type(term).at(**rows)
            case PinFriction():
                pins = (
                    (self.pin(pin), mu, self.length * r) for pin, mu, r in term.pins
                )
                return PinFriction(tuple(pins))
            case Springs():
                return Springs(tuple(map(self.term, term.springs)))
            case Spring():
                return replace(
                    term,
                    start=self.place(term.start),
                    end=self.place(term.end),
                    length=self.length * term.length,
                    preload=self.length * term.preload,
                    stroke=None if term.stroke is None else self.length * term.stroke,
                )
            case Torsion():
                return Torsion(tuple(map(self.torsion, term.springs)))
            case Flywheel():
                return Flywheel(self.square * term.inertia, self.number(term.bar) or 2)
            case LinearDrive():
                return LinearDrive(self.place(term.start), self.place(term.end))
            case PointDrive(place, direction, frame):
                turned = self.direction(direction, frame, place.bar)
                return PointDrive(self.place(place), turned, frame)
        return None


def _from_other_end(length: float, pair: tuple[float, float]) -> tuple[float, float]:
    """Return a place of a bar, (distance, angle), seen from its second pin."""
    return cmath.polar(length - cmath.rect(*pair))


_NOT_IN_PARTS = (Friction, PinFriction)
"""Effects that are not the sum of what each adds."""


def _convert(scene: Scene, **how: Any) -> Scene:
    """State a scene otherwise."""
    link = scene.linkage
    to = _SceneConversion(link, **how)
    bars = [to.bar(number) for number in MOVING_BARS]
    theta_1 = to.sense * link.ground_angle + to.turn
    if to.exchanged:
        bars = bars[::-1]
        theta_1 = theta_1 + math.pi
    return copy_with(
        scene,
        linkage=_put_bars(link, bars, to.length * link.ground, theta_1),
        drive_bar=to.number(scene.drive_bar),
        loads=tuple(map(to.term, scene.loads)),
        effects=tuple(map(to.term, scene.effects)),
        drive=to.term(scene.drive),
    )


def _put_bars(
    linkage: FourBar,
    bars: Sequence[Bar],
    ground: float,
    ground_angle: float,
) -> FourBar:
    """Put other moving bars on another ground."""
    two, three, four = bars
    return copy_with(
        linkage,
        ground=ground,
        input=two,
        coupler=three,
        output=four,
        ground_angle=ground_angle,
    )


def _measure_mirrored(few: _Few) -> Array:
    """Mirror at the x-axis: the sine changes its sign."""
    command = few.command
    other = few.solve_alike(
        _convert(few.scene, sense=-1.0),
        -1,
        angle=-command.angle,
        speed=-np.asarray(command.speed),
        acceleration=-np.asarray(command.acceleration),
    )

    def convert(name: str) -> Array:
        values: Array = getattr(other, name)
        if name in PIN_FORCES:
            return values * [1.0, -1.0]
        if name in ("drive_force", "power"):
            return values
        return -values

    return few.compare(convert)


def _measure_turned(few: _Few) -> Array:
    """Turn about O2."""
    other = few.solve(
        _convert(few.scene, turn=TURNED),
        angle=few.command.angle + TURNED,
    )

    def convert(name: str) -> Array:
        values: Array = getattr(other, name)
        if name in PIN_FORCES:
            turned = (values @ [1.0, 1j]) * np.exp(-1j * TURNED)
            return join_components(turned.real, turned.imag)
        if name.startswith("theta"):
            return values - TURNED
        return values

    return few.compare(convert)


def _measure_scaled(few: _Few) -> Array:
    """Multiply lengths, and what grows with them, by a power of two.

    Return what differs at all.
    """
    other = few.solve(_convert(few.scene, length=SCALE))
    power = {"N": SCALE, "N m": SCALE**2, "W": SCALE**2}
    differences = []
    for name, ours in zip(few.quantities, few.numbers, strict=True):
        theirs = getattr(other, name) / power.get(UNITS[name], 1.0)
        differences.append(theirs - ours)
    return magnitudes(differences)


def _measure_exchanged(few: _Few) -> Array:
    """Read the linkage from O4.

    At its other end the ground points the other way, theta_1 + pi, and so does bar 3,
    with which sin(theta_4 - theta_2), the sine of a command of bar 3, changes its sign.
    """
    command = few.command
    bar = _OTHER_BAR[command.bar]
    reversed_ = bar == 3
    other = few.solve_alike(
        _convert(few.scene, exchanged=True),
        -1 if reversed_ else 1,
        angle=command.angle + math.pi if reversed_ else command.angle,
        bar=bar,
    )

    def convert(name: str) -> Array:
        if name in PIN_FORCES:
            same, sign = _OTHER_FORCE[name]
            return np.asarray(sign * getattr(other, same))
        values: Array
        if name[:6] in ("theta_", "omega_", "alpha_"):
            values = getattr(other, f"{name[:6]}{_OTHER_BAR[int(name[6])]}")
            return values - math.pi if name == "theta_3" else values
        values = getattr(other, name)
        return values

    return few.compare(convert)


def _measure_superposed(few: _Few) -> Array:
    """Sum what each load and effect adds to the forces of inertia alone."""
    scene = few.scene
    _require_linear(scene)
    if len(scene.loads) + len(scene.effects) < 2:
        raise NotAskedError("the scene has fewer than two loads and effects")
    bare = copy_with(scene, loads=(), effects=())
    alone = [
        *(copy_with(bare, loads=(load,)) for load in scene.loads),
        *(copy_with(bare, effects=(effect,)) for effect in scene.effects),
    ]
    return _measure_sum(few, alone, bare)


def _measure_split_masses(few: _Few) -> Array:
    """Sum the forces of two bodies that make up each bar.

    All but gravity acts with one of them.
    """
    scene = few.scene
    _require_linear(scene)
    if any(load.arm is not None for load in scene.loads):
        raise NotAskedError("a load at an arm from the mass centre moves with it")
    if not any(bar.mass for bar in scene.linkage.moving):
        raise NotAskedError("no bar has a mass")
    weight = tuple(effect for effect in scene.effects if isinstance(effect, Gravity))
    loaded = scene
    bare = copy_with(scene, loads=(), effects=weight)
    parts = [
        copy_with(part, linkage=_take_part(scene.linkage, share))
        for part, share in ((loaded, PART), (bare, 1.0 - PART))
    ]
    return _measure_sum(few, parts)


def _take_part(linkage: FourBar, part: float) -> FourBar:
    """Take a part of each bar's mass: 0.3 on one side of the centre, or 0.7."""
    bars = []
    for bar in linkage.moving:
        assert bar.inertia is not None and bar.centre is not None
        mass = part * bar.mass
        if bar.mass:
            apart = MASSES_APART * math.sqrt(bar.inertia / bar.mass)
        else:
            apart = 0.0
        # the inertia of both parts about the common centre, less what their distance
        # makes
        rest = bar.inertia - PART * (1.0 - PART) * bar.mass * apart * apart
        away = apart * ((1.0 - PART) if part == PART else -PART)
        centre = cmath.polar(cmath.rect(*bar.centre) + away)
        bars.append(copy_with(bar, mass=mass, inertia=part * rest, centre=centre))
    return _put_bars(linkage, bars, linkage.ground, linkage.ground_angle)


def _require_linear(scene: Scene) -> None:
    """Raise NotAskedError where forces are not the sum of their parts.

    A part is what a load or an effect adds.
    """
    if any(isinstance(effect, _NOT_IN_PARTS) for effect in scene.effects):
        raise NotAskedError("forces with dry friction are no sum of what each adds")


def _measure_sum(
    few: _Few,
    parts: Sequence[Scene],
    bare: Scene | None = None,
) -> Array:
    """Compare the forces with the sum of what scenes have, (q, n).

    What a bare scene has, if there is one, is taken off.
    """
    names = few.quantities[few.forces]
    solved = [few.solve(part) for part in parts]
    none = None if bare is None else few.solve(bare)
    totals = []
    summed = []
    for name in names:
        of_parts = np.array([getattr(part, name) for part in solved])
        total = of_parts.sum(axis=0)
        size = magnitudes(of_parts).sum(axis=0)
        if none is not None:
            nothing = getattr(none, name)
            total = total - (len(parts) - 1) * nothing
            size = size + len(parts) * magnitude(nothing)
        totals.append(total)
        summed.append(size)
    scale, condition, terms = few.sizes.select(few.forces)
    # what cancels within a part is among the terms of the whole
    sizes = np.maximum(scale, np.maximum(summed, terms))
    apart = compute_differences(names, few.numbers[few.forces], totals)
    return divide(apart, sizes) * condition


class _Transformation(NamedTuple):
    """A way of stating a scene otherwise."""

    measure: Callable[[_Few], Array]
    """Errors of all quantities, or of forces alone, times their conditions, (q, n)."""
    reason: str
    """Why nothing may change, as the report prints it."""
    of_forces: bool = False
    """True if it compares forces alone."""
    exact: bool = False
    """True if no digit may change."""


TRANSFORMATIONS = {
    "mirrored": _Transformation(
        _measure_mirrored, "y, angles and couples change their signs"
    ),
    "turned": _Transformation(
        _measure_turned, "everything turns with the ground; nothing else changes"
    ),
    "scaled": _Transformation(
        _measure_scaled,
        "lengths and accelerations times 2^7, forces times 2^7, couples times 4^7, to"
        " the last digit",
        exact=True,
    ),
    "exchanged": _Transformation(
        _measure_exchanged, "bars 2 and 4 change places, the coupler is read from B"
    ),
    "superposed": _Transformation(
        _measure_superposed,
        "the forces of all loads and effects are the sum of what each adds",
        of_forces=True,
    ),
    "split masses": _Transformation(
        _measure_split_masses,
        "a bar of two bodies has the forces of both",
        of_forces=True,
    ),
}
"""Ways of stating a scene otherwise, by the names of their rows."""
