"""The moving linkage as a film: GIF through pillow, MP4 through ffmpeg."""

import math
import shutil
import tempfile
from collections.abc import Callable
from pathlib import Path
from subprocess import CalledProcessError
from typing import TYPE_CHECKING

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

FRAMES_PER_SECOND = 25
FILM_DPI = 100
"""Pixels per inch of a film."""
_MAX_FRAMES = 1500
FILM_SIZE = (6.4, 5.6)
SWEEP_SECONDS = 6.0
"""Duration of a film of a sweep if no other is stated, s."""
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
        shown = make_view(scene)
        shown.units = units
        if seconds is None:
            seconds = SWEEP_SECONDS
            if shown.time is not None:
                duration = float(shown.time[-1] - shown.time[0])
                seconds = min(max(duration, SHORTEST_FILM), longest)
        order = choose_frames(shown, max(2, round(seconds * FRAMES_PER_SECOND)))
        with tempfile.TemporaryDirectory() as folder:
            draft = Path(folder) / f"film.{kind}"
            _write_frames(draft, shown, order, moving)
            write_bytes(path, draft.read_bytes())
    return len(order)


def _write_frames(path: Path, shown: View, order: list[int], moving: bool) -> None:
    import matplotlib as mpl
    from matplotlib.animation import AbstractMovieWriter, FFMpegWriter, PillowWriter

    writer: AbstractMovieWriter = PillowWriter(FRAMES_PER_SECOND)
    if path.suffix == ".mp4":
        mpl.rcParams["animation.ffmpeg_path"] = _find_ffmpeg()
        writer = FFMpegWriter(FRAMES_PER_SECOND, codec="h264")
    figure, move = _make_stage(shown, moving)
    try:
        with (
            show_running(f"{len(order)} frames are drawn") as progress,
            writer.saving(figure, str(path), FILM_DPI),
        ):
            for number, index in enumerate(order, 1):
                move(index)
                writer.grab_frame()
                if progress is not None:
                    progress(number / len(order))
    except CalledProcessError:
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

    over_time = shown.time is not None
    covered = positions.angle[last] - positions.angle[first]
    is_one_turn = abs(covered - math.tau) < 1e-6 and not over_time
    there_and_back = not (over_time or is_one_turn)
    if there_and_back:
        count = max(2, count // 2)
    places = np.linspace(first, last, count, endpoint=not is_one_turn)
    order = [round(place) for place in places.tolist()]
    return order + order[-2:0:-1] if there_and_back else order


def _make_stage(shown: View, moving: bool) -> "tuple[Figure, Callable[[int], None]]":
    """Make the figure, and the function that moves it to a position of the sweep."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure
    from matplotlib.legend import Legend
    from matplotlib.patheffects import withStroke

    sweep = shown.sweep
    figure = Figure(figsize=FILM_SIZE, dpi=FILM_DPI, layout="constrained")
    axes = figure.subplots()
    figure.suptitle(shorten_text(shown.scene.title, 70), **TITLE)
    draw_frame(axes, shown)
    still = {*axes.lines, *axes.patches}

    def move(index: int) -> None:
        """Draw the mechanism at a position, in place of what stood there."""
        for artist in {*axes.lines, *axes.patches, *axes.texts} - still:
            artist.remove()
        with_arrows = moving and shown.moves
        draw_mechanism(axes, shown, sweep, index, moving=with_arrows)
        for text in axes.texts:  # names keep clear of bars of their colour
            text.set_path_effects([withStroke(linewidth=2.5, foreground="white")])
        axis = shown.axis
        words = f"{axis.symbol} = "
        unit = axis.unit
        place = axis.factor * sweep.at.places[index]
        if shown.time is not None:
            words = f"t = {shown.time[index]:.2f} s, θ₂ = "
            unit = "°"
            place = math.degrees(sweep.theta_2[index])
        words += write_cell(place, ".1f").replace("-", "−") + unit
        axes.set_title(f"{words}, {shown.branch_name} branch", pad=pad)

    pad = 0.0
    closes = np.flatnonzero(sweep.assembled)
    # the window holds what acts at every position
    for index in closes[:: max(1, len(closes) // WINDOW_POSITIONS)]:
        move(int(index))
    label_plane(axes, shown, "θ")
    pad = place_legend(axes, 3)
    figure.draw_without_rendering()
    axes.set_autoscale_on(False)  # nothing jumps from frame to frame
    figure.set_layout_engine(None)
    # what stands still is drawn once: a picture lies under the frames
    for artist in {*axes.lines, *axes.patches, *axes.texts} - still:
        artist.remove()
    axes.set_title("")
    canvas = FigureCanvasAgg(figure)
    canvas.draw()  # type: ignore[no-untyped-call]
    pixels = np.array(canvas.buffer_rgba())  # type: ignore[no-untyped-call]
    figure.figimage(pixels, zorder=-1.0)
    for artist in (figure.patch, *figure.texts, *axes.findobj(Legend), *still):
        artist.set_visible(False)
    axes.set_axis_off()
    return figure, move
