"""The commands about a linkage at rest, and in place of its loop: equilibrium, ratio."""

from pathlib import Path
from typing import TYPE_CHECKING

import click

from fourbar.cli.given import open_scene, or_out_option, print_to, scene_argument

if TYPE_CHECKING:
    from fourbar.scene import Scene


@click.command()
@scene_argument
@click.option("--json", "as_json", is_flag=True, help="One object, SI and rad, every digit.")
@or_out_option
def equilibrium(scene: Path, as_json: bool, out: Path | None) -> None:
    """Find where a linkage stays by itself, stable or not, how fast it swings there, and what holds it elsewhere."""
    from fourbar.show import equilibrium as shown
    from fourbar.show.progress import show_running
    from fourbar.studies.equilibrium import equilibrium as found

    with open_scene(scene) as described, show_running("the boxes are halved"):
        result = found(described)
    print_to((shown.write_json if as_json else shown.write_tables)(described.title, result), out)


@click.command()
@scene_argument
@click.option(
    "--degree", type=int, default=4, show_default=True, metavar="N", help="Of the highest polynomial, 1 to 4."
)
@click.option("--json", "as_json", is_flag=True, help="One object, SI and rad, every digit.")
@or_out_option
def ratio(scene: Path, degree: int, as_json: bool, out: Path | None) -> None:
    """Show omega_4/omega_2, torque ratio and reflected inertia, and the polynomial of a mimic joint with its errors."""
    from fourbar.show import ratio as shown
    from fourbar.studies.ratio import ratio as found

    with open_scene(scene) as described:
        result = found(described, degree)
    print_to((shown.write_json if as_json else shown.write_tables)(described.title, result), out)


def replace_loop(model: str, scene: "Scene") -> str:
    """Give MJCF text joints that follow the input by the best polynomials that MuJoCo holds."""
    from fourbar.mjcf import replace_loop
    from fourbar.studies.ratio import ratio as found

    best = found(scene).fits[-1]
    return replace_loop(model, scene, best.about, best.joint_A, best.theta_4)
