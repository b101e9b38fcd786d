"""What frame and pins bear over a motion and what the drive delivers, to choose bearings and a motor; its energy."""

from typing import Any, NamedTuple

import numpy as np

from fourbar.effects.actions import Actions, bodies
from fourbar.errors import DependencyError, InputError, expect, installing
from fourbar.evaluation.case import state_at
from fourbar.formulas.arithmetic import dot
from fourbar.formulas.motion import State
from fourbar.linkage import MOVING_BARS, PIN_FORCE, FourBar
from fourbar.scene import Command, Scene
from fourbar.solution import Array, Conversion, Solution, unit_in


class BearingLoad(NamedTuple):
    """Load of one pin over the positions of a solution."""

    largest: float
    """N."""
    rms: float
    """Root mean square over the positions, N; a closed sweep counts its two equal ends once."""
    where: float
    """theta_2 of the largest load, rad."""


def _evaluated(solution: Solution, name: str) -> Array:
    expect("solution", solution, Solution)
    force: Array | None = getattr(solution, name)
    if force is None:
        raise InputError("solution", name, "was not evaluated: solve up to the stage 'force'")
    return force


def shaking_force(solution: Solution) -> Array:
    """Force of the bars on the frame through its pins, F21 + F41 = -(F12 + F14), N, (n, 2).

    A spring with one end on the ground pulls there besides.
    """
    return -(_evaluated(solution, "F12") + _evaluated(solution, "F14"))


def shaking_moment(linkage: FourBar, solution: Solution) -> Array:
    """Moment of the bars and of the drive on the frame about O2, -T - O4 x F14, N m, (n,).

    Couples that effects exert between the bars and ground (pin damping or friction at O2, O4)
    are not part of it.
    """
    expect("linkage", linkage, FourBar)
    F14, torque = _evaluated(solution, "F14"), _evaluated(solution, "torque")
    x, y = linkage.ground * np.cos(linkage.ground_angle), linkage.ground * np.sin(linkage.ground_angle)
    return np.asarray(-torque - (x * F14[:, 1] - y * F14[:, 0]))


def drive_power(solution: Solution) -> Array:
    """T_k omega_k, W, (n,)."""
    return np.asarray(_evaluated(solution, "torque") * _evaluated(solution, f"omega_{solution.drive_bar}"))


def once_round(solution: Solution) -> slice:
    """All positions, but of a sweep over whole turns not the last one, which repeats the first."""
    angle: Array = getattr(solution, solution.commanded)
    turns = abs(angle[-1] - angle[0]) / (2.0 * np.pi)
    closed = len(solution) > 1 and turns > 0.5 and np.isclose(turns, round(turns), rtol=1e-12, atol=0.0)
    return slice(None, -1 if closed else None)


def bearing_load(solution: Solution, pin: str) -> BearingLoad:
    """Largest and root mean square load of pin "O2", "A", "B" or "O4", and where; NaN positions are left out."""
    if not isinstance(pin, str) or pin not in PIN_FORCE:
        raise InputError("pin", pin, "the pins are " + ", ".join(PIN_FORCE))
    loads = np.hypot(*_evaluated(solution, PIN_FORCE[pin]).T)
    one = once_round(solution)
    load, theta_2 = loads[one], solution.theta_2[one]
    known = np.isfinite(load)
    if not known.any():
        return BearingLoad(float("nan"), float("nan"), float("nan"))
    load, theta_2 = load[known], theta_2[known]
    worst = int(np.argmax(load))
    return BearingLoad(float(load[worst]), _rms(load), float(theta_2[worst]))


class MotorDuty(NamedTuple):
    """Peak and root mean square over the positions (a closed sweep counts its two equal ends once), and the energy."""

    peak_torque: float
    """Largest size, N m."""
    rms_torque: float
    """N m."""
    peak_speed: float
    """Largest size of omega of the driven bar, rad/s."""
    peak_power: float
    """Largest size of T_k omega_k, W."""
    rms_power: float
    """W."""
    energy_in: float | None
    """That the drive gives to the linkage over the sweep, J; None where it does not move through two positions."""
    energy_out: float | None
    """That the linkage gives back, J."""
    closed: bool
    """The sweep is one turn of the input, or several."""


DUTY_UNITS = {
    **{"peak_torque": "N m", "rms_torque": "N m", "peak_speed": "rad/s", "peak_power": "W", "rms_power": "W"},
    **{"energy_in": "J", "energy_out": "J"},
}


def motor_duty(solution: Solution) -> MotorDuty | None:
    """Peak and RMS torque and power, peak speed, and the energy in and out by the trapezoidal rule.

    E = integral of P dt, dt = d theta/omega of the commanded bar in a sweep; E_in of the positive part of P, E_out of
    the negative.
    Positions without a value are left out, and so are the steps from and to them.

    Returns None where no position has a torque: a released linkage, or positions alone.

    Parameters
    ----------
    solution : (n,) positions of a sweep or of a motion law, to the stage "force".
    """
    expect("solution", solution, Solution)
    if solution.torque is None or not np.isfinite(solution.torque).any():
        return None
    power = drive_power(solution)
    speed: Array = getattr(solution, f"omega_{solution.drive_bar}")
    one = once_round(solution)
    energy_in, energy_out = _energy(solution, power)
    return MotorDuty(
        _peak(solution.torque),
        _rms(solution.torque[one]),
        _peak(speed),
        _peak(power),
        _rms(power[one]),
        energy_in,
        energy_out,
        one.stop is not None,
    )


def _energy(solution: Solution, power: Array) -> tuple[float | None, float | None]:
    """Integrate the positive and the negative part of the power, each over time."""
    omega = getattr(solution, solution.commanded.replace("theta", "omega"))
    if solution.time is not None:
        spans = np.diff(solution.time)
    elif omega is not None and np.all(omega != 0.0):
        spans = np.abs(np.diff(getattr(solution, solution.commanded)) / omega[:-1])
    else:
        return None, None
    parts = [0.5 * spans * (part[:-1] + part[1:]) for part in (np.maximum(power, 0.0), np.maximum(-power, 0.0))]
    if not np.isfinite(parts[0]).any():
        return None, None
    energy_in, energy_out = (float(np.nansum(part)) for part in parts)
    return energy_in, energy_out


def _peak(values: Array) -> float:
    return float(np.nanmax(np.abs(values)))


def _rms(values: Array) -> float:
    return float(np.sqrt(np.nanmean(np.square(values))))


def motor_entry(solution: Solution, units: Conversion) -> dict[str, Any] | None:
    """Write the duty and the loads of the pins as the JSON has them, in the units of the output."""
    duty = motor_duty(solution)
    if duty is None:
        return None
    entry: dict[str, Any] = {"closed": duty.closed}
    for name, unit in DUTY_UNITS.items():
        number = getattr(duty, name)
        entry[name] = None if number is None else number * unit_in(unit, units)[1]
    force, angle = unit_in("N", units)[1], unit_in("rad", units)[1]
    loads = {pin: bearing_load(solution, pin) for pin in PIN_FORCE}
    entry["pins"] = {
        pin: {"peak": load.largest * force, "rms": load.rms * force, "theta_2": load.where * angle}
        for pin, load in loads.items()
    }
    entry["units"] = {name: unit_in(unit, units)[0] for name, unit in DUTY_UNITS.items()}
    return entry


class Energies(NamedTuple):
    """Energies at n instants, J."""

    kinetic: Array
    """(n,)."""
    work: dict[str, Array]
    """Done since the first instant, (n,): by all loads together, and by each effect that does any."""


def energies(scene: Scene, motion: Solution) -> Energies:
    """Kinetic energy, and the work of each effect and of the loads.

    T = sum of m v_G^2/2 + I omega^2/2;   W(t) = integral of the power, by a cubic spline through the instants.

    Raises DependencyError where SciPy is not installed.
    """
    try:
        from scipy.interpolate import CubicSpline
    except ModuleNotFoundError:
        raise DependencyError(f"SciPy is needed for free motion: {installing('dynamics')}") from None
    assert motion.time is not None and motion.omega_2 is not None
    state = state_at(scene, Command(motion.theta_2, motion.branch, motion.omega_2, 0.0))
    groups = {"loads": scene.loads, **{effect.key: (effect,) for effect in scene.effects}}
    work = {}
    for name, terms in groups.items():
        actions = Actions(state, bodies(scene.linkage))
        for term in terms:
            term.act(actions, state)
        power = np.zeros(len(motion)) + actions.work()[0] * motion.omega_2
        known = np.isfinite(power)  # bars 3 and 4 in line: the velocities are 0/0
        if np.count_nonzero(known) > 1 and np.any(power[known]):
            work[name] = CubicSpline(motion.time[known], power[known]).antiderivative()(motion.time)
    return Energies(_kinetic(scene, state), work)


def _kinetic(scene: Scene, state: State) -> Array:
    total = np.zeros(len(state.theta_2))
    for number, body in zip(MOVING_BARS, bodies(scene.linkage, scene.effects), strict=True):
        v = state.velocity(number, body.z)
        total = total + 0.5 * body.m * dot(v, v) + 0.5 * body.I * np.square(state.omega(number))
    return total
