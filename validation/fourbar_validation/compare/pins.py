"""Masses, inertias, and places from the first pins of bars.

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

    A bar that states none has G at its middle.
    """
    if bar.centre is not None:
        return bar.centre
    return (bar.length / 2.0, 0.0)


def find_mass(bar: Bar) -> float:
    """Return the mass, kg: as stated, or density times the volume from pin to pin."""
    if bar.density is None:
        return bar.mass
    if bar.section is not None:
        height, thickness = bar.section
        return bar.density * (height * thickness) * bar.length
    assert bar.diameter is not None
    radius = bar.diameter / 2.0
    return bar.density * (math.pi * (radius * radius)) * bar.length


def find_inertia(bar: Bar) -> float:
    """Return the moment of inertia about G, kg m^2.

    A bar that states none is uniform and slender: m L^2/12.
    """
    if bar.inertia is not None:
        return bar.inertia
    return find_mass(bar) * bar.length**2 / 12.0


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
