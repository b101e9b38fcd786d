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
from fourbar.quantities import PIN_FORCES, Array
from fourbar_validation.places import MODELS

TEXTBOOK_FOLDER = MODELS / "textbook"
BAR_LENGTHS = (20.0, 48.0, 55.0, 20.0)
"""Bars 1 to 4, cm."""
THETA_1, THETA_2 = math.radians(225.0), math.radians(135.0)
"""Angles of sections 4.12 and 5.7 in the thesis's convention, rad."""
_ARMS = {
    "R12": (2, -76.5),
    "R32": (2, 48.0 - 76.5),
    "R23": (3, -27.5),
    "R43": (3, 27.5),
    "R23_in_eq_5_6": (3, -27.5),
    "R43_in_eq_5_6": (3, 27.5),
    "R14": (4, 10.0),
    "R34": (4, -10.0),
}
"""Bar on which a force acts, and its place from the bar's G along it, cm; bar 4 points
from B to O4.
"""
_LEVER = cmath.rect(5.0, math.radians(265.0))
"""Place from G2 where the force on bar 2 acts, cm."""
_TO_N = 0.01
"""1 kg cm/s^2 in N, and 1 kg cm^2/s^2 in N cm."""
_TYPED_INERTIAS = 0.292472, 0.107526
"""I_G3, I_G4 of section 5.7, kg cm^2, solved back from the printed unknowns."""
LADDER = ("3", "1", "2", "4", "5", "5b")
"""Errata in the order in which they are made, from right to published."""
d, a, b, c = BAR_LENGTHS
Results = dict[str, Any]
"""Numbers, and vectors x + i y, by the names that the data give to results. Lists are
of bars 2, 3 and 4, or of what the data count.
"""


def truncate(value: complex, decimals: int) -> complex:
    """Cut off further decimals, in both parts."""
    unit = 10.0**decimals
    return complex(math.trunc(value.real * unit), math.trunc(value.imag * unit)) / unit


_load = cache(fourbar.load)


def make_model_scene(theta_2: Array | float, branch: int = 1) -> fourbar.Scene:
    """Make the model mechanism for our formulas, SI, uniform bars 2.54 cm wide."""
    scene = _load(MODELS / "thesis.toml")
    return replace(scene, motion=scene.motion.replace(angle=theta_2, branch=branch))


@cache
def compute_results(errata: tuple[str, ...], scene: str = "") -> Any:
    """Compute what every table has, with these errata made, or solve another scene.

    `scene`: of TEXTBOOK_FOLDER; empty for the thesis.
    """
    if scene:
        return fourbar.solve(fourbar.load(TEXTBOOK_FOLDER / f"{scene}.toml"))
    return {
        **_compute_positions("6" in errata),
        **_compute_limits("14" in errata),
        **compute_model(errata),
    }


@cache
def compute_model(errata: tuple[str, ...] = ()) -> Results:
    """Compute sections 4.12 and 5.7 at theta_2 = 135 deg, by our motion, with errata.

    Lengths are in cm, directions as the thesis counts them. The forces follow from the
    right ones: what inertia lacks, or has too much, acts as a load besides.
    """
    scene = make_model_scene(THETA_2)
    s = fourbar.solve(scene)
    bars = [scene.linkage.bar(number) for number in MOVING_BARS]
    masses = np.array([bar.mass for bar in bars])
    inertias = np.array([1e4 * bar.moment_of_inertia for bar in bars])
    # the polygon of the thesis sums to zero
    theta = np.array([THETA_2, s.theta_3[0], s.theta_4[0] + math.pi])
    omega, alpha = (
        np.array([s[f"{rate}_{number}"][0] for number in MOVING_BARS])
        for rate in ("omega", "alpha")
    )
    a_A, *a_G = (
        100.0 * complex(*s[name][0]) for name in ("a_A", "a_G2", "a_G3", "a_G4")
    )
    lacking = _TO_N * masses * a_G
    couple = _TO_N * inertias * alpha
    if "4" in errata:
        # -(L w^2 cos - L alpha sin) for -(... + ...), eq 4.20
        a_G[1] += 2.0 * 27.5 * alpha[1] * math.sin(theta[1])
    if "5" in errata:  # index 5 for 6
        a_G[2] = complex(alpha[1], a_G[2].imag)
    if "10" in errata:  # the arc tangent gives the opposite direction
        a_G[2] = -a_G[2]
    if "12c" in errata:
        a_G = [*map(truncate, a_G, (6, 10, 10))]
    if "3" in errata:
        inertias[1:] = masses[1:] * 2.54**2 / 12.0
    if "5b" in errata:
        inertias[1:] = _TYPED_INERTIAS
    per_mass, per_inertia = (1.0 if name in errata else _TO_N for name in ("1", "2"))
    force = per_mass * masses * a_G
    moment = per_inertia * inertias * alpha
    if "7" in errata:
        moment[1] *= -1.0
    wrenches = zip(MOVING_BARS, lacking - force, couple - moment, strict=True)
    loads = [
        fourbar.Load(number, cmath.polar(push), moment=_TO_N * couple)
        for number, push, couple in wrenches
    ]
    wrong = fourbar.solve(replace(scene, loads=(*scene.loads, *loads)))
    bars_along = (a, b, c) * np.exp(1j * theta)
    results = {
        "A_A": [a_A] * 3,
        "A_G": a_G,
        "I_G": inertias,
        "force": force,
        "moment": moment,
        "omega": omega,
        "alpha": alpha,
        "R_ext": _LEVER,
        "push": (10.0, 0.0, 0.0),  # along x, N
        "couple": [-15.0] * 3,  # N cm
        "moment_of_force": (-10.0 * _LEVER.imag, 0.0, 0.0),
        "T4": 100.0 * wrong.torque[0],
        "bar": bars_along,
        # A alpha_3 + B alpha_4 = C and D alpha_3 + E alpha_4 = F
        "centripetal": -np.sum(omega**2 * bars_along),
    }
    for name, (number, place) in _ARMS.items():
        direction = theta[number - 2]
        if "12" in errata and number == 3:
            decimals = 8 if name.endswith("eq_5_6") else 6
            degrees = truncate(math.degrees(direction) % 360.0, decimals).real
            direction = math.radians(degrees)
        results[name] = cmath.rect(place, direction)
    return results | {name: complex(*wrong[name][0]) for name in PIN_FORCES}


def _compute_positions(is_tenfold: bool) -> Results:
    """Compute both roots at whole degrees of theta_2, as unit vectors of bars 3 and 4.

    Section 2.4 has the constants at 90 deg, k1 cos + k2 sin + k3 + e^2 = 0, or
    A t^2 + B t + C = 0, t = tan(theta/2). The manual's window has the angles at 0 deg.

    `is_tenfold`: one of them is ten times as large (erratum 6).
    """
    results: Results = {}
    for branch, third, fourth in ((1, 1, 2), (-1, 2, 1)):
        sweep = np.radians(range(361))
        s = fourbar.solve(make_model_scene(sweep, branch), "position")
        results[f"theta3_{third}"] = np.exp(1j * s.theta_3)
        # the polygon of the thesis sums to zero
        results[f"theta4_{fourth}"] = -np.exp(1j * s.theta_4)
    if is_tenfold:
        results["theta3_1"][136] **= 10
    ground = cmath.rect(d, THETA_1)
    results |= {"ground": ground, "O4": -ground, "input": a}
    tip = complex(0.0, a) + ground
    for name, length, second in (("theta4", c, b), ("theta3", b, c)):
        results[f"{name}_k"] = 2.0 * length * tip
        results[f"{name}_k3"] = abs(tip) ** 2 - second**2
        results[f"{name}_square"] = length**2
    return results


def _compute_limits(from_ground: bool) -> Results:
    """Compute table 3.2: cosines whose existence decides, and limits that exist, deg.

    `from_ground`: the limit of row 2 is counted from the ground's line (erratum 14).
    """
    linkage = make_model_scene(THETA_2).linkage
    limits = limit_positions(linkage, 4)[-1], limit_positions(linkage, 2)[0]
    second, fourth = (math.degrees(limit.theta_2) % 360.0 for limit in limits)
    side = np.array([a + b, abs(a - b), a, a])
    opposite = np.array([c, c, b + c, b - c])
    return {
        "row_2_limit": second - math.degrees(THETA_1) * from_ground,
        "row_4_limit": fourth,
        "cosine": (side**2 + d**2 - opposite**2) / (2.0 * side * d),
    }
