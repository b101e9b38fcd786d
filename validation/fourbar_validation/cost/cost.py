"""`python -m validation cost`: the study of scenes, its table, its laws and its pictures."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path

import click

from fourbar.errors import FAILED, HOLDS
from fourbar.scene import Scene
from fourbar.scene import command as command_of
from fourbar.writing import write_text
from fourbar_validation.advise.matters import (
    MATTERS,
    measure_influences,
    write_sentence,
)
from fourbar_validation.compare.rows import write_csv
from fourbar_validation.cost.laws import (
    ErrorLaw,
    find_pareto,
    fit_laws,
    list_warnings,
    write_laws,
)
from fourbar_validation.cost.series import BEST
from fourbar_validation.cost.study import COLUMNS, STEPPED, CostPoint, CostStudy
from fourbar_validation.engines.mujoco.trial import TrialSetup
from fourbar_validation.places import MODELS
from fourbar_validation.report.machine import describe_setup
from fourbar_validation.report.templating import render
from fourbar_validation.report.terminal import make_table
from fourbar_validation.scenes.suites import read_scene_files

DEFAULT_SCENES = (MODELS / "crank_rocker.toml",)
WANTED = (1e-3, 1e-6)
"""Errors whose price the table of several scenes has."""
HEAD = ("setting", "error", "RK4 steps", "ms/turn", "+-")


@click.command(name="cost")
@click.argument("scenes", nargs=-1, type=click.Path(path_type=Path))
@click.option(
    "-o",
    "--out",
    type=click.Path(path_type=Path, file_okay=False),
    default=Path("results/cost"),
    show_default=True,
)
def cost(scenes: tuple[Path, ...], out: Path) -> int:
    """Measure what accuracy costs in time: every method, on SCENES (default: the crank-rocker).

    An interrupted study is resumed where it stopped. Exit status 1 where the law of any quantity does not hold, or
    none is decided.
    """
    from rich.console import Console
    from rich.progress import track

    files = read_scene_files(scenes or DEFAULT_SCENES)
    fitted: list[ErrorLaw] = []
    rows: list[tuple[str, ...]] = []
    for index in range(len(files)):
        name, scene = files.name(index), files.scene(index)
        setup = TrialSetup(scene, command_of(scene))
        study = CostStudy(name, scene, out / name)
        curves = dict(
            track(study.points(), name, total=len(study), console=Console(stderr=True))
        )
        laws = fit_laws(curves)
        ranked = measure_influences(scene, setup, BEST)
        fitted += [law for law in laws if law.decided]
        written = write(study, curves, laws, scene.title or name)
        Console().print(
            make_table(HEAD, list_front(curves), title=f"{name}: what accuracy costs")
        )
        lines = [
            *write_laws(laws),
            *(f"warning: {line}" for line in list_warnings(curves)),
        ]
        lines += [
            *(f"left out: {line}" for line in study.left_out),
            write_sentence(ranked),
        ]
        click.echo("\n".join(lines))
        held = sum(law.holds for law in laws if law.decided)
        most = ranked[0].setting if ranked[0].times >= MATTERS else "none by itself"
        rows.append(
            (
                name,
                *find_cheapest(curves),
                f"{held} of {sum(law.decided for law in laws)}",
                most,
            )
        )
        click.echo(
            f"Written to {out / name}: {', '.join(sorted(path.name for path in written))}."
        )
    if len(rows) > 1:
        head = (
            "scene",
            *(f"RK4 steps for {error:g}" for error in WANTED),
            "laws hold",
            "matters most",
        )
        Console().print(make_table(head, rows, show_edge=False))
    if not fitted:
        click.echo("Nothing was compared: no law has points enough for a fit.")
    return HOLDS if fitted and all(law.holds for law in fitted) else FAILED


def write(
    study: CostStudy,
    curves: Mapping[str, Sequence[CostPoint]],
    laws: Sequence[ErrorLaw],
    title: str,
) -> list[Path]:
    """Write cost.csv, cost.md and the pictures."""
    from fourbar_validation.cost.pictures import draw

    pictures = draw(curves, write_subtitle(study.scene, title), study.folder)
    what = {
        "title": title,
        "setup": describe_setup(),
        "pictures": [path.stem for path in pictures if path.suffix == ".svg"],
        "laws": write_laws(laws),
        "head": HEAD,
        "front": list_front(curves),
        "warnings": list_warnings(curves),
        "left_out": study.left_out,
    }
    texts = {
        "cost.csv": write_csv(
            COLUMNS, (asdict(p).values() for points in curves.values() for p in points)
        )
    }
    texts["cost.md"] = render("fourbar_validation.cost", "cost.md.j2", **what)
    for name, text in texts.items():
        write_text(study.folder / name, text)
    return [*(study.folder / name for name in texts), *pictures]


def write_subtitle(scene: Scene, title: str) -> str:
    """Describe what was run, in one line under the statement of a picture."""
    acting = [type(effect).__name__.lower() for effect in scene.effects]
    acting += ["loads"] if scene.loads else []
    omega = "" if scene.motion.omega_2 is None else f", {scene.motion.omega_2:g} rad/s"
    return f"{title}{omega}{', ' + ' and '.join(acting) if acting else ''}"


def find_cheapest(curves: Mapping[str, Sequence[CostPoint]]) -> list[str]:
    """Find the least work of a revolution, in RK4 steps, for each of WANTED; a dash where nothing reaches it."""
    points = [
        p
        for name, row in curves.items()
        if "slow" not in name
        for p in row
        if p.kind == STEPPED
    ]
    work = ([p.rk4_steps for p in points if p.worst <= error] for error in WANTED)
    return [f"{min(steps):.0f}" if steps else "-" for steps in work]


def list_front(curves: Mapping[str, Sequence[CostPoint]]) -> list[tuple[str, ...]]:
    """List the Pareto front of everything stepped, by the worse of torque and force, under HEAD."""
    points = [
        p
        for name, row in curves.items()
        if "slow" not in name
        for p in row
        if p.kind == STEPPED
    ]
    rows: list[tuple[str, ...]] = []
    for p in find_pareto(points, "worst"):
        scatter = (
            "-" if math.isnan(p.scatter) else f"{100.0 * p.scatter:.0f} %"
        )  # a dash where there was one timing
        of_work = f"{p.rk4_steps:.0f}", f"{1e3 * p.seconds_per_revolution:.2f}", scatter
        rows.append((f"{p.curve}: {p.setting}", f"{p.worst:.0e}", *of_work))
    return rows
