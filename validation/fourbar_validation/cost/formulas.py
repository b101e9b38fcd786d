"""The formulas' side of the study: their cost and error in each arithmetic.

Compared are double and single precision, the thirteen equations, and fifty digits.
"""

import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from fourbar.effects import Actions
from fourbar.effects.effect import list_bodies
from fourbar.evaluation.case import Case, compute_shown_state
from fourbar.formulas.arithmetic import cross
from fourbar.formulas.longer import change_numbers
from fourbar.formulas.pin_forces import Wrenches
from fourbar.linkage import MOVING_BARS
from fourbar.quantities import PIN_FORCES, Array
from fourbar.scene import Command, Scene, with_signs
from fourbar.solving import solve
from fourbar_validation.advise.worst_errors import WorstErrors, find_greatest
from fourbar_validation.compare.scales import scale_of
from fourbar_validation.compare.tolerance import divide
from fourbar_validation.published import thirteen

FIFTY_DIGITS = 167 + 30
"""Bits of fifty digits. They include what some sixty roundings of a well-conditioned
position cost.
"""
POSITIONS_WITH_REFERENCE = 25
"""Positions at which errors against the reference are taken. They take a few
milliseconds each.
"""
QuantityValues = dict[str, Any]
_QUANTITIES = ("torque", *PIN_FORCES)


def choose_few(command: Command) -> Command:
    """Choose at most POSITIONS_WITH_REFERENCE positions, evenly over the sweep."""
    n = len(command.theta_2)
    places = np.linspace(0, n - 1, min(POSITIONS_WITH_REFERENCE, n))
    return command.part(np.unique(places.round().astype(int)))


def evaluate_double(scene: Scene, command: Command) -> QuantityValues:
    """Evaluate by `fourbar.solve`."""
    s = solve(scene, "force", at=command)
    return {name: s[name] for name in _QUANTITIES}


def evaluate_single(scene: Scene, command: Command) -> QuantityValues:
    """Evaluate the formulas on float32 arrays."""
    case = change_numbers(Case.of(scene), _round_single)
    path = case.path._replace(u1=np.complex64(case.path.u1))
    case = case._replace(path=path)
    with np.errstate(all="ignore"):
        # arrays of a command are doubles by their type
        theta_2: Any = command.theta_2.astype(np.float32)
        speed: Any = np.float32(command.omega_2 or 0.0)
        growth: Any = np.float32(command.alpha_2)
        half = path.half_angle(theta_2)
        moved = command._replace(angle=theta_2, speed=speed, acceleration=growth)
        state = case.assemble(moved, half)
        state = change_numbers(state, _round_single)
        dynamics = case.dynamics(state, growth)
    assert dynamics.effort.dtype == np.float32
    pins = [getattr(dynamics.pins, name) for name in PIN_FORCES]
    forces = np.moveaxis(_stack(pins, len(theta_2)), 1, 0)
    return {"torque": dynamics.effort, **dict(zip(PIN_FORCES, forces, strict=True))}


def _round_single(value: Any) -> Any:
    """Round to single precision, both parts of a vector too."""
    kind = np.complex64 if np.iscomplexobj(value) else np.float32
    return np.asarray(value).astype(kind)[()]


def _stack(vectors: Sequence[Any], n: int) -> Array:
    """Stack k complex vectors, each of one position or of n, to (n, k, 2)."""
    stacked = np.stack([np.broadcast_to(one, n) for one in vectors], 1)
    return np.stack((stacked.real, stacked.imag), -1).astype(float)


def solve_thirteen_equations(scene: Scene, command: Command) -> QuantityValues:
    """Solve thirteen equations per position, with kinematics by the formulas."""
    if any(effect.loaded_pins for effect in scene.effects):
        raise NotImplementedError(
            "friction that depends on the pin forces is not linear in them"
        )
    x = thirteen.solve_thirteen(make_bodies(scene, command), scene.drive_bar)
    values = {"torque": x[:, -1]}
    for name in PIN_FORCES:
        column = 2 * thirteen.FORCES.index(name)
        values[name] = x[:, column : column + 2]
    return values


def make_bodies(scene: Scene, command: Command) -> thirteen.EquationTerms:
    """Set up the free bodies with what acts on them, by our kinematics.

    Moments are about the mass centres.
    """
    state = compute_shown_state(scene, command)
    parts = list_bodies(scene.linkage, scene.effects)
    n = len(state.theta_2)
    placed = scene.settled()
    actions = Actions(state, parts).add((*placed.loads, *placed.effects))
    acting = actions.wrenches(Wrenches())
    arms: list[Any] = []
    forces = []
    moments = []
    for k, body in zip(MOVING_BARS, parts, strict=True):
        direction = state.direction(k)
        centre = body.z * direction
        # the thesis's order: bar 4's second pin is B as well, and its first is O4
        tip = scene.linkage.bar(k).length * direction
        arms += (-centre, tip - centre)
        R, M = acting.on(k)
        forces.append(body.m * state.acceleration(k, body.z) - R)
        about_G = M - cross(centre, R + 0.0j)
        inertial = body.I * np.asarray(state.alpha(k))
        moments.append(np.broadcast_to(inertial, n) - about_G)
    return thirteen.EquationTerms(
        _stack(arms, n).reshape(n, 3, 2, 2), _stack(forces, n), np.stack(moments, 1)
    )


def evaluate_balls(
    scene: Scene,
    command: Command,
    bits: int = FIFTY_DIGITS,
) -> QuantityValues:
    """Evaluate balls of the independent reference, (n,) objects."""
    from flint import arb, ctx

    from fourbar_validation.engines.balls import collect_inputs, compute_outputs

    command = with_signs(scene.linkage, command)
    out: QuantityValues = {name: [] for name in _QUANTITIES}
    with ctx.workprec(bits):
        positions = zip(command.theta_2.tolist(), command.branch.tolist(), strict=True)
        for theta_2, branch in positions:
            inputs = collect_inputs(scene, theta_2)
            x = {name: arb(value) for name, value in inputs.items()}
            y = compute_outputs(scene, branch, x) or {}
            out["torque"].append(y.get("torque"))
            for name in PIN_FORCES:
                out[name].append((y.get(f"{name}_x"), y.get(f"{name}_y")))
    return out


def compare_with_reference(
    scene: Scene,
    command: Command,
    quantities: QuantityValues,
    reference: QuantityValues,
) -> WorstErrors:
    """Find the worst errors on their scales against balls of many more digits."""
    formulas = solve(scene, "force", at=command)
    worst = {}
    for name in _QUANTITIES:
        sizes = scale_of(name, scene, formulas, formulas[name]).size.tolist()
        errors = []
        for size, *pair in zip(sizes, quantities[name], reference[name], strict=True):
            ours, exact = map(np.atleast_1d, pair)
            if None not in exact:
                apart = map(_compute_difference, ours, exact)
                errors.append(float(divide(math.hypot(*apart), size)))
        worst[name] = find_greatest(errors)
    return WorstErrors(**worst)


def _compute_difference(ours: Any, exact: Any) -> float:
    from flint import arb

    ball = ours if isinstance(ours, arb) else arb(float(ours))
    return abs(float((ball - exact).mid()))


METHODS_TIMED: dict[str, Callable[[Scene, Command], QuantityValues]] = {
    "formulas, double": evaluate_double,
    "formulas, single": evaluate_single,
    "13x13": solve_thirteen_equations,
    "50 digits": evaluate_balls,
}
