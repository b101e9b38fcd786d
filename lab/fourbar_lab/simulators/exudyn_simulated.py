"""Exudyn's own simulation: nine absolute coordinates, its implicit solvers, all four pins and the drive multipliers."""

import time
from importlib.metadata import version
from typing import Any

import exudyn as exu
import numpy as np

from fourbar.errors import LimitError
from fourbar.linkage import PIN_FORCE
from fourbar.scene import Scene
from fourbar_lab.engines.exudyn import JOINTS, SIZE, ExudynBars
from fourbar_lab.simulators.motion import Instant, Readings, start, turn

VERSION = version("exudyn")
STEPS = (314, 1256, 5024)
CHANGED = "built with its Python interface; the drive is a coordinate constraint whose offset follows the time"
SETTINGS: dict[str, Any] = {
    "generalized alpha, index 3 (its default)": exu.DynamicSolverType.GeneralizedAlpha,
    "trapezoidal rule, index 2": exu.DynamicSolverType.TrapezoidalIndex2,
}


def through(scene: Scene, steps: int, setting: str) -> Readings:
    """Simulate a turn; multipliers, speeds and accelerations are all of the end of a step."""
    timestep, stops = turn(scene, steps)
    begin, bars = start(scene), ExudynBars(scene)
    if bars.terms:
        raise LimitError("Exudyn's own simulation has gravity, viscous pins and springs alone")
    mbs, state = bars.mbs, bars.state
    theta_2, omega_2 = begin.qpos[0], begin.qvel[0]
    bars.place(begin.qpos)
    speeds = np.linalg.solve(bars.jacobians, omega_2 * np.eye(SIZE)[-1])
    initial = exu.ConfigurationType.Initial
    mbs.SetObjectParameter(bars.drive, "offsetUserFunction", lambda _, t, __, ___: theta_2 + omega_2 * t)
    mbs.SetObjectParameter(bars.drive, "offsetUserFunction_t", lambda _, t, __, ___: omega_2)
    state.SetODE2Coordinates(bars.q, configuration=initial)
    state.SetODE2Coordinates_t(speeds, configuration=initial)
    found, done = Readings(setting, steps), 0

    def read(system: Any, t: float) -> bool:
        nonlocal done
        done += 1
        if done in stops:
            q, v, a = (np.array(get()) for get in (state.GetODE2Coordinates, state.GetODE2Coordinates_t,
                                                   state.GetODE2Coordinates_tt))  # fmt: skip
            exerted = -np.array(state.GetAECoordinates())  # its multipliers stand on the other side of M a = f
            forces = {PIN_FORCE[pin]: exerted[2 * number : 2 * number + 2] for number, pin in enumerate(JOINTS)}
            theta = [q[turn] for turn in bars.turn.values()]
            found.read(scene, Instant(theta, v[bars.turn[2]], a[bars.turn[2]], exerted[-1], forces))
        return True

    mbs.SetPostStepUserFunction(read)
    settings = exu.SimulationSettings()
    settings.timeIntegration.numberOfSteps = steps
    settings.timeIntegration.endTime = steps * timestep
    settings.timeIntegration.verboseMode = 0
    settings.solution.file.write = False
    began = time.process_time()
    mbs.SolveDynamic(settings, solverType=SETTINGS[setting])
    found.seconds = time.process_time() - began
    return found
