"""A scene from a loop of a robot: lengths, masses, effects and range, in the pose.

Everything else is held. What hangs on a bar by other joints is held as it stands and
counts with its mass. Lengths are read within the digits of the file. What a scene
cannot hold is named with its size.
"""

import cmath
import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from decimal import Decimal

import mujoco
import numpy as np

from fourbar.effects import (
    Effect,
    Flywheel,
    Friction,
    Gravity,
    LinearDrive,
    Load,
    Torsion,
    Viscous,
)
from fourbar.effects.place import Place
from fourbar.errors import InputError
from fourbar.formulas.mobility import (
    DIGITS_STATED,
    choose_range,
    count_equalities,
    list_met_equalities,
    meet_change_points,
    turns_fully,
)
from fourbar.linkage import BAR_NAMES, MOVING_BARS, PINS, Bar, FourBar, Lengths
from fourbar.mjcf.model import write_six_digits
from fourbar.quantities import Array
from fourbar.scene import Scene, command, find_signs
from fourbar.scene.motion import BRANCH_NAMES, OPEN, Motion, Sweep
from fourbar.show.panels import split_runs
from fourbar_validation.engines.free_body_closure import close
from fourbar_validation.engines.mujoco.robots.ancestry import (
    climb,
    describe_actuator,
    find_tied_bodies,
    is_enabled,
    list_actuators,
    list_lifted_masses,
    list_wraps,
    name_body,
    name_joint,
    take_control,
)
from fourbar_validation.engines.mujoco.robots.closures import (
    describe_equality,
    find_loops,
)
from fourbar_validation.engines.mujoco.robots.inside import LoopInside
from fourbar_validation.engines.mujoco.robots.loop_facts import (
    LoopScene,
    PoseOptions,
    RobotFile,
    RobotLoop,
    is_in_line,
    round_off,
)
from fourbar_validation.engines.mujoco.robots.pose import (
    OUTSIDE_A_RANGE,
    PosedRobot,
    find_outside,
    list_unknown_parts,
    pose_robot,
)
from fourbar_validation.engines.mujoco.robots.seen import Lump, SeenLoop

_DECIMALS_OF_A_DEGREE = 10
"""The same for an angle in degrees."""
SWEEP_INTERVALS = 120
"""Intervals of the sweep."""
RANGE_INTERVALS = 720
"""Intervals in each sense in which the ranges of the hinges are looked for."""
DEFAULT_SPEED = 1.0
"""rad/s, where none is stated."""
ROUND_OFF_OF_LOADS = 1e-9
"""Part of what acts below which a number is round-off."""
_ACROSS = 1e-6
"""Part of gravity below which none acts across the plane."""
_TURN_OF_A_QUATERNION = 2.0
"""Angle by which a rotation changes over the change of its unit quaternion."""
_SKEW = 1e-6
"""rad; axes less apart than this are parallel but for the digits of the file."""
_SAME_OUTPUT = 1e-6
"""rad; two ways to see a linkage whose outputs miss that of the scene alike."""


def read_loop_scene(
    file: RobotFile,
    options: PoseOptions,
    name: str | None,
    speed: float | None,
) -> LoopScene:
    """Make a scene from a loop of a robot's file.

    Parameters
    ----------
    name : of the closure; None: the only four-bar of the file.
    speed : of the driven bar, rad/s; None: 1.

    Raises
    ------
    InputError : there is no such four-bar, or one of its masses is unknown.
    """
    posed = pose_robot(file, options)
    loops = find_loops(posed, name)
    if len(loops) > 1:
        names = ", ".join(loop.name for loop in loops)
        raise InputError("--loop", None, f"states one of the four-bars: {names}")
    (loop,) = loops
    title = f"{loop.name} of {file.path.name}"
    return make_loop_scene(posed, loop, speed, title, file.path.name)


def make_loop_scene(
    posed: PosedRobot,
    loop: RobotLoop,
    speed: float | None,
    title: str = "",
    source: str = "",
) -> LoopScene:
    """Make a scene from a loop in its pose; errors as of `read_loop_scene`."""
    made = SceneOfLoop(posed, loop)
    scene = made.describe(DEFAULT_SPEED if speed is None else speed, title, source)
    remarks = [*loop.chosen, *loop.remarks, *made.remarks]
    if speed is None:
        remarks.append(
            f"a speed of {DEFAULT_SPEED:g} rad/s is taken; --speed states another"
        )
    parts = (*made.write_parts(), made.write_relation())
    return LoopScene(scene, made.loop, parts, tuple(remarks), posed.notes)


def _reflect(model: mujoco.MjModel, joint: int, name: str) -> float:
    """Return armature, kg m^2, or damping, N m s/rad, of a hinge.

    A motor on the hinge adds its own times the square of its gear.
    """
    own = getattr(model, f"dof_{name}")[model.jnt_dofadr[joint]]
    if name == "damping":
        own = own * is_enabled(model, "damper")
    # since MuJoCo 4.0
    of_motors = getattr(model, f"actuator_{name}", np.zeros(model.nu))
    motors = list_actuators(model, joint)
    gears = model.actuator_gear[motors, 0]
    return float(own + of_motors[motors] @ gears**2)


def write_pose(
    model: mujoco.MjModel,
    loop: RobotLoop,
    qpos: Array | None,
) -> str:
    """Write the hinges of a loop in a pose as the value of --pose.

    The digits close the loop to 1e-8 of its bars. The text is empty without a pose, and
    where a hinge would be outside its range.
    """
    hinges = sorted(loop.hinges.values())
    if qpos is None or not {*hinges}.isdisjoint(find_outside(model, qpos)):
        return ""
    parts = []
    for joint in hinges:
        angle = math.degrees(qpos[model.jnt_qposadr[joint]])
        parts.append(f"{name_joint(model, joint)}={round(angle, 6):.10g}deg")
    return ",".join(parts)


def _round_angle(angle: float) -> float:
    """Round an angle to the digits that a compiled model has, rad; -0.0 becomes 0.0.

    Degrees are rounded, so that a right angle stays one to its last digit.
    """
    return math.radians(round(math.degrees(angle), _DECIMALS_OF_A_DEGREE) + 0.0)


def _write_axis(axis: Array) -> str:
    """Write a unit vector: as x, y or z with its sign if it is one of these."""
    for name, part in zip("xyz", axis, strict=True):
        if abs(abs(part) - 1.0) <= _SKEW**2:
            return f"-{name}" if part < 0.0 else name
    return f"({', '.join(f'{round(part, 6) + 0.0:.6g}' for part in axis)})"


def miss_output(scene: Scene, angles: Sequence[float]) -> float:
    """Return by how much the motion of a scene misses a loop in its pose, rad.

    The loop's commanded bar tells where the last bar that follows must be; infinite if
    the scene is open there. `angles`: theta_1 to theta_4 of the loop, rad.
    """
    linkage = scene.linkage
    bar = command(scene).bar
    last = max(MOVING_BARS, key=lambda one: (one != bar, one))
    angle = np.array([angles[bar - 1] - angles[0] + linkage.ground_angle])
    branch = find_signs(linkage, angle, scene.motion.branch, bar)
    follows = float(close(linkage, angle, branch, bar).theta[1, 0])
    away = follows - linkage.ground_angle - (angles[last - 1] - angles[0])
    if math.isfinite(away):
        return abs(math.remainder(away, math.tau))
    return math.inf


def is_seen_from_behind(scene: Scene, angles: Sequence[float]) -> bool:
    """Tell whether the plane of a loop is seen from the other side.

    In its pose the loop then has the assembly of a scene. All angles turn the other way
    there.
    """
    missed = miss_output(scene, angles)
    missed_behind = miss_output(scene, [-angle for angle in angles])
    return missed_behind < missed - _SAME_OUTPUT


class SceneOfLoop(SeenLoop):
    """A scene that is made from one loop."""

    def __init__(self, posed: PosedRobot, loop: RobotLoop) -> None:
        super().__init__(posed.model, loop)
        self.robot = posed
        self.remarks: list[str] = []
        self.shift = 0.0
        """Whole turns by which theta_2 of the scene exceeds that of the loop, rad."""
        self.bodies = {body for body, bar in enumerate(loop.bars) if (bar or 1) > 1}
        gravity = self.model.opt.gravity * is_enabled(self.model, "gravity")
        self.gravity = np.asarray(gravity, float)

    def require_masses(self) -> None:
        """Refuse a bar of unknown mass, and say which parts of bars have none."""
        parts = list_unknown_parts(self.robot, self.bodies)
        if parts:
            self._leave_out(f"the mass of {', '.join(parts)}, whose mesh is missing")

    def write_parts(self) -> tuple[str, ...]:
        """Say which joint is which pin, which body which bar, and what is held."""
        model = self.model
        loop = self.loop
        closing = loop.name if loop.cut else ""
        hinges = {pin: name_joint(model, joint) for pin, joint in loop.hinges.items()}
        pins = (f"{pin} {hinges.get(pin, closing)}" for pin in PINS)
        bars = []
        for bar, name in BAR_NAMES.items():
            bodies = [name_body(model, body) for body in loop.bodies[bar]]
            if bar == 1:  # as the list of closures names it, not what it is fixed to
                bodies[0] = loop.ground
            bars.append(f"{name} {' + '.join(bodies)}")
        lines = [f"Pins: {', '.join(pins)}.", f"Bars: {', '.join(bars)}."]
        held = [name_joint(model, joint) for joint in loop.held]
        if held:
            lines.append(f"Held as they stand: {', '.join(held)}.")
        return tuple(lines)

    def write_relation(self) -> str:
        """Say how theta_2 of the scene and the driven joint are related.

        Say too which axes of the world x and y of the scene are.
        """
        loop = self.loop
        at_zero = loop.angles[0] + self.angle_at("O2", 0.0) + self.shift
        constant = round(math.degrees(at_zero), _DECIMALS_OF_A_DEGREE)
        sign = "-" if loop.senses["O2"] < 0.0 else ""
        angle = f"theta_2 = {sign}{self._name_hinge('O2')}"
        if constant:
            angle += f" {'+' if constant > 0.0 else '-'} {abs(constant):.12g} deg"
        x, y = (_write_axis(axis) for axis in self.axes)
        fixed = not self.model.body_weldid[loop.bodies[1][0]]
        when = "" if fixed else " in this pose"
        return f"Angles: {angle}. Axes: x is {x} of the world, y is {y}{when}."

    def describe(self, speed: float, title: str, source: str) -> Scene:
        """Describe the scene."""
        self.require_masses()
        lumps = {bar: self.lump(bar) for bar in MOVING_BARS}
        armature = self._list_armature()
        lengths = self.meet_lengths().met
        bars = {}
        for bar, lump in lumps.items():
            inertia = lump.inertia + (armature.get("O4", 0.0) if bar == 4 else 0.0)
            distance, angle = lump.centre
            centre = (round_off(distance), _round_angle(angle))
            mass = round_off(lump.mass)
            bars[bar] = Bar(lengths[bar - 1], mass, round_off(inertia), centre)
        theta_1 = _round_angle(self.loop.angles[0])
        linkage = FourBar(lengths[0], bars[2], bars[3], bars[4], theta_1)
        self.inside = LoopInside(self.model, self.loop)
        *ends, at_start = self._find_sweep()
        self.shift = math.tau * math.ceil((-math.pi - ends[0]) / math.tau)
        start, stop = (_round_angle(end + self.shift) for end in ends)
        theta_2 = Sweep(start, stop, SWEEP_INTERVALS) if stop > start else start
        branch = OPEN
        if not is_in_line(self.loop.angles, 2):
            in_pose = np.array([self.loop.angles[1] + self.shift])
            branch = int(find_signs(linkage, in_pose, self.inside.signs)[0])
        self._remark_assembly(branch)
        motion = Motion(theta_2, speed, branch=branch)
        effects = tuple(self._list_effects(armature, at_start))
        self._remark_what_is_left_out(lumps)
        loads = tuple(self._list_loads())
        return Scene(
            linkage,
            motion,
            drive=self._find_cylinder(),
            loads=loads,
            effects=effects,
            title=title,
            source=source,
        )

    def meet_lengths(self, wanted: Lengths | None = None) -> RobotLoop:
        """Read the lengths within the digits of the file, and say which are equal.

        MuJoCo saves positions and quaternions with six significant digits, and so do
        many generators. The lengths of a parallelogram then differ in their seventh
        digit, and the linkage as it stands has no change point and another range. As in
        a scene that states rounded lengths or coordinates, the lengths are those of the
        parallelogram or kite that the digits cannot tell from the file's. They are the
        file's own where these are nearer to those of a scene, `wanted`.
        """
        d, a, b, c = map(round_off, self.loop.lengths)
        stated = (d, a, b, c)
        met = tuple(map(round_off, self._meet_lengths(stated)))
        if wanted and math.dist(wanted, stated) < math.dist(wanted, met):
            met = stated
        equal = [
            f"{first} and {second}, which differ by {gap:.4g} m"
            for first, second, gap in list_met_equalities(stated, met)
        ]
        if equal:
            self.remarks.append(
                "lengths read as equal within the digits of the file:"
                f" {'; '.join(equal)}"
            )
        self.loop = replace(self.loop, met=met)
        return self.loop

    def _meet_lengths(self, lengths: Lengths) -> Lengths:
        """Return lengths, of a parallelogram or a kite without their rounding."""
        finest = DIGITS_STATED * math.fsum(lengths)
        rounding = 0.0
        for moved in self._list_roundings(max(lengths)):
            if moved <= finest:  # numbers of fewer digits are meant as they stand
                rounding += moved
        fine = [find_rounding([length]) <= finest for length in lengths]
        d, a, b, c = (rounding / max(sum(fine), 1) * np.array(fine)).tolist()
        met = meet_change_points(lengths, (d, a, b, c))
        # one equality alone is met by chance: nobody builds it
        return met if count_equalities(met) > 1 else lengths

    def _list_roundings(self, longest: float) -> Iterator[float]:
        """List how far the rounding of each stated place and turn moves a pin, m."""
        model = self.model
        equality = self.loop.equality
        first, second = find_tied_bodies(model, equality)
        if model.eq_objtype[equality] == mujoco.mjtObj.mjOBJ_SITE:
            sites = (model.eq_obj1id[equality], model.eq_obj2id[equality])
            places = [model.site_pos[site] for site in sites]
        else:
            places = [model.eq_data[equality, 0:3]]
        places += [model.jnt_pos[joint] for joint in self.hinge.values()]
        for body in {*climb(model, first)} ^ {*climb(model, second)}:
            places.append(model.body_pos[body])
            turned = find_rounding(self.robot.quaternions.get(body, ()))
            yield _TURN_OF_A_QUATERNION * longest * turned
        yield from map(find_rounding, places)

    @property
    def _pull(self) -> complex:
        """Gravity in the plane, m/s^2."""
        return complex(*self.in_plane(self.gravity))

    def _list_armature(self) -> dict[str, float]:
        """Return the armature of each hinge that has any, by its pin, kg m^2."""
        armature = {
            pin: _reflect(self.model, joint, "armature")
            for pin, joint in self.loop.hinges.items()
        }
        for pin, size in armature.items():
            text = f"the armature {size:.6g} kg m^2 of {self._name_hinge(pin)}"
            if size and pin == "O4":
                self.remarks.append(
                    f"{text} is in the inertia of the output, which turns as it does"
                )
            elif size and pin != "O2":
                self._leave_out(f"{text}, between two moving bars")
        return armature

    def _name_hinge(self, pin: str) -> str:
        return name_joint(self.model, self.loop.hinges[pin])

    def _list_effects(
        self, armature: dict[str, float], at_start: list[float]
    ) -> Iterator[Effect]:
        """List the effects, the pins in their order."""
        model = self.model
        pull = self._pull
        if abs(pull) > ROUND_OFF_OF_LOADS * math.hypot(*self.gravity):
            yield Gravity(round_off(abs(pull)), _round_angle(cmath.phase(pull)))
        hinges = self.loop.hinges
        damping = [_reflect(model, joint, "damping") for joint in hinges.values()]
        couples = model.dof_frictionloss[model.jnt_dofadr[[*hinges.values()]]]
        couples = couples * is_enabled(model, "frictionloss", "constraint")
        for make, sizes in ((Viscous, damping), (Friction, couples.tolist())):
            at_pins = zip(hinges, map(round_off, sizes), strict=True)
            if any(sizes):
                yield make(tuple((pin, size) for pin, size in at_pins if size))
        if springs := tuple(self._list_springs(at_start)):
            yield Torsion(springs)
        if armature.get("O2"):
            yield Flywheel(round_off(armature["O2"]), 2)

    def _list_springs(
        self, at_start: list[float]
    ) -> Iterator[tuple[str, float, float, float]]:
        """List pin, stiffness, rest angle and preload of the hinges' springs.

        A scene counts its rest angle within half a turn where the motion begins; the
        couple of whole turns beyond is a preload.
        """
        model = self.model
        if not is_enabled(model, "spring"):
            return
        for pin, joint in self.loop.hinges.items():
            stiffness = float(model.jnt_stiffness[joint])
            if not stiffness:
                continue
            rest = self.rest_angle(pin, spring=True)
            first, second = (at_start[bar - 1] for bar in PINS[pin])
            turns = math.tau * round((second - first - rest) / math.tau)
            angle = _round_angle(math.remainder(rest, math.tau))
            yield pin, round_off(stiffness), angle, round_off(stiffness * turns)

    def _list_loads(self) -> Iterator[Load]:
        """Yield the forces by which bodies are held against gravity (gravcomp).

        The point of action of each is where the bodies have it.
        """
        data = self.data
        lifted_masses = list_lifted_masses(self.model)
        for bar in MOVING_BARS:
            bodies = self.list_parts(bar)
            lifted = lifted_masses[bodies]
            force = -float(lifted.sum()) * self._pull
            if not force:
                continue
            place = self._place(bar, lifted @ data.xipos[bodies] / lifted.sum())
            size = round_off(abs(force))
            angle = _round_angle(cmath.phase(force))
            yield Load(bar, (size, angle), from_pin=place.from_pin)

    def _place(self, bar: int, point: Array) -> Place:
        """Return a place of a bar, by its point in world axes, (3,), m."""
        distance, angle = self.polar(bar, point)
        return Place(bar, (round_off(distance), _round_angle(angle)))

    def _find_cylinder(self) -> LinearDrive | None:
        """Return what drives the loop, None for a couple."""
        model = self.model
        if self.loop.cylinder is None:
            return None
        tendon = model.actuator_trnid[self.loop.cylinder, 0]
        sites = [site for _, site, _ in list_wraps(model, tendon)]
        start, end = self.data.site_xpos[sites]
        across = abs(float((end - start) @ self.normal))
        if across > _ACROSS * math.dist(start, end):
            self._leave_out(
                f"{across:.4g} m across the plane between its cylinder's ends"
            )
        first, second = (self.loop.bars[body] for body in model.site_bodyid[sites])
        return LinearDrive(self._place(first, start), self._place(second, end))

    def _find_sweep(self) -> tuple[float, float, list[float]]:
        """Follow the loop over the range of the driven hinge.

        The range ends where the loop does not assemble or another hinge stops it.
        Of one longer than a turn, a turn is taken from the pose, or as near to it as
        the range allows. Return theta_2 at the ends, and theta_1 to theta_4 at the
        first of them, rad.
        """
        from scipy.optimize import brentq

        theta_2 = self.loop.angles[1]
        linkage = self.inside.linkage
        closing = np.array([-math.inf, math.inf])
        if not turns_fully(linkage):
            closing = np.array(choose_range(linkage, holding=theta_2))
            closing += math.tau * round((theta_2 - closing.mean()) / math.tau)
        low, high = closing.tolist()
        if stops := self.stops("O2"):
            low = max(low, stops[0] + self.loop.angles[0])
            high = min(high, stops[1] + self.loop.angles[0])
        near = min(max(theta_2, low), high)
        low = max(low, near - math.tau)
        high = min(high, near + math.tau)
        both_ways = np.linspace([low, high], near, RANGE_INTERVALS + 1)
        angles = np.union1d(both_ways, theta_2)
        in_pose = int(np.searchsorted(angles, theta_2))
        theta = self.inside.turn_bars(angles)
        if np.isnan(theta[in_pose]).any():
            posed = self.loop.qpos[self.model.jnt_qposadr[self.hinge["O2"]]]
            ends = posed + self.sense["O2"] * (closing - theta_2)
            ends = np.sort(np.degrees(ends))
            raise InputError(
                "MJCF",
                self.loop.name,
                f"is open in this pose: it closes with {self._name_hinge('O2')} from"
                f" {ends[0]:.6g} to {ends[1]:.6g} deg",
            )
        turns = np.round((theta[in_pose] - self.loop.angles) / math.tau)
        theta -= math.tau * turns
        slack = self._measure_slack(theta)
        free = (angles >= low) & (angles <= high) & (slack >= -OUTSIDE_A_RANGE)
        if not free.any():
            raise InputError(
                "MJCF",
                self.loop.name,
                "no position is within the ranges of its hinges",
            )
        places = np.flatnonzero(free)
        runs = split_runs(places)
        run = min(runs, key=lambda run: np.abs(run - in_pose).min())

        def find_end(inner: int, outer: int) -> float:
            """Return where a hinge meets its stop on the way to an angle, rad."""
            if not 0 <= outer < len(angles) or not slack[inner] > 0.0 > slack[outer]:
                return float(angles[inner])

            def measure(angle: float) -> float:
                path = self.inside.turn_bars(np.array([angles[inner], angle]))
                turns = np.round((path[0] - theta[inner]) / math.tau)
                return float(self._measure_slack(path - math.tau * turns)[1])

            return float(brentq(measure, angles[inner], angles[outer]))

        low = find_end(run[0], run[0] - 1)
        high = find_end(run[-1], run[-1] + 1)
        start = max(low, min(near, high - math.tau))
        stop = min(high, start + math.tau)
        at_start = [float(np.interp(start, angles, column)) for column in theta.T]
        return start, stop, at_start

    def _measure_slack(self, theta: Array) -> Array:
        """Return how far the nearest stop of a hinge is, negative beyond it, rad, (n,).

        `theta`: theta_1 to theta_4, (n, 4), rad.
        """
        slack = np.full(len(theta), math.inf)
        for pin in self.hinge:
            first, second = PINS[pin]
            beta = theta[:, second - 1] - theta[:, first - 1]
            least, most = self.stops(pin) or (-math.inf, math.inf)
            slack = np.minimum(slack, np.minimum(beta - least, most - beta))
        return slack

    def _remark_assembly(self, branch: int) -> None:
        """Say where the pose does not tell the assembly."""
        loop = self.loop
        text = "coupler and output are in line in"
        if is_in_line(loop.angles, 2):
            text += " this pose: open is taken; --pose states another"
        elif loop.is_flat(2):
            text += (
                " the pose before closing, which does not tell the assembly: it closed"
                f" to the {BRANCH_NAMES[branch]} one"
            )
            reflected = self.inside.reflect()
            if pose := write_pose(self.model, loop, reflected):
                text += f"; --pose {pose} closes to the other"
        else:
            return
        self.remarks.append(text)

    def _remark_what_is_left_out(self, lumps: dict[int, Lump]) -> None:
        """Name what acts on the loop and is not in the scene."""
        model = self.model
        loop = self.loop
        across = float(self.gravity @ self.normal)
        if abs(across) > _ACROSS * math.hypot(*self.gravity):
            weights = (
                f"{BAR_NAMES[bar]} {abs(lump.mass * across):.4g} N"
                for bar, lump in lumps.items()
            )
            self._leave_out(f"weights across the plane: {', '.join(weights)}")
        if loop.misaligned > _SKEW:
            angle = math.degrees(loop.misaligned)
            self._leave_out(f"the {angle:.2g} deg between its axes")
        for number in loop.other_equalities:
            name = describe_equality(model, number)
            self._leave_out(f"the equality {name}, which acts on its bars too")
        joints = [*loop.hinges.values()]
        for field, rows, what, of in (
            ("dof_dampingpoly", model.jnt_dofadr[joints], "damping", "speed"),
            ("jnt_stiffnesspoly", joints, "stiffness", "angle"),
        ):
            if np.any(getattr(model, field, np.zeros(model.nv))[rows]):
                self._leave_out(f"{what} that is a polynomial of the {of}")
        self._remark_tendons_and_motors()
        if np.any(model.opt.density) or np.any(model.opt.viscosity):
            self._leave_out(
                f"a fluid of density {model.opt.density:g} kg/m^3 and viscosity "
                f"{model.opt.viscosity:g} Pa s"
            )
        collides = (model.geom_contype != 0) | (model.geom_conaffinity != 0)
        if np.any(collides & np.isin(model.geom_bodyid, [*self.bodies])):
            self._leave_out("contacts, and what its bars touch")

    def _leave_out(self, what: str) -> None:
        self.remarks.append(f"not in the scene: {what}")

    def _remark_tendons_and_motors(self) -> None:
        """Name tendons and actuators that act on the loop.

        The motor of the driven hinge is left out.
        """
        model = self.model
        none = np.zeros((model.ntendon, 0))
        for number in filter(self.touches_tendon, range(model.ntendon)):
            acts = []
            for name in ("stiffness", "damping", "frictionloss", "armature"):
                size = getattr(model, f"tendon_{name}")[number]
                # since MuJoCo 4.0
                more = getattr(model, f"tendon_{name}poly", none)[number]
                sizes = np.trim_zeros(np.append(size, more), "b").tolist()
                if sizes:
                    acts.append(f"{name} {write_six_digits(*sizes)}")
            if acts:
                name = model.tendon(number).name or str(number)
                self._leave_out(f"the tendon {name} ({', '.join(acts)})")
        joints = {*self.loop.hinges.values()} - {self.loop.joint}
        for number, kind in enumerate(model.actuator_trntype):
            target = model.actuator_trnid[number, 0]
            on_joint = kind == mujoco.mjtTrn.mjTRN_JOINT and target in joints
            on_site = kind == mujoco.mjtTrn.mjTRN_SITE
            on_tendon = kind == mujoco.mjtTrn.mjTRN_TENDON
            pulls = on_tendon and not take_control(model)[number]
            if (
                on_joint
                or (on_site and model.site_bodyid[target] in self.bodies)
                or (pulls and self.touches_tendon(target))
            ):
                self._leave_out(describe_actuator(model, number))


def find_rounding(vector: Iterable[float]) -> float:
    """Return the size of the rounding of a vector of numbers as they are written.

    All have as many significant digits as the one that shows most, since zeros at the
    end are not written. A zero is exact.
    """
    numbers = [Decimal(repr(float(number))) for number in vector if number]
    digits = max((len(n.normalize().as_tuple().digits) for n in numbers), default=0)
    return math.hypot(*(0.5 * 10.0 ** (n.adjusted() + 1 - digits) for n in numbers))
