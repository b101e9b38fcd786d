"""A motion law held to its own table: the piecewise cubic through the points whose acceleration is continuous.

Each piece is the cubic of Hermite through the table's angles with the speeds at its ends; that it is the
law's is decided by the accelerations of neighbouring pieces and by the ends alone.
"""

import numpy as np

from fourbar.scene import Command, Scene
from validation.compare.error import worst
from validation.compare.identities import FORMULAS
from validation.compare.rows import AGREES, FAILS, Row
from validation.compare.tolerance import IDENTITY, Array


def law_row(name: str, scene: Scene, at: Command) -> Row:
    """theta_2, omega_2 and alpha_2 of every position, and the conditions on the pieces, by the worst of them."""
    law = scene.motion.law
    assert law is not None and at.time is not None and at.omega_2 is not None
    t, angle = np.array(law.time), np.array(law.theta_2)
    h, rise = np.diff(t), np.diff(angle) / np.diff(t)
    speed = law.at(t)[1]
    first = (6.0 * rise - 4.0 * speed[:-1] - 2.0 * speed[1:]) / h
    last = (-6.0 * rise + 2.0 * speed[:-1] + 4.0 * speed[1:]) / h
    turned = float(np.abs(angle).max())
    size = float(np.abs(rise).max() + np.abs(speed).max()) + turned / float(h.min())
    bent = size / float(h.min())
    errors = [np.abs(first[1:] - last[:-1]) / bent]
    if law.ends == "rest":
        errors.append(np.abs(speed[[0, -1]]) / size)
    elif law.ends == "periodic":
        errors.append(np.abs([speed[0] - speed[-1], (first[0] - last[-1]) / h.min()]) / size)
    else:  # one cubic through the first two pieces, and through the last two
        jerk = (last - first) / h
        errors.append(np.abs([jerk[1] - jerk[0], jerk[-1] - jerk[-2]]) * float(h.min()) / bent)
    piece = np.clip(np.searchsorted(t, at.time, side="right") - 1, 0, len(h) - 1)
    theta_2, omega_2, alpha_2 = _hermite(
        at.time - t[piece], angle[piece], speed[piece], first[piece], last[piece], h[piece]
    )
    along = [
        np.abs(theta_2 - at.theta_2) / max(1.0, turned),
        np.abs(omega_2 - at.omega_2) / size,
        np.abs(alpha_2 - at.alpha_2) / bent,
    ]
    pieces, position = max(float(each.max(initial=0.0)) for each in errors), worst(np.max(along, axis=0))
    error = float(np.max([pieces, *(each[position] for each in along)]))
    verdict = AGREES if error <= IDENTITY.factor else FAILS
    reason = "the piecewise cubic through the table, its acceleration continuous"
    place = float(at.theta_2[position])
    return Row(name, FORMULAS, "exact", "law", error, IDENTITY.factor, verdict, reason, place, 1.0)


def _hermite(s: Array, angle: Array, speed: Array, first: Array, last: Array, h: Array) -> tuple[Array, Array, Array]:
    """Angle, speed and acceleration a time s into a piece, from its acceleration at both ends."""
    jerk = (last - first) / h
    return (
        angle + s * (speed + s * (first / 2.0 + s * jerk / 6.0)),
        speed + s * (first + s * jerk / 2.0),
        first + s * jerk,
    )
