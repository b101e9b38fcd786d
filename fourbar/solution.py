"""What `solve` returns: one array per quantity, and `None` for what was not asked for."""

from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from fourbar.kinematics import Array

STAGES = ("position", "velocity", "acceleration", "force")
STAGE_OF = {
    **dict.fromkeys(("theta_3", "theta_4", "A", "B", "G2", "G3", "G4", "sin_mu", "condition"), "position"),
    **dict.fromkeys(("omega_2", "omega_3", "omega_4"), "velocity"),
    **dict.fromkeys(
        ("alpha_2", "alpha_3", "alpha_4", "a_A", "a_B", "a_G2", "a_G3", "a_G4"),
        "acceleration",
    ),
    **dict.fromkeys(("F12", "F32", "F43", "F14", "torque", "drive_condition"), "force"),
}
"""Every evaluated quantity and the stage that computes it."""
VECTORS = frozenset(("A", "B", "G2", "G3", "G4", "a_A", "a_B", "a_G2", "a_G3", "a_G4", "F12", "F32", "F43", "F14"))
UNITS = {
    **dict.fromkeys(("theta_2", "theta_3", "theta_4"), "rad"),
    **dict.fromkeys(("omega_2", "omega_3", "omega_4"), "rad/s"),
    **dict.fromkeys(("alpha_2", "alpha_3", "alpha_4"), "rad/s^2"),
    **dict.fromkeys(("A", "B", "G2", "G3", "G4"), "m"),
    **dict.fromkeys(("a_A", "a_B", "a_G2", "a_G3", "a_G4"), "m/s^2"),
    **dict.fromkeys(("F12", "F32", "F43", "F14"), "N"),
    "torque": "N m",
    **dict.fromkeys(("sin_mu", "condition", "drive_condition"), "1"),
}
STATUS_NAMES = ("ok", "not_assembled", "singular")
OK, NOT_ASSEMBLED, SINGULAR = range(3)


@dataclass(slots=True, eq=False)
class Solution:
    """The answer of the formulas at n positions, SI units and radians.

    Scalars have shape (n,), vectors (n, 2); NaN marks a position where a quantity has no value
    (see `status`), None a quantity that was not asked for.
    """

    title: str
    drive_bar: int
    status_code: NDArray[np.uint8]
    """0 ok, 1 not_assembled, 2 singular (velocities are 0/0)."""
    branch: NDArray[np.int8]
    """+1 open, -1 crossed."""
    theta_2: Array
    theta_3: Array
    theta_4: Array
    sin_mu: Array
    """sin(theta_4 - theta_3), signed like the branch."""
    condition: Array
    """Motion condition |sin(theta_4 - theta_3)|, in (0, 1]; 1 is best."""
    A: Array
    B: Array
    G2: Array
    G3: Array
    G4: Array
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

    def __len__(self) -> int:
        return len(self.theta_2)

    @property
    def assembled(self) -> NDArray[np.bool_]:
        """Where the loop closes, (n,)."""
        return np.not_equal(self.status_code, NOT_ASSEMBLED)

    @property
    def status(self) -> list[str]:
        """ "ok", "not_assembled" or "singular" for each position."""
        return [STATUS_NAMES[code] for code in self.status_code]

    def evaluated(self) -> list[str]:
        """Names of the quantities that were evaluated, theta_2 first."""
        names = [f.name for f in fields(self) if f.name in UNITS]
        return [name for name in names if getattr(self, name) is not None]


def unwrap(angles: Array) -> Array:
    """The same angles, continuous along a sweep: the first in (-pi, pi], gaps (NaN) stepped over."""
    result = angles.copy()
    known = ~np.isnan(angles)
    result[known] = np.unwrap(angles[known])
    return result
