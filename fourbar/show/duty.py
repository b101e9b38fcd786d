"""Loads of frame and pins over a motion, and the duty of the drive.

Bearings and a motor are chosen by them; the JSON of `analyze` has them.
"""

import math
from collections.abc import Iterable, Mapping
from typing import Any, NamedTuple

import numpy as np

from fourbar.effects.effect import Actions, list_bodies
from fourbar.errors import InputError, expect, needing
from fourbar.evaluation.case import compute_shown_state
from fourbar.formulas.arithmetic import cross
from fourbar.formulas.torque import inertia
from fourbar.linkage import MOVING_BARS, PIN_FORCE
from fourbar.quantities import JAMMED, WOUND, Array
from fourbar.scene import Command, Scene, find_signs
from fourbar.show.driving import is_once_round, name_places, read_drive_demand
from fourbar.show.motion_curves import MotionCurves, describe_motion, find_largest
from fourbar.solution import Conversion, Solution, find_unit_in
from fourbar.studies.paths import measure_paths


class BearingLoad(NamedTuple):
    """Load of one pin over a motion; None: it grows without bound."""

    largest: float | None
    """N."""
    rms: float | None
    """Root mean square, N. A list of positions that closes counts its two equal ends
    once.
    """
    where: float | None
    """theta_2 of the largest load, rad."""
    time: float | None = None
    """Time of it along a law or a release, s."""


class MotorDuty(NamedTuple):
    """Peak and root mean square over a motion, and the energy.

    None: it grows without bound, or is not defined.
    """

    peak_torque: float | None
    """Largest size, N m; None where the drive exerts a force."""
    rms_torque: float | None
    """N m."""
    peak_speed: float | None
    """Largest size of the speed of the drive. It is omega of the driven bar, rad/s, or
    the speed of the stroke or of the driven point, m/s.
    """
    peak_power: float | None
    """Largest size of T_k omega_k, or of force times speed, W."""
    rms_power: float | None
    """W."""
    energy_in: float | None
    """Energy from the drive to the linkage over the sweep, J. None: it does not move
    through two positions.
    """
    energy_out: float | None
    """Energy from the linkage back to the drive, J."""
    closed: bool
    """The sweep is one turn of the input, or several."""
    peak_force: float | None = None
    """Largest size of the force of a drive that exerts one, N."""
    rms_force: float | None = None
    mean_torque: float | None = None
    """Mean over the angle of the driven bar, N m. None: the sweep is not closed,
    another bar is commanded, or the drive exerts a force.
    """
    energy_swing: float | None = None
    """Largest minus smallest of the integral over time of power less mean power, J. A
    flywheel stores it. None: the sweep is not closed.
    """


DUTY_UNITS = {
    "peak_torque": "N m",
    "rms_torque": "N m",
    "peak_speed": "rad/s",
    "peak_power": "W",
    "rms_power": "W",
    "energy_in": "J",
    "energy_out": "J",
    "peak_force": "N",
    "rms_force": "N",
    "mean_torque": "N m",
    "energy_swing": "J",
}
"""SI unit of each number of `MotorDuty`. The speed of a drive that exerts a force is in
m/s.
"""


class _FromOutside(Actions):
    """Sums over what acts on the bars from outside: loads, weights, a driving force."""

    def pull(self, start: Any, end: Any, force: Any) -> None:
        """Leave out what acts between two bars, or a bar and the frame."""

    def pin_couple(self, pin: str, couple: Any) -> None:
        """Leave out what acts between two bars, or a bar and the frame."""


def shaking_force(solution: Solution) -> Array:
    """Return the force of the linkage on the frame, N, (n, 2), of a study (m, n, 2).

    By the momentum of the bars it is what acts on them from outside less the sum of m
    a_G: the force F21 + F41 = -(F12 + F14), and that of a linear drive or of springs
    with an end on the ground besides.
    """
    return _sum_on_frame(solution)[0].copy()


def shaking_moment(solution: Solution) -> Array:
    """Return the moment of the linkage on the frame about O2, N m, (n,) or (m, n).

    By the angular momentum of the bars about O2: -T - O4 x F14, and the moments of
    linear drives, springs and couples that act between bars and ground.
    """
    return _sum_on_frame(solution)[1].copy()


def _sum_on_frame(solution: Solution) -> tuple[Array, Array]:
    """Sum what acts on the bars from outside, and what their momentum gains.

    The solution keeps both sums, of which tables ask for one after the other.
    """
    F12 = _require_quantity(solution, "F12")
    kept = vars(solution)
    if "_on_frame" in kept:
        sums: tuple[Array, Array] = kept["_on_frame"]
        return sums
    scene = solution.stated.settled()
    bodies = list_bodies(scene.linkage, scene.effects)
    state = compute_shown_state(scene, solution.at)
    outside = _FromOutside(state, bodies).add((*scene.loads, *scene.effects))
    if scene.drive is not None:
        scene.drive.act(outside, _require_quantity(solution, "drive_force"))
    force = np.zeros(F12.shape[:-1], dtype=complex)
    moment = np.zeros(F12.shape[:-1])
    first_pins = (
        0.0j,
        state.lengths.a * state.direction(2),
        state.lengths.d * state.direction(1),
    )
    for bar, body, pin in zip(MOVING_BARS, bodies, first_pins, strict=True):
        x, y = np.moveaxis(solution[f"G{bar}"], -1, 0)
        a_x, a_y = np.moveaxis(solution[f"a_G{bar}"], -1, 0)
        on_bar = outside.forces.get(bar, 0.0)
        force += on_bar - body.m * (a_x + 1j * a_y)
        moment += cross(-on_bar, pin) + outside.moments.get(bar, 0.0)
        moment -= body.m * (x * a_y - y * a_x) + body.I * solution[f"alpha_{bar}"]
    has_none = np.isnan(F12).any(axis=-1)
    moment[has_none] = np.nan
    vectors = np.stack([force.real, force.imag], axis=-1)
    vectors[has_none] = np.nan
    kept["_on_frame"] = vectors, moment
    return vectors, moment


def bearing_load(solution: Solution, pin: str) -> BearingLoad:
    """Return largest and RMS load of pin "O2", "A", "B" or "O4", and the place.

    Loads of a sweep or a motion law are those of the whole motion, whatever its steps,
    and None where they grow without bound. Those of a list or of a released motion are
    of the positions that have a value.
    """
    if not isinstance(pin, str) or pin not in PIN_FORCE:
        raise InputError("pin", pin, "must be one of " + ", ".join(PIN_FORCE))
    name = PIN_FORCE[pin]
    motion = _describe_loads(solution)
    peak = motion.find_peak(name)
    if not math.isfinite(peak.value):
        return BearingLoad(None, None, None)
    where = motion.find_theta_2(peak.place)
    time = None if solution.time is None else peak.place
    rms = motion.find_rms(name)
    return BearingLoad(peak.value, None if math.isnan(rms) else rms, where, time)


def motor_duty(solution: Solution) -> MotorDuty | None:
    """Return peak and RMS torque and power, peak speed, and the energy in and out.

    E = integral of P dt, dt = d theta/omega of the commanded bar, or ds/speed of the
    stroke, in a sweep; E_in of the positive part of P, E_out of the negative.

    Over a closed sweep of the angle theta the mean torque is (E_in - E_out)/theta, with
    the sense of the rotation. A flywheel of inertia I on a bar that turns at about
    omega takes up the swing of the energy dE = max - min of integral (P - mean P) dt
    with a change of speed of omega dE/(I omega^2).

    Numbers of a sweep or a motion law are those of the whole motion, whatever its
    steps. Those of a list are of the positions that have a value, without energies.
    What grows without bound is None, and so are means and energies of a sweep with an
    acceleration, which passes its positions at no one speed, and the energies of a
    motion on a part of which no forces exist.

    Returns None where no position has a torque or force of the drive: a released
    linkage, or positions alone.

    Parameters
    ----------
    solution : positions of a scene, to the stage "force".
    """
    expect("solution", solution, Solution)
    drive = read_drive_demand(solution)
    if not np.isfinite(drive.values).any():
        return None
    motion = _describe_loads(solution)
    panels = motion.panels
    kind = "torque" if solution.drive is None else "force"
    numbers = dict.fromkeys(DUTY_UNITS, math.nan)
    for name, curve in ((kind, drive.keys.value), ("power", "power")):
        ways = motion.started if name == kind else [motion]
        numbers[f"peak_{name}"] = find_largest(curve, ways)
        numbers[f"rms_{name}"] = motion.find_rms(curve)
    numbers["peak_speed"] = abs(motion.find_peak("speed").value)
    closed = bool(is_once_round(solution)) and not motion.stretches
    # over a stretch without forces the energies would be those of a part, unsaid
    whole = not np.isin(solution.status_code, (WOUND, JAMMED)).any()
    second = motion.places_of_second
    if second and whole and panels.has_value("power"):
        integrals = panels.accumulate("power")
        work = np.diff(integrals) / second
        numbers["energy_in"] = float(work[work > 0.0].sum())
        numbers["energy_out"] = float(-work[work < 0.0].sum())
        if closed:
            given = integrals[-1]
            surplus = panels.accumulate("power", given / panels.length)
            numbers["energy_swing"] = float(np.ptp(surplus)) / second
            if solution.drive_bar == solution.at.bar:  # else it has another angle
                # the integral of the speed would be off by its rule
                angle = solution.at.angle
                sense = np.sign(np.mean(np.asarray(solution.at.speed)))
                turned = sense * abs(angle[-1] - angle[0])
                numbers["mean_torque"] = float(given / second / turned)
    bounded: dict[str, Any] = {
        name: number if math.isfinite(number) else None
        for name, number in numbers.items()
    }
    return MotorDuty(closed=closed, **bounded)


def _describe_loads(solution: Solution) -> MotionCurves:
    """Describe the motion of one scene by its curves; InputError for a study."""
    _require_quantity(solution, "F12")
    if solution.scene is None or solution.theta_2.ndim > 1:
        allowed = "must be of one scene: solve members of a study one by one"
        raise InputError("solution", solution, allowed)
    return describe_motion(solution)


def _require_quantity(solution: Solution, name: str) -> Array:
    expect("solution", solution, Solution)
    values: Array | None = getattr(solution, name)
    if values is None:
        raise InputError(
            "solution",
            name,
            "was not evaluated: solve up to the stage 'force'",
        )
    return values


def list_duty(solution: Solution, units: Conversion) -> dict[str, Any] | None:
    """Return the duty and the loads of the pins as the JSON has them.

    Numbers have the units of the output, and the keys are those of `motor_duty`.
    """
    if solution.F12 is None or not np.isfinite(solution.F12).any():
        return None
    duty = motor_duty(solution)
    si = DUTY_UNITS if solution.drive is None else {**DUTY_UNITS, "peak_speed": "m/s"}
    of_pin = {"peak": "N", "rms": "N", "theta_2": "rad", "time": "s"}
    return {
        "closed": bool(duty and duty.closed),
        **convert((getattr(duty, name, None) for name in si), si, units),
        "pins": {
            pin: convert(bearing_load(solution, pin), of_pin, units)
            for pin in PIN_FORCE
        },
        "units": {name: find_unit_in(unit, units)[0] for name, unit in si.items()},
    }


def convert(
    numbers: Iterable[Any], si: Mapping[str, str], units: Conversion
) -> dict[str, Any]:
    """Name numbers, or several of a kind, as their SI units are, and convert them."""
    return {
        name: None
        if number is None
        else np.multiply(number, find_unit_in(unit, units)[1]).tolist()
        for number, (name, unit) in zip(numbers, si.items(), strict=False)
    }


def collect_paths(solution: Solution, units: Conversion) -> dict[str, Any]:
    """Collect the paths as the JSON has them, by the name of the point."""
    _, place = name_places(solution)
    lengths = dict.fromkeys(("x", "y", "straightness", "stroke"), "m")
    si = {**lengths, "direction": "rad", "ends": place}
    return {
        name: convert(path, si, units) for name, path in measure_paths(solution).items()
    }


class _Energies(NamedTuple):
    """Energies at n instants, J."""

    kinetic: Array
    """(n,)."""
    work: dict[str, Array]
    """Work since the first instant, (n,). It is that of all loads together, and of each
    effect that does any.
    """


def compute_energies(scene: Scene, motion: Solution) -> _Energies:
    """Compute the kinetic energy, and the work of each effect and of the loads.

        T = J omega_2^2/2, J the equivalent inertia,
        W(t) = integral of the power, by a cubic spline through the instants.

    Raises DependencyError where SciPy is not installed.
    """
    with needing("SciPy is needed for free motion", "studies"):
        from scipy.interpolate import CubicSpline
    scene = scene.settled()
    assembly = find_signs(scene.linkage, motion.theta_2, motion.branch)
    of_input = Command(motion.theta_2, assembly, motion.omega_2, 0.0)
    state = compute_shown_state(scene, of_input)
    groups: dict[str, tuple[Any, ...]] = {"loads": scene.loads}
    groups |= {effect.key: (effect,) for effect in scene.effects}
    work = {}
    for name, terms in groups.items():
        Q, _ = (
            Actions(state, list_bodies(scene.linkage)).add(terms).generalized_forces()
        )
        power = np.zeros(len(motion)) + Q * motion.omega_2
        finite = np.isfinite(power)  # bars 3 and 4 in line: the velocities are 0/0
        if np.count_nonzero(finite) > 1 and np.any(power[finite]):
            spline = CubicSpline(motion.time[finite], power[finite])
            work[name] = spline.antiderivative()(motion.time)
    bodies = list_bodies(scene.linkage, scene.effects)
    length = scene.linkage.input.length
    J = sum(inertia(length, bodies, state.position, state.k))
    return _Energies(np.asarray(0.5 * J * np.square(motion.omega_2)), work)
