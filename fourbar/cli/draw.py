"""The commands that draw: plot, animate."""

from pathlib import Path

import click

from fourbar.cli.given import angle_of, loaded, named, out_option, scene_argument, units_option, waiting
from fourbar.errors import InputError


@click.command()
@scene_argument
@out_option
@click.option(
    "--figure",
    default="overview",
    show_default=True,
    metavar="NAME",
    help="overview, linkage, coupler, kinematics, points, torque, forces, hodograph, energy, transmission, freebody, "
    "sensitivity.",
)
@click.option("--position", metavar="ANGLE", help='theta_2 of the linkage and free bodies, like "135 deg".')
@click.option("--branches", default="one", show_default=True, metavar="WHICH", help="one or both.")
@click.option("--dimensions", is_flag=True, help="Write the lengths of the bars at them.")
@units_option
def plot(
    scene: Path, out: Path, figure: str, position: str | None, branches: str, dimensions: bool, units: str
) -> None:
    """Draw a scene as SVG, PNG or PDF (by the ending of FILE)."""
    from fourbar.show.plot import draw
    from fourbar.show.units import units as units_of

    at = None if position is None else angle_of("--position", position)
    described = loaded(scene)
    with named(scene), waiting(described):
        draw(described, out, figure, position=at, branches=branches, units=units_of(units), dimensions=dimensions)


@click.command()
@scene_argument
@out_option
@click.option(
    "--picture",
    "pictures",
    multiple=True,
    metavar="BAR=FILE",
    help="A PNG or JPEG laid along input, coupler or output (pages).",
)
@click.option(
    "--seconds",
    type=click.FloatRange(min=0.1, max=60.0),
    help="Length of a film; left out: 6, of a motion through time its own.",
)
@click.option("--vectors", is_flag=True, help="With arrows of velocity and acceleration at the points.")
@units_option
def animate(
    scene: Path, out: Path, pictures: tuple[str, ...], seconds: float | None, vectors: bool, units: str
) -> None:
    """Show a scene moving: one web page (.html), or a film (.gif, .mp4)."""
    from fourbar.show.animate import write
    from fourbar.show.units import units as units_of

    attached = {}
    for entry in pictures:
        bar, equals, file = entry.partition("=")
        if not equals:
            raise InputError("--picture", entry, "must be like coupler=FILE")
        attached[bar] = file
    described = loaded(scene)
    with named(scene), waiting(described):
        write(described, out, pictures=attached, seconds=seconds, units=units_of(units), vectors=vectors)
