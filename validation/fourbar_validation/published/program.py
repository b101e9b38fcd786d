"""The thesis's own program: its 13 unknowns, its units, and its errors.

A switch turns each error on.

Source: I. Linares Mendoza, "Analisis cinematico y dinamico asistido por computadora de
mecanismos de cuatro barras", UNAM FES Cuautitlan, sections 4.12 and 5.7 and the
program's tables in the manual.
"""

import math
from dataclasses import dataclass

import numpy as np

import fourbar
from fourbar.linkage import MOVING_BARS
from fourbar.quantities import Array
from fourbar_validation.compare.tolerance import EPS
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


@dataclass(frozen=True, slots=True)
class ProgramErrors:
    """Errors of the program; all False is right."""

    inertia_about_long_axis: bool = False
    mass_times_acceleration_unscaled: bool = False
    inertia_times_alpha_unscaled: bool = False
    sign_in_acceleration_of_G3: bool = False
    alpha_3_for_acceleration_of_G4: bool = False


def to_degrees(angle: float) -> float:
    """Convert to degrees in [0, 360), as the thesis has them."""
    return math.degrees(angle) % 360.0


def split_components(r: float, angle: float) -> tuple[float, float]:
    """Split a vector into its components."""
    return r * math.cos(angle), r * math.sin(angle)


def to_ours(theta: float) -> float:
    """Convert theta_1 or theta_4 of the thesis to our convention, or back, rad.

    The thesis's polygon sums to zero.
    """
    return math.remainder(theta + math.pi, 2.0 * math.pi)


def make_model_scene(theta_2: Array | float, branch: int = 1) -> fourbar.Scene:
    """Make the model mechanism for our formulas, SI, uniform bars of `BAR_WIDTH`."""
    d, a, b, c = (0.01 * length for length in BAR_LENGTHS)
    inertias = (INERTIA_2, compute_inertia(3), compute_inertia(4))
    two, three, four = (
        fourbar.Bar(length, MASSES[bar], 1e-4 * inertia, (0.01 * CENTRE[bar], 0.0))
        for bar, length, inertia in zip(MOVING_BARS, (a, b, c), inertias, strict=True)
    )
    linkage = fourbar.FourBar(d, two, three, four, ground_angle=to_ours(THETA_1))
    arm = (0.01 * LOAD_ARM, LOAD_ANGLE)
    couples = [fourbar.Load(bar, moment=0.01 * COUPLE_ON_A_BAR) for bar in MOVING_BARS]
    loads = (fourbar.Load(2, (FORCE_ON_BAR_2, 0.0), arm=arm), *couples)
    motion = fourbar.Motion(theta_2, OMEGA_2, branch=branch)
    return fourbar.Scene(linkage, motion, drive_bar=4, loads=loads)


def compute_motion(theta_2: Array, branch: int = 1) -> fourbar.Solution:
    """Compute position to accelerations of the model mechanism by our formulas, SI."""
    return fourbar.solve(make_model_scene(theta_2, branch), "acceleration")


def compute_right_unknowns() -> dict[str, float]:
    """Compute the 13 unknowns by our formulas at theta_2 = 135 deg, N and N cm."""
    s = fourbar.solve(make_model_scene(THETA_2))
    pins = (s.F12, s.F32, -s.F32, s.F43, s.F14, -s.F43)
    unknowns = np.concatenate([*(pin[0] for pin in pins), 100.0 * s.torque])
    return dict(zip(PRINTED_UNKNOWNS, unknowns.tolist(), strict=True))


def compute_inertia(bar: int, about_long_axis: bool = False) -> float:
    """Return I_G of bar 3 or 4, kg cm^2.

    I_G is m (L^2 + w^2)/12, or m w^2/12 as the thesis has it.
    """
    if about_long_axis:
        across = 0.0
    else:
        across = BAR_LENGTHS[bar - 1] ** 2
    return MASSES[bar] * (across + BAR_WIDTH**2) / 12.0


class Kinematics:
    """Motion at theta_2 = 135 deg by our formulas, and the arms of the pin forces.

    Lengths are in cm, angles as the thesis counts them.
    """

    def __init__(self) -> None:
        s = compute_motion(np.array([THETA_2]))
        self.theta_3 = float(s.theta_3[0])
        self.theta_4 = to_ours(float(s.theta_4[0]))
        self.omega, self.alpha = (
            {bar: float(getattr(s, f"{name}_{bar}")[0]) for bar in MOVING_BARS}
            for name in ("omega", "alpha")
        )
        self.a_G = {bar: 100.0 * getattr(s, f"a_G{bar}")[0] for bar in MOVING_BARS}
        self.a_A = 100.0 * s.a_A[0]
        self.slip = 2.0 * CENTRE[3] * self.alpha[3] * math.sin(self.theta_3)
        """Amount that erratum 4 adds to the x component of A_G3/A: -(L w^2 cos - L
        alpha sin) for -(... + ...), eq 4.20.
        """
        _, a, b, c = BAR_LENGTHS
        self.arms = {  # from G; R14 points along B to O4, the thesis's theta_4
            "R12": split_components(-CENTRE[2], THETA_2),
            "R32": split_components(a - CENTRE[2], THETA_2),
            "R23": split_components(-CENTRE[3], self.theta_3),
            "R43": split_components(b - CENTRE[3], self.theta_3),
            "R14": split_components(CENTRE[4], self.theta_4),
            "R34": split_components(CENTRE[4] - c, self.theta_4),
        }


def make_equations(
    errors: ProgramErrors,
    inertias: tuple[float, float] | None = None,
) -> tuple[Array, Array]:
    """Make matrix and right side of section 5.7 at theta_2 = 135 deg, N and N cm.

    sum F = m A and sum M_G = I alpha of bars 2, 3, 4; F32 = -F23 and F34 = -F43.

    `errors`: which of the named errors to make.
    `inertias`: I_G3, I_G4 as typed into the program, kg cm^2; left out: computed.
    """
    k = Kinematics()
    if errors.sign_in_acceleration_of_G3:
        k.a_G[3][0] += k.slip
    if errors.alpha_3_for_acceleration_of_G4:  # index 5 for 6
        k.a_G[4][0] = k.alpha[3]
    if inertias is None:
        inertias = (
            compute_inertia(3, errors.inertia_about_long_axis),
            compute_inertia(4, errors.inertia_about_long_axis),
        )
    about_G = {2: INERTIA_2, 3: inertias[0], 4: inertias[1]}
    per_mass = 1.0 if errors.mass_times_acceleration_unscaled else TO_N
    per_inertia = 1.0 if errors.inertia_times_alpha_unscaled else TO_N
    force = {}
    moment = {}
    for bar in MOVING_BARS:
        force[bar] = per_mass * MASSES[bar] * k.a_G[bar]
        inertial = per_inertia * about_G[bar] * k.alpha[bar]
        moment[bar] = np.array([inertial - COUPLE_ON_A_BAR])
    force[2][0] -= FORCE_ON_BAR_2
    _, y = split_components(LOAD_ARM, LOAD_ANGLE)
    moment[2] += y * FORCE_ON_BAR_2  # minus the moment of the load, -y F
    first, second = (
        {bar: np.array([k.arms[name]]) for bar, name in enumerate(names, 2)}
        for names in (("R12", "R23", "R14"), ("R32", "R43", "R34"))
    )
    matrix, right = assemble_equations(EquationTerms(first, second, force, moment), 4)
    return matrix[0], right[0]


def compute_thesis_program(
    errors: ProgramErrors,
    inertias: tuple[float, float] | None = None,
) -> dict[str, float]:
    """Compute the 13 unknowns of section 5.7 at theta_2 = 135 deg, N and N cm."""
    unknowns = np.linalg.solve(*make_equations(errors, inertias))
    return dict(zip(PRINTED_UNKNOWNS, unknowns.tolist(), strict=True))


def bound_round_off(
    errors: ProgramErrors,
    inertias: tuple[float, float] | None = None,
) -> dict[str, float]:
    """Bound how far an elimination of these equations may be off, N and N cm.

    The bound is for each unknown, whoever eliminates. 13 eps |A^-1| (|A| |x| + |b|):
    each number of the system carries up to as many roundings as there are unknowns,
    from its own making and from the elimination (Higham, Accuracy and Stability, 7.2
    and 9.3).
    """
    matrix, right = make_equations(errors, inertias)
    unknowns = np.linalg.solve(matrix, right)
    moved = np.abs(np.linalg.inv(matrix)) @ (
        np.abs(matrix) @ np.abs(unknowns) + np.abs(right)
    )
    bounds = len(PRINTED_UNKNOWNS) * EPS * moved
    return dict(zip(PRINTED_UNKNOWNS, bounds.tolist(), strict=True))


_PRINTED_INERTIAS = (0.2924725333, 0.1075266667)
_TYPED_INERTIAS = (0.292472, 0.107526)
"""I_G3, I_G4 of the manual's table and of section 5.7, kg cm^2, solved back from the
printed unknowns.
"""
_ALL_ERRORS = ProgramErrors(True, True, True, True, True)
ERRATA_IN_ORDER: tuple[tuple[str, ProgramErrors, tuple[float, float] | None], ...] = (
    ("", ProgramErrors(), None),
    ("3", ProgramErrors(True), None),
    ("1", ProgramErrors(True, True), None),
    ("2", ProgramErrors(True, True, True), None),
    ("4", ProgramErrors(True, True, True, True), None),
    ("5", _ALL_ERRORS, None),
    ("manual", _ALL_ERRORS, _PRINTED_INERTIAS),
    ("5b", _ALL_ERRORS, _TYPED_INERTIAS),
)
"""The errata in the order in which they are made, from right to published."""


def climb_ladder() -> list[tuple[str, dict[str, float]]]:
    """Compute the unknowns after each further erratum, from right to published."""
    return [
        (erratum, compute_thesis_program(errors, inertias))
        for erratum, errors, inertias in ERRATA_IN_ORDER
    ]
