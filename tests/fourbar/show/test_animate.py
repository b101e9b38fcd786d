"""The moving page as a file.

What is embedded, that nothing foreign gets in or out, and the films.
"""

import base64
import hashlib
import json
import re
import shutil
import sys
from dataclasses import replace
from html.parser import HTMLParser
from importlib.util import find_spec
from itertools import pairwise
from math import degrees, nan, pi, radians

import numpy as np
from numpy.testing import assert_allclose, assert_equal
from pytest import approx, mark, raises

from fourbar import (
    DependencyError,
    Free,
    Law,
    Motion,
    NotAssembledError,
    Sweep,
    load,
    solve,
)
from fourbar.files import loads
from fourbar.show import animate
from fourbar.show.plot import film as films
from fourbar.show.plot import style, view
from fourbar_validation.places import MODELS
from tests.support.rows import read_rows, refused
from tests.support.scenes import PARALLELOGRAM, bare, crank_rocker, thesis

HOSTILE = (
    "</script><script>alert(1)</script> \"'><img src=x onerror=alert(2)> $style ${data}"
    " {{x}} \u2028 \x00 é"
)


PNG = base64.b64decode(
    "iVBORw0KGgoAAAANSUhEUgAAAAIAAAABCAIAAAB7QOjdAAAAD0lEQVR4nGP4z8DwHwYBABv2A/0Fj9VPAAAAAElFTkSuQmCC"
)


class Tags(HTMLParser):
    """Every tag with its attributes, and the text of script elements."""

    def __init__(self, text):
        super().__init__()
        self.tags = []
        self.scripts = []
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        self.tags.append((tag, dict(attrs)))

    def handle_data(self, data):
        if self.tags and self.tags[-1][0] == "script":
            self.scripts.append(data)


def embedded(page):
    return json.loads(Tags(page).scripts[0])


@mark.slow
def test_what_is_solved_already_changes_no_number():
    turn, backwards = Sweep(0.0, 2.0 * pi, 12), Sweep(3.0, 1.0, 12)
    for angles in (turn, backwards, 1.0):
        scene = crank_rocker(Motion(angles, 10.0))
        plain = animate.collect_live_data(scene, signs=(1, -1))
        shown = animate.collect_live_data(scene, signs=(1, -1), solved=solve(scene))
        assert_equal(shown, plain)


def test_a_single_position_is_one_of_the_rows_and_the_first_shown():
    theta_2 = radians(123.456)
    data = embedded(animate.write_page(thesis(theta_2)))
    row = data["start"]
    assert data["theta_2"][row] == theta_2 and len(data["theta_2"]) > 300
    assert data["branches"]["1"]["torque"][row] == solve(thesis(theta_2)).torque[0]


def test_a_single_position_has_the_angles_of_its_solution():
    """The table begins at 0 deg, from where the output of a parallelogram goes on."""
    scene = crank_rocker(Motion(radians(200.0), 3.0), linkage=bare(*PARALLELOGRAM))
    data = animate.collect_page_data(scene, {})
    assert data["branches"]["1"]["theta_4"][data["start"]] == approx(radians(-160.0))


ROUNDING = read_rows("""
parallelogram | 9 | torque
parallelogram | 9 | power
parallelogram | 9 | F12
antiparallelogram | 6 | omega_3
antiparallelogram | 18 | alpha_3
""")
"""A model, a row of its sweep and what has a number there that is rounding alone."""


@mark.parametrize("model, row, name", ROUNDING)
def test_what_is_rounding_of_its_kind_is_zero(model, row, name):
    scene = load(MODELS / f"capabilities/{model}.toml")
    shown = animate.collect_live_data(scene)["branches"][str(scene.motion.branch)][name]
    solved = getattr(solve(scene), name)
    assert_allclose(shown, solved, atol=1e-12)
    here = int(row)
    assert np.count_nonzero(shown[here]) == np.count_nonzero(solved[here]) - 1


RELEASED = crank_rocker(Motion(0.5, 0.0, free=Free(1.8, 90)), drive_bar=2)


def test_a_released_motion_has_an_energy_and_no_torque():
    columns = animate.collect_live_data(RELEASED)["branches"]["1"]
    assert not {"torque", "torque_error", "power"} & columns.keys()
    assert columns["energy"][0] == 0.0 < columns["energy"][1]


@mark.parametrize(
    "duration, rate",
    [(0.2, 0.1), (1.4e-3, 1e-4), (30.0, 1.0), (6e3, 100.0), (6.1e3, 1e3)],
)
def test_what_is_too_quick_to_see_is_slowed_down_by_a_power_of_ten(duration, rate):
    law = Law((0.0, 0.5 * duration, duration), (0.0, 1.0, 2.0), ends="rest")
    data = embedded(animate.write_page(crank_rocker(Motion(law=law))))
    assert data["rate"] == approx(rate)
    assert len(data["branches"]["1"]["torque"]) == 361


def test_a_fine_sweep_is_thinned_evenly_and_says_so():
    scene = crank_rocker(Motion(Sweep(0.0, 2 * pi, 36_000), 1.0))
    data = embedded(animate.write_page(scene))
    assert len(data["theta_2"]) == animate.MAX_ROWS
    assert np.diff(data["theta_2"]) == approx(2 * pi / (animate.MAX_ROWS - 1))
    assert data["positions"] == 36_001


def test_nothing_is_fetched_and_hostile_text_stays_text():
    page = animate.write_page(replace(crank_rocker(), title=HOSTILE, source=HOSTILE))
    tags = Tags(page).tags
    assert [name for name, _ in tags].count("script") == 2
    assert "img" not in [name for name, _ in tags]
    for _, attributes in tags:
        assert not {"src", "onerror", "onclick", "style"} & set(attributes)
        href = attributes.get("href", "#")
        # an icon of no bytes keeps browsers from asking for one
        assert href.startswith("#") or href == "data:,"
    assert not re.search(r"(?:https?:)?//(?!www\.w3\.org/2000/svg)[a-z]+\.[a-z]", page)
    assert "\x00" not in page
    assert "$style" in page  # a stranger's text is no template
    assert not set("<>&\u2028") & set(Tags(page).scripts[0])
    assert loads(embedded(page)["toml"]).title == HOSTILE
    policy = next(a["content"] for name, a in tags if a.get("http-equiv"))
    assert "default-src 'none'" in policy and "unsafe" not in policy
    script = page[page.rindex("<script>") + len("<script>") : page.rindex("</script>")]
    digest = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
    assert f"'sha256-{digest}'" in policy  # its own script and nothing else


@mark.parametrize(
    "bar, content, message",
    [
        ("input", b"", "PNG or JPEG"),
        ("wheel", PNG, "must name one of input, coupler, output"),
    ],
)
def test_what_is_no_picture_is_refused(tmp_path, bar, content, message):
    path = tmp_path / "picture.png"
    path.write_bytes(content)
    with refused(message):
        animate.write_animation(
            crank_rocker(), tmp_path / "page.html", pictures={bar: path}
        )
    assert not (tmp_path / "page.html").exists()


@mark.parametrize(
    "name, options, words",
    [
        ("a.avi", {}, ".html, .gif, .mp4"),
        ("a.gif", {"seconds": nan}, "seconds"),
        ("a.gif", {"pictures": {"input": "x.png"}}, "html page"),
    ],
)
def test_what_cannot_be_shown_is_refused(name, options, words, tmp_path):
    with refused(words):
        animate.write_animation(crank_rocker(), tmp_path / name, **options)
    apart = thesis(Sweep(radians(40), radians(50), 5))
    with raises(NotAssembledError, match="assembl"):
        animate.write_animation(apart, tmp_path / "a.html")
    assert not list(tmp_path.iterdir())


@mark.slow
@mark.parametrize("scene, frames", [(crank_rocker(), 5), (RELEASED, 9)])
def test_a_gif_moves_the_linkage(scene, frames, tmp_path, monkeypatch):
    """A release of 1.8 s runs forward and as long as it does."""
    from PIL import Image

    options = {"seconds": 0.2}
    if scene is RELEASED:
        monkeypatch.setattr(films, "FRAMES_PER_SECOND", 5)
        options = {}
    animate.write_animation(scene, tmp_path / "a.gif", **options)
    pictures = []
    with Image.open(tmp_path / "a.gif") as film:
        assert film.n_frames == frames
        for index in range(frames):
            film.seek(index)
            pictures.append(np.asarray(film.convert("L"), int))
            assert film.convert("RGB").getpixel((2, 300)) == (255, 255, 255)
    assert all(np.any(p != q) for p, q in pairwise(pictures))
    with style.apply_style():  # nothing of an earlier frame stays
        shown = view.make_view(scene)
        (last,) = films._draw_frames(
            shown, films.choose_frames(shown, frames)[-1:], False
        )
    assert np.mean(abs(pictures[-1] - np.asarray(last.convert("L"), int)) > 64) < 1e-3


@mark.slow
@mark.skipif(
    shutil.which("ffmpeg") is None and find_spec("imageio_ffmpeg") is None,
    reason="neither ffmpeg nor imageio-ffmpeg",
)
def test_an_mp4_is_written(tmp_path):
    animate.write_animation(thesis(), tmp_path / "a.mp4", seconds=0.2)
    assert (tmp_path / "a.mp4").read_bytes()[4:8] == b"ftyp"


def test_without_ffmpeg_an_mp4_is_refused_in_one_line(tmp_path, monkeypatch):
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.setitem(sys.modules, "imageio_ffmpeg", None)
    with raises(
        DependencyError, match=r"^an \.mp4 film needs the program ffmpeg[^\n]*$"
    ):
        animate.write_animation(crank_rocker(), tmp_path / "a.mp4")
    assert not list(tmp_path.iterdir())


@mark.slow
def test_a_frame_has_the_linkage_at_its_position_and_nothing_of_another():
    with style.apply_style():
        shown = view.make_view(crank_rocker())
        figure, move = films._make_stage(shown, True)
        (axes,) = figure.axes
        held = []
        for index in (20, 45):
            move(index)
            held.append((len(axes.get_children()), axes.get_xlim(), axes.get_ylim()))
            bars = [line for line in axes.lines if line.get_linewidth() == 4.5]
            A, B = (1e3 * pin[index] for pin in (shown.sweep.A, shown.sweep.B))
            assert len(bars) == 3
            assert_allclose(bars[1].get_xydata(), [A, B])
            angle = degrees(shown.sweep.theta_2[index])
            assert f"θ₂ = {angle:.2f}°" in axes.get_title("left")
    assert held[0] == held[1]
