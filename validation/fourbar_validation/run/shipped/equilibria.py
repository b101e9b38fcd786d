"""Equilibria, by free bodies held at rest: the torque that holds them vanishes there, and nowhere between.

With T the torque on the independent bar at rest and J the torque per unit of its acceleration, T = -Q and
    dT/dq > 0: stable,   sqrt((dT/dq)/J)/(2 pi): the frequency.
"""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

import fourbar
from fourbar.formulas.mobility import change_points, find_intervals, turns_fully
from fourbar.scene import Command, Scene
from fourbar.scene.motion import Motion, Sweep
from fourbar.studies.equilibrium import Equilibrium
from fourbar_validation.compare.answer import Array
from fourbar_validation.compare.rows import AGREES, FAILS, Row
from fourbar_validation.compare.tolerance import WELL_CONDITIONED, ErrorBound
from fourbar_validation.engines.free_body import FreeBody
from fourbar_validation.run.question import NotAskedError, Question
from fourbar_validation.run.shipped.variants import make_row

SAMPLES = 720
"""Of a turn of the input: between two of them the torque changes its sign at an odd number of equilibria."""
STEP = 3e-4
"""rad, of differences of the sixth order."""
DIFFERENCES = np.array([-1.0, 9.0, -45.0, 0.0, 45.0, -9.0, 1.0]) / 60.0
SOUND = 0.3
"""Least condition of such: of a slope that grows as 1/x they leave out 36 (3e-4/x)^6, 2e-12 where x is 0.05 rad."""
OFF_GRID = 0.381966
"""Of a sample's step: no equilibrium of a round angle falls on one."""
REST = ErrorBound(
    "rest",
    "1e-9 of the usual torque: differences of free bodies where the condition is at least 0.3, which leave out 2e-12, "
    "and to which rounding adds 1e-12 of what acts, which may be 1000 times the torque that is left",
    1e-9,
    conditioned=False,
)


def equilibria(question: Question) -> Iterator[Row]:
    """Judge the torque, its slope and the frequency at every equilibrium, and that there are no others."""
    scene, result = _at_rest(question.scene), fourbar.equilibrium(question.scene)
    if result.indifferent:
        raise NotAskedError("the linkage is indifferent")
    branches: tuple[int, ...] = (1, -1)
    if turns_fully(scene.linkage) and not change_points(scene.linkage):
        branches = (int(question.solution.branch[0]),)
    theta_2 = _around(question)
    torques = {sign: _held(scene, 2, theta_2, sign, least=WELL_CONDITIONED) for sign in branches}
    known = [torque[np.isfinite(torque)] for torque in torques.values()]
    most = float(np.median(np.abs(np.concatenate(known)))) if sum(map(len, known)) else 0.0
    if not most > 0.0:
        raise NotAskedError("no position is held by a torque")
    missed = sum(_differing(theta_2, torque, _of_branch(result.found, sign)) for sign, torque in torques.items())
    reason = f"{len(result.found)} equilibria; {SAMPLES} positions of a turn held by free bodies"
    verdict = FAILS if missed else AGREES
    yield Row(question.name, "equilibria", "exact", "missed", float(missed), 0.0, verdict, reason, float("nan"), 1.0)
    decided = [each for each in result.found if each.stability != "undecided"]
    rows = [(each.place.theta_2, *error) for each in decided if (error := _errors(scene, each, most)) is not None]
    if rows:
        where, *errors = np.array(rows).T
        for name, error in zip(("torque", "slope", "inertia", "frequency"), errors, strict=True):
            compared = f"{len(rows)} of {len(result.found)} equilibria"
            yield make_row(question, "equilibria", name, error, REST, where, compared)


def _at_rest(scene: Scene) -> Scene:
    """Leave out dry friction, which has equilibria of its own, and the drive."""
    if scene.counts_turns:
        raise NotAskedError("how far its torsion springs are wound depends on the motion")
    effects = tuple(effect for effect in scene.effects if not effect.dry_pins)
    if not scene.loads and not effects:
        raise NotAskedError("nothing acts")
    return replace(scene, motion=Motion(), effects=effects, drive=None, drive_bar=2, points=(), tolerances=())


def _around(question: Question) -> Array:
    """List the input's angles at which it is held: through its sweep, or all that it reaches."""
    swept, motion = question.solution.theta_2, question.scene.motion
    swept = swept[np.isfinite(swept)]
    turn, first = 2.0 * np.pi, float(swept[0])
    if isinstance(motion.angle, Sweep) or motion.law is not None:
        low, high = float(swept.min()), min(float(swept.max()), float(swept.min()) + turn)
    else:
        low, high = next(
            own for own in find_intervals(question.scene.linkage) if (first - own[0]) % turn <= own[1] - own[0]
        )
    return np.arange(low + OFF_GRID * turn / SAMPLES, high, turn / SAMPLES)


def _held(
    scene: Scene, bar: int, angle: Array, branch: int, acceleration: float = 0.0, *, least: float = SOUND
) -> Array:
    """Ask the free bodies for the torque on a bar at rest; NaN where it is ill-conditioned or does not assemble."""
    sign = np.full(angle.shape, branch, dtype=np.int8)
    at = Command(angle, sign, np.zeros(angle.shape), np.full(angle.shape, acceleration), bar=bar)
    with np.errstate(all="ignore"):
        answer = FreeBody().answer(replace(scene, drive_bar=bar), at)
        if answer.refusal is not None:
            raise NotAskedError(answer.refusal)
        theta = {2: angle, **{each: answer.quantities[f"theta_{each}"] for each in (2, 3, 4) if each != bar}}
        theta[bar] = angle
        one, other = (theta[each] for each in (2, 3, 4) if each != bar)
        sound = np.abs(np.sin(other - one)) >= least
    held: Array = np.where(sound & np.asarray(answer.assembled), answer.quantities["torque"], np.nan)
    return held


def _of_branch(found: tuple[Equilibrium, ...], sign: int) -> Array:
    return np.array([each.place.theta_2 for each in found if each.place.branch == sign])


def _differing(theta_2: Array, torque: Array, found: Array) -> int:
    """Count the steps in which the torque changes its sign and no equilibrium was found, or the reverse."""
    changes = torque[:-1] * torque[1:] < 0.0
    counted = np.zeros(len(changes), dtype=int)
    for place in found:
        at = theta_2[0] + np.remainder(place - theta_2[0], 2.0 * np.pi)
        index: NDArray[np.intp] = np.searchsorted(theta_2, at) - 1
        if 0 <= index < len(counted):
            counted[index] += 1
    known = np.isfinite(torque[:-1]) & np.isfinite(torque[1:])
    return int(np.count_nonzero(known & (changes != (counted % 2 == 1))))


def _errors(scene: Scene, each: Equilibrium, most: float) -> tuple[float, float, float, float] | None:
    """Compare torque, slope, inertia and frequency, each by its size; None where it is ill-conditioned."""
    place, bar = each.place, int(each.angle[-1])
    theta = {2: place.theta_2, 3: place.theta_3, 4: place.theta_4}
    one, other = (theta[k] for k in (2, 3, 4) if k != bar)
    branch = 1 if np.sin(other - one) > 0.0 else -1
    around = theta[bar] + STEP * np.arange(-3.0, 4.0)
    torque = _held(scene, bar, around, branch)
    push = most / each.inertia if each.inertia > 0.0 else 1.0
    pushed = _held(scene, bar, around[3:4], branch, push)
    if not np.isfinite(torque).all():
        return None
    slope = float(DIFFERENCES @ torque) / STEP
    J = float(pushed[0] - torque[3]) / push
    off = abs(slope + each.slope) / (most + abs(slope)), abs(J - each.inertia) / max(abs(J), each.inertia, 1e-300)
    frequency = np.sqrt(slope / J) / (2.0 * np.pi) if slope > 0.0 and J > 0.0 else 0.0
    ours = 0.0 if each.frequency is None else each.frequency
    size = max(frequency, ours) * max(1.0, most / max(abs(slope), 1e-300)) or 1.0
    return abs(float(torque[3])) / most, off[0], off[1], abs(frequency - ours) / size
