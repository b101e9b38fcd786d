"""Places of bars in scene files: `from_pin`, `from_centre` or `point`.

A place is stated in polar form or by x and y.
"""

from collections.abc import Mapping
from typing import Any

from fourbar.effects.load import PLACES_OF_LOADS
from fourbar.effects.place import STATED_PLACES, Place
from fourbar.files.fields import Reader

PLACES_OF_ENDS = (*STATED_PLACES, "point")
"""Keys of which one states an end of a spring or cylinder, or the point of a force."""


def read_stated_place(
    read: Reader,
    key: str,
    entry: Mapping[str, Any],
    bars: Mapping[str, int],
    least: int = 1,
) -> Place:
    """Read the bar of an entry and its place on it, which one key states.

    An entry without such a key is at the bar's first pin.

    Parameters
    ----------
    bars : the bar of each named point, which the entry need not state again.
    least : number of the first bar allowed, 1 or 2.
    """
    stated = [name for name in PLACES_OF_LOADS if name in entry]
    if len(stated) > 1:
        allowed = f"{stated[0]} states the place already; state one of them"
        raise read.refuse(f"{key}.{stated[1]}", entry[stated[1]], allowed)
    name = entry.get("point") if "point" in stated else None
    if name is not None:
        read.choice(f"{key}.point", name, bars)
        bar = entry.get("bar", bars[name])
    else:
        bar = entry.get("bar")
    place = Place(read.bar(f"{key}.bar", bar, least))
    if name is not None:
        if place.bar != bars[name]:
            allowed = f"the point {name} is on bar {bars[name]}"
            raise read.refuse(f"{key}.bar", bar, allowed)
        return place._replace(point=name)
    for form in set(stated) & STATED_PLACES.keys():
        if form == "from_centre" and place.bar == 1:
            allowed = "the ground has no mass centre: write from_pin"
            raise read.refuse(f"{key}.{form}", entry[form], allowed)
        stated_pair: Any = {form: read.polar(f"{key}.{form}", entry[form], "m")}
        place = place._replace(**stated_pair)
    return place
