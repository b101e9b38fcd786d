"""MJCF of a scene, for each simulator that reads it; a scene from bare bar lengths."""

import math
import tomllib
from dataclasses import dataclass, replace
from importlib.resources import files
from typing import Any, Literal, NamedTuple, Self, get_args
from xml.etree import ElementTree as ET

import numpy as np

from fourbar.effects import LinearDrive
from fourbar.errors import (
    InputError,
    LimitError,
    NotAssembledError,
    clean_line,
    write_in_units,
)
from fourbar.formulas.mobility import change_points, choose_range, turns_fully
from fourbar.linkage import BAR_NAMES, Bar, FourBar, uniform
from fourbar.mjcf.model import (
    FULL_TURN,
    RECIPE,
    Model,
    Settings,
    add_comments,
    add_element,
    make_motor,
    make_servo,
    require_carriable,
    unwind,
)
from fourbar.mjcf.plane import LEVEL, Plane
from fourbar.quantities import OK, Array
from fourbar.scene import Command, Scene, command, require_input
from fourbar.scene.motion import Motion
from fourbar.solving import solve

NOTES: dict[str, Any] = tomllib.loads(
    files("fourbar.mjcf").joinpath("notes.toml").read_text(encoding="utf-8")
)
"""Comments in the model files: how to start them, and where their numbers stand."""
SPEED_LAID_OUT_FOR = 1.0
"""rad/s that flywheel and timestep are laid out for where the scene states no speed."""
SETTLING = 2.0
"""Time constant with which the servo starts the input from rest, in timesteps. The
angle of the input lags by as many.
"""
_RELEASED_STEPS = 6280
"""Timesteps in the time in which weights and loads would turn the linkage once. It
holds without a flywheel.
"""
_RELEASED_CLOSURE = 2.0
"""Time constant of the closure of a released linkage, in timesteps. Measured: 2 takes
the least energy out of it.
"""
_STIFF_PAD, _SOFT_PAD = 1e-4, 2e-3
"""Pads of `Settings.pad`. Stiff: the closure's softness matters less than 1e-9. Soft: 7
digits after one iteration.
"""
QUICK = 1.0
"""rad/s^2. MuJoCo's Newton solver stops where an iteration changes the accelerations by
less than 1e-15 rad/s^2 (mjMINVAL): below about this acceleration there is no second
one, and stiff pads leave errors of up to 1e-3.
"""
LIGHT_BAR_RATIO = 100.0
"""Mass ratio of coupler and output above which `fit_pad` makes the pad smaller. The
closure then softens by the ratio more than by the loads: the error of the inertial
torque was 3e-5 for 10 g against 14.5 kg, and 3e-3 for 1 g.
"""
Drive = Literal["flywheel", "motor", "none"]
"""Kind of drive: a flywheel that keeps omega_2 or alpha_2; a motor on the driven bar
whose control is its couple; none. A free motion has none.
"""


def write_mjcf(
    scene: Scene,
    settings: Settings = RECIPE,
    reader: str = "mujoco",
    *,
    keyframe: bool = True,
    start: "Start | None" = None,
    drive: Drive = "flywheel",
    plane: Plane = LEVEL,
) -> str:
    """Write the MJCF text of a scene: it runs on its own in MuJoCo.

    Parameters
    ----------
    settings : of MuJoCo; the default ones carry every linkage above MuJoCo's floor of
        mass.
    reader : one of `SIMULATORS`: the comments say where torque and pin force are read
        there.
    keyframe : False leaves it out, and with it the assembled pose and the servo that
        starts it from rest; then `settings.timestep` must be given and no position is
        computed.
    start : the assembled state to open with; None: that of `find_start`.
    drive : "flywheel" keeps the input at omega_2; "motor" leaves the driven bar to a
        controller, "none" likewise without an actuator: then nothing is added to the
        linkage's inertia.
    plane : where the linkage stands in the world.

    Raises
    ------
    InputError : a bar has less mass or inertia than MuJoCo carries, or nothing sets the
        timestep.
    LimitError : an effect or the motion has no counterpart in MJCF.
    NotAssembledError : the linkage closes at none of the scene's positions.
    """
    _require_counterpart(scene, drive)
    scene = scene.in_pairs_from_pins()
    is_released = scene.motion.free is not None
    if is_released:
        drive = "none"
    if drive != "flywheel":
        settings = _leave_out_flywheel(scene, settings)
    if settings.pad == "fitted":
        settings = replace(settings, pad=fit_pad(scene))
    start = (start or find_start(scene)) if keyframe else None
    timestep = _choose_timestep(settings, start)
    # MuJoCo alone reads motors without a control
    passive = drive == "motor" and reader == "mujoco"
    model = Model(scene.linkage, settings, timestep, passive=passive)
    if isinstance(scene.drive, LinearDrive) and not is_released:
        model.cylinder = scene.drive
    for term in (*scene.effects, *scene.loads):
        term.add_to_mjcf(model)
    root = model.root
    root.set("model", clean_line(scene.title) or "four-bar")
    exerts = passive and model.exerts
    add_comments(root, _write_comments(scene, drive, reader, passive=exerts))
    add_element(root, "compiler", angle="radian", autolimits="true")
    model.add_option()
    if start is not None:
        start = start._replace(qpos=unwind(scene, start.qpos))
        model.rest = start.qpos
    armature = size_flywheel(scene, settings)
    model.add_bodies(armature)
    model.add_load_sites()
    model.add_closure()
    model.add_tendons()
    if drive == "motor":
        actuator = make_motor(scene.drive_bar, _size_control(scene))
    else:
        couple = armature * scene.motion.alpha_2
        gain = 0.0
        if armature and start is not None and not scene.motion.alpha_2:
            gain = armature / (SETTLING * timestep)
            couple = gain * start.qvel[0]
        actuator = make_servo(couple, gain)
    model.add_actuators(actuator, driven=drive == "flywheel")
    if start is not None:
        frame = add_element(root, "keyframe")
        add_element(frame, "key", name="start", qpos=start.qpos, qvel=start.qvel)
    if plane.is_moved:
        plane.move_mjcf(root)
    if plane.is_tilted:
        root.insert(0, ET.Comment(f" {NOTES['mjcf']['tilted']} "))
    ET.indent(root)
    return ET.tostring(root, encoding="unicode") + "\n"


def _require_counterpart(scene: Scene, drive: Drive) -> None:
    """Raise an error where linkage, motion or drive have no counterpart in MJCF."""
    require_input(scene, "the drive of an MJCF")
    if scene.motion.law is not None:
        raise LimitError(
            "a motion law has no counterpart in MJCF: its drive keeps omega_2 or"
            " alpha_2"
        )
    require_carriable(scene.linkage)
    if drive == "motor" and scene.drive is not None and not scene.drive.has_stroke:
        raise LimitError(
            "a force at a point has no motor in MJCF: choose flywheel or none"
        )


def _choose_timestep(settings: Settings, start: "Start | None") -> float:
    """Return the timestep of a file, s, which its settings or its start state."""
    if start is not None:
        return start.run.timestep(settings)
    if settings.timestep is None:
        allowed = "is missing: state it, or request a keyframe"
        raise InputError("timestep", None, allowed)
    return settings.timestep * settings.timestep_scale


def _size_control(scene: Scene) -> float:
    """Return twice the largest couple (N m) or push (N) of the scene's drive.

    A scene without a drive gets the scale of one.
    """
    motion = scene.motion.replace(speed=scene.motion.speed or 0.0)
    solution = solve(replace(scene, motion=motion), "force")
    driving = solution.torque if scene.drive is None else solution.drive_force
    sizes = np.abs(np.asarray(driving))
    largest = float(sizes[np.isfinite(sizes)].max(initial=0.0))
    if not largest:
        scale = _Scale.of(scene)
        largest = (scale.inertia + scale.of_loads) * scale.acceleration
    return float(f"{2.0 * largest:.3g}")


def _write_comments(
    scene: Scene,
    drive: Drive,
    reader: str,
    *,
    passive: bool,
) -> list[str]:
    """Say how the file starts and where its numbers stand, a line each."""
    notes = NOTES["mjcf"]
    numbers = NOTES["numbers"][reader]
    lines: list[str] = [
        notes.get(f"{reader}_{kind}", notes[kind]).format(bar=scene.drive_bar)
        for kind in ("opens", *_list_note_keys(scene, drive))
    ]
    lines += numbers["instant"]
    if drive == "flywheel":
        lines += numbers["driven"]
    lines += numbers["pins"]
    if reader == "mujoco" and drive != "flywheel" and scene.motion.free is None:
        lines += notes["without_flywheel"]
    if drive == "motor":
        lines.append(notes["control"])
    if passive:
        lines.append(notes["passive"])
    if reader == "mujoco" and scene.loads:
        lines.append(notes["loads"])
    return [*lines, *numbers["after"]]


def _list_note_keys(scene: Scene, drive: Drive) -> list[str]:
    """List the keys of the notes that hold for the motion and the drive of a file."""
    linear = isinstance(scene.drive, LinearDrive)
    if scene.motion.free is not None:
        return ["released"]
    if drive != "flywheel":
        return [f"cylinder_{drive}" if linear else drive]
    kinds = ["accelerated" if scene.motion.alpha_2 else "driven"]
    turns = _compute_span(scene.linkage) >= FULL_TURN
    if not turns or change_points(scene.linkage):
        kinds.append("limits")
    if linear:
        kinds.append("cylinder_flywheel")
    elif scene.drive is not None:
        kinds.append("pushed")
    elif scene.drive_bar != 2:
        kinds.append("elsewhere")
    return kinds


def size_flywheel(scene: Scene, settings: Settings = RECIPE) -> float:
    """Compute the armature of pin O2, kg m^2.

    The armature is `settings.flywheel` times the sum of m L^2 + I + (m g L + F L +
    M)/q. L is the longest lever arm, and q the greater of omega_2^2 and |alpha_2|. The
    work of weights and loads in a revolution is then a small part of the flywheel's
    energy.
    """
    scale = _Scale.of(scene)
    armature = settings.flywheel * (scale.inertia + scale.of_loads)
    if not math.isfinite(armature):
        raise InputError(
            "flywheel",
            armature,
            "must be a double: forces, masses and lengths of the scene must be smaller",
            unit="kg m^2",
        )
    return float(f"{armature:.3g}")


def compute_load_ratio(scene: Scene) -> float:
    """Return loads and weights over inertia, (m g L + F L + M)/(q (m L^2 + I)).

    Symbols are those of `size_flywheel`.
    """
    scale = _Scale.of(scene)
    return scale.of_loads / scale.inertia if scale.inertia else math.inf


def _leave_out_flywheel(scene: Scene, settings: Settings) -> Settings:
    """Choose timestep and closure without a flywheel.

    The timestep follows from the speed that loads can cause; the closure of a released
    linkage takes little energy out.
    """
    by_loads = compute_load_ratio(scene) * _Scale.of(scene).acceleration
    motion = scene.motion
    speed = math.sqrt((motion.omega_2 or 0.0) ** 2 + by_loads) or SPEED_LAID_OUT_FOR
    timestep = settings.timestep or math.tau / (_RELEASED_STEPS * speed)
    settings = replace(settings, flywheel=0.0, timestep=timestep)
    if motion.free is None:
        return settings
    return replace(settings, pad=None, time_constant_steps=_RELEASED_CLOSURE)


def fit_pad(scene: Scene) -> float:
    """Choose the pad: stiff enough for the loads, soft enough for one iteration.

    The sag of the closure grows as pad^2 times the loads, the rounding of one iteration
    of MuJoCo's Newton solver as 1/(pad^2 times the loads).
    """
    _, a, b, c = scene.linkage.lengths
    least_sag = _SOFT_PAD / math.sqrt(
        (1.0 + compute_load_ratio(scene))
        * max(1.0, compute_mass_ratio(scene.linkage) / LIGHT_BAR_RATIO)
    )
    # size of the accelerations of bars 3 and 4
    if _Scale.of(scene).acceleration * a / max(b, c) < QUICK:
        return least_sag
    return min(_STIFF_PAD, least_sag)


def compute_mass_ratio(linkage: FourBar) -> float:
    """Return the larger over the smaller (I + m r^2)/L^2 of coupler and output.

    The ratio is 1 if one of them has no mass.
    """
    masses = [reduce_mass(bar) for bar in linkage.moving[1:]]
    return max(masses) / min(masses) if min(masses) else 1.0


def reduce_mass(bar: Bar) -> float:
    """Return the mass at a bar's second pin with its inertia about the first, kg."""
    return (bar.moment_of_inertia + bar.mass * bar.mass_centre[0] ** 2) / bar.length**2


class _Scale(NamedTuple):
    """Sizes that flywheel, timestep and closure are laid out for."""

    acceleration: float
    """The greater of omega_2^2 and |alpha_2|, rad/s^2: all accelerations grow with it.
    """
    inertia: float
    """Sum of m L^2 + I of the moving bars, kg m^2."""
    of_loads: float
    """Sum of the couples of loads and effects on the drive over the acceleration."""

    @classmethod
    def of(cls, scene: Scene) -> Self:
        linkage = scene.linkage
        motion = scene.motion
        speed = motion.omega_2 or SPEED_LAID_OUT_FOR
        acceleration = float(max(speed**2, abs(motion.alpha_2)))
        longest = max(linkage.lengths)
        inertia = 0.0
        for bar in linkage.moving:
            arm = max(longest, abs(bar.mass_centre[0]))
            inertia += bar.mass * arm * arm + bar.moment_of_inertia
        scene = scene.settled()
        couples = 0.0
        for term in (*scene.loads, *scene.effects):
            couples += term.couple_on_drive(linkage, math.sqrt(acceleration))
        return cls(acceleration, inertia, couples / acceleration)


@dataclass
class WindowMotion:
    """The input's motion through a window of theta_2, in time.

        theta_2 = start + omega t + alpha t^2/2

    from `start` to `stop`, at the speed `omega` at the start.
    """

    start: float
    stop: float
    omega: float
    alpha: float

    @property
    def fastest(self) -> float:
        """The greatest |omega_2| in the window, rad/s."""
        gained = 2.0 * self.alpha * (self.stop - self.start)
        return math.sqrt(self.omega**2 + max(gained, 0.0))

    def time(self, theta_2: float) -> float:
        """Return the time at which the input passes an angle, s.

        Raises LimitError if alpha_2 stops it before.
        """
        angle = theta_2 - self.start
        squared = self.omega**2 + 2.0 * self.alpha * angle
        if squared <= 0.0:
            there = write_in_units("rad", theta_2)
            raise LimitError(
                f"alpha_2 brings the input to rest before theta_2 = {there}"
            )
        return (
            2.0 * angle / (self.omega + math.copysign(math.sqrt(squared), self.omega))
        )

    def timestep(self, settings: Settings = RECIPE) -> float:
        """Return a timestep that divides the turn, s.

        The settings state the least number of steps per revolution and per window.
        """
        if settings.timestep is not None:
            return settings.timestep * settings.timestep_scale
        duration = self.time(self.stop)
        # at the greatest speed throughout: an input that speeds up covers the end of
        # its window in few steps
        width = abs(self.stop - self.start)
        steps = settings.count_steps(duration * self.fastest, width)
        # a window of 628 steps per revolution must not become one more by a rounding
        steps = max(math.ceil(steps * (1.0 - 1e-9)), 1)
        return duration / steps * settings.timestep_scale


class Start(NamedTuple):
    """The assembled state that the keyframe holds, and the motion from there on."""

    qpos: tuple[float, float, float]
    qvel: tuple[float, float, float]
    run: WindowMotion


def choose_run(theta_2: Array, omega: float, alpha: float) -> WindowMotion:
    """Choose the motion through positions.

    The motion is counter-clockwise from the least, or clockwise from the greatest.
    """
    ends = float(np.min(theta_2)), float(np.max(theta_2))
    start, stop = ends if omega > 0.0 else ends[::-1]
    return WindowMotion(start, stop, omega, alpha)


def find_start(scene: Scene) -> Start:
    """Find the start of the motion: the first position that assembles, as it moves."""
    at = command(scene)
    alpha = scene.motion.alpha_2
    speed = scene.motion.omega_2 or 0.0
    at = Command(at.theta_2, at.branch, speed, alpha)
    solution = solve(scene, "velocity", at=at)
    usable = np.flatnonzero(solution.status_code == OK)
    if not usable.size:
        raise NotAssembledError(
            "the linkage closes at none of the scene's positions: there is no keyframe"
            " to write"
        )
    theta_2 = at.theta_2[usable]
    first = usable[np.argmin(theta_2) if speed >= 0.0 else np.argmax(theta_2)]
    q2 = float(at.theta_2[first])
    q3 = float(solution.theta_3[first])
    omega_3 = float(solution.omega_3[first])
    if np.ptp(theta_2) == 0.0:
        theta_2 = q2 + np.array([0.0, _compute_span(scene.linkage)])
        alpha = 0.0  # no window is requested: its length only sets the timestep
    return Start(
        (q2, q3 - q2, float(solution.theta_4[first])),
        (speed, omega_3 - speed, float(solution.omega_4[first])),
        choose_run(theta_2, speed or SPEED_LAID_OUT_FOR, alpha if speed else 0.0),
    )


def _compute_span(linkage: FourBar) -> float:
    """Compute the width of the range that the input can turn through, rad."""
    least, most = choose_range(linkage)
    return min(abs(most - least), math.tau)


SINGLE = replace(RECIPE, flywheel=1e3, pad=None)
"""Settings for single precision. A flywheel of 1e8 and fitted pads lose the closing
force entirely there.
"""
SHORT_TIME_CONSTANT = replace(RECIPE, time_constant_steps=2.0)
"""Settings for a `connect` without (dJ/dt) v. With a short time constant the position
error soon makes up for it.
"""
SIMULATORS = {
    "mujoco": RECIPE,
    "warp": SINGLE,
    "mjx": SHORT_TIME_CONSTANT,
    "genesis": RECIPE,
    "newton": SINGLE,
}
"""Simulators that read the file, and the settings that carry the loop best there."""
_OWN_MOTORS = ("genesis", "newton")
"""Simulators that put couples on joints themselves. They take none from the controls of
a file; Genesis takes no actuator at all.
"""


def write_mjcf_for(
    scene: Scene,
    simulator: str = "mujoco",
    drive: Drive = "flywheel",
    plane: Plane = LEVEL,
) -> str:
    """Write the MJCF text of a scene for one simulator.

    Comments in the text name where torque and pin force are read.

    Raises InputError for no such simulator, or a motor for one that does not take it,
    and as `write_mjcf` does.
    """
    stated = ("simulator", simulator, SIMULATORS), ("drive", drive, get_args(Drive))
    for name, word, words in stated:
        if word not in words:
            raise InputError(name, word, f"must be one of {', '.join(words)}")
    if drive == "motor" and simulator in _OWN_MOTORS:
        raise InputError(
            "drive",
            drive,
            f"only mujoco, warp and mjx read it; leave it out for {simulator}",
        )
    settings = SIMULATORS[simulator]
    plane = plane.moved(*scene.origin)
    return write_mjcf(scene, settings, simulator, drive=drive, plane=plane)


_PER_METRE = 1.0
"""kg/m of the uniform bars."""
OMEGA = 1.0
"""rad/s of the input."""


def make_scene(
    ground: float,
    input: float,
    coupler: float,
    output: float,
    omega: float = OMEGA,
) -> Scene:
    """Make a scene of uniform slender bars of 1 kg/m; lengths in m.

    The input turns at omega (rad/s) from the middle of its range.
    """
    linkage = uniform(ground, input, coupler, output, per_metre=_PER_METRE)
    title = f"four-bar {ground!r} {input!r} {coupler!r} {output!r}"
    # half a turn from the ground's line would start a parallelogram in its change point
    quarter = linkage.ground_angle + math.pi / 2.0
    start = quarter if turns_fully(linkage) else 0.5 * sum(choose_range(linkage))
    return Scene(linkage, Motion(start, omega), title=title)


def list_defaults(scene: Scene) -> list[str]:
    """List the lengths that `make_scene` was given and its defaults, one line each."""
    theta_2 = scene.motion.theta_2
    lengths = zip(BAR_NAMES.values(), scene.linkage.lengths, strict=True)
    return [
        f"lengths in m: {', '.join(f'{name} {length!r}' for name, length in lengths)}",
        f"bars: uniform and slender, {_PER_METRE:g} kg/m",
        "branch: open",
        f"omega_2: {scene.motion.omega_2!r} rad/s, alpha_2: 0",
        f"start: theta_2 = {theta_2!r} rad ({math.degrees(theta_2):.6g} deg)",
        "drive: bar 2; no gravity, no loads",
    ]
