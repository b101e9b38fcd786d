"""Somebody's own MJCF.

What differs is named, what it costs is measured, and the file is data.
"""

import itertools
import math
import os
import re
import signal
import threading
import time
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from click.testing import CliRunner
from pytest import approx, raises

import fourbar
from fourbar.effects import Friction, Gravity, Place, Spring, Springs, Torsion
from fourbar.errors import InputError
from fourbar.mjcf import Plane, write_mjcf
from fourbar.quantities import PIN_FORCES, UNKNOWNS
from fourbar.scene import command
from fourbar.solving import solve
from fourbar_validation.compare.compare import Comparison, Demands
from fourbar_validation.compare.results_file import read_columns
from fourbar_validation.compare.rows import FAILS, Row
from fourbar_validation.compare.tolerance import SIMULATED
from fourbar_validation.engines.description import ModelEntry
from fourbar_validation.engines.mujoco.describe import describe_model
from fourbar_validation.engines.mujoco.robots import measure as measuring
from fourbar_validation.engines.mujoco.robots.measure import put_loop_inside
from fourbar_validation.engines.mujoco.robots.onto_scene import find_loop_of_scene
from fourbar_validation.engines.mujoco.robots.seen import SeenLoop
from fourbar_validation.engines.programs import WORKER_MEMORY
from fourbar_validation.places import MODELS
from fourbar_validation.robots import guard
from fourbar_validation.robots.check_mjcf import check_mjcf_command
from fourbar_validation.robots.differences import (
    Difference,
    _remark,
    change_scene,
    find_differences,
    order,
    price,
)
from fourbar_validation.robots.judge_loop import (
    FILE_AT_ONE_STATE,
    FILE_THROUGH_TIME,
    LoopJudgement,
    answer_changed,
    judge_file,
)
from fourbar_validation.robots.loop_errors import MEASURE
from fourbar_validation.robots.report import _describe_differences
from tests.support.robots import (
    AS_DRAWN,
    answer_of,
    answers_of,
    examine_text,
    file_of,
    mend,
    notes_of,
)
from tests.support.rows import read_rows
from tests.support.scenes import low_parallelogram, recommand
from tests.support.texts import put

pytestmark = pytest.mark.usefixtures("in_this_process")
SCENE = fourbar.load(MODELS / "crank_rocker.toml")
CRANK_ROCKER = recommand(SCENE, angle=fourbar.Sweep(0.0, math.tau, 6))
GENERATED = write_mjcf(CRANK_ROCKER)
NO_FILE = file_of("")
MINE = {"input": "crank", "coupler": "rod", "output": "rocker"}
FEW = fourbar.Scene(
    CRANK_ROCKER.linkage,
    fourbar.Motion(np.linspace(0.3, 2.3, 7), 10.0),
    effects=CRANK_ROCKER.effects,
    title="no loads",
)
STILL = replace(
    FEW, motion=fourbar.Motion(FEW.motion.angle, np.linspace(10.0, 11.0, 7))
)
"""The same at a speed of each position: no motion through time."""
DRY = replace(
    recommand(SCENE, angle=fourbar.Sweep(0.6, 0.75, 6)),
    effects=(*CRANK_ROCKER.effects, Friction.at(A=0.05, O4=0.05)),
)
SPRING = Spring(Place(1, (0.1, -1.5)), Place(4, (0.08, 0.2)), 200.0, 0.05)
SPRUNG = replace(
    CRANK_ROCKER,
    motion=FEW.motion,
    effects=(Gravity(), Torsion.at(O4=(0.3, 0.4, 0.0)), Springs((SPRING,))),
)
STILL_SPRUNG = replace(SPRUNG, motion=STILL.motion)
BOTH = (FILE_AT_ONE_STATE, FILE_THROUGH_TIME)
STIFF = 'solref="0.02 1" solimp="0.9999 0.9999 0.001 0.5 2"'
FLOOR = 1e-4
"""What the generated file is off without its flywheel: 3e-5 as measured."""
STIFF_ENOUGH = 1e-4
"""One state at d = 0.9999 without pads: 1.5e-5 of the torque, 5e-5 of the forces, as
measured.
"""


@cache
def generated(scene):
    return examine_text(scene)


def values(examined):
    return {key: entry.value for key, entry in examined.loops[0].described.items()}


def differences(scene, theirs):
    """Return the differences of an examined file from the generated one, by key."""
    return {
        d.key: d
        for d in find_differences(
            generated(scene).loops[0].described, theirs.loops[0].described
        )
    }


def rows_of(scene, answers):
    demands = Demands(SIMULATED, UNKNOWNS)
    return [
        row
        for answer in answers
        for row in Comparison(
            "", scene, answer, solve(scene, at=answer.at), demands
        ).rows()
    ]


def errors(scene, examined, how=FILE_AT_ONE_STATE):
    return {
        row.quantity: row.error
        for row in rows_of(scene, [answer_of(examined, how)])
        if row.quantity != "assembled"
    }


def worst_error(scene, examined, how=FILE_AT_ONE_STATE):
    return max(errors(scene, examined, how).values())


FIRST, SECOND = re.findall("    <general [^>]*load_[^>]*/>\n", GENERATED)
SERVO = '<velocity name="servo" joint="O2" kv="10"/></actuator>'
EQUALITY = '<joint joint1="O2" joint2="O4"/></equality>'
RIGHT = {
    "generated": (GENERATED, set()),
    "tilted": (
        write_mjcf(CRANK_ROCKER, plane=Plane((-2.0, 5.0, 1.0), (1.0, -2.0, 0.5))),
        {"plane"},
    ),
    "loads under other names and in another order": (
        put(GENERATED, FIRST + SECOND, SECOND + FIRST, "load_1", "couple"),
        set(),
    ),
    "a servo and another equality": (
        put(GENERATED, "</actuator>", SERVO, "</equality>", EQUALITY),
        {"other equalities"},
    ),
}
"""Files that agree with the scene, and what differs in them."""


@pytest.mark.parametrize("name", RIGHT)
def test_a_file_that_is_right_agrees_and_what_differs_is_named(name):
    text, keys = RIGHT[name]
    examination = examine_text(CRANK_ROCKER, text)
    assert differences(CRANK_ROCKER, examination).keys() == keys
    for how in BOTH:
        assert worst_error(CRANK_ROCKER, examination, how) <= SIMULATED.factor
    taken_off = "servo" in text
    assert any("servo" in note for note in notes_of(examination)) == taken_off
    assert examination.loops[0].switched_off == ("O2-O4",) * taken_off


def test_what_is_welded_to_a_bar_is_part_of_it():
    """Two masses m at distance s of each other.

    G in the middle, inertia 2 I + m s^2/2.
    """
    half = (
        '<body pos="{} 0 0"><inertial pos="0 0 0" mass="0.2" diaginertia="1e-3 1e-3'
        ' 1e-3"/></body>'
    )
    text = re.sub(
        '(name="rocker"[^>]*><joint/>)<inertial[^>]*>',
        r"\1" + half.format(0.05) + half.format(0.15),
        other_plane(),
    )
    listed = described(text, FEW)
    parts = ("mass", "centre.distance", "centre.angle", "inertia")
    numbers = [listed[f"bars.output.{part}"].value for part in parts]
    right = [0.4, 0.1, 0.0, 2e-3 + 0.2 * 0.1**2 / 2.0]
    assert numbers == approx(right, rel=1e-12, abs=1e-14)


EDITS = read_rows("""
coupler's mass | mass="0.5" | mass="5" | bars.coupler.mass | 10^1 times: units?
inertia about the pin | 0.0016133333333333336 | 0.0073733333333333336 | \
bars.output.inertia |
mass centre | pos="0.05 0 0" mass="0.2" | pos="0.06 0 0" mass="0.2" | \
bars.input.centre.distance |
length | "B4" pos="0.22 0 0" | "B4" pos="0.23 0 0" | lengths.output | another linkage
gravity left out | -9.81 | 0.0 | gravity.y | weight
damping | name="A" type="hinge" | name="A" type="hinge" damping="0.1" | pins.A.damping \
| couple
timestep | timestep="0.00100 | timestep="0.00200 | option.timestep | integration
integrator | "RK4" | "Euler" | option.integrator | RK4 four
solimp | 0.9999 0.9999 | 0.95 0.95 | closure.solimp | (1-d)/d
solref | solref="0.02 | solref="0.03 | closure.solref | sags under load
tolerance | tolerance="0" | tolerance="1e-8" | option.tolerance | only 0 is tight
range | name="O4" type="hinge" | name="O4" type="hinge" range="0 3" | pins.O4.range | \
stop
load missing | <general gaintype="fixed" gainprm="0" biastype="affine" name="load_2" | \
 | loads.coupler, axes of the coupler.force | summed here bar by bar
load turned | 3.061616997868383e-17 -0.5 | -0.5 0.0 | loads.coupler, axes of the \
coupler.force | N; the
load elsewhere | name="load_2" pos="0.15 | name="load_2" pos="0.16 | loads.coupler, \
axes of the coupler.point | along the bar
line search | iterations="10" | iterations="10" ls_iterations="1" | \
option.ls_iterations | line search
wind | iterations="10" | iterations="10" density="1.2" wind="1 0 0" | option.wind | drag
motor at a pin | </actuator> | <velocity joint="A" kv="1"/></actuator> | pins.A.motor \
| couple at the pin
a hinge that is not parallel | name="A" type="hinge" axis="0 0 1" | name="A" \
type="hinge" axis="0 1e-6 1" | skew | across the plane
bars that collide | contype="0" conaffinity="0" | contype="1" conaffinity="1" | \
contacts | push each other
""")


def described(text, scene=CRANK_ROCKER):
    """Describe a file without measuring it."""
    found = find_loop_of_scene(file_of(text), scene, AS_DRAWN)
    inside, _ = put_loop_inside(found)
    seen = SeenLoop(found.robot.model, found.loop, 2)
    return describe_model(seen, inside.flywheel)


def planted(what):
    """Return the generated file with one of the edits; flags let it act."""
    (old, new) = next(edit[1:3] for edit in EDITS if edit[0] == what)
    text = put(GENERATED, old, new) if new else re.sub(old + "[^>]*>", "", GENERATED)
    flags = {"range": "limit", "contype": "contact"}
    off = ["damper", *(flag for word, flag in flags.items() if word in new)]
    return re.sub(f'({"|".join(off)})="disable"', "", text)


@pytest.mark.parametrize("what, key, word", [(e[0], *e[3:]) for e in EDITS])
def test_a_planted_difference_is_named(what, key, word):
    of_scene = described(GENERATED)
    listed = find_differences(of_scene, described(planted(what)))
    assert word in {d.key: d.remark for d in listed}[key]


SPRING = "tendons.ground output.stiffness"
ARMATURE = "tendons.ground output.armature"


@pytest.mark.parametrize(
    "key, ours, theirs, remark",
    [
        ("pins.A.damping", 0.0, 0.1, "a couple at the pin, a force along the tendon"),
        ("pins.A.stiffness", 0.2, 0.1, "a spring at the pin or along the tendon"),
        (ARMATURE, None, 0.1, "inertia at the pin or along the tendon"),
        (SPRING, 150.0, 155.0, "a spring at the pin or along the tendon"),
        ("closure.by", "connect of sites", "tendon", "a tendon leaves out"),
        ("closure.weight", 4.0, 8.0, "1/kg, by the masses"),
    ],
)
def test_a_remark_says_what_a_difference_does(key, ours, theirs, remark):
    assert _remark(key, ours, theirs).startswith(remark)


def test_a_tendon_is_named_only_where_one_closes_the_loop():
    assert not _remark("closure.by", "connect of sites", "weld of sites")


def slip_at_A(s):
    return (s.omega_3 - s.omega_2) ** 2 / s.omega_2


def work_of_load(s):
    """Return what the load on the coupler does per turn of the crank, N m."""
    crank, rod = np.exp(1j * s.theta_2), np.exp(1j * s.theta_3)
    place = complex(0.15992199739630214, 0.048391265005082486) * rod
    velocity = 1j * (0.1 * s.omega_2 * crank + s.omega_3 * place)
    return (-0.5j * rod * velocity.conj()).real / s.omega_2


@pytest.mark.parametrize(
    "what, more",
    [
        ("motor at a pin", slip_at_A),
        ("damping", lambda s: 0.1 * slip_at_A(s)),
        ("load missing", work_of_load),
    ],
)
def test_what_a_planted_difference_does_to_the_torque_is_its_virtual_work(what, more):
    scene = replace(CRANK_ROCKER, motion=STILL.motion)
    answer = answer_of(examine_text(scene, planted(what)), FILE_AT_ONE_STATE)
    ours = solve(scene, "force", at=answer.at)
    off = answer.quantities["torque"] - ours.torque
    assert np.abs(off).max() > 0.01
    np.testing.assert_allclose(off, more(ours), atol=1e-6)


BRAKED = replace(FEW, loads=(fourbar.Load(4, moment=-0.4),))
BRAKE = '<general gainprm="0" biastype="affine" name="brake" {} biasprm="{}"/>'
ARM = '<body><joint/><inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/></body>'


@pytest.mark.parametrize("bodies", ["", ARM])
@pytest.mark.parametrize(
    "form", ['joint="O4" gear="0.5"', 'site="B4" gear="0 0 0 0 0 0.5"']
)
def test_a_couple_on_a_hinge_of_the_ground_is_a_load_of_its_bar(form, bodies):
    """The torque of a wrong one is off by its virtual work, moment times omega_4."""
    text = put(write_mjcf(BRAKED), "</worldbody>", f"{bodies}</worldbody>")
    right, wrong = (
        examine_text(BRAKED, re.sub("<general [^>]*load_1[^>]*/>", brake, text))
        for brake in (BRAKE.format(form, -0.8), BRAKE.format(form, 0.8))
    )
    assert not differences(BRAKED, right)
    (one,) = differences(BRAKED, wrong).values()
    assert one.write().startswith(
        'loads.output.couple: 0.4, generated -0.4; in the file: actuator "brake"; '
    )
    at = wrong.loops[0].command(wrong.loops[0].states)
    ours = solve(BRAKED, at=at)
    extra = 0.8 * np.abs(ours.omega_4 / ours.omega_2).max()
    changed = answer_changed(BRAKED, one, at)
    priced = price(one, rows_of(BRAKED, [changed]), ())
    assert priced.cost == approx(extra / np.abs(ours.torque).max(), rel=1e-9)
    theirs = answer_of(wrong, FILE_AT_ONE_STATE).quantities["torque"]
    assert changed.quantities["torque"] == approx(theirs, rel=1e-9)


@pytest.mark.parametrize("axis, couple", [("0 -1 0", 0.4), ("0 1 0", -0.4)])
def test_a_couple_on_a_hinge_turns_as_its_axis(axis, couple):
    hinge = 'pos="1.3 2 3"><joint'
    brake = BRAKE.format('joint="O4"', 0.4)
    added = f"</equality><actuator>{brake}</actuator>"
    text = put(other_plane(axis=axis), hinge, f'{hinge} name="O4"')
    listed = described(put(text, "</equality>", added), FEW)
    assert listed["loads.output.couple"].value == couple


def test_how_softly_dry_friction_slips_is_named_and_costs():
    """By default its couple rises over 0.02 s of slip."""
    text = re.sub(' sol(ref|imp)friction="[^"]*"', "", write_mjcf(DRY))
    text = text.replace('joint name="A"', 'joint name="rod"')
    examination = examine_text(DRY, text)
    by_key = differences(DRY, examination)
    fields = {
        f"pins.{pin}.{field}"
        for pin in ("A", "O4")
        for field in ("solreffriction", "solimpfriction")
    }
    assert by_key.keys() == fields
    assert by_key["pins.A.solreffriction"].written == 'joint "rod" solreffriction'
    assert by_key["pins.A.solreffriction"].theirs == (0.02, 1.0)
    assert errors(DRY, examination)["F12"] > 100.0 * SIMULATED.factor


CAUSES = read_rows("""
# solver parameters of friction that is not there
plain | type="hinge" | type="hinge" solreffriction="0.1 1" |
# a lighter bar makes the closure softer, and a heavier one stiffer: no difference
plain | "0.5" | "0.25" | bars.coupler.mass, closure.weight
plain | 0.9999 0.9999 | 0.95 0.95 | closure.solimp
plain | "0.5" | "1" | bars.coupler.mass
# a tendon that exerts nothing
sprung | </tendon> | <fixed><joint joint="A" coef="1"/></fixed></tendon> | \
tendons.A, tendons.A.path
# a servo pulls where it is told nothing, and a motor does not
sprung | </actuator> | <position tendon="spring_1" kp="100"/></actuator> | \
tendons.ground output.tension
sprung | </actuator> | <motor tendon="spring_1"/><motor joint="A"/></actuator> |
""")


@pytest.mark.parametrize("name, old, new, keys", CAUSES)
def test_a_cause_is_named_and_nothing_else(name, old, new, keys):
    scene = SPRUNG if name == "sprung" else CRANK_ROCKER
    text = write_mjcf(scene)
    theirs = described(put(text, old, new), scene)
    listed = find_differences(described(text, scene), theirs)
    assert ", ".join(sorted(one.key for one in listed)) == keys


def other_plane(closure='site1="r" site2="q"', axis="0 -1 0"):
    """The crank-rocker by another hand.

    x-z plane, away from the origin, other names, default closure.
    """
    linkage = FEW.linkage

    def inertial(number):
        bar = linkage.bar(number)
        r, phi = bar.mass_centre or (0.0, 0.0)
        x, z = r * math.cos(phi), r * math.sin(phi)
        moments = " ".join([repr(bar.moment_of_inertia)] * 3)
        return (
            f'<inertial pos="{x!r} 0 {z!r}" mass="{bar.mass!r}"'
            f' diaginertia="{moments}"/>'
        )

    end_of_rod = '<site name="r" pos="0.25 0 0"/>'
    end_of_rocker = '<site name="q" pos="0.22 0 0"/>'
    return f"""<mujoco><option gravity="0 0 -9.81"/>
    <default><joint axis="{axis}"/></default><worldbody>
    <body name="crank" pos="1 2 3"><joint/>{inertial(2)}
      <body name="rod" pos="0.1 0 0"><joint/>{inertial(3)}{end_of_rod}</body></body>
    <body name="rocker" pos="1.3 2 3"><joint/>{inertial(4)}{end_of_rocker}</body>
    </worldbody>
    <equality>{f"<connect {closure}/>" if closure else ""}</equality></mujoco>"""


def test_bodies_are_guessed_from_what_hangs_together_and_from_the_lengths():
    """The rocker is as good a crank by its hinges alone."""
    text = other_plane()
    rocker = re.search(' *<body name="rocker".*?</body>', text)
    # it comes first in the file
    text = text.replace(rocker[0], "").replace("<worldbody>", "<worldbody>" + rocker[0])
    examination = examine_text(FEW, text)
    bars = "Bars: ground world, input crank, coupler rod, output rocker."
    assert bars in examination.loops[0].parts
    assert errors(FEW, examination)["theta_4"] < STIFF_ENOUGH


COSTLY = read_rows("""
bars.coupler.mass | mass="0.5" | mass="0.6"
bars.output.inertia | 0.0016133333333333336 0.0016133333333333336 \
0.0016133333333333336 | 0.003 0.003 0.003
bars.output.centre.angle | 0.11883216824898844 0 -0.0167 | 0.11883216824898844 0 0.0167
bars.input.centre.distance | pos="0.05 0 0.0" mass="0.2" | pos="0.06 0 0.0" mass="0.2"
lengths.coupler | name="r" pos="0.25 | name="r" pos="0.26
lengths.input | name="rod" pos="0.1 | name="rod" pos="0.11
lengths.output | name="q" pos="0.22 | name="q" pos="0.23
lengths.ground | name="rocker" pos="1.3 | name="rocker" pos="1.31
gravity.y | 0 0 -9.81 | 0 0 -8.81
pins.A.damping | name="rod" pos="0.1 0 0"><joint | name="rod" pos="0.1 0 0"><joint \
damping="0.1"
pins.O4.stiffness | pos="1.3 2 3"><joint | pos="1.3 2 3"><joint stiffness="0.5"
""")


ATTACHED = read_rows("""
tendons.ground output.stiffness | stiffness="200" | stiffness="300"
tendons.ground output.springlength | springlength="0.05" | springlength="0.06"
pins.O4.spring angle | springref=" | springref="1
""")
"""What is attached to the generated file itself."""
SPOILT = {
    "another hand": (STILL, other_plane(f'site1="r" site2="q" {STIFF}'), MINE, COSTLY),
    "attached": (STILL_SPRUNG, write_mjcf(SPRUNG), {}, ATTACHED),
}
"""Scene, right file, names, and entries to spoil."""


@pytest.mark.slow
@pytest.mark.parametrize(
    "group, entry", [(group, entry) for group in SPOILT for entry in SPOILT[group][3]]
)
def test_the_one_thing_that_is_wrong_costs_its_error(group, entry):
    """Made wrong in one entry, a file has as its price its error.

    A bar or gravity has it by the formulas of a scene that is as wrong.
    """
    scene, right, names, _ = SPOILT[group]
    key, *edit = entry
    text = put(right, *edit)
    spoilt = examine_text(scene, text, **names)
    one = differences(scene, spoilt)[key]
    rows = rows_of(scene, answers_of(spoilt))
    at = spoilt.loops[0].command(spoilt.loops[0].states)
    answer = answer_changed(scene, one, at)
    if answer is not None:
        priced = price(one, rows_of(scene, [answer]), ())
    else:
        (mended,) = mend(scene, text, names, [(key, one.generated)])
        priced = price(one, rows, rows_of(scene, mended))
    worst = max(errors(scene, spoilt)[name] for name in ("torque", *PIN_FORCES))
    assert (answer is None) == key.startswith(("pins.", "tendons."))
    assert priced.cost == approx(worst, rel=1e-2, abs=FLOOR)


def test_a_setting_costs_what_the_worst_error_of_a_method_grows_by():
    before, after = (
        [
            Row.judged(("scene", method, "-"), quantity, float(error), 1.0, "")
            for method, quantity, error in read_rows(rows)
        ]
        for rows in (
            "one | F12 | 0.1\none | F32 | 0.3\ntwo | F12 | 0.9",
            "one | F12 | 0.5\none | F32 | 0.1\ntwo | F12 | 0.9",
        )
    )
    one = Difference("closure.solref", (0.02, 1.0), (0.1, 1.0), "")
    priced = price(one, after, before)
    assert (priced.cost, priced.quantity) == (approx(0.2), "F12")


def test_an_entry_that_cannot_stand_alone_has_no_price():
    """Who turns the other way round, or closes the loop otherwise, is another file."""
    scene = replace(CRANK_ROCKER, motion=STILL.motion)
    changes = [
        ("pins.A.positive", "clockwise"),
        ("closure.by", "tendon"),
        ("loads.coupler, axes of the coupler.force", (0.0, 0.0)),
    ]
    assert mend(scene, GENERATED, {}, changes) == [None] * 3
    ones = (Difference(key, "", theirs, "") for key, theirs in changes)
    assert not any(change_scene(scene, one) for one in ones)


def test_a_length_costs_little_beyond_a_change_point_too():
    """It does not turn a parallelogram over, nor wind its spring."""
    scene = replace(low_parallelogram(), effects=(Torsion.at(O4=(1.0, 0.0, 0.0)),))
    length = scene.linkage.output.length
    one = Difference("lengths.output", length, length * (1.0 + 1e-9), "")
    answer = answer_changed(scene, one, command(scene))
    assert price(one, rows_of(scene, [answer]), ()).cost < 1e-7


def mend_settings(first=0):
    """Mend two settings of another hand's file, or the second alone."""
    settings = [("closure.solimp", None), ("option.tolerance", 1e-8)]
    return mend(STILL, other_plane(), MINE, settings[first:])


def test_each_entry_is_mended_in_a_model_of_its_own():
    stiff, soft = mend_settings()
    (alone,) = mend_settings(1)
    assert stiff and soft and alone
    torques = [one[0].quantities["torque"] for one in (stiff, soft, alone)]
    assert np.array_equal(*torques[1:])
    assert not np.array_equal(*torques[:2])


def test_a_busy_machine_leaves_no_entry_unpriced(monkeypatch):
    """A minute of others' work between two readings of the clock does not count."""
    minutes = itertools.count(step=60.0)
    monkeypatch.setattr(time, "perf_counter", lambda: next(minutes))
    assert all(mend_settings())
    monkeypatch.setattr(time, "process_time", lambda: next(minutes))
    assert mend_settings() == [None, None]


@pytest.mark.parametrize("axis", ["0 -1 0", "0 1 0"])
def test_another_plane_and_a_reversed_axis_change_no_number(axis):
    examination = examine_text(
        FEW, other_plane(f'site1="r" site2="q" {STIFF}', axis), **MINE
    )
    assert worst_error(FEW, examination) < STIFF_ENOUGH
    keys = differences(FEW, examination).keys()
    assert "plane" in keys
    assert ("pins.A.positive" in keys) == (axis == "0 1 0")


def test_body_anchors_on_an_open_rest_state_build_another_linkage():
    examination = examine_text(
        FEW, other_plane('body1="rod" body2="rocker" anchor="0.25 0 0"'), **MINE
    )
    assert (
        "in the pose of the file"
        in differences(FEW, examination)["lengths.output"].remark
    )
    assert values(examination)["lengths.output"] == approx(0.05)


def test_lengths_of_another_linkage_come_before_what_costs_more():
    """A length that is off by its rounding is no cause of what a soft closure costs."""
    entries = [
        Difference("contacts", "off", "possible", "", cost=70.0),
        Difference("closure.solimp", (0.9999,), (0.9,), "", cost=14.0),
        Difference("pins.A.positive", "on", "off", ""),
        Difference("lengths.input", 0.1, 0.10000001, "", cost=1e-6),
        Difference("lengths.coupler", 3.5, 2.66, "", cost=0.6),
    ]
    assert [one.key for one in order(entries)] == [
        "lengths.coupler",
        "contacts",
        "closure.solimp",
        "lengths.input",
        "pins.A.positive",
    ]


@pytest.mark.slow
def test_a_cylinder_of_ones_own_is_what_the_force_is_solved_for():
    drive = fourbar.LinearDrive(Place(2, (0.17, -1.1)), Place(4, (0.09, 0.7)))
    scene = replace(CRANK_ROCKER, drive_bar=None, drive=drive)
    text, driven = write_mjcf(scene), '<general name="cylinder" tendon="cylinder" />'
    servo = (
        '<position name="ram" tendon="cylinder" kp="400" kv="3" gear="2" ctrlrange="-1'
        ' 1" forcerange="-1 1"/>'
    )
    for mine in (text, put(text, driven, servo)):
        examined = examine_text(scene, mine)
        assert any("gives the cylinder's force" in note for note in notes_of(examined))
        for how, most in zip(BOTH, (1e-9, 1e-6), strict=True):
            of_file = errors(scene, examined, how)
            assert "torque" not in of_file
            for name in ("drive_force", "F12", "F43", "F14"):
                assert of_file[name] < most
    start = 'name="cylinder_end" pos="'
    moved = examine_text(scene, put(text, start + "0.0", start + "0.1"))
    assert errors(scene, moved)["drive_force"] > 1e-2
    assert any(key.startswith("tendons.") for key in differences(scene, moved))
    without = examine_text(scene, put(text, driven, ""))
    assert errors(scene, without)["drive_force"] < 1e-9


def test_a_loop_that_nothing_closes_is_seen_in_the_numbers():
    text = (
        other_plane("")
        .replace('site name="r"', 'site name="B3"')
        .replace('site name="q"', 'site name="B4"')
    )
    examination = examine_text(FEW, text, **MINE)
    assert values(examination)["closure.by"] == "nothing"
    assert np.isnan(errors(FEW, examination)["F43"])
    assert errors(FEW, examination)["torque"] > 0.01
    assert examination.loops[0].refusal == "nothing closes the loop"


@pytest.mark.parametrize("timestep", ["1e-12", "1e9"])
def test_an_absurd_timestep_is_reported_and_not_run_through(timestep):
    """One so long that no step is made once agreed in every position.

    The state at the start, again and again.
    """
    text = re.sub('timestep="[^"]*"', f'timestep="{timestep}"', GENERATED)
    assert text != GENERATED
    _, through = answers_of(examine_text(CRANK_ROCKER, text))
    assert (
        through.refusal is not None
        and "steps of the motion; must be 1 to 130000" in through.refusal
    )


OVERDONE = read_rows("""
every mass | mass="[^"]*" | mass="1e308" | body_mass of 1e+308 is out of range
lengths | \\bpos="[^"]*" | pos="1e308 1e308 0" | body_pos of 1e+308 is out of range
user data | <worldbody> | <size nuser_body="2000000000"/><worldbody> | is a size in it \
too large?
keyframes | <worldbody> | <size nkey="2000000000"/><worldbody> | asks for 2000000000 \
keyframes
timestep -1 | timestep="[^"]*" | timestep="-1" | its timestep of -1 s must be above 0
timestep 0 | timestep="[^"]*" | timestep="0" | its timestep of 0 s must be above 0
timestep nan | timestep="[^"]*" | timestep="nan" | its timestep of nan s must be above 0
no MJCF | mass= | weight= | MuJoCo does not compile it
""")


@pytest.mark.slow
def test_a_file_that_overdoes_it_is_one_line_with_its_name():
    with guard.examine_guarded(NO_FILE) as examined:
        for what, old, new, words in OVERDONE:
            text = re.sub(old, new, GENERATED)
            assert text != GENERATED
            with raises(InputError) as caught:
                examined(MEASURE, file_of(text), AS_DRAWN, CRANK_ROCKER)
            message = str(caught.value)
            assert message.startswith("robot.xml: MJCF = 'robot.xml': "), what
            assert words in message and "\n" not in message, what


def test_a_ratio_beyond_the_range_of_doubles_has_its_remark():
    light, heavy = (
        {"lengths.input": ModelEntry(1.0), "bars.output.mass": ModelEntry(mass)}
        for mass in (0.4, 4e307)
    )
    (difference,) = find_differences(light, heavy)
    assert difference.remark.startswith("10^308 times")


def rows_with(torque, force):
    errors = {"torque": torque, "F12": force}
    return [
        Row("", "how", "-", name, error, 1e-5, FAILS, "", 0.0, 1.0)
        for name, error in errors.items()
    ]


@pytest.mark.parametrize(
    "key, cost", [("closure.solref", 0.0), ("bars.coupler.mass", 0.048)]
)
def test_a_setting_that_leaves_the_worst_error_costs_nothing(key, cost):
    """The output's mass is wrong, and both time constants leave F12 0.3 off."""
    difference = Difference(key, 0.02, 0.03, "")
    priced = price(difference, rows_with(0.05, 0.3), rows_with(0.002, 0.3))
    assert priced.cost == approx(cost)


@pytest.mark.parametrize(
    "key, finer",
    [("option.timestep", 0.5), ("option.tolerance", 0.5), ("option.iterations", 2.0)],
)
def test_a_setting_that_is_finer_is_no_difference(key, finer):
    ours = {"lengths.input": ModelEntry(1.0), key: ModelEntry(1.0)}
    for value, count in ((finer, 0), (1.0 / finer, 1)):
        theirs = ours | {key: ModelEntry(value)}
        assert len(find_differences(ours, theirs)) == count


def test_what_to_type_is_advised_where_a_setting_differs():
    rows = rows_with(0.05, 0.3)
    for key, written, advised in read_rows("""
option.timestep | option timestep | 1
# an SDF has no place for it
option.timestep | | 0
lift.output | body gravcomp | 0
"""):
        listed = [Difference(key, 0.0, 1.0, "", written)]
        sentences = LoopJudgement(None, listed, rows, {}, []).sentences()  # type: ignore[arg-type]
        assert sum("advise SCENE FILE" in text for text in sentences) == int(advised)


def test_an_error_stands_before_that_of_the_generated_file():
    torque, force = rows_with(0.05, 0.3)
    ours = {("how", "torque"): 0.2}
    judgement = LoopJudgement(None, [], [torque, force], ours, [])  # type: ignore[arg-type]
    *_, table = _describe_differences(judgement)
    assert table.rows == [
        ("torque", "5.00e-02", "2.00e-01", "1.00e-05", FAILS),
        ("F12", "3.00e-01", "-", "1.00e-05", FAILS),
    ]


@pytest.mark.parametrize("turns", [-2, 1, 3])
def test_a_loop_counts_the_whole_turns_of_its_scene(turns):
    """A spring of the file is wound as the angle of the scene says."""
    loops = [
        find_loop_of_scene(file_of(GENERATED), scene, AS_DRAWN).loop
        for scene in (FEW, recommand(FEW, angle=FEW.motion.angle + math.tau * turns))
    ]
    one, other = (loop.angles[1] for loop in loops)
    assert other == approx(one + math.tau * turns)
    assert abs(one - np.mean(FEW.motion.angle)) <= math.pi


def test_a_range_is_asked_of_both_files(monkeypatch):
    monkeypatch.setattr(measuring, "POSITIONS_OF_A_LOOP", 5)
    options = replace(AS_DRAWN, span=(0.5, 0.9))
    judgement = judge_file("range", CRANK_ROCKER, file_of(GENERATED), options)
    joints = [row.joint for row in judgement.measured.states.rows]
    assert (min(joints), max(joints)) == approx((0.5, 0.9))
    at_states = [row for row in judgement.rows if row.engine == FILE_AT_ONE_STATE]
    for row in at_states:
        generated = judgement.generated[row.engine, row.quantity]
        assert generated == approx(row.error, rel=1e-6, abs=1e-12)


REFUSED = {
    "no such body": (
        other_plane(),
        {"input": "wheel"},
        "the file has: crank, rod, rocker",
    ),
    "a slide": (
        other_plane().replace("<joint/>", '<joint type="slide"/>', 1),
        MINE,
        "joint 0 is a slide",
    ),
    "nothing closes": (
        re.sub("<site [^>]*>", "", other_plane("")),
        MINE,
        "has no equality that closes a loop; where something else does, say where",
    ),
    "two names, one body": (
        other_plane(),
        {**MINE, "coupler": "crank"},
        "no four-bar has these bars: input crank, coupler rod, output rocker",
    ),
}


@pytest.mark.parametrize("text, names, word", REFUSED.values(), ids=REFUSED)
def test_a_file_that_is_no_four_bar_is_one_line(text, names, word):
    with raises(InputError) as caught:
        examine_text(FEW, text, **names)
    assert word in str(caught.value)
    assert "\n" not in str(caught.value)


def crash(scene, text, names):
    os.kill(os.getpid(), signal.SIGSEGV)


def hang(scene, text, names):
    time.sleep(3600.0)


def devour(scene, text, names):
    bytearray(2 * WORKER_MEMORY)


@pytest.mark.slow
@pytest.mark.posix
def test_ctrl_c_does_not_wait_for_the_file():
    # a test run in the background inherits SIGINT ignored
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    began = time.monotonic()
    threading.Timer(3.0, os.kill, (os.getpid(), signal.SIGINT)).start()
    try:
        with (
            raises(KeyboardInterrupt),
            guard.examine_guarded(NO_FILE) as examined,
        ):
            examined(f"{__name__}:hang", FEW, "<mujoco/>", {})
    finally:
        signal.signal(signal.SIGINT, before)
    assert time.monotonic() - began < guard.ROBOT_SECONDS / 4


@pytest.mark.slow
@pytest.mark.parametrize(
    "what, word",
    [
        (crash, "crashed"),
        (hang, "did not come back"),
        pytest.param(devour, "memory", marks=pytest.mark.linux),
    ],
)
def test_a_file_that_breaks_the_engine_is_one_line(what, word, monkeypatch):
    monkeypatch.setattr(
        guard, "ROBOT_SECONDS", 4.0 if what is hang else 60.0
    )  # a busy machine starts a process slowly
    with (
        raises(InputError, match=word),
        guard.examine_guarded(NO_FILE) as examined,
    ):
        examined(f"{__name__}:{what.__name__}", FEW, "<mujoco/>", {})  # type: ignore[attr-defined]


def call(folder, text, *options, scene=FEW):
    """Call the command on a file whose name would colour a terminal."""
    stated, path = folder / "scene.toml", folder / "mine\x1b[31m.xml"
    path.write_text(text)
    if scene is not None:
        stated.write_text(fourbar.dump(scene))
    files = [str(file) for file in (stated, path) if file.exists()]
    arguments = [*files, "--out", str(folder / "out"), *options]
    return CliRunner().invoke(check_mjcf_command, arguments, standalone_mode=False)


@pytest.mark.parametrize(
    "scene, options, words",
    [
        (FEW, "--name wheel=a", "ROLE=NAME"),
        (None, "--name input=input", "--name needs a SCENE"),
        (None, "", "no equality that closes a loop"),
    ],
)
def test_what_cannot_be_judged_or_measured_is_refused(scene, options, words, tmp_path):
    hinge = '<body><joint/><geom size="0.1"/></body>'
    text = f"<mujoco><worldbody>{hinge}</worldbody></mujoco>"
    process = call(tmp_path, text, *options.split(), scene=scene)
    assert words in str(process.exception)


def run(tmp_path, text, *options):
    """Return the exit status of the command, and what its comparisons are allowed."""
    process = call(tmp_path, text, *options)
    if process.exception is not None:
        raise process.exception
    rows = read_columns(tmp_path / "out" / "results.csv")
    allowed = {row.allowed for row in rows if row.quantity != "undecided"}
    return process.return_value, sorted(allowed)


@pytest.mark.slow
def test_a_required_error_is_what_their_file_is_held_to(tmp_path):
    text = write_mjcf(FEW).replace("0.0016133333333333336", "0.0017")
    assert run(tmp_path, text) == (1, [0.0, SIMULATED.factor])
    assert run(tmp_path, text, "--error", "0.5") == (0, [0.0, 0.5])
    with raises(InputError, match="above 0 and below 1"):
        run(tmp_path, text, "--error", "2")
