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
from fourbar_validation.advise.matters import MATTERS, measure_influences, write_sentence
from fourbar_validation.advise.worst_errors import QUANTITIES
from fourbar_validation.compare.rows import write_csv
from fourbar_validation.engines.mujoco.trial import TrialSetup
from fourbar_validation.lab.cost.laws import ErrorLaw, find_pareto, fit_laws, list_warnings, write_laws
from fourbar_validation.lab.cost.series import BEST
from fourbar_validation.lab.cost.study import COLUMNS, STEPPED, CostPoint, CostStudy
from fourbar_validation.places import MODELS
from fourbar_validation.report.machine import list_versions, name_machine
from fourbar_validation.report.terminal import make_table
from fourbar_validation.scenes.suites import read_scene_files

DEFAULT_SCENES = (MODELS / "crank_rocker.toml",)
WANTED = (1e-3, 1e-6)
"""Errors whose price the table of several scenes has."""
ORDERS = "Errors are the worst over the scene's positions, each on its scale, against the formulas at the motion made."


@click.command(name="cost")
@click.argument("scenes", nargs=-1, type=click.Path(path_type=Path))
@click.option(
    "-o", "--out", type=click.Path(path_type=Path, file_okay=False), default=Path("results/cost"), show_default=True
)
def cost(scenes: tuple[Path, ...], out: Path) -> int:
    """Measure what accuracy costs in time: every method, on SCENES (default: the crank-rocker).

    An interrupted study is resumed where it stopped. Exit status 1 where the law of any quantity does not hold, or
    none is decided.
    """
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    files = read_scene_files(scenes or DEFAULT_SCENES)
    fitted: list[ErrorLaw] = []
    rows: list[tuple[str, ...]] = []
    for index in range(len(files)):
        name, scene = files.name(index), files.scene(index)
        setup = TrialSetup(scene, command_of(scene))
        study = CostStudy(name, scene, out / name)
        columns = (
            TextColumn(name),
            BarColumn(),
            MofNCompleteColumn(),
            TextColumn("{task.description}"),
            TimeRemainingColumn(),
        )
        curves: dict[str, list[CostPoint]] = {}
        with Progress(*columns, console=Console(stderr=True)) as progress:
            task = progress.add_task("", total=len(study))
            for curve, points in study.points():
                curves[curve] = points
                progress.update(task, advance=1, description=curve)
        result = fit_laws(curves)
        ranked = measure_influences(scene, setup, BEST)
        fitted += [law for law in result if law.decided]
        written = write(study, curves, result, scene.title or name)
        click.echo(write_summary(name, curves, result, study.left_out))
        click.echo(write_sentence(ranked))
        held = sum(law.holds for law in result if law.decided)
        most = ranked[0].setting if ranked[0].times >= MATTERS else "none by itself"
        rows.append((name, *find_cheapest(curves), f"{held} of {sum(law.decided for law in result)}", most))
        click.echo(f"written to {out / name}: {', '.join(sorted(path.name for path in written))}")
    if len(rows) > 1:
        head = ("scene", *(f"RK4 steps for {error:g}" for error in WANTED), "laws hold", "matters most")
        Console().print(make_table(head, rows, show_edge=False))
    if not fitted:
        click.echo("Nothing was compared: no law has points enough for a fit")
    return HOLDS if fitted and all(law.holds for law in fitted) else FAILED


def write(
    study: CostStudy, curves: Mapping[str, Sequence[CostPoint]], found: Sequence[ErrorLaw], title: str
) -> list[Path]:
    """Write cost.csv, cost.md and the pictures."""
    from fourbar_validation.lab.cost.pictures import draw

    folder = study.folder
    paths = [folder / "cost.csv", folder / "cost.md"]
    write_text(paths[0], write_points(curves))
    pictures = draw(curves, write_subtitle(study.scene, title), folder)
    write_text(paths[1], write_report(title, curves, found, study.left_out, pictures))
    return [*paths, *pictures]


def write_subtitle(scene: Scene, title: str) -> str:
    """Describe what was run, in one line under the statement of a picture."""
    acting = [type(effect).__name__.lower() for effect in scene.effects]
    acting += ["loads"] if scene.loads else []
    omega = "" if scene.motion.omega_2 is None else f", {scene.motion.omega_2:g} rad/s"
    return f"{title}{omega}{', ' + ' and '.join(acting) if acting else ''}"


def write_points(curves: Mapping[str, Sequence[CostPoint]]) -> str:
    """Write one row per point, floats as repr."""
    return write_csv(COLUMNS, (asdict(point).values() for points in curves.values() for point in points))


def write_summary(
    name: str, curves: Mapping[str, Sequence[CostPoint]], found: Sequence[ErrorLaw], left_out: Sequence[str]
) -> str:
    """Summarise the study for the terminal."""
    text = [f"{name}: what accuracy costs", "", *list_front(curves), "", *write_laws(found), ""]
    text += [f"warning: {line}" for line in list_warnings(curves)]
    return "\n".join((*text, *(f"left out: {line}" for line in left_out)))


def find_cheapest(curves: Mapping[str, Sequence[CostPoint]]) -> list[str]:
    """Find the least work of a revolution, in RK4 steps, for each of WANTED; a dash where nothing reaches it."""
    points = [p for name, row in curves.items() if "slow" not in name for p in row if p.kind == STEPPED]
    work = ([p.rk4_steps for p in points if p.worst <= error] for error in WANTED)
    return [f"{min(steps):.0f}" if steps else "-" for steps in work]


def list_front(curves: Mapping[str, Sequence[CostPoint]]) -> list[str]:
    """List the Pareto front of everything stepped, by the worse of torque and force."""
    points = [p for name, row in curves.items() if "slow" not in name for p in row if p.kind == STEPPED]
    head = f"{'error':>8} {'RK4 steps':>10} {'ms/turn':>8} {'+-':>5}  setting"
    front = find_pareto(points, "worst")
    rows = [
        f"{p.worst:8.0e} {p.rk4_steps:10.0f} {1e3 * p.seconds_per_revolution:8.2f} {write_percent(p.scatter):>5}  "
        f"{p.curve}: {p.setting}"
        for p in front
    ]
    return [head, *rows]


def write_percent(scatter: float) -> str:
    """Format the scatter of timings; a dash where there was one."""
    return "-" if math.isnan(scatter) else f"{100.0 * scatter:.0f} %"


def write_report(
    title: str,
    curves: Mapping[str, Sequence[CostPoint]],
    found: Sequence[ErrorLaw],
    left_out: Sequence[str],
    pictures: Sequence[Path],
) -> str:
    """Write the study as Markdown."""
    about = ", ".join(f"{name} {version}" for name, version in list_versions().items())
    text = [f"# What accuracy costs: {title}", "", f"{name_machine()}; {about}. {ORDERS}", ""]
    text += [f"![{path.stem}]({path.name})" for path in pictures if path.suffix == ".svg"]
    text += ["", "## Laws", "", *(f"- {law}" for law in write_laws(found))]
    text += ["", "## Cheapest for each error", "", "```", *list_front(curves), "```"]
    text += ["", "## Where an error jumps, and where more steps buy nothing", ""]
    text += [f"- {line}" for line in list_warnings(curves) or ["none"]]
    text += [
        "",
        "## All points",
        "",
        f"| setting | {' | '.join(QUANTITIES)} | steps/turn | ms/turn | +- | us/sample | RK4 steps |",
        "|---|---|---|---|---|---|---|---|---|---|---|",
    ]
    for name, points in curves.items():
        for p in points:
            text.append(
                f"| {name}: {p.setting} | {' | '.join(f'{getattr(p, q):.1e}' for q in QUANTITIES)} "
                f"| {p.steps_per_revolution:.0f} "
                f"| {1e3 * p.seconds_per_revolution:.3g} | {write_percent(p.scatter)} "
                f"| {1e6 * p.seconds_per_sample:.3g} | {p.rk4_steps:.0f} |"
            )
    if left_out:
        text += ["", "## Left out", "", *(f"- {line}" for line in left_out)]
    return "\n".join(text) + "\n"
