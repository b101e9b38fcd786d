"""What `fourbar ratio` prints: the loop as a gear, and what polynomials in its place miss."""

import math

import numpy as np

from fourbar.show.tables import make_plain_table, write_cells, write_table
from fourbar.studies.ratio import Fit, GearRatio
from fourbar.writing import write_object

SCHEMA = "fourbar-ratio/1"
ROWS = 36
"""Intervals of the range that the table shows."""


def write_tables(title: str, found: GearRatio) -> str:
    """Write both tables, and the numbers to copy."""
    columns = (np.degrees(found.theta_2), found.omega_ratio, found.torque_ratio, found.reflected_inertia)
    rows = list(zip(*map(write_cells, columns), strict=True))[:: max(1, len(found.theta_2) // ROWS)]
    heads = ("theta_2 (deg)", "omega_4/omega_2", "torque on 4 by that on 2", "reflected inertia (kg m^2)")
    text = write_table(title, [], make_plain_table(heads, rows))
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
    errors = make_plain_table(of_fits, [_write_row(each, most) for each in found.fits], left=("held by",))
    return text.rstrip("\n") + "\n\n" + write_table("", lines, errors, after=["", *_write_elements(found.fits)])


def _write_row(fit: Fit, most: float) -> list[str]:
    held = "URDF, SDF, MuJoCo" if fit.degree == 1 else "MuJoCo"
    row = [str(fit.degree), held, f"{math.degrees(fit.angle.value):.4g}", f"{fit.speed.value:.4g}"]
    share = f"{100.0 * fit.torque.value / most:.3g} %" if most else "-"
    return [*row, f"{fit.torque.value:.4g}", share, f"{math.degrees(fit.torque.theta_2):.2f}"]


def _write_elements(fits: tuple[Fit, ...]) -> list[str]:
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


def write_json(title: str, found: GearRatio) -> str:
    """One object, SI and rad."""
    return write_object(SCHEMA, title=title, **found._asdict())
