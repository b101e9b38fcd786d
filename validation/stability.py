"""Forward error of every output of `solve` against ball arithmetic, per family of hard cases.

The error allowed is 8 eps (|y| + sum |x_i dy/dx_i|) with y the value (1 rad for angles) and x_i the
stored inputs: what a change of the inputs in their last digits does to y, and nothing more.
"""

import math
import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from typing import Any

import click
import numpy as np

from fourbar.effects import Friction, Gravity, Load, Viscous
from fourbar.linkage import MOVING_BARS, PINS, Bar, FourBar
from fourbar.motion import Motion
from fourbar.scene import Command, Scene, solve
from fourbar.solution import OK, UNITS, VECTORS
from validation.engines.energy import EnergyMethod
from validation.reference import reference

EPS = 2.0**-52
FACTOR = 8.0
"""Of eps, as the contract states it."""
TOO_SMALL, TOO_LARGE = 10.0, 100.0
"""An error bar may be this much smaller (never) and this much larger (in 99 % of the samples) than the error."""
HALF_A_DIGIT = 2.0**-53
"""Of a result: an error below that is chance, for no double need be nearer to the truth. A bar is held to be too
large against no less."""
FULL = 10_000
"""Samples per family of the full set."""
CHUNK = 250
"""Samples per task: about a second."""
FORCES = ("F12", "F32", "F43", "F14")
BY_ENERGY = "{}, by energy"
"""Outputs of the second derivation; what both are within of the truth, they agree to."""


def triangle(rng: np.random.Generator, diagonal: float, low: float, high: float) -> tuple[float, float]:
    """Lengths b, c that close over a diagonal, b/e log-uniform."""
    b = diagonal * 10.0 ** rng.uniform(low, high)
    c = abs(diagonal - b) + 2.0 * min(diagonal, b) * rng.uniform(0.02, 0.98)
    return float(b), float(c)


def dressed(rng: np.random.Generator, lengths: tuple[float, ...], spread: float = 0.0) -> Scene:
    """A scene with masses, offset centres, loads and effects at random on bars of the given lengths (d, a, b, c)."""
    d, *moving = (float(length) for length in lengths)
    size = max(d, *moving)
    bars = []
    for length in moving:
        mass = float(10.0 ** rng.uniform(-spread, spread) * rng.uniform(0.2, 5.0)) if rng.random() < 0.9 else 0.0
        centre = (length * float(rng.uniform(-0.5, 1.5)), float(rng.choice([0.0, rng.uniform(-3, 3)])))
        bars.append(Bar(length, mass, mass * length**2 * float(rng.uniform(0.0, 0.5)), centre))
    theta_1 = float(rng.choice([0.0, rng.uniform(-3.0, 3.0)]))
    loads = []
    for _ in range(rng.integers(0, 3)):
        force = (float(rng.uniform(-20, 20)), float(rng.uniform(-3, 3)))
        at = (float(rng.uniform(0, 1)) * size, float(rng.uniform(-3, 3)))
        moment = float(rng.choice([0.0, rng.uniform(-5, 5)])) * size
        loads.append(Load(int(rng.integers(2, 5)), force, at, moment, str(rng.choice(["world", "bar"]))))
    effects: list[Any] = []
    if rng.random() < 0.5:
        effects.append(Gravity())
    if rng.random() < 0.3:
        effects.append(Viscous.at(**{pin: float(rng.uniform(0, 1)) * size**2 for pin in PINS if rng.random() < 0.5}))
    if rng.random() < 0.2:
        effects.append(Friction.at(**{pin: float(rng.uniform(0, 1)) * size for pin in PINS if rng.random() < 0.5}))
    motion = Motion(
        0.0,
        float(rng.choice([-1.0, 1.0]) * 10.0 ** rng.uniform(-1, 2)),
        float(rng.choice([0.0, rng.uniform(-50, 50)])),
        branch=int(rng.choice([-1, 1])),
    )
    return Scene(
        FourBar(d, bars[0], bars[1], bars[2], theta_1),
        motion,
        int(rng.choice(MOVING_BARS)),
        tuple(loads),
        tuple(effects),
    )


def at_angle(scene: Scene, theta_2: float) -> Scene:
    """The same scene at theta_2 (rad from theta_1 on)."""
    angle = scene.linkage.ground_angle + theta_2
    return replace(scene, motion=replace(scene.motion, theta_2=angle))


def random(rng: np.random.Generator) -> Scene:
    """Lengths within a factor of ten, theta_2 anywhere it assembles."""
    while True:
        d, a = rng.uniform(0.1, 1.0, 2)
        angle = float(rng.uniform(-7.0, 7.0))
        diagonal = abs(d - a * complex(math.cos(angle), math.sin(angle)))
        b, c = rng.uniform(0.1, 1.0, 2)
        if abs(b - c) < diagonal < b + c:
            return at_angle(dressed(rng, (d, a, b, c)), angle)


def limit(rng: np.random.Generator) -> Scene:
    """Within 1e-12..1e-2 rad of a limit position of the input."""
    while True:
        d, a, b, c = rng.uniform(0.1, 1.0, 4)
        folded = bool(rng.random() < 0.5)
        cosine = (a * a + d * d - (b - c if folded else b + c) ** 2) / (2 * a * d)
        if abs(cosine) < 0.999:
            offset = 10.0 ** rng.uniform(-12, -2) * (1.0 if folded else -1.0)
            angle = float(rng.choice([-1.0, 1.0])) * (math.acos(cosine) + offset)
            return at_angle(dressed(rng, (d, a, b, c)), angle)


def change_point(rng: np.random.Generator) -> Scene:
    """Within 1e-8..1 rad of a change point: parallelograms, kites, and any s + l = p + q, some off by as little."""
    x, y = rng.uniform(0.1, 1.0, 2)
    kind = rng.integers(0, 4)
    straight = 0.0
    if kind == 0:  # parallelogram, antiparallelogram
        lengths = (x, y, x, y)
        straight = float(rng.choice([0.0, math.pi]))
    elif kind == 1:  # kite a = b, c = d
        lengths, straight = (x, y, y, x), math.pi
    elif kind == 2:  # kite a = d, b = c
        lengths, straight = (x, x, y, y), 0.0
    else:
        # multiples of 2^-20 so that d + a = b + c, or d - a = b - c, holds exactly
        d, a, b = (float(round(v * 2**20)) / 2**20 for v in sorted(rng.uniform(0.1, 1.0, 3), reverse=True))
        b = float(min(b, d + a - 0.01))
        lengths, straight = ((d, a, b, d + a - b), math.pi) if rng.random() < 0.5 else ((d, a, d - a + b, b), 0.0)
    distance = float(rng.choice([-1.0, 1.0]) * 10.0 ** rng.uniform(-8, 0))
    if rng.random() < 0.3:
        k = int(rng.integers(0, 4))
        lengths = tuple(v * (1.0 + 0.1 * distance**2) if i == k else v for i, v in enumerate(lengths))
    return at_angle(dressed(rng, lengths), straight + distance)


def ratios(rng: np.random.Generator) -> Scene:
    """Crank to ground, coupler to diagonal, and masses, each in ratios from 1e-6 to 1e6."""
    d = float(rng.uniform(0.1, 1.0))
    a = d * float(10.0 ** rng.uniform(-6, 6))
    angle = float(rng.uniform(-7.0, 7.0))
    diagonal = abs(d - a * complex(math.cos(angle), math.sin(angle)))
    b, c = triangle(rng, diagonal, -1, 1)
    return at_angle(dressed(rng, (d, a, b, c), spread=3.0), angle)


def scales(rng: np.random.Generator) -> Scene:
    """All lengths times 1e-9..1e9."""
    scene = random(rng)
    link, k = scene.linkage, float(10.0 ** rng.uniform(-9, 9))
    bars = []
    for number in MOVING_BARS:
        bar = link.bar(number)
        assert bar.inertia is not None and bar.centre is not None
        bars.append(Bar(bar.length * k, bar.mass, bar.inertia * k * k, (bar.centre[0] * k, bar.centre[1])))
    loads = tuple(replace(load, at=(load.at[0] * k, load.at[1]), moment=load.moment * k) for load in scene.loads)
    return replace(scene, linkage=FourBar(link.ground * k, bars[0], bars[1], bars[2], link.ground_angle), loads=loads)


def speeds(rng: np.random.Generator) -> Scene:
    """omega_2 up to 1e6 rad/s, alpha_2 up to 1e12 rad/s^2, and the static case."""
    scene = random(rng)
    omega = float(rng.choice([-1.0, 1.0]) * 10.0 ** rng.uniform(-3, 6)) * bool(rng.random() < 0.9)
    alpha = float(rng.choice([0.0, rng.choice([-1.0, 1.0]) * 10.0 ** rng.uniform(-3, 12)]))
    return replace(scene, motion=replace(scene.motion, omega_2=omega, alpha_2=alpha))


FAMILIES: dict[str, Callable[[np.random.Generator], Scene]] = {
    "random": random,
    "limit": limit,
    "change_point": change_point,
    "ratios": ratios,
    "scales": scales,
    "speeds": speeds,
}


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
        """One error over what is allowed."""
        self.worst[output] = max(self.worst.get(output, (0.0, "")), (ratio, sample))

    def held(self) -> bool:
        """Whether error and error bars are as promised."""
        bars = all(ratio <= TOO_SMALL for ratio in self.too_small.values())
        useful = all(count <= 0.01 * self.samples for count in self.too_large.values())
        return bars and useful and not self.warned and all(ratio <= 1.0 for ratio, _ in self.worst.values())


def components(name: str) -> list[tuple[str, Any]]:
    """The names under which the reference knows an output, and their index in its array."""
    return [(f"{name}_x", (0, 0)), (f"{name}_y", (0, 1))] if name in VECTORS else [(name, 0)]


def judge(scene: Scene, tally: Tally, sample: str) -> None:
    """Compare one position with the reference."""
    tally.samples += 1
    theta_2 = float(np.asarray(scene.motion.theta_2))
    at = Command(
        np.array([theta_2]), np.array([scene.motion.branch], np.int8), scene.motion.omega_2, scene.motion.alpha_2
    )
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        solution = solve(scene, at=at)
        witness = EnergyMethod().answer(scene, at)
    tally.warned += [f"{sample}: {warning.message}" for warning in caught]
    assert witness.assembled is not None
    exact = reference(scene, scene.motion.branch, theta_2)
    if exact is None:
        tally.not_assembled += 1
        if solution.status_code[0] == OK:
            tally.worst["assembled"] = (math.inf, sample)
        if np.isfinite(witness.quantities["torque"]).any():
            tally.worst[BY_ENERGY.format("assembled")] = (math.inf, sample)
        return
    values, sensitivity = exact
    for name, array in witness.quantities.items():
        if name in values:
            ratio, _ = _ratio(name, float(array[0]), values[name], sensitivity[name])
            tally.note(BY_ENERGY.format(name), ratio, sample)
    errors: dict[str, float] = {}
    for name in UNITS:
        array = getattr(solution, name)
        if array is None or name == "theta_2" or name.endswith("_error"):
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
    force = max(math.hypot(errors[f"{name}_x"], errors[f"{name}_y"]) for name in FORCES)
    strongest = max(math.hypot(*getattr(solution, name)[0]) for name in FORCES)
    assert solution.torque is not None
    for name, error, size in (
        ("torque_error", errors["torque"], abs(solution.torque[0])),
        ("force_error", force, strongest),
    ):
        bar = float(getattr(solution, name)[0])
        ratio = 0.0 if error == 0.0 else error / bar if bar else math.inf
        tally.too_small[name] = max(tally.too_small.get(name, 0.0), math.inf if math.isnan(ratio) else ratio)
        tally.too_large[name] = tally.too_large.get(name, 0) + (bar > TOO_LARGE * max(error, HALF_A_DIGIT * size))


def _ratio(name: str, ours: float, value: Any, sensitivity: float) -> tuple[float, float]:
    """Error over what is allowed, and the error; a number that the balls cannot tell from the truth has none."""
    error = value - float(ours) if math.isfinite(ours) else math.inf
    size = abs(float(value.mid()))
    if name.startswith("theta"):
        error, size = math.remainder(float(error), 2.0 * math.pi), 1.0
    wrong = abs(float(error)) if value.rad() < abs(error) else 0.0
    allowed = FACTOR * EPS * (size + sensitivity)
    return 0.0 if wrong == 0.0 else wrong / allowed if allowed else math.inf, wrong


def run(family: str, samples: range, seed: int = 0) -> Tally:
    """Judge some samples of a family; each depends on the family, the seed and its number alone."""
    tally = Tally()
    for number in samples:
        rng = np.random.default_rng([seed, list(FAMILIES).index(family), number])
        judge(FAMILIES[family](rng), tally, f"{family} {number}")
    return tally


def chunks(samples: int) -> Iterator[range]:
    """The sample numbers in portions of one task."""
    for start in range(0, samples, CHUNK):
        yield range(start, min(start + CHUNK, samples))


@click.command()
@click.option("--samples", default=FULL, show_default=True, type=click.IntRange(1), help="Samples per family.")
@click.option("--family", "families", multiple=True, type=click.Choice(list(FAMILIES)), help="Only these (repeatable).")
@click.option("--seed", default=0, show_default=True)
@click.option("--jobs", default=2, show_default=True, help="Processes.")
def stability(samples: int, families: tuple[str, ...], seed: int, jobs: int) -> None:
    """Error of every output against 50-digit arithmetic, and whether the error bars hold."""
    from joblib import Parallel, delayed
    from rich.console import Console
    from rich.progress import track
    from rich.table import Table

    chosen = families or tuple(FAMILIES)
    tasks = [(family, part) for family in chosen for part in chunks(samples)]
    results = Parallel(n_jobs=jobs, return_as="generator")(delayed(run)(family, part, seed) for family, part in tasks)
    tallies = {family: Tally() for family in chosen}
    for (family, _), tally in track(zip(tasks, results, strict=True), "samples", total=len(tasks)):
        tallies[family].add(tally)
    table = Table(title=f"largest error / (8 eps (|y| + sum |x dy/dx|)), {samples} samples each, seed {seed}")
    table.add_column("output")
    for family in chosen:
        table.add_column(family, justify="right")
    for name in dict.fromkeys(name for tally in tallies.values() for name in tally.worst):
        cells = [tallies[family].worst.get(name, (math.nan, ""))[0] for family in chosen]
        table.add_row(name, *(f"{cell:.3f}" + ("" if cell <= 1.0 else " fails") for cell in cells))
    for bar in ("torque_error", "force_error"):
        table.add_row(f"error / {bar}", *(f"{tallies[family].too_small.get(bar, math.nan):.2f}" for family in chosen))
        shares = (100.0 * tallies[family].too_large.get(bar, 0) / tallies[family].samples for family in chosen)
        table.add_row(f"% {bar} > {TOO_LARGE:.0f} x error", *(f"{share:.2f}" for share in shares))
    table.add_row("not assembled", *(str(tallies[family].not_assembled) for family in chosen))
    table.add_row("no torque", *(str(tallies[family].no_torque) for family in chosen))
    console = Console()
    console.print(table)
    for family, tally in tallies.items():
        for name, (ratio, sample) in tally.worst.items():
            if ratio > 1.0:
                console.print(f"{name}: {ratio:.3g} at sample {sample}")
        for line in tally.warned[:5]:
            console.print(f"{family} warned: {line}")
    if not all(tally.held() for tally in tallies.values()):
        raise SystemExit(1)
