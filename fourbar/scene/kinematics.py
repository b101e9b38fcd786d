"""The quantities before the forces, from the positions of a case and their motion."""

from collections.abc import Callable, Collection
from typing import Any

import numpy as np

from fourbar.formulas.motion import State
from fourbar.linkage import MOVING_BARS
from fourbar.scene.case import Case

Quantity = Callable[[Case, State], Any]


def _of_bar(evaluate: Callable[[Case, State, int], Any], bar: int) -> Quantity:
    return lambda case, state: evaluate(case, state, bar)


def _of_bars(name: str, evaluate: Callable[[Case, State, int], Any]) -> dict[str, Quantity]:
    return {name.format(bar): _of_bar(evaluate, bar) for bar in MOVING_BARS}


KINEMATIC: dict[str, Quantity] = {
    "theta_3": lambda case, state: np.arctan2(state.at.u3.imag, state.at.u3.real),
    "theta_4": lambda case, state: np.arctan2(state.at.u4.imag, state.at.u4.real),
    "sin_mu": lambda case, state: state.at.sin_mu,
    "condition": lambda case, state: np.abs(state.at.sin_mu),
    "A": lambda case, state: state.point(2, case.lengths.a),
    "B": lambda case, state: state.point(4, case.lengths.c),
    **_of_bars("G{}", lambda case, state, bar: state.point(bar, case.bodies[bar - 2].z)),
    **_of_bars("omega_{}", lambda case, state, bar: state.omega(bar)),
    **_of_bars("alpha_{}", lambda case, state, bar: state.alpha(bar)),
    "v_A": lambda case, state: state.velocity(2, case.lengths.a),
    "v_B": lambda case, state: state.velocity(4, case.lengths.c),
    **_of_bars("v_G{}", lambda case, state, bar: state.velocity(bar, case.bodies[bar - 2].z)),
    "a_A": lambda case, state: state.acceleration(2, case.lengths.a),
    "a_B": lambda case, state: state.acceleration(4, case.lengths.c),
    **_of_bars("a_G{}", lambda case, state, bar: state.acceleration(bar, case.bodies[bar - 2].z)),
}
"""The quantities before the forces."""


def kinematics(case: Case, state: State, names: Collection[str]) -> dict[str, Any]:
    """Those of the quantities that come before the forces, a scene's own points among them."""
    values = {name: KINEMATIC[name](case, state) for name in names if name in KINEMATIC}
    for name, bar, z in case.points:
        for start, evaluate in (("", state.point), ("v_", state.velocity), ("a_", state.acceleration)):
            if start + name in names:
                values[start + name] = evaluate(bar, z)
    return values
