"""What `fourbar` offers in Python.

Every public name documented, the list of them, and what a slip is answered.
"""

import itertools
import json
import math
import pydoc
import re
import runpy
from dataclasses import fields, replace
from decimal import Decimal
from functools import partial
from pathlib import Path

import numpy as np
import pytest

import fourbar
from fourbar.cli import status
from fourbar.files import save
from tests.support.scenes import CYLINDER, crank_rocker

DOCS = Path(__file__).parents[2] / "docs"


@pytest.mark.slow
def test_the_page_of_the_api_has_every_public_name_once_and_its_reference_too():
    names = sorted(dir(fourbar))
    page = (DOCS / "api.md").read_text(encoding="utf-8")
    table = page.partition("## Names by task")[2].partition("\n\n|")[2]
    rows = table.partition("\n\n")[0].splitlines()[2:]
    assert sorted(name for row in rows for name in re.findall(r"`(\w+)`", row)) == names
    reference = runpy.run_path(str(DOCS / "api.py"))["text"]()
    assert all(f"\n### {name}\n" in reference for name in names)


def test_dir_shows_what_there_is_and_nothing_else():
    assert {
        "classify",
        "limit_positions",
        "coupler_curve",
        "point_coefficients",
        "instant_centres",
    } <= set(dir(fourbar))
    for name in dir(fourbar):
        thing = getattr(fourbar, name)
        assert name == "__version__" or (
            thing.__doc__ and thing.__module__.startswith("fourbar.")
        ), name


@pytest.mark.parametrize("number", [0.25, np.float64(0.25)])
def test_a_number_where_a_bar_belongs_gets_a_sentence(number):
    words = r"bars.coupler = .*0\.25.*must be a Bar, like fourbar\.Bar"
    with pytest.raises(fourbar.InputError, match=words):
        fourbar.FourBar(
            0.3,
            fourbar.Bar(0.1),
            number,
            fourbar.Bar(0.22),
        )


ALWAYS_WRONG = (5j, [[1, 2], [3]], np.zeros((3, 3)), object())
TEXTS = ("", ".", "no/such", "1", ["1", "2"])
WRONG = (
    *ALWAYS_WRONG,
    None,
    False,
    math.nan,
    -1,
    10**400,
    Decimal(1),
    *TEXTS,
    (),
    {},
    {"m": 1},
    {5: 1},
)
"""Not for every argument: some are allowed somewhere, and then the call goes through.
"""
OF_OTHERS = {"Solution", "Sensitivity", "Study", "Released"}
"""What functions return; nobody constructs them."""


def calls():
    """Every public function and class, used: what is called, and good arguments."""
    link = fourbar.uniform(0.3, 0.1, 0.25, 0.22)
    turning = fourbar.Motion(1.0, 10.0)
    scene = fourbar.Scene(link, turning)
    still = fourbar.Scene(link, fourbar.Motion(1.0, 5.0, free=fourbar.Free(0.1, 2)))
    solution = fourbar.solve(scene)
    study = fourbar.vary(scene, {"lengths.input": [0.1, 0.11]})
    sensitivity = fourbar.sensitivity(scene)
    command = fourbar.command(scene)
    ends = (fourbar.Place(2, (0.1, 0.2)), fourbar.Place(4, (0.1, 0.2)))
    spring = fourbar.Spring(*ends, 1.0)
    rows = (("O2", 0.1), ("B", 0.2))
    drawn = ((0.0, 0.0), (0.0, 0.1), (0.175, 0.05), (0.25, 0.05))
    times, angles = (0.0, 1.0, 2.0, 3.0), (0.0, 0.1, 0.2, 0.1)
    curve = (link, 0.1, 0.1, 0, 1, 8)
    torques = np.empty(1)
    empty = ("", "", (), (), ())

    def solve(linkage=link, motion=turning, **parts):
        return fourbar.solve(fourbar.Scene(linkage, motion, **parts))

    def state(kind, use):
        """Return a call that uses what a constructor makes of its arguments."""
        return lambda *arguments: use(kind(*arguments))

    def bar(moving):
        return solve(fourbar.FourBar(0.3, moving, link.coupler, link.output))

    def move(motion):
        return solve(motion=motion)

    def follow(law):
        return move(fourbar.Motion(law=law))

    def act(effect):
        return solve(effects=(effect,))

    def pull(pulling):
        return act(fourbar.Springs((pulling,)))

    def drive(cylinder):
        return solve(drive=cylinder)

    uses = {
        "Bar": (bar, (0.1, 0.2, 0.1, (0.1, 0.1))),
        "DrawnPins": (lambda pins: solve(drawing=pins), drawn),
        "from_pins": (fourbar.solve, drawn),
        "Scene": (
            fourbar.solve,
            (link, turning, 2, (fourbar.Load(2),), (fourbar.Gravity(),), *empty),
        ),
        "Motion": (move, (1.0, 10.0, 0.0, 1, None, None)),
        "Sweep": (state(fourbar.Motion, move), (0.0, 1.0, 2)),
        "Free": (lambda free: move(fourbar.Motion(1.0, free=free)), (0.01, 2)),
        "Law": (follow, (times, angles, 2, "free")),
        "Rise": (follow, ("345", (0.1, 0.2), 0.3, 0.1, 0.2, 0.1, 8)),
        "Sine": (follow, (1.0, 0.5, 2.0, 3.0, 0.1, 8)),
        "Point": (lambda point: solve(points=(point,)), ("P", 3, (0.1, 0.2))),
        "Load": (lambda load: solve(loads=(load,)), (2, (1.0, 0.0))),
        "Spring": (pull, (*ends, 1.0, 0.1, 0.1)),
        "Place": (lambda end: pull(fourbar.Spring(end, ends[1], 1.0)), (2, (0.1, 0.2))),
        "LinearDrive": (drive, ends),
        "PointDrive": (drive, (ends[1], 0.3, "world")),
        "Springs": (act, ((spring,),)),
        "Gravity": (act, (9.81, 1.0)),
        "Flywheel": (act, (0.1, 2)),
        "Viscous": (act, (rows,)),
        "Friction": (act, (rows,)),
        "PinFriction": (act, ((("O2", 0.1, 0.01),),)),
        "Torsion": (act, ((("O2", 0.1, 0.0, 0.1),),)),
    }
    at_O2 = {"Viscous": 0.1, "Friction": 0.1, "PinFriction": (0.1, 0.01)}
    at_O2["Torsion"] = (0.1, 0.0, 0.1)
    plain = {
        ("change_points", "circuits", "classify", "time_ratio"): (link,),
        ("transmission_extremes",): (link,),
        ("motor_duty", "shaking_force", "shaking_moment"): (solution,),
        ("command", "dump", "sensitivity", "equilibrium"): (scene,),
        ("limit_positions", "swing"): (link, 4),
        ("instant_centres",): (link, np.array([1.0]), 1),
        ("point_coefficients",): (link, np.array([1.0]), 1, 3, 0.1j),
        ("bearing_load",): (solution, "A"),
        ("internal_forces",): (scene, solution, 2, (0.0, 0.05)),
        ("units",): ("mm",),
        ("load",): (str(DOCS.parent / "models" / "thesis.toml"),),
        ("save",): (scene, "a.toml"),
        ("vary",): (scene, {"lengths.input": [0.1]}),
        ("release",): (still,),
        ("FourBar",): (0.3, link.input, link.coupler, link.output, 0.1),
        ("FromLimit",): (1, 0.1),
        ("Tolerance",): ("lengths.input", 0.1, False),
        ("Table",): ((0.0, 2.0), (1.0, 1.0)),
        ("Picture",): (3, "a.png", "."),
    }
    return {
        **{
            name: (getattr(fourbar, name), good)
            for names, good in plain.items()
            for name in names
        },
        **{
            name: (state(getattr(fourbar, name), use), good)
            for name, (use, good) in uses.items()
        },
        **{
            f"{name}.at": (
                lambda x, name=name: act(getattr(fourbar, name).at(O2=x)),
                (good,),
            )
            for name, good in at_O2.items()
        },
        "coupler_curve": (
            lambda *x: fourbar.coupler_curve(*x[:4], branch=x[4], steps=x[5]),
            curve,
        ),
        "uniform": (
            lambda *x: fourbar.uniform(*x[:4], per_metre=x[4]),
            (0.3, 0.1, 0.25, 0.22, 1.0),
        ),
        "vary, a value": (
            lambda x: fourbar.solve(fourbar.vary(scene, {"lengths.input": x})),
            (0.1,),
        ),
        "tolerances": (
            lambda *x: fourbar.tolerances(
                replace(scene, tolerances=x[0]),
                samples=x[1],
                seed=x[2],
            ),
            ((fourbar.Tolerance("lengths.input", 1e-4),), 2, 0),
        ),
        **{
            name: (lambda *x: fourbar.solve(x[0], x[1], at=x[2], side=x[3]), good)
            for name, good in {
                "solve": (scene, "force", command, 0),
                "solve, a study": (study, "force", None, 0),
            }.items()
        },
        "solve, out": (
            lambda x: fourbar.solve(scene, out=x),
            ({"torque": torques},),
        ),
        "solve, out torque": (
            lambda x: fourbar.solve(scene, out={"torque": x}),
            (torques,),
        ),
        "FourBar.bar": (link.bar, (3,)),
        "Law.at": (fourbar.Law(times, angles).at, (np.array([0.5]),)),
        "Solution.to_csv": (
            lambda *x: solution.to_csv(x[0], degrees=x[1], units=x[2]),
            ("a.csv", True, {}),
        ),
        "Solution.to_pandas": (solution.to_pandas, (fourbar.units("mm"),)),
        "Sensitivity.of": (sensitivity.of, ("torque", "motion.omega_2")),
        "Sensitivity.value": (sensitivity.value, ("torque",)),
    }


def calls_by_name():
    """Arguments that are given by their names, each for itself.

    What is called, and a good value.
    """
    link = fourbar.uniform(0.3, 0.1, 0.25, 0.22)
    end = fourbar.Place(4, (0.1, 0.2))
    turning = fourbar.Motion(1.0, 10.0)
    pair, points = (0.1, 0.2), (fourbar.Point("P", 2, (0.1, 0.2)),)

    def solve(motion=turning, linkage=link, points=points, **parts):
        return fourbar.solve(fourbar.Scene(linkage, motion, points=points, **parts))

    def load(**stated):
        return solve(loads=(fourbar.Load(2, (1.0, 0.0), **stated),))

    def bar(**stated):
        moving = fourbar.Bar(0.1, **stated), link.coupler, link.output
        return solve(linkage=fourbar.FourBar(0.3, *moving))

    def pull(**stated):
        spring = fourbar.Spring(fourbar.Place(2, **stated), end, 1.0)
        return solve(effects=(fourbar.Springs((spring,)),))

    def name(**stated):
        return solve(points=(fourbar.Point("Q", 3, **stated),))

    def turn(**stated):
        return solve(fourbar.Motion(**stated))

    def rise(**stated):
        return turn(law=fourbar.Rise("345", pair, steps=8, **stated))

    def follow(**stated):
        return turn(law=fourbar.Law((0.0, 1.0, 2.0, 3.0), steps=2, **stated))

    def stroke(**stated):
        motion = {"stroke": 0.25, "side": "left"} | stated
        return solve(fourbar.Motion(**motion), drive=CYLINDER)

    third, fourth = {"theta_3": 0.4}, {"theta_4": 1.9}
    load_by = {"from_pin": pair, "from_centre": pair, "arm": pair, "point": "P"}
    load_by |= {"moment": 0.1, "frame": "bar"}
    load_by["table"] = fourbar.Table((0.0, 2.0), (1.0, 1.0))
    laws = {"theta_3": (0.4, 0.5, 0.6, 0.5), "theta_4": (1.9, 2.0, 2.1, 2.0)}
    drawn = fourbar.DrawnPins(
        (0.0, 0.0),
        (0.0, 0.1),
        (0.175, 0.05),
        (0.25, 0.05),
    )
    driven = {"drive": fourbar.LinearDrive(fourbar.Place(2, pair), end)}
    stated = [
        ("Load", load, load_by),
        ("Bar", partial(bar, diameter=0.02), {"density": 7850.0}),
        ("Bar", partial(bar, density=7850.0), {"section": (0.02, 0.01)}),
        ("Bar", partial(bar, density=7850.0), {"diameter": 0.02}),
        ("Bar", bar, {"mass_per_length": 4.2}),
        ("Point", name, {"from_centre": pair}),
        ("Place", pull, {"point": "P", "from_centre": pair}),
        ("Rise", rise, third | fourth),
        ("Law", follow, laws),
        ("Motion", turn, third | fourth),
        ("Motion", partial(turn, **third), {"omega_3": 1.0}),
        ("Motion", partial(turn, **third, omega_3=1.0), {"alpha_3": 1.0}),
        ("Motion", partial(turn, **fourth), {"omega_4": 1.0}),
        ("Motion", partial(turn, **fourth, omega_4=1.0), {"alpha_4": 1.0}),
        ("Motion", stroke, {"stroke": 0.2, "stroke_speed": 0.1}),
        ("Motion", partial(stroke, stroke_speed=0.1), {"stroke_acceleration": 0.1}),
        ("Scene", solve, {**driven, "drawing": drawn}),
    ]
    return {
        f"{kind},{argument}": (
            lambda x, call=call, argument=argument: call(**{argument: x}),
            (good,),
        )
        for kind, call, ones in stated
        for argument, good in ones.items()
    }


def spoilt(value, wrong):
    """The wrong value, and tuples in which it stands for one part, at any depth."""
    yield wrong
    if isinstance(value, tuple):
        for i, part in enumerate(value):
            for replacement in spoilt(part, wrong):
                parts = (*value[:i], replacement, *value[i + 1 :])
                yield type(value)(*parts) if hasattr(value, "_fields") else parts


@pytest.mark.slow
def test_whatever_an_argument_is_the_answer_is_a_value_or_one_line(
    tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    table = calls() | calls_by_name()
    public = set(dir(fourbar)) - OF_OTHERS
    errors = {name for name in public if name.endswith("Error")}
    assert {re.split(r"[.,]", name)[0] for name in table} - OF_OTHERS == public - errors
    holes = []
    for name, (call, good) in table.items():
        call(*good)
        for wrong in WRONG:
            for arguments in itertools.islice(spoilt(good, wrong), 1, None):
                try:
                    call(*arguments)
                    if wrong is ALWAYS_WRONG[-1]:
                        holes.append(f"{name} takes {wrong!r}")
                except fourbar.FourBarError as error:
                    if "\n" in str(error):
                        holes.append(f"{name} given {wrong!r}: {error}")
                except Exception as error:
                    holes.append(f"{name} given {wrong!r}: {error!r}")
    assert not holes, "\n".join(holes)


@pytest.mark.slow
def test_a_figure_is_refused_arguments_of_another_type(tmp_path):
    scene = crank_rocker()
    drawing = scene.plot("linkage")
    calls = (
        lambda x: scene.plot("torque", position=x),
        lambda x: scene.plot("torque", units=x),
        scene.plot,
        drawing.save,
    )
    wrong = (*ALWAYS_WRONG, tmp_path / "no" / "a.svg")
    for call, argument in itertools.product(calls, wrong):
        with pytest.raises(fourbar.InputError) as caught:
            call(argument)
        assert "\n" not in str(caught.value)


def test_the_public_formulas_agree_with_a_solution():
    """A point's velocity is its coefficient times omega_2.

    The coupler curve passes through the point at each angle.
    """
    scene = crank_rocker()
    solution, linkage = fourbar.solve(scene), scene.linkage
    at, z = (linkage, solution.theta_2, solution.branch), linkage.coupler.to_centre
    by_angle = fourbar.point_coefficients(*at, 3, z)
    a = by_angle.first * solution.alpha_2 + by_angle.second * solution.omega_2**2
    np.testing.assert_allclose(
        np.column_stack([np.real(a), np.imag(a)]),
        solution.a_G3,
        rtol=1e-12,
        atol=1e-12,
    )
    curve = fourbar.coupler_curve(linkage, z.real, z.imag)
    gaps = np.hypot(
        curve.x[:, None] - solution.G3[:, 0],
        curve.y[:, None] - solution.G3[:, 1],
    )
    assert gaps.min(axis=0).max() < 0.01 * linkage.coupler.length
    pin = fourbar.instant_centres(*at)[2, 3].point
    np.testing.assert_allclose(
        np.column_stack(pin),
        solution.A,
        rtol=0.0,
        atol=1e-15,
    )


def test_classify_as_json_is_what_the_formulas_say(capsys):
    assert status(["classify", "0.3", "0.1", "0.25", "0.22", "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    linkage = fourbar.uniform(0.3, 0.1, 0.25, 0.22)
    assert document["name"] == "crank-rocker" and document["turning"] == [2]
    assert document["swing"]["output"] == fourbar.swing(linkage)
    assert document["time_ratio"] == fourbar.time_ratio(linkage)
    limits = [tuple(limit.values()) for limit in document["limit_positions"]["output"]]
    assert len(limits) == 4
    assert limits == [tuple(limit) for limit in fourbar.limit_positions(linkage, 4)]
    worst = document["transmission"]["worst"]
    assert worst == fourbar.transmission_extremes(linkage).worst
    assert status(["classify", "3", "1", "1", "1", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["barker"] is None


@pytest.mark.slow
def test_a_scene_draws_itself(tmp_path):
    pytest.importorskip(
        "matplotlib",
        reason="drawing needs matplotlib: pip install matplotlib",
    )
    drawing = crank_rocker().plot("torque")
    assert drawing._repr_svg_().rstrip().endswith("</svg>")
    drawing.save(tmp_path / "a.png")
    assert (tmp_path / "a.png").read_bytes()[:4] == b"\x89PNG"
    with pytest.raises(fourbar.InputError, match="must be one of"):
        crank_rocker().plot("pie")


def test_help_says_the_parameters():
    shown = pydoc.render_doc(crank_rocker().plot, renderer=pydoc.plaintext)
    for name in ("figure", "position", "units", "dimensions"):
        assert f"{name} :" in shown
    shown = pydoc.render_doc(fourbar.Scene, renderer=pydoc.plaintext)
    for field in fields(fourbar.Scene):
        listed = re.search(rf"^ \|  .*\b{field.name}\b.* : ", shown, re.MULTILINE)
        assert listed, field.name


def test_scenes_compare_by_value(tmp_path):
    def turn(*angles, **stated):
        return crank_rocker(motion=fourbar.Motion(np.array(angles), 10.0, **stated))

    scene, same = turn(0.1, 0.2), turn(0.1, 0.2)
    assert scene == same and hash(scene) == hash(same) and scene != "scene"
    for changed in (
        turn(0.1, 0.3),
        crank_rocker(motion=fourbar.Motion(0.1, 10.0)),
        turn(0.1, 0.2, branch=-1),
        replace(scene, loads=scene.loads[:1]),
        replace(scene, drive_bar=4),
        replace(scene, title="another"),
    ):
        assert scene != changed
    file = DOCS.parent / "models" / "thesis.toml"
    save(fourbar.load(file), tmp_path / "a.toml")
    assert fourbar.load(file) == fourbar.load(tmp_path / "a.toml")


def test_loads_without_a_speed_are_pointed_to_the_static_torque(
    tmp_path, monkeypatch, capsys
):
    monkeypatch.chdir(tmp_path)
    save(crank_rocker(motion=fourbar.Motion(1.0)), "still.toml")
    bars = (fourbar.Bar(length) for length in (0.1, 0.25, 0.22))
    save(fourbar.Scene(fourbar.FourBar(0.3, *bars), fourbar.Motion(1.0)), "bare.toml")
    hint = 'omega_2 = "0 rad/s" gives the static torque and pin forces'
    assert status(["analyze", "still.toml"]) == 0
    assert hint in capsys.readouterr().out
    assert status(["plot", "still.toml", "--figure", "torque", "-o", "a.svg"]) == 2
    assert hint in capsys.readouterr().err
    assert status(["analyze", "bare.toml"]) == 0
    assert hint not in capsys.readouterr().out


@pytest.mark.parametrize("wrong", [0, 2, -1.5, np.nan])
def test_a_command_on_no_branch_is_refused(wrong):
    scene = crank_rocker(motion=fourbar.Motion(np.array([0.1, 0.2]), 10.0))
    command = fourbar.command(scene)
    for row in (np.array([wrong]), np.array([1, wrong])):
        at = command._replace(angle=command.theta_2[: len(row)], branch=row)
        with pytest.raises(fourbar.InputError, match=r"at\.branch = .*must be \+1"):
            fourbar.solve(scene, at=at)
