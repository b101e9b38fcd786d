"""What can turn: Grashof condition, linkage type, change points, limit positions, circuits."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fourbar.kinematics import Array
from fourbar.linkage import FourBar


class LimitPosition(NamedTuple):
    """A position in which two bars are collinear."""

    theta_2: float
    theta_3: float
    theta_4: float


def limit_positions(linkage: FourBar) -> tuple[LimitPosition, ...]:
    """Limit positions of the input, counter-clockwise from theta_1."""
    raise NotImplementedError


def default_range(linkage: FourBar) -> tuple[float, float]:
    """The range of theta_2 that is swept where a scene names none."""
    return (0.0, 2 * np.pi)


def on_smooth_path(linkage: FourBar, theta_2: Array, branch: int) -> NDArray[np.int8]:
    """The branch of each position of a sweep that runs smoothly through the change points."""
    raise NotImplementedError
