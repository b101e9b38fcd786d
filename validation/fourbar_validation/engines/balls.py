"""The linkage in ball arithmetic, as a reference and as an engine.

Every output of `solve` has 50 digits and a rigorous radius. Shares nothing with the
formulas: the loop is closed by the complex quadratic in e^{i theta_3}, the velocities
and accelerations come from the linear systems of the differentiated loop, the pin
forces and the torque from the nine Newton-Euler equations of the bars about O2, as one
system.
"""

import math
from bisect import bisect
from collections.abc import Callable
from itertools import product
from typing import Any, TypeAlias

import numpy as np
from flint import acb, arb, arb_mat, ctx, fmpq

from fourbar.effects import Load, Place, PointDrive, Table
from fourbar.formulas.many_digits import WORKING_DIGITS
from fourbar.linkage import MOVING_BARS, PINS, FourBar
from fourbar.quantities import VECTORS, Array
from fourbar.scene import Command, Scene
from fourbar_validation.compare.answer import Answer
from fourbar_validation.compare.compare import COMPARED_QUANTITIES
from fourbar_validation.compare.pins import find_centre, find_inertia, find_mass
from fourbar_validation.compare.tolerance import EPS, RANDOM_WALK
from fourbar_validation.engines.description import (
    FORCE_BETWEEN,
    SHARED_BY_EXACT_ENGINES,
    Sizes,
    find_stated_lengths,
    find_unknown,
)
from fourbar_validation.engines.loop import read_each

Ball: TypeAlias = Any
ComplexBall: TypeAlias = Any
"""A vector of the plane, x + i y, of two balls."""
BallValues: TypeAlias = dict[str, Ball]
OfBars: TypeAlias = dict[int, Ball]
VectorsOfBars: TypeAlias = dict[int, ComplexBall]
Spot: TypeAlias = tuple[int, ComplexBall]
"""A place on a bar: the bar, and a vector from its first pin."""


def polar_ball(r: Ball, angle: Ball) -> ComplexBall:
    """Return r e^{i angle}."""
    return acb(r * angle.cos(), r * angle.sin())


def wedge(u: ComplexBall, v: ComplexBall) -> Ball:
    """Return u_x v_y - u_y v_x."""
    return (u.conjugate() * v).imag


def square(ball: Ball) -> Ball:
    """Return the square as a product.

    The power of python-flint 0.9 is NaN of a ball about 0 exactly, such as the speed of
    a bar that does not turn.
    """
    return ball * ball


BITS = 320
"""Working precision. 50 digits are 167 bits; the rest is what the worst sample (a limit
position at 1e-20) cancels.
"""
OF_PIECE = ("table_start", "table_stop", "table_first", "table_last")
"""Angles and factors of the piece of a load's table that a position is in."""
COMMANDED_FIRST = {
    2: ("a", "b", "c"),
    3: ("b", "a", "c"),
    4: ("c", "b", "a"),
}
"""Lengths of the commanded bar and of the two others, by the commanded bar."""
STEP_BITS = 90
"""Sensitivities are difference quotients with a relative step of 2^-90: wrong by about
2^-90 / (distance to the nearest singular position), and the cancelled 90 bits are there
to lose.
"""


def make_ball_lengths(linkage: FourBar) -> BallValues:
    """Return the lengths d, a, b, c as they were stated, as balls.

    Lengths that are balls already, as those of a study of slopes, stay.
    """
    if any(isinstance(length, arb) for length in linkage.lengths):
        return dict(zip("dabc", map(arb, linkage.lengths), strict=True))
    lengths = find_stated_lengths(linkage.lengths)
    return {
        name: arb(fmpq(*length.as_integer_ratio()))
        for name, length in zip("dabc", lengths, strict=True)
    }


def make_balls(scene: Scene, angle: float, **motion: float) -> BallValues:
    """Return the stored doubles that the outputs at one position depend on, as balls.

    The position is of the commanded angle; omega_2 or alpha_2 are replaced where they
    are given. What acts is evaluated once, with all bars laid down along +x, and takes
    its numbers on the way. The working precision is set.
    """
    ctx.prec = BITS
    linkage = scene.linkage
    inputs = make_ball_lengths(linkage) | {"theta_1": arb(linkage.ground_angle)}
    rates = scene.motion.find_rates(np.array([angle]))
    stored = angle, *(0.0 if rate is None else np.ravel(rate)[0] for rate in rates)
    commanded = dict(zip(scene.motion.names, stored, strict=True)) | motion
    for name, value in commanded.items():
        inputs[name] = arb(value)
    loop = _Loop(scene, inputs)
    loop.pose(dict.fromkeys(MOVING_BARS, acb(1)))
    loop.omega = loop.alpha = dict.fromkeys(loop.w, arb(0))
    loop.sum_acting()
    return loop.x


def compute_directions(
    x: BallValues,
    branch: int,
) -> tuple[ComplexBall, ComplexBall, ComplexBall] | None:
    """Return e^{i theta_2}, e^{i theta_3}, e^{i theta_4}.

    None if the loop does not close.

    The two bars that are not commanded, of lengths b and c, span a vector D. With w the
    direction of the first of them, |D - b w| = c is
        b conj(D) w^2 - K w + b D = 0,   K = |D|^2 + b^2 - c^2.
    In the letters of the linkage
        D = d e^{i theta_1} - a e^{i theta_2} of bars 3 and 4,
        D = d e^{i theta_1} - b e^{i theta_3} of bars 2 and 4,
        D = d e^{i theta_1} + c e^{i theta_4} of bars 3 and 2, bar 2 reversed.
    """
    bar = _find_commanded_bar(x)
    d = x["d"]
    held, b, c = (x[name] for name in COMMANDED_FIRST[bar])
    side = 1 if bar == 4 else -1
    angle = x[f"theta_{bar}"]
    w = polar_ball(arb(1), angle)
    D = polar_ball(d, x["theta_1"]) + side * held * w
    # |D|^2 by the angle between ground and input: where they are in line it is exact,
    # and so is a loop that just closes
    cosine = (angle - x["theta_1"]).cos()
    squared = d**2 + held**2 + side * 2 * d * held * cosine
    K = squared + b * b - c * c
    discriminant = 4 * b * b * squared - K * K
    if discriminant < 0:  # an undecided one has no root, and what follows is NaN
        return None
    first = acb(K, branch * discriminant.sqrt()) * D / (2 * b * squared)
    second = (b * first - D) / c
    if bar == 2:
        return (w, first, second)
    if bar == 3:
        return (first, w, second)
    return (-second, first, w)


def _find_commanded_bar(x: BallValues) -> int:
    """Return the bar whose angle is among the inputs."""
    return next(bar for bar in MOVING_BARS if f"theta_{bar}" in x)


def compute_outputs(
    scene: Scene,
    branch: int,
    inputs: BallValues,
) -> BallValues | None:
    """Compute every output at one position as balls.

    Vectors are name_x, name_y; None if the loop does not close.
    """
    loop = _Loop(scene, inputs)
    if "stroke" in inputs and not loop.turn_by_stroke():
        return None
    directions = compute_directions(loop.x, branch)
    if directions is None:
        return None
    loop.pose(dict(zip(MOVING_BARS, directions, strict=True)))
    commanded = _find_commanded_bar(loop.x)
    y: BallValues = {}
    for bar in MOVING_BARS:
        if f"theta_{bar}" not in inputs:
            y[f"theta_{bar}"] = loop.w[bar].arg()
    y["sin_mu"] = loop.sines[2]
    y["condition"] = abs(loop.sines[commanded]) * loop.x.get("lever", 1)
    # NaN where A lies on O4, about which bars 3 and 4 then turn freely
    if not y["condition"] > 0:
        return y
    loop.move(commanded)
    y |= {f"omega_{bar}": loop.omega[bar] for bar in MOVING_BARS}
    y |= {f"alpha_{bar}": loop.alpha[bar] for bar in MOVING_BARS}
    _put_vectors(y, loop.points())
    unit = loop.evaluate_drive(y)
    try:
        forces, driving = loop.solve_forces(unit)
    except ZeroDivisionError:
        return y
    _put_vectors(y, forces)
    y["torque" if scene.drive is None else "drive_force"] = driving
    y["power"] = driving * loop.compute_power(unit, loop.omega)
    return y


def _put_vectors(y: BallValues, vectors: dict[str, ComplexBall]) -> None:
    """Put vectors by their components."""
    for name, vector in vectors.items():
        y[f"{name}_x"] = vector.real
        y[f"{name}_y"] = vector.imag


class _Wrenches:
    """Force, and moment about O2, that act on each bar. The ground bears all."""

    def __init__(self) -> None:
        bars = (1, *MOVING_BARS)
        self.force: VectorsOfBars = dict.fromkeys(bars, acb(0))
        self.moment: OfBars = dict.fromkeys(bars, arb(0))

    def push(self, bar: int, force: ComplexBall, point: ComplexBall) -> None:
        """Add a force at a point."""
        self.force[bar] += force
        self.moment[bar] += wedge(point, force)

    def twist(self, pin: str, couple: Ball) -> None:
        """Add a couple to bar j of a pin (i, j), its opposite to bar i."""
        i, j = PINS[pin]
        self.moment[j] += couple
        self.moment[i] -= couple

    def components(self) -> list[Ball]:
        """List force and moment of the moving bars, nine balls."""
        listed = []
        for bar in MOVING_BARS:
            force = self.force[bar]
            listed += [force.real, force.imag, self.moment[bar]]
        return listed


class _Loop:
    """The linkage at one position: its numbers, then its bars as they lie and move.

    Bars are numbered as everywhere, the ground is bar 1.
    """

    w: VectorsOfBars
    """Unit vectors along the bars."""
    sines: OfBars
    """Sine between the two other moving bars, by bar; 3 and 4 turn by it over their
    lengths where 2 turns by its own.
    """
    tip: VectorsOfBars
    """Vectors from the first pin to the second."""
    first_pin: VectorsOfBars
    """Places of the first pins."""
    centre: VectorsOfBars
    """Places of the mass centres."""
    omega: OfBars
    alpha: OfBars

    def __init__(self, scene: Scene, inputs: BallValues) -> None:
        self.scene = scene
        self.x = dict(inputs)
        """Every number taken, by name."""
        self.to_centre = {}
        for bar in MOVING_BARS:
            stated = scene.linkage.bar(bar)
            self.take(f"m{bar}", find_mass(stated))
            self.take(f"I{bar}", find_inertia(stated))
            self.to_centre[bar] = self.polar(find_centre(stated), f"r{bar}")
        drive = scene.drive
        # names of the points between which a linear drive acts
        ends = zip(("from", "to"), () if drive is None else drive.ends, strict=False)
        self.ends = [self.spot(place, name) for name, (_, place) in ends]
        if isinstance(drive, PointDrive):
            self.take("direction", drive.direction)

    def take(self, name: str, stored: Any) -> Ball:
        """Take a number, as it is given or else as the scene stores it."""
        if name not in self.x:
            self.x[name] = arb(stored)
        return self.x[name]

    def polar(self, pair: tuple[float, float], name: str) -> ComplexBall:
        """Take a vector that two numbers state."""
        size, angle = pair
        return polar_ball(self.take(name, size), self.take(f"{name}_angle", angle))

    def spot(self, place: Place, name: str) -> Spot:
        """Take a place by its two numbers; of a named point, the point's."""
        if place.point is not None:
            points = self.scene.points
            place = next(one.place for one in points if one.name == place.point)
        pair = place.from_centre if place.from_pin is None else place.from_pin
        assert pair is not None
        offset = self.polar(pair, name)
        if place.from_pin is None:
            offset += self.to_centre[place.bar]
        return place.bar, offset

    def turn_by_stroke(self) -> bool:
        """Take angle, speed and acceleration of the bar that a stroke turns.

        False if the triangle stays open.

        With l and r from the pin to the ends: s^2 = l^2 + r^2 - 2 l r cos beta, twice
        differentiated.
        """
        x = self.x
        (_, on_ground), (bar, held) = sorted(self.ends, key=lambda spot: spot[0])
        fixed = polar_ball(arb(1), x["theta_1"]) * on_ground
        if bar == 4:
            fixed -= polar_ball(x["d"], x["theta_1"])
        s = x["stroke"]
        speed = x["stroke_speed"]
        length = abs(held)
        reach = abs(fixed)
        cosine = (length**2 + reach**2 - s**2) / (2 * length * reach)
        if abs(cosine) > 1:
            return False
        beta = cosine.acos()
        # to the left the stroke grows with the angle
        side = 1 if self.scene.motion.side == "left" else -1
        across = length * reach * beta.sin()
        along = length * reach * cosine
        rate = s * speed / across
        along_the_stroke = square(speed) + s * x["stroke_acceleration"]
        growth = (along_the_stroke - along * square(rate)) / across
        x[f"theta_{bar}"] = fixed.arg() - held.arg() + side * beta
        x[f"omega_{bar}"] = side * rate
        x[f"alpha_{bar}"] = side * growth
        x["lever"] = across / s / max(reach, length)
        return True

    def pose(self, w: VectorsOfBars) -> None:
        """Place the bars along unit vectors."""
        x = self.x
        self.w = {1: polar_ball(arb(1), x["theta_1"]), **w}
        self.sines = {2: wedge(w[3], w[4]), 3: wedge(w[4], w[2]), 4: wedge(w[3], w[2])}
        self.tip = {2: x["a"] * w[2], 3: x["b"] * w[3], 4: x["c"] * w[4]}
        ground = polar_ball(x["d"], x["theta_1"])
        self.first_pin = {1: acb(0), 2: acb(0), 3: self.tip[2], 4: ground}
        centres = self.to_centre.items()
        self.centre = {bar: self.locate((bar, offset)) for bar, offset in centres}

    def locate(self, spot: Spot) -> ComplexBall:
        """Locate a place on a bar."""
        bar, offset = spot
        return self.first_pin[bar] + self.w[bar] * offset

    def move(self, commanded: int) -> None:
        """Move the bars: two linear systems of the differentiated loop."""
        x = self.x
        zero = acb(0)
        side = self.tip | {4: -self.tip[4]}  # the loop is gone round
        first, second = (bar for bar in MOVING_BARS if bar != commanded)
        across = wedge(side[first], side[second])

        def rates(stated: Ball, total: ComplexBall) -> OfBars:
            """Solve for the rates of the other bars.

            The sum of i side rate is `total`.
            """
            rest = acb(0, -1) * total - stated * side[commanded]
            others = {
                first: wedge(rest, side[second]) / across,
                second: wedge(side[first], rest) / across,
            }
            return {1: arb(0), commanded: stated, **others}

        # a probe opens the loop by slip, m/s, and jerk, m/s^2
        self.omega = rates(x[f"omega_{commanded}"], x.get("slip", zero))
        pull = sum((side[bar] * square(self.omega[bar]) for bar in MOVING_BARS), zero)
        self.alpha = rates(x[f"alpha_{commanded}"], x.get("jerk", zero) + pull)

    def velocity(self, omega: OfBars, spot: Spot) -> ComplexBall:
        """Return the velocity of a point of a bar at angular speeds."""
        bar, point = spot
        v = acb(0, omega[bar]) * (point - self.first_pin[bar])
        return v + acb(0, omega[2]) * self.tip[2] if bar == 3 else v

    def acceleration(self, spot: Spot) -> ComplexBall:
        """Return the acceleration of a point of a bar."""
        bar, point = spot
        turned = acb(-square(self.omega[bar]), self.alpha[bar])
        a = turned * (point - self.first_pin[bar])
        return a + self.acceleration((2, self.tip[2])) if bar == 3 else a

    def compute_power(self, on: _Wrenches, omega: OfBars) -> Ball:
        """Compute the power of wrenches at angular speeds.

        A wrench about O2 acts on the point of its bar that lies there.
        """
        total = arb(0)
        for bar in MOVING_BARS:
            velocity = self.velocity(omega, (bar, acb(0)))
            total += (on.force[bar].conjugate() * velocity).real
            total += on.moment[bar] * omega[bar]
        return total

    def points(self) -> dict[str, ComplexBall]:
        """Return places, velocities and accelerations of the points, by name.

        The points are those that are answered.
        """
        spots = {"A": (2, self.tip[2]), "B": (4, self.first_pin[4] + self.tip[4])}
        spots |= {f"G{bar}": (bar, self.centre[bar]) for bar in MOVING_BARS}
        points = {}
        for name, spot in spots.items():
            _, points[name] = spot
            points[f"v_{name}"] = self.velocity(self.omega, spot)
            points[f"a_{name}"] = self.acceleration(spot)
        return points

    def sum_acting(self) -> _Wrenches:
        """Sum what acts on each bar."""
        on = _Wrenches()
        for k, load in enumerate(self.scene.loads):
            self._add_load(on, load, k)
        for effect in self.scene.effects:
            if effect.key not in _TERMS:
                kind = type(effect).__name__
                raise NotImplementedError(f"the reference knows no effect {kind}")
            _TERMS[effect.key](self, on, effect)
        for bar in MOVING_BARS:
            on.moment[bar] += self.x.get(f"couple_{bar}", 0)  # a probe may add one
        return on

    def _add_load(self, on: _Wrenches, load: Load, k: int) -> None:
        """Add the moment and the force of one load."""
        bar = load.bar
        force = self.polar(load.force or (0.0, 0.0), f"F_{k}")
        moment = self.take(f"M_{k}", load.moment)
        factor = self._interpolate(load.table, k) if load.table else 1
        on.moment[bar] += factor * moment
        if load.arm is not None:
            point = self.centre[bar] + self.polar(load.arm, f"at_{k}")
        elif load.force is not None:
            assert load.place is not None
            point = self.locate(self.spot(load.place, f"at_{k}"))
        else:
            return
        axes = self.w[bar] if load.frame == "bar" else 1
        on.push(bar, factor * axes * force, point)

    def _interpolate(self, table: Table, k: int) -> Ball:
        """Interpolate between the two points of a table that enclose theta_2.

        The angle is taken modulo a turn. Where the inputs have them, the four numbers
        are multiplied by those of `OF_PIECE`.
        """
        theta_2 = self.x.get("theta_2", self.w[2].arg())
        middle = float(theta_2.mid())
        turns = math.floor((middle - table.theta_2[0]) / math.tau + 1e-12)
        angle = theta_2 - 2 * turns * arb.pi()
        points_before = bisect(table.theta_2, float(angle.mid()))
        after = min(max(points_before, 1), len(table.theta_2) - 1)
        piece = slice(after - 1, after + 1)
        numbers = (*table.theta_2[piece], *table.factor[piece])
        scaled = []
        for name, value in zip(OF_PIECE, numbers, strict=True):
            scaled.append(arb(value) * self.x.get(f"{name}_{k}", 1))
        start, stop, first, last = scaled
        return first + (last - first) * (angle - start) / (stop - start)

    def add_gravity(self, on: _Wrenches, effect: Any) -> None:
        """Add the weights."""
        field = self.polar((effect.magnitude, effect.angle), "g")
        for bar in MOVING_BARS:
            on.push(bar, self.x[f"m{bar}"] * field, self.centre[bar])

    def _slip(self, pin: str) -> Ball:
        """Return omega_j - omega_i of the bars that meet at a pin."""
        i, j = PINS[pin]
        return self.omega[j] - self.omega[i]

    def add_damping(self, on: _Wrenches, effect: Any) -> None:
        """Add couples against the slip, in proportion to it."""
        for pin, stated in effect.coefficients:
            on.twist(pin, -self.take(f"viscous_{pin}", stated) * self._slip(pin))

    def add_friction(self, on: _Wrenches, effect: Any) -> None:
        """Add couples against the slip; a ball that contains 0 has every sign."""
        for pin, stated in effect.torques:
            couple = self.take(f"friction_{pin}", stated)
            on.twist(pin, -couple * self._slip(pin).sgn())

    def add_flywheel(self, on: _Wrenches, effect: Any) -> None:
        """Add the couple of the wheel's inertia."""
        on.moment[effect.bar] -= self.take("J", effect.inertia) * self.alpha[effect.bar]

    def add_torsion(self, on: _Wrenches, effect: Any) -> None:
        """Add the couples of torsion springs."""
        for pin, *stated in effect.springs:
            names = (f"torsion_{pin}", f"rest_{pin}", f"wound_{pin}")
            stiffness, rest, preload = map(self.take, names, stated)
            i, j = PINS[pin]
            turned = self.w[j] * self.w[i].conjugate() * polar_ball(arb(1), -rest)
            on.twist(pin, -preload - stiffness * turned.arg())

    def add_springs(self, on: _Wrenches, effect: Any) -> None:
        """Add the pull of each spring at its two ends."""
        for k, spring in enumerate(effect.springs):
            stiffness = self.take(f"stiffness_{k}", spring.stiffness)
            length = self.take(f"length_{k}", spring.length)
            preload = self.take(f"pull_{k}", spring.preload)
            start = self.locate(self.spot(spring.start, f"start_{k}"))
            end = self.locate(self.spot(spring.end, f"end_{k}"))
            across = end - start
            pull = stiffness * across
            # else the pull is k times the distance, wherever that ends
            if spring.preload != spring.stiffness * spring.length:
                distance = abs(across)
                tension = preload + stiffness * (distance - length)
                if spring.acts == "pull":
                    tension = tension.max(arb(0))
                elif spring.acts == "push":
                    tension = tension.min(arb(0))
                pull = tension / distance * across
            on.push(spring.start.bar, pull, start)
            on.push(spring.end.bar, -pull, end)

    def evaluate_drive(self, y: BallValues) -> _Wrenches:
        """Return what one N m or one N of the drive does to the bars.

        The drive's condition and, of a drive along a line, its motion are put into `y`.
        The condition is |P|/L. P is the stroke's speed with (sin mu, (a/b) sin(theta_2
        - theta_4), (a/c) sin(theta_2 - theta_3)). L is the sum of what each end could
        move: r on bar 2, a + r a/b on bar 3, r a/c on bar 4.
        """
        drive = self.scene.drive
        unit = _Wrenches()
        if drive is None:
            driven = self.scene.drive_bar
            y["drive_condition"] = abs(self.sines[driven])
            unit.moment[driven] = arb(1)
            return unit
        points = [self.locate(spot) for spot in self.ends]
        if isinstance(drive, PointDrive):
            line = polar_ball(arb(1), self.x["direction"])
            if drive.frame == "bar":
                line *= self.w[drive.place.bar]
        else:
            start, end = points
            y["stroke"] = abs(end - start)
            line = (end - start) / y["stroke"]
        a = self.x["a"]
        per_turn = {2: arb(1), 3: a / self.x["b"], 4: a / self.x["c"]}
        reach = arb(0)
        for (sense, _), (bar, arm), point in zip(
            drive.ends, self.ends, points, strict=True
        ):
            unit.push(bar, int(sense) * line, point)
            if bar != 1:
                reach += per_turn[bar] * abs(arm) + (a if bar == 3 else 0)
        turning = {bar: per_turn[bar] * self.sines[bar] for bar in MOVING_BARS}
        y["drive_condition"] = abs(self.compute_power(unit, turning)) / reach
        y["stroke_speed"] = self.compute_power(unit, self.omega)
        _put_vectors(y, {"drive_line": line})
        return unit

    def solve_forces(self, unit: _Wrenches) -> tuple[dict[str, ComplexBall], Ball]:
        """Solve for pin forces, complex, N, and the drive, N m or N, at one position.

        Raises ZeroDivisionError where they are singular to working precision. The
        equations are Newton and Euler of the three bars about O2. One of the drive acts
        as `unit`.
        """
        columns = []
        O2, A, O4 = (self.first_pin[bar] for bar in MOVING_BARS)
        places = {"F12": O2, "F32": A, "F43": O4 + self.tip[4], "F14": O4}
        for name, place in places.items():
            from_bar, on_bar = FORCE_BETWEEN[name]
            for direction in (acb(1), acb(0, 1)):
                one = _Wrenches()
                one.push(on_bar, direction, place)
                one.push(from_bar, -direction, place)
                columns.append(one.components())
        columns.append(unit.components())
        acting = self.sum_acting()
        for bar, centre in self.centre.items():
            inertia = self.x[f"m{bar}"] * self.acceleration((bar, centre))
            acting.push(bar, -inertia, centre)
            acting.moment[bar] -= self.x[f"I{bar}"] * self.alpha[bar]
        right = arb_mat(9, 1, [-component for component in acting.components()])
        *forces, driving = arb_mat(columns).transpose().solve(right).entries()
        vectors = map(acb, forces[::2], forces[1::2])
        return dict(zip(places, vectors, strict=True)), driving


_TERMS: dict[str, Callable[[_Loop, _Wrenches, Any], None]] = {
    "gravity": _Loop.add_gravity,
    "viscous": _Loop.add_damping,
    "friction": _Loop.add_friction,
    "flywheel": _Loop.add_flywheel,
    "torsion": _Loop.add_torsion,
    "springs": _Loop.add_springs,
}
"""What adds the wrenches of an effect, by the effect's key."""


class Responses:
    """How far each output at one position moves as inputs do."""

    def __init__(self, scene: Scene, branch: int, inputs: BallValues) -> None:
        self.scene = scene
        self.branch = branch
        self.inputs = inputs
        self.step = arb(2) ** -STEP_BITS
        self.base = self.move()
        """The outputs; None where the loop does not close."""

    def move(self, **changed: Ball) -> BallValues | None:
        """Compute the outputs at changed inputs."""
        return compute_outputs(self.scene, self.branch, self.inputs | changed)

    def add(self, total: Sizes, **changed: Ball) -> bool:
        """Add how far each output moves with changed inputs, in parts of 2^-STEP_BITS.

        An output that becomes singular moves infinitely far. False where the loop does
        not close.
        """
        moved = self.move(**changed)
        if moved is None or self.base is None:
            return False
        for output, y in self.base.items():
            rate = math.inf
            if output in moved:
                change = abs(moved[output] - y)
                if output.startswith("theta") and change > 3:
                    change = 2 * arb.pi() - change
                rate = abs(float((change / self.step).mid()))
            total[output] = total.get(output, 0.0) + rate
        return True

    def add_of_inputs(self, total: Sizes, weights: Sizes) -> None:
        """Add how far each output moves as each input moves by its weight.

        The side is one on which the loop closes.
        """
        for name, weight in weights.items():
            step = weight * self.step
            value = self.inputs[name]
            if not self.add(total, **{name: value + step}):
                self.add(total, **{name: value - step})


class BallArithmetic:
    """Every compared quantity at each position, rounded once from 320 bits."""

    name = "ball-arithmetic"

    def answer(self, scene: Scene, command: Command) -> Answer:
        """Answer, or refuse by naming an effect that it does not know."""
        if reason := find_unknown(scene, lambda effect: effect.in_balls):
            return Answer(self.name, "exact", refusal=reason)
        names = [
            q
            for q in COMPARED_QUANTITIES
            if command.omega_2 is not None or q.startswith("theta")
        ]
        stated = make_balls(scene, 0.0)
        remainder = arb(0 if command.remainder is None else command.remainder)

        def read(
            theta: float, branch: int, speed: float, acceleration: float
        ) -> dict[str, Any] | None:
            moved = {"theta_2": arb(theta) + remainder, "omega_2": arb(speed)}
            moved["alpha_2"] = arb(acceleration)
            balls = compute_outputs(scene, branch, stated | moved)
            if balls is None:
                return None
            values: dict[str, Any] = {
                name: float(ball.mid()) for name, ball in balls.items()
            }
            for name in VECTORS:
                if f"{name}_x" in values:
                    values[name] = values[f"{name}_x"], values[f"{name}_y"]
            return values

        out, assembled = read_each(command, names, read)
        return Answer(
            self.name,
            "exact",
            at=command,
            assembled=assembled,
            quantities=out,
            shared=SHARED_BY_EXACT_ENGINES,
            own=(
                "closure as a complex quadratic, linear speeds and accelerations,"
                " nine Newton-Euler equations"
            ),
        )


def compute_exact_sines(linkage: FourBar, command: Command) -> Array:
    """Compute sin(theta_4 - theta_3) of each position in many digits, (n,).

    The lengths are those that were stated. NaN where the loop does not close.
    """
    ctx.prec = BITS
    x = make_ball_lengths(linkage)
    x["theta_1"] = arb(linkage.ground_angle)

    def read(theta: float, branch: int, *_: float) -> Sizes | None:
        closed = compute_directions(x | {"theta_2": arb(theta)}, branch)
        if closed is None:
            return None
        # bars 3 and 4 have no direction if A is on O4
        return {"sin_mu": np.nan_to_num(float(wedge(*closed[1:]).mid()))}

    out, _ = read_each(command, ["sin_mu"], read)
    return out["sin_mu"]


def shift_to(
    linkage: FourBar,
    theta_2: float,
    sin_mu: float,
) -> Any:
    """Return the shift of theta_2 in rad at which sin(theta_4 - theta_3) is +-sin_mu.

    The shift is a number of mpmath, None if it is beyond rounding. The diagonal e from
    A to O4 has

        e^2 = d^2 + a^2 - 2 a d cos(theta_2 - theta_1) = b^2 + c^2 -+ 2 b c cos(mu).
    """
    from mpmath import mp, mpf

    with mp.workdps(WORKING_DIGITS):
        d, a, b, c = map(mpf, linkage.lengths)
        theta_1 = mpf(linkage.ground_angle)
        cos_mu = mp.sqrt(max(1 - mpf(sin_mu) ** 2, 0))
        nearest = mp.inf
        for side, sign in product((2 * b * c, -2 * b * c), (1, -1)):
            cosine = (d * d + a * a - b * b - c * c + side * cos_mu) / (2 * a * d)
            if abs(cosine) <= 1:
                shift = theta_1 + sign * mp.acos(cosine) - theta_2
                shift -= 2 * mp.pi * mp.nint(shift / (2 * mp.pi))
                nearest = min(nearest, shift, key=abs)
        largest = max(1.0, abs(theta_2), abs(linkage.ground_angle))
        return nearest if abs(nearest) <= RANDOM_WALK * EPS * largest else None
