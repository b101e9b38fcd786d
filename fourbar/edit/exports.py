"""What the workbench writes besides the scene: into one folder, under names of its own."""

import base64
from pathlib import Path

from fourbar.errors import InputError
from fourbar.scene import Scene
from fourbar.solution import Conversion, write_csv
from fourbar.solve import find_last_stage, solve
from fourbar.writing import write_text

ENDINGS = {**{kind: kind for kind in ("svg", "png", "pdf", "csv")}, "mjcf": "xml", "page": "html"}
"""Of the file, by the name of the format."""


class Exports:
    """The folder that exports go to; made when there is something for it."""

    def __init__(self, folder: Path, stem: str) -> None:
        self.folder, self.stem = folder, stem

    def write(self, scene: Scene, name: str, units: Conversion) -> Path:
        """Write one export and return its path; InputError for an unknown format."""
        from fourbar.mjcf import write_mjcf_for
        from fourbar.show.animate import write
        from fourbar.show.plot import draw

        if name not in ENDINGS:
            raise InputError("format", name, "must be one of " + ", ".join(ENDINGS))
        self.folder.mkdir(exist_ok=True)
        path = self.folder / f"{self.stem}.{ENDINGS[name]}"
        if name == "csv":
            write_text(path, write_csv(solve(scene, find_last_stage(scene)), units))
        elif name == "mjcf":  # which has units of its own
            write_text(path, write_mjcf_for(scene))
        elif name == "page":
            write(scene, path, units=units)
        else:
            draw(scene, path, units=units)
        return path

    @staticmethod
    def free_bodies(scene: Scene, position: float, units: Conversion) -> str:
        """Draw the free bodies at a position, as the address of a picture."""
        from fourbar.show.plot.figures import draw_figure

        text = draw_figure(scene, "freebody", position=position, units=units)._repr_svg_()
        return "data:image/svg+xml;base64," + base64.b64encode(text.encode()).decode("ascii")
