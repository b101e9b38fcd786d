"""Leave to MuJoCo what the generated MJCF states."""

from collections.abc import Mapping, Sequence
from xml.etree import ElementTree as ET


def remove_attributes(mjcf: str, attributes: Mapping[str, Sequence[str]]) -> str:
    """Remove these attributes of the elements at these paths from a text.

    What they state is left to MuJoCo.
    """
    root = ET.fromstring(mjcf)
    for path, names in attributes.items():
        element = root.find(path)
        assert element is not None
        for name in names:
            element.attrib.pop(name, None)
    return ET.tostring(root, encoding="unicode")


def restore_defaults(mjcf: str) -> str:
    """Return a text in which solref, solimp and the solver are left to MuJoCo.

    MuJoCo's defaults are 0.02 s, impedance 0.9 to 0.95, and Newton to 1e-8.
    """
    return remove_attributes(
        mjcf,
        {
            "option": ("solver", "tolerance", "iterations"),
            "equality/connect": ("solref", "solimp"),
        },
    )
