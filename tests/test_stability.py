"""Forward errors and error bars on a small seeded set; the full one is `python -m validation stability`."""

import numpy as np
import pytest

import fourbar
from validation.stability import FAMILIES, Tally, run

SAMPLES = 150
"""Per family: about 1.5 s each."""


@pytest.mark.parametrize("family", FAMILIES)
def test_every_output_is_within_what_the_inputs_last_digits_do(family: str) -> None:
    tally = run(family, range(SAMPLES))
    assert tally.samples == SAMPLES
    assert tally.not_assembled < SAMPLES / 10
    assert not tally.warned
    bad = {name: entry for name, entry in tally.worst.items() if not entry[0] <= 1.0}
    assert not bad


def test_a_torque_off_in_its_twelfth_digit_is_noticed(monkeypatch: pytest.MonkeyPatch) -> None:
    true = fourbar.scene.solve

    def off(*arguments: object, **options: object) -> fourbar.Solution:
        solution = true(*arguments, **options)  # type: ignore[arg-type]
        assert solution.torque is not None
        solution.torque *= 1.0 + 1e-12
        return solution

    monkeypatch.setattr("validation.stability.solve", off)
    tally = run("random", range(20))
    assert tally.worst["torque"][0] > 1.0
    assert not tally.held()


def test_a_tally_adds_up() -> None:
    whole, parts = run("random", range(12)), Tally()
    for part in (range(5), range(5, 12)):
        parts.add(run("random", part))
    assert parts == whole


def test_error_bars_grow_towards_a_dead_centre() -> None:
    linkage = fourbar.uniform(0.3, 0.1, 0.25, 0.22)
    # bars 2 and 3 in line: e^2 = c^2 with O2, B, O4; the input angle by the cosine rule
    reach = 0.35
    theta = float(np.arccos((0.3**2 + reach**2 - 0.22**2) / (2 * 0.3 * reach)))
    bars = [
        fourbar.solve(fourbar.Scene(linkage, fourbar.Motion(theta + offset, 10.0), drive_bar=4)).torque_error
        for offset in (1e-1, 1e-4, 1e-7)
    ]
    assert bars[0] is not None and bars[1] is not None and bars[2] is not None
    assert bars[0][0] < bars[1][0] * 1e-1 < bars[2][0] * 1e-2
