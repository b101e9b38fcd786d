"""The moving linkage as a film: GIF through pillow, MP4 through ffmpeg."""

import math
import shutil
import subprocess
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from fourbar.errors import DependencyError, InputError
from fourbar.scene import Scene
from fourbar.show.plot import symbols
from fourbar.show.plot.labels import Labels
from fourbar.show.plot.linkage import (
    choose_drawing_scale,
    draw_mechanism,
    draw_paths,
    write_path_legend,
)
from fourbar.show.plot.style import TITLE, apply_style, shorten_text
from fourbar.show.plot.view import View, make_view
from fourbar.show.tables import show_running
from fourbar.solution import SI, Conversion
from fourbar.writing import write_bytes

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FRAMES_PER_SECOND = 25
_MAX_FRAMES = 1500
FILM_SIZE = (6.4, 5.6)
FILM_DPI = 100
SWEEP_SECONDS = 6.0
"""Duration of a film of a sweep if no other is stated, s."""
WINDOW_POSITIONS = 24
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
    units: Conversion = SI,
    *,
    moving: bool = False,
) -> None:
    """Film one sweep, there and back if the input does not turn fully.

    A motion through time is shown as it is.

    Raises DependencyError where matplotlib or, for MP4, ffmpeg with its H.264 encoder
    is missing.
    """
    if seconds is not None and not (
        math.isfinite(seconds) and 0.0 < seconds * FRAMES_PER_SECOND <= _MAX_FRAMES
    ):
        raise InputError(
            "seconds",
            seconds,
            f"must be more than 0 and at most {_MAX_FRAMES // FRAMES_PER_SECOND}",
        )
    with apply_style():
        import matplotlib as mpl
        from matplotlib.animation import FFMpegWriter, FuncAnimation, PillowWriter

        if kind == "mp4":
            mpl.rcParams["animation.ffmpeg_path"] = _find_ffmpeg()
        shown = make_view(scene)
        shown.units = units
        if seconds is None:
            seconds = SWEEP_SECONDS
            if shown.time is not None:
                duration = float(shown.time[-1] - shown.time[0])
                seconds = min(
                    max(duration, SHORTEST_FILM),
                    _MAX_FRAMES / FRAMES_PER_SECOND,
                )
        figure, move = _make_stage(shown, moving)
        order = choose_frames(shown, max(2, round(seconds * FRAMES_PER_SECOND)))
        writer: Any = PillowWriter(fps=FRAMES_PER_SECOND)
        if kind == "mp4":
            # yuv420p needs even pixel numbers and is what browsers and slides play
            writer = FFMpegWriter(
                fps=FRAMES_PER_SECOND,
                codec="h264",
                extra_args=["-pix_fmt", "yuv420p"],
            )
        with tempfile.TemporaryDirectory() as folder:
            draft = Path(folder) / f"film.{kind}"
            try:
                with show_running(f"{len(order)} frames are drawn") as progress:
                    told = (
                        None
                        if progress is None
                        else lambda done, count: progress(done / count)
                    )
                    film = FuncAnimation(
                        figure,
                        move,
                        frames=order,
                        cache_frame_data=False,
                    )
                    film.save(
                        str(draft),
                        writer=writer,
                        dpi=FILM_DPI,
                        progress_callback=told,
                    )
            except (subprocess.CalledProcessError, BrokenPipeError):
                raise DependencyError(
                    "this ffmpeg cannot encode H.264 (libx264); .gif and .html need"
                    " none"
                ) from None
            write_bytes(path, draft.read_bytes())


def choose_frames(shown: View, count: int) -> list[int]:
    """Choose the positions shown one after the other, by index.

    They are the segment that assembles around the drawn position.
    """
    assembled = shown.sweep.assembled
    positions = shown.sweep.at
    distances = np.abs(positions.places - shown.here.at.places[0])
    here = int(np.argmin(distances))
    gaps = np.flatnonzero(~assembled)
    first = max(gaps[gaps < here], default=-1) + 1
    last = min(gaps[gaps > here], default=len(assembled)) - 1

    def spread(number: int, *, endpoint: bool = True) -> list[int]:
        places = np.linspace(first, last, number, endpoint=endpoint)
        return [round(place) for place in places.tolist()]

    if shown.time is not None:
        return spread(count)
    covered = positions.angle[last] - positions.angle[first]
    is_one_turn = abs(covered - math.tau) < 1e-6
    if is_one_turn:
        return spread(count, endpoint=False)
    forward = spread(max(2, count // 2))
    back = forward[-2:0:-1]
    return forward + back


def _make_stage(shown: View, moving: bool) -> tuple["Figure", Any]:
    """Make the figure, and the function that moves it to a position of the sweep."""
    from matplotlib.figure import Figure

    sweep = shown.sweep
    factor, unit, size = choose_drawing_scale(shown)
    figure = Figure(figsize=FILM_SIZE, dpi=FILM_DPI, layout="constrained")
    axes = figure.subplots()
    figure.suptitle(shorten_text(shown.scene.title, 70), **TITLE)
    draw_paths(axes, shown, Labels())
    if moving and shown.moves:
        move_vectors = symbols.draw_vectors(axes, shown, sweep, factor, size)
    else:
        move_vectors = None
    passing: list[Any] = []

    def put(index: int) -> Labels:
        """Draw the mechanism at a position, in place of what stood there."""
        while passing:
            passing.pop().remove()
        labels = Labels()
        passing.extend(draw_mechanism(axes, shown, sweep, index, labels))
        passing.extend(labels.beside())
        return labels

    closes = np.flatnonzero(sweep.assembled)
    # the window holds what acts at every position
    for index in closes[:: max(1, len(closes) // WINDOW_POSITIONS)]:
        for _, line, _ in put(int(index)).lines:
            axes.update_datalim(line)
    axes.autoscale_view()
    axes.set_aspect("equal", adjustable="datalim")
    axes.set(xlabel=f"$x$ ({unit})", ylabel=f"$y$ ({unit})", title="θ")
    pad = write_path_legend(axes)
    figure.draw_without_rendering()
    axes.set_autoscale_on(False)  # nothing jumps from frame to frame
    figure.set_layout_engine(None)

    def move(index: int) -> None:
        put(index)
        if move_vectors is not None:
            move_vectors(index)
        axis = shown.axis
        places = sweep.at.places
        theta = f"{axis.factor * places[index]:.1f}".replace("-", "−")
        caption = rf"{axis.label} = {theta}{axis.unit}"
        if shown.time is not None:
            theta = f"{math.degrees(sweep.theta_2[index]):.1f}".replace("-", "−")
            caption = rf"$t$ = {shown.time[index]:.2f} s, $\theta_2$ = {theta}°"
        axes.set_title(f"{caption}, {shown.branch_name} branch", pad=pad)

    return figure, move
