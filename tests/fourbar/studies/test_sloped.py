"""No comparison of balls decides silently: every ufunc, every effect, every line of the formulas that compares them."""

import sys
from collections.abc import Iterator
from dataclasses import replace
from importlib import import_module
from pathlib import Path
from pkgutil import iter_modules
from typing import Any

import flint
import numpy as np
import pytest

import fourbar
import fourbar.effects
from fourbar import Bar, FourBar, InputError, Motion, Scene, Tolerance
from fourbar.effects import (
    Effect,
    Flywheel,
    Friction,
    Gravity,
    Load,
    PinFriction,
    Spring,
    SpringEnd,
    Springs,
    Torsion,
    Viscous,
)
from fourbar.effects.effect import PinRows
from fourbar.errors import LimitError
from fourbar.studies import sloped
from fourbar.studies.enclosure import _Search, require_provable
from fourbar.studies.keys import list_entries, read_place, replace_numbers
from fourbar.studies.sloped import Sloped, Undecided
from fourbar_validation.engines.balls import closure, make_balls, wedge

STRADDLED = [(0.0, 1.0), (0.5, 1.0), (-1.0, 1e-3), (2.0, 2.0), (0.0, 0.0)]
"""Centres and radii: over 0, over whole and half numbers, at a kink, and none at all."""
SAMPLES = 41
ROUNDING = 1e-12
"""Relative; what doubles lose of a sample."""

LINKAGE = FourBar(0.3, Bar(0.1, 1.0, 1e-3), Bar(0.25, 2.0, 1e-2), Bar(0.22, 1.5, 1e-2))
LEVEL = FourBar(
    0.1,
    Bar(0.1, 1.0, 1e-3, (0.05, 0.0)),
    Bar(0.06, 2.0, 1e-2, (0.03, 0.0)),
    Bar(0.12, 1.5, 1e-2, (0.06, 0.0)),
)
"""Ground and input are equal: which is shorter is open within their tolerances."""
MEETING = Spring(SpringEnd(1, 0.1005, 0.5), SpringEnd(2, 0.1, 0.0), 1000.0, 0.5)
LOOSE = Spring(SpringEnd(1, 0.1, 2.0), SpringEnd(3, 0.1, 0.0), 1000.0, 0.5, 500.0)


def scene(
    *effects: Any,
    linkage: FourBar = LINKAGE,
    loads: Any = (),
    alpha_2: float = 0.0,
    within: Any = None,
) -> Scene:
    loose = tuple(Tolerance(key, width) for key, width in (within or {}).items())
    return Scene(
        linkage, Motion(1.0, 10.0, alpha_2), 2, loads, effects, tolerances=loose
    )


STRADDLING: dict[str, list[tuple[Scene, float, float]]] = {
    "gravity": [
        (
            scene(
                Gravity(), within={"bars.coupler.mass": 3.0, "effects.gravity.0": 20.0}
            ),
            1.0,
            0.1,
        )
    ],
    "viscous": [
        (
            scene(
                Viscous.at(A=0.5),
                within={"effects.viscous.A": 1.0, "motion.omega_2": 20.0},
            ),
            1.0,
            0.1,
        )
    ],
    "friction": [(scene(Friction.at(A=0.5)), 1.0, 0.1)],
    "pin_friction": [(scene(PinFriction.at(A=(0.1, 0.01))), 1.0, 0.1)],
    "torsion": [(scene(Torsion.at(A=(0.1, 0.01, 0.0))), 1.0, 0.1)],
    "springs": [
        (scene(Springs((MEETING,))), 0.5, 0.1),
        (scene(Springs((MEETING,))), 0.5, 1e-3),
        (
            scene(Springs((MEETING,)), within={"effects.springs.0.from.at.0": 1e-3}),
            2.0,
            0.01,
        ),
        (
            scene(Springs((LOOSE,)), within={"effects.springs.0.preload": 10.0}),
            0.5,
            0.1,
        ),
    ],
    "flywheel": [
        (
            scene(
                Flywheel(0.5),
                within={"effects.flywheel.inertia": 1.0, "motion.alpha_2": 1.0},
            ),
            1.0,
            0.1,
        )
    ],
    "load": [
        (
            scene(
                loads=(Load(3, (1.0, 0.0), moment=1e-3),),
                within={"loads.0.moment": 1.0},
            ),
            1.0,
            0.1,
        )
    ],
}
"""By effect: scenes whose numbers lie on both sides of each of its decisions, and the interval of theta_2."""
FORMULAS: list[tuple[Scene, float, float]] = [
    (
        scene(linkage=LEVEL, within={"lengths.ground": 1e-3, "lengths.input": 1e-3}),
        1.5,
        0.1,
    ),
    (scene(linkage=LEVEL, within={"lengths.input": 1e-3}), 1.5, 0.01),
    (
        scene(
            linkage=FourBar(0.5, Bar(0.3, 1.0), Bar(0.4, 2.0), Bar(0.45, 1.5)),
            within={"lengths.input": 1e-2},
        ),
        1.0,
        0.1,
    ),
    (
        scene(
            linkage=FourBar(0.3, Bar(0.2, 1.0), Bar(0.25, 2.0), Bar(0.24, 1.5)),
            within={"lengths.input": 1e-3},
        ),
        1.0,
        0.1,
    ),
    *[
        (
            scene(linkage=FourBar(1.0, Bar(0.9, 1.0), Bar(0.8, 2.0), Bar(0.85, 1.5))),
            theta_2,
            0.05,
        )
        for theta_2 in np.arange(-3, 3, 0.1)
    ],
]


@pytest.fixture
def compared(monkeypatch: pytest.MonkeyPatch) -> Iterator[dict[tuple[str, int], bool]]:
    """File and line of each comparison of balls: whether it was open once."""
    decisions: dict[tuple[str, int], bool] = {}

    def noted(holds: Any, fails: Any) -> Any:
        mask, frame = true(holds, fails), sys._getframe(1)
        while frame.f_back and Path(frame.f_code.co_filename).parts[-2] not in (
            "effects",
            "formulas",
            "evaluation",
            "scene",
        ):
            frame = frame.f_back
        place = "/".join(Path(frame.f_code.co_filename).parts[-2:]), frame.f_lineno
        decisions[place] = decisions.get(place, False) or isinstance(mask, Undecided)
        return mask

    def of_one(mask: Any, x: Any, y: Any) -> Any:
        pairs = np.broadcast_arrays(
            sloped.take_values(x), sloped.take_values(y), mask.holds | mask.fails
        )
        for first, second, is_decided in zip(*pairs, strict=True):
            differ = first - second != 0
            assert is_decided or not differ, "two forms of one number that differ"
        return both(mask, x, y)

    true, both = sloped.decided, Undecided.of_one
    before, flint.ctx.prec = flint.ctx.prec, 128
    monkeypatch.setattr(sloped, "decided", noted)
    monkeypatch.setattr(Undecided, "of_one", of_one)
    yield decisions
    flint.ctx.prec = before


def ufuncs() -> list[Any]:
    every = {
        f.__name__: f
        for f in vars(np).values()
        if isinstance(f, np.ufunc) and f.nin < 3
    }
    return [every[name] for name in sorted(every)]


@pytest.mark.parametrize("function", ufuncs(), ids=lambda f: f.__name__)
@pytest.mark.parametrize("ball", STRADDLED, ids=str)
def test_a_function_of_balls_holds_every_sample_or_refuses(
    function: Any, ball: tuple[float, float]
) -> None:
    x = Sloped(
        np.array([flint.arb(*ball)], dtype=object), np.array([[1]], dtype=object)
    )
    arguments = (x,) if function.nin == 1 else (x, 1.0)
    try:
        outcome = function(*arguments)
    except (TypeError, AttributeError):
        return
    with np.errstate(all="ignore"):
        samples = function(
            np.linspace(ball[0] - ball[1], ball[0] + ball[1], SAMPLES), *arguments[1:]
        )
    if isinstance(outcome, Undecided):
        assert (samples | ~outcome.holds).all() and (~samples | ~outcome.fails).all()
        with pytest.raises(LimitError):
            bool(outcome)
        return
    if not isinstance(outcome, Sloped):
        assert outcome.dtype == bool and (samples == outcome).all()
        return
    for sample in samples[np.isfinite(samples)].tolist():
        assert outcome.values[0].overlaps(flint.arb(sample, ROUNDING))


@pytest.mark.parametrize(("centre", "jumps"), [(0.3, False), (0.0, True)])
def test_both_sides_of_an_open_comparison_are_taken(centre: float, jumps: bool) -> None:
    """np.where may jump, so no slope is known; select chooses between forms of one number."""
    x = Sloped(
        np.array([flint.arb(centre, 0.1)], dtype=object), np.array([[1]], dtype=object)
    )
    jump, same = (
        np.where(x > 0.0, x + 1.0, -x),
        fourbar.formulas.arithmetic.select(x > 0.0, 2.0 * x, x + x),
    )
    assert (
        jump.values[0].contains(centre + 1.05)
        and jump.values[0].contains(0.05 - centre) == jumps
    )
    assert flint.arb(jump.slopes[0, 0]).is_finite() != jumps and same.slopes[0, 0] == 2
    with pytest.raises(TypeError):
        bool(x)


def effects() -> set[str]:
    for module in iter_modules(fourbar.effects.__path__):
        import_module(f"fourbar.effects.{module.name}")
    kinds = [
        kind
        for kind in (*Effect.__subclasses__(), *PinRows.__subclasses__())
        if kind is not PinRows
    ]
    return {
        kind.key for kind in kinds if kind.__module__.startswith("fourbar.effects.")
    }


def test_every_effect_is_walked() -> None:
    assert effects() == set(STRADDLING)


@pytest.mark.parametrize("key", STRADDLING)
def test_an_effect_is_bounded_over_its_decisions_or_refused(
    key: str, compared: dict[tuple[str, int], bool]
) -> None:
    walked = 0
    for case, centre, radius in STRADDLING[key]:
        try:
            require_provable(case)
        except InputError:
            continue
        held(case, centre, radius)
        walked += 1
    assert walked in (0, len(STRADDLING[key]))
    of_effects = {
        place: was for place, was in compared.items() if place[0].startswith("effects/")
    }
    assert all(of_effects.values()), of_effects


@pytest.mark.slow
def test_the_formulas_are_bounded_over_their_decisions(
    compared: dict[tuple[str, int], bool],
) -> None:
    for case, centre, radius in FORMULAS:
        held(case, centre, radius)
    held(*STRADDLING["flywheel"][0])
    of_formulas = {
        place: was
        for place, was in compared.items()
        if not place[0].startswith("effects/")
    }
    assert len(of_formulas) > 4 and all(of_formulas.values()), of_formulas


def held(case: Scene, centre: float, radius: float) -> None:
    """Samples of the box lie in its balls, and in the bounds that the slopes give."""
    search = _Search.__new__(_Search)
    search.arb, search.scene, search.boxes, search.branch = flint.arb, case, 0, 1.0
    search.reach = {tolerance.key: tolerance.reach for tolerance in case.tolerances}
    search.keys = [key for key in list_entries(case) if key in search.reach]
    entries, random = list_entries(case), np.random.default_rng(0)
    with np.errstate(all="ignore"):
        over = search.evaluate(
            np.array([flint.arb(centre, radius)], dtype=object), None
        )
        nominal = search.evaluate(
            np.array([flint.arb(centre)], dtype=object), np.zeros((len(search.keys), 1))
        )
        part = random.choice(
            [-1.0, 1.0, *random.uniform(-1.0, 1.0, 4)], (1 + len(search.keys), SAMPLES)
        )
        points = np.array(
            [flint.arb(centre) + radius * flint.arb(x) for x in part[0]], dtype=object
        )
        for name, samples in search.evaluate(points, part[1:]).items():
            tops = [
                search._bound(sign, over[name], nominal[name], 0, radius)[0]
                for sign in (1, -1)
            ]
            for sample in samples.values:
                assert over[name].values[0].overlaps(sample), name
                assert not sample > tops[0] and not -sample > tops[1], name
    part = part[:, -1]
    numbers = {
        key: read_place(case, entries[key].place) + search.reach[key] * x
        for key, x in zip(search.keys, part[1:], strict=True)
    }
    solution = fourbar.solve(
        replace_numbers(case, numbers),
        at=fourbar.scene.Command(
            np.array([centre + radius * part[0]]),
            np.ones(1, np.int8),
            numbers.get("motion.omega_2", 10.0),
            numbers.get("motion.alpha_2", 0.0),
        ),
    )
    assert solution.torque is not None
    if np.isfinite(solution.torque[0]):
        assert (
            over["torque"]
            .values[0]
            .overlaps(
                flint.arb(
                    solution.torque[0], ROUNDING * (1.0 + abs(solution.torque[0]))
                )
            )
        )


@pytest.mark.parametrize("ground_angle", [0.0, 1.0, 2.5])
def test_a_loop_that_just_closes_closes_however_the_ground_is_turned(
    ground_angle: float,
) -> None:
    """Its discriminant is 0 exactly; from turned directions it was undecided, and read as open."""
    bars = (Bar(length) for length in (1.0, 2.0, 4.0))
    folded = Scene(
        FourBar(3.0, *bars, ground_angle=ground_angle), Motion(ground_angle, 1.0)
    )  # type: ignore[misc]
    closed = closure(make_balls(folded, ground_angle), 1)
    assert closed is not None and abs(float(wedge(*closed[1:]).mid())) < 1e-60
    apart = replace(folded, linkage=replace(folded.linkage, ground=3.0 - 1e-15))
    assert closure(make_balls(apart, ground_angle), 1) is None
