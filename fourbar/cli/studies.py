"""The commands of what may vary: tolerance, extremes."""

from pathlib import Path

import click

from fourbar.cli.given import loaded, named, or_out_option, printed_to, scene_argument
from fourbar.errors import NotAssembledError


@click.command()
@scene_argument
@click.option("--samples", type=int, metavar="N", help="Linkages that are tried; left out: 8192.")
@click.option("--seed", type=int, default=0, show_default=True, metavar="S", help="Of the quasi-random samples.")
@click.option("--json", "as_json", is_flag=True, help="One object, SI, every digit.")
@click.option("-o", "--out", type=click.Path(path_type=Path), metavar="PLOT", help="Draw the bands: svg, png or pdf.")
def tolerance(scene: Path, samples: int | None, seed: int, as_json: bool, out: Path | None) -> None:
    """What the [tolerances] of a scene do to torque, pin forces and points, and which dimension does it."""
    from fourbar.show import tolerances as shown
    from fourbar.show.plot import draw_tolerances, format_of
    from fourbar.show.progress import running
    from fourbar.show.tables import under_heading
    from fourbar.studies.spread import SAMPLES, tolerances

    if out is not None:
        format_of(out)
    stated = loaded(scene)
    with named(scene), running("samples are solved") as progress:
        found = tolerances(stated, SAMPLES if samples is None else samples, seed, progress=progress)
    if (found.without == found.samples).all():
        raise NotAssembledError(f"{scene}: motion.theta_2: the linkage assembles at none of the positions")
    if out is not None:
        draw_tolerances(found, out)
    if as_json:
        printed_to(shown.json_text(found), None)
    else:
        printed_to(under_heading(stated.title, shown.heading(found), shown.table(found)), None)


@click.command()
@scene_argument
@click.option("--quantity", "quantities", multiple=True, metavar="NAME", help="torque, F12 .. F14, transmission.")
@click.option("--json", "as_json", is_flag=True, help="One object, SI and rad, every digit.")
@or_out_option
def extremes(scene: Path, quantities: tuple[str, ...], as_json: bool, out: Path | None) -> None:
    """Prove the largest and smallest torque, pin forces and transmission angle over the input's whole interval."""
    from fourbar.show import extremes as shown
    from fourbar.show.progress import running
    from fourbar.show.tables import under_heading
    from fourbar.studies.enclosure import NAMES
    from fourbar.studies.enclosure import extremes as proven

    stated = loaded(scene)
    with named(scene), running("the boxes are halved"):
        found = proven(stated, quantities or NAMES)
    if as_json:
        text = shown.json_text(stated, found)
    else:
        text = under_heading(stated.title, shown.heading(stated, found), shown.table(found))
    printed_to(text, out)
