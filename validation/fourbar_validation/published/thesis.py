"""The thesis's printed tables, computed: our numbers, and what errata make of them.

Sections 2.4, 4.12 and 5.7, table 3.2 and the tables of the manual. Ours come from
`fourbar.solve` and `fourbar.formulas.mobility`, or from the thesis's formula for a
constant that nobody else defines. Units as printed: cm, deg, rad/s, cm/s^2, N, N cm.
"""

import math
from collections.abc import Mapping
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from fourbar.formulas.mobility import limit_positions
from fourbar.linkage import MOVING_BARS
from fourbar.quantities import Array
from fourbar_validation.published.figures import POSITIONS, PrintedFigure
from fourbar_validation.published.program import (
    BAR_LENGTHS,
    CENTRE,
    COUPLE_ON_A_BAR,
    ERRATA_IN_ORDER,
    FORCE_ON_BAR_2,
    INERTIA_2,
    LOAD_ANGLE,
    LOAD_ARM,
    MASSES,
    OMEGA_2,
    THETA_1,
    THETA_2,
    Kinematics,
    ProgramErrors,
    bound_round_off,
    compute_inertia,
    compute_motion,
    compute_right_unknowns,
    compute_thesis_program,
    make_equations,
    make_model_scene,
    split_components,
    to_degrees,
    to_ours,
)

_ANGLE_NOISE = 4e-15
"""Four steps of a double near 360 deg, rad. The program carries such angles, where a
step is 5.7e-14 deg = 1e-15 rad.
"""
d, a, b, c = BAR_LENGTHS
Numbers = Mapping[str, float]


class ComputedTable(NamedTuple):
    """Our numbers of a printed table, by the names of its figures."""

    ours: Numbers
    made: Numbers = MappingProxyType({})
    """Ours after the errata of the figure, where these can be computed."""
    noise: Numbers = MappingProxyType({})
    """Round-off of digits that the program printed in full."""


def compute_tables(
    printed: Mapping[str, PrintedFigure],
) -> dict[str, ComputedTable]:
    """Compute every table of the thesis by its name.

    `printed`: the table of positions, whose angles go on over turns.
    """
    k = Kinematics()
    kinematics = _compute_kinematics(k)
    slips = _compute_slips(k)
    arms = {name: _compute_cut_arm(k, 6) for name in ("R23_j", "R43_j")}
    arms["R43_j"] *= -1.0
    sizes = {
        "t": math.degrees(1.0),
        "R": abs(CENTRE[2]),
        "A": float(np.abs(k.a_G[2]).max()),
    }
    noise = {name: _ANGLE_NOISE * sizes.get(name[0], 1.0) for name in kinematics}
    return {
        POSITIONS: _compute_positions(printed),
        "2.4 constants": ComputedTable(_compute_half_angle_constants()),
        "3.2 limits": _compute_limits(),
        "manual, window": ComputedTable(_compute_window()),
        "4.12": ComputedTable(kinematics, slips | arms),
        "manual, kinematics": ComputedTable(kinematics, slips, noise),
        **_compute_constants(k),
        "manual, unknowns": _compute_unknowns(-2),
        "5.7 unknowns": _compute_unknowns(-1),
    }


def _solve_roots(theta_2: Array) -> dict[str, Array]:
    """Solve theta_3 and theta_4 of both roots, deg, by the thesis's names."""
    roots = {}
    for branch, third, fourth in ((1, 1, 2), (-1, 2, 1)):
        s = compute_motion(theta_2, branch)
        roots[f"theta3_{third}"] = np.degrees(s.theta_3)
        roots[f"theta4_{fourth}"] = np.degrees([*map(to_ours, s.theta_4)])
    return roots


def _compute_positions(printed: Mapping[str, PrintedFigure]) -> ComputedTable:
    """Compute section 2.4's table of 281 positions, angles to the turn as printed."""
    places = [name.split() for name in printed]
    roots = _solve_roots(np.radians([float(theta_2) for theta_2, _ in places]))
    ours = {}
    for row, (place, figure) in enumerate(printed.items()):
        degrees = float(roots[places[row][1]][row])
        turns = round((float(figure.printed) - degrees) / 360.0)
        ours[place] = degrees + 360.0 * turns
    return ComputedTable(ours, {"136 theta3_1": 10.0 * ours["136 theta3_1"]})


def _compute_half_angle_constants() -> dict[str, float]:
    """Compute section 2.4 at theta_2 = 90 deg.

    k1 cos + k2 sin + k3 + e^2 = 0, A t^2 + B t + C = 0, t = tan(theta/2).
    """
    theta_2 = math.radians(90.0)
    x = a * math.cos(theta_2) + d * math.cos(THETA_1)
    y = a * math.sin(theta_2) + d * math.sin(THETA_1)
    roots = _solve_roots(np.array([theta_2]))
    ours = {f"{name}_deg": float(angle[0]) for name, angle in roots.items()}
    for name, length, second in (("theta4", c, b), ("theta3", b, c)):
        k1 = 2.0 * length * x
        k2 = 2.0 * length * y
        k3 = x * x + y * y - second**2
        whole = k3 + length**2
        numbers = (k1, k2, k3, whole - k1, 2.0 * k2, whole + k1)
        for key, number in zip(("k1", "k2", "k3", "A", "B", "C"), numbers, strict=True):
            ours[f"{name} {key}"] = number
    return ours


def _compute_window() -> dict[str, float]:
    """Compute the manual's window: angles e1..e4 in rad and deg, of theta_2 = 0."""
    s = compute_motion(np.array([0.0]))
    angles = {
        "teta1": THETA_1,
        "tetaDos": 0.0,
        "anguloTres": float(s.theta_3[0]),
        "anguloCuatro": to_ours(s.theta_4[0]),
    }
    ours = {f"e{bar}_rad": angle for bar, angle in enumerate(angles.values(), 1)}
    return ours | {f"{name}_deg": to_degrees(angle) for name, angle in angles.items()}


def _compute_limits() -> ComputedTable:
    """Compute table 3.2: cosines whose existence decides, and limits that exist."""
    linkage = make_model_scene(THETA_2).linkage
    second = to_degrees(limit_positions(linkage, 4)[-1].theta_2)
    fourth = to_degrees(limit_positions(linkage, 2)[0].theta_2)
    ours = {
        "row 1 cosine": ((a + b) ** 2 + d**2 - c**2) / (2.0 * (a + b) * d),
        "row 2 cosine": ((a - b) ** 2 + d**2 - c**2) / (2.0 * abs(a - b) * d),
        "row 2 theta_2": second,
        "row 3 cosine": (a**2 + d**2 - (b + c) ** 2) / (2.0 * a * d),
        "row 4 cosine": (a**2 + d**2 - (b - c) ** 2) / (2.0 * a * d),
        "row 4 theta_2": fourth,
        "row 4 arc cosine": fourth - math.degrees(to_ours(THETA_1)),
    }
    return ComputedTable(ours, {"row 2 theta_2": second - to_degrees(THETA_1)})


def truncate(value: float, decimals: int) -> float:
    """Cut off further decimals."""
    return math.trunc(value * 10.0**decimals) / 10.0**decimals


def _compute_cut_arm(k: Kinematics, decimals: int) -> float:
    """Return y of R23 in cm, theta_3 cut to some decimals of a degree (erratum 12)."""
    theta_3 = math.radians(truncate(to_degrees(k.theta_3), decimals))
    return -CENTRE[3] * math.sin(theta_3)


def _compute_kinematics(k: Kinematics) -> dict[str, float]:
    """Compute ours by the names of section 4.12 and of the manual's table.

    A alpha_3 + B alpha_4 = C and D alpha_3 + E alpha_4 = F.
    """
    turned = [
        a * OMEGA_2**2 * np.exp(1j * THETA_2),
        b * k.omega[3] ** 2 * np.exp(1j * k.theta_3),
        c * k.omega[4] ** 2 * np.exp(1j * k.theta_4),
    ]
    right = -sum(turned)
    values = {
        "theta3_deg": to_degrees(k.theta_3),
        "theta4_deg": to_degrees(k.theta_4),
        **{f"omega{bar}": omega for bar, omega in k.omega.items()},
        **{f"alpha{bar}": alpha for bar, alpha in k.alpha.items()},
        "A": b * math.sin(k.theta_3),
        "B": c * math.sin(k.theta_4),
        "C": float(right.real),
        "D": -b * math.cos(k.theta_3),
        "E": -c * math.cos(k.theta_4),
        "F": float(right.imag),
    }
    centres = {f"A_G{bar}": a_G for bar, a_G in k.a_G.items()}
    relative = k.a_G[3] - k.a_A
    vectors = {**centres, "A_A": k.a_A, "A_G3/A": relative, **k.arms}
    for name, (x, y) in vectors.items():
        values[f"{name}_i"] = float(x)
        values[f"{name}_j"] = float(y)
        values[f"{name}_mod"] = math.hypot(x, y)
        values[f"{name}_ang_deg"] = to_degrees(math.atan2(y, x))
    return values


def _compute_slips(k: Kinematics) -> dict[str, float]:
    """Compute the figures of these tables that errata 4 and 10 touch."""
    x, y = k.a_G[3]
    slipped = x + k.slip
    x_4, y_4 = k.a_G[4]
    return {
        "A_G3/A_i": slipped - k.a_A[0],
        "A_G3_i": slipped,
        "A_G3_mod": math.hypot(slipped, y),
        "A_G3_ang_deg": to_degrees(math.atan2(y, slipped)),
        "A_G4_ang_deg": to_degrees(math.atan(y_4 / x_4)),
    }


def _compute_constants(k: Kinematics) -> dict[str, ComputedTable]:
    """Compute the constants of section 5.7: inertias, right sides, arms, the matrix."""
    ours = _name_equations(ProgramErrors())
    # by four errata; the sign of I alpha is wrong for bar 3 alone, erratum 7
    made = _name_equations(ERRATA_IN_ORDER[4][1])
    made["k3_5"] = -made["k3_5"] - 2.0 * COUPLE_ON_A_BAR
    for number, sign in ((1, -1.0), (3, 1.0)):
        made[f"k3_{number}"] = sign * _compute_cut_arm(k, 6)
        made[f"k3_{number}_in_eq_5_6"] = sign * _compute_cut_arm(k, 8)
    force_2 = MASSES[2] * truncate(k.a_G[2][0], 6)
    by_hand = {
        "k2x": force_2 - FORCE_ON_BAR_2,
        "k2y": MASSES[2] * truncate(k.a_G[2][1], 6),
        "k4x": MASSES[4] * truncate(k.a_G[4][0], 10),
    }
    x, y = split_components(LOAD_ARM, LOAD_ANGLE)
    load = {"R_ext_i": x, "R_ext_j": y, "moment_of_force_N_cm": -y * FORCE_ON_BAR_2}
    again = {f"k3_{n}_in_eq_5_6": ours[f"k3_{n}"] for n in (1, 2, 3, 4)}
    inertias, about_long_axis = (
        {f"I_G{bar}": compute_inertia(bar, wrong) for bar in (3, 4)}
        for wrong in (False, True)
    )
    return {
        "5.7 inertias": ComputedTable({"I_G2": INERTIA_2} | inertias, about_long_axis),
        "5.7 constants": ComputedTable(ours | load | again, made | by_hand),
        "5.7 matrix": ComputedTable(ours, made),
    }


def _name_equations(errors: ProgramErrors) -> dict[str, float]:
    """Name the numbers of section 5.7's equations as the thesis does."""
    matrix, right = make_equations(errors)
    named = {f"right side, row {row}": right[row - 1] for row in range(10, 14)}
    named["T4 in row 9"] = matrix[8, 12]
    for bar in MOVING_BARS:
        row = 3 * (bar - 2)
        named |= {f"k{bar}{key}": right[row + i] for i, key in enumerate(("x", "y"))}
        named[f"k{bar}_5"] = right[row + 2]
        arms = matrix[row + 2, 4 * (bar - 2) :]
        named |= {f"k{bar}_{number}": arms[number - 1] for number in (1, 2, 3, 4)}
    return {name: float(number) for name, number in named.items()}


def _compute_unknowns(step: int) -> ComputedTable:
    """Compute the 13 unknowns, and those of the program with its errors to a step."""
    _, errors, inertias = ERRATA_IN_ORDER[step]
    return ComputedTable(
        compute_right_unknowns(),
        compute_thesis_program(errors, inertias),
        bound_round_off(errors, inertias),
    )
