"""What a drive has to deliver over a motion: torque, power, speed and energy, for the choice of a motor."""

from typing import Any, NamedTuple

import numpy as np

from fourbar.errors import expect
from fourbar.linkage import PIN_FORCE
from fourbar.show.bearing import bearing_load, drive_power, once_round
from fourbar.solution import Array, Conversion, Solution, unit_in


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

    E = integral of P dt, dt = d theta_2/omega_2 in a sweep; E_in of the positive part of P, E_out of the negative.
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
    """The positive and the negative part of the power, each over time."""
    omega_2 = solution.omega_2
    if solution.time is not None:
        spans = np.diff(solution.time)
    elif omega_2 is not None and np.all(omega_2 != 0.0):
        spans = np.abs(np.diff(solution.theta_2) / omega_2[:-1])
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
    """The duty and the loads of the pins as the JSON has them, in the units of the output."""
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
