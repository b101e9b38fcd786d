"""The moving linkage as a film: GIF through pillow, MP4 through ffmpeg."""

import math
import shutil
import subprocess
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from fourbar.errors import DependencyError, InputError, installing
from fourbar.linkage import ENDS
from fourbar.scene import Scene
from fourbar.show.acting import acting
from fourbar.show.plot import symbols
from fourbar.show.plot.linkage import POINT, mass_centre, path_legend, paths, pin_name, scale_of, supports
from fourbar.show.plot.style import BAR_COLOURS, INK, OPEN, TITLE, matplotlib_style, plain
from fourbar.show.plot.view import View, view
from fourbar.show.progress import counted
from fourbar.solution import SI, Conversion
from fourbar.writing import write_bytes

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FRAMES_PER_SECOND = 25
MAX_FRAMES = 1500
SIZE = (6.4, 5.6)
DPI = 100


SWEEP_SECONDS = 6.0
"""Of a film of a sweep, where nothing else is stated."""
NAME: dict[str, Any] = {
    **{"textcoords": "offset points", "xytext": (0.0, 0.0), "ha": "center", "va": "center", "size": 9.0},
    **{"zorder": 9, "annotation_clip": False},
}
WINDOW = 24
"""Positions whose symbols the window is made to hold."""
SHORTEST = 1.0
"""A motion through time shorter than this, s, is slowed down to be seen."""


def _ffmpeg() -> str:
    """Find the program: the machine's own, else the one that imageio-ffmpeg brings."""
    if (own := shutil.which("ffmpeg")) is not None:
        return own
    try:
        from imageio_ffmpeg import get_ffmpeg_exe

        return str(get_ffmpeg_exe())
    except (ImportError, RuntimeError):
        wanted = f"the program ffmpeg (or {installing('film')})"
        raise DependencyError(f"an .mp4 film needs {wanted}; .gif and .html do not") from None


def write_film(
    scene: Scene, path: Path, kind: str, seconds: float | None, units: Conversion = SI, *, moving: bool = False
) -> None:
    """One sweep; where the input does not turn fully, there and back. A motion through time is shown as it is.

    Parameters
    ----------
    seconds : length of the film; None: 6 s for a sweep, of a motion through time its own duration.
    moving : with arrows of velocity and acceleration at the points.

    Raises
    ------
    DependencyError : matplotlib or, for MP4, ffmpeg with its H.264 encoder is missing.
    """
    if seconds is not None and not (math.isfinite(seconds) and 0.0 < seconds * FRAMES_PER_SECOND <= MAX_FRAMES):
        raise InputError("seconds", seconds, f"must be more than 0 and at most {MAX_FRAMES // FRAMES_PER_SECOND}")
    with matplotlib_style():
        import matplotlib as mpl
        from matplotlib.animation import FFMpegWriter, PillowWriter

        if kind == "mp4":
            mpl.rcParams["animation.ffmpeg_path"] = _ffmpeg()
        shown = view(scene)
        shown.units = units
        if seconds is None:
            seconds = SWEEP_SECONDS
            if shown.time is not None:
                duration = float(shown.time[-1] - shown.time[0])
                seconds = min(max(duration, SHORTEST), MAX_FRAMES / FRAMES_PER_SECOND)
        figure, move = _stage(shown, moving)
        order = frames(shown, max(2, round(seconds * FRAMES_PER_SECOND)))
        writer: Any = PillowWriter(fps=FRAMES_PER_SECOND)
        if kind == "mp4":
            # yuv420p needs even pixel numbers and is what browsers and slides play
            writer = FFMpegWriter(fps=FRAMES_PER_SECOND, codec="h264", extra_args=["-pix_fmt", "yuv420p"])
        with tempfile.TemporaryDirectory() as folder:
            draft = Path(folder) / f"film.{kind}"
            try:
                with writer.saving(figure, str(draft), DPI):
                    for index in counted(order, f"{len(order)} frames"):
                        move(index)
                        writer.grab_frame()
            except (subprocess.CalledProcessError, BrokenPipeError):
                raise DependencyError("this ffmpeg cannot encode H.264 (libx264); .gif and .html need none") from None
            write_bytes(path, draft.read_bytes())


def frames(shown: View, count: int) -> list[int]:
    """Choose the positions shown one after the other, by index: the segment that assembles around the one drawn."""
    closes = shown.sweep.assembled
    here = int(np.argmin(np.abs(shown.sweep.theta_2 - shown.here.theta_2[0])))
    if shown.time is not None and shown.here.time is not None:
        here = int(np.argmin(np.abs(shown.time - shown.here.time[0])))
    gaps = np.flatnonzero(~closes)
    first, last = max(gaps[gaps < here], default=-1) + 1, min(gaps[gaps > here], default=len(closes)) - 1
    if shown.time is not None:
        return [round(i) for i in np.linspace(first, last, count)]
    theta_2 = shown.sweep.theta_2
    if abs(theta_2[last] - theta_2[first] - math.tau) < 1e-6:
        return [round(i) for i in np.linspace(first, last, count, endpoint=False)]
    there = [round(i) for i in np.linspace(first, last, max(2, count // 2))]
    return there + there[-2:0:-1]


def _acting(axes: Any, shown: View, factor: float, size: float) -> Callable[[int], list[symbols.DrawnSymbol]]:
    """Make the function that draws the symbols of what acts at a position, in place of what stood there.

    The window becomes large enough for those of every position.
    """
    everything = acting(shown.scene)
    passing: list[Any] = []

    def draw(index: int) -> list[symbols.DrawnSymbol]:
        while passing:
            passing.pop().remove()
        place = symbols.place_of(shown.scene.linkage, shown.sweep, index, factor)
        drawn = [symbols.draw(axes, symbol, place, size) for symbol in everything]
        for each, symbol in zip(drawn, everything, strict=True):
            passing.extend(each.artists)
            if each.label is not None:
                away = each.away or 1.0  # of what surrounds a pin: to the right
                side = {"ha": "left"} if each.away == 0.0 else {}
                at = {**NAME, "xytext": (12.0 * away.real, 12.0 * away.imag), **side}
                passing.append(axes.annotate(each.text, each.label, color=symbols.COLOURS[symbol.kind], **at))
        return drawn

    closes = np.flatnonzero(shown.sweep.assembled)
    for index in closes[:: max(1, len(closes) // WINDOW)]:
        for line in (line for each in draw(int(index)) for line in each.lines):
            axes.update_datalim(line)
    return draw


def _names(axes: Any, shown: View, centres: list[int]) -> dict[str, Any]:
    """Write the names of pins, bars, mass centres and own points."""
    texts = {pin: (pin_name(pin), INK) for pin in ("O2", "A", "B", "O4")}
    texts |= {str(number): (str(number), BAR_COLOURS[number]) for number in ENDS}
    texts |= {f"G{number}": (f"$G_{number}$", BAR_COLOURS[number]) for number in centres}
    texts |= {name: (name, POINT) for name in shown.sweep.points}
    return {key: axes.annotate(text, (0.0, 0.0), color=colour, **NAME) for key, (text, colour) in texts.items()}


def _stage(shown: View, moving: bool) -> tuple["Figure", Any]:
    """Make the figure, and the function that moves it to a position of the sweep."""
    from matplotlib.figure import Figure

    sweep, linkage = shown.sweep, shown.scene.linkage
    O4 = (linkage.ground * math.cos(linkage.ground_angle), linkage.ground * math.sin(linkage.ground_angle))
    factor, unit, size = scale_of(shown)
    figure = Figure(figsize=SIZE, dpi=DPI, layout="constrained")
    axes = figure.subplots()
    figure.suptitle(plain(shown.scene.title, 70), **TITLE)
    for path, colour, dashes, name in paths(shown):
        axes.plot(*(factor * path).T, color=colour, lw=1.0, ls=dashes, label=name, zorder=2)
    supports(axes, (0.0, 0.0), (factor * O4[0], factor * O4[1]), size)
    look: dict[str, Any] = {"lw": 4.5, "ms": 6.5, "mew": 1.2, "zorder": 4, **OPEN}
    bars = {number: axes.plot([], [], "o-", color=BAR_COLOURS[number], **look)[0] for number in ENDS}
    centres = {number: mass_centre(axes, (0.0, 0.0)) for number in ENDS if linkage.bar(number).mass > 0.0}
    own = {name: axes.plot([], [], "D", ms=4.5, mfc="white", mec=POINT, mew=1.2, zorder=8)[0] for name in sweep.points}
    arms = {number: axes.plot([], [], color=BAR_COLOURS[number], lw=0.8, ls=":", zorder=3)[0] for number in centres}
    names = _names(axes, shown, list(centres))
    move_vectors = symbols.vectors(axes, shown, sweep, factor, size) if moving and shown.moves else None
    act = _acting(axes, shown, factor, size)
    axes.autoscale_view()
    axes.set_aspect("equal", adjustable="datalim")
    axes.set(xlabel=f"$x$ ({unit})", ylabel=f"$y$ ({unit})", title="θ")
    pad = path_legend(axes)
    figure.draw_without_rendering()
    figure.set_layout_engine(None)  # nothing jumps from frame to frame

    def move(index: int) -> None:
        pins = {"O2": np.zeros(2), "A": sweep.A[index], "B": sweep.B[index], "O4": np.array(O4)}
        middle, at = np.mean(list(pins.values()), axis=0), dict(pins)
        at |= {name: path[index] for name, path in sweep.points.items()}
        for number, (start, stop) in ENDS.items():
            bars[number].set_data(*(factor * np.array([pins[start], pins[stop]]).T))
            at[str(number)] = 0.5 * (pins[start] + pins[stop])
        for number, marks in centres.items():
            at[f"G{number}"] = point = getattr(sweep, f"G{number}")[index]
            for mark in marks:
                mark.set_data(*(factor * point[:, None]))
            arms[number].set_data(*(factor * np.array([pins[ENDS[number][0]], point]).T))
        for name, mark in own.items():
            mark.set_data(*(factor * at[name][:, None]))
        for key, text in names.items():
            away = at[key] - middle if key[0] != "G" else middle - at[key]  # across the bar from its number
            text.xy = tuple(factor * at[key])
            text.set_position(tuple(13.0 * away / max(float(np.hypot(*away)), 1e-300)))
        act(index)
        if move_vectors is not None:
            move_vectors(index)
        theta = f"{math.degrees(sweep.theta_2[index]):.1f}".replace("-", "−")
        when = "" if shown.time is None else f"$t$ = {shown.time[index]:.2f} s, "
        axes.set_title(rf"{when}$\theta_2$ = {theta}°, {shown.branch_name} branch", pad=pad)

    return figure, move
