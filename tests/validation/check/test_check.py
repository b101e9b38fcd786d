"""Other people's numbers: judged row by row, and a known mistake is named as such."""

import json
import math
import re
import xml.etree.ElementTree as ET
from dataclasses import replace
from functools import partial
from math import cos, hypot, pi, radians, sin

import numpy as np
from pytest import approx, fixture, mark

import fourbar
from fourbar import Bar, Friction, Load, Motion, Sweep, Torsion, save
from fourbar.cli import status as fourbar_status
from fourbar.effects.load import Table
from fourbar.errors import BAD_INPUT, FAILED, HOLDS
from fourbar.quantities import OK, PIN_FORCES, UNITS, VECTORS
from fourbar.scene import Scene, command, command_at
from fourbar.scene.motion import Law
from fourbar.show.derived import derive
from fourbar.solving import solve
from fourbar_validation.check.calculated import find_miscalculated
from fourbar_validation.check.check import Judgement, list_names_of_points
from fourbar_validation.check.judge_table import MADE_OF, Allowance, Judge
from fourbar_validation.check.mistakes import list_column_mistakes, list_hypotheses
from fourbar_validation.check.theirs import NOT_JUDGED, read_table
from fourbar_validation.cli import status
from fourbar_validation.places import MODELS
from tests.support.rows import read_rows, refused, slow_but
from tests.support.scenes import (
    MASSLESS,
    UNIFORM_PARALLELOGRAM,
    recommand,
    relink,
)
from tests.validation.check.test_mistakes import CAUSES

SCENES = {
    name: fourbar.load(MODELS / f"{name}.toml")
    for name in ("thesis", "crank_rocker", "drag_link")
}
OURS, THESIS = SCENES["crank_rocker"], SCENES["thesis"]
ACCELERATING = recommand(OURS, acceleration=30.0)
SCENES["accelerating"] = relink(ACCELERATING, ground_angle=0.3)
MOMENT, FORCE = OURS.loads
TURNING = replace(OURS, loads=(MOMENT, replace(FORCE, frame="world")))
SCENES["load_in_the_world"] = TURNING
FORCES = ("torque", *PIN_FORCES)
ALL = ("theta_3", "theta_4", "omega_3", "omega_4", "alpha_3", "alpha_4", *FORCES)
EVERY = 31
"""One position of so many is written."""
OF_CAUSES = ("loads", "gravity", "the weight")
"""Beginnings of mistakes that need no case for each of their kinds."""
NO_CAUSE = "no single known mistake explains it"


def right(scene, **changed):
    """The right numbers at some positions; the command may be changed."""
    at = command(scene).part(slice(None, None, EVERY))._replace(**changed)
    solution = solve(scene, at=at)
    assert np.all(solution.status_code == OK)
    return {name: np.array(solution[name]) for name in ("theta_2", *ALL)}


def tabulate(columns, form=repr):
    """Write columns of numbers as a table, the first in full."""
    lines = [",".join(columns)]
    for first, *others in np.transpose([*columns.values()]).tolist():
        lines.append(",".join([repr(first), *map(form, others)]))
    return "\n".join([*lines, ""])


def write(numbers, names=ALL, digits=None):
    """Write a table, rounded but for its angles: those ask for a position."""
    columns = {"theta_2": numbers["theta_2"]}
    for name in names:
        if name in VECTORS:
            columns[f"{name}_x"], columns[f"{name}_y"] = numbers[name].T
        else:
            columns[name] = numbers[name]
    form = repr if digits is None else f"{{:.{digits}e}}".format
    return tabulate(columns, form)


def list_differing(scene, table):
    """Name the quantities that differ, without a search for what explains them."""
    findings = [one for one in Judge(scene, table).findings if one.judged]
    assert findings
    return {one.quantity for one in findings if not one.agrees}


@fixture
def judged(read):
    """Judges numbers that are written as a table."""

    def judge(scene, *numbers, tolerance=None):
        return Judgement(scene, read(write(*numbers)), tolerance)

    return judge


@fixture
def check(tmp_path, capsys):
    """Judges the text of a table by the command: status, output in one line, errors."""

    def call(scene, text, *options):
        table = tmp_path / "theirs.csv"
        if text is not None:
            table.write_bytes(text if isinstance(text, bytes) else text.encode())
        if isinstance(scene, Scene):
            save(scene, tmp_path / "scene.toml")
            scene = tmp_path / "scene.toml"
        code = status(["check", str(scene), str(table), *options])
        printed = capsys.readouterr()
        assert max(map(len, printed.out.splitlines()), default=0) <= 80
        return code, " ".join(printed.out.split()), printed.err

    return call


@mark.parametrize("scene", SCENES.values(), ids=SCENES)
def test_right_digits_agree_and_the_last_of_them_is_judged(scene, read):
    """A theta_2 that is rounded as the rest is allowed for, and excuses no more."""

    def differing(*numbers):
        return list_differing(scene, read(write(*numbers)))

    numbers = right(scene)
    assert not differing(numbers)
    rounded = [float(f"{x:.6g}") for x in numbers["theta_2"]]
    assert np.any(rounded != numbers["theta_2"])
    for given in (numbers, numbers | {"theta_2": np.array(rounded)}):
        assert not differing(given, ALL, 5)
        for name, off in (("torque", 3e-5), ("F43", 1e-4)):
            if given is numbers or name == "F43":
                wrong = given | {name: given[name] * (1.0 + off)}
                assert differing(wrong, ALL, 5) == {name}


def test_blank_cells_are_counted_and_the_rest_of_their_row_is_judged(read):
    numbers = right(THESIS)
    one, two = numbers["theta_2"][:2].tolist()
    first, second = numbers["torque"][:2].tolist()
    table = read(
        "theta_2,torque,F12_x,F12_y,note\n"
        f"{one},{first},,,a\n"
        f"{two},{2 * second},{numbers['F12'][1, 0]:.17g},,b\n"
        f"{two},,,,c\n"
    )
    judgement = Judgement(THESIS, table)
    assert [(f.line, f.quantity, f.agrees) for f in judgement.findings] == [
        (2, "torque", True), (3, "torque", False), (3, "F12_x", True)
    ]  # fmt: skip
    (wrong,) = judgement.differing
    assert wrong.theirs == (2 * second,)
    assert wrong.ours == approx((second,), rel=1e-12)
    assert judgement.sentence().endswith("; 3 of 6 cells are blank")


@mark.parametrize("angle, half", [("20.5", 0.0), ("20.5003", 0.00005)])
def test_whole_degrees_are_positions_that_somebody_chose(angle, half, read):
    """Zeros may be left off: a column has the decimals of its longest number."""
    table = read(f"theta_2 [deg],torque\n10,1.0\n{angle},1.0\n")
    assert table.find_half(table.place) == approx(np.radians(half), rel=1e-9)


@mark.parametrize("factor", [1.0, 1.1])
def test_what_the_digits_of_the_angle_explain_is_no_mistake(factor, read):
    """They are no positions of the scene: somebody may have chosen whole tenths."""
    angles = np.radians([30.84, 47.21, 68.77])
    torque = solve(OURS, at=command_at(OURS, angles)).torque
    torque[-1] *= factor
    rows = [
        f"{angle:.1f},{value:.6g}"
        for angle, value in zip(np.degrees(angles), torque, strict=True)
    ]
    judgement = Judgement(OURS, read("\n".join(["theta_2 [deg],torque", *rows, ""])))
    assert judgement.status == FAILED
    by_digits = "what differs is within half a digit of theta_2"
    assert (by_digits in judgement.describe_unexplained()) == (factor == 1.0)


def solved(change=lambda scene: scene, **commanded):
    """Solve another scene, or the same one at another command."""
    return lambda scene: right(change(scene), **commanded)


def changed(change):
    """Change columns of the right numbers."""
    return lambda scene: (numbers := right(scene)) | change(numbers)


def units(*names, factor):
    return changed(lambda numbers: {name: factor * numbers[name] for name in names})


def in_axes(degrees, of_y=1.0, names=PIN_FORCES, factor=1.0):
    """State vectors in axes that are turned, whose y may be reversed."""
    c, s = cos(radians(degrees)), sin(radians(degrees))
    axes = factor * np.array([(c, -of_y * s), (s, of_y * c)])
    return changed(lambda right: {name: right[name] @ axes for name in names})


def relative_to(base):
    return changed(lambda numbers: {"theta_4": numbers["theta_4"] - numbers[base]})


def shifted(change, names=ALL):
    """Take numbers from other positions than those beside which they are written."""

    def planted(scene):
        numbers = right(scene)
        others = right(scene, angle=change(numbers["theta_2"]))
        return numbers | {name: others[name] for name in names}

    return planted


def gravity(*field):
    """Solve with another field of gravity: its size and direction, or none."""
    effects = (fourbar.Gravity(*field),) if field else ()
    return solved(lambda scene: replace(scene, effects=effects))


def loads_times(factor, of_moments):
    """Multiply the forces of all loads, and their moments by another factor."""

    def scale(load):
        size, angle = load.force or (0.0, 0.0)
        moment = of_moments * load.moment
        return replace(load, force=(factor * size, angle), moment=moment)

    return solved(lambda scene: replace(scene, loads=tuple(map(scale, scene.loads))))


def bars(change, *names):
    """Solve with these bars changed; without names every moving bar."""
    names = names or ("input", "coupler", "output")

    def change_linkage(scene):
        moving = {name: change(getattr(scene.linkage, name)) for name in names}
        return relink(scene, **moving)

    return solved(change_linkage)


def centred(change):
    """Put the mass centre of a bar elsewhere, in coordinates along and across it."""

    def change_bar(bar):
        r, phi = bar.mass_centre
        x, y = change(bar.length, r * cos(phi), r * sin(phi))
        return replace(bar, centre=(hypot(x, y), math.atan2(y, x)))

    return change_bar


def scaled(mass=1.0, inertia=1.0):
    """Multiply mass and moment of inertia about G."""
    return lambda bar: replace(
        bar, mass=mass * bar.mass, inertia=inertia * bar.moment_of_inertia
    )


def steiner(bar):
    """Move the axis of the moment of inertia from G to the first pin."""
    added = bar.mass * bar.mass_centre[0] ** 2
    return replace(bar, inertia=bar.moment_of_inertia + added)


def opposite(planted):
    """Take off what a mistake adds; no bar has so little inertia."""

    def less(scene):
        numbers, more = right(scene), planted(scene)
        return {name: 2.0 * numbers[name] - more[name] for name in numbers}

    return less


def stretched(name, factor):
    """Change a length; bars keep mass, centre and inertia."""

    def change(scene):
        linkage = scene.linkage
        longer = factor * linkage.ground
        if name != "ground":
            bar = getattr(linkage, name)
            kept = {"centre": bar.mass_centre, "inertia": bar.moment_of_inertia}
            longer = replace(bar, length=factor * bar.length, **kept)
        return relink(scene, **{name: longer})

    return solved(change)


def inertial(by_mass, by_inertia):
    """m a and I alpha by hand: what each adds to static equilibrium, times a factor."""

    def planted(scene):
        numbers = right(scene)
        still = right(scene, speed=0.0, acceleration=0.0)
        points = bars(scaled(inertia=0.0))(scene)
        for name in FORCES:
            of_masses = by_mass * (points[name] - still[name])
            of_inertia = by_inertia * (numbers[name] - points[name])
            numbers[name] = still[name] + of_masses + of_inertia
        return numbers

    return planted


def in_degrees(first):
    """Angles in degrees within a turn from `first`."""
    names = ("theta_3", "theta_4")

    def turn(angle):
        return first + (np.degrees(angle) - first) % 360.0

    return changed(lambda numbers: {name: turn(numbers[name]) for name in names})


def in_other_frame(scene):
    """Return the scene with its force in the other frame, "world" or "bar"."""
    return OURS if scene is TURNING else TURNING


def mirrored(by):
    """Reverse all that turns, the commanded angle too, and vectors by a factor."""
    return changed(
        lambda right: {
            name: (by if name in VECTORS else -1.0) * values
            for name, values in right.items()
        }
    )


UNITS_TAKEN = read_rows("""
thesis | numbers in N cm where N m was announced | torque | 100
thesis | kgf | F12 F32 F43 F14 | 0.10197162129779283
thesis | sign reversed | torque | -1
thesis | every number is 0.37 times ours | F12 F14 | 0.37
crank_rocker | numbers in N mm where N m | torque | 1000
crank_rocker | numbers in kN where N was | F12 F32 F43 F14 | 0.001
crank_rocker | numbers in lbf ft where N m | torque | 0.7375621492772654
crank_rocker | F_ij given for F_ji | F32 | -1
crank_rocker | degrees where radians | theta_3 theta_4 | 57.29577951308232
crank_rocker | in radians where degrees | theta_2 | 0.017453292519943295
""")
"""Scene, words, quantities and the factor on them: of kgf 1 / 9.80665."""
RPM = pi / 30.0
OF_A_BAR = {
    ": mass centre measured from the wrong pin": centred(lambda d, x, y: (d - x, y)),
    ": mass centre taken at mid-bar": centred(lambda d, x, y: (d / 2.0, 0.0)),
    ".centre reversed": centred(lambda d, x, y: (-x, -y)),
    ".centre.1 reversed": centred(lambda d, x, y: (x, -y)),
    ".centre.1 left out": centred(lambda d, x, y: (hypot(x, y), 0.0)),
    ": inertia about the pin": steiner,
    ".mass left out": scaled(mass=0.0),
}
WHOSE = (("bars.coupler", ("coupler",)), ("bars.*", ()))
LENGTHS = {"ground": 1.01, "input": 0.98, "coupler": 1.001, "output": 0.95}
IN_THESIS = {
    "x and y exchanged": changed(lambda right: {"F32": right["F32"][:, ::-1]}),
    "other branch": solved(branch=np.full(12, -1, np.int8)),
    **{
        f"gravity along -y is included though the scene has none: {size}": (
            gravity(size)
        )
        for size in (9.81, 9.80665, 9.8)
    },
    "bars.coupler.inertia left out": bars(scaled(inertia=0.0), "coupler"),
    "bars.*.inertia left out": bars(scaled(inertia=0.0)),
    "bars.output.inertia 10000 times ours": bars(scaled(inertia=1e4), "output"),
    **{
        f"on bar {bar} instead of bar 4": solved(partial(replace, drive_bar=bar))
        for bar in (2, 3)
    },
    "m a in kg cm/s^2 added to N": inertial(100.0, 1.0),
    "I alpha in kg cm^2/s^2": inertial(1.0, 100.0),
    "bars.*.inertia reversed": inertial(1.0, -1.0),
    "m a and I alpha in kg mm/s^2": inertial(1e3, 1e3),
    **{
        f"loads {done}": loads_times(x, x)
        for done, x in {"left out": 0.0, "doubled": 2.0, "reversed": -1.0}.items()
    },
    "loads.0.force 0.1 times ours": loads_times(0.1, 1.0),
    "theta_4 or": changed(lambda right: {"theta_4": right["theta_4"] + pi}),
    "relative to bar 3": relative_to("theta_3"),
    "F32 and F43 are exchanged": changed(
        lambda right: {"F32": right["F43"], "F43": right["F32"]}
    ),
}
IN_CRANK_ROCKER = {
    "loads and effects left out": solved(
        lambda scene: replace(scene, loads=(), effects=())
    ),
    "the power is given": changed(lambda right: {"torque": 10.0 * right["torque"]}),
    "the sign is lost: sizes alone": changed(
        lambda right: {"torque": abs(right["torque"])}
    ),
    "y reversed": units(*PIN_FORCES, factor=(1.0, -1.0)),
    "x reversed": units("F12", "F32", factor=(-1.0, 1.0)),
    "in axes turned by -90 deg": in_axes(-90.0),
    "in axes turned by 22.918 deg": in_axes(math.degrees(0.4)),
    "in axes turned by 33 deg, y reversed, every number is 0.37 times ours": in_axes(
        33.0, -1.0, ("F12", "F43"), 0.37
    ),
    "effects.gravity left out": gravity(),
    "effects.gravity reversed": gravity(-9.81),
    "gravity points to 0 deg": gravity(9.81, 0.0),
    "effects.gravity 0.101937 times ours": gravity(1.0),
    "statics": solved(speed=0.0, acceleration=0.0),
    **{
        f"omega_2 in {words}": solved(speed=10.0 * factor)
        for words, factor in {
            "rev/min taken for rad/s": 1.0 / RPM,
            "rad/s taken for rev/min": RPM,
            "rev/s taken for rad/s": 0.5 / pi,
            "deg/s taken for rad/s": math.degrees(1.0),
            "rad/s taken for deg/s": radians(1.0),
            "deg/s taken for rev/min": 6.0,
            "rev/min taken for deg/s": 1.0 / 6.0,
        }.items()
    },
    "omega_2 is reversed": solved(speed=-10.0),
    **{
        f"{who}{text}": bars(change, *names)
        for text, change in OF_A_BAR.items()
        for who, names in WHOSE
    },
    **{
        f"{who}: inertia about G used as the inertia about the pin": opposite(
            bars(steiner, *names)
        )
        for who, names in WHOSE
    },
    "bars.*.inertia 4 times ours": bars(
        lambda bar: replace(bar, inertia=bar.mass * bar.length**2 / 3.0)
    ),
    "bars.output.inertia 0.83 times ours": bars(scaled(inertia=0.83), "output"),
    "bars.coupler 1.2 times ours": bars(scaled(mass=1.2, inertia=1.2), "coupler"),
    "bars.coupler.mass 1.2 times ours": bars(scaled(mass=1.2), "coupler"),
    "bars.coupler left out": bars(scaled(mass=0.0, inertia=0.0), "coupler"),
    "bars left out": bars(scaled(mass=0.0, inertia=0.0)),
    "m a and I alpha in kg cm/s^2": inertial(100.0, 100.0),
    "m a in kg mm/s^2": inertial(1e3, 1.0),
    "d'Alembert": inertial(-1.0, -1.0),
    "from another zero: theta_2 +37 deg": shifted(lambda theta: theta + radians(37.0)),
    "from another zero: theta_2 -118 deg": shifted(
        lambda theta: theta - radians(118.0)
    ),
    "from another zero: theta_2 +90 deg": shifted(lambda theta: theta + radians(90.0)),
    "read as degrees": shifted(np.radians),
    "relative to bar 2": relative_to("theta_2"),
    **{
        f"omega_2 {factor} times ours": solved(speed=10.0 * factor)
        for factor in (0.5, 7)
    },
    "theta_2 counted clockwise, with all angles and torques": mirrored(1.0),
    "all angles and torques, and y reversed": mirrored((1.0, -1.0)),
    "one step late: numbers of the position before": changed(
        lambda right: {name: np.roll(right[name], 1, axis=0) for name in ALL}
    ),
    **{
        f"half a step {word}: numbers between a position and the one {side}{extent}": (
            shifted(move, names)
        )
        for word, side, move in (
            ("late", "before", lambda theta: theta - 0.5 * (theta[1] - theta[0])),
            ("early", "after", lambda theta: theta + 0.5 * (theta[1] - theta[0])),
        )
        for names, extent in ((ALL, ""), (FORCES, " (forces alone)"))
    },
    **{
        f"lengths.{name} {factor:g} times ours": stretched(name, factor)
        for name, factor in LENGTHS.items()
    },
    "loads.1 (bar 3): its direction is kept": solved(in_other_frame),
}
MISTAKES = {
    "thesis": IN_THESIS,
    "crank_rocker": IN_CRANK_ROCKER,
    "accelerating": {
        "ground_angle is left out": solved(partial(relink, ground_angle=0.0)),
        "forces are in the frame of bar 1": in_axes(math.degrees(0.3)),
        "alpha_2 is left out": solved(acceleration=0.0),
        "omega_2 is left out": solved(speed=0.0),
        "alpha_2 in deg/s^2 taken for": solved(acceleration=math.degrees(30.0)),
        "alpha_2 in rad/s^2 taken for": solved(acceleration=radians(30.0)),
    },
    "load_in_the_world": {
        "loads.1 (bar 3): its direction turns with": solved(in_other_frame)
    },
    "drag_link": {
        "degrees from -180 to 180 where radians": in_degrees(-180.0),
        "degrees from 0 to 360 where radians": in_degrees(0.0),
    },
}
"""What was done by words of its explanation, by scene."""
for name, words, names, factor in UNITS_TAKEN:
    MISTAKES[name][words] = units(*names.split(), factor=float(factor))


@mark.parametrize(
    "name, words",
    [(name, words) for name, planted in MISTAKES.items() for words in planted],
)
def test_a_known_mistake_is_the_first_explanation(name, words, judged):
    scene = SCENES[name]
    judgement = judged(scene, MISTAKES[name][words](scene), ALL, 9)
    assert judgement.differing
    first = judgement.explanations[0]
    assert words in first.text and first.complete
    said = [(one.text, one.quantities) for one in judgement.explanations]
    assert len(set(said)) == len(said)


def test_every_hypothesis_has_a_case_and_no_two_have_one_text(read):
    """Whatever is swapped, left out or of another unit has a message.

    A case above demands it.
    """

    def kind(text):
        text = re.sub(
            r"^(bars|loads|effects)\S* (left out|doubled|reversed)", r"\2", text
        )
        return re.sub(r"input|coupler|output|loads\.\d|bar \d", "ONE", text)

    cases = [kind(words) for planted in MISTAKES.values() for words in planted]
    cases += [*map(kind, CAUSES), "counted to 180 deg"]
    listed = list(list_column_mistakes(solve(OURS)))
    for scene in SCENES.values():
        texts = [mistake.text for mistake in list_hypotheses(scene, command(scene))]
        calculated = find_miscalculated(Judge(scene, read(write(right(scene)))))
        texts_of_columns = (mistake.text for mistake in calculated if mistake.whole)
        every = [*texts, *texts_of_columns]
        assert len(set(every)) == len(every)
        listed += [text for text in texts if not text.startswith(OF_CAUSES)]
    texts = {kind(getattr(one, "text", one)) for one in listed}
    assert not {text for text in texts if not any(words in text for words in cases)}


@mark.parametrize("name", ["drawn", "loads", "push_output"])
def test_places_by_points_and_arms_have_hypotheses(name):
    """A place of one bar is refused on another, and an arm on a force that turns."""
    scene = fourbar.load(MODELS / "capabilities" / f"{name}.toml")
    texts = [mistake.text for mistake in list_hypotheses(scene, command(scene))]
    assert any("(bar 4): its force acts at G" in text for text in texts)


@mark.parametrize("digits", [4, 5])
def test_a_ratio_fitted_to_rounded_numbers_and_one_to_SI_are_named(
    digits, judged, read
):
    numbers = units("torque", "F12", factor=1.0 / 9.81)(OURS)
    (explanation,) = judged(OURS, numbers, ("torque", "F12"), digits).explanations
    assert explanation.quantities == ("torque", "F12")
    angles = {"theta_2": numbers["theta_2"], "theta_4 [deg]": numbers["theta_4"]}
    table = read(tabulate(angles, f"{{:.{digits}f}}".format))
    first = Judgement(OURS, table).explanations[0].text
    assert first.startswith("units: numbers in rad where deg was announced")


def test_a_ratio_of_one_is_no_mistake_and_a_reversed_sign_has_one_text(judged, read):
    """Four numbers are half as far again from ours as round-off allows."""
    numbers = right(OURS)
    column = Judge(OURS, read(write(numbers))).columns["F12"]
    off = np.zeros((12, 2))
    off[::3, 0] = 1.5 * (column.judged_right[1] * column.size)[::3]
    for sign, texts in (1.0, []), (-1.0, ["sign reversed, or F_ij given for F_ji"]):
        judgement = judged(OURS, numbers | {"F12": sign * (numbers["F12"] + off)})
        assert judgement.differing
        assert [one.text for one in judgement.explanations] == texts


def test_a_sign_that_negative_masses_would_explain_is_a_sign(judged):
    """Nothing but masses and their weight acts."""
    weighed = replace(OURS, loads=(), effects=(fourbar.Gravity(9.81, -pi / 2.0),))
    numbers = right(weighed)
    reversed_ = {name: -numbers[name] for name in FORCES}
    (said,) = judged(weighed, numbers | reversed_).explanations
    assert said.text == "sign reversed, or F_ij given for F_ji" and said.complete


@mark.slow
def test_a_position_that_agrees_by_chance_does_not_hide_a_mistake(judged):
    numbers = right(OURS)
    slip = numbers["torque"] * np.where(np.arange(12) % 5 == 4, -1.0, 1.0)
    assert not judged(OURS, numbers | {"torque": slip}, ("torque",)).explanations
    rounded = [float(f"{x:.5f}") for x in np.radians(numbers["theta_2"])]
    numbers["theta_2"] = np.array(rounded)
    assert rounded[0] == 0.0
    first = judged(OURS, numbers, ("torque",)).explanations[0]
    assert "in radians where degrees" in first.text


def test_the_other_branch_is_named_where_the_torque_has_a_slip_besides(check):
    numbers = right(OURS, branch=np.full(12, -1, np.int8))
    numbers["torque"] *= 1.0 + 0.1 * np.sin(np.arange(12))
    code, out, _ = check(OURS, write(numbers, ("theta_4", "torque")))
    assert code == FAILED and out.count("looks like") == 1
    assert "looks like: the other branch (explains theta_4)" in out
    assert "no single known mistake explains the rest" in out


STROKE = fourbar.load(MODELS / "capabilities/stroke_input.toml")
COVERED = replace(
    OURS,
    motion=Motion(Sweep(0.5, 1.5, 12), 10.0),
    loads=(Load(4, moment=-3.0, table=Table((0.5, 1.0, 1.5), (0.5, 1.0, 0.3))),),
)
OTHERS = {
    "loads.0.moment 1.1 times ours (fitted)": (
        COVERED,
        solve(replace(COVERED, loads=(replace(COVERED.loads[0], moment=-3.3),))),
    ),
    "ground_angle is left out": (
        STROKE,
        solve(relink(STROKE, ground_angle=0.0)),
    ),
    "effects.torsion.O4 left out": (
        replace(OURS, effects=(Torsion.at(O4=(2.0, 1.0, 0.5)),)),
        solve(replace(OURS, effects=())),
    ),
}


@mark.parametrize("words", OTHERS)
def test_the_table_of_another_scene_is_explained(words, read):
    scene, numbers = OTHERS[words]
    name = scene.motion.commanded
    at = solve(scene)[name]
    text = tabulate({name: at, "F12_x": numbers.F12[:, 0], "F14_y": numbers.F14[:, 1]})
    judgement = Judgement(scene, read(text, commanded=name))
    first, *more = (one.text for one in judgement.explanations)
    assert first == words and not any("of two bars" in text for text in more)


@mark.parametrize(
    "alpha, part, code, words",
    read_rows("""
0 | 0 | 0 | 24 of 24 numbers agree
0 | -0.7 | 0 | friction, not judged: F12_x 12 of 12 numbers agree
0 | 1 | 0 | 12 of torque lie within and agree
0 | 1.01 | 1 | every number is ours +0.505 N m
-9 | 0 | 0 | 24 of 24 numbers agree
-9 | -1 | 0 | 24 of 24 numbers agree
-9 | -0.7 | 1 | 12 of torque
-9 | 1 | 1 | 12 of torque
"""),
)
def test_dry_friction_holds_a_range_of_torques_at_rest(alpha, part, code, words, check):
    """Nothing is held where it starts: there the whole of friction acts."""
    still = recommand(OURS, speed=0.0, acceleration=float(alpha))
    scene = replace(still, effects=(Friction.at(O2=0.5),))
    numbers = right(scene)
    columns = {
        "theta_2": numbers["theta_2"],
        "torque": numbers["torque"] + 0.5 * float(part),  # O2 turns with the driven bar
        "F12_x": numbers["F12"][:, 0],
    }
    result, out, _ = check(scene, tabulate(columns))
    assert result == int(code) and words in out


def test_a_rounded_log_of_a_start_has_digits_where_it_starts(check):
    """Half a unit of its speed is no reversal of the whole of dry friction."""
    rates = {"omega_2": [0.0, 1.0, 2.0], "alpha_2": [9.0, 9.0, 9.0]}
    rubbing = replace(OURS, effects=(Friction.at(O2=0.5),))
    logged = solve(replace(rubbing, motion=Motion([0.4, 0.5, 0.6], *rates.values())))
    columns = {"theta_2": logged.theta_2, **rates, "torque": logged.torque}
    text = write(columns, ("omega_2", "alpha_2", "torque"), 6)
    _, out, _ = check(replace(rubbing, motion=Motion(0.4)), text)
    assert "3 of 3 numbers agree" in out


@mark.parametrize(
    "share, code", [(-1.0, HOLDS), (0.0, HOLDS), (1.0, HOLDS), (0.5, FAILED)]
)
def test_where_a_list_turns_back_friction_acts_one_way_or_the_other(share, code, check):
    motion = Motion([0.4, 0.8, 0.5], [2.0, 0.0, -2.0], [0.0, -9.0, 0.0])
    scene = replace(OURS, motion=motion, effects=(Friction.at(O2=0.5),))
    solution = solve(scene)
    torque = solution.torque + np.array([0.0, 0.5 * share, 0.0])
    columns = {"theta_2": solution.theta_2, "torque": torque}
    assert check(scene, write(columns, ("torque",)))[0] == code


@mark.parametrize("axis, name", [(0, "F12_x"), (1, "F12_y")])
def test_the_sign_of_one_component_is_named_by_itself(axis, name, read):
    numbers = right(OURS)
    columns = {"theta_2": numbers["theta_2"], name: -numbers["F12"][:, axis]}
    first = Judgement(OURS, read(tabulate(columns))).explanations[0]
    assert "sign reversed" in first.text
    assert first.complete and first.quantities == (name,)


def test_rates_of_the_rows_are_named_where_the_scene_states_others(read):
    rates = np.linspace(3.0, 7.0, 12)
    numbers = right(OURS, speed=rates, acceleration=-rates)
    columns = {"omega_2": rates, "alpha_2": -rates, "torque": numbers["torque"]}
    for logged in (columns, columns | {"omega_2": rates.round(3)}):
        table = read(tabulate({"theta_2": numbers["theta_2"], **logged}))
        (told,) = Judgement(OURS, table).explanations
        text = "own speed: leave omega_2 and alpha_2 out of the scene"
        assert told.text.endswith(text) and told.complete


def test_another_unit_of_a_speed_comes_before_a_fitted_one(read):
    solution = solve(OURS)
    x, y = 1e3 * solution.v_B.T
    table = read(tabulate({"theta_2": solution.theta_2, "v_B_x": x, "v_B_y": y}))
    first, *_ = Judgement(OURS, table).explanations
    assert first.text.startswith("units: numbers in mm/s where m/s")


def test_shaking_takes_part_in_a_mistake(read):
    still = solve(replace(OURS, effects=()))
    x, y = derive(still, "shaking_force").T
    columns = {"shaking_force_x": x, "shaking_force_y": y, "torque": still.torque}
    table = read(tabulate({"theta_2": still.theta_2, **columns}))
    (told,) = Judgement(OURS, table).explanations
    assert told.text == "effects.gravity left out" and told.complete
    assert told.quantities == ("shaking_force", "torque")


def test_a_size_is_that_of_one_force_without_a_sign(read):
    numbers = right(OURS)
    size = np.hypot(*numbers["F14"].T)
    columns = {"theta_2": numbers["theta_2"], "F43": size}
    told = Judgement(OURS, read(tabulate(columns))).explanations
    assert [one.text for one in told] == ["F43 = F14"]
    late = read(tabulate({"theta_2": numbers["theta_2"], "F14": np.r_[9.0, size[:-1]]}))
    first = Judgement(OURS, late).explanations[0]
    assert first.text.startswith("one step late")


@mark.parametrize("torque, code", [("0.0", HOLDS), ("0.04", FAILED)])
def test_what_is_zero_by_all_its_terms_is_judged_in_its_own_unit(torque, code, check):
    """Bars without mass or load take no torque.

    Half a printed digit over a scale of 0 once excused any number.
    """
    scene = Scene(MASSLESS, Motion(1.0, 2.0))
    assert check(scene, f"theta_2,torque\n1.0,{torque}\n")[0] == code


REFUSED_MOTIONS = [
    (
        {
            "theta_2": 1.0,
            "omega_2": 2.0,
            "free": fourbar.Free(1.0, 10),
        },
        "not judged while released; without free and omega_2 each row is judged at its"
        " own omega_2 and alpha_2",
    ),
    (
        {"law": Law((0.0, 0.5, 1.0, 1.5), (0.0, 1.0, 2.0, 3.0))},
        "at the scene's own positions",
    ),
    ({"theta_2": [0.1, 0.2], "omega_2": [1.0, 2.0]}, "motion.omega_2: a table"),
]


@mark.parametrize("motion, words", REFUSED_MOTIONS)
def test_a_motion_that_rows_are_not_found_by_is_refused_in_one_line(
    motion, words, check
):
    """A released scene is not judged at the speed of its start."""
    scene = replace(OURS, motion=Motion(**motion))
    code, _, error = check(scene, "theta_2,torque\n0.3,1.0\n")
    assert code == BAD_INPUT and words in error and "scene.toml: motion" in error


def noise(seed, values):
    return np.random.default_rng(seed).normal(size=values.shape)


def test_nonsense_and_a_single_number_are_explained_by_nothing(judged, read):
    """Of one torque every mass and every load would be the cause.

    Without gravity it is 0.292 N m, which two digits tell from nothing.
    """
    few = Judgement(OURS, read("theta_2 [deg],torque\n60,0.29\n"))
    assert few.differing and not few.explanations
    numbers = right(OURS)
    wild = numbers | {name: noise(3, numbers[name]) for name in FORCES}
    assert judged(OURS, wild, FORCES).explanations == []


def test_the_thesis_itself_differs_and_no_single_mistake_explains_it(check):
    """Its section 5.7 at theta_2 = 135 deg, N and N cm, digits as printed."""
    code, printed, _ = check(
        THESIS,
        "theta_2 [deg],torque [N cm],F12_x,F12_y,F32_x,F32_y,F43_x,F43_y,F14_x,F14_y\n"
        "135,308.80440716278196,161.41816840858934,-156.5062600586869,"
        "-16.155517050935163,1.2436087010327004,-15.747450980232276,"
        "-0.10106254809495736,-15.753131487864277,-0.4245152186008738\n",
    )
    assert code == FAILED
    assert "0 of 5 numbers agree" in printed and NO_CAUSE in printed
    assert "looks like" not in printed


def test_a_long_line_ends_within_no_word(check):
    """Put together again, its lines are one."""
    mistake = "m a and I alpha in kg mm/s^2"
    code, printed, _ = check(THESIS, write(IN_THESIS[mistake](THESIS)))
    assert code == FAILED and f"looks like: {mistake} and kg mm^2/s^2," in printed
    assert "1000 times (explains everything that differs: torque, F12, F32" in printed


BAD_TABLES = read_rows(r"""
 | header and at least one row
theta_2,torque\n | header and at least one row
torque\n1\n | theta_2
theta_2\n1\n | needs a result; known are the columns
theta_2,torque_error\n1,0\n | needs a result
theta_2,torque\n,2\n | line 2 = ['', '2']: needs a theta_2
theta_2,torque\n1,\n | needs a result in place of blank cells
theta_2,torque\n1,2,3\n | needs 2 cells; with decimal commas, semicolons
theta_2,torque\nrad,kg\n1,2\n | kg
theta_2,torque_low\n1,2\n | no dry friction
theta_2,drive_force\n1,2\n | its drive exerts a torque
theta_2,stroke\n1,2\n | it has no cylinder
time,Zeit,torque\n0,0,1\n | columns 1 and 2 are both time
theta_2,wheel\n1,2\n | known are the columns of
theta_2,torque [kg]\n1,2\n | kg
theta_2,torque,torque\n1,2,3\n | columns 2 and 3 are both torque: rename
theta_2,torque\n1,much\n | line 2
theta_2,torque\n1,nan\n | finite
theta_2,torque\n1,1e999\n | larger than a double
theta_2,torque\n\n1,2\n3\n | line 4
theta_2,torque\n1,"2,5"\n | line 2, torque = '2,5': must be a number
\xff\xfe\x00\x01 | UTF-8
theta_2,torque\n1,2\x00\n | table
theta_2,\x1b[31mtorque\n1,2\n | known are
theta_4 [deg],torque\n190,1\n | line 2, theta_4 = '190 deg': the motion passes it at
""")


@mark.parametrize("text, words", BAD_TABLES)
def test_a_bad_table_is_one_line(text, words, check):
    written = text.encode().decode("unicode_escape").encode("latin-1")
    code, _, error = check(THESIS, written)
    assert code == BAD_INPUT and words in error and "theirs.csv" in error
    assert len(error.splitlines()) == 1 and "\x1b" not in error


def test_a_stroke_from_another_zero_is_refused_by_its_line(check):
    code, _, error = check(STROKE, "stroke [m],torque\n0.1,1\n0,1\n")
    assert code == BAD_INPUT and "theirs.csv: line 3, stroke" in error


def test_positions_that_do_not_assemble_are_named_by_their_line(read, check):
    """A right number beside them makes no success of the table."""
    assert check(THESIS, "theta_2,torque\n\n0.8,1\n")[0] == FAILED
    both = (right(THESIS)[f"theta_{bar}"][0] for bar in (2, 3))
    right_row = ",".join(repr(float(angle)) for angle in both)
    table = read(f"theta_2,theta_3\n{right_row}\n{radians(45.0)!r},1\n")
    judgement = Judgement(THESIS, table)
    assert judgement.not_assembled == [3] and judgement.status == FAILED
    assert [finding.line for finding in judgement.findings] == [2]


@mark.parametrize("degrees", [False, True])
@mark.parametrize("delimiter", [",", ";", "\t"])
def test_the_file_of_analyze_is_read_as_it_is_and_as_a_spreadsheet_saves_it(
    delimiter, degrees, check
):
    text = solve(THESIS, "error").to_csv(degrees=degrees)
    # without the derived quantities, which stand before the time
    cells = [line.split(",") for line in text.splitlines()[:40]]
    rows = [row[:14] + row[-22:-13] + row[-1:] for row in cells]
    if delimiter == ";":  # decimal commas, and what is left of a deleted column
        rows = [[cell.replace(".", ",") for cell in row] + [""] for row in rows]
    code, printed, _ = check(
        THESIS, "\ufeff" + "\r\n".join(delimiter.join(row) for row in rows)
    )
    assert code == HOLDS
    assert "left out (stated by the scene): status, branch, drive_bar" in printed
    printed = printed.replace(" [N m]", "")
    assert "left out (blank): torque_low, torque_high" in printed
    assert "429 of 429 numbers agree" in printed


@mark.parametrize("name", slow_but({"drawn"}, ["drawn", "springs", "push_output"]))
def test_every_column_of_the_file_of_analyze_is_known(name, tmp_path):
    """Each is judged at its own scale: A_x was once judged in newtons.

    A millionth of the largest number of a column is beyond every allowed error.
    """
    text = (MODELS / "capabilities" / f"{name}.toml").read_text()
    post = '[points]\npost = { bar = 1, from_pin = ["20 mm", "0 deg"] }'
    file, path = tmp_path / "scene.toml", tmp_path / "theirs.csv"
    file.write_text(text.replace("[points]", post))
    assert fourbar_status(["analyze", str(file), "--csv", "-o", str(path)]) == HOLDS
    scene = fourbar.load(file)
    points = list_names_of_points(scene)
    table = read_table(path, points=points).from_pin(scene.origin)
    assert "not a known column" not in table.left_out.values()
    assert Judgement(scene, table).status == HOLDS
    if any(scene.origin):
        assert list_differing(scene, read_table(path, points=points)) >= {"A", "B"}
    made = [key for key in table.columns if key.strip("|") not in UNITS]
    assert len(made) > len(MADE_OF)
    for key in table.columns.keys() - {*NOT_JUDGED, table.found_by}:
        column = table.columns[key]
        far = 1e-6 * (np.nanmax(abs(column.values)) or 1.0)
        exact = np.zeros(len(column.values))
        off = column._replace(values=column.values + far, rounding=exact)
        theirs = replace(table, columns={**table.columns, key: off})
        assert list_differing(scene, theirs) == {key}


@mark.parametrize("wrong", [False, True])
def test_magnitudes_and_a_whole_imperial_table(wrong, read):
    numbers = right(OURS)
    inch, pound = 0.0254, 4.4482216152605
    columns = {
        "theta_2 [deg]": np.degrees(numbers["theta_2"]),
        "omega_3 (rpm)": numbers["omega_3"] / RPM,
        "F12 [lbf]": np.hypot(*numbers["F12"].T) / pound,
        "|F43| [kN]": np.hypot(*numbers["F43"].T) / 1e3 * (1.0 + 1e-6 * wrong),
        "F14_x [kgf]": numbers["F14"][:, 0] / 9.80665,
        "F41 [N]": np.hypot(*numbers["F14"].T),
        "F23_y [N]": -numbers["F32"][:, 1],
        "torque": numbers["torque"] / (pound * inch),
    }
    heading, *lines = tabulate(columns, "{:.12g}".format).splitlines()
    under = ",,,,,,,lbf in"  # a line of units under the names
    table = read("\n".join([heading, under, *lines]))
    assert not table.left_out
    assert list_differing(OURS, table) == ({"|F43|"} if wrong else set())


def test_a_stated_tolerance_decides_and_the_exact_count_stands_next_to_it(
    tmp_path, check
):
    numbers = right(THESIS)
    off = numbers | {"torque": numbers["torque"] * (1.0 + 1e-4)}
    text = write(off)
    document, suites = tmp_path / "out.json", tmp_path / "out.xml"
    rows = len(numbers["theta_2"])
    count = len(ALL) * rows

    def judge(*options):
        forms = (f"--json={document}", f"--junit={suites}")
        code, printed, _ = check(THESIS, text, *forms, *options)
        cases = ET.parse(suites).getroot().iter("testcase")
        failing = [one.get("name") for one in cases if one.find("failure") is not None]
        return code, printed, json.loads(document.read_text()), failing

    code, _, report, failing = judge()
    assert code == FAILED and failing == ["torque"] and not report["holds"]
    assert (report["compared"], report["agree"]) == (count, count - rows)
    assert {finding["quantity"] for finding in report["differing"]} == {"torque"}
    assert report["differing"][0]["theirs"] == approx([off["torque"][0]], rel=1e-15)
    code, printed, report, failing = judge("--rtol", "1e-3")
    agreed = f"{count} of {count} numbers agree within rtol 0.001, atol 0"
    assert code == HOLDS and f"{agreed}; {count - rows} to round-off" in printed
    assert report["agree_to_round_off"] == count - rows and failing == []
    codes = [judge(one)[0] for one in ("--atol=1e-9", "--atol=1.0", "--rtol=-1")]
    assert codes == [FAILED, HOLDS, BAD_INPUT]


def test_a_mistake_is_recognised_in_numbers_that_are_right_only_to_the_stated_tolerance(
    judged,
):
    """A simulation's torque, a ten-thousandth off, under the wrong unit."""
    numbers = units("torque", factor=1e3)(OURS)
    numbers["torque"] *= 1.0 + 1e-4 * np.sin(np.arange(len(numbers["torque"])))
    first = judged(OURS, numbers, tolerance=Allowance(rtol=1e-3)).explanations[0]
    assert "N mm where N m" in first.text and first.complete
    twice = loads_times(2.0, 2.0)(THESIS)
    first = judged(THESIS, twice, FORCES, 4, tolerance=Allowance(1e-3)).explanations[0]
    assert first.text == "loads doubled" and first.complete


def test_a_factor_with_a_plain_name_is_named_in_a_table_of_one_row(judged):
    for times, name in ((2.0, "loads doubled"), (-1.0, "loads reversed")):
        numbers = loads_times(times, times)(OURS)
        row = {key: values[:1] for key, values in numbers.items()}
        assert judged(OURS, row, ["torque"]).explanations[0].text == name


def test_an_input_is_named_before_a_calculation_that_explains_as_much(judged):
    scene = replace(OURS, loads=(), effects=())
    heavier = bars(scaled(mass=2.0), "output")(scene)
    texts = [one.text for one in judged(scene, heavier, ["torque"]).explanations]
    assert texts[:2] == [
        "bars.output.mass doubled",
        "bars.output: inertia about the pin used as the inertia about G",
    ]
    assert any("alpha x r is doubled in a_G of bar 4" in text for text in texts)


def test_two_numbers_beyond_a_tolerance_are_too_few_for_a_fit(judged):
    numbers = bars(scaled(inertia=0.98), "output")(OURS)
    *_, third, second, _ = sorted(abs(numbers["torque"] / right(OURS)["torque"] - 1.0))
    tolerance = Allowance(rtol=0.5 * (third + second))
    judgement = judged(OURS, numbers, ("torque",), tolerance=tolerance)
    assert len(judgement.differing) == 2 and not judgement.explanations


def test_a_law_and_a_changing_branch_are_judged_at_the_positions_of_the_scene(read):
    scene = Scene(
        UNIFORM_PARALLELOGRAM,
        Motion(Sweep(0.5, 4.0, 21), 2.0),
    )
    solution = solve(scene)
    assert {*solution.branch.tolist()} == {1, -1}
    judgement = Judgement(scene, read(solution.to_csv()))
    assert judgement.status == HOLDS and judgement.compared > 100


WITHOUT_SPEED = recommand(OURS, speed=None, acceleration=0.0)


@mark.slow
def test_a_log_is_judged_at_the_speed_of_each_row_where_the_scene_states_none(read):
    rates = {
        "omega_2": np.linspace(2.0, 9.0, 12),
        "alpha_2": np.linspace(-30.0, 40.0, 12),
    }
    speed, acceleration = rates.values()
    log = right(OURS, speed=speed, acceleration=acceleration) | rates

    def judge(scene, *names):
        return Judgement(scene, read(write(log, (*rates, *names)).replace("nan", "")))

    assert judge(OURS, *ALL).status == FAILED  # at the scene's one speed
    judgement = judge(WITHOUT_SPEED, *ALL)
    assert judgement.status == HOLDS
    assert {finding.quantity for finding in judgement.findings} == {*ALL}
    log["torque"][5] *= 1.0 + 1e-9
    assert [finding.line for finding in judge(WITHOUT_SPEED, *ALL).differing] == [7]
    assert judge(WITHOUT_SPEED).status == FAILED  # nothing compared
    log["omega_2"][3] = np.nan
    assert judge(WITHOUT_SPEED, "F12").not_assembled == [5]


@mark.parametrize(
    "decimals, factor, said",
    read_rows("""
6 | 1 |
6 | 0 | alpha_2 is left out
6 | 1.1 | alpha_2 1.1 times ours (fitted)
2 | 1 | what differs is within half a digit of theta_2, omega_2, alpha_2
2 | 1.1 | no single known mistake explains it
"""),
)
def test_the_speed_and_acceleration_of_a_row_are_rounded_too(
    decimals, factor, said, read
):
    omega = 8.0 + np.sin(np.arange(12.0))
    alpha = 20.0 * np.cos(np.arange(12.0))
    log = right(OURS, speed=omega, acceleration=float(factor) * alpha)
    rates = {"omega_2": omega, "alpha_2": alpha}
    log |= {name: rate.round(int(decimals)) for name, rate in rates.items()}
    judgement = Judgement(WITHOUT_SPEED, read(write(log, (*rates, "torque"))))
    texts = [one.text for one in judgement.explanations]
    found = [*texts, judgement.describe_unexplained()][0]
    assert (judgement.status == HOLDS) == (not said)
    assert found.startswith(said)


@fixture
def torques(read):
    """Reads theta_2 of a crank-rocker in whole degrees and its torque in a form."""
    degrees = np.arange(0.0, 360.0, 30.0)
    torque = solve(OURS, at=command_at(OURS, np.radians(degrees))).torque
    rows = np.transpose([degrees, torque]).tolist()

    def read_form(head, row="{theta:.0f},{torque:.9e}"):
        form = row if callable(row) else row.format
        lines = [head, *(form(theta=theta, torque=torque) for theta, torque in rows)]
        return read("\n".join(lines) + "\n")

    return read_form


def in_thousands(theta, torque):
    """Write micronewton metres with points between thousands, and a decimal comma."""
    number = f"{1e6 * torque:,.3f}".translate(str.maketrans(",.", ".,"))
    return f"{theta:.0f};{number}"


def with_comma(theta, torque):
    return f"{theta:.0f};{torque:.9f}".replace(".", ",")


@mark.parametrize(
    "form",
    [
        ("# made by hand\ntheta_2 [deg],torque",),
        ("# run 7\n# theta_2 [deg], torque [N m]",),
        ("Reference Coordinate System:,Global\n\nCrank angle (deg),Torque (N m)",),
        ("Run,7\nangle,torque\ndeg,N m",),
        ("Motion study 1\n,\ntheta_2 [deg],torque [N m]",),
        ('"Run 3, of May"\n"theta_2\n[deg]","torque\n[N m]"',),
        ("Study 1;\nKurbelwinkel [deg];Drehmoment [N m]", with_comma),
        ("theta_2 [deg];torque [uN m]", in_thousands),
        ("Kurbelwinkel [deg];Drehmoment [N m]", "{theta:.0f};{torque:.9f}"),
        ("Kurbelwinkel [deg];Drehmoment [N m]", with_comma),
        ("THETA_2 [deg],TORQUE",),
        ("theta2 (deg),T2 (N m)",),
        ("theta2 (deg),T12 (N-m),w2 (rad/s)", "{theta:.0f},{torque:.9e},10.000"),
        ("θ\N{SUBSCRIPT TWO} / deg,T\N{SUBSCRIPT TWO} / N m",),
        ("Theta_2 [DEG],Torque [N M]",),
        ("Crank angle (deg)\tMotor torque (N-m)", "{theta:.0f}\t{torque:.9e}"),
        ("theta2 [deg],T [N·m]",),
        ("theta_2,torque,alpha_2\ndeg,N m,rad/s2", "{theta:.0f},{torque:.9e},0"),
    ],
)
def test_an_ordinary_table_is_read(form, torques):
    judgement = Judgement(OURS, torques(*form))
    assert judgement.status == HOLDS and not judgement.table.left_out
    agreeing = sum(one.agrees for one in judgement.findings if one.quantity == "torque")
    assert agreeing == 12
    assert re.search(r"agree, compared to \d+ digits", judgement.sentence())


def test_degrees_under_a_bare_theta_2_are_recognised_and_said(torques):
    table = torques("theta_2,torque")
    assert Judgement(OURS, table).status == HOLDS
    (note,) = table.notes
    assert note.startswith("theta_2 has no unit and goes to 330: it is read as degrees")


@mark.parametrize("heading", ["omega", "R12x [N]", "F12 / F32", "T12 [K]", "W3 [N]"])
def test_a_column_of_an_unknown_name_is_left_out_by_name(heading, torques):
    table = torques(f"theta_2 [deg],torque,{heading}", "{theta:.0f},{torque:.9e},1")
    ((name, why),) = table.left_out.items()
    assert name == heading and why.startswith("not a known column: known are")
    assert "torque (drive_force of a cylinder)" in why
    with refused("needs a result; known are the columns of"):
        torques(f"theta_2 [deg],{heading}", "{theta:.0f},1")


COARSE = read_rows(r"""
60,0.4,6.36 | 1 | more digits: torque 1 of 1 numbers agree, compared to 3
60,0.45,6 | 0 | compared to 1 digit
60,0.4, | 1 | more digits: line 2, torque Nothing was compared; no digit
60,0.4,6.36\n100,-0.0, | 1 | more digits: torque, line 3
60,0.45,6.36\n100,0,1.6 | 1 | 3 of 4 numbers agree
60,0.4,6.36\n200,-0.61,13 | 0 | 4 of 4 numbers agree, compared to 1 digit
60,0.1,6.36 | 1 | 1 of 2 numbers agree
60,1e-99999999,6.36 | 1 | 1 of 2 numbers agree
1e308,1e308, | 1 | Nothing was compared
68,0.4,\n100,-0.0391, | 1 | 1 of 1 numbers agree, compared to 3 digits; no digit
137,-0.6,\n200,-0.61, | 0 | compared to 2 digits
137,-0.603,\n200,-0.61, | 0 | compared to 2 digits
103.76,,2\n79.18,0.281,3.00 | 0 | 3 of 3 numbers agree, compared to 2
107,,2\n79.18,0.281,3.00 | 1 | 2 of 3 numbers agree
60,0.4,6.36\n100,-0.04,1.603 --rtol 0.2 | 0 | 4 of 4
60,0.45,6.36\n100,-0.06,1.6 --rtol 0.02 | 1 | no single known mistake
60,0,6.36 --rtol 2 | 0 | 2 of 2 numbers agree within
60,0,6.36 --rtol 0.5 | 1 | no number has a digit to compare
""")
"""Rows of a crank-rocker with T = 0.4467 N m and F12 = 6.358 N at 60 deg, -0.6074 and
12.96 at 200, -0.039 and 1.604 at 100, T = -0.6026 at 137, F12 = 2.00 N at 103.76 and
2.4 N at 107, and what is said of them, after the status. A spreadsheet leaves off
zeros: they are digits where they are right, as of 2.00 and -0.60, and not of -0.61.
"""


@mark.parametrize("rows, code, words", COARSE)
def test_a_number_without_a_digit_agrees_with_nothing(rows, code, words, check):
    rows, *options = rows.replace(r"\n", "\n").split(" ")
    text = f"theta_2 [deg],torque [N m],F12 [N]\n{rows}\n"
    found, printed, _ = check(MODELS / "crank_rocker.toml", text, *options)
    assert found == int(code) and words in printed


def test_a_change_point_where_no_digits_help_is_no_failure(check):
    scene = Scene(UNIFORM_PARALLELOGRAM, Motion(Sweep(0.0, pi, 12), 10.0))
    numbers = solve(scene)
    columns = {"theta_2": numbers.theta_2, "torque": numbers.torque}
    code, out, _ = check(scene, tabulate(columns))
    assert code == HOLDS and "no digit left to judge 2 more by" in out


def test_what_brings_one_number_nearer_and_no_other_is_no_explanation(check):
    """Five numbers of one position, each wrong, by a script of a student.

    Impulses, a sign of I alpha and an offset of 4.1 deg come near to some by chance,
    and exclude each other.
    """
    input_mass, output_mass = (7850.0 * 0.05 * 0.025 * x for x in (1.0, 2.33))
    linkage = fourbar.FourBar(
        2.22,
        Bar(1.0, input_mass, 0.82),
        Bar(2.06, 219.95674411, 10.35, (1.6476, radians(-18.7352))),
        Bar(2.33, output_mass, 50.13),
    )
    load = Load(3, (100.0, pi / 2.0), from_pin=(3.06, radians(-31.0)))
    code, printed, _ = check(
        Scene(linkage, Motion(radians(60.0), 10.0, 5.0), loads=(load,)),
        "theta_2 [deg],torque [N m],F12 [N],F32 [N],F43 [N],F14 [N]\n"
        "60,14271.89,23647.43,24055.14,7798.85,7515.91\n",
    )
    assert code == FAILED and NO_CAUSE in printed
    assert "looks like" not in printed


@mark.parametrize("alike, explained", [(9, True), (8, False)])
def test_a_mistake_that_explains_less_than_nine_tenths_is_not_printed(
    alike, explained, judged
):
    """Ten columns differ, each by its sign or by chance."""
    names = [*PIN_FORCES, *ALL[:6]]
    numbers = right(OURS)
    for name in names:
        reverse = name in names[:alike]
        numbers[name] = -numbers[name] if reverse else noise(5, numbers[name])
    assert bool(judged(OURS, numbers, names).explanations) == explained


UNLOADED = """\
[lengths]
ground = "5 in"
input = "1.75 in"
coupler = "4.75 in"
output = "1.75 in"
ground_angle = "-90 deg"
[motion]
theta_2 = ["5 deg", "10 deg", "15 deg", "22 deg", "28 deg", "34 deg"]
omega_2 = "1 rad/s"
[drive]
from = { bar = 1, from_pin = ["13 in", "180 deg"] }
to = { bar = 4, from_pin = ["8 in", "0 deg"] }
[[effects.springs]]
from = { bar = 1, from_pin = ["13 in", "180 deg"] }
to = { bar = 4, from_pin = ["8 in", "0 deg"] }
stiffness = "600 lbf/in"
length = "18 in"
"""
"""The cylinder holds the spring: no pin has a load but rounding."""


@mark.slow
@mark.parametrize(
    "name, options, angle",
    read_rows("""
thesis |  | theta_2 [deg]
thesis | --csv-comma | theta_2 [deg]
gallery/pump_jack | --degrees | theta_2 [deg]
gallery/pump_jack | --radians | theta_2 [rad]
unloaded | --csv-comma | theta_2 [deg]
saved |  | theta_2 [rad]
saved | --degrees | theta_2 [deg]
"""),
)
def test_the_default_csv_returns_to_the_last_digit(
    name, options, angle, tmp_path, check
):
    """As many numbers agree, without a tolerance, as of the file in SI units."""
    scene, table = tmp_path / "scene.toml", tmp_path / "table.csv"
    if name == "unloaded":
        scene.write_text(UNLOADED)
    elif name == "saved":
        save(OURS, scene)
    else:
        scene = MODELS / f"{name}.toml"
    form = options.split() if "csv" in options else (*options.split(), "--csv")
    counts = []
    for units in ((), ("--units", "SI")):
        line = ["analyze", str(scene), *form, *units, "-o", str(table)]
        assert fourbar_status(line) == HOLDS
        heading = table.read_text().splitlines()[0].replace(";", ",").split(",")
        bare_angle = units and options != "--degrees"
        assert ("theta_2" if bare_angle else angle) in heading
        code, printed, _ = check(scene, table.read_text())
        assert code == HOLDS
        counts += re.findall(r"\d+ of \d+ numbers agree", printed)
    assert counts[0] == counts[1]


@mark.parametrize("digits, power", slow_but({(5, -4)}, [(8, -7), (5, -4)]))
@mark.slow
def test_a_right_table_of_fewer_digits_than_it_prints_is_told_the_tolerance(
    digits, power, check
):
    """Rounded to so many digits, printed with 15; the option that is named agrees.

    A number that is off by 1 % has no such line.
    """
    numbers = solve(THESIS)
    torque = np.array([float(f"{x:.{digits - 1}e}") for x in numbers.torque])

    def print_digits():
        columns = {"theta_2": numbers.theta_2, "torque": torque}
        return tabulate(columns, "{:.14e}".format)

    table = print_digits()
    code, printed, _ = check(THESIS, table)
    option = ("--rtol", f"1e{power}")
    assert code == FAILED
    within = f"all agree within 1e{power} of each number"
    assert f"{within}: {' '.join(option)} judges so" in printed
    assert check(THESIS, table, *option)[0] == HOLDS
    torque[7] *= 1.01
    code, printed, _ = check(THESIS, print_digits())
    assert code == FAILED and "all agree within" not in printed
