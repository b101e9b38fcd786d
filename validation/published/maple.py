"""The Maple worksheet's two solutions of one four-bar: positions alone, theta_1 = 0, rad."""

import json
import math
from collections.abc import Iterator
from pathlib import Path

import fourbar
from validation.published.figures import Figure

SOURCE = Path(__file__).parent / "data" / "maple.json"


def maple_figures() -> Iterator[Figure]:
    """theta_3 and theta_4 of the open and of the crossed solution, and the constant of the real equation."""
    sheet = json.loads(SOURCE.read_text(encoding="utf-8"))
    a, b, c, d = (float(sheet["inputs"][name]) for name in "abcd")
    theta_2 = math.pi / 3.0
    linkage = fourbar.FourBar(d, fourbar.Bar(a), fourbar.Bar(b), fourbar.Bar(c))
    real = sheet["reduced_equations"]["real_constant"]
    yield Figure("Maple", "real constant", real, a * math.cos(theta_2) - d)
    for branch, solution in zip((1, -1), sheet["solutions"], strict=True):
        s = fourbar.solve(fourbar.Scene(linkage, fourbar.Motion(theta_2, branch=branch)))
        for name, angle in (("theta3", s.theta_3), ("theta4", s.theta_4)):
            key = f"{solution['configuration']} {name}"
            yield Figure("Maple", key, solution[f"{name}_printed_rad"], float(angle[0]))
