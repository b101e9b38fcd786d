"""The command: forward error of every output of `solve` against ball arithmetic, per family of hard cases.

The error allowed is 8 eps (|y| + sum |x_i dy/dx_i|) with y the value (1 rad for angles) and x_i the
stored inputs: what a change of the inputs in their last digits does to y, and nothing more.
"""

import math
import warnings
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

import click
import numpy as np

from fourbar.errors import FAILED, HOLDS
from fourbar.formulas.path import NO_DIGIT_LEFT
from fourbar.quantities import OK, PIN_FORCES, UNITS, VECTORS
from fourbar.scene import Command, Scene
from fourbar.scene.motion import Motion
from fourbar.solution import Solution
from fourbar.solve import solve
from fourbar_validation.compare.tolerance import used
from fourbar_validation.engines.balls import reference
from fourbar_validation.engines.workers import each
from fourbar_validation.lab.stress.forward_error.families import FAMILIES
from fourbar_validation.report.terminal import lined_up

EPS = 2.0**-52
FACTOR = 8.0
"""Of eps, as the contract states it."""
TOO_SMALL, TOO_LARGE = 10.0, 100.0
"""An error bar may be this much smaller (never) and this much larger (in one of USELESS samples) than the error."""
USELESS = 0.01
CHANCE = 1e-6
"""That so many samples or more are counted where the share is USELESS: rarer is no chance. Of 60 samples one is."""
HALF_A_DIGIT = 2.0**-53
"""Of a result: an error below that is chance, for no double need be nearer to the truth. A bar is held to be too
large against no less."""
FULL = 10_000
"""Samples per family of the full set."""
CHUNK = 250
"""Samples per task: about a second."""


@dataclass(slots=True)
class Tally:
    """What a number of samples of one family showed."""

    samples: int = 0
    not_assembled: int = 0
    no_torque: int = 0
    """Samples in which the exact system of forces is singular: nothing to compare."""
    worst: dict[str, tuple[float, str]] = field(default_factory=dict)
    """Output: largest error/allowed, and the sample it belongs to."""
    too_small: dict[str, float] = field(default_factory=dict)
    """Error bar: largest error/bar."""
    too_large: dict[str, int] = field(default_factory=dict)
    """Error bar: samples in which it is more than TOO_LARGE times the error."""
    warned: list[str] = field(default_factory=list)

    def add(self, other: "Tally") -> None:
        """Take in the samples of another tally."""
        self.samples += other.samples
        self.not_assembled += other.not_assembled
        self.no_torque += other.no_torque
        self.warned += other.warned
        for name, entry in other.worst.items():
            self.worst[name] = max(self.worst.get(name, (0.0, "")), entry)
        for name, ratio in other.too_small.items():
            self.too_small[name] = max(self.too_small.get(name, 0.0), ratio)
        for name, count in other.too_large.items():
            self.too_large[name] = self.too_large.get(name, 0) + count

    def note(self, output: str, ratio: float, sample: str) -> None:
        """Keep the largest error over what is allowed."""
        self.worst[output] = max(self.worst.get(output, (0.0, "")), (ratio, sample))

    def holds(self) -> bool:
        """Whether anything was compared, and error and error bars are as promised."""
        bars = all(ratio <= TOO_SMALL for ratio in self.too_small.values())
        useful = all(by_chance(count, self.samples) for count in self.too_large.values())
        errors = bool(self.worst) and all(ratio <= 1.0 for ratio, _ in self.worst.values())
        return errors and bars and useful and not self.warned


def by_chance(count: int, samples: int) -> bool:
    """Whether a share of USELESS explains that so many samples or more are counted (binomial)."""
    from scipy.stats import binom

    return bool(binom.sf(count - 1, samples, USELESS) >= CHANCE)


def components(name: str) -> list[tuple[str, Any]]:
    """List the names that an output has in the reference, and their index in its array."""
    return [(f"{name}_x", (0, 0)), (f"{name}_y", (0, 1))] if name in VECTORS else [(name, 0)]


def judge(scene: Scene, tally: Tally, sample: str) -> None:
    """Compare one position with the reference; `solve` evaluates one in plain numbers, two in arrays."""
    tally.samples += 1
    motion, angle = scene.motion, float(np.asarray(scene.motion.angle))
    times = 1 + hash(angle) % 2  # as good as random, and the same on every run
    branch = np.full(times, motion.branch, np.int8)
    at = Command(np.full(times, angle), branch, motion.speed, motion.acceleration, bar=motion.bar)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        solution = solve(scene, "error", at=at)
    tally.warned += [f"{sample}: {warning.message}" for warning in caught]
    exact = reference(scene, motion.branch, angle)
    if exact is None:
        tally.not_assembled += 1
        if solution.status_code[0] == OK:
            tally.worst["assembled"] = (math.inf, sample)
        return
    values, sensitivity = exact
    errors: dict[str, float] = {}
    for name in UNITS:
        array = getattr(solution, name)
        if array is None or name == at.commanded or name.endswith("_error"):
            continue
        for component, index in components(name):
            if component not in values:
                continue
            ratio, errors[component] = _ratio(name, array[index], values[component], sensitivity[component])
            tally.note(component, ratio, sample)
    if "torque" not in values:
        tally.no_torque += 1
        return
    assert solution.status_code[0] == OK or "torque" in errors
    force = max(math.hypot(errors[f"{name}_x"], errors[f"{name}_y"]) for name in PIN_FORCES)
    strongest = max(math.hypot(*getattr(solution, name)[0]) for name in PIN_FORCES)
    assert solution.torque is not None
    for name, error, size in (
        ("torque_error", errors["torque"], abs(solution.torque[0])),
        ("force_error", force, strongest),
    ):
        bar = float(getattr(solution, name)[0])
        tally.too_small[name] = max(tally.too_small.get(name, 0.0), float(used(error, bar)))
        tally.too_large[name] = tally.too_large.get(name, 0) + (bar > TOO_LARGE * max(error, HALF_A_DIGIT * size))


def _ratio(name: str, ours: float, value: Any, sensitivity: float) -> tuple[float, float]:
    """Compute an error over what is allowed, and the error: 0 where the balls cannot tell it from the truth."""
    error = value - float(ours) if math.isfinite(ours) else math.inf
    size = abs(float(value.mid()))
    if name.startswith("theta"):
        error, size = math.remainder(float(error), 2.0 * math.pi) if math.isfinite(ours) else error, 1.0
    wrong = abs(float(error)) if value.rad() < abs(error) else 0.0
    allowed = FACTOR * EPS * (size + sensitivity)
    return float(used(wrong, allowed)), wrong


def run(family: str, samples: range, seed: int = 0, bar: int = 2) -> Tally:
    """Judge some samples of a family; each depends on the family, the seed and its number alone.

    `bar`: whose motion is commanded, as it comes out where the input is.
    """
    tally = Tally()
    for number in samples:
        rng = np.random.default_rng([seed, list(FAMILIES).index(family), number])
        scene = fed_back(FAMILIES[family](rng), bar)
        if scene is not None:
            judge(scene, tally, f"{family} {number}")
    return tally


def fed_back(scene: Scene, bar: int) -> Scene | None:
    """Command bar 2, 3 or 4 to move as it does under the scene's own command; None where that has no motion."""
    if bar == 2:
        return scene
    found = solve(scene, "acceleration")
    theta, omega, alpha, sine = commanded(found, bar)
    if found.status_code[0] != OK or abs(sine) <= NO_DIGIT_LEFT:
        return None
    numbers = {f"theta_{bar}": theta, f"omega_{bar}": omega, f"alpha_{bar}": alpha}
    return replace(scene, motion=Motion(branch=1 if sine > 0.0 else -1, **numbers))  # type: ignore[arg-type]


def commanded(found: Solution, bar: int) -> tuple[float, float, float, float]:
    """Return angle, speed and acceleration of a bar at the first position, and the sine whose sign its branch is."""
    theta, omega, alpha = (float(getattr(found, f"{name}_{bar}")[0]) for name in ("theta", "omega", "alpha"))
    first, second = {2: (3, 4), 3: (2, 4), 4: (2, 3)}[bar]
    one, other = (float(getattr(found, f"theta_{each}")[0]) for each in (first, second))
    return theta, omega, alpha, math.sin(other - one)


def _run(seed: int, bar: int, task: tuple[str, range]) -> Tally:
    return run(*task, seed, bar)


def chunks(samples: int) -> Iterator[range]:
    """Divide the sample numbers into tasks."""
    for start in range(0, samples, CHUNK):
        yield range(start, min(start + CHUNK, samples))


@click.command()
@click.option("--samples", default=FULL, show_default=True, type=click.IntRange(1), help="Samples per family.")
@click.option("--family", "families", multiple=True, type=click.Choice(list(FAMILIES)), help="Only these (repeatable).")
@click.option("--seed", default=0, show_default=True)
@click.option("--bar", default=2, show_default=True, type=click.IntRange(2, 4), help="Whose motion is commanded.")
@click.option("--jobs", default=2, show_default=True, help="Processes.")
def stability(samples: int, families: tuple[str, ...], seed: int, bar: int, jobs: int) -> int:
    """Measure the error of every output against 50-digit arithmetic, and whether the error bars hold."""
    from rich.box import HEAVY_HEAD
    from rich.console import Console
    from rich.progress import track

    chosen = families or tuple(FAMILIES)
    tasks = [(family, part) for family in chosen for part in chunks(samples)]
    results = each(partial(_run, seed, bar), tasks, jobs, seconds=None)
    tallies = {family: Tally() for family in chosen}
    for (family, _), tally in track(zip(tasks, results, strict=True), "samples", total=len(tasks)):
        tallies[family].add(tally)
    rows = []
    for name in dict.fromkeys(name for tally in tallies.values() for name in tally.worst):
        cells = [tallies[family].worst.get(name, (math.nan, ""))[0] for family in chosen]
        rows.append((name, *("-" if math.isnan(cell) else f"{cell:.3f}" + " fails" * (cell > 1.0) for cell in cells)))
    for name in ("torque_error", "force_error"):
        rows.append((f"error / {name}", *(f"{tallies[family].too_small.get(name, math.nan):.2f}" for family in chosen)))
        shares = (100.0 * tallies[family].too_large.get(name, 0) / tallies[family].samples for family in chosen)
        rows.append((f"% {name} > {TOO_LARGE:.0f} x error", *(f"{share:.2f}" for share in shares)))
    rows.append(("not assembled", *(str(tallies[family].not_assembled) for family in chosen)))
    rows.append(("no torque", *(str(tallies[family].no_torque) for family in chosen)))
    console = Console()
    title = f"largest error / (8 eps (|y| + sum |x dy/dx|)), {samples} samples each, seed {seed}"
    console.print(lined_up(("output", *chosen), rows, title=title, box=HEAVY_HEAD))
    for family, tally in tallies.items():
        for name, (ratio, sample) in tally.worst.items():
            if ratio > 1.0:
                console.print(f"{name}: {ratio:.3g} at sample {sample}")
        for line in tally.warned[:5]:
            console.print(f"{family} warned: {line}")
    for family, tally in tallies.items():
        if not tally.worst:
            console.print(f"{family}: nothing was compared")
    return HOLDS if all(tally.holds() for tally in tallies.values()) else FAILED
