"""What `fourbar` offers in Python.

Every public name documented, the list of them, and what a slip is answered.
"""

import itertools
import json
import math
import re
import runpy
from dataclasses import fields, is_dataclass, replace
from decimal import Decimal
from functools import partial

import numpy as np
from pytest import mark, raises

import fourbar
from fourbar import (
    Bar,
    FourBar,
    FourBarError,
    Free,
    Friction,
    InputError,
    Law,
    Motion,
    PinFriction,
    Rise,
    Scene,
    Tolerance,
    Torsion,
    Viscous,
    solve,
    uniform,
    units,
    vary,
)
from fourbar.cli import status
from fourbar_lab.fault_scenes import FAULT_SCENES
from tests.support.checkout import ROOT, read
from tests.support.scenes import CYLINDER, crank_rocker


@mark.slow
def test_the_page_of_the_api_has_every_public_name_once_and_its_reference_too():
    names = sorted(dir(fourbar))
    table = read("docs/api.md").partition("## Names by task")[2].partition("\n\n|")[2]
    rows = table.partition("\n\n")[0].splitlines()[2:]
    assert sorted(name for row in rows for name in re.findall(r"`(\w+)`", row)) == names
    reference = runpy.run_path(ROOT / "docs/api.py")["text"]()
    assert all(f"\n### {name}\n" in reference for name in names)


@mark.parametrize("number", [0.25, np.float64(0.25)])
def test_a_number_where_a_bar_belongs_gets_a_sentence(number):
    words = r"bars.coupler = .*0\.25.*must be a Bar, like fourbar\.Bar"
    with raises(InputError, match=words):
        FourBar(0.3, Bar(0.1), number, Bar(0.22))


ALWAYS_WRONG = (5j, [[1, 2], [3]], np.zeros((3, 3)), object())
WRONG = (
    *ALWAYS_WRONG,
    None,
    False,
    math.nan,
    -1,
    10**400,
    Decimal(1),
    "",
    ".",
    "no/such",
    "1",
    ["1", "2"],
    (),
    {},
    {"m": 1},
    {5: 1},
)
"""Not for every argument: some are allowed somewhere, and then the call goes through.
"""
OF_OTHERS = {"Solution", "Sensitivity", "Study", "Released"}
"""What functions return; nobody constructs them."""


def list_fields(part):
    """Return the names of the fields of a record that a user states."""
    if isinstance(part, Motion):  # its constructor takes other names
        return ["angle", "free", "law"]
    if is_dataclass(part):
        return [one.name for one in fields(part) if one.name not in MADE_ALONG]
    return getattr(part, "_fields", ())


MADE_ALONG = ("met_lengths", "turns")
"""Fields that the package fills itself."""


def list_arguments(part, path=()):
    """Yield each argument that a scene is made of: its path, its name and value."""
    for name in list_fields(part):
        value = getattr(part, name)
        yield (*path, name), f"{type(part).__name__}.{name}", value
        yield from list_arguments(value, (*path, name))
    if type(part) is tuple:
        for place, inner in enumerate(part):
            yield from list_arguments(inner, (*path, place))


def put(whole, path, value):
    """Return nested records and tuples with another value at a path."""
    if not path:
        return value
    first, *rest = path
    if isinstance(first, int):
        return (*whole[:first], put(whole[first], rest, value), *whole[first + 1 :])
    part = put(getattr(whole, first), rest, value)
    if isinstance(whole, Motion):
        return whole.replace(**{first: part})
    change = replace if is_dataclass(whole) else type(whole)._replace
    return change(whole, **{first: part})


PINS = (0.0, 0.0), (0.0, 0.1), (0.175, 0.05), (0.25, 0.05)
MOTIONS = [
    {"theta_2": 1.0, "omega_2": 10.0, "alpha_2": 0.1, "branch": 1},
    {"theta_3": 0.4, "omega_3": 1.0, "alpha_3": 1.0},
    {"theta_4": 1.9, "omega_4": 1.0, "alpha_4": 1.0},
    {"stroke": 0.25, "stroke_speed": 0.1, "stroke_acceleration": 0.1, "side": "left"},
]
MADE = [
    *FAULT_SCENES.values(),
    crank_rocker(Motion(law=Rise("345", (0.1, 0.2), theta_3=0.4, steps=8))),
    crank_rocker(
        Motion(law=Law((0.0, 1.0, 2.0, 3.0), theta_3=(0.4, 0.5, 0.6, 0.5), steps=2))
    ),
    crank_rocker(
        linkage=replace(crank_rocker().linkage, input=Bar(0.1, mass_per_length=4.2))
    ),
]
"""Scenes in which each field of each record is stated somewhere."""


def uses():
    """Each argument of a class, good: a scene is solved with it."""

    def move(stated, name, value):
        drive = CYLINDER if "stroke" in stated else None
        return crank_rocker(Motion(**{**stated, name: value}), drive=drive)

    made = {
        f"Motion.{name}": (partial(move, stated, name), good)
        for stated in MOTIONS
        for name, good in stated.items()
    }
    for scene in MADE:
        for path, name, value in list_arguments(scene):
            if value is not None:
                made.setdefault(name, (partial(put, scene, path), value))
    return {
        name: partial(lambda x, make=make: solve(make(x)), good)
        for name, (make, good) in made.items()
    }


def calls():
    """Every public function, used: called with good arguments."""
    link = uniform(0.3, 0.1, 0.25, 0.22)
    scene = Scene(link, Motion(1.0, 10.0))
    solution = solve(scene)
    study = vary(scene, {"lengths.input": [0.1, 0.11]})
    sensitivity = fourbar.sensitivity(scene)
    times, angles = (0.0, 1.0, 2.0, 3.0), (0.0, 0.1, 0.2, 0.1)
    at_O2 = {
        Viscous: 0.1,
        Friction: 0.1,
        PinFriction: (0.1, 0.01),
        Torsion: (0.1, 0.0, 0.1),
    }
    good = {
        **dict.fromkeys(
            ("change_points", "circuits", "classify", "time_ratio"), (link,)
        ),
        "transmission_extremes": (link,),
        **dict.fromkeys(("motor_duty", "shaking_force", "shaking_moment"), (solution,)),
        **dict.fromkeys(("command", "dump", "sensitivity", "equilibrium"), (scene,)),
        **dict.fromkeys(("limit_positions", "swing"), (link, 4)),
        "instant_centres": (link, np.array([1.0]), 1),
        "point_coefficients": (link, np.array([1.0]), 1, 3, 0.1j),
        "bearing_load": (solution, "A"),
        "internal_forces": (scene, solution, 2, (0.0, 0.05)),
        "units": ("mm",),
        "load": (str(ROOT / "models/thesis.toml"),),
        "save": (scene, "a.toml"),
        "vary": (scene, {"lengths.input": [0.1]}),
        "release": (replace(scene, motion=Motion(1.0, 5.0, free=Free(0.1, 2))),),
        "from_pins": PINS,
        "FromLimit": (1, 0.1),
        "Picture": (3, "a.png", "."),
    }
    return {
        **{name: partial(getattr(fourbar, name), *good[name]) for name in good},
        **{
            f"{kind.__name__}.at": partial(
                lambda x, kind=kind: solve(replace(scene, effects=(kind.at(O2=x),))),
                number,
            )
            for kind, number in at_O2.items()
        },
        "coupler_curve": partial(
            fourbar.coupler_curve, link, 0.1, 0.1, 0, branch=1, steps=8
        ),
        "uniform": partial(uniform, 0.3, 0.1, 0.25, 0.22, per_metre=1.0),
        "vary, a value": partial(
            lambda x: solve(vary(scene, {"lengths.input": x})), 0.1
        ),
        "tolerances": partial(
            lambda stated, **how: fourbar.tolerances(
                replace(scene, tolerances=stated), **how
            ),
            (Tolerance("lengths.input", 1e-4),),
            samples=2,
            seed=0,
        ),
        "solve": partial(solve, scene, "force", at=fourbar.command(scene), side=0),
        "solve, a study": partial(solve, study, "force", at=None, side=0),
        "solve, out": partial(solve, scene, out={"torque": np.empty(1)}),
        "FourBar.bar": partial(link.bar, 3),
        "Scene.plot": partial(
            crank_rocker().plot, "torque", position=0.1, units=units("mm")
        ),
        "Law.at": partial(Law(times, angles).at, np.array([0.5])),
        "Solution.to_csv": partial(solution.to_csv, "a.csv", degrees=True, units={}),
        "Solution.to_pandas": partial(solution.to_pandas, units("mm")),
        "Sensitivity.of": partial(sensitivity.of, "torque", "motion.omega_2"),
        "Sensitivity.value": partial(sensitivity.value, "torque"),
    }


def spoilt(value, wrong):
    """The wrong value, and tuples and dictionaries in which it stands for one part, at
    any depth.
    """
    yield wrong
    if isinstance(value, dict):
        for key, part in value.items():
            yield from ({**value, key: bad} for bad in spoilt(part, wrong))
    if isinstance(value, tuple):
        for i, part in enumerate(value):
            for replacement in spoilt(part, wrong):
                parts = (*value[:i], replacement, *value[i + 1 :])
                yield type(value)(*parts) if hasattr(value, "_fields") else parts


@mark.slow
def test_whatever_an_argument_is_the_answer_is_a_value_or_one_line(
    tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    table = calls() | uses()
    public = set(dir(fourbar)) - OF_OTHERS
    errors = {name for name in public if name.endswith("Error")}
    assert {re.split(r"[.,]", name)[0] for name in table} - OF_OTHERS == public - errors
    holes = []
    for name, good in table.items():
        good()
        given = dict(enumerate(good.args)) | good.keywords
        for wrong in WRONG:
            for stated in itertools.islice(spoilt(given, wrong), 1, None):
                arguments = [stated.pop(i) for i in range(len(good.args))]
                try:
                    good.func(*arguments, **stated)
                    if wrong is ALWAYS_WRONG[-1]:
                        holes.append(f"{name} takes {wrong!r}")
                except FourBarError as error:
                    if "\n" in str(error):
                        holes.append(f"{name} given {wrong!r}: {error}")
                except Exception as error:
                    holes.append(f"{name} given {wrong!r}: {error!r}")
    assert not holes, "\n".join(holes)


def test_classify_as_json_is_what_the_formulas_say(capsys):
    assert status(["classify", "0.3", "0.1", "0.25", "0.22", "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    linkage = uniform(0.3, 0.1, 0.25, 0.22)
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


def test_scenes_compare_by_value():
    def turn(*angles, **stated):
        return crank_rocker(Motion(np.array(angles), 10.0, **stated))

    scene, same = turn(0.1, 0.2), turn(0.1, 0.2)
    assert scene == same and hash(scene) == hash(same) and scene != "scene"
    for changed in (
        turn(0.1, 0.3),
        crank_rocker(Motion(0.1, 10.0)),
        turn(0.1, 0.2, branch=-1),
        replace(scene, loads=scene.loads[:1]),
        replace(scene, drive_bar=4),
        replace(scene, title="another"),
    ):
        assert scene != changed


@mark.parametrize("wrong", [0, 2, -1.5, np.nan])
def test_a_command_on_no_branch_is_refused(wrong):
    scene = crank_rocker(Motion(np.array([0.1, 0.2]), 10.0))
    command = fourbar.command(scene)
    for row in (np.array([wrong]), np.array([1, wrong])):
        at = command._replace(angle=command.theta_2[: len(row)], branch=row)
        with raises(InputError, match=r"at\.branch = .*must be \+1"):
            solve(scene, at=at)


@mark.parametrize(
    "wrong", [{"branch": np.array(1)}, {"speed": [1.0, 2.0]}, {"acceleration": "1"}]
)
def test_a_command_of_another_shape_is_refused(wrong):
    scene = crank_rocker(Motion(np.array([0.1, 0.2]), 10.0))
    with raises(InputError, match=r"must be numbers, shape \(2,\)"):
        solve(scene, at=fourbar.command(scene)._replace(**wrong))


def test_the_sign_of_the_branch_is_that_of_the_pose():
    """Beyond its change point a kite has the other sign in the same assembly."""
    kite = Scene(uniform(1.0, 2.0, 1.0, 2.0), Motion(np.array([1.0, 4.0])))
    pin = {"A": np.empty((2, 2))}
    whole = solve(kite)
    assert whole.branch.tolist() == np.sign(whole.sin_mu).tolist() == [1, -1]
    assert solve(kite, at=fourbar.command(kite), out=pin).branch.tolist() == [1, -1]
