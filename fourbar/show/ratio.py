"""What `fourbar ratio` prints: the loop as a gear, and what polynomials in its place miss."""

import json
import math
from typing import Any

import numpy as np

from fourbar.show.tables import plain_table, under_heading
from fourbar.studies.ratio import Fit, GearRatio

SCHEMA = "fourbar-ratio/1"
ROWS = 36
"""Intervals of the range that the table shows."""


def printed(title: str, found: GearRatio) -> str:
    """Write both tables, and the numbers to copy."""
    columns = (np.degrees(found.theta_2), found.omega_ratio, found.torque_ratio, found.reflected_inertia)
    rows = [[_number(of[i]) for of in columns] for i in range(0, len(columns[0]), max(1, len(columns[0]) // ROWS))]
    heads = ("theta_2 (deg)", "omega_4/omega_2", "torque on 4 by that on 2", "reflected inertia (kg m^2)")
    text = under_heading(title, [], plain_table(heads, rows))
    most = float(np.abs(found.torque).max())
    lines = [f"theta_4 as a polynomial of theta_2: greatest errors (largest torque on the input: {most:.6g} N m)"]
    of_fits = (
        "degree",
        "held by",
        "theta_4 (deg)",
        "omega_4/omega_2",
        "torque on 2 (N m)",
        "of the largest",
        "at (deg)",
    )
    errors = plain_table(of_fits, [_row(each, most) for each in found.fits], left=("held by",))
    return text.rstrip("\n") + "\n\n" + under_heading("", lines, errors, after=["", *_to_copy(found.fits)])


def _row(fit: Fit, most: float) -> list[str]:
    held = "URDF, SDF, MuJoCo" if fit.degree == 1 else "MuJoCo"
    row = [str(fit.degree), held, f"{math.degrees(fit.angle.value):.4g}", f"{fit.speed.value:.4g}"]
    share = f"{100.0 * fit.torque.value / most:.3g} %" if most else "-"
    return [*row, f"{fit.torque.value:.4g}", share, f"{math.degrees(fit.torque.theta_2):.2f}"]


def _to_copy(fits: tuple[Fit, ...]) -> list[str]:
    """Write the elements of URDF, SDF and MJCF; joints read theta_2 and theta_4."""
    one, best = fits[0], fits[-1]
    multiplier, reference = one.theta_4[1], one.about
    offset = one.theta_4[0] - multiplier * reference
    poly = " ".join(repr(x) for x in (*best.theta_4, 0.0, 0.0, 0.0, 0.0)[:5])
    return [
        f'URDF   <mimic joint="O2" multiplier="{multiplier!r}" offset="{offset!r}"/>',
        f'SDF    <mimic joint="O2"><multiplier>{multiplier!r}</multiplier><offset>{one.theta_4[0]!r}</offset>'
        f"<reference>{reference!r}</reference></mimic>",
        f'MJCF   <joint joint1="O4" joint2="O2" polycoef="{poly}"/>',
        f"       where O2 reads theta_2 - {best.about!r}; `fourbar mjcf SCENE --mimic -o FILE` writes the whole model",
    ]


def _number(value: float) -> str:
    return f"{value:.6g}" if math.isfinite(value) else "-"


def json_text(title: str, found: GearRatio) -> str:
    """One object, SI and rad."""

    def fit(each: Fit) -> dict[str, Any]:
        errors = {name: getattr(each, name)._asdict() for name in ("angle", "speed", "torque")}
        return {**each._asdict(), **errors}

    arrays = ("theta_2", "omega_ratio", "torque_ratio", "reflected_inertia", "torque")
    columns = {name: [x if math.isfinite(x) else None for x in getattr(found, name).tolist()] for name in arrays}
    document = {"schema": SCHEMA, "title": title, **columns, "fits": [fit(each) for each in found.fits]}
    return json.dumps(document, allow_nan=False) + "\n"
