"""The page on the cost of accuracy: its numbers are computed again, its pictures drawn
again from few points.
"""

import math
import re
import runpy
from dataclasses import replace

from pytest import approx, mark

from fourbar.files import load
from fourbar.scene import command
from fourbar.show.plot.style import apply_style
from fourbar_validation.advise.matters import compute_errors, judge_trial
from fourbar_validation.cost import work_precision
from fourbar_validation.cost.work_precision import BEST, MUJOCO_TIMESTEP
from fourbar_validation.engines.mujoco.trial import (
    TrialSetup,
    make_settings,
    restore_defaults,
)
from fourbar_validation.report.svg import write_alone
from tests.support.checkout import ROOT, find_lines, read, read_table

PAGE = read("docs/cost.md")
README = read("README.md")
SCENE = load(ROOT / "models/crank_rocker.toml")
PRINTED = 0.06
"""Two printed digits, of the error and of the settings, hold an error to this part."""
DRAWS = runpy.run_path(ROOT / "docs/cost.py")


ROWS = read_table(PAGE, "settings")


def read_settings(text, steps):
    """Read settings as the page words them."""
    constant = float(re.findall(r"tc = (\S+) steps", text)[0])
    tolerance = float(re.findall(r"tolerance ([^,]+)", text)[0])
    return replace(
        make_settings(steps, constant),
        pad=None if "no pads" in text else "fitted",
        tolerance=tolerance,
        iterations=10 if tolerance == 0.0 else 100,
        flywheel=float(re.findall(r"flywheel (\S+)", text)[0]),
    )


def compute_row(text, steps, folder):
    """Compute the errors of a row of the table."""
    if "defaults" not in text:
        setup = TrialSetup(SCENE, command(SCENE))
        return judge_trial(SCENE, setup.try_out(read_settings(text, steps)))
    if "Euler" in text:
        steps = 2.0 * math.pi / float(SCENE.motion.omega_2) / MUJOCO_TIMESTEP
    settings = replace(
        BEST, pad=None, integrator=text.partition(",")[0], steps_per_revolution=steps
    )
    setup = work_precision.CostStudy("page", SCENE, folder).setup(settled=True)
    trial = setup.try_out(settings, restore_defaults)
    work_precision._leave_out_first(trial)
    return compute_errors(SCENE, trial.at, trial.quantities)


@mark.parametrize("row", ROWS, ids=[row[0] for row in ROWS])
def test_the_errors_of_the_table_are_computed_again(row, tmp_path):
    text, steps, torque, force, _ = row
    errors = compute_row(text, float(steps), tmp_path)
    assert errors.torque == approx(float(torque), rel=PRINTED)
    assert errors.force == approx(float(force), rel=PRINTED)


def test_the_first_sentences_are_those_of_the_table():
    six = next(row for row in ROWS if row[1] == "104")
    default = next(row for row in ROWS if row[0] == "Euler, MuJoCo's defaults")
    assert float(six[3]) < 1e-6
    assert f"Six digits of every pin force cost {six[4]} ms" in PAGE
    assert f"MuJoCo's defaults cost {default[4]} ms for two digits" in PAGE
    assert f"Six digits of every pin force cost MuJoCo {six[4]} ms" in README
    assert f"This costs {six[4]} ms of processor time" in README
    (friction,) = find_lines(r"^\|friction\|[^|]*\|\+([^|]*)\|", PAGE)
    assert f"Dry friction adds {friction} to a step" in README
    assert 1e-3 < float(default[3]) < 1e-2


def read_words(svg):
    """Read what is written in a picture, but for lines with numbers."""
    texts = re.findall(r"<text[^>]*>([^<]*)</text>", svg)
    return {text for text in texts if text.strip() and not re.search(r"\d", text)}


@mark.slow
@mark.parametrize("name", ["hard", "effects", "small-hard", "small-effects"])
def test_the_other_pictures_are_those_that_are_drawn(name):
    with apply_style():
        drawn = write_alone(DRAWS[f"draw_{name.replace('-', '_')}"](), name)
    assert read_words(drawn) == read_words(read(f"docs/cost/{name}.svg"))


def test_every_point_of_the_hard_picture_stays_below_the_limit():
    """The title of the picture says so; each engine has points on three approaches."""
    points = list(DRAWS["list_hard_points"]())
    engines = [engine for *_, engine in points]
    assert min(map(engines.count, engines)) == 3
    for condition, error, engine in points:
        assert (error <= DRAWS["K"] * DRAWS["EPS"] / condition).all(), engine
