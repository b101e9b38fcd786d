"""One scene through the whole path: file and back, formulas, exact engines, and from the torque back to the motion."""

import warnings

import numpy as np

from fourbar.dynamics import VANISHING, acceleration, generalised_force, inertia, path
from fourbar.files import dump, loads
from fourbar.scene import Command, Scene, command, solve
from fourbar.solution import OK, Solution
from validation.compare import TOUCHING_MARGIN, closing_margin, compare
from validation.hard.prediction import from_data
from validation.hard.suite import predicting
from validation.identities import identities
from validation.mobility.rows import statements
from validation.results import FAILS
from validation.tolerance import DEGRADED, EPS, K
from validation.witnesses import WITNESSES, Witness, predicting_from

EXACT = tuple(predicting(w) for w in WITNESSES if w.name in ("pinocchio-inverse", "mujoco-inverse", "free-body"))
"""The exact engines, held to full accuracy or to what was predicted for the position."""


def findings(scene: Scene, witnesses: tuple[Witness, ...] = EXACT) -> list[str]:
    """What is wrong with a scene, in one line each; an exception or a warning is a finding too."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            at = command(scene)
            solution = solve(scene, "force", at=at)
            found = [*_file(scene), *_assembly(scene, at, solution)]
            return [*found, *_engines(scene, at, solution, witnesses), *_back(scene, at, solution)]
    except Exception as error:  # a traceback is what fuzzing looks for
        return [f"{type(error).__name__}: {error}".splitlines()[0]]


def _file(scene: Scene) -> list[str]:
    """Written as a scene file and read again, it must be the same scene to the last digit."""
    again = dump(loads(dump(scene)))
    return [] if again == dump(scene) else ["file: a scene that was written and read is another one"]


def _assembly(scene: Scene, at: Command, solution: Solution) -> list[str]:
    """No position where the loop does not close, none missing where it does, by ball arithmetic."""
    from flint import arb, ctx

    from validation.reference import BITS, closure, inputs

    ctx.prec = BITS
    found = []
    margin = np.abs(closing_margin(scene, at.theta_2))
    for i, theta_2 in enumerate(at.theta_2):
        exact = {name: arb(value) for name, value in inputs(scene, float(theta_2)).items()}
        closes = closure(exact, int(at.branch[i])) is not None
        if closes != bool(solution.assembled[i]) and margin[i] > TOUCHING_MARGIN:
            found.append(f"assembled: the formulas say {bool(solution.assembled[i])} at theta_2 = {theta_2!r}")
        angles = (solution.theta_3[i], solution.theta_4[i])
        if np.isfinite(angles).any() and not solution.assembled[i]:
            found.append(f"assembled: angles where the loop does not close, theta_2 = {theta_2!r}")
    return found


def _engines(scene: Scene, at: Command, solution: Solution, witnesses: tuple[Witness, ...]) -> list[str]:
    rows = identities("", scene, at, solution)
    for witness in witnesses:
        answer = witness.engine().answer(scene, at)
        rows += compare(
            "",
            scene,
            answer,
            solution,
            witness.tolerance,
            witness.expected,
            predicting_from(witness, scene, at, answer),
        )
        if witness.name == "pinocchio-inverse" and answer.refusal is None:  # of two exact engines the quicker one
            rows += statements("", scene, witness.engine(), answer)
    return [f"{row.engine} {row.quantity}: {row.reason}" for row in rows if row.verdict == FAILS]


def _back(scene: Scene, at: Command, solution: Solution) -> list[str]:
    """From the torque back to alpha_2 by the reduced equation: J alpha = Q + T theta_k' - J'/2 omega^2."""
    assert solution.torque is not None and at.omega_2 is not None
    way = path(scene.linkage, at.theta_2, np.asarray(at.branch, dtype=float))
    terms = (*scene.loads, *scene.effects)
    with np.errstate(all="ignore"):
        J, J_1 = inertia(scene.linkage, way)
        Q = generalised_force(scene.linkage, way, at.omega_2, terms)
        driven = solution.torque * way.first[scene.drive_bar]
        alpha = acceleration(scene.linkage, way, at.omega_2, Q + driven)
        rate = np.where(at.omega_2 == 0.0, VANISHING, at.omega_2)  # dry friction at rest is the mean of two that cancel
        pulls = sum(np.abs(generalised_force(scene.linkage, way, rate, (term,))) for term in terms)
        sizes = pulls + np.abs(driven) + np.abs(0.5 * J_1 * at.omega_2**2) + np.abs(J * at.alpha_2)
        error = np.abs(J * (alpha - at.alpha_2))
    where = (solution.status_code == OK) & (np.broadcast_to(J, error.shape) > 0.0)
    if not where.any() or not (error[where] > K * EPS * np.broadcast_to(sizes, error.shape)[where]).any():
        return []
    slack = _torque_slack(scene, at, way.first[scene.drive_bar])
    bad = where & ~(error <= K * EPS * sizes + DEGRADED * slack)
    return [f"forward: alpha_2 from the torque is off by {alpha[i] - at.alpha_2:.1e}" for i in np.flatnonzero(bad)]


def _torque_slack(scene: Scene, at: Command, coefficient: object) -> np.ndarray:
    """What the rounding of the data may do to J alpha through the torque."""
    predicted = from_data(scene, at, ("torque",))["torque"]
    with np.errstate(invalid="ignore"):  # a torque that has no bound on a bar that does not move
        return np.asarray(np.nan_to_num(np.abs(coefficient) * predicted, nan=0.0, posinf=np.inf))  # type: ignore[call-overload]
