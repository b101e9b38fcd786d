"""The thesis's printed motion, constants and unknowns against ours: sections 4.12 and 5.7, the manual's tables.

Ours come from `fourbar.solve`, or from the thesis's formula for a constant that nobody else defines.
Units as printed: cm, deg, rad/s, cm/s^2, N, N cm.
"""

import math
from collections.abc import Iterator

import numpy as np

from fourbar_validation.published.figures import PublishedFigure
from fourbar_validation.published.program import (
    CENTRE,
    COUPLE,
    INERTIA_2,
    LENGTHS,
    LOAD,
    LOAD_ANGLE,
    LOAD_ARM,
    MASSES,
    OMEGA_2,
    STEPS,
    THETA_2,
    TO_N,
    Kinematics,
    climb_ladder,
    compute_inertia,
    compute_right_unknowns,
    read_printed,
    round_off,
    split_components,
    to_degrees,
)

ANGLE_NOISE = 4e-15
"""The program carries angles near 360 deg, where a double steps by 5.7e-14 deg = 1e-15 rad: four such steps, rad."""
_, a, b, c = LENGTHS


def cut(value: float, decimals: int) -> float:
    """Cut off further decimals."""
    return math.trunc(value * 10.0**decimals) / 10.0**decimals


def compute_cut_arm(k: Kinematics, decimals: int) -> float:
    """Compute y of R23 with theta_3 cut to some decimals of a degree first, erratum 12."""
    return -CENTRE[3] * math.sin(math.radians(cut(to_degrees(k.theta_3), decimals)))


def compute_our_kinematics(k: Kinematics) -> dict[str, float]:
    """Compute ours by the names of section 4.12 and of the manual's table.

    A alpha_3 + B alpha_4 = C and D alpha_3 + E alpha_4 = F.
    """
    speeds = ((a, OMEGA_2, THETA_2), (b, k.omega[3], k.theta_3), (c, k.omega[4], k.theta_4))
    values = {
        "theta3_deg": to_degrees(k.theta_3),
        "theta4_deg": to_degrees(k.theta_4),
        **{f"omega{bar}": omega for bar, omega in k.omega.items()},
        **{f"alpha{bar}": alpha for bar, alpha in k.alpha.items()},
        "A": b * math.sin(k.theta_3),
        "B": c * math.sin(k.theta_4),
        "C": -sum(length * omega**2 * math.cos(theta) for length, omega, theta in speeds),
        "D": -b * math.cos(k.theta_3),
        "E": -c * math.cos(k.theta_4),
        "F": -sum(length * omega**2 * math.sin(theta) for length, omega, theta in speeds),
    }
    vectors = {"A_G2": k.a_G[2], "A_A": k.a_A, "A_G3/A": k.a_G[3] - k.a_A, "A_G3": k.a_G[3], "A_G4": k.a_G[4], **k.arms}
    for name, (x, y) in vectors.items():
        values |= {f"{name}_i": x, f"{name}_j": y, f"{name}_mod": math.hypot(x, y)}
        values[f"{name}_ang_deg"] = to_degrees(math.atan2(y, x))
    return {key: float(value) for key, value in values.items()}


def list_slips(k: Kinematics) -> dict[str, tuple[tuple[str, ...], float]]:
    """List the figures that the errata touch, with the value that these lead to."""
    x, y = k.a_G[3][0] + k.slip, k.a_G[3][1]
    return {
        "A_G3/A_i": (("4",), k.a_G[3][0] - k.a_A[0] + k.slip),
        "A_G3_i": (("4",), x),
        "A_G3_mod": (("4",), math.hypot(x, y)),
        "A_G3_ang_deg": (("4",), to_degrees(math.atan2(y, x))),
        "A_G4_ang_deg": (("10",), to_degrees(math.atan(k.a_G[4][1] / k.a_G[4][0]))),
    }


def list_kinematics(k: Kinematics) -> Iterator[PublishedFigure]:
    """Section 4.12, and the manual's table of the program's 17 digits."""
    ours, slips = compute_our_kinematics(k), list_slips(k)
    by_hand = {"R23_j": (("12",), compute_cut_arm(k, 6)), "R43_j": (("12",), -compute_cut_arm(k, 6))}
    for name, text in read_printed()["published"]["section_4_12_hand"].items():
        errata, made = {**slips, **by_hand}.get(name, ((), None))
        yield PublishedFigure("4.12", name, text, ours[name], errata, made)
    for name, text in read_printed()["published"]["manual_program_kinematic"].items():
        errata, made = slips.get(name, ((), None))
        size = {"t": math.degrees(1.0), "R": abs(CENTRE[2]), "A": float(np.abs(k.a_G[2]).max())}.get(name[0], 1.0)
        yield PublishedFigure("manual, kinematics", name, text, ours[name], errata, made, ANGLE_NOISE * size)


def list_constants(k: Kinematics) -> Iterator[PublishedFigure]:
    """Section 5.7: inertias, right sides and moment arms of the 13 equations, and the matrix as printed."""
    source = read_printed()
    inertias = source["inputs"]["inertia_kg_cm2_printed"]
    yield PublishedFigure("5.7 inertias", "I_G2", inertias["I_G2"], INERTIA_2)
    for bar in (3, 4):
        yield PublishedFigure(
            "5.7 inertias",
            f"I_G{bar}",
            inertias[f"I_G{bar}"],
            compute_inertia(bar),
            ("3",),
            compute_inertia(bar, about_long_axis=True),
        )
    load = split_components(LOAD_ARM, LOAD_ANGLE)
    ours: dict[str, float] = {"R_ext_i": load[0], "R_ext_j": load[1], "moment_of_force_N_cm": -load[1] * LOAD}
    slips: dict[str, tuple[tuple[str, ...], float]] = {}
    for bar, a_G in k.a_G.items():
        force = LOAD if bar == 2 else 0.0
        slip = k.slip if bar == 3 else 0.0
        ours[f"k{bar}x"], ours[f"k{bar}y"] = TO_N * MASSES[bar] * a_G[0] - force, TO_N * MASSES[bar] * a_G[1]
        slips[f"k{bar}x"] = (("4", "1") if slip else ("1",), MASSES[bar] * (a_G[0] + slip) - force)
        slips[f"k{bar}y"] = (("1",), MASSES[bar] * a_G[1])
    ours["k2_5"] = -COUPLE + load[1] * LOAD
    for bar, alpha, sign in ((3, k.alpha[3], -1.0), (4, k.alpha[4], 1.0)):
        ours[f"k{bar}_5"] = TO_N * compute_inertia(bar) * alpha - COUPLE
        # the sign of I alpha is wrong for bar 3 alone, erratum 7
        made = sign * compute_inertia(bar, about_long_axis=True) * alpha - COUPLE
        slips[f"k{bar}_5"] = (("3", "2", "7") if bar == 3 else ("3", "2"), made)
    for bar, pins in ((2, ("R12", "R32")), (3, ("R23", "R43")), (4, ("R14", "R34"))):
        for pair, pin in enumerate(pins):
            x, y = k.arms[pin]
            ours[f"k{bar}_{2 * pair + 1}"], ours[f"k{bar}_{2 * pair + 2}"] = -y, x
    for number, sign in ((1, -1.0), (3, 1.0)):
        slips[f"k3_{number}"] = (("12",), sign * compute_cut_arm(k, 6))
        slips[f"k3_{number}_in_eq_5_6"] = (("12",), sign * compute_cut_arm(k, 8))
    ours |= {f"k3_{number}_in_eq_5_6": ours[f"k3_{number}"] for number in (1, 2, 3, 4)}
    by_hand: dict[str, tuple[tuple[str, ...], float | None]] = {
        **slips,
        "k3_2_in_eq_5_6": (("12b",), None),
        "k4_1": (("12b",), None),
        "k2x": (("1", "12c"), MASSES[2] * cut(k.a_G[2][0], 6) - LOAD),
        "k2y": (("1", "12c"), MASSES[2] * cut(k.a_G[2][1], 6)),
        "k4x": (("1", "12c"), MASSES[4] * cut(k.a_G[4][0], 10)),
    }
    for name, text in source["published"]["section_5_7_hand_constants"].items():
        errata, changed = by_hand.get(name, ((), None))
        yield PublishedFigure("5.7 constants", name, text, float(ours[name]), errata, changed)
    matrix = source["published"]["section_5_7_matrix_as_printed"]
    sides = [f"k{bar}{key}" for bar in (2, 3, 4) for key in ("x", "y", "_5")]
    entries = list(zip(sides, matrix["rhs"], strict=False))
    for bar, row in ((2, "row3_bar2"), (3, "row6_bar3"), (4, "row9_bar4")):
        entries += [(f"k{bar}_{n}", text) for n, text in enumerate(matrix[row][:4], 1)]
    for name, text in entries:
        errata, changed = {key: value for key, value in slips.items() if "12" not in value[0]}.get(name, ((), None))
        yield PublishedFigure("5.7 matrix", name, text, float(ours[name]), errata, changed)
    for number, text in enumerate(matrix["rhs"][9:], 10):
        yield PublishedFigure("5.7 matrix", f"right side, row {number}", text, 0.0)
    yield PublishedFigure("5.7 matrix", "T4 in row 9", matrix["row9_bar4"][4], 1.0)


def list_unknowns() -> Iterator[PublishedFigure]:
    """List the 13 unknowns, of the program (the manual's table) and of section 5.7."""
    right, steps = compute_right_unknowns(), climb_ladder()
    names = tuple(name for name, _, _ in STEPS if name in "12345" and name)
    for key, label, step, last in (
        ("manual_program_dynamic", "manual, unknowns", -2, ()),
        ("section_5_7_hand_solution", "5.7 unknowns", -1, ("5b",)),
    ):
        noise = round_off(*STEPS[step][1:])  # printed with up to 17 digits
        for name, text in read_printed()["published"][key].items():
            yield PublishedFigure(label, name, text, right[name], (*names, *last), steps[step][1][name], noise[name])


def list_dynamics() -> Iterator[PublishedFigure]:
    """List every published velocity, acceleration, constant and unknown of the thesis."""
    k = Kinematics()
    yield from list_kinematics(k)
    yield from list_constants(k)
    yield from list_unknowns()
