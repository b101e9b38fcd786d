"""Grashof condition of a linkage, and the type that follows from which bar is shortest."""

import math
from typing import NamedTuple

import numpy as np

from fourbar.linkage import BAR_NAMES, FourBar

TYPES = {
    "ground": "double crank (drag link)",
    "input": "crank-rocker",
    "coupler": "double rocker",
    "output": "rocker-crank",
}
"""Type of a Grashof linkage by its shortest bar."""
ROUNDING = float(np.finfo(float).eps) / 2.0
"""What rounding takes from a stored length, relative."""


class Grashof(NamedTuple):
    """The condition and the name."""

    surplus: float
    """p + q - s - l, m: > 0 the shortest bar turns fully against all others, 0 a change point."""
    name: str


def grashof(linkage: FourBar) -> Grashof:
    """Grashof condition s + l < p + q: s the shortest, l the longest, p and q the other two lengths.

    The sums are taken without rounding; they count as equal (a change point) where they differ by
    no more than the rounding of the four stored lengths can make.

    Source: R. L. Norton, Design of Machinery, section 2.13.
    """
    lengths = dict(zip(BAR_NAMES.values(), linkage.lengths, strict=True))
    shortest, longest = min(lengths.values()), max(lengths.values())
    surplus = math.fsum((*lengths.values(), -shortest, -shortest, -longest, -longest))
    if abs(surplus) <= ROUNDING * math.fsum(lengths.values()):
        return Grashof(0.0, "change point")
    if surplus < 0.0:
        return Grashof(surplus, "triple rocker")
    return Grashof(surplus, TYPES[min(lengths, key=lengths.__getitem__)])
