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

import numpy as np
from flint import acb, arb, arb_mat, ctx, fmpq

from fourbar.effects import (
    Effect,
    Flywheel,
    Friction,
    Gravity,
    LinearDrive,
    Place,
    PointDrive,
    Spring,
    Springs,
    Table,
    Torsion,
    Viscous,
)
from fourbar.linkage import MOVING_BARS, PINS, FourBar
from fourbar.scene import Scene
from fourbar_validation.compare.pins import find_centre, find_inertia, find_mass
from fourbar_validation.engines.description import find_stated_lengths

Ball: TypeAlias = Any
ComplexBall: TypeAlias = Any
"""A vector of the plane, x + i y, of two balls."""
BallValues: TypeAlias = dict[str, Ball]
_Pushes: TypeAlias = dict[int, tuple[Ball, Ball, Ball]]
"""Force (x, y) and moment about the mass centre, by bar, for one of the drive."""


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
    d, a, b, c = link.lengths
    values = {
        "d": d,
        "a": a,
        "b": b,
        "c": c,
        "theta_1": link.ground_angle,
    }
    motion = scene.motion
    position, speed, acceleration = motion.names
    omega, alpha = motion.find_rates(np.array([angle]))
    values |= {
        position: angle,
        speed: 0.0 if omega is None else np.ravel(omega)[0],
        acceleration: np.ravel(alpha)[0],
    }
    if scene.drive is not None:
        for name, (_, point) in zip(LINE_ENDS, scene.drive.ends, strict=False):
            values |= _collect_place(scene, point, name, f"{name}_angle")
        if isinstance(scene.drive, PointDrive):
            values["direction"] = scene.drive.direction
    for k in MOVING_BARS:
        bar = link.bar(k)
        values[f"m{k}"] = find_mass(bar)
        values[f"I{k}"] = find_inertia(bar)
        values[f"r{k}"], values[f"phi{k}"] = find_centre(bar)
    for k in range(len(scene.loads)):
        values |= _collect_load(scene, k)
    for effect in scene.effects:
        values |= _collect_effect(scene, effect)
    return values


def _collect_load(scene: Scene, k: int) -> dict[str, float]:
    """Collect the numbers of one load: force, moment and point of action."""
    load = scene.loads[k]
    force, direction = load.force or (0.0, 0.0)
    values = {
        f"F_{k}": force,
        f"F_angle_{k}": direction,
        f"M_{k}": load.moment,
    }
    if load.arm is not None:
        values[f"at_{k}"], values[f"at_angle_{k}"] = load.arm
    elif load.force is not None:
        assert load.place is not None
        values |= _collect_place(scene, load.place, f"at_{k}", f"at_angle_{k}")
    return values


def _collect_effect(scene: Scene, effect: Effect) -> dict[str, float]:
    """Collect the numbers of one effect."""
    values: dict[str, float] = {}
    if isinstance(effect, Gravity):
        values["g"] = effect.magnitude
        values["g_angle"] = effect.angle
    elif isinstance(effect, Viscous):
        for pin, coefficient in effect.coefficients:
            values[f"viscous_{pin}"] = coefficient
    elif isinstance(effect, Friction):
        for pin, torque in effect.torques:
            values[f"friction_{pin}"] = torque
    elif isinstance(effect, Flywheel):
        values["J"] = effect.inertia
    elif isinstance(effect, Torsion):
        for pin, stiffness, rest, preload in effect.springs:
            values[f"torsion_{pin}"] = stiffness
            values[f"rest_{pin}"] = rest
            values[f"wound_{pin}"] = preload
    elif isinstance(effect, Springs):
        for k, spring in enumerate(effect.springs):
            values[f"stiffness_{k}"] = spring.stiffness
            values[f"length_{k}"] = spring.length
            values[f"pull_{k}"] = spring.preload
            for end, place in (("start", spring.start), ("end", spring.end)):
                values |= _collect_place(scene, place, f"{end}_{k}", f"{end}_angle_{k}")
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
    pair = stated.from_centre if stated.from_pin is None else stated.from_pin
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
    stored = collect_inputs(scene, angle) | motion
    balls = {name: arb(value) for name, value in stored.items()}
    return balls | make_ball_lengths(scene.linkage)


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


def _solve_linear(rows: list[list[Ball]], right: list[Ball]) -> list[Ball]:
    """Solve a linear system rigorously.

    Raises ZeroDivisionError where it is singular to working precision.
    """
    column = arb_mat([[value] for value in right])
    solution = arb_mat(rows).solve(column)
    return [solution[k, 0] for k in range(len(right))]


def compute_outputs(
    scene: Scene,
    branch: int,
    inputs: BallValues,
) -> BallValues | None:
    """Compute every output at one position as balls.

    Vectors are name_x, name_y; None if the loop does not close.
    """
    x: BallValues | None = inputs
    if "stroke" in inputs:
        x = _turn_by_stroke(scene, inputs)
    if x is None:
        return None
    directions = compute_directions(x, branch)
    if directions is None:
        return None
    w = dict(zip(MOVING_BARS, directions, strict=True))
    commanded = _find_commanded_bar(x)
    sines = {
        2: wedge(w[3], w[4]),
        3: wedge(w[2], w[4]),
        4: wedge(w[2], w[3]),
    }
    y: BallValues = {}
    for bar in MOVING_BARS:
        if f"theta_{bar}" not in inputs:
            y[f"theta_{bar}"] = w[bar].arg()
    y["sin_mu"] = sines[2]
    y["condition"] = abs(sines[commanded]) * x.get("lever", 1)
    # NaN where A lies on O4, about which bars 3 and 4 then turn freely
    singular = not y["condition"] > 0
    if singular:
        return y
    bars = _move_balls(x, w, commanded)
    y |= {f"omega_{bar}": bars.omega[bar] for bar in MOVING_BARS}
    y |= {f"alpha_{bar}": bars.alpha[bar] for bar in MOVING_BARS}
    _put_vectors(y, bars.points())
    drive, speed, drives = _evaluate_drive(scene, x, bars, sines, y)
    force, moment = _sum_acting_balls(scene, x, bars)
    try:
        forces, driving = _solve_thirteen_balls(x, bars, force, moment, drives)
    except ZeroDivisionError:
        return y
    _put_vectors(y, forces)
    y[drive] = driving
    y["power"] = driving * speed
    return y


class _BallBars(NamedTuple):
    """Bars 2, 3 and 4 in motion at one position: directions, rates and vectors."""

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
        points = {
            "A": self.tip[2],
            "B": self.first_pin[4] + self.tip[4],
            "v_A": self.v_pin[3],
            "v_B": self.turn(4, self.tip[4]),
            "a_A": self.a_pin[3],
            "a_B": self.swing(4, self.tip[4]),
        }
        for bar in MOVING_BARS:
            centre = self.centre[bar]
            points[f"G{bar}"] = self.first_pin[bar] + centre
            points[f"v_G{bar}"] = self.v_pin[bar] + self.turn(bar, centre)
            points[f"a_G{bar}"] = self.acceleration(bar)
        return points


def _move_balls(
    x: BallValues,
    w: dict[int, ComplexBall],
    commanded: int,
) -> _BallBars:
    """Move the bars: two linear systems of the differentiated loop."""
    a = x["a"]
    b = x["b"]
    c = x["c"]
    zero = acb(0)
    side = {
        2: a * w[2],
        3: b * w[3],
        4: -c * w[4],
    }  # sides of the loop
    first, second = (bar for bar in MOVING_BARS if bar != commanded)

    def rates(stated: Ball, total: ComplexBall) -> dict[int, Ball]:
        """Solve for the rates of the other bars.

        The sum of i side rate is `total`.
        """
        u = acb(0, 1) * side[first]
        v = acb(0, 1) * side[second]
        rest = total - acb(0, stated) * side[commanded]
        rows = [
            [u.real, v.real],
            [u.imag, v.imag],
        ]
        first_rate, second_rate = _solve_linear(rows, [rest.real, rest.imag])
        return {
            commanded: stated,
            first: first_rate,
            second: second_rate,
        }

    # a probe opens the loop by slip, m/s, and jerk, m/s^2
    omega = rates(x[f"omega_{commanded}"], x.get("slip", zero))
    centripetal = zero
    for bar in MOVING_BARS:
        centripetal += side[bar] * square(omega[bar])
    alpha = rates(x[f"alpha_{commanded}"], x.get("jerk", zero) + centripetal)
    tip = {
        2: a * w[2],
        3: b * w[3],
        4: c * w[4],
    }
    first_pin = {
        1: zero,
        2: zero,
        3: tip[2],
        4: polar_ball(x["d"], x["theta_1"]),
    }
    centre = {}
    for bar in MOVING_BARS:
        centre[bar] = w[bar] * polar_ball(x[f"r{bar}"], x[f"phi{bar}"])
    v_A = acb(0, omega[2]) * tip[2]
    a_A = acb(-omega[2] * omega[2], alpha[2]) * tip[2]
    return _BallBars(
        w=w,
        omega=omega,
        alpha=alpha,
        tip=tip,
        first_pin=first_pin,
        centre=centre,
        v_pin={2: zero, 3: v_A, 4: zero},
        a_pin={2: zero, 3: a_A, 4: zero},
    )


def _sum_acting_balls(
    scene: Scene,
    x: BallValues,
    bars: _BallBars,
) -> tuple[dict[int, ComplexBall], dict[int, Ball]]:
    """Sum what acts on each bar: a force, and a moment about the mass centre."""
    acting = _Acting({}, {})
    for bar in MOVING_BARS:
        acting.force[bar] = acb(0)
        if "g" in x:
            acting.force[bar] = x[f"m{bar}"] * polar_ball(x["g"], x["g_angle"])
        acting.moment[bar] = x.get(f"couple_{bar}", arb(0))  # a probe may add one
    for k in range(len(scene.loads)):
        _add_load(acting, scene, x, bars, k)
    for effect in scene.effects:
        if isinstance(effect, Flywheel):
            acting.moment[effect.bar] -= x["J"] * bars.alpha[effect.bar]
        elif isinstance(effect, Torsion):
            for pin, *_ in effect.springs:
                _add_torsion_spring(acting, x, bars, pin)
        elif isinstance(effect, Springs):
            for k, spring in enumerate(effect.springs):
                _add_spring(acting, scene, x, bars, k, spring)
    for pin, (i, j) in PINS.items():
        slip = bars.omega.get(j, 0) - bars.omega.get(i, 0)
        damping = x.get(f"viscous_{pin}", arb(0)) * slip
        friction = x.get(f"friction_{pin}", arb(0)) * _sign(slip)
        acting.add_couple(pin, -damping - friction)
    return acting.force, acting.moment


class _Acting(NamedTuple):
    """Force and moment about the mass centre that act on each moving bar."""

    force: dict[int, ComplexBall]
    moment: dict[int, Ball]

    def add_couple(self, pin: str, couple: Ball) -> None:
        """Add a couple to bar j of a pin (i, j), its opposite to bar i.

        Couples on the ground have no effect.
        """
        i, j = PINS[pin]
        for bar, value in ((j, couple), (i, -couple)):
            if bar in self.moment:
                self.moment[bar] += value


def _sign(ball: Ball) -> Ball:
    """Return the sign of a ball; one that contains 0 has every sign."""
    if ball > 0:
        return arb(1)
    if ball < 0:
        return arb(-1)
    if ball == 0:
        return arb(0)
    return arb(0, 1)


def _add_load(
    acting: _Acting,
    scene: Scene,
    x: BallValues,
    bars: _BallBars,
    k: int,
) -> None:
    """Add the moment and the force of one load."""
    load = scene.loads[k]
    directions = bars.directions(x)
    centre = bars.centre
    factor = arb(1)
    if load.table:
        theta_2 = x.get("theta_2", directions[2].arg())
        factor = _interpolate_factor(load.table, theta_2, x, k)
    acting.moment[load.bar] += factor * x[f"M_{k}"]
    if load.force is None:
        return
    axes = directions[load.bar] if load.frame == "bar" else acb(1)
    force = axes * polar_ball(x[f"F_{k}"], x[f"F_angle_{k}"])
    distance = x[f"at_{k}"]
    angle = x[f"at_angle_{k}"]
    if load.arm is not None:
        arm = polar_ball(distance, angle)
    else:
        assert load.place is not None
        stated = find_stated(scene, load.place)
        from_pin = _place_from_pin(stated, distance, angle, directions, centre)
        arm = from_pin - centre[load.bar]
    acting.force[load.bar] += factor * force
    acting.moment[load.bar] += factor * wedge(arm, force)


def _add_torsion_spring(
    acting: _Acting,
    x: BallValues,
    bars: _BallBars,
    pin: str,
) -> None:
    """Add the couple of the torsion spring at one pin."""
    i, j = PINS[pin]
    w = bars.directions(x)
    unwound = polar_ball(arb(1), -x[f"rest_{pin}"])
    turned = (w[j] * w[i].conjugate() * unwound).arg()
    acting.add_couple(pin, -x[f"wound_{pin}"] - x[f"torsion_{pin}"] * turned)


def _add_spring(
    acting: _Acting,
    scene: Scene,
    x: BallValues,
    bars: _BallBars,
    k: int,
    spring: Spring,
) -> None:
    """Add the pull of one spring at its two ends."""
    directions = bars.directions(x)
    arms = []
    for place, name in ((spring.start, "start"), (spring.end, "end")):
        arm = _place_from_pin(
            find_stated(scene, place),
            x[f"{name}_{k}"],
            x[f"{name}_angle_{k}"],
            directions,
            bars.centre,
        )
        arms.append(arm)
    start = spring.start.bar
    end = spring.end.bar
    across = bars.first_pin[end] + arms[1] - bars.first_pin[start] - arms[0]
    stiffness = x[f"stiffness_{k}"]
    # then the pull is k times the distance, wherever that ends
    pull_at_no_length_is_zero = spring.preload == spring.stiffness * spring.length
    if pull_at_no_length_is_zero:
        pull = stiffness * across
    else:
        distance = abs(across)
        tension = x[f"pull_{k}"] + stiffness * (distance - x[f"length_{k}"])
        if spring.acts is not None:
            tension = _keep_one_way(tension, spring.acts)
        pull = tension / distance * across
    for bar, arm, force in ((start, arms[0], pull), (end, arms[1], -pull)):
        if bar in acting.force:
            acting.force[bar] += force
            acting.moment[bar] += wedge(arm - bars.centre[bar], force)


def _keep_one_way(tension: Ball, acts: str) -> Ball:
    """Return the tension of a spring that acts one way; where unsure, both cases."""
    sense = -1 if acts == "push" else 1
    if sense * tension > 0:
        return tension
    return arb(0) if sense * tension <= 0 else tension.union(arb(0))


def _solve_thirteen_balls(
    x: BallValues,
    bars: _BallBars,
    force: dict[int, ComplexBall],
    moment: dict[int, Ball],
    drives: _Pushes,
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
        newton_x = 3 * n
        newton_y = newton_x + 1
        euler = newton_x + 2
        for joint, arms in joints[bar]:
            arm = arms[bar]
            force_x = 2 * joint
            force_y = force_x + 1
            matrix[newton_x][force_x] = arb(1)
            matrix[newton_y][force_y] = arb(1)
            matrix[euler][force_x] = -arm.imag
            matrix[euler][force_y] = arm.real
        for row, value in enumerate(drives[bar], start=newton_x):
            matrix[row][12] = value
        needed = x[f"m{bar}"] * bars.acceleration(bar) - force[bar]
        constants.append(needed.real)
        constants.append(needed.imag)
        constants.append(x[f"I{bar}"] * bars.alpha[bar] - moment[bar])
    for row, (i, j) in enumerate(((2, 4), (3, 5), (6, 8), (7, 9)), start=9):
        matrix[row][i] = arb(1)
        matrix[row][j] = arb(1)
        constants.append(arb(0))
    solved = _solve_linear(matrix, constants)
    forces = {}
    for name, joint in {"F12": 0, "F32": 1, "F43": 3, "F14": 5}.items():
        forces[name] = acb(solved[2 * joint], solved[2 * joint + 1])
    return forces, solved[12]


def _put_vectors(y: BallValues, vectors: dict[str, ComplexBall]) -> None:
    """Put vectors by their components."""
    for name, vector in vectors.items():
        y[f"{name}_x"] = vector.real
        y[f"{name}_y"] = vector.imag


def _interpolate_factor(
    table: Table,
    theta_2: Ball,
    x: BallValues,
    k: int,
) -> Ball:
    """Interpolate between the two points of a table that enclose an angle.

    The angle is taken modulo a turn. Where the inputs have them, the four numbers are
    multiplied by those of `OF_PIECE`.
    """
    middle = float(theta_2.mid())
    turns = math.floor((middle - table.theta_2[0]) / math.tau + 1e-12)
    angle = theta_2 - 2 * turns * arb.pi()
    points_before = bisect(table.theta_2, float(angle.mid()))
    after = min(max(points_before, 1), len(table.theta_2) - 1)
    before = after - 1
    piece = (
        table.theta_2[before],
        table.theta_2[after],
        table.factor[before],
        table.factor[after],
    )
    scaled = []
    for name, value in zip(OF_PIECE, piece, strict=True):
        scaled.append(arb(value) * x.get(f"{name}_{k}", 1))
    start, stop, first, last = scaled
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
    ends = zip((drive.start.bar, drive.end.bar), LINE_ENDS, strict=True)
    (_, on_ground), (bar, on_bar) = sorted(ends)
    place = drive.start if drive.end.bar == 1 else drive.end
    held = _place_from_pin(
        find_stated(scene, place),
        x[on_bar],
        x[f"{on_bar}_angle"],
        {bar: acb(1)},  # at angle zero
        {bar: polar_ball(x[f"r{bar}"], x[f"phi{bar}"])},
    )
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
    # to the left the stroke grows with the angle
    side = 1 if motion.side == "left" else -1
    across = length * reach * beta.sin()
    along = length * reach * cosine
    rate = s * speed / across
    along_the_stroke = square(speed) + s * x["stroke_acceleration"]
    growth = (along_the_stroke - along * square(rate)) / across
    longer = max(reach, length)
    turned = {
        f"theta_{bar}": fixed.arg() - held.arg() + side * beta,
        f"omega_{bar}": side * rate,
        f"alpha_{bar}": side * growth,
        "lever": across / s / longer,
    }
    return x | turned


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
        total = acb(0)
        for k, sense in self.sense.items():
            total += sense * (foot[k] + acb(0, omega[k]) * self.arms[k])
        return (self.line.conjugate() * total).real

    def push(self, bar: int, centre: ComplexBall) -> tuple[Ball, Ball, Ball]:
        """Force (x, y) and moment about the mass centre of a bar, per newton."""
        if bar not in self.sense:
            return arb(0), arb(0), arb(0)
        force = self.sense[bar] * self.line
        return force.real, force.imag, wedge(self.arms[bar] - centre, force)


def _find_line(
    scene: Scene,
    x: BallValues,
    bars_in_motion: _BallBars,
) -> _BallLine:
    """Find the line of a drive from the directions and first pins of all bars.

    The ground's are among them.
    """
    drive = scene.drive
    assert drive is not None
    first_pin = bars_in_motion.first_pin
    w = bars_in_motion.directions(x)
    centre = bars_in_motion.centre
    arms = {}
    for (_, place), name in zip(drive.ends, LINE_ENDS, strict=False):
        arms[place.bar] = _place_from_pin(
            find_stated(scene, place),
            x[name],
            x[f"{name}_angle"],
            w,
            centre,
        )
    if isinstance(drive, PointDrive):
        unit = polar_ball(arb(1), x["direction"])
        if drive.frame == "bar":
            unit = unit * w[drive.place.bar]
        return _BallLine(
            None,
            unit,
            arms,
            {drive.place.bar: 1},
        )
    from_bar, to_bar = (place.bar for _, place in drive.ends)
    start = first_pin[from_bar] + arms[from_bar]
    end = first_pin[to_bar] + arms[to_bar]
    stroke = abs(end - start)
    return _BallLine(
        stroke=stroke,
        line=(end - start) / stroke,
        arms=arms,
        sense={from_bar: -1, to_bar: 1},
    )


def _evaluate_drive(
    scene: Scene,
    x: BallValues,
    bars: _BallBars,
    sines: dict[int, Ball],
    y: BallValues,
) -> tuple[str, Ball, _Pushes]:
    """Return the name of the drive's output, its speed, and the push of one of it.

    The drive's condition and, of a drive along a line, its motion are put into `y`.
    """
    if scene.drive is None:
        y["drive_condition"] = abs(sines[scene.drive_bar])
        torques = {bar: arb(bar == scene.drive_bar) for bar in MOVING_BARS}
        drives = {bar: (arb(0), arb(0), torques[bar]) for bar in MOVING_BARS}
        return "torque", bars.omega[scene.drive_bar], drives
    line = _find_line(scene, x, bars)
    y["drive_condition"] = _compute_condition(line, x, bars.tip[2], sines)
    speed = line.speed({1: acb(0), **bars.v_pin}, {1: arb(0), **bars.omega})
    y["stroke_speed"] = speed
    if line.stroke is not None:
        y["stroke"] = line.stroke
    _put_vectors(y, {"drive_line": line.line})
    drives = {bar: line.push(bar, bars.centre[bar]) for bar in MOVING_BARS}
    return "drive_force", speed, drives


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
    turning = {
        1: arb(0),
        2: sines[2],
        3: -a / b * sines[3],
        4: -a / c * sines[4],
    }
    foot = {
        1: acb(0),
        2: acb(0),
        3: acb(0, turning[2]) * tip,
        4: acb(0),
    }
    most = {
        1: (0, 0),
        2: (0, 1),
        3: (a, a / b),
        4: (0, a / c),
    }
    reach = arb(0)
    for k, arm in line.arms.items():
        of_first_pin, of_arm = most[k]
        reach += of_first_pin + of_arm * abs(arm)
    return abs(line.speed(foot, turning)) / reach
