"""The thesis's printed angles and limit positions against ours: section 2.4, table 3.2, the manual's window.

Ours come from `fourbar.solve` and `fourbar.formulas.mobility`, or from the thesis's formula for a constant that
nobody else defines. Units as printed: cm and deg.
"""

import csv
import json
import math
from collections.abc import Iterator

import numpy as np

from fourbar.formulas.mobility import limit_positions
from fourbar_validation.published.figures import PublishedFigure
from fourbar_validation.published.program import (
    DATA,
    LENGTHS,
    THETA_1,
    THETA_2,
    compute_motion,
    make_scene,
    read_printed,
    to_degrees,
    to_ours,
)

d, a, b, c = LENGTHS


def list_positions() -> Iterator[PublishedFigure]:
    """Section 2.4's table: theta_3 and theta_4 of both roots at 281 positions."""
    rows = list(csv.DictReader((DATA / "positions.csv").read_text(encoding="utf-8").splitlines()))
    theta_2 = np.radians([float(row["theta2_deg"]) for row in rows])
    for branch, third, fourth in ((1, "theta3_1", "theta4_2"), (-1, "theta3_2", "theta4_1")):
        s = compute_motion(theta_2, branch)
        for row, theta_3, theta_4 in zip(rows, s.theta_3, s.theta_4, strict=True):
            for name, angle in ((third, float(theta_3)), (fourth, to_ours(float(theta_4)))):
                text = row[f"{name}_deg"]
                ours = math.degrees(angle)
                ours += 360.0 * round((float(text) - ours) / 360.0)
                where_it_is = f"{row['theta2_deg']} {name}"
                lost = ("6",) if where_it_is == "136 theta3_1" else ()
                yield PublishedFigure("2.4 positions", where_it_is, text, ours, lost, 10.0 * ours if lost else None)


def list_half_angle_constants() -> Iterator[PublishedFigure]:
    """Section 2.4 at theta_2 = 90 deg: k1 cos + k2 sin + k3 + e^2 = 0 and A t^2 + B t + C = 0, t = tan(theta/2)."""
    theta_2 = math.radians(90.0)
    x, y = a * math.cos(theta_2) + d * math.cos(THETA_1), a * math.sin(theta_2) + d * math.sin(THETA_1)
    roots = {branch: compute_motion(np.array([theta_2]), branch) for branch in (1, -1)}
    angles = {
        "theta3_1": float(roots[1].theta_3[0]),
        "theta3_2": float(roots[-1].theta_3[0]),
        "theta4_1": to_ours(float(roots[-1].theta_4[0])),
        "theta4_2": to_ours(float(roots[1].theta_4[0])),
    }
    for name, length, second in (("theta4", c, b), ("theta3", b, c)):
        k1, k2, k3 = 2.0 * length * x, 2.0 * length * y, x * x + y * y - second**2
        ours = {"k1": k1, "k2": k2, "k3": k3, "A": k3 + length**2 - k1, "B": 2.0 * k2, "C": k3 + length**2 + k1}
        ours |= {f"{key}_deg": math.degrees(angle) for key, angle in angles.items()}
        for key, text in read_printed()["published"]["section_2_4_theta2_90"][name].items():
            yield PublishedFigure("2.4 constants", key if key.startswith("theta") else f"{name} {key}", text, ours[key])


def list_simulation_window() -> Iterator[PublishedFigure]:
    """List the manual's window: angles e1..e4 in rad and deg, of theta_2 = 0."""
    s = compute_motion(np.array([0.0]))
    theta_3, theta_4 = float(s.theta_3[0]), to_ours(float(s.theta_4[0]))
    ours = {"e1_rad": THETA_1, "e2_rad": 0.0, "e3_rad": theta_3, "e4_rad": theta_4, "teta1_deg": to_degrees(THETA_1)}
    ours |= {"tetaDos_deg": 0.0, "anguloTres_deg": to_degrees(theta_3), "anguloCuatro_deg": to_degrees(theta_4)}
    for name, text in read_printed()["published"]["manual_simulation_window"].items():
        if name != "note":
            yield PublishedFigure("manual, window", name, text, ours[name], ("17",) if name == "tetaDos_deg" else ())


def list_limits() -> Iterator[PublishedFigure]:
    """Table 3.2: cosines whose existence decides, and the limit positions that do exist."""
    linkage = make_scene(THETA_2).linkage
    output, dead_centre = (limit_positions(linkage, bar) for bar in (4, 2))
    cosines = {
        1: ((a + b) ** 2 + d**2 - c**2) / (2.0 * (a + b) * d),
        2: ((a - b) ** 2 + d**2 - c**2) / (2.0 * abs(a - b) * d),
        3: (a**2 + d**2 - (b + c) ** 2) / (2.0 * a * d),
        4: (a**2 + d**2 - (b - c) ** 2) / (2.0 * a * d),
    }
    limits = {2: to_degrees(output[-1].theta_2), 4: to_degrees(dead_centre[0].theta_2)}
    for row in json.loads((DATA / "limits.json").read_text(encoding="utf-8"))["table_3_2"]:
        number = row["row"]
        yield PublishedFigure("3.2 limits", f"row {number} cosine", row["discriminant_printed"], cosines[number])
        if number == 2:
            made = limits[2] - to_degrees(THETA_1)
            yield PublishedFigure("3.2 limits", "row 2 theta_2", row["value_printed_deg"], limits[2], ("14",), made)
        if number == 4:
            yield PublishedFigure("3.2 limits", "row 4 theta_2", row["value_printed_deg"], limits[4])
            arc = limits[4] - math.degrees(to_ours(THETA_1))
            yield PublishedFigure("3.2 limits", "row 4 arc cosine", row["acos_printed_deg"], arc)


def list_position_figures() -> Iterator[PublishedFigure]:
    """List every published angle and limit position of the thesis."""
    yield from list_positions()
    yield from list_half_angle_constants()
    yield from list_limits()
    yield from list_simulation_window()
