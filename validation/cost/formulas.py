"""The formulas' side of the study: double and single precision, the thirteen equations, fifty digits."""

import math
import time
from collections.abc import Callable
from typing import Any

import numpy as np

from fourbar.effects import Wrenches
from fourbar.kinematics import add_accelerations, add_velocities, close_loop
from fourbar.kinetostatics import add_inertia, eliminate
from fourbar.linkage import MOVING_BARS
from fourbar.scene import Command, Scene, solve
from fourbar.state import State
from validation import thirteen
from validation.answer import Array
from validation.cost.errors import PIN_FORCES, Errors
from validation.scales import divisor, yardstick

FIFTY_DIGITS = 167 + 30
"""Bits: fifty digits, and what some sixty roundings of a well-conditioned position cost."""
AT_MOST = 25
"""Positions at which errors against the reference are taken: a few milliseconds each."""
Quantities = dict[str, Any]


def few(at: Command) -> Command:
    """At most so many positions, evenly over the sweep."""
    rows = np.unique(np.linspace(0, len(at.theta_2) - 1, min(AT_MOST, len(at.theta_2))).round().astype(int))
    return at._replace(theta_2=at.theta_2[rows], branch=at.branch[rows])


def double(scene: Scene, at: Command) -> Quantities:
    """`fourbar.solve`."""
    s = solve(scene, "force", at=at)
    return {name: getattr(s, name) for name in ("torque", *PIN_FORCES)}


def single(scene: Scene, at: Command) -> Quantities:
    """The same formulas on float32 arrays."""
    state = _moving(scene, at._replace(theta_2=at.theta_2.astype(np.float32)))
    wrenches = _Single(state)
    add_inertia(wrenches, state)
    for term in (*scene.loads, *scene.effects):
        term.add_wrenches(wrenches, state)
    pins = eliminate(state, wrenches, scene.drive_bar)
    assert pins.torque.dtype == np.float32
    return {"torque": pins.torque, **{name: np.stack(getattr(pins, name), axis=1) for name in PIN_FORCES}}


class _Single(Wrenches):
    """Sums that stay in single precision: a constant load would bring its double with it."""

    def _array(self, value: Any) -> Array:
        return super()._array(value).astype(np.float32)


def _moving(scene: Scene, at: Command) -> State:
    with np.errstate(invalid="ignore", divide="ignore"):
        state = close_loop(scene.linkage, at.theta_2, at.branch)
        # a turned ground multiplies by doubles of numpy, which would bring their precision with them
        for name in ("u2", "u3", "u4"):
            setattr(state, name, tuple(part.astype(at.theta_2.dtype) for part in getattr(state, name)))
        add_velocities(state, at.omega_2)  # type: ignore[arg-type]
        add_accelerations(state, at.alpha_2)
    return state


def thirteen_equations(scene: Scene, at: Command) -> Quantities:
    """Kinematics by the formulas, then thirteen equations per position, assembled and solved."""
    x = thirteen.solve_thirteen(_bodies(scene, _moving(scene, at)), scene.drive_bar)
    columns = {name: getattr(thirteen, name) for name in PIN_FORCES}
    return {"torque": x[:, thirteen.TORQUE], **{name: x[:, k : k + 2] for name, k in columns.items()}}


def _bodies(scene: Scene, state: State) -> thirteen.FreeBodies:
    """The free bodies with what acts on them, moments about the mass centres."""
    acting = Wrenches(state)
    for term in (*scene.loads, *scene.effects):
        term.add_wrenches(acting, state)
    n = len(state.theta_2)

    def stack(vector: Any) -> Array:
        return np.stack([np.broadcast_to(part, (n,)) for part in vector], axis=1)

    first, second, force, moment = {}, {}, {}, {}
    for k in MOVING_BARS:
        bar = scene.linkage.bar(k)
        assert bar.centre is not None and bar.inertia is not None
        r, phi = bar.centre
        centre = stack(state.arm(k, r * math.cos(phi), r * math.sin(phi)))
        first[k], second[k] = -centre, stack(state.arm(k, bar.length, 0.0)) - centre
        # the thesis's order: bar 4's second pin is B as well, and its first is O4
        a_G = stack(state.acceleration(k, r * math.cos(phi), r * math.sin(phi)))
        R = stack(acting.force(k))
        force[k] = bar.mass * a_G - R
        about_G = acting.moment(k) - (centre[:, 0] * R[:, 1] - centre[:, 1] * R[:, 0])
        moment[k] = np.broadcast_to(bar.inertia * np.asarray(state.alpha(k)), (n,)) - about_G
    return thirteen.FreeBodies(first, second, force, moment)


def fifty_digits(scene: Scene, at: Command, bits: int = FIFTY_DIGITS) -> Quantities:
    """Balls of the independent reference, (n,) objects."""
    from flint import arb, ctx

    from validation.reference import inputs, outputs

    before, ctx.prec = ctx.prec, bits
    try:
        found = []
        for theta_2, branch in zip(at.theta_2.tolist(), at.branch.tolist(), strict=True):
            x = {name: arb(value) for name, value in inputs(scene, theta_2).items()}
            found.append(outputs(scene, branch, x, scene.drive_bar) or {})
    finally:
        ctx.prec = before
    out: Quantities = {"torque": [y.get("torque") for y in found]}
    return out | {name: [(y.get(f"{name}_x"), y.get(f"{name}_y")) for y in found] for name in PIN_FORCES}


def against_reference(scene: Scene, at: Command, quantities: Quantities, reference: Quantities) -> Errors:
    """Worst errors on their scales against balls of many more digits."""
    formulas = solve(scene, "force", at=at)
    worst = {}
    for name in ("torque", *PIN_FORCES):
        sizes = divisor(yardstick(name, scene, formulas, getattr(formulas, name)))
        value = 0.0
        for ours, exact, size in zip(quantities[name], reference[name], sizes.tolist(), strict=True):
            pairs = ((ours, exact),) if name == "torque" else tuple(zip(ours, exact, strict=True))
            if any(y is None for _, y in pairs):
                continue
            value = max(value, math.hypot(*(_difference(x, y) for x, y in pairs)) / size)
        worst[name] = value
    return Errors(**worst)


def _difference(ours: Any, exact: Any) -> float:
    from flint import arb

    ball = ours if isinstance(ours, arb) else arb(float(ours))
    return abs(float((ball - exact).mid()))


METHODS: dict[str, Callable[[Scene, Command], Quantities]] = {
    "formulas, double": double,
    "formulas, single": single,
    "13x13": thirteen_equations,
    "50 digits": fifty_digits,
}


def seconds(method: Callable[[Scene, Command], Quantities], scene: Scene, at: Command) -> float:
    """CPU seconds of one call."""
    began = time.process_time()
    method(scene, at)
    return time.process_time() - began
