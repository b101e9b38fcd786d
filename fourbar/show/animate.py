"""A scene that moves: one self-contained web page, or a film (GIF, MP4).

The page needs nothing but a browser: no network, no library. It replays the numbers of
`collect_page_data` and computes none of its own; to change a length there is `fourbar edit`.
"""

import base64
import hashlib
import html
import json
from collections.abc import Mapping
from dataclasses import replace
from importlib.resources import files
from pathlib import Path
from string import Template

from fourbar.errors import InputError
from fourbar.scene import Scene
from fourbar.show.page_data import collect_page_data
from fourbar.show.plot.style import format_of, shorten_text
from fourbar.solution import SI, Conversion
from fourbar.writing import write_text

FORMATS = ("html", "gif", "mp4")
SCRIPTS = ("numbers.js", "picture.js", "acting.js", "chart.js", "tolerances.js", "page.js")
LIVE_SCRIPTS = ("fields.js", "drag.js", "edit.js")
"""Of the workbench besides."""


def write(
    scene: Scene,
    path: str | Path,
    *,
    pictures: Mapping[str, str | Path] | None = None,
    seconds: float | None = None,
    units: Conversion = SI,
    vectors: bool = False,
) -> None:
    """Write a moving scene to a file, whole or not at all.

    Parameters
    ----------
    path : the file; its ending says which of html, gif and mp4 is meant.
    pictures : for bars "input", "coupler", "output", in place of the scene's own: a PNG or JPEG file
        that is laid along the bar, its left edge at the bar's first pin (O2, A, O4) and its right
        edge at the second. Pages only.
    units : in which numbers are shown; left out: SI. Angles are in degrees.
    vectors : with arrows of velocity and acceleration at the points; a page can show and hide them.
    seconds : duration of a film; left out: 6 s for a sweep, of a motion through time its own.

    Raises
    ------
    InputError : unknown format; a picture that cannot be read, is too large or no PNG or JPEG.
    NotAssembledError : the linkage assembles at none of the scene's positions.
    DependencyError : a film without matplotlib, or MP4 without ffmpeg.
    """
    target, kind = Path(path), format_of(path, FORMATS)
    if kind == "html":
        write_text(target, write_page(scene, pictures or {}, units, vectors))
        return
    if pictures:
        raise InputError("picture", sorted(pictures), "pictures are shown in an .html page only")
    from fourbar.show.plot.film import write_film

    write_film(scene, target, kind, seconds, units, moving=vectors)


def write_page(
    scene: Scene,
    pictures: Mapping[str, str | Path] | None = None,
    units: Conversion = SI,
    vectors: bool = False,
    live: str = "",
) -> str:
    """Write the page as text; `live`: the address of the line to the workbench, which a saved page has not."""
    from fourbar import __version__

    def asset(*names: str) -> str:
        folder = files("fourbar.show").joinpath("page")
        return "".join(folder.joinpath(name).read_text(encoding="utf-8") for name in names)

    style, script = asset("page.css"), asset(*SCRIPTS)
    if live:
        style, script = style + asset("edit.css"), script + asset(*LIVE_SCRIPTS)
    return Template(asset("page.html")).substitute(
        title=html.escape(shorten_text(scene.title, 200) or "Four-bar linkage"),
        source=html.escape(shorten_text(scene.source, 400)),
        version=__version__,
        style=style,
        style_hash=_hash_content(style),
        script=script,
        script_hash=_hash_content(script),
        connect=f"connect-src ws://{live.split('/')[2]}; " if live else "",
        panel=asset("edit.html") if live else "",
        results=asset("bench.html") if live else "",
        data=embed_json(
            collect_page_data(
                replace(scene, tolerances=()) if live else scene, pictures or {}, units, midway=bool(live)
            )
            | {"vectors": vectors, "live": live}
        ),
    )


def _hash_content(text: str) -> str:
    """Hash an inline script or style: by this name the page's own security policy allows it."""
    return "sha256-" + base64.b64encode(hashlib.sha256(text.encode("utf-8")).digest()).decode("ascii")


def embed_json(value: object) -> str:
    """JSON that can stand inside a script element, whatever strings it holds."""
    text = json.dumps(value, ensure_ascii=True, allow_nan=False, separators=(",", ":"))
    return text.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026")
