"""The energy of a motion through time: what the bars carry, and the work that loads and effects did."""

from typing import NamedTuple

import numpy as np

from fourbar.effects.actions import Actions, bodies
from fourbar.errors import DependencyError, installing
from fourbar.formulas.arithmetic import dot
from fourbar.formulas.motion import State
from fourbar.linkage import MOVING_BARS
from fourbar.scene import Command, Scene
from fourbar.scene.case import state_at
from fourbar.solution import Array, Solution


class Energies(NamedTuple):
    """Energies at n instants, J."""

    kinetic: Array
    """(n,)."""
    work: dict[str, Array]
    """Done since the first instant, (n,): by all loads together, and by each effect that does any."""


def energies(scene: Scene, motion: Solution) -> Energies:
    """Kinetic energy, and the work of each effect and of the loads.

    T = sum of m v_G^2/2 + I omega^2/2;   W(t) = integral of the power, by a cubic spline through the instants.

    Raises DependencyError where SciPy is not installed.
    """
    try:
        from scipy.interpolate import CubicSpline
    except ModuleNotFoundError:
        raise DependencyError(f"SciPy is needed for free motion: {installing('dynamics')}") from None
    assert motion.time is not None and motion.omega_2 is not None
    state = state_at(scene, Command(motion.theta_2, motion.branch, motion.omega_2, 0.0))
    groups = {"loads": scene.loads, **{effect.key: (effect,) for effect in scene.effects}}
    work = {}
    for name, terms in groups.items():
        actions = Actions(state, bodies(scene.linkage))
        for term in terms:
            term.act(actions, state)
        power = np.zeros(len(motion)) + actions.work()[0] * motion.omega_2
        known = np.isfinite(power)  # bars 3 and 4 in line: the velocities are 0/0
        if np.count_nonzero(known) > 1 and np.any(power[known]):
            work[name] = CubicSpline(motion.time[known], power[known]).antiderivative()(motion.time)
    return Energies(_kinetic(scene, state), work)


def _kinetic(scene: Scene, state: State) -> Array:
    total = np.zeros(len(state.theta_2))
    for number, body in zip(MOVING_BARS, bodies(scene.linkage, scene.effects), strict=True):
        v = state.velocity(number, body.z)
        total = total + 0.5 * body.m * dot(v, v) + 0.5 * body.I * np.square(state.omega(number))
    return total
