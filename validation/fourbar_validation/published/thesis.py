"""The thesis's printed figures against ours.

Compared are angles and limit positions, then motion, constants and unknowns: sections
2.4, 4.12 and 5.7, table 3.2 and the tables of the manual. Ours come from
`fourbar.solve` and `fourbar.formulas.mobility`, or from the thesis's formula for a
constant that nobody else defines. Units as printed: cm, deg, rad/s, cm/s^2, N, N cm.
"""

import csv
import json
import math

import numpy as np

from fourbar.formulas.mobility import limit_positions
from fourbar_validation.published.figures import (
    PublishedFigure,
    Slips,
    compare_table,
)
from fourbar_validation.published.program import (
    BAR_LENGTHS,
    CENTRE,
    COUPLE_ON_A_BAR,
    DATA,
    ERRATA_IN_ORDER,
    FORCE_ON_BAR_2,
    INERTIA_2,
    LOAD_ANGLE,
    LOAD_ARM,
    MASSES,
    OMEGA_2,
    THETA_1,
    THETA_2,
    TO_N,
    Kinematics,
    bound_round_off,
    climb_ladder,
    compute_inertia,
    compute_motion,
    compute_right_unknowns,
    make_model_scene,
    read_printed,
    split_components,
    to_degrees,
    to_ours,
)

_ANGLE_NOISE = 4e-15
"""Four steps of a double near 360 deg, rad. The program carries such angles, where a
step is 5.7e-14 deg = 1e-15 rad.
"""
d, a, b, c = BAR_LENGTHS


def list_thesis_figures() -> list[PublishedFigure]:
    """List every published figure of the thesis."""
    k = Kinematics()
    return [
        *_list_positions(),
        *_list_half_angle_constants(),
        *_list_limits(),
        *_list_simulation_window(),
        *_list_printed_kinematics(k),
        *_list_constants(k),
        *_list_printed_unknowns(),
    ]


def _list_positions() -> list[PublishedFigure]:
    """List section 2.4's table: theta_3 and theta_4 of both roots at 281 positions."""
    text = (DATA / "positions.csv").read_text(encoding="utf-8")
    rows = list(csv.DictReader(text.splitlines()))
    theta_2 = np.radians([float(row["theta2_deg"]) for row in rows])
    printed = {}
    ours = {}
    for branch, third, fourth in (
        (1, "theta3_1", "theta4_2"),
        (-1, "theta3_2", "theta4_1"),
    ):
        s = compute_motion(theta_2, branch)
        for row, theta_3, theta_4 in zip(rows, s.theta_3, s.theta_4, strict=True):
            for name, angle in ((third, theta_3), (fourth, to_ours(theta_4))):
                place = f"{row['theta2_deg']} {name}"
                printed[place] = row[f"{name}_deg"]
                degrees = math.degrees(angle)
                turns = round((float(printed[place]) - degrees) / 360.0)
                ours[place] = degrees + 360.0 * turns
    lost = "136 theta3_1"
    slips: Slips = {lost: (("6",), 10.0 * ours[lost])}
    return compare_table("2.4 positions", printed, ours, slips)


def _list_half_angle_constants() -> list[PublishedFigure]:
    """List section 2.4 at theta_2 = 90 deg.

    k1 cos + k2 sin + k3 + e^2 = 0, A t^2 + B t + C = 0, t = tan(theta/2).
    """
    theta_2 = math.radians(90.0)
    x = a * math.cos(theta_2) + d * math.cos(THETA_1)
    y = a * math.sin(theta_2) + d * math.sin(THETA_1)
    ours = {}
    for branch, third, fourth in ((1, 1, 2), (-1, 2, 1)):
        s = compute_motion(np.array([theta_2]), branch)
        ours[f"theta3_{third}_deg"] = math.degrees(s.theta_3[0])
        ours[f"theta4_{fourth}_deg"] = math.degrees(to_ours(s.theta_4[0]))
    printed = {}
    tables = read_printed()["published"]["section_2_4_theta2_90"]
    for name, length, second in (("theta4", c, b), ("theta3", b, c)):
        k1 = 2.0 * length * x
        k2 = 2.0 * length * y
        k3 = x * x + y * y - second**2
        ours[f"{name} k1"] = k1
        ours[f"{name} k2"] = k2
        ours[f"{name} k3"] = k3
        ours[f"{name} A"] = k3 + length**2 - k1
        ours[f"{name} B"] = 2.0 * k2
        ours[f"{name} C"] = k3 + length**2 + k1
        for key, text in tables[name].items():
            printed[key if key in ours else f"{name} {key}"] = text
    return compare_table("2.4 constants", printed, ours)


def _list_simulation_window() -> list[PublishedFigure]:
    """List the manual's window: angles e1..e4 in rad and deg, of theta_2 = 0."""
    s = compute_motion(np.array([0.0]))
    theta_3 = s.theta_3[0]
    theta_4 = to_ours(s.theta_4[0])
    ours = {
        "e1_rad": THETA_1,
        "e2_rad": 0.0,
        "e3_rad": theta_3,
        "e4_rad": theta_4,
        "teta1_deg": to_degrees(THETA_1),
        "tetaDos_deg": 0.0,
        "anguloTres_deg": to_degrees(theta_3),
        "anguloCuatro_deg": to_degrees(theta_4),
    }
    printed = read_printed()["published"]["manual_simulation_window"]
    del printed["note"]
    return compare_table(
        "manual, window", printed, ours, {"tetaDos_deg": (("17",), None)}
    )


def _list_limits() -> list[PublishedFigure]:
    """List table 3.2: cosines whose existence decides, and limit positions.

    The limit positions are those that do exist.
    """
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
    keys = {
        "cosine": "discriminant_printed",
        "theta_2": "value_printed_deg",
        "arc cosine": "acos_printed_deg",
    }
    table = json.loads((DATA / "limits.json").read_text(encoding="utf-8"))["table_3_2"]
    printed = {}
    for name in ours:
        _, number, what = name.split(maxsplit=2)
        printed[name] = table[int(number) - 1][keys[what]]
    slips: Slips = {"row 2 theta_2": (("14",), second - to_degrees(THETA_1))}
    return compare_table("3.2 limits", printed, ours, slips)


def truncate(value: float, decimals: int) -> float:
    """Cut off further decimals."""
    return math.trunc(value * 10.0**decimals) / 10.0**decimals


def _compute_cut_arm(k: Kinematics, decimals: int) -> float:
    """Return y of R23 in cm, theta_3 cut to some decimals of a degree (erratum 12)."""
    return -CENTRE[3] * math.sin(
        math.radians(truncate(to_degrees(k.theta_3), decimals))
    )


def _compute_our_kinematics(k: Kinematics) -> dict[str, float]:
    """Compute ours by the names of section 4.12 and of the manual's table.

    A alpha_3 + B alpha_4 = C and D alpha_3 + E alpha_4 = F.
    """
    speeds = (
        (a, OMEGA_2, THETA_2),
        (b, k.omega[3], k.theta_3),
        (c, k.omega[4], k.theta_4),
    )
    values = {
        "theta3_deg": to_degrees(k.theta_3),
        "theta4_deg": to_degrees(k.theta_4),
        **{f"omega{bar}": omega for bar, omega in k.omega.items()},
        **{f"alpha{bar}": alpha for bar, alpha in k.alpha.items()},
        "A": b * math.sin(k.theta_3),
        "B": c * math.sin(k.theta_4),
        "C": -sum(
            length * omega**2 * math.cos(theta) for length, omega, theta in speeds
        ),
        "D": -b * math.cos(k.theta_3),
        "E": -c * math.cos(k.theta_4),
        "F": -sum(
            length * omega**2 * math.sin(theta) for length, omega, theta in speeds
        ),
    }
    vectors = {
        "A_G2": k.a_G[2],
        "A_A": k.a_A,
        "A_G3/A": k.a_G[3] - k.a_A,
        "A_G3": k.a_G[3],
        "A_G4": k.a_G[4],
        **k.arms,
    }
    for name, (x, y) in vectors.items():
        values[f"{name}_i"] = x
        values[f"{name}_j"] = y
        values[f"{name}_mod"] = math.hypot(x, y)
        values[f"{name}_ang_deg"] = to_degrees(math.atan2(y, x))
    return {key: float(value) for key, value in values.items()}


def _list_slips(k: Kinematics) -> Slips:
    """List the figures that the errata touch, with the value that these lead to."""
    x, y = k.a_G[3]
    slipped = x + k.slip
    x_4, y_4 = k.a_G[4]
    return {
        "A_G3/A_i": (("4",), x - k.a_A[0] + k.slip),
        "A_G3_i": (("4",), slipped),
        "A_G3_mod": (("4",), math.hypot(slipped, y)),
        "A_G3_ang_deg": (("4",), to_degrees(math.atan2(y, slipped))),
        "A_G4_ang_deg": (("10",), to_degrees(math.atan(y_4 / x_4))),
    }


def _list_printed_kinematics(k: Kinematics) -> list[PublishedFigure]:
    """List section 4.12, and the manual's table of the program's 17 digits."""
    ours = _compute_our_kinematics(k)
    slips = _list_slips(k)
    by_hand: Slips = {
        **slips,
        "R23_j": (("12",), _compute_cut_arm(k, 6)),
        "R43_j": (("12",), -_compute_cut_arm(k, 6)),
    }
    sizes = {
        "t": math.degrees(1.0),
        "R": abs(CENTRE[2]),
        "A": float(np.abs(k.a_G[2]).max()),
    }
    noise = {name: _ANGLE_NOISE * sizes.get(name[0], 1.0) for name in ours}
    printed = read_printed()["published"]
    program = printed["manual_program_kinematic"]
    return [
        *compare_table("4.12", printed["section_4_12_hand"], ours, by_hand),
        *compare_table("manual, kinematics", program, ours, slips, noise),
    ]


def _list_constants(k: Kinematics) -> list[PublishedFigure]:
    """List the constants of section 5.7: inertias, right sides, arms, the matrix."""
    source = read_printed()
    ours = _compute_our_constants(k)
    slips = _list_slips_of_constants(k)
    force_2 = MASSES[2] * truncate(k.a_G[2][0], 6)
    by_hand: Slips = {
        **slips,
        "k3_2_in_eq_5_6": (("12b",), None),
        "k4_1": (("12b",), None),
        "k2x": (("1", "12c"), force_2 - FORCE_ON_BAR_2),
        "k2y": (("1", "12c"), MASSES[2] * truncate(k.a_G[2][1], 6)),
        "k4x": (("1", "12c"), MASSES[4] * truncate(k.a_G[4][0], 10)),
    }
    matrix = source["published"]["section_5_7_matrix_as_printed"]
    sides = [f"k{bar}{key}" for bar in (2, 3, 4) for key in ("x", "y", "_5")]
    in_matrix = dict(zip(sides, matrix["rhs"], strict=False))
    for bar, row in ((2, "row3_bar2"), (3, "row6_bar3"), (4, "row9_bar4")):
        for number in (1, 2, 3, 4):
            in_matrix[f"k{bar}_{number}"] = matrix[row][number - 1]
    for number, text in enumerate(matrix["rhs"][9:], 10):
        in_matrix[f"right side, row {number}"] = text
        ours[f"right side, row {number}"] = 0.0
    in_matrix["T4 in row 9"] = matrix["row9_bar4"][4]
    ours["T4 in row 9"] = 1.0
    # the matrix has the arms in full
    in_full = {name: slip for name, slip in slips.items() if "12" not in slip[0]}
    by_program = source["inputs"]["inertia_kg_cm2_printed"]
    inertias = {f"I_G{bar}": by_program[f"I_G{bar}"] for bar in MASSES}
    of_hand = source["published"]["section_5_7_hand_constants"]
    return [
        *compare_table("5.7 inertias", inertias, ours, slips),
        *compare_table("5.7 constants", of_hand, ours, by_hand),
        *compare_table("5.7 matrix", in_matrix, ours, in_full),
    ]


def _compute_our_constants(k: Kinematics) -> dict[str, float]:
    """Compute ours by the names of section 5.7."""
    x, y = split_components(LOAD_ARM, LOAD_ANGLE)
    ours: dict[str, float] = {
        "I_G2": INERTIA_2,
        "I_G3": compute_inertia(3),
        "I_G4": compute_inertia(4),
        "R_ext_i": x,
        "R_ext_j": y,
        "moment_of_force_N_cm": -y * FORCE_ON_BAR_2,
    }
    for bar, a_G in k.a_G.items():
        force = FORCE_ON_BAR_2 if bar == 2 else 0.0
        ours[f"k{bar}x"] = TO_N * MASSES[bar] * a_G[0] - force
        ours[f"k{bar}y"] = TO_N * MASSES[bar] * a_G[1]
    ours["k2_5"] = -COUPLE_ON_A_BAR + y * FORCE_ON_BAR_2
    for bar in (3, 4):
        inertial = TO_N * compute_inertia(bar) * k.alpha[bar]
        ours[f"k{bar}_5"] = inertial - COUPLE_ON_A_BAR
    for bar, pins in ((2, ("R12", "R32")), (3, ("R23", "R43")), (4, ("R14", "R34"))):
        for pair, pin in enumerate(pins):
            x, y = k.arms[pin]
            ours[f"k{bar}_{2 * pair + 1}"] = -y
            ours[f"k{bar}_{2 * pair + 2}"] = x
    for number in (1, 2, 3, 4):
        ours[f"k3_{number}_in_eq_5_6"] = ours[f"k3_{number}"]
    return ours


def _list_slips_of_constants(k: Kinematics) -> Slips:
    """List the constants that the errata touch, with the value that these lead to."""
    about_long_axis = {
        bar: compute_inertia(bar, about_long_axis=True) for bar in (3, 4)
    }
    slips: Slips = {f"I_G{bar}": (("3",), about_long_axis[bar]) for bar in (3, 4)}
    for bar, a_G in k.a_G.items():
        force = FORCE_ON_BAR_2 if bar == 2 else 0.0
        slip = k.slip if bar == 3 else 0.0
        errata = ("4", "1") if slip else ("1",)
        slips[f"k{bar}x"] = (errata, MASSES[bar] * (a_G[0] + slip) - force)
        slips[f"k{bar}y"] = (("1",), MASSES[bar] * a_G[1])
    # the sign of I alpha is wrong for bar 3 alone, erratum 7
    inertial_3 = -1.0 * about_long_axis[3] * k.alpha[3]
    inertial_4 = about_long_axis[4] * k.alpha[4]
    slips["k3_5"] = (("3", "2", "7"), inertial_3 - COUPLE_ON_A_BAR)
    slips["k4_5"] = (("3", "2"), inertial_4 - COUPLE_ON_A_BAR)
    for number, sign in ((1, -1.0), (3, 1.0)):
        slips[f"k3_{number}"] = (("12",), sign * _compute_cut_arm(k, 6))
        slips[f"k3_{number}_in_eq_5_6"] = (("12",), sign * _compute_cut_arm(k, 8))
    return slips


def _list_printed_unknowns() -> list[PublishedFigure]:
    """List the 13 unknowns, of the program (the manual's table) and of section 5.7."""
    steps = climb_ladder()
    names = ("3", "1", "2", "4", "5")
    figures = []
    for key, label, step, errata in (
        ("manual_program_dynamic", "manual, unknowns", -2, names),
        ("section_5_7_hand_solution", "5.7 unknowns", -1, (*names, "5b")),
    ):
        figures += compare_table(
            label,
            read_printed()["published"][key],
            compute_right_unknowns(),
            {name: (errata, made) for name, made in steps[step][1].items()},
            bound_round_off(*ERRATA_IN_ORDER[step][1:]),  # printed with up to 17 digits
        )
    return figures
