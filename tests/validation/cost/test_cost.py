"""What accuracy costs.

The laws hold, every method is right at its own price, a study is resumed where it
stopped.
"""

import json
import re
from dataclasses import replace
from itertools import combinations
from math import inf, pi, radians

import numpy as np
from click.testing import CliRunner
from pytest import approx, mark, raises
from scipy.interpolate import make_interp_spline

import fourbar
from fourbar import Motion, Scene, Sweep, dump, solve
from fourbar.errors import LimitError
from fourbar.scene import command, command_at
from fourbar.show.plot.style import apply_style
from fourbar_lab.contenders import CONTENDED_LINKAGE
from fourbar_lab.fault_scenes import FAULT_SCENES
from fourbar_validation.advise.clocks import summarise_timings
from fourbar_validation.advise.matters import (
    ERROR_NAMES,
    INFINITE_ERRORS,
    WorstErrors,
    compute_errors,
    judge_trial,
)
from fourbar_validation.cost import charts, laws, work_precision
from fourbar_validation.cost.cost import cost, list_front
from fourbar_validation.cost.work_precision import BEST, Spot
from fourbar_validation.engines.mujoco.trial import JudgedSetup, TrialSetup
from fourbar_validation.scenes.suites import MODELS
from tests.support.checkout import find_lines, read
from tests.support.costs import point
from tests.support.rows import slow_but
from tests.support.scenes import (
    CYLINDER,
    UNIFORM_PARALLELOGRAM,
    WEIGHT,
    crank_rocker,
    recommand,
)


def turning(omega=10.0, positions=36):
    """Return the crank-rocker a = 0.1, b = 0.25, c = 0.22, d = 0.3 m with gravity, over
    a revolution.
    """
    return Scene(
        CONTENDED_LINKAGE,
        Motion(Sweep(0.0, 2.0 * pi, positions), omega),
        effects=WEIGHT,
    )


def tried(scene):
    setup = TrialSetup(scene, command(scene))

    def error(settings):
        trial = setup.try_out(settings)
        if trial.broken:
            return INFINITE_ERRORS
        return compute_errors(scene, trial.at, trial.quantities)

    return error


@mark.slow
@mark.parametrize(
    "integrator, order, first",
    [("Euler", 1.0, 160), ("implicitfast", 1.0, 160), ("RK4", 4.0, 40)],
)
def test_each_integrator_shows_its_order(integrator, order, first):
    steps = [first * 2**k for k in range(4)]
    error = tried(turning())
    settings = replace(BEST, integrator=integrator)
    points = [
        error(
            replace(settings, steps_per_revolution=n, time_constant_steps=n / 4)
        ).worst
        for n in steps
    ]
    exponent, sigma = laws.fit([1.0 / n for n in steps], points)
    assert abs(exponent - order) <= max(2.0 * sigma, laws.WITHIN), points


@mark.slow
def test_softness_is_proportional_to_1_minus_d_and_sags_with_the_square_of_tc():
    plain = replace(BEST, pad=None, time_constant_steps=10.0)
    fast, slow = tried(turning()), tried(turning(0.1))
    softness, tc = (1e-3, 1e-4), (5.0, 10.0, 20.0)
    for error in (fast, slow):
        errors = [error(replace(plain, impedance=1.0 - x)).worst for x in softness]
        slope, _ = laws.fit(softness, errors)
        assert abs(slope - 1.0) <= laws.WITHIN
    at_tc = [replace(plain, time_constant_steps=x) for x in tc]
    slope, _ = laws.fit(tc, [slow(settings).worst for settings in at_tc])
    assert abs(slope - 2.0) <= laws.WITHIN
    # without gravity and at speed the second group is not there
    assert fast(at_tc[2]).worst < 2.0 * fast(at_tc[1]).worst


@mark.slow
def test_the_defaults_stay_at_their_floor_at_every_timestep(tmp_path):
    made = work_precision.CostStudy("s", turning(), tmp_path)
    curves = {curve.name: curve for curve in work_precision.design_curves(turning())}
    curve = curves["RK4, MuJoCo's defaults"]
    spots = tuple(spot for spot in curve.spots if spot.x in (320, 2560))
    coarse, fine = (p.at_steps for p in made._try_curve(replace(curve, spots=spots)))
    assert fine.worst > laws.FLOORED * coarse.worst
    assert fine.torque == approx(4e-3, rel=0.3)
    assert fine.force == approx(7e-3, rel=0.3)


@mark.slow
def test_a_study_past_a_change_point_stays_on_the_assembly(tmp_path):
    """The sign of an antiparallelogram's sine changes there; its assembly does not."""
    motion = Motion(Sweep(radians(200.0), radians(340.0), 20), 10.0, branch=-1)
    scene = Scene(UNIFORM_PARALLELOGRAM, motion, effects=WEIGHT)
    made = work_precision.CostStudy("past a change point", scene, tmp_path)
    assert tried(scene)(replace(BEST, steps_per_revolution=640)).worst < 1e-4
    assert all(p.errors.worst < 1e-11 for p in made._time_inverse())


def test_formulas_are_right_to_round_off(tmp_path):
    made = work_precision.CostStudy("s", crank_rocker(), tmp_path)
    (point_of_formulas,) = made._time_formulas()
    assert point_of_formulas.errors.worst < 1e-13
    made.scene = replace(made.scene, effects=(fourbar.PinFriction.at(A=(0.2, 0.02)),))
    with raises(LimitError, match="ball arithmetic: the effect 'pin_friction"):
        next(made._time_formulas())


def test_a_drive_at_rest_has_no_small_error():
    still = replace(recommand(turning(positions=8), speed=0.0), drive_bar=4)
    solution = solve(still, "force")
    numbers = {name: solution[name] for name in ERROR_NAMES}
    assert compute_errors(still, command(still), numbers).torque == inf


def change(rung, **errors):
    """Return a point with other errors of some quantities."""
    return replace(
        rung,
        errors=rung.errors._replace(**errors),
        at_steps=rung.at_steps._replace(**errors),
    )


def fit_by_quantity(curves):
    return {law.quantity: law for law in laws.fit_laws(curves)}


JUMPING = (6.4e-2, 3.2e-2, 1.6e-2, 8e-3, 4e-3, 0.44, 1e-3, 5e-4)
"""Of one pin force in steps doubled from 20 on: first order but for one point, which is
no longer the motion.
"""


@mark.parametrize(
    "jumping",
    [
        JUMPING,
        (*JUMPING[:5], 9e-2, *JUMPING[6:]),
        (*JUMPING[:5], inf, *JUMPING[6:]),
    ],
)
def test_a_jump_in_one_pin_force_is_named_and_its_law_fails(jumping):
    ladder = [
        change(point(20.0 * 2**k, 0.05 / 2**k), F43=error)
        for k, error in enumerate(jumping)
    ]
    laws_found = fit_by_quantity({"Euler, tc held": ladder})
    assert [name for name, law in laws_found.items() if not law.holds] == ["F43"]
    assert laws_found["F43"].decided
    jump = f"jumps from 4.0e-03 to {jumping[5]:.1e} at 640 steps a revolution"
    (line,) = laws.write_laws(list(laws_found.values()))
    assert f"; F43: FAILS, {jump}" in line
    assert "torque, F12, F32, F14: holds, 1.00" in line


def test_each_quantity_has_its_own_order_and_floor():
    ladder = [
        change(point(20.0 * 2**k, 2.0 ** (-4 * k - 8)), F14=0.05 / 2**k, F32=1e-3)
        for k in range(8)
    ]
    laws_found = fit_by_quantity({"RK4, tc held": ladder})
    assert laws_found["torque"].holds and not laws_found["F14"].holds
    assert laws_found["F14"].exponent == approx(1.0)
    assert not laws_found["F32"].decided and laws.find_floor(ladder, "F32") == 1e-3


def test_a_quantity_that_no_timestep_brings_down_is_no_law_and_is_reported():
    """In the thesis's mechanism the torque falls by its order with Euler.

    The pin forces are wrong throughout.
    """
    ladder = [
        change(point(160.0 * 2**k, 0.05 / 2**k), F12=error)
        for k, error in enumerate((1.8, 0.9, 1.1, 0.7))
    ]
    laws_found = fit_by_quantity({"Euler, tc held": ladder})
    assert laws_found["torque"].holds
    assert not laws_found["F12"].decided and not laws_found["F12"].holds
    assert str(laws_found["F12"]) == "no fit, 0 points above the floor and below 0.1"


def test_a_study_is_resumed_where_it_was_interrupted(tmp_path):
    done = []

    def units(stop):
        made = work_precision.CostStudy("s", turning(), tmp_path)

        def unit(name):
            if name == stop:
                raise KeyboardInterrupt
            done.append(name)
            return [point(10, 1e-3, name)]

        made.units = {name: lambda name=name: unit(name) for name in ("a", "b", "c")}  # type: ignore[misc]
        return made

    with raises(KeyboardInterrupt):
        list(units("b").points())
    curves = [p.curve for row in dict(units(None).points()).values() for p in row]
    assert done == curves == ["a", "b", "c"]
    stated = json.loads((tmp_path / "run.json").read_text())
    assert stated["study"] == work_precision.STUDY_VERSION
    # another scene in the same folder starts over
    second_study = work_precision.CostStudy("s", turning(20.0), tmp_path)
    second_study.units = {}
    assert not list(second_study.points()) and not list((tmp_path / "parts").iterdir())


def measure(scene, out, *options):
    """Run the command on a scene file."""
    line = [str(scene), "--out", str(out), *options]
    return CliRunner().invoke(cost, line, standalone_mode=False)


@mark.slow
def test_the_command_writes_table_report_and_pictures(tmp_path, monkeypatch):
    scene = tmp_path / "small.toml"
    scene.write_text(dump(turning(positions=12)))
    few = {"RK4, tc held", "RK4, MuJoCo's defaults", "tolerance, Newton"}
    curves = [one for one in work_precision.design_curves(turning()) if one.name in few]
    monkeypatch.setattr(work_precision, "design_curves", lambda scene: curves)
    monkeypatch.setattr(work_precision, "ERRORS_ADVISED", (1e-3,))
    monkeypatch.setattr(work_precision, "TIMINGS_OF_A_SETTING", 1)
    process = measure(scene, tmp_path / "out")
    assert process.exception is None and process.return_value == 0, process.output
    assert "matters most here. " in process.output and ", because " in process.output
    for what in ("the driving torque", "every pin force"):
        assert re.search(rf"Four digits of {what}: \S+ ms \(", process.output)
    folder = tmp_path / "out" / "small"
    rows = (folder / "cost.csv").read_text().splitlines()
    assert rows[0] == ",".join(work_precision.COST_COLUMNS) and len(rows) > 25
    text = (folder / "cost.md").read_text()
    assert "order of RK4 in the timestep" in text
    (order,) = [line for line in text.splitlines() if "order of RK4" in line]
    assert all(quantity in order for quantity in ERROR_NAMES) and "FAILS" not in order
    stems = ("work-precision-torque", "work-precision-force", "integrator", "solver")
    for stem in stems:
        picture = (folder / f"{stem}.svg").read_text()
        assert picture.startswith("<svg") and "prefers-color-scheme:dark" in picture


def test_a_scene_that_cannot_be_run_through_is_refused_before_anything_is_measured(
    tmp_path,
):
    scene, out = tmp_path / "law.toml", tmp_path / "out"
    scene.write_text(dump(FAULT_SCENES["law_periodic"]))
    error = measure(scene, out).exception
    assert isinstance(error, fourbar.errors.LimitError) and "motion law" in str(error)
    assert not out.exists()


def test_the_least_of_timings_counts_and_the_middle_one_tells_their_scatter():
    assert summarise_timings([1.0, 9.0, 2.0, 2.2, 1.8]) == (1.0, 1.0)


def test_the_front_is_listed_by_what_lies_between_the_steps_too():
    """A point that is right at its steps alone is not on the front."""
    right = WorstErrors(*[1e-9] * len(ERROR_NAMES))
    worse, worst = (replace(point(n, 0.5), at_steps=right) for n in (6, 15))
    assert list_front({"c": [worse, worst, point(10, 1e-2), point(20, 1e-3)]}) == [
        ("c, 6 steps a revolution", "5e-01", "0.01", "0.01"),
        ("c, 10 steps a revolution", "1e-02", "0.02", "0.01"),
        ("c, 20 steps a revolution", "1e-03", "0.04", "0.02"),
    ]


def test_names_in_a_picture_cover_no_other_and_are_not_cut():
    near = {"kind": work_precision.EXACT_MOTION, "seconds_per_second": 0.3}
    curves = {
        "inverse": [
            replace(point(1, 1e-12), setting=name, **near)
            for name in (work_precision.PINOCCHIO, work_precision.MUJOCO_INVERSE)
        ],
        "Euler": [
            replace(point(20, 0.2), setting=laws.DEFAULT, seconds_per_second=0.3)
        ],
        "recommended": [point(20 * 2**k, 1e-3 / 8**k) for k in range(4)],
    }
    with apply_style():
        figure = charts.draw_work_precision(curves, "torque", "title")
    boxes = [text.get_window_extent() for text in figure.axes[0].texts]
    assert len(boxes) == 4
    assert not any(box.overlaps(other) for box, other in combinations(boxes, 2))
    assert all(figure.bbox.x0 <= box.x0 <= box.x1 <= figure.bbox.x1 for box in boxes)


@mark.parametrize("drive", slow_but({3}, [2, 3, 4, None]))
def test_cost_measures_what_advise_measures(drive, tmp_path, monkeypatch):
    """More steps than positions of the scene are judged between the steps as well.

    The last is driven by a cylinder.
    """
    step, reading = 2e-6, 3e-5
    monkeypatch.setattr(
        JudgedSetup,
        "make_clocks",
        lambda *_: (lambda count: step * count, lambda count: reading * count),
    )
    scene = replace(turning(), drive_bar=drive, drive=None if drive else CYLINDER)
    settings = replace(BEST, steps_per_revolution=200.0)
    made = work_precision.CostStudy("s", scene, tmp_path)
    (cost_point,) = made._try_spots("c", (Spot("s", settings),), made.setup())
    trial = JudgedSetup(scene).try_out(settings)
    assert cost_point.errors == judge_trial(scene, trial)
    assert cost_point.at_steps == compute_errors(scene, trial.at, trial.quantities)
    # a torque with poles bends where 200 steps a turn see it too seldom
    ratio = cost_point.errors.worst / cost_point.at_steps.worst
    assert (ratio > 10.0) == (drive != 2)
    seconds = step * trial.steps + reading * trial.readings
    assert cost_point.seconds_per_revolution == approx(seconds, rel=1e-12)


@mark.parametrize("drive, column", [(2, 1), (4, 3)])
def test_the_page_tells_what_a_curve_through_samples_misses(drive, column):
    page = read("docs/cost.md")
    rows = find_lines(r"^\| (120|360|720) \|(.*)\|$", page)
    assert len(rows) == 3
    scene = replace(fourbar.load(MODELS / "crank_rocker.toml"), drive_bar=drive)
    for count, cells in rows:
        printed = [float(cell) for cell in cells.split("|")][column - 1 : column + 1]
        missed = [miss_between(scene, int(count), degree) for degree in (3, 7)]
        # the least of them is the rounding of the torque
        assert missed == approx(printed, rel=0.05, abs=2e-13)


def miss_between(scene, count, degree):
    """Return the worst error between samples where the driven bar is far from rest."""
    fine = np.linspace(0.0, 2.0 * pi, 4 * count + 1)
    exact = solve(scene, at=command_at(scene, fine))
    speed = abs(exact[f"omega_{scene.drive_bar}"])
    far = speed > 0.1 * speed.max()
    sampled = np.flatnonzero(far[::4])
    worst = 0.0
    for stretch in np.split(sampled, np.flatnonzero(np.diff(sampled) > 1) + 1):
        rows = np.arange(4 * stretch[0], 4 * stretch[-1] + 1)
        curve = make_interp_spline(
            fine[::4][stretch], exact.torque[::4][stretch], degree
        )
        worst = max(worst, float(abs(curve(fine[rows]) - exact.torque[rows]).max()))
    return worst / float(abs(exact.torque[far]).max())
