"""Monitor a simulation's own error.

The error is judged by the loop's residuals, the power balance, and what both do to the
answer. A small closure gap proves little: an explicit step with a closure stiffer than
it can follow holds the gap at micrometres while accelerations and forces are anything.
At every sample this asks

- how far the loop is open in position, in velocity (J v) and in acceleration
  (J a + J' v),
- whether the drive's power is that of the moving bars:
      T_k omega_k = v . (M a + bias - applied),
- whether the forces that were read carry the bars:
      J^T F43 + e_k T_k = M a + bias - applied,
- how far speeds, accelerations, forces and torque would move if the loop were closed
  exactly at the same theta_2, omega_2, alpha_2: the error to expect, by MuJoCo's own
  inverse dynamics.

The bars alone are evaluated, without flywheel, motor and closure, on data of their own.
"""

import math
from dataclasses import dataclass

import mujoco
import numpy as np

from fourbar.quantities import COUPLE, LINE, PIN_FORCES, Array
from fourbar_validation.compare.tolerance import EPS
from fourbar_validation.engines.mujoco.closed_loop import (
    FRICTION_ROWS,
    O2,
    O4,
    A,
    ClosedLoop,
)
from fourbar_validation.engines.tree import put_back, solve_closed, solve_multipliers

RESIDUALS = ("acceleration_gap", "power_gap", "force_gap")
"""Residuals of motion and forces that `ResidualMonitor` measures."""
_LIMITS = {
    "bad_states": (
        0.0,
        "MuJoCo warned of a bad position, velocity or acceleration, and reset its data",
    ),
    "time_went_back": (0.0, "the time ran backwards: the data were reset"),
    "closure_gap": (1e-5, "of the sum of the lengths: the loop is open"),
    "speed_error": (
        1e-4,
        "of the greatest speed: the crank does not turn as commanded",
    ),
    "acceleration_gap": (
        1e-3,
        "of the greatest a_B: healthy runs have 1e-7..1e-4, a step that errs by 98 %"
        " has 4",
    ),
    "power_gap": (
        1e-4,
        "of the greatest power: healthy runs have 1e-8..1e-5, that step 4e-2, a stopped"
        " solver 1",
    ),
    "force_gap": (
        1e-3,
        "of the greatest joint torque: the solver did not converge; healthy runs have"
        " 1e-8..1e-4",
    ),
}
"""Greatest allowed value of each residual, and the reason."""
_EXCUSED = 1e-3
"""A solver's residual excuses an error of this part of a force, not more."""
_ROUNDINGS = 4.0
"""Roundings of the flywheel's torque, which is taken away from what drives it."""


def list_alarms(
    evidence: dict[str, float], size: float, factor: float
) -> dict[str, str]:
    """Say what is wrong with a run, by the residual that is too large.

    Parameters
    ----------
    evidence : the worst of each residual over the run.
    size : sum of the lengths, m.
    factor : max(1, N/K) of the drive's torque or force, by which residuals of forces
        may be larger where its terms cancel.
    """
    seen = {**evidence, "closure_gap": evidence["closure_gap_m"] / size}
    alarms = {}
    for name, (limit, reason) in _LIMITS.items():
        # residuals relative to forces, whose terms may cancel
        most = limit * factor if name in ("power_gap", "force_gap") else limit
        if name in seen and not seen[name] <= most:
            alarms[name] = f"{name} = {seen[name]:.1e} > {most:g}: {reason}"
    return alarms


def softens_friction(loop: ClosedLoop) -> bool:
    """Tell whether dry friction somewhere is below its full torque.

    A slip that is slow for the bars' inertia is held by a soft constraint, whose
    force is no number that the scene states.
    """
    d = loop.data
    soft = d.efc_state == mujoco.mjtConstraintState.mjCNSTRSTATE_QUADRATIC
    return bool(np.any(soft & np.isin(d.efc_type, FRICTION_ROWS)))


@dataclass(slots=True)
class _MonitoredMotion:
    """The bars at one position, velocity and acceleration."""

    gap: Array
    """B on bar 3 minus B on bar 4, (2,), m."""
    slip: Array
    """Rate of the gap, m/s."""
    jerk: Array
    """Second derivative of the gap, m/s^2."""
    a_B: Array
    jacobian: Array
    """Derivative of the gap by the joint angles, (2, 3)."""
    drive: Array
    """Derivative of what is driven by the joint angles, (3,). Driven is the bar's
    rotation, or the cylinder's stroke.
    """
    needed: Array
    """Torque of the motion in each joint beyond loads and effects, (3,), N m."""
    answer: dict[str, Array]
    """theta, omega, alpha of bars 3 and 4, and the result of inverse dynamics."""


class ResidualMonitor:
    """Looks at a simulated motion with the bars alone, sample after sample."""

    def __init__(self, bars: ClosedLoop, drive_bar: int | None) -> None:
        self.bars = bars
        self.drive_bar = drive_bar
        self.drive = (COUPLE if drive_bar else LINE).value
        model = self.bars.model
        model.dof_armature[:] = 0.0
        model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_EQUALITY
        if self.bars.drive is not None:
            model.actuator_biastype[self.bars.drive] = mujoco.mjtBias.mjBIAS_NONE
        self.worst = dict.fromkeys(RESIDUALS, 0.0)
        self._most = dict.fromkeys(RESIDUALS, 0.0)

    def look(
        self,
        loop: ClosedLoop,
        read: ClosedLoop,
        torque: float,
        loop_force: Array,
    ) -> dict[str, float]:
        """Take in a forwarded state, and return the error to expect of each quantity.

        The drive's torque and F43 are as read, of the loop `read`.
        """
        data = loop.data
        q, v, a = (x.copy() for x in (data.qpos, data.qvel, data.qacc))
        seen = self._motion(q, v, a)
        closing = float(np.hypot(*seen.jerk))
        self._keep("acceleration_gap", closing, float(np.hypot(*seen.a_B)))
        # at a pole of T3 or T4 the speed of the driven bar, which vanishes, is as
        # uncertain as the others
        lever = float(np.abs(seen.drive).max())
        power = torque * float(seen.drive @ v)
        terms = abs(torque) * lever * float(np.abs(v).max())
        terms += float(np.abs(seen.needed * v).sum())
        self._keep("power_gap", abs(power - float(seen.needed @ v)), terms)
        carried = seen.jacobian.T @ loop_force
        unbalanced = float(np.linalg.norm(seen.needed - carried - seen.drive * torque))
        acting = float(np.linalg.norm(seen.needed) + np.linalg.norm(carried))
        self._keep("force_gap", unbalanced, acting)
        try:
            closed = self._close(q, v, a, seen)
            rates = solve_closed(seen.jacobian, 1.0)
        except np.linalg.LinAlgError:
            # exactly at a limit position nothing closes the loop
            return dict.fromkeys(seen.answer, math.inf)
        expected = {
            name: float(np.linalg.norm(value - closed.answer[name]))
            for name, value in seen.answer.items()
        }
        # remainder of the solver: the pin forces differ by as much as F43
        of_pins = float(np.linalg.norm(loop_force - seen.answer["F43"]))
        remaining = dict.fromkeys(PIN_FORCES, of_pins)
        remaining[self.drive] = abs(torque - float(seen.answer[self.drive]))
        for name, error in remaining.items():
            size = float(np.linalg.norm(seen.answer[name]))
            if name == COUPLE.value:
                size = max(size, float(np.linalg.norm(seen.needed)))
            expected[name] += min(error, _EXCUSED * size)
        # the drive does what the flywheel's torque leaves; their powers are compared
        flywheel = read.model.dof_armature[O2] * a[O2]
        with np.errstate(divide="ignore", invalid="ignore"):
            rounding = abs(float(flywheel / (seen.drive @ rates)))
        expected[self.drive] += _ROUNDINGS * EPS * rounding
        return expected

    def _keep(
        self,
        name: str,
        value: float,
        size: float,
    ) -> None:
        if not math.isfinite(value):
            value = math.inf
        self.worst[name] = max(self.worst[name], value)
        self._most[name] = max(self._most[name], size)

    def evidence(self) -> dict[str, float]:
        """Return the worst of each residual, relative to its largest term."""
        return {
            name: worst / (self._most[name] or 1.0)
            for name, worst in self.worst.items()
        }

    def _motion(
        self,
        q: Array,
        v: Array,
        a: Array,
    ) -> _MonitoredMotion:
        bars = self.bars
        data = bars.data
        data.qpos[:] = q
        data.qvel[:] = v
        data.qacc[:] = a
        mujoco.mj_inverse(bars.model, data)
        mujoco.mj_fwdActuation(bars.model, data)
        jacobian = bars.jacobian()
        rate_3 = bars.rate_at("B3")
        rate_4 = bars.rate_at("B4")
        needed = data.qfrc_inverse - data.qfrc_actuator
        drive = bars.drive_column(self.drive_bar)
        answer: dict[str, Array] = {}
        for name, x in (("theta", q), ("omega", v), ("alpha", a)):
            answer[f"{name}_3"] = x[O2] + x[A]
            answer[f"{name}_4"] = x[O4]
        try:
            multipliers = np.array(solve_multipliers(jacobian, drive, needed.tolist()))
        except np.linalg.LinAlgError:
            multipliers = np.full(3, np.inf)
        loop_force = multipliers[:2]
        answer["F43"] = loop_force
        answer[self.drive] = multipliers[2]
        answer |= self._compute_pins(loop_force, float(multipliers[2]))
        return _MonitoredMotion(
            gap=np.array(bars.gap()),
            slip=jacobian @ v,
            jerk=jacobian @ a + (rate_3 - rate_4) @ v,
            a_B=bars.jacobian_at("B4") @ a + rate_4 @ v,
            jacobian=jacobian,
            drive=drive,
            needed=needed,
            answer=answer,
        )

    def _compute_pins(self, loop_force: Array, drive: float) -> dict[str, Array]:
        """Return F12, F32, F14 in N, from the open tree and the closing force."""
        bars = self.bars
        d = self.bars.data
        if self.drive_bar is None:  # its line crosses the pins, a couple does not
            d.ctrl[bars.ram] = drive
            mujoco.mj_fwdActuation(bars.model, d)
            d.ctrl[bars.ram] = 0.0
        mujoco.mj_rnePostConstraint(bars.model, d)
        on = {bar: complex(*force) for bar, force in bars.joint_forces().items()}
        pins = put_back(on, complex(*loop_force))
        return {name: np.array(force) for name, force in pins.items()}

    def _close(
        self,
        q: Array,
        v: Array,
        a: Array,
        seen: _MonitoredMotion,
    ) -> _MonitoredMotion:
        """Return the motion with the loop closed at the same theta_2, omega_2, alpha_2.

        One Newton step closes each of position, velocity and acceleration.
        """
        state = q.copy(), v.copy(), a.copy()
        others = [A, O4]
        for values, opening in zip(state, ("gap", "slip", "jerk"), strict=True):
            jacobian = seen.jacobian[:, others]
            values[others] -= np.linalg.solve(jacobian, getattr(seen, opening))
            seen = self._motion(*state)
        return seen
