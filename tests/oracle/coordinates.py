"""Coordinates of a drawing, in the numbers of a scene that is stated by lengths.

Where a drawn pin moves, the lengths of its bars follow, and of O2 and O4 the ground's
angle; every place keeps its distance and angle on its bar. Where a drawn place moves,
its distance and angle follow, and the pins stay. The arithmetic is the harness's own.
"""

import cmath

from fourbar.linkage import BAR_NAMES, BAR_NUMBERS, ENDS, FIRST_PIN

DRAWN_SETTING = "drawn"
"""Setting of rows that judge numbers of a drawing."""
_OF_PINS = "pins."
_OF_PLACES = ".drawn"
_MASS_CENTRE = ".centre"
_FORM_OF_PLACES = ".from_pin"
_ALONG_AXES = (1.0, 1.0j)
"""A coordinate's direction in the plane, by its index."""


def is_coordinate(key):
    """Return whether a key names a coordinate of a drawn pin or place."""
    stem, _, _ = key.rpartition(".")
    return key.startswith(_OF_PINS) or stem.endswith(_OF_PLACES)


def find_entry(document, key):
    """Find the table that holds a number, and its name or index there.

    Raises KeyError if the file leaves it out.
    """
    *path, last = [int(part) if part.isdecimal() else part for part in key.split(".")]
    for part in path:
        document = document[part]
    if isinstance(last, str) and last not in document:
        raise KeyError(key)
    return document, last


class Coordinates:
    """Coordinates of a drawing, beside the tables of a file that states lengths."""

    def __init__(self, drawing, document):
        self.pins = {
            pin: complex(*getattr(drawing, pin)) for pin in ("O2", "A", "B", "O4")
        }
        vectors = _find_vectors(self.pins)
        self.shortest = min(abs(vector) for vector in vectors.values())
        """Length of the shortest bar, m."""
        self._document = document

    def read(self, key):
        """Read a coordinate, m.

        Raises KeyError for a place that the file leaves out.
        """
        name, axis = _split(key)
        if name in self.pins:
            place = self.pins[name]
        else:
            bar, distance, angle = self._find_pair(name)
            place = self.pins[FIRST_PIN[bar]]
            place += cmath.rect(distance, angle) * self._find_direction(bar)
        return (place.real, place.imag)[axis]

    def follow(self, changes):
        """Return what the file's numbers change by.

        Changes of coordinates are turned into those of lengths, angles and distances;
        others stay.
        """
        followed = {}
        moves = {}
        for key, change in changes.items():
            if is_coordinate(key):
                name, axis = _split(key)
                moves[name] = moves.get(name, 0j) + change * _ALONG_AXES[axis]
            else:
                followed[key] = change
        followed |= self._follow_pins(moves)
        for name, move in moves.items():
            if name not in self.pins:
                followed |= self._follow_place(name, move)
        return followed

    def move_origin(self, changes):
        """Return the place of O2 in the drawing after such changes, m."""
        return complex(
            *(
                self.read(key) + changes.get(key, 0.0)
                for key in ("pins.O2.0", "pins.O2.1")
            )
        )

    def _follow_pins(self, moves):
        """Return by what lengths and the ground's angle change.

        A length that is drawn within a rounding keeps its rounding.
        """
        moved = {pin: place + moves.get(pin, 0j) for pin, place in self.pins.items()}
        after = _find_vectors(moved)
        changes = {}
        for bar, vector in _find_vectors(self.pins).items():
            if moves.keys().isdisjoint(ENDS[bar]):
                continue
            changes[f"lengths.{BAR_NAMES[bar]}"] = abs(after[bar]) - abs(vector)
            if bar == 1:
                turned = cmath.phase(after[bar] * vector.conjugate())
                changes["lengths.ground_angle"] = turned
        return changes

    def _follow_place(self, name, move):
        """Return by what distance and angle of a place on its bar change."""
        bar, distance, angle = self._find_pair(name)
        on_bar = cmath.rect(distance, angle)
        on_bar += move * self._find_direction(bar).conjugate()
        turned = cmath.phase(on_bar * cmath.rect(1.0, -angle))
        pair = _name_pair(name)
        return {f"{pair}.0": abs(on_bar) - distance, f"{pair}.1": turned}

    def _find_pair(self, name):
        """Find the bar of a place, with distance (m) and angle (rad) on it."""
        holder, last = find_entry(self._document, _name_pair(name))
        distance, angle = (float(text.partition(" ")[0]) for text in holder[last])
        if name.endswith(_MASS_CENTRE):
            bar = BAR_NUMBERS[name.split(".")[1]]
        else:
            bar = holder["bar"]
        return bar, distance, angle

    def _find_direction(self, bar):
        """Return the drawn direction of a bar, a unit vector."""
        vector = _find_vectors(self.pins)[bar]
        return vector / abs(vector)


def _split(key):
    """Split the key of a coordinate into the name of pin or place and the axis."""
    stem, _, axis = key.rpartition(".")
    if key.startswith(_OF_PINS):
        return stem.removeprefix(_OF_PINS), int(axis)
    return stem.removesuffix(_OF_PLACES), int(axis)


def _name_pair(name):
    """Return the key of the pair by which a file without a drawing states a place."""
    if name.endswith(_MASS_CENTRE):
        return name
    return name + _FORM_OF_PLACES


def _find_vectors(pins):
    """Return the vectors of the bars, from pin to pin, m."""
    return {bar: pins[second] - pins[first] for bar, (first, second) in ENDS.items()}
