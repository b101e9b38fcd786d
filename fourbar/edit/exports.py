"""Replies to a page, exports and reports that the workbench makes of a scene.

The largest numbers stand beside the drawing. Once a page rests they are those that
`analyze` prints, located between the positions; while somebody drags they are those of
the positions, which are reached at least.

The frame of a reply: four bytes with the length of its JSON (little-endian), the JSON
padded to a multiple of eight bytes, then columns of doubles one after the other, as the
JSON lists them: writing these as text takes longer than solving.
"""

import asyncio
import importlib.util
import json
import math
import os
import signal
import struct
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from fourbar.edit.dragging import list_handles
from fourbar.errors import DependencyError, NotAssembledError, say_install
from fourbar.formulas.mobility import limit_positions
from fourbar.linkage import MOVING_BARS, PIN_FORCE
from fourbar.scene import Scene
from fourbar.show.animate import collect_live_data
from fourbar.show.block import SceneBlock
from fourbar.show.driving import lacks_friction, read_drive_demand
from fourbar.show.motion_curves import compute_pin_loads, find_drive_rounding
from fourbar.show.shown_units import COMMON, write_short
from fourbar.show.studies import write_type
from fourbar.show.summary import Facts
from fourbar.solution import Conversion, Solution, write_csv
from fourbar.solving import find_last_stage, solve
from fourbar.studies.passing import say_nowhere
from fourbar.writing import write_text

EXPORT_ENDINGS = {
    **{kind: kind for kind in ("svg", "png", "pdf", "csv", "gif")},
    "mjcf": "xml",
    "page": "html",
}
"""Ending of the file by the name of the format."""
HARNESS_PACKAGE = "fourbar_validation"
LAST_LINES = 30
"""Lines of what the harness prints."""


def evaluate_scene(
    scene: Scene,
    units: Conversion,
    *,
    settled: bool = False,
    pressure: float | None = None,
) -> dict[str, Any]:
    """Evaluate a scene for the page.

    `settled`: with error bars, located peaks and summary, which cost more than the
    rest.

    `pressure`: of a cylinder, Pa; the summary then has the bore that it needs.

    Raises NotAssembledError where no position assembles, InputError as `solve` does.
    """
    stage = find_last_stage(scene) if settled else None
    solution = solve(scene, stage)
    if not solution.assembled.any():
        raise NotAssembledError(say_nowhere(scene))
    data = collect_live_data(scene, units, stage=stage, midway=True, solved=solution)
    data |= {"tolerances": None, "pictures": {}, "toml": None, "traced": None}
    if scene.picture is not None:
        picture = scene.picture
        data["traced"] = {
            "file": picture.name,
            "origin": picture.origin,
            "scale": picture.scale,
            "angle": picture.angle,
            "opacity": picture.opacity,
            "shift": scene.origin,
        }
    data["drawn"] = None if scene.drawing is None else scene.drawing.angle(2)
    data["turns"] = _list_turns(scene)
    data["handles"] = [handle.drawn() for handle in list_handles(scene)]
    shown_units = {**COMMON, **units}
    facts = None
    if settled:  # what `analyze` and `classify` print
        facts = SceneBlock(solution, shown_units, pressure)
        limits = write_type(scene.linkage, shown_units, everything=True)
        data["summary"] = [*facts.write(), "", *limits]
        if len(solution) > 1:  # the curves are those of a sweep
            data["peaks"] = list_peaks(solution, facts)
    data["headline"] = write_headline(solution, shown_units, facts)
    return data


def _list_turns(scene: Scene) -> list[tuple[Any, ...]]:
    """List limits of the commanded bar and dead centres: words and the three angles."""
    turns = []
    for bar in dict.fromkeys((scene.motion.bar, 2, 4)):
        word = "limit" if bar == scene.motion.bar else "dead centre"
        one, other = (number for number in MOVING_BARS if number != bar)
        words = f"{word}: bars {one}, {other} in line"
        turns += [(words, *limit[:3]) for limit in limit_positions(scene.linkage, bar)]
    return turns


def write_headline(
    solution: Solution,
    units: Conversion,
    facts: Facts | None,
) -> str:
    """Write the drive's peak, the largest pin force and the least transmission angle.

    `facts`: those of the solution; without them numbers are said to be reached at
    least.
    """
    peaks = list_peaks(solution, facts)
    drive = read_drive_demand(solution)
    reached = "" if facts is not None or len(solution) == 1 else "at least "
    among = " (of these positions)" if facts and facts.kind == "list" else ""
    parts = []
    for what, unit, names in (
        (f"peak {drive.name}", drive.unit, {"": drive.keys.value}),
        ("largest pin force", "N", PIN_FORCE),
    ):
        sizes = {at: peaks[name] for at, name in names.items() if name in peaks}
        if not sizes:
            continue
        text = "grows without bound"
        places = [at for at, size in sizes.items() if size is None]
        if not places:
            size, place = max((size or 0.0, at) for at, size in sizes.items())
            text = reached + write_short(size, unit, units)
            places = [place]
        at_pins = ", ".join(filter(None, places))
        parts.append(f"{what} {text}{at_pins and f' at {at_pins}'}{among}")
    if lacks_friction(solution).any():
        parts.append("dry friction at rest taken as 0")
    if facts is None:
        least = math.asin(min(float(np.nanmin(np.abs(solution.sin_mu))), 1.0))
        reached = reached.replace("least", "most")
    else:
        least = facts.transmission.value
    parts.append(f"least transmission angle {reached}{math.degrees(least):.1f}°{among}")
    return "; ".join(parts)


def list_peaks(solution: Solution, facts: Facts | None) -> dict[str, float | None]:
    """List the largest magnitudes of drive and pin forces; None: without bound, SI.

    `facts`: where they are located between the positions.
    """
    sizes = {} if solution.F12 is None else compute_pin_loads(solution)
    drive = read_drive_demand(solution)
    sizes[drive.keys.value] = drive.sizes
    peaks = dict[str, float | None]()
    for name, values in sizes.items():
        if not np.isfinite(values).any():
            continue
        peaks[name] = float(np.nanmax(values))
        if facts is not None:
            peak = abs(facts.motion.find_peak(name).value)
            peaks[name] = peak if math.isfinite(peak) else None
    size = peaks.get(drive.keys.value)
    if size is not None and size <= find_drive_rounding(solution):
        peaks[drive.keys.value] = 0.0
    return peaks


def pack_frame(about: dict[str, Any]) -> bytes:
    """Pack an answer: arrays in `about["data"]["branches"]` become columns."""
    columns: list[tuple[str, str, int, int]] = []
    arrays: list[bytes] = []
    if "data" in about:
        branches: dict[str, dict[str, Any]] = {}
        for sign, table in about["data"]["branches"].items():
            branches[sign] = {}
            for name, column in table.items():
                if isinstance(column, np.ndarray):
                    columns.append((sign, name, len(column), column.ndim))
                    arrays.append(column.astype("<f8").tobytes())
                else:
                    branches[sign][name] = column
        data = about["data"] | {"branches": branches}
        about = about | {"data": data, "columns": columns}
    text = json.dumps(about, allow_nan=False, separators=(",", ":")).encode()
    # the arrays begin at a multiple of 8 bytes
    text += b" " * (-(len(text) + 4) % 8)
    length = struct.pack("<I", len(text))
    return b"".join((length, text, *arrays))


def write_export(scene: Scene, path: Path, kind: str, units: Conversion) -> None:
    """Write one export, whose kind is one of `EXPORT_ENDINGS`; its folder is made."""
    from fourbar.mjcf import write_mjcf_for
    from fourbar.show.animate import write_animation
    from fourbar.show.plot import draw

    path.parent.mkdir(exist_ok=True)
    if kind == "csv":
        write_text(path, write_csv(solve(scene, find_last_stage(scene)), units))
    elif kind == "mjcf":  # which has units of its own
        write_text(path, write_mjcf_for(scene))
    elif kind in ("page", "gif"):
        write_animation(scene, path, units=units)
    else:
        draw(scene, path, units=units)


def find_harness() -> list[str]:
    """Return the command of the harness; DependencyError if it is not installed."""
    needed = ("mujoco", "pinocchio", HARNESS_PACKAGE)
    if all(importlib.util.find_spec(name) for name in needed):
        return [sys.executable, "-m", HARNESS_PACKAGE]
    raise DependencyError(
        "the harness with MuJoCo and Pinocchio is not installed:"
        f" {say_install('validation')}"
    )


class HarnessRun:
    """Run of the harness; only one goes on at a time."""

    def __init__(self, folder: Path, tell: Callable[[dict[str, Any]], None]) -> None:
        self.folder = folder
        self.tell = tell
        self.process: asyncio.subprocess.Process | None = None
        self.task: asyncio.Task[None] | None = None

    @property
    def report(self) -> Path:
        """Path of the report of the last run."""
        return self.folder / "report.html"

    def start(self, text: str) -> None:
        """Begin to judge a scene; one that runs already goes on."""
        if self.task is None or self.task.done():
            self.task = asyncio.create_task(self._run(text))

    def stop(self) -> None:
        """End the process and all that it started."""
        if self.process is not None and self.process.returncode is None:
            if os.name == "posix":
                os.killpg(self.process.pid, signal.SIGTERM)
            else:
                self.process.terminate()

    async def _run(self, text: str) -> None:
        about: dict[str, Any] = {"running": True, "lines": [], "report": False}
        self.tell({"check": about})
        try:
            command = find_harness()
            self.folder.mkdir(parents=True, exist_ok=True)
            self.report.unlink(missing_ok=True)
            scene = self.folder / "scene.toml"
            write_text(scene, text)
            files = str(scene.absolute()), "--out", str(self.folder.absolute())
            self.process = await asyncio.create_subprocess_exec(
                *command,
                "run",
                *files,
                stdout=subprocess.PIPE,
                stderr=subprocess.STDOUT,
                start_new_session=True,  # so that it ends with all that it starts
            )
            printed, _ = await self.process.communicate()
            status = await self.process.wait()
            lines = printed.decode(errors="replace").splitlines()[:LAST_LINES]
            about |= {"lines": lines, "stopped": status < 0, "status": status}
        except (DependencyError, OSError) as error:
            about["lines"] = [str(error)]
        self.tell({"check": about | {"running": False, "report": self.report.exists()}})
