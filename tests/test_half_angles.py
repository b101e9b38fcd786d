"""theta_3 and theta_4 alone: against ball arithmetic, against the other way, and where they refuse."""

import math

import numpy as np
import pytest

import fourbar
from fourbar.half_angles import _half, half_angles
from fourbar.scene import Command, solve
from validation.reference import reference
from validation.stability.judge import EPS, FACTOR

SEED, LINKAGES = 3, 12
"""Crank-rockers; 40 positions each take about half a second of ball arithmetic together."""


def serving(rng: np.random.Generator) -> tuple[fourbar.FourBar, int]:
    """A linkage that the half angles serve, and a branch."""
    while True:
        d, a, b, c = (float(x) for x in rng.uniform(0.05, 1.0, 4))
        if 2.0 * max(d, a, b, c) > d + a + b + c:
            continue
        bars = fourbar.FourBar(d, fourbar.Bar(a), fourbar.Bar(b), fourbar.Bar(c))
        branch = int(rng.choice([-1, 1]))
        if half_angles(bars, branch) is not None:
            return bars, branch


def at(theta_2: np.ndarray, branch: int) -> Command:
    return Command(theta_2, np.full(theta_2.shape, branch, np.int8), None, 0.0)


def alone(bars: fourbar.FourBar, where: Command) -> dict[str, np.ndarray]:
    """The two angles by `solve`, asked for alone."""
    out = {name: np.full(where.theta_2.shape, np.nan) for name in ("theta_3", "theta_4")}
    solution = solve(fourbar.Scene(bars), at=where, out=out)
    assert set(solution.status) == {"ok"} and solution.theta_3 is out["theta_3"]
    return out


def test_both_angles_are_within_what_the_last_digits_of_the_inputs_do() -> None:
    rng = np.random.default_rng(SEED)
    forms = set()
    for _ in range(LINKAGES):
        bars, branch = serving(rng)
        halves = half_angles(bars, branch)
        assert halves is not None
        forms |= {(name, half.offset) for name, half in halves.halves.items()}
        theta_2 = np.concatenate([rng.uniform(-7.0, 7.0, 3), [0.0, math.pi, -math.pi, 1e-9, math.pi + 1e-9]])
        found = alone(bars, at(theta_2, branch))
        for index, angle in enumerate(theta_2):
            exact = reference(fourbar.Scene(bars, fourbar.Motion(float(angle), 1.0)), branch, float(angle))
            assert exact is not None
            values, sensitivity = exact
            for name, array in found.items():
                error = abs(float(values[name] - float(array[index])))
                assert error <= FACTOR * EPS * (1.0 + sensitivity[name]), (bars.lengths, branch, angle, name)
    assert len(forms) >= 4, forms  # by tangent and by cotangent, on both sides of the ground


def test_the_other_way_gives_the_same_angles_over_many_blocks() -> None:
    rng = np.random.default_rng(SEED)
    for _ in range(6):
        bars, branch = serving(rng)
        where = at(rng.uniform(-7.0, 7.0, 40_000), branch)  # in no order: nothing may jump by a turn
        whole = solve(fourbar.Scene(bars), "position", at=where)
        for name, array in alone(bars, where).items():
            raw = np.concatenate(
                [
                    getattr(solve(fourbar.Scene(bars), "position", at=at(part, branch)), name)
                    for part in np.array_split(where.theta_2, 40)
                ]
            )
            assert np.max(np.abs(array - getattr(whole, name))) <= 2.0 * FACTOR * EPS
            assert np.array_equal(getattr(whole, name), raw)
            assert np.all(np.abs(array) < math.pi)
            assert len({*np.sign(array)}) == 1


@pytest.mark.parametrize(
    ("lengths", "why"),
    [
        ((0.3, 0.1, 0.25, 0.22, 0.4), "the ground is turned"),
        ((0.3, 0.25, 0.1, 0.22, 0.0), "limit positions"),
        ((0.3, 0.1, 0.3, 0.1, 0.0), "a parallelogram"),
        ((0.1, 0.3, 0.25, 0.22, 0.0), "a drag link: the output turns fully"),
        ((0.35, 0.23, 0.69, 0.24, 0.0), "positions near limits"),
        ((0.35, 0.23, 0.34, 0.24, 0.0), "limit positions, and both angles away from pi"),
    ],
)
def test_other_linkages_go_the_other_way(lengths: tuple[float, ...], why: str) -> None:
    d, a, b, c, theta_1 = lengths
    bars = fourbar.FourBar(d, fourbar.Bar(a), fourbar.Bar(b), fourbar.Bar(c), theta_1)
    assert half_angles(bars, 1) is None, why
    theta_2 = np.linspace(-3.0, 9.0, 200)
    out = {"theta_4": np.zeros(200)}
    solve(fourbar.Scene(bars), at=at(theta_2, 1), out=out)
    assert np.array_equal(
        out["theta_4"], solve(fourbar.Scene(bars), "position", at=at(theta_2, 1)).theta_4, equal_nan=True
    )


def test_an_angle_that_passes_pi_is_refused() -> None:
    d, a, b, c = 0.1, 0.9, 0.25, 1.0
    theta_3 = solve(
        fourbar.Scene(fourbar.uniform(d, a, b, c)), "position", at=at(np.linspace(0.0, 6.28, 99), 1)
    ).theta_3
    assert np.ptp(theta_3) > 6.0  # it turns with the input
    assert _half(d, a, b, c, 1) is None


def test_branches_of_both_kinds_go_the_other_way() -> None:
    bars = fourbar.FourBar(0.3, fourbar.Bar(0.1), fourbar.Bar(0.25), fourbar.Bar(0.22))
    theta_2 = np.array([1.0, 1.0])
    out = {"theta_3": np.zeros(2)}
    solve(fourbar.Scene(bars), at=Command(theta_2, np.array([1, -1], np.int8), None, 0.0), out=out)
    each = [alone(bars, at(theta_2[:1], branch))["theta_3"][0] for branch in (1, -1)]
    assert out["theta_3"] == pytest.approx(each, rel=1e-14) and each[0] != each[1]
