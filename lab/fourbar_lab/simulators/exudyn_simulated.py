"""Exudyn's own simulation by its implicit solvers.

Unknowns are nine absolute coordinates, and multipliers of all four pins and the drive.
"""

import time
from importlib.metadata import version
from typing import Any, ClassVar

import exudyn as exu
import numpy as np

from fourbar.errors import LimitError
from fourbar.linkage import PIN_FORCE
from fourbar.scene import Scene
from fourbar_lab.engines.exudyn import EXUDYN_SIZE, JOINTS, ExudynBars
from fourbar_lab.simulators.protocol_engines import (
    Course,
    Instant,
    Readings,
    Simulator,
    start,
)


class ExudynIntegrators(Simulator):
    """Exudyn's implicit integrators."""

    name = "Exudyn"
    version = version("exudyn")
    changed = (
        "built with its Python interface; the drive is a coordinate constraint whose"
        " offset follows the time"
    )
    effects = ("gravity", "viscous", "torsion", "springs")
    settings: ClassVar[dict[str, Any]] = {
        "generalized alpha": exu.DynamicSolverType.GeneralizedAlpha,
        "trapezoidal rule": exu.DynamicSolverType.TrapezoidalIndex2,
    }

    def through(self, scene: Scene, course: Course) -> Readings:
        """Run through a course.

        Multipliers, speeds and accelerations are all of the end of a step.
        """
        begin = start(scene)
        bars = ExudynBars(scene)
        if bars.terms:
            raise LimitError(
                "Exudyn's own simulation has gravity, viscous pins and springs alone"
            )
        mbs = bars.mbs
        state = bars.state
        theta_2 = begin.qpos[0]
        omega_2 = begin.qvel[0]
        bars.place(begin.qpos)
        speeds = np.linalg.solve(bars.jacobians, omega_2 * np.eye(EXUDYN_SIZE)[-1])
        initial = exu.ConfigurationType.Initial
        mbs.SetObjectParameter(
            bars.drive,
            "offsetUserFunction",
            lambda _, t, __, ___: theta_2 + omega_2 * t,
        )
        mbs.SetObjectParameter(
            bars.drive,
            "offsetUserFunction_t",
            lambda _, t, __, ___: omega_2,
        )
        state.SetODE2Coordinates(bars.q, configuration=initial)
        state.SetODE2Coordinates_t(speeds, configuration=initial)
        readings = Readings()
        done = 0

        def read(system: Any, t: float) -> bool:
            nonlocal done
            done += 1
            if done in course.stops:
                q = np.array(state.GetODE2Coordinates())
                v = np.array(state.GetODE2Coordinates_t())
                a = np.array(state.GetODE2Coordinates_tt())
                # its multipliers stand on the other side of M a = f
                exerted = -np.array(state.GetAECoordinates())
                pins = zip(JOINTS, exerted[:-1].reshape(4, 2), strict=True)
                forces = {PIN_FORCE[pin]: force for pin, force in pins}
                theta = [q[turn] for turn in bars.turn.values()]
                turn = bars.turn[2]
                readings.read(
                    scene, Instant(theta, v[turn], a[turn], exerted[-1], forces)
                )
            return True

        mbs.SetPostStepUserFunction(read)
        settings = exu.SimulationSettings()
        settings.timeIntegration.numberOfSteps = course.stops[-1]
        settings.timeIntegration.endTime = course.stops[-1] * course.timestep
        settings.timeIntegration.verboseMode = 0
        settings.solution.file.write = False
        began = time.process_time()
        mbs.SolveDynamic(settings, solverType=self.settings[self.setting])
        readings.seconds = time.process_time() - began
        return readings
