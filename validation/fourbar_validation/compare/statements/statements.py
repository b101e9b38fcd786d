"""The rows of one engine about the linkage of a scene, whatever its motion."""

from collections.abc import Iterator

import numpy as np

from fourbar.formulas import mobility
from fourbar.linkage import FourBar
from fourbar.scene import Scene
from fourbar_validation.compare.answer import Answer, Engine
from fourbar_validation.compare.compare import Predicted
from fourbar_validation.compare.rows import Row
from fourbar_validation.compare.statements import limits, transmission
from fourbar_validation.compare.statements.finding import Finding, Seen, Stated, worst
from fourbar_validation.compare.statements.ranges import ranges

PAST = 1e-3
"""rad. This far on either side of a change point the speeds of the two motions differ visibly."""
FAR = 0.1
"""rad. As far as a sweep goes on."""


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


def through(linkage: FourBar, engine: Engine) -> Iterator[Finding]:
    """Through a change point two motions go on: the smooth one is that whose speeds the engine finds unbroken.

    Every change point, in both senses and from both branches, with a position on the point itself and without.
    """
    for point in mobility.change_points(linkage):
        for sense in (1.0, -1.0):
            for start in (1, -1):
                angles = point + sense * np.array([-FAR, -PAST, PAST, FAR])
                places = [(float(angles[1]), start), (float(angles[2]), 1), (float(angles[2]), -1)]
                seen = Seen(engine, linkage, places)
                rates = np.array([[seen.at(place, name) for place in places] for name in ("omega_3", "omega_4")])
                goes_on = (1, -1)[int(np.argmin(np.abs(rates[:, 1:] - rates[:, :1]).max(axis=0)))]
                expected = [start, start, goes_on, goes_on]
                stated = mobility.on_smooth_path(linkage, angles, start)
                on_it = mobility.on_smooth_path(linkage, np.insert(angles, 2, point), start)
                wrong = np.count_nonzero(stated != expected) + np.count_nonzero(np.delete(on_it, 2) != expected)
                yield Finding(float(wrong), 0.0, float(point), f"from branch {start:+d} at {point!r} rad")
