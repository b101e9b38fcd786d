"""`python -m validation cost --effects`: what each effect costs in each engine, in time."""

from pathlib import Path

import click

from fourbar.errors import DependencyError, InputError
from fourbar.mjcf.effects import NO_MJCF
from fourbar.writing import write_text
from fourbar_validation.engines.witnesses import find_missing
from fourbar_validation.lab.effects.work import DEFAULT_FLAGS, EFFECTS, ENGINES, list_flags

NO_COUNTERPART = {("mujoco-simulated", name) for name in (*NO_MJCF, "load over theta_2")}


def list_pairs(engines: tuple[str, ...], effects: tuple[str, ...]) -> list[tuple[str, str]]:
    """Pair each engine with each effect that it has, the simulation with each flag that the bare scene switches off."""
    chosen = [(engine, effect) for engine in engines for effect in effects if (engine, effect) not in NO_COUNTERPART]
    if "mujoco-simulated" in engines:
        chosen += [("mujoco-simulated", name) for name in (DEFAULT_FLAGS, *list_flags())]
    return chosen


@click.command(name="cost --effects")
@click.option("--engines", metavar="NAMES", default=",".join(ENGINES), show_default=True, help="Comma-separated.")
@click.option("--only", "effects", metavar="NAMES", help="Comma-separated; left out: all.")
@click.option("-o", "--out", type=click.Path(path_type=Path, dir_okay=False), help="Write the table as Markdown too.")
def command(engines: str, effects: str | None, out: Path | None) -> int:
    """Time each effect in each engine, and each flag of MuJoCo; a minute."""
    wanted = tuple(name.strip() for name in engines.split(","))
    chosen = tuple(EFFECTS) if effects is None else tuple(dict.fromkeys(["none", *effects.split(",")]))
    for option, names, allowed in (("--engines", wanted, ENGINES), ("--only", chosen, EFFECTS)):
        for name in names:
            if name not in allowed:
                raise InputError(option, name, "must be among " + ", ".join(allowed))
    for name in wanted:
        if reason := find_missing(name.partition("-")[0]) if name != "formulas" else None:
            raise DependencyError(f"{name}: {reason}")
    from rich.progress import track

    from fourbar_validation.lab.effects.table import measure, show, write_markdown

    costs = [measure(*pair) for pair in track(list_pairs(wanted, chosen), description="timing", transient=True)]
    show(costs)
    if out is not None:
        write_text(out, write_markdown(costs))
        click.echo(f"written to {out}")
    return 0
