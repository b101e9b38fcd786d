"""The generated MJCF as it is shipped.

Checked is that the file opens closed, that its keyframe moves at omega_2, and that its
drive brings it there.
"""

import math
from dataclasses import replace

import mujoco
import numpy as np

from fourbar.errors import InputError, LimitError, NotAssembledError
from fourbar.mjcf import write_mjcf
from fourbar.scene import Command, Scene, with_signs
from fourbar.scene.motion import BRANCH_NAMES
from fourbar_validation.compare.rows import UNDECIDED, Row
from fourbar_validation.compare.tolerance import EPS, SIMULATED, K, wrap_difference
from fourbar_validation.engines.limits import (
    FASTEST,
    NEAREST_TOGGLE,
    QUICKEST_START,
    compute_least_sine,
    find_exceeded,
    find_uneven,
)
from fourbar_validation.engines.mujoco.closed_loop import O2, ClosedLoop

SIMULATED_NAME = "mujoco-simulated"
QUANTITY = "as shipped"
LARGEST_GAP = 1e4 * K * EPS
"""Gap in parts of the lengths, and gap speed in parts of the speeds: one rounding near
a limit position, where |sin mu| is 1e-4 and less MuJoCo is not run.
"""
SERVO_STEPS = 200
"""Timesteps after which the servo has brought the input to its speed, to e^-100. Its
time constant is two steps.
"""
SPEED_ERROR = 100.0 * SIMULATED.factor
"""Allowed error of the speed, from loads and the closure in as many steps: ten times
what was measured.
"""


def compare_shipped(
    name: str,
    scene: Scene,
    command: Command,
) -> Row | None:
    """Compare the file's rest pose, its keyframe and its drive.

    Give the worst; None if nothing moves.
    """
    omega = scene.motion.omega_2
    if scene.motion.has_rate_of_each or not omega or scene.motion.law is not None:
        return None
    try:
        loop = ClosedLoop(write_mjcf(scene))
    except (
        InputError,
        LimitError,
        NotAssembledError,
    ):  # no file is shipped; the simulation's own row says why
        return None
    d = loop.data
    size = math.fsum(scene.linkage.lengths)
    departures: dict[str, float] = {}
    """Parts of what is allowed, by what departs."""

    def require_closed(what: str) -> Command:
        mujoco.mj_forward(loop.model, d)
        gap = math.hypot(*loop.gap())
        departures[f"{what}: the loop is open"] = gap / (LARGEST_GAP * size)
        here = _find_commanded(command, float(d.qpos[O2]), omega)
        # of an assembly the sign changes at a change point
        same = loop.branch() == with_signs(scene.linkage, here).branch[0]
        name_of_branch = BRANCH_NAMES[int(here.branch[0])]
        departures[f"{what}: not {name_of_branch}"] = 0.0 if same else math.inf
        return here

    mujoco.mj_resetData(loop.model, d)
    require_closed("as it opens")
    mujoco.mj_resetDataKeyframe(loop.model, d, 0)
    first = float(require_closed("keyframe").theta_2[0])
    apart = abs(math.remainder(first - float(d.qpos[O2]), math.tau))
    slip = float(np.hypot(*(loop.jacobian() @ d.qvel[:3])))
    fastest = float(np.abs(d.qvel).max())
    rounding = K * EPS
    departures |= {
        "keyframe: theta_2 is none of the scene's": apart
        / (rounding * max(1.0, abs(first))),
        "keyframe: omega_2": abs(float(d.qvel[O2]) / omega - 1.0) / rounding,
        "keyframe: the bars' speeds open the loop": slip
        / (LARGEST_GAP * size * fastest),
    }
    driven = SERVO_STEPS * loop.model.opt.timestep
    due = omega
    if scene.motion.alpha_2 == 0.0:  # a servo; from rest as the file opens
        mujoco.mj_resetData(loop.model, d)
    else:  # a motor: on from the keyframe
        due += scene.motion.alpha_2 * driven
    beyond = _find_not_driven(scene, float(d.qpos[O2]), driven)
    if beyond is None:
        mujoco.mj_step(loop.model, d, SERVO_STEPS)
        missed = abs(float(d.qvel[O2]) - due)
        lost = d.time < 0.5 * driven
        reason = (
            f"after {SERVO_STEPS} steps the input turns at {d.qvel[O2]:.6g} of"
            f" {due:.6g} rad/s"
        )
        allowed = SPEED_ERROR * max(abs(omega), abs(due))
        departures[reason] = math.inf if lost else missed / allowed
        if not departures[reason] <= 1.0:
            beyond = _find_excuse(scene, loop, fastest, lost=lost)
            if beyond:
                del departures[reason]
    reason, error = max(
        departures.items(), key=lambda one: math.inf if math.isnan(one[1]) else one[1]
    )
    row = Row.judged(
        (name, SIMULATED_NAME, "shipped"),
        QUANTITY,
        error,
        1.0,
        reason,
        float(d.qpos[O2]),
    )
    if beyond is None or row.failed:
        return row
    reason = f"the drive is not judged: {beyond}"
    return replace(row, verdict=UNDECIDED, reason=reason)


def _find_commanded(
    command: Command,
    theta_2: float,
    omega_2: float,
) -> Command:
    """Return the command at an angle of bar 2, whatever turn it is of.

    The nearest position counts; of several turns the first in the direction of motion,
    where the file begins.
    """
    apart = np.abs(wrap_difference(command.theta_2 - theta_2))
    rounding = K * EPS * np.maximum(1.0, np.abs(command.theta_2))
    nearest = np.flatnonzero(apart <= apart.min() + rounding)
    in_time = math.copysign(1.0, omega_2) * command.theta_2[nearest]
    return command.part(nearest[[np.argmin(in_time)]])


def _find_not_driven(
    scene: Scene,
    theta_2: float,
    seconds: float,
) -> str | None:
    """Name the declared limit of the simulation that the first steps meet, if any."""
    omega_2 = scene.motion.omega_2 or 0.0
    if abs(omega_2) > FASTEST.boundary:
        return FASTEST.reason
    ahead = np.array([theta_2, theta_2 + omega_2 * seconds])
    least = compute_least_sine(scene.linkage, ahead, np.array([True, True]))
    return None if least >= NEAREST_TOGGLE.boundary else NEAREST_TOGGLE.reason


def _find_excuse(
    scene: Scene, loop: ClosedLoop, fastest: float, *, lost: bool
) -> str | None:
    """Name the declared limit by which a drive may miss its speed, if any.

    `fastest`: greatest speed of a bar at the start, rad/s. `lost`: the data were reset.
    """
    quickest = QUICKEST_START.boundary * 2.0 * loop.model.opt.timestep
    if scene.motion.alpha_2 == 0.0 and fastest > quickest:
        return QUICKEST_START.reason
    exceeded = find_exceeded(scene, abs(scene.motion.omega_2 or 0.0))
    if exceeded is None and (lost or loop.bad()):
        return find_uneven(scene)
    return exceeded
