"""The commands that write a scene for simulators: mjcf, sdf, usd."""

from pathlib import Path

import click

from fourbar.cli.given import lengths_of, loaded, named, number_of, out_option, scene_argument


@click.command()
@click.argument("scene", type=click.Path(path_type=Path), required=False)
@click.option("--lengths", nargs=4, metavar="D A B C", help="Ground, input, coupler, output (bare numbers: m).")
@click.option("--omega", metavar="W", help="Speed of the input with --lengths (a bare number: rad/s).")
@click.option(
    "--for",
    "simulator",
    type=click.Choice(["mujoco", "warp", "mjx", "genesis", "newton"]),
    default="mujoco",
    show_default=True,
    help="What loads it: settings that suit it, and where its numbers stand.",
)
@out_option
def mjcf(scene: Path | None, lengths: tuple[str, ...] | None, omega: str | None, simulator: str, out: Path) -> None:
    """Write a scene, or a linkage of uniform bars, as MJCF that runs on its own in MuJoCo and its kin."""
    from fourbar import mjcf as writer
    from fourbar.writing import write_text

    if (scene is None) == (lengths is None):
        raise click.UsageError("give a scene file or --lengths D A B C, one of the two")
    if scene is not None:
        if omega is not None:
            raise click.UsageError("--omega goes with --lengths; a scene states its own omega_2")
        with named(scene):
            text = writer.mjcf_for(loaded(scene), simulator)
        write_text(out, text)
        return
    assert lengths is not None
    speed = {} if omega is None else {"omega": number_of("--omega", omega, "rad/s")}
    made = writer.scene_from_lengths(*lengths_of(lengths), **speed)
    write_text(out, writer.mjcf_for(made, simulator))
    for line in writer.defaults_used(made):
        click.echo(line)


@click.command()
@scene_argument
@click.option("--for", "reader", type=click.Choice(["gazebo", "drake"]), default="gazebo", show_default=True)
@out_option
def sdf(scene: Path, reader: str, out: Path) -> None:
    """Write a scene as SDF, the loop closed by a fourth joint (Gazebo) or a ball constraint (Drake)."""
    from fourbar.mjcf.sdf import sdf as written
    from fourbar.writing import write_text

    with named(scene):
        text = written(loaded(scene), reader)
    write_text(out, text)


@click.command()
@scene_argument
@out_option
def usd(scene: Path, out: Path) -> None:
    """Write a scene as USD text (.usda) for Newton, the loop closed by a fourth revolute joint."""
    from fourbar.mjcf.usd import usd as written
    from fourbar.writing import write_text

    with named(scene):
        text = written(loaded(scene))
    write_text(out, text)
