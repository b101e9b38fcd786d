"""Guaranteed extremes: no sample lies outside, the enclosures are as narrow as promised, and what has none says so."""

import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import flint
import numpy as np
import pytest

import fourbar
from fourbar import Friction, InputError, Motion, Scene, Sweep, Tolerance
from fourbar.cli import status
from fourbar.effects import Gravity, Spring, SpringEnd, Springs
from fourbar.scene import Command
from fourbar.studies import enclosure
from fourbar.studies.enclosure import PROVEN, Extremes, extremes

MODELS = Path(__file__).parents[3] / "models"
LENGTHS = ("ground", "input", "coupler", "output")
ROUNDING = 1e-12
"""Relative; what doubles lose of a sample that lies on the extreme itself."""


@pytest.fixture(scope="module")
def rocker() -> tuple[Scene, Extremes]:
    scene = fourbar.load(MODELS / "crank_rocker.toml")
    return scene, extremes(scene, ["torque", "F43", "transmission"])


def sampled(solution: Any) -> dict[str, np.ndarray]:
    forces = {
        f"|{name}|": np.hypot(*np.moveaxis(getattr(solution, name), -1, 0))
        for name in enclosure.PIN_FORCES
    }
    mu = np.arctan2(
        np.abs(solution.sin_mu), np.abs(np.cos(solution.theta_4 - solution.theta_3))
    )
    return {"torque": solution.torque, **forces, "transmission": mu}


def holds(bounds: Extremes, samples: dict[str, np.ndarray]) -> None:
    for name in bounds.least:
        values = samples[name]
        size = ROUNDING * np.abs(values).max()
        assert values.min() >= bounds.least[name].low - size, name
        assert values.max() <= bounds.greatest[name].high + size, name


@pytest.mark.slow
def test_no_sample_lies_outside_and_the_enclosure_is_as_narrow_as_promised(
    rocker: tuple[Scene, Extremes],
) -> None:
    scene, bounds = rocker
    theta_2 = np.linspace(0, 2 * math.pi, 20_001)
    samples = sampled(
        fourbar.solve(scene, at=Command(theta_2, np.ones(20_001, np.int8), 10.0, 0.0))
    )
    assert (
        set(samples) == set(enclosure.NAMES) - {"drive_force"}
        and bounds.distance == 0.0
    )
    holds(bounds, samples)
    for name in bounds.least:
        values = samples[name]
        size = np.abs(values).max()
        for extreme, value in (
            (bounds.least[name], values.min()),
            (bounds.greatest[name], values.max()),
        ):
            assert 0.0 <= extreme.high - extreme.low <= PROVEN * size
            dense = (
                1e-3 if name == "transmission" else 1e-6
            )  # it has a corner at a right angle
            assert (
                extreme.low <= value + dense * size
                and value - dense * size <= extreme.high
            )


@pytest.mark.slow
def test_poles_are_kept_away_from_and_the_drive_may_be_on_any_bar() -> None:
    scene = fourbar.load(MODELS / "thesis.toml")
    bounds = extremes(scene, ["torque"])
    assert (
        bounds.distance == enclosure.DISTANCE
        and len(bounds.parts) == 3
        and set(bounds.least) == {"torque"}
    )
    theta_2 = np.concatenate([np.linspace(*part, 500) for part in bounds.parts])
    samples = sampled(
        fourbar.solve(scene, at=Command(theta_2, np.ones(1500, np.int8), 0.2244, 0.0))
    )
    holds(bounds, samples)
    assert bounds.greatest["torque"].high == pytest.approx(
        samples["torque"].max(), rel=1e-6
    )  # at an end


@pytest.mark.slow
def test_with_tolerances_no_linkage_lies_outside(
    rocker: tuple[Scene, Extremes],
) -> None:
    scene, nominal = rocker
    linkage = scene.linkage.lengths
    widths = {
        f"lengths.{name}": 1e-4 * length
        for name, length in zip(LENGTHS, linkage, strict=True)
    }
    loose = replace(
        scene, tolerances=tuple(Tolerance(key, width) for key, width in widths.items())
    )
    bounds = extremes(loose, ["F43"])
    assert list(bounds.greatest) == ["|F43|"]
    random = np.random.default_rng(1)
    corners = (
        random.choice([-1.0, 1.0], (4, 200))
        * np.maximum(random.uniform(0, 1.0, (4, 200)), 0.5).round()
    )
    values = {
        key: x + w * c
        for (key, w), x, c in zip(widths.items(), linkage, corners, strict=True)
    }
    study = fourbar.vary(
        scene, values | {"motion.theta_2": np.linspace(0, 2 * math.pi, 721)}
    )
    holds(bounds, sampled(fourbar.solve(study)))
    for name in bounds.greatest:
        over = bounds.over_estimate(name, 1)
        assert over is not None and 1.0 <= over <= 1.2, name
        assert (
            bounds.nominal is not None
            and bounds.nominal.greatest[name] == nominal.greatest[name]
        )


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"motion": Motion(1.0)}, "is needed for extremes"),
        (
            {"effects": (Friction.at(B=0.05),)},
            "effects.friction: its extremes cannot be guaranteed; those with",
        ),
        ({"linkage": fourbar.uniform(0.3, 0.1, 0.3, 0.1)}, "change point"),
        (
            {"tolerances": (Tolerance("bars.coupler.inertia", 1e-4),)},
            "is no number that the scene states",
        ),
    ],
)
def test_what_has_no_enclosure_is_one_line(changes: dict[str, Any], words: str) -> None:
    scene = fourbar.load(MODELS / "crank_rocker.toml")
    with pytest.raises(InputError, match=words):
        extremes(replace(scene, **changes))


def test_the_share_of_the_linkages_that_come_apart_is_stated() -> None:
    scene = Scene(
        fourbar.uniform(0.3, 0.1, 0.25, 0.22), Motion(Sweep(0.0, 1.0, 2), 1.0)
    )  # turns fully where c >= 0.15
    loose = replace(scene, tolerances=(Tolerance("lengths.output", 0.1),))
    with pytest.raises(
        fourbar.FourBarError,
        match=r"tolerances: \S+ % of the linkages .* do not assemble",
    ) as error:
        extremes(loose)
    assert float(str(error.value).split(":")[1].split("%")[0]) == pytest.approx(
        100 * (0.15 - 0.12) / 0.2, abs=1.0
    )


def test_a_pole_within_the_tolerances_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(enclosure, "FINEST_OF_MANY", 1e-2)
    scene = replace(fourbar.load(MODELS / "crank_rocker.toml"), drive_bar=4)
    with pytest.raises(
        fourbar.FourBarError,
        match=r"torque has no bound at theta_2 = .* there it has a pole",
    ):
        extremes(
            replace(scene, tolerances=(Tolerance("lengths.coupler", 0.01),)), ["torque"]
        )


@pytest.mark.slow
def test_what_only_tolerances_widen_is_not_halved_further(
    rocker: tuple[Scene, Extremes],
) -> None:
    loose = replace(rocker[0], tolerances=(Tolerance("lengths.input", 3e-3),))
    bounds = extremes(loose, ["torque"])
    assert bounds.boxes < 2000  # many times that where each is halved to the end
    over = bounds.over_estimate("torque", 1)
    assert over is not None and over > 1.5


def test_the_command(
    rocker: tuple[Scene, Extremes], monkeypatch: pytest.MonkeyPatch, capsys: Any
) -> None:
    monkeypatch.setattr(enclosure, "extremes", lambda scene, names: rocker[1])
    model = str(MODELS / "crank_rocker.toml")
    assert status(["extremes", model]) == 0
    text = capsys.readouterr().out
    assert "guaranteed over theta_2 = 0 to 360 deg" in text and "319.8767" in text
    assert status(["extremes", model, "--units", "mm N.mm rad"]) == 0
    low = 1000.0 * rocker[1].greatest["torque"].low
    text = capsys.readouterr().out
    assert (
        "theta_2 = 0 to 6.28319 rad" in text
        and f"{low:.11g}" in text
        and "N mm  greatest" in text
    )
    assert status(["extremes", model, "--json", "--units", "mm"]) == 2
    assert "--json has SI units" in capsys.readouterr().err
    assert status(["extremes", model, "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    assert (
        document["extremes"]["torque"]["greatest"]["high"]
        == rocker[1].greatest["torque"].high
    )
    monkeypatch.undo()
    assert status(["extremes", model, "--quantity", "F99"]) == 2
    assert "quantity = 'F99': must be one of torque, F12" in capsys.readouterr().err


def test_the_bound_of_a_box_holds_at_its_ends(rocker: tuple[Scene, Extremes]) -> None:
    search, radius = enclosure._Search(rocker[0]), 1e-3
    centre = np.array([0.4, 2.0, 4.5])
    points, low, high = (
        np.array([search.arb(x) for x in centre + r]) for r in (0.0, -radius, radius)
    )
    wide = np.array([search.arb(x, radius) for x in centre])
    none = np.zeros((0, 3))
    over, nominal, *ends = (
        search.evaluate(*box)
        for box in ((wide, None), (points, none), (low, none), (high, none))
    )
    for name in over:
        for i in range(3):
            top = search._bound(1, over[name], nominal[name], i, radius)[0]
            least = -search._bound(-1, over[name], nominal[name], i, radius)[0]
            for end in ends:
                assert least <= float(end[name].values[i].mid()) <= top, name


def meeting(distance: float) -> Scene:
    """A spring whose ends nearly meet once in a turn: the boxes there hold a distance of 0."""
    spring = Spring(SpringEnd(1, distance, 0.5), SpringEnd(2, 0.1, 0.0), 1000.0, 0.5)
    return Scene(
        fourbar.uniform(0.3, 0.1, 0.25, 0.22),
        Motion(0.0, 10.0),
        2,
        (),
        (Springs((spring,)),),
    )


@pytest.mark.slow
@pytest.mark.parametrize("distance", [0.102, 0.1005])
def test_a_spring_whose_ends_nearly_meet_hides_no_value(distance: float) -> None:
    scene = meeting(distance)
    solution = fourbar.solve(
        scene,
        at=Command(np.linspace(0.4, 0.6, 2001), np.ones(2001, np.int8), 10.0, 0.0),
    )
    holds(extremes(scene, ["torque", "F12"]), sampled(solution))


@pytest.mark.slow
def test_a_spring_whose_ends_meet_has_no_bound_there() -> None:
    with pytest.raises(fourbar.FourBarError, match=r"no bound at theta_2 = 28\.64"):
        extremes(meeting(0.1), ["F12"])


@pytest.mark.slow
@pytest.mark.parametrize(
    "lengths",
    [
        (1, 1e-7, 0.6, 0.8),
        (1, 1e-12, 0.6, 0.8),
        (1, 1e-3, 1.5, 0.51),
        (1, 0.3, 0.9, 0.8),
    ],
)
def test_the_transmission_angle_is_that_of_the_triangle_to_the_last_digits(
    lengths: tuple[float, ...],
) -> None:
    d, a, b, c = (flint.arb(length) for length in lengths)
    cosines = [(b * b + c * c - e * e) / (2 * b * c) for e in (d - a, d + a)]
    ends = sorted(float(abs(x).acos()) for x in cosines)
    if cosines[0] * cosines[1] < 0:
        ends[1] = math.pi / 2
    bounds = extremes(
        Scene(fourbar.uniform(*lengths), Motion(0.0, 1.0)), ["transmission"]
    )
    for end, extreme in zip(
        ends,
        (bounds.least["transmission"], bounds.greatest["transmission"]),
        strict=True,
    ):
        size = 4.0 * ROUNDING
        assert extreme.low - size <= end <= extreme.high + size
        assert extreme.high - extreme.low <= PROVEN


@pytest.mark.slow
@pytest.mark.parametrize("far", [50.0, 1e11, -1e15])
def test_turns_of_the_input_change_no_bound(far: float) -> None:
    scene = Scene(fourbar.uniform(0.3, 0.1, 0.25, 0.22), Motion(0.0, 10.0), drive_bar=4)
    near, turned = (
        extremes(scene, ["torque"]),
        extremes(replace(scene, motion=Motion(far, 10.0)), ["torque"]),
    )
    assert turned.greatest["torque"].high == pytest.approx(
        near.greatest["torque"].high, rel=2 * PROVEN
    )
    assert turned.boxes < 2 * near.boxes


def test_a_ground_turned_too_far_is_one_line() -> None:
    turned = replace(fourbar.uniform(0.3, 0.1, 0.25, 0.22), ground_angle=1e11)
    with pytest.raises(
        InputError, match=r"lengths.ground_angle = 1\S+: must lie within 100000 rad"
    ):
        extremes(Scene(turned, Motion(0.0, 10.0)))


@pytest.mark.slow
@pytest.mark.parametrize("size", [1e-150, 1e150])
def test_sizes_whose_squares_doubles_do_not_hold_are_bounded(size: float) -> None:
    lengths = (0.3, 0.1, 0.25, 0.22)
    unscaled, scaled = (
        extremes(
            Scene(fourbar.uniform(*(scale * x for x in lengths)), Motion(0.0, 10.0)),
            ["F12"],
        )
        for scale in (1.0, size)
    )
    assert scaled.greatest["|F12|"].high == pytest.approx(
        size * size * unscaled.greatest["|F12|"].high, rel=2 * PROVEN
    )


def test_what_is_zero_everywhere_is_bounded_by_zero() -> None:
    bars = (fourbar.Bar(length) for length in (0.1, 0.25, 0.22))
    bounds = extremes(
        Scene(fourbar.FourBar(0.3, *bars), Motion(0.0, 10.0)), ["torque", "F12"]
    )
    assert {
        end
        for extreme in (*bounds.least.values(), *bounds.greatest.values())
        for end in extreme[:2]
    } == {0.0}


def test_a_torque_that_springs_balance_is_bounded_by_as_many_boxes_as_are_allowed(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Its 1e-16 N m would take boxes as narrow as they get."""
    monkeypatch.setattr(enclosure, "MANY", 128)
    bars = (
        fourbar.Bar(0.1, 2.0, 1e-3, (0.05, 0.0)),
        fourbar.Bar(0.25),
        fourbar.Bar(0.22),
    )
    balancing = Springs(
        (Spring(SpringEnd(1, 0.1, 0.5 * math.pi), SpringEnd(2, 0.1, 0.0), 80.0),)
    )
    scene = Scene(
        fourbar.FourBar(0.3, *bars), Motion(0.0, 10.0), 2, (), (Gravity(8.0), balancing)
    )
    bounds = extremes(scene, ["torque"])
    assert 4 * 128 < bounds.boxes < 20 * 128  # over two searches
    moment = 2.0 * 8.0 * 0.05
    for extreme in (bounds.least["torque"], bounds.greatest["torque"]):
        assert -1e-2 * moment < extreme.low <= extreme.high < 1e-2 * moment
    assert bounds.least["torque"].low < -1e-9 * moment  # not halved to the end
    holds(
        bounds,
        sampled(
            fourbar.solve(
                scene,
                at=Command(np.linspace(0, 6, 500), np.ones(500, np.int8), 10.0, 0.0),
            )
        ),
    )


@pytest.mark.parametrize(
    ("lengths", "drive_bar"),
    [
        ((0.173, 0.462, 0.641, 0.00601), 2),
        (
            (
                0.17274163525586872,
                0.46219401279422845,
                0.6411602856139893,
                0.006228543349729581,
            ),
            3,
        ),
    ],
)
def test_an_interval_that_lies_near_limits_throughout_is_one_line(
    lengths: tuple[float, ...], drive_bar: int
) -> None:
    """The input swings by a degree, or a drive on the coupler has a pole wherever it is."""
    scene = Scene(fourbar.uniform(*lengths), Motion(0.0, 1.0), drive_bar)
    with pytest.raises(fourbar.FourBarError, match="lies within 1 deg of a limit"):
        extremes(scene, ["torque"])
