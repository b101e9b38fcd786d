"""Guaranteed extremes: the largest and smallest load over the input's whole interval, enclosed in ball arithmetic.

A box B of theta_2 and of the toleranced numbers, with centre c, is bounded by the mean-value form
    f(B) is in f(c) + f'(B) (B - c),
and the boxes that may hold the extreme are halved in theta_2 until it is known.

Source: R. E. Moore, R. B. Kearfott, M. J. Cloud, Introduction to Interval Analysis, ch. 6; F. Johansson, IEEE Trans.
Comput. 66 (2017) 1281 (Arb).
"""

import itertools
import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fourbar.effects.effect import list_bodies
from fourbar.errors import DependencyError, InputError, LimitError, expect, say_install
from fourbar.evaluation.case import Case
from fourbar.formulas.arithmetic import dot
from fourbar.formulas.mobility import (
    TURN,
    change_points,
    find_intervals,
    limit_positions,
    turns_fully,
)
from fourbar.formulas.path import Path
from fourbar.formulas.position import Loop, direction
from fourbar.quantities import COUPLE, LINE, NOT_ASSEMBLED, PIN_FORCES
from fourbar.scene import Scene, command, require_input
from fourbar.solve import solve
from fourbar.studies.derivatives import make_differentiable
from fourbar.studies.keys import read_numbers, replace_numbers
from fourbar.studies.sloped import Sloped, make_balls
from fourbar.studies.study import vary

BITS = 128
"""Working precision: rounding is far below what is promised."""
PROVEN = 1e-9
"""Width of the enclosure, relative to the largest magnitude."""
FIRST = 64
"""Boxes to begin with."""
FINEST, FINEST_OF_MANY = 1e-10, 1e-4
"""rad; narrower boxes are not halved: without tolerances, and with them."""
NEGLIGIBLE = 0.02
"""A box over which theta_2 adds less than this share of what the tolerances add is not halved, which hardly helps."""
MANY = 2**15
"""Boxes that are left, above which none is halved: a nearly constant quantity, as of a balanced linkage, has more."""
DRIVES = (COUPLE.value, LINE.value)
NAMES = (*DRIVES, *(f"|{name}|" for name in PIN_FORCES), "transmission")
DISTANCE = math.radians(1.0)
"""rad; how near to a limit, where forces grow without end, the bounds reach."""
TRIED = 10_000
"""Linkages drawn from the tolerances to say how many do not assemble: the share is known to half a percent of all."""
FARTHEST = 1e5
"""Largest ground angle, rad; beyond it the narrowest boxes are smaller than the spacing of doubles."""
PROVABLE = ("gravity", "viscous", "springs", "flywheel", "load")
"""Effects whose form in ball arithmetic is known."""
Balls = NDArray[Any]


class Extreme(NamedTuple):
    """One end of a quantity over the interval."""

    low: float
    """The extreme lies between these two, rounded outwards."""
    high: float
    theta_2: float
    """theta_2 of the extreme, or with tolerances theta_2 where it was found, rad."""


class Extremes(NamedTuple):
    """Result of `extremes`."""

    parts: tuple[tuple[float, float], ...]
    """The intervals of theta_2 (rad) that the bounds hold over."""
    distance: float
    """Distance kept from limits of the input and poles of the torque, rad; 0 where there is none."""
    least: dict[str, Extreme]
    """Least values by quantity: torque (N m) or drive_force (N), |F12| .. |F14| (N), transmission (rad)."""
    greatest: dict[str, Extreme]
    boxes: int
    """Number of boxes that were evaluated."""
    nominal: "Extremes | None" = None
    """Extremes of the linkage without its tolerances, if it has any."""

    def over_estimate(self, name: str, sign: int) -> float | None:
        """Return the distance of the proven greatest (+1) or least (-1) from the nominal, over that of the one found.

        At least 1; None without tolerances, or where no linkage is found beyond the nominal one.
        """
        if self.nominal is None:
            return None
        extreme, before = (
            (x.greatest if sign > 0 else x.least)[name] for x in (self, self.nominal)
        )
        proven, reached = (
            (extreme.high, extreme.low) if sign > 0 else (extreme.low, extreme.high)
        )
        middle = 0.5 * (before.low + before.high)
        return (
            (proven - middle) / (reached - middle)
            if sign * (reached - middle) > PROVEN * abs(middle)
            else None
        )


def extremes(scene: Scene, quantities: Sequence[str] = ()) -> Extremes:
    """Prove the largest and smallest drive, pin forces and transmission angle over the input's whole interval.

    omega_2, alpha_2 and branch are those of the scene. If the scene has tolerances, the bounds hold for every linkage
    within them (three sigma of a normal one): `high` of the greatest and `low` of the least are then proven, and the
    other end is what the worst corner found reaches. The stated doubles count as exact, and nothing derived from them
    is rounded, such as a default inertia m L^2/12.

    Parameters
    ----------
    quantities : of torque (drive_force where the drive is linear), |F12|, |F32|, |F43|, |F14|, transmission; left out:
        all. F12 means |F12|.

    Raises
    ------
    InputError : an unknown quantity, no omega_2, a free motion or a motion law, a change point, an effect that has no
        derivative somewhere.
    LimitError : the linkages within the tolerances do not all assemble over the interval.
    DependencyError : python-flint is not installed.
    """
    try:
        import flint
    except ImportError:
        raise DependencyError(
            f"Guaranteed extremes need python-flint: {say_install('studies')}"
        ) from None
    expect("scene", scene, Scene)
    expect("quantities", quantities, list, tuple)
    for name in quantities:
        expect("quantities", name, str)
    possible = [
        name
        for name in NAMES
        if name not in DRIVES or name == DRIVES[scene.drive is not None]
    ]
    names = [
        name
        for name in possible
        if not quantities or name in quantities or name.strip("|") in quantities
    ]
    for name in quantities:
        if name not in possible and f"|{name}|" not in possible:
            raise InputError(
                "quantity",
                name,
                "must be one of " + ", ".join(possible).replace("|", ""),
            )
    require_provable(scene)
    before, flint.ctx.prec = flint.ctx.prec, BITS
    try:
        with np.errstate(all="ignore"):
            search = _Search(scene)
            least, greatest = (
                {name: search.extreme(name, sign) for name in names} for sign in (-1, 1)
            )
            nominal = (
                extremes(replace(scene, tolerances=()), names)
                if scene.tolerances
                else None
            )
            return Extremes(
                search.parts, search.distance, least, greatest, search.boxes, nominal
            )
    finally:
        flint.ctx.prec = before


class _Search:
    """The quantities over boxes, and the halving of boxes."""

    def __init__(self, scene: Scene) -> None:
        from flint import arb

        self.arb, self.scene, self.boxes = arb, scene, 0
        stated = read_numbers(scene)
        self.reach = {tolerance.key: tolerance.reach for tolerance in scene.tolerances}
        for key in self.reach:
            if key not in stated:
                raise InputError(
                    f"tolerances.{key}",
                    self.reach[key],
                    "is no number that the scene states",
                )
        self.keys = [key for key in stated if key in self.reach]
        self.parts, self.distance = _find_interval(scene)
        self.branch = float(command(scene).branch[0])
        _require_assembly(scene, self.parts)
        self.start = _split(np.array(self.parts), FIRST)
        self.at_start: tuple[dict[str, Sloped], dict[str, Sloped]] | None = None

    def number(self, key: str, value: float, moved: Any) -> Sloped:
        """Return a number of the scene at all boxes: as a ball over its tolerance, or moved by a part of that."""
        slopes = np.zeros((1 + len(self.keys), 1), dtype=object)
        if key not in self.reach:
            return Sloped(make_balls(value), slopes)
        row = self.keys.index(key)
        slopes[1 + row] = 1
        if moved is None:
            return Sloped(make_balls(value, self.reach[key]), slopes)
        return Sloped(
            make_balls(value) + moved[row].astype(object) * self.reach[key], slopes
        )

    def evaluate(self, theta_2: Balls, moved: Any) -> dict[str, Sloped]:
        """Compute the quantities, the pin forces and the sine of the transmission angle squared, with their slopes.

        `moved`: None: over the tolerances; else what each number is off by, in parts of its tolerance, (k, n).
        """
        self.boxes += len(theta_2)
        numbers = {
            key: self.number(key, value, moved)
            for key, value in read_numbers(self.scene).items()
        }
        still = {
            key: number
            for key, number in numbers.items()
            if not key.startswith("motion.")
        }
        scene = replace_numbers(make_differentiable(self.scene), still)
        by_theta = np.zeros((1 + len(self.keys), 1), dtype=object)
        by_theta[0] = 1
        q, link = Sloped(theta_2, by_theta), scene.linkage
        d, a, b, c = link.lengths
        lengths = Loop(
            d,
            a,
            b,
            c,
            (b + c - a - d) * (a + b + c + d),
            (d - a - b + c) * (d - a + b - c),
        )
        terms = (*scene.loads, *scene.effects)
        path = Path(2, lengths, link.ground_angle, direction(link.ground_angle))
        case = Case(
            link,
            lengths,
            list_bodies(link, terms),
            terms,
            scene.drive_bar,
            path,
            drive=scene.drive,
        )
        acceleration = numbers["motion.alpha_2"]
        state = case.assemble(
            q, path.half_angle(q), self.branch, numbers["motion.omega_2"], acceleration
        )
        dynamics = case.dynamics(state, acceleration)
        forces = {
            f"|{name}|": dot(force, force)
            for name, force in dynamics.pins._asdict().items()
        }
        position = state.position
        cosine = dot(position.u3, position.u4)
        return {
            case.names.value: dynamics.drive,
            **forces,
            "sine": position.sin_mu * position.sin_mu,
            "cosine": cosine * cosine,
        }

    def over(
        self, boxes: NDArray[np.float64]
    ) -> tuple[dict[str, Sloped], dict[str, Sloped]]:
        """Evaluate the quantities over the boxes and all tolerances, and at the centres without any."""
        if (
            boxes is self.start and self.at_start is not None
        ):  # every search begins with them
            return self.at_start
        centre, radius = _centre(boxes)
        undisturbed = np.zeros((len(self.keys), len(boxes)))
        bounds = (
            self.evaluate(make_balls(centre, radius), None),
            self.evaluate(make_balls(centre), undisturbed),
        )
        if boxes is self.start:
            self.at_start = bounds
        return bounds

    def extreme(self, name: str, sign: int) -> Extreme:
        """Find the greatest (+1) or least (-1) value, enclosed and rounded outwards."""
        arb, quantity = self.arb, "sine" if name == "transmission" else name
        if (
            quantity == "sine"
            and _bound_below(sign, self.over(self.start)[1][quantity]).max() * sign
            > 0.5
        ):
            quantity, sign = (
                "cosine",
                -sign,
            )  # near a right angle the cosine has more digits
        low, high, theta_2 = self.enclosed(quantity, sign)
        if name not in DRIVES:
            low, high = (end.max(arb(0)).sqrt() for end in (low, high))
        if quantity == "sine":
            low, high = (end.min(arb(1)).asin() for end in (low, high))
        elif quantity == "cosine":
            low, high = (end.min(arb(1)).acos() for end in (high, low))
        return Extreme(_below(low), _above(high), theta_2)

    def enclosed(self, name: str, sign: int) -> tuple[Any, Any, float]:
        """Enclose the greatest (+1) or least (-1) value of what is evaluated between two numbers, and where it is."""
        finest = FINEST_OF_MANY if self.keys else FINEST
        boxes = self.start
        # all numbers below are relative to the largest value at the start: no square leaves the range of doubles
        sizes = [
            abs(value).upper()
            for value in self.over(boxes)[1][name].values
            if value.is_finite()
        ]
        unit = max([x for x in sizes if x > 0], default=self.arb(1))
        scale = sign / unit
        best, theta_2, closed, size = -math.inf, math.nan, -math.inf, 0.0
        while len(boxes):
            centre, radius = _centre(boxes)
            over, nominal = (values[name] for values in self.over(boxes))
            values = _bound_below(scale, nominal)
            size = max([size, *np.abs(values[np.isfinite(values)])])
            bounds = [
                self._bound(scale, over, nominal, i, r) for i, r in enumerate(radius)
            ]
            top, settled = (
                np.array([bound[0] for bound in bounds]),
                np.array([bound[1] for bound in bounds]),
            )
            if (
                self.keys
                and (tried := np.flatnonzero(top > max(best, values.max()))).size
            ):
                slopes = np.broadcast_to(
                    nominal.slopes, (1 + len(self.keys), len(boxes))
                )[1:, tried]
                middles = np.array(
                    [[float(self.arb(slope).mid()) for slope in row] for row in slopes]
                )
                reached = self.evaluate(
                    make_balls(centre[tried]), sign * np.copysign(1.0, middles)
                )[name]
                values[tried] = np.fmax(values[tried], _bound_below(scale, reached))
            if values.max() > best:
                best, theta_2 = float(values.max()), float(centre[int(values.argmax())])
                size = max(size, abs(best))
            allowed = PROVEN * (
                math.sqrt(abs(best) * size) + PROVEN * size
                if name not in DRIVES
                else size
            )
            done = (top <= best + allowed) | (
                (settled | (radius < finest) | (len(boxes) > MANY)) & np.isfinite(top)
            )
            closed = max([closed, *top[done & (top > best)].tolist()])
            done |= top <= closed
            if ((radius < finest) & ~np.isfinite(top)).any():
                pole = math.degrees(float(centre[~np.isfinite(top)][0]))
                why = "there it has a pole, or a linkage within the tolerances has one or does not assemble"
                raise LimitError(
                    f"{name} has no bound at theta_2 = {pole:.6g} deg: {why}"
                )
            boxes = _split(boxes[~done], 2)
        farthest, proven = unit * best, unit * max(closed, best)
        return (
            (farthest, proven, theta_2) if sign > 0 else (-proven, -farthest, theta_2)
        )

    def _bound(
        self, scale: Any, over: Sloped, nominal: Sloped, index: int, radius: float
    ) -> tuple[float, bool]:
        """Bound what a box holds from above, inf without a bound; the second is True if halving gains nothing."""
        slopes = np.broadcast_to(over.slopes, (1 + len(self.keys), len(over.values)))[
            :, index
        ]
        reach = [radius, *(self.reach[key] for key in self.keys)]
        added = [scale * s * self.arb(0, r) for s, r in zip(slopes, reach, strict=True)]
        tops = [
            _above(value)
            for value in (
                scale * nominal.values[index] + sum(added),
                scale * over.values[index],
            )
        ]
        by_angle, *by_tolerance = (float(part.rad()) for part in added)
        top = min([x for x in tops if math.isfinite(x)], default=math.inf)
        return top, by_angle < NEGLIGIBLE * sum(by_tolerance)


def _bound_below(scale: Any, number: Sloped) -> NDArray[np.float64]:
    """Bound the values, scaled, from below; -inf where no bound is certain."""
    bounds = np.array([_below(scale * value) for value in number.values])
    return np.where(np.isfinite(bounds), bounds, -math.inf)


def _below(ball: Any) -> float:
    """Return the least that a ball holds, rounded outwards."""
    low = float(ball.lower())
    return math.nextafter(low, -math.inf) if type(ball)(low) > ball.lower() else low


def _above(ball: Any) -> float:
    """Return the greatest."""
    return -_below(-ball)


def _centre(
    boxes: NDArray[np.float64],
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return centres, and radii that reach both ends."""
    centre = boxes.mean(axis=1)
    return centre, np.nextafter(
        np.maximum(boxes[:, 1] - centre, centre - boxes[:, 0]), math.inf
    )


def _split(boxes: NDArray[np.float64], parts: int) -> NDArray[np.float64]:
    """Split each box into equal parts."""
    ends = np.linspace(boxes[:, 0], boxes[:, 1], parts + 1, axis=1)
    return np.stack([ends[:, :-1], ends[:, 1:]], axis=2).reshape(-1, 2)


def require_provable(scene: Scene) -> None:
    """Raise InputError for what has no proven extremes."""
    motion = scene.motion
    require_input(scene, "the search for proven extremes")
    if motion.free is not None or motion.law is not None:
        raise InputError(
            "motion",
            "a free motion or a motion law",
            "has no interval of theta_2 at one speed",
        )
    if motion.omega_2 is None:
        raise InputError(
            "motion.omega_2", None, "is needed for extremes of torque and pin forces"
        )
    if abs(scene.linkage.ground_angle) > FARTHEST:
        allowed = f"must lie within {FARTHEST:g} rad for extremes"
        raise InputError("lengths.ground_angle", scene.linkage.ground_angle, allowed)
    if change_points(scene.linkage):
        raise InputError(
            "lengths",
            scene.linkage.lengths,
            "has a change point, towards which forces have no bound",
        )
    for term in (*scene.loads, *scene.effects):
        if term.key not in PROVABLE or getattr(term, "table", None) is not None:
            key = "loads" if term.key == "load" else f"effects.{term.key}"
            allowed = "gravity, viscous, springs, flywheel and loads without a table"
            raise InputError(
                key,
                None,
                f"its extremes cannot be guaranteed; those with {allowed} can",
            )


def _find_interval(scene: Scene) -> tuple[tuple[tuple[float, float], ...], float]:
    """Return the input's full interval without what lies within DISTANCE of its limits and of poles of the torque."""
    linkage, first = scene.linkage, float(command(scene).theta_2[0])
    psi = first - linkage.ground_angle
    if abs(psi) > TURN:
        first = linkage.ground_angle + math.atan2(math.sin(psi), math.cos(psi))
    if turns_fully(linkage):
        start, stop, gaps = first, first + TURN, False
    else:
        every = [
            (low + TURN * turn, high + TURN * turn)
            for low, high in find_intervals(linkage)
            for turn in (math.floor((first - low) / TURN),)
        ]
        start, stop = next(
            ((low, high) for low, high in every if low <= first <= high), every[0]
        )
        start, stop, gaps = start + DISTANCE, stop - DISTANCE, True
    parts = [(start, stop)]
    if scene.drive_bar in (
        3,
        4,
    ):  # T3 has poles where bar 3 stands still against the ground, T4 where bar 4 does
        for limit in limit_positions(linkage, scene.drive_bar):
            for turn in range(-2, 3):
                pole = limit.theta_2 + TURN * turn
                cut = [(low, min(high, pole - DISTANCE)) for low, high in parts]
                cut += [(max(low, pole + DISTANCE), high) for low, high in parts]
                kept = [(low, high) for low, high in cut if low < high]
                if kept != parts:
                    gaps = True
                parts = sorted(set(kept))
    parts = [(low, high) for low, high in parts if low < high]
    if not parts:
        near = f"lies within {math.degrees(DISTANCE):g} deg of a limit of the input or of a pole"
        raise LimitError(
            f"the whole interval of theta_2 {near}, where nothing is proven"
        )
    return tuple(parts), DISTANCE if gaps else 0.0


def _require_assembly(scene: Scene, parts: tuple[tuple[float, float], ...]) -> None:
    """Raise LimitError with the share of the linkages within the tolerances that do not assemble everywhere.

    The diagonal from A to O4 is shortest and longest at the ends, and where the input lies along the ground's line.
    """
    of_lengths = [
        tolerance
        for tolerance in scene.tolerances
        if tolerance.key.startswith("lengths.")
    ]
    if not of_lengths:
        return
    corners = np.array(list(itertools.product((-1.0, 1.0), repeat=len(of_lengths))))
    off = np.concatenate(
        [corners, np.random.default_rng(0).uniform(-1.0, 1.0, (TRIED, len(of_lengths)))]
    ).T
    stated, first = read_numbers(scene), scene.linkage.ground_angle
    values: dict[str, Any] = {
        tolerance.key: stated[tolerance.key] + tolerance.reach * part
        for tolerance, part in zip(of_lengths, off, strict=True)
    }
    along = [first + 0.5 * TURN * turn for turn in range(-4, 5)]
    inside = [
        angle for angle in along if any(low <= angle <= high for low, high in parts)
    ]
    values["motion.theta_2"] = np.array([*itertools.chain(*parts), *inside])
    apart = (solve(vary(scene, values), "position").status_code == NOT_ASSEMBLED).any(
        axis=1
    )
    if apart.any():
        share = 100.0 * float(apart[len(corners) :].mean())
        low, high = (math.degrees(end) for end in (parts[0][0], parts[-1][1]))
        raise LimitError(
            f"tolerances: {f'{share:.3g} %' if share else 'some'} of the linkages within them do not assemble over "
            f"theta_2 = {low:.6g} to {high:.6g} deg: no bound holds for all; narrow the tolerances"
        )
