"""The one runner through time: a model is stepped from the state it is in and read at stated instants."""

from collections.abc import Callable, Iterable

import mujoco

from fourbar.mjcf.effects import unwind
from fourbar.scene import Command, Scene
from fourbar_validation.compare.answer import Array
from fourbar_validation.engines.loop import Assembler
from fourbar_validation.engines.mujoco.closed_loop import O2, ClosedLoop, solve_couple_elsewhere
from fourbar_validation.engines.mujoco.motions import MotionSegment

LIGHT_FLYWHEEL = 1e4
"""Flywheel of the model that gives T3 or T4: heavy enough to keep the closure's softness
small, light enough that the torque it needs does not drown in its rounding."""
Found = tuple[float, float, float] | None
"""Own joint angles (O2, A, O4), None where the loop does not close."""


class Stepper:
    """Counts the steps of a model from its present state on."""

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData, timestep: float) -> None:
        self.model, self.data, self.timestep, self.done = model, data, timestep, 0

    def to(self, seconds: float, each: Callable[[float], None] | None = None) -> None:
        """Step on to the step nearest to a time; `each` is called with the time after every step."""
        steps = round(seconds / self.timestep) - self.done
        if each is None:
            if steps > 0:
                mujoco.mj_step(self.model, self.data, steps)
                self.done += steps
            return
        for _ in range(steps):
            mujoco.mj_step(self.model, self.data)
            self.done += 1
            each(self.time)

    @property
    def time(self) -> float:
        """Return what the model's own time must be, s."""
        return self.done * self.timestep

    def lost(self) -> bool:
        """Tell whether MuJoCo reset the data: that starts time again, and clears the warnings."""
        return bool(self.data.time < self.time * (1.0 - 1e-6))


class SimulatedRun:
    """One segment of positions at a prescribed motion; `light` is the model that a drive elsewhere is read from."""

    def __init__(
        self,
        scene: Scene,
        loop: ClosedLoop,
        light: ClosedLoop | None,
        motion_segment: MotionSegment,
        start: tuple[float, float, float],
        timestep: float,
    ) -> None:
        self.scene, self.loop, self.light, self.motion_segment = scene, loop, light, motion_segment
        wound = unwind(scene, start)
        self.turns = wound[O2] - start[O2]
        """Whole turns by which MuJoCo's theta_2 is ahead: springs at pins count them, rad."""
        loop.set_state(wound, motion_segment.omega, motion_segment.bar)
        self.begins = self.progress()
        self.stepper = Stepper(loop.model, loop.data, timestep)

    def progress(self) -> float:
        """Angle or stroke of what moves as commanded."""
        return self.loop.stroke() if (bar := self.motion_segment.bar) is None else self.loop.angle(bar)

    def to(self, index: int) -> None:
        """Step on to the step nearest to a position."""
        self.stepper.to(self.motion_segment.seconds(index))

    def read(self) -> tuple[float | None, dict[str, Array]]:
        """Read the torque (N m, or a cylinder's force, N) and the pin forces of the state that was last forwarded.

        The torque is None where it does not move the input.
        """
        torque = self.loop.crank_torque()
        if self.light is None:
            return torque, self.loop.forces()
        couple = solve_couple_elsewhere(self.loop, self.light, self.scene.drive_bar, self.loop.given(), torque)
        return couple, self.light.forces()


def find_assembled(position: Assembler, command: Command, order: Iterable[int]) -> list[Found]:
    """Own joint angles of every commanded position, found one after the other in an order."""
    result: list[Found] = [None] * len(command.angle)
    for index in order:
        result[index] = position.find(float(command.angle[index]), int(command.branch[index]))
    return result


def split_segments(
    found: list[Found], order: Iterable[int], joined: Callable[[int, int], bool] = lambda one, other: True
) -> list[list[int]]:
    """Split the positions, in order of time, where the loop does not close, or two neighbours are not joined."""
    split: list[list[int]] = [[]]
    for index in order:
        if found[index] is None or (split[-1] and not joined(split[-1][-1], index)):
            split.append([])
        if found[index] is not None:
            split[-1].append(int(index))
    return [segment for segment in split if segment]
