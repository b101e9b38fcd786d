"""The assembled linkage as bodies with what acts on them, for files that hold neither speeds nor a drive: SDF, USD."""

import cmath
from collections.abc import Mapping
from typing import Any, NamedTuple

from fourbar.errors import LimitError
from fourbar.linkage import FIRST_PIN, MOVING_BARS
from fourbar.mjcf.document import NOTES, Start, find_start
from fourbar.mjcf.model import require_carriable
from fourbar.scene import Scene, require_input

PARENT = {2: 1, 3: 2, 4: 1}
"""The bar that carries each bar's first pin."""


class Assembly(NamedTuple):
    """Bodies in the plane."""

    turn: dict[int, float]
    """Angle of each bar, 1 to 4, that of the ground 0, rad."""
    first_pin: dict[int, complex]
    """First pin of each bar, m."""
    numbers: tuple[float, ...]
    """theta_2, theta_3, theta_4, and the speeds of joints O2, A, O4."""
    inertia: dict[int, float]
    """Of each moving bar about its mass centre, a flywheel's with it, kg m^2."""
    gravity: tuple[float, float]
    """m/s^2."""
    dynamics: dict[str, dict[str, float]]
    """By pin what its joint holds."""


def assemble(
    scene: Scene, start: Start | None, form: str, at_pins: Mapping[str, tuple[str, str]], *, without_loads: bool = False
) -> Assembly:
    """Evaluate the linkage in the state given, or in that of `find_start`.

    Parameters
    ----------
    form : the file's, for errors.
    at_pins : the effects that its joints hold: the name there, and the field of the effect that lists it by pin.
    without_loads : leave the loads out, instead of refusing them.

    Raises LimitError for a load, a motion law or an effect without a counterpart there, InputError for a bar without
    mass or inertia, NotAssembledError where the linkage closes at none of the scene's positions.
    """
    require_input(scene, "the drive of an SDF or a USD")
    if scene.motion.law is not None:
        raise LimitError(f"a motion law has no counterpart in {form}; apply it in the simulator")
    if scene.loads and not without_loads:
        on = ", ".join(sorted({f"bar {load.bar}" for load in scene.loads}))
        raise LimitError(f"loads (here on {on}) have no counterpart in {form}; --without-loads leaves them out")
    if scene.drive is not None:
        raise LimitError(f"a linear drive (drive.from, drive.to) has no counterpart in {form}")
    linkage = scene.linkage
    require_carriable(linkage)
    inertia = {number: linkage.bar(number).moment_of_inertia for number in MOVING_BARS}
    gravity, dynamics = (0.0, 0.0), dict[str, dict[str, float]]()
    of: Any
    for of in scene.effects:
        if of.key == "gravity":
            gravity = (float(of.vector[0]), float(of.vector[1]))
        elif of.key == "flywheel":
            inertia[of.bar] += of.inertia
        elif of.key in at_pins:
            name, field = at_pins[of.key]
            for pin, value in getattr(of, field):
                dynamics.setdefault(pin, {})[name] = value
        else:
            raise LimitError(f"the effect {of.key!r} has no counterpart in {form}")
    (theta_2, of_3_to_2, theta_4), speeds = (start or find_start(scene))[:2]
    theta_3 = theta_2 + of_3_to_2
    foot = {1: 0j, 2: 0j, 3: cmath.rect(linkage.input.length, theta_2)}
    foot[4] = cmath.rect(linkage.ground, linkage.ground_angle)
    turn, numbers = {1: 0.0, 2: theta_2, 3: theta_3, 4: theta_4}, (theta_2, theta_3, theta_4, *speeds)
    return Assembly(turn, foot, numbers, inertia, gravity, dynamics)


def write_comment(scene: Scene, form: str, reader: str, assembly: Assembly, at_B: str = "") -> str:
    """Say in what state the file stands, and where its reader's numbers are."""
    notes, bar = NOTES["assembled"], scene.drive_bar
    joint = f", joint {FIRST_PIN[bar]}" if bar != 3 else ""
    lines = [notes["opens"].strip().format(*map(repr, assembly.numbers), form=form, at_B=at_B)]
    lines += [notes["drive"].format(bar=bar, joint=joint), *([notes["without_loads"]] if scene.loads else [])]
    return "\n".join([*lines, notes[reader].strip()])
