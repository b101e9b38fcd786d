"""How the generated file looks: camera facing the plane, soft light, plain background; nothing that acts."""

import math
from typing import Any, NamedTuple
from xml.etree import ElementTree as ET

from fourbar.linkage import FourBar

FOVY = 45.0
"""Vertical field of view, deg."""
ASPECT = 4.0 / 3.0
"""Narrowest window that shows the whole linkage."""
MARGIN = 1.15
"""Width and height of the picture over those of the linkage."""


def write_rounded(*numbers: float) -> str:
    """Numbers that nothing is computed from, in six digits."""
    return " ".join(f"{number:.6g}" for number in numbers)


class CameraView(NamedTuple):
    """What the camera sees: the box in which pins A and B move."""

    x: float
    y: float
    half_height: float
    """Of the picture, m."""

    @property
    def distance(self) -> float:
        """Of the camera from the plane, m."""
        return self.half_height / math.tan(math.radians(0.5 * FOVY))


def compute_frame(linkage: FourBar) -> CameraView:
    """Compute the box around the circle of A about O2 and of B about O4: no position leaves it."""
    d, a, _, c = linkage.lengths
    x, y = d * math.cos(linkage.ground_angle), d * math.sin(linkage.ground_angle)
    left, right = min(-a, x - c), max(a, x + c)
    low, high = min(-a, y - c), max(a, y + c)
    half = MARGIN * max(0.5 * (high - low), 0.5 * (right - left) / ASPECT)
    return CameraView(0.5 * (left + right), 0.5 * (low + high), half)


def add_appearance(root: ET.Element, linkage: FourBar) -> None:
    """Extent and free camera of the viewer, light, background."""
    seen = compute_frame(linkage)
    ET.SubElement(root, "statistic", extent=write_rounded(seen.distance / 1.5), center=write_rounded(seen.x, seen.y, 0))
    visual = ET.SubElement(root, "visual")
    # the viewer's free camera starts at 1.5 extents from the centre; -90 deg looks straight down on the plane
    ET.SubElement(visual, "global", azimuth="90", elevation="-90", fovy=f"{FOVY:g}", offwidth="1280", offheight="960")
    ET.SubElement(visual, "headlight", ambient=".45 .45 .45", diffuse=".35 .35 .35", specular=".1 .1 .1")
    ET.SubElement(visual, "rgba", haze="1 1 1 1")
    sky: dict[str, Any] = {"rgb1": ".95 .96 .98", "rgb2": ".95 .96 .98", "width": "32", "height": "192"}
    ET.SubElement(ET.SubElement(root, "asset"), "texture", type="skybox", builtin="flat", **sky)


def add_camera(world: ET.Element, linkage: FourBar) -> None:
    """Add the camera `plane`, and a light at the same place."""
    seen = compute_frame(linkage)
    place = write_rounded(seen.x, seen.y, seen.distance)
    shining = {"diffuse": ".2 .2 .2", "specular": ".1 .1 .1"}  # with the headlight 1
    shining |= {"directional": "true", "castshadow": "false"}
    ET.SubElement(world, "light", shining, name="light", pos=place, dir="0 0 -1")
    ET.SubElement(world, "camera", name="plane", pos=place, fovy=f"{FOVY:g}")
