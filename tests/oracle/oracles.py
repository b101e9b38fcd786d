"""Second derivations of what fourbar derives from a solution: one oracle for each.

An oracle takes a question of the harness and yields its rows. No run makes them.
"""

from fourbar_validation.run.judge import make_question
from fourbar_validation.run.question import NotAskedError
from tests.oracle import cuts, files, sensitivities
from tests.oracle.equilibria import equilibria
from tests.oracle.points import points
from tests.oracle.summary import summary

ORACLES = {
    oracle.__name__: oracle
    for oracle in (
        points,
        sensitivities.study,
        sensitivities.sensitivity,
        sensitivities.tolerances,
        cuts.internal_forces,
        summary,
        equilibria,
        files.sdf,
        files.usd,
    )
}


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
            rows += ORACLES[name](question)
        except NotAskedError:
            if names:
                raise
    return rows
