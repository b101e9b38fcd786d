"""The functions of formulas/ compiled by numba as they stand, and the loops over the positions that call them.

The loops carry loads (in both frames, over a table too), gravity, viscous pins and flywheels, with the drive on any
bar. Positions that they leave open (those that need many digits, singular, not assembled, beyond the range of doubles)
are evaluated by NumPy, as is every scene with other effects or with two pairs of equal bars. Arrays are one after the
other in few places whose distances the compiler knows: it then evaluates as many positions at once as the processor's
vectors hold, with the same roundings.
"""

import zlib
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from fourbar.evaluation import case as cases
from fourbar.evaluation import error_bars as bars
from fourbar.evaluation.case import BLOCK, find_undecided
from fourbar.evaluation.error_bars import EVALUATIONS, compute_bar, round_coefficients, round_half_angle, round_real
from fourbar.formulas import arithmetic, motion, path, pin_forces, position, torque
from fourbar.formulas.arithmetic import conjugate, cross, divisor, is_any, select, square_root, vector
from fourbar.formulas.motion import Coefficients, Rates, coefficients, rates, take_sines_of_rates
from fourbar.formulas.path import NO_DIGIT_LEFT, drive_sine_of_triangle
from fourbar.formulas.pin_forces import Body, PinForces, Wrenches, coupler_about_B, inertia_wrenches
from fourbar.formulas.pin_forces import pin_forces as pin_forces_of
from fourbar.formulas.position import (
    HAIR,
    HalfAngle,
    Loop,
    Position,
    close_loop,
    direction_of_tangent,
    hair,
    half_angle_of_tangent,
)
from fourbar.formulas.torque import driving_torque, half_slope, inertia
from fourbar.solution import Array

BODIES, VISCOUS, LOADS = 16, 28, 32
"""Where the bodies, viscous pins and loads begin among the numbers of a position."""
OF_BODY, OF_LOADS = 4, 8
ROWS = LOADS + 3 * OF_LOADS
SMALL, LARGE = 1e-130, 1e130
"""N, N m. Of what is beyond, the squares of the changes for an error bar may leave the range of doubles."""


def number(rows: Any, row: int, i: int) -> Any:
    """Of position i."""
    return rows[row * BLOCK + i] if isinstance(rows, np.ndarray) else rows[row]


def change_complex(z: Any, turned: Any, signs: Any, first: int) -> Any:
    """Change each part of a complex number by one of two signs; without signs nothing changes.

    A ground at an angle mixes the parts of every direction, and each carries the larger's.
    """
    if signs is None:
        return z
    of_x, of_y = signs[first], signs[first + 1]
    if turned:
        size = np.maximum(np.abs(z.real), np.abs(z.imag))
        return z + vector(size * of_x, size * of_y)
    return vector(round_real(z.real, of_x), round_real(z.imag, of_y))


def change_real(x: Any, signs: Any, first: int) -> Any:
    """Change a real number likewise."""
    return x if signs is None else round_real(x, signs[first])


def change_by_terms(x: Any, size: Any, signs: Any, first: int) -> Any:
    """Change a sum by the last digit of its terms."""
    return x if signs is None else x + size * signs[first]


def find_body(rows: Any, i: int, bar: int) -> Body:
    """Bar 2, 3 or 4."""
    row = BODIES + OF_BODY * (bar - 2)
    z = vector(number(rows, row + 2, i), number(rows, row + 3, i))
    return Body(number(rows, row, i), number(rows, row + 1, i), z)


def push_of(rows: Any, i: int, bar: int, z: Any, u: Any, turned: Any, signs: Any) -> tuple[Any, Any]:
    """Force of the loads on a bar (complex, N) and their moment about its first pin (N m)."""
    row, sign = LOADS + OF_LOADS * (bar - 2), 64 + 7 * (bar - 2)
    of_world, of_turning = number(rows, row + 5, i), number(rows, row + 6, i)
    x = change_by_terms(number(rows, row, i), of_world, signs, sign)
    y = change_by_terms(number(rows, row + 1, i), of_world, signs, sign + 1)
    along = change_by_terms(number(rows, row + 2, i), of_turning, signs, sign + 2)
    across = change_by_terms(number(rows, row + 3, i), of_turning, signs, sign + 3)
    couple = change_by_terms(number(rows, row + 4, i), number(rows, row + 7, i), signs, sign + 4)
    force = vector(x, y) + vector(along, across) * u
    return force, change_real(cross(z * u, force), signs, sign + 5) + couple


def compute_viscous_couple(rows: Any, i: int, pin: int, slip: Any, signs: Any) -> Any:
    """Couple of a viscous pin."""
    return change_real(-number(rows, VISCOUS + pin, i) * (slip * number(rows, 12, i)), signs, 60 + pin)


def compute_forces(
    at: Position, k: Coefficients, moving: Rates, rows: Any, i: int, drive_bar: int, signs: Any
) -> tuple[PinForces, Any, Any]:
    """Compute pin forces, torque, and the sine of the drive, as `Case.dynamics` has them."""
    (lengths, in_unit), turned = read_lengths(rows, i), at.u1.imag != 0.0
    a, speed, acceleration = lengths.a, number(rows, 12, i), number(rows, 13, i)
    two, three, four = find_body(rows, i, 2), find_body(rows, i, 3), find_body(rows, i, 4)
    bodies = (two, three, four)
    w, mass_at_A = inertia_wrenches(a, bodies, at, moving)
    of_input, of_others = inertia(a, bodies, at, k)
    slope = half_slope(a, bodies, at, k) * (speed * speed)
    others = slope + of_others * acceleration
    inertial = change_real(others + of_input * acceleration, signs, 53)
    others = change_real(others, signs, 54)
    sine = change_real(drive_sine_of_triangle(in_unit, at, drive_bar), signs, 55)
    P2, N2 = push_of(rows, i, 2, two.z, at.u2, turned, signs)
    P3, N3 = push_of(rows, i, 3, three.z, at.u3, turned, signs)
    P4, N4 = push_of(rows, i, 4, four.z, at.u4, turned, signs)
    slip_A = -k.h23
    of_O2, of_A = compute_viscous_couple(rows, i, 0, k.h2, signs), compute_viscous_couple(rows, i, 1, slip_A, signs)
    of_B, of_O4 = compute_viscous_couple(rows, i, 2, k.h43, signs), compute_viscous_couple(rows, i, 3, k.h4, signs)
    Q = N3 * k.h3 + N4 * k.h4 + k.h2 * cross(a * at.u2, P3) + of_B * k.h43 + of_O4 * k.h4
    w = Wrenches(
        change_complex(w.R2, turned, signs, 42) + P2,
        change_complex(w.R3, turned, signs, 44) + P3,
        change_complex(w.R4, turned, signs, 46) + P4,
        change_real(w.M2, signs, 48) + N2 + of_O2 - of_A,
        change_real(w.M3, signs, 49) + N3 + of_A,
        change_real(w.M4, signs, 50) + N4 + of_O4,
        of_B,
    )
    mass_at_A = vector(change_real(mass_at_A.real, signs, 51), change_real(mass_at_A.imag, signs, 52))
    if drive_bar == 4:
        about_B = change_real(coupler_about_B(lengths, three, at, moving, sine), signs, 86)
        moment = -(about_B + N3 - lengths.b * cross(at.u3, P3) + of_A - of_B)
    else:
        moment = Q + of_A * k.h3 - others
    pins = pin_forces_of(lengths, at, drive_bar, sine, w, mass_at_A, moment)
    by = k.h2 if drive_bar == 2 else k.h3 if drive_bar == 3 else k.h4
    return pins, driving_torque(by, inertial, Q + of_A * slip_A + (N2 + of_O2) * k.h2), sine


def take_thirteen(signs: Any, first: int) -> Any:
    """Thirteen of the signs; with a slice of them the positions are evaluated one at a time, in thrice the time."""
    s, k = signs, first
    return (
        *(s[k], s[k + 1], s[k + 2], s[k + 3], s[k + 4], s[k + 5], s[k + 6]),
        *(s[k + 7], s[k + 8], s[k + 9], s[k + 10], s[k + 11], s[k + 12]),
    )


def read_lengths(rows: Any, i: int) -> tuple[Loop, Loop]:
    """Read the lengths in m, and in their unit with E1 and E2."""
    in_unit = Loop(
        *(number(rows, 0, i), number(rows, 1, i), number(rows, 2, i), number(rows, 3, i)),
        *(number(rows, 4, i), number(rows, 5, i)),
    )
    return Loop(number(rows, 6, i), number(rows, 7, i), number(rows, 8, i), number(rows, 9, i), 0.0, 0.0), in_unit


def compute_directions(
    in_unit: Loop, rows: Any, i: int, tangent: Any, of_theta_2: Any
) -> tuple[Any, Any, Any, HalfAngle]:
    """u1, u2, whether the ground is turned, and the half angle, from the tangents as of `run`."""
    u1, half = vector(number(rows, 10, i), number(rows, 11, i)), half_angle_of_tangent(in_unit, tangent)
    turned = u1.imag != 0.0
    u2 = vector(half.kk - half.ss, 2.0 * half.sk)
    if turned or u1.real != 1.0:
        u2 = direction_of_tangent(of_theta_2)
    return u1, u2, turned, half


def change_position(
    rows: Any, i: int, tangent: Any, of_theta_2: Any, drive_bar: int, signs: Any
) -> tuple[PinForces, Any]:
    """Change every number of position i in its last digit, as `error_bars` does; compute pin forces and torque."""
    lengths, in_unit = read_lengths(rows, i)
    u1, u2, turned, half = compute_directions(in_unit, rows, i, tangent, of_theta_2)
    own = take_thirteen(signs, 2)
    half = round_half_angle(in_unit, half, number(rows, 15, i) * np.sign(own[0]), False, own)
    u2 = select(turned, u2, vector(half.kk - half.ss, 2.0 * half.sk))
    near = close_loop(in_unit, u1, u2, half, number(rows, 14, i), lengths.d / in_unit.d)
    k = coefficients(in_unit, near)
    near = take_sines_of_rates(in_unit, near, k)
    near = Position(
        u1,
        change_complex(u2, turned, signs, 19),
        change_complex(near.u3, turned, signs, 21),
        change_complex(near.u4, turned, signs, 23),
        round_real(near.sin_mu, signs[17]),
        change_complex(near.diagonal, turned, signs, 0),
        near.e2,
        near.root,
        half,
    )
    k = round_coefficients(in_unit, near, k, take_thirteen(signs, 25))
    moving = rates(k, number(rows, 12, i), number(rows, 13, i))
    pins, torque, _ = compute_forces(near, k, moving, rows, i, drive_bar, signs)
    return pins, torque


def square(z: Any) -> Any:
    """|z|^2."""
    return z.real * z.real + z.imag * z.imag


def run(tangents: Array, of_theta_2: Array, rows: Any, drive_bar: int, vectors: Any, scalars: Array) -> None:
    """Up to BLOCK positions one after the other.

    Parameters
    ----------
    tangents : tan of half theta_2 - theta_1, (n,).
    of_theta_2 : tan of half theta_2, (n,); empty where no ground is turned.
    rows : as of `numbers`.
    vectors : u2, u3, u4 and the pin forces, complex, (7 BLOCK,), written.
    scalars : sin mu, omega_3, omega_4, alpha_3, alpha_4, torque, sine of the drive, whether a position is left to
        NumPy, error bars, and the sums of squares that they are made of, (15 BLOCK,), written.
    """
    turns = len(of_theta_2) > 0
    for i in range(len(tangents)):
        lengths, in_unit = read_lengths(rows, i)
        u1, u2, _, half = compute_directions(in_unit, rows, i, tangents[i], of_theta_2[i] if turns else np.nan)
        size = 4.0 * in_unit.a * in_unit.d
        close = find_undecided(half.outer, in_unit.E1, size) or find_undecided(half.inner, in_unit.E2, size)
        at = close_loop(in_unit, u1, u2, half, number(rows, 14, i), lengths.d / in_unit.d)
        k = coefficients(in_unit, at)
        at = take_sines_of_rates(in_unit, at, k)
        v = rates(k, number(rows, 12, i), number(rows, 13, i))
        pins, torque, sine = compute_forces(at, k, v, rows, i, drive_bar, None)
        whole = at.sin_mu + v.omega_3 + v.omega_4 + v.alpha_3 + v.alpha_4 + torque + sine
        total = pins.F12 + pins.F32 + pins.F43 + pins.F14
        left = close or not np.abs(at.sin_mu) > NO_DIGIT_LEFT or not np.isfinite(whole + total.real + total.imag)
        vectors[i], vectors[BLOCK + i], vectors[2 * BLOCK + i] = at.u2, at.u3, at.u4
        vectors[3 * BLOCK + i], vectors[4 * BLOCK + i] = pins.F12, pins.F32
        vectors[5 * BLOCK + i], vectors[6 * BLOCK + i] = pins.F43, pins.F14
        scalars[i], scalars[BLOCK + i], scalars[2 * BLOCK + i] = at.sin_mu, v.omega_3, v.omega_4
        scalars[3 * BLOCK + i], scalars[4 * BLOCK + i], scalars[5 * BLOCK + i] = v.alpha_3, v.alpha_4, torque
        scalars[6 * BLOCK + i], scalars[7 * BLOCK + i] = sine, 1.0 if left else 0.0


def scatter(
    tangents: Array, of_theta_2: Array, rows: Any, drive_bar: int, vectors: Any, scalars: Array, signs: Any
) -> None:
    """Compute the error bars of positions that `run` has evaluated; for the parameters see there.

    `signs`: (evaluations, numbers).
    """
    n, turns = len(tangents), len(of_theta_2) > 0
    scalars[10 * BLOCK :] = 0.0
    for each in range(EVALUATIONS):
        for i in range(n):
            other, T = change_position(rows, i, tangents[i], of_theta_2[i] if turns else np.nan, drive_bar, signs[each])
            scalars[10 * BLOCK + i] += square(T - scalars[5 * BLOCK + i])
            scalars[11 * BLOCK + i] += square(other.F12 - vectors[3 * BLOCK + i])
            scalars[12 * BLOCK + i] += square(other.F32 - vectors[4 * BLOCK + i])
            scalars[13 * BLOCK + i] += square(other.F43 - vectors[5 * BLOCK + i])
            scalars[14 * BLOCK + i] += square(other.F14 - vectors[6 * BLOCK + i])
    for i in range(n):
        torque, of_forces, largest = np.abs(scalars[5 * BLOCK + i]), 0.0, 0.0
        for pin in range(4):
            of_forces = max(of_forces, scalars[(11 + pin) * BLOCK + i])
            largest = max(largest, square(vectors[(3 + pin) * BLOCK + i]))
        largest = np.sqrt(largest)
        scalars[8 * BLOCK + i] = compute_bar(np.sqrt(scalars[10 * BLOCK + i] / EVALUATIONS), torque)
        scalars[9 * BLOCK + i] = compute_bar(np.sqrt(of_forces / EVALUATIONS), largest)
        if not min(torque, largest) > SMALL or not max(torque, largest) < LARGE:
            scalars[7 * BLOCK + i] = 1.0


LEAVES: tuple[tuple[Any, str], ...] = (
    (arithmetic, "split_sum cross dot"),
    (position, "direction_of_tangent half_angle_of_tangent compute_factors close_loop"),
    (motion, "may_turn_fast find_fast_turns coefficients take_sines_of_rates rates"),
    (pin_forces, "about_first_pin inertia_wrenches coupler_about_B solve_between pin_forces"),
    (torque, "inertia half_slope driving_torque"),
    (path, "drive_sine_of_triangle"),
    (cases, "find_undecided"),
    (bars, "round_real round_half_angle round_coefficients compute_bar"),
)
"""What is compiled as it stands."""
OWN = (
    change_complex,
    change_real,
    change_by_terms,
    find_body,
    push_of,
    compute_viscous_couple,
    compute_forces,
    take_thirteen,
    read_lengths,
    compute_directions,
    change_position,
    square,
)


@cache
def make_known() -> None:
    """Every function that the loops call, to numba; those that ask for the type of a number in a form for one."""
    from numba import types
    from numba.extending import overload, register_jitable

    overload(is_any)(lambda mask: lambda mask: bool(mask))  # noqa: PLW0108 - numba reads the names
    overload(select)(lambda mask, x, y: lambda mask, x, y: x if mask else y)
    overload(square_root)(lambda x: lambda x: np.sqrt(x))  # noqa: PLW0108
    overload(vector)(lambda x, y: lambda x, y: complex(x, y))  # noqa: PLW0108
    overload(conjugate)(lambda u: lambda u: u.conjugate())
    overload(divisor)(lambda x, where: lambda x, where: x)
    overload(hair)(lambda t: lambda t: np.copysign(HAIR, t))
    of_one, of_each = (lambda rows, row, i: rows[row]), (lambda rows, row, i: rows[row * BLOCK + i])
    overload(number)(lambda rows, row, i: of_each if isinstance(rows, types.Array) else of_one)
    leaves = [getattr(module, name) for module, names in LEAVES for name in names.split()]
    for leaf in (*leaves, *OWN):
        register_jitable(error_model="numpy", forceinline=True)(leaf)
    for each in (run, scatter):
        register_jitable(error_model="numpy")(each)


@cache
def compile_loop(function: Any, on_disk: bool = True) -> Any:
    """Compile `run` or `scatter`; on the disk, where it can be written, for later processes until a source changes."""
    from numba import njit

    make_known()
    files = sorted({str(module.__file__) for module, _ in LEAVES})
    sources = zlib.crc32(b"".join(Path(file).read_bytes() for file in files))

    def compiled(*given: Any) -> None:
        if sources >= 0:  # a part of the key on the disk, where numba looks at this file alone
            function(*given)

    try:
        return njit(compiled, nogil=True, error_model="numpy", cache=on_disk)
    except RuntimeError:  # no place to write to
        return compile_loop(function, False)
