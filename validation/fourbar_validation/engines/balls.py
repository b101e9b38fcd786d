"""The linkage in ball arithmetic: every output of `solve` to 50 digits with a rigorous radius, and its sensitivities.

Shares nothing with the formulas: the loop is closed by the complex quadratic in e^{i theta_3}, the
velocities and accelerations come from the linear systems of the differentiated loop, the pin forces
and the torque from the full thirteen Newton-Euler equations about the mass centres.
"""

import math
from bisect import bisect
from collections.abc import Iterable
from typing import Any, NamedTuple, TypeAlias

from flint import acb, arb, arb_mat, ctx

from fourbar.effects import Flywheel, Friction, Gravity, LinearDrive, Spring, Springs, Table, Torsion, Viscous
from fourbar.linkage import MOVING_BARS
from fourbar.scene import Scene
from fourbar_validation.engines.description import PINS, find_centre, find_inertia

Ball: TypeAlias = Any
Complex: TypeAlias = Any
"""A vector of the plane, x + i y, of two balls."""
Values: TypeAlias = dict[str, Ball]


def polar(r: Ball, angle: Ball) -> Complex:
    """Return r e^{i angle}."""
    return acb(r * angle.cos(), r * angle.sin())


def wedge(u: Complex, v: Complex) -> Ball:
    """Return u_x v_y - u_y v_x."""
    return (u.conjugate() * v).imag


def dot(u: Complex, v: Complex) -> Ball:
    """Return u_x v_x + u_y v_y."""
    return (u.conjugate() * v).real


BITS = 320
"""Working precision; 50 digits are 167 bits, the rest is what the worst sample (a limit position at 1e-20) cancels."""
OF_PIECE = ("table_start", "table_stop", "table_first", "table_last")
"""Angles and factors of the piece of a load's table that a position is in."""
STEP_BITS = 90
"""Sensitivities are difference quotients with a relative step of 2^-90: wrong by about 2^-90 / (distance to the
nearest singular position), and the cancelled 90 bits are there to lose."""


def collect_inputs(scene: Scene, angle: float) -> dict[str, float]:
    """Collect the stored doubles that the outputs at one position, of the commanded angle, depend on."""
    link, motion = scene.linkage, scene.motion
    d, a, b, c = link.lengths
    values = {"d": d, "a": a, "b": b, "c": c, "theta_1": link.ground_angle}
    values |= dict(zip(motion.names, (angle, motion.speed or 0.0, motion.acceleration), strict=True))
    values |= collect_ends(scene.drive)
    for k in MOVING_BARS:
        bar = link.bar(k)
        values |= {f"m{k}": bar.mass, f"I{k}": find_inertia(bar)}
        values[f"r{k}"], values[f"phi{k}"] = find_centre(bar)
    for k, load in enumerate(scene.loads):
        f, f_angle = load.force or (0.0, 0.0)
        values |= {f"F_{k}": f, f"F_angle_{k}": f_angle, f"M_{k}": load.moment}
        values |= {f"at_{k}": load.at[0], f"at_angle_{k}": load.at[1]}
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
                values |= {f"torsion_{pin}": stiffness, f"rest_{pin}": rest, f"wound_{pin}": preload}
        elif isinstance(effect, Springs):
            for k, spring in enumerate(effect.springs):
                values |= {f"stiffness_{k}": spring.stiffness, f"length_{k}": spring.length}
                values[f"pull_{k}"] = spring.preload
                for end, point in (("start", spring.start), ("end", spring.end)):
                    values |= {f"{end}_{k}": point.distance, f"{end}_angle_{k}": point.angle}
        else:
            raise NotImplementedError(f"the reference knows no effect {type(effect).__name__}")
    return values


def make_balls(scene: Scene, angle: float, **motion: float) -> Values:
    """Give the inputs as balls of no radius, with another omega_2 or alpha_2 where given; set the working precision."""
    ctx.prec = BITS
    return {name: arb(value) for name, value in (collect_inputs(scene, angle) | motion).items()}


def closure(x: Values, branch: int) -> tuple[Complex, Complex, Complex] | None:
    """Return e^{i theta_2}, e^{i theta_3}, e^{i theta_4}; None if the loop does not close.

    With D = d e^{i theta_1} - a e^{i theta_2}, |D - b w| = c is b conj(D) w^2 - K w + b D = 0, K = D^2 + b^2 - c^2.
    Where bar 3 is commanded D = d e^{i theta_1} - b e^{i theta_3} is what bars 2 and 4 span, where bar 4 is it is
    d e^{i theta_1} + c e^{i theta_4}, spanned by bars 3 and 2 with bar 2 reversed.
    """
    bar, d = find_commanded(x), x["d"]
    own, b, c = {2: ("a", "b", "c"), 3: ("b", "a", "c"), 4: ("c", "b", "a")}[bar]
    own, b, c, side = x[own], x[b], x[c], 1 if bar == 4 else -1
    w = polar(arb(1), x[f"theta_{bar}"])
    D = polar(d, x["theta_1"]) + side * own * w
    # |D|^2 by the angle between ground and input: where they are in line it is exact, and so is a loop that just closes
    squared = d**2 + own**2 + side * 2 * d * own * (x[f"theta_{bar}"] - x["theta_1"]).cos()
    K = squared + b * b - c * c
    discriminant = 4 * b * b * squared - K * K
    if discriminant < 0:  # an undecided one has no root, and what follows is NaN
        return None
    first = acb(K, branch * discriminant.sqrt()) * D / (2 * b * squared)
    second = (b * first - D) / c
    return (w, first, second) if bar == 2 else (first, w, second) if bar == 3 else (-second, first, w)


def find_commanded(x: Values) -> int:
    """Return the bar whose angle is among the inputs."""
    return next(bar for bar in MOVING_BARS if f"theta_{bar}" in x)


def solve_linear(rows: list[list[Ball]], right: list[Ball]) -> list[Ball]:
    """Solution of a linear system, rigorous; ZeroDivisionError where it is singular to working precision."""
    solution = arb_mat(rows).solve(arb_mat([[value] for value in right]))
    return [solution[k, 0] for k in range(len(right))]


def compute_outputs(scene: Scene, branch: int, inputs: Values) -> Values | None:  # noqa: PLR0915 - one system
    """Compute every output at one position as balls; vectors as name_x, name_y; None where the loop does not close."""
    x = turn_by_stroke(scene, inputs) if "stroke" in inputs else inputs
    closed = None if x is None else closure(x, branch)
    if x is None or closed is None:
        return None
    w = dict(zip(MOVING_BARS, closed, strict=True))
    a, b, c, bar = x["a"], x["b"], x["c"], find_commanded(x)
    y: Values = {f"theta_{k}": w[k].arg() for k in MOVING_BARS if f"theta_{k}" not in inputs}
    sines = {2: wedge(w[3], w[4]), 3: wedge(w[2], w[4]), 4: wedge(w[2], w[3])}
    y |= {"sin_mu": sines[2], "condition": abs(sines[bar]) * x.get("lever", 1)}
    if not y["condition"] > 0:  # singular; NaN where A lies on O4, about which bars 3 and 4 then turn freely
        return y
    zero = acb(0)
    side = {2: a * w[2], 3: b * w[3], 4: -c * w[4]}  # sides of the loop

    def rates(stated: Ball, known: Complex) -> dict[int, Ball]:
        """Solve for the rates of the other bars, where the sum of i side rate is given."""
        one, other = (k for k in MOVING_BARS if k != bar)
        u, v, known = acb(0, 1) * side[one], acb(0, 1) * side[other], known - acb(0, stated) * side[bar]
        found = solve_linear([[u.real, v.real], [u.imag, v.imag]], [known.real, known.imag])
        return {bar: stated, **dict(zip((one, other), found, strict=True))}

    # a probe opens the loop by slip, m/s, and jerk, m/s^2
    omega = rates(x[f"omega_{bar}"], x.get("slip", zero))
    centripetal = sum((side[k] * omega[k] ** 2 for k in MOVING_BARS), zero)
    alpha = rates(x[f"alpha_{bar}"], x.get("jerk", zero) + centripetal)
    for k in MOVING_BARS:
        y[f"omega_{k}"], y[f"alpha_{k}"] = omega[k], alpha[k]

    O4, tip = polar(x["d"], x["theta_1"]), {2: a * w[2], 3: b * w[3], 4: c * w[4]}
    spin = {k: acb(0, omega[k]) for k in MOVING_BARS}
    swing = {k: acb(-omega[k] * omega[k], alpha[k]) for k in MOVING_BARS}
    first_pin = {1: zero, 2: zero, 3: tip[2], 4: O4}
    v_foot, a_foot = ({2: zero, 3: turn[2] * tip[2], 4: zero} for turn in (spin, swing))
    centre = {k: w[k] * polar(x[f"r{k}"], x[f"phi{k}"]) for k in MOVING_BARS}
    acceleration = {k: a_foot[k] + swing[k] * centre[k] for k in MOVING_BARS}
    points = {"A": tip[2], "B": O4 + tip[4], "a_A": a_foot[3], "a_B": swing[4] * tip[4]}
    points |= {"v_A": v_foot[3], "v_B": spin[4] * tip[4]}
    for k in MOVING_BARS:
        points |= {f"G{k}": first_pin[k] + centre[k], f"a_G{k}": acceleration[k]}
        points[f"v_G{k}"] = v_foot[k] + spin[k] * centre[k]
    _put(y, points)

    force = {k: x[f"m{k}"] * polar(x["g"], x["g_angle"]) if "g" in x else zero for k in MOVING_BARS}
    moment = {k: x.get(f"couple_{k}", arb(0)) for k in MOVING_BARS}  # about G; a probe may add one
    directions = {1: polar(arb(1), x["theta_1"]), **w}
    _add_effects(scene, x, directions, first_pin, centre, force, moment)
    for effect in scene.effects:
        if isinstance(effect, Flywheel):
            moment[effect.bar] -= x["J"] * alpha[effect.bar]
    for pin, (i, j) in PINS.items():
        slip = omega.get(j, 0) - omega.get(i, 0)
        sign = arb(1) if slip > 0 else arb(-1) if slip < 0 else arb(0) if slip == 0 else arb(0, 1)
        couple = -x.get(f"viscous_{pin}", arb(0)) * slip - x.get(f"friction_{pin}", arb(0)) * sign
        _add_twist(moment, pin, couple)
    line = find_line(scene.drive, x, directions, first_pin) if scene.drive else None
    # unknowns F12 F32 F23 F43 F34 F14 (x, y each) and T
    joints = {2: ((0, "first_pin"), (1, "tip")), 3: ((2, "first_pin"), (3, "tip")), 4: ((4, "tip"), (5, "first_pin"))}
    matrix = [[arb(0)] * 13 for _ in range(13)]
    known = []
    for n, k in enumerate(MOVING_BARS):
        for column, end in joints[k]:
            arm = -centre[k] if end == "first_pin" else tip[k] - centre[k]
            matrix[3 * n][2 * column] = matrix[3 * n + 1][2 * column + 1] = arb(1)
            matrix[3 * n + 2][2 * column], matrix[3 * n + 2][2 * column + 1] = -arm.imag, arm.real
        pushed = line.push(k, centre[k]) if line else (arb(0), arb(0), arb(k == scene.drive_bar))
        for row, value in enumerate(pushed, start=3 * n):
            matrix[row][12] = value
        needed = x[f"m{k}"] * acceleration[k] - force[k]
        known += [needed.real, needed.imag, x[f"I{k}"] * alpha[k] - moment[k]]
    for row, (i, j) in enumerate(((2, 4), (3, 5), (6, 8), (7, 9)), start=9):
        matrix[row][i] = matrix[row][j] = arb(1)
        known.append(arb(0))
    if line is None:
        drive, y["drive_condition"], speed = "torque", abs(sines[scene.drive_bar]), omega[scene.drive_bar]
    else:
        drive, y["drive_condition"] = "drive_force", compute_condition(line, x, tip[2], sines)
        speed = line.speed({1: zero, **v_foot}, {1: arb(0), **omega})
        y |= {"stroke": line.stroke, "stroke_speed": speed}
        _put(y, {"drive_line": line.line})
    try:
        solved = solve_linear(matrix, known)
    except ZeroDivisionError:
        return y
    columns = {"F12": 0, "F32": 1, "F43": 3, "F14": 5}
    _put(y, {name: acb(solved[2 * column], solved[2 * column + 1]) for name, column in columns.items()})
    y[drive], y["power"] = solved[12], solved[12] * speed
    return y


def _put(y: Values, vectors: dict[str, Complex]) -> None:
    """Vectors by their components."""
    for name, vector in vectors.items():
        y[f"{name}_x"], y[f"{name}_y"] = vector.real, vector.imag


def _add_twist(moment: dict[int, Ball], pin: str, couple: Ball) -> None:
    """Add a couple to bar j of a pin (i, j), its opposite to bar i; on the ground it does nothing."""
    i, j = PINS[pin]
    for bar, value in ((j, couple), (i, -couple)):
        if bar in moment:
            moment[bar] += value


def _add_effects(
    scene: Scene,
    x: Values,
    w: dict[int, Complex],
    first_pin: dict[int, Complex],
    centre: dict[int, Complex],
    force: dict[int, Complex],
    moment: dict[int, Ball],
) -> None:
    """Add loads and springs, from the directions and first pins of all bars, the ground's too."""
    for k, load in enumerate(scene.loads):
        theta_2 = x.get("theta_2", w[2].arg())
        factor = _interpolate_factor(load.table, theta_2, x, k) if load.table else arb(1)
        axes = w[load.bar] if load.frame == "bar" else acb(1)
        f, arm = (axes * polar(x[f"{name}_{k}"], x[f"{name}_angle_{k}"]) for name in ("F", "at"))
        force[load.bar] += factor * f
        moment[load.bar] += factor * (wedge(arm, f) + x[f"M_{k}"])
    for effect in scene.effects:
        if isinstance(effect, Torsion):
            for pin, *_ in effect.springs:
                i, j = PINS[pin]
                turned = (w[j] * w[i].conjugate() * polar(arb(1), -x[f"rest_{pin}"])).arg()
                _add_twist(moment, pin, -x[f"wound_{pin}"] - x[f"torsion_{pin}"] * turned)
        elif isinstance(effect, Springs):
            for k, spring in enumerate(effect.springs):
                start, end = spring.start.bar, spring.end.bar
                arms = [
                    w[bar] * polar(x[f"{name}_{k}"], x[f"{name}_angle_{k}"])
                    for bar, name in ((start, "start"), (end, "end"))
                ]
                pull = _pull(spring, x, k, first_pin[end] + arms[1] - first_pin[start] - arms[0])
                for bar, arm, f in ((start, arms[0], pull), (end, arms[1], -pull)):
                    if bar in force:
                        force[bar] += f
                        moment[bar] += wedge(arm - centre[bar], f)


def _interpolate_factor(table: Table, theta_2: Ball, x: Values, k: int) -> Ball:
    """Interpolate between the two points of a table that enclose an angle, taken modulo a turn.

    Where the inputs have them, the four numbers are multiplied by those of `OF_PIECE`.
    """
    turns = math.floor((float(theta_2.mid()) - table.theta_2[0]) / math.tau + 1e-12)
    angle = theta_2 - 2 * turns * arb.pi()
    after = min(max(bisect(table.theta_2, float(angle.mid())), 1), len(table.theta_2) - 1)
    piece = (*table.theta_2[after - 1 : after + 1], *table.factor[after - 1 : after + 1])
    start, stop, first, last = (
        arb(value) * x.get(f"{name}_{k}", 1) for name, value in zip(OF_PIECE, piece, strict=True)
    )
    return first + (last - first) * (angle - start) / (stop - start)


def _pull(spring: Spring, x: Values, k: int, across: Complex) -> Complex:
    """Preload + stiffness (distance - length) along the line of the two points, and nothing where they meet."""
    if spring.preload == spring.stiffness * spring.length:  # the pull is k times the distance, wherever that ends
        return x[f"stiffness_{k}"] * across
    distance = abs(across)
    return (x[f"pull_{k}"] + x[f"stiffness_{k}"] * (distance - x[f"length_{k}"])) / distance * across


def compute_response(base: Values, changed: Iterable[Values | None]) -> dict[str, float]:
    """Compute how far each output moves, by 2^-STEP_BITS, under the first of several changes that closes the loop."""
    for moved in changed:
        if moved is None:
            continue
        result = {}
        for output, y in base.items():
            if output not in moved:  # singular there
                result[output] = math.inf
                continue
            change = abs(moved[output] - y)
            if output.startswith("theta") and change > 3:
                change = 2 * arb.pi() - change
            result[output] = abs(float((change * arb(2) ** STEP_BITS).mid()))
        return result
    return {}


def compute_reference(scene: Scene, branch: int, angle: float) -> tuple[Values, dict[str, float]] | None:
    """Compute values at one position as balls, and sum |x_i dy/dx_i| of each; None where the loop does not close."""
    exact = make_balls(scene, angle)
    exact |= {f"{name}_{k}": arb(1) for k, load in enumerate(scene.loads) if load.table for name in OF_PIECE}

    def evaluate(**changed: Ball) -> Values | None:
        return compute_outputs(scene, branch, exact | changed)

    base = evaluate()
    if base is None:
        return None
    sensitivity = dict.fromkeys(base, 0.0)
    for name, value in exact.items():
        step = abs(value) * arb(2) ** -STEP_BITS
        moved = (
            compute_response(base, (evaluate(**{name: value + side * step}) for side in (1, -1))) if value != 0 else {}
        )
        for output, rate in moved.items():
            sensitivity[output] += rate
    return base, sensitivity


ENDS = ("from", "to")


def collect_ends(drive: LinearDrive | None) -> dict[str, float]:
    """Collect the stored doubles of a drive."""
    points = () if drive is None else zip(ENDS, (drive.start, drive.end), strict=True)
    return {key: value for name, point in points for key, value in zip((name, f"{name}_angle"), point[1:], strict=True)}


def turn_by_stroke(scene: Scene, x: Values) -> Values | None:
    """Add angle, speed and acceleration of the bar that a commanded stroke turns; None where the triangle stays open.

    With l and r from the pin to the ends: s^2 = l^2 + r^2 - 2 l r cos beta, twice differentiated.
    """
    drive, motion = scene.drive, scene.motion
    assert drive is not None and motion.side is not None
    (_, other), (bar, own) = sorted(zip((drive.start.bar, drive.end.bar), ENDS, strict=True))
    held = polar(x[own], x[f"{own}_angle"])
    fixed = polar(x[other], x[f"{other}_angle"] + x["theta_1"])
    if bar == 4:
        fixed -= polar(x["d"], x["theta_1"])
    s, speed, length, reach = x["stroke"], x["stroke_speed"], abs(held), abs(fixed)
    cosine = (length**2 + reach**2 - s**2) / (2 * length * reach)
    if abs(cosine) > 1:
        return None
    beta, side = cosine.acos(), 1 if motion.side == "left" else -1  # to the left the stroke grows with the angle
    across, along = length * reach * beta.sin(), length * reach * cosine
    rate = s * speed / across
    growth = (speed**2 + s * x["stroke_acceleration"] - along * rate**2) / across
    lever = across / s / (length if length > reach else reach)
    turned = {f"theta_{bar}": fixed.arg() - held.arg() + side * beta, f"omega_{bar}": side * rate}
    return x | turned | {f"alpha_{bar}": side * growth, "lever": lever}


class BallLine(NamedTuple):
    """Line of the drive between its two points, at one position of the linkage."""

    stroke: Ball
    line: Complex
    """Unit vector from one point to the other."""
    arms: dict[int, Complex]
    """Vectors from the first pin to the end, of the bars with an end."""
    sense: dict[int, int]
    """Sign of the drive's push along the line on each of these bars."""

    def speed(self, foot: dict[int, Complex], omega: dict[int, Ball]) -> Ball:
        """Return ds/dt from the speeds of the bars' first pins and the bars' angular speeds."""
        ends = (sense * (foot[k] + acb(0, omega[k]) * self.arms[k]) for k, sense in self.sense.items())
        return dot(self.line, sum(ends, acb(0)))

    def push(self, bar: int, centre: Complex) -> tuple[Ball, Ball, Ball]:
        """Force (x, y) and moment about the mass centre of a bar, per newton."""
        if bar not in self.sense:
            return arb(0), arb(0), arb(0)
        force = self.sense[bar] * self.line
        return force.real, force.imag, wedge(self.arms[bar] - centre, force)


def find_line(drive: LinearDrive, x: Values, w: dict[int, Complex], first_pin: dict[int, Complex]) -> BallLine:
    """Find the line of a drive from the directions and first pins of all bars, the ground's too."""
    bars = drive.start.bar, drive.end.bar
    arms = {k: w[k] * polar(x[name], x[f"{name}_angle"]) for k, name in zip(bars, ENDS, strict=True)}
    start, end = (first_pin[k] + arms[k] for k in bars)
    stroke = abs(end - start)
    return BallLine(stroke, (end - start) / stroke, arms, dict(zip(bars, (-1, 1), strict=True)))


def compute_condition(line: BallLine, x: Values, tip: Complex, sines: dict[int, Ball]) -> Ball:
    """|P|/L, P the speed of the stroke with (sin mu, (a/b) sin(theta_2 - theta_4), (a/c) sin(theta_2 - theta_3)).

    L is the sum of what each end could move: r on bar 2, a + r a/b on bar 3, r a/c on bar 4, `tip` is A.
    """
    a, b, c = x["a"], x["b"], x["c"]
    turning = {1: arb(0), 2: sines[2], 3: -a / b * sines[3], 4: -a / c * sines[4]}
    foot = {1: acb(0), 2: acb(0), 3: acb(0, turning[2]) * tip, 4: acb(0)}
    most = {1: (0, 0), 2: (0, 1), 3: (a, a / b), 4: (0, a / c)}
    reach = sum((most[k][0] + most[k][1] * abs(arm) for k, arm in line.arms.items()), arb(0))
    return abs(line.speed(foot, turning)) / reach
