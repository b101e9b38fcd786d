"""What `solve` returns: one array per quantity, and `None` for what was not asked for."""

from dataclasses import dataclass, field, fields
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from fourbar.state import Array

if TYPE_CHECKING:
    from pathlib import Path

    from pandas import DataFrame

STAGES = ("position", "velocity", "acceleration", "force", "error")
STAGE_OF = {
    **dict.fromkeys(("theta_3", "theta_4", "A", "B", "G2", "G3", "G4", "sin_mu", "condition"), "position"),
    **dict.fromkeys(("omega_2", "omega_3", "omega_4"), "velocity"),
    **dict.fromkeys(
        ("alpha_2", "alpha_3", "alpha_4", "a_A", "a_B", "a_G2", "a_G3", "a_G4"),
        "acceleration",
    ),
    **dict.fromkeys(("F12", "F32", "F43", "F14", "torque", "drive_condition"), "force"),
    **dict.fromkeys(("torque_low", "torque_high", "friction_residual"), "force"),
    **dict.fromkeys(("torque_error", "force_error"), "error"),
}
"""Every evaluated quantity and the stage that computes it."""
OF_DRY_FRICTION = ("torque_low", "torque_high")
OF_PIN_LOADS = ("friction_residual",)
"""Quantities that exist only where the scene has dry friction, or friction that depends on the pin forces."""
ANGLES = ("theta_3", "theta_4")
VECTORS = frozenset(("A", "B", "G2", "G3", "G4", "a_A", "a_B", "a_G2", "a_G3", "a_G4", "F12", "F32", "F43", "F14"))
UNITS = {
    **dict.fromkeys(("theta_2", "theta_3", "theta_4"), "rad"),
    **dict.fromkeys(("omega_2", "omega_3", "omega_4"), "rad/s"),
    **dict.fromkeys(("alpha_2", "alpha_3", "alpha_4"), "rad/s^2"),
    **dict.fromkeys(("A", "B", "G2", "G3", "G4"), "m"),
    **dict.fromkeys(("a_A", "a_B", "a_G2", "a_G3", "a_G4"), "m/s^2"),
    **dict.fromkeys(("F12", "F32", "F43", "F14"), "N"),
    "time": "s",
    "torque": "N m",
    "torque_error": "N m",
    **dict.fromkeys(("torque_low", "torque_high", "friction_residual"), "N m"),
    "force_error": "N",
    **dict.fromkeys(("sin_mu", "condition", "drive_condition"), "1"),
}
STATUS_NAMES = (
    *("ok", "not_assembled", "singular", "jammed", "several", "no_direction", "wound"),
    *("no_torque", "overflow"),
)
OK, NOT_ASSEMBLED, SINGULAR, JAMMED, SEVERAL, NO_DIRECTION, WOUND, NO_TORQUE, OVERFLOW = range(len(STATUS_NAMES))


@dataclass(slots=True, eq=False)
class Solution:
    """The answer of the formulas at n positions, SI units and radians.

    Scalars have shape (n,), vectors (n, 2); NaN marks a position where a quantity has no value
    (see `status`), None a quantity that was not asked for.
    """

    title: str
    drive_bar: int
    status_code: NDArray[np.uint8]
    """0 ok: every quantity that was asked for is a number. 1 not_assembled, 2 singular (velocities are 0/0); of
    friction that depends on the pin forces: 3 jammed (no forces fulfil it: they are NaN; at rest, where it is the
    motion that would begin, torque_low or torque_high is), 4 several (more than one set does: those of the least
    friction); of springs, forces NaN: 5 no_direction (both ends in one point), 6 wound (turned beyond half a turn from
    rest). 7 no_torque: the two bars that are not driven are in line, no couple on the driven bar holds them in balance,
    forces are NaN (T3 and T4 have these poles where omega_3, omega_4 are 0). 8 overflow: numbers beyond the range of
    doubles; from the first stage (position, velocity, ...) that meets them on everything is NaN."""
    branch: NDArray[np.int8]
    """+1 open, -1 crossed."""
    theta_2: Array
    # the positions are None only where `out` named other quantities, which then are all that is wanted
    theta_3: Array = None  # type: ignore[assignment]
    theta_4: Array = None  # type: ignore[assignment]
    sin_mu: Array = None  # type: ignore[assignment]
    """sin(theta_4 - theta_3), signed like the branch."""
    condition: Array = None  # type: ignore[assignment]
    """Motion condition |sin(theta_4 - theta_3)|, in (0, 1]; 1 is best."""
    A: Array = None  # type: ignore[assignment]
    B: Array = None  # type: ignore[assignment]
    G2: Array = None  # type: ignore[assignment]
    G3: Array = None  # type: ignore[assignment]
    G4: Array = None  # type: ignore[assignment]
    omega_2: Array | None = None
    omega_3: Array | None = None
    omega_4: Array | None = None
    alpha_2: Array | None = None
    alpha_3: Array | None = None
    alpha_4: Array | None = None
    a_A: Array | None = None
    a_B: Array | None = None
    a_G2: Array | None = None
    a_G3: Array | None = None
    a_G4: Array | None = None
    F12: Array | None = None
    F32: Array | None = None
    F43: Array | None = None
    F14: Array | None = None
    torque: Array | None = None
    """Couple of ground on the driven bar, N m."""
    drive_condition: Array | None = None
    """|sine| between the two bars that are not driven, in (0, 1]."""
    torque_error: Array | None = None
    """Error bar of the torque, N m: what rounding makes it scatter by."""
    force_error: Array | None = None
    """Error bar of the pin forces, N: the same for the worst of the four."""
    torque_low: Array | None = None
    """Where dry friction holds a pin at rest the least torque that may act, else the torque itself, N m."""
    torque_high: Array | None = None
    """The greatest one; NaN where friction jams the motion that would begin."""
    friction_residual: Array | None = None
    """Largest |mu r |F| - couple| that the solved pin friction leaves, N m."""

    time: Array | None = None
    """Of a motion law, or of a free motion, s; the latter ends where the linkage stops at a limit position."""
    stopped_at: float | None = field(default=None, init=False)
    """When a free motion reached that limit position or change point, s; None: it did not."""

    def __len__(self) -> int:
        return len(self.theta_2)

    @property
    def assembled(self) -> NDArray[np.bool_]:
        """Where the loop closes, (n,)."""
        return np.not_equal(self.status_code, NOT_ASSEMBLED)

    @property
    def status(self) -> list[str]:
        """One of `STATUS_NAMES` for each position."""
        return [STATUS_NAMES[code] for code in self.status_code]

    def evaluated(self) -> list[str]:
        """Names of the quantities that were evaluated, theta_2 first."""
        names = [f.name for f in fields(self) if f.name in UNITS]
        return [name for name in names if getattr(self, name) is not None]

    def to_csv(self, path: "str | Path | None" = None, *, degrees: bool = False) -> str | None:
        """One line per position, every digit; the text itself, or written to a file, whole or not at all."""
        from fourbar.tables import csv_text
        from fourbar.writing import write_text

        text = csv_text(self, degrees=degrees)
        if path is None:
            return text
        write_text(path, text)
        return None

    def to_pandas(self) -> "DataFrame":
        """One row per position, vectors as columns `A_x`, `A_y`; only what was evaluated, SI and radians.

        Raises DependencyError where pandas is not installed.
        """
        from fourbar.notebook import frame

        return frame(self)

    def _repr_html_(self) -> str:
        from fourbar.notebook import solution_html

        return solution_html(self)


class Unwrapped:
    """Makes angles continuous along a sweep, one block after the other: the first in (-pi, pi]."""

    def __init__(self) -> None:
        self.turns: float = 0.0
        self.last: float | None = None

    def extend(self, angles: Array) -> None:
        """Unwrap the next angles, each in [-pi, pi], in place; gaps (NaN) are stepped over."""
        low, high = float(angles.min()), float(angles.max())
        if not np.isnan(low) and self.last is not None and self.turns == 0.0:
            low, high = min(low, self.last), max(high, self.last)
        if high - low < np.pi and self.turns == 0.0:
            self.last = float(angles[-1])
            return
        known = np.flatnonzero(~np.isnan(angles))
        if not len(known):
            return
        raw = angles[known]
        before = raw[0] if self.last is None else self.last - self.turns
        # -pi as a double lies inside (-pi, pi], yet reads as the excluded end
        start = self.turns + (2.0 * np.pi if self.last is None and raw[0] == -np.pi else 0.0)
        jumps = np.diff(raw, prepend=before)
        turns = start - (2.0 * np.pi) * np.cumsum(np.round(jumps / (2.0 * np.pi)))
        angles[known] = raw + turns
        self.turns, self.last = float(turns[-1]), float(raw[-1] + turns[-1])
