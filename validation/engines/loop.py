"""Assembly, motion and loop multipliers of a four-bar opened at pin B, by whatever engine moves the open tree.

Coordinates q = (turn of bar 2 at O2, of bar 3 against bar 2 at A, of bar 4 at O4). With g(q) = B on
bar 3 minus B on bar 4 and J = dg/dq the loop holds where g = 0, J v = 0, J a + (dJ/dt) v = 0, and

    [J^T e_drive] [lambda; T] = tau(q, v, a),

lambda = F43 and e_drive = the derivative of the driven bar's rotation. Every number comes from the tree.
"""

import math
import time
from collections.abc import Callable, Sequence
from typing import Any, Protocol

import numpy as np

from fourbar.linkage import MOVING_BARS
from fourbar.quantities import ANGLES, STAGE_OF, STAGES, VECTORS
from fourbar.scene import Command, Scene
from validation.compare.answer import Answer, Array
from validation.engines import effects
from validation.engines.description import FORCE_AT

START_ANGLES = np.radians(
    (
        *((30, 30), (15, 15), (45, 45), (5, 5), (5, 120)),
        *((120, 5), (60, 60), (2, 150), (150, 2), (1, 1)),
    )
).tolist()
"""rad that bars 3 and 4 first make with the diagonal A to O4, tried in turn where the triangle of the lengths as
measured is none to start from; they alone served 8000 of 8000 linkages, in four times as many steps."""
LONGEST_STEP = 0.5
"""rad; a longer Newton step leaves the region in which the gap is nearly linear."""
SHORTEST_STEP = 2.0**-40
"""A step halved this often moves nothing that a gap above the rounding could tell."""
NEWTON_STEPS = 100
"""Near a toggle Newton halves its distance: fifty steps reach the last digit from any start."""
PASSES = 1000
"""Passes over pin loads and the friction they make; each lessens the error where the friction is unique."""
REPEATED = 2.0 * 2.0**-52
"""Change of a pin load, relative, that is rounding."""
ROUNDED = 1e-11
"""Change, relative, at or below which one that no longer falls is rounding, near a pole of the torque too."""
DIVERGED = 1e100
"""Load, N, that only passes running away from each other reach."""
NOT_ANSWERED = frozenset(
    (
        *("theta_2", "omega_2", "alpha_2", "condition", "drive_condition"),
        *("torque_error", "force_error", "torque_low", "torque_high", "friction_residual"),
        *("v_A", "v_B", "v_G2", "v_G3", "v_G4"),
    )
)
"""What is commanded, follows from others that are answered, or is of the formulas alone."""
ROUNDING = 16.0 * 2.0**-52
"""Gap, relative to the sum of the lengths, that the roundings of a chain of three bars alone can leave."""


class Bars(Protocol):
    """An engine holding the bars of a scene, opened at pin A or B; every number is the engine's own."""

    def place(self, q: Sequence[float]) -> None:
        """Move to a configuration."""

    def gap(self) -> tuple[float, float]:
        """B on bar 3 minus B on bar 4, or A on bar 2 minus A on bar 3, m."""

    def jacobian(self) -> Array:
        """Derivative of the gap, (2, 3), m."""

    def angle(self, bar: int) -> float:
        """Direction of a bar's line, in (-pi, pi], rad."""

    def positions(self) -> dict[str, Array]:
        """Points O4, A, B, G2, G3, G4, "B4", the end of bar 4, and where pin A is open "A2", that of bar 2; (2,), m."""


class Tree(Bars, effects.Tree, Protocol):
    """An engine holding the open tree of a scene; it computes everything from q, v, a by itself."""

    pin_loads: dict[str, float]
    """Magnitudes of its own pin forces in the last pass, by pin, N."""

    def turn(self, bar: int) -> Array:
        """Derivative of a bar's rotation, (3,)."""

    def drift(self, v: Array) -> Array:
        """Acceleration of the gap at speeds v where a = 0, (2,), m/s^2."""

    def torques(self, v: Array, a: Array) -> Array:
        """Generalised forces that the motion asks for beyond loads and effects, (3,), N m."""

    def inertial(self, v: Array, a: Array) -> Array:
        """The same of the bars alone: without loads, effects and gravity, (3,), N m."""

    def accelerations(self) -> dict[str, Array]:
        """Accelerations of A, B, G2, G3, G4 at the motion last given, (2,) each, m/s^2."""

    def forces(self, loop_force: Array) -> dict[str, Array]:
        """F12, F32, F14 with the loop force on bar 3 at B, and its opposite on bar 4, put back."""


class Position:
    """Assembles a tree at commanded angles of bar 2, one after another."""

    def __init__(self, tree: Bars) -> None:
        self.tree = tree

    def find(self, theta_2: float, branch: int) -> tuple[float, float, float] | None:
        """The configuration on the branch, with the tree placed there, or None where the loop does not close."""
        tree = self.tree
        tree.place((theta_2, 0.0, 0.0))
        at = tree.positions()
        pin_a = at.get("A2", at["A"])
        diagonal = at["O4"] - pin_a
        e, a, d, b, c = (
            math.hypot(*vector.tolist())
            for vector in (diagonal, pin_a, at["O4"], at["B"] - at["A"], at["B4"] - at["O4"])
        )
        closed = ROUNDING * (a + d + b + c)
        # with bar 2 held, the gap is stationary only where bars 3 and 4 lie along the diagonal: this is its least value
        if max(e - (b + c), abs(b - c) - e) > closed:
            return None
        phi = math.atan2(diagonal[1], diagonal[0])
        # the triangle as measured is the nearest start, also where a bar is a millionth of the others
        triangle = _triangle_angle(e, b, c), _triangle_angle(e, c, b)
        for alpha, beta in (triangle, *START_ANGLES):
            theta_3, theta_4 = phi + branch * alpha, phi + math.pi - branch * beta
            q = theta_2, math.remainder(theta_3 - theta_2, math.tau), math.remainder(theta_4, math.tau)
            found = newton(tree, q, branch, closed)
            if found is not None:
                return found
        if max(e - (b + c), abs(b - c) - e) < -closed:
            raise ArithmeticError(f"the loop closes at theta_2 = {theta_2!r}, but Newton's method does not find it")
        return None


def _triangle_angle(e: float, near: float, far: float) -> float:
    """The angle between the sides e and near, by half-angle tangents."""
    above, below = (e - near + far) * (far + near - e), (e + near - far) * (e + near + far)
    return 2.0 * math.atan2(math.sqrt(max(above, 0.0)), math.sqrt(max(below, 0.0)))


def newton(tree: Bars, q: tuple[float, float, float], branch: int, closed: float) -> tuple[float, float, float] | None:
    """Close the gap with bar 2 held, never leaving the branch.

    The determinant of the gap's derivative by (q3, q4) is -b c sin(theta_4 - theta_3): its sign is the
    branch's. A step is halved until the gap falls and the sign is kept; the last one is taken where
    nothing smaller than `closed` (m) falls any further.
    """

    def look(q: tuple[float, float, float]) -> tuple[float, float, float, float, float, float, float]:
        tree.place(q)
        x, y = tree.gap()
        (_, a, b), (_, c, d) = tree.jacobian().tolist()
        return x, y, a, b, c, d, a * d - b * c

    here = look(q)
    if here[6] * branch >= 0.0:
        return None
    for _ in range(NEWTON_STEPS):
        x, y, a, b, c, d, det = here
        step_3, step_4 = (b * y - d * x) / det, (c * x - a * y) / det
        size = math.hypot(x, y)
        part = min(1.0, LONGEST_STEP / max(abs(step_3), abs(step_4), LONGEST_STEP))
        while True:
            trial = (q[0], q[1] + part * step_3, q[2] + part * step_4)
            there = look(trial)
            if math.hypot(there[0], there[1]) < size and there[6] * branch < 0.0:
                break
            part /= 2.0
            if size <= closed or part < SHORTEST_STEP:
                tree.place(q)
                return q if size <= closed else None
        q, here = trial, there
    return q if math.hypot(here[0], here[1]) <= closed else None


Act = Callable[[float, float], dict[str, Array | float]]
"""omega_2, alpha_2: motion and forces where the bars are placed, by name; empty where a toggle leaves them 0/0."""


def answer_exactly(engine: str, build: Callable[[Scene], Tree], scene: Scene, command: Command) -> Answer:
    """Every position by itself: assembly, velocities, accelerations, drive torque and pin forces of one engine."""
    tree = build(scene)
    loaded = [pin for effect in scene.effects for pin in effect.loaded_pins]
    tree.place((0.0, 0.0, 0.0))
    e_drive = tree.turn(scene.drive_bar)

    alone = bool(scene.loads or scene.effects)

    def act(omega_2: float, alpha_2: float) -> dict[str, Array | float]:
        return _motion_and_forces(tree, e_drive, omega_2, alpha_2, loaded, alone=alone)

    own = (
        "assembly (Newton on its own gap), velocities (own Jacobian), accelerations (own dJ/dt v), "
        "inverse dynamics, effects from its own state, loop multipliers, pin forces"
    )
    return answer_each(engine, tree, act, command, own, alone=alone)


def answer_each(
    engine: str,
    bars: Bars,
    act: Act,
    command: Command,
    own: str,
    *,
    alone: bool = False,
) -> Answer:
    """Each position assembled, and then moved and loaded by an engine.

    Parameters
    ----------
    own : what the engine finds alone, for the report.
    alone : `act` gives the torque that the bars without loads and effects take, too: `torque_inertia`.
    """
    start = time.perf_counter()
    n = len(command.theta_2)
    wanted = ("position",) if command.omega_2 is None else STAGES
    names = [name for name, stage in STAGE_OF.items() if stage in wanted and name not in NOT_ANSWERED]
    names += ["torque_inertia"] if alone and command.omega_2 is not None else []
    missing = {name: (math.nan, math.nan) if name in VECTORS else math.nan for name in names}
    rows: list[dict[str, Any]] = []
    assembled = np.zeros(n, dtype=bool)
    gap = 0.0
    position = Position(bars)
    omega_2 = np.broadcast_to(np.asarray(command.omega_2, dtype=float), (n,))
    alpha_2 = np.broadcast_to(np.asarray(command.alpha_2, dtype=float), (n,))
    for i, (theta_2, branch) in enumerate(zip(command.theta_2.tolist(), command.branch.tolist(), strict=True)):
        q = position.find(theta_2, branch)
        rows.append(missing)
        if q is None:
            continue
        assembled[i] = True
        theta_3, theta_4 = bars.angle(3), bars.angle(4)
        rows[i] = missing | {"theta_3": theta_3, "theta_4": theta_4, "sin_mu": math.sin(theta_4 - theta_3)}
        points = bars.positions()
        rows[i].update({name: points[name] for name in ("A", "B", "G2", "G3", "G4")})
        gap = max(gap, math.hypot(*bars.gap()))
        if command.omega_2 is not None:
            rows[i].update(act(float(omega_2[i]), float(alpha_2[i])))
    out = {name: np.array([row[name] for row in rows]) for name in names}
    for name in ANGLES:
        out[name][assembled] = np.unwrap(out[name][assembled])
    return Answer(
        engine,
        "exact",
        at=command,
        assembled=assembled,
        quantities=out,
        evidence={"closure_gap": gap},
        shared="the description, theta_2, omega_2, alpha_2 and the branch",
        own=own,
        seconds=time.perf_counter() - start,
    )


def _motion_and_forces(
    tree: Tree,
    e_drive: Array,
    omega_2: float,
    alpha_2: float,
    loaded: Sequence[str],
    *,
    alone: bool,
) -> dict[str, Array | float]:
    """Velocities, accelerations and forces where the tree is placed; nothing where a toggle leaves them 0/0.

    Effects that depend on the load of a pin (`loaded`) are given the loads of the pass before, until they repeat.
    `alone`: with the torque of the bars without loads and effects, of the same motion.
    """
    jacobian = tree.jacobian().tolist()
    try:
        v = _closed(jacobian, omega_2, 0.0, 0.0)
        a = _closed(jacobian, alpha_2, *tree.drift(v).tolist())
        tree.pin_loads = {}
        inertial = [tree.inertial(v, a)] if alone else []
        needed = tree.torques(v, a)
        values: dict[str, Array | float] = {}
        for bar in MOVING_BARS[1:]:
            values[f"omega_{bar}"], values[f"alpha_{bar}"] = tree.velocity(bar), tree.alpha(bar)
        values.update({f"a_{name}": value for name, value in tree.accelerations().items()})
    except np.linalg.LinAlgError:
        return {}
    try:
        matrix = np.array([*jacobian, e_drive]).T
        unknowns, *without = np.linalg.solve(matrix, np.array([needed, *inertial]).T).T
        if without:
            values["torque_inertia"] = float(without[0][2])
        forces = _forces(tree, unknowns)
        if loaded:
            settled = _settle(tree, loaded, forces, lambda: _forces(tree, np.linalg.solve(matrix, tree.torques(v, a))))
            if settled is None:  # no answer, rather than that of some pass
                return values
            forces = settled
    except np.linalg.LinAlgError:  # no torque on that bar balances the linkage here
        return values
    values.update(forces)
    return values


def _closed(jacobian: Sequence[Sequence[float]], of_2: float, x: float, y: float) -> Array:
    """Rates of the three coordinates where J rates + (x, y) = 0 and bar 2 has its own; LinAlgError at a toggle."""
    (e, a, b), (f, c, d) = jacobian
    x, y, det = x + e * of_2, y + f * of_2, a * d - b * c
    if det == 0.0:
        raise np.linalg.LinAlgError
    return np.array([of_2, (b * y - d * x) / det, (c * x - a * y) / det])


def _settle(
    tree: Tree, loaded: Sequence[str], forces: dict[str, Any], again: Callable[[], dict[str, Any]]
) -> dict[str, Any] | None:
    """Passes over pin loads and the friction they make, until they repeat; None where they never do."""
    before = math.inf
    for _ in range(PASSES):
        loads = {pin: math.hypot(*forces[FORCE_AT[pin]]) for pin in loaded}
        most = max(loads.values())
        change = max(abs(load - tree.pin_loads.get(pin, 0.0)) for pin, load in loads.items())
        # once down to the rounding of a pass, the change falls no further
        if change <= REPEATED * most or before <= change <= ROUNDED * most:
            return forces
        if not most < DIVERGED:
            return None
        before, tree.pin_loads = change, loads
        forces = again()
    return None


def _forces(tree: Tree, unknowns: Array) -> dict[str, Any]:
    """Driving torque and the four pin forces."""
    return {**tree.forces(unknowns[:2]), "F43": unknowns[:2], "torque": unknowns[2]}


def turned_by(rotation: Sequence[Sequence[float]], x: float, y: float) -> Array:
    """A vector turned by a matrix of two rows."""
    (a, b), (c, d) = rotation
    return np.array([a * x + b * y, c * x + d * y])


def turned_ground(theta_1: float, x: float, y: float) -> Array:
    """World axes of a vector along and across the ground's line, as described."""
    cos, sin = math.cos(theta_1), math.sin(theta_1)
    return turned_by(((cos, -sin), (sin, cos)), x, y)


class LimitWatch:
    """Sees bars 3 and 4 of one branch come to lie in one line, from step to step of an engine."""

    def __init__(self, branch: int) -> None:
        self.branch, self.before = branch, (0.0, 0.0)
        self.stopped_at: float | None = None

    def look(self, time: float, theta_3: float, theta_4: float) -> None:
        """Take in a state; the instant between two of them is that of the line through their sines."""
        if self.stopped_at is not None:
            return
        sine = self.branch * math.sin(theta_4 - theta_3)
        began, last = self.before
        if sine < 0.0:
            self.stopped_at = began + (time - began) * max(last, 0.0) / (max(last, 0.0) - sine)
        self.before = (time, sine)
