"""The moving linkage as a film: GIF through pillow, MP4 through ffmpeg."""

import math
import shutil
import subprocess
import tempfile
from collections.abc import Callable, Iterator
from contextlib import suppress
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from fourbar.errors import DependencyError, InputError
from fourbar.scene import Scene
from fourbar.show.plot.labels import Label, Labels
from fourbar.show.plot.linkage_figure import (
    choose_drawing_scale,
    draw_mechanism,
    draw_paths,
)
from fourbar.show.plot.style import (
    TITLE,
    apply_style,
    place_legend,
    shorten_text,
    split_complex,
    split_points,
)
from fourbar.show.plot.symbols import draw_vectors
from fourbar.show.plot.view import View, make_view
from fourbar.show.shown_units import write_cell
from fourbar.show.tables import show_running
from fourbar.solution import Conversion
from fourbar.writing import write_bytes

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from PIL.Image import Image

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
    if seconds is not None and not (
        math.isfinite(seconds) and 0.0 < seconds * FRAMES_PER_SECOND <= _MAX_FRAMES
    ):
        raise InputError(
            "seconds",
            seconds,
            f"must be more than 0 and at most {_MAX_FRAMES // FRAMES_PER_SECOND}",
        )
    with apply_style():
        program = _find_ffmpeg() if kind == "mp4" else ""
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
        order = choose_frames(shown, max(2, round(seconds * FRAMES_PER_SECOND)))
        with (
            tempfile.TemporaryDirectory() as folder,
            show_running(f"{len(order)} frames are drawn") as progress,
        ):
            draft = Path(folder) / f"film.{kind}"
            frames = _draw_frames(shown, order, moving, progress)
            if program:
                _write_mp4(draft, frames, program)
            else:
                _write_gif(draft, frames)
            write_bytes(path, draft.read_bytes())
    return len(order)


def _draw_frames(
    shown: View,
    order: list[int],
    moving: bool,
    progress: Callable[[float], object] | None,
) -> "Iterator[Image]":
    """Draw what moves, frame by frame, over a picture of what stands still."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from PIL import Image

    figure, move = _make_stage(shown, moving)
    (axes,) = figure.axes
    canvas = FigureCanvasAgg(figure)
    for artist in move(order[0]):
        artist.set_visible(False)
    canvas.draw()  # type: ignore[no-untyped-call]
    still = canvas.copy_from_bbox(figure.bbox)  # type: ignore[no-untyped-call]
    for number, index in enumerate(order, 1):
        canvas.restore_region(still)  # type: ignore[no-untyped-call]
        for artist in sorted(move(index), key=lambda artist: artist.get_zorder()):
            artist.set_visible(True)
            axes.draw_artist(artist)
        if progress is not None:
            progress(number / len(order))
        pixels = canvas.buffer_rgba()  # type: ignore[no-untyped-call]
        yield Image.fromarray(np.asarray(pixels)).convert("RGB")


def _write_gif(path: Path, frames: "Iterator[Image]") -> None:
    from PIL.Image import Dither

    frame = next(frames)
    first = frame.quantize()
    others = [frame.quantize(palette=first, dither=Dither.NONE) for frame in frames]
    first.save(
        path,
        save_all=True,
        append_images=others,
        duration=1000 // FRAMES_PER_SECOND,
        loop=0,
    )


def _write_mp4(path: Path, frames: "Iterator[Image]", program: str) -> None:
    """Encode frames by ffmpeg; yuv420p is what browsers and slides play."""
    first = next(frames)
    command = [program, "-loglevel", "error", "-f", "rawvideo", "-pix_fmt", "rgb24"]
    command += ["-s", f"{first.width}x{first.height}", "-r", str(FRAMES_PER_SECOND)]
    command += ["-i", "-", "-c:v", "h264", "-pix_fmt", "yuv420p", "-y", str(path)]
    with tempfile.TemporaryFile() as errors:
        encoder = subprocess.Popen(
            command,
            stdin=subprocess.PIPE,
            stdout=errors,
            stderr=errors,
        )
        assert encoder.stdin is not None
        try:
            for frame in chain([first], frames):
                encoder.stdin.write(frame.tobytes())
            encoder.stdin.close()
        except BrokenPipeError:
            encoder.kill()
        finally:
            with suppress(BrokenPipeError):
                encoder.stdin.close()
            status = encoder.wait()
    if status != 0:
        raise DependencyError(
            "this ffmpeg cannot encode H.264 (libx264); .gif and .html need none"
        )


def choose_frames(shown: View, count: int) -> list[int]:
    """Choose the positions shown one after the other, by index.

    Frames cover the segment that assembles around the drawn position.
    """
    assembled = shown.sweep.assembled
    positions = shown.sweep.at
    distances = np.abs(positions.places - shown.here.at.places[0])
    here = int(np.argmin(distances))
    gaps = np.flatnonzero(~assembled)
    first = max(gaps[gaps < here], default=-1) + 1
    last = min(gaps[gaps > here], default=len(assembled)) - 1

    over_time = shown.time is not None
    covered = positions.angle[last] - positions.angle[first]
    is_one_turn = abs(covered - math.tau) < 1e-6 and not over_time
    there_and_back = not (over_time or is_one_turn)
    if there_and_back:
        count = max(2, count // 2)
    places = np.linspace(first, last, count, endpoint=not is_one_turn)
    order = [round(place) for place in places.tolist()]
    return order + order[-2:0:-1] if there_and_back else order


def _make_stage(shown: View, moving: bool) -> tuple["Figure", Any]:
    """Make the figure, and the function that moves it to a position of the sweep.

    The function returns what it has moved.
    """
    from matplotlib.figure import Figure

    sweep = shown.sweep
    factor, unit, size = choose_drawing_scale(shown)
    figure = Figure(figsize=FILM_SIZE, dpi=FILM_DPI, layout="constrained")
    axes = figure.subplots()
    figure.suptitle(shorten_text(shown.scene.title, 70), **TITLE)
    draw_paths(axes, shown, Labels())
    move_vectors = None
    if moving and shown.moves:
        move_vectors = draw_vectors(axes, shown, sweep, factor, size)
    drawn = list[Any]()

    def put(index: int) -> Labels:
        """Draw the mechanism at a position, in place of what stood there."""
        while drawn:
            drawn.pop().remove()
        labels = Labels()
        drawn.extend(draw_mechanism(axes, shown, sweep, index, labels))
        drawn.extend(map(write_label, labels.wanted))
        return labels

    closes = np.flatnonzero(sweep.assembled)
    # the window holds what acts at every position
    for index in closes[:: max(1, len(closes) // WINDOW_POSITIONS)]:
        for _, line, _ in put(int(index)).lines:
            axes.update_datalim(split_points(line))
    axes.autoscale_view()
    axes.set_aspect("equal", adjustable="datalim")
    axes.set(xlabel=f"$x$ ({unit})", ylabel=f"$y$ ({unit})", title="θ")
    pad = place_legend(axes, 3)
    figure.draw_without_rendering()
    axes.set_autoscale_on(False)  # nothing jumps from frame to frame
    figure.set_layout_engine(None)

    def move(index: int) -> list[Any]:
        put(index)
        axis = shown.axis
        caption = f"{axis.symbol} = "
        unit = axis.unit
        place = axis.factor * sweep.at.places[index]
        if shown.time is not None:
            caption = f"t = {shown.time[index]:.2f} s, θ₂ = "
            unit = "°"
            place = math.degrees(sweep.theta_2[index])
        caption += write_cell(place, ".1f").replace("-", "−") + unit
        title = axes.set_title(f"{caption}, {shown.branch_name} branch", pad=pad)
        arrows = [] if move_vectors is None else move_vectors(index)
        return [*drawn, *arrows, title]

    return figure, move


def write_label(label: Label) -> Any:
    """Write a label outwards from its point, or from its ring, and return its text.

    No free spot is searched: from frame to frame the label would jump. A bright edge
    keeps the text clear of a bar of its own colour.
    """
    from matplotlib.patheffects import withStroke

    away = label.at - label.shun
    away /= max(abs(away), 1e-300)
    sides = ("center", "left", "right")  # -1 is the last
    return label.axes.annotate(
        label.text,
        split_complex(label.at + label.ring * away),
        (8.0 * away.real, 11.0 * away.imag),
        textcoords="offset points",
        ha=sides[round(away.real)],
        va="center",
        color=label.colour,
        size=label.size,
        zorder=9,
        path_effects=[withStroke(linewidth=2.5, foreground="white")],
        annotation_clip=False,
    )
