"""An equality by whose polynomial one joint of a robot's file follows another."""

import cmath
import math
from collections.abc import Iterable, Iterator
from dataclasses import replace
from itertools import chain

import mujoco
import numpy as np

from fourbar.errors import InputError
from fourbar.linkage import BAR_NAMES, Bar, record
from fourbar.quantities import Array
from fourbar.scene import Scene, command
from fourbar_validation.engines.mujoco.robots.ancestry import (
    Follower,
    find_roots,
    list_followers,
    name_joint,
)
from fourbar_validation.engines.mujoco.robots.loop_facts import RobotFile, write_length
from fourbar_validation.engines.mujoco.robots.loop_scene import is_seen_from_behind
from fourbar_validation.engines.mujoco.robots.pose import (
    HINGE_JOINT,
    compile_robot,
    evaluate_kinematics,
    find_joint,
)

_SAME_LENGTH = 1e-3
"""Relative difference of a length in a file from that in a scene: files state three or
four digits.
"""
_SAME_ANGLE = 1e-3
"""rad; files state angles with three or four digits."""
_SAME_CENTRE = 0.05
"""Relative difference of a mass centre's distance: files state two digits."""


@record
class JointEquality:
    """The position of a joint as a polynomial of that of another.

    y - y0 = a0 + a1 (x - x0) + ... + a4 (x - x0)^4, with x of the leader and y of the
    follower.
    """

    follower: str
    leader: str
    coefficients: tuple[float, ...]
    """a0 to a4."""
    leader_zero: float
    """x0, rad: the leader in the rest pose of the file."""
    sense: float
    """+1 if both joints turn about the same direction, -1 if about opposite ones."""
    theta_2: float
    """theta_2 of the scene in the rest pose, rad; NaN where the file does not tell
    where the input or the ground ends.
    """
    follower_zero: float
    """Angle of the follower's bar against its bearer in the rest pose, rad; NaN where
    the file does not tell it.
    """
    side: float
    """+1 if theta_2 grows with the leader, -1 if it falls."""
    is_side_told: bool
    """False where +1 is assumed."""
    bars: tuple[int, int]
    """Bar that the follower turns, and the one that it turns against: 1 to 4."""
    limits: tuple[float, float] | None
    """Range of the leader in the file, rad; None where it has none."""
    remark: str
    """Length of the bearer that is another in the scene; empty if it is the same."""

    @property
    def swing(self) -> tuple[float, float] | None:
        """Range of theta_2 by the leader's limits, rad; None if it is not known."""
        if self.limits is None or math.isnan(self.theta_2):
            return None
        ends = [self.side * (end - self.leader_zero) for end in self.limits]
        return self.theta_2 + min(ends), self.theta_2 + max(ends)


def read_joint_equality(
    file: RobotFile,
    name: str,
    scene: Scene,
    theta_2: float | None = None,
) -> JointEquality:
    """Read the equality by which a joint follows another, in the loop of a scene.

    The leader turns the input. The tree of bodies tells which bars the follower joins.
    Where the bars point in the rest pose is read from what the file has at their ends,
    or from their mass centres.

    Parameters
    ----------
    theta_2 : in the rest pose, rad; it wins over what is read.

    Raises
    ------
    InputError : no such joint, no equality by which it follows, or a joint that is no
        hinge.
    """
    model = compile_robot(file).model
    joint = find_joint(model, name, "--mimic")
    for number in range(model.neq):
        for tie in list_followers(model, number):
            if tie.joint == joint:
                return _RestPose(model, tie, scene).describe(theta_2)
    needed = {
        "MJCF": f'active <joint joint1="{name}" joint2="..."> and no active equality'
        " of a fixed tendon over it and one other joint"
    }.get(file.kind, f"<mimic> in its {name}")
    raise InputError(
        "--mimic", name, f"follows no other joint: the file has no {needed}"
    )


class _RestPose:
    """Rest pose of a file in which one hinge of a scene's loop follows another."""

    def __init__(self, model: mujoco.MjModel, tie: Follower, scene: Scene) -> None:
        self.model = model
        self.tie = tie
        self.scene = scene
        for joint in (tie.joint, tie.leader):
            if model.jnt_type[joint] != HINGE_JOINT:
                raise InputError(
                    "--mimic",
                    name_joint(model, joint),
                    "is no hinge: both must be hinges",
                )
        self.data = evaluate_kinematics(model, model.qpos0)
        self.roots = find_roots(model, set())
        self.axes = np.zeros((2, 3))
        """x along the ground and y in the plane, (2, 3), once the ground is found."""

    def describe(self, stated: float | None) -> JointEquality:
        """Describe the equality, with the angles of the rest pose and the side."""
        model = self.model
        linkage = self.scene.linkage
        follower, leader, coefficients = self.tie
        sense = math.copysign(1.0, self.data.xaxis[follower] @ self.data.xaxis[leader])
        bars = self._find_bars(follower)
        remark = self._compare_length(follower, bars[1])
        # angles of the bars from the ground's line, seen from the tip of the axis
        angles = [0.0, math.nan, math.nan, math.nan]
        turn = 0.0
        rocker = self._find_rocker()
        if rocker is not None:
            angles[1] = self._find_angle(leader, linkage.input)
            if not math.isnan(angles[1]):  # else the side of the scene is not known
                angles[3] = self._find_angle(rocker, linkage.output)
            if bars == (3, 2):
                angles[2] = self._find_angle(follower, linkage.coupler)
            if rocker == follower:
                # the equality turns the output while the leader is at its zero
                turn = sense * coefficients[0]
        low, high = model.jnt_range[leader].tolist()
        limits = (low, high) if model.jnt_limited[leader] else None
        zero_is_told = 3 in bars or rocker == follower

        def see(side: float) -> JointEquality:
            """Describe the equality as it is seen from the tip, +1, or from behind."""
            _, *theta = linkage.ground_angle + side * np.array(angles)
            turned, bearer = ([0.0, *theta][bar - 1] for bar in bars)
            return JointEquality(
                name_joint(model, follower),
                name_joint(model, leader),
                coefficients,
                float(model.qpos0[model.jnt_qposadr[leader]]),
                sense,
                float(theta[0]),
                float(turned - bearer) if zero_is_told else math.nan,
                side,
                True,
                bars,
                limits,
                remark,
            )

        ways = (see(1.0), see(-1.0))
        posed = (*angles[:3], angles[3] + turn)
        tip, behind = (self._list_evidence(way, posed, stated) for way in ways)
        is_told = tip != behind or (stated is None and math.isnan(angles[1]))
        seen = replace(ways[behind > tip], is_side_told=is_told)
        return seen if stated is None else replace(seen, theta_2=stated)

    def _find_bars(self, follower: int) -> tuple[int, int]:
        """Return the bar that a follower turns, and the bar that bears it."""
        model = self.model
        roots = self.roots
        crank = model.jnt_bodyid[self.tie.leader]
        ground = roots[model.body_parentid[crank]]
        bearer = roots[model.body_parentid[model.jnt_bodyid[follower]]]
        if bearer == crank:
            return 3, 2
        if bearer == ground:
            return 4, 1
        if roots[model.body_parentid[bearer]] == crank:
            return 4, 3
        return 3, 4

    def _find_line(self, joint: int, other: int) -> tuple[Array, float]:
        """Return the way between two hinges and its length, (3,) and a number, m.

        The part along the leader's axis is left out.
        """
        normal = self.data.xaxis[self.tie.leader]
        line = self.data.xanchor[joint] - self.data.xanchor[other]
        line -= normal * (normal @ line)
        return line, math.hypot(*line)

    def _compare_length(self, follower: int, bearer: int) -> str:
        """Say that the hinges of the follower's bearer are not those of the scene."""
        model = self.model
        other = self.tie.leader
        if bearer > 1:
            body = self.roots[model.body_parentid[model.jnt_bodyid[follower]]]
            other = model.body_jntadr[body]
        if other < 0:  # it hangs on the world, beside the ground of the scene
            return ""
        _, length = self._find_line(follower, other)
        in_scene = self.scene.linkage.lengths[bearer - 1]
        if _is_same_number(length, in_scene):
            return ""
        return (
            f"the {BAR_NAMES[bearer]} of the scene is {write_length(in_scene)} mm long,"
            f" but {name_joint(model, follower)} is {write_length(length)} mm from"
            f" {name_joint(model, other)} in the file"
        )

    def _find_rocker(self) -> int | None:
        """Find the hinge that bears the output on the ground, and take its axes.

        The follower itself is the first that may be, then all joints that follow the
        same leader.
        """
        model = self.model
        follower, leader, _ = self.tie
        ties = chain.from_iterable(list_followers(model, n) for n in range(model.neq))
        joints = [follower, *(tie.joint for tie in ties if tie.leader == leader)]
        normal = self.data.xaxis[leader]
        for joint in joints:
            line, length = self._find_line(joint, leader)
            is_ground = _is_same_number(length, self.scene.linkage.lengths[0])
            if is_ground and self._find_bars(joint) == (4, 1):
                x = line / length
                self.axes = np.array([x, np.cross(normal, x)])
                return joint
        return None

    def _list_evidence(
        self, seen: JointEquality, angles: tuple[float, ...], stated: float | None
    ) -> tuple[bool, ...]:
        """Tell by what a side is that of the scene; what comes first decides.

        First comes the stated or the drawn theta_2, then the scene's output, and last
        the leader's range that meets the scene's. `angles`: theta_1 to theta_4 in the
        file, seen from the tip, rad, NaN if it does not tell them.
        """
        scene = self.scene
        shown = stated
        if shown is None and scene.drawing is not None:
            shown = scene.drawing.angle(2)
        meets = False
        if seen.swing is not None:
            theta_2 = command(scene).theta_2
            ranges = np.array([seen.swing, (theta_2.min(), theta_2.max())])
            first, second = ranges.mean(axis=1)
            # they share an angle modulo turns
            apart = abs(math.remainder(first - second, math.tau))
            meets = bool(apart <= np.ptp(ranges, axis=1).mean())
        return (
            shown is not None and is_same_angle(seen.theta_2, shown),
            is_seen_from_behind(scene, [-seen.side * angle for angle in angles]),
            meets,
        )

    def _find_angle(self, joint: int, bar: Bar) -> float:
        """Return the angle of a bar from its hinge to its other pin, rad.

        The pin is what lies at the length of the bar: a hinge, else a site, else the
        end of a capsule or cylinder. Else a mass centre as far from the hinge as that
        of the scene tells the line, if the scene has it on the line. NaN if there is
        nothing, or if it lies in several directions.
        """
        body = self.model.jnt_bodyid[joint]

        def locate(place: Array) -> complex:
            return complex(*(self.axes @ (place - self.data.xanchor[joint])))

        for places in self._list_places(body):
            arms = map(locate, places)
            angles = [
                cmath.phase(arm)
                for arm in arms
                if _is_same_number(abs(arm), bar.length)
            ]
            if angles:
                first = angles[0]
                spread = [abs(math.remainder(one - first, math.tau)) for one in angles]
                return first if max(spread) <= _SAME_LENGTH else math.nan
        distance, turn = bar.centre or (0.5 * bar.length, 0.0)
        arm = locate(self.data.xipos[body])
        is_centre = math.isclose(abs(arm), distance, rel_tol=_SAME_CENTRE)
        is_told = is_centre and turn == 0.0 and distance
        return cmath.phase(arm) if is_told else math.nan

    def _list_places(self, body: int) -> Iterator[Iterable[Array]]:
        """Yield the hinges of the bodies on a body, its sites, the ends of its rods."""
        model = self.model
        data = self.data
        on_body = model.body_parentid[model.jnt_bodyid] == body
        yield data.xanchor[on_body & (model.jnt_type == HINGE_JOINT)]
        yield data.site_xpos[model.site_bodyid == body]
        ends = []
        rods = (mujoco.mjtGeom.mjGEOM_CAPSULE, mujoco.mjtGeom.mjGEOM_CYLINDER)
        for number in np.flatnonzero(model.geom_bodyid == body):
            if model.geom_type[number] in rods:
                axis = data.geom_xmat[number].reshape(3, 3)[:, 2]
                reach = model.geom_size[number, 1] * axis
                middle = data.geom_xpos[number]
                ends += [middle - reach, middle + reach]
        yield ends


def is_same_angle(one: float, other: float) -> bool:
    """Tell whether two angles are the same but for whole turns and what is rounded."""
    return abs(math.remainder(one - other, math.tau)) <= _SAME_ANGLE


def _is_same_number(one: float, other: float) -> bool:
    return math.isclose(one, other, rel_tol=_SAME_LENGTH)
