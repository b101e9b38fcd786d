"""Sensitivities: the derivative of every quantity by every number of a scene.

The formulas run as they stand, on numbers that carry their slopes.
"""

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from fourbar.effects import Springs
from fourbar.effects.effect import Actions
from fourbar.errors import InputError, expect
from fourbar.evaluation.case import Case
from fourbar.evaluation.evaluate import list_kinematics
from fourbar.formulas.arithmetic import (
    Number,
    polar,
    select,
    vector,
    without_slopes,
)
from fourbar.formulas.path import LoopPath
from fourbar.formulas.position import HalfAngle, compute_factors, find_root_sign
from fourbar.quantities import (
    DRY_FRICTION_QUANTITIES,
    FORCE_NAMES,
    NOT_ASSEMBLED,
    OF_POINTS,
    OK,
    PIN_FORCES,
    SINGULAR,
    STAGE_OF,
    STAGES,
    STATUS_NAMES,
    Array,
    Indices,
    Mask,
)
from fourbar.scene import Command, Scene, command, compute_bar_motion
from fourbar.scene.motion import FromLimit
from fourbar.solution import (
    SHOWN_PARTS,
    Solution,
    find_unit_of_quantity,
    find_values,
    is_scalar,
    split_parts,
)
from fourbar.solving import solve
from fourbar.studies.keys import (
    SceneNumber,
    command_key,
    list_entries,
    moves_before_pins,
    read_number,
    replace_number,
)
from fourbar.studies.sloped import Sloped, take_slopes, take_values
from fourbar.writing import list_names, make_data_frame, make_html, write_between

if TYPE_CHECKING:
    from pandas import DataFrame

POSITIONS_AT_ONCE = 512
"""Positions at a time. Each number is then as many rows as the scene has numbers, and
stays in the cache.
"""
_HUNDREDTH, _DEGREE = 0.01, math.radians(1.0)
"""Change of a number for which its influence is reported. It is relative, or in rad for
an angle.
"""
AT_REST = "at_rest"
"""Status where dry friction holds a pin at rest. Its couple, and all that follows from
it, jumps with the motion. A linkage that stands has its couple 0 and the derivatives of
that, but none by the speed.
"""
AT_FREE_LENGTH = "at_free_length"
"""Status where a spring that acts one way just comes off: slopes jump there."""
_NO_INFLUENCE = 1e-13
"""Change over the largest value of its quantity that is rounding."""


class _Influence(NamedTuple):
    """Largest influence of one number on one quantity.

    The number is changed by a hundredth, a coordinate in the drawing by a hundredth of
    the longest bar, an angle by a degree.
    """

    key: str
    change: float
    """Change in the quantity's unit, signed. For a vector that is no force it is the
    length of its change.
    """
    theta_2: float
    """rad."""
    row: int
    """Index of the position."""


@dataclass(frozen=True, slots=True, eq=False)
class Sensitivity:
    """Derivatives d(quantity)/d(key) at n positions, in SI units and radians."""

    scene: Scene
    solution: Solution
    """The quantities themselves."""
    keys: dict[str, SceneNumber]
    """The p numbers of the derivatives, as in the scene file. Pairs and lists have an
    index.
    """
    numbers: Array
    """Values of the numbers, (p,). Those of motion.theta_2, and of what a motion law
    varies, are NaN.
    """
    status: list[str]
    """Status of each position, as in `Solution.status`; "at_rest": dry friction holds a
    pin; "at_free_length": a spring that acts one way just comes off. Torque and pin
    forces have no derivative there; of a linkage that stands, with friction 0, only
    that by the speed is missing. Quantities that a status other than ok concerns are
    NaN.
    """
    by: dict[str, Array]
    """Derivatives by quantity, (p, n) or (p, n, 2). Of a linkage that stands they
    include what dry friction holds, torque_low and torque_high.
    """

    def of(self, quantity: str, key: str) -> Array:
        """Return d(quantity)/d(key), (n,) or (n, 2).

        A component F12_x or a magnitude |F12| gives (n,).

        Raises InputError for a quantity or a key that is not known here.
        """
        if not isinstance(key, str) or key not in self.keys:
            raise InputError(
                "sensitivity", key, "is not known here; known: " + ", ".join(self.keys)
            )
        slopes: Array = self.find(quantity)[1][list(self.keys).index(key)]
        return slopes

    def value(self, quantity: str) -> Array:
        """Return the quantity, or a component or magnitude of it.

        Places, (n, 2), are those that the derivatives are of: in the coordinates of
        the scene's drawing, which are `solve(scene)[quantity] + scene.origin`.

        Raises InputError as `of` does.
        """
        return self.find(quantity)[0]

    def find(self, quantity: str) -> tuple[Array, Array]:
        """Return a quantity, (n,) or (n, 2), and its derivatives by all keys, (p, ...).

        Quantities and errors are those of `of`.
        """
        named = str(quantity)
        for name in (named, named.strip("|"), named[:-2]):
            if name not in self.by:
                continue
            slopes = self.by[name]
            values: Array = find_values(self.solution, name)
            if name == quantity:
                return values, slopes
            parts = split_parts(name, values)
            if quantity in parts:
                of_parts = split_parts(name, slopes)
                if named.startswith("|"):
                    with np.errstate(all="ignore"):
                        along = (slopes * values).sum(axis=-1) / parts[named]
                    of_parts[named] = along
                return parts[named], of_parts[named]
        raise InputError(
            "sensitivity", quantity, "is not known here; known: " + ", ".join(self.by)
        )

    def to_pandas(self) -> "DataFrame":
        """Make a table, a row for each number and position.

        Columns are key, theta_2, status and d(quantity)/d(key), SI units and rad.

        Raises DependencyError where pandas is not installed.
        """
        parts = [part for name in self.by for part in split_parts(name, self.by[name])]
        parts.sort(key=lambda part: part[0] == "|")  # magnitudes last
        first = {
            "key": np.repeat(list(self.keys), len(self.status)),
            "theta_2": np.tile(self.solution.theta_2, len(self.keys)),
            "status": self.status * len(self.keys),
        }
        slopes = {part: self.find(part)[1].ravel() for part in parts}
        return make_data_frame(first | slopes)

    def influences(self, quantity: str) -> list[_Influence]:
        """List by how much the numbers change a quantity, the largest first.

        A pin force counts by its magnitude.
        """
        part = f"|{quantity}|" if quantity in PIN_FORCES else quantity
        value, slopes = self.find(part)
        size = np.abs(value) if value.ndim == 1 else np.hypot(*value.T)
        rounding = _NO_INFLUENCE * np.nanmax(size, initial=0.0)
        rows = []
        steps = map(self._find_step, self.keys.values(), self.numbers.tolist())
        for key, step, slope in zip(self.keys, steps, slopes, strict=True):
            change = step * slope
            if change.ndim == 2:
                change = np.hypot(*change.T)
            sizes = np.nan_to_num(np.abs(change))
            worst = int(np.argmax(sizes))
            if sizes[worst] > rounding:
                theta_2 = float(self.solution.theta_2[worst])
                rows.append(_Influence(key, float(change[worst]), theta_2, worst))
        return sorted(rows, key=lambda row: -abs(row.change))

    def _find_step(self, entry: SceneNumber, number: float) -> float:
        """Return the change of a number for which its influence is reported.

        A coordinate depends on where the drawing has its origin: it is compared with
        the longest bar.
        """
        if entry.unit == "rad":
            return _DEGREE
        if entry.is_drawn_place or "drawing" in entry.place:
            return _HUNDREDTH * max(self.scene.linkage.lengths)
        return _HUNDREDTH * abs(number)

    def describe_steps(self) -> str:
        """Say by how much a number is changed where its influence is reported."""
        steps = "by 1 % of a number, of an angle by 1 deg"
        if self.scene.drawing is None:
            return steps
        return f"{steps}, of a drawn coordinate by 1 % of the longest bar"

    def __repr__(self) -> str:
        counts = ", ".join(
            f"{self.status.count(word)} {word}" for word in dict.fromkeys(self.status)
        )
        return (
            f"Sensitivity {self.scene.title!r}: by {len(self.keys)} numbers at {counts}"
            "\n" + list_names("quantities", self.by)
        )

    def _repr_html_(self) -> str:
        head = ("", "value", f"changes most {self.describe_steps()}, with")
        rows = []
        for part in SHOWN_PARTS:
            if part.strip("|") in self.by:
                first = self.influences(part)[:3]
                most = ", ".join(f"{row.key} {abs(row.change):.3g}" for row in first)
                rows.append((part, write_between(self.value(part)), most))
        return make_html(repr(self), head, rows)


def sensitivity(scene: Scene) -> Sensitivity:
    """Differentiate every quantity at each position of a scene by each of its numbers.

    d(quantity)/d(key), the other numbers held; what the scene leaves out (the inertia
    of a uniform bar, its centre at mid-bar) follows the length. What is commanded is
    held too, and "motion.theta_2" (or theta_3, theta_4, stroke) is the derivative by
    it. A coordinate of a drawn pin ("pins.A.0") moves the pin in the drawing: lengths
    and ground_angle follow. One of a drawn place ("points.P.drawn.0") moves the place
    alone.

    Raises
    ------
    InputError : a free motion, or a position that is described by its distance from a
        limit.

    >>> from fourbar import Motion, Scene, uniform
    >>> found = sensitivity(Scene(uniform(0.3, 0.1, 0.25, 0.22), Motion(1.0, 10.0)))
    >>> # the torque grows with the square of the speed
    >>> found.of("torque", "motion.omega_2") * 10.0 / found.value("torque")
    array([2.])
    """
    expect("scene", scene, Scene)
    if scene.motion.free is not None:
        raise InputError(
            "motion.free",
            "a free motion",
            "has no sensitivities: they are those of a prescribed theta_2",
        )
    theta = command_key(scene)
    if isinstance(scene.motion.angle, FromLimit):
        raise InputError(
            theta,
            scene.motion.angle,
            "has no sensitivities: the limit moves with the lengths",
        )
    at = command(scene)
    solution = solve(scene)
    moving = at.speed is not None
    keys = {theta: SceneNumber((), scene.motion.numbers[scene.motion.commanded].unit)}
    of_positions = ("pins", "lengths", "points", "drive")
    for key, entry in list_entries(scene).items():
        if moving or key.startswith(of_positions) or ".centre." in key:
            keys[key] = entry
    # a commanded angle has no size of which a hundredth could be taken
    numbers = [float(at.places.max()) if at.moves_stroke else np.nan]
    numbers += [read_number(scene, entry) for entry in keys.values() if entry.place]
    forces = [*FORCE_NAMES]
    if not any(effect.loaded_pins for effect in scene.effects):
        forces.append("drive_condition")
    if not np.any(at.stated[1]):  # what holds a linkage that stands
        forces += DRY_FRICTION_QUANTITIES
    names = [
        name
        for name in solution.evaluated()
        if STAGE_OF.get(name, "force") in STAGES[:3]
        or (moving and name in forces)
        or (name == "theta_2" and scene.motion.commanded != name)
    ]
    stages = OF_POINTS if moving else ("",)
    names += [start + point.name for point in scene.points for start in stages]
    p = len(keys)
    by = {
        name: np.full((p, *find_values(solution, name).shape), np.nan) for name in names
    }
    status = np.array(STATUS_NAMES, dtype="<U16")[solution.status_code]
    with np.errstate(all="ignore"):
        _, decided = Case.of(scene, at.bar).half_angle(at)
        # doubles cannot tell the factors from zero
        status[decided] = STATUS_NAMES[SINGULAR]
        without = STATUS_NAMES[NOT_ASSEMBLED], STATUS_NAMES[SINGULAR]
        regular = np.flatnonzero(~np.isin(status, without))
        seeded = scene
        for number, (key, entry) in sorted(
            enumerate(keys.items()), key=lambda one: not moves_before_pins(*one[1])
        ):
            if not key.startswith("motion."):
                # what is left out carries the slope of its length too
                value = read_number(seeded, entry) + _make_unit_slope(number, p)
                seeded = replace_number(seeded, entry, value)
        for start in range(0, len(regular), POSITIONS_AT_ONCE):
            index = regular[start : start + POSITIONS_AT_ONCE]
            marks = _derive(seeded, keys, at, index, by)
            is_ok = solution.status_code[index] == OK
            for word, mark in marks.items():
                status[index[mark & is_ok]] = word
    stands = (status == AT_REST) & (at.stated[1] == 0.0)
    by_speed = np.array([[key == f"motion.{at.names[1]}"] for key in keys])
    lost = (status != STATUS_NAMES[OK]) & (by_speed | ~stands)
    for name in set(forces) & set(names):
        by[name][lost] = np.nan
    return Sensitivity(
        scene, solution, keys, np.array(numbers, dtype=float), status.tolist(), by
    )


class _SlopedPath(LoopPath):
    """The same path by sine and cosine.

    Near 180 deg a tangent is large, and slopes through it are differences of large
    numbers.
    """

    __slots__ = ()

    def half_angle(self, q: Number) -> HalfAngle:
        """Compute the half angle for the independent angle q against the ground.

        The angle is in rad.
        """
        psi = q - self.theta_1
        s = np.sin(0.5 * psi)
        k = np.cos(0.5 * psi)
        opposite = self.bar == 4
        squares = (k * k, s * s, -(s * k)) if opposite else (s * s, k * k, s * k)
        # a sign has no slope: the linkages beside keep the assembly
        root_sign = find_root_sign(without_slopes(psi), self.passing, opposite=opposite)
        return compute_factors(self.lengths, *squares, root_sign)

    def input_direction(self, q: Number, half: HalfAngle) -> Number:
        """Compute e^{i q}."""
        return polar(1.0, q)


def _make_unit_slope(index: int, count: int) -> Sloped:
    """Return zero, with the slope 1 by one of the variables."""
    return Sloped(0.0, np.eye(count)[:, index : index + 1])


def _derive(
    scene: Scene,
    keys: dict[str, SceneNumber],
    stated: Command,
    index: Indices,
    by: dict[str, Array],
) -> dict[str, Mask]:
    """Compute the slopes of quantities at some positions into arrays, by name.

    The result marks, by status, the positions where forces have no slopes.
    """
    moving = stated.speed is not None
    place = {key: number for number, key in enumerate(keys)}

    def seeded(key: str, number: Any) -> Any:
        number = 0.0 if number is None else number
        number = np.broadcast_to(number, stated.angle.shape)[index].astype(float)
        if key in place:
            return number + _make_unit_slope(place[key], len(keys))
        return Sloped(number, np.zeros((len(keys), 1)))

    of_command = {
        name: seeded(f"motion.{name}", number)
        for name, number in zip(stated.names, stated.stated, strict=True)
    }
    q, speed, acceleration, condition = compute_bar_motion(scene, *of_command.values())
    case = Case.of(scene, stated.bar)
    case = case._replace(path=_SlopedPath(*case.path))
    motion = Command(q, stated.branch[index].astype(float), speed, acceleration)
    state = case.assemble(motion, case.path.half_angle(q), moving=moving)
    quantities = {**list_kinematics(case, state, by.keys()), **of_command}
    quantities["condition"] = quantities["condition"] * condition
    held, off = np.zeros((2, len(index)), dtype=bool)
    if moving:
        actions = Actions(state, case.bodies)
        for pin in {pin for term in case.terms for pin in term.dry_pins}:
            held |= ~np.broadcast_to(actions.turning(pin), held.shape)
            held |= take_values(speed) == 0.0
        for term in case.terms:
            if isinstance(term, Springs):
                off |= term.comes_off(state)
        dynamics = case.dynamics(state)
        quantities |= dynamics.pins._asdict()
        quantities[case.drive.names.value] = dynamics.effort
        quantities["power"] = dynamics.generalized_force * speed
        quantities["drive_condition"] = case.drive_condition(state)
        low, high = case.drive.names.low, case.drive.names.high
        if low in by:
            still = state._replace(speed=0.0)
            ahead = case._replace(impending=1).dynamics(still).effort
            back = case._replace(impending=-1).dynamics(still).effort
            falls = take_values(back) < take_values(ahead)
            quantities[low] = select(falls, back, ahead)
            quantities[high] = select(falls, ahead, back)
    origin = vector(*scene.origin)  # places are those of the drawing
    for name, slopes_of in by.items():
        number = quantities[name]
        if find_unit_of_quantity(name) == "m" and not is_scalar(name):
            number = number + origin
        slopes = np.asarray(take_slopes(number))
        if slopes_of.ndim == 3:
            slopes = np.stack([slopes.real, slopes.imag], axis=-1)
        slopes_of[:, index] = slopes.real
    # where both hold, a pin at rest counts
    return {AT_FREE_LENGTH: off, AT_REST: held}
