"""The thesis's own program and printed tables, with any of its errata made.

Sections 2.4, 4.12 and 5.7, table 3.2 and the tables of the manual. Without errata the
numbers come from `fourbar.solve` and `fourbar.formulas.mobility`, or from the thesis's
formula for a constant that nobody else defines. Units as printed: cm, deg, rad/s,
cm/s^2, N, N cm.

Source: I. Linares Mendoza, "Analisis cinematico y dinamico asistido por computadora de
mecanismos de cuatro barras", UNAM FES Cuautitlan, sections 4.12 and 5.7 and the
program's tables in the manual.
"""

import math
from collections.abc import Sequence
from functools import cache, cached_property

import numpy as np

import fourbar
from fourbar.formulas.mobility import limit_positions
from fourbar.linkage import MOVING_BARS
from fourbar.quantities import Array
from fourbar_validation.compare.pins import resolve
from fourbar_validation.compare.tolerance import EPS
from fourbar_validation.published.printed_figures import POSITIONS, read_printed
from fourbar_validation.published.thirteen import EquationTerms, assemble_equations

_PRINTED_FORCES = ("F12", "F32", "F23", "F43", "F14", "F34")
PRINTED_UNKNOWNS = (*(f"{pin}{axis}" for pin in _PRINTED_FORCES for axis in "xy"), "T4")
BAR_LENGTHS = (20.0, 48.0, 55.0, 20.0)
"""Bars 1 to 4, cm."""
MASSES = {2: 57.0, 3: 0.544, 4: 0.2}
"""kg."""
INERTIA_2 = 57.0 * 153.0**2 / 12.0
"""kg cm^2; bar 2 is 153 cm long in all."""
BAR_WIDTH = 2.54
"""cm."""
OMEGA_2 = 0.2244
"""rad/s."""
THETA_1, THETA_2 = math.radians(225.0), math.radians(135.0)
"""Angles of sections 4.12 and 5.7 in the thesis's convention, rad."""
CENTRE = {2: 76.5, 3: 27.5, 4: 10.0}
"""Distance from the bar's first pin to G, cm."""
FORCE_ON_BAR_2, LOAD_ARM, LOAD_ANGLE = 10.0, 5.0, math.radians(265.0)
"""Force along x on bar 2, N, and where it acts from G2, cm and rad."""
COUPLE_ON_A_BAR = -15.0
"""Couple on each of bars 2, 3, 4, N cm."""
TO_N = 0.01
"""1 kg cm/s^2 in N, and 1 kg cm^2/s^2 in N cm."""
AS_PRINTED = "manual"
"""Name, beside the errata, of the inertias that the manual prints."""
TYPED_INERTIAS = {
    AS_PRINTED: (0.2924725333, 0.1075266667),
    "5b": (0.292472, 0.107526),
}
"""I_G3, I_G4 of the manual's table and of section 5.7, kg cm^2, solved back from the
printed unknowns.
"""
LADDER = ("3", "1", "2", "4", "5", AS_PRINTED, "5b")
"""Errata in the order in which they are made, from right to published."""
CUT_DECIMALS = {2: 6, 4: 10}
"""Decimals after which erratum 12c cuts the accelerations of G2 and G4."""
_ANGLE_NOISE = 4e-15
"""Four steps of a double near 360 deg, rad. The program carries such angles, where a
step is 5.7e-14 deg = 1e-15 rad.
"""
d, a, b, c = BAR_LENGTHS
Numbers = dict[str, float]
"""Numbers of a printed table, by the names of its figures."""


def to_degrees(angle: float) -> float:
    """Convert to degrees in [0, 360), as the thesis has them."""
    return math.degrees(angle) % 360.0


def truncate(value: float, decimals: int) -> float:
    """Cut off further decimals."""
    return math.trunc(value * 10.0**decimals) / 10.0**decimals


def to_ours(theta: float) -> float:
    """Convert theta_1 or theta_4 of the thesis to our convention, or back, rad.

    The thesis's polygon sums to zero.
    """
    return math.remainder(theta + math.pi, 2.0 * math.pi)


def compute_inertia(bar: int, about_long_axis: bool = False) -> float:
    """Return I_G of bar 3 or 4, kg cm^2.

    I_G is m (L^2 + w^2)/12, or m w^2/12 as the thesis has it.
    """
    across = 0.0 if about_long_axis else BAR_LENGTHS[bar - 1] ** 2
    return MASSES[bar] * (across + BAR_WIDTH**2) / 12.0


def make_model_scene(theta_2: Array | float, branch: int = 1) -> fourbar.Scene:
    """Make the model mechanism for our formulas, SI, uniform bars of `BAR_WIDTH`."""
    inertias = {2: INERTIA_2, 3: compute_inertia(3), 4: compute_inertia(4)}
    two, three, four = (
        fourbar.Bar(
            0.01 * BAR_LENGTHS[bar - 1],
            MASSES[bar],
            1e-4 * inertias[bar],
            (0.01 * CENTRE[bar], 0.0),
        )
        for bar in MOVING_BARS
    )
    theta_1 = to_ours(THETA_1)
    linkage = fourbar.FourBar(0.01 * d, two, three, four, ground_angle=theta_1)
    arm = (0.01 * LOAD_ARM, LOAD_ANGLE)
    couples = [fourbar.Load(bar, moment=0.01 * COUPLE_ON_A_BAR) for bar in MOVING_BARS]
    loads = (fourbar.Load(2, (FORCE_ON_BAR_2, 0.0), arm=arm), *couples)
    motion = fourbar.Motion(theta_2, OMEGA_2, branch=branch)
    return fourbar.Scene(linkage, motion, drive_bar=4, loads=loads)


def compute_motion(theta_2: Array, branch: int = 1) -> fourbar.Solution:
    """Compute position to accelerations of the model mechanism by our formulas, SI."""
    return fourbar.solve(make_model_scene(theta_2, branch), "acceleration")


def compute_right_unknowns() -> Numbers:
    """Compute the 13 unknowns by our formulas at theta_2 = 135 deg, N and N cm."""
    s = fourbar.solve(make_model_scene(THETA_2))
    pins = (s.F12, s.F32, -s.F32, s.F43, s.F14, -s.F43)
    unknowns = np.concatenate([*(pin[0] for pin in pins), 100.0 * s.torque])
    return dict(zip(PRINTED_UNKNOWNS, unknowns.tolist(), strict=True))


class ThesisProgram:
    """The thesis's calculation at theta_2 = 135 deg, by our motion, with errata made.

    Lengths are in cm, angles as the thesis counts them.

    Parameters
    ----------
    errata : ids of the errata that are made, and the keys of `TYPED_INERTIAS`.
    decimals : of theta_3, deg, that erratum 12 leaves in the arms of bar 3.
    """

    def __init__(self, errata: Sequence[str] = (), decimals: int = 6) -> None:
        self.errata = errata
        s = compute_motion(np.array([THETA_2]))
        self.theta_3 = float(s.theta_3[0])
        self.theta_4 = to_ours(float(s.theta_4[0]))
        self.omega, self.alpha = (
            {bar: float(getattr(s, f"{name}_{bar}")[0]) for bar in MOVING_BARS}
            for name in ("omega", "alpha")
        )
        self.a_G = {bar: 100.0 * getattr(s, f"a_G{bar}")[0] for bar in MOVING_BARS}
        self.a_A = 100.0 * s.a_A[0]
        if "4" in errata:
            # -(L w^2 cos - L alpha sin) for -(... + ...), eq 4.20
            slip = 2.0 * CENTRE[3] * self.alpha[3] * math.sin(self.theta_3)
            self.a_G[3][0] += slip
        if "5" in errata:  # index 5 for 6
            self.a_G[4][0] = self.alpha[3]
        if "12c" in errata:
            for bar, kept in CUT_DECIMALS.items():
                self.a_G[bar] = np.array([truncate(x, kept) for x in self.a_G[bar]])
        in_arms = self.theta_3
        if "12" in errata:
            in_arms = math.radians(truncate(to_degrees(in_arms), decimals))
        self.arms = {  # from G; R14 points along B to O4, the thesis's theta_4
            "R12": resolve(-CENTRE[2], THETA_2),
            "R32": resolve(a - CENTRE[2], THETA_2),
            "R23": resolve(-CENTRE[3], in_arms),
            "R43": resolve(b - CENTRE[3], in_arms),
            "R14": resolve(CENTRE[4], self.theta_4),
            "R34": resolve(CENTRE[4] - c, self.theta_4),
        }
        inertias = [compute_inertia(bar, "3" in errata) for bar in (3, 4)]
        for name, typed in TYPED_INERTIAS.items():
            if name in errata:
                inertias = [*typed]
        self.inertias = {2: INERTIA_2, 3: inertias[0], 4: inertias[1]}

    @cached_property
    def equations(self) -> tuple[Array, Array]:
        """Matrix and right side of section 5.7, N and N cm.

        sum F = m A and sum M_G = I alpha of bars 2, 3, 4; F32 = -F23 and F34 = -F43.
        """
        per_mass = 1.0 if "1" in self.errata else TO_N
        per_inertia = 1.0 if "2" in self.errata else TO_N
        force = {}
        moment = {}
        for bar in MOVING_BARS:
            force[bar] = per_mass * MASSES[bar] * self.a_G[bar]
            inertial = per_inertia * self.inertias[bar] * self.alpha[bar]
            if bar == 3 and "7" in self.errata:
                inertial = -inertial
            moment[bar] = np.array([inertial - COUPLE_ON_A_BAR])
        force[2][0] -= FORCE_ON_BAR_2
        _, y = resolve(LOAD_ARM, LOAD_ANGLE)
        moment[2] += y * FORCE_ON_BAR_2  # minus the moment of the load, -y F
        first, second = (
            {bar: np.array([self.arms[name]]) for bar, name in enumerate(names, 2)}
            for names in (("R12", "R23", "R14"), ("R32", "R43", "R34"))
        )
        terms = EquationTerms(first, second, force, moment)
        matrix, right = assemble_equations(terms, 4)
        return matrix[0], right[0]

    def unknowns(self) -> Numbers:
        """Compute the 13 unknowns of section 5.7, N and N cm."""
        solved = np.linalg.solve(*self.equations)
        return dict(zip(PRINTED_UNKNOWNS, solved.tolist(), strict=True))

    def bound_round_off(self) -> Numbers:
        """Bound how far an elimination of these equations may be off, N and N cm.

        The bound is for each unknown, whoever eliminates. 13 eps |A^-1| (|A| |x| +
        |b|): each number of the system carries up to as many roundings as there are
        unknowns, from its own making and from the elimination (Higham, Accuracy and
        Stability, 7.2 and 9.3).
        """
        matrix, right = self.equations
        terms = np.abs(matrix) @ np.abs(np.linalg.solve(matrix, right)) + np.abs(right)
        moved = np.abs(np.linalg.inv(matrix)) @ terms
        bounds = len(PRINTED_UNKNOWNS) * EPS * moved
        return dict(zip(PRINTED_UNKNOWNS, bounds.tolist(), strict=True))

    def kinematics(self) -> Numbers:
        """Compute the numbers of section 4.12 and of the manual's table.

        A alpha_3 + B alpha_4 = C and D alpha_3 + E alpha_4 = F.
        """
        turned = [
            a * OMEGA_2**2 * np.exp(1j * THETA_2),
            b * self.omega[3] ** 2 * np.exp(1j * self.theta_3),
            c * self.omega[4] ** 2 * np.exp(1j * self.theta_4),
        ]
        right = -sum(turned)
        values = {
            "theta3_deg": to_degrees(self.theta_3),
            "theta4_deg": to_degrees(self.theta_4),
            **{f"omega{bar}": omega for bar, omega in self.omega.items()},
            **{f"alpha{bar}": alpha for bar, alpha in self.alpha.items()},
            "A": b * math.sin(self.theta_3),
            "B": c * math.sin(self.theta_4),
            "C": float(right.real),
            "D": -b * math.cos(self.theta_3),
            "E": -c * math.cos(self.theta_4),
            "F": float(right.imag),
        }
        vectors = {f"A_G{bar}": a_G for bar, a_G in self.a_G.items()} | self.arms
        vectors |= {"A_A": self.a_A, "A_G3/A": self.a_G[3] - self.a_A}
        for name, (x, y) in vectors.items():
            values[f"{name}_i"] = float(x)
            values[f"{name}_j"] = float(y)
            values[f"{name}_mod"] = math.hypot(x, y)
            angle = math.atan(y / x) if "10" in self.errata else math.atan2(y, x)
            values[f"{name}_ang_deg"] = to_degrees(angle)
        return values

    def constants(self) -> Numbers:
        """Name the numbers of section 5.7's equations as the thesis does."""
        matrix, right = self.equations
        x, y = resolve(LOAD_ARM, LOAD_ANGLE)
        named = {
            "T4 in row 9": matrix[8, 12],
            "R_ext_i": x,
            "R_ext_j": y,
            "moment_of_force_N_cm": -y * FORCE_ON_BAR_2,
        }
        named |= {f"right side, row {row}": right[row - 1] for row in range(10, 14)}
        for bar in MOVING_BARS:
            row = 3 * (bar - 2)
            for i, key in enumerate(("x", "y", "_5")):
                named[f"k{bar}{key}"] = right[row + i]
            arms = matrix[row + 2, 4 * (bar - 2) :]
            named |= {f"k{bar}_{number}": arms[number - 1] for number in (1, 2, 3, 4)}
        return {name: float(number) for name, number in named.items()}


@cache
def compute_tables(errata: tuple[str, ...] = ()) -> dict[str, Numbers]:
    """Compute every table of the thesis by its name, with these errata made."""
    program = ThesisProgram(errata)
    kinematics = program.kinematics()
    constants = program.constants()
    in_eq_5_6 = ThesisProgram(errata, decimals=8).constants()
    again = {f"k3_{n}_in_eq_5_6": in_eq_5_6[f"k3_{n}"] for n in (1, 2, 3, 4)}
    if errata:
        unknowns = program.unknowns()
        manual = ThesisProgram((*errata, AS_PRINTED)).unknowns()
    else:
        unknowns = manual = compute_right_unknowns()
    return {
        POSITIONS: _compute_positions("6" in errata),
        "2.4 constants": _compute_half_angle_constants(),
        "3.2 limits": _compute_limits("14" in errata),
        "manual, window": _compute_window(),
        "4.12": kinematics,
        "manual, kinematics": kinematics,
        "5.7 inertias": {f"I_G{bar}": x for bar, x in program.inertias.items()},
        "5.7 constants": constants | again,
        "5.7 matrix": constants,
        "manual, unknowns": manual,
        "5.7 unknowns": unknowns,
    }


@cache
def find_noise() -> dict[str, Numbers]:
    """Find the round-off of the digits that the program printed in full, by table."""
    sizes = {
        "t": math.degrees(1.0),
        "R": CENTRE[2],
        "A": float(np.abs(ThesisProgram().a_G[2]).max()),
    }
    names = compute_tables()["manual, kinematics"]
    manual, published = (ThesisProgram(LADDER[:steps]) for steps in (-1, None))
    return {
        "manual, kinematics": {
            name: _ANGLE_NOISE * sizes.get(name[0], 1.0) for name in names
        },
        "manual, unknowns": manual.bound_round_off(),
        "5.7 unknowns": published.bound_round_off(),
    }


def _solve_roots(theta_2: Array) -> dict[str, Array]:
    """Solve theta_3 and theta_4 of both roots, deg, by the thesis's names."""
    roots = {}
    for branch, third, fourth in ((1, 1, 2), (-1, 2, 1)):
        s = compute_motion(theta_2, branch)
        roots[f"theta3_{third}"] = np.degrees(s.theta_3)
        roots[f"theta4_{fourth}"] = np.degrees([*map(to_ours, s.theta_4)])
    return roots


def _compute_positions(tenfold: bool) -> Numbers:
    """Compute section 2.4's table of 281 positions, angles to the turn as printed.

    `tenfold`: one of them is printed with its point one digit too far (erratum 6).
    """
    printed = read_printed()[POSITIONS]
    places = [name.split() for name in printed]
    roots = _solve_roots(np.radians([float(theta_2) for theta_2, _ in places]))
    ours = {}
    for row, (place, figure) in enumerate(printed.items()):
        degrees = float(roots[places[row][1]][row])
        turns = round((float(figure.printed) - degrees) / 360.0)
        ours[place] = degrees + 360.0 * turns
    if tenfold:
        ours["136 theta3_1"] *= 10.0
    return ours


def _compute_half_angle_constants() -> Numbers:
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


def _compute_window() -> Numbers:
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


def _compute_limits(from_ground: bool) -> Numbers:
    """Compute table 3.2: cosines whose existence decides, and limits that exist.

    `from_ground`: the limit of row 2 is counted from the ground's line (erratum 14).
    """
    linkage = make_model_scene(THETA_2).linkage
    second = to_degrees(limit_positions(linkage, 4)[-1].theta_2)
    fourth = to_degrees(limit_positions(linkage, 2)[0].theta_2)
    return {
        "row 1 cosine": ((a + b) ** 2 + d**2 - c**2) / (2.0 * (a + b) * d),
        "row 2 cosine": ((a - b) ** 2 + d**2 - c**2) / (2.0 * abs(a - b) * d),
        "row 2 theta_2": second - (to_degrees(THETA_1) if from_ground else 0.0),
        "row 3 cosine": (a**2 + d**2 - (b + c) ** 2) / (2.0 * a * d),
        "row 4 cosine": (a**2 + d**2 - (b - c) ** 2) / (2.0 * a * d),
        "row 4 theta_2": fourth,
        "row 4 arc cosine": fourth - math.degrees(to_ours(THETA_1)),
    }
