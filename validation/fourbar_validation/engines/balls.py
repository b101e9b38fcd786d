"""The linkage in ball arithmetic.

Every output of `solve` has 50 digits and a rigorous radius. Shares nothing with the
formulas: the loop is closed by the complex quadratic in e^{i theta_3}, the velocities
and accelerations come from the linear systems of the differentiated loop, the pin
forces and the torque from the full thirteen Newton-Euler equations about the mass
centres.
"""

import math
from bisect import bisect
from typing import Any, NamedTuple, TypeAlias

from flint import acb, arb, arb_mat, ctx

from fourbar.effects import (
    Flywheel,
    Friction,
    Gravity,
    LinearDrive,
    Place,
    PointDrive,
    Springs,
    Table,
    Torsion,
    Viscous,
)
from fourbar.linkage import MOVING_BARS, PINS
from fourbar.scene import Scene
from fourbar_validation.compare.pins import find_centre, find_inertia, find_mass

Ball: TypeAlias = Any
ComplexBall: TypeAlias = Any
"""A vector of the plane, x + i y, of two balls."""
BallValues: TypeAlias = dict[str, Ball]


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


def dot_product(u: ComplexBall, v: ComplexBall) -> Ball:
    """Return u_x v_x + u_y v_y."""
    return (u.conjugate() * v).real


BITS = 320
"""Working precision. 50 digits are 167 bits; the rest is what the worst sample (a limit
position at 1e-20) cancels.
"""
OF_PIECE = ("table_start", "table_stop", "table_first", "table_last")
"""Angles and factors of the piece of a load's table that a position is in."""
LINE_ENDS = ("from", "to")
"""Names of the points between which a linear drive acts."""
STEP_BITS = 90
"""Sensitivities are difference quotients with a relative step of 2^-90: wrong by about
2^-90 / (distance to the nearest singular position), and the cancelled 90 bits are there
to lose.
"""


def collect_inputs(scene: Scene, angle: float) -> dict[str, float]:
    """Collect the stored doubles that the outputs at one position depend on.

    The position is of the commanded angle.
    """
    link = scene.linkage
    motion = scene.motion
    d, a, b, c = link.lengths
    values = {"d": d, "a": a, "b": b, "c": c, "theta_1": link.ground_angle}
    values |= dict(
        zip(
            motion.names,
            (angle, motion.speed or 0.0, motion.acceleration),
            strict=True,
        )
    )
    if scene.drive is not None:
        for name, (_, point) in zip(LINE_ENDS, scene.drive.ends, strict=False):
            values |= _collect_place(scene, point, name, f"{name}_angle")
        if isinstance(scene.drive, PointDrive):
            values["direction"] = scene.drive.direction
    for k in MOVING_BARS:
        bar = link.bar(k)
        values |= {f"m{k}": find_mass(bar), f"I{k}": find_inertia(bar)}
        values[f"r{k}"], values[f"phi{k}"] = find_centre(bar)
    for k, load in enumerate(scene.loads):
        f, f_angle = load.force or (0.0, 0.0)
        values |= {f"F_{k}": f, f"F_angle_{k}": f_angle, f"M_{k}": load.moment}
        if load.arm is not None:
            values |= {f"at_{k}": load.arm[0], f"at_angle_{k}": load.arm[1]}
        elif load.place is not None:
            values |= _collect_place(scene, load.place, f"at_{k}", f"at_angle_{k}")
    for effect in scene.effects:
        if isinstance(effect, Gravity):
            values |= {"g": effect.magnitude, "g_angle": effect.angle}
        elif isinstance(effect, Viscous):
            values |= {f"viscous_{pin}": value for pin, value in effect.coefficients}
        elif isinstance(effect, Friction):
            values |= {f"friction_{pin}": value for pin, value in effect.torques}
        elif isinstance(effect, Flywheel):
            values["J"] = effect.inertia
        elif isinstance(effect, Torsion):
            for pin, stiffness, rest, preload in effect.springs:
                values |= {
                    f"torsion_{pin}": stiffness,
                    f"rest_{pin}": rest,
                    f"wound_{pin}": preload,
                }
        elif isinstance(effect, Springs):
            for k, spring in enumerate(effect.springs):
                values |= {
                    f"stiffness_{k}": spring.stiffness,
                    f"length_{k}": spring.length,
                }
                values[f"pull_{k}"] = spring.preload
                for end, point in (("start", spring.start), ("end", spring.end)):
                    keys = f"{end}_{k}", f"{end}_angle_{k}"
                    values |= _collect_place(scene, point, *keys)
        else:
            raise NotImplementedError(
                f"the reference knows no effect {type(effect).__name__}"
            )
    return values


def find_stated(scene: Scene, place: Place) -> Place:
    """Return a place by its numbers: of a named point, the point's."""
    if place.point is None:
        return place
    return next(point.place for point in scene.points if point.name == place.point)


def _collect_place(
    scene: Scene,
    place: Place,
    distance: str,
    angle: str,
) -> dict[str, float]:
    """Collect the two numbers that state a place, under two names."""
    stated = find_stated(scene, place)
    if stated.from_pin is None:
        pair = stated.from_centre
    else:
        pair = stated.from_pin
    assert pair is not None
    return {distance: pair[0], angle: pair[1]}


def _place_from_pin(
    stated: Place,
    distance: Ball,
    angle: Ball,
    w: dict[int, ComplexBall],
    centre: dict[int, ComplexBall],
) -> ComplexBall:
    """Return the vector from a bar's first pin to a place on it.

    Two numbers state the place.

    `w`: directions of the bars; `centre`: vectors from their first pins to G.
    """
    arm = w[stated.bar] * polar_ball(distance, angle)
    if stated.from_centre is None:
        return arm
    return centre[stated.bar] + arm


def make_balls(scene: Scene, angle: float, **motion: float) -> BallValues:
    """Give the inputs as balls of no radius, and set the working precision.

    omega_2 or alpha_2 are replaced where they are given.
    """
    ctx.prec = BITS
    return {
        name: arb(value)
        for name, value in (collect_inputs(scene, angle) | motion).items()
    }


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
    bar = _find_commanded(x)
    d = x["d"]
    held, b, c = {2: ("a", "b", "c"), 3: ("b", "a", "c"), 4: ("c", "b", "a")}[bar]
    held = x[held]
    b = x[b]
    c = x[c]
    side = 1 if bar == 4 else -1
    w = polar_ball(arb(1), x[f"theta_{bar}"])
    D = polar_ball(d, x["theta_1"]) + side * held * w
    # |D|^2 by the angle between ground and input: where they are in line it is exact,
    # and so is a loop that just closes
    squared = (
        d**2 + held**2 + side * 2 * d * held * (x[f"theta_{bar}"] - x["theta_1"]).cos()
    )
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


def _find_commanded(x: BallValues) -> int:
    """Return the bar whose angle is among the inputs."""
    return next(bar for bar in MOVING_BARS if f"theta_{bar}" in x)


def _solve_linear(rows: list[list[Ball]], right: list[Ball]) -> list[Ball]:
    """Solve a linear system rigorously.

    Raises ZeroDivisionError where it is singular to working precision.
    """
    solution = arb_mat(rows).solve(arb_mat([[value] for value in right]))
    return [solution[k, 0] for k in range(len(right))]


def compute_outputs(scene: Scene, branch: int, inputs: BallValues) -> BallValues | None:
    """Compute every output at one position as balls.

    Vectors are name_x, name_y; None if the loop does not close.
    """
    if "stroke" in inputs:
        x = _turn_by_stroke(scene, inputs)
    else:
        x = inputs
    if x is None:
        directions = None
    else:
        directions = compute_directions(x, branch)
    if x is None or directions is None:
        return None
    w = dict(zip(MOVING_BARS, directions, strict=True))
    commanded = _find_commanded(x)
    sines = {2: wedge(w[3], w[4]), 3: wedge(w[2], w[4]), 4: wedge(w[2], w[3])}
    y: BallValues = {
        f"theta_{bar}": w[bar].arg()
        for bar in MOVING_BARS
        if f"theta_{bar}" not in inputs
    }
    y |= {"sin_mu": sines[2], "condition": abs(sines[commanded]) * x.get("lever", 1)}
    if (
        not y["condition"] > 0
    ):  # singular; NaN where A lies on O4, about which bars 3 and 4 then turn freely
        return y
    bars = _move_balls(x, w, commanded)
    y |= {f"omega_{bar}": bars.omega[bar] for bar in MOVING_BARS}
    y |= {f"alpha_{bar}": bars.alpha[bar] for bar in MOVING_BARS}
    _put_vectors(y, bars.points())
    if scene.drive:
        line = _find_line(scene, x, bars)
    else:
        line = None
    if line is None:
        drive, y["drive_condition"], speed = (
            "torque",
            abs(sines[scene.drive_bar]),
            bars.omega[scene.drive_bar],
        )
    else:
        drive, y["drive_condition"] = (
            "drive_force",
            _compute_condition(line, x, bars.tip[2], sines),
        )
        speed = line.speed({1: acb(0), **bars.v_pin}, {1: arb(0), **bars.omega})
        y["stroke_speed"] = speed
        if line.stroke is not None:
            y["stroke"] = line.stroke
        _put_vectors(y, {"drive_line": line.line})
    drives = {bar: (arb(0), arb(0), arb(bar == scene.drive_bar)) for bar in MOVING_BARS}
    if line is not None:
        drives = {bar: line.push(bar, bars.centre[bar]) for bar in MOVING_BARS}
    try:
        forces, driving = _solve_thirteen_balls(
            x, bars, *_sum_acting_balls(scene, x, bars), drives
        )
    except ZeroDivisionError:
        return y
    _put_vectors(y, forces)
    y[drive], y["power"] = driving, driving * speed
    return y


class _BallBars(NamedTuple):
    """Bars 2, 3 and 4 in motion at one position.

    They have directions, rates, and vectors of the plane.
    """

    w: dict[int, ComplexBall]
    """Unit vectors along the bars."""
    omega: dict[int, Ball]
    alpha: dict[int, Ball]
    tip: dict[int, ComplexBall]
    """Vectors from the first pin to the second."""
    first_pin: dict[int, ComplexBall]
    """Places of the first pins, the ground's too."""
    centre: dict[int, ComplexBall]
    """Vectors from the first pin to the mass centre."""
    v_pin: dict[int, ComplexBall]
    a_pin: dict[int, ComplexBall]
    """Velocities and accelerations of the first pins."""

    def turn(self, bar: int, arm: ComplexBall) -> ComplexBall:
        """Return the velocity of a point of a bar against its first pin."""
        return acb(0, self.omega[bar]) * arm

    def swing(self, bar: int, arm: ComplexBall) -> ComplexBall:
        """Return the acceleration of a point of a bar against its first pin."""
        return acb(-self.omega[bar] * self.omega[bar], self.alpha[bar]) * arm

    def acceleration(self, bar: int) -> ComplexBall:
        """Return the acceleration of a mass centre."""
        return self.a_pin[bar] + self.swing(bar, self.centre[bar])

    def directions(self, x: BallValues) -> dict[int, ComplexBall]:
        """Return the unit vectors along all bars, the ground's too."""
        return {1: polar_ball(arb(1), x["theta_1"]), **self.w}

    def points(self) -> dict[str, ComplexBall]:
        """Return places, velocities and accelerations of the points, by name.

        The points are those that are answered.
        """
        points = {"A": self.tip[2], "B": self.first_pin[4] + self.tip[4]}
        points |= {"v_A": self.v_pin[3], "v_B": self.turn(4, self.tip[4])}
        points |= {"a_A": self.a_pin[3], "a_B": self.swing(4, self.tip[4])}
        for bar in MOVING_BARS:
            points[f"G{bar}"] = self.first_pin[bar] + self.centre[bar]
            points[f"v_G{bar}"] = self.v_pin[bar] + self.turn(bar, self.centre[bar])
            points[f"a_G{bar}"] = self.acceleration(bar)
        return points


def _move_balls(x: BallValues, w: dict[int, ComplexBall], commanded: int) -> _BallBars:
    """Move the bars: two linear systems of the differentiated loop."""
    a = x["a"]
    b = x["b"]
    c = x["c"]
    zero = acb(0)
    side = {2: a * w[2], 3: b * w[3], 4: -c * w[4]}  # sides of the loop
    first, second = (bar for bar in MOVING_BARS if bar != commanded)

    def rates(stated: Ball, total: ComplexBall) -> dict[int, Ball]:
        """Solve for the rates of the other bars.

        The sum of i side rate is `total`.
        """
        u = acb(0, 1) * side[first]
        v = acb(0, 1) * side[second]
        rest = total - acb(0, stated) * side[commanded]
        solved = _solve_linear(
            [[u.real, v.real], [u.imag, v.imag]], [rest.real, rest.imag]
        )
        return {commanded: stated, **dict(zip((first, second), solved, strict=True))}

    # a probe opens the loop by slip, m/s, and jerk, m/s^2
    omega = rates(x[f"omega_{commanded}"], x.get("slip", zero))
    centripetal = sum((side[bar] * square(omega[bar]) for bar in MOVING_BARS), zero)
    alpha = rates(x[f"alpha_{commanded}"], x.get("jerk", zero) + centripetal)
    tip = {2: a * w[2], 3: b * w[3], 4: c * w[4]}
    first_pin = {1: zero, 2: zero, 3: tip[2], 4: polar_ball(x["d"], x["theta_1"])}
    centre = {
        bar: w[bar] * polar_ball(x[f"r{bar}"], x[f"phi{bar}"]) for bar in MOVING_BARS
    }
    v_A = acb(0, omega[2]) * tip[2]
    a_A = acb(-omega[2] * omega[2], alpha[2]) * tip[2]
    at_rest = {2: zero, 4: zero}
    return _BallBars(
        w, omega, alpha, tip, first_pin, centre, at_rest | {3: v_A}, at_rest | {3: a_A}
    )


def _sum_acting_balls(
    scene: Scene,
    x: BallValues,
    bars: _BallBars,
) -> tuple[dict[int, ComplexBall], dict[int, Ball]]:
    """Sum what acts on each bar: a force, and a moment about the mass centre."""
    w, first_pin, centre = bars.directions(x), bars.first_pin, bars.centre
    force = {
        bar: x[f"m{bar}"] * polar_ball(x["g"], x["g_angle"]) if "g" in x else acb(0)
        for bar in MOVING_BARS
    }
    moment = {
        bar: x.get(f"couple_{bar}", arb(0)) for bar in MOVING_BARS
    }  # a probe may add one
    for k, load in enumerate(scene.loads):
        theta_2 = x.get("theta_2", w[2].arg())
        factor = (
            _interpolate_factor(load.table, theta_2, x, k) if load.table else arb(1)
        )
        moment[load.bar] += factor * x[f"M_{k}"]
        if load.force is None:
            continue
        axes = w[load.bar] if load.frame == "bar" else acb(1)
        f = axes * polar_ball(x[f"F_{k}"], x[f"F_angle_{k}"])
        if load.arm is not None:
            arm = polar_ball(x[f"at_{k}"], x[f"at_angle_{k}"])
        else:
            assert load.place is not None
            stated = find_stated(scene, load.place)
            at = x[f"at_{k}"], x[f"at_angle_{k}"]
            arm = _place_from_pin(stated, *at, w, centre) - centre[load.bar]
        force[load.bar] += factor * f
        moment[load.bar] += factor * wedge(arm, f)
    for effect in scene.effects:
        if isinstance(effect, Flywheel):
            moment[effect.bar] -= x["J"] * bars.alpha[effect.bar]
        elif isinstance(effect, Torsion):
            for pin, *_ in effect.springs:
                i, j = PINS[pin]
                turned = (
                    w[j] * w[i].conjugate() * polar_ball(arb(1), -x[f"rest_{pin}"])
                ).arg()
                _add_twist(
                    moment, pin, -x[f"wound_{pin}"] - x[f"torsion_{pin}"] * turned
                )
        elif isinstance(effect, Springs):
            for k, spring in enumerate(effect.springs):
                start, end = spring.start.bar, spring.end.bar
                ends = ((spring.start, "start"), (spring.end, "end"))
                arms = [
                    _place_from_pin(
                        find_stated(scene, place),
                        x[f"{name}_{k}"],
                        x[f"{name}_angle_{k}"],
                        bars.directions(x),
                        centre,
                    )
                    for place, name in ends
                ]
                across = first_pin[end] + arms[1] - first_pin[start] - arms[0]
                if (
                    spring.preload == spring.stiffness * spring.length
                ):  # k times the distance, wherever that ends
                    pull = x[f"stiffness_{k}"] * across
                else:
                    distance = abs(across)
                    tension = x[f"pull_{k}"] + x[f"stiffness_{k}"] * (
                        distance - x[f"length_{k}"]
                    )
                    pull = tension / distance * across
                for bar, arm, f in ((start, arms[0], pull), (end, arms[1], -pull)):
                    if bar in force:
                        force[bar] += f
                        moment[bar] += wedge(arm - centre[bar], f)
    for pin, (i, j) in PINS.items():
        slip = bars.omega.get(j, 0) - bars.omega.get(i, 0)
        sign = (
            arb(1)
            if slip > 0
            else arb(-1)
            if slip < 0
            else arb(0)
            if slip == 0
            else arb(0, 1)
        )
        couple = (
            -x.get(f"viscous_{pin}", arb(0)) * slip
            - x.get(f"friction_{pin}", arb(0)) * sign
        )
        _add_twist(moment, pin, couple)
    return force, moment


def _solve_thirteen_balls(
    x: BallValues,
    bars: _BallBars,
    force: dict[int, ComplexBall],
    moment: dict[int, Ball],
    drives: dict[int, tuple[Ball, Ball, Ball]],
) -> tuple[dict[str, ComplexBall], Ball]:
    """Solve for the pin forces and the driving torque or force.

    Raises ZeroDivisionError where they are singular. Unknowns F12 F32 F23 F43 F34 F14
    (x, y each) and the drive, whose force and moment on each bar, for one of it, are
    `drives`. Equations: Newton and Euler about each mass centre, then action and
    reaction at A and B.
    """
    at_pin = {bar: -bars.centre[bar] for bar in MOVING_BARS}
    at_tip = {bar: bars.tip[bar] - bars.centre[bar] for bar in MOVING_BARS}
    joints = {
        2: ((0, at_pin), (1, at_tip)),
        3: ((2, at_pin), (3, at_tip)),
        4: ((4, at_tip), (5, at_pin)),
    }
    matrix = [[arb(0)] * 13 for _ in range(13)]
    constants = []
    for n, bar in enumerate(MOVING_BARS):
        for column, arms in joints[bar]:
            arm = arms[bar]
            matrix[3 * n][2 * column] = matrix[3 * n + 1][2 * column + 1] = arb(1)
            matrix[3 * n + 2][2 * column], matrix[3 * n + 2][2 * column + 1] = (
                -arm.imag,
                arm.real,
            )
        for row, value in enumerate(drives[bar], start=3 * n):
            matrix[row][12] = value
        needed = x[f"m{bar}"] * bars.acceleration(bar) - force[bar]
        constants += [
            needed.real,
            needed.imag,
            x[f"I{bar}"] * bars.alpha[bar] - moment[bar],
        ]
    for row, (i, j) in enumerate(((2, 4), (3, 5), (6, 8), (7, 9)), start=9):
        matrix[row][i] = matrix[row][j] = arb(1)
        constants.append(arb(0))
    solved = _solve_linear(matrix, constants)
    columns = {"F12": 0, "F32": 1, "F43": 3, "F14": 5}
    return {
        name: acb(solved[2 * k], solved[2 * k + 1]) for name, k in columns.items()
    }, solved[12]


def _put_vectors(y: BallValues, vectors: dict[str, ComplexBall]) -> None:
    """Put vectors by their components."""
    for name, vector in vectors.items():
        y[f"{name}_x"], y[f"{name}_y"] = vector.real, vector.imag


def _add_twist(moment: dict[int, Ball], pin: str, couple: Ball) -> None:
    """Add a couple to bar j of a pin (i, j), its opposite to bar i.

    On the ground it does nothing.
    """
    i, j = PINS[pin]
    for bar, value in ((j, couple), (i, -couple)):
        if bar in moment:
            moment[bar] += value


def _interpolate_factor(table: Table, theta_2: Ball, x: BallValues, k: int) -> Ball:
    """Interpolate between the two points of a table that enclose an angle.

    The angle is taken modulo a turn. Where the inputs have them, the four numbers are
    multiplied by those of `OF_PIECE`.
    """
    turns = math.floor((float(theta_2.mid()) - table.theta_2[0]) / math.tau + 1e-12)
    angle = theta_2 - 2 * turns * arb.pi()
    after = min(
        max(bisect(table.theta_2, float(angle.mid())), 1), len(table.theta_2) - 1
    )
    piece = (
        *table.theta_2[after - 1 : after + 1],
        *table.factor[after - 1 : after + 1],
    )
    start, stop, first, last = (
        arb(value) * x.get(f"{name}_{k}", 1)
        for name, value in zip(OF_PIECE, piece, strict=True)
    )
    return first + (last - first) * (angle - start) / (stop - start)


def _turn_by_stroke(scene: Scene, x: BallValues) -> BallValues | None:
    """Add angle, speed and acceleration of the bar that a stroke turns.

    None if the triangle stays open.

    With l and r from the pin to the ends: s^2 = l^2 + r^2 - 2 l r cos beta, twice
    differentiated.
    """
    drive = scene.drive
    motion = scene.motion
    assert isinstance(drive, LinearDrive) and motion.side is not None
    (_, on_ground), (bar, on_bar) = sorted(
        zip((drive.start.bar, drive.end.bar), LINE_ENDS, strict=True)
    )
    stated = find_stated(scene, drive.start if drive.end.bar == 1 else drive.end)
    centre = {bar: polar_ball(x[f"r{bar}"], x[f"phi{bar}"])}
    at_zero = {bar: acb(1)}
    at = x[on_bar], x[f"{on_bar}_angle"]
    held = _place_from_pin(stated, *at, at_zero, centre)
    fixed = polar_ball(x[on_ground], x[f"{on_ground}_angle"] + x["theta_1"])
    if bar == 4:
        fixed -= polar_ball(x["d"], x["theta_1"])
    s = x["stroke"]
    speed = x["stroke_speed"]
    length = abs(held)
    reach = abs(fixed)
    cosine = (length**2 + reach**2 - s**2) / (2 * length * reach)
    if abs(cosine) > 1:
        return None
    beta = cosine.acos()
    side = (
        1 if motion.side == "left" else -1
    )  # to the left the stroke grows with the angle
    across = length * reach * beta.sin()
    along = length * reach * cosine
    rate = s * speed / across
    growth = (
        square(speed) + s * x["stroke_acceleration"] - along * square(rate)
    ) / across
    lever = across / s / (length if length > reach else reach)
    turned = {
        f"theta_{bar}": fixed.arg() - held.arg() + side * beta,
        f"omega_{bar}": side * rate,
    }
    return x | turned | {f"alpha_{bar}": side * growth, "lever": lever}


class _BallLine(NamedTuple):
    """Line of the drive between its two points, at one position of the linkage."""

    stroke: Ball | None
    """None of a force at a point."""
    line: ComplexBall
    """Unit vector from one point to the other."""
    arms: dict[int, ComplexBall]
    """Vectors from the first pin to the end, of the bars with an end."""
    sense: dict[int, int]
    """Sign of the drive's push along the line on each of these bars."""

    def speed(self, foot: dict[int, ComplexBall], omega: dict[int, Ball]) -> Ball:
        """Return ds/dt from the bars' angular speeds and their pins' speeds."""
        ends = (
            sense * (foot[k] + acb(0, omega[k]) * self.arms[k])
            for k, sense in self.sense.items()
        )
        return dot_product(self.line, sum(ends, acb(0)))

    def push(self, bar: int, centre: ComplexBall) -> tuple[Ball, Ball, Ball]:
        """Force (x, y) and moment about the mass centre of a bar, per newton."""
        if bar not in self.sense:
            return arb(0), arb(0), arb(0)
        force = self.sense[bar] * self.line
        return force.real, force.imag, wedge(self.arms[bar] - centre, force)


def _find_line(scene: Scene, x: BallValues, bars_in_motion: _BallBars) -> _BallLine:
    """Find the line of a drive from the directions and first pins of all bars.

    The ground's are among them.
    """
    drive = scene.drive
    first_pin = bars_in_motion.first_pin
    assert drive is not None
    w = bars_in_motion.directions(x)
    centre = bars_in_motion.centre
    arms = {
        place.bar: _place_from_pin(
            find_stated(scene, place), x[name], x[f"{name}_angle"], w, centre
        )
        for (_, place), name in zip(drive.ends, LINE_ENDS, strict=False)
    }
    if isinstance(drive, PointDrive):
        unit = polar_ball(arb(1), x["direction"])
        if drive.frame == "bar":
            unit = unit * w[drive.place.bar]
        return _BallLine(None, unit, arms, {drive.place.bar: 1})
    bars = [place.bar for _, place in drive.ends]
    start, end = (first_pin[k] + arms[k] for k in bars)
    stroke = abs(end - start)
    return _BallLine(
        stroke, (end - start) / stroke, arms, dict(zip(bars, (-1, 1), strict=True))
    )


def _compute_condition(
    line: _BallLine,
    x: BallValues,
    tip: ComplexBall,
    sines: dict[int, Ball],
) -> Ball:
    """Compute |P|/L.

    P is the stroke's speed with (sin mu, (a/b) sin(theta_2 - theta_4), (a/c)
    sin(theta_2 - theta_3)). L is the sum of what each end could move: r on bar 2, a + r
    a/b on bar 3, r a/c on bar 4, `tip` is A.
    """
    a = x["a"]
    b = x["b"]
    c = x["c"]
    turning = {1: arb(0), 2: sines[2], 3: -a / b * sines[3], 4: -a / c * sines[4]}
    foot = {1: acb(0), 2: acb(0), 3: acb(0, turning[2]) * tip, 4: acb(0)}
    most = {1: (0, 0), 2: (0, 1), 3: (a, a / b), 4: (0, a / c)}
    reach = sum(
        (most[k][0] + most[k][1] * abs(arm) for k, arm in line.arms.items()), arb(0)
    )
    return abs(line.speed(foot, turning)) / reach
