"""A scene that moves: one self-contained web page, or a film (GIF, MP4).

The page needs nothing but a browser: no network, no library. It replays the numbers
that `collect_page_data` collects of `fourbar.solve`, and computes none of its own; to
change a length there is `fourbar edit`.
"""

import base64
import hashlib
import html
import json
import math
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import replace
from importlib.resources import files
from pathlib import Path
from string import Template
from typing import Any

import numpy as np

from fourbar.errors import InputError, NotAssembledError
from fourbar.files import dump
from fourbar.files.scene_text import MOVING_BAR_NUMBERS
from fourbar.formulas.mobility import classify
from fourbar.linkage import MOVING_BARS
from fourbar.quantities import (
    ANGLES,
    COUPLE,
    DERIVED_NAMES,
    LINE,
    OK,
    PIN_FORCES,
    RATES,
    Array,
)
from fourbar.scene import Command, Scene, command, command_at
from fourbar.scene.pictures import encode_picture
from fourbar.show.derived import derive
from fourbar.show.driving import find_senses, read_drive_demand
from fourbar.show.duty import compute_energies
from fourbar.show.motion_curves import find_drive_rounding
from fourbar.show.plot.film import write_film
from fourbar.show.plot.style import format_of, shorten_text
from fourbar.show.plot.symbols import Symbol, list_acting
from fourbar.show.plot.view import (
    describe_change_points,
    is_over_time,
    list_sweep,
    set_branch,
)
from fourbar.show.shown_units import choose_unit, drop_rounding
from fourbar.show.tables import show_running
from fourbar.show.tolerances import collect_tolerances
from fourbar.solution import SI, Conversion, Solution
from fourbar.solving import solve
from fourbar.writing import null_nan, write_text

MAX_ROWS = 1441
"""Positions embedded in a page: a quarter of a degree over a full turn. A finer sweep
is thinned out evenly.
"""
_WATCHED = (1.5, 60.0)
"""A motion through time that lasts between these, s, is shown in real time."""
DRIVE_SCALARS = (*COUPLE, "power", *LINE)
"""Numbers of a drive, which a released motion has not."""
ANIMATED_SCALARS = (*ANGLES, "condition", *RATES, *DRIVE_SCALARS, "stroke")


_STRIP = """<p id="strip" class="hint"></p>
<p id="type-change" class="warning" role="status" hidden></p>
"""
"""Place of the largest numbers beside the drawing of the workbench."""


def collect_page_data(
    scene: Scene,
    pictures: Mapping[str, str | Path],
    units: Conversion = SI,
    *,
    midway: bool = False,
) -> dict[str, Any]:
    """Collect everything the page's script needs.

    Numbers are in SI units and radians, null where there is no value.

    `midway`: the page opens in the middle of a motion, not at its beginning.
    """
    data = collect_live_data(scene, units, signs=(1, -1), midway=midway)
    encoded = {}
    for name, path in pictures.items():
        if name not in MOVING_BAR_NUMBERS:
            allowed = f"must name one of {', '.join(MOVING_BAR_NUMBERS)}"
            raise InputError("picture", name, allowed)
        encoded[MOVING_BAR_NUMBERS[name]] = encode_picture(f"picture.{name}", path)
    for picture in scene.pictures:
        # those that are given replace them
        if picture.bar not in encoded:
            encoded[picture.bar] = picture.data_uri()
    data["pictures"] = encoded
    data["tolerances"] = data["toml"] = None
    if scene.tolerances:
        places = data["over"]["values"] or data["theta_2"]
        with show_running("the samples of the tolerances are solved") as progress:
            data["tolerances"] = collect_tolerances(scene, places, progress)
    with suppress(InputError):  # a file has no form of what acts
        data["toml"] = dump(scene)
    plain: dict[str, Any] = null_nan(data)
    return plain


def collect_live_data(
    scene: Scene,
    units: Conversion = SI,
    *,
    signs: tuple[int, ...] = (),
    stage: str | None = None,
    midway: bool = False,
    solved: Solution | None = None,
) -> dict[str, Any]:
    """Collect what the page's script draws, columns as arrays.

    Tolerances, pictures and the file are left out.

    `signs`: the branches of a sweep; left out: the scene's. `stage`: the last one
    evaluated; left out: as of `solve`. `solved`: the scene's solution at that stage,
    so that a sweep which is shown as it stands is not solved twice.
    """
    linkage = scene.linkage
    motion = scene.motion
    shown = _collect_shown(scene, signs or (motion.branch,), stage, solved)
    closes = np.isfinite(shown["branches"][str(motion.branch)]["theta_3"])
    if not closes.any():
        raise NotAssembledError(
            "nothing to show: the linkage assembles at none of the scene's positions"
        )
    if shown["start"] is None:
        rows = np.flatnonzero(closes)
        shown["start"] = int(rows[len(rows) // 2 if midway else 0])
    factor, unit = choose_unit(max(linkage.lengths), "m", units)
    bars = {str(number): linkage.bar(number) for number in MOVING_BARS}
    return {
        "type": classify(linkage).name,
        "lengths": linkage.lengths,
        "theta_1": linkage.ground_angle,
        "unit": {"factor": factor, "name": unit},
        "units": units,
        "centres": {
            number: _split(bar.to_centre) if bar.mass > 0.0 else None
            for number, bar in bars.items()
        },
        "bars": {
            number: [bar.mass, bar.moment_of_inertia] for number, bar in bars.items()
        },
        "drive_bar": scene.drive_bar,
        "branch": motion.branch,
        "points": [
            {
                "name": point.name,
                "bar": point.bar,
                "at": _split(point.place.vector()),
            }
            for point in scene.settled().points
        ],
        "acting": [
            _write_symbol(symbol, shown["theta_2"]) for symbol in list_acting(scene)
        ],
        **shown,
    }


def _split(z: complex) -> list[float]:
    return [z.real, z.imag]


def _write_symbol(symbol: Symbol, theta_2: list[float]) -> dict[str, Any]:
    """Write one thing that acts, as the page's script draws it."""
    entry: dict[str, Any] = symbol._asdict()
    for name in ("at", "beyond", "vector"):
        entry[name] = _split(entry[name])
    if symbol.end is not None:
        bar, place = symbol.end
        entry["end"] = [bar, _split(place)]
    table = entry.pop("table")
    entry["factor"] = None if table is None else np.asarray(table.at(theta_2)).tolist()
    return entry


def _collect_shown(
    scene: Scene,
    signs: tuple[int, ...],
    stage: str | None,
    solved: Solution | None,
) -> dict[str, Any]:
    """Collect the motion that the scene makes, or branches over its command."""
    motion = scene.motion
    made = solve(scene) if is_over_time(scene) else None
    covered, place = list_sweep(scene) if made is None else (made.at, None)
    at = thin_out(covered)
    places = at.places
    commanded = covered.commanded
    name = commanded if made is None else "time"
    start = None if place is None else int(np.argmin(np.abs(places - place)))
    if solved is not None and not np.array_equal(places, solved.at.places):
        solved = None
    branches = {}
    for sign in signs if name == "theta_2" else (motion.branch,):
        if made is not None:
            solution = solve(scene, stage, at=at)
        elif solved is not None and sign == motion.branch:
            solution = solved
        else:
            one = set_branch(scene, sign)
            solution = solve(one, stage, at=command_at(one, places))
            if start is not None and len(command(scene).angle) == 1:
                # there the angles that are not commanded lie within (-pi, pi]
                for of_bar in {"theta_2", *ANGLES} - {commanded}:
                    angles = getattr(solution, of_bar)
                    turns = np.ceil(angles[start] / math.tau - 0.5)
                    angles -= math.tau * np.nan_to_num(turns)
        branches[str(sign)] = _collect_columns(solution)
    theta_2 = solution.theta_2
    if name != "theta_2":
        branches[str(motion.branch)]["theta_2"] = theta_2
    if motion.free is not None:
        energies = compute_energies(scene, solution)
        branches[str(motion.branch)]["energy"] = energies.kinetic
    rate = pace = None
    if made is not None:
        # a power of ten for a motion that is too short or too long to watch
        duration = float(places[-1] - places[0])
        power = math.log10(duration / np.clip(duration, *_WATCHED))
        rate = 10.0 ** math.copysign(math.ceil(abs(power)), power)
        pace = _describe_pace(made, rate, len(places))
    has_one_speed = made is None and not isinstance(motion.speed, np.ndarray)
    return {
        "theta_2": null_nan(theta_2),
        "time": None if made is None else places.tolist(),
        "over": {
            "name": name,
            "commanded": commanded,
            "values": None if name == "theta_2" else places.tolist(),
            "speed": motion.speed if has_one_speed else None,
        },
        "rate": rate,
        "start": start,
        "branches": branches,
        "pace": pace,
        "positions": len(covered.angle),
    }


def thin_out(positions: Command) -> Command:
    """Take at most `MAX_ROWS` of the positions, evenly, both ends included."""
    n = len(positions.angle)
    if n <= MAX_ROWS:
        return positions
    return positions.part(np.round(np.linspace(0, n - 1, MAX_ROWS)).astype(int))


def _describe_pace(motion: Solution, rate: float, shown: int) -> str:
    """Say what speed 1 means, which instants are shown, and what change points mean."""
    pace = "in real time"
    if rate < 1.0:
        pace = f"{1.0 / rate:.0f} times slower than it really does"
    elif rate > 1.0:
        pace = f"{rate:.0f} times faster than it really does"
    words = f"At speed 1× it moves {pace}"
    if motion.change_points:
        words += ". " + describe_change_points(motion)
    if len(motion) > shown:
        words += f". Shown are {shown} of the {len(motion)} instants"
    return words + "."


def _collect_columns(solution: Solution) -> dict[str, Any]:
    """Collect arrays by name, in SI units, and signs and statuses for the page."""
    columns: dict[str, Any] = {"sign": solution.branch.tolist()}
    if (solution.status_code != OK).any():
        columns["status"] = solution.status
    is_free = solution.scene.motion.free is not None
    for name in (*ANIMATED_SCALARS, *PIN_FORCES):
        values = getattr(solution, name)
        if values is not None and not (is_free and name in DRIVE_SCALARS):
            columns[name] = values
    if solution.omega_4 is not None:
        fastest = _drop_rounding(columns, RATES[:3])
        _drop_rounding(columns, RATES[3:], fastest**2)
    if solution.F12 is not None:
        _drop_rounding(columns, PIN_FORCES)
        drive = read_drive_demand(solution)
        senses, _ = find_senses(solution)
        for end in {*drive.keys[2:]} & columns.keys():  # a start or stop is no range
            columns[end] = np.where(senses == 0.0, columns[end], np.nan)
        idle = drive.sizes <= find_drive_rounding(solution)
        for name in {"torque", "power", "drive_force"} & columns.keys():
            columns[name] = np.where(idle, 0.0, columns[name])
    for name in DERIVED_NAMES:
        values = derive(solution, name)
        # centres lie at infinity now and then: a figure has them, no curve
        if name not in ("I13", "I24") and values is not None:
            columns[name] = values
    return columns


def _drop_rounding(
    columns: dict[str, Any], names: tuple[str, ...], among: float | Array = 0.0
) -> Array:
    """Drop what is rounding of the largest of its kind at its position.

    `among`: another of the kind. Returns the largest of each position, (n,).
    """
    kind = np.array([columns[name].T for name in names])
    sizes = np.abs(kind).reshape(-1, kind.shape[-1])
    largest = np.fmax(np.fmax.reduce(sizes), among)
    for name, numbers in zip(names, drop_rounding(kind, largest), strict=True):
        columns[name] = numbers.T
    return largest


ANIMATION_FORMATS = ("html", "gif", "mp4")
_SCRIPTS = (
    "numbers.js",
    "picture.js",
    "acting.js",
    "chart.js",
    "tolerances.js",
    "page.js",
)


def write_animation(
    scene: Scene,
    path: str | Path,
    *,
    pictures: Mapping[str, str | Path] | None = None,
    seconds: float | None = None,
    units: Conversion = SI,
    vectors: bool = False,
) -> int:
    """Write a moving scene to a file, atomically; return the frames of a film, or 0.

    Parameters
    ----------
    path : the file; its ending says which of html, gif and mp4 is meant.
    pictures : for bars "input", "coupler", "output", in place of the scene's own: a PNG
        or JPEG file that is laid along the bar, its left edge at the bar's first pin
        (O2, A, O4) and its right edge at the second. Pages only.
    units : in which numbers are shown; left out: SI. Angles are in degrees.
    vectors : with arrows of velocity and acceleration at the points; a page can show
        and hide them.
    seconds : duration of a film; left out: 6 s for a sweep, of a motion through time
        its own.

    Raises
    ------
    InputError : unknown format; a picture that cannot be read, is too large or no PNG
        or JPEG.
    NotAssembledError : the linkage assembles at none of the scene's positions.
    DependencyError : a film without matplotlib, or MP4 without ffmpeg.
    """
    target = Path(path)
    kind = format_of(path, ANIMATION_FORMATS)
    if kind == "html":
        write_text(target, write_page(scene, pictures or {}, units, vectors))
        return 0
    if pictures:
        only = "pictures are shown in an .html page only"
        raise InputError("picture", sorted(pictures), only)
    return write_film(scene, target, kind, seconds, units, moving=vectors)


def write_page(
    scene: Scene,
    pictures: Mapping[str, str | Path] | None = None,
    units: Conversion = SI,
    vectors: bool = False,
    live: str = "",
) -> str:
    """Write the page as text.

    `live`: the address of the line to the workbench, which a saved page does not have.
    """
    from fourbar import __version__

    def asset(*names: str) -> str:
        folder = files("fourbar.show").joinpath("page")
        return "".join(
            folder.joinpath(name).read_text(encoding="utf-8") for name in names
        )

    style = asset("page.css")
    script = asset(*_SCRIPTS)
    address = ""
    if live:
        style += asset("edit.css")
        script += asset("fields.js", "drag.js", "edit.js")
        address = live.split("/")[2]
        scene = replace(scene, tolerances=())
    data = collect_page_data(scene, pictures or {}, units, midway=bool(live))
    embedded = json.dumps(
        data | {"vectors": vectors, "live": live},
        allow_nan=False,
        separators=(",", ":"),
    )
    for mark in "<>&":  # whatever strings it holds, it stands inside a script element
        embedded = embedded.replace(mark, f"\\u{ord(mark):04x}")
    return Template(asset("page.html")).substitute(
        title=html.escape(shorten_text(scene.title, 200) or "Four-bar linkage"),
        source=html.escape(shorten_text(scene.source, 400)),
        version=__version__,
        style=style,
        style_hash=_hash_content(style),
        script=script,
        script_hash=_hash_content(script),
        images=f" http://{address}" if live else "",
        connect=f"connect-src ws://{address}; " if live else "",
        panel=asset("edit.html") if live else "",
        strip=_STRIP if live else "",
        results=asset("bench.html") if live else "",
        data=embedded,
    )


def _hash_content(text: str) -> str:
    """Return the hash by which the page's security policy allows a script or style."""
    digest = hashlib.sha256(text.encode("utf-8")).digest()
    return f"sha256-{base64.b64encode(digest).decode('ascii')}"
