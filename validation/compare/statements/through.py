"""Through a change point two motions go on: the smooth one is that whose speeds the engine finds unbroken."""

from collections.abc import Iterator

import numpy as np

from fourbar.formulas import mobility
from fourbar.linkage import FourBar
from validation.compare.answer import Engine
from validation.compare.statements.finding import Finding, Seen

PAST = 1e-3
"""rad. This far on either side of a change point the speeds of the two motions differ visibly."""
FAR = 0.1
"""rad. As far as a sweep goes on."""


def through(linkage: FourBar, engine: Engine) -> Iterator[Finding]:
    """Every change point, in both senses and from both branches, with a position on the point itself and without."""
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
