"""One scene run through in time with any settings of MuJoCo: what accuracy costs, tried out.

The scene is assembled once by the engine itself; each trial compiles the generated MJCF anew, with
the drive to be tried, and reports its own motion, torque, pin forces and CPU seconds.
"""

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace

import mujoco
import numpy as np

from fourbar.errors import LimitError
from fourbar.mjcf import Settings, mjcf, run_through
from fourbar.mjcf.effects import unwound
from fourbar.quantities import PIN_FORCES
from fourbar.scene import Command, Scene
from validation.compare.answer import Array
from validation.engines.mujoco.closed_loop import O2, ClosedLoop, couple_elsewhere

LIGHT_FLYWHEEL = 1e4
"""Flywheel of the model that gives T3 or T4: heavy enough to keep the closure's softness
small, light enough that the torque it needs does not drown in its rounding."""
Build = Callable[[str, float], ClosedLoop]
"""From the MJCF text and the speed to keep (rad/s) to the loop that is stepped."""


@contextmanager
def silence() -> Iterator[None]:
    """A setting that fails is a result here: MuJoCo neither prints it nor leaves a log in the working folder."""
    before = mujoco.get_mju_user_warning()
    mujoco.set_mju_user_warning(lambda _: None)
    try:
        yield
    finally:
        mujoco.set_mju_user_warning(before)


@dataclass(slots=True, eq=False)
class Trial:
    """What one run through the scene gave."""

    at: Command
    """The motion that was really made."""
    quantities: dict[str, Array]
    """Torque (n,) and pin forces (n, 2), under the names of `fourbar.Solution`."""
    steps: int
    steps_per_revolution: float
    """At the fastest speed of the run."""
    stepping: float
    """CPU seconds in steps."""
    reading: float
    """CPU seconds in reading the samples."""
    broken: str = ""
    """What MuJoCo reported of itself, where it lost the motion."""


class Rig:
    """A scene, ready to be tried with any settings.

    Raises LimitError for a scene that cannot be run through in time.
    """

    def __init__(self, scene: Scene, command: Command) -> None:
        if scene.motion.free is not None or not np.any(command.omega_2) or np.ptp(command.theta_2) == 0.0:
            raise LimitError("nothing to run through in time: a sweep of theta_2 at omega_2 is needed")
        self.omega, self.alpha = float(np.max(command.omega_2)), float(np.max(command.alpha_2))  # type: ignore[arg-type]
        motion = replace(scene.motion, theta_2=command.theta_2, omega_2=self.omega, alpha_2=self.alpha)
        self.scene, self.command = replace(scene, motion=motion), command
        order = np.argsort(command.theta_2 if self.omega > 0.0 else -command.theta_2, kind="stable")
        position = ClosedLoop(mjcf(self.scene, Settings(timestep=1e-3), keyframe=False)).position()
        self.stretches: list[list[int]] = [[]]
        self.start: dict[int, tuple[float, float, float]] = {}
        for index in order:
            found = position.find(float(command.theta_2[index]), int(command.branch[index]))
            if found is None:
                self.stretches.append([])
                continue
            if not self.stretches[-1]:
                self.start[int(index)] = found
            self.stretches[-1].append(int(index))
        self.stretches = [stretch for stretch in self.stretches if len(stretch) > 1]
        if not self.stretches:
            raise LimitError("the loop closes at no two neighbouring positions: nothing to run through in time")

    def text(self, settings: Settings, timestep: float) -> str:
        """The generated MJCF, without its keyframe."""
        return mjcf(self.scene, replace(settings, timestep=timestep, timestep_scale=1.0), keyframe=False)

    def timestep(self, settings: Settings, stretch: list[int]) -> float:
        """A whole number of steps over the stretch."""
        return run_through(self.command.theta_2[stretch], self.omega, self.alpha).timestep(settings)

    def steps(self, settings: Settings) -> int:
        """Steps of one run, without making it."""
        total = 0
        for stretch in self.stretches:
            run = run_through(self.command.theta_2[stretch], self.omega, self.alpha)
            total += round(run.time(run.stop) / run.timestep(settings))
        return total

    def try_out(self, settings: Settings, build: Build | None = None) -> Trial:
        """Run through every stretch of positions that assembles and read at the step nearest to each."""
        samples = [index for stretch in self.stretches for index in stretch]
        n = len(samples)
        motion = {name: np.full(n, np.nan) for name in ("theta_2", "omega_2", "alpha_2", "torque")}
        forces = {name: np.full((n, 2), np.nan) for name in PIN_FORCES}
        trial = Trial(self.command, {}, 0, 0.0, 0.0, 0.0)
        first = 0
        with silence():
            for stretch in self.stretches:
                self._run(stretch, settings, build or (lambda text, _: ClosedLoop(text)), first, motion, forces, trial)
                first += len(stretch)
                if trial.broken:
                    break
        trial.quantities = {"torque": motion.pop("torque"), **forces}
        trial.at = Command(motion["theta_2"], self.command.branch[samples], motion["omega_2"], motion["alpha_2"])
        return trial

    def _run(
        self,
        stretch: list[int],
        settings: Settings,
        build: Build,
        first: int,
        motion: dict[str, Array],
        forces: dict[str, Array],
        trial: Trial,
    ) -> None:
        run = run_through(self.command.theta_2[stretch], self.omega, self.alpha)
        timestep = self.timestep(settings, stretch)
        loop = build(self.text(settings, timestep), self.omega)
        light = None
        if self.scene.drive_bar != 2:
            light = ClosedLoop(self.text(replace(settings, flywheel=LIGHT_FLYWHEEL), timestep))
        start = self.start[stretch[0]]
        wound = unwound(self.scene, start)
        loop.set_state(wound, self.omega)
        turns, done = wound[O2] - start[O2], 0
        for row, index in enumerate(stretch, first):
            step = round(run.time(float(self.command.theta_2[index])) / timestep)
            began = time.process_time()
            if step > done:
                mujoco.mj_step(loop.model, loop.data, step - done)
                done = step
            stepped = time.process_time()
            loop.forward()
            d = loop.data
            lost = d.time < done * timestep * (1.0 - 1e-6)  # a reset starts time again, and clears the warnings
            if lost or loop.bad() or not np.isfinite(d.qacc).all():
                trial.broken = "MuJoCo lost the motion: a value not finite, or too large"
                break
            motion["theta_2"][row] = d.qpos[O2] - turns
            motion["omega_2"][row], motion["alpha_2"][row] = d.qvel[O2], d.qacc[O2]
            motion["torque"][row] = loop.crank_torque()
            read = loop.forces
            if light is not None:
                crank = float(motion["torque"][row])
                couple = couple_elsewhere(loop, light, self.scene.drive_bar, self.alpha, crank)
                motion["torque"][row] = np.nan if couple is None else couple
                read = light.forces
            for name, force in read().items():
                forces[name][row] = force
            trial.stepping += stepped - began
            trial.reading += time.process_time() - stepped
        trial.steps += done
        trial.steps_per_revolution = max(trial.steps_per_revolution, 2.0 * np.pi / run.fastest / timestep)

    def seconds_per_step(self, settings: Settings, build: Build | None = None) -> Callable[[int], float]:
        """CPU seconds of a number of steps from the start of the longest stretch; each call starts there again."""
        stretch = max(self.stretches, key=len)
        timestep = self.timestep(settings, stretch)
        make = build or (lambda text, _: ClosedLoop(text))
        loop = make(self.text(settings, timestep), self.omega)

        def clock(steps: int) -> float:
            loop.set_state(self.start[stretch[0]], self.omega)
            with silence():
                began = time.process_time()
                mujoco.mj_step(loop.model, loop.data, steps)
                return time.process_time() - began

        return clock
