"""What is shipped, each with the check that judges it; and their rows, whatever one of them raises."""

from collections.abc import Callable, Iterator

from fourbar.scene import Command, Scene
from fourbar.solution import Solution
from fourbar_validation.compare.answer import Answer
from fourbar_validation.compare.rows import Row, breakdown
from fourbar_validation.run.shipped.bounds import extremes
from fourbar_validation.run.shipped.calls import compiled, study
from fourbar_validation.run.shipped.changes import sensitivity, tolerances
from fourbar_validation.run.shipped.files import sdf, usd
from fourbar_validation.run.shipped.question import NotAskedError, Question

CHECKS: tuple[Callable[[Question], list[Row]], ...] = (compiled, study, sensitivity, extremes, tolerances, sdf, usd)
"""Each is the engine of its rows, by its own name."""


def judge_shipped(
    name: str, scene: Scene, at: Command, solution: Solution, free_body: Answer | None
) -> Iterator[Row | str]:
    """The rows of every check, and a line for each that a scene leaves nothing to."""
    if at.omega_2 is None or free_body is None or free_body.refusal is not None:
        yield "what else is shipped: judged by what the free bodies say of forces, and here they say nothing"
        return
    question = Question(name, scene, at, solution, free_body)
    for check in CHECKS:
        try:
            yield from check(question)
        except NotAskedError as reason:
            yield f"{check.__name__}: {reason}"
        except Exception as error:  # as of any engine
            yield breakdown(name, check.__name__, error)
