"""What the formulas state of a linkage holds by engines, and planted errors are
seen.
"""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import fourbar
from fourbar.formulas import mobility, transmission
from fourbar.linkage import uniform
from fourbar.scene import Scene, command
from fourbar_validation.compare.rows import Row
from fourbar_validation.engines.asking import ask_at
from fourbar_validation.engines.loop import Exact
from fourbar_validation.engines.mujoco.inverse import MujocoInverse
from fourbar_validation.engines.pinocchio import PinocchioInverse
from fourbar_validation.scenes.random import DrawnType, draw_random_scene
from tests.oracle import limit_positions
from tests.oracle import transmission as stated_transmission
from tests.oracle.statements import check_statements

ROCKER, TRIPLE, CHANGE = (
    (0.3, 0.1, 0.25, 0.22),
    (0.22, 0.2, 0.32, 0.18),
    (0.3, 0.1, 0.3, 0.1),
)
LENGTHS = [
    *(ROCKER, TRIPLE, CHANGE),
    *((0.3, 0.24, 0.1, 0.22), (0.08, 0.24, 0.2, 0.26), (0.25, 0.22, 0.3, 0.1)),
    *(
        (0.1, 0.3, 0.3, 0.1),
        (0.3, 0.3, 0.1, 0.1),
        (0.2, 0.2, 0.2, 0.2),
        (3.0, 1.0, 2.0, 2.0),
        (1.0, 1.0, 0.4, 0.4),
    ),
]
SEEN = 1e-9
"""rad. An error of a limit, an extreme or a ratio of this size must be seen."""


def judged(
    lengths: tuple[float, ...],
    engine: Callable[[], Exact] = PinocchioInverse,
    theta_1: float = 0.4,
) -> dict[str, Row]:
    bars = uniform(*lengths)
    linkage = fourbar.FourBar(
        bars.ground, bars.input, bars.coupler, bars.output, theta_1
    )
    low, high = mobility.choose_range(linkage)
    scene = Scene(
        linkage,
        fourbar.Motion(fourbar.Sweep(low + 0.01, high - 0.01, 7), 2.0),
        drive_bar=4,
    )
    adapter = engine()
    answer = ask_at(adapter, scene, command(scene))
    rows = check_statements("scene", scene, adapter, answer)
    return {row.quantity: row for row in rows}


@pytest.mark.parametrize("engine", [PinocchioInverse, MujocoInverse])
@pytest.mark.parametrize("lengths", LENGTHS, ids=str)
def test_what_is_stated_holds(lengths: tuple[float, ...], engine: type) -> None:
    rows = judged(lengths, engine)
    assert all(row.passed for row in rows.values()), rows
    assert ("through" in rows) == bool(mobility.change_points(uniform(*lengths)))


def test_what_is_stated_holds_of_random_linkages() -> None:
    for index in range(20):
        scene = draw_random_scene(1, index, tuple(DrawnType))
        engine = PinocchioInverse()
        rows = check_statements(
            "scene", scene, engine, engine.answer(scene, command(scene))
        )
        assert all(row.passed for row in rows), rows


def changed(
    function: str,
    change: Callable[[Any], Any],
    module: Any = mobility,
) -> Callable[[pytest.MonkeyPatch], None]:
    """A module's function answers something else."""
    true = getattr(module, function)

    def plant(monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr(module, function, lambda *a, **k: change(true(*a, **k)))

    return plant


def moved(
    limits: tuple[mobility.LimitPosition, ...],
    field: str,
) -> tuple[mobility.LimitPosition, ...]:
    return tuple(
        limit._replace(**{field: getattr(limit, field) + SEEN}) for limit in limits
    )


FAULTS = {
    "a limit missing": (
        TRIPLE,
        "range",
        changed("limit_positions", lambda limits: limits[:-1]),
    ),
    "interval begins late": (
        TRIPLE,
        "range",
        changed(
            "find_intervals",
            lambda intervals: tuple((low + SEEN, high) for low, high in intervals),
        ),
    ),
    "the complement of the range": (
        TRIPLE,
        "range",
        changed(
            "find_intervals",
            lambda intervals: tuple(
                (high, low + 2 * math.pi) for low, high in intervals
            ),
        ),
    ),
    "turns fully": (TRIPLE, "range", changed("turns_fully", lambda turns: True)),
    "a full turn denied": (
        ROCKER,
        "range",
        changed("turns_fully", lambda turns: False),
    ),
    "sweep leaves the range": (
        TRIPLE,
        "range",
        changed("choose_range", lambda interval: (interval[0] - 0.1, interval[1])),
    ),
    "swing": (ROCKER, "range", changed("swing", lambda angle: angle + SEEN)),
    "change point": (
        CHANGE,
        "range",
        changed("change_points", lambda angles: angles[:1]),
    ),
    "a change point that is none": (
        ROCKER,
        "range",
        changed("change_points", lambda angles: (0.4,)),
    ),
    "theta_2 of a dead centre": (
        ROCKER,
        "limit_positions",
        changed("limit_positions", lambda limits: moved(limits, "theta_2")),
    ),
    "theta_3 of a dead centre": (
        ROCKER,
        "limit_positions",
        changed("limit_positions", lambda limits: moved(limits, "theta_3")),
    ),
    "theta_4 of a dead centre": (
        ROCKER,
        "limit_positions",
        changed("limit_positions", lambda limits: moved(limits, "theta_4")),
    ),
    "an end of the output's range": (
        ROCKER,
        "range",
        changed("limit_positions", lambda limits: moved(limits, "theta_4")),
    ),
    "branch of a dead centre": (
        ROCKER,
        "limit_positions",
        changed(
            "limit_positions",
            lambda limits: tuple(
                limit._replace(branch=-limit.branch) for limit in limits
            ),
        ),
    ),
    "no branch of a dead centre": (
        ROCKER,
        "limit_positions",
        changed(
            "limit_positions",
            lambda limits: tuple(limit._replace(branch=0) for limit in limits),
        ),
    ),
    "stretched for folded": (
        TRIPLE,
        "limit_positions",
        changed(
            "limit_positions",
            lambda limits: tuple(limit._replace(stretched=False) for limit in limits),
        ),
    ),
    "least angle at B": (
        ROCKER,
        "transmission",
        changed(
            "transmission_extremes",
            lambda ends: ends._replace(least=ends.least + SEEN),
            transmission,
        ),
    ),
    "where the angle at B is greatest": (
        ROCKER,
        "transmission",
        changed(
            "transmission_extremes",
            lambda ends: ends._replace(theta_2_greatest=0.4),
            transmission,
        ),
    ),
    "transmission angle": (
        ROCKER,
        "transmission",
        changed("transmission_angle", lambda angle: angle + SEEN, transmission),
    ),
    "drive condition": (
        ROCKER,
        "transmission",
        changed(
            "drive_sine",
            lambda sine: sine * (1.0 + SEEN),
            stated_transmission,
        ),
    ),
    "mechanical advantage": (
        ROCKER,
        "transmission",
        changed("mechanical_advantage", lambda gain: -gain, transmission),
    ),
    "distance to a singular position": (
        ROCKER,
        "transmission",
        changed("distance_to_singular", lambda distance: distance + SEEN, transmission),
    ),
    "time ratio": (
        ROCKER,
        "transmission",
        changed("time_ratio", lambda ratio: 1.0 / ratio),
    ),
    "no time ratio": (
        ROCKER,
        "transmission",
        changed("time_ratio", lambda ratio: None),
    ),
    "branch through a change point": (
        CHANGE,
        "through",
        lambda patch: patch.setattr(
            limit_positions,
            "find_signs",
            lambda linkage, angle, branch: np.full_like(angle, branch),
        ),
    ),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_each_error_in_a_statement_is_seen(
    fault: str,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    lengths, quantity, plant = FAULTS[fault]
    plant(monkeypatch)
    row = judged(lengths)[quantity]
    assert not row.passed and row.verdict == "fails", row
    assert row.reason


def test_an_engine_that_does_not_answer_agrees_with_nothing(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    true = Exact.answer

    def silent(self: Exact, scene: Scene, command: fourbar.scene.Command) -> Any:
        answer = true(self, scene, command)
        answer.quantities = {
            name: np.full_like(value, np.nan)
            for name, value in answer.quantities.items()
        }
        return answer

    monkeypatch.setattr(Exact, "answer", silent)
    for lengths in (ROCKER, TRIPLE):
        assert not judged(lengths)["limit_positions"].passed
        assert not judged(lengths)["transmission"].passed
