"""Where the declared limits of the engines lie, measured.

Each holds at one value of what it limits, not at another. An engine upgrade that lifts
a limit, or makes it worse, is then noticed.
"""

from dataclasses import replace
from math import acos, sqrt
from typing import NamedTuple

import mujoco
import numpy as np

from fourbar.mjcf import RECIPE, write_mjcf
from fourbar.mjcf.document import compute_load_ratio
from fourbar.scene import command
from fourbar.scene.motion import Motion
from fourbar_validation.compare.tolerance import SIMULATED
from fourbar_validation.engines import limits, pinocchio
from fourbar_validation.engines.mujoco import closed_loop, runner, simulate
from fourbar_validation.scenes.hard_families import (
    draw_lengths_of_type,
    dress,
    replace_bars,
    scale_loads,
    set_angles,
    sweep_turn,
)
from fourbar_validation.scenes.random import DrawnType


class Measured(NamedTuple):
    """One limit, and what asks the engine itself at a value of the limited quantity."""

    of: limits.Boundary
    inside: float
    outside: float
    holds: object


def _simulated(scene):
    """The simulation itself, whatever its declared limits."""
    course = runner.RunCourse(scene, command(scene))
    return simulate._Simulation(RECIPE, course, bounded=False).answer()


def _near_toggle(sine):
    """Tell whether a sweep that ends near a toggle is followed without an alarm.

    |sin mu| has this value at its end.
    """
    d, a, b, c = draw_lengths_of_type(DrawnType.TRIPLE_ROCKER, 1)
    cosine = -sqrt(1.0 - sine * sine)
    squared = b * b + c * c - 2.0 * b * c * cosine
    psi = acos((d * d + a * a - squared) / (2.0 * d * a))
    return not _simulated(
        set_angles(dress((d, a, b, c), 1), np.linspace(psi - 0.5, psi, 20))
    ).alarms


_BASE = sweep_turn(dress((0.3, 0.1, 0.25, 0.22)))


def _at_speed(omega_2):
    return replace(_BASE, motion=_BASE.motion.replace(speed=omega_2))


def _crank_acceleration(value):
    answer = _simulated(replace(_at_speed(sqrt(value / 0.1)), loads=(), effects=()))
    return not answer.alarms and answer.evidence["force_gap"] < 1e-3


def _loaded(ratio):
    (_, scene), *_ = scale_loads(exponents=(3,))
    times = ratio / compute_load_ratio(scene)
    heavier = tuple(
        replace(
            load,
            force=load.force and (load.force[0] * times, load.force[1]),
            moment=load.moment * times,
        )
        for load in scene.loads
    )
    answer = _simulated(replace(scene, loads=heavier))
    return not answer.alarms and answer.evidence["acceleration_gap"] < SIMULATED.factor


def _starts(acceleration):
    """Tell whether the file brings the crank from rest to its speed in two steps."""
    settings = replace(RECIPE, timestep=_BASE.motion.speed / (2.0 * acceleration))
    loop = closed_loop.ClosedLoop(write_mjcf(_BASE, settings))
    mujoco.mj_step(loop.model, loop.data, 10)
    return not loop.bad()


def _in_narrow_window(uneven):
    """Tell whether a narrow sweep between long bars is followed without an alarm."""
    scene = dress((uneven, 1.0, 2.0, uneven), 1)
    return not _simulated(set_angles(scene, np.linspace(1.0, 1.001, 3))).alarms


def _compiles(inertia):
    inertias = " ".join([repr(inertia)] * 3)
    try:
        mujoco.MjModel.from_xml_string(f"""<mujoco><worldbody><body><joint/>
            <inertial pos="0 0 0" mass="1" diaginertia="{inertias}"/>
            </body></worldbody></mujoco>""")
    except ValueError:
        return False
    return True


def _centre_kept(r):
    """Tell whether the compiled MJCF keeps a mass centre at a distance r from its pin,
    m.
    """
    scene = replace_bars(_BASE, output=replace(_BASE.linkage.output, centre=(r, 0.5)))
    loop = closed_loop.ClosedLoop(
        write_mjcf(scene, replace(RECIPE, timestep=1e-3), keyframe=False)
    )
    return not closed_loop.merges_points(loop.model)


def _proximal(mu):
    """Tell whether Pinocchio's constrained acceleration is finite at a proximal mu."""
    scene = replace(_BASE, loads=(), motion=Motion(1.0, 3.0))
    kept = pinocchio.PROXIMAL_SETTINGS
    try:
        pinocchio.PROXIMAL_SETTINGS = (kept[0], mu, kept[2] if mu else 1)
        released = pinocchio.PinocchioReleased().release(scene, np.array([0.0, 0.01]))
    finally:
        pinocchio.PROXIMAL_SETTINGS = kept
    return np.isfinite(released.quantities["theta_2"]).all()


MEASURED = (
    Measured(limits.NEAREST_TOGGLE, 0.06, 0.01, _near_toggle),
    Measured(
        limits.FASTEST,
        3e4,
        3e5,
        lambda omega_2: not _simulated(_at_speed(omega_2)).alarms,
    ),
    Measured(limits.SLOWEST, 1e-10, 1e-11, _crank_acceleration),
    Measured(limits.HEAVIEST, 1e10, 1e11, _loaded),
    Measured(limits.NEAREST_CENTRE, 2e-6, 5e-7, _centre_kept),
    Measured(limits.LIGHTEST, 1.001e-15, 0.999e-15, _compiles),
    Measured(limits.QUICKEST_START, 1e9, 1e11, _starts),
    Measured(limits.MOST_UNEVEN, 1e3, 1e5, _in_narrow_window),
    Measured(limits.PROXIMAL_BOUNDARY, 1e-8, 0.0, _proximal),
)
