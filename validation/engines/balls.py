"""The linkage in ball arithmetic: every output of `solve` to 50 digits with a rigorous radius, and its sensitivities.

Shares nothing with the formulas: the loop is closed by the complex quadratic in e^{i theta_3}, the
velocities and accelerations come from the linear systems of the differentiated loop, the pin forces
and the torque from the full thirteen Newton-Euler equations about the mass centres.
"""

import math
from bisect import bisect
from collections.abc import Iterable
from typing import Any, TypeAlias

from flint import arb, arb_mat, ctx

from fourbar.effects import Flywheel, Friction, Gravity, Load, Spring, Springs, Table, Torsion, Viscous
from fourbar.linkage import MOVING_BARS
from fourbar.scene import Scene
from validation.engines.description import PINS, centre, inertia

BITS = 320
"""Working precision; 50 digits are 167 bits, the rest is what the worst sample (a limit position at 1e-20) cancels."""
STEP_BITS = 90
"""Sensitivities are difference quotients with a relative step of 2^-90: wrong by about 2^-90 / (distance to the
nearest singular position), and the cancelled 90 bits are there to lose."""

Ball: TypeAlias = Any
Pair: TypeAlias = tuple[Ball, Ball]
Values: TypeAlias = dict[str, Ball]


def inputs(scene: Scene, theta_2: float) -> dict[str, float]:
    """The stored doubles that the outputs at one position depend on."""
    link, motion = scene.linkage, scene.motion
    d, a, b, c = link.lengths
    values = {"d": d, "a": a, "b": b, "c": c, "theta_1": link.ground_angle, "theta_2": theta_2}
    values |= {"omega_2": motion.omega_2 or 0.0, "alpha_2": motion.alpha_2}
    for k in MOVING_BARS:
        bar = link.bar(k)
        values |= {
            f"m{k}": bar.mass,
            f"I{k}": inertia(bar),
            f"r{k}": centre(bar)[0],
            f"phi{k}": centre(bar)[1],
        }
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
                values |= {
                    f"stiffness_{k}": spring.stiffness,
                    f"length_{k}": spring.length,
                    f"pull_{k}": spring.preload,
                }
                for end, point in (("start", spring.start), ("end", spring.end)):
                    values |= {f"{end}_{k}": point.distance, f"{end}_angle_{k}": point.angle}
        else:
            raise NotImplementedError(f"the reference knows no effect {type(effect).__name__}")
    return values


def polar(r: Ball, angle: Ball) -> Pair:
    """(r cos angle, r sin angle)."""
    return (r * angle.cos(), r * angle.sin())


def plus(u: Pair, v: Pair) -> Pair:
    return (u[0] + v[0], u[1] + v[1])


def times(k: Ball, u: Pair) -> Pair:
    return (k * u[0], k * u[1])


def turn(u: Pair, by: Pair) -> Pair:
    """The product of two complex numbers."""
    return (u[0] * by[0] - u[1] * by[1], u[0] * by[1] + u[1] * by[0])


def wedge(u: Pair, v: Pair) -> Ball:
    return u[0] * v[1] - u[1] * v[0]


def closure(x: Values, branch: int) -> tuple[Pair, Pair, Pair] | None:
    """e^{i theta_2}, e^{i theta_3}, e^{i theta_4}; None where the loop does not close.

    With D = d e^{i theta_1} - a e^{i theta_2}, |D - b w| = c is b conj(D) w^2 - K w + b D = 0, K = D^2 + b^2 - c^2.
    """
    w2 = polar(arb(1), x["theta_2"])
    D = plus(polar(x["d"], x["theta_1"]), times(-x["a"], w2))
    b, c = x["b"], x["c"]
    squared = D[0] * D[0] + D[1] * D[1]
    K = squared + b * b - c * c
    discriminant = 4 * b * b * squared - K * K
    if not discriminant >= 0:
        return None
    w3 = times(1 / (2 * b * squared), turn((K, branch * discriminant.sqrt()), D))
    w4 = times(1 / c, plus(times(b, w3), times(arb(-1), D)))
    return w2, w3, w4


def linear(rows: list[list[Ball]], right: list[Ball]) -> list[Ball]:
    """Solution of a linear system, rigorous; ZeroDivisionError where it is singular to working precision."""
    solution = arb_mat(rows).solve(arb_mat([[value] for value in right]))
    return [solution[k, 0] for k in range(len(right))]


def outputs(  # noqa: PLR0915 - one system
    scene: Scene, branch: int, x: Values, drive_bar: int
) -> Values | None:
    """Every output at one position as balls; vectors as name_x, name_y; None where the loop does not close."""
    closed = closure(x, branch)
    if closed is None:
        return None
    w = dict(zip(MOVING_BARS, closed, strict=True))
    a, b, c = x["a"], x["b"], x["c"]
    y: Values = {"theta_3": arb.atan2(w[3][1], w[3][0]), "theta_4": arb.atan2(w[4][1], w[4][0])}
    y["sin_mu"] = wedge(w[3], w[4])
    y["condition"] = abs(y["sin_mu"])
    # b i w3 omega_3 - c i w4 omega_4 = -a i w2 omega_2, and the same differentiated once more
    rows = [[-b * w[3][1], c * w[4][1]], [b * w[3][0], -c * w[4][0]]]
    omega = {2: x["omega_2"]}
    if not y["condition"] > 0:  # singular; NaN where A lies on O4, about which bars 3 and 4 then turn freely
        return y
    zero = (arb(0), arb(0))
    slip, jerk = x.get("slip", zero), x.get("jerk", zero)  # what a probe opens the loop by, m/s and m/s^2
    omega[3], omega[4] = linear(rows, [a * omega[2] * w[2][1] + slip[0], -a * omega[2] * w[2][0] + slip[1]])
    alpha = {2: x["alpha_2"]}
    centripetal = plus(times(a * omega[2] ** 2, w[2]), times(b * omega[3] ** 2, w[3]))
    centripetal = plus(centripetal, times(-c * omega[4] ** 2, w[4]))
    right = [centripetal[0] + a * alpha[2] * w[2][1] + jerk[0], centripetal[1] - a * alpha[2] * w[2][0] + jerk[1]]
    alpha[3], alpha[4] = linear(rows, right)
    for k in (2, 3, 4):
        y[f"omega_{k}"], y[f"alpha_{k}"] = omega[k], alpha[k]

    def swing(k: int, arm: Pair) -> Pair:
        return turn(arm, (-omega[k] * omega[k], alpha[k]))

    def turning(k: int, arm: Pair) -> Pair:
        return turn(arm, (arb(0), omega[k]))

    O4 = polar(x["d"], x["theta_1"])
    foot = {2: zero, 3: times(a, w[2]), 4: O4}
    foot_acceleration = {2: zero, 3: swing(2, times(a, w[2])), 4: zero}
    tip = {2: times(a, w[2]), 3: times(b, w[3]), 4: times(c, w[4])}
    centre = {k: turn(w[k], polar(x[f"r{k}"], x[f"phi{k}"])) for k in MOVING_BARS}
    acceleration = {k: plus(foot_acceleration[k], swing(k, centre[k])) for k in MOVING_BARS}
    points = {"A": tip[2], "B": plus(O4, tip[4]), "a_A": foot_acceleration[3], "a_B": swing(4, tip[4])}
    points |= {f"G{k}": plus(foot[k], centre[k]) for k in MOVING_BARS}
    points |= {f"a_G{k}": acceleration[k] for k in MOVING_BARS}
    foot_velocity = {2: zero, 3: turning(2, tip[2]), 4: zero}
    points |= {"v_A": foot_velocity[3], "v_B": turning(4, tip[4])}
    points |= {f"v_G{k}": plus(foot_velocity[k], turning(k, centre[k])) for k in MOVING_BARS}

    force = dict.fromkeys(MOVING_BARS, zero)
    moment = {k: x.get(f"couple_{k}", arb(0)) for k in MOVING_BARS}  # about G; a probe may add one
    for k, load in enumerate(scene.loads):
        _add_load(load, x, k, w, force, moment)
    axes = {1: polar(arb(1), x["theta_1"]), **w}
    for effect in scene.effects:
        if isinstance(effect, Springs):
            for k, spring in enumerate(effect.springs):
                _add_spring(spring, x, k, axes, {1: zero, **foot}, centre, force, moment)
        elif isinstance(effect, Torsion):
            for pin, *_ in effect.springs:
                i, j = PINS[pin]
                back = turn((axes[i][0], -axes[i][1]), polar(arb(1), -x[f"rest_{pin}"]))
                cos, sin = turn(axes[j], back)
                couple = -x[f"wound_{pin}"] - x[f"torsion_{pin}"] * arb.atan2(sin, cos)
                for bar, value in ((j, couple), (i, -couple)):
                    if bar in moment:
                        moment[bar] += value
        elif isinstance(effect, Flywheel):
            moment[effect.bar] -= x["J"] * alpha[effect.bar]
    for k in MOVING_BARS:
        if "g" in x:
            force[k] = plus(force[k], times(x[f"m{k}"], polar(x["g"], x["g_angle"])))
    for pin, (i, j) in PINS.items():
        slip = omega.get(j, 0) - omega.get(i, 0)
        sign = arb(1) if slip > 0 else arb(-1) if slip < 0 else arb(0)
        couple = -x.get(f"viscous_{pin}", arb(0)) * slip - x.get(f"friction_{pin}", arb(0)) * sign
        for k, value in ((j, couple), (i, -couple)):
            if k in moment:
                moment[k] += value
    # unknowns F12 F32 F23 F43 F34 F14 (x, y each) and T
    joints = {2: ((0, "foot"), (1, "tip")), 3: ((2, "foot"), (3, "tip")), 4: ((4, "tip"), (5, "foot"))}
    matrix = [[arb(0)] * 13 for _ in range(13)]
    known = []
    for n, k in enumerate(MOVING_BARS):
        for column, end in joints[k]:
            arm = times(arb(-1), centre[k]) if end == "foot" else plus(tip[k], times(arb(-1), centre[k]))
            matrix[3 * n][2 * column] = matrix[3 * n + 1][2 * column + 1] = arb(1)
            matrix[3 * n + 2][2 * column], matrix[3 * n + 2][2 * column + 1] = -arm[1], arm[0]
        if k == drive_bar:
            matrix[3 * n + 2][12] = arb(1)
        known += [x[f"m{k}"] * acceleration[k][i] - force[k][i] for i in range(2)]
        known.append(x[f"I{k}"] * alpha[k] - moment[k])
    for row, (i, j) in enumerate(((2, 4), (3, 5), (6, 8), (7, 9)), start=9):
        matrix[row][i] = matrix[row][j] = arb(1)
        known.append(arb(0))
    for name, (px, py) in points.items():
        y[f"{name}_x"], y[f"{name}_y"] = px, py
    sines = {2: y["sin_mu"], 3: wedge(w[2], w[4]), 4: wedge(w[2], w[3])}
    y["drive_condition"] = abs(sines[drive_bar])
    try:
        solved = linear(matrix, known)
    except ZeroDivisionError:
        return y
    for name, column in (("F12", 0), ("F32", 1), ("F43", 3), ("F14", 5)):
        y[f"{name}_x"], y[f"{name}_y"] = solved[2 * column], solved[2 * column + 1]
    y["torque"] = solved[12]
    return y


def _add_load(
    load: Load, x: Values, k: int, w: dict[int, Pair], force: dict[int, Pair], moment: dict[int, Ball]
) -> None:
    factor = _factor(load.table, x["theta_2"]) if load.table else arb(1)
    f, arm = polar(factor * x[f"F_{k}"], x[f"F_angle_{k}"]), polar(x[f"at_{k}"], x[f"at_angle_{k}"])
    if load.frame == "bar":
        f, arm = turn(f, w[load.bar]), turn(arm, w[load.bar])
    force[load.bar] = plus(force[load.bar], f)
    moment[load.bar] = moment[load.bar] + wedge(arm, f) + factor * x[f"M_{k}"]


def _factor(table: Table, theta_2: Ball) -> Ball:
    """On the straight line between the two points of a table that enclose an angle, taken modulo a turn."""
    turns = math.floor((float(theta_2.mid()) - table.theta_2[0]) / math.tau + 1e-12)
    angle = theta_2 - 2 * turns * arb.pi()
    after = min(max(bisect(table.theta_2, float(angle.mid())), 1), len(table.theta_2) - 1)
    start, stop = (arb(table.theta_2[k]) for k in (after - 1, after))
    first, last = (arb(table.factor[k]) for k in (after - 1, after))
    return first + (last - first) * (angle - start) / (stop - start)


def _add_spring(
    spring: Spring,
    x: Values,
    k: int,
    axes: dict[int, Pair],
    foot: dict[int, Pair],
    centre: dict[int, Pair],
    force: dict[int, Pair],
    moment: dict[int, Ball],
) -> None:
    """Pull preload + stiffness (distance - length) along the line of the two points, and nothing where they meet."""
    ends = (("start", spring.start.bar), ("end", spring.end.bar))
    arms = [turn(axes[bar], polar(x[f"{end}_{k}"], x[f"{end}_angle_{k}"])) for end, bar in ends]
    places = [plus(foot[bar], arm) for (_, bar), arm in zip(ends, arms, strict=True)]
    across = plus(places[1], times(arb(-1), places[0]))
    distance = (across[0] * across[0] + across[1] * across[1]).sqrt()
    if spring.preload == spring.stiffness * spring.length:  # the pull is k times the distance, wherever that ends
        pull = times(x[f"stiffness_{k}"], across)
    else:
        pull = times((x[f"pull_{k}"] + x[f"stiffness_{k}"] * (distance - x[f"length_{k}"])) / distance, across)
    for (_, bar), arm, f in zip(ends, arms, (pull, times(arb(-1), pull)), strict=True):
        if bar in force:
            force[bar] = plus(force[bar], f)
            moment[bar] += wedge(plus(arm, times(arb(-1), centre[bar])), f)


def response(base: Values, changed: Iterable[Values | None]) -> dict[str, float]:
    """How far each output moves, by 2^-STEP_BITS, under the first of several changes with which the loop closes."""
    for moved in changed:
        if moved is None:
            continue
        found = {}
        for output, y in base.items():
            if output not in moved:  # singular there
                found[output] = math.inf
                continue
            change = abs(moved[output] - y)
            if output.startswith("theta") and change > 3:
                change = 2 * arb.pi() - change
            found[output] = abs(float((change * arb(2) ** STEP_BITS).mid()))
        return found
    return {}


def reference(scene: Scene, branch: int, theta_2: float) -> tuple[Values, dict[str, float]] | None:
    """Values at one position as balls, and sum |x_i dy/dx_i| of each; None where the loop does not close."""
    ctx.prec = BITS
    exact = {name: arb(value) for name, value in inputs(scene, theta_2).items()}

    def evaluate(**changed: Ball) -> Values | None:
        return outputs(scene, branch, exact | changed, scene.drive_bar)

    base = evaluate()
    if base is None:
        return None
    sensitivity = dict.fromkeys(base, 0.0)
    for name, value in exact.items():
        step = abs(value) * arb(2) ** -STEP_BITS
        moved = response(base, (evaluate(**{name: value + side * step}) for side in (1, -1))) if value != 0 else {}
        for output, rate in moved.items():
            sensitivity[output] += rate
    return base, sensitivity
