"""The command `stability`: forward error of every output of `solve`, per hard family.

The reference is ball arithmetic.
"""

import math
import warnings
from dataclasses import replace
from functools import partial
from typing import Any

import click
import numpy as np

from fourbar.errors import FAILED, HOLDS
from fourbar.formulas.path import NO_DIGIT_LEFT
from fourbar.quantities import OK, PIN_FORCES, UNITS
from fourbar.scene import Scene, command, find_signs, with_signs
from fourbar.scene.motion import Motion
from fourbar.solution import Solution
from fourbar.solving import solve
from fourbar_lab.families import FAMILY_DRAWERS
from fourbar_lab.slopes import judge_slopes
from fourbar_lab.tally import (
    BAR_FACTORS,
    HALF_A_DIGIT,
    Tally,
    error_over_allowed,
    list_components,
)
from fourbar_validation.compare.tolerance import find_used
from fourbar_validation.engines.description import name_driving
from fourbar_validation.engines.prediction import compute_reference
from fourbar_validation.engines.workers import apply_each
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
    return {
        name: array[0]
        for name in UNITS
        if (array := getattr(solution, name)) is not None
    }


def judge_sample(
    scene: Scene,
    tally: Tally,
    sample: str,
) -> None:
    """Compare one position with the reference."""
    tally.samples += 1
    angle = float(np.asarray(scene.motion.angle))
    drive = name_driving(scene)
    internal = (
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
        tally.not_assembled += 1
        if math.isfinite(solution[drive]):
            tally.worst["assembled"] = (math.inf, sample)
        return
    values, sensitivity = exact
    errors: dict[str, float] = {}
    for name in solution:
        for component, index in list_components(name):
            if (
                component not in values
                or name == scene.motion.commanded
                or name.endswith("_error")
            ):
                continue
            own = np.ravel(solution[name])[index]
            rate = sensitivity[component]
            if (
                internal and name in PIN_FORCES
            ):  # a component that the drive has no part in is left of larger ones
                rate = max(sensitivity[other] for other, _ in list_components(name))
            part, errors[component] = error_over_allowed(
                name,
                own,
                values[component],
                rate,
            )
            tally.note(component, part, sample)
    if drive not in values:
        tally.no_torque += 1
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
        tally.too_small[name] = max(
            tally.too_small.get(name, 0.0), float(find_used(error, bar))
        )
        tally.too_large[name] = tally.too_large.get(name, 0) + (
            bar > BAR_FACTORS * max(error, HALF_A_DIGIT * size)
        )


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
    for number in samples:
        rng = np.random.default_rng([seed, list(FAMILY_DRAWERS).index(family), number])
        scene = _feed_back(FAMILY_DRAWERS[family](rng), bar)
        if scene is not None:
            (judge_slopes if derivatives else judge_sample)(
                scene,
                tally,
                f"{family} {number}",
            )
    return tally


def _feed_back(scene: Scene, bar: int) -> Scene | None:
    """Command bar 2, 3 or 4 to move as it does under the scene's command.

    The scene is None if that command has no motion.
    """
    if bar == 2:
        return scene
    solution = solve(scene, "acceleration")
    theta, omega, alpha, sine = _read_bar_motion(solution, bar)
    if solution.status_code[0] != OK or abs(sine) <= NO_DIGIT_LEFT:
        return None
    numbers = {f"theta_{bar}": theta, f"omega_{bar}": omega, f"alpha_{bar}": alpha}
    sign = 1 if sine > 0.0 else -1
    branch = int(find_signs(scene.linkage, np.array([theta]), sign, bar)[0])
    return replace(scene, motion=Motion(branch=branch, **numbers))  # type: ignore[arg-type]


def _read_bar_motion(solution: Solution, bar: int) -> tuple[float, float, float, float]:
    """Return angle, speed and acceleration of a bar at the first position.

    The sine whose sign its branch is follows.
    """
    theta, omega, alpha = (
        float(getattr(solution, f"{name}_{bar}")[0])
        for name in ("theta", "omega", "alpha")
    )
    first, second = {2: (3, 4), 3: (2, 4), 4: (2, 3)}[bar]
    one, other = (
        float(getattr(solution, f"theta_{each}")[0]) for each in (first, second)
    )
    return theta, omega, alpha, math.sin(other - one)


def _judge_task(
    seed: int,
    bar: int,
    derivatives: bool,
    task: tuple[str, range],
) -> Tally:
    return judge_samples(*task, seed, bar, derivatives=derivatives)


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
    for (family, _), tally in track(
        zip(tasks, results, strict=True),
        "samples",
        total=len(tasks),
    ):
        tallies[family].add(tally)
    rows = []
    for name in dict.fromkeys(
        name for tally in tallies.values() for name in tally.worst
    ):
        cells = [
            tallies[family].worst.get(name, (math.nan, ""))[0] for family in chosen
        ]
        rows.append(
            (
                name,
                *(
                    "-" if math.isnan(cell) else f"{cell:.3f}" + " fails" * (cell > 1.0)
                    for cell in cells
                ),
            )
        )
    bars = ("torque_error", "drive_force_error", "force_error")
    for name in (
        name
        for name in bars
        if any(name in tally.too_small for tally in tallies.values())
    ):
        rows.append(
            (
                f"error / {name}",
                *(
                    f"{tallies[family].too_small.get(name, math.nan):.2f}"
                    for family in chosen
                ),
            )
        )
        shares = (
            100.0 * tallies[family].too_large.get(name, 0) / tallies[family].samples
            for family in chosen
        )
        rows.append(
            (
                f"% {name} > {BAR_FACTORS:.0f} x error",
                *(f"{share:.2f}" for share in shares),
            )
        )
    rows.append(
        ("not assembled", *(str(tallies[family].not_assembled) for family in chosen))
    )
    rows.append(("no torque", *(str(tallies[family].no_torque) for family in chosen)))
    if derivatives:
        rows.append(
            ("no digit tells", *(str(tallies[family].untold) for family in chosen))
        )
    console = Console()
    if (
        not console.is_terminal
    ):  # in a file the columns of all families keep their width
        console.width = WIDE
    of = ", of derivatives by every number" if derivatives else ""
    title = (
        f"largest error / (8 eps (|y| + sum |x dy/dx|)), {samples} samples each, seed"
        f" {seed}{of}"
    )
    console.print(make_words_table(("output", *chosen), rows, title=title))
    for family, tally in tallies.items():
        for name, (part, sample) in tally.worst.items():
            if part > 1.0:
                console.print(f"{name}: {part:.3g} at sample {sample}")
        for line in tally.warned[:5]:
            console.print(f"{family} warned: {line}")
    for family, tally in tallies.items():
        if not tally.worst:
            console.print(f"{family}: nothing was compared")
    return HOLDS if all(tally.holds() for tally in tallies.values()) else FAILED
