"""The closures of a robot: from both bodies of each equality to their common ancestor.

A planar four-bar is three hinges with parallel axes on the way and a connect, which is
the fourth pin; or four hinges and a weld, which joins two halves of a bar. Bodies that
no joint parts, or a held one, are one bar.
"""

import math
from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations, pairwise, permutations

import mujoco
import numpy as np

from fourbar.errors import InputError
from fourbar.linkage import ENDS, PINS
from fourbar.quantities import Array
from fourbar_validation.engines.mujoco.robots.ancestry import (
    climb,
    find_common,
    find_ends,
    find_parent,
    find_roots,
    find_tied_bodies,
    list_actuators,
    list_followers,
    list_joints,
    list_motors,
    name_joint,
)
from fourbar_validation.engines.mujoco.robots.compiled import compile_robot
from fourbar_validation.engines.mujoco.robots.frame import LoopFrame
from fourbar_validation.engines.mujoco.robots.loop_facts import (
    PoseOptions,
    RobotClosure,
    RobotFile,
    RobotLoop,
    RobotReport,
    write_length,
)
from fourbar_validation.engines.mujoco.robots.planes import (
    PARALLEL,
    find_mean_axis,
    find_normals,
    find_offset,
)
from fourbar_validation.engines.mujoco.robots.pose import (
    BALL,
    FREE_JOINT,
    HINGE_JOINT,
    LARGEST_RESIDUAL,
    SLIDE,
    PosedRobot,
    find_joint,
    pose_robot,
)

_PIN_BETWEEN = {frozenset(bars): pin for pin, bars in PINS.items()}
"""Pins by the two bars that each joins."""
COINCIDENT_PINS = 1e-6
"""Two pins are one where they are nearer than this part of the longest bar."""
LEVEL_PLANE = 1e-6
"""Part of gravity below which a plane is level."""
EQUALITY_KINDS = {
    int(getattr(mujoco.mjtEq, f"mjEQ_{name.upper()}")): name
    for name in ("connect", "weld", "joint", "tendon")
}
JOINT_WORDS = {FREE_JOINT: "free", BALL: "ball", SLIDE: "slide"}
NUMBERS = ("no", "one", "two", "three", "four", "five", "six", "seven")
NAMES_OF_LINKAGES = {6: "a six-bar", 8: "an eight-bar"}
_SERVE_SPATIAL = "MuJoCo or Drake serve it, Pinocchio its inverse dynamics"
_SERVE_PLANAR = "MuJoCo or Drake serve it, PMKS+ for a sketch"
"""Tools for mechanisms that are no planar four-bar."""
_MOST_HOLDS = 5
"""Further choices of joints to hold that are printed."""


def list_closures(
    file: RobotFile,
    options: PoseOptions,
    name: str | None = None,
) -> RobotReport:
    """Compile a robot's file, pose it, and describe each of its equalities.

    A name chooses one of them.
    """
    compiled = compile_robot(file)
    posed = pose_robot(compiled.model, options)
    closures = find_closures(posed, options)
    if name is not None:
        closures = [_find_closure(closures, name)]
    return RobotReport(tuple(closures), (*compiled.notes, *posed.notes))


def find_closures(posed: PosedRobot, options: PoseOptions) -> list[RobotClosure]:
    """Describe each equality of a posed robot, in the order of the file.

    Raises
    ------
    InputError : a joint that is held or drives is none of the robot's, or drives no
        loop.
    """
    finder = _Finder(posed, options)
    closures = [finder.describe(number) for number in range(posed.model.neq)]
    if options.drive is not None:
        joint = find_joint(posed.model, options.drive, "--drive")
        loops = [closure.loop for closure in closures if closure.loop is not None]
        if not any(joint == loop.hinges["O2"] for loop in loops):
            raise InputError(
                "--drive",
                options.drive,
                "drives no four-bar: it must be a hinge of one, on its ground",
            )
    return closures


def _find_closure(closures: Sequence[RobotClosure], name: str) -> RobotClosure:
    """Return the closure of a name, or raise an InputError that lists what is there."""
    for closure in closures:
        if closure.name == name:
            return closure
    names = ", ".join(closure.name for closure in closures) or "none"
    raise InputError("--loop", name, f"no such closure; the file has: {names}")


def choose_loop(closures: Sequence[RobotClosure], name: str) -> RobotLoop:
    """Return the four-bar of a closure.

    Raises an InputError that says why there is none.
    """
    closure = _find_closure(closures, name)
    if closure.loop is None:
        raise InputError("--loop", name, f"is no four-bar: {closure.reason}")
    return closure.loop


def require_loops(closures: Sequence[RobotClosure]) -> list[RobotLoop]:
    """Return the four-bars among closures; an InputError says why there are none.

    Of equalities that hold one pin together the first stands for all.
    """
    loops: dict[frozenset[int], RobotLoop] = {}
    for closure in closures:
        loop = closure.loop
        if loop is None:
            continue
        pin = frozenset(loop.closures)
        known = loops.setdefault(pin, loop)
        if known is not loop:
            remark = f"{loop.name} holds the same pin, and acts with {known.name}"
            loops[pin] = replace(known, remarks=(*known.remarks, remark))
    if not loops:
        why = "the file has no equality that closes a loop"
        if len(closures) == 1:
            why = f"{closures[0].name}: {closures[0].reason}"
        elif closures:
            why = f"fourbar-validation loops says why of its {len(closures)} equalities"
        raise InputError("MJCF", None, f"has no planar four-bar: {why}")
    return [*loops.values()]


def describe_equality(model: mujoco.MjModel, number: int) -> str:
    """Return an equality's name, or the two bodies or joints that it ties."""
    if model.equality(number).name:
        return str(model.equality(number).name)
    kind = EQUALITY_KINDS.get(int(model.eq_type[number]))
    first = int(model.eq_obj1id[number])
    second = int(model.eq_obj2id[number])
    if kind in ("connect", "weld"):
        names = [name_body(model, body) for body in find_tied_bodies(model, number)]
    elif kind == "joint":
        names = [name_joint(model, i) for i in (first, second) if i >= 0]
    elif kind == "tendon":
        tendons = [i for i in (first, second) if i >= 0]
        names = [model.tendon(i).name or f"tendon {i}" for i in tendons]
    else:
        return f"equality {number}"
    return "-".join(names)


def name_body(model: mujoco.MjModel, body: int) -> str:
    """Name a body; the world is its own."""
    return model.body(body).name or f"body {body}"


def _spell_count(number: int, most: int = 7) -> str:
    """Write a number as a word up to a largest one."""
    return NUMBERS[number] if number <= most else str(number)


class _NoFourBarError(Exception):
    """A closure closes no planar four-bar; the message says why."""


class _Chain:
    """Joints from one end of a closure to the other, and the bars between them.

    The chain leads over the common ancestor of both ends.
    """

    def __init__(self, finder: "_Finder", number: int) -> None:
        self.model = finder.model
        self.number = number
        self.is_pin = finder.is_pin(number)
        first, second = find_tied_bodies(self.model, number)
        common = find_common(self.model, first, second)
        self.ground = finder.root[common]
        self.ground_name = name_body(self.model, common)
        upward = self._list_side(finder, first, common)
        downward = self._list_side(finder, second, common)[::-1]
        self.joints = [joint for joint, _ in upward + downward]
        self.bars = [finder.root[first], *(bearer for _, bearer in upward)]
        """One more than joints; None: the joint hangs on another of the same body."""
        if downward:
            self.bars += [*(bearer for _, bearer in downward[1:]), finder.root[second]]

    def _list_side(
        self,
        finder: "_Finder",
        end: int,
        common: int,
    ) -> list[tuple[int, int | None]]:
        """List (moving joint, its bearer) from an end up to the common ancestor.

        The bearer is a bar, or None if another joint bears this one.
        """
        side: list[tuple[int, int | None]] = []
        for body in climb(self.model, end):
            if body == common:
                break
            joints = list_joints(self.model, body)
            moving = [joint for joint in joints if joint not in finder.held]
            bearers = [
                finder.root[find_parent(self.model, body)],
                *[None] * len(moving),
            ]
            side += reversed([*zip(moving, bearers, strict=False)])
        return side

    @property
    def pins(self) -> int:
        """Number of its joints, and of its closure if that is a pin."""
        return len(self.joints) + self.is_pin

    @property
    def hinges(self) -> list[int]:
        """Hinges among the joints."""
        types = self.model.jnt_type
        return [joint for joint in self.joints if types[joint] == HINGE_JOINT]

    @property
    def others(self) -> dict[int, int]:
        """Type of each joint that is no hinge."""
        types = {joint: int(self.model.jnt_type[joint]) for joint in self.joints}
        return {joint: kind for joint, kind in types.items() if kind != HINGE_JOINT}


class _Finder:
    """Four-bars of one posed model."""

    def __init__(self, posed: PosedRobot, options: PoseOptions) -> None:
        self.posed = posed
        self.options = options
        self.model = posed.model
        self.data = posed.data
        self.held = {find_joint(self.model, name, "--hold") for name in options.held}
        self.root = find_roots(self.model, self.held)
        self.standing = self._hold_standing()
        self.normals = find_normals(self.model, self.data, self.held)
        self.before = mujoco.MjData(self.model)
        self.before.qpos[:] = posed.stated
        mujoco.mj_kinematics(self.model, self.before)

    def _hold_standing(self) -> dict[int, int]:
        """Hold the hinges that cannot turn, and return them by the closure that acts.

        A closure of two hinges that lies on the axis of one leaves this one free. The
        other hinge stands.
        """
        standing = {}
        for number in self._list_others(-1):
            chain = _Chain(self, number)
            away = self._list_away(chain)
            if chain.is_pin and len(away) == 1 and len(chain.joints) == 2:
                (standing[number],) = away
                self.held.update(away)
        self.root = find_roots(self.model, self.held)
        return standing

    def _list_away(self, chain: _Chain) -> list[int]:
        """List the joints of a chain but the hinges on whose axis its closure lies."""
        place, _ = find_ends(self.model, self.data, chain.number)
        arms = np.cross(place - self.data.xanchor, self.data.xaxis)
        near = np.linalg.norm(arms, axis=1) <= LARGEST_RESIDUAL
        return [one for one in chain.joints if one in chain.others or not near[one]]

    def _is_idle(self, chain: _Chain) -> bool:
        """Tell whether a closure lies on the axes of all its hinges, and holds none."""
        return chain.is_pin and not self._list_away(chain)

    def describe(self, number: int) -> RobotClosure:
        """Describe one equality."""
        model = self.model
        kind = EQUALITY_KINDS.get(int(model.eq_type[number]), "flex")
        closure = RobotClosure(
            self._name(number),
            kind,
            None,
            self._describe_mimic(number, kind),
            solref=tuple(model.eq_solref[number].tolist()),
            solimp=tuple(model.eq_solimp[number].tolist()),
        )
        if kind not in ("connect", "weld"):
            return closure
        chain = _Chain(self, number)
        loop = None
        reason = ""
        try:
            loop = self._recognise(chain)
        except _NoFourBarError as error:
            reason = str(error)
        return replace(
            closure,
            loop=loop,
            reason=reason,
            ground=chain.ground_name,
            hinges=tuple(name_joint(model, joint) for joint in chain.hinges),
            other_joints=tuple(
                f"{name_joint(model, joint)} ({JOINT_WORDS[kind]})"
                for joint, kind in chain.others.items()
            ),
            misaligned=self._measure_axes(chain)[0],
            gap=self._measure_gap(number) if chain.is_pin else None,
        )

    def _measure_gap(self, number: int) -> float:
        """Measure the distance of the stated ends, in a plane if there is one, m."""
        first, second = find_ends(self.model, self.before, number)
        apart = first - second
        normal = self.normals.get(number, np.zeros(3))
        return float(np.linalg.norm(apart - (apart @ normal) * normal))

    def _name(self, number: int) -> str:
        """Name an equality so that no other has the same name."""
        names = [describe_equality(self.model, n) for n in range(self.model.neq)]
        name = names[number]
        if names.count(name) == 1:
            return name
        return f"{name}-{names[: number + 1].count(name)}"

    def is_pin(self, number: int) -> bool:
        """Return True for a connect, and for a weld that lets its bodies turn."""
        if self.model.eq_type[number] == mujoco.mjtEq.mjEQ_CONNECT:
            return True
        return bool(self.model.eq_data[number, 10] == 0.0)  # torquescale

    def _describe_mimic(self, number: int, kind: str) -> str:
        """Write which joint follows which, by which polynomial."""
        model = self.model
        followers = list_followers(model, number)
        if followers:
            joint, leader, numbers = followers[0]
            follower = name_joint(model, joint)
            polynomial = " ".join(f"{c + 0.0:.6g}" for c in numbers)
            return (
                f"{follower} follows {name_joint(model, leader)}, polycoef "
                f"{polynomial}: no loop is closed (write the loop that it stands for, "
                "by fourbar new SCENE --pins; then check-mjcf SCENE FILE --mimic "
                f"{follower} says what it loses)"
            )
        if kind != "joint":
            return f"a {kind} equality is no pin"
        joint = int(model.eq_obj1id[number])
        rest = float(model.eq_data[number, 0])
        return f"{name_joint(model, joint)} is kept at {rest:.6g} of its rest"

    def _recognise(self, chain: "_Chain") -> RobotLoop:
        """Return the four-bar of a closure."""
        if not self.model.eq_active0[chain.number]:
            raise _NoFourBarError('it is switched off in the file (active="false")')
        if not chain.joints:
            raise _NoFourBarError("both ends are on one rigid body")
        reason = (
            self._explain_idle(chain)
            or self._find_ball_in_a_plane(chain)
            or self._find_other_joint(chain)
            or self._find_skew_axes(chain)
        )
        if not reason and chain.pins != len(PINS):
            reason = self._explain_count(chain)
        elif not reason and None in chain.bars:
            reason = "two of its hinges are on one body: a bar has no body"
        if reason:
            raise _NoFourBarError(reason)
        return self._make_loop(chain)

    def _explain_idle(self, chain: _Chain) -> str:
        """Say what a closure on the axes of its hinges holds; empty for others."""
        if not self._is_idle(chain):
            return ""
        names = ", ".join(name_joint(self.model, joint) for joint in chain.joints)
        text = f"it lies on the axis of {names} and leaves it free"
        if chain.number in self.standing:
            stands = name_joint(self.model, self.standing[chain.number])
            text += f"; {stands} cannot turn by it, and counts as held"
        return text

    def _find_ball_in_a_plane(self, chain: _Chain) -> str:
        """Say what to type for one ball among hinges with parallel axes.

        Both ends of the bar that the ball carries stay in their planes, so that a hinge
        moves as the ball does. Empty where the loop is another.
        """
        is_one = [*chain.others.values()] == [BALL] and chain.pins == len(PINS)
        if not is_one or self._find_skew_axes(chain):
            return ""
        (ball,) = chain.others
        rest = mujoco.MjData(self.model)
        rest.qpos[:] = self.data.qpos
        address = int(self.model.jnt_qposadr[ball])
        rest.qpos[address : address + 4] = self.model.qpos0[address : address + 4]
        mujoco.mj_kinematics(self.model, rest)
        body = int(self.model.jnt_bodyid[ball])
        # a joint states its axis in the frame of its body
        axis = rest.xmat[body].reshape(3, 3).T @ rest.xaxis[chain.hinges[0]]
        numbers = " ".join(f"{part:.6g}" for part in np.round(axis, 12) + 0.0)
        typed = f'type="hinge" axis="{numbers}"'
        if self.model.jnt_limited[ball]:  # its range is not that of a hinge
            typed += ' limited="false"'
        return (
            f"{name_joint(self.model, ball)} is a ball joint, but the axes of the"
            f" hinges are parallel: a hinge in its place ({typed} in the file) moves"
            " alike and makes it a four-bar"
        )

    def _find_other_joint(self, chain: _Chain) -> str:
        words = {
            FREE_JOINT: f"floats freely{self._suggest_hinge(chain)}",
            BALL: f"is a ball joint: the loop is spatial ({_SERVE_SPATIAL})",
            SLIDE: f"is a slide: a slider-crank or of its kin ({_SERVE_PLANAR})",
        }
        for joint, kind in chain.others.items():
            inner = ""
            if kind == SLIDE and chain.hinges:
                inner = self._describe_inner_four_bar(chain, self._find_coupled(chain))
            return f"{name_joint(self.model, joint)} {words[kind]}{inner}"
        return ""

    def _suggest_hinge(self, chain: _Chain) -> str:
        """Say what to type for a body that floats between two pins.

        One of the pins becomes a hinge, and the other closes the loop. Three or more
        pins are loops of another kind, and the text is empty without a second one.
        """
        model = self.model
        floating = {int(model.jnt_bodyid[joint]) for joint in chain.others}
        pins = {}
        for pin in sorted([chain.number, *self._list_others(chain.number)]):
            ends = find_tied_bodies(model, pin)
            if self.is_pin(pin) and len(floating.intersection(ends)) == 1:
                pins[pin] = ends
        if len(floating) != 1 or len(pins) < 2:
            return ""
        if len(pins) > 2:
            return f" on {len(pins)} pins: several loops in one ({_SERVE_SPATIAL})"
        ((first, ends), (second, _)) = pins.items()
        (body,) = floating
        (holder,) = {*ends} - floating
        return (
            f": with {name_body(model, body)} inside {name_body(model, holder)}, on a"
            f" hinge in place of its free joint and of {self._name(first)},"
            f" {self._name(second)} closes the loop"
        )

    def _measure_axes(self, chain: _Chain) -> tuple[float | None, str]:
        """Return the largest angle between two hinges' axes, rad, and which two."""
        largest: float | None = None
        names = ""
        for pair in combinations(chain.hinges, 2):
            across = np.cross(*self.data.xaxis[[*pair]])
            angle = math.asin(min(1.0, float(np.linalg.norm(across))))
            if largest is None or angle > largest:
                largest = angle
                names = " and ".join(name_joint(self.model, joint) for joint in pair)
        return largest, names

    def _find_skew_axes(self, chain: _Chain) -> str:
        angle, names = self._measure_axes(chain)
        if angle is None or angle <= PARALLEL:
            return ""
        return (
            f"the axes of {names} are {math.degrees(angle):.3g} deg apart: "
            f"the loop is spatial ({_SERVE_SPATIAL})"
        )

    def _explain_count(self, chain: _Chain) -> str:
        """Say what another number of hinges makes, and what makes it a four-bar."""
        freedoms = chain.pins - 3
        count = f"{_spell_count(chain.pins)} hinge{'s' if chain.pins > 1 else ''}"
        if freedoms <= 0 and chain.is_pin:
            return f"{count} in a plane cannot move"
        if freedoms <= 0:
            return (
                f"a weld that leaves no freedom: {count} in a plane cannot move; a"
                ' <connect> or torquescale="0" makes a pin of it'
            )
        motors = self._list_motors(chain.joints)
        coupled = self._find_coupled(chain)
        holds = self._list_holds(chain, motors, coupled, freedoms - 1)
        if not holds:
            return self._explain_coupling(chain, coupled)
        text = f"{count} and {_spell_count(freedoms, 3)} freedoms"
        if len(motors) > 1:
            motor_names = ", ".join(self._name_motor(*motor) for motor in motors)
            text += f", driven by {len(motors)} motors ({motor_names})"
        first, *others = (",".join(hold) for hold in holds)
        text += f"; --hold {first}"
        if others:
            text += f" (or {' or '.join(others[:_MOST_HOLDS])})"
        return f"{text} makes it a four-bar"

    def _list_others(self, number: int, *further: str) -> list[int]:
        """List the other active connects and welds, and those of further kinds."""
        kinds = ("connect", "weld", *further)
        types = {n for n, kind in EQUALITY_KINDS.items() if kind in kinds}
        of_kinds = np.isin(self.model.eq_type, [*types]) & (self.model.eq_active0 != 0)
        return [other for other in np.flatnonzero(of_kinds).tolist() if other != number]

    def _find_coupled(self, chain: _Chain) -> list[_Chain]:
        """List the chains of other closures whose loops move the same bars.

        Loops that share bars with such a loop are among them.
        """
        others = [_Chain(self, other) for other in self._list_others(chain.number)]
        others = [other for other in others if not self._is_idle(other)]
        joints = {*chain.joints}
        coupled: list[_Chain] = []
        while more := [other for other in others if joints & {*other.joints}]:
            coupled += more
            others = [other for other in others if other not in more]
            joints.update(*(other.joints for other in more))
        return sorted(coupled, key=lambda other: other.number)

    def _list_holds(
        self,
        chain: _Chain,
        motors: list[tuple[int, int]],
        coupled: list[_Chain],
        count: int,
    ) -> list[tuple[str, ...]]:
        """List the joints to hold that leave a four-bar apart from other loops."""
        holdable = self._list_holdable(chain, motors)
        if len(holdable) < count:
            holdable = [*chain.joints]
        holds = []
        for held in combinations(holdable, count):
            moving = {*chain.joints} - {*held}
            if not any(moving & {*other.joints} for other in coupled):
                holds.append(tuple(name_joint(self.model, joint) for joint in held))
        return holds

    def _explain_coupling(self, chain: _Chain, coupled: list[_Chain]) -> str:
        """Say which linkage loops with common bars make."""
        joints = {*chain.joints}.union(*(other.joints for other in coupled))
        kinds = self.model.jnt_type[[*joints]]
        names = ", ".join(self._name(other.number) for other in coupled)
        moves = "moves" if len(coupled) == 1 else "move"
        if not coupled or not np.all(kinds == HINGE_JOINT):
            return f"{names} {moves} its bars too: no hold makes it a four-bar"
        taken = sum(2 if one.is_pin else 3 for one in (chain, *coupled))
        freedoms = len(joints) - taken
        bars = len(joints) + 1 - max(freedoms - 1, 0)
        which = NAMES_OF_LINKAGES.get(bars, f"a linkage of {bars} bars")
        if freedoms > 1:
            held = _spell_count(freedoms - 1, 3)
            which += f" once {held} of its freedoms is held"
        text = (
            f"with {names}, which {moves} its bars too, {len(joints)} hinges,"
            f" {len(coupled) + 1} loops and {_spell_count(freedoms, 3)}"
            f" {'freedom' if freedoms == 1 else 'freedoms'}: {which}"
            f" ({_SERVE_PLANAR})"
        )
        return text + self._describe_inner_four_bar(chain, coupled)

    def _describe_inner_four_bar(self, chain: _Chain, coupled: list[_Chain]) -> str:
        """Describe the four bars that a closure and three pins of others join, if any.

        The pins may be those of other closures.
        """
        model = self.model
        pins = dict[frozenset[int], Array]()
        connects = dict[frozenset[int], str]()
        hinges = {*chain.hinges}.union(*(other.hinges for other in coupled))
        for joint in hinges:
            across = np.cross(*self.data.xaxis[[joint, chain.hinges[0]]])
            if float(np.linalg.norm(across)) > math.sin(PARALLEL):
                continue
            parent = self.root[find_parent(model, int(model.jnt_bodyid[joint]))]
            pins[frozenset((self._find_root(joint), parent))] = self.data.xanchor[joint]
        for one in (*coupled, chain):
            ends = find_tied_bodies(model, one.number)
            first, last = (self.root[end] for end in ends)
            place, _ = find_ends(model, self.data, one.number)
            pins[frozenset((first, last))] = place
            connects[frozenset((first, last))] = self._name(one.number)
        of_others = {
            self._find_root(joint) for other in coupled for joint in other.joints
        }
        bars = {bar for pair in pins for bar in pair}
        for inner in permutations(bars - {first, last}, 2):
            cycle = [first, *inner, last]
            pairs = [frozenset(pair) for pair in pairwise([*cycle, first])]
            if not all(pair in pins for pair in pairs):
                continue
            places = [pins[pair] for pair in pairs]  # before and after each bar
            sizes = {
                bar: float(np.linalg.norm(places[i] - places[i - 1]))
                for i, bar in enumerate(cycle)
            }
            ground = cycle.index(min(cycle, key=lambda bar: len(climb(model, bar))))
            cycle = cycle[ground:] + cycle[:ground]
            if cycle[1] > cycle[3]:
                cycle[1:] = reversed(cycle[1:])
            names = [name_body(model, bar) for bar in cycle]
            shared = [name_body(model, bar) for bar in cycle[1:] if bar in of_others]
            if len(shared) == len(cycle) - 1:  # it is the four-bar of another closure
                continue
            lengths = ", ".join(write_length(sizes[bar]) for bar in cycle)
            text = (
                f"; {', '.join(names[1:])} on {names[0]} ({lengths} mm) are a"
                f" four-bar, but {', '.join(shared)} belongs to another loop too"
            )
            in_it = [connects[pair] for pair in pairs[:-1] if pair in connects]
            if in_it:
                text += (
                    f": to measure it make a hinge of {', '.join(in_it)} and a connect"
                    " of another joint of that loop"
                )
            return text
        return ""

    def _list_holdable(
        self,
        chain: _Chain,
        motors: list[tuple[int, int]],
    ) -> list[int]:
        """List the joints of a chain that may be held, the likeliest first.

        Joints without a motor may be held. Several motors hold: one of them is held
        while another moves. A spring holds its joint best.
        """
        driven = {joint for joint, _ in motors}
        several = len(driven) > 1
        joints = [joint for joint in chain.joints if (joint in driven) == several]

        def has_no_spring(joint: int) -> bool:
            return not self.model.jnt_stiffness[joint]

        return sorted(joints or chain.joints, key=has_no_spring)

    def _name_motor(self, joint: int, actuator: int) -> str:
        """Name an actuator: as the file does, or by the joint that it acts on."""
        name = self.model.actuator(actuator).name
        return name or f"on {name_joint(self.model, joint)}"

    def _find_bar(self, body: int, bars: set[int]) -> int | None:
        """Return the bar that carries a body, however far down, or None."""
        while body:
            if self.root[body] in bars:
                return self.root[body]
            body = find_parent(self.model, body)
        return None

    def _list_motors(self, joints: Sequence[int]) -> list[tuple[int, int]]:
        """List (joint, actuator) of what takes a control and acts on these joints."""
        return [motor for motor in list_motors(self.model) if motor[0] in joints]

    def _make_loop(self, chain: _Chain) -> RobotLoop:
        """Lay a closed chain of four pins out as ground, input, coupler and output."""
        number = chain.number
        joints: list[int | None] = [*chain.joints]
        groups: list[tuple[int, ...]]
        groups = [(bar,) for bar in chain.bars if bar is not None]
        if chain.is_pin:
            joints.append(None)
        else:  # its halves are one bar
            halves = {*groups[0], *groups.pop()}
            groups[0] = tuple(sorted(halves, key=lambda body: body != chain.ground))
        # group i lies between joint i - 1 and joint i
        at_ground = next(i for i, group in enumerate(groups) if chain.ground in group)
        groups = groups[at_ground:] + groups[:at_ground]
        joints = joints[at_ground:] + joints[:at_ground]
        # the ground lies between the joints at the end and at the beginning
        driven, remarks = self._choose_driven([joints[0], joints[-1]], chain)
        if driven != joints[0]:
            groups[1:] = reversed(groups[1:])
            joints.reverse()
        hinges: dict[str, int] = {}
        cut = None
        for pin, joint in zip(PINS, joints, strict=True):
            if joint is None:
                cut = pin
            else:
                hinges[pin] = joint
        bodies = dict(zip(ENDS, groups, strict=True))
        sides = {
            pin: 1.0 if self._find_root(joint) in bodies[PINS[pin][1]] else -1.0
            for pin, joint in hinges.items()
        }
        # about it the driven joint turns bar 2 counter-clockwise
        normal = sides["O2"] * find_mean_axis(self.data, hinges.values())
        places = self._locate_pins(number, bodies, hinges, cut)
        along = self._choose_along(normal, places[1, "O4"] - places[1, "O2"])

        def to_body(bar: int, vector: Array) -> Array:
            """Return a vector of the world in the frame of a bar's first body."""
            rotation = self.data.xmat[bodies[bar][0]].reshape(3, 3)
            return np.asarray(rotation.T @ vector)

        moving = set(hinges.values())
        loop = RobotLoop(
            name=self._name(number),
            equality=number,
            closures=(number,),
            cut=cut,
            bodies=bodies,
            ground=chain.ground_name,
            hinges=hinges,
            senses={
                pin: math.copysign(1.0, side * self.data.xaxis[hinges[pin]] @ normal)
                for pin, side in sides.items()
            },
            points={
                (bar, pin): to_body(bar, place - self.data.xpos[bodies[bar][0]])
                for (bar, pin), place in places.items()
            },
            axis=to_body(1, normal),
            along=to_body(1, along),
            misaligned=self._measure_axes(chain)[0] or 0.0,
            lines=(),
            stated_lines=(),
            qpos=self.data.qpos.copy(),
            held=tuple(j for j in range(self.model.njnt) if j not in moving),
            other_equalities=(),
        )
        loop = replace(
            loop,
            lines=tuple(map(LoopFrame(loop, self.data).line, ENDS)),
            stated_lines=tuple(map(LoopFrame(loop, self.before).line, ENDS)),
        )
        for length, (one, other) in zip(loop.lengths, ENDS.values(), strict=True):
            if length <= COINCIDENT_PINS * max(loop.lengths):
                raise _NoFourBarError(
                    f"pins {one} and {other} are in one place: a bar has no length"
                )
        closures, others = self._sort_equalities(loop)
        remarks += _describe_offset(self.posed, closures, loop, normal)
        return replace(
            loop,
            closures=closures,
            other_equalities=others,
            remarks=tuple(remarks),
        )

    def _find_root(self, joint: int) -> int:
        """Return the bar that a joint turns."""
        return self.root[int(self.model.jnt_bodyid[joint])]

    def _locate_pins(
        self,
        number: int,
        bodies: dict[int, tuple[int, ...]],
        hinges: dict[str, int],
        cut: str | None,
    ) -> dict[tuple[int, str], Array]:
        """Locate each pin on each of its bars, by bar and pin, (3,), m."""
        places = {
            (bar, pin): self.data.xanchor[joint].copy()
            for pin, joint in hinges.items()
            for bar in PINS[pin]
        }
        if cut is not None:
            tied = find_tied_bodies(self.model, number)
            ends = find_ends(self.model, self.data, number)
            for body, place in zip(tied, ends, strict=True):
                bar = next(b for b in PINS[cut] if self.root[body] in bodies[b])
                places[bar, cut] = place
        return places

    def _choose_along(self, normal: Array, line: Array) -> Array:
        """Return the unit vector x of a plane in world axes, (3,).

        The direction is across gravity unless the plane is level, else along the line
        of the ground.
        """
        gravity = self.model.opt.gravity
        in_plane = gravity - (gravity @ normal) * normal
        size = float(np.linalg.norm(in_plane))
        if size > LEVEL_PLANE * float(np.linalg.norm(gravity)) and size > 0.0:
            return np.asarray(np.cross(-in_plane / size, normal))
        line = line - (line @ normal) * normal
        length = float(np.linalg.norm(line))
        if length > 0.0:
            return np.asarray(line / length)
        return np.asarray(np.linalg.svd(normal[None])[2][1])

    def _choose_driven(
        self, ends: list[int | None], chain: _Chain
    ) -> tuple[int, list[str]]:
        """Return the driven hinge among those of the ground, and remarks.

        A remark says so if no motor decides.
        """
        model = self.model
        at_ground = [joint for joint in ends if joint is not None]
        if self.options.drive is not None:
            stated = find_joint(model, self.options.drive, "--drive")
            if stated in at_ground:
                return stated, []
        driven = [joint for joint, _ in self._list_motors(chain.joints)]
        if not driven:  # one that takes no control drives by a speed that it keeps
            driven = [joint for joint in at_ground if list_actuators(model, joint)]
        names = ", ".join(dict.fromkeys(name_joint(model, joint) for joint in driven))
        chosen = next((joint for joint in driven if joint in at_ground), None)
        if chosen is not None:
            if len(set(driven)) == 1:
                return chosen, []
            reason = f"motors act on {names}"
        else:
            pushed, by = self._find_pushed(at_ground, chain.number)
            # of the hinges without a sign the first of the file
            chosen = min(at_ground) if pushed is None else pushed
            reason = "no motor acts on it"
            if driven:
                reason = f"the motor on {names} acts between two moving bars"
            elif by:
                reason = f"{by} acts on it"
        taken = f"{name_joint(model, chosen)} is taken as driven"
        return chosen, [f"{reason}: {taken} (--drive states another)"]

    def _find_pushed(self, at_ground: list[int], number: int) -> tuple[int | None, str]:
        """Return the one hinge of the ground whose bar another closure moves.

        The closure's name follows; (None, "") if there is not exactly one such hinge.
        """
        hinge_of = {self._find_root(joint): joint for joint in at_ground}
        pushed = {
            hinge_of[self.root[body]]: self._name(other)
            for other in self._list_others(number)
            for body in find_tied_bodies(self.model, other)
            if self.root[body] in hinge_of and not self._is_idle(_Chain(self, other))
        }
        return next(iter(pushed.items())) if len(pushed) == 1 else (None, "")

    def _sort_equalities(
        self, loop: RobotLoop
    ) -> tuple[tuple[int, ...], tuple[int, ...]]:
        """Return the equalities of the closing pin, and others on moving bars."""
        bars = {root: bar for bar, roots in loop.bodies.items() for root in roots}
        moving = {root for root, bar in bars.items() if bar != 1}
        frame = LoopFrame(loop, self.data)
        closures = [loop.equality]
        others: list[int] = []
        for other in self._list_others(loop.equality, "joint"):
            equality = self.model.equality(other)
            if EQUALITY_KINDS[int(equality.type[0])] == "joint":
                tied = {int(equality.obj1id[0]), int(equality.obj2id[0])}
                if tied & {*loop.hinges.values()}:
                    others.append(other)
                continue
            ends = find_tied_bodies(self.model, other)
            carried = [self._find_bar(end, moving) for end in ends]
            numbers = [1 if root is None else bars[root] for root in carried]
            if numbers[0] == numbers[1]:
                continue
            if not all(self.root[end] in bars for end in ends):
                others.append(other)
                continue
            pin = _PIN_BETWEEN.get(frozenset(numbers))
            places = find_ends(self.model, self.data, other)
            if not (pin and self.is_pin(other) and _is_at(frame, pin, places)):
                raise _NoFourBarError(
                    f"{self._name(other)} holds two of its bars as well: no freedom is"
                    " left"
                )
            # beside a hinge a connect holds the same pin
            (closures if pin == loop.cut else others).append(other)
        return tuple(closures), tuple(others)


def _is_at(frame: LoopFrame, pin: str, ends: list[Array]) -> bool:
    """Tell whether both ends of another equality lie on the axis of a pin."""
    near = max(COINCIDENT_PINS * max(frame.loop.lengths), LARGEST_RESIDUAL)
    place = frame.locate(PINS[pin][0], pin)
    return all(
        float(np.linalg.norm(frame.in_plane(end - place))) <= near for end in ends
    )


def _describe_offset(
    posed: PosedRobot,
    closures: tuple[int, ...],
    loop: RobotLoop,
    normal: Array,
) -> list[str]:
    """Say how far the ends of a closure are apart along the axes, and what that costs.

    The list is empty where they lie in one plane.
    """
    offset, across, in_plane = find_offset(
        posed.model, posed.data.qpos, closures, normal
    )
    if offset <= COINCIDENT_PINS * max(loop.lengths):
        return []
    return [
        f"its ends are {write_length(offset)} mm apart along the axes, which no motion"
        f" closes: MuJoCo's constraint carries {across:.4g} N across the plane and"
        f" {in_plane:.4g} N in it, let go at rest in this pose"
    ]
