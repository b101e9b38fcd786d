"""The linkage in ball arithmetic.

Every output of `solve` has 50 digits and a rigorous radius. Shares nothing with the
formulas: the loop is closed by the complex quadratic in e^{i theta_3}, the velocities
and accelerations come from the linear systems of the differentiated loop, the pin
forces and the torque from the full thirteen Newton-Euler equations about the mass
centres.
"""

import math
from bisect import bisect
from collections.abc import Callable
from typing import Any, TypeAlias

import numpy as np
from flint import acb, arb, arb_mat, ctx, fmpq

from fourbar.effects import Load, Place, PointDrive, Table
from fourbar.linkage import MOVING_BARS, PINS, FourBar
from fourbar.scene import Scene
from fourbar_validation.compare.pins import find_centre, find_inertia, find_mass
from fourbar_validation.engines.description import find_stated_lengths

Ball: TypeAlias = Any
ComplexBall: TypeAlias = Any
"""A vector of the plane, x + i y, of two balls."""
BallValues: TypeAlias = dict[str, Ball]
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
LINE_ENDS = ("from", "to")
"""Names of the points between which a linear drive acts."""
COMMANDED_FIRST = {
    2: ("a", "b", "c"),
    3: ("b", "a", "c"),
    4: ("c", "b", "a"),
}
"""Lengths of the commanded bar and of the two others, by the commanded bar."""
FORCE_COLUMNS = {"F12": 0, "F32": 2, "F43": 6, "F14": 8}
"""Columns of the unknown pin forces; each bar has those at its first and at its second
pin, and that of the drive is the last.
"""
REACTIONS = ((2, 4), (3, 5), (6, 10), (7, 11))
"""Columns of forces that are opposite: F32 and F23 at A, F43 and F34 at B, x and y."""
STEP_BITS = 90
"""Sensitivities are difference quotients with a relative step of 2^-90: wrong by about
2^-90 / (distance to the nearest singular position), and the cancelled 90 bits are there
to lose.
"""


def collect_inputs(scene: Scene, angle: float) -> BallValues:
    """Collect the stored doubles that the outputs at one position depend on, as balls.

    The position is of the commanded angle. What acts is evaluated once, with all bars
    laid down along +x, and takes its numbers on the way.
    """
    link = scene.linkage
    names = ("d", "a", "b", "c", "theta_1", *scene.motion.names)
    omega, alpha = scene.motion.find_rates(np.array([angle]))
    rates = (0.0 if rate is None else np.ravel(rate)[0] for rate in (omega, alpha))
    stored = (*link.lengths, link.ground_angle, angle, *rates)
    loop = _Loop(scene, dict(zip(names, map(arb, stored), strict=True)))
    loop.pose(dict.fromkeys(MOVING_BARS, acb(1)))
    loop.omega = loop.alpha = dict.fromkeys(loop.w, arb(0))
    loop.sum_acting()
    return loop.x


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
    """Give the inputs as balls of no radius, and set the working precision.

    omega_2 or alpha_2 are replaced where they are given.
    """
    ctx.prec = BITS
    replaced = {name: arb(value) for name, value in motion.items()}
    stated = make_ball_lengths(scene.linkage)
    return collect_inputs(scene, angle) | replaced | stated


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
        forces, driving = loop.solve_thirteen(unit)
    except ZeroDivisionError:
        return y
    _put_vectors(y, forces)
    y["torque" if scene.drive is None else "drive_force"] = driving
    y["power"] = driving * unit.power(loop.v_pin, loop.omega)
    return y


def _put_vectors(y: BallValues, vectors: dict[str, ComplexBall]) -> None:
    """Put vectors by their components."""
    for name, vector in vectors.items():
        y[f"{name}_x"] = vector.real
        y[f"{name}_y"] = vector.imag


class _Wrenches:
    """Force, and moment about the mass centre, that act on each bar.

    The ground bears all. `centre`: vectors from the first pins to the mass centres.
    """

    def __init__(self, centre: dict[int, ComplexBall]) -> None:
        self.centre = centre
        self.force: dict[int, ComplexBall] = dict.fromkeys(centre, acb(0))
        self.moment: dict[int, Ball] = dict.fromkeys(centre, arb(0))

    def push(self, bar: int, force: ComplexBall, arm: ComplexBall) -> None:
        """Add a force at an arm from the first pin."""
        self.force[bar] += force
        self.moment[bar] += wedge(arm - self.centre[bar], force)

    def twist(self, pin: str, couple: Ball) -> None:
        """Add a couple to bar j of a pin (i, j), its opposite to bar i."""
        i, j = PINS[pin]
        self.moment[j] += couple
        self.moment[i] -= couple

    def power(self, v_pin: dict[int, ComplexBall], omega: dict[int, Ball]) -> Ball:
        """Return the power at velocities of the first pins and angular speeds."""
        total = arb(0)
        for bar in MOVING_BARS:
            velocity = v_pin[bar] + acb(0, omega[bar]) * self.centre[bar]
            total += (self.force[bar].conjugate() * velocity).real
            total += self.moment[bar] * omega[bar]
        return total

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

    w: dict[int, ComplexBall]
    """Unit vectors along the bars."""
    sines: dict[int, Ball]
    """Sine between the two other moving bars, by bar; 3 and 4 turn by it over their
    lengths where 2 turns by its own.
    """
    tip: dict[int, ComplexBall]
    """Vectors from the first pin to the second."""
    first_pin: dict[int, ComplexBall]
    """Places of the first pins."""
    centre: dict[int, ComplexBall]
    """Vectors from the first pin to the mass centre."""
    omega: dict[int, Ball]
    alpha: dict[int, Ball]
    v_pin: dict[int, ComplexBall]
    a_pin: dict[int, ComplexBall]
    """Velocities and accelerations of the first pins."""

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
        ends = zip(LINE_ENDS, () if drive is None else drive.ends, strict=False)
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

    def pose(self, w: dict[int, ComplexBall]) -> None:
        """Place the bars along unit vectors."""
        x = self.x
        self.w = {1: polar_ball(arb(1), x["theta_1"]), **w}
        self.sines = {2: wedge(w[3], w[4]), 3: wedge(w[4], w[2]), 4: wedge(w[3], w[2])}
        self.tip = {2: x["a"] * w[2], 3: x["b"] * w[3], 4: x["c"] * w[4]}
        ground = polar_ball(x["d"], x["theta_1"])
        self.first_pin = {1: acb(0), 2: acb(0), 3: self.tip[2], 4: ground}
        self.centre = {bar: w[bar] * self.to_centre[bar] for bar in MOVING_BARS}
        self.centre[1] = acb(0)

    def lay(self, spots: list[Spot]) -> tuple[list[Spot], ComplexBall]:
        """Return bar and arm from the first pin of each place.

        The vector from the first place to the last is returned too.
        """
        arms = [(bar, self.w[bar] * offset) for bar, offset in spots]
        places = [self.first_pin[bar] + arm for bar, arm in arms]
        return arms, places[-1] - places[0]

    def move(self, commanded: int) -> None:
        """Move the bars: two linear systems of the differentiated loop."""
        x = self.x
        zero = acb(0)
        side = self.tip | {4: -self.tip[4]}  # the loop is gone round
        first, second = (bar for bar in MOVING_BARS if bar != commanded)
        across = wedge(side[first], side[second])

        def rates(stated: Ball, total: ComplexBall) -> dict[int, Ball]:
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
        self.v_pin = dict.fromkeys(self.w, zero)
        self.a_pin = dict.fromkeys(self.w, zero)
        self.v_pin[3] = self.turn(2, self.tip[2])
        self.a_pin[3] = self.swing(2, self.tip[2])

    def turn(self, bar: int, arm: ComplexBall) -> ComplexBall:
        """Return the velocity of a point of a bar against its first pin."""
        return acb(0, self.omega[bar]) * arm

    def swing(self, bar: int, arm: ComplexBall) -> ComplexBall:
        """Return the acceleration of a point of a bar against its first pin."""
        return acb(-self.omega[bar] * self.omega[bar], self.alpha[bar]) * arm

    def points(self) -> dict[str, ComplexBall]:
        """Return places, velocities and accelerations of the points, by name.

        The points are those that are answered.
        """
        arms = {"A": (2, self.tip[2]), "B": (4, self.tip[4])}
        arms |= {f"G{bar}": (bar, self.centre[bar]) for bar in MOVING_BARS}
        points = {}
        for name, (bar, arm) in arms.items():
            points[name] = self.first_pin[bar] + arm
            points[f"v_{name}"] = self.v_pin[bar] + self.turn(bar, arm)
            points[f"a_{name}"] = self.a_pin[bar] + self.swing(bar, arm)
        return points

    def sum_acting(self) -> _Wrenches:
        """Sum what acts on each bar."""
        on = _Wrenches(self.centre)
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
            to_force = self.polar(load.arm, f"at_{k}")
            arm = self.centre[bar] + to_force
        elif load.force is not None:
            assert load.place is not None
            _, offset = self.spot(load.place, f"at_{k}")
            arm = self.w[bar] * offset
        else:
            return
        axes = self.w[bar] if load.frame == "bar" else 1
        on.push(bar, factor * axes * force, arm)

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
            ends = (spring.start, f"start_{k}"), (spring.end, f"end_{k}")
            arms, across = self.lay([self.spot(*end) for end in ends])
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
            for (bar, arm), force in zip(arms, (pull, -pull), strict=True):
                on.push(bar, force, arm)

    def evaluate_drive(self, y: BallValues) -> _Wrenches:
        """Return what one N m or one N of the drive does to the bars.

        The drive's condition and, of a drive along a line, its motion are put into `y`.
        The condition is |P|/L. P is the stroke's speed with (sin mu, (a/b) sin(theta_2
        - theta_4), (a/c) sin(theta_2 - theta_3)). L is the sum of what each end could
        move: r on bar 2, a + r a/b on bar 3, r a/c on bar 4.
        """
        scene = self.scene
        drive = scene.drive
        unit = _Wrenches(self.centre)
        if drive is None:
            y["drive_condition"] = abs(self.sines[scene.drive_bar])
            unit.moment[scene.drive_bar] = arb(1)
            return unit
        arms, line = self.lay(self.ends)
        if isinstance(drive, PointDrive):
            line = polar_ball(arb(1), self.x["direction"])
            if drive.frame == "bar":
                line *= self.w[drive.place.bar]
        else:
            y["stroke"] = abs(line)
            line /= y["stroke"]
        for (sense, _), (bar, arm) in zip(drive.ends, arms, strict=True):
            unit.push(bar, int(sense) * line, arm)
        a = self.x["a"]
        per_turn = {2: arb(1), 3: a / self.x["b"], 4: a / self.x["c"]}
        turning = {bar: per_turn[bar] * self.sines[bar] for bar in MOVING_BARS}
        foot = {2: acb(0), 3: acb(0, turning[2]) * self.tip[2], 4: acb(0)}
        reach = arb(0)
        for bar, arm in arms:
            if bar != 1:
                reach += per_turn[bar] * abs(arm) + (a if bar == 3 else 0)
        y["drive_condition"] = abs(unit.power(foot, turning)) / reach
        y["stroke_speed"] = unit.power(self.v_pin, self.omega)
        _put_vectors(y, {"drive_line": line})
        return unit

    def solve_thirteen(self, unit: _Wrenches) -> tuple[dict[str, ComplexBall], Ball]:
        """Solve for pin forces, complex, N, and the drive, N m or N, at one position.

        Raises ZeroDivisionError where they are singular to working precision. Unknowns
        are F12 F32 F23 F43 F14 F34 (x, y each) and the drive, of which one acts as
        `unit`. Equations are Newton and Euler about each mass centre, then action and
        reaction at A and B.
        """
        columns = []
        needed = _Wrenches(self.centre)
        acting = self.sum_acting()
        for bar in MOVING_BARS:
            for arm in (acb(0), self.tip[bar]):
                for direction in (acb(1), acb(0, 1)):
                    alone = _Wrenches(self.centre)
                    alone.push(bar, direction, arm)
                    columns.append([*alone.components(), 0, 0, 0, 0])
            acceleration = self.a_pin[bar] + self.swing(bar, self.centre[bar])
            needed.force[bar] = self.x[f"m{bar}"] * acceleration - acting.force[bar]
            moment = self.x[f"I{bar}"] * self.alpha[bar]
            needed.moment[bar] = moment - acting.moment[bar]
        for row, (action, reaction) in enumerate(REACTIONS, start=9):
            columns[action][row] = columns[reaction][row] = 1
        columns.append([*unit.components(), 0, 0, 0, 0])
        right = arb_mat(13, 1, [*needed.components(), 0, 0, 0, 0])
        solved = arb_mat(columns).transpose().solve(right)
        forces = {}
        for name, column in FORCE_COLUMNS.items():
            forces[name] = acb(solved[column, 0], solved[column + 1, 0])
        return forces, solved[12, 0]


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

    def add(self, total: dict[str, float], **changed: Ball) -> bool:
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

    def add_of_inputs(self, total: dict[str, float], weights: dict[str, float]) -> None:
        """Add how far each output moves as each input moves by its weight.

        The side is one on which the loop closes.
        """
        for name, weight in weights.items():
            step = weight * self.step
            value = self.inputs[name]
            if not self.add(total, **{name: value + step}):
                self.add(total, **{name: value - step})
