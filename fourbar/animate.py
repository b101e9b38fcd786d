"""A scene that moves: one self-contained web page, or a film (GIF, MP4).

The page needs nothing but a browser: no network, no library. Its numbers are those of
`fourbar.solve`, embedded for both branches; the position formula runs in the page as well, so
that the picture follows when a length is changed.
"""

import base64
import hashlib
import html
import json
import math
from collections.abc import Mapping
from dataclasses import replace
from importlib.resources import files
from pathlib import Path
from string import Template
from typing import Any

import numpy as np

from fourbar.errors import InputError, NotAssembledError
from fourbar.kinematics import Array, centre_in_bar
from fourbar.linkage import BAR_NAMES, MOVING_BARS
from fourbar.plot.style import length_unit, plain
from fourbar.plot.view import on_branch, sweep_command
from fourbar.scene import Command, Scene, command, solve
from fourbar.writing import write_text

FORMATS = ("html", "gif", "mp4")
MAX_ROWS = 1441
"""Positions embedded in a page: a quarter of a degree over a full turn; a finer sweep is thinned out evenly."""
MAX_PICTURE = 2_000_000
"""Bytes of one picture: a page with three of them still opens quickly."""
RASTER = {b"\x89PNG\r\n\x1a\n": "image/png", b"\xff\xd8\xff": "image/jpeg"}
"""First bytes of the formats that may be attached; SVG may not, because it can carry scripts."""
SCALARS = (
    "theta_3",
    "theta_4",
    "condition",
    "omega_2",
    "omega_3",
    "omega_4",
    "alpha_2",
    "alpha_3",
    "alpha_4",
    "torque",
)
FORCES = ("F12", "F32", "F43", "F14")
SCRIPTS = ("linkage.js", "numbers.js", "picture.js", "chart.js", "page.js")


def write(
    scene: Scene,
    path: str | Path,
    *,
    pictures: Mapping[str, str | Path] | None = None,
    file_format: str | None = None,
    seconds: float = 6.0,
) -> None:
    """Write a moving scene to a file, whole or not at all.

    Parameters
    ----------
    path : the file; its ending says which of html, gif and mp4 is meant.
    pictures : for bars "input", "coupler", "output": a PNG or JPEG file that is laid along the
        bar, its left edge at the bar's first pin (O2, A, O4) and its right edge at the second.
        Pages only.
    file_format : html, gif or mp4 where the path's ending does not say it.
    seconds : duration of one sweep in a film.

    Raises
    ------
    InputError : unknown format; a picture that cannot be read, is too large or no PNG or JPEG.
    NotAssembledError : the linkage assembles at none of the scene's positions.
    DependencyError : a film without matplotlib, or MP4 without ffmpeg.
    """
    target = Path(path)
    kind = (file_format or target.suffix.removeprefix(".")).lower()
    if kind not in FORMATS:
        raise InputError("output", str(path), "must end in one of " + ", ".join(f".{end}" for end in FORMATS))
    if kind == "html":
        write_text(target, page(scene, pictures or {}))
        return
    if pictures:
        raise InputError("picture", sorted(pictures), "pictures are shown in an .html page only")
    from fourbar.plot.film import write_film

    write_film(scene, target, kind, seconds)


def page(scene: Scene, pictures: Mapping[str, str | Path] | None = None) -> str:
    """The page as text."""
    from fourbar import __version__

    assets = files("fourbar").joinpath("page")
    style = assets.joinpath("page.css").read_text(encoding="utf-8")
    script = "".join(assets.joinpath(name).read_text(encoding="utf-8") for name in SCRIPTS)
    return Template(assets.joinpath("page.html").read_text(encoding="utf-8")).substitute(
        title=html.escape(plain(scene.title, 200) or "Four-bar linkage"),
        source=html.escape(plain(scene.source, 400)),
        version=__version__,
        style=style,
        style_hash=_content_hash(style),
        script=script,
        script_hash=_content_hash(script),
        data=embedded(page_data(scene, pictures or {})),
    )


def _content_hash(text: str) -> str:
    """The name by which the page's own security policy allows an inline script or style."""
    return "sha256-" + base64.b64encode(hashlib.sha256(text.encode("utf-8")).digest()).decode("ascii")


def embedded(value: object) -> str:
    """JSON that can stand inside a script element, whatever strings it holds."""
    text = json.dumps(value, ensure_ascii=True, allow_nan=False, separators=(",", ":"))
    return text.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026")


def page_data(scene: Scene, pictures: Mapping[str, str | Path]) -> dict[str, Any]:
    """Everything the page's script needs: SI units, radians, null where there is no value."""
    linkage, motion = scene.linkage, scene.motion
    where = thinned(sweep_command(scene))
    branches = {str(sign): _columns(on_branch(scene, sign), where.theta_2) for sign in (1, -1)}
    closes = [theta_3 is not None for theta_3 in branches[str(motion.branch)]["theta_3"]]
    if not any(closes):
        raise NotAssembledError("nothing to show: the linkage assembles at none of the scene's positions")
    own = command(scene).theta_2
    start = closes.index(True)
    if len(own) == 1:
        start = int(np.argmin(np.abs(np.angle(np.exp(1j * (where.theta_2 - own[0]))))))
    factor, unit = length_unit(max(linkage.lengths))
    return {
        "lengths": list(linkage.lengths),
        "theta_1": linkage.ground_angle,
        "unit": {"factor": factor, "name": unit},
        "centres": {
            str(number): list(centre_in_bar(linkage.bar(number))) if linkage.bar(number).mass > 0.0 else None
            for number in MOVING_BARS
        },
        "drive_bar": scene.drive_bar,
        "omega_2": motion.omega_2,
        "alpha_2": motion.alpha_2,
        "branch": motion.branch,
        "followed": motion.through == "follow",
        "theta_2": where.theta_2.tolist(),
        "start": start,
        "branches": branches,
        "pictures": {str(number): picture for number, picture in _pictures(pictures).items()},
        "pace": _pace(motion.omega_2, where.theta_2, len(sweep_command(scene).theta_2)),
    }


def thinned(where: Command) -> Command:
    """At most `MAX_ROWS` of the positions, evenly, both ends included."""
    n = len(where.theta_2)
    if n <= MAX_ROWS:
        return where
    keep = np.round(np.linspace(0, n - 1, MAX_ROWS)).astype(int)
    return where._replace(theta_2=where.theta_2[keep], branch=where.branch[keep])


def _pace(omega_2: float | None, theta_2: Array, asked: int) -> str:
    """What speed 1 means, and whether positions were left out."""
    words = "At speed 1× one sweep takes 6 s"
    if omega_2:
        real = abs(float(theta_2[-1] - theta_2[0]) / omega_2)
        words += f"; at ω₂ = {omega_2:.4g} rad/s the mechanism takes {real:.3g} s"
    if asked > len(theta_2):
        words += f". Shown are {len(theta_2)} of the {asked} positions"
    return words + "."


def _columns(scene: Scene, theta_2: Array) -> dict[str, Any]:
    """The solution on one branch, quantity by quantity."""
    own = command(replace(scene, motion=replace(scene.motion, theta_2=theta_2)))
    solution = solve(scene, at=own)
    columns: dict[str, Any] = {"sign": solution.branch.tolist()}
    for name in SCALARS:
        values = getattr(solution, name)
        if values is not None:
            columns[name] = [_or_null(value) for value in values.tolist()]
    for name in FORCES:
        values = getattr(solution, name)
        if values is not None:
            columns[name] = [[_or_null(x), _or_null(y)] for x, y in values.tolist()]
    return columns


def _or_null(value: float) -> float | None:
    return value if math.isfinite(value) else None


def _pictures(pictures: Mapping[str, str | Path]) -> dict[int, str]:
    """The pictures of the bars as data URIs."""
    numbers = {name: number for number, name in BAR_NAMES.items() if number in MOVING_BARS}
    found = {}
    for name, path in pictures.items():
        if name not in numbers:
            raise InputError("picture", name, "must name one of " + ", ".join(numbers))
        key = f"picture.{name}"
        try:
            content = Path(path).read_bytes()
        except OSError as error:
            raise InputError(key, str(path), f"cannot be read: {error.strerror or error}") from None
        kind = next((kind for magic, kind in RASTER.items() if content.startswith(magic)), None)
        if kind is None:
            raise InputError(key, str(path), "must be a PNG or JPEG picture")
        if len(content) > MAX_PICTURE:
            raise InputError(key, str(path), f"must not exceed {MAX_PICTURE // 1_000_000} MB")
        found[numbers[name]] = f"data:{kind};base64,{base64.b64encode(content).decode('ascii')}"
    return found
