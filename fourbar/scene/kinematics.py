"""The quantities before the forces, from the positions of a case and their motion."""

from collections.abc import Callable, KeysView
from typing import Any

from fourbar.formulas.arithmetic import angle
from fourbar.formulas.motion import State
from fourbar.scene.case import Case
from fourbar.scene.point import OF_POINTS

OF_BARS: dict[str, Callable[[State], Any]] = {
    "theta_3": lambda state: angle(state.at.u3),
    "theta_4": lambda state: angle(state.at.u4),
    "sin_mu": lambda state: state.at.sin_mu,
    "condition": lambda state: abs(state.at.sin_mu),
    "omega_2": lambda state: state.moving.omega_2,
    "omega_3": lambda state: state.moving.omega_3,
    "omega_4": lambda state: state.moving.omega_4,
    "alpha_2": lambda state: state.moving.alpha_2,
    "alpha_3": lambda state: state.moving.alpha_3,
    "alpha_4": lambda state: state.moving.alpha_4,
}


PLACES = frozenset(start + name for start in OF_POINTS for name in ("A", "B", "G2", "G3", "G4"))


def kinematics(case: Case, state: State, wanted: KeysView[str]) -> dict[str, Any]:
    """Those of the quantities that come before the forces, a scene's own points among them."""
    values = {name: evaluate(state) for name, evaluate in OF_BARS.items() if name in wanted}
    if not case.points and wanted.isdisjoint(PLACES):
        return values
    lengths, (two, three, four) = case.lengths, case.bodies
    places: dict[int, list[tuple[str, Any]]] = {
        2: [("A", lengths.a), ("G2", two.z)],
        3: [("G3", three.z)],
        4: [("B", lengths.c), ("G4", four.z)],
    }
    for name, bar, z in case.points:
        places.setdefault(bar, []).append((name, z))
    for bar, of_bar in places.items():
        u, foot, i_omega, turn = state.direction(bar), state.foot(bar), 1j * state.omega(bar), state.turn(bar)
        v_foot = a_foot = 0.0
        if bar == 3:
            v_foot, a_foot = 1j * state.omega(2) * foot, state.turn(2) * foot
        for name, z in of_bar:
            r = z * u
            if name in wanted:
                values[name] = foot + r
            if (velocity := f"v_{name}") in wanted:
                values[velocity] = v_foot + i_omega * r
            if (acceleration := f"a_{name}") in wanted:
                values[acceleration] = a_foot + turn * r
    return values
