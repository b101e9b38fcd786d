"""The command that opens the workbench."""

from itertools import chain, count
from pathlib import Path

import click

from fourbar.cli.given import FILE
from fourbar.errors import DependencyError, say_install


@click.command()
@click.argument("scene", type=FILE, required=False)
@click.option("--port", type=click.IntRange(0, 65535), default=0, help="Of this machine; left out: any that is free.")
@click.option("--exports", type=FILE, metavar="FOLDER", help="For exports and reports; left out: SCENE_exports.")
@click.option("--no-browser", is_flag=True, help="Print the address only.")
def edit(scene: Path | None, port: int, exports: Path | None, no_browser: bool) -> None:
    """Change a scene in the browser, and see torque and forces follow; without SCENE a new one.

    Ctrl-C ends it, and so does a minute and a half without a page.
    """
    from fourbar.writing import require_file

    if scene is None:
        names = (Path(f"linkage{number}.toml") for number in chain([""], count(2)))
        scene = next(path for path in names if not path.exists())
    require_file(scene)
    try:
        from fourbar.edit.server import edit as opened_there
    except ModuleNotFoundError as error:
        raise DependencyError(f"{error.name} is not installed: {say_install('edit')}") from None
    opened_there(scene, exports or scene.with_name(f"{scene.stem}_exports"), port, browse=not no_browser)
