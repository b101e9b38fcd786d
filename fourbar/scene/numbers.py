"""The unit of every number of a scene, by its key: each is declared where it belongs, as `numbers` of its class."""

from fourbar import effects
from fourbar.linkage import BAR_NAMES, MOVING_BARS, Bar, Declared, FourBar
from fourbar.scene.motion import OF_STROKE
from fourbar.scene.motion_law import COMMANDS
from fourbar.scene.point import Point

OF_MOTION = {
    name: Declared(f"{unit}{per}")
    for unit, commands in (("rad", COMMANDS.values()), ("m", [OF_STROKE]))
    for names in commands
    for name, per in zip(names, ("", "/s", "/s^2"), strict=True)
}
"""Numbers of a motion: place, speed and acceleration of what is commanded."""
LENGTHS = {**FourBar.numbers, **{BAR_NAMES[bar]: Bar.numbers["length"] for bar in MOVING_BARS}}


def find_unit(key: str) -> str | None:
    """Return the unit of the number that a key of a scene file names; None where no scene has such a number."""
    table, *names = key.split(".")
    numbers = {"lengths": LENGTHS, "bars": Bar.numbers, "motion": OF_MOTION, "points": Point.numbers}.get(table, {})
    if table == "loads":
        numbers = effects.Load.numbers
    elif table == "drive":
        numbers = {"at": effects.Springs.numbers["at"]}
    elif table == "effects" and names and (kind := effects.list_kinds().get(names[0])):
        numbers = {**kind.numbers, "gravity": effects.Gravity.numbers["magnitude"]}
    part = names.pop() if names and names[-1] in ("0", "1") else ""
    stated = numbers.get(names[-1] if names else "", numbers.get(""))
    return None if stated is None else "rad" if part == "1" else stated.unit
