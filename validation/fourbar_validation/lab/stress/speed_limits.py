"""Limits of the speeds that `bench` measures."""

from typing import NamedTuple


class SpeedLimit(NamedTuple):
    """Limit of a row of the table, and why; a ratio, which holds with and without AVX-512."""

    sign: str
    bound: float
    reason: str

    def holds(self, measured: float) -> bool:
        """Compare a measured number with the limit; NaN does not hold."""
        return measured >= self.bound if self.sign == ">=" else measured <= self.bound


JUDGED_BY_SYSTEMS = "a judged scene / 13x13"
LIMITS = {
    "13x13 / formulas": SpeedLimit(">=", 5.0, "closed formulas are worth several times the system that they eliminate"),
    "formulas / positions only": SpeedLimit(">=", 3.0, "who asks for two angles does not pay for nine more unknowns"),
    "positions only / floor": SpeedLimit("<=", 6.0, "the rest of two angles is arithmetic on arrays of a block"),
    "solve to forces / formulas": SpeedLimit("<=", 2.0, "new arrays and the points come on top, no second evaluation"),
    "solve with error bars / to forces": SpeedLimit(
        "<=", 25.0, "the forces are evaluated 15 times, all that is computed changed in its last digit"
    ),
    "one position / 13x13 solved": SpeedLimit("<=", 70.0, "some hundred steps of Python, and no array"),
    "one position with error bars / to forces": SpeedLimit(
        "<=", 4.5, "the evaluations run as one batch of short arrays"
    ),
    "numpy / compiled": SpeedLimit(">=", 1.2, "who installs numba gains by it on one core"),
    "compiled / C": SpeedLimit("<=", 1.5, "the blocks, statuses and copies around the compiled loop stay small"),
    "compiled error bars / forces": SpeedLimit(
        "<=", 6.0, "fourteen more evaluations, which share the tangent and the writing"
    ),
    "study of linkages / positions": SpeedLimit("<=", 2.0, "a member is a column of the same arrays as a position"),
    "growth from 1000 positions on": SpeedLimit("<=", 1.3, "the work is linear in the positions: blocks fit the cache"),
    "memory beyond the result, MB": SpeedLimit("<=", 50.0, "work space is that of a block, not of the sweep"),
    JUDGED_BY_SYSTEMS: SpeedLimit(
        "<=", 26_000.0, "65 ms where a system takes 2.5 us: a million scenes a night on 20 cores"
    ),
    "import fourbar / import numpy": SpeedLimit("<=", 1.0, "it loads numpy alone, and less than that of its own"),
}
"""By the name of the row."""
