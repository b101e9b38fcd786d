"""Ask an engine: it is told the sign at each position, and no result of the formulas.

A command of a scene names an assembly; an engine is asked for the sign of the bar's
sine. The two differ beyond a change point. Whoever asks about a command of a scene asks
here; limits and equilibria are asked for by their signs.
"""

from dataclasses import replace

import numpy as np

from fourbar.scene import Command, Scene, StrokeOrigin, with_signs
from fourbar_validation.compare.answer import Adapter, Answer
from fourbar_validation.engines.protocol import require_near


def ask_at(
    adapter: Adapter,
    scene: Scene,
    command: Command,
) -> Answer:
    """Give an engine what is commanded, with the sign of its sine.

    The sign is at each position; nothing else of the formulas is given.
    """
    bare = remove_angles(with_signs(scene.linkage, command))
    answer = adapter.answer(scene, bare)
    if answer.at is bare:
        return replace(answer, at=command)
    if answer.at is None:
        return answer
    if command.moves_stroke:
        require_near(answer.at, command)
    return replace(answer, at=with_signs(scene.linkage, answer.at))


def remove_angles(command: Command) -> Command:
    """Put NaN for the bar's motion in a command by a stroke.

    The formulas computed it from the stroke.
    """
    if not isinstance(command.origin, StrokeOrigin):
        return command
    unknown = np.full_like(command.angle, np.nan)
    speed = None if command.speed is None else unknown
    return command._replace(
        angle=unknown,
        speed=speed,
        acceleration=unknown,
        origin=StrokeOrigin(*command.stated),
    )
