"""The moving linkage as a film: GIF through pillow, MP4 through ffmpeg."""

import math
import shutil
import subprocess
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from fourbar.errors import DependencyError, InputError
from fourbar.scene import Scene
from fourbar.show.plot.linkage_figure import draw_frame, draw_mechanism, label_plane
from fourbar.show.plot.style import TITLE, apply_style, place_legend, shorten_text
from fourbar.show.plot.view import View, make_view
from fourbar.show.shown_units import write_cell
from fourbar.show.tables import show_running
from fourbar.solution import Conversion
from fourbar.writing import write_bytes

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from PIL.Image import Image

FRAMES_PER_SECOND = 25
_STAYS = 255
"""Colour, after those of the palette, of a pixel that a frame leaves as it was."""
_MAX_FRAMES = 1500
"""Frames of a film, one minute: more take long to draw and to open."""
WINDOW_POSITIONS = 12
"""Positions whose symbols the window is made to hold."""
SHORTEST_FILM = 1.0
"""A motion through time shorter than this, s, is slowed down to be seen."""


def _find_ffmpeg() -> str:
    """Find the program: the machine's own, else the one that imageio-ffmpeg brings."""
    if (installed := shutil.which("ffmpeg")) is not None:
        return installed
    try:
        from imageio_ffmpeg import get_ffmpeg_exe

        return str(get_ffmpeg_exe())
    except (ImportError, RuntimeError):
        wanted = "the program ffmpeg (or pip install imageio-ffmpeg)"
        raise DependencyError(
            f"an .mp4 film needs {wanted}; .gif and .html do not"
        ) from None


def write_film(
    scene: Scene,
    path: Path,
    kind: str,
    seconds: float | None,
    units: Conversion,
    *,
    moving: bool,
) -> int:
    """Film one sweep, there and back if the input does not turn fully.

    A motion through time is shown as it is. Return the number of frames.

    Raises DependencyError where matplotlib or, for MP4, ffmpeg with its H.264 encoder
    is missing.
    """
    longest = _MAX_FRAMES / FRAMES_PER_SECOND
    if seconds is not None and not 0.0 < seconds <= longest:
        allowed = f"must be more than 0 and at most {longest:g}"
        raise InputError("seconds", seconds, allowed)
    with apply_style():
        program = _find_ffmpeg() if kind == "mp4" else ""
        shown = make_view(scene)
        shown.units = units
        if seconds is None:
            seconds = 6.0  # of a film of a sweep
            if shown.time is not None:
                duration = float(shown.time[-1] - shown.time[0])
                seconds = min(max(duration, SHORTEST_FILM), longest)
        order = choose_frames(shown, max(2, round(seconds * FRAMES_PER_SECOND)))
        with tempfile.TemporaryDirectory() as folder:
            _write_gif(Path(folder, "film.gif"), _draw_frames(shown, order, moving))
            if program:
                _encode_mp4(folder, program)
            write_bytes(path, Path(folder, f"film.{kind}").read_bytes())
    return len(order)


def _draw_frames(shown: View, order: list[int], moving: bool) -> "Iterator[Image]":
    """Draw what moves, frame by frame, over a picture of what stands still."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from PIL import Image

    figure, move = _make_stage(shown, moving)
    (axes,) = figure.axes
    canvas: Any = FigureCanvasAgg(figure)
    canvas.draw()
    still = canvas.copy_from_bbox(figure.bbox)
    with show_running(f"{len(order)} frames are drawn") as progress:
        for number, index in enumerate(order, 1):
            canvas.restore_region(still)
            for artist in move(index):
                axes.draw_artist(artist)
            if progress is not None:
                progress(number / len(order))
            yield Image.fromarray(np.asarray(canvas.buffer_rgba())).convert("RGB")


def _write_gif(path: Path, frames: "Iterator[Image]") -> None:
    """Write frames as they come, in one palette; a pixel that stays is transparent."""
    from PIL import Image
    from PIL.GifImagePlugin import getdata, getheader

    shown = next(frames).quantize(_STAYS, Image.Quantize.MEDIANCUT)
    header, _ = getheader(shown, info={"loop": 0})
    look: Any = {"duration": 1000 // FRAMES_PER_SECOND, "transparency": _STAYS}
    before = np.asarray(shown)
    # Pillow looks a colour up by the upper six bits of its channels
    near = shown.copy()
    near.putpalette([level & 0xFC for level in shown.getpalette() or []])
    with open(path, "wb") as file:
        file.writelines([*header, *getdata(shown, **look)])
        for frame in frames:
            pixels = np.asarray(frame.quantize(palette=near, dither=Image.Dither.NONE))
            changes = Image.fromarray(np.where(pixels == before, _STAYS, pixels))
            file.writelines(getdata(changes, **look))
            before = pixels
        file.write(b";")


def _encode_mp4(folder: str, program: str) -> None:
    """Encode the GIF of a folder anew; yuv420p is what browsers and slides play."""
    command = [program, "-i", "film.gif", "-c:v", "h264", "-pix_fmt", "yuv420p"]
    try:
        subprocess.run(
            [*command, "film.mp4"],
            cwd=folder,
            stdin=subprocess.DEVNULL,  # it reads what a loop of the shell reads
            capture_output=True,
            check=True,
        )
    except subprocess.CalledProcessError:
        raise DependencyError(
            "this ffmpeg cannot encode H.264 (libx264); .gif and .html need none"
        ) from None


def choose_frames(shown: View, count: int) -> list[int]:
    """Choose the positions shown one after the other, by index.

    Frames cover the segment that assembles around the drawn position.
    """
    assembled = shown.sweep.assembled
    positions = shown.sweep.at
    distances = np.abs(positions.places - shown.here.at.places[0])
    here = int(np.argmin(distances))
    gaps_before = np.cumsum(~assembled)
    segment = np.flatnonzero(assembled & (gaps_before == gaps_before[here]))
    first, last = segment[[0, -1]]

    covered = positions.angle[last] - positions.angle[first]
    is_one_turn = abs(covered - math.tau) < 1e-6 and shown.time is None
    there_and_back = shown.time is None and not is_one_turn
    if there_and_back:
        count = max(2, count // 2)
    places = np.linspace(first, last, count, endpoint=not is_one_turn)
    order = [round(place) for place in places.tolist()]
    return order + order[-2:0:-1] if there_and_back else order


def _make_stage(shown: View, moving: bool) -> "tuple[Figure, Callable[[int], Any]]":
    """Make the figure, and the function that moves it to a position of the sweep.

    The function returns what is to be drawn, from below.
    """
    from matplotlib.figure import Figure
    from matplotlib.patheffects import withStroke

    sweep = shown.sweep
    axis = shown.axis
    figure = Figure(figsize=(6.4, 5.6), dpi=100, layout="constrained")
    axes = figure.subplots()
    figure.suptitle(shorten_text(shown.scene.title, 70), **TITLE)
    draw_frame(axes, shown)
    still = {*axes.lines, *axes.patches}
    title = axes.set_title("θ")
    moved = list[Any]()

    def clear() -> None:
        while moved:
            moved.pop().remove()
        title.set_text("")

    def move(index: int) -> list[Any]:
        """Draw the mechanism at a position, in place of what stood there."""
        clear()
        with_arrows = moving and shown.moves
        draw_mechanism(axes, shown, sweep, index, moving=with_arrows)
        for text in axes.texts:  # names keep clear of bars of their colour
            text.set_path_effects([withStroke(linewidth=2.5, foreground="white")])
        drawn = (*axes.lines, *axes.patches, *axes.texts)
        moved.extend(artist for artist in drawn if artist not in still)
        place = write_cell(axis.factor * sweep.at.places[index], ".2f")
        words = f"{axis.symbol} = {place}{axis.unit}"
        if shown.time is not None:
            theta_2 = math.degrees(sweep.theta_2[index])
            words += f", θ₂ = {write_cell(theta_2, '.1f')}°"
        title.set_text(f"{words}, {shown.branch_name} branch".replace("-", "−"))
        return sorted([*moved, title], key=lambda artist: artist.get_zorder())

    closes = np.flatnonzero(sweep.assembled)
    # the window holds what acts at every position
    for index in closes[:: max(1, len(closes) // WINDOW_POSITIONS)]:
        move(int(index))
    label_plane(axes, shown, "θ")
    place_legend(axes, 3)
    figure.draw_without_rendering()
    axes.set_autoscale_on(False)  # nothing jumps from frame to frame
    figure.set_layout_engine(None)
    clear()
    return figure, move
