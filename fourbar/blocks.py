"""One block of positions at a time, stage by stage: what `solve` runs over a scene."""

from collections.abc import Callable, Iterator, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from fourbar.kinematics import add_accelerations, add_velocities, close_loop
from fourbar.kinetostatics import drive_sine, solve_pins, torque_interval
from fourbar.margins import NO_DIGIT_LEFT, U, diagonal_to_O4
from fourbar.more_digits import needing_more_digits, restated, rounded
from fourbar.solution import (
    ANGLES,
    JAMMED,
    NO_TORQUE,
    NOT_ASSEMBLED,
    OF_DRY_FRICTION,
    OK,
    OVERFLOW,
    SEVERAL,
    SINGULAR,
    STAGE_OF,
    STAGES,
    VECTORS,
)
from fourbar.state import Array, State, Vector, centre_in_bar

if TYPE_CHECKING:
    from fourbar.effects import Effect
    from fourbar.scene import Command, Scene

ALL = slice(None)
BLOCK = 15 * 1024
"""Positions evaluated at a time, measured: fewer pay for calls; from 128 KiB an array on, the C library maps fresh
pages for each."""

LIVE_ARRAYS = 96
"""More than a block ever holds at once."""


def warm_heap() -> Array:
    """Memory for the arrays of a block, freed below a small array that is kept.

    The C library returns the free top of its heap to the system, and the next block would fault
    every page in again: three times the cost of the arithmetic. The array on top prevents that.
    """
    ballast = [np.empty(BLOCK) for _ in range(LIVE_ARRAYS)]
    lid = np.empty(BLOCK)  # too large for a hole further down
    del ballast
    return lid


KINEMATIC: dict[str, Callable[[State], Array | Vector | float | None]] = {
    "sin_mu": lambda state: state.sin_mu,
    "condition": lambda state: np.abs(state.sin_mu),
    "A": lambda state: state.pin("A"),
    "B": lambda state: state.pin("B"),
    "G2": lambda state: state.point(2, *centre_in_bar(state.linkage.input)),
    "G3": lambda state: state.point(3, *centre_in_bar(state.linkage.coupler)),
    "G4": lambda state: state.point(4, *centre_in_bar(state.linkage.output)),
    "omega_2": lambda state: state.omega_2,
    "omega_3": lambda state: state.omega_3,
    "omega_4": lambda state: state.omega_4,
    "alpha_2": lambda state: state.alpha_2,
    "alpha_3": lambda state: state.alpha_3,
    "alpha_4": lambda state: state.alpha_4,
    "a_A": lambda state: state.acceleration(2, state.linkage.input.length, 0.0),
    "a_B": lambda state: state.acceleration(4, state.linkage.output.length, 0.0),
    "a_G2": lambda state: state.acceleration(2, *centre_in_bar(state.linkage.input)),
    "a_G3": lambda state: state.acceleration(3, *centre_in_bar(state.linkage.coupler)),
    "a_G4": lambda state: state.acceleration(4, *centre_in_bar(state.linkage.output)),
}
"""The quantities up to the acceleration, from the state of the stage that they belong to."""


@np.errstate(all="ignore")  # what comes of it is looked for, and said by the status
def solve_block(
    scene: "Scene", where: "Command", part: slice, wanted: int, out: Mapping[str, Array]
) -> NDArray[np.uint8]:
    """Evaluate one block of positions into the result arrays; its status codes."""
    theta_2, branch = where.theta_2[part], where.branch[part]
    motion = (_piece(where.omega_2, part), _piece(where.alpha_2, part))
    if where.remainder is None:
        state = close_loop(scene.linkage, theta_2, branch)
    else:
        exact = diagonal_to_O4(scene.linkage, theta_2, where.remainder)
        state = close_loop(scene.linkage, theta_2, branch, exact)
    friction = np.zeros(theta_2.shape, dtype=np.uint8)
    room = {name: (array[:, 0], array[:, 1]) if name in VECTORS else array for name, array in out.items()}
    for name, value in _evaluate(scene, state, *motion, wanted, room):
        if name == "status":
            friction[:] = value
        else:
            _put(room[name], value)
    if (hard := needing_more_digits(state)).size:
        for name, value in _evaluate(scene, *restated(state, *motion, hard), wanted, dict.fromkeys(out)):
            if name == "status":
                friction[hard] = value
                continue
            # what doubles lost is lost again, 53 bits further down
            left = out[name][hard] * U if STAGE_OF[name] == "error" else 0.0
            _put(room[name], value, hard)
            out[name][hard] += left
    code = friction
    if state.diagonal.least_root == 0.0 and not (state.assembled.all() and not state.singular.any()):
        code = np.where(state.assembled, np.where(state.singular, SINGULAR, friction), NOT_ASSEMBLED).astype(np.uint8)
        code[np.isnan(state.diagonal.squared)] = OVERFLOW  # of theta_2 - theta_1: not even where it closes is known
    if not _all_finite(out):
        _withhold(out, code, np.abs(drive_sine(state, scene.drive_bar)) <= NO_DIGIT_LEFT)
    return code


def _all_finite(out: Mapping[str, Array]) -> bool:
    """Whether every entry of a block's arrays is a number: their sum at each position is, which is quicker to look at.

    False also where the sum alone is beyond the range of a double.
    """
    for arrays in ([array for array in out.values() if array.ndim == dimensions] for dimensions in (1, 2)):
        if arrays:
            total = arrays[0].copy("K")
            for array in arrays[1:]:
                total += array
            if not np.isfinite(total).all():
                return False
    return True


def _withhold(out: Mapping[str, Array], code: NDArray[np.uint8], in_line: NDArray[np.bool_]) -> None:
    """Where a quantity is no number and the status promises one: the status that says so, and NaN from that stage on.

    Parameters
    ----------
    code : status of each position, changed in place.
    in_line : where the two bars that are not driven are in line: there no forces hold them in balance.
    """
    gone = np.zeros(code.shape, dtype=bool)
    for stage in STAGES:
        arrays = {name: array for name, array in out.items() if STAGE_OF[name] == stage}
        of_forces = stage in STAGES[3:]
        promised = np.isin(code, (OK, SEVERAL)) if of_forces else ~np.isin(code, (NOT_ASSEMBLED, SINGULAR))
        found = np.zeros_like(gone)
        for array in arrays.values():
            found |= ~(np.isfinite(array).all(axis=1) if array.ndim == 2 else np.isfinite(array))
            array[np.isinf(array)] = np.nan
        found &= promised & ~gone
        code[found] = OVERFLOW
        if of_forces:
            code[found & in_line] = NO_TORQUE
        gone |= found
        for name, array in arrays.items():
            if name != "drive_condition":
                array[gone] = np.nan


def _evaluate(
    scene: "Scene",
    state: State,
    omega_2: Array | float,
    alpha_2: Array | float,
    wanted: int,
    names: Mapping[str, Any],
) -> Iterator[tuple[str, Any]]:
    """The quantities named, stage by stage, and the "status" that friction leaves.

    A name may come with room for the result; most of them are then written there at once.
    """
    room = {name: array for name, array in names.items() if array is not None}
    if wanted >= 1:
        add_velocities(state, omega_2, room)
    if wanted >= 2:
        add_accelerations(state, alpha_2, room)
    for name in names:
        if name in ANGLES:
            yield name, state.angle(int(name[-1]), room.get(name))
        elif name in KINEMATIC:
            yield name, KINEMATIC[name](state)
    if wanted >= 3:
        terms = (*scene.loads, *scene.effects)
        forces = _forces(scene, state, terms, wanted, room, names)
        yield from forces if (codes := _without_value(terms, state)) is None else _blanked(forces, codes)


def _without_value(terms: "tuple[Effect, ...]", state: State) -> NDArray[np.uint8] | None:
    """Where an effect has no value its status code, elsewhere OK; None: each has one everywhere."""
    found = [codes for term in terms if (codes := term.unsettled(state)) is not None]
    return np.max(found, axis=0) if found else None


def _blanked(forces: Iterator[tuple[str, Any]], codes: NDArray[np.uint8]) -> Iterator[tuple[str, Any]]:
    """NaN where an effect has no value, and its status there."""
    gone, status = codes != OK, codes
    for name, value in forces:
        if name == "status":
            status = np.where(gone, codes, value)
        elif name == "drive_condition":
            yield name, value
        elif isinstance(value, tuple):
            yield name, tuple(np.where(gone, np.nan, rounded(component)) for component in value)
        else:
            yield name, np.where(gone, np.nan, rounded(value))
    yield "status", status


def _forces(
    scene: "Scene",
    state: State,
    terms: "tuple[Effect, ...]",
    wanted: int,
    room: Mapping[str, Any],
    names: Mapping[str, Any],
) -> Iterator[tuple[str, Any]]:
    """What the force stage and the error bars evaluate."""
    pins = solve_pins(state, terms, scene.drive_bar, room=room)
    for name in ("F12", "F32", "F43", "F14", "torque"):
        if name in names:
            yield name, getattr(pins, name)
    if pins.unsettled is not None:
        yield "status", pins.unsettled
    if "drive_condition" in names:
        condition = np.abs(drive_sine(state, scene.drive_bar))
        yield "drive_condition", condition if pins.from_jamming is None else condition * pins.from_jamming
    if "friction_residual" in names:
        yield "friction_residual", 0.0 if pins.residual is None else pins.residual
    if "torque_low" in names or "torque_high" in names:
        *ends, held = torque_interval(state, terms, scene.drive_bar, pins.torque)
        yield from ((name, end) for name, end in zip(OF_DRY_FRICTION, ends, strict=True) if name in names)
        if held is not None and pins.unsettled is not None:
            yield "status", np.where(held & (pins.unsettled == OK), JAMMED, pins.unsettled)
    if wanted >= 4:
        from fourbar.error_bars import error_bars

        for name, value in error_bars(state, pins, terms, scene.drive_bar).items():
            if name in names:
                yield name, value


def _put(room: Array | Vector, value: Array | Vector | float | None, where: slice | NDArray[np.intp] = ALL) -> None:
    assert value is not None
    if not isinstance(value, tuple):
        room, value = (room,), (value,)  # type: ignore[assignment]
    for target, component in zip(room, value, strict=True):  # type: ignore[arg-type]
        if component is not target:  # else it is there already
            target[where] = rounded(component)


def _piece(value: float | Array | None, part: slice) -> float | Array:
    """A number for all positions, or the part of an array that belongs to a block."""
    if value is None or np.ndim(value) == 0:
        return value or 0.0
    return value[part]  # type: ignore[index]
