"""The table ``[tolerances]`` of a scene file: keys as in the file, quoted or dotted."""

from typing import Any

from fourbar.errors import InputError
from fourbar.files.fields import Reader, write_quantity
from fourbar.linkage import ANY, POSITIVE
from fourbar.scene import Scene
from fourbar.scene.tolerance import Tolerance
from fourbar.studies.keys import COMMAND_KEYS, LEFT_OUT, is_left_out, list_entries, read_place, refuse_key

SIGMA = "sigma"


def read_tolerances(read: Reader, scene: Scene, value: object) -> tuple[Tolerance, ...]:
    """``"lengths.input" = "0.05 mm"`` (plus or minus) or ``["0.02 mm", "sigma"]``."""
    known, found = list_entries(scene), []
    for key, given in _flatten(read, value).items():
        name = f'tolerances."{key}"'
        if key in COMMAND_KEYS:
            raise read.refuse(name, given, "is what is commanded, and is held; its speed and acceleration may scatter")
        if key not in known:
            raise read.refuse(name, given, refuse_key(key, given, list(known)).allowed)
        entry, sigma = known[key], isinstance(given, list)
        if sigma and (len(given) != 2 or given[1] != SIGMA):
            raise read.refuse(name, given, f'must be like "0.05 {entry.unit}" or ["0.02 {entry.unit}", "{SIGMA}"]')
        width = given[0] if sigma else given
        if is_left_out(scene, entry):
            raise read.refuse(name, width, LEFT_OUT)
        own = read.quantity(name, width, entry.unit, POSITIVE)
        if own <= 0.0:
            raise read.refuse(name, width, "must be > 0")
        tolerance, number = Tolerance(key, own, sigma), read_place(scene, entry.place)
        if number is None:
            raise read.refuse(name, width, "belongs to a number that the scene does not state")
        if entry.bound != ANY and tolerance.reach >= number:
            three = "three sigma of it " if sigma else ""
            raise read.refuse(name, width, f"{three}must be less than the number itself, {number:.6g} {entry.unit}")
        found.append(tolerance)
    return tuple(found)


def _flatten(read: Reader, value: object, before: str = "") -> dict[str, Any]:
    """Flatten a table to full keys, whether these are quoted or dotted."""
    if not isinstance(value, dict):
        raise read.refuse("tolerances", value, 'must be a table of keys like "lengths.input" = "0.05 mm"')
    found: dict[str, Any] = {}
    for key, entry in value.items():
        found |= _flatten(read, entry, f"{before}{key}.") if isinstance(entry, dict) else {f"{before}{key}": entry}
    return found


def write_tolerances(scene: Scene) -> dict[str, Any]:
    """Write the table of tolerances."""
    known, rows = list_entries(scene), dict[str, Any]()
    for tolerance in scene.tolerances:
        if tolerance.key not in known:
            raise InputError("tolerances", tolerance.key, "is no number of the scene")
        width = write_quantity(tolerance.width, known[tolerance.key].unit)
        rows[tolerance.key] = [width, SIGMA] if tolerance.sigma else width
    return rows
