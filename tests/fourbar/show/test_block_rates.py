"""The block of a linkage on which nothing acts.

Rates of the bars that follow, in place of zeros.
"""

import numpy as np
import pytest

import fourbar
from fourbar.show.block import write_block
from fourbar.show.tables import write_cells

WIPER = fourbar.FourBar(0.12, fourbar.Bar(0.03), fourbar.Bar(0.125), fourbar.Bar(0.045))
SHOWN = 6e-4
"""Relative: four digits are shown."""


def test_nothing_acts_and_the_block_shows_the_largest_rates() -> None:
    scene = fourbar.Scene(WIPER, fourbar.Motion(omega_2="45 rpm"))
    lines = write_block(scene, fourbar.solve(scene))
    assert not any(line.startswith(("drive", "pins", "  torque")) for line in lines)
    rows = {line.split()[0]: line.split()[1:] for line in lines if line.strip()}
    fine = fourbar.Motion(fourbar.Sweep(0.0, 2.0 * np.pi, 100_000), "45 rpm")
    s = fourbar.solve(fourbar.Scene(WIPER, fine))
    for name, column, factor in (("omega", 2, np.pi / 30.0), ("alpha", 2, 1.0)):
        values = getattr(s, f"{name}_4")
        largest = values[np.argmax(np.abs(values))]
        shown = float(rows[name][column]) * factor
        assert shown == pytest.approx(largest, rel=SHOWN)


def test_a_mass_brings_drive_and_pins_back() -> None:
    heavy = fourbar.uniform(0.12, 0.03, 0.125, 0.045)
    scene = fourbar.Scene(heavy, fourbar.Motion(omega_2="45 rpm"))
    lines = write_block(scene, fourbar.solve(scene))
    assert any(line.startswith("pins") for line in lines)
    assert not any(line.startswith("rates") for line in lines)


def test_a_cell_that_is_rounding_of_its_column_is_zero_without_a_sign() -> None:
    values = np.array([0.0392, -1.7e-16, -0.0, np.nan, 0.02])
    assert write_cells(values) == ["0.0392", "0", "0", "-", "0.02"]
    assert write_cells(np.array([12.0, -1e-5, 30.0]), ".4f")[1] == "0.0000"
    beside_a_pole = np.array([10.0] * 99 + [1e15])
    assert write_cells(beside_a_pole)[0] == "10"
