"""A four-bar assembled position by position, by the engine that moves its bars.

Every exact engine answers in this way.
"""

import cmath
import math
import time
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from fourbar.errors import LimitError
from fourbar.quantities import (
    ANGLES,
    LINE_QUANTITIES,
    PIN_FORCES,
    STAGE_OF,
    STAGES,
    VECTORS,
    Mask,
    Signs,
)
from fourbar.scene import Command, Scene, with_signs
from fourbar_validation.compare.answer import Answer, Arrays
from fourbar_validation.compare.pins import state_from_pins
from fourbar_validation.engines.description import (
    SHARED_BY_EXACT_ENGINES,
    list_speeds,
    list_unknowns,
    name_driving,
    reduce_angle,
)
from fourbar_validation.engines.free_body_closure import (
    NEARLY_IN_LINE,
    NEWTON_STEPS,
    find_angle,
)
from fourbar_validation.engines.loaded import Assembled, BarValues, Components, Loaded
from fourbar_validation.engines.tree import Tree, solve_closed, solve_multipliers

NOT_ANSWERED = frozenset(
    (
        "theta_2",
        "omega_2",
        "alpha_2",
        "condition",
        "drive_condition",
        "torque_error",
        "force_error",
        "torque_low",
        "torque_high",
        "friction_residual",
        "power",
        *LINE_QUANTITIES,
        "v_A",
        "v_B",
        "v_G2",
        "v_G3",
        "v_G4",
    )
)
"""Quantities that no exact engine answers: commanded ones, those that follow from
others, and those of the formulas alone.
"""
JointAngles = tuple[float, float, float]
"""Turns of bar 2 at O2, of bar 3 against bar 2 at A, of bar 4 at O4, rad."""
_CLOSING = {
    2: (3, 4),
    3: (2, 4),
    4: (3, 2),
}
"""The two bars that close the loop, by the commanded bar. In this order the sine
between them is the branch's, and they stand on the diagonal between their free ends as
bars 3 and 4 do from A to O4; bar 2 from A back to O2.
"""
ROUNDING_OF_THREE_BARS = 16.0 * 2.0**-52
"""Gap that the roundings of a chain of three bars can leave, relative to the sum of the
lengths.
"""


class Assembler:
    """Assembles a tree at commanded angles of a bar, one after another."""

    def __init__(self, tree: Assembled, bar: int = 2) -> None:
        self.tree = tree
        self.bar = bar
        # measured once, with the bars laid down along +x
        tree.place((0.0, 0.0, 0.0))
        points = {name: complex(*place) for name, place in tree.positions().items()}
        along = {
            2: points.get("A2", points["A"]),
            3: points["B"] - points["A"],
            4: points["B4"] - points["O4"],
        }
        self.ground = points["O4"]
        self.along = along[bar]
        self.closing = _CLOSING[bar]
        self.near, self.far = (abs(along[other]) for other in self.closing)
        lengths = abs(self.ground), abs(self.along), self.near, self.far
        self.closed = ROUNDING_OF_THREE_BARS * sum(lengths)

    def find(self, theta: float, branch: int) -> JointAngles | None:
        """Return the joint angles on the branch, rad, None if the loop does not close.

        The tree is placed at these angles.
        """
        bar = self.bar
        near = self.near
        far = self.far
        closed = self.closed
        theta = theta if bar == 2 else reduce_angle(theta)
        held = self.along * complex(math.cos(theta), math.sin(theta))
        diagonal = self.ground + held if bar == 4 else self.ground - held
        e, phi = cmath.polar(diagonal)
        # the gap with a bar held is stationary only where the others lie along the
        # diagonal: this is its least value
        least_gap = max(e - (near + far), abs(near - far) - e)
        if least_gap > closed:
            return None
        # of equal bars that lie on each other the corner is not on the ground pin
        e = max(e, closed / 4.0)
        first, second = self.closing
        angles = {
            bar: theta,
            first: phi + branch * _compute_triangle_angle(e, near, far),
            second: phi + math.pi - branch * _compute_triangle_angle(e, far, near),
        }
        if bar == 4:
            angles[2] += math.pi
        q = (
            angles[2],
            math.remainder(angles[3] - angles[2], math.tau),
            math.remainder(angles[4], math.tau),
        )
        assembled = self._close_gap(q, branch)
        if assembled is None and least_gap < -closed:
            raise ArithmeticError(
                f"the loop closes at theta_{bar} = {theta!r}, but Newton's method does"
                " not find it"
            )
        return assembled

    def _close_gap(self, q: JointAngles, branch: int) -> JointAngles | None:
        """Close the gap with a bar held, never leaving the branch.

        The determinant of the gap's derivative by the angles of the others, for bar 2
        -b c sin(theta_4 - theta_3), has the branch's sign. The last step is the one
        after which the gap falls no further. An answer that stops a step earlier has
        other last digits, and near a change point these decide whether forces can be
        told.
        """
        first, second = self.closing
        size, (step_1, step_2) = self._look(q, branch)
        for _ in range(NEWTON_STEPS):
            turned = {self.bar: 0.0, first: step_1, second: step_2}
            trial = (
                q[0] + turned[2],
                q[1] + (turned[3] - turned[2]),
                q[2] + turned[4],
            )
            trial_size, steps = self._look(trial, branch)
            if not trial_size < size:
                break
            q = trial
            size = trial_size
            step_1, step_2 = steps
        self.tree.place(q)
        return q if size <= self.closed else None

    def _look(self, q: JointAngles, branch: int) -> tuple[float, Components]:
        """Return the gap at joint angles, m, and Newton's steps of the closing bars.

        The gap is infinite off the branch.
        """
        tree = self.tree
        tree.place(q)
        x, y = tree.gap()
        (e, a, b), (f, c, d) = tree.jacobian().tolist()
        # a bar turns alone where the joints of those that it carries turn back
        slopes = {2: (e - a, f - c), 3: (a, c), 4: (b, d)}
        (a, c), (b, d) = (slopes[bar] for bar in self.closing)
        det = a * d - b * c
        if not det * branch < 0.0:
            return math.inf, (0.0, 0.0)
        return math.hypot(x, y), ((b * y - d * x) / det, (c * x - a * y) / det)


def _compute_triangle_angle(e: float, near: float, far: float) -> float:
    """Compute the angle between the sides e and near, by half-angle tangents.

    The corner is never on the side e, as for the free bodies. Plain numbers take an
    eighth of the time that NumPy takes for one corner.
    """
    above = (e - (near - far)) * (near + far - e)
    below = (e + (near - far)) * (near + far + e)
    angle = 2.0 * math.atan2(math.sqrt(max(above, 0.0)), math.sqrt(max(below, 0.0)))
    least = NEARLY_IN_LINE * min(near, far) / near
    return min(max(angle, least), math.pi - least)


@dataclass(slots=True)
class Exact:
    """An engine that answers each position by itself."""

    name: str
    build: Callable[[Scene], Loaded]
    """Function that builds the engine's bars from the description. LimitError, of it or
    of a method of the bars, says why the engine cannot hold them.
    """
    commands: tuple[str, ...] = ("theta_2", "theta_3", "theta_4", "stroke")

    def answer(self, scene: Scene, command: Command) -> Answer:
        """Answer, or refuse by naming what it does not know or cannot hold."""
        scene = state_from_pins(scene)
        try:
            return self._answer(self.build(scene), scene, command)
        except LimitError as error:
            return Answer(self.name, "exact", refusal=str(error))

    def _answer(self, bars: Loaded, scene: Scene, command: Command) -> Answer:
        start = time.perf_counter()
        asked = command
        moves = command.speed is not None
        wanted = STAGES if moves else ("position",)
        names = [
            name
            for name, stage in STAGE_OF.items()
            if stage in wanted and name not in NOT_ANSWERED
        ]
        input_follows = command.bar != 2 or command.moves_stroke
        if input_follows:
            names += MADE if moves else MADE[:1]
        if command.moves_stroke:
            command = find_angle(command, scene.motion, *bars.cylinder(command.bar))
        names = list_unknowns(scene, names)
        if bars.alone and moves:
            names.append(f"{name_driving(scene)}_inertia")

        position = Assembler(bars, command.bar)
        gaps = [0.0]

        def read(theta: float, branch: int, *rates: float) -> BarValues | None:
            if position.find(theta, branch) is None:
                return None
            gaps.append(math.hypot(*bars.gap()))
            values: BarValues = dict(bars.positions())
            values["theta_3"] = theta_3 = bars.angle(3)
            values["theta_4"] = theta_4 = bars.angle(4)
            values["sin_mu"] = math.sin(theta_4 - theta_3)
            if input_follows:
                values["theta_2"] = bars.angle(2)
            if moves:
                values |= bars.move(command.bar, *rates)
            return values

        out, assembled = read_each(command, names, read)
        for name in ANGLES:  # continuous along the sweep
            out[name][assembled] = np.unwrap(out[name][assembled])
        return Answer(
            self.name,
            "exact",
            asked,
            assembled,
            out,
            evidence={"closure_gap": max(gaps)},
            shared=SHARED_BY_EXACT_ENGINES,
            own=bars.own,
            seconds=time.perf_counter() - start,
        )


Read = Callable[[float, int, float, float], Mapping[str, Any] | None]
"""Function of angle, branch, speed and acceleration of the commanded bar that returns
values by name, None where the loop does not close.
"""


def read_each(
    command: Command, names: Iterable[str], read: Read
) -> tuple[Arrays, Mask]:
    """Read each position, NaN where there is no value; and where the loop closes."""
    out = make_blank(len(command.angle), names)
    closed = np.zeros(len(command.angle), dtype=bool)
    columns = command.angle, command.branch, *list_speeds(command)
    positions = zip(*(column.tolist() for column in columns), strict=True)
    for i, position in enumerate(positions):
        values = read(*position)
        if values is not None:
            closed[i] = True
            for name, array in out.items():
                array[i] = values.get(name, math.nan)
    return out, closed


MADE = ("theta_2", "omega_2", "alpha_2")
"""The motion that an engine really made."""


def make_blank(
    n: int,
    names: Iterable[str],
) -> Arrays:
    """Return NaN for each of n positions, (n,) or (n, 2)."""
    blank = {}
    for name in names:
        shape = (n, 2) if name in VECTORS else (n,)
        blank[name] = np.full(shape, np.nan)
    return blank


def split_answer(
    out: Arrays,
    branch: Signs,
) -> tuple[Command, Arrays]:
    """Split what was read into a command and the other quantities.

    The command is the motion that was made.
    """
    theta_2, omega_2, alpha_2 = (out[name] for name in MADE)
    rest = {name: values for name, values in out.items() if name not in MADE}
    return Command(theta_2, branch, omega_2, alpha_2), rest


class PlainLoop:
    """A scene in the tree of one engine, asked for torque and pin forces alone.

    A position takes Newton's steps on the gap, the rates of the closed loop, one
    inverse dynamics and the multipliers, as a user would write them.

    Raises LimitError for a cylinder, and for friction that depends on the pin forces.
    """

    def __init__(self, build: Callable[[Scene], Tree], scene: Scene) -> None:
        if scene.drive is not None:
            raise LimitError("the plain loop has a couple on a bar, no cylinder")
        self.linkage = scene.linkage
        self.tree = tree = build(state_from_pins(scene))
        if tree.loaded:
            raise LimitError("the plain loop does not iterate over loads of pins")
        self.position = Assembler(tree)
        self.drive = tree.turns[scene.drive_bar]

    def answer(self, command: Command) -> Arrays:
        """Return the torque, (n,), and the pin forces, (n, 2)."""
        tree = self.tree

        def read(
            theta: float, branch: int, speed: float, acceleration: float
        ) -> dict[str, Any]:
            if self.position.find(theta, branch) is None:
                raise LimitError("the loop does not close at every position")
            jacobian = tree.jacobian()
            v = solve_closed(jacobian, speed)
            a = solve_closed(jacobian, acceleration, drift=tree.drift(v))
            tree.moving(v, a)
            x, y, torque = solve_multipliers(jacobian, self.drive, tree.torques())
            forces = tree.forces(complex(x, y), torque)
            return {"torque": torque, "F43": (x, y), **forces}

        signed = with_signs(self.linkage, command)
        answered, _ = read_each(signed, ("torque", *PIN_FORCES), read)
        return answered
