"""The rows of one engine about the linkage of a scene, whatever its motion."""

from fourbar.formulas import mobility
from fourbar.scene import Scene
from validation.compare.answer import Answer, Engine
from validation.compare.compare import Predicted
from validation.compare.rows import Row
from validation.compare.statements.finding import worst
from validation.compare.statements.limits import limit_positions
from validation.compare.statements.ranges import ranges
from validation.compare.statements.through import through
from validation.compare.statements.transmission import transmitted


def statements(
    name: str, scene: Scene, engine: Engine, answer: Answer, predicted: Predicted | None = None
) -> list[Row]:
    """One row for each of `range`, `limit_positions`, `transmission`, and where there are change points `through`.

    Parameters
    ----------
    answer : what the engine found over the scene's own motion.
    predicted : the errors to be expected of it.
    """
    found = {
        "range": ranges(scene.linkage, engine),
        "limit_positions": limit_positions(scene.linkage, engine),
        "transmission": transmitted(scene, engine, answer, predicted),
    }
    if mobility.change_points(scene.linkage):
        found["through"] = through(scene.linkage, engine)
    return [worst(name, answer, quantity, findings) for quantity, findings in found.items()]
