"""What each effect costs in each engine, in instructions: valgrind, of the work alone.

Wall clock on a busy machine scatters by a third; instructions repeat to some 0.01 % where hashing
and addresses are fixed (PYTHONHASHSEED, setarch -R) and one thread runs.
"""

from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import click

from fourbar.errors import DependencyError, InputError
from fourbar.writing import write_text
from fourbar_validation.engines.witnesses import not_installed
from fourbar_validation.lab.effects.counted import AMOUNTS, available, counts
from fourbar_validation.lab.effects.work import DEFAULT_FLAGS, EFFECTS, ENGINES, flags

NO_COUNTERPART = {("mujoco-simulated", "pin_friction"), ("mujoco-simulated", "load over theta_2")}


def pairs(engines: tuple[str, ...], effects: tuple[str, ...]) -> list[tuple[str, str]]:
    """Every engine with every effect that it has; of the simulation each flag that the bare scene switches off too."""
    found = [(engine, effect) for engine in engines for effect in effects if (engine, effect) not in NO_COUNTERPART]
    if "mujoco-simulated" in engines:
        found += [("mujoco-simulated", name) for name in (DEFAULT_FLAGS, *flags())]
    return found


def costs(work: list[tuple[str, str]], workers: int) -> dict[tuple[str, str], float]:
    """Instructions of each; one process for each engine."""
    engines = list(dict.fromkeys(engine for engine, _ in work))
    effects = [[effect for engine, effect in work if engine == each] for each in engines]
    with ThreadPoolExecutor(workers) as pool:
        found = pool.map(counts, engines, effects)
    return {(engine, name): n for engine, of in zip(engines, found, strict=True) for name, n in of.items()}


@click.command(name="effects-cost")
@click.option("--engines", metavar="NAMES", default=",".join(AMOUNTS), show_default=True, help="Comma-separated.")
@click.option("--effects", metavar="NAMES", help="Comma-separated; left out: all.")
@click.option("--workers", type=click.IntRange(min=1), default=2, show_default=True, help="Counts at the same time.")
@click.option("-o", "--out", type=click.Path(path_type=Path, dir_okay=False), help="Write the table as Markdown too.")
@click.option("--absent", is_flag=True, help="Look instead for any trace of an effect in a build without it: none.")
def command(engines: str, effects: str | None, workers: int, out: Path | None, absent: bool) -> int:
    """Count the instructions that each effect costs in each engine (valgrind; some minutes)."""
    if absent:
        return check_absent()
    wanted = tuple(name.strip() for name in engines.split(","))
    for name in wanted:
        if name not in ENGINES:
            raise InputError("--engines", name, "must be among " + ", ".join(ENGINES))
    chosen = tuple(EFFECTS) if effects is None else tuple(dict.fromkeys(["none", *effects.split(",")]))
    for name in chosen:
        if name not in EFFECTS:
            raise InputError("--effects", name, "must be among " + ", ".join(EFFECTS))
    if not available():
        raise DependencyError("valgrind and setarch are needed to count instructions")
    for name in wanted:
        if reason := not_installed(name.partition("-")[0]) if name != "formulas" else None:
            raise DependencyError(f"{name}: {reason}")
    from rich.progress import track

    from fourbar_validation.lab.effects.table import Entry, markdown, ratio, show

    work = pairs(wanted, chosen)
    counted = costs(work, workers)
    clocked = [ratio(*pair) for pair in track(work, description="wall clock", transient=True)]  # by itself, undisturbed
    entries = [Entry(*pair, counted[pair], times) for pair, times in zip(work, clocked, strict=True)]
    show(entries)
    if out is not None:
        write_text(out, markdown(entries))
        click.echo(f"written to {out}")
    return 0


def check_absent() -> int:
    """Print what a build without each effect makes otherwise of a bare scene; 1 where it is anything."""
    from fourbar_validation.lab.effects.absent import ABSENT, compared

    failed, required = False, "no difference is"
    no_model = not_installed("mujoco")
    equal = "bits, MJCF and terms are equal" if no_model else "bits, MJCF, compiled model and terms are equal"
    if no_model:
        click.echo(f"compiled models are not compared: {no_model}")
    if not available():
        click.echo("instructions are not counted: valgrind or setarch is not installed")
    for found in compared(ABSENT):
        failed |= not found.holds
        same = "differs in " + ", ".join(found.differs) if found.differs else equal
        counted = "" if found.more is None else f"; instructions {100.0 * found.more:+.3f} %"
        click.echo(f"without {found.effect}: {same}{counted}")
        if found.more is not None:
            required = f"at most {100.0 * found.bound:.2g} %, by the noise of the whole build, and no difference are"
    click.echo(f"{'FAILS' if failed else 'holds'}: {required} required")
    return int(failed)
