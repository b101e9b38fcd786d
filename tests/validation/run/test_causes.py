"""Guests with one mistake each: the run names it, and names nothing of a right one.

Each is the engine of docs/protocol.md with a few words of its text exchanged, so that
the mistake is made in a calculation which knows nothing of the hypotheses.
"""

import cmath
from dataclasses import replace
from functools import partial
from itertools import cycle
from math import pi, sin

import numpy as np
from pytest import mark

from fourbar import (
    Bar,
    Flywheel,
    Friction,
    Gravity,
    Load,
    Motion,
    Place,
    Spring,
    Springs,
    Sweep,
    Table,
    Torsion,
    Viscous,
    load,
    solve,
)
from fourbar.quantities import OK
from fourbar_lab.fault_scenes import FAULT_SCENES
from fourbar_validation.check.calculated import find_miscalculated
from fourbar_validation.check.judge_table import Judge
from fourbar_validation.compare.answer import Answer
from fourbar_validation.compare.rows import FORMULAS
from fourbar_validation.compare.tolerance import EQUIVALENCE, ErrorBound
from fourbar_validation.engines import protocol
from fourbar_validation.engines.free_body import FreeBody
from fourbar_validation.engines.registry import Engine
from fourbar_validation.places import MODELS
from fourbar_validation.run import causes as search
from fourbar_validation.run.judge import judge
from tests.support.guests import PLAIN
from tests.support.here import list_failed, summary_of
from tests.support.scenes import WEIGHT, crank_rocker, recommand, relink
from tests.support.texts import put

SCENE = crank_rocker(Motion(Sweep(0.1, 6.0, 30), 10.0, 5.0), loads=())
CAPABILITIES = MODELS / "capabilities"
SOLVER = PLAIN.partition("\nNAMES =")[0]
TORQUE = '"torque": moments[0] - cross(r2, F32)'
PIN_FORCES = ("F12", "F32", "F43", "F14")
FORCES = (*PIN_FORCES, "torque")


def nothing(numbers, at):
    """Leave the numbers as they are."""


def make_guest(*words):
    """Return the page's engine with other words in its text: each old, then new."""
    solver = {}
    exec(put(SOLVER, *words), solver)

    class Plain:
        name = "plain"

        def answer(self, scene, at):
            described = protocol.scene_to_json(scene)
            told = protocol.command_to_json(scene, at)
            columns = [
                np.broadcast_to(told[key], len(at.angle)).tolist()
                for key in ("theta_2", "omega_2", "alpha_2", "branch")
            ]
            rows = [
                solver["solve"](described, *row) for row in zip(*columns, strict=True)
            ]
            numbers = {name: np.array([row[name] for row in rows]) for name in rows[0]}
            assembled = np.ones(len(rows), dtype=bool)
            return Answer(self.name, "exact", at, assembled, numbers)

    return Plain


def give_position_before(numbers, at):
    values = numbers["torque"]
    numbers["torque"] = np.concatenate((values[:1], values[:-1]))


def turn_into_bars(numbers, at):
    """Give each force in the frame of the bar on which it acts."""
    theta_2 = numbers.get("theta_2", at.angle)
    bars = (theta_2, theta_2, numbers["theta_3"], numbers["theta_4"])
    for name, theta in zip(PIN_FORCES, bars, strict=True):
        (x, y), c, s = numbers[name].T, np.cos(theta), np.sin(theta)
        numbers[name] = np.stack((c * x + s * y, c * y - s * x), axis=1)


def times_the_step(numbers, at):
    for name in FORCES:
        numbers[name] = 2e-3 * numbers[name]


LOOP_FORCE = "F43 = (moments[2] * r3 + moments[1] * r4) / det"
TREE = (
    "forces and torque of the open tree, cut at B: the loop force is 0, as from "
    "mj_inverse or rnea of a loop"
)
NO_VELOCITY_TERMS = "(dJ/dt) v is missing in the accelerations of the loop"
CUT_AT_B = "    F32 = F43 - forces[1]", "    F43 = 0j\n    F32 = F43 - forces[1]"
CARRIED = "moments[0] += cross(r2, forces[1])\n    "
DONE_TO_NUMBERS = {
    "one step late: numbers of the position before: torque": give_position_before,
    "each force is in the frame of the bar on which it acts, not in world axes": (
        turn_into_bars
    ),
    "bars 0.002 times ours (fitted)": times_the_step,
}
"""What is done to the engine's numbers by the mistake that is named."""
EXCHANGED = """\
F14 = -F43: F14
"F14": forces[2] + F43 -> "F14": -F43

the other branch from theta_2 = 118.4 deg on
r2 = cmath -> branch = branch if theta < 2.0 else -branch; r2 = cmath

(dJ/dt) v is missing in the accelerations of the loop
(alpha + 1j * omega**2) * r2 + -> alpha * r2 + 0.0 * (
1j * omega_4**2 * r4 -> 1j * omega_4**2 * r4)

(dJ/dt) v is halved in the accelerations of the loop
1j * omega**2) * r2 -> 0.5j * omega**2) * r2
1j * omega_3**2 -> 0.5j * omega_3**2
1j * omega_4**2 -> 0.5j * omega_4**2

(dJ/dt) v has the wrong sign in the accelerations of the loop
1j * omega**2) * r2 -> -1j * omega**2) * r2
1j * omega_3**2 -> -1j * omega_3**2
1j * omega_4**2 -> -1j * omega_4**2

forces and torque of the open tree, cut at B: the loop force is 0, as from mj_inverse \
or rnea of a loop
F43 = (moments[2] * r3 + moments[1] * r4) / det -> F43 = 0j
"torque": moments[0] - -> "torque": moments[0] + moments[1] -

effects.gravity left out
arm - field) -> arm)

the weight of bar 3 is missing
arm - field) -> arm - field * (name != "coupler"))

# ipab-slmc/exotica#134
bars.input left out
bar["mass"] * (a_pin -> bar["mass"] * (name != "input") * (a_pin
bar.get("inertia" -> (name != "input") * bar.get("inertia"

# bulletphysics/bullet3#2966
every number is 2 times ours: torque
moments[0] - cross(r2, F32) -> 2.0 * (moments[0] - cross(r2, F32))

the acceleration of bar 3's first pin is used as its a_G
- w * w) * arm -> - w * w) * arm * (name != "coupler")

# an adversary's: what issue lists of engines report, and no case above has
F32 is in the frame of bar 3, not in world axes: F32
"F32": F32 -> "F32": F32 / (r3 / b)

-omega^2 r is missing in a_G of every bar, r from its first pin to G
1j * turning - w * w -> 1j * turning

-omega^2 r has the wrong sign in a_G of every bar, r from its first pin to G
1j * turning - w * w -> 1j * turning + w * w

# bulletphysics/bullet3#4451
-omega^2 r is doubled in a_G of every bar, r from its first pin to G
1j * turning - w * w -> 1j * turning - 2.0 * w * w

alpha x r is missing in a_G of every bar, r from its first pin to G
1j * turning - w * w -> -w * w

alpha x r is doubled in a_G of every bar, r from its first pin to G
1j * turning - w * w -> 2j * turning - w * w

alpha x r has the wrong sign in a_G of every bar, r from its first pin to G
1j * turning - w * w -> -1j * turning - w * w

-omega^2 r is missing in a_G of bar 4, r from its first pin to G
1j * turning - w * w -> 1j * turning - w * w * (name != "output")

a_A is missing in a_G of bar 3
a_pin + (1j -> a_pin * (name != "coupler") + (1j

-omega^2 r is missing in every a_G, and in a_A
1j * turning - w * w -> 1j * turning
a_A = (1j * alpha - omega**2) * r2 -> a_A = 1j * alpha * r2

alpha_2 is reversed
r2 = cmath -> alpha = -alpha; r2 = cmath
"""
"""Words that name a mistake, and what makes it in the engine's text."""


def read_bugs():
    """Return the words to exchange in the engine's text, by the mistake's name."""
    bugs = {}
    for case in EXCHANGED.split("\n\n"):
        lines = [line for line in case.splitlines() if not line.startswith("#")]
        text, *changes = lines
        bugs[text] = " -> ".join(changes).split(" -> ")
    return bugs


BUGS = read_bugs()
DRIVEN = {
    3: (
        LOOP_FORCE,
        f"{CARRIED}F43 = (moments[0] * r4 + moments[2] * r2) / cross(r2, r4)",
        TORQUE,
        '"torque": moments[1] - cross(r3, F43)',
    ),
    4: (
        LOOP_FORCE,
        f"{CARRIED}F43 = (moments[1] * r2 - moments[0] * r3) / cross(r3, r2)",
        TORQUE,
        '"torque": moments[2] + cross(r4, F43)',
    ),
}
"""The engine's text where the drive is on bar 3 or 4."""


@mark.parametrize("bar", DRIVEN)
def test_a_mistake_is_named_wherever_the_drive_acts(bar):
    scene = replace(SCENE, drive_bar=bar)
    right = DRIVEN[bar]
    assert find_causes(make_guest(*right), scene) == []
    for pair, words in (
        (BUGS[NO_VELOCITY_TERMS], NO_VELOCITY_TERMS),
        (CUT_AT_B, TREE),
    ):
        assert find_causes(make_guest(*right, *pair), scene)[0] == words


@mark.parametrize(
    "cut, bar, joint, behind",
    [("A", 3, "B", (3,)), ("O4", 4, "B", (4,)), ("O4", 3, "A", (3, 4))],
)
def test_the_joint_of_a_driven_bar_carries_the_bars_behind_it(cut, bar, joint, behind):
    """The work of the weights in a tree whose driven joint alone turns is that of its
    torque.
    """
    scene = replace(recommand(SCENE, speed=0.0, acceleration=0.0), drive_bar=bar)
    right = solve(scene, "force")
    torque = sum(
        scene.linkage.bar(one).mass * 9.81 * (right[f"G{one}"] - right[joint])[:, 0]
        for one in behind
    )
    answer = FreeBody().answer(scene, right.at)
    table = search.make_answer_table(answer, right.status_code == OK)
    (of_tree,) = (
        mistake.predict("torque")
        for mistake in find_miscalculated(Judge(scene, table))
        if mistake.text.startswith(f"forces and torque of the open tree, cut at {cut}")
    )
    np.testing.assert_allclose(of_tree, torque, atol=1e-12)


def find_causes_of(change, scene=SCENE):
    """Find the causes of free bodies whose numbers are changed at last."""
    return find_causes(partial(Altered, change), scene)


def find_causes(guest, scene=SCENE):
    record = judge("scene", scene, [Engine("plain", guest, EQUIVALENCE)])
    failed = [row.failed for row in record.rows if row.engine == "plain"]
    assert failed and (any(failed) or "plain" not in record.causes)
    causes = record.causes.get("plain", [])
    return [cause.removesuffix(", all else agrees") for cause in causes]


@mark.slow
@mark.parametrize("text", BUGS)
def test_a_mistake_is_named_first(text):
    assert find_causes(make_guest(*BUGS[text]))[0] == text


@mark.slow
@mark.parametrize("text", DONE_TO_NUMBERS)
def test_a_mistake_in_the_numbers_is_named_first(text):
    assert find_causes_of(DONE_TO_NUMBERS[text])[0] == text


def test_a_right_guest_has_no_cause():
    assert find_causes(make_guest()) == []


class Altered:
    """Free bodies whose numbers are changed at last."""

    name = "plain"
    commands = FreeBody.commands

    def __init__(self, change):
        self.change = change

    def answer(self, scene, at):
        answer = FreeBody().answer(scene, at)
        numbers = dict(answer.quantities)
        self.change(numbers, at)
        return replace(answer, engine=self.name, quantities=numbers)


def reverse_F43(numbers, at):
    numbers["F43"] = -numbers["F43"]


def test_numbers_where_an_engine_finds_no_loop_closed_are_not_looked_at():
    class Partly(Altered):
        def answer(self, scene, at):
            answer = super().answer(scene, at)
            answer.assembled[:5] = False
            answer.quantities["F43"][:5] = 7.0
            return answer

    (cause,) = find_causes(partial(Partly, reverse_F43))
    assert cause == "sign reversed, or F_ij given for F_ji: F43"


def reverse_y(numbers, at):
    for name in PIN_FORCES:
        numbers[name] = numbers[name] * (1.0, -1.0)


HARD_TO_EXPLAIN = {
    **{
        name: load(CAPABILITIES / f"{name}.toml")
        for name in (
            "kite",
            "parallelogram",
            "command_coupler",
            "command_output",
            "stroke_input",
            "stroke_output",
            "cylinder_1_3",
            "law_cycloidal",
        )
    },
    **{name: FAULT_SCENES[name] for name in ("output commanded", "limited")},
    # only the error predicted for an engine tells a digit from none
    "nearest to a limit": FAULT_SCENES["nearest to a limit"],
}


@mark.parametrize("name", HARD_TO_EXPLAIN)
def test_what_nothing_explains_fails_by_its_numbers_under_every_command(name):
    """Mistakes that are tried in vain, as a zero that is elsewhere, hide no number."""

    def spoil(numbers, at):
        for place, (quantity, values) in enumerate(numbers.items()):
            ripple = np.cos(place + np.arange(values.size) ** 2.0)
            numbers[quantity] = values + np.ptp(values) * ripple.reshape(values.shape)

    engine = Engine("plain", partial(Altered, spoil), EQUIVALENCE)
    failed = {row.quantity for row in list_failed(HARD_TO_EXPLAIN[name], [engine])}
    assert "F12" in failed and "all" not in failed


def test_mistakes_in_several_columns_are_named_together():
    def reverse_both(numbers, at):
        reverse_F43(numbers, at)
        numbers["F12"] = numbers["F12"] * (-1.0, 1.0)

    of_F43 = "sign reversed, or F_ij given for F_ji: F43"
    assert find_causes_of(reverse_both)[0] == f"{of_F43}; x reversed: F12"


@mark.parametrize("spoiled", [["alpha_3"], ["alpha_3", "a_G3"]])
def test_a_mistake_that_explains_less_than_nine_tenths_is_not_named(spoiled):
    """The other branch changes fewer than twenty quantities."""

    def take_other_branch(numbers, at):
        numbers |= FreeBody().answer(SCENE, at._replace(branch=-at.branch)).quantities
        ripple = 1.0 + 0.1 * np.cos(np.arange(len(at.angle)) ** 2.0)
        for name in spoiled:
            numbers[name] = (numbers[name].T * ripple).T

    causes = find_causes_of(take_other_branch)
    named = ["the other branch, but alpha_3 differs"]
    assert causes == (named if len(spoiled) == 1 else [])


@mark.parametrize("name", HARD_TO_EXPLAIN)
def test_a_sign_is_named_under_every_command_and_at_change_points(name):
    causes = find_causes_of(reverse_F43, HARD_TO_EXPLAIN[name])
    assert causes == ["sign reversed, or F_ij given for F_ji: F43"]


def test_the_commanded_angle_is_looked_at_too():
    def measure_from_B(numbers, at):
        numbers["theta_4"] = numbers["theta_4"] + pi

    scene = load(CAPABILITIES / "command_output.toml")
    (cause,) = find_causes_of(measure_from_B, scene)
    assert cause.startswith("measured from the other end of the bar")


def test_a_mistake_of_the_inertia_alone_is_said_to_be_there():
    class OfInertia(Altered):
        def answer(self, scene, at):
            answer = super().answer(scene, at)
            answer.quantities.pop("torque_inertia", None)
            if not scene.effects:
                answer.quantities["torque"] *= 1.5
            return answer

    (cause,) = find_causes(partial(OfInertia, nothing))
    assert cause == "without loads and effects: every number is 1.5 times ours: torque"


@mark.parametrize("name", ["stroke_output", "cylinder_2_3", "push_output"])
def test_the_force_of_a_drive_takes_part_in_the_balance_that_is_wrong(name):
    """The weight of the coupler is what the balances with and without it differ by."""
    scene = load(CAPABILITIES / f"{name}.toml")
    scene = replace(scene, effects=WEIGHT)
    massless = replace(scene.linkage.coupler, mass=0.0, density=None, inertia=0.0)
    light = relink(scene, coupler=massless)

    def leave_out_weight(numbers, at):
        inertial, weighing, neither = (
            FreeBody().answer(one, at).quantities
            for one in (replace(scene, effects=()), light, replace(light, effects=()))
        )
        for force in (*PIN_FORCES, "drive_force"):
            numbers[force] = inertial[force] + weighing[force] - neither[force]

    assert "the weight of bar 3 is missing" in find_causes_of(leave_out_weight, scene)


def scale(without, factor=0.0):
    """Leave out, double or reverse what a scene has not."""

    def change(numbers, at):
        rest = FreeBody().answer(without, at).quantities
        for name in FORCES:
            numbers[name] = rest[name] + factor * (numbers[name] - rest[name])
        numbers.pop("torque_inertia", None)

    return change


GROUND, COUPLER = Place(1, (0.3, 0.2)), Place(3, (0.1, 0.4))
SPRING = Spring(
    GROUND,
    COUPLER,
    90.0,
    0.1,
    4.0,
)
SLACK = Spring(
    GROUND,
    Place(4, (0.1, 0.0)),
    50.0,
    0.1,
)
TORSION = Torsion.at(O4=(2.0, 1.0, 0.0))
BOTH, ONE, SLIPPED, GRASPED = (
    Springs(springs)
    for springs in (
        (SPRING, SLACK),
        (SPRING,),
        (replace(SPRING, preload=0.0),),
        (replace(SPRING, length=0.0),),
    )
)
ACTING = {
    "effects.springs": (BOTH,),
    "effects.springs.1.stiffness": (BOTH, ONE),
    "effects.springs.0.preload": (ONE, SLIPPED),
    "effects.springs.0.length": (ONE, GRASPED),
    "effects.torsion.O4.rest": (
        TORSION,
        Torsion.at(O4=(2.0, 0.0, 0.0)),
    ),
    "effects.viscous.O4": (Viscous.at(O4=0.2),),
    "effects.torsion.O4.stiffness": (TORSION,),
    "effects.flywheel.inertia": (Flywheel(0.3),),
    "effects.friction.O4": (Friction.at(O4=0.5),),
}
"""What acts, and what is left where a part of it is missing."""
DONE = {"left out": 0.0, "doubled": 2.0, "reversed": -1.0}


@mark.slow
@mark.parametrize("name, word", list(zip(ACTING, cycle(DONE))))
def test_what_acts_may_be_left_out_doubled_or_reversed(name, word):
    bare = replace(SCENE, effects=WEIGHT)
    acting, *left = ACTING[name]
    scene, without = (
        replace(bare, effects=(*bare.effects, *effects)) for effects in ([acting], left)
    )
    causes = find_causes_of(scale(without, DONE[word]), scene)
    assert f"{name} {word}" in causes and "fitted" not in " ".join(causes)


def with_load(bar=4, **stated):
    """Return the scene with a force on a bar, placed as stated."""
    return replace(SCENE, loads=(Load(bar, (3.0, 0.7), **stated),))


def with_effects(*effects):
    return replace(SCENE, effects=effects)


def with_springs(*springs):
    return with_effects(Springs(springs))


def with_torsion(*springs):
    """Return the scene with springs at pins: stiffness, rest angle and preload."""
    return with_effects(Torsion(springs))


def with_forces(angle, moment, **table):
    """Return the scene with a force of this angle on bar 4 and on bar 2 another."""
    first = Load(4, (3.0, angle), arm=PLACE, moment=moment)
    second = Load(2, (5.0, 2.0 * angle), from_pin=PLACE, **table)
    return replace(SCENE, loads=(first, second))


PLACE = (0.05, 1.0)
TABLE = {"table": Table((0.0, 2.0, 2.0 * pi), (1.0, 3.0, 1.0))}
DRAWN = replace(SPRING, preload=-4.0)
PULLING, PUSHING = (replace(SLACK, acts=acts) for acts in ("pull", "push"))
RUBBED = replace(
    SCENE,
    motion=Motion(Sweep(3.5, 5.0, 12), 10.0, 5.0),
    effects=(Friction.at(B=0.5),),
)
BARS = {name: getattr(SCENE.linkage, name) for name in ("input", "coupler", "output")}
LIGHT = {name: Bar(bar.length) for name, bar in BARS.items()}
WEIGHTS = tuple(
    Load(number, (9.81 * bar.mass, -0.5 * pi), from_pin=bar.mass_centre)
    for number, bar in enumerate(BARS.values(), 2)
)
ARM, FROM_PIN = with_load(arm=PLACE), with_load(from_pin=PLACE)
AT_PIN = {"from_pin": (0.0, 0.0)}
OTHER_SCENES = {
    "loads.0 (bar 3): its force acts at the second pin of the bar": (
        with_load(3, from_pin=PLACE),
        with_load(3, from_pin=(SCENE.linkage.coupler.length, 0.0)),
    ),
    "effects.viscous.O4 57.2958 times ours (fitted)": (
        with_effects(Gravity(), Viscous.at(O4=0.2)),
        SCENE,
        np.degrees(1.0),
    ),
    "effects.torsion.*.preload left out": (
        with_torsion(("O2", 2.0, 0.4, 0.5), ("O4", 1.0, 1.0, -0.3)),
        with_torsion(("O2", 2.0, 0.4, 0.0), ("O4", 1.0, 1.0, 0.0)),
    ),
    "no inertial forces (statics), with friction": (
        replace(RUBBED, effects=(*RUBBED.effects, Gravity(9.81))),
        replace(relink(RUBBED, **LIGHT), loads=WEIGHTS),
    ),
    "effects.springs.*.length left out": (
        with_springs(PULLING, PUSHING),
        with_springs(replace(PULLING, length=0.0, acts=None)),
    ),
    "effects.springs.0.stiffness left out": (
        with_springs(DRAWN),
        with_springs(replace(DRAWN, stiffness=0.0)),
    ),
    "effects.torsion.O2.stiffness 1.3 times ours (fitted)": (
        with_torsion(("O2", 2.0, 1.0, 0.3)),
        with_torsion(("O2", 2.6, 1.0, 0.3)),
    ),
    "loads.0 (bar 4): its place is measured from the bar's second pin, not from its"
    " first": (
        FROM_PIN,
        with_load(from_pin=cmath.polar(0.22 + cmath.rect(*PLACE))),
    ),
    "effects.springs.0.length 1.3 times ours (fitted)": (
        with_springs(DRAWN),
        with_springs(replace(DRAWN, length=0.13)),
    ),
    "gravity points to -90 deg": (
        with_effects(Gravity(angle=-1.2)),
        with_effects(Gravity()),
    ),
    "gravity is turned with the ground": (
        with_effects(Gravity()),
        with_effects(Gravity(angle=SCENE.linkage.ground_angle - 0.5 * pi)),
    ),
    "loads.*.force.1 reversed": (
        with_forces(0.7, 0.0),
        with_forces(-0.7, 0.0),
    ),
    "loads.*.force reversed": (
        with_forces(0.7, 0.4),
        replace(SCENE, loads=(Load(4, moment=0.4),)),
        -1.0,
    ),
    "loads.0.moment reversed": (
        with_forces(0.7, 0.4),
        with_forces(0.7, -0.4),
    ),
    "loads.1 (bar 2): its table is left out": (
        with_forces(0.7, 0.4, **TABLE),
        with_forces(0.7, 0.4),
    ),
    # an arm from the first pin, in world axes, gives one moment everywhere
    "loads.0 (bar 4): its arm is measured from the bar's first pin, not from G": (
        ARM,
        with_load(moment=3.0 * 0.05 * sin(0.7 - 1.0), **AT_PIN),
    ),
    "loads.0 (bar 4): its place is measured from G, not from the bar's first pin": (
        FROM_PIN,
        with_load(from_centre=PLACE),
    ),
    # stack-of-tasks/pinocchio#1544
    "loads.0 (bar 4): its force acts at the first pin of the bar": (
        ARM,
        with_load(**AT_PIN),
    ),
    "loads.0 (bar 4): its force acts at G of the bar": (
        FROM_PIN,
        with_load(from_centre=(0.0, 0.0)),
    ),
    # stack-of-tasks/pinocchio#1543
    "loads.0 (bar 4): its direction turns with the bar": (
        FROM_PIN,
        with_load(from_pin=PLACE, frame="bar"),
    ),
}
"""Scene, the one that is solved in its place, and the factor on what differs."""


@mark.parametrize("words", OTHER_SCENES)
def test_another_scene_of_an_adversary_is_named_first(words):
    scene, other, *factor = OTHER_SCENES[words]
    assert find_causes_of(scale(other, *factor), scene)[0] == words


@mark.parametrize(
    "names, where",
    [  # osrf/drcsim#193: the wrench of the constraints alone
        (PIN_FORCES, "in the pin forces alone"),
        (("torque",), "in what drives alone"),
    ],
)
def test_what_acts_may_be_missing_in_some_quantities(names, where):
    def leave_out(numbers, at):
        without = FreeBody().answer(replace(SCENE, effects=()), at).quantities
        numbers |= {name: without[name] for name in names}

    assert find_causes_of(leave_out)[0] == f"effects.gravity left out {where}"


def name_wrong(changes, tolerance=EQUIVALENCE):
    """Who is called wrong, and why, where engines answer with these changes."""

    class Named(Altered):
        def __init__(self, name, change):
            super().__init__(change)
            self.name = name

    engines = [
        Engine(name, partial(Named, name, change), tolerance, ("F43", "torque"))
        for name, change in changes.items()
    ]
    summary = summary_of([judge("scene", SCENE, engines)])
    return {cause.engine: cause.text for cause in summary.causes}


def test_two_engines_that_agree_with_each_other_blame_the_formulas_alone():
    twice = {"one": reverse_F43, "two": reverse_F43}
    words = "one, two agree with each other, and differ from it in F43"
    assert name_wrong(twice) == {FORMULAS: words}
    assert name_wrong({**twice, "three": nothing}) == {FORMULAS: words}
    # where as many agree with the formulas each is wrong by itself
    outvoted = name_wrong({**twice, "three": nothing, "four": nothing})
    assert outvoted.keys() == twice.keys()
    # nor where each differs in a way of its own
    assert name_wrong({"one": reverse_F43, "two": reverse_y}).keys() == twice.keys()

    def stretch(numbers, at, by):
        numbers["F43"] = numbers["F43"] * by

    missed = {"one": partial(stretch, by=1.0015), "two": partial(stretch, by=1.002)}
    declared = ErrorBound("stated", "3 digits", 1e-3, conditioned=False)
    assert name_wrong(missed, declared).keys() == twice.keys()


@mark.parametrize("quantity", ["v_G3", "assembled"])
def test_what_follows_from_two_answers_alike_is_no_fault_of_theirs(quantity):
    class Alike(Altered):
        def answer(self, scene, at):
            answer = super().answer(scene, at)
            answer.assembled[:2] &= quantity != "assembled"
            return answer

    def turn_faster(numbers, at):
        numbers["omega_3"] = numbers["omega_3"] + (quantity == "v_G3")

    class AlsoAlike(Alike):
        name = "other"

    engines = [
        Engine(one.name, partial(one, turn_faster), EQUIVALENCE, ("omega_3", "v_G3"))
        for one in (Alike, AlsoAlike)
    ]
    record = judge("scene", SCENE, engines)
    failed = {row.quantity for row in record.rows if row.failed}
    assert quantity in failed and failed == {*record.against}


def test_what_nobody_knows_is_no_known_mistake():
    strange = make_guest(TORQUE, '"torque": 1.0 + 0.3 * math.sin(7.0 * theta)')
    assert find_causes(strange) == []


def test_where_pins_slide_the_rows_about_the_first_wrong_one_are_looked_at():
    scene = load(CAPABILITIES / "sliding_pins.toml")
    scene = replace(scene, motion=Motion(Sweep(0.1, 6.0, 60), -10.0, 5.0))

    def spoil_one_more(numbers, at):
        reverse_F43(numbers, at)
        numbers["F12"][50] *= 1.1

    (cause,) = find_causes_of(spoil_one_more, scene)
    assert cause == "sign reversed, or F_ij given for F_ji: F43, but F12 differs"
