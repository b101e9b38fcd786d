"""Proven extremes: nothing that the free bodies find inside the box lies outside, and the bounds are reached."""

from dataclasses import replace
from itertools import product

import numpy as np

import fourbar
from fourbar.errors import InputError, LimitError
from fourbar.scene import Scene
from fourbar.scene.motion import Motion
from fourbar_validation.compare.rows import REFUSES, Row
from fourbar_validation.compare.tolerance import ErrorBound
from fourbar_validation.engines.description import name_driving
from fourbar_validation.run.question import NotAskedError, Question
from fourbar_validation.run.shipped.variants import SceneFile, ask_free_bodies, make_row

GIVEN = 1e-4
"""Tolerance that the run gives a length, in parts of it."""
INSIDE = 1.0 - 1e-12
"""Part of a tolerance at which corners are tried, so that no rounding puts one beyond it."""
MOST = 3
"""Tolerances at whose corners linkages are tried; of more the first."""
POSITIONS = 361
"""Positions in the interval; a smooth curve falls off by 1e-4 of its size from its peak to the next position."""
LEAST_CONDITION = 0.05
"""Least condition in the interval; nearer to a singular position the boxes become too many for a run."""
BOUNDS = ErrorBound(
    "proven bounds",
    "1e-8 of the largest value: ten times what the enclosure promises, and what rounding costs the free bodies at "
    "conditions of at least 0.05",
    1e-8,
    conditioned=False,
)


def extremes(question: Question) -> list[Row]:
    """Judge the proven extremes of the torque: with tolerances, the scene's own or some that the run gives it."""
    scene = replace(question.scene, points=(), title="", source="", pictures=())
    _require_conditioned(scene)
    drive = name_driving(scene)
    if not scene.tolerances:
        lengths = {name: getattr(scene.linkage, name).length for name in ("input", "coupler")}
        scene = replace(
            scene, tolerances=tuple(fourbar.Tolerance(f"lengths.{k}", GIVEN * x) for k, x in lengths.items())
        )
    try:
        bounds = fourbar.extremes(scene, [drive])
    except (InputError, LimitError) as limit:
        return [Row.unmeasured(question.name, "extremes", "exact", drive, REFUSES, str(limit))]
    assert bounds.nominal is not None
    ends = [each[drive] for part in (bounds, bounds.nominal) for each in (part.least, part.greatest)]
    theta_2 = np.concatenate(
        [*(np.linspace(low, high, POSITIONS) for low, high in bounds.parts), [each.theta_2 for each in ends]]
    )
    reach = {each.key: each.reach for each in scene.tolerances[:MOST]}
    bare = replace(scene, tolerances=(), motion=scene.motion.replace(angle=theta_2, through="sign"))
    corners = [dict(zip(reach, signs, strict=True)) for signs in product((-INSIDE, INSIDE), repeat=len(reach))]
    file = SceneFile(bare)
    moved = [file.move({key: sign * reach[key] for key, sign in corner.items()}) for corner in ({}, *corners)]
    values = np.array([ask_free_bodies(member).quantities[drive] for member in moved])
    size = max(abs(end) for each in ends for end in each[:2])
    error = np.zeros_like(theta_2)
    all_moved = len(reach) == len(scene.tolerances)
    for of, own, within in ((bounds, values, all_moved), (bounds.nominal, values[:1], True)):
        for sign, each in ((-1.0, of.least[drive]), (1.0, of.greatest[drive])):
            proven, reached = (each.high, each.low) if sign > 0 else (-each.low, -each.high)
            beyond = (sign * own).max(axis=0) - proven  # NaN where a linkage has no torque: nothing holds there
            if within:
                at = int(np.flatnonzero(theta_2 == each.theta_2)[0])
                beyond[at] = max(beyond[at], reached - float((sign * own[:, at]).max()))
            error = np.maximum(error, beyond / size)
    reason = f"{len(values)} linkages at {len(theta_2)} positions"
    return [make_row(question, "extremes", drive, error, BOUNDS, theta_2, reason)]


def _require_conditioned(scene: Scene) -> None:
    """NotAskedError where bars 3 and 4 come near to one line within the interval, not at its ends."""
    around = np.linspace(0.0, 2.0 * np.pi, POSITIONS)
    answer = ask_free_bodies(replace(scene, motion=Motion(around, None, branch=scene.motion.branch), tolerances=()))
    assert answer.assembled is not None
    inside = answer.assembled & np.roll(answer.assembled, 1) & np.roll(answer.assembled, -1)
    sine = np.abs(answer.quantities["sin_mu"][inside])
    if not len(sine) or sine.min() < LEAST_CONDITION:
        raise NotAskedError(
            f"nearer to a line of bars 3 and 4 than {LEAST_CONDITION:g} a proof takes longer than a run"
        )
