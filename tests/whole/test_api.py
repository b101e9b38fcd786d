"""What `fourbar` offers in Python.

Every public name documented, the list of them, and what a slip is answered.
"""

import itertools
import json
import math
import pydoc
import re
import runpy
from collections.abc import Callable
from dataclasses import fields, replace
from decimal import Decimal
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import fourbar
from fourbar.cli import status
from fourbar.files import save
from tests.support.scenes import CYLINDER, crank_rocker

DOCS = Path(__file__).parents[2] / "docs"


def test_the_page_of_the_api_has_every_public_name_once_and_its_reference_too():
    names = sorted(dir(fourbar))
    table = (
        (DOCS / "api.md")
        .read_text(encoding="utf-8")
        .partition("## Names by task")[2]
        .partition("\n\n|")[2]
    )
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
    with pytest.raises(
        fourbar.InputError,
        match=r"bars.coupler = .*0\.25.*must be a Bar, like fourbar\.Bar",
    ):
        fourbar.FourBar(0.3, fourbar.Bar(0.1), number, fourbar.Bar(0.22))  # type: ignore[arg-type]


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
    scene, rows = (
        fourbar.Scene(link, fourbar.Motion(1.0, 10.0)),
        (("O2", 0.1), ("B", 0.2)),
    )
    solution, study = (
        fourbar.solve(scene),
        fourbar.vary(scene, {"lengths.input": [0.1, 0.11]}),
    )
    out, command, ends = (
        {"torque": np.empty(1)},
        fourbar.command(scene),
        (fourbar.Place(2, (0.1, 0.2)), fourbar.Place(4, (0.1, 0.2))),
    )
    drawn = ((0.0, 0.0), (0.0, 0.1), (0.175, 0.05), (0.25, 0.05))
    times, angles = (0.0, 1.0, 2.0, 3.0), (0.0, 0.1, 0.2, 0.1)

    def moving(motion):
        return fourbar.solve(fourbar.Scene(link, motion))

    def acting(effect):
        return fourbar.solve(
            fourbar.Scene(link, fourbar.Motion(1.0, 10.0), effects=(effect,))
        )

    def by(kind, *values):
        return acting(kind.at(O2=values[0]))

    def law(*arguments):
        return moving(fourbar.Motion(law=fourbar.Law(*arguments)))

    def bars(*arguments):
        return fourbar.solve(
            fourbar.Scene(
                fourbar.FourBar(0.3, fourbar.Bar(*arguments), link.coupler, link.output)
            )
        )

    def solved(*arguments):
        return fourbar.solve(
            arguments[0],
            arguments[1],
            at=arguments[2],
            side=arguments[3],
        )

    only_linkage = (
        "change_points",
        "circuits",
        "classify",
        "time_ratio",
        "transmission_extremes",
    )
    of_solution = ("motor_duty", "shaking_force", "shaking_moment")
    of_scene = ("command", "dump", "sensitivity")
    return {
        **{name: (getattr(fourbar, name), (link,)) for name in only_linkage},
        **{name: (getattr(fourbar, name), (solution,)) for name in of_solution},
        **{name: (getattr(fourbar, name), (scene,)) for name in of_scene},
        "limit_positions": (fourbar.limit_positions, (link, 4)),
        "swing": (fourbar.swing, (link, 4)),
        "coupler_curve": (
            lambda *x: fourbar.coupler_curve(*x[:4], branch=x[4], steps=x[5]),
            (link, 0.1, 0.1, 0, 1, 8),
        ),
        "instant_centres": (fourbar.instant_centres, (link, np.array([1.0]), 1)),
        "point_coefficients": (
            fourbar.point_coefficients,
            (link, np.array([1.0]), 1, 3, 0.1j),
        ),
        "bearing_load": (fourbar.bearing_load, (solution, "A")),
        "in_units": (fourbar.in_units, (scene, "mm")),
        "internal_forces": (fourbar.internal_forces, (scene, solution, 2, (0.0, 0.05))),
        "units": (fourbar.units, ("mm",)),
        "uniform": (
            lambda *x: fourbar.uniform(*x[:4], per_metre=x[4]),
            (0.3, 0.1, 0.25, 0.22, 1.0),
        ),
        "load": (fourbar.load, (str(DOCS.parent / "models" / "thesis.toml"),)),
        "save": (fourbar.save, (scene, "a.toml")),
        "vary": (fourbar.vary, (scene, {"lengths.input": [0.1]})),
        "vary, a value": (
            lambda x: fourbar.solve(fourbar.vary(scene, {"lengths.input": x})),
            (0.1,),
        ),
        "equilibrium": (fourbar.equilibrium, (scene,)),
        "release": (
            fourbar.release,
            (
                fourbar.Scene(
                    fourbar.uniform(0.3, 0.1, 0.25, 0.22),
                    fourbar.Motion(1.0, 5.0, free=fourbar.Free(0.1, 2)),
                ),
            ),
        ),
        "tolerances": (
            lambda *x: fourbar.tolerances(
                fourbar.Scene(link, scene.motion, tolerances=x[0]),
                samples=x[1],
                seed=x[2],
            ),
            ((fourbar.Tolerance("lengths.input", 1e-4),), 2, 0),
        ),
        "solve": (solved, (scene, "force", command, 0)),
        "solve, a study": (solved, (study, "force", None, 0)),
        "solve, out": (lambda x: fourbar.solve(scene, out=x), (out,)),
        "solve, out torque": (
            lambda x: fourbar.solve(scene, out={"torque": x}),
            (out["torque"],),
        ),
        "Bar": (bars, (0.1, 0.2, 0.1, (0.1, 0.1))),
        "FourBar": (fourbar.FourBar, (0.3, link.input, link.coupler, link.output, 0.1)),
        "DrawnPins": (
            lambda *x: fourbar.solve(
                fourbar.Scene(link, drawing=fourbar.DrawnPins(*x))
            ),
            drawn,
        ),
        "from_pins": (lambda *x: fourbar.solve(fourbar.from_pins(*x)), drawn),
        "FourBar.bar": (link.bar, (3,)),
        "Scene": (
            lambda *x: fourbar.solve(fourbar.Scene(*x)),
            (
                link,
                scene.motion,
                2,
                (fourbar.Load(2),),
                (fourbar.Gravity(),),
                "",
                "",
                (),
                (),
                (),
            ),
        ),
        "Motion": (
            lambda *x: moving(fourbar.Motion(*x)),
            (1.0, 10.0, 0.0, 1, None, None),
        ),
        "Sweep": (lambda *x: moving(fourbar.Motion(fourbar.Sweep(*x))), (0.0, 1.0, 2)),
        "FromLimit": (fourbar.FromLimit, (1, 0.1)),
        "Free": (
            lambda *x: moving(fourbar.Motion(1.0, free=fourbar.Free(*x))),
            (0.01, 2),
        ),
        "Law": (law, (times, angles, 2, "free")),
        "Law.at": (fourbar.Law(times, angles).at, (np.array([0.5]),)),
        "Rise": (
            lambda *x: moving(fourbar.Motion(law=fourbar.Rise(*x))),
            ("345", (0.1, 0.2), 0.3, 0.1, 0.2, 0.1, 8),
        ),
        "Sine": (
            lambda *x: moving(fourbar.Motion(law=fourbar.Sine(*x))),
            (1.0, 0.5, 2.0, 3.0, 0.1, 8),
        ),
        "Point": (
            lambda *x: fourbar.solve(fourbar.Scene(link, points=(fourbar.Point(*x),))),
            ("P", 3, (0.1, 0.2)),
        ),
        "Tolerance": (fourbar.Tolerance, ("lengths.input", 0.1, False)),
        "Load": (
            lambda *x: fourbar.solve(
                fourbar.Scene(link, scene.motion, loads=(fourbar.Load(*x),))
            ),
            (2, (1.0, 0.0)),
        ),
        "Table": (fourbar.Table, ((0.0, 2.0), (1.0, 1.0))),
        "Picture": (fourbar.Picture, (3, "a.png", ".")),
        "Spring": (
            lambda *x: acting(fourbar.Springs((fourbar.Spring(*x),))),
            (*ends, 1.0, 0.1, 0.1),
        ),
        "Place": (
            lambda *x: acting(
                fourbar.Springs((fourbar.Spring(fourbar.Place(*x), ends[1], 1.0),))
            ),
            (2, (0.1, 0.2)),
        ),
        "LinearDrive": (
            lambda *x: fourbar.solve(
                fourbar.Scene(link, drive=fourbar.LinearDrive(*x))
            ),
            ends,
        ),
        "PointDrive": (
            lambda *x: fourbar.solve(fourbar.Scene(link, drive=fourbar.PointDrive(*x))),
            (ends[1], 0.3, "world"),
        ),
        "Springs": (
            lambda x: acting(fourbar.Springs(x)),
            ((fourbar.Spring(*ends, 1.0),),),
        ),
        "Gravity": (lambda *x: acting(fourbar.Gravity(*x)), (9.81, 1.0)),
        "Flywheel": (lambda *x: acting(fourbar.Flywheel(*x)), (0.1, 2)),
        "Viscous": (lambda x: acting(fourbar.Viscous(x)), (rows,)),
        "Viscous.at": (partial(by, fourbar.Viscous), (0.1,)),
        "Friction": (lambda x: acting(fourbar.Friction(x)), (rows,)),
        "Friction.at": (partial(by, fourbar.Friction), (0.1,)),
        "PinFriction": (
            lambda x: acting(fourbar.PinFriction(x)),
            ((("O2", 0.1, 0.01),),),
        ),
        "PinFriction.at": (partial(by, fourbar.PinFriction), ((0.1, 0.01),)),
        "Torsion": (lambda x: acting(fourbar.Torsion(x)), ((("O2", 0.1, 0.0, 0.1),),)),
        "Torsion.at": (partial(by, fourbar.Torsion), ((0.1, 0.0, 0.1),)),
        "Solution.to_csv": (
            lambda *x: solution.to_csv(x[0], degrees=x[1], units=x[2]),
            ("a.csv", True, {}),
        ),
        "Solution.to_pandas": (solution.to_pandas, (fourbar.units("mm"),)),
        "Sensitivity.of": (fourbar.sensitivity(scene).of, ("torque", "motion.omega_2")),
        "Sensitivity.value": (fourbar.sensitivity(scene).value, ("torque",)),
    }


def calls_by_name():
    """Arguments that are given by their names, each for itself.

    What is called, and a good value.
    """
    link, base = fourbar.uniform(0.3, 0.1, 0.25, 0.22), fourbar.Motion(1.0, 10.0)
    ends = (fourbar.Place(2, (0.1, 0.2)), fourbar.Place(4, (0.1, 0.2)))
    pair, points = (0.1, 0.2), (fourbar.Point("P", 2, (0.1, 0.2)),)

    def solve(motion=base, **parts):
        return fourbar.solve(fourbar.Scene(link, motion, points=points, **parts))

    def load(**stated):
        return solve(loads=(fourbar.Load(2, (1.0, 0.0), **stated),))

    def bar(**stated):
        moving = fourbar.Bar(0.1, **stated), link.coupler, link.output
        return fourbar.solve(fourbar.Scene(fourbar.FourBar(0.3, *moving), base))

    def pull(**stated):
        spring = fourbar.Spring(fourbar.Place(2, **stated), ends[1], 1.0)
        return solve(effects=(fourbar.Springs((spring,)),))

    def name(**stated):
        return fourbar.solve(
            fourbar.Scene(link, base, points=(fourbar.Point("Q", 3, **stated),))
        )

    def rise(**stated):
        return solve(fourbar.Motion(law=fourbar.Rise("345", pair, steps=8, **stated)))

    def follow(**stated):
        law = fourbar.Law((0.0, 1.0, 2.0, 3.0), steps=2, **stated)
        return solve(fourbar.Motion(law=law))

    def turn(**stated):
        return solve(fourbar.Motion(**stated))

    def stroke(**stated):
        motion = fourbar.Motion(**({"stroke": 0.25, "side": "left"} | stated))
        return solve(motion, drive=CYLINDER)

    table = fourbar.Table((0.0, 2.0), (1.0, 1.0))
    drawn = fourbar.DrawnPins((0.0, 0.0), (0.0, 0.1), (0.175, 0.05), (0.25, 0.05))
    stated: list[tuple[str, Callable[..., object], dict[str, Any]]] = [
        *(("Load", load, {place: pair}) for place in ("from_pin", "from_centre")),
        *(("Load", load, {"arm": pair}), ("Load", load, {"point": "P"})),
        *(("Load", load, {"moment": 0.1}), ("Load", load, {"frame": "bar"})),
        ("Load", load, {"table": table}),
        ("Bar", partial(bar, diameter=0.02), {"density": 7850.0}),
        ("Bar", partial(bar, density=7850.0), {"section": (0.02, 0.01)}),
        ("Bar", partial(bar, density=7850.0), {"diameter": 0.02}),
        ("Bar", bar, {"mass_per_length": 4.2}),
        *(("Point", name, {"from_centre": pair}), ("Place", pull, {"point": "P"})),
        ("Place", pull, {"from_centre": pair}),
        *(("Rise", rise, {"theta_3": 0.4}), ("Rise", rise, {"theta_4": 1.9})),
        ("Law", follow, {"theta_3": (0.4, 0.5, 0.6, 0.5)}),
        ("Law", follow, {"theta_4": (1.9, 2.0, 2.1, 2.0)}),
        *(("Motion", turn, {"theta_3": 0.4}), ("Motion", turn, {"theta_4": 1.9})),
        ("Motion", partial(turn, theta_3=0.4), {"omega_3": 1.0}),
        ("Motion", partial(turn, theta_3=0.4, omega_3=1.0), {"alpha_3": 1.0}),
        ("Motion", partial(turn, theta_4=1.9), {"omega_4": 1.0}),
        ("Motion", partial(turn, theta_4=1.9, omega_4=1.0), {"alpha_4": 1.0}),
        ("Motion", stroke, {"stroke": 0.2}),
        ("Motion", stroke, {"stroke_speed": 0.1}),
        ("Motion", partial(stroke, stroke_speed=0.1), {"stroke_acceleration": 0.1}),
        ("Scene", solve, {"drive": fourbar.LinearDrive(*ends)}),
        ("Scene", solve, {"drawing": drawn}),
    ]
    table_of_calls = {}
    for kind, call, one in stated:
        ((argument, good),) = one.items()
        table_of_calls[f"{kind},{argument}"] = (
            lambda x, call=call, argument=argument: call(**{argument: x}),
            (good,),
        )
    assert len(table_of_calls) == len(stated)
    return table_of_calls


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
    scene = fourbar.Scene(
        fourbar.uniform(0.3, 0.1, 0.25, 0.22), fourbar.Motion(1.0, 10.0)
    )
    drawing = scene.plot("linkage")  # type: ignore[attr-defined]
    calls: list[Callable[[Any], object]] = [
        *(
            lambda x: scene.plot("torque", position=x),
            lambda x: scene.plot("torque", units=x),
            scene.plot,
        ),
        drawing.save,
    ]
    for call, wrong in itertools.product(
        calls, (*ALWAYS_WRONG, tmp_path / "no" / "a.svg")
    ):
        with pytest.raises(fourbar.InputError) as caught:
            call(wrong)
        assert "\n" not in str(caught.value)


def test_the_public_formulas_agree_with_a_solution():
    """A point's velocity is its coefficient times omega_2.

    The coupler curve passes through the point at each angle.
    """
    scene = crank_rocker()
    solution, linkage = fourbar.solve(scene), scene.linkage
    z = linkage.coupler.to_centre
    coefficients = fourbar.point_coefficients(
        linkage, solution.theta_2, solution.branch, 3, z
    )
    a = (
        coefficients.first * solution.alpha_2
        + coefficients.second * solution.omega_2**2
    )
    assert np.allclose(
        np.column_stack([np.real(a), np.imag(a)]),
        solution.a_G3,
        rtol=1e-12,
        atol=1e-12,
    )
    curve = fourbar.coupler_curve(linkage, z.real, z.imag)
    gap = np.hypot(
        curve.x[:, None] - solution.G3[:, 0], curve.y[:, None] - solution.G3[:, 1]
    ).min(axis=0)
    assert gap.max() < 0.01 * linkage.coupler.length
    pin = fourbar.instant_centres(linkage, solution.theta_2, solution.branch)[
        2, 3
    ].point
    assert np.allclose(np.column_stack(pin), solution.A, rtol=0.0, atol=1e-15)


def test_classify_as_json_is_what_the_formulas_say(capsys):
    assert status(["classify", "0.3", "0.1", "0.25", "0.22", "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    linkage = fourbar.uniform(0.3, 0.1, 0.25, 0.22)
    assert document["name"] == "crank-rocker" and document["turning"] == [2]
    assert document["swing"]["output"] == fourbar.swing(linkage) and document[
        "time_ratio"
    ] == fourbar.time_ratio(linkage)
    limits = [tuple(limit.values()) for limit in document["limit_positions"]["output"]]
    assert (
        limits == [tuple(limit) for limit in fourbar.limit_positions(linkage, 4)]
        and len(limits) == 4
    )
    assert (
        document["transmission"]["worst"]
        == fourbar.transmission_extremes(linkage).worst
    )
    assert status(["classify", "3", "1", "1", "1", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["barker"] is None


@pytest.mark.slow
def test_a_scene_draws_itself(tmp_path):
    pytest.importorskip(
        "matplotlib",
        reason="drawing needs matplotlib: pip install matplotlib",
    )
    drawing = crank_rocker().plot("torque")  # type: ignore[attr-defined]
    assert drawing._repr_svg_().rstrip().endswith("</svg>")
    drawing.save(tmp_path / "a.png")
    assert (tmp_path / "a.png").read_bytes()[:4] == b"\x89PNG"
    with pytest.raises(fourbar.InputError, match="must be one of"):
        crank_rocker().plot("pie")  # type: ignore[attr-defined]


def test_help_says_the_parameters():
    shown = pydoc.render_doc(crank_rocker().plot, renderer=pydoc.plaintext)  # type: ignore[attr-defined]
    assert all(
        f"{name} :" in shown
        for name in ("figure", "position", "branches", "units", "dimensions")
    )
    shown = pydoc.render_doc(fourbar.Scene, renderer=pydoc.plaintext)
    for field in fields(fourbar.Scene):
        assert re.search(rf"^ \|  .*\b{field.name}\b.* : ", shown, re.MULTILINE), (
            field.name
        )


def test_scenes_compare_by_value(tmp_path):
    scene = crank_rocker(motion=fourbar.Motion(np.array([0.1, 0.2]), 10.0))
    same = crank_rocker(motion=fourbar.Motion(np.array([0.1, 0.2]), 10.0))
    assert scene == same and hash(scene) == hash(same) and scene != "scene"
    for changed in (
        crank_rocker(motion=fourbar.Motion(np.array([0.1, 0.3]), 10.0)),
        crank_rocker(motion=fourbar.Motion(0.1, 10.0)),
        crank_rocker(motion=fourbar.Motion(np.array([0.1, 0.2]), 10.0, branch=-1)),
        replace(scene, loads=scene.loads[:1]),
        replace(scene, drive_bar=4),
        replace(scene, title="another"),
    ):
        assert scene != changed
    file = DOCS.parent / "models" / "thesis.toml"
    save(fourbar.load(file), tmp_path / "a.toml")
    assert fourbar.load(file) == fourbar.load(tmp_path / "a.toml")


def test_loads_without_a_speed_are_pointed_to_the_static_torque(tmp_path, capsys):
    save(crank_rocker(motion=fourbar.Motion(1.0)), tmp_path / "still.toml")
    assert status(["analyze", str(tmp_path / "still.toml")]) == 0
    hint = 'omega_2 = "0 rad/s" gives the static torque and pin forces'
    assert hint in capsys.readouterr().out
    assert (
        status(
            [
                "plot",
                str(tmp_path / "still.toml"),
                "--figure",
                "torque",
                "-o",
                str(tmp_path / "a.svg"),
            ]
        )
        == 2
    )
    assert hint in capsys.readouterr().err
    bare = fourbar.FourBar(0.3, fourbar.Bar(0.1), fourbar.Bar(0.25), fourbar.Bar(0.22))
    save(fourbar.Scene(bare, fourbar.Motion(1.0)), tmp_path / "bare.toml")
    assert (
        status(["analyze", str(tmp_path / "bare.toml")]) == 0
        and hint not in capsys.readouterr().out
    )


@pytest.mark.parametrize("wrong", [0, 2, -1.5, np.nan])
def test_a_command_on_no_branch_is_refused(wrong):
    scene = fourbar.Scene(
        fourbar.uniform(0.3, 0.1, 0.25, 0.22),
        fourbar.Motion(np.array([0.1, 0.2]), 10.0),
    )
    command = fourbar.command(scene)
    for row in (np.array([wrong]), np.array([1, wrong])):
        with pytest.raises(fourbar.InputError, match=r"at\.branch = .*must be \+1"):
            fourbar.solve(
                scene,
                at=command._replace(angle=command.theta_2[: len(row)], branch=row),
            )
