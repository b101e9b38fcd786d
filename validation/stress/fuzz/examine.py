"""One scene through the whole path: file and back, formulas, exact engines."""

import warnings

import numpy as np

from fourbar.files import dump, loads
from fourbar.scene import Command, Scene, command
from fourbar.solution import Solution
from fourbar.solve import solve
from validation.compare.compare import TOUCHING_MARGIN, closing_margin, compare
from validation.compare.identities import identities
from validation.compare.rows import FAILS
from validation.compare.statements.statements import statements
from validation.engines.hard_suite import predicting
from validation.engines.witnesses import WITNESSES, predicting_from

EXACT = tuple(predicting(w) for w in WITNESSES if w.name in ("pinocchio-inverse", "mujoco-inverse", "free-body"))
"""The exact engines, held to full accuracy or to what was predicted for the position."""


def findings(scene: Scene) -> list[str]:
    """What is wrong with a scene, in one line each; an exception or a warning is a finding too."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            at = command(scene)
            solution = solve(scene, "force", at=at)
            return [*_file(scene), *_assembly(scene, at, solution), *_engines(scene, at, solution)]
    except Exception as error:  # a traceback is what fuzzing looks for
        return [f"{type(error).__name__}: {error}".splitlines()[0]]


def _file(scene: Scene) -> list[str]:
    """Written as a scene file and read again, it must be the same scene to the last digit."""
    again = dump(loads(dump(scene)))
    return [] if again == dump(scene) else ["file: a scene that was written and read is another one"]


def _assembly(scene: Scene, at: Command, solution: Solution) -> list[str]:
    """No position where the loop does not close, none missing where it does, by ball arithmetic."""
    from validation.engines.balls import closure, stored

    found = []
    margin = np.abs(closing_margin(scene, at.theta_2))
    for i, theta_2 in enumerate(at.theta_2):
        closes = closure(stored(scene, float(theta_2)), int(at.branch[i])) is not None
        if closes != bool(solution.assembled[i]) and margin[i] > TOUCHING_MARGIN:
            found.append(f"assembled: the formulas say {bool(solution.assembled[i])} at theta_2 = {theta_2!r}")
        angles = (solution.theta_3[i], solution.theta_4[i])
        if np.isfinite(angles).any() and not solution.assembled[i]:
            found.append(f"assembled: angles where the loop does not close, theta_2 = {theta_2!r}")
    return found


def _engines(scene: Scene, at: Command, solution: Solution) -> list[str]:
    rows = identities("", scene, at, solution)
    for witness in EXACT:
        answer = witness.engine().answer(scene, at)
        predicted = predicting_from(witness, scene, at, answer)
        rows += compare("", scene, answer, solution, witness.tolerance, witness.expected, predicted)
        if witness.name == "pinocchio-inverse" and answer.refusal is None:  # of two exact engines the quicker one
            rows += statements("", scene, witness.engine(), answer, predicted=predicted)
    # half of the scenes are drawn where doubles have few digits: that they are undecided is no fault
    failed = [row for row in rows if row.verdict == FAILS and row.quantity != "undecided"]
    return [f"{row.engine} {row.quantity}: {row.reason}" for row in failed]
