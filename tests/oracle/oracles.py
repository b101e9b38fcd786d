"""Second derivations of what fourbar derives from a solution: one oracle for each.

An oracle takes a question of the harness and yields its rows. No run makes them.
"""

from fourbar_validation.run.judge import make_question
from fourbar_validation.run.question import NotAskedError
from tests.oracle.cuts import internal_forces
from tests.oracle.equilibria import equilibria
from tests.oracle.files import sdf, usd
from tests.oracle.points import points
from tests.oracle.sensitivities import sensitivity, study, tolerances
from tests.oracle.summary import summary

OF_FORCES = (
    study,
    sensitivity,
    tolerances,
    internal_forces,
    summary,
    equilibria,
    sdf,
    usd,
)
"""Oracles that need the forces of the free bodies."""
ORACLES = {oracle.__name__: oracle for oracle in (points, *OF_FORCES)}
AT_THETA_2 = (sdf, usd)
"""Oracles that need a command of theta_2."""


def ask(oracle, question):
    """Yield the rows of an oracle.

    Raises NotAskedError where the scene has nothing that it could compare.
    """
    if question.at.speed is None and oracle is not equilibria:
        raise NotAskedError("the scene has no speed")
    if oracle in AT_THETA_2 and question.at.commanded != "theta_2":
        raise NotAskedError(f"{question.at.commanded} is commanded")
    if oracle in OF_FORCES and oracle is not equilibria:
        answer = question.free_body
        if answer is None or answer.refusal is not None:
            raise NotAskedError("the free bodies have no forces for this scene")
    yield from oracle(question)


def judge_by(scene, *names):
    """Return the rows of some oracles, or of all that the scene has something for.

    Raises NotAskedError where the scene has nothing for one of the named oracles.
    """
    if scene.motion.free is not None:
        return []
    question = make_question("", scene, ())
    rows = []
    for name in names or ORACLES:
        try:
            rows += ask(ORACLES[name], question)
        except NotAskedError:
            if names:
                raise
    return rows
