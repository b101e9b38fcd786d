"""What the speeds are held to."""

from typing import NamedTuple


class Limit(NamedTuple):
    """What a row of the table is held to, and why; a ratio, which holds with and without AVX-512."""

    sign: str
    bound: float
    reason: str

    def holds(self, measured: float) -> bool:
        """Whether the measured number keeps it; NaN does not."""
        return measured >= self.bound if self.sign == ">=" else measured <= self.bound


JUDGED_BY_SYSTEMS = "a judged scene / 13x13"
LIMITS = {
    "13x13 / formulas": Limit(">=", 5.0, "closed formulas are worth several times the system that they eliminate"),
    "formulas / positions only": Limit(">=", 3.0, "who asks for two angles does not pay for nine more unknowns"),
    "positions only / floor": Limit("<=", 6.0, "the rest of two angles is arithmetic on arrays of a block"),
    "solve to forces / formulas": Limit("<=", 2.0, "new arrays and the points come on top, no second evaluation"),
    "solve with error bars / to forces": Limit(
        "<=", 25.0, "the forces are evaluated 15 times, all that is computed changed in its last digit"
    ),
    "one position / 13x13 solved": Limit("<=", 70.0, "some hundred steps of Python, and no array"),
    "one position with error bars / to forces": Limit("<=", 4.5, "the evaluations run as one batch of short arrays"),
    "numpy / compiled": Limit(">=", 1.2, "who installs numba gains by it on one core"),
    "compiled / C": Limit("<=", 1.5, "the blocks, statuses and copies around the compiled loop stay small"),
    "compiled error bars / forces": Limit(
        "<=", 6.0, "fourteen more evaluations, which share the tangent and the writing"
    ),
    "study of linkages / positions": Limit("<=", 2.0, "a member is a column of the same arrays as a position"),
    "growth from 1000 positions on": Limit("<=", 1.3, "the work is linear in the positions: blocks fit the cache"),
    "memory beyond the result, MB": Limit("<=", 50.0, "work space is that of a block, not of the sweep"),
    JUDGED_BY_SYSTEMS: Limit("<=", 26_000.0, "65 ms where a system takes 2.5 us: a million scenes a night on 20 cores"),
    "import fourbar / import numpy": Limit("<=", 1.0, "it loads numpy alone, and less than that of its own"),
}
"""By the name of the row."""
