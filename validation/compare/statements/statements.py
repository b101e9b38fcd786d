"""The rows of one engine about the linkage of a scene, whatever its motion."""

from fourbar.formulas import mobility
from fourbar.scene import Scene
from validation.compare.answer import Answer, Engine
from validation.compare.compare import Predicted
from validation.compare.rows import Row
from validation.compare.statements import limits, transmission
from validation.compare.statements.finding import Seen, Stated, worst
from validation.compare.statements.ranges import ranges
from validation.compare.statements.through import through


def statements(
    name: str,
    scene: Scene,
    engine: Engine,
    answer: Answer,
    stated: Stated | None = None,
    predicted: Predicted | None = None,
) -> list[Row]:
    """One row for each of `range`, `limit_positions`, `transmission`, and where there are change points `through`.

    Parameters
    ----------
    answer : what the engine found over the scene's own motion.
    stated : what the formulas state of the linkage, where several engines are held to it.
    predicted : the errors to be expected of the answer.
    """
    stated = Stated(scene.linkage) if stated is None else stated
    seen = Seen(engine, scene.linkage, [*limits.places(stated), *transmission.places(stated)])
    found = {
        "range": ranges(stated, engine),
        "limit_positions": limits.limit_positions(stated, seen),
        "transmission": transmission.transmitted(scene, stated, seen, answer, predicted),
    }
    if stated(mobility.change_points):
        found["through"] = through(scene.linkage, engine)
    return [worst(name, answer, quantity, findings) for quantity, findings in found.items()]
