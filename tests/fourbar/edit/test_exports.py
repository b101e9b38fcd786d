"""The largest numbers beside the drawing are those that `analyze` prints."""

import re
from dataclasses import replace

from pytest import importorskip, mark

from fourbar import load, solve
from fourbar.show.shown_units import COMMON

importorskip(
    "tomlkit",
    reason="the workbench edits scene files by tomlkit: pip install tomlkit",
)
from fourbar.edit.exports import evaluate_scene
from fourbar_validation.places import MODELS
from tests.support.block import read_block
from tests.support.rows import slow_but
from tests.support.scenes import RESTING

BOUNDED = (
    "crank_rocker",
    "drag_link",
    "gallery/bonnet_hinge",
    "capabilities/cylinder_3_4",
)
UNBOUNDED = ("thesis", "capabilities/cylinder_1_4", "capabilities/cylinder_1_2")


def load_coarse(name):
    """Load a scene with a tenth of its positions, between which its peaks lie."""
    scene = load(MODELS / f"{name}.toml")
    steps = max(len(solve(scene, "position")) // 10, 12)
    coarse = replace(scene.motion.angle, steps=steps)
    return replace(scene, motion=scene.motion.replace(angle=coarse))


@mark.parametrize(
    "name",
    slow_but({"gallery/bonnet_hinge", "capabilities/cylinder_3_4"}, BOUNDED),
)
def test_at_rest_the_headline_has_the_numbers_of_analyze(name):
    scene = load_coarse(name)
    block = read_block(solve(scene), COMMON)
    drive, pins, _ = evaluate_scene(scene, COMMON, settled=True)["headline"].split("; ")
    peak = re.sub(r"^peak (torque|drive force) ", "", drive)
    assert re.search(rf"(torque|force) +peak -?{re.escape(peak)} at", block), drive
    assert re.fullmatch(r"largest pin force (\S+ \S+) at \w\d?", pins)[1] in block, pins


def test_the_headline_says_that_dry_friction_at_rest_is_left_out():
    headline = evaluate_scene(RESTING, COMMON)["headline"]
    assert "; dry friction at rest taken as 0; " in headline


@mark.parametrize(
    "name",
    slow_but({"thesis"}, UNBOUNDED),
)
def test_what_grows_without_bound_is_no_number(name):
    data = evaluate_scene(load(MODELS / f"{name}.toml"), COMMON, settled=True)
    drive, pins, _ = data["headline"].split("; ")
    assert re.fullmatch("peak (torque|drive force) grows without bound", drive)
    assert re.match("largest pin force grows without bound at O2", pins)
    unbounded = {name for name, peak in data["peaks"].items() if peak is None}
    assert unbounded & {"torque", "drive_force"}


@mark.slow
def test_a_balanced_drive_has_no_peak_of_rounding():
    """Nothing acts on this linkage at a constant speed but inertia, which is zero."""
    scene = load(MODELS / "capabilities/parallelogram.toml")
    gravity_only = replace(scene, effects=(), loads=())
    assert evaluate_scene(gravity_only, COMMON, settled=True)["peaks"]["torque"] == 0.0
    headline = evaluate_scene(gravity_only, COMMON)["headline"]
    assert headline.startswith("peak torque at least 0 N m; ")
