"""The formulas' own numbers: the equations that they satisfy, and where they have none.

The equations use the printed results alone (forces, accelerations, torque) and none of
the elimination that produced them: closure, the sum of forces on the three bars, and
the sum of moments about O2.
"""

from collections import Counter
from collections.abc import Iterator
from typing import Any

import numpy as np

from fourbar.effects import Actions
from fourbar.effects.effect import list_bodies
from fourbar.errors import write_count
from fourbar.evaluation.case import compute_shown_state
from fourbar.formulas.pin_forces import Wrenches
from fourbar.linkage import MOVING_BARS, PIN_FORCE
from fourbar.quantities import (
    CHANGE_POINT,
    COUPLE,
    LINE,
    NO_LEVER,
    NO_TORQUE,
    NOT_ASSEMBLED,
    OK,
    OVERFLOW,
    SEVERAL,
    SINGULAR,
    Array,
)
from fourbar.scene import Scene
from fourbar.solution import Solution
from fourbar_validation.compare.compare import CLOSURE, NOT_DEMANDED
from fourbar_validation.compare.effect_sizes import find_size
from fourbar_validation.compare.pins import state_from_pins
from fourbar_validation.compare.rows import FAILS, FORMULAS, Row
from fourbar_validation.compare.tolerance import (
    EPS,
    IDENTITY,
    NOTHING_TO_TELL,
    Mask,
    compute_closing_margin,
    count_half_turns,
    divide,
    find_condition,
    find_gap,
    find_lever,
    find_worst,
    magnitude,
    mark_touching,
)
from fourbar_validation.engines.description import name_driving
from fourbar_validation.engines.free_body import count_solutions
from fourbar_validation.engines.registry import find_missing
from fourbar_validation.run.question import Question, select_positions, spread_evenly

OPTIONAL_QUANTITIES = ("omega_3", "alpha_3", COUPLE.value, LINE.value)
"""One quantity of each stage that a position may lack."""
_LARGE = 1e75
"""Size of numbers beyond which they, or their squares, may overflow. A product of four
is 1e300.
"""
_IN_ONE_LINE = 32.0 * 2.0**-53
"""|sin(theta_4 - theta_3)| at which bars 3 and 4 may count as collinear. Their
directions are rounded by that.
"""
POSITIONS_OF_FRICTION = 5
"""Positions of a scene that are tried for solutions of friction. Some have several,
some one; each may take a search.
"""
TOO_NEAR_A_TOGGLE = 1e-6
"""|sin(theta_4 - theta_3)| below which doubles have no word in it."""


def check_identities(question: Question) -> Iterator[Row]:
    """Check each equation that the stage of the solution allows."""
    solution = question.solution
    command = question.at
    linkage = question.scene.linkage
    closing = solution.assembled & (solution.status_code != OVERFLOW)
    gap = find_gap(linkage, solution.theta_2, solution.theta_3, solution.theta_4)
    yield _make_equation_row(question, "closure", CLOSURE, gap, closing)
    motion = question.scene.motion
    if motion.angle is None and motion.law is None and command.bar == 2:
        yield _check_sweep(question)
    if solution.F12 is not None and (solution.status_code == OK).any():
        yield from _check_sums(question)


def _check_sweep(question: Question) -> Row:
    """Check a sweep that the scene leaves open.

    Such a sweep is a whole turn, two with a single change point, or ends one degree
    short of where the loop just closes. At the end of an interval narrower than four
    degrees it leaves out a quarter of that, which is half of the sweep.
    """
    command = question.at
    linkage = question.scene.linkage
    start = float(command.theta_2[0])
    stop = float(command.theta_2[-1])
    # ends of a sweep of an input that turns fully, rad: with a single change point its
    # assembly repeats after two turns
    if start == 0.0 and stop in (2.0 * np.pi, 4.0 * np.pi):
        missed = np.maximum(-compute_closing_margin(linkage, command.theta_2), 0.0)
    else:
        left_out = min(np.radians(1.0), 0.5 * (stop - start))
        ends = np.array([start - left_out, stop + left_out])
        missed = np.abs(compute_closing_margin(linkage, ends))
    allowed = IDENTITY.factor * count_half_turns(linkage.ground_angle, command.theta_2)
    reason = "one degree short of where the loop just closes, or whole turns"
    return question.row("sweep", np.array([missed.max()]), allowed, reason)


def _make_equation_row(
    question: Question,
    quantity: str,
    equation: str,
    error: Array,
    judged: Mask,
) -> Row:
    """Make the row of an equation from its error where it is worst.

    The error is in parts of its terms.
    """
    ground_angle = question.scene.linkage.ground_angle
    condition = 1.0 / count_half_turns(ground_angle, question.at.angle)
    allowed = IDENTITY.factor / condition
    reason = f"identity: {equation}" if judged.any() else NOT_DEMANDED
    return question.row(quantity, error, allowed, reason, judged, condition)


def _check_sums(question: Question) -> Iterator[Row]:
    """Check that F12 + F14 + loads = sum of m a_G, the moments about O2, the power.

    What acts is complex: force, its point, and a couple.
    """
    scene = question.scene
    linkage = scene.linkage
    solution = question.solution
    actions, of_drive, O4 = _sum_actions(question)
    drive = name_driving(scene)

    def read(name: str) -> Any:
        vectors = solution[name]
        return vectors[:, 0] + 1j * vectors[:, 1]

    torque = 0.0 if solution.torque is None else solution.torque
    exerted: list[tuple[Any, Any, Any]] = [
        (read("F12"), 0.0, torque),
        (read("F14"), O4, 0.0),
    ]
    # the moments of forces inside cancel
    inside: Any = np.abs(read("A") * read("F32")) + np.abs(read("B") * read("F43"))
    # a force that drives and the loads nearly cancel in the couple of their bar, and
    # the force has the rounding of its own moment: they act apart
    acting = [(one, one.wrenches(Wrenches())) for one in (actions, of_drive)]
    first_pins = (("O2", 0.0), ("", read("A")), ("O4", O4))
    for number, (ground_pin, pin) in zip(MOVING_BARS, first_pins, strict=True):
        for part, wrenches in acting:
            force_on, couple = wrenches.on(number)
            # the ground's pull on bars 2 and 4 goes through their pins; between moving
            # bars it cancels
            force_on = force_on + part.through.get(ground_pin, 0.0)
            exerted.append((force_on, pin, couple))
        inertia = linkage.bar(number).mass * read(f"a_G{number}")
        turned = actions.bodies[number - 2].I * solution[f"alpha_{number}"]
        exerted.append((-inertia, read(f"G{number}"), -turned))
    force: Any = sum(force for force, _, _ in exerted)
    moment = sum((np.conj(point) * force).imag + M for force, point, M in exerted)
    forces = sum(np.abs(force) for force, _, _ in exerted)
    moments = sum(np.abs(point * force) + np.abs(M) for force, point, M in exerted)
    # the forces of the bars that are not driven are solved apart, and the torque is
    # that of virtual work
    placed = state_from_pins(scene)
    sizes: dict[str, Array | float] = dict.fromkeys(("load", "springs", "torsion"), 0.0)
    for term in (*placed.loads, *placed.effects):
        if term.key in sizes:
            sizes[term.key] += find_size(term, linkage, solution)
    # a force at a place far from its bar's pins is balanced by as large a couple
    forces_acting = sizes["load"] + sizes["springs"]
    # and a spring next to its free length has the rounding of that length
    couples_acting = sum(sizes.values()) * max(linkage.lengths)
    lever = find_lever(linkage) * solution.drive_condition
    condition = find_condition(drive, linkage, solution)
    with np.errstate(divide="ignore", invalid="ignore"):
        force_size = (forces + forces_acting) / lever
        moment_size = (moments + inside + couples_acting) / condition
    # the sense of dry friction at a pin at rest is decided by rounding: not the same
    # here as in the answer
    judged = (solution.status_code == OK) & ~question.reversing(IDENTITY.factor)
    speed = getattr(solution, f"omega_{solution.drive_bar}", solution.stroke_speed)
    works = getattr(solution, drive) * speed
    equations = {
        "power": ("of the drive", solution.power - works, np.abs(works)),
        "force_sum": ("F12 + F14 + loads = sum of m a_G", force, force_size),
        "moment_sum": ("moments about O2, with the torque", moment, moment_size),
    }
    for name, (equation, rest, size) in equations.items():
        error = divide(np.abs(rest), size)
        yield _make_equation_row(question, name, equation, error, judged)


def _sum_actions(question: Question) -> tuple[Actions, Actions, complex]:
    """Sum what acts at the speeds that were answered.

    Another evaluation of them is not used. What a drive that exerts a force does is
    returned apart, and the place of O4.
    """
    scene = question.scene
    command = question.at
    solution = question.solution
    state = compute_shown_state(scene, command)
    bars = [bar for bar in MOVING_BARS if bar != command.bar]
    speeds = {f"omega_{bar}": getattr(solution, f"omega_{bar}") for bar in bars}
    state = state._replace(moving=state.moving._replace(**speeds))
    placed = scene.settled()
    bodies = list_bodies(scene.linkage, scene.effects)
    forces = {name: getattr(solution, name) for name in PIN_FORCE.values()}
    with np.errstate(all="ignore"):
        actions = Actions(state, bodies).add((*placed.loads, *placed.effects))
        for term in scene.effects:
            if term.loaded_pins:
                term.act_known(actions, forces)
        of_drive = Actions(state, bodies)
        if solution.drive is not None:
            solution.drive.act(of_drive, solution.drive_force)
    return actions, of_drive, complex(np.ravel(state.foot(4))[0])


def check_status(question: Question) -> Iterator[Row]:
    """Check that the formulas lack a value exactly where another derivation does."""
    reference = question.reference
    free_body = question.free_body
    if reference is not None and question.at.speed is not None:
        yield _compare_status(question, reference)
    elif reference is None and (free_body is None or free_body.refusal is None):
        what = "the free bodies, by which it is judged, broke down"
        yield Row.unmeasured(question.name, FORMULAS, "exact", "status", FAILS, what)


def _compare_status(question: Question, reference: Solution) -> Row:
    """Count where one of the formulas and `reference` alone has a value.

    Positions count where digits are left. That a loop does not close is compared by
    itself where doubles can decide it. Near a toggle sin(theta_4 - theta_3) in many
    digits decides whether positions are singular, and of loaded friction some positions
    are searched for several solutions.
    """
    scene = question.scene
    linkage = scene.linkage
    command = question.at
    formulas = question.solution
    code = formulas.status_code
    differ = np.zeros(len(formulas), dtype=bool)
    large = _mark_large(scene, reference)
    for quantity in OPTIONAL_QUANTITIES:
        ours = getattr(formulas, quantity)
        theirs = getattr(reference, quantity)
        if ours is not None and theirs is not None:
            sound = find_condition(quantity, linkage, reference) * NOTHING_TO_TELL > EPS
            differ |= sound & ~large & (np.isfinite(ours) != np.isfinite(theirs))
    differ &= code != NOT_ASSEMBLED
    if reference.drive_condition is not None:
        found = [formulas.a_G2, formulas.a_G3, formulas.a_G4]
        found += formulas.acceleration.values()
        accelerations = np.hstack([a for a in found if a is not None])
        # if everything that the forces need is finite, a missing number is the forces'
        # own
        moves = np.isfinite(accelerations).all(axis=1)
        in_line = reference.drive_condition < _IN_ONE_LINE
        differ |= (code == OVERFLOW) & moves & in_line
        apart = reference.drive_condition > TOO_NEAR_A_TOGGLE
        differ |= np.isin(code, (NO_TORQUE, NO_LEVER)) & apart
    touching = mark_touching(linkage, formulas.theta_2)
    close = touching | (reference.condition < TOO_NEAR_A_TOGGLE)
    close |= formulas.condition < TOO_NEAR_A_TOGGLE
    singular = np.isin(code, (SINGULAR, CHANGE_POINT))
    differ |= singular & ~close & ~large
    # within the rounding of the lengths a limit counts as met
    near = np.flatnonzero(close & ~(singular & touching))
    of_theta_2 = command.remainder is None and command.commanded == "theta_2"
    if of_theta_2 and len(near) and not find_missing("flint"):
        # exact arithmetic has to decide there
        from fourbar_validation.engines.balls import compute_exact_sines

        sine = np.abs(compute_exact_sines(linkage, select_positions(command, near)))
        closes = np.isfinite(sine)
        wrong = np.where(
            singular[near], sine > _IN_ONE_LINE, sine < _IN_ONE_LINE / 16.0
        )
        differ[near] |= (code[near] == NOT_ASSEMBLED) == closes
        differ[near] |= closes & wrong
    if any(effect.loaded_pins for effect in scene.effects):
        differ |= _mark_other_numbers(question)
    wrong_ones = np.count_nonzero(differ)
    stated = ", ".join(
        f"{count} {name}"
        for name, count in Counter(formulas.status).items()
        if name != "ok"
    )
    reason = f"the formulas state: {stated}"
    if not stated:
        reason = "every position has its values"
    if wrong_ones:
        first = formulas.status[find_worst(differ.astype(float))]
        positions = write_count(int(wrong_ones), "position")
        reason = f"other at {positions}, the first is {first}; {reason}"
    errors = float(wrong_ones) * differ
    return question.row("status", errors, 0.0, reason, theta_2=formulas.theta_2)


def _mark_other_numbers(question: Question) -> Mask:
    """Mark where the formulas state one solution of friction for several, (n,).

    So are positions where it is the reverse. Few are looked at; others are False.
    """
    code = question.solution.status_code
    several = np.flatnonzero(code == SEVERAL)[:POSITIONS_OF_FRICTION]
    alone = np.flatnonzero(code == OK)
    if len(alone):
        alone = spread_evenly(alone, POSITIONS_OF_FRICTION)
    differ = np.zeros(len(code), dtype=bool)
    for some, many in ((several, True), (alone, False)):
        if len(some):
            here = select_positions(question.at, some)
            differ[some] = (count_solutions(question.scene, here) > 1) != many
    return differ


def _mark_large(scene: Scene, reference: Solution) -> Mask:
    """Mark where numbers are so large that the formulas may have to give up, (n,)."""
    lengths = scene.linkage.lengths
    uneven = max(lengths) > _LARGE or min(lengths) < 1.0 / _LARGE
    large = np.full(len(reference), uneven)
    for name in ("omega_2", "alpha_2", *OPTIONAL_QUANTITIES, "F12", "F43"):
        values = getattr(reference, name)
        if values is not None:
            large |= magnitude(values) > _LARGE
    return large
