"""What the workbench writes besides the scene: into one folder, under names of its own."""

import base64
from collections.abc import Callable
from pathlib import Path

from fourbar.errors import InputError
from fourbar.scene import Scene
from fourbar.solution import Conversion, write_csv
from fourbar.solve import find_last_stage, solve
from fourbar.writing import write_text


def _export_picture(scene: Scene, path: Path, units: Conversion) -> None:
    from fourbar.show.plot import draw

    draw(scene, path, units=units)


def _export_csv(scene: Scene, path: Path, units: Conversion) -> None:
    write_text(path, write_csv(solve(scene, find_last_stage(scene)), units))


def _export_mjcf(scene: Scene, path: Path, units: Conversion) -> None:
    from fourbar.mjcf import write_mjcf_for

    del units  # a model has its own
    write_text(path, write_mjcf_for(scene, "mujoco"))


def _export_page(scene: Scene, path: Path, units: Conversion) -> None:
    from fourbar.show.animate import write

    write(scene, path, units=units)


FORMATS: dict[str, tuple[str, Callable[[Scene, Path, Conversion], None]]] = {
    **{kind: (kind, _export_picture) for kind in ("svg", "png", "pdf")},
    **{"csv": ("csv", _export_csv), "mjcf": ("xml", _export_mjcf), "page": ("html", _export_page)},
}
"""By name: the ending of the file, and what writes it."""


class Exports:
    """The folder that exports go to; made when there is something for it."""

    def __init__(self, folder: Path, stem: str) -> None:
        self.folder, self.stem = folder, stem

    def write(self, scene: Scene, name: str, units: Conversion) -> Path:
        """Write one export and return its path; InputError for an unknown format."""
        if name not in FORMATS:
            raise InputError("format", name, "must be one of " + ", ".join(FORMATS))
        ending, writer = FORMATS[name]
        self.folder.mkdir(exist_ok=True)
        path = self.folder / f"{self.stem}.{ending}"
        writer(scene, path, units)
        return path

    @staticmethod
    def free_bodies(scene: Scene, position: float, units: Conversion) -> str:
        """Draw the free bodies at a position, as the address of a picture."""
        from fourbar.show.plot.figures import draw_figure

        text = draw_figure(scene, "freebody", position=position, units=units)._repr_svg_()
        return "data:image/svg+xml;base64," + base64.b64encode(text.encode()).decode("ascii")
