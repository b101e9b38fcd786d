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
from fourbar.formulas.mobility import TURN, limit_positions
from fourbar.linkage import MOVING_BARS
from fourbar.quantities import PIN_FORCES, Array
from fourbar_validation.engines.free_body import (
    DRIVE_COLUMN,
    FORCE_COLUMNS,
    solve_wrenches,
    speeds_and_accelerations,
)
from fourbar_validation.engines.free_body_effects import BodyWrenches
from fourbar_validation.places import MODELS

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
_ARMS = {
    "R12": -76.5,
    "R32": 48.0 - 76.5,
    "R23": -27.5,
    "R43": 27.5,
    "R14": 10.0,
    "R34": -10.0,
}
"""Places of the forces from their bar's G along it, cm, by two on each of bars 2 to 4;
bar 4 points from B to O4.
"""
_FORCE_ON_BAR_2 = 10.0
"""Force along x on bar 2, N."""
_ACCELERATIONS = ("a_A", "a_G2", "a_G3", "a_G4")
_LOAD = cmath.rect(5.0, math.radians(265.0))
"""Place from G2 where that force acts, cm."""
_COUPLE_ON_A_BAR = -15.0
"""Couple on each of bars 2, 3, 4, N cm."""
_TO_N = 0.01
"""1 kg cm/s^2 in N, and 1 kg cm^2/s^2 in N cm."""
_TYPED_INERTIAS = 0.292472, 0.107526
"""I_G3, I_G4 of section 5.7, kg cm^2, solved back from the printed unknowns."""
LADDER = ("3", "1", "2", "4", "5", "5b")
"""Errata in the order in which they are made, from right to published."""
d, a, b, c = BAR_LENGTHS
Numbers = dict[str, float]
"""Numbers of printed tables, by the names of their figures."""


def to_degrees(angle: float) -> float:
    """Convert to degrees in [0, 360), as the thesis has them."""
    return math.degrees(angle) % 360.0


def truncate(values: Any, decimals: Any) -> Any:
    """Cut off further decimals, of complex numbers in both parts."""
    unit = 10.0 ** np.array(decimals)
    return (np.trunc(values.real * unit) + 1j * np.trunc(values.imag * unit)) / unit


def to_ours(theta: float) -> float:
    """Convert theta_1 or theta_4 of the thesis to our convention, or back, rad.

    The thesis's polygon sums to zero.
    """
    return math.remainder(theta + math.pi, TURN)


_load = cache(fourbar.load)


def make_model_scene(theta_2: Array | float, branch: int = 1) -> fourbar.Scene:
    """Make the model mechanism for our formulas, SI, uniform bars 2.54 cm wide."""
    scene = _load(MODELS / "thesis.toml")
    return replace(scene, motion=scene.motion.replace(angle=theta_2, branch=branch))


@cache
def compute_model(errata: tuple[str, ...] = (), decimals: int = 6) -> Numbers:
    """Compute sections 4.12 and 5.7 at theta_2 = 135 deg, by our motion, with errata.

    Lengths are in cm, angles as the thesis counts them; arrays begin with bar 2.

    Parameters
    ----------
    errata : ids of the errata that are made.
    decimals : of theta_3, deg, that erratum 12 leaves in the arms of bar 3.
    """
    scene = make_model_scene(THETA_2)
    s = fourbar.solve(scene)
    theta = np.array([THETA_2, s.theta_3[0], to_ours(s.theta_4[0])])
    omega, alpha = (
        np.array([s[f"{name}_{bar}"][0] for bar in MOVING_BARS])
        for name in ("omega", "alpha")
    )
    a_A, *a_G = (100.0 * complex(*s[name][0]) for name in _ACCELERATIONS)
    inertias = _MASSES * (_ALONG**2 + _ACROSS**2) / 12.0
    right_force, right_moment = _TO_N * _MASSES * a_G, _TO_N * inertias * alpha
    if "4" in errata:
        # -(L w^2 cos - L alpha sin) for -(... + ...), eq 4.20
        a_G[1] += 2.0 * _CENTRE_3 * alpha[1] * math.sin(theta[1])
    if "5" in errata:  # index 5 for 6
        a_G[2] = complex(alpha[1], a_G[2].imag)
    if "12c" in errata:
        a_G = truncate(np.array(a_G), (6, 10, 10))
    directions = theta.copy()
    if "12" in errata:
        directions[1] = math.radians(truncate(to_degrees(theta[1]), decimals).real)
    arms = [*_ARMS.values()] * np.exp(1j * np.repeat(directions, 2))
    if "3" in errata:
        inertias = _MASSES * (_ALONG**2 * (1.0, 0.0, 0.0) + _ACROSS**2) / 12.0
    if "5b" in errata:
        inertias[1:] = _TYPED_INERTIAS
    per_mass, per_inertia = (1.0 if name in errata else _TO_N for name in ("1", "2"))
    force = per_mass * _MASSES * a_G
    moment = per_inertia * inertias * alpha
    if "7" in errata:
        moment[1] *= -1.0
    wrong = right_force - force, right_moment - moment
    values = _compute_unknowns(scene, s, *wrong)
    force[0] -= _FORCE_ON_BAR_2
    moment -= _COUPLE_ON_A_BAR
    moment[0] += _LOAD.imag * _FORCE_ON_BAR_2  # minus the moment of the load, -y F
    # A alpha_3 + B alpha_4 = C and D alpha_3 + E alpha_4 = F
    centripetal = -np.sum((a, b, c) * omega**2 * np.exp(1j * theta))
    values |= {
        "theta3_deg": to_degrees(theta[1]),
        "theta4_deg": to_degrees(theta[2]),
        "A": b * math.sin(theta[1]),
        "B": c * math.sin(theta[2]),
        "C": centripetal.real,
        "D": -b * math.cos(theta[1]),
        "E": -c * math.cos(theta[2]),
        "F": centripetal.imag,
        "T4 in row 9": 1.0,
        "R_ext_i": _LOAD.real,
        "R_ext_j": _LOAD.imag,
        "moment_of_force_N_cm": -_LOAD.imag * _FORCE_ON_BAR_2,
    }
    values |= dict.fromkeys((f"right side, row {row}" for row in range(10, 14)), 0.0)
    vectors = {"A_A": a_A, "A_G3/A": a_G[1] - a_A}
    vectors |= dict(zip(_ARMS, arms, strict=True))
    for k, bar in enumerate(MOVING_BARS):
        vectors[f"A_G{bar}"] = a_G[k]
        one, other = arms[2 * k : 2 * k + 2]
        terms = -one.imag, one.real, -other.imag, other.real, moment[k]
        values |= {f"k{bar}_{number}": term for number, term in enumerate(terms, 1)}
        values |= {
            f"omega{bar}": omega[k],
            f"alpha{bar}": alpha[k],
            f"I_G{bar}": inertias[k],
            f"k{bar}x": force[k].real,
            f"k{bar}y": force[k].imag,
        }
    return values | _name_parts(vectors, by_arctangent="10" in errata)


def _compute_unknowns(
    scene: fourbar.Scene, right: fourbar.Solution, force: Array, moment: Array
) -> Numbers:
    """Compute pin forces, N, and torque, N cm, under forces and moments besides.

    They act at G of bars 2, 3 and 4, N and N cm: what their inertia lacks.
    """
    motion = speeds_and_accelerations(
        scene.linkage,
        right.theta_2,
        right.omega_2,
        right.alpha_2,
        right.theta_3,
        right.theta_4,
    )
    acting = BodyWrenches(1)
    for k, bar in enumerate(MOVING_BARS):
        acting.push(bar, force[k], motion.to_centre(bar))
        acting.couple(bar, _TO_N * moment[k])
    (added,), _ = solve_wrenches(scene, motion, [acting])
    values = {"T4": 100.0 * (right.torque[0] + added[DRIVE_COLUMN, 0])}
    for name in PIN_FORCES:
        column = FORCE_COLUMNS[name]
        x, y = right[name][0] + added[column : column + 2, 0]
        opposite = f"F{name[2]}{name[1]}"
        values |= {f"{name}x": x, f"{name}y": y}
        values |= {f"{opposite}x": -x, f"{opposite}y": -y}
    return values


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


@cache
def compute_numbers(errata: tuple[str, ...] = ()) -> Numbers:
    """Compute the figures of every table by their names, with these errata made."""
    in_eq_5_6 = compute_model(errata, decimals=8)
    roots = _compute_roots()
    if "6" in errata:
        roots["136 theta3_1"] *= 10.0
    return {
        **roots,
        **_compute_half_angle_constants(roots),
        **_compute_limits("14" in errata),
        **_compute_window(roots),
        **compute_model(errata),
        **{f"k3_{n}_in_eq_5_6": in_eq_5_6[f"k3_{n}"] for n in range(1, 5)},
        **_compute_worksheet(),
    }


def _compute_roots() -> Numbers:
    """Compute theta_3 and theta_4 of both roots at whole degrees of theta_2, deg."""
    degrees = range(361)
    roots = {}
    for branch, third, fourth in ((1, 1, 2), (-1, 2, 1)):
        s = fourbar.solve(make_model_scene(np.radians(degrees), branch), "position")
        for at in degrees:
            theta_3 = math.remainder(s.theta_3[at], TURN)
            roots[f"{at} theta3_{third}"] = math.degrees(theta_3)
            roots[f"{at} theta4_{fourth}"] = math.degrees(to_ours(s.theta_4[at]))
    return roots


def _compute_half_angle_constants(roots: Numbers) -> Numbers:
    """Compute section 2.4 at theta_2 = 90 deg.

    k1 cos + k2 sin + k3 + e^2 = 0, A t^2 + B t + C = 0, t = tan(theta/2).
    """
    tip = cmath.rect(a, math.radians(90.0)) + cmath.rect(d, THETA_1)
    ours = {}
    for name, length, second in (("theta4", c, b), ("theta3", b, c)):
        for root in (f"{name}_1", f"{name}_2"):
            ours[f"{root}_deg"] = roots[f"90 {root}"]
        k1 = 2.0 * length * tip.real
        k2 = 2.0 * length * tip.imag
        k3 = abs(tip) ** 2 - second**2
        whole = k3 + length**2
        numbers = (k1, k2, k3, whole - k1, 2.0 * k2, whole + k1)
        for key, number in zip(("k1", "k2", "k3", "A", "B", "C"), numbers, strict=True):
            ours[f"{name} {key}"] = number
    return ours


def _compute_window(roots: Numbers) -> Numbers:
    """Compute the manual's window: angles e1..e4 in rad and deg, of theta_2 = 0."""
    angles = {
        "teta1": math.degrees(THETA_1),
        "tetaDos": 0.0,
        "anguloTres": roots["0 theta3_1"],
        "anguloCuatro": roots["0 theta4_2"],
    }
    ours = {f"{name}_deg": angle for name, angle in angles.items()}
    for bar, angle in enumerate(angles.values(), 1):
        ours[f"e{bar}_rad"] = math.radians(angle)
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
