"""`fourbar-validation cost`: the study of scenes, its table, laws and pictures."""

from collections.abc import Sequence
from itertools import chain
from pathlib import Path

import click

from fourbar.errors import FAILED, HOLDS
from fourbar.scene import Scene
from fourbar.writing import write_text
from fourbar_validation.advise.matters import measure_influences
from fourbar_validation.compare.rows import write_csv_rows
from fourbar_validation.cost.laws import (
    Curves,
    ErrorLaw,
    conclude,
    find_pareto,
    fit_laws,
    list_stepped,
    write_laws,
)
from fourbar_validation.cost.work_precision import (
    BEST,
    COST_COLUMNS,
    CostStudy,
    list_cells,
)
from fourbar_validation.engines.mujoco.trial import JudgedSetup
from fourbar_validation.places import MODELS
from fourbar_validation.report.machine import describe_setup
from fourbar_validation.report.sentences import make_words_table, print_sentence
from fourbar_validation.report.templating import render
from fourbar_validation.scenes.suites import read_scene_files

COST_HEADINGS = ("setting", "error", "ms per simulated second", "ms a revolution")


@click.command(name="cost")
@click.argument("scenes", nargs=-1, type=click.Path(path_type=Path))
@click.option(
    "-o",
    "--out",
    type=click.Path(path_type=Path, file_okay=False),
    default=Path("results/cost"),
    show_default=True,
)
@click.option(
    "--verbose",
    is_flag=True,
    help="Print the cheapest settings of every error and the laws too.",
)
def cost(
    scenes: tuple[Path, ...],
    out: Path,
    verbose: bool,
) -> int:
    """Measure what accuracy costs in time.

    Every method is measured on SCENES (default: the crank-rocker). An interrupted study
    is resumed where it stopped. Exit status 1 where the law of any quantity does not
    hold, or none is decided.
    """
    from rich.console import Console
    from rich.progress import track

    files = read_scene_files(scenes or (MODELS / "crank_rocker.toml",))
    fitted: list[ErrorLaw] = []
    for index in range(len(files)):
        name = files.name(index)
        scene = files.scene(index)
        setup = JudgedSetup(scene)
        study = CostStudy(name, scene, out / name)
        curves = dict(
            track(
                study.points(),
                name,
                total=len(study),
                console=Console(stderr=True),
                transient=True,
            )
        )
        laws = fit_laws(curves)
        decided = [law for law in laws if law.decided]
        influences = measure_influences(scene, setup, BEST)
        conclusion = conclude(curves, laws, influences)
        subtitle = write_subtitle(scene, scene.title or name)
        write_cost(study, curves, laws, scene.title or name, conclusion)
        for sentence in (subtitle, *conclusion):
            print_sentence(sentence)
        if verbose:
            Console().print(make_words_table(COST_HEADINGS, list_front(curves)))
            for line in write_laws(laws):
                print_sentence(line)
            for line in study.left_out:
                print_sentence(f"left out: {line}")
        click.echo(f"Pictures, laws and every point: {out / name / 'cost.md'}")
        fitted += decided
    if not fitted:
        print_sentence("Nothing was compared: no law has points enough for a fit.")
    return HOLDS if fitted and all(law.holds for law in fitted) else FAILED


def write_cost(
    study: CostStudy,
    curves: Curves,
    laws: Sequence[ErrorLaw],
    title: str,
    conclusion: Sequence[str],
) -> list[Path]:
    """Write cost.csv, cost.md and the pictures."""
    from fourbar_validation.cost.charts import draw_pictures

    pictures = draw_pictures(curves, write_subtitle(study.scene, title), study.folder)
    what = {
        "title": title,
        "conclusion": conclusion,
        "setup": describe_setup(),
        "pictures": [path.stem for path in pictures],
        "laws": write_laws(laws),
        "head": COST_HEADINGS,
        "front": list_front(curves),
        "left_out": study.left_out,
    }
    rows = map(list_cells, chain.from_iterable(curves.values()))
    texts = {
        "cost.csv": write_csv_rows(COST_COLUMNS, rows),
        "cost.md": render("fourbar_validation.cost", "cost.md.j2", **what),
    }
    for name, text in texts.items():
        write_text(study.folder / name, text)
    return [*(study.folder / name for name in texts), *pictures]


def write_subtitle(scene: Scene, title: str) -> str:
    """Describe what was run, in one line under the statement of a picture."""
    acting = [type(effect).__name__.lower() for effect in scene.effects]
    acting += ["loads"] * bool(scene.loads)
    parts = [title]
    if scene.motion.omega_2 is not None:
        parts.append(f"{scene.motion.omega_2:g} rad/s")
    if acting:
        parts.append(" and ".join(acting))
    return ", ".join(parts)


def list_front(curves: Curves) -> list[tuple[str, ...]]:
    """List the Pareto front of everything stepped, under COST_HEADINGS.

    The error is the worse of torque and force.
    """
    return [
        (
            point.name,
            f"{point.errors.worst:.0e}",
            f"{1e3 * point.seconds_per_second:.2f}",
            f"{1e3 * point.seconds_per_revolution:.2f}",
        )
        for point in find_pareto(list_stepped(curves), "worst")
    ]
