"""A scene as a pure function of some of its numbers: to be compiled, mapped and differentiated by an array library."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from difflib import get_close_matches
from typing import Any, NamedTuple

import numpy as np

from fourbar.errors import DependencyError, InputError, expect, say_install
from fourbar.evaluation.case import Case, find_undecided
from fourbar.evaluation.evaluate import list_kinematics
from fourbar.formulas.arithmetic import make_like, namespace
from fourbar.formulas.mobility import change_points
from fourbar.quantities import (
    COUPLE,
    DRY_FRICTION_QUANTITIES,
    LINE_QUANTITIES,
    OK,
    PIN_LOAD_QUANTITIES,
    SCALARS,
    STAGE_OF,
)
from fourbar.scene import Command, Scene, command
from fourbar.scene.motion import FromLimit
from fourbar.scene.numbers import POINT_STAGES
from fourbar.scene.scene import turn_bar
from fourbar.studies.keys import (
    SceneNumber,
    command_key,
    list_entries,
    read_place,
    refuse_key,
    replace_numbers,
)

NO_DIGIT_LEFT, UNDECIDED = 8.0, 16.0
"""Times the spacing of the numbers at 1: of |sin mu|, and of what decides whether the loop closes, as `solve` has them
for doubles."""
NEVER = {
    *DRY_FRICTION_QUANTITIES,
    *PIN_LOAD_QUANTITIES,
    *(name for name, stage in STAGE_OF.items() if stage == "error"),
}
"""Quantities of searches and of many digits."""


class Given(NamedTuple):
    """Numbers as arrays of one library."""

    values: dict[str, Any]
    xp: Any
    zero: Any
    """Zero of the shape and the kind of the results."""
    eps: float
    """The spacing of its numbers at 1."""


def function(
    scene: Scene, keys: Sequence[str], quantities: Sequence[str] = ("torque",)
) -> Callable[..., Any]:
    """Make a pure function of some numbers of a scene, for any array library: JAX, PyTorch or NumPy.

    The function takes one value for each key, a number or an array of shape () or (n,), and returns a dict: each
    quantity with the shape that the values have together, () or (n,), a vector with 2 more. Where solve has a status
    other than "ok" the result is NaN, and so it is where a loop is so near a limit that only many digits tell whether
    it closes; a derivative of the other positions is not touched by those. A torsion spring counts its turns at each
    position anew, and the angles are in (-pi, pi].

    Parameters
    ----------
    keys : as of `vary`; without "motion.theta_2" the positions are those of the scene.
    quantities : as in a solution, those of the scene's own points too.

    Raises
    ------
    InputError : an unknown key or quantity; what cannot be traced: friction that depends on the pin forces, a free
        motion, a position stated from a limit, a path that is followed through change points, a table that
        covers less than a turn. The function: values that are no real floating-point numbers of one
        library, or whose shapes do not broadcast.
    DependencyError : array-api-compat is missing, without which other libraries than NumPy are not known.

    >>> from fourbar import Motion, uniform
    >>> f = function(Scene(uniform(0.3, 0.1, 0.25, 0.22), Motion(1.0, 10.0)), ["lengths.input"])
    >>> f(np.array([0.1, 0.11, 2.0]))["torque"].round(3).tolist()
    [-0.009, -0.011, nan]
    """
    expect("scene", scene, Scene)
    _expect_names(keys=keys, quantities=quantities)
    entries, theta, motion = list_entries(scene), command_key(scene), scene.motion
    for key in keys:
        if key not in (*entries, theta):
            raise refuse_key(key, "a key", [*entries, theta])
    _refuse_untraceable(scene, keys)
    wanted = _list_stages(scene, quantities, keys)
    stated = None if theta in keys else command(scene)
    shape = (
        () if stated is None or isinstance(motion.angle, float) else stated.angle.shape
    )

    def solve_for(*values: Any) -> dict[str, Any]:
        numbers = _check_given(keys, values, shape)
        alone = numbers.xp is np and numbers.zero.shape == ()
        if (
            alone
        ):  # arrays of one entry, because Python's numbers raise on division by 0
            numbers = _check_given(
                keys, [np.atleast_1d(value) for value in numbers.values.values()], shape
            )
        with np.errstate(all="ignore"):
            changed, commanded, holds = _replace_given(scene, entries, numbers, stated)
            results = _evaluate(changed, commanded, holds, numbers, wanted)
        return {name: value[0] for name, value in results.items()} if alone else results

    return solve_for


def _replace_given(
    scene: Scene,
    entries: Mapping[str, SceneNumber],
    given: Given,
    stated: Command | None,
) -> tuple[Scene, tuple[Any, Any, Any], Any]:
    """Replace the numbers of the scene that are given; return its commanded place, speed, acceleration too.

    The last of the results is where all numbers hold: one that a scene would refuse is replaced by the scene's own, for
    what is finite has finite derivatives. `stated`: the command of a scene whose place is not given.
    """
    numbers: dict[str, Any] = {}
    holds: Any = True
    for key, value in given.values.items():
        entry = entries.get(key)
        inside = given.xp.isfinite(value) if entry is None else entry.holds(value)
        default = None if entry is None else read_place(scene, entry.place)
        holds, numbers[key] = (
            holds & inside,
            given.xp.where(inside, value, 1.0 if default is None else default),
        )
    q = numbers.pop(command_key(scene), None)
    changed = replace_numbers(scene, numbers)
    speed, acceleration = changed.motion.speed, changed.motion.acceleration
    if stated is not None:
        places = stated.angle if stated.stroke is None else stated.stroke
        q = make_like(places if places.size > 1 else places.reshape(()), given.zero)
        if scene.motion.law is not None:
            speed, acceleration = (
                make_like(x, given.zero) for x in (stated.speed, stated.acceleration)
            )
    return changed, (q + given.zero, speed, acceleration), holds


def _expect_names(**lists: Sequence[str]) -> None:
    """Raise an InputError for a list that is none of words, each once."""
    for name, names in lists.items():
        expect(name, names, tuple, list)
        for name_of_one in names:
            expect(name, name_of_one, str)
        if len(set(names)) < len(names) or not names:
            raise InputError(name, names, "must be one or more, each once")


def _evaluate(
    scene: Scene,
    commanded: tuple[Any, Any, Any],
    holds: Any,
    given: Given,
    wanted: dict[str, str],
) -> dict[str, Any]:
    """Evaluate quantities, NaN where they have no value; what is put there meanwhile is finite, as its derivatives.

    A loop that does not close is evaluated with a right angle at B in its place, its sides those of the bars.
    """
    case, branch, xp = (
        Case.of(scene, scene.motion.bar),
        float(scene.motion.branch),
        given.xp,
    )
    q, speed, acceleration, condition = turn_bar(scene, *commanded)
    speed = 0.0 if speed is None else speed
    if condition is not None:
        holds = holds & (condition > NO_DIGIT_LEFT * given.eps)
    path = case.path
    lengths, half = path.lengths, path.half_angle(q)
    square = 2.0 * lengths.b * lengths.c
    size, turned, part = (
        4.0 * lengths.a * lengths.d,
        abs(half.sk * (q - path.theta_1)),
        UNDECIDED * given.eps,
    )
    least = NO_DIGIT_LEFT * given.eps * square
    ok = (
        (half.outer > 0.0)
        & (half.inner > 0.0)
        & (half.outer * half.inner > least * least)
    )
    for factor, constant, trig in (
        (half.outer, lengths.E1, half.kk),
        (half.inner, lengths.E2, half.ss),
    ):
        ok = ok & ~find_undecided(factor, constant, size * (trig + turned), part)
    half = half._replace(
        outer=xp.where(ok, half.outer, square), inner=xp.where(ok, half.inner, square)
    )
    stages = set(wanted.values())
    state = case.assemble(
        q, half, branch, speed, acceleration, moving=stages != {"position"}
    )
    quantities = list_kinematics(case, state, wanted.keys()) | dict(
        zip(scene.motion.names[:2], commanded[:2], strict=True)
    )
    if condition is not None and "condition" in wanted:
        quantities["condition"] = quantities["condition"] * condition
    if "force" in stages:
        done = case.dynamics(state, acceleration)
        power = xp.where(xp.isfinite(done.drive), done.work * speed, xp.nan)
        forces = {**done.pins._asdict(), case.names.value: done.drive, "power": power}
        lever = case.drive_condition(state)
        held = (
            lever > NO_DIGIT_LEFT * given.eps
        )  # compilers and other libraries round what is exactly 0 in `solve`
        quantities |= {
            name: xp.where(held, force, xp.nan) for name, force in forces.items()
        } | {"drive_condition": lever}
        for term in case.terms:
            if (status := term.status(state, None)) is not None:
                ok = ok & (status == OK)
        if (
            case.drive is not None
            and (status := case.drive.status(state, case.sines(state.position)))
            is not None
        ):
            ok = ok & (status == OK)
    results, zero = {}, given.zero
    for name in wanted:
        value = quantities[name]
        parts = (
            (value + zero,)
            if name in SCALARS
            else (value.real + zero, value.imag + zero)
        )
        kept = [
            xp.where(ok & holds & xp.isfinite(sum(parts)), part, xp.nan)
            for part in parts
        ]
        results[name] = kept[0] if name in SCALARS else xp.stack(kept, axis=-1)
    return results


def _check_given(
    keys: Sequence[str], values: Sequence[Any], positions: tuple[int, ...]
) -> Given:
    """Check the values, and make arrays of one library of them."""
    if len(values) != len(keys):
        raise InputError(
            "values",
            f"{len(values)} of them",
            f"must be {len(keys)}, one for each of {', '.join(keys)}",
        )
    arrays = {
        key: value
        for key, value in zip(keys, values, strict=True)
        if not _is_plain(value)
    }
    libraries: dict[Any, str] = {}
    for key, value in arrays.items():
        libraries.setdefault(_find_library(key, value), key)
    if len(libraries) > 1:
        raise InputError(
            "values",
            [f"{key} of {xp.__name__}" for xp, key in libraries.items()],
            "must be of one library",
        )
    xp: Any = next(iter(libraries), np)
    first = next(iter(arrays.values()), np.float64(0.0))
    try:
        shape = np.broadcast_shapes(
            positions, *(tuple(value.shape) for value in arrays.values())
        )
    except ValueError:
        shapes = {key: tuple(value.shape) for key, value in arrays.items()}
        raise InputError(
            "values",
            shapes,
            f"must have shapes that broadcast to one of {positions or '() or (n,)'}",
        ) from None
    kind = np.float64 if xp is np else xp.result_type(*arrays.values())
    zero = xp.zeros_like(xp.broadcast_to(xp.astype(first, kind) * 0.0, shape))
    like = Given({}, xp, zero, float(xp.finfo(kind).eps))
    for key, value in zip(keys, values, strict=True):
        like.values[key] = (
            value if key in arrays and xp is not np else make_like(value, zero)
        )
    return like


def _is_plain(value: Any) -> bool:
    """Return True if a value is one number of Python or NumPy."""
    return isinstance(value, (int, float, np.integer, np.floating)) and not isinstance(
        value, bool
    )


def _find_library(key: str, value: Any) -> Any:
    """Return the functions of an array's library; an InputError for what the formulas do not take."""
    try:
        xp = namespace(value)
    except ModuleNotFoundError:
        raise DependencyError(
            f"array-api-compat is needed for arrays of this library: {say_install('jax')}"
        ) from None
    if xp is np and not isinstance(value, np.ndarray):
        raise InputError(key, value, "must be a number or an array of numbers")
    if not hasattr(xp, "complex64"):
        raise InputError(
            key,
            xp.__name__,
            "is a library without complex numbers, in which forces are written",
        )
    if not xp.isdtype(value.dtype, "real floating"):
        raise InputError(
            key, str(value.dtype), "must be an array of real floating-point numbers"
        )
    if len(value.shape) > 1:
        raise InputError(
            key, f"shape {tuple(value.shape)}", "must have the shape () or (n,)"
        )
    return xp


def _list_stages(
    scene: Scene, quantities: Iterable[str], keys: Sequence[str]
) -> dict[str, str]:
    """Return the stages of the quantities asked for."""
    others = LINE_QUANTITIES if scene.drive is None else (COUPLE.value,)
    stages = {
        name: stage for name, stage in STAGE_OF.items() if name not in {*NEVER, *others}
    }
    stages |= {
        start + point.name: stage
        for point in scene.points
        for start, stage in POINT_STAGES.items()
    }
    stages["theta_2"] = "position"
    for name in quantities:
        if name not in stages:
            close = get_close_matches(str(name), stages, 1, 0.0)
            raise InputError(
                "quantities",
                name,
                f'is none of a function\'s; did you mean "{close[0]}"?',
            )
    wanted = {name: stages[name] for name in quantities}
    motion, omega = scene.motion, f"motion.{scene.motion.names[1]}"
    at_rest = motion.speed is None and motion.law is None and omega not in keys
    if at_rest and set(wanted.values()) - {"position"}:
        raise InputError(omega, None, "is needed for more than positions")
    return wanted


def _refuse_untraceable(scene: Scene, keys: Sequence[str]) -> None:
    """Raise an InputError that names what is searched for, integrated or decided in many digits."""
    motion = scene.motion
    if motion.free is not None:
        raise InputError(
            "motion.free",
            motion.free,
            "is integrated step by step, which cannot be traced",
        )
    for effect in scene.effects:
        if effect.loaded_pins:
            allowed = (
                "depends on the pin forces, which are searched for and cannot be traced"
            )
            raise InputError(f"effects.{effect.key}", effect.loaded_pins, allowed)
    for index, load in enumerate(scene.loads):
        if load.table is not None and not load.table.covers_a_turn:
            raise InputError(
                f"loads.{index}.table",
                load.table.theta_2,
                "must cover a whole turn to be traced",
            )
    if motion.through == "follow" and change_points(scene.linkage):
        raise InputError(
            "motion.through",
            motion.through,
            'cannot be traced through change points: "sign" can',
        )
    theta = command_key(scene)
    if theta in keys:
        if motion.law is not None:
            raise InputError(theta, "a key", "is that of the scene's motion law")
    elif isinstance(motion.angle, FromLimit):
        raise InputError(
            theta, motion.angle, "is evaluated in many digits, which cannot be traced"
        )
    elif motion.law is None and motion.angle is None:
        raise InputError(
            theta, None, "depends on the linkage: state it, or make it one of the keys"
        )
