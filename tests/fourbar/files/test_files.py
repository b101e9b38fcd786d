"""Scene files: read exactly, written back bit for bit.

The models say what their sources say.
"""

import re
from dataclasses import replace
from math import pi, tau

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from pytest import approx, mark, raises

from fourbar import (
    Bar,
    FourBar,
    Free,
    FromLimit,
    Gravity,
    Motion,
    Place,
    Spring,
    Sweep,
    Tolerance,
    solve,
)
from fourbar.files import dump, load, loads, new_scene, save
from fourbar_validation.places import MODELS
from tests.fourbar.test_solving import EXAMPLES, scenes
from tests.support.rows import read_rows, refused
from tests.support.scenes import crank_rocker
from tests.support.texts import LENGTHS

FILES = sorted(MODELS.glob("*.toml"))


def facts(scene):
    """Every number of a scene, in a form that compares bit for bit.

    repr tells -0.0 from 0.0.
    """
    motion = scene.motion
    angles = np.asarray(motion.theta_2).tolist()
    rest = (motion.omega_2, motion.alpha_2, motion.branch, motion.free)
    parts = (scene.linkage, angles, rest, scene.drive_bar, scene.loads, scene.effects)
    return repr(parts), scene.title, scene.source


@mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_models_read_back_and_assemble_everywhere(path):
    scene = load(path)
    assert facts(loads(dump(scene))) == facts(scene)
    assert scene.title and scene.source
    assert set(solve(scene).status) == {"ok"}


def test_defaults_are_those_of_the_contract():
    scene = loads(LENGTHS)
    assert scene.linkage == FourBar(0.3, Bar(0.1), Bar(0.25), Bar(0.22), 0.0)
    assert scene.motion == Motion(None, None, 0.0, 1) and scene.drive_bar == 2
    assert (scene.loads, scene.effects, scene.title, scene.source) == ((), (), "", "")
    bar = loads(LENGTHS + '[bars.coupler]\nmass = "6 kg"\n').linkage.coupler
    assert bar.moment_of_inertia == approx(6.0 * 0.25**2 / 12.0, rel=1e-15)
    assert bar.mass_centre == (0.125, 0.0)


def test_every_form_of_theta_2():
    def motion(text):
        return loads(f'{LENGTHS}[motion]\ntheta_2 = {text}\nbranch = "crossed"').motion

    swept = motion('{ from = "0 deg", to = "360 deg", steps = 7 }')
    assert motion('"180 deg"').theta_2 == pi and swept.theta_2 == Sweep(0.0, tau, 7)
    assert swept.branch == -1
    assert motion('{ limit = 2, offset = "1e-9 rad" }').theta_2 == FromLimit(2, 1e-9)
    assert np.array_equal(motion('["0 deg", "180 deg"]').theta_2, [0.0, pi])


FINITE = st.floats(-1e300, 1e300, allow_nan=False)
STEPS = st.integers(1, 10**8)
SWEPT = st.builds(Sweep, FINITE, FINITE, STEPS) | st.builds(
    FromLimit, st.integers(1, 4), FINITE
)
RELEASED = st.builds(Free, st.floats(0.0, 1e300, exclude_min=True), STEPS)
TEXT = st.text(st.characters(exclude_categories=["Cs"]), max_size=20)


@mark.slow
@EXAMPLES
@given(scenes(), st.none() | SWEPT | RELEASED, TEXT, TEXT)
def test_any_scene_reads_back_bit_for_bit(scene, stated, title, source):
    """Beside listed angles: none at all, a sweep, a limit, and a release."""
    motion = scene.motion
    if isinstance(stated, Free):
        motion = Motion(0.1, motion.omega_2, free=stated)
    elif title:
        motion = motion.replace(angle=stated)
    scene = replace(scene, motion=motion, title=title, source=source)
    assert facts(loads(dump(scene))) == facts(scene)


def test_every_letter_of_a_title_reads_back():
    title = "".join(map(chr, range(0x180))) + "\u2028\ufeff\U0001f980"
    assert loads(dump(replace(load(FILES[0]), title=title))).title == title


def test_save_is_whole_or_not_at_all(tmp_path, monkeypatch):
    scene = load(FILES[0])
    target = tmp_path / "scene.toml"
    save(scene, target)
    before = target.read_bytes()
    assert facts(load(target)) == facts(scene)

    def full(_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("os.fsync", full)
    with raises(OSError, match="No space"):
        save(replace(scene, title="other"), target)
    assert target.read_bytes() == before and list(tmp_path.iterdir()) == [target]


def test_what_a_file_cannot_hold_is_refused():
    scene = load(FILES[0])
    with refused("one effect of each kind"):
        dump(replace(scene, effects=(Gravity(), Gravity())))
    with refused("Unicode"):
        dump(replace(scene, title="\ud800"))


@mark.parametrize(
    "key, width, why",
    read_rows("""
bars.input.inertia | 1e-6 | follows the length; state it
bars.input.centre.0 | 1e-3 | follows the length; state it
lengths.input | 0.1 | must be less than the number itself, 0.1 m
loads.0.from_pin.0 | 1e-3 | no number of the scene has this key
motion.theta_2 | 1e-3 | no number of the scene has this key
"""),
)
def test_no_tolerance_is_written_that_reading_refuses(key, width, why):
    scene = crank_rocker(tolerances=(Tolerance(key, float(width)),))
    with refused(key, why):
        dump(scene)


def test_three_sigma_less_than_the_number_are_written_and_more_are_not():
    less, more = (
        crank_rocker(tolerances=(Tolerance("lengths.input", width, sigma=True),))
        for width in (0.033, 0.034)
    )
    assert loads(dump(less)) == less
    with refused("three sigma of it must be less"):
        dump(more)


def test_a_stroke_is_less_than_the_spring_is_long():
    ends = Place(1, (0.03, -1.0)), Place(3, (0.02, 0.3))
    for stroke, words in (
        (0.3, "stroke = 0.3 m: must be less than the"),
        (-0.1, "stroke = -0.1: must be a finite number > 0"),
    ):
        with refused(words):
            Spring(*ends, 10.0, 0.3, stroke=stroke)


@mark.parametrize(
    "length, units, gravity",
    read_rows("""
4 in | lb, in, lb in^2, lbf, lbf in | 9.806686
300 mm | kg, mm, kg m^2, N, N mm | 9.81
30cm | kg, mm, kg m^2, N, N mm | 9.81
2 ft | lb, in, lb in^2, lbf, lbf in | 9.806686
"""),
)
def test_the_comments_of_a_new_file_have_its_units_and_can_be_used(
    length, units, gravity
):
    comment = re.compile(r"^# (?=\w+ = |\[)", re.MULTILINE)
    text = new_scene.write_new_scene([length] * 4)
    scene = loads(comment.sub("", text))
    assert len(scene.loads) == 2 and scene.points and len(scene.effects) == 2
    assert scene.effects[0].magnitude == approx(float(gravity))
    assert scene.motion.omega_2 == approx(2.0 * pi)
    for entry in ("mass", "centre", "inertia", "force", "moment"):
        stated = re.search(rf'^(?:# )?{entry} = \[?"[-\d.]+ ([^"]*)"', text, re.M)
        assert stated is not None and stated[1] in units.split(", "), entry
    bar = scene.linkage.input
    per_length = 0.05 * 0.45359237 / 0.0254 if "lb" in units else 1.0
    assert bar.mass == approx(per_length * bar.length)


def test_a_release_is_written_and_new_bars_weigh_by_their_lengths():
    scene = loads(new_scene.write_new_scene(("300  mm", "100 mm", "250 mm", "220 mm")))
    assert [bar.mass for bar in scene.linkage.moving] == [0.1, 0.25, 0.22]
    released = replace(scene, motion=Motion(1.0, free=Free(1.0, 4)))
    assert loads(dump(released)) == released
