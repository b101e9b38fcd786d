"""The thesis's own program: its 13 unknowns, its units, and its errors, each behind a switch.

Source: I. Linares Mendoza, "Analisis cinematico y dinamico asistido por computadora de mecanismos de
cuatro barras", UNAM FES Cuautitlan, sections 4.12 and 5.7 and the program's tables in the manual.
"""

import math
from dataclasses import dataclass

import numpy as np

import fourbar
from fourbar.kinematics import Array

UNKNOWNS = ("F12x", "F12y", "F32x", "F32y", "F23x", "F23y", "F43x", "F43y", "F14x", "F14y", "F34x", "F34y", "T4")
LENGTHS = (20.0, 48.0, 55.0, 20.0)
"""Bars 1 to 4, cm."""
MASSES = {2: 57.0, 3: 0.544, 4: 0.2}
WIDTH = 2.54
TO_N = 0.01
"""1 kg cm/s^2 in N, and 1 kg cm^2/s^2 in N cm."""


@dataclass(frozen=True, slots=True)
class Errors:
    """What the program did; all False is right."""

    inertia_about_long_axis: bool = False
    mass_times_acceleration_unscaled: bool = False
    inertia_times_alpha_unscaled: bool = False
    sign_in_acceleration_of_G3: bool = False
    alpha_3_for_acceleration_of_G4: bool = False


def to_ours(theta: float) -> float:
    """theta_1 or theta_4 of the thesis (its polygon sums to zero) in our convention, and back, rad."""
    return math.remainder(theta + math.pi, 2.0 * math.pi)


def motion(theta_2: Array, branch: int = 1) -> fourbar.Solution:
    """Position to accelerations of the model mechanism by our formulas, SI."""
    d, a, b, c = (0.01 * length for length in LENGTHS)
    bars = (fourbar.Bar(a, centre=(0.765, 0.0)), fourbar.Bar(b), fourbar.Bar(c))
    linkage = fourbar.FourBar(d, *bars, ground_angle=to_ours(math.radians(225.0)))
    return fourbar.solve(fourbar.Scene(linkage, fourbar.Motion(theta_2, 0.2244, branch=branch)))


def thesis_program(errors: Errors, inertias: tuple[float, float] | None = None) -> dict[str, float]:
    """The 13 unknowns of section 5.7 at theta_2 = 135 deg, N and N cm.

    sum F = m A and sum M_G = I alpha of bars 2, 3, 4; F32 = -F23 and F34 = -F43.

    Parameters
    ----------
    errors : which of the named errors to make.
    inertias : I_G3, I_G4 as typed into the program, kg cm^2; left out: computed.
    """
    s = motion(np.radians([135.0]))
    assert s.alpha_3 is not None and s.alpha_4 is not None and s.omega_3 is not None
    assert s.a_G2 is not None and s.a_G3 is not None and s.a_G4 is not None and s.a_A is not None
    theta_3, theta_4 = float(s.theta_3[0]), to_ours(float(s.theta_4[0]))
    alpha = {2: 0.0, 3: float(s.alpha_3[0]), 4: float(s.alpha_4[0])}
    A = {2: 100.0 * s.a_G2[0], 3: 100.0 * s.a_G3[0], 4: 100.0 * s.a_G4[0]}
    if errors.sign_in_acceleration_of_G3:  # -(L w^2 cos - L alpha sin) in place of -(... + ...), eq 4.20
        A[3][0] += 2.0 * 27.5 * alpha[3] * math.sin(theta_3)
    if errors.alpha_3_for_acceleration_of_G4:  # index 5 for 6
        A[4][0] = alpha[3]
    if inertias is None:
        across = 0.0 if errors.inertia_about_long_axis else 1.0
        inertias = tuple(MASSES[k] * (across * LENGTHS[k - 1] ** 2 + WIDTH**2) / 12.0 for k in (3, 4))  # type: ignore[assignment]
    assert inertias is not None
    inertia = {2: 111192.75, 3: inertias[0], 4: inertias[1]}
    per_mass = 1.0 if errors.mass_times_acceleration_unscaled else TO_N
    per_inertia = 1.0 if errors.inertia_times_alpha_unscaled else TO_N

    def polar(r: float, angle: float) -> tuple[float, float]:
        return r * math.cos(angle), r * math.sin(angle)

    theta_2 = math.radians(135.0)
    arms = {  # bar: (pin force, arm from G) twice; R14 points along B to O4, the thesis's theta_4
        2: (("F12", polar(-76.5, theta_2)), ("F32", polar(48.0 - 76.5, theta_2))),
        3: (("F23", polar(-27.5, theta_3)), ("F43", polar(27.5, theta_3))),
        4: (("F14", polar(10.0, theta_4)), ("F34", polar(-10.0, theta_4))),
    }
    matrix, right = np.zeros((13, 13)), np.zeros(13)
    column = {name: index for index, name in enumerate(UNKNOWNS)}
    force = {2: 10.0, 3: 0.0, 4: 0.0}
    for row, (bar, pins) in zip((0, 3, 6), arms.items(), strict=True):
        for name, (x, y) in pins:
            fx, fy = column[name + "x"], column[name + "y"]
            matrix[row, fx] = matrix[row + 1, fy] = 1.0
            matrix[row + 2, fx], matrix[row + 2, fy] = -y, x
        right[row] = per_mass * MASSES[bar] * A[bar][0] - force[bar]
        right[row + 1] = per_mass * MASSES[bar] * A[bar][1]
        right[row + 2] = per_inertia * inertia[bar] * alpha[bar] + 15.0  # M2 = M3 = M4 = -15 N cm
    right[2] += polar(5.0, math.radians(265.0))[1] * force[2]  # minus the moment of the load, -y F
    matrix[8, column["T4"]] = 1.0
    for row, one, other in ((9, "F32x", "F23x"), (10, "F32y", "F23y"), (11, "F43x", "F34x"), (12, "F43y", "F34y")):
        matrix[row, column[one]] = matrix[row, column[other]] = 1.0
    return dict(zip(UNKNOWNS, map(float, np.linalg.solve(matrix, right)), strict=True))


STEPS = (
    ("right: SI, uniform bars m (L^2 + w^2)/12", Errors(), None),
    ("#3 I_G3, I_G4 = m w^2/12, about the long axis", Errors(True), None),
    ("#1 m A in kg cm/s^2 added to N", Errors(True, True), None),
    ("#2 I alpha in kg cm^2/s^2 added to N cm", Errors(True, True, True), None),
    ("#4 wrong sign of L alpha sin in A_G3/A", Errors(True, True, True, True), None),
    ("#5 alpha_3 read in place of A_G4x", Errors(True, True, True, True, True), None),
    ("I as printed: the manual's table", Errors(True, True, True, True, True), (0.2924725333, 0.1075266667)),
    ("I with six digits: section 5.7", Errors(True, True, True, True, True), (0.292472, 0.107526)),
)


def ladder() -> list[tuple[str, dict[str, float]]]:
    """The unknowns after each further error, from right to published."""
    return [(name, thesis_program(errors, inertias)) for name, errors, inertias in STEPS]
