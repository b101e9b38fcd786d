"""Derived quantities: ratios and centres by two formulas, and how they are shown."""

from dataclasses import replace

import numpy as np
from pytest import approx

import fourbar
from fourbar import solve
from fourbar.formulas.path import compute_state
from fourbar.quantities import DERIVED_QUANTITIES
from fourbar.show.derived import derive
from fourbar.show.tables import print_positions
from fourbar.solution import DEGREES
from tests.support.scenes import TURN

ROUND_OFF = 1e-13
"""Relative: two formulas of a few operations each, at transmission angles above 20 deg.
"""


def test_ratios_and_centres_are_those_of_the_formulas():
    """From the pins and from the half-angle formulas."""
    for motion in (TURN.motion, TURN.motion.replace(speed=None)):
        scene = replace(TURN, motion=motion)
        s = solve(scene)
        state = compute_state(scene.linkage, s.theta_2, s.branch)
        expected = {
            "mechanical_advantage": 1.0 / state.k.h4,
            "omega_4/omega_2": state.k.h4,
            "omega_3/omega_2": state.k.h3,
        }
        for name, values in expected.items():
            assert derive(s, name) == approx(values, rel=ROUND_OFF), name
        by_formula = fourbar.instant_centres(scene.linkage, s.theta_2, s.branch)
        for bars, name in {(1, 3): "I13", (2, 4): "I24"}.items():
            centre = np.stack(by_formula[bars].point, axis=-1)
            assert derive(s, name) == approx(centre, rel=1e-11), name


def test_what_has_no_value_is_a_dash_and_no_number():
    """Bars 2 and 4 parallel: I13 at infinity.

    Bar 4 at a dead centre: no bounded advantage.
    """
    half_turn = fourbar.Scene(
        fourbar.uniform(3.0, 1.0, 3.0, 1.0), fourbar.Motion(np.array([1.0, 2.0]))
    )
    assert np.isnan(derive(solve(half_turn), "I13")).all()
    assert derive(solve(half_turn), "omega_4/omega_2") == approx(1.0)
    assert " - " in print_positions(solve(half_turn), None, DEGREES)


def test_shaking_follows_the_frame_of_a_table_and_csv():
    s = solve(TURN)
    text = s.to_csv()
    header, first = (line.split(",") for line in text.splitlines()[:2])
    row = dict(zip(header, first, strict=True))
    assert float(row["shaking_force_x"]) == -(s.F12[0, 0] + s.F14[0, 0])
    assert float(row["omega_4/omega_2"]) == s.omega_4[0] / s.omega_2[0]
    assert float(row["time"]) == 0.0
    for quantity in DERIVED_QUANTITIES:
        suffix = "" if quantity.kind == "scalar" else "_x"
        assert f"{quantity.name}{suffix}" in row
