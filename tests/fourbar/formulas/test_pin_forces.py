"""Pin forces and torque against the thirteen equations.

Power, sums over the linkage, and the thesis are used too.
"""

import math
from dataclasses import replace

import numpy as np
from pytest import approx, mark, raises

from fourbar import (
    Bar,
    Gravity,
    InputError,
    Load,
    Motion,
    PinFriction,
    Scene,
    command,
    solve,
    uniform,
    vary,
)
from fourbar.evaluation.case import compute_shown_state
from fourbar.formulas.arithmetic import cross
from fourbar.formulas.pin_forces import Wrenches, pin_forces
from fourbar.linkage import PIN_FORCE, PINS
from tests.support.scenes import EPS, TURN, WEIGHT, bare, crank_rocker

GROWN = 1e-13
"""Relative, divided by the drive's condition: two evaluations of some hundred roundings
each.
"""


def test_written_into_given_arrays():
    solution = solve(TURN)
    out = {"torque": np.empty(25), "F43": np.empty((25, 2))}
    part = solve(TURN, out=out)
    assert part.torque is out["torque"] and part.F12 is part.theta_3 is None
    for name, array in out.items():
        assert np.array_equal(array, solution[name])
    for wrong, words in (("torque", r"out\.torque"), ("T2", "T2")):
        with raises(InputError, match=words):
            solve(TURN, out={wrong: np.empty(24)})


@mark.parametrize("beside", [1e-3, 1e-6, 1e-9])
def test_a_force_beside_B_has_its_moment_there(beside):
    """The output is driven, and bars 2 and 4 are free of moments.

    Then b u3 x F32 is the moment about B: force times arm.
    """
    b, direction = 0.25, 0.3
    link = replace(bare(0.3, 0.1, b, 0.22), coupler=Bar(b, centre=(0.0, 0.0)))
    load = Load(3, (1.0, direction), from_centre=(b + beside, 0.0), frame="bar")
    s = solve(Scene(link, Motion(np.linspace(0.1, 6.0, 7), 0.0), 4, (load,)))
    arm = (b + beside) - b  # exact: as the doubles have it
    exact = arm * math.sin(direction) / (b * abs(np.sin(s.theta_3 - s.theta_2)))
    assert np.hypot(*s.F32.T) == approx(exact, rel=GROWN)


@mark.parametrize("ratio", [1e-5, 1e-3, 0.49, 0.51, 3.0, 1e3])
@mark.parametrize("couple", [0.0, 0.4, 1e6])
def test_the_moments_of_bars_of_any_ratio_balance(ratio, couple):
    """Each moment equation holds to a rounding of its own terms, however short bar 4.

    Bar 4 is commanded: a long input says little of the angle of a short bar.
    """
    b, c = 1.0, ratio
    motion = Motion(theta_4=[math.pi - 0.3 / max(1.0, c)], omega_4=2.0)
    case = Scene(uniform(1.5 + c, 1.2, b, c), motion)
    state = compute_shown_state(case, command(case))
    position = state.position
    assert abs(position.sin_mu) > 0.1
    w = Wrenches(R3=0.7 - 0.2j, M3=0.9, M4=0.3 * c, C=couple)
    forces = pin_forces(state.lengths, position, 2, position.sin_mu, w, 0j, 0.0)
    size = abs(forces.F43)
    of_3 = b * cross(position.u3, forces.F43) + w.M3 - couple
    of_4 = -c * cross(position.u4, forces.F43) + w.M4 + couple
    assert np.all(abs(of_3) <= 16.0 * EPS * (b * size + w.M3 + couple))
    assert np.all(abs(of_4) <= 16.0 * EPS * (c * size + w.M4 + couple))


@mark.parametrize(
    "pins",
    [("O2",), ("A",), ("B",), ("O4",), ("O2", "A", "B", "O4")],
    ids="-".join,
)
@mark.parametrize("drive_bar", [2, 3, 4])
def test_the_couple_of_a_loaded_pin_is_its_force_times_the_radius_of_friction(
    pins, drive_bar
):
    """With the couples mu r |F| as loads the forces are the same."""
    friction = PinFriction.at(**{pin: (0.1, 0.02) for pin in pins})
    angles = np.linspace(0.1, 6.0, 13)
    case = crank_rocker(Motion(angles, 10.0), drive_bar=drive_bar, loads=())
    s = solve(replace(case, effects=(Gravity(), friction)))
    largest = max(np.hypot(*s[name].T).max() for name in PIN_FORCE.values())
    assert s.friction_residual.max() <= 8.0 * EPS * 0.1 * 0.02 * largest
    assert s.friction_residual.any() or len(pins) == 1
    rate = {1: 0.0, 2: s.omega_2, 3: s.omega_3, 4: s.omega_4}
    moments, loads = {}, []
    for pin in pins:
        i, j = PINS[pin]
        size = 0.1 * 0.02 * np.hypot(*s[PIN_FORCE[pin]].T)
        couple = size * np.sign(rate[j] - rate[i])
        for bar, moment in ((i, couple), (j, -couple)):
            if bar > 1:
                moments[f"loads.{len(loads)}.moment"] = moment
                loads.append(Load(bar, moment=1.0))
    one = replace(case, loads=tuple(loads), effects=WEIGHT)
    given = solve(vary(one, {**moments, "motion.theta_2": angles[:, None]}))
    allowed = GROWN * largest / s.drive_condition
    for name in (*PIN_FORCE.values(), "torque"):
        assert (allowed >= abs(s[name] - given[name][:, 0]).T).all(), name
