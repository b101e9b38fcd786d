"""The four-bar as three free bodies, by numpy alone: no closed formula, no engine.

The two closure equations, closed by Newton's method, are once and twice differentiated linear in the
speeds b omega_3, c omega_4 and in b alpha_3, c alpha_4. Forces and moments about the first pin of each bar
and the two reactions at A and B are thirteen linear equations in F12, F32, F23, F43, F34, F14 and the
torque (R. L. Norton, Design of Machinery, ch. 11, has them about the mass centres). Vectors of the plane
are complex numbers, x + i y.
"""

import numpy as np
from numpy.typing import NDArray

from fourbar.linkage import MOVING_BARS, PIN_FORCE, FourBar
from fourbar.scene import Command, Scene
from validation.compare.answer import Answer, Array
from validation.engines.free_body_closure import Complex, close
from validation.engines.free_body_effects import Motion, Wrenches, acting, sliding_pins, unknown

NAME = "free-body"
COLUMN = {"F12": 0, "F32": 2, "F23": 4, "F43": 6, "F34": 8, "F14": 10}
TORQUE = 12
ROWS = {2: (0, "F12", "F32"), 3: (3, "F23", "F43"), 4: (6, "F14", "F34")}
"""First row of a bar, the force at its first pin and that at its second."""
BLOCK = 4096
"""Positions solved at once: 1.4 kB a matrix, and some four of them at a time, are 22 MB."""
FRICTION_STAGES = 16
"""Friction grows from none to its full coefficient in so many stages, each the start of the next."""
FRICTION_STEPS = 60
"""Newton's steps in a stage; where it converges it needs a tenth of them."""
FRICTION_SETTLED = 8.0 * 2.0**-52
"""Of the sum of the terms of a friction couple's equation: what is left of it is rounding."""


class FreeBody:
    """Every compared quantity, all positions at once."""

    name = NAME

    def answer(self, scene: Scene, command: Command) -> Answer:
        """Its answer, or the refusal that names an effect it does not know."""
        if (reason := unknown(scene)) is not None:
            return Answer(NAME, "exact", refusal=reason)
        closed = close(scene.linkage, command.theta_2, command.branch)
        answer = Answer(
            NAME,
            "exact",
            at=command,
            assembled=closed.assembled,
            quantities={"theta_3": closed.theta[0], "theta_4": closed.theta[1]},
            evidence={"closure_gap": float(np.max(closed.gap, initial=0.0, where=closed.assembled))},
            shared="the description, theta_2, omega_2, alpha_2 and the branch",
            own="assembly (Newton on the two closure equations), speeds and accelerations (own 2x2 Jacobian), every "
            "effect from its definition, the thirteen equations of the free bodies as one system",
        )
        if command.omega_2 is not None:
            n = len(command.theta_2)
            omega_2, alpha_2 = (np.broadcast_to(np.asarray(x, float), (n,)) for x in (command.omega_2, command.alpha_2))
            commanded = (command.theta_2, omega_2, alpha_2, *closed.theta)
            blocks = [slice(start, start + BLOCK) for start in range(0, n, BLOCK)]
            parts = [_answered(scene, *(array[block] for array in commanded)) for block in blocks]
            answer.evidence["residual"] = max((residual for _, residual in parts), default=0.0)
            for name in parts[0][0] if parts else ():
                answer.quantities[name] = np.concatenate([part[name] for part, _ in parts])
        return answer


def _answered(
    scene: Scene, theta_2: Array, omega_2: Array, alpha_2: Array, theta_3: Array, theta_4: Array
) -> tuple[dict[str, Array], float]:
    """Motion, pin forces and torque at some positions, and the residual of their thirteen equations."""
    motion = move(scene.linkage, theta_2, omega_2, alpha_2, theta_3, theta_4)
    unknowns, residual = balance(scene, motion)
    found = {name: unknowns[:, COLUMN[name] : COLUMN[name] + 2] for name in PIN_FORCE.values()}
    for bar in (3, 4):
        found |= {f"omega_{bar}": motion.omega[bar], f"alpha_{bar}": motion.alpha[bar]}
    return found | {"torque": unknowns[:, TORQUE]}, residual


def move(linkage: FourBar, theta_2: Array, omega_2: Array, alpha_2: Array, theta_3: Array, theta_4: Array) -> Motion:
    """Speeds and accelerations; NaN where the Jacobian is singular."""
    d, a, b, c = linkage.lengths
    n = len(theta_2)
    u_1, u_2 = np.exp(1j * linkage.ground_angle), np.exp(1j * theta_2)
    u_3, u_4 = np.exp(1j * theta_3), np.exp(1j * theta_4)
    jacobian = np.stack((_plane(u_3), -_plane(u_4)), axis=-1)
    v_3, v_4 = solved(jacobian, _plane(-a * omega_2 * u_2)[..., None])[0][..., 0].T
    omega = {1: np.zeros(n), 2: omega_2, 3: v_3 / b, 4: v_4 / c}
    centripetal = a * omega_2**2 * u_2 + b * omega[3] ** 2 * u_3 - c * omega[4] ** 2 * u_4
    w_3, w_4 = solved(jacobian, _plane(-a * alpha_2 * u_2 - 1j * centripetal)[..., None])[0][..., 0].T
    alpha = {1: np.zeros(n), 2: alpha_2, 3: w_3 / b, 4: w_4 / c}
    zero = np.zeros(n, dtype=complex)
    foot = {1: zero, 2: zero, 3: a * u_2, 4: zero + d * u_1}
    return Motion(linkage, theta_2, {1: zero + u_1, 2: u_2, 3: u_3, 4: u_4}, foot, omega, alpha)


def balance(scene: Scene, motion: Motion) -> tuple[Array, float]:
    """The thirteen unknowns (n, 13), N and N m, and the largest residual of the system, relative to its terms."""
    wrenches = acting(scene, motion)
    _add_inertia(motion, wrenches)
    pins = sliding_pins(scene)
    columns = [_right(motion.linkage, wrenches)]
    for pin in pins:
        unit = Wrenches(len(motion.theta_2))
        unit.twist_at(pin, -np.sign(motion.slip(pin)))
        columns.append(_right(motion.linkage, unit))
    unknowns, residual = solved(_matrix(motion, scene.drive_bar), np.stack(columns, axis=-1))
    unknowns[:, TORQUE] *= motion.linkage.bar(scene.drive_bar).length
    total = unknowns[..., 0]
    if pins:
        of_pin = [unknowns[:, COLUMN[PIN_FORCE[pin]] : COLUMN[PIN_FORCE[pin]] + 2] for pin in pins]
        loads = np.stack([force[:, 0] + 1j * force[:, 1] for force in of_pin], axis=1)
        couples = slide(loads[..., 0], loads[..., 1:], np.array(list(pins.values())))
        total = total + (unknowns[..., 1:] * couples[:, None, :]).sum(axis=-1)
    return total, residual


def _add_inertia(motion: Motion, wrenches: Wrenches) -> None:
    """-m a_G and -I alpha (d'Alembert), moments about the first pin, of which that of bar 3 moves."""
    for number in MOVING_BARS:
        bar = motion.linkage.bar(number)
        arm, omega, alpha = motion.to_centre(number), motion.omega[number], motion.alpha[number]
        wrenches.push(number, -bar.mass * (1j * alpha - omega**2) * arm, 0.0)
        wrenches.twist(number, -(bar.moment_of_inertia + bar.mass * bar.mass_centre[0] ** 2) * alpha)
    a_A = (1j * motion.alpha[2] - motion.omega[2] ** 2) * motion.foot[3]
    wrenches.push(3, -motion.linkage.coupler.mass * a_A, motion.to_centre(3))


def _matrix(motion: Motion, drive_bar: int) -> Array:
    """Rows: forces on bars 2, 3, 4 and moments over the bar's length, reactions at A and B; (n, 13, 13).

    The last column is the torque over the driven bar's length, so that every number is 0, 1 or of a unit vector.
    """
    matrix = np.zeros((len(motion.theta_2), 13, 13))
    for bar, (row, first, second) in ROWS.items():
        for force in (first, second):
            matrix[:, row, COLUMN[force]] = matrix[:, row + 1, COLUMN[force] + 1] = 1.0
        u = motion.unit[bar]
        matrix[:, row + 2, COLUMN[second]], matrix[:, row + 2, COLUMN[second] + 1] = -u.imag, u.real
    matrix[:, ROWS[drive_bar][0] + 2, TORQUE] = 1.0
    for row, (force, reaction) in ((9, ("F32", "F23")), (11, ("F43", "F34"))):
        for axis in (0, 1):
            matrix[:, row + axis, COLUMN[force] + axis] = matrix[:, row + axis, COLUMN[reaction] + axis] = 1.0
    return matrix


def _right(linkage: FourBar, wrenches: Wrenches) -> Array:
    """Right-hand sides, (n, 13), N."""
    right = np.zeros((len(wrenches.moment[2]), 13))
    for bar, (row, _, _) in ROWS.items():
        right[:, row : row + 2] = -_plane(wrenches.force[bar])
        right[:, row + 2] = -wrenches.moment[bar] / linkage.bar(bar).length
    return right


def solved(matrix: Array, right: Array) -> tuple[Array, float]:
    """Solutions, NaN where the matrix is singular, and the largest residual relative to |matrix| |x| + |right|.

    One step of refinement makes each equation hold to the rounding of its own terms.
    """
    x = np.full(right.shape, np.nan)
    known = np.asarray(np.isfinite(matrix).all(axis=(1, 2)))
    known[known] = np.linalg.det(matrix[known]) != 0.0
    matrix, right = matrix[known], right[known]
    x[known] = np.linalg.solve(matrix, right)
    x[known] += np.linalg.solve(matrix, right - matrix @ x[known])
    terms = np.abs(matrix) @ np.abs(x[known]) + np.abs(right)
    left = np.abs(right - matrix @ x[known]) / np.where(terms == 0.0, 1.0, terms)
    return x, float(np.max(left, initial=0.0, where=np.isfinite(left)))


def slide(F: Complex, C: Complex, k: Array) -> Array:
    """The couples x_p = k_p |F_p + sum over q of C_pq x_q|, (n, p), grown from none; NaN where that ends in a jam.

    Parameters
    ----------
    F : pin forces without this friction, (n, p), N.
    C : what a couple of 1 N m against the rotation at pin q adds to the force at pin p, (n, p, p), 1/m.
    k : mu r of each pin, m.
    """
    x = np.full(F.shape, np.nan)
    left = np.flatnonzero(np.isfinite(F).all(axis=1) & np.isfinite(C).all(axis=(1, 2)))
    x[left] = 0.0
    for stage in range(1, FRICTION_STAGES + 1):
        x[left], grown = _grow(F[left], C[left], k * (stage / FRICTION_STAGES), x[left])
        x[left[~grown]] = np.nan
        left = left[grown]
    return x


def _grow(F: Complex, C: Complex, k: Array, x: Array) -> tuple[Array, NDArray[np.bool_]]:
    """Newton's method from the couples of a smaller friction, and where it arrives.

    The growth has turned back, into a jam, where the determinant of the equations, 1 without friction, changes its
    sign.
    """
    grown = np.zeros(len(x), dtype=bool)
    for _ in range(FRICTION_STEPS):
        force = F + (C * x[:, None, :]).sum(axis=-1)
        size = np.abs(force)
        direction = force / np.where(size == 0.0, 1.0, size)
        matrix = np.eye(len(k)) - k[:, None] * (np.conj(direction)[..., None] * C).real
        gap, terms = k * size - x, k * (np.abs(F) + (np.abs(C) * x[:, None, :]).sum(axis=-1))
        settled = (np.abs(gap) <= FRICTION_SETTLED * terms).all(axis=1)
        grown = settled & (np.linalg.det(matrix) > 0.0) & (x >= 0.0).all(axis=1)
        step = solved(matrix, gap[..., None])[0][..., 0]
        moving = ~settled & np.isfinite(step).all(axis=1)
        if not moving.any():
            break
        x = np.where(moving[:, None], x + step, x)
    return x, grown


def _plane(vectors: Complex) -> Array:
    """Components, (n, 2)."""
    return np.stack((vectors.real, vectors.imag), axis=-1)
