"""The four-bar as three free bodies, by numpy alone: no closed formula, no engine.

Newton's method solves the two closure equations for the angles. Their first derivative
is linear in b omega_3 and c omega_4, their second in b alpha_3 and c alpha_4. Forces
and moments about the first pin of each bar and the two reactions at A and B are
thirteen linear equations in F12, F32, F23, F43, F34, F14 and the torque or force of
the drive (R. L. Norton, Design of Machinery, ch. 11, has them about the mass centres).
Vectors of the plane are complex numbers, x + i y.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fourbar.linkage import MOVING_BARS, PINS, FourBar
from fourbar.quantities import COUPLE, LINE, Array, ComplexArray
from fourbar.scene import Command, Scene, find_signs, with_signs
from fourbar.scene import command as command_of
from fourbar_validation.compare.answer import Answer, Arrays
from fourbar_validation.compare.bodies import (
    BodyMotion,
    make_vector,
    pose,
    stack_components,
)
from fourbar_validation.compare.line import place_line
from fourbar_validation.compare.pins import find_mass, state_from_pins
from fourbar_validation.engines.description import (
    FORCE_AT,
    SHARED_BY_EXACT_ENGINES,
    declares,
    find_unknown,
    inertia_about_first_pin,
    list_speeds,
    look_up,
)
from fourbar_validation.engines.free_body_closure import (
    close,
    cross_products,
    find_angle,
    measure_cylinder,
)
from fourbar_validation.engines.sliding import (
    continue_couples,
    solve_couples,
    solve_system,
)

_MEET = 16.0 * 2.0**-52
"""Part of the lengths below which two points lie in one. The lengths are those by which
they are reached.
"""
FOLLOWED = np.radians(2.0)
"""Step in which angles are followed from where a motion begins, rad."""
GREATEST_WINDING = math.pi * (1.0 - 1e-12)
"""Greatest winding of a spring from rest, rad: half a turn less the rounding of an
angle of several turns.
"""
_FRICTION_STARTS = 100
"""Starts from which other solutions are sought, over six decades of couples."""
SAME_SOLUTIONS = 1e-6
"""Relative difference below which two solutions are one."""


class BodyWrenches:
    """Sums of the forces (N) and moments (N m) on the moving bars, (n,) each.

    The moments are about the first pins.
    """

    def __init__(self, n: int) -> None:
        self.force: dict[int, ComplexArray] = {
            bar: np.zeros(n, dtype=complex) for bar in MOVING_BARS
        }
        self.moment: dict[int, Array] = {bar: np.zeros(n) for bar in MOVING_BARS}

    def push(self, bar: int, force: Any, arm: Any) -> None:
        """Add a force, at `arm` from the bar's first pin.

        Forces on the ground have no effect.
        """
        if bar in self.force:
            self.force[bar] = self.force[bar] + force
            self.moment[bar] = self.moment[bar] + cross_products(arm, force)

    def couple(self, bar: int, couple: Any) -> None:
        """Add a couple; on the ground it does nothing."""
        if bar in self.moment:
            self.moment[bar] = self.moment[bar] + couple

    def twist_at(self, pin: str, couple: Any) -> None:
        """Add a couple to bar j of a pin (i, j), its opposite to bar i."""
        i, j = PINS[pin]
        self.couple(j, couple)
        self.couple(i, -couple)


def _apply_gravity(effect: Any, motion: BodyMotion, wrenches: BodyWrenches) -> None:
    """Apply m g at every mass centre."""
    for bar in MOVING_BARS:
        wrenches.push(
            bar,
            find_mass(motion.linkage.bar(bar))
            * make_vector((effect.magnitude, effect.angle)),
            motion.to_centre(bar),
        )


def _add_viscous_couple(
    effect: Any,
    motion: BodyMotion,
    wrenches: BodyWrenches,
) -> None:
    """Add couples -k (omega_j - omega_i), N m, at the pins."""
    for pin, k in effect.coefficients:
        wrenches.twist_at(pin, -k * motion.slip(pin))


def _add_friction_couple(
    effect: Any,
    motion: BodyMotion,
    wrenches: BodyWrenches,
) -> None:
    """Add couples -f sign(omega_j - omega_i), N m, at the pins.

    At rest the sign is that of the motion about to begin; without one there is none.
    """
    for pin, f in effect.torques:
        wrenches.twist_at(pin, -f * motion.sense(pin))


def _add_torsion_couple(
    effect: Any,
    motion: BodyMotion,
    wrenches: BodyWrenches,
) -> None:
    """Apply the couple -(preload + k (theta_j - theta_i - rest)).

    The angle is within half a turn.
    """
    for pin, k, rest, preload in effect.springs:
        i, j = PINS[pin]
        angle = np.angle(
            motion.unit[j] * np.conj(motion.unit[i]) * make_vector((1.0, -rest))
        )
        wrenches.twist_at(pin, -(preload + k * angle))


def _add_spring_pulls(effect: Any, motion: BodyMotion, wrenches: BodyWrenches) -> None:
    """Apply the pull preload + k (distance - length) along the points' line.

    The line has no direction where they coincide.
    """
    for spring in effect.springs:
        arms, across = motion.lay((spring.start, spring.end))
        if spring.preload == spring.stiffness * spring.length:
            pull = spring.stiffness * across
        else:
            reach = (
                sum(motion.linkage.lengths)
                + abs(spring.start.distance)
                + abs(spring.end.distance)
            )
            distance = np.where(np.abs(across) <= _MEET * reach, np.nan, np.abs(across))
            tension = spring.preload + spring.stiffness * (distance - spring.length)
            if spring.acts == "push":
                tension = np.minimum(tension, 0.0)
            elif spring.acts == "pull":  # off where the ends meet
                tension = np.maximum(np.nan_to_num(tension), 0.0)
                distance = np.nan_to_num(distance, nan=1.0)
            pull = tension / distance * across
        wrenches.push(spring.start.bar, pull, arms[0])
        wrenches.push(spring.end.bar, -pull, arms[1])


def _add_flywheel_couple(
    effect: Any,
    motion: BodyMotion,
    wrenches: BodyWrenches,
) -> None:
    """Couple -J alpha (d'Alembert)."""
    wrenches.couple(effect.bar, -effect.inertia * motion.alpha[effect.bar])


WRENCH_OF: dict[str, Callable[[Any, BodyMotion, BodyWrenches], None]] = {
    "gravity": _apply_gravity,
    "viscous": _add_viscous_couple,
    "friction": _add_friction_couple,
    "pin_friction": lambda *_: (
        None
    ),  # it depends on the pin forces, and is solved with them
    "torsion": _add_torsion_couple,
    "springs": _add_spring_pulls,
    "flywheel": _add_flywheel_couple,
}
"""Function that applies an effect, by the effect's name in a scene file. Others bring
their own.
"""


def has_wrench(effect: Any) -> bool:
    """Return True if an effect can be applied to the free bodies."""
    return effect.key in WRENCH_OF or declares(effect, "act_on_free_bodies")


def apply_effect(effect: Any, motion: BodyMotion, wrenches: BodyWrenches) -> None:
    """Add what an effect does to the free bodies."""
    act = WRENCH_OF.get(effect.key, type(effect).act_on_free_bodies)
    act(effect, motion, wrenches)


def sum_acting(scene: Scene, motion: BodyMotion) -> BodyWrenches:
    """Sum all that acts on the bars but pins, inertia and drive.

    What depends on the pin forces is left out too.
    """
    wrenches = BodyWrenches(len(motion.theta_2))
    for load in scene.loads:
        apply_load(load, motion, wrenches)
    for effect in scene.effects:
        apply_effect(effect, motion, wrenches)
    return wrenches


def apply_load(load: Any, motion: BodyMotion, wrenches: BodyWrenches) -> None:
    """Apply a force where it acts, from the bar's first pin, and a couple."""
    factor = 1.0 if load.table is None else look_up(load.table, motion.theta_2)
    if load.force is not None:
        force: Any = make_vector(load.force)
        if load.frame == "bar":
            force = motion.unit[load.bar] * force
        wrenches.push(load.bar, factor * force, find_arm(load, motion))
    wrenches.couple(load.bar, factor * load.moment)


def find_arm(load: Any, motion: BodyMotion) -> Any:
    """Return the vector from the bar's first pin to where a load acts.

    A couple without a place enters bars 2 and 4 at the shaft and bar 3 at G.
    """
    if load.arm is not None:
        return motion.to_centre(load.bar) + make_vector(load.arm)
    if load.place is not None:
        return motion.unit[load.bar] * make_vector(load.place.from_pin)
    return motion.to_centre(3) if load.bar == 3 else 0.0 * motion.unit[load.bar]


def find_wound(scene: Scene, motion: BodyMotion) -> NDArray[np.bool_] | None:
    """Return where a torsion spring is wound more than half a turn from its rest.

    The spring's turns are followed from the motion's start, in its assembly. Where the
    loop is open bars 3 and 4 lie along the line from A to O4, as at its limits. None
    where no spring counts turns.
    """
    springs = [
        spring
        for effect in scene.effects
        if effect.key == "torsion"
        for spring in effect.springs  # type: ignore[attr-defined]
    ]
    if not springs or scene.motion.free is not None:
        return None
    begins = command_of(scene)
    link = scene.linkage
    gone = np.zeros(len(motion.theta_2), dtype=bool)
    ends = np.concatenate((begins.theta_2, motion.theta_2))
    steps = math.ceil(float(np.ptp(ends)) / FOLLOWED) + 1
    path = np.unique(np.concatenate((ends, np.linspace(ends.min(), ends.max(), steps))))
    closed = close(link, path, find_signs(link, path, scene.motion.branch))
    on_path = np.isin(begins.theta_2, path[closed.assembled])
    if not on_path.any():
        return gone
    followed = np.where(closed.assembled, closed.theta, closed.in_line)
    theta_3, theta_4 = np.unwrap(followed)
    theta = {1: link.ground_angle + 0.0 * path, 2: path, 3: theta_3, 4: theta_4}
    start = begins.theta_2[on_path][0]
    first = int(np.searchsorted(path, start))
    places = np.clip(np.searchsorted(path, motion.theta_2), 0, len(path) - 1)
    for pin, _, rest, _ in springs:
        i, j = PINS[pin]
        away = theta[j] - theta[i] - rest
        turns = np.floor(away[first] / math.tau + 0.5)
        gone |= np.abs(away[places] - math.tau * turns) > GREATEST_WINDING
    return gone


def list_sliding_pins(scene: Scene) -> dict[str, float]:
    """Return mu r of each pin whose friction depends on its load, m."""
    pins = [
        pin
        for effect in scene.effects
        if effect.key == "pin_friction"
        for pin in effect.pins  # type: ignore[attr-defined]
    ]
    return {name: mu * r for name, mu, r in pins if mu * r != 0.0}


NAME = "free-body"
FORCE_COLUMNS = {"F12": 0, "F32": 2, "F23": 4, "F43": 6, "F34": 8, "F14": 10}
DRIVE_COLUMN = 12
"""The torque, or the force along a line."""
EQUATION_ROWS = {2: (0, "F12", "F32"), 3: (3, "F23", "F43"), 4: (6, "F14", "F34")}
"""First row of a bar, the force at its first pin and that at its second."""
POSITIONS_SOLVED_AT_ONCE = 4096
"""Positions solved at once. At 1.4 kB a matrix, and some four of them at a time, they
are 22 MB.
"""


class FreeBody:
    """Every compared quantity, all positions at once."""

    name = NAME
    commands = ("theta_2", "theta_3", "theta_4", "stroke")

    def answer(self, scene: Scene, command: Command) -> Answer:
        """Answer, or refuse by naming an effect that it does not know."""
        scene = state_from_pins(scene)
        if reason := find_unknown(scene, has_wrench, forces=True):
            return Answer(NAME, "exact", refusal=reason)
        if command.bar != 2 and scene.counts_turns:
            return Answer(
                NAME,
                "exact",
                refusal=(
                    "it counts the turns of springs along theta_2, not"
                    f" {command.commanded}"
                ),
            )
        asked = command
        if command.moves_stroke:
            command = find_angle(command, scene.motion, *measure_cylinder(scene))
        closed = close(scene.linkage, command.angle, command.branch, command.bar)
        theta = np.insert(closed.theta, command.bar - 2, command.angle, axis=0)
        motion = _move_bodies(scene.linkage, command, theta)
        answer = Answer(
            NAME,
            "exact",
            at=asked,
            assembled=closed.assembled,
            quantities=_list_places(motion, theta),
            evidence={
                "closure_gap": float(
                    np.max(closed.gap, initial=0.0, where=closed.assembled)
                )
            },
            shared=SHARED_BY_EXACT_ENGINES,
            own=(
                "assembly (Newton on the two closure equations), speeds and"
                " accelerations (own 2x2 Jacobian), every effect from its definition,"
                " the thirteen equations of the free bodies as one system"
            ),
        )
        if command.speed is not None:
            parts = []
            for start in range(0, max(theta.shape[1], 1), POSITIONS_SOLVED_AT_ONCE):
                block = slice(start, start + POSITIONS_SOLVED_AT_ONCE)
                some = command.part(block)
                parts.append(_list_dynamics(scene, some, theta[:, block]))
            answer.evidence["residual"] = max(residual for _, residual in parts)
            for name in parts[0][0]:
                columns = [quantities[name] for quantities, _ in parts]
                answer.quantities[name] = np.concatenate(columns)
        return answer


def _list_dynamics(
    scene: Scene, command: Command, theta: Array
) -> tuple[Arrays, float]:
    """List rates, pin forces and what the drive takes, and the largest residual.

    `theta`: angles of bars 2, 3 and 4, rad, (3, n).
    """
    motion = _move_bodies(scene.linkage, command, theta)
    forces, residual = _list_forces(scene, motion)
    quantities = motion.swing_points()
    for bar in MOVING_BARS:
        quantities[f"omega_{bar}"] = motion.omega[bar]
        quantities[f"alpha_{bar}"] = motion.alpha[bar]
    quantities |= forces
    if any(effect.dry for effect in scene.effects):
        begun = command._replace(speed=1.0, acceleration=0.0)
        omega = _move_bodies(scene.linkage, begun, theta).omega
        quantities |= _find_range_at_rest(scene, motion, omega)
    return quantities, residual


def _move_bodies(linkage: FourBar, command: Command, theta: Array) -> BodyMotion:
    """Set the bars at angles (3, n) in motion as commanded; a speed left out is 0."""
    return speeds_and_accelerations(
        pose(linkage, theta), *list_speeds(command), command.bar
    )


def _list_places(motion: BodyMotion, theta: Array) -> Arrays:
    """List the angles, the sine of those of bars 3 and 4, and the points.

    The points are pins A, B and the mass centres.
    """
    _, theta_3, theta_4 = theta
    quantities = dict(zip(("theta_2", "theta_3", "theta_4"), theta, strict=True))
    quantities["sin_mu"] = np.sin(theta_4 - theta_3)
    return quantities | motion.places()


def _list_forces(scene: Scene, motion: BodyMotion) -> tuple[Arrays, float]:
    """List pin forces, the drive's size and its condition.

    The residual of the thirteen equations is returned too.
    """
    unknowns, residual, from_jamming = balance(scene, motion)
    drive = COUPLE if scene.drive is None else LINE
    if (gone := find_wound(scene, motion)) is not None:
        unknowns[gone] = np.nan
    forces = {
        name: unknowns[:, FORCE_COLUMNS[name] : FORCE_COLUMNS[name] + 2]
        for name in FORCE_AT.values()
    }
    if scene.drive is None:
        # the sine between the bars that are not driven
        others = [bar for bar in MOVING_BARS if bar != scene.drive_bar]
        condition = np.abs(cross_products(*(motion.unit[bar] for bar in others)))
    else:
        condition = place_line(motion, scene.drive).condition
    forces["drive_condition"] = condition * from_jamming
    forces[drive.value] = unknowns[:, DRIVE_COLUMN]
    if scene.loads or scene.effects:
        alone, _, _ = balance(replace(scene, loads=(), effects=()), motion)
        forces[f"{drive.value}_inertia"] = alone[:, DRIVE_COLUMN]
    return forces, residual


def _find_range_at_rest(
    scene: Scene, motion: BodyMotion, omega: dict[int, Array]
) -> Arrays:
    """Find the least and the greatest that the drive takes where the linkage rests.

    `omega`: of a motion that may begin there, rad/s; its opposite may begin too.
    """
    drive = COUPLE if scene.drive is None else LINE
    ends = []
    for side in (1.0, -1.0):
        beginning = {bar: side * rate for bar, rate in omega.items()}
        unknowns, _, _ = balance(scene, motion._replace(beginning=beginning))
        ends.append(unknowns[:, DRIVE_COLUMN])
    return {drive.low: np.minimum(*ends), drive.high: np.maximum(*ends)}


def speeds_and_accelerations(
    posed: BodyMotion, speed: Array, acceleration: Array, bar: int = 2
) -> BodyMotion:
    """Compute speeds and accelerations where those of a bar are stated.

    NaN where the Jacobian is singular.
    """
    _, a, b, c = posed.linkage.lengths
    length = {2: a, 3: b, 4: c}
    # bar 4 is gone along from B to O4
    round_ = posed.unit | {4: -posed.unit[4]}
    others = [number for number in MOVING_BARS if number != bar]
    jacobian = np.stack(
        [stack_components(round_[number]) for number in others],
        axis=-1,
    )

    def rates(stated: Array, centripetal: ComplexArray) -> dict[int, Array]:
        right = stack_components(-length[bar] * stated * round_[bar] - 1j * centripetal)
        solved = solve_system(jacobian, right[..., None])[0][..., 0].T
        found = posed.omega | {bar: stated}
        for number, v in zip(others, solved, strict=True):
            found[number] = v / length[number]
        return found

    pull = posed.first_pin[1]
    omega = rates(speed, pull)
    for number in MOVING_BARS:
        pull = pull + length[number] * omega[number] ** 2 * round_[number]
    alpha = rates(acceleration, pull)
    return posed._replace(omega=omega, alpha=alpha)


def balance(
    scene: Scene,
    motion: BodyMotion,
) -> tuple[Array, float, Array | float]:
    """Return the thirteen unknowns (n, 13) in N and N m, their residual and jamming.

    The last is the distance of friction from jamming.
    """
    unknowns, loads, arms, residual = solve_unit_couples(scene, motion)
    total: Array = unknowns[..., 0]
    from_jamming: Array | float = 1.0
    if len(arms):
        couples, matrix = continue_couples(loads[..., 0], loads[..., 1:], arms)
        from_jamming = _compute_distance_from_jamming(matrix)
        total = total + (unknowns[..., 1:] * couples[:, None, :]).sum(axis=-1)
    return total, residual, from_jamming


def solve_unit_couples(
    scene: Scene,
    motion: BodyMotion,
) -> tuple[Array, ComplexArray, Array, float]:
    """Solve without sliding friction and per N m of it at each pin, (n, 13, 1 + p).

    Returns also the loads of these pins as complex numbers (n, p, 1 + p), mu r of each
    (m), and the residual.
    """
    pins = list_sliding_pins(scene)
    wrenches = sum_acting(scene, motion)
    _add_inertia(motion, wrenches)
    every = [wrenches]
    for pin in pins:
        unit = BodyWrenches(len(motion.theta_2))
        unit.twist_at(pin, -motion.sense(pin))
        every.append(unit)
    unknowns, residual = solve_wrenches(scene, motion, every)
    first = [FORCE_COLUMNS[FORCE_AT[pin]] for pin in pins]
    loads = unknowns[:, first] + 1j * unknowns[:, [column + 1 for column in first]]
    return unknowns, loads, np.array(list(pins.values())), residual


def solve_wrenches(
    scene: Scene,
    motion: BodyMotion,
    wrenches: Sequence[BodyWrenches],
) -> tuple[Array, float]:
    """Return the unknowns (n, 13, k) of k sums of wrenches, and the residual."""
    columns = [_make_right_sides(motion.linkage, one) for one in wrenches]
    matrix = _make_matrix(scene, motion)
    unknowns, residual = solve_system(matrix, np.stack(columns, axis=-1))
    if scene.drive is None:
        unknowns[:, DRIVE_COLUMN] *= motion.linkage.bar(scene.drive_bar).length
    return unknowns, residual


def count_solutions(scene: Scene, command: Command) -> Array:
    """Count the solutions that balance the linkage at each position, (n,).

    A solution is pin forces and friction couples; the linkage moves there.
    """
    scene = state_from_pins(scene)
    signs = with_signs(scene.linkage, command).branch
    closed = close(scene.linkage, command.angle, signs, command.bar)
    theta = np.insert(closed.theta, command.bar - 2, command.angle, axis=0)
    motion = _move_bodies(scene.linkage, command, theta)
    _, loads, arms, _ = solve_unit_couples(scene, motion)
    return np.array(
        [
            _count_at_position(F, C, arms)
            for F, C in zip(loads[..., 0], loads[..., 1:], strict=True)
        ],
        dtype=float,
    )


def _count_at_position(F: ComplexArray, C: ComplexArray, k: Array) -> int:
    """Count at one position.

    One where the couples are a contraction, else those reached from many starts.
    """
    if not (np.isfinite(F).all() and np.isfinite(C).all()):
        return 0
    if np.abs(np.linalg.eigvals(k[:, None] * np.abs(C))).max() < 1.0:
        return 1
    rng = np.random.default_rng(0)
    n = _FRICTION_STARTS
    size = float((k * np.abs(F)).max()) or 1.0
    x = (
        size
        * 10.0 ** rng.uniform(-3.0, 3.0, (n, 1))
        * rng.uniform(0.0, 1.0, (n, len(k)))
    )
    x, settled, _ = solve_couples(np.tile(F, (n, 1)), np.tile(C, (n, 1, 1)), k, x)
    solutions: list[Array] = []
    for loads in x[settled & (x >= 0.0).all(axis=1)]:
        if all(
            np.abs(loads - other).max() > SAME_SOLUTIONS * max(loads.max(), other.max())
            for other in solutions
        ):
            solutions.append(loads)
    return len(solutions)


def _add_inertia(motion: BodyMotion, wrenches: BodyWrenches) -> None:
    """Add -m a_G and -I alpha (d'Alembert), with moments about the first pins.

    The first pin of bar 3 accelerates.
    """
    for number in MOVING_BARS:
        bar = motion.linkage.bar(number)
        arm = motion.to_centre(number)
        alpha = motion.alpha[number]
        wrenches.push(number, -find_mass(bar) * motion.swing(number, arm), 0.0)
        wrenches.couple(number, -inertia_about_first_pin(bar) * alpha)
    wrenches.push(
        3,
        -find_mass(motion.linkage.coupler) * motion.swing(2, motion.first_pin[3]),
        motion.to_centre(3),
    )


def _make_matrix(scene: Scene, motion: BodyMotion) -> Array:
    """Make the matrix of the equations, (n, 13, 13).

    Rows are forces and moments of bars 2, 3, 4, and the reactions at A and B. Moments
    are divided by the bar's length, so that every entry is 0, 1 or a component of a
    unit vector. The last column is that of the torque, or the effect of 1 N of the
    drive on the bars that it pushes.
    """
    matrix = np.zeros((len(motion.theta_2), 13, 13))
    sums = [*EQUATION_ROWS.values(), (9, "F32", "F23"), (11, "F43", "F34")]
    for row, *forces in sums:
        for axis, force in product((0, 1), forces):
            matrix[:, row + axis, FORCE_COLUMNS[force] + axis] = 1.0
    for bar, (row, _, second) in EQUATION_ROWS.items():
        u = motion.unit[bar]
        matrix[:, row + 2, FORCE_COLUMNS[second]] = -u.imag
        matrix[:, row + 2, FORCE_COLUMNS[second] + 1] = u.real
    if scene.drive is None:
        matrix[:, EQUATION_ROWS[scene.drive_bar][0] + 2, DRIVE_COLUMN] = 1.0
    else:
        line = place_line(motion, scene.drive)
        unit = BodyWrenches(len(motion.theta_2))
        for (sense, point), arm in zip(line.drive.ends, line.arms, strict=True):
            unit.push(point.bar, sense * line.unit, arm)
        matrix[:, :, DRIVE_COLUMN] = -_make_right_sides(motion.linkage, unit)
    return matrix


def _make_right_sides(linkage: FourBar, wrenches: BodyWrenches) -> Array:
    right = np.zeros((len(wrenches.moment[2]), 13))
    for bar, (row, _, _) in EQUATION_ROWS.items():
        right[:, row : row + 2] = -stack_components(wrenches.force[bar])
        right[:, row + 2] = -wrenches.moment[bar] / linkage.bar(bar).length
    return right


def _compute_distance_from_jamming(matrix: Array) -> Array:
    """Compute the least singular value of Jacobians, at most 1, (n,)."""
    far = np.full(len(matrix), np.nan)
    finite = np.isfinite(matrix).all(axis=(1, 2))
    far[finite] = np.linalg.svd(matrix[finite], compute_uv=False)[:, -1]
    least: Array = np.minimum(far, 1.0)
    return least
