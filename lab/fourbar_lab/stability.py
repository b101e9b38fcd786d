"""The command `stability`: forward error of every output of `solve`, per hard family.

The reference is ball arithmetic.
"""

import math
import warnings
from collections.abc import Collection
from dataclasses import replace
from functools import partial
from itertools import chain
from typing import Any

import click
import numpy as np

from fourbar.errors import FAILED, HOLDS
from fourbar.formulas.path import NO_DIGIT_LEFT
from fourbar.quantities import OK, PIN_FORCES, UNITS
from fourbar.scene import Scene, command, find_signs, with_signs
from fourbar.scene.motion import Motion
from fourbar.solving import solve
from fourbar_lab.each import apply_each
from fourbar_lab.families import FAMILY_DRAWERS
from fourbar_lab.slopes import judge_slopes
from fourbar_lab.tally import (
    BAR_FACTORS,
    HALF_A_DIGIT,
    SAMPLES,
    TOO_LARGE,
    Tally,
    error_over_allowed,
    list_components,
)
from fourbar_validation.compare.tolerance import find_used
from fourbar_validation.engines.balls import (
    OF_PIECE,
    BallValues,
    Responses,
    make_balls,
)
from fourbar_validation.engines.description import name_driving
from fourbar_validation.report.sentences import make_words_table

SAMPLES_OF_A_FAMILY = 10_000
"""Samples per family of the full set."""
SAMPLES_OF_A_TASK = 250
"""Samples per task: about a second."""
WIDE = 160
"""Columns of text for the table of all families where no terminal limits them."""


def solve_position(scene: Scene, angle: float) -> dict[str, Any]:
    """Solve one position with error bars.

    `solve` evaluates one in plain numbers, two in arrays.
    """
    times = 1 + hash(angle) % 2  # as good as random, and the same on every run
    commanded = np.full(times, angle)
    scene = replace(scene, motion=scene.motion.replace(angle=commanded))
    solution = solve(scene, "error")
    arrays = {name: getattr(solution, name) for name in UNITS}
    return {name: array[0] for name, array in arrays.items() if array is not None}


def compute_reference(
    scene: Scene,
    branch: int,
    angle: float,
) -> tuple[BallValues, dict[str, float]] | None:
    """Return values at one position as balls, and sum |x_i dy/dx_i| of each.

    The answer is None if the loop does not close.
    """
    exact = make_balls(scene, angle)
    for k, load in enumerate(scene.loads):
        if load.table:
            exact |= {f"{name}_{k}": 1 for name in OF_PIECE}
    responses = Responses(scene, branch, exact)
    if responses.base is None:
        return None
    sensitivity = dict.fromkeys(responses.base, 0.0)
    weights = {name: abs(float(value)) for name, value in exact.items() if value != 0}
    responses.add_of_inputs(sensitivity, weights)
    return responses.base, sensitivity


def judge_sample(
    scene: Scene,
    tally: Tally,
    sample: str,
) -> None:
    """Compare one position with the reference."""
    tally.counts[SAMPLES] += 1
    angle = float(np.asarray(scene.motion.angle))
    drive = name_driving(scene)
    # a component of a pin force that such a drive has no part in is left of larger ones
    between_moving_bars = (
        scene.drive is not None
        and scene.drive.has_stroke
        and 1 not in [place.bar for _, place in scene.drive.ends]
    )
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        solution = solve_position(scene, angle)
    tally.warned += [f"{sample}: {warning.message}" for warning in caught]
    sign = int(with_signs(scene.linkage, command(scene)).branch[0])
    exact = compute_reference(scene, sign, angle)
    if exact is None:
        tally.counts["not assembled"] += 1
        if math.isfinite(solution[drive]):
            tally.worst["assembled"] = (math.inf, sample)
        return
    values, sensitivity = exact
    errors: dict[str, float] = {}
    for name, found in solution.items():
        if name == scene.motion.commanded or name.endswith("_error"):
            continue
        components = [item for item in list_components(name) if item[0] in values]
        rates = [sensitivity[component] for component, _ in components]
        if between_moving_bars and name in PIN_FORCES:
            rates = [max(rates)] * len(rates)
        for (component, index), rate in zip(components, rates, strict=True):
            part, errors[component] = error_over_allowed(
                name, np.ravel(found)[index], values[component], rate
            )
            tally.note(component, part, sample)
    if drive not in values:
        tally.counts["no torque"] += 1
        return
    force = max(
        math.hypot(errors[f"{name}_x"], errors[f"{name}_y"]) for name in PIN_FORCES
    )
    strongest = max(math.hypot(*solution[name]) for name in PIN_FORCES)
    for name, error, size in (
        (f"{drive}_error", errors[drive], abs(solution[drive])),
        ("force_error", force, strongest),
    ):
        bar = float(solution[name])
        tally.note(name, float(find_used(error, bar)), sample)
        useless = bar > BAR_FACTORS * max(error, HALF_A_DIGIT * size)
        tally.counts[f"{name}{TOO_LARGE}"] += useless


def judge_samples(
    family: str,
    samples: range,
    seed: int = 0,
    bar: int = 2,
    *,
    derivatives: bool = False,
) -> Tally:
    """Return the tally of some samples of a family.

    A sample depends on the family, the seed and its number alone.

    Parameters
    ----------
    bar : whose motion is commanded, as it comes out where the input is.
    derivatives : judge those of `sensitivity` instead.
    """
    tally = Tally()
    judge = judge_slopes if derivatives else judge_sample
    which = list(FAMILY_DRAWERS).index(family)
    for number in samples:
        rng = np.random.default_rng([seed, which, number])
        scene = _feed_back(FAMILY_DRAWERS[family](rng), bar)
        if scene is not None:
            judge(scene, tally, f"{family} {number}")
    return tally


def _feed_back(scene: Scene, bar: int) -> Scene | None:
    """Command bar 2, 3 or 4 to move as it does under the scene's command.

    The scene is None if that command has no motion.
    """
    if bar == 2:
        return scene
    solution = solve(scene, "acceleration")
    names = [f"{name}_{bar}" for name in ("theta", "omega", "alpha")]
    theta, omega, alpha = (float(getattr(solution, name)[0]) for name in names)
    other = solution.theta_4 if bar == 3 else solution.theta_3
    sine = math.sin(other[0] - solution.theta_2[0])
    if solution.status_code[0] != OK or abs(sine) <= NO_DIGIT_LEFT:
        return None
    sign = 1 if sine > 0.0 else -1
    branch = int(find_signs(scene.linkage, np.array([theta]), sign, bar)[0])
    motion: Any = dict(zip(names, (theta, omega, alpha), strict=True))
    return replace(scene, motion=Motion(branch=branch, **motion))


def _judge_task(
    seed: int,
    bar: int,
    derivatives: bool,
    task: tuple[str, range],
) -> Tally:
    return judge_samples(*task, seed, bar, derivatives=derivatives)


def list_rows(tallies: Collection[Tally]) -> list[list[str]]:
    """List the rows of the table: a name, and a cell of each tally."""
    rows = []
    for name in dict.fromkeys(chain.from_iterable(tally.worst for tally in tallies)):
        row = [name]
        for tally in tallies:
            ratio, _ = tally.worst.get(name, (math.nan, ""))
            cell = f"{ratio:.3f}" + " fails" * (name in tally.list_beyond())
            row.append("-" if math.isnan(ratio) else cell)
        rows.append(row)
    for name in dict.fromkeys(chain.from_iterable(tally.counts for tally in tallies)):
        rows.append([name, *(str(tally.counts[name]) for tally in tallies)])
    return rows


@click.command()
@click.option(
    "--samples",
    default=SAMPLES_OF_A_FAMILY,
    show_default=True,
    type=click.IntRange(1),
    help="Samples per family.",
)
@click.option(
    "--family",
    "families",
    multiple=True,
    type=click.Choice(list(FAMILY_DRAWERS)),
    help="Only these (repeatable).",
)
@click.option("--seed", default=0, show_default=True)
@click.option(
    "--bar",
    default=2,
    show_default=True,
    type=click.IntRange(2, 4),
    help="Whose motion is commanded.",
)
@click.option(
    "--derivatives",
    is_flag=True,
    help="Judge those of `sensitivity` by every number of a scene.",
)
@click.option("--jobs", default=2, show_default=True, help="Processes.")
def stability(
    samples: int,
    families: tuple[str, ...],
    seed: int,
    bar: int,
    derivatives: bool,
    jobs: int,
) -> int:
    """Measure the error of every output against 50-digit arithmetic.

    The table tells too whether the error bars hold.
    """
    from rich.console import Console
    from rich.progress import track

    chosen = families or tuple(FAMILY_DRAWERS)
    parts = [
        range(start, min(start + SAMPLES_OF_A_TASK, samples))
        for start in range(0, samples, SAMPLES_OF_A_TASK)
    ]
    tasks = [(family, part) for family in chosen for part in parts]
    results = apply_each(partial(_judge_task, seed, bar, derivatives), tasks, jobs)
    tallies = {family: Tally() for family in chosen}
    judged = zip(tasks, results, strict=True)
    for (family, _), tally in track(judged, "samples", total=len(tasks)):
        tallies[family].add(tally)
    rows = list_rows(tallies.values())
    console = Console()
    if not console.is_terminal:
        # in a file the columns of all families keep their width
        console.width = WIDE
    of = ", of derivatives by every number" if derivatives else ""
    title = (
        f"largest error / (8 eps (|y| + sum |x dy/dx|)), of error bars error / bar,"
        f" {samples} samples each, seed {seed}{of}"
    )
    console.print(make_words_table(("output", *chosen), rows, title=title))
    for family, tally in tallies.items():
        for name in tally.list_beyond():
            part, sample = tally.worst[name]
            console.print(f"{name}: {part:.3g} at sample {sample}")
        for line in tally.warned[:5]:
            console.print(f"{family} warned: {line}")
    for family, tally in tallies.items():
        if not tally.worst:
            console.print(f"{family}: nothing was compared")
    return HOLDS if all(tally.holds() for tally in tallies.values()) else FAILED
