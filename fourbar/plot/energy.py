"""The energy of a motion through time: what the bars carry, and the work that loads and effects did."""

from typing import NamedTuple

import numpy as np

from fourbar.dynamics import carrying
from fourbar.errors import DependencyError
from fourbar.kinematics import add_velocities, close_loop
from fourbar.linkage import MOVING_BARS
from fourbar.scene import Scene
from fourbar.solution import Solution
from fourbar.state import Array, State, centre_in_bar


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
        raise DependencyError('SciPy is needed for free motion: pip install "fourbar[dynamics]"') from None
    assert motion.time is not None and motion.omega_2 is not None
    state = close_loop(scene.linkage, motion.theta_2, motion.branch)
    add_velocities(state, motion.omega_2)
    groups = {"loads": scene.loads, **{effect.key: (effect,) for effect in scene.effects}}
    work = {}
    for name, terms in groups.items():
        power = np.zeros(len(motion)) + sum(term.power(state) for term in terms)
        known = np.isfinite(power)  # bars 3 and 4 in line: the velocities are 0/0
        if np.count_nonzero(known) > 1 and np.any(power[known]):
            work[name] = CubicSpline(motion.time[known], power[known]).antiderivative()(motion.time)
    return Energies(_kinetic(scene, state), work)


def _kinetic(scene: Scene, state: State) -> Array:
    linkage = carrying(scene.linkage, (*scene.loads, *scene.effects))
    total = np.zeros(len(state.theta_2))
    for number in MOVING_BARS:
        bar = linkage.bar(number)
        assert bar.inertia is not None
        vx, vy = state.velocity(number, *centre_in_bar(bar))
        total = total + 0.5 * bar.mass * (vx * vx + vy * vy) + 0.5 * bar.inertia * np.square(state.omega(number))
    return total
