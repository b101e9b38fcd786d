"""Tolerances of what is derived from `solve`.

Each is a rule of a run, as those of its engines are.
"""

from fourbar_validation.compare.tolerance import EPS, ErrorBound, K

DIFFERENCES = ErrorBound(
    "differences",
    "1e-7 of the sum of the absolute terms: the fourth-order difference of free bodies"
    " at positions whose condition is at least 0.1, where it leaves out 1e-11 and"
    " rounding adds 1e-10",
    1e-7,
    conditioned=False,
)
"""Tolerance of the derivatives along one direction.

Every number of a scene stated by lengths changes in it, or every coordinate of a
drawing, by 1e-4 of the shortest bar at most.
"""
SPREAD = ErrorBound(
    "spread",
    "3 % of a deviation or of a worst case: 1024 quasi-random samples against cubature,"
    " twice what they were seen to differ by",
    0.03,
    conditioned=False,
)
"""Tolerance of spreads that tolerances make."""
REST = ErrorBound(
    "rest",
    "K eps of the sum of what moving each stored number by its own size would change,"
    " from differences in 320-bit arithmetic; of an inertia at least of the sum of m"
    " L^2 and I",
    K * EPS,
    conditioned=False,
)
"""Tolerance of torque, slope, inertia and frequency at an equilibrium."""
CUT = ErrorBound(
    "cut bars",
    "1e-10 of the sum of the absolute terms: pin forces at conditions of at least 0.1"
    " differ by some 1e-14, and terms that cancel in the balance of a piece stand in"
    " the sum",
    1e-10,
    conditioned=False,
)
"""Tolerance of internal forces."""
PRINTED = ErrorBound(
    "summary",
    "1e-8 of the value: five calls leave a place to 1e-7 of a step, a range the fourth"
    " power of 0.05 degrees",
    1e-8,
    conditioned=False,
)
"""Tolerance of what `analyze` prints and its JSON holds."""
LOCATED_ROUGHLY = ErrorBound(
    "summary, bending",
    "1e-6 of the moment: three calls of 40 cuts leave a place to 1e-4 of a step, a"
    " maximum the square of that",
    1e-6,
    conditioned=False,
)
"""Tolerance of the largest bending moments."""
