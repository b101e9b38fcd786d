"""Tolerances: samples against first order and against cases known by hand.

What a file may not state.
"""

import json
import re
from math import copysign, sqrt
from types import SimpleNamespace

import numpy as np
from numpy.testing import assert_allclose, assert_array_equal
from pytest import approx, mark
from scipy.stats import norm

from fourbar import (
    Friction,
    Gravity,
    Motion,
    Scene,
    Sweep,
    Tolerance,
    tolerances,
    uniform,
)
from fourbar.files import loads
from fourbar.formulas.mobility import choose_range, limit_positions
from fourbar.show.lines import BLOCK_WIDTH
from fourbar.show.tolerances import describe_parted, write_spreads
from fourbar.solution import DEGREES
from fourbar.studies import spread as studied
from fourbar_validation.places import MODELS
from tests.support.rows import read_rows, refused
from tests.support.scenes import crank_rocker

MODEL = (MODELS / "crank_rocker.toml").read_text()


TABLE = (
    '[tolerances]\n"lengths.input" = "0.05 mm"\n'
    'lengths.coupler = ["0.02 mm", "sigma"]\n'
)


QUASI = 0.02
"""Of a standard deviation from 2048 quasi-random samples: a random sample would scatter
by 1/sqrt(2 N) = 0.016.
"""


def spread(*stated, samples=2048, seed=0, **motion):
    moving = {"theta_2": Sweep(0.3, 6.0, 6), "omega_2": 10.0} | motion
    free = {"loads": (), "effects": (), "tolerances": stated}
    return tolerances(crank_rocker(Motion(**moving), **free), samples, seed)


def test_a_number_that_the_torque_is_proportional_to():
    # the torque of inertia alone is proportional to its square
    study = spread(Tolerance("motion.omega_2", 0.3))
    torque = study.spreads["torque"]
    size = abs(torque.nominal)
    most = np.fmax(abs(torque.least), abs(torque.greatest))
    assert_allclose(most, 1.0609 * size, rtol=1e-4)
    assert_allclose(torque.worst, 2 * 0.03 * size, rtol=1e-12)
    assert_allclose(torque.first_order, 2 * 0.03 / sqrt(3) * size, rtol=1e-12)
    assert_allclose(torque.deviation, torque.first_order, rtol=QUASI)
    # of 1 % and of 99 % of an even distribution
    band = np.multiply.outer((0.9706**2, 1.0294**2), torque.nominal)
    assert_allclose((torque.low, torque.high), np.sort(band, axis=0), rtol=1e-4)
    assert_allclose(study.spreads["theta_4"].deviation, 0.0, atol=1e-14)
    assert not torque.parted.any() and study.apart == study.invalid == 0


def test_friction_at_rest_moves_what_it_holds_and_no_torque():
    stated = (Tolerance("effects.friction.O2", 0.01),)
    effects = Gravity(), Friction.at(O2=0.05)
    motion = Motion([0.4, 1.9], 0.0)
    study = tolerances(crank_rocker(motion, effects=effects, tolerances=stated))
    for name, width in (("torque", 0.0), ("torque_low", 0.01), ("torque_high", 0.01)):
        assert_allclose(study.spreads[name].worst, width, rtol=1e-9, atol=1e-12)
        sigma = study.spreads[name].deviation
        assert_allclose(sigma, width / sqrt(3), rtol=QUASI, atol=1e-12)
    lines = write_spreads(study, DEGREES, None).split("\n")
    assert "  torque_high: 100 % effects.friction.O2" in lines
    assert max(map(len, lines)) <= BLOCK_WIDTH


def test_a_normal_tolerance_is_drawn_as_far_out_as_the_samples_go():
    """Of n numbers the k-th is the quantile (k + 1/2)/n, within one of n."""
    theta = spread(Tolerance("lengths.output", 2e-5, True)).spreads["theta_4"]
    for end in (theta.least, theta.greatest):
        sigmas = abs(end - theta.nominal) / theta.first_order
        assert (sigmas > norm.isf(1.0 / 2048)).all()


def test_the_same_seed_gives_the_same_samples_in_blocks_of_any_size(monkeypatch):
    """A generator draws those of its seed."""
    loose = Tolerance("lengths.input", 5e-5), Tolerance("lengths.coupler", 2e-5)
    at_once = spread(*loose, samples=100, seed=7)
    drawn = spread(*loose, samples=100, seed=np.random.default_rng(7))
    monkeypatch.setattr(studied, "EVALUATED_AT_ONCE", 200)
    pieces = spread(*loose, samples=100, seed=7)
    for name, in_one in at_once.spreads.items():
        assert_array_equal(in_one.low, drawn.spreads[name].low)
        for expected, piece in zip(in_one, pieces.spreads[name], strict=True):
            assert_allclose(expected, piece, rtol=1e-12, atol=1e-12, err_msg=name)
    assert drawn.seed is None and "(a generator's)" in repr(drawn)


def test_members_that_come_apart_are_counted_and_first_order_is_not_trusted_there():
    linkage = uniform(0.2, 0.48, 0.55, 0.2)
    edge = limit_positions(linkage)[0].theta_2
    beside = edge + copysign(2e-4, choose_range(linkage)[0] - edge)
    loose = (Tolerance("lengths.output", 2e-4),)
    motion = Motion(np.array([beside, beside + 0.3]), 1.0)
    study = tolerances(Scene(linkage, motion, tolerances=loose), 256)
    assert 0 < study.apart == study.without[0] < 256 and study.without[1] == 0
    assert study.spreads["torque"].parted.tolist() == [True, False]


BAD = read_rows("""
"lengths.input" = "150 mm" | less than the number itself, 0.1 m
"lengths.input" = ["40 mm", "sigma"] | three sigma of it must be less
"lengths.inptu" = "1 mm" | must be among lengths.input
"lengths.input" = "1 deg" | "deg" does not convert to m
"lengths.input" = 0.1 | the unit is missing
"lengths.input" = ["1 mm", "normal"] | "sigma"]
"lengths.input" = "0 mm" | > 0
"bars.input.inertia" = "1 kg m^2" | follows the length
"bars.input.centre" = "1 mm" | must be among bars.input.centre.0
"motion.theta_2" = "1 deg" | a commanded value has no tolerance
"motion.law.rise.0" = "1 deg" | a commanded value has no tolerance
""")


@mark.parametrize("line, words", BAD)
def test_a_bad_tolerance_is_one_line(line, words):
    with refused(words, start="s.toml: tolerances"):
        loads(MODEL + "[tolerances]\n" + line, "s.toml")


def test_the_positions_at_which_first_order_fails_are_named_each():
    parted = np.isin(np.arange(73), (0, 1, 9, 72, 40))
    first_order = np.where(np.arange(73) == 40, np.nan, 1.0)
    parted = SimpleNamespace(parted=parted, first_order=first_order)
    degrees = np.radians(np.arange(0.0, 361.0, 5.0))
    study = SimpleNamespace(theta_2=degrees, spreads={"torque": parted}, time=None)
    differ, alone = describe_parted(study, "torque")
    assert "at 4 of 73 positions (theta_2 = 0 to 5, 45, 360 deg)" in differ
    assert "first order has no value at 1 of 73 positions (theta_2 = 200" in alone
    study.time = np.arange(73.0)  # of a law, which passes an angle twice
    assert "(time = 0 to 1, 9, 72 s)" in describe_parted(study, "torque")[0]


INPUT = Tolerance("lengths.input", 5e-5)


@mark.parametrize(
    "stated, options, words",
    [
        ((), {}, "states none"),
        ((Tolerance("lengths.x", 1.0),), {}, "must be among lengths."),
        ((Tolerance("bars.input.inertia", 1.0),), {}, "left out"),
        *(((INPUT,), {"samples": n}, "whole number") for n in (1, 2.5, 10**9)),
        *(((INPUT,), {"seed": x}, "Generator") for x in (-1, True, 1.5, "1", None)),
    ],
)
def test_what_the_study_refuses(stated, options, words):
    with refused(words):
        spread(*stated, **{"samples": 64, **options})


def test_the_command_prints_draws_and_writes(tmp_path, show, run):
    scene, plot = tmp_path / "s.toml", tmp_path / "t.png"
    text = MODEL.replace("steps = 360", "steps = 12")
    # a place, though v_ begins a velocity
    point = '\n[points]\nv = { bar = 3, from_pin = ["5 cm", "20 deg"] }\n'
    scene.write_text(text + TABLE)
    command = "tolerance", scene, "--samples", 64
    printed = show(*command, "-o", plot)
    assert "64 samples (seed 0), 13 positions" in printed and "lengths.input" in printed
    assert plot.read_bytes().startswith(b"\x89PNG")
    for part, unit in (("torque", "N m"), ("theta_4", "deg")):
        assert re.search(rf"^{part} +{unit} ", printed, re.M)
    in_N_mm = show(*command, "--units", "N.mm rad")
    assert re.search(r"^torque +N mm ", in_N_mm, re.M)
    assert re.search(r"unit +rad +nominal", in_N_mm)
    document = json.loads(show(*command, "--json"))
    assert len(document["quantities"]["torque"]["deviation"]) == 13
    assert document["tolerances"]["lengths.coupler"]["distribution"] == "normal"
    assert run(*command, "-o", "t.bmp")[0] == 2
    scene.write_text(text + TABLE + point)
    assert re.search(r"^v_x +mm ", show(*command), re.M)
    scene.write_text(text)
    code, _, err = run(*command)
    assert code == 2 and "tolerances: the scene states none" in err


DRAWN = """\
title = "Drawn away from the origin"
[pins]
O2 = ["40 in", "8 in"]
A = ["40 in", "12 in"]
B = ["47 in", "10 in"]
O4 = ["50 in", "10 in"]
[points]
P = { bar = 3, drawn = ["45 in", "11 in"] }
[motion]
theta_2 = "drawn"
[tolerances]
"lengths.coupler" = "0.01 in"
"""


def test_samples_of_a_drawing_have_its_coordinates_and_units(tmp_path, show):
    """The nominal place is as drawn, and the samples lie about it."""
    (tmp_path / "drawn.toml").write_text(DRAWN)
    printed = show("tolerance", "drawn.toml", "--samples", 64)
    for name, drawn in (("P_x", 45.0), ("P_y", 11.0)):
        row = re.search(rf"^{name} +in +(.*)$", printed, re.M)
        assert row is not None, printed
        _, nominal, sigma, *band, _ = map(float, row[1].split())
        assert nominal == drawn
        assert band == approx([drawn] * 4, abs=0.03)
        assert 0.001 < sigma < 0.02
    assert max(map(len, printed[: printed.index("  theta_2")].splitlines())) <= 80


def test_the_share_that_is_done_reaches_all_of_it():
    told = []
    tolerances(crank_rocker(tolerances=(INPUT,)), 64, progress=told.append)
    assert (told[0], told[-1]) == (0.0, 1.0)
