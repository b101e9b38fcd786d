"""A compiled MJCF as a closed loop.

MuJoCo's own kinematics gives its assembly, velocities and pin forces. The couple under
which a joint accelerates as wanted is asked of MuJoCo by trials: the acceleration is
continuous in the couple. Where nothing but pins acts it is linear; dry friction, joint
limits and clamped actuators make it piecewise linear, and the couple is bracketed.
"""

import math
from collections.abc import Callable, Sequence
from functools import partial

import mujoco
import numpy as np

from fourbar.linkage import BAR_NAMES, MOVING_BARS
from fourbar.mjcf.model import CYLINDER
from fourbar.quantities import Array
from fourbar_validation.engines.loaded import Assembled, Components
from fourbar_validation.engines.tree import BEARERS, solve_closed

# MuJoCo would write warnings to standard error and to a file of a fixed name in the
# working folder; the monitor reads them from its data
mujoco.set_mju_user_warning(lambda _: None)

O2, A, O4 = 0, 1, 2
"""Degrees of freedom, in the order of the bodies."""
_TURNED_BY = {2: [O2], 3: [O2, A], 4: [O4]}
"""Joints whose angles a bar's rotation is the sum of."""
_COLUMN_OF = {
    bar: np.isin((O2, A, O4), joints).astype(float)
    for bar, joints in _TURNED_BY.items()
}
"""Derivative of each bar's rotation by the joint angles."""
CYLINDER_SITES = (f"{CYLINDER}_start", f"{CYLINDER}_end")
"""Sites of the cylinder."""
WARNINGS = (
    mujoco.mjtWarning.mjWARN_BADQPOS,
    mujoco.mjtWarning.mjWARN_BADQVEL,
    mujoco.mjtWarning.mjWARN_BADQACC,
)
FRICTION_ROWS = (
    mujoco.mjtConstraint.mjCNSTR_FRICTION_DOF,
    mujoco.mjtConstraint.mjCNSTR_FRICTION_TENDON,
)
"""Types of the constraints that are dry friction."""
LARGEST_TRIAL = 1e8
"""N m or N: beside a heavy flywheel a larger trial is no number for MuJoCo, which takes
controls up to 1e10.
"""
_REFINEMENTS = 3
"""Secant steps after the first: each gains the digits that the one before has."""
_MISSED = 1e-9
"""Part of the acceleration sought that a linear solve may leave. Its rounding is 1e-12,
also near a change point.
"""
SOLVER_NOISE = 1e-3
"""Part of it that the noise of the file's solver may leave. Where the acceleration
jumps, all of it is left.
"""
_DOUBLINGS = 40
"""Times that a trial's size is doubled in search of a couple, to both sides. Beyond
1e12 times the size nothing is found.
"""


def merges_points(model: mujoco.MjModel) -> bool:
    """Tell whether the compiler moved a bar's mass centre or a site to its body's pin.

    The inertial frames of pads may be moved.
    """
    on_body = mujoco.mjtSameFrame.mjSAMEFRAME_BODY
    bars = [model.body(BAR_NAMES[number]).id for number in MOVING_BARS]
    centres = model.body_ipos[bars][model.body_sameframe[bars] == on_body]
    sites = model.site_pos[model.site_sameframe == on_body]
    return bool(centres.any() or sites.any())


def find_site_load(
    model: mujoco.MjModel,
    data: mujoco.MjData,
    actuator: int,
) -> Callable[[], Array]:
    """Return a function that reads the world force of an actuator on a site, (3,).

    MuJoCo counts it into the force of the parent. The function reads MuJoCo's own
    memory: to look a row up anew costs more than to read it.
    """
    site, frame = model.actuator_trnid[actuator]
    axes = data.site_xmat[frame if frame >= 0 else site].reshape(3, 3)
    gear = model.actuator_gear[actuator, :3]
    forces = data.actuator_force
    return lambda: axes.dot(gear) * forces[actuator]


def open_model(text: str) -> tuple[mujoco.MjModel, mujoco.MjData]:
    """Compile a text and evaluate it at keyframe 0."""
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    mujoco.mj_forward(model, data)
    return model, data


def make_stepper(text: str) -> Callable[[int], None]:
    """Return a function that takes steps of a model from its first keyframe.

    Each call steps on from where the last one ended.
    """
    return partial(mujoco.mj_step, *open_model(text))


class ClosedLoop(Assembled):
    """Model and data of one generated MJCF; nothing is edited after it is compiled."""

    def __init__(self, mjcf: str) -> None:
        self.model = model = mujoco.MjModel.from_xml_string(mjcf)
        self.data = mujoco.MjData(model)
        self.site = {model.site(number).name: number for number in range(model.nsite)}
        bar_of = {model.body(BAR_NAMES[bar]).id: bar for bar in MOVING_BARS}
        actuators = {model.actuator(i).name: i for i in range(model.nu)}
        self.drive = actuators.get("drive")
        self.ram = actuators.get(CYLINDER)
        self._loads = []
        for name, load in actuators.items():
            if name.startswith("load_"):
                body = model.site_bodyid[model.actuator_trnid[load, 0]]
                bearers = BEARERS[bar_of[body]]
                self._loads.append((find_site_load(model, self.data, load), bearers))
        # MuJoCo's own memory, as that of the loads
        forces = self.data.cfrc_int
        self._carried = {bar: forces[body, 3:5] for body, bar in bar_of.items()}
        self._jac = np.zeros((3, model.nv))

    def gap(self) -> Components:
        """Return B on bar 3 minus B on bar 4, m."""
        x, y = self.find_line("B4", "B3").tolist()
        return x, y

    def find_line(self, start: str, end: str) -> Array:
        """Return the vector from one site to another, (2,), m."""
        places = self.data.site_xpos
        across: Array = places[self.site[end]] - places[self.site[start]]
        return across[:2]

    def jacobian(self) -> Array:
        """Return the derivative of the gap by the joint angles, (2, 3)."""
        return self.jacobian_at("B3") - self.jacobian_at("B4")

    def jacobian_at(self, site: str) -> Array:
        """Return the derivative of a site's position by the joint angles, (2, 3)."""
        mujoco.mj_jacSite(self.model, self.data, self._jac, None, self.site[site])
        return self._jac[:2].copy()

    def place(self, q: Sequence[float]) -> None:
        """Move to the joint angles (O2, A, O4)."""
        self.data.qpos[:] = q
        mujoco.mj_kinematics(self.model, self.data)
        mujoco.mj_comPos(self.model, self.data)

    def positions(self) -> dict[str, Array]:
        """Locate pins O4 and A, and B at the end of bar 3 and of bar 4, (2,), m."""
        sites = {"O4": "O4", "A": "A", "B": "B3", "B4": "B4"}
        places = self.data.site_xpos
        return {name: places[self.site[site], :2] for name, site in sites.items()}

    def branch(self, bar: int = 2) -> int:
        """Return the branch (+1 or -1, 0 at a toggle) of a command of a bar.

        The state is the one last forwarded. The null vector of the gap's derivative
        turns bars 2, 3 and 4 in proportion to

            -b c sin(theta_4 - theta_3),
            a c sin(theta_4 - theta_2),
            a b sin(theta_3 - theta_2).
        """
        null_vector = np.cross(*self.jacobian()[:, :3])
        turn = self.drive_column(bar) @ null_vector
        return int(np.sign(turn if bar != 2 else -turn))

    def set_state(
        self,
        q: Sequence[float],
        speed: float,
        bar: int | None = 2,
    ) -> None:
        """Start from own joint angles at the speed of a bar or of the stroke.

        The gap is kept closed.
        """
        mujoco.mj_resetData(self.model, self.data)
        self.place(q)
        jacobian = self.jacobian()[:, :3]
        column = self.drive_column(bar)
        self.data.qvel[:3] = solve_closed(jacobian, speed, column)

    def forward(self) -> None:
        """Evaluate the present state.

        After a Runge-Kutta step some fields are still of the step before.
        """
        mujoco.mj_forward(self.model, self.data)
        mujoco.mj_rnePostConstraint(self.model, self.data)

    def forces(self) -> dict[str, Array]:
        """Read the pin forces of the state last forwarded, world axes, (2,) each, N."""
        on = self.joint_forces()
        closure = self.data.efc_force[:2].copy()
        return {"F12": on[2], "F32": -on[3], "F43": closure, "F14": on[4]}

    def joint_forces(self) -> dict[int, Array]:
        """Return the force of the parent on each bar in world axes, N.

        Read is cfrc_int, which includes all that the bar carries, without the forces of
        actuators on sites, which MuJoCo counts into it, unlike those of tendons.
        """
        on = {bar: force.copy() for bar, force in self._carried.items()}
        for read, bearers in self._loads:
            load = read()[:2]
            for bar in bearers:
                on[bar] -= load
        return on

    def motor(self) -> float:
        """Return the torque of the flywheel's motor, N m."""
        return (
            0.0 if self.drive is None else float(self.data.actuator_force[self.drive])
        )

    def crank_torque(self) -> float:
        """Return T2 of the flywheel and of the motor next to it, N m."""
        flywheel = -self.model.dof_armature[O2] * self.data.qacc[O2]
        return float(flywheel + self.motor())

    def drive_column(self, drive_bar: int | None) -> Array:
        """Return the derivative of what is driven by the joint angles, (3,).

        Driven is the bar's rotation, or the cylinder's stroke.
        """
        if drive_bar is not None:
            return _COLUMN_OF[drive_bar]
        start, end = CYLINDER_SITES
        line = self.find_line(start, end)
        jacobian = self.jacobian_at(end) - self.jacobian_at(start)
        along: Array = line / self.stroke()
        return along @ jacobian

    def angle(self, bar: int) -> float:
        """Sum of the joint angles that a bar's direction is, rad."""
        return float(self.data.qpos[_TURNED_BY[bar]].sum())

    def stroke(self) -> float:
        """Return the distance of the cylinder's sites, m."""
        return float(np.hypot(*self.find_line(*CYLINDER_SITES)))

    def drive_drift(self, drive_bar: int | None) -> float:
        """Return the second derivative of the drive at the present speeds.

        Nothing accelerates. The first derivative is `drive_column`; that of a
        cylinder's stroke gives m/s^2.
        """
        if drive_bar is not None:
            return 0.0
        start, end = CYLINDER_SITES
        line = self.find_line(start, end)
        stroke = self.stroke()
        v = self.data.qvel
        jacobian = self.jacobian_at(end) - self.jacobian_at(start)
        rate = self.rate_at(end) - self.rate_at(start)
        x, y = jacobian @ v
        across = (line[0] * y - line[1] * x) / stroke
        along = line / stroke @ rate @ v
        return float(along + across * across / stroke)

    def rate_at(self, site: str) -> Array:
        """Return the rate of `jacobian_at` at the present speeds, (2, nv)."""
        rate = np.zeros((3, self.model.nv))
        number = self.site[site]
        body = self.model.site_bodyid[number]
        place = self.data.site_xpos[number]
        mujoco.mj_jacDot(self.model, self.data, rate, None, place, body)
        return rate[:2]

    def cylinder(self, bar: int) -> tuple[complex, complex]:
        """Measure from the ground pin of a bar to the cylinder's ends, m.

        The end on the bar is at angle 0 of the bar; the other is on the ground.
        """
        self.place((0.0, 0.0, 0.0))
        places = self.data.site_xpos
        pivot = places[self.site["O4"]] if bar == 4 else np.zeros(3)
        ground = self.model.body("ground").id
        sites = [self.site[end] for end in CYLINDER_SITES]
        sites.sort(key=lambda site: self.model.site_bodyid[site] == ground)
        on_bar, on_ground = (complex(*(places[site] - pivot)[:2]) for site in sites)
        return on_bar, on_ground

    def work(
        self,
        drive_bar: int | None,
        size: float,
        correction: float = 0.0,
    ) -> None:
        """Let a couple act on the driven bar, N m, or the actuator push, N.

        The actuator is that of the cylinder. A couple acts on the crank too.
        """
        applied = self.data.qfrc_applied
        applied[O2] = correction
        applied[A] = 0.0
        applied[O4] = 0.0
        if drive_bar is None:
            self.data.ctrl[self.ram] = size
            return
        for joint in _TURNED_BY[drive_bar]:
            applied[joint] += size

    def solve_drive(
        self,
        drive_bar: int | None,
        wanted: float,
        trials: tuple[float, float],
        correction: float = 0.0,
    ) -> float | None:
        """Solve for the couple or push that accelerates the crank (rad/s^2).

        None if it does not move the crank. The state is left under it, to be read.
        """

        def crank_acceleration(size: float) -> float:
            self.work(drive_bar, size, correction)
            mujoco.mj_forward(self.model, self.data)
            return float(self.data.qacc[O2])

        size = solve_couple(crank_acceleration, wanted, *trials)
        mujoco.mj_rnePostConstraint(self.model, self.data)
        return size

    def bad(self) -> int:
        """Return the number of warnings of a bad position, velocity or acceleration.

        MuJoCo resets the data at each of them.
        """
        return sum(self.data.warning[kind].number for kind in WARNINGS)


def solve_couple(
    acceleration: Callable[[float], float],
    wanted: float,
    low: float,
    high: float,
    refinements: int = 0,
) -> float | None:
    """Solve for the couple under which an acceleration is the wanted one.

    The acceleration is linear in it. The couple that was evaluated last is returned
    too. None where it does not depend on the couple. The difference of the two trials
    loses digits: each refinement, from where the couple before leads, brings some of
    them back.
    """
    at_low = acceleration(low)
    at_high = acceleration(high)
    slope = (at_high - at_low) / (high - low)
    if slope == 0.0 or not np.isfinite(slope):
        return None
    couple = low + (wanted - at_low) / slope
    for _ in range(refinements):
        missing = wanted - acceleration(couple)
        couple += missing / slope
    acceleration(couple)
    return float(couple)


LEAST_ACCELERATION = 1e-6
"""Acceleration of the driven joint, over that of the open tree's joints, that is not
told from none.
"""


def find_couple(
    model: mujoco.MjModel,
    data: mujoco.MjData,
    acceleration: Callable[[float], float],
    wanted: float,
) -> float | None:
    """Find the couple that gives an acceleration; NaN where none does.

    The couple that was evaluated last is returned too. None where the acceleration does
    not depend on the couple.

    Parameters
    ----------
    acceleration : evaluates `model` and `data` under a couple, N m, and returns an
        acceleration, rad/s^2.
    """
    free = acceleration(0.0)
    # without a couple it may already accelerate as wanted, to the rounding of the
    # others, which may vanish too: a bar that turns uniformly has omega^2
    speed = float(np.abs(data.qvel).max())
    others = max(float(np.abs(data.qacc_smooth).max()), speed * speed) or 1.0
    sought = max(abs(wanted - free), LEAST_ACCELERATION * others)
    trial = min(float(model.dof_M0.sum()) * sought, LARGEST_TRIAL)
    couple = solve_couple(acceleration, wanted, 0.0, trial, _REFINEMENTS)
    if couple is None or abs(acceleration(couple) - wanted) <= _MISSED * sought:
        return couple
    # the solver starts from the same accelerations at every trial, or its noise would
    # look like a jump
    start = data.qacc_warmstart.copy()

    def repeatable(size: float) -> float:
        data.qacc_warmstart[:] = start
        return acceleration(size)

    bracketed = bracket_couple(repeatable, wanted, trial, SOLVER_NOISE * sought)
    if bracketed is None:
        return math.nan
    return bracketed


def bracket_couple(
    acceleration: Callable[[float], float],
    wanted: float,
    trial: float,
    allowed: float,
) -> float | None:
    """Solve for the couple under which an acceleration is the wanted one.

    The couple that was evaluated last is returned too. The acceleration is continuous
    in the couple and need not be linear: dry friction, joint limits and clamped
    actuators make it piecewise linear. None where no couple gives the acceleration to
    within `allowed`.
    """
    from scipy.optimize import brentq

    def miss(couple: float) -> float:
        return acceleration(couple) - wanted

    sought = miss(0.0)
    if sought == 0.0:
        return 0.0
    above = below = 0.0
    for doubling in range(_DOUBLINGS):
        size = abs(trial) * 2.0**doubling
        for nearer, farther in ((above, size), (below, -size)):
            if miss(farther) * sought <= 0.0:
                couple = float(brentq(miss, nearer, farther, xtol=abs(trial) * 1e-15))
                left = abs(miss(couple))
                return couple if left <= allowed else None
        above = size
        below = -size
    return None
