"""Loads of frame and pins over a motion, and the duty of the drive.

Bearings and a motor are chosen by them; the JSON of `analyze` has them.
"""

import warnings
from collections.abc import Iterable
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
from fourbar.show.driving import Driving, is_once_round, read_drive_demand
from fourbar.show.motion_curves import describe_motion
from fourbar.solution import Conversion, Solution, find_unit_in, where_assembled


class BearingLoad(NamedTuple):
    """Load of one pin over a motion.

    Of a study each number is an array (m,). None: the load grows without bound.
    """

    largest: float | None
    """N."""
    rms: float | None
    """Root mean square, N. A list of positions that closes counts its two equal ends
    once.
    """
    where: float | None
    """theta_2 of the largest load, rad."""


class MotorDuty(NamedTuple):
    """Peak and root mean square over a motion, and the energy.

    Of a study each is an array (m,). None: it grows without bound, or is not defined.
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
    return _balance_momentum(solution)[0].copy()


def shaking_moment(solution: Solution) -> Array:
    """Return the moment of the linkage on the frame about O2, N m, (n,) or (m, n).

    By the angular momentum of the bars about O2: -T - O4 x F14, and the moments of
    linear drives, springs and couples that act between bars and ground.
    """
    return _balance_momentum(solution)[1].copy()


def _balance_momentum(solution: Solution) -> tuple[Array, Array]:
    """Return the force on the frame and its moment about O2, which the solution keeps.

    Force and moment are those of the momentum of the bars.
    """
    expect("solution", solution, Solution)
    kept = vars(solution)
    if "_on_frame" not in kept:
        kept["_on_frame"] = _sum_on_frame(solution)
    on_frame: tuple[Array, Array] = kept["_on_frame"]
    return on_frame


def _sum_on_frame(solution: Solution) -> tuple[Array, Array]:
    """Sum what acts on the bars from outside, and what their momentum gains."""
    F12 = _require_quantity(solution, "F12")
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
    return vectors, moment


def bearing_load(solution: Solution, pin: str) -> BearingLoad:
    """Return largest and RMS load of pin "O2", "A", "B" or "O4", and the place.

    Of a sweep or a motion law of one scene they are those of the whole motion, whatever
    its steps, and None where the load grows without bound. Of a list, a released motion
    or a study they are those of the positions that have a value, of a study arrays
    (m,).
    """
    if not isinstance(pin, str) or pin not in PIN_FORCE:
        raise InputError("pin", pin, "must be one of " + ", ".join(PIN_FORCE))
    name = PIN_FORCE[pin]
    force = _require_quantity(solution, name)
    if not _is_one_scene(solution):
        load = np.hypot(force[..., 0], force[..., 1])
        load = np.where(np.isfinite(load), load, np.nan)
        worst = np.argmax(np.nan_to_num(load, nan=-1.0), axis=-1)[..., None]
        theta_2 = np.where(np.isfinite(load), solution.theta_2, np.nan)
        place = _reduce_to_number(np.take_along_axis(theta_2, worst, axis=-1)[..., 0])
        return BearingLoad(_reduce(np.nanmax, load), _find_rms(solution, load), place)
    motion = describe_motion(solution)
    peak = motion.find_peak(name)
    if peak is None:
        return BearingLoad(None, None, None)
    where = motion.find_theta_2(peak.place)
    return BearingLoad(peak.value, motion.find_rms(name), where)


def motor_duty(solution: Solution) -> MotorDuty | None:
    """Return peak and RMS torque and power, peak speed, and the energy in and out.

    E = integral of P dt, dt = d theta/omega of the commanded bar, or ds/speed of the
    stroke, in a sweep; E_in of the positive part of P, E_out of the negative.

    Over a closed sweep of the angle theta the mean torque is (E_in - E_out)/theta, with
    the sense of the rotation. A flywheel of inertia I on a bar that turns at about
    omega takes up the swing of the energy dE = max - min of integral (P - mean P) dt
    with a change of speed of omega dE/(I omega^2).

    Of a sweep or a motion law of one scene all are those of the whole motion, whatever
    its steps. Of a list or a study they are those of the positions that have a value,
    the energies by the trapezoidal rule. What grows without bound is None, and so are
    means and energies of a sweep with an acceleration, which passes its positions at no
    one speed, and the energies of a motion on a part of which no forces exist.

    Returns None where no position has a torque or force of the drive: a released
    linkage, or positions alone.

    Parameters
    ----------
    solution : positions of a sweep or of a motion law, to the stage "force"; or of a
        study of one.
    """
    expect("solution", solution, Solution)
    drive = read_drive_demand(solution)
    if drive.values is None or not np.isfinite(drive.values).any():
        return None
    _require_quantity(solution, "power")
    if _is_one_scene(solution) and describe_motion(solution).panels.located:
        return _integrate_duty(solution, drive)
    return _sum_duty(solution, drive)


def _is_one_scene(solution: Solution) -> bool:
    """Return True if the solution is one of a scene, with all that it needs."""
    quantities = (solution.sin_mu, solution.a_G4, solution.power, solution.F12)
    complete = all(values is not None for values in quantities)
    return complete and solution.scene is not None and solution.theta_2.ndim == 1


def _integrate_duty(solution: Solution, drive: Driving) -> MotorDuty:
    """Find the duty over a motion from its curves."""
    motion = describe_motion(solution)
    panels = motion.panels
    name = drive.keys.value
    # over a stretch without forces the energies would be those of a part, unsaid
    whole = not np.isin(solution.status_code, (WOUND, JAMMED)).any()

    def find_largest(curve: str) -> float | None:
        peak = motion.find_peak(curve)
        return peak and abs(peak.value)

    peak = find_largest(name)
    rms = motion.find_rms(name)
    duty = MotorDuty(
        **_name_effort(solution, peak, rms),
        peak_speed=find_largest("speed"),
        peak_power=find_largest("power"),
        rms_power=motion.find_rms("power"),
        energy_in=None,
        energy_out=None,
        closed=bool(is_once_round(solution)) and not motion.stretches,
    )
    second = motion.places_of_second
    if not second or not whole or not panels.has_value("power"):
        return duty
    work = np.diff(panels.accumulate("power")) / second
    duty = duty._replace(
        energy_in=float(work[work > 0.0].sum()),
        energy_out=float(-work[work < 0.0].sum()),
    )
    if not duty.closed:
        return duty
    given = panels.integrate("power")
    surplus = panels.accumulate("power", given / panels.length)
    mean_torque = None
    if solution.drive_bar == solution.at.bar:  # none of a drive that exerts a force
        mean_torque = _find_mean_torque(solution, given / second)
    return duty._replace(
        energy_swing=float(np.ptp(surplus)) / second,
        mean_torque=mean_torque,
    )


def _sum_duty(solution: Solution, drive: Driving) -> MotorDuty:
    """Sum up the duty over the positions of a list, or of each member of a study.

    A member of a study that is not closed, or has a position without a value, has NaN
    for what is about the mean.
    """
    values = getattr(solution, drive.keys.value)
    power = _require_quantity(solution, "power")
    speed = where_assembled(solution, _require_quantity(solution, drive.speed_key))
    closed = is_once_round(solution)
    spans = _compute_spans(solution, power)

    def integrate(part: Array) -> Any:
        steps = 0.5 * spans * (part[..., :-1] + part[..., 1:])
        moves = np.isfinite(steps).any(axis=-1)
        return _find_known(np.where(moves, np.nansum(steps, axis=-1), np.nan))

    work = 0.5 * spans * (power[..., :-1] + power[..., 1:])
    counts = np.asarray(closed) & np.isfinite(work).all(axis=-1)
    spans = np.broadcast_to(spans, work.shape)
    duration = spans.sum(axis=-1)
    mean = np.full(counts.shape, np.nan)
    np.divide(work.sum(axis=-1), duration, out=mean, where=counts)
    surplus = np.cumsum(work - mean[..., None] * spans, axis=-1)
    # the first position counts with an energy of 0
    most = surplus.max(axis=-1, initial=0.0)
    least = surplus.min(axis=-1, initial=0.0)
    mean_torque = None
    if counts.any() and solution.drive_bar == solution.at.bar:
        mean_torque = _find_mean_torque(solution, mean * duration)
    return MotorDuty(
        **_name_effort(
            solution, _reduce(np.nanmax, np.abs(values)), _find_rms(solution, values)
        ),
        peak_speed=_reduce(np.nanmax, np.abs(speed)),
        peak_power=_reduce(np.nanmax, np.abs(power)),
        rms_power=_find_rms(solution, power),
        energy_in=integrate(np.maximum(power, 0.0)),
        energy_out=integrate(np.maximum(-power, 0.0)),
        closed=bool(closed) if np.ndim(closed) == 0 else closed,
        mean_torque=mean_torque,
        energy_swing=_find_known(np.where(counts, most - least, np.nan)),
    )


def _name_effort(solution: Solution, peak: Any, rms: Any) -> dict[str, Any]:
    """Name peak and RMS of the drive as `MotorDuty` has them."""
    effort = {"peak_torque": None, "rms_torque": None}
    kind = "torque" if solution.drive is None else "force"
    return effort | {f"peak_{kind}": peak, f"rms_{kind}": rms}


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


def _compute_spans(solution: Solution, power: Array) -> Array:
    """Compute the time between each two positions, s; NaN where nothing moves."""
    if solution.time is not None:
        return np.diff(solution.time)
    speed = getattr(solution, solution.at.names[1])
    speed = np.broadcast_to(np.asarray(speed), power.shape)[..., :-1]
    spans = np.full(speed.shape, np.nan)
    np.divide(np.diff(solution.at.places), speed, out=spans, where=speed != 0.0)
    return np.abs(spans)


def _find_mean_torque(solution: Solution, work: Any) -> Any:
    """Find the mean torque over the angle that the driven bar turns; NaN for no angle.

    `work`: of the drive over the motion, J, of a study (m,). The angle is the commanded
    one: the integral of the speed would be off by its rule.
    """
    angle = np.asarray(solution.at.angle)
    speed = np.atleast_1d(np.asarray(solution.at.speed))
    sense = np.sign(speed.mean(axis=-1))
    turned = sense * np.abs(angle[..., -1] - angle[..., 0])
    return _reduce_to_number(work / turned)


def _find_rms(solution: Solution, values: Array) -> Any:
    """Return the root mean square over the positions.

    Whole turns count their two equal ends once.
    """
    positions = values.shape[-1]
    is_last = np.arange(positions) == positions - 1
    is_repeated = is_once_round(solution)[..., None] & is_last
    once = np.where(is_repeated, np.nan, values)
    mean_square = _reduce(np.nanmean, np.square(once))
    return _reduce_to_number(np.sqrt(mean_square))


def _reduce(reduce: Any, values: Array) -> Any:
    """Reduce over the positions that have a value; NaN where none has."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # of a member without any
        return _reduce_to_number(reduce(values, axis=-1))


def _find_known(values: Array) -> Any:
    """Return a number, or of a study an array (m,); None where there is none."""
    return _reduce_to_number(values) if np.isfinite(values).any() else None


def _reduce_to_number(value: Any) -> Any:
    """Return a number, or of a study an array (m,)."""
    if np.ndim(value) == 0:
        return float(value)
    return value


def list_duty(solution: Solution, units: Conversion) -> dict[str, Any] | None:
    """Return the duty and the loads of the pins as the JSON has them.

    Numbers have the units of the output, and the keys are those of `motor_duty`.
    """
    duty = motor_duty(solution)
    if duty is None:
        return None
    si = DUTY_UNITS if solution.drive is None else {**DUTY_UNITS, "peak_speed": "m/s"}

    def convert(numbers: Iterable[Any], of: dict[str, str]) -> dict[str, Any]:
        """Name numbers as their units are, and convert them."""
        return {
            name: None if number is None else number * find_unit_in(unit, units)[1]
            for number, (name, unit) in zip(numbers, of.items(), strict=True)
        }

    of_pin = {"peak": "N", "rms": "N", "theta_2": "rad"}
    return {
        "closed": duty.closed,
        **convert((getattr(duty, name) for name in si), si),
        "pins": {
            pin: convert(bearing_load(solution, pin), of_pin) for pin in PIN_FORCE
        },
        "units": {name: find_unit_in(unit, units)[0] for name, unit in si.items()},
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
