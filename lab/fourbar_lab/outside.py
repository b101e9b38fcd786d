"""A search for values outside proven extremes: doubles climb in random boxes, balls that share nothing judge.

The bounds hold for the numbers that a scene states, doubles as they are, and so does the judge: no tolerance.
"""

import math
from dataclasses import replace
from typing import Any

import numpy as np

from fourbar.effects import Gravity, Spring, SpringEnd, Springs, Viscous
from fourbar.errors import InputError, LimitError
from fourbar.formulas.mobility import change_points
from fourbar.linkage import MOVING_BARS, Bar, FourBar
from fourbar.scene import Scene
from fourbar.scene.motion import Motion
from fourbar.scene.numbers import Tolerance
from fourbar.solution import Array, Solution
from fourbar.solve import solve
from fourbar.studies.enclosure import Extremes, extremes
from fourbar.studies.keys import is_left_out, list_entries, read_place, replace_numbers
from fourbar.studies.study import vary

QUANTITIES = {
    2: ("torque", "|F12|"),
    3: ("torque", "|F43|"),
    4: ("torque", "transmission"),
}
"""Quantities by the bar of the drive; each costs a proof of its own."""
DRAWN, BEST, AROUND, ROUNDS, NARROWED = 1000, 8, 25, 12, 0.3
"""Points to begin with; those climbed from; points around each; rounds, each within a part of the reach before."""
WITHIN = 1.0 - 1e-12
"""Part of a tolerance that is used, so that no number rounds to one beyond it."""


def draw_scene(seed: int, index: int) -> Scene:
    """Draw lengths, some near the limit of assembly, up to two tolerances, and springs whose ends nearly meet."""
    rng = np.random.default_rng([seed, index])
    while True:
        d, a, b, c = rng.uniform(0.1, 1.0, 4)
        if rng.random() < 0.3:
            c = abs(
                (d + a if rng.random() < 0.5 else abs(d - a)) - b
            ) + 10.0 ** rng.uniform(-6, -1)
        two, three, four = (
            Bar(x, rng.uniform(0.0, 2.0), *_draw_own(rng, x)) for x in (a, b, c)
        )
        try:
            linkage = FourBar(
                d, two, three, four, float(rng.choice([0.0, rng.uniform(-3.0, 3.0)]))
            )
        except InputError:
            continue
        motion = Motion(
            rng.uniform(-3.0, 3.0),
            rng.uniform(-10.0, 10.0),
            rng.uniform(-10.0, 10.0),
            branch=int(rng.choice([-1, 1])),
        )
        scene = Scene(linkage, motion, int(rng.choice([2, 2, 3, 4])))
        solution = solve(scene, "position")
        if not change_points(linkage) and solution.assembled.all():
            break
    effects: list[Any] = []
    if rng.random() < 0.7:
        effects.append(Springs((_draw_nearly_meeting(rng, scene, solution),)))
    if rng.random() < 0.5:
        effects.append(Gravity())
    if rng.random() < 0.3:
        effects.append(Viscous.at(A=rng.uniform(0.0, 1.0)))
    scene = replace(scene, effects=tuple(effects))
    entries = list_entries(scene)
    stated = [
        key
        for key, entry in entries.items()
        if not is_left_out(scene, entry) and not key.startswith("motion")
    ]
    keys = rng.choice(stated, rng.choice([0, 0, 1, 2]), replace=False).tolist()
    widths = {
        key: abs(float(read_place(scene, entries[key].place)))
        * 10.0 ** rng.uniform(-10, -2.5)
        for key in keys
    }
    return replace(
        scene,
        tolerances=tuple(
            Tolerance(key, width) for key, width in widths.items() if width > 0.0
        ),
    )


def _draw_own(rng: np.random.Generator, length: float) -> tuple[Any, ...]:
    """Draw inertia and centre of a bar, or none: then they follow its length."""
    return (
        (0.1 * length * length, (0.5 * length, rng.uniform(-1.0, 1.0)))
        if rng.random() < 0.7
        else ()
    )


def _draw_nearly_meeting(
    rng: np.random.Generator, scene: Scene, solution: Solution
) -> Spring:
    """Draw a spring whose ends are a millionth to a tenth of the linkage apart where the motion begins."""
    assert solution.theta_3 is not None and solution.theta_4 is not None
    link, bars = scene.linkage, rng.choice(4, 2, replace=False) + 1
    angles = np.array(
        [
            link.ground_angle,
            scene.motion.theta_2,
            solution.theta_3[0],
            solution.theta_4[0],
        ]
    )
    first_pins = np.array(
        [
            0.0,
            0.0,
            *(np.array([link.input.length, link.ground]) * np.exp(1j * angles[[1, 0]])),
        ]
    )
    meet = first_pins[bars[0] - 1] + rng.uniform(0.05, 0.3) * np.exp(
        1j * rng.uniform(-3.0, 3.0)
    )
    apart = np.array(
        [0.0, 10.0 ** rng.uniform(-6, -1) * np.exp(1j * rng.uniform(-3.0, 3.0))]
    )
    in_bars = (meet + apart - first_pins[bars - 1]) * np.exp(-1j * angles[bars - 1])
    start, end = (
        SpringEnd(int(bar), float(abs(z)), float(np.angle(z)))
        for bar, z in zip(bars, in_bars, strict=True)
    )
    return Spring(
        start,
        end,
        10.0 ** rng.uniform(0, 4),
        rng.uniform(0.0, 0.5),
        rng.uniform(-5.0, 5.0),
    )


def list_findings(scene: Scene) -> list[str]:
    """List each value found outside what is proven, in one line; nothing where nothing is proven."""
    try:
        proven = extremes(scene, QUANTITIES[scene.drive_bar])
        return [
            line
            for name in proven.least
            for sign in (1, -1)
            for line in _list_outside(scene, proven, name, sign)
        ]
    except (InputError, LimitError):
        return []
    except Exception as error:  # a traceback is found, too
        return [f"extremes {type(error).__name__}: {error}".splitlines()[0]]


def _list_outside(scene: Scene, proven: Extremes, name: str, sign: int) -> list[str]:
    """List what lies beyond the bound at the point reached by climbing, and what the stated place does not reach."""
    extreme = (proven.greatest if sign > 0 else proven.least)[name]
    outer, inner = (
        (extreme.high, extreme.low) if sign > 0 else (extreme.low, extreme.high)
    )
    parts, theta_2 = _climb(scene, proven.parts, name, sign)
    value, violations = _evaluate_ball(scene, name, parts, theta_2), []
    if not sign * (value - outer) <= 0:
        violations.append(
            f"extremes {name}: {value} at theta_2 = {theta_2!r}, {parts.tolist()} lies beyond {outer!r}"
        )
    if not scene.tolerances:
        value = _evaluate_ball(scene, name, parts, extreme.theta_2)
        if not sign * (value - inner) >= 0:
            violations.append(
                f"extremes {name}: {value} at theta_2 = {extreme.theta_2!r} does not reach {inner!r}"
            )
    return violations


def _move_numbers(scene: Scene, parts: Array) -> dict[str, Any]:
    """Move the toleranced numbers by parts of their tolerances, (k,) or (k, n)."""
    entries = list_entries(scene)
    return {
        tolerance.key: read_place(scene, entries[tolerance.key].place)
        + WITHIN * tolerance.reach * part
        for tolerance, part in zip(scene.tolerances, parts, strict=True)
    }


def _climb(
    scene: Scene, intervals: tuple[tuple[float, float], ...], name: str, sign: int
) -> tuple[Array, float]:
    """Find parts of the tolerances and theta_2 of the greatest (+1) or least (-1) value."""
    rng, k = np.random.default_rng(0), len(scene.tolerances)
    low, high = np.array(intervals).T
    spots = rng.integers(0, len(low), DRAWN)
    theta_2 = np.clip(
        rng.uniform(low[spots] - 0.05, high[spots] + 0.05), low[spots], high[spots]
    )  # some at the ends
    parts = np.clip(rng.uniform(-2.0, 2.0, (k, DRAWN)), -1.0, 1.0)
    values = _evaluate_samples(scene, name, sign, parts, theta_2)
    reach = 0.1
    for _ in range(ROUNDS):
        best = np.argsort(values)[-BEST:]
        around = np.concatenate([best, np.repeat(best, AROUND)])
        noise = reach * rng.normal(size=(1 + k, len(around)))
        noise[:, :BEST] = 0.0  # the best themselves stay
        spots, reach = spots[around], reach * NARROWED
        theta_2 = np.clip(theta_2[around] + noise[0], low[spots], high[spots])
        parts = np.clip(parts[:, around] + 10.0 * noise[1:], -1.0, 1.0)
        values = _evaluate_samples(scene, name, sign, parts, theta_2)
    best_sample = int(np.argmax(values))
    return parts[:, best_sample], float(theta_2[best_sample])


def _evaluate_samples(
    scene: Scene, name: str, sign: int, parts: Array, theta_2: Array
) -> Array:
    """Evaluate in doubles, times the sign, (n,); -inf where there is no value."""
    members = vary(
        replace(scene, tolerances=()),
        _move_numbers(scene, parts) | {"motion.theta_2": theta_2[:, None]},
    )
    solution = solve(members, "force")
    if name == "transmission":
        values = np.arctan2(
            np.abs(solution.sin_mu), np.abs(np.cos(solution.theta_4 - solution.theta_3))
        )
    else:
        values = getattr(solution, name.strip("|"))
        values = (
            values if name == "torque" else np.hypot(values[..., 0], values[..., 1])
        )
    return np.asarray(np.nan_to_num(sign * values[:, 0], nan=-math.inf))


def _evaluate_ball(scene: Scene, name: str, parts: Array, theta_2: float) -> Any:
    """Evaluate a ball by the thirteen equations of the free bodies; NaN where there is no value."""
    from flint import acb, arb

    from fourbar_validation.engines.balls import (
        closure,
        compute_outputs,
        make_balls,
        wedge,
    )

    member = replace_numbers(scene, _move_numbers(scene, parts))
    x, branch = make_balls(member, theta_2), scene.motion.branch
    for k, length in zip(MOVING_BARS, "abc", strict=True):
        if member.linkage.bar(k).inertia is None:  # m L^2/12, which a double rounds
            x[f"I{k}"] = x[f"m{k}"] * x[length] ** 2 / 12
    if name == "transmission":
        closed = closure(x, branch)
        return (
            closed
            and acb(
                abs((closed[1].conjugate() * closed[2]).real), abs(wedge(*closed[1:]))
            ).arg()
        )
    y = compute_outputs(member, branch, x) or {}
    if name == "torque":
        return y.get(name, arb("nan"))
    x_and_y = [y.get(f"{name.strip('|')}_{axis}", arb("nan")) for axis in "xy"]
    return sum(component * component for component in x_and_y).sqrt()
