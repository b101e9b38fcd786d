"""Tolerances: samples against first order and against cases known by hand.

What a file may not state.
"""

import json
import math
import re
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from pytest import approx, raises
from scipy.stats import norm

import fourbar.formulas.mobility
from fourbar import Bar, FourBar, InputError, Motion, Scene, Sweep, Tolerance, uniform
from fourbar.cli import status
from fourbar.files import dump, loads
from fourbar.show.tolerances import describe_parted
from fourbar.studies import spread as studied
from fourbar.studies.spread import tolerances
from tests.support.scenes import crank_rocker

MODEL = (Path(__file__).parents[3] / "models" / "crank_rocker.toml").read_text()
TABLE = (
    '[tolerances]\n"lengths.input" = "0.05 mm"\n'
    'lengths.coupler = ["0.02 mm", "sigma"]\n'
)
QUASI = 0.02
"""Of a standard deviation from 2048 quasi-random samples: a random sample would scatter
by 1/sqrt(2 N) = 0.016.
"""


def spread(*stated, samples=2048, seed=0, **motion):
    linkage = FourBar(0.3, Bar(0.1, 0.2), Bar(0.25, 0.5), Bar(0.22, 0.4))
    case = Scene(
        linkage,
        Motion(**({"theta_2": Sweep(0.3, 6.0, 6), "omega_2": 10.0} | motion)),
        tolerances=stated,
    )
    return tolerances(case, samples, seed)


def test_a_number_that_the_torque_is_proportional_to():
    omega = Tolerance(
        "motion.omega_2", 0.3
    )  # the torque of inertia alone is proportional to its square
    study = spread(omega)
    torque = study.spreads["torque"]
    size = np.abs(torque.nominal)
    assert_allclose(
        np.fmax(np.abs(torque.least), np.abs(torque.greatest)), 1.0609 * size, rtol=1e-4
    )
    assert_allclose(torque.worst, 2 * 0.03 * size, rtol=1e-12)
    assert_allclose(torque.first_order, 2 * 0.03 / math.sqrt(3) * size, rtol=1e-12)
    assert_allclose(torque.deviation, torque.first_order, rtol=QUASI)
    assert_allclose(study.spreads["theta_4"].deviation, 0.0, atol=1e-14)
    assert not torque.parted.any() and study.apart == study.invalid == 0


def test_a_normal_tolerance_is_drawn_as_far_out_as_the_samples_go():
    """Of n numbers the k-th is the quantile (k + 1/2)/n, within one of n."""
    study = spread(Tolerance("lengths.output", 2e-5, True))
    theta = study.spreads["theta_4"]
    for end in (theta.least, theta.greatest):
        sigmas = np.abs(end - theta.nominal) / theta.first_order
        assert (sigmas > norm.isf(1.0 / 2048)).all()


def test_samples_agree_with_first_order_where_it_is_straight_and_so_do_the_shares():
    both = Tolerance("lengths.input", 5e-5), Tolerance("lengths.output", 2e-5, True)
    study, alone = spread(*both), [spread(tolerance) for tolerance in both]
    for name in ("torque", "|F12|", "F43_x", "theta_4"):
        of_both = study.spreads[name]
        assert_allclose(of_both.deviation, of_both.first_order, rtol=QUASI)
        for share, one in zip(of_both.shares, alone, strict=True):
            assert_allclose(np.sqrt(share), one.spreads[name].deviation, rtol=QUASI)
        assert (of_both.least <= of_both.low).all()
        assert (of_both.low < of_both.nominal).all()
        assert (of_both.high <= of_both.greatest).all()


def test_the_same_seed_gives_the_same_samples_in_blocks_of_any_size(monkeypatch):
    loose = Tolerance("lengths.input", 5e-5), Tolerance("lengths.coupler", 2e-5)
    at_once = spread(*loose, samples=100)
    monkeypatch.setattr(studied, "EVALUATED_AT_ONCE", 200)
    pieces = spread(*loose, samples=100)
    for name, in_one in at_once.spreads.items():
        for expected, piece in zip(in_one, pieces.spreads[name], strict=True):
            assert_allclose(expected, piece, rtol=1e-12, atol=1e-12, err_msg=name)


def test_a_generator_draws_the_samples_of_its_seed():
    loose = Tolerance("lengths.input", 5e-5)
    by_seed = spread(loose, samples=64, seed=7)
    by_generator = spread(loose, samples=64, seed=np.random.default_rng(7))
    for name, expected in by_seed.spreads.items():
        assert_array_equal(expected.low, by_generator.spreads[name].low)
    assert by_generator.seed is None
    assert "(a generator's)" in repr(by_generator)


@pytest.mark.parametrize("seed", [-1, True, 1.5, "1", None])
def test_what_is_no_seed_is_refused(seed):
    with raises(InputError, match="Generator"):
        spread(Tolerance("lengths.input", 5e-5), samples=64, seed=seed)


def test_members_that_come_apart_are_counted_and_first_order_is_not_trusted_there():
    linkage = uniform(0.2, 0.48, 0.55, 0.2)
    edge = fourbar.formulas.mobility.limit_positions(linkage)[0].theta_2
    theta_2 = edge + 2e-4 * np.sign(
        fourbar.formulas.mobility.choose_range(linkage)[0] - edge
    )
    case = Scene(
        linkage,
        Motion(np.array([theta_2, theta_2 + 0.3]), 1.0),
        tolerances=(Tolerance("lengths.output", 2e-4),),
    )
    study = tolerances(case, 256)
    assert 0 < study.apart == study.without[0] < 256 and study.without[1] == 0
    assert study.spreads["torque"].parted.tolist() == [True, False]


def test_tolerances_of_a_file_come_back_as_they_were():
    scene = loads(MODEL + TABLE)
    assert scene.tolerances == (
        Tolerance("lengths.input", 5e-5),
        Tolerance("lengths.coupler", 2e-5, True),
    )
    assert loads(dump(scene)).tolerances == scene.tolerances


@pytest.mark.parametrize(
    "line, words",
    [
        ('"lengths.input" = "150 mm"', "less than the number itself, 0.1 m"),
        ('"lengths.input" = ["40 mm", "sigma"]', "three sigma of it must be less"),
        ('"lengths.inptu" = "1 mm"', 'did you mean "lengths.input"'),
        ('"lengths.input" = "1 deg"', '"deg" does not convert to m'),
        ('"lengths.input" = 0.1', "with a unit"),
        ('"lengths.input" = ["1 mm", "normal"]', '"sigma"]'),
        ('"lengths.input" = "0 mm"', "> 0"),
        ('"bars.input.inertia" = "1 kg m^2"', "follows the length"),
        ('"bars.input.centre" = "1 mm"', "is more than one number"),
        ('"motion.theta_2" = "1 deg"', "a commanded value has no tolerance"),
    ],
)
def test_a_bad_tolerance_is_one_line(line, words):
    with raises(InputError) as error:
        loads(MODEL + "[tolerances]\n" + line, "s.toml")
    text = str(error.value)
    assert words in text and text.startswith("s.toml: tolerances") and "\n" not in text


def test_the_positions_at_which_first_order_fails_are_named_each():
    study = SimpleNamespace(
        theta_2=np.radians(np.arange(0.0, 361.0, 5.0)),
        spreads={
            "torque": SimpleNamespace(parted=np.isin(np.arange(73), (0, 1, 9, 72)))
        },
    )
    assert "at 4 of 73 positions (theta_2 = 0 to 5, 45, 360 deg)" in describe_parted(
        study, "torque"
    )


def test_what_the_study_refuses():
    for stated, words in (
        ((), "states none"),
        ((Tolerance("lengths.x", 1.0),), "did you mean"),
        ((Tolerance("bars.input.inertia", 1.0),), "left out"),
    ):
        with raises(InputError, match=words):
            spread(*stated)
    for samples in (1, 2.5, 10**9):
        with raises(InputError, match="whole number"):
            spread(Tolerance("lengths.input", 1e-5), samples=samples)


@pytest.mark.slow
def test_the_command_prints_draws_and_writes(tmp_path, capsys):
    scene, plot = tmp_path / "s.toml", tmp_path / "t.png"
    text = MODEL.replace("steps = 360", "steps = 12")
    scene.write_text(text + TABLE)
    assert status(["tolerance", str(scene), "--samples", "64", "-o", str(plot)]) == 0
    printed = capsys.readouterr().out
    assert "64 samples (seed 0), 13 positions" in printed and "lengths.input" in printed
    assert plot.read_bytes().startswith(b"\x89PNG")
    nominal = re.search(r"^torque +N m +\S+ +(\S+)", printed, re.M)
    assert (
        status(["tolerance", str(scene), "--samples", "64", "--units", "N.mm rad"]) == 0
    )
    rows = capsys.readouterr().out
    in_N_mm = re.search(r"^torque N mm +\S+ +(\S+)", rows, re.M)
    assert nominal
    assert in_N_mm
    assert float(in_N_mm[1]) == approx(1000.0 * float(nominal[1]), rel=1e-5)
    assert re.search(r"unit +rad +nominal", rows)
    assert status(["tolerance", str(scene), "--samples", "64", "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    torque = document["quantities"]["torque"]
    assert len(torque["deviation"]) == 13
    assert document["tolerances"]["lengths.coupler"]["distribution"] == "normal"
    scene.write_text(
        text + TABLE + '\n[points]\nv = { bar = 3, from_pin = ["5 cm", "20 deg"] }\n'
    )
    assert status(["tolerance", str(scene), "--samples", "64"]) == 0
    assert re.search(
        r"^v_x +mm ", capsys.readouterr().out, re.M
    )  # a place, though v_ begins a velocity
    assert status(["tolerance", str(scene), "-o", "t.bmp"]) == 2
    scene.write_text(text)
    assert status(["tolerance", str(scene)]) == 2
    assert "tolerances: the scene states none" in capsys.readouterr().err


@pytest.mark.slow
def test_the_share_that_is_done_is_told_from_the_start_and_reaches_all_of_it():
    told = []
    scene = crank_rocker(tolerances=(Tolerance("lengths.input", 5e-5),))
    tolerances(scene, 16384, progress=told.append)
    assert told[0] == 0.0
    assert told[-1] == 1.0
    assert len(told) > 3
    assert np.all(np.diff(told) > 0.0)


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


def test_samples_of_a_drawing_have_its_coordinates_and_units(tmp_path, capsys):
    """The nominal place is as drawn, and the samples lie about it."""
    (tmp_path / "drawn.toml").write_text(DRAWN)
    assert status(["tolerance", str(tmp_path / "drawn.toml"), "--samples", "64"]) == 0
    printed = capsys.readouterr().out
    for name, drawn in (("P_x", 45.0), ("P_y", 11.0)):
        row = re.search(rf"^{name} +in +(.*)$", printed, re.M)
        assert row is not None, printed
        _, nominal, sigma, *band, _ = map(float, row[1].split())
        assert nominal == drawn
        assert band == approx([drawn] * 4, abs=0.03)
        assert 0.001 < sigma < 0.02
    above = printed[: printed.index("  theta_2")].splitlines()
    assert max(map(len, above)) <= 80
