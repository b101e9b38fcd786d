"""The motion in which a loop of a robot is looked at."""

from typing import NamedTuple

import numpy as np


class LoopMotion(NamedTuple):
    """Angles of bar 2 in the plane of the loop, rad, and its speed and acceleration there."""

    theta_2: tuple[float, ...]
    omega_2: float
    alpha_2: float

    def thin_out(self, most: int) -> "LoopMotion":
        """Return the motion with at most so many of the angles, spread evenly, both ends among them."""
        count = min(len(self.theta_2), most)
        keep = np.linspace(0, len(self.theta_2) - 1, count).round().astype(int)
        return self._replace(theta_2=tuple(self.theta_2[i] for i in keep))
