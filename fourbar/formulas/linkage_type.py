"""Type of a linkage by its four lengths: Barker's fourteen classes, and what the field calls them."""

import math
from typing import NamedTuple

from fourbar.formulas.mobility import TOUCHING, choose_unit, turns_fully
from fourbar.linkage import BAR_NAMES, FourBar

GRASHOF = {
    1: ("GCCC", "double crank (drag link)"),
    2: ("GCRR", "crank-rocker"),
    3: ("GRCR", "double rocker"),
    4: ("GRRC", "rocker-crank"),
}
"""By the number of the shortest bar, which turns fully against all others."""
CHANGE_POINT = {1: "SCCC", 2: "SCRR", 3: "SRCR", 4: "SRRC"}
PARALLELOGRAM = "parallelogram (crossed: antiparallelogram)"


class LinkageType(NamedTuple):
    """What a linkage is called, and on what evidence."""

    surplus: float
    """p + q - s - l, m: > 0 Grashof, 0 change point, < 0 non-Grashof."""
    barker: int | None
    """Barker's class 1..14; None for a structure, which cannot move."""
    code: str
    """Barker's letters: G Grashof, S special (change point), R rocker, C crank, for the bars 2, 3, 4 in turn."""
    name: str
    shortest: int
    """Number of the shortest bar, the lowest of equal ones."""
    longest: int
    """Number of the longest bar, the lowest of equal ones."""
    turning: tuple[int, ...]
    """Which of the bars 2, 3, 4 turn fully against the ground (through change points, if need be)."""


def classify(linkage: FourBar) -> LinkageType:
    """Classify a linkage by the Grashof condition s + l < p + q and by which bar is shortest or longest.

    s, l are the shortest and longest lengths, p, q the other two. The sums are exact; equality is
    decided within the rounding of the four lengths. Which of the three sums of two bars and the
    other two are equal tells the change-point types apart: one equality 9-12, two 13 (opposite
    bars equal: parallelogram; adjacent bars equal: kite, also deltoid or Galloway), three 14 (rhombus).

    Source: C. R. Barker, A complete classification of planar four-bar linkages, Mechanism and
    Machine Theory 20 (1985).
    """
    unit = choose_unit(linkage)
    lengths = dict(zip(BAR_NAMES, (length / unit for length in linkage.lengths), strict=True))
    shortest, longest = min(lengths, key=lengths.__getitem__), max(lengths, key=lengths.__getitem__)
    whole = math.fsum(lengths.values())

    def balance(bar: int, other: int) -> float:
        """Compute the two bars minus the other two; 0 within the rounding of the lengths."""
        total = math.fsum(length if k in (bar, other) else -length for k, length in lengths.items())
        return 0.0 if abs(total) <= TOUCHING * whole else total

    # all bars equal: every bar is both, and any other one is its partner
    surplus = -balance(shortest, longest if longest != shortest else 4) * unit
    turning = tuple(k for k in (2, 3, 4) if turns_fully(linkage, k))

    def found(barker: int | None, code: str, name: str) -> LinkageType:
        return LinkageType(surplus, barker, code, name, shortest, longest, turning)

    if math.fsum((*lengths.values(), -2.0 * lengths[longest])) <= TOUCHING * whole:
        return found(None, "structure", f"structure (the {BAR_NAMES[longest]} is as long as the other three)")
    if surplus > 0.0:
        return found(shortest, *GRASHOF[shortest])
    if surplus < 0.0:
        return found(4 + longest, f"RRR{longest}", f"triple rocker (longest: {BAR_NAMES[longest]})")
    opposite, with_input, with_output = (balance(1, k) == 0.0 for k in (3, 2, 4))
    if opposite + with_input + with_output == 3:
        return found(14, "S3X", "rhombus (triple change point)")
    if opposite + with_input + with_output == 2:
        if not opposite:
            return found(13, "S2X", PARALLELOGRAM)
        # d + b = a + c and d + c = a + b give d = a; d + b = a + c and d + a = b + c give d = c
        pairs = (
            ("ground and input", "coupler and output") if with_output else ("ground and output", "input and coupler")
        )
        return found(13, "S2X", f"kite (equal: {pairs[0]}; {pairs[1]})")
    return found(8 + shortest, CHANGE_POINT[shortest], f"change-point {GRASHOF[shortest][1]}")
