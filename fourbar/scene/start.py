"""Where the motion of a scene begins, for the effects that count turns from there."""

from dataclasses import replace

import numpy as np

from fourbar.errors import LimitError
from fourbar.formulas.motion import State
from fourbar.scene import Command, Scene, command
from fourbar.scene.case import Case


def state_at(scene: Scene, at: Command) -> State:
    """The positions of a command and their motion, for what shows them."""
    with np.errstate(all="ignore"):
        case = Case.of(scene)
        half, _ = case.half_angle(at.theta_2, at.remainder)
        found = case.path.position(at.theta_2, half, at.branch)
        omega_2 = 0.0 if at.omega_2 is None else at.omega_2
        return case.state(case.path, at.theta_2, found, at.branch, omega_2, at.alpha_2)


def with_start(scene: Scene) -> Scene:
    """A scene with effects that count turns, which know where its motion begins: where it first assembles, if it keeps
    its branch."""
    at = command(scene)
    half, _ = Case.of(scene).half_angle(at.theta_2, at.remainder)
    assembled = (half.outer >= 0.0) & (half.inner >= 0.0)
    if not assembled.any() or np.ptp(at.branch) != 0:
        return scene
    first = int(np.argmax(assembled))
    return started(scene, Command(at.theta_2[first], at.branch[first], 0.0, 0.0, at.remainder))


def started(scene: Scene, at: Command) -> Scene:
    """The scene with effects that know that its motion begins at a position, of as many linkages as there are."""
    state = state_at(scene, at)
    return replace(scene, effects=tuple(effect.counted_from(state, at.branch) for effect in scene.effects))


def refuse_wound(scene: Scene, at: Command) -> None:
    """A LimitError where a free motion winds a spring: from there on it is no longer the spring's."""
    if not any(effect.counts_turns for effect in scene.effects):
        return
    with np.errstate(all="ignore"):
        state = state_at(scene, at)
        for effect in with_start(scene).effects:
            codes = effect.status(state, at.branch) if effect.counts_turns else None
            if codes is not None and codes.any():
                assert at.time is not None
                raise LimitError(
                    f"effects.{effect.key}: at {at.time[np.argmax(codes)]:.6g} s the free motion has turned a pin "
                    "by more than half a turn from the rest of its spring, which is not modelled"
                )
