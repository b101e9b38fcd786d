"""The same linkage mirrored, turned, scaled, read from its other end, and in parts.

A symmetry of mechanics takes the formulas' numbers of one scene into those of another,
which other branches of the code compute; no reference is needed. Scaling by powers of
two changes no digit at all.
"""

import cmath
import math
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from functools import cached_property, partial
from typing import Any, NamedTuple

import numpy as np

from fourbar.effects import (
    Flywheel,
    Friction,
    Gravity,
    Load,
    PinFriction,
    Place,
    PointDrive,
    Springs,
    Torsion,
    Viscous,
)
from fourbar.effects.effect import PinRows
from fourbar.linkage import ANY_NUMBER, MOVING_BARS, Bar, FourBar, copy_with
from fourbar.quantities import OK, PIN_FORCES, UNITS, Array
from fourbar.scene import Command, Scene, with_signs
from fourbar.scene.motion import Motion
from fourbar.solution import Solution
from fourbar.solving import solve
from fourbar.studies.keys import (
    SceneNumber,
    list_entries,
    read_number,
    read_place,
    replace_number,
)
from fourbar_validation.compare.bodies import pose, stack_components
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
    count_half_turns,
    find_condition,
    find_error,
    find_worst,
    magnitude,
    mark_touching,
    sum_lengths,
)
from fourbar_validation.run.question import NotAskedError, Question, spread_evenly

TURNED = 0.75
"""Angle by which a scene is turned, rad: of few bits, so that sums with it are seldom
rounded. A rounded theta_2 is another one.
"""
SCALE = 2.0**7
"""Factor of every length."""
PART, MASSES_APART = 0.3, 0.4
"""Part of a bar's mass that is split off, and the distance of both parts. The distance
is in radii of gyration of the bar.
"""
Numbers = dict[str, Array]
"""Numbers, or errors, of quantities by their names, (n,) or (n, 2)."""
_FORCES = (*PIN_FORCES, "torque", "drive_force")
_TRANSFORMED_QUANTITIES = (
    *(f"{name}_{bar}" for name in ("theta", "omega", "alpha") for bar in MOVING_BARS),
    *_FORCES,
    "power",
)
"""Quantities that are compared, as far as the scene has them."""
_POWERS = {
    "m": 1,
    "m/s^2": 1,
    "N": 1,
    "W": 2,
    "N m": 2,
    "N m/rad": 2,
    "N m s/rad": 2,
    "kg m^2": 2,
}
"""Powers of the factor of every length and acceleration by which numbers grow, by their
units.
"""
_IN_THE_WORLD = {"ground_angle", "angle", "force", "arm", "direction"}
"""Fields whose angle counts from +x, of a force unless it is of the bar's frame."""
_WITH_A_COUNTERPART = (
    Flywheel,
    Friction,
    Gravity,
    Load,
    PinFriction,
    Springs,
    Torsion,
    Viscous,
)
_ENDS = (
    (2, 4),
    ("O2", "O4"),
    ("A", "B"),
    ("F12", "F14"),
    ("F32", "F43"),
    ("theta_2", "theta_4"),
    ("omega_2", "omega_4"),
    ("alpha_2", "alpha_4"),
)
_OTHER_END: dict[Any, Any] = {a: b for ends in _ENDS for a, b in (ends, ends[::-1])}
"""Bars, pins and quantities by their names in a linkage read from its other end. The
pin forces of bar 3 turn their signs there: F34 = -F43, F23 = -F32.
"""
_AT_A_REVERSAL = 1e-3
"""Part of its speeds below which a pin with dry friction may reverse."""
POSITIONS_STATED_OTHERWISE = 5
"""Positions of a scene that are stated otherwise."""


@dataclass(frozen=True)
class _Few:
    """A scene at a few well-conditioned positions, with the formulas' solution."""

    scene: Scene
    command: Command
    question: Question
    fit: Mask
    """Positions that are compared. The first, from which springs count their turns,
    need not be.
    """

    @cached_property
    def solution(self) -> Solution:
        """Solve the scene."""
        return self.solve(self.scene)

    @cached_property
    def numbers(self) -> Numbers:
        """Return the numbers of each quantity that the scene has."""
        found = {
            name: getattr(self.solution, name, None) for name in _TRANSFORMED_QUANTITIES
        }
        return {name: values for name, values in found.items() if values is not None}

    def solve(self, scene: Scene, sense: int = 1, **changed: Any) -> Solution:
        """Solve another scene at the same positions, the first of which it begins at.

        Springs count their turns from there. Some entries of the command are changed.

        An assembly of a linkage with change points has another sign beyond each of
        them, and the rounding of the lengths decides whether there are any: the sign is
        the same in both scenes, the name of the assembly need not be.

        `sense`: 1 if the loop lies on the same side at each position, -1 if on the
        other.
        """
        signs = with_signs(self.scene.linkage, self.command).branch
        command = self.command._replace(branch=sense * signs, **changed)
        command = with_signs(scene.linkage, command)
        if scene.counts_turns:
            begin: Any = {f"theta_{command.bar}": float(command.angle[0])}
            motion = Motion(**begin, branch=int(command.branch[0]))
            scene = copy_with(scene, motion=motion)
        return solve(scene, "force", at=command)

    def compare(
        self,
        *parts: tuple[int, Solution],
        read: Callable[[str, Solution], Array] = lambda name, other: other[name],
    ) -> Numbers:
        """Compare the numbers here with a sum of multiples of those of other scenes.

        Errors (n,) are returned, in parts of the size of each quantity here, times the
        condition of the quantity. Forces alone are sums.

        `read`: reads what a solution says of a quantity here.
        """
        terms = TermSizes(self.scene, self.solution)
        errors = {}
        for name, values in self.numbers.items():
            if len(parts) > 1 and name not in _FORCES:
                continue
            theirs = [times * read(name, other) for times, other in parts]
            size = terms.scale(name, values).of_terms
            if len(parts) > 1:
                # what cancels within a part is among the terms of the whole
                of_parts = sum(map(magnitude, theirs))
                size = np.maximum(size, np.maximum(of_parts, terms.sum_terms(name)))
            condition = find_condition(name, self.scene.linkage, self.solution)
            error = find_error(name, values, np.sum(theirs, axis=0), size)
            errors[name] = error * np.minimum(condition, 1.0)
        return errors

    def row(self, name: str, transformation: "_Transformation") -> Row:
        """Make the row of a transformation, of the quantity that is worst."""
        theta_2 = self.solution.theta_2
        errors = transformation.measure(self)
        theta_1 = self.scene.linkage.ground_angle
        condition = 1.0 / count_half_turns(theta_1, self.command.angle)
        allowed = 0.0 if transformation.exact else EQUIVALENCE.factor / condition
        largest = [error[self.fit].max() for error in errors.values()]
        worst = list(errors)[find_worst(np.array(largest))]
        reason = f"identity: {transformation.reason}; times the condition; worst in"
        return self.question.row(
            name,
            errors[worst],
            allowed,
            f"{reason} {worst}",
            self.fit,
            condition,
            theta_2,
        )


def check_transformed(question: Question) -> Iterator[Row]:
    """Hold a scene to what it is when it is stated otherwise."""
    name = "scenes stated otherwise"
    try:
        few = _take_plain_positions(question)
    except NotAskedError as reason:
        question.leave_out(name, reason)
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
    link = scene.linkage
    if at.speed is None:
        raise NotAskedError("the scene states positions only")
    if at.moves_stroke or at.time is not None:
        raise NotAskedError("a stroke or a motion law is commanded")
    placed = state_from_pins(scene)
    for term in (*placed.loads, *placed.effects):
        if isinstance(term, Load) and term.table is not None:
            raise NotAskedError("a load over a table has no counterpart")
        if not isinstance(term, _WITH_A_COUNTERPART):
            raise NotAskedError(f"the effect {term.key!r} has no counterpart")
    in_line = link.ground_angle + np.array([0.0, math.pi])
    if scene.counts_turns and mark_touching(link, in_line).any():
        raise NotAskedError("rounding decides how far its torsion springs are wound")
    fit = (
        (solution.status_code == OK)
        & (solution.condition >= WELL_CONDITIONED)
        & (solution.drive_condition >= WELL_CONDITIONED)
        & ~question.reversing(_AT_A_REVERSAL)
    )
    posed = pose(link, [solution.theta_2, solution.theta_3, solution.theta_4])
    for effect in placed.effects:
        for spring in effect.springs if isinstance(effect, Springs) else ():
            # where its ends nearly meet rounding turns its line, whatever the loop's
            # condition
            _, across = posed.lay((spring.start, spring.end))
            fit &= np.abs(across) >= WELL_CONDITIONED * sum_lengths(link)
    indices = np.flatnonzero(fit)
    if not len(indices):
        raise NotAskedError("no position is well-conditioned")
    begin = int(np.argmax(solution.assembled))
    chosen = spread_evenly(indices, POSITIONS_STATED_OTHERWISE)
    positions = np.concatenate([[begin], chosen[chosen != begin]])
    bars = [
        Bar(bar.length, find_mass(bar), find_inertia(bar), find_centre(bar))
        for bar in link.moving
    ]
    few = Scene(
        _put_bars(link, bars),
        Motion(),
        scene.drive_bar,
        placed.loads,
        placed.effects,
        drive=placed.drive,
    )
    command = at.part(positions).as_doubles()
    return _Few(few, command, question, fit[positions])


def _put_bars(linkage: FourBar, bars: Iterable[Bar], **ground: float) -> FourBar:
    """Put other moving bars on the ground, or on another one."""
    names = ("input", "coupler", "output")
    return copy_with(linkage, **dict(zip(names, bars, strict=True)), **ground)


def _measure_moved(
    few: _Few,
    sense: float = 1.0,
    turn: float = 0.0,
    size: float = 1.0,
) -> Numbers:
    """Mirror a scene at the x-axis, turn it about O2, and multiply its lengths.

    What grows with lengths is multiplied too. Angles and couples of a sense have
    another one in a mirror.

    `sense`: -1 for a mirror. `turn`: rad.
    """
    scene = few.scene
    for number in list_entries(scene).values():
        if number.place[0] == "motion":
            continue
        value = read_number(scene, number) * size ** _POWERS.get(number.unit, 0)
        if number.unit in ("rad", "N m") and number.bound == ANY_NUMBER:
            value *= sense
        if number.unit == "rad" and _turns_with_the_ground(scene, number):
            value += turn
        scene = replace_number(scene, number, value)
    at = few.command
    rates = {name: sense * getattr(at, name) for name in ("speed", "acceleration")}
    other = few.solve(scene, int(sense), angle=sense * at.angle + turn, **rates)

    def read(name: str, other: Solution) -> Array:
        values = other[name] / size ** _POWERS.get(UNITS[name], 0)
        if name in PIN_FORCES:
            turned = (values @ np.array([1.0, 1j])) * cmath.rect(1.0, -turn)
            return stack_components(turned if sense > 0.0 else turned.conj())
        if name in ("drive_force", "power"):
            return values
        return sense * (values - turn * name.startswith("theta"))

    return few.compare((1, other), read=read)


def _turns_with_the_ground(scene: Scene, number: SceneNumber) -> bool:
    """Tell whether an angle counts from +x, and not from a line of a bar."""
    holder = read_place(scene, number.place[: 1 + (number.place[0] != "drive")])
    of_bar = getattr(holder, "frame", "world") == "bar" and "arm" not in number.place
    return not of_bar and not _IN_THE_WORLD.isdisjoint(number.place)


def _measure_exchanged(few: _Few) -> Numbers:
    """Read the linkage from O4.

    At its other end the ground points the other way, theta_1 + pi, and so does bar 3,
    with which sin(theta_4 - theta_2), the sine of a command of bar 3, changes its sign.
    """
    command = few.command
    bar = _OTHER_END.get(command.bar, command.bar)
    angle = command.angle + math.pi if bar == 3 else command.angle
    scene = read_from_other_end(few.scene)
    other = few.solve(scene, -1 if bar == 3 else 1, angle=angle, bar=bar)

    def read(name: str, other: Solution) -> Array:
        values = other[_OTHER_END.get(name, name)]
        if name == "theta_3":
            return values - math.pi
        return -values if name in ("F32", "F43") else values

    return few.compare((1, other), read=read)


def read_from_other_end(scene: Scene) -> Scene:
    """State a scene, its places from first pins, with bar 4 as the input."""
    link = scene.linkage

    def exchange(place: Place) -> Place:
        pair = place.from_pin
        if place.bar in _OTHER_END:
            return Place(_OTHER_END[place.bar], pair)
        length = link.lengths[place.bar - 1]
        return Place(place.bar, _from_other_end(length, pair))

    def exchange_term(term: Any) -> Any:
        if isinstance(term, PinRows):
            return type(term).at(**dict(map(exchange_row, term.rows)))
        changed: dict[str, Any] = {}
        place = getattr(term, "place", None)
        if place is None and hasattr(term, "bar"):
            changed["bar"] = _OTHER_END.get(term.bar, term.bar)
        turned = math.pi * (getattr(term, "bar", place and place.bar) == 3)
        if getattr(term, "frame", "world") == "bar":
            # the coupler's line points the other way
            if isinstance(term, PointDrive):
                changed["direction"] = term.direction + turned
            elif term.force is not None:
                changed["force"] = (term.force[0], term.force[1] + turned)
        return copy_with(term.with_places(exchange), **changed)

    def exchange_row(row: tuple[Any, ...]) -> tuple[str, tuple[float, ...]]:
        pin, *numbers = row
        if len(numbers) == 3:  # a spring; two bars at A or B change their order
            stiffness, rest, preload = numbers
            sense = -1.0 if pin in ("A", "B") else 1.0
            numbers = [stiffness, sense * rest - math.pi, sense * preload]
        return _OTHER_END[pin], tuple(numbers)

    two, three, four = link.moving
    three = copy_with(three, centre=_from_other_end(three.length, three.centre))
    theta_1 = link.ground_angle + math.pi
    return copy_with(
        scene,
        linkage=_put_bars(link, (four, three, two), ground_angle=theta_1),
        drive_bar=_OTHER_END.get(scene.drive_bar, scene.drive_bar),
        loads=tuple(map(exchange_term, scene.loads)),
        effects=tuple(map(exchange_term, scene.effects)),
        drive=None if scene.drive is None else exchange_term(scene.drive),
    )


def _from_other_end(length: float, pair: Any) -> tuple[float, float]:
    """Return a place of a bar, (distance, angle), seen from its second pin."""
    return cmath.polar(length - cmath.rect(*pair))


def _measure_superposed(few: _Few) -> Numbers:
    """Sum what each load and effect adds to the forces of inertia alone."""
    scene = few.scene
    bare = copy_with(scene, loads=(), effects=())
    alone = [copy_with(bare, loads=(load,)) for load in scene.loads]
    alone += [copy_with(bare, effects=(effect,)) for effect in scene.effects]
    _require_linear(scene)
    if len(alone) < 2:
        raise NotAskedError("the scene has fewer than two loads and effects")
    # inertia acts in each of them, and once in the scene
    inertia = (1 - len(alone), few.solve(bare))
    return few.compare(inertia, *((1, few.solve(part)) for part in alone))


def _measure_split_masses(few: _Few) -> Numbers:
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
    bare = copy_with(scene, loads=(), effects=weight)
    bodies = ((scene, PART, 1.0 - PART), (bare, 1.0 - PART, -PART))
    parts = []
    for body, part, away in bodies:
        bars = [_take_part(bar, part, away) for bar in scene.linkage.moving]
        stated = copy_with(body, linkage=_put_bars(scene.linkage, bars))
        parts.append((1, few.solve(stated)))
    return few.compare(*parts)


def _take_part(bar: Bar, part: float, away: float) -> Bar:
    """Take a part of a bar's mass, so many times MASSES_APART from the centre."""
    assert bar.inertia is not None and bar.centre is not None
    gyration = math.sqrt(bar.inertia / bar.mass) if bar.mass else 0.0
    apart = MASSES_APART * gyration
    # the inertia of both parts about the common centre, less what their distance makes
    rest = bar.inertia - PART * (1.0 - PART) * bar.mass * apart * apart
    centre = cmath.polar(cmath.rect(*bar.centre) + apart * away)
    return copy_with(bar, mass=part * bar.mass, inertia=part * rest, centre=centre)


def _require_linear(scene: Scene) -> None:
    """Raise NotAskedError where forces are not the sum of what each effect adds."""
    if any(isinstance(effect, Friction | PinFriction) for effect in scene.effects):
        raise NotAskedError("forces with dry friction are no sum of what each adds")


class _Transformation(NamedTuple):
    """A way of stating a scene otherwise."""

    measure: Callable[[_Few], Numbers]
    """Errors of each quantity that is compared, times its condition, (n,)."""
    reason: str
    """Why nothing may change, as the report prints it."""
    exact: bool = False
    """True if no digit may change."""


TRANSFORMATIONS = {
    "mirrored": _Transformation(
        partial(_measure_moved, sense=-1.0), "y, angles and couples change their signs"
    ),
    "turned": _Transformation(
        partial(_measure_moved, turn=TURNED),
        "everything turns with the ground; nothing else changes",
    ),
    "scaled": _Transformation(
        partial(_measure_moved, size=SCALE),
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
    ),
    "split masses": _Transformation(
        _measure_split_masses, "a bar of two bodies has the forces of both"
    ),
}
"""Ways of stating a scene otherwise, by the names of their rows."""
