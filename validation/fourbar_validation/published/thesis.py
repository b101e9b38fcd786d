"""The sources' own calculations and printed tables, with any of their errata made.

Of the thesis these are sections 2.4, 4.12 and 5.7, table 3.2 and the tables of the
manual. Without errata the numbers come from `fourbar.solve` and
`fourbar.formulas.mobility`, or from the thesis's formula for a constant that nobody
else defines. Units as printed: cm, deg, rad/s, cm/s^2, N, N cm.

Source: I. Linares Mendoza, "Analisis cinematico y dinamico asistido por computadora de
mecanismos de cuatro barras", UNAM FES Cuautitlan, sections 4.12 and 5.7 and the
program's tables in the manual.
"""

import math
from collections.abc import Iterable, Sequence
from dataclasses import replace
from functools import cache, cached_property

import numpy as np

import fourbar
from fourbar.formulas.mobility import limit_positions
from fourbar.linkage import MOVING_BARS
from fourbar.quantities import Array
from fourbar_validation.compare.pins import resolve
from fourbar_validation.compare.tolerance import EPS
from fourbar_validation.places import MODELS
from fourbar_validation.published.printed_figures import POSITIONS, read_printed
from fourbar_validation.published.thirteen import (
    FORCES,
    EquationTerms,
    assemble_equations,
)

PRINTED_UNKNOWNS = (*(f"{pin}{axis}" for pin in FORCES for axis in "xy"), "T4")
BAR_LENGTHS = (20.0, 48.0, 55.0, 20.0)
"""Bars 1 to 4, cm."""
_MASSES = np.array([57.0, 0.544, 0.2])
"""Masses of bars 2 to 4, kg."""
_ALONG, _ACROSS = np.array([[153.0, 55.0, 20.0], [0.0, 2.54, 2.54]])
"""Sizes of the bars 2 to 4 that have their inertias, cm."""
THETA_1, THETA_2 = math.radians(225.0), math.radians(135.0)
"""Angles of sections 4.12 and 5.7 in the thesis's convention, rad."""
_CENTRE_3 = 27.5
"""Distance from pin A to G3, cm."""
_ARMS = np.array([-76.5, 48.0 - 76.5, -27.5, 27.5, 10.0, -10.0])
"""Places of `FORCES` from their bar's G along it, cm; bar 4 points from B to O4."""
_FORCE_ON_BAR_2 = 10.0
"""Force along x on bar 2, N."""
_LOAD_X, _LOAD_Y = resolve(5.0, math.radians(265.0))
"""Place from G2 where that force acts, cm."""
_COUPLE_ON_A_BAR = -15.0
"""Couple on each of bars 2, 3, 4, N cm."""
_TO_N = 0.01
"""1 kg cm/s^2 in N, and 1 kg cm^2/s^2 in N cm."""
AS_PRINTED = "manual"
"""Name, beside the errata, of the inertias that the manual prints."""
_TYPED_INERTIAS = {
    AS_PRINTED: (0.2924725333, 0.1075266667),
    "5b": (0.292472, 0.107526),
}
"""I_G3, I_G4 of the manual's table and of section 5.7, kg cm^2, solved back from the
printed unknowns.
"""
LADDER = ("3", "1", "2", "4", "5", AS_PRINTED, "5b")
"""Errata in the order in which they are made, from right to published."""
_ANGLE_NOISE = 4e-15
"""Four steps of a double near 360 deg, rad. The program carries such angles, where a
step is 5.7e-14 deg = 1e-15 rad.
"""
d, a, b, c = BAR_LENGTHS
Numbers = dict[str, float]
"""Numbers of printed tables, by the names of their figures."""


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


_load = cache(fourbar.load)


def make_model_scene(theta_2: Array | float, branch: int = 1) -> fourbar.Scene:
    """Make the model mechanism for our formulas, SI, uniform bars 2.54 cm wide."""
    scene = _load(MODELS / "thesis.toml")
    return replace(scene, motion=scene.motion.replace(angle=theta_2, branch=branch))


def _compute_motion(theta_2: Array | float, branch: int = 1) -> fourbar.Solution:
    """Compute position to accelerations of the model mechanism by our formulas, SI."""
    return fourbar.solve(make_model_scene(theta_2, branch), "acceleration")


def _name_unknowns(values: Iterable[float]) -> Numbers:
    return dict(zip(PRINTED_UNKNOWNS, map(float, values), strict=True))


def compute_right_unknowns() -> Numbers:
    """Compute the 13 unknowns by our formulas at theta_2 = 135 deg, N and N cm."""
    s = fourbar.solve(make_model_scene(THETA_2))
    pins = (s.F12, s.F32, -s.F32, s.F43, s.F14, -s.F43)
    return _name_unknowns([*np.concatenate(pins, 1)[0], 100.0 * s.torque[0]])


class ThesisProgram:
    """The thesis's calculation at theta_2 = 135 deg, by our motion, with errata made.

    Lengths are in cm, angles as the thesis counts them; arrays begin with bar 2.

    Parameters
    ----------
    errata : ids of the errata that are made, and the name of the manual's inertias.
    decimals : of theta_3, deg, that erratum 12 leaves in the arms of bar 3.
    """

    def __init__(self, errata: Sequence[str] = (), decimals: int = 6) -> None:
        self.errata = errata
        s = _compute_motion(THETA_2)
        self.theta = [THETA_2, float(s.theta_3[0]), to_ours(float(s.theta_4[0]))]
        self.omega, self.alpha = (
            np.concatenate([getattr(s, f"{name}_{bar}") for bar in MOVING_BARS])
            for name in ("omega", "alpha")
        )
        self.a_A = 100.0 * s.a_A[0]
        self.a_G = 100.0 * np.concatenate((s.a_G2, s.a_G3, s.a_G4))
        if "4" in errata:
            # -(L w^2 cos - L alpha sin) for -(... + ...), eq 4.20
            self.a_G[1, 0] += 2.0 * _CENTRE_3 * self.alpha[1] * math.sin(self.theta[1])
        if "5" in errata:  # index 5 for 6
            self.a_G[2, 0] = self.alpha[1]
        if "12c" in errata:
            for row, kept in ((0, 6), (2, 10)):
                self.a_G[row] = [truncate(x, kept) for x in self.a_G[row]]
        directions = [*self.theta]
        if "12" in errata:
            cut = truncate(to_degrees(directions[1]), decimals)
            directions[1] = math.radians(cut)
        along_bars = zip(_ARMS, np.repeat(directions, 2), strict=True)
        self.arms = np.array([resolve(*place) for place in along_bars])
        along = _ALONG * (1.0, 0.0, 0.0) if "3" in errata else _ALONG
        self.inertias = _MASSES * (along**2 + _ACROSS**2) / 12.0
        for name, typed in _TYPED_INERTIAS.items():
            if name in errata:
                self.inertias[1:] = typed

    @cached_property
    def equations(self) -> tuple[Array, Array]:
        """Matrix and right side of section 5.7, N and N cm.

        sum F = m A and sum M_G = I alpha of bars 2, 3, 4; F32 = -F23 and F34 = -F43.
        """
        per_mass, per_inertia = (
            1.0 if name in self.errata else _TO_N for name in ("1", "2")
        )
        force = per_mass * _MASSES[:, None] * self.a_G
        moment = per_inertia * self.inertias * self.alpha
        if "7" in self.errata:
            moment[1] *= -1.0
        moment -= _COUPLE_ON_A_BAR
        force[0, 0] -= _FORCE_ON_BAR_2
        moment[0] += _LOAD_Y * _FORCE_ON_BAR_2  # minus the moment of the load, -y F
        terms = EquationTerms(self.arms.reshape(3, 2, 2), force, moment)
        return assemble_equations(terms, 4)

    def unknowns(self) -> Numbers:
        """Compute the 13 unknowns of section 5.7, N and N cm."""
        return _name_unknowns(np.linalg.solve(*self.equations))

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
        return _name_unknowns(len(PRINTED_UNKNOWNS) * EPS * moved)

    def kinematics(self) -> Numbers:
        """Compute the numbers of section 4.12 and of the manual's table.

        A alpha_3 + B alpha_4 = C and D alpha_3 + E alpha_4 = F.
        """
        _, theta_3, theta_4 = self.theta
        lengths = np.array([a, b, c])
        right = -np.sum(lengths * self.omega**2 * np.exp(1j * np.array(self.theta)))
        values = {
            "theta3_deg": to_degrees(theta_3),
            "theta4_deg": to_degrees(theta_4),
            "A": b * math.sin(theta_3),
            "B": c * math.sin(theta_4),
            "C": float(right.real),
            "D": -b * math.cos(theta_3),
            "E": -c * math.cos(theta_4),
            "F": float(right.imag),
        }
        vectors = {
            f"R{name[1:]}": arm for name, arm in zip(FORCES, self.arms, strict=True)
        }
        vectors |= {"A_A": self.a_A, "A_G3/A": self.a_G[1] - self.a_A}
        for k, bar in enumerate(MOVING_BARS):
            values[f"omega{bar}"] = float(self.omega[k])
            values[f"alpha{bar}"] = float(self.alpha[k])
            values[f"I_G{bar}"] = float(self.inertias[k])
            vectors[f"A_G{bar}"] = self.a_G[k]
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
        named = {
            "T4 in row 9": matrix[8, 12],
            "R_ext_i": _LOAD_X,
            "R_ext_j": _LOAD_Y,
            "moment_of_force_N_cm": -_LOAD_Y * _FORCE_ON_BAR_2,
        }
        named |= {f"right side, row {row}": right[row - 1] for row in range(10, 14)}
        for k, bar in enumerate(MOVING_BARS):
            row = 3 * k
            arms = matrix[row + 2, 4 * k : 4 * k + 4]
            numbers = (*arms, right[row + 2], *right[row : row + 2])
            keys = ("_1", "_2", "_3", "_4", "_5", "x", "y")
            for key, number in zip(keys, numbers, strict=True):
                named[f"k{bar}{key}"] = number
        return {name: float(number) for name, number in named.items()}


@cache
def compute_numbers(errata: tuple[str, ...] = ()) -> Numbers:
    """Compute the figures of every table by their names, with these errata made."""
    program = ThesisProgram(errata)
    in_eq_5_6 = ThesisProgram(errata, decimals=8).constants()
    unknowns = program.unknowns() if errata else compute_right_unknowns()
    return {
        **_compute_positions("6" in errata),
        **_compute_half_angle_constants(),
        **_compute_limits("14" in errata),
        **_compute_window(),
        **program.kinematics(),
        **program.constants(),
        **{f"k3_{n}_in_eq_5_6": in_eq_5_6[f"k3_{n}"] for n in range(1, 5)},
        **unknowns,
        **_compute_worksheet(),
    }


@cache
def find_noise() -> dict[str, Numbers]:
    """Find the round-off of the digits that the program printed in full, by table."""
    right = ThesisProgram()
    sizes = {
        "t": math.degrees(1.0),
        "R": -_ARMS[0],
        "A": float(np.abs(right.a_G[0]).max()),
    }
    manual, published = (ThesisProgram(LADDER[:steps]) for steps in (-1, None))
    return {
        "manual, kinematics": {
            name: _ANGLE_NOISE * sizes.get(name[0], 1.0) for name in right.kinematics()
        },
        "manual, unknowns": manual.bound_round_off(),
        "5.7 unknowns": published.bound_round_off(),
    }


def _solve_roots(theta_2: Array) -> dict[str, Array]:
    """Solve theta_3 and theta_4 of both roots, deg, by the thesis's names."""
    roots = {}
    for branch, third, fourth in ((1, 1, 2), (-1, 2, 1)):
        s = _compute_motion(theta_2, branch)
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
    s = _compute_motion(0.0)
    angles = (THETA_1, 0.0, float(s.theta_3[0]), to_ours(s.theta_4[0]))
    names = ("teta1", "tetaDos", "anguloTres", "anguloCuatro")
    ours = {}
    for bar, (name, angle) in enumerate(zip(names, angles, strict=True), 1):
        ours[f"e{bar}_rad"] = angle
        ours[f"{name}_deg"] = to_degrees(angle)
    return ours


def _compute_limits(from_ground: bool) -> Numbers:
    """Compute table 3.2: cosines whose existence decides, and limits that exist.

    `from_ground`: the limit of row 2 is counted from the ground's line (erratum 14).
    """
    linkage = make_model_scene(THETA_2).linkage
    second = to_degrees(limit_positions(linkage, 4)[-1].theta_2)
    fourth = to_degrees(limit_positions(linkage, 2)[0].theta_2)
    ours = {
        "row 2 theta_2": second - (to_degrees(THETA_1) if from_ground else 0.0),
        "row 4 theta_2": fourth,
        "row 4 arc cosine": fourth - math.degrees(to_ours(THETA_1)),
    }
    triangles = ((a + b, c), (abs(a - b), c), (a, b + c), (a, b - c))
    for row, (side, opposite) in enumerate(triangles, 1):
        squares = side**2 + d**2 - opposite**2
        ours[f"row {row} cosine"] = squares / (2.0 * side * d)
    return ours


def _compute_worksheet() -> Numbers:
    """Compute the Maple worksheet's two solutions of positions, theta_1 = 0, rad.

    The constant of its real equation is computed too.
    """
    ground = 3.0
    crank = 0.8
    input_bar, coupler, output = map(fourbar.Bar, (crank, 2.5, 2.0))
    linkage = fourbar.FourBar(ground, input_bar, coupler, output)
    theta_2 = math.pi / 3.0
    ours = {"real constant": crank * math.cos(theta_2) - ground}
    for name, branch in (("open", 1), ("crossed", -1)):
        motion = fourbar.Motion(theta_2, branch=branch)
        s = fourbar.solve(fourbar.Scene(linkage, motion))
        ours[f"{name} theta3"] = float(s.theta_3[0])
        ours[f"{name} theta4"] = float(s.theta_4[0])
    return ours
