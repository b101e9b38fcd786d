"""The closures of a robot: from both bodies of each equality to their common ancestor.

A planar four-bar is three hinges with parallel axes on the way and a connect, which is
the fourth pin; or four hinges and a weld, which joins two halves of a bar. Bodies that
no joint parts, or a held one, are one bar.
"""

import math
from collections.abc import Iterator
from dataclasses import replace
from itertools import combinations, pairwise, permutations
from operator import itemgetter

import mujoco
import numpy as np

from fourbar.errors import InputError, write_count
from fourbar.linkage import ENDS, PINS
from fourbar.mjcf.model import write_six_digits
from fourbar.quantities import Array
from fourbar_validation.engines.mujoco.robots.ancestry import (
    EQUALITY_KINDS,
    climb,
    describe_actuator,
    find_bits,
    find_ends,
    find_named,
    find_roots,
    find_tied_bodies,
    list_actuators,
    list_closing,
    list_followers,
    list_joints_between,
    list_motors,
    list_tied_joints,
    name_body,
    name_joint,
    name_part,
    take_control,
)
from fourbar_validation.engines.mujoco.robots.drive import find_cylinder
from fourbar_validation.engines.mujoco.robots.loop_facts import (
    PoseOptions,
    RobotClosure,
    RobotFile,
    RobotLoop,
    RobotReport,
    round_off,
    write_length,
)
from fourbar_validation.engines.mujoco.robots.planes import (
    PARALLEL,
    copy_for_closures,
    find_mean_axis,
    find_normals,
    read_equality_force,
)
from fourbar_validation.engines.mujoco.robots.pose import (
    BALL,
    FREE_JOINT,
    HINGE_JOINT,
    LARGEST_RESIDUAL,
    SLIDE,
    PosedRobot,
    evaluate_kinematics,
    pose_robot,
)
from fourbar_validation.engines.mujoco.robots.seen import LoopFrame

_PIN_BETWEEN = {frozenset(bars): pin for pin, bars in PINS.items()}
"""Pins by the two bars that each joins."""
COINCIDENT_PINS = 1e-6
"""Two pins are one where they are nearer than this part of the longest bar."""
LEVEL_PLANE = 1e-6
"""Part of gravity below which a plane is level."""

JOINT_WORDS = {FREE_JOINT: "free", BALL: "ball", SLIDE: "slide"}
NAMES_OF_LINKAGES = {6: "a six-bar", 8: "an eight-bar"}
_SERVE_SPATIAL = "MuJoCo or Drake serve it, Pinocchio its inverse dynamics"
_SERVE_PLANAR = "MuJoCo or Drake serve it, PMKS+ for a sketch"
"""Tools for mechanisms that are no planar four-bar."""
PRINTED_AS_ZERO = 1e-12
"""m or deg; less is printed as 0."""
_MOST_HOLDS = 5
"""Further choices of joints to hold that are printed."""
_SWITCHED_OFF = 'it is switched off in the file (active="false", or a <flag>)'


def list_closures(
    file: RobotFile,
    options: PoseOptions,
    name: str | None = None,
) -> RobotReport:
    """Compile a robot's file, pose it, and describe each of its equalities.

    A name chooses one of them.
    """
    posed = pose_robot(file, options)
    return RobotReport(tuple(find_closures(posed, name)), posed.notes)


def find_closures(posed: PosedRobot, name: str | None = None) -> list[RobotClosure]:
    """Describe each equality of a posed robot, in the order of the file.

    A name chooses one of them.

    Raises
    ------
    InputError : a joint that is held or drives is none of the robot's, or drives no
        loop; no closure has the name.
    """
    finder = _Finder(posed)
    closures = [finder.describe(number) for number in range(posed.model.neq)]
    driven = [closure.loop.joint for closure in closures if closure.loop is not None]
    if posed.drive is not None and posed.drive not in driven:
        raise InputError(
            "--drive",
            name_joint(posed.model, posed.drive),
            "drives no four-bar: it must be a hinge of one, on its ground",
        )
    if name is None:
        return closures
    return [closures[find_named(finder.names, name, "closure", "--loop")]]


def find_loops(posed: PosedRobot, name: str | None) -> list[RobotLoop]:
    """Return the four-bars of a posed robot, or that of one closure.

    An InputError says why there is none. Of equalities that hold one pin together the
    first stands for all.
    """
    closures = find_closures(posed, name)
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
    """Return an equality's name, or the names of what it ties."""
    if model.equality(number).name:
        return str(model.equality(number).name)
    kind = EQUALITY_KINDS.get(model.eq_type[number])
    if kind is None:
        return f"equality {number}"
    tied = [one for one in find_tied_bodies(model, number) if one >= 0]
    part = kind if kind in ("joint", "tendon") else "body"
    return "-".join(name_part(model, part, one) for one in tied)


class _NoFourBarError(Exception):
    """A closure closes no planar four-bar; the message says why."""


class _Chain:
    """Joints from one end of a connect or weld to the other, and the bars between them.

    The chain leads over the common ancestor of both ends.
    """

    def __init__(self, finder: "_Finder", number: int) -> None:
        model = finder.model
        self.number = number
        self.name = finder.names[number]
        self.is_active = bool(model.eq_active0[number])
        self.is_pin = bool(
            model.eq_type[number] == mujoco.mjtEq.mjEQ_CONNECT
            or model.eq_data[number, 10] == 0.0  # a weld's torquescale
        )
        self.ends = find_tied_bodies(model, number)
        first, second = (climb(model, end) for end in self.ends)
        common = max({*first} & {*second})  # the one that is farthest from the world
        self.ground = finder.root[common]
        self.ground_name = name_body(model, common)
        joints = list_joints_between(model, *self.ends)
        self.joints = [joint for joint in joints if joint not in finder.held]
        self.bars = [finder.root[self.ends[0]]]
        """One more than joints."""
        for joint in self.joints:
            turned, bearer = finder.join(joint)
            self.bars.append(bearer if self.bars[-1] == turned else turned)
        types = {joint: int(model.jnt_type[joint]) for joint in self.joints}
        self.hinges = [one for one, kind in types.items() if kind == HINGE_JOINT]
        self.others = {one: types[one] for one in types if one not in self.hinges}
        """Type of each joint that is no hinge."""
        place, _ = find_ends(model, finder.data, number)
        arms = np.cross(place - finder.data.xanchor, finder.data.xaxis)
        away = np.linalg.norm(arms, axis=1) > LARGEST_RESIDUAL
        self.away = [one for one in self.joints if one in self.others or away[one]]
        """Its joints but the hinges on whose axis its closure lies."""
        axes = finder.data.xaxis
        skews = [
            (float(np.linalg.norm(np.cross(*axes[[*pair]]))), pair)
            for pair in combinations(self.hinges, 2)
        ]
        self.most_skew: tuple[int, ...]
        """The two hinges whose axes are farthest from parallel."""
        sine, self.most_skew = max(skews, key=itemgetter(0), default=(0.0, ()))
        self.skew = math.asin(min(sine, 1.0))
        """Angle between them, rad."""

    @property
    def is_idle(self) -> bool:
        """Tell whether its closure lies on the axes of all hinges, and holds none."""
        return self.is_pin and not self.away

    @property
    def pins(self) -> int:
        """Number of its joints, and of its closure if that is a pin."""
        return len(self.joints) + self.is_pin


class _Finder:
    """Four-bars of one posed model."""

    def __init__(self, posed: PosedRobot) -> None:
        self.posed = posed

        self.data = posed.data
        model = self.model = posed.model
        names = [describe_equality(model, number) for number in range(model.neq)]
        self.names = [
            f"{name}-{names[: number + 1].count(name)}"
            if names.count(name) > 1
            else name
            for number, name in enumerate(names)
        ]
        """Name of each equality, which no other has."""
        self.held = {*posed.held}
        self.root = find_roots(model, self.held)
        self.standing: dict[int, list[int]] = {}
        """Hinges that cannot turn, by the closure that holds them.

        A closure of two hinges that lies on the axis of one leaves this one free. The
        other hinge stands. Three pins of a triangle stand too, where joints are held.
        """
        for number in list_closing(model):
            chain = _Chain(self, number)
            is_of_two = chain.is_pin and len(chain.joints) == 2
            if (
                chain.is_active
                and is_of_two
                and (len(chain.away) == 1 or self._is_triangle(chain))
            ):
                self.standing[number] = chain.away
                self.held.update(chain.away)
        self.root = find_roots(model, self.held)
        self.chains = {one: _Chain(self, one) for one in list_closing(model)}
        self.normals = find_normals(model, self.data, self.held)
        self.before = evaluate_kinematics(model, posed.stated)

    def _is_triangle(self, chain: _Chain) -> bool:
        """Tell whether two parallel hinges, off each other and the closure, stand."""
        is_planar = len(chain.hinges) == len(chain.away) == 2 and chain.skew <= PARALLEL
        if not (self.posed.held and is_planar):
            return False
        first, second = self.data.xanchor[chain.hinges]
        arm = np.cross(first - second, self.data.xaxis[chain.hinges[0]])
        return math.hypot(*arm) > LARGEST_RESIDUAL

    def join(self, joint: int) -> tuple[int, int]:
        """Return the bar that a joint turns, and the one that bears it."""
        body = int(self.model.jnt_bodyid[joint])
        return self.root[body], self.root[self.model.body_parentid[body]]

    def describe(self, number: int) -> RobotClosure:
        """Describe one equality."""
        model = self.model
        kind = EQUALITY_KINDS.get(model.eq_type[number], "flex")
        loop = None
        reason = self._describe_mimic(number, kind)
        facts: list[str] = []
        if number in self.chains:
            chain = self.chains[number]
            reason = next(self._list_reasons(chain), "")
            if not reason:
                try:
                    loop = self._make_loop(chain)
                    other = self._make_loop(chain, from_other_end=True)
                    loop = replace(loop, from_other_end=other)
                except _NoFourBarError as error:
                    reason = str(error)
            facts += self._list_facts(chain, loop)
        facts.append(f"solref {write_six_digits(*model.eq_solref[number].tolist())}")
        facts.append(f"solimp {write_six_digits(*model.eq_solimp[number].tolist())}")
        name = self.names[number]
        what = kind if loop is not None else f"{kind}, no four-bar: {reason}"
        return RobotClosure(name, loop, reason, "; ".join([f"{name}: {what}", *facts]))

    def _list_facts(self, chain: _Chain, loop: RobotLoop | None) -> Iterator[str]:
        """Say what a chain is made of, and how far it is from closed and planar."""
        model = self.model
        yield f"ground {chain.ground_name}"
        if hinges := chain.hinges or self.standing.get(chain.number):
            yield f"hinges {', '.join(name_joint(model, one) for one in hinges)}"
        if chain.others:
            others = (
                f"{name_joint(model, joint)} ({JOINT_WORDS[kind]})"
                for joint, kind in chain.others.items()
            )
            yield f"other joints {', '.join(others)}"
        if loop is not None:
            yield loop.describe_lengths()
        if chain.most_skew:
            apart = math.degrees(chain.skew)
            yield f"axes {apart if apart > PRINTED_AS_ZERO else 0.0:.2g} deg apart"
        if chain.is_pin:
            first, second = find_ends(model, self.before, chain.number)
            normal = self.normals.get(chain.number, np.zeros(3))
            across = (first - second) @ normal
            gap = math.hypot(*(first - second - across * normal))
            yield f"gap {write_length(gap) if gap > PRINTED_AS_ZERO else 0} mm"

    def _describe_mimic(self, number: int, kind: str) -> str:
        """Write which joint follows which, by which polynomial."""
        model = self.model
        if not model.eq_active0[number]:
            return _SWITCHED_OFF
        followers = list_followers(model, number)
        if followers:
            joint, leader, numbers = followers[0]
            follower = name_joint(model, joint)
            polynomial = " ".join(f"{c + 0.0:.6g}" for c in numbers)
            advice = (
                "if it stands for a four-bar, write that by fourbar new SCENE --pins;"
                f" then check-mjcf SCENE FILE --mimic {follower} says what it loses"
            )
            if (model.jnt_type[[joint, leader]] == SLIDE).any():
                advice = "a slide is in it: no four-bar stands behind it"
            return (
                f"{follower} follows {name_joint(model, leader)}, polycoef "
                f"{polynomial}: no loop is closed ({advice})"
            )
        if kind == "tendon":
            return (
                "a tendon equality is no pin; where it stands for rods that are not in"
                " the file, a body for each, closed by a <connect>, makes loops of them"
            )
        if kind != "joint":
            return f"a {kind} equality is no pin"
        joint = int(model.eq_obj1id[number])
        rest = float(model.eq_data[number, 0])
        return f"{name_joint(model, joint)} is kept at {rest:.6g} of its rest"

    def _list_reasons(self, chain: _Chain) -> Iterator[str]:
        """Say why a closure closes no four-bar; the first reason counts."""
        if not chain.is_active:
            yield _SWITCHED_OFF
        if not chain.joints:
            stands = chain.number in self.standing
            why = "3 hinges in a plane cannot move"
            yield why if stands else "both ends are on one rigid body"
        if chain.is_idle:
            yield self._explain_idle(chain)
        model = self.model
        is_skew = chain.skew > PARALLEL
        is_four = chain.pins == len(PINS)
        if [*chain.others.values()] == [BALL] and is_four and not is_skew:
            yield self._explain_ball(chain)
        is_rigid = not chain.is_pin and chain.pins < len(PINS)
        if is_rigid and not is_skew and [*chain.others.values()] == [SLIDE]:
            yield self._explain_count(chain)
        for joint, kind in chain.others.items():
            if kind != SLIDE or not is_skew:  # a slider-crank lies in a plane
                yield f"{name_joint(model, joint)} {self._explain_joint(chain, kind)}"
        if is_skew:
            spatial = f"the loop is spatial ({_SERVE_SPATIAL})"
            places = self.data.xanchor[chain.hinges].round(6)
            if len(np.unique(places, axis=0)) < len(places):
                spatial += (
                    ", unless hinges in one place are a ball, and all else is parallel:"
                    " --hold those of the ball that turn across"
                )
            names = " and ".join(name_joint(model, one) for one in chain.most_skew)
            degrees = math.degrees(chain.skew)
            yield f"the axes of {names} are {degrees:.3g} deg apart: {spatial}"
        if not is_four:
            yield self._explain_count(chain)
        if len({*model.jnt_bodyid[chain.joints]}) < len(chain.joints):
            yield "two of its hinges are on one body: a bar has no body"

    def _explain_idle(self, chain: _Chain) -> str:
        """Say what a closure on the axes of its hinges holds."""
        names = ", ".join(name_joint(self.model, joint) for joint in chain.joints)
        text = f"it lies on the axis of {names} and leaves it free"
        if chain.number in self.standing:
            stands = name_joint(self.model, *self.standing[chain.number])
            text += f"; {stands} cannot turn by it, and counts as held"
        return text

    def _explain_ball(self, chain: _Chain) -> str:
        """Say what to type for one ball among hinges with parallel axes.

        Both ends of the bar that the ball carries stay in their planes, so that a hinge
        moves as the ball does.
        """
        model = self.model
        (ball,) = chain.others
        qpos = self.data.qpos.copy()
        of_ball = slice(model.jnt_qposadr[ball], model.jnt_qposadr[ball] + 4)
        qpos[of_ball] = model.qpos0[of_ball]
        rest = evaluate_kinematics(model, qpos)
        # a joint states its axis in the frame of its body
        turn = rest.xmat[model.jnt_bodyid[ball]].reshape(3, 3)
        axis = turn.T @ rest.xaxis[chain.hinges[0]]
        numbers = " ".join(f"{part:.6g}" for part in np.round(axis, 12) + 0.0)
        typed = f'type="hinge" axis="{numbers}"'
        if model.jnt_limited[ball]:  # its range is not that of a hinge
            typed += ' limited="false"'
        return (
            f"{name_joint(model, ball)} is a ball joint, but the axes of the"
            f" hinges are parallel: a hinge in its place ({typed} in the file) moves"
            " alike and makes it a four-bar"
        )

    def _explain_joint(self, chain: _Chain, kind: int) -> str:
        """Say what a joint of a chain that is no hinge makes of it."""
        if kind == FREE_JOINT:
            return f"floats freely{self._suggest_hinge(chain)}"
        if kind == BALL:
            return f"is a ball joint: the loop is spatial ({_SERVE_SPATIAL})"
        text = f"is a slide: a slider-crank or of its kin ({_SERVE_PLANAR})"
        coupled = self._find_coupled(chain)
        inner = self._describe_inner_four_bar(chain, coupled)
        return text + (self._suggest_holds(chain, coupled) or inner)

    def _suggest_hinge(self, chain: _Chain) -> str:
        """Say what to type for a body that floats between two pins.

        One of the pins becomes a hinge, and the other closes the loop. Three or more
        pins are loops of another kind, and the text is empty without a second one.
        """
        model = self.model
        free = [joint for joint, kind in chain.others.items() if kind == FREE_JOINT]
        floating = {int(model.jnt_bodyid[joint]) for joint in free}
        pins = [
            one
            for one in self.chains.values()
            if (one is chain or one.is_active)
            and one.is_pin
            and len(floating.intersection(one.ends)) == 1
        ]
        if len(floating) != 1 or len(pins) < 2:
            return ""
        if len(pins) > 2:
            return f" on {len(pins)} pins: several loops in one ({_SERVE_SPATIAL})"
        first, second = pins
        (body,) = floating
        (holder,) = {*first.ends} - floating
        return (
            f": with {name_body(model, body)} inside {name_body(model, holder)}, on a"
            f" hinge in place of its free joint and of {first.name},"
            f" {second.name} closes the loop"
        )

    def _explain_count(self, chain: _Chain) -> str:
        """Say what another number of hinges makes, or a weld of few joints.

        What would make it a four-bar is said too.
        """
        freedoms = chain.pins - 3
        count = write_count(chain.pins, "joint" if chain.others else "hinge")
        if freedoms <= 0:
            text = f"{count} in a plane cannot move"
            if not chain.is_pin:
                text = f"a weld that leaves no freedom: {text}"
                if freedoms == 0:
                    text += '; a <connect> or torquescale="0" makes a pin of it'
            return text
        coupled = self._find_coupled(chain)
        holds = self._suggest_holds(chain, coupled)
        if not holds and coupled:
            return self._explain_coupling(chain, coupled)
        text = f"{count} and {write_count(freedoms, 'freedom')}"
        return text + (holds or ": no hold makes it a four-bar")

    def _find_coupled(self, chain: _Chain) -> list[_Chain]:
        """List the other closures whose loops move the same bars.

        Loops that share bars with such a loop are among them.
        """
        others = [
            one
            for one in self.chains.values()
            if one.is_active and one is not chain and not one.is_idle
        ]
        joints = {*chain.joints}
        coupled: list[_Chain] = []
        while more := [other for other in others if joints & {*other.joints}]:
            coupled += more
            others = [other for other in others if other not in more]
            joints.update(*(other.joints for other in more))
        return sorted(coupled, key=lambda other: other.number)

    def _suggest_holds(self, chain: _Chain, coupled: list[_Chain]) -> str:
        """Name the joints to hold that leave a four-bar apart from other loops, if any.

        The likeliest come first. Joints without a motor may be held, and slides.
        Several motors hold: one of them is held while another moves. A spring holds its
        joint best.
        """
        count = max(chain.pins - len(PINS), 0)
        driven = {*list_motors(self.model)}.intersection(chain.joints)
        several = len(driven) > 1
        hinges = [one for one in chain.hinges if (one in driven) == several]
        stiffness = self.model.jnt_stiffness
        hinges = sorted(hinges or chain.hinges, key=lambda one: not stiffness[one])
        holdable = [*chain.others, *hinges]
        if len(holdable) < count:
            holdable = chain.joints
        taken = {joint for other in coupled for joint in other.joints}
        holds: list[str] = []
        for held in combinations(holdable, count):
            free = {*chain.joints} - {*held}
            if free & chain.others.keys() or free & taken or len(holds) > _MOST_HOLDS:
                continue
            posed = replace(self.posed, held=self.posed.held.union(held))
            if _Finder(posed).describe(chain.number).loop is not None:
                holds.append(",".join(name_joint(self.model, joint) for joint in held))
        if not holds:
            return ""
        others = f" (or {' or '.join(holds[1:])})" if holds[1:] else ""
        return f"; --hold {holds[0]}{others} makes it a four-bar"

    def _explain_coupling(self, chain: _Chain, coupled: list[_Chain]) -> str:
        """Say which linkage loops with common bars make."""
        joints = {*chain.joints}.union(*(other.joints for other in coupled))
        kinds = self.model.jnt_type[[*joints]]
        names = ", ".join(other.name for other in coupled)
        moves = "moves" if len(coupled) == 1 else "move"
        if not np.all(kinds == HINGE_JOINT):
            return f"{names} {moves} its bars too: no hold makes it a four-bar"
        taken = sum(2 if one.is_pin else 3 for one in (chain, *coupled))
        freedoms = len(joints) - taken
        bars = len(joints) + 1 - max(freedoms - 1, 0)
        which = NAMES_OF_LINKAGES.get(bars, f"a linkage of {bars} bars")
        if freedoms > 1:
            which += f" once {freedoms - 1} of its freedoms is held"
        text = (
            f"with {names}, which {moves} its bars too, {len(joints)} hinges,"
            f" {len(coupled) + 1} loops and {write_count(freedoms, 'freedom')}: {which}"
            f" ({_SERVE_PLANAR})"
        )
        return text + self._describe_inner_four_bar(chain, coupled)

    def _describe_inner_four_bar(self, chain: _Chain, coupled: list[_Chain]) -> str:
        """Describe the four bars that a closure and three pins of others join, if any.

        The pins may be those of other closures.
        """
        model = self.model
        loops = (*coupled, chain)
        hinges = {joint for one in loops for joint in one.hinges}
        pins: dict[frozenset[int], Array] = {}
        """Place of what joins two bars."""
        for joint in hinges:
            across = np.cross(*self.data.xaxis[[joint, min(hinges)]])
            if math.hypot(*across) <= math.sin(PARALLEL):
                pins[frozenset(self.join(joint))] = self.data.xanchor[joint]
        for one in loops:
            first, last = (self.root[end] for end in one.ends)
            pins[frozenset((first, last))], _ = find_ends(model, self.data, one.number)
        moved = {self.join(joint)[0] for one in coupled for joint in one.joints}
        bars = frozenset[int]().union(*pins)
        for inner in permutations(bars - {first, last}, 2):
            cycle = [first, *inner, last]
            ground = cycle.index(min(cycle, key=lambda bar: len(climb(model, bar))))
            cycle = cycle[ground:] + cycle[:ground]
            if cycle[1] > cycle[3]:
                cycle[1:] = reversed(cycle[1:])
            pairs = [frozenset(pair) for pair in pairwise([*cycle, cycle[0]])]
            shared = [name_body(model, bar) for bar in cycle[1:] if bar in moved]
            # all of them: it is the four-bar of another closure
            if len(shared) == len(cycle) - 1 or not pins.keys() >= {*pairs}:
                continue
            names = [name_body(model, bar) for bar in cycle]
            places = np.array([pins[pair] for pair in pairs])  # behind each bar
            sizes = np.linalg.norm(places - np.roll(places, 1, axis=0), axis=1)
            lengths = ", ".join(map(write_length, sizes))
            return (
                f"; {', '.join(names[1:])} on {names[0]} ({lengths} mm) are a"
                f" four-bar, but {', '.join(shared)} belongs to another loop too"
            )
        return ""

    def _list_pulling(self, chain: _Chain) -> list[int]:
        """List the motors that move joints of a chain."""
        model = self.model
        data = self.data
        mujoco.mj_tendon(model, data)
        mujoco.mj_transmission(model, data)
        pulls = np.zeros((model.nu, model.nv))
        places = (data.moment_rownnz, data.moment_rowadr, data.moment_colind)
        mujoco.mju_sparse2dense(pulls, data.actuator_moment, *places)
        dofs = model.jnt_dofadr[chain.joints]
        pulling = pulls[:, dofs].any(axis=1) & take_control(model)
        return [*map(int, np.flatnonzero(pulling))]

    def _make_loop(self, chain: _Chain, *, from_other_end: bool = False) -> RobotLoop:
        """Lay a closed chain of four pins out as ground, input, coupler and output.

        About the normal of its plane the driven joint turns its bar counter-clockwise.
        `from_other_end`: the input is the bar that the driven joint does not turn.
        """
        data = self.data
        joints: list[int | None] = [*chain.joints]
        groups: list[tuple[int, ...]]
        groups = [(bar,) for bar in chain.bars]
        if chain.is_pin:
            joints.append(None)
        else:  # its halves are one bar
            halves = {*groups[0], *groups.pop()}
            groups[0] = tuple(sorted(halves, key=lambda body: body != chain.ground))
        # group i lies between joint i - 1 and joint i
        at_ground = chain.bars.index(chain.ground) % len(groups)
        groups = groups[at_ground:] + groups[:at_ground]
        joints = joints[at_ground:] + joints[:at_ground]
        # the ground lies between the joints at the end and at the beginning
        driven, chosen = self._choose_driven([joints[0], joints[-1]], chain)
        if (driven != joints[0]) != from_other_end:
            groups[1:] = reversed(groups[1:])
            joints.reverse()
        at_pins = zip(PINS, joints, strict=True)
        hinges = {pin: joint for pin, joint in at_pins if joint is not None}
        cut = next((pin for pin in PINS if pin not in hinges), None)
        bodies = dict(zip(ENDS, groups, strict=True))
        held = {*range(self.model.njnt)} - {*hinges.values()}
        roots = find_roots(self.model, held)
        of_root = {roots[body]: bar for bar in bodies for body in bodies[bar]}
        bars = tuple(map(of_root.get, roots))
        normal = find_mean_axis(data, hinges.values())
        turns_ground = bars[self.join(driven)[0]] == 1
        if (data.xaxis[driven] @ normal > 0.0) == turns_ground:
            normal = -normal
        senses = {}
        for pin, joint in hinges.items():
            turned, _ = self.join(joint)
            side = 1.0 if bars[turned] == PINS[pin][1] else -1.0
            senses[pin] = math.copysign(1.0, side * data.xaxis[joint] @ normal)
        loop = RobotLoop(
            name=chain.name,
            equality=chain.number,
            closures=(chain.number,),
            cut=cut,
            bodies=bodies,
            bars=bars,
            ground=chain.ground_name,
            hinges=hinges,
            senses=senses,
            cut_bars=tuple(bars[end] for end in chain.ends),
            axes=np.eye(3),
            misaligned=chain.skew,
            qpos=data.qpos.copy(),
            held=tuple(sorted(held)),
        )
        loop = replace(loop, axes=self._choose_axes(loop, normal))
        _, stated = LoopFrame(loop, self.before).measure_bars()
        lengths, angles = LoopFrame(loop, data).measure_bars()
        met = tuple(map(round_off, lengths))
        loop = replace(
            loop, lengths=lengths, met=met, angles=angles, stated_angles=stated
        )
        for length, (one, other) in zip(loop.lengths, ENDS.values(), strict=True):
            if length <= COINCIDENT_PINS * max(loop.lengths):
                raise _NoFourBarError(
                    f"pins {one} and {other} are in one place: a bar has no length"
                )
        longest = max(loop.lengths)
        if sum(loop.lengths) - 2.0 * longest <= COINCIDENT_PINS * longest:
            raise _NoFourBarError(
                "its longest bar reaches as far as the other three together"
                f" ({loop.describe_lengths()}), or farther: it cannot move; an anchor"
                " is taken in the rest pose, so if the loop is open there, state the"
                " pin by two sites"
            )
        closures, others = self._sort_equalities(loop)
        remarks = self._describe_offset(closures, loop, normal)
        loop = replace(
            loop,
            closures=closures,
            other_equalities=others,
            chosen=tuple(chosen),
            remarks=tuple(remarks),
        )
        cylinder = find_cylinder(self.model, loop)
        if chosen and cylinder and cylinder == self._list_pulling(chain):
            return self._drive_by(loop, *cylinder)
        return loop

    def _drive_by(self, loop: RobotLoop, cylinder: int) -> RobotLoop:
        """Return a loop that a cylinder drives in place of a couple."""
        by = describe_actuator(self.model, cylinder)
        hinge = name_joint(self.model, loop.joint)
        text = f"{by} drives it as a cylinder (--drive {hinge} states a couple)"
        return replace(loop, chosen=(text,), cylinder=cylinder)

    def _choose_axes(self, loop: RobotLoop, normal: Array) -> Array:
        """Return x, y and the normal of a loop's plane in the frame of its ground.

        x is across gravity unless the plane is level, else along the line of the
        ground.
        """
        gravity = self.model.opt.gravity
        along = np.cross(normal, gravity)
        if math.hypot(*along) <= LEVEL_PLANE * math.hypot(*gravity):
            frame = LoopFrame(loop, self.data)
            line = frame.locate(1, "O4") - frame.locate(1, "O2")
            along = line - (line @ normal) * normal
        along = along / (math.hypot(*along) or 1.0)
        ground = self.data.xmat[loop.bodies[1][0]].reshape(3, 3)
        axes = np.array([along, np.cross(normal, along), normal])
        return np.asarray(axes @ ground)

    def _choose_driven(
        self, ends: list[int | None], chain: _Chain
    ) -> tuple[int, list[str]]:
        """Return the driven hinge among those of the ground, and remarks.

        A remark says so if no motor decides.
        """
        model = self.model
        at_ground = [joint for joint in ends if joint is not None]
        for joint in at_ground:
            if joint == self.posed.drive:
                return joint, []
        driven = [joint for joint in list_motors(model) if joint in chain.joints]
        if not driven:  # one that takes no control drives by a speed that it keeps
            driven = [joint for joint in at_ground if list_actuators(model, joint)]
        names = ", ".join(dict.fromkeys(name_joint(model, joint) for joint in driven))
        chosen = next((joint for joint in driven if joint in at_ground), None)
        reason = f"motors act on {names}"
        if chosen is None:
            chosen = min(at_ground)  # the first of the file
            reason = "no motor acts on it"
            if driven:
                reason = f"the motor on {names} acts between two moving bars"
            elif pulling := self._list_pulling(chain):
                names = ", ".join(describe_actuator(model, one) for one in pulling)
                reason = (
                    f"what drives it is on no hinge ({names}), and a couple gives other"
                    " pin forces ([drive] from and to of a SCENE state a cylinder)"
                )
        elif len({*driven}) == 1:
            return chosen, []
        taken = f"{name_joint(model, chosen)} is taken as driven"
        return chosen, [f"{reason}: {taken} (--drive states another)"]

    def _sort_equalities(
        self, loop: RobotLoop
    ) -> tuple[tuple[int, ...], tuple[int, ...]]:
        """Return the equalities of the closing pin, and others on moving bars."""
        model = self.model
        rigid = {*sum(loop.bodies.values(), ())}
        frame = LoopFrame(loop, self.data)
        nearest = max(COINCIDENT_PINS * max(loop.lengths), LARGEST_RESIDUAL)
        closures = [loop.equality]
        others: list[int] = []
        for number in np.flatnonzero(model.eq_active0).tolist():
            tied = list_tied_joints(model, number)
            if number == loop.equality or tied.isdisjoint(loop.hinges.values()):
                continue
            if number not in self.chains:
                others.append(number)
                continue
            chain = self.chains[number]
            numbers = frozenset(loop.bars[end] or 1 for end in chain.ends)
            if len(numbers) == 1:
                continue
            if not all(self.root[end] in rigid for end in chain.ends):
                others.append(number)
                continue
            pin = _PIN_BETWEEN.get(numbers, "")
            near = False
            if pin and chain.is_pin:
                bar, _ = PINS[pin]
                ends = find_ends(model, self.data, number)
                away = (ends - frame.locate(bar, pin)) @ frame.axes.T
                near = np.linalg.norm(away, axis=1).max() <= nearest
            if not near:
                raise _NoFourBarError(
                    f"{chain.name} holds two of its bars as well: no freedom is left"
                )
            # beside a hinge a connect holds the same pin
            (closures if pin == loop.cut else others).append(number)
        return tuple(closures), tuple(others)

    def _describe_offset(
        self, closures: tuple[int, ...], loop: RobotLoop, normal: Array
    ) -> list[str]:
        """Say how far the ends of a closure are apart along the axes, and its cost.

        The list is empty where they lie in one plane.
        """
        ends = (find_ends(self.model, self.data, number) for number in closures)
        offset = max(abs(float((first - second) @ normal)) for first, second in ends)
        if offset <= COINCIDENT_PINS * max(loop.lengths):
            return []
        alone = copy_for_closures(self.model, closures)
        alone.opt.disableflags |= find_bits("frictionloss")
        data = mujoco.MjData(alone)
        data.qpos[:] = self.data.qpos
        mujoco.mj_forward(alone, data)
        total = np.sum([read_equality_force(data, one) for one in closures], axis=0)
        across = float(total @ normal)
        in_plane = math.hypot(*(total - across * normal))
        return [
            f"its ends are {write_length(offset)} mm apart along the axes, which no"
            " motion closes: MuJoCo's constraint carries"
            f" {abs(across):.4g} N across the plane and {in_plane:.4g} N in it, let go"
            " at rest in this pose"
        ]
