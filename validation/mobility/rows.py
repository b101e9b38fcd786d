"""The rows of one engine about the linkage of a scene, whatever its motion."""

from fourbar import mobility
from fourbar.scene import Scene
from validation.answer import Answer, Engine
from validation.mobility.finding import worst
from validation.mobility.limits import limit_positions
from validation.mobility.ranges import ranges
from validation.mobility.through import through
from validation.mobility.transmission import transmitted
from validation.results import Row


def statements(name: str, scene: Scene, engine: Engine, answer: Answer) -> list[Row]:
    """One row for each of `range`, `limit_positions`, `transmission`, and where there are change points `through`.

    Parameters
    ----------
    answer : what the engine found over the scene's own motion.
    """
    found = {
        "range": ranges(scene.linkage, engine),
        "limit_positions": limit_positions(scene.linkage, engine),
        "transmission": transmitted(scene, engine, answer),
    }
    if mobility.change_points(scene.linkage):
        found["through"] = through(scene.linkage, engine)
    return [worst(name, answer, quantity, findings) for quantity, findings in found.items()]
