"""Studies, sensitivities and tolerances by differences and cubature of what free
bodies say of changed linkages.
"""

import math
from dataclasses import replace
from itertools import product
from typing import NamedTuple

import numpy as np

import fourbar
from fourbar.quantities import FORCE_NAMES, LINE, OF_POINTS, UNKNOWNS, Array
from fourbar.studies.keys import command_key
from fourbar_validation.compare.rows import keep_worst
from fourbar_validation.compare.scales import make_reference
from fourbar_validation.compare.tolerance import divide, magnitude
from fourbar_validation.run.question import take_member
from tests.oracle.bounds import DIFFERENCES, SPREAD
from tests.oracle.points import move_points
from tests.oracle.variants import (
    DRAWN_SETTING,
    SceneFile,
    ask_beside,
    ask_free_bodies,
    at_places,
    hold_to,
    is_coordinate,
    is_near_change_point,
    make_row,
    split_unknowns,
    take_few,
)

_MEMBERS = 5
"""Members of the study, as many as positions. It is a square study, whose axes only its
numbers tell apart.
"""
MEMBERS_APART = 1e-2
"""Difference of its numbers from member to member, relative, for angles in rad."""
_APART_NEAR_CHANGE_POINT = 1e-5
"""The same near a change point, where larger differences make linkages of their own."""
_POINTS = "points"
"""Quantity of the row of all points of a scene."""


def _judge_groups(question, judge):
    """Judge the numbers that vary together, by the setting of their rows.

    Lengths and polar pairs follow from the coordinates of a drawing: these are a group
    of their own.
    """
    scene = take_few(question)
    nominal = ask_free_bodies(scene)
    groups = {}
    for key in fourbar.sensitivity(scene).keys:
        setting = DRAWN_SETTING if is_coordinate(key) else "exact"
        groups.setdefault(setting, []).append(key)
    rows = []
    for setting, keys in groups.items():
        judged = judge(question, scene, nominal, keys)
        rows += [replace(row, setting=setting) for row in keep_worst(judged)]
    return rows


def study(question):
    """Judge square studies in which many numbers vary, member by member.

    In one these are the numbers of a scene that is stated by lengths, of a drawn scene
    in another one all coordinates of its drawing.
    """
    return _judge_groups(question, _judge_study)


def _judge_study(question, scene, nominal, keys):
    """Judge a study in which the numbers of some keys vary."""
    places = np.asarray(scene.motion.angle)
    apart = MEMBERS_APART
    if is_near_change_point(scene.linkage):
        apart = _APART_NEAR_CHANGE_POINT
    stated = SceneFile(scene).find_stated(keys)
    commanded = command_key(scene)
    stated.pop(commanded, None)
    parts = [apart * number for number in range(_MEMBERS)]
    values = {key: x + step * np.array(parts) for key, (x, step) in stated.items()}
    # the places of each member lie within those of the scene: nothing says that a table
    # reaches further
    values[commanded] = places + np.outer(parts, places.mean() - places)
    rows = []
    with np.errstate(all="ignore"):
        solved = fourbar.solve(fourbar.vary(scene, values))
        for number, part in enumerate(parts):
            changes = {key: part * step for key, (_, step) in stated.items()}
            one = SceneFile(at_places(scene, values[commanded][number])).move(changes)
            answer = ask_beside(one, scene, nominal)
            rows += hold_to(question, "study", one, take_member(solved, number), answer)
    return rows


RELATIVE_STEP = 1e-4
"""Relative step of each number, for an angle in rad. Truncation at fourth order and
rounding are then about equal.
"""
FIRST_ORDER_STEP = 1e-8
"""Step of the first order that tolerances are held to. Rounding adds 1e-7, and what
bends a curve nothing.
"""
_CONVERGED = 1e-5
"""Most that the fourth order may change the second by, in parts of the sum of the
absolute terms: it leaves out some hundred times the square of that. Elsewhere a linkage
that does not assemble is too near for differences.
"""
SPREAD_SAMPLES = 1024
_NEARLY_STRAIGHT = 0.1
"""Relative difference of cubature and first order, below which three points are enough
for a deviation.
"""
_SLIGHT = 1e-3
"""Part of the greatest worst case of a quantity that is not judged. Differences and
rounding are there as large as their result.
"""
MOST_TOLERANCES = 3
"""Tolerances of a scene that are judged together: three points each."""
_GIVEN = 1e-4
"""Tolerance that the run gives the lengths, in parts of the shortest bar."""
_NODES = {False: (0.6**0.5, 5.0 / 18.0), True: (3.0**0.5, 1.0 / 6.0)}
"""Outer nodes and weights of Gauss's three points. They are of an even and of a normal
distribution; the nodes are in parts of the width.
"""


def sensitivity(question):
    """Judge the derivatives of unknowns and points along one direction in the
    numbers of a scene, and along another one in the coordinates of its drawing.
    """
    return _judge_groups(question, _judge_slopes)


def _judge_slopes(question, scene, nominal, keys):
    """Judge the derivatives along a direction in the numbers of some keys."""
    derivatives = fourbar.sensitivity(scene)
    file = SceneFile(scene)
    direction = {key: step for key, (_, step) in file.find_stated(keys).items()}
    if command_key(scene) in direction and scene.motion.stroke is None:
        direction[command_key(scene)] = 1.0

    def along(part):
        changes = {key: part * RELATIVE_STEP * step for key, step in direction.items()}
        moved = file.move(changes)
        answer = ask_beside(moved, scene, nominal)
        points = _place_points(moved, answer, moved.drawing or scene.drawing)
        return answer.quantities | points

    points_at = _place_points(scene, nominal, scene.drawing)
    at_nominal = nominal.quantities | points_at
    near, far = [(along(part), along(-part)) for part in (1.0, 2.0)]
    comparable = np.array([status == "ok" for status in derivatives.status])
    errors = {}
    for name in (*UNKNOWNS, LINE.value, *points_at):
        if name not in at_nominal:
            continue
        first, second = (
            _subtract(name, up[name], down[name]) for up, down in (near, far)
        )
        slope = (8.0 * first - second) / (12.0 * RELATIVE_STEP)
        coarse = first / (2.0 * RELATIVE_STEP)
        terms = np.array(
            [step * derivatives.of(name, key) for key, step in direction.items()]
        )
        size = magnitude(at_nominal[name]) + sum(magnitude(term) for term in terms)
        # a derivative that is no number is compared, and fails
        bent = divide(magnitude(slope - coarse), size) > _CONVERGED
        straight = np.isfinite(magnitude(slope)) & ~bent
        if name in FORCE_NAMES:
            straight &= comparable
        if not straight.any():
            continue
        error = divide(magnitude(terms.sum(axis=0) - slope), size)
        error = np.where(straight, error, 0.0)
        judged_as = _POINTS if name in points_at else name
        errors[judged_as] = np.maximum(errors.get(judged_as, 0.0), error)
    reason = f"along one direction in {len(direction)} numbers"
    return [
        make_row(
            question,
            "sensitivity",
            name,
            error,
            DIFFERENCES,
            derivatives.solution.theta_2,
            reason,
        )
        for name, error in errors.items()
    ]


def _place_points(scene, answer, drawing):
    """Return places, velocities and accelerations of the scene's points by an
    answer's angles, in the coordinates of a drawing if there is one.
    """
    origin = complex(*drawing.O2) if drawing else 0j
    placed = {}
    for name, moved in move_points(scene, make_reference(scene, answer)).items():
        parts = zip(OF_POINTS, *moved, (origin, 0j, 0j), strict=True)
        for start, arm, foot, shift in parts:
            vector = arm + foot + shift
            placed[f"{start}{name}"] = np.stack((vector.real, vector.imag), axis=1)
    return placed


def tolerances(question):
    """Judge the spread that a few tolerances make, the scene's own or given ones."""
    scene = take_few(question)
    width = _GIVEN * min(scene.linkage.lengths)
    names = ("input", "coupler", "output")
    defaults = (
        fourbar.Tolerance(f"lengths.{name}", width, name == "output") for name in names
    )
    scene = replace(
        scene, tolerances=(scene.tolerances or tuple(defaults))[:MOST_TOLERANCES]
    )
    spread = fourbar.tolerances(scene, SPREAD_SAMPLES)
    expected = _compute_expected(scene)
    errors = {}
    for name in (*UNKNOWNS, LINE.value):
        parts = [
            part
            for part in expected
            if part in (name, f"{name}_x", f"{name}_y", f"|{name}|")
        ]
        if not parts:
            continue
        slight = _SLIGHT * max(expected[part].worst.max() for part in parts)
        errors[name] = np.max(
            [
                _compute_off(spread.spreads[part], expected[part], slight)
                for part in parts
            ],
            axis=0,
        )
    reason = ", ".join(tolerance.key for tolerance in scene.tolerances)
    return [
        make_row(question, "tolerances", name, error, SPREAD, spread.theta_2, reason)
        for name, error in errors.items()
    ]


class Expected(NamedTuple):
    """Effect of the tolerances on a part of a quantity at n positions."""

    deviation: Array
    """Standard deviation, by cubature over the linkages themselves."""
    first_order: Array
    worst: Array
    bent: Array
    """Relative difference of cubature and first order. It is that of their deviations,
    or the square of the skewness.
    """


def _compute_expected(scene):
    """Compute what the free bodies of changed linkages answer.

    The result is by the parts of the unknowns.
    """
    bare = replace(scene, tolerances=())
    answer = ask_free_bodies(bare)
    nominal = split_unknowns(answer)
    file = SceneFile(bare)
    numbers = file.find_stated(tolerance.key for tolerance in scene.tolerances)

    def changed(changes):
        parts = split_unknowns(ask_beside(file.move(changes), bare, answer))
        return {
            part: _subtract(part, values, nominal[part])
            for part, values in parts.items()
        }

    weights = []
    off = []
    slopes = []
    nodes = []
    for tolerance in scene.tolerances:
        key = tolerance.key
        x, w = _NODES[tolerance.sigma]
        x *= tolerance.width
        nodes.append([(key, 0.0, 1.0 - 2.0 * w), (key, x, w), (key, -x, w)])
        _, step = numbers[key]
        h = FIRST_ORDER_STEP * max(abs(step), tolerance.width)
        up, down = (changed({key: change}) for change in (h, -h))
        slopes.append({part: (up[part] - down[part]) / (2.0 * h) for part in nominal})
    for node in product(*nodes):
        off.append(changed({key: x for key, x, _ in node}))
        weights.append(math.prod(w for *_, w in node))
    w = np.array(weights)[:, None]
    widths = np.array([[tolerance.width] for tolerance in scene.tolerances])
    normal = np.array([[tolerance.sigma] for tolerance in scene.tolerances])
    variances = np.where(normal, 1.0, 1.0 / 3.0)
    expected = {}
    for part in nominal:
        values, slope = (
            np.array([member[part] for member in members]) for members in (off, slopes)
        )
        mean = (w * values).sum(axis=0)
        deviation = np.sqrt((w * (values - mean) ** 2).sum(axis=0))
        first_order = np.sqrt((variances * (slope * widths) ** 2).sum(axis=0))
        bent = divide(abs(deviation - first_order), deviation)
        bent = np.maximum(bent, divide(abs(mean), deviation) ** 2)
        worst = abs(slope * widths * (1.0 + 2.0 * normal)).sum(axis=0)
        expected[part] = Expected(deviation, first_order, worst, bent)
    return expected


def _compute_off(spread, expected, slight):
    """Compute by what part the figures of a spread are off, (n,)."""
    errors = []
    for name, most in (
        ("worst", np.inf),
        ("first_order", np.inf),
        ("deviation", _NEARLY_STRAIGHT),
    ):
        theirs = getattr(expected, name)
        apart = divide(abs(getattr(spread, name) - theirs), theirs)
        judged = (expected.bent <= most) & (expected.worst > slight)
        errors.append(np.where(judged, apart, 0.0))
    return np.max(errors, axis=0)


def _subtract(name, one, minus):
    """Subtract, angles within half a turn."""
    difference = one - minus
    if name.startswith("theta"):
        return np.angle(np.exp(1j * difference))
    return difference
