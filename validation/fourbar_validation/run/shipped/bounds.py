"""Proven extremes: nothing that the free bodies find inside the box lies outside, and the bounds are reached."""

from dataclasses import replace
from itertools import product

import numpy as np

import fourbar
from fourbar.errors import InputError, LimitError
from fourbar.scene import Scene
from fourbar.scene.motion import Motion
from fourbar.studies.enclosure import Extreme
from fourbar_validation.compare.rows import REFUSES, Row
from fourbar_validation.compare.tolerance import Array, ErrorBound
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
        lengths = {
            name: getattr(scene.linkage, name).length for name in ("input", "coupler")
        }
        scene = replace(
            scene,
            tolerances=tuple(
                fourbar.Tolerance(f"lengths.{k}", GIVEN * x) for k, x in lengths.items()
            ),
        )
    try:
        proven = fourbar.extremes(scene, [drive])
    except (InputError, LimitError) as limit:
        return [
            Row.unmeasured(
                question.name, "extremes", "exact", drive, REFUSES, str(limit)
            )
        ]
    assert proven.nominal is not None
    bounds = [
        of[drive]
        for of in (
            proven.least,
            proven.greatest,
            proven.nominal.least,
            proven.nominal.greatest,
        )
    ]
    in_interval = [np.linspace(low, high, POSITIONS) for low, high in proven.parts]
    theta_2 = np.concatenate([*in_interval, [bound.theta_2 for bound in bounds]])
    linkages = _list_corners(
        replace(scene, motion=scene.motion.replace(angle=theta_2, through="sign"))
    )
    values = np.array(
        [ask_free_bodies(linkage).quantities[drive] for linkage in linkages]
    )
    every_corner = (
        len(scene.tolerances) <= MOST
    )  # otherwise the bounds need not be reached at one of those tried
    error = np.max(
        [
            _find_beyond(theta_2, values, bounds[0], -1.0, reached=every_corner),
            _find_beyond(theta_2, values, bounds[1], 1.0, reached=every_corner),
            _find_beyond(theta_2, values[:1], bounds[2], -1.0),
            _find_beyond(theta_2, values[:1], bounds[3], 1.0),
            np.zeros_like(theta_2),
        ],
        axis=0,
    )
    size = max(abs(end) for bound in bounds for end in bound[:2])
    reason = f"{len(values)} linkages at {len(theta_2)} positions"
    return [
        make_row(question, "extremes", drive, error / size, BOUNDS, theta_2, reason)
    ]


def _list_corners(scene: Scene) -> list[Scene]:
    """List the linkage itself, then those at the corners of its tolerances."""
    reach = {tolerance.key: tolerance.reach for tolerance in scene.tolerances[:MOST]}
    file = SceneFile(replace(scene, tolerances=()))
    corners = product((-INSIDE, INSIDE), repeat=len(reach))
    moves = [
        {key: sign * reach[key] for key, sign in zip(reach, signs, strict=True)}
        for signs in corners
    ]
    return [file.move(move) for move in ({}, *moves)]


def _find_beyond(
    theta_2: Array, values: Array, bound: Extreme, sign: float, *, reached: bool = True
) -> Array:
    """Compute by how much values, one line for each linkage, lie beyond a greatest value (sign 1) or a least (-1).

    `reached`: whether one of them must come as far as the bound says that the extreme does, at its position.
    """
    most, least = (bound.high, bound.low) if sign > 0 else (-bound.low, -bound.high)
    beyond = np.asarray(
        (sign * values).max(axis=0) - most
    )  # NaN where a linkage has no torque: nothing holds there
    if reached:
        i = int(np.flatnonzero(theta_2 == bound.theta_2)[0])
        beyond[i] = max(beyond[i], least - float((sign * values[:, i]).max()))
    return beyond


def _require_conditioned(scene: Scene) -> None:
    """Raise NotAskedError where bars 3 and 4 come near to one line within the interval, not at its ends."""
    around = np.linspace(0.0, 2.0 * np.pi, POSITIONS)
    answer = ask_free_bodies(
        replace(
            scene,
            motion=Motion(around, None, branch=scene.motion.branch),
            tolerances=(),
        )
    )
    assert answer.assembled is not None
    inside = (
        answer.assembled & np.roll(answer.assembled, 1) & np.roll(answer.assembled, -1)
    )
    sine = np.abs(answer.quantities["sin_mu"][inside])
    if not len(sine) or sine.min() < LEAST_CONDITION:
        raise NotAskedError(
            f"nearer to a line of bars 3 and 4 than {LEAST_CONDITION:g} a proof takes longer than a run"
        )
