"""The commands about a linkage at rest, and in place of its loop: equilibrium, ratio."""

from pathlib import Path

import click

from fourbar.cli.given import opened, or_out_option, printed_to, scene_argument


@click.command()
@scene_argument
@click.option("--json", "as_json", is_flag=True, help="One object, SI and rad, every digit.")
@or_out_option
def equilibrium(scene: Path, as_json: bool, out: Path | None) -> None:
    """Find where a linkage stays by itself, stable or not, how fast it swings there, and what holds it elsewhere."""
    from fourbar.show import equilibrium as shown
    from fourbar.studies.equilibrium import equilibrium as found

    with opened(scene) as described:
        result = found(described)
    printed_to((shown.json_text if as_json else shown.printed)(described.title, result), out)
