"""`cost --mimic`: what is lost where a mimic joint takes the place of the loop, simulated side by side."""

import math
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import click
import numpy as np

from fourbar.errors import InputError
from fourbar.files import load
from fourbar.mjcf import replace_loop, write_mjcf
from fourbar.quantities import PIN_FORCES
from fourbar.scene import Scene
from fourbar.studies.ratio import ratio
from fourbar.writing import write_text
from fourbar_validation.compare.tolerance import magnitude, wrap_angle
from fourbar_validation.engines.free_body import FreeBody
from fourbar_validation.places import MODELS, PROGRAM
from fourbar_validation.report.machine import describe_setup
from fourbar_validation.report.templating import render
from fourbar_validation.report.terminal import make_table

SCENES = ("crank_rocker", "drag_link", "double_rocker", "gallery/bonnet_hinge", "gallery/landing_gear")
"""Of models/, where none are named: a crank that turns fully, and ranges of 50 to 90 degrees."""
PARTS = ("torque", *PIN_FORCES)
HEADS = ("scene", "model", "theta_4 (deg)", *PARTS, "gap at B (mm)")


class Lost(NamedTuple):
    """Greatest errors of one model against the free bodies at the motion that happened."""

    model: str
    angle: float
    """Of theta_4, rad."""
    parts: dict[str, float]
    """Of the torque and of each pin force that there is, by its largest value in the range."""
    gap: float
    """Between the ends of bars 3 and 4, m."""


def simulate_lost(scene: Scene) -> list[Lost]:
    """Simulate the loop, and what follows by polynomials of degree 4 and 1, over the range of a scene."""
    if not scene.motion.omega_2:
        raise InputError("motion.omega_2", scene.motion.omega_2, "is needed, not zero: the models are driven")
    scene = replace(scene, drive_bar=2, drive=None)
    gear, written = ratio(scene), write_mjcf(scene)
    low, high = float(gear.theta_2[0]), float(gear.theta_2[-1])
    models = {"the loop": written}
    for fit in (gear.fits[-1], gear.fits[0]):
        text = replace_loop(written, scene, fit.about, fit.joint_A, fit.theta_4)
        models[f"mimic joint, degree {fit.degree}"] = text
    return [_compare(name, text, scene, (low, high)) for name, text in models.items()]


def _compare(name: str, model: str, scene: Scene, ends: tuple[float, float]) -> Lost:
    from fourbar_validation.engines.mujoco.mimic import step_through

    at, read = step_through(model, scene, *ends)
    answer = FreeBody().answer(scene, at).quantities
    parts = {
        each: float(magnitude(read[each] - answer[each]).max() / magnitude(answer[each]).max())
        for each in PARTS
        if each in read
    }
    angle = float(np.abs(wrap_angle(read["theta_4"] - answer["theta_4"])).max())
    return Lost(name, angle, parts, float(read["gap"].max()))


def write_row(scene: str, of: Lost) -> list[str]:
    """Write one row of the table."""
    shares = [f"{_write_short(100.0 * of.parts[each])} %" if each in of.parts else "none" for each in PARTS]
    return [scene, of.model, _write_short(math.degrees(of.angle)), *shares, _write_short(1e3 * of.gap)]


def _write_short(number: float) -> str:
    return f"{number:.0f}" if number >= 10.0 else f"{number:.2g}"


@click.command(name="cost --mimic")
@click.argument("scenes", nargs=-1, type=click.Path(path_type=Path))
@click.option("-o", "--out", type=click.Path(path_type=Path, dir_okay=False), help="Write the page as Markdown too.")
def command(scenes: tuple[Path, ...], out: Path | None) -> int:
    """Simulate the loop and a mimic joint in its place, and compare both with the free bodies; a minute."""
    from rich.console import Console

    rows = []
    for file in scenes or tuple(MODELS / f"{name}.toml" for name in SCENES):
        try:
            rows += [write_row(file.stem, each) for each in simulate_lost(load(file))]
        except InputError as error:
            raise error if error.file else error.in_file(str(file)) from None
    Console().print(make_table(HEADS, rows))
    if out is not None:
        what = {"head": HEADS, "rows": rows, "program": PROGRAM, "setup": describe_setup()}
        write_text(out, render("fourbar_validation.lab", "mimic.md.j2", **what))
        click.echo(f"written to {out}")
    return 0
