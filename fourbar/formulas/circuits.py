"""Circuits: the sets of positions that a linkage reaches without being taken apart."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fourbar.formulas.mobility import TURN, Array, change_points, find_intervals, turns_fully
from fourbar.formulas.path import prepare_path
from fourbar.formulas.position import loop
from fourbar.linkage import FourBar

BOTH = (1, -1)


class Circuit(NamedTuple):
    """Positions that are connected by motion."""

    theta_2: tuple[float, float]
    """The range [from, to] in which it assembles, rad; a whole turn where the input turns fully."""
    branches: tuple[int, ...]
    """Its branches; both of them meet at the limits of theta_2 or at change points."""


def circuits(linkage: FourBar) -> tuple[Circuit, ...]:
    """List the circuits of a linkage, with the range of theta_2 on each and the branches that belong to it.

    A Grashof linkage has two: the branches, where the input turns fully, else the two ranges of
    theta_2. Every other linkage has one; at a change point both branches count as reachable.

    Source: T. R. Chase, J. A. Mirth, Circuits and branches of single-degree-of-freedom planar linkages,
    J. Mechanical Design 115 (1993) 223-230.
    """
    ranges = find_intervals(linkage)
    if turns_fully(linkage) and not change_points(linkage):
        return tuple(Circuit(ranges[0], (branch,)) for branch in BOTH)
    return tuple(Circuit(interval, BOTH) for interval in ranges)


def find_circuit(linkage: FourBar, theta_2: Array, branch: int | NDArray[np.int8]) -> NDArray[np.int8]:
    """Find the circuit (index into `circuits`) of each position, -1 where it does not assemble, (n,).

    `theta_2`: (n,), rad. `branch`: +1 or -1, or one of them for each position (n,).
    """
    theta_2 = np.asarray(theta_2, dtype=float)
    found = circuits(linkage)
    if len(found) == 1:
        number = np.zeros(theta_2.shape, dtype=np.int8)
    elif len(found[0].branches) == 1:
        number = np.where(np.broadcast_to(branch, theta_2.shape) == found[0].branches[0], 0, 1)
    else:  # the two ranges are mirror images in the ground's line
        number = np.where((theta_2 - linkage.ground_angle) % TURN < 0.5 * TURN, 0, 1)
    half = prepare_path(loop(*linkage.lengths), linkage.ground_angle).half_angle(theta_2)
    return np.where((half.outer >= 0.0) & (half.inner >= 0.0), number, -1).astype(np.int8)
