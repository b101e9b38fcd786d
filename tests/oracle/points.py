"""A scene's own points, moved as the angles of another derivation have them."""

import numpy as np

from fourbar.linkage import MOVING_BARS
from fourbar.quantities import OK
from fourbar_validation.compare.bodies import stack_components
from fourbar_validation.compare.pins import state_from_pins
from fourbar_validation.compare.scales import TermSizes
from fourbar_validation.compare.tolerance import (
    EPS,
    EQUIVALENCE,
    NOTHING_TO_TELL,
    count_half_turns,
    find_condition,
    find_error,
    sum_lengths,
)
from tests.support.scenes import cis


def points(question):
    """Check the scene's own points."""
    if (
        question.scene.points
        and question.reference is not None
        and question.at.speed is not None
    ):
        yield compare_points(
            question, question.scene, question.solution, question.reference
        )


def compare_points(question, scene, solution, reference, least=0.0):
    """Compare places, velocities and accelerations of a scene's own points with
    those that follow from the angles of another derivation.

    `least`: the condition from which on they are judged.
    """
    link = scene.linkage
    error = np.zeros(len(reference))
    sizes = TermSizes(scene, reference)
    usable = (solution.status_code == OK) & (reference.condition >= least)
    usable &= find_condition("F12", link, reference) * NOTHING_TO_TELL > EPS
    tables = (solution.points, solution.velocity, solution.acceleration)
    like = ("B", "v_B", "a_B")
    for name, (arms, feet) in move_points(scene, reference).items():
        for ours, kind, arm, at_foot in zip(tables, like, arms, feet, strict=True):
            if name in ours:
                theirs = stack_components(arm + at_foot)
                terms = sum_lengths(link) if kind == "B" else sizes.sum_terms(kind)
                size = abs(arm) + abs(at_foot) + terms
                apart = find_error(kind, ours[name], theirs, size)
                apart *= find_condition(kind, link, reference)
                apart = np.nan_to_num(apart, nan=np.inf)
                error = np.where(usable, np.maximum(error, apart), error)
    allowed = EQUIVALENCE.factor * count_half_turns(link.ground_angle, solution.theta_2)
    what = f"the {len(scene.points)} points of the scene"
    theta_2 = solution.theta_2
    return question.row("points", error, allowed, what, usable, theta_2=theta_2)


def move_points(scene, reference):
    """Move a scene's own points as the angles of another derivation have them.

    Return by name, over the positions and as x + i y, place, velocity and acceleration
    of the point against its bar's first pin, and those of that pin, from O2.
    """
    link = scene.linkage
    zero = np.zeros(len(reference))
    theta, speed, growth = {1: zero + link.ground_angle}, {1: zero}, {1: zero}
    for bar in MOVING_BARS:
        for motion, name in (theta, "theta"), (speed, "omega"), (growth, "alpha"):
            values = getattr(reference, f"{name}_{bar}")
            motion[bar] = zero if values is None else values

    def swing(bar, distance, angle):
        arm = distance * cis(theta[bar] + angle)
        return [arm, 1j * speed[bar] * arm, (1j * growth[bar] - speed[bar] ** 2) * arm]

    first_pins = {
        3: swing(2, link.input.length, 0.0),
        4: [link.ground * cis(theta[1]), 0.0 * zero, 0.0 * zero],
    }
    moved = {}
    for point in state_from_pins(scene).points:
        arms = swing(point.bar, *point.place.polar_from_pin())
        moved[point.name] = arms, first_pins.get(point.bar, [zero, zero, zero])
    return moved
