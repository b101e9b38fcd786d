"""A new scene file, for four lengths or four drawn pins, from a template."""

import json
import re
from string import Template

from fourbar.files.scene_file import loads
from fourbar.files.scene_text import MOVING_BAR_NUMBERS
from fourbar.linkage import BAR_NAMES
from fourbar.quantities.units import IMPERIAL, find_unit, to_si

NEW_SCENE, NEW_POSITIONS = "new.toml", "new_positions.toml"
"""Templates of a new scene file, and of one that asks for positions only."""


def write_new_scene(
    lengths: tuple[str, ...] | list[str], template: str = NEW_SCENE
) -> str:
    """Write a scene file for four lengths (ground, input, coupler, output).

    Lengths keep the units in which they were given.

    Raises InputError for what is no length, and for bars that cannot close.
    """
    rows = ["[lengths]"]
    for name, text in zip(BAR_NAMES.values(), lengths, strict=True):
        rows.append(f"{name} = {_quote(text)}")
    rows.append('ground_angle = "0 deg"  # from O2 to O4')
    unit = find_unit(lengths[0], "m")
    return _fill_in(rows, "--lengths", _BRANCH_LINE, unit, template)


_BRANCH_LINE = '# branch = "crossed"  # left out: open\n'
"""Comment on the branch, which pins state."""


def write_drawn_scene(
    pins: dict[str, tuple[str, str]], template: str = NEW_SCENE
) -> str:
    """Write a scene file for four pins, x and y each with its unit.

    Raises InputError as `DrawnPins` does.
    """
    rows = ["[pins]  # x and y in the position that is drawn"]
    for pin, (x, y) in pins.items():
        rows.append(f"{pin} = [{_quote(x)}, {_quote(y)}]")
    return _fill_in(rows, "--pins", "", find_unit(pins["A"][0], "m"), template)


def _quote(text: str) -> str:
    """Write a quantity as a text of TOML.

    The mark of inches would end the text: 12" becomes "12 in".
    """
    text = " ".join(text.split())
    inches = re.fullmatch(r"([^'′’]*\d)\s*[\"”″]", text)
    return json.dumps(f"{inches[1]} in" if inches else text, ensure_ascii=False)


_EXAMPLES = {
    "pound": "kg",
    "long": "m",
    "per_length": "1",
    "inertia": "0.01 kg m^2",
    "force": "10 N",
    "gravity": "9.81 m/s^2",
    "damping": "0.01 N m s/rad",
    "centre": "100 mm",
    "place": "50 mm",
    "moment": "150 N mm",
}
"""Quantities that the comments of a new file show, and its gravity."""
_IMPERIAL_EXAMPLES = {
    "pound": "lb",
    "long": "in",
    "per_length": "0.05",
    "inertia": "30 lb in^2",
    "force": "2 lbf",
    "gravity": "386.09 in/s^2",
    "damping": "0.1 lbf in s/rad",
    "centre": "4 in",
    "place": "2 in",
    "moment": "1.5 lbf in",
}
"""Examples for lengths in inches or feet."""


def _fill_in(
    rows: list[str],
    option: str,
    branch: str,
    unit: str,
    template: str,
) -> str:
    """Fill in the template of a new scene file; each bar weighs 1 kg/m or 0.05 lb/in.

    Parameters
    ----------
    rows : of the linkage.
    option : of the command that states them, for errors.
    unit : of its lengths; imperial ones have comments in such units.
    """
    linkage = loads("\n".join(rows), option).linkage
    examples = _EXAMPLES
    if unit.casefold() in IMPERIAL:
        examples = _IMPERIAL_EXAMPLES
    per_metre = float(examples["per_length"]) / to_si(f"1 {examples['long']}", "m")
    masses = {
        name: repr(float(f"{per_metre * linkage.bar(number).length:.4g}"))
        for name, number in MOVING_BAR_NUMBERS.items()
    }
    # loads much that no other command needs
    from importlib.resources import files

    text = files("fourbar.files").joinpath(template).read_text(encoding="utf-8")
    return Template(text).substitute(
        linkage="\n".join(rows),
        branch=branch,
        **masses,
        **examples,
    )
