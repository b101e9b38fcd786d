"""The sources' own calculations and printed tables, with any of their errata made.

Of the thesis these are sections 2.4, 4.12 and 5.7, table 3.2 and the tables of the
manual. Without errata the numbers come from `fourbar.solve` and
`fourbar.formulas.mobility`, or from the thesis's formula for a constant that nobody
else defines. Units as printed: cm, deg, rad/s, cm/s^2, N, N cm.

Source: I. Linares Mendoza, "Analisis cinematico y dinamico asistido por computadora de
mecanismos de cuatro barras", UNAM FES Cuautitlan, sections 4.12 and 5.7 and the
program's tables in the manual.
"""

import cmath
import math
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np

import fourbar
from fourbar.formulas.mobility import limit_positions
from fourbar.linkage import MOVING_BARS
from fourbar.quantities import Array
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
_ACCELERATIONS = ("a_A", "a_G2", "a_G3", "a_G4")
_LOAD = cmath.rect(5.0, math.radians(265.0))
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


def compute_right_unknowns() -> Numbers:
    """Compute the 13 unknowns by our formulas at theta_2 = 135 deg, N and N cm."""
    s = fourbar.solve(make_model_scene(THETA_2))
    pins = (s.F12, s.F32, -s.F32, s.F43, s.F14, -s.F43)
    values = [*np.concatenate(pins, 1)[0].tolist(), 100.0 * float(s.torque[0])]
    return dict(zip(PRINTED_UNKNOWNS, values, strict=True))


@cache
def compute_model(errata: tuple[str, ...] = (), decimals: int = 6) -> Numbers:
    """Compute sections 4.12 and 5.7 at theta_2 = 135 deg, by our motion, with errata.

    Lengths are in cm, angles as the thesis counts them; arrays begin with bar 2.

    Parameters
    ----------
    errata : ids of the errata that are made, and the name of the manual's inertias.
    decimals : of theta_3, deg, that erratum 12 leaves in the arms of bar 3.
    """
    s = fourbar.solve(make_model_scene(THETA_2), "acceleration")
    theta = [THETA_2, float(s.theta_3[0]), to_ours(float(s.theta_4[0]))]
    omega, alpha = (
        np.array([s[f"{name}_{bar}"][0] for bar in MOVING_BARS])
        for name in ("omega", "alpha")
    )
    a_A, *a_G = (100.0 * complex(*s[name][0]) for name in _ACCELERATIONS)
    if "4" in errata:
        # -(L w^2 cos - L alpha sin) for -(... + ...), eq 4.20
        a_G[1] += 2.0 * _CENTRE_3 * alpha[1] * math.sin(theta[1])
    if "5" in errata:  # index 5 for 6
        a_G[2] = complex(alpha[1], a_G[2].imag)
    if "12c" in errata:
        a_G[0], a_G[2] = _truncate_both(a_G[0], 6), _truncate_both(a_G[2], 10)
    directions = np.array(theta)
    if "12" in errata:
        directions[1] = math.radians(truncate(to_degrees(theta[1]), decimals))
    arms = _ARMS * np.exp(1j * np.repeat(directions, 2))
    along = _ALONG * (1.0, 0.0, 0.0) if "3" in errata else _ALONG
    inertias = _MASSES * (along**2 + _ACROSS**2) / 12.0
    for name, typed in _TYPED_INERTIAS.items():
        if name in errata:
            inertias[1:] = typed
    per_mass, per_inertia = (1.0 if name in errata else _TO_N for name in ("1", "2"))
    force = per_mass * _MASSES * a_G
    moment = per_inertia * inertias * alpha
    if "7" in errata:
        moment[1] *= -1.0
    moment -= _COUPLE_ON_A_BAR
    force[0] -= _FORCE_ON_BAR_2
    moment[0] += _LOAD.imag * _FORCE_ON_BAR_2  # minus the moment of the load, -y F
    terms = EquationTerms(_split(arms).reshape(3, 2, 2), _split(force), moment)
    matrix, right = assemble_equations(terms, 4)
    # A alpha_3 + B alpha_4 = C and D alpha_3 + E alpha_4 = F
    centripetal = -np.sum((a, b, c) * omega**2 * np.exp(1j * np.array(theta)))
    values: Numbers = {
        "theta3_deg": to_degrees(theta[1]),
        "theta4_deg": to_degrees(theta[2]),
        "A": b * math.sin(theta[1]),
        "B": c * math.sin(theta[2]),
        "C": centripetal.real,
        "D": -b * math.cos(theta[1]),
        "E": -c * math.cos(theta[2]),
        "F": centripetal.imag,
        "T4 in row 9": matrix[8, 12],
        "R_ext_i": _LOAD.real,
        "R_ext_j": _LOAD.imag,
        "moment_of_force_N_cm": -_LOAD.imag * _FORCE_ON_BAR_2,
    }
    vectors = {"A_A": a_A, "A_G3/A": a_G[1] - a_A}
    vectors |= {f"R{name[1:]}": arm for name, arm in zip(FORCES, arms, strict=True)}
    for k, bar in enumerate(MOVING_BARS):
        vectors[f"A_G{bar}"] = a_G[k]
        of_arms = matrix[3 * k + 2, 4 * k : 4 * k + 4]
        of_bar = {
            f"omega{bar}": omega[k],
            f"alpha{bar}": alpha[k],
            f"I_G{bar}": inertias[k],
            f"k{bar}x": force[k].real,
            f"k{bar}y": force[k].imag,
        }
        for number, value in enumerate((*of_arms, moment[k]), 1):
            of_bar[f"k{bar}_{number}"] = value
        values |= of_bar
    values |= _name_parts(vectors, by_arctangent="10" in errata)
    for row in range(10, 14):
        values[f"right side, row {row}"] = right[row - 1]
    unknowns = np.linalg.solve(matrix, right)
    values |= dict(zip(PRINTED_UNKNOWNS, unknowns, strict=True))
    return {name: float(value) for name, value in values.items()}


def _name_parts(vectors: dict[str, complex], *, by_arctangent: bool) -> Numbers:
    """Name components, size and angle of vectors; erratum 10 is the arc tangent."""
    values = {}
    for name, vector in vectors.items():
        values[f"{name}_i"] = vector.real
        values[f"{name}_j"] = vector.imag
        values[f"{name}_mod"] = abs(vector)
        angle = cmath.phase(vector)
        if by_arctangent:
            angle = math.atan(vector.imag / vector.real)
        values[f"{name}_ang_deg"] = to_degrees(angle)
    return values


def _truncate_both(vector: complex, decimals: int) -> complex:
    return complex(truncate(vector.real, decimals), truncate(vector.imag, decimals))


def _split(vectors: Any) -> Array:
    """Split complex numbers into x and y, (n, 2)."""
    return np.stack((vectors.real, vectors.imag), axis=-1)


@cache
def compute_numbers(errata: tuple[str, ...] = ()) -> Numbers:
    """Compute the figures of every table by their names, with these errata made."""
    in_eq_5_6 = compute_model(errata, decimals=8)
    return {
        **_compute_positions("6" in errata),
        **_compute_half_angle_constants(),
        **_compute_limits("14" in errata),
        **_compute_window(),
        **compute_model(errata),
        **({} if errata else compute_right_unknowns()),
        **{f"k3_{n}_in_eq_5_6": in_eq_5_6[f"k3_{n}"] for n in range(1, 5)},
        **_compute_worksheet(),
    }


def _solve_roots(theta_2: Array) -> dict[str, Array]:
    """Solve theta_3 and theta_4 of both roots, deg, by the thesis's names."""
    roots = {}
    for branch, third, fourth in ((1, 1, 2), (-1, 2, 1)):
        s = fourbar.solve(make_model_scene(theta_2, branch), "position")
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
    tip = cmath.rect(a, theta_2) + cmath.rect(d, THETA_1)
    roots = _solve_roots(np.array([theta_2]))
    ours = {f"{name}_deg": float(angle[0]) for name, angle in roots.items()}
    for name, length, second in (("theta4", c, b), ("theta3", b, c)):
        k1 = 2.0 * length * tip.real
        k2 = 2.0 * length * tip.imag
        k3 = abs(tip) ** 2 - second**2
        whole = k3 + length**2
        numbers = (k1, k2, k3, whole - k1, 2.0 * k2, whole + k1)
        for key, number in zip(("k1", "k2", "k3", "A", "B", "C"), numbers, strict=True):
            ours[f"{name} {key}"] = number
    return ours


def _compute_window() -> Numbers:
    """Compute the manual's window: angles e1..e4 in rad and deg, of theta_2 = 0."""
    s = fourbar.solve(make_model_scene(0.0), "position")
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
    ground, crank, theta_2 = 3.0, 0.8, math.pi / 3.0
    input_bar, coupler, output = map(fourbar.Bar, (crank, 2.5, 2.0))
    linkage = fourbar.FourBar(ground, input_bar, coupler, output)
    ours = {"real constant": crank * math.cos(theta_2) - ground}
    for name, branch in (("open", 1), ("crossed", -1)):
        motion = fourbar.Motion(theta_2, branch=branch)
        s = fourbar.solve(fourbar.Scene(linkage, motion))
        ours[f"{name} theta3"] = float(s.theta_3[0])
        ours[f"{name} theta4"] = float(s.theta_4[0])
    return ours
