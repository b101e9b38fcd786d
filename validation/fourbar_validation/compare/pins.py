"""Places and mass centres from the first pins of their bars.

The arithmetic is the harness's own.
"""

import math

from fourbar.effects import Place
from fourbar.linkage import Bar
from fourbar.scene import Scene


def resolve(size: float, angle: float) -> tuple[float, float]:
    """Resolve a vector along and across the line from which its angle (rad) counts."""
    return size * math.cos(angle), size * math.sin(angle)


def find_centre(bar: Bar) -> tuple[float, float]:
    """Return distance (m) and angle (rad) of G from pin and line.

    They are as stated, or mid-bar.
    """
    return bar.centre if bar.centre is not None else (bar.length / 2.0, 0.0)


def state_from_pins(scene: Scene) -> Scene:
    """State every place of a scene by a pair from its bar's first pin."""
    stated = {point.name: point.place for point in scene.points}

    def convert(place: Place) -> Place:
        if place.point is not None:
            place = stated[place.point]
        if place.from_centre is None:
            return place
        x, y = resolve(*find_centre(scene.linkage.bar(place.bar)))
        along, across = resolve(*place.from_centre)
        x, y = x + along, y + across
        return Place(place.bar, (math.hypot(x, y), math.atan2(y, x)))

    return scene.with_places(convert)
