"""The line of a drive that exerts a force: its stroke, speed and leverage.

All follow from the angles of the bars alone.
"""

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from fourbar.effects import PointDrive
from fourbar.linkage import MOVING_BARS, FourBar
from fourbar.quantities import Array, ComplexArray
from fourbar_validation.compare.bodies import BodyMotion

if TYPE_CHECKING:
    from fourbar.effects import ForceDrive


class DriveLine(NamedTuple):
    """The line at n positions."""

    motion: BodyMotion
    drive: "ForceDrive"
    arms: list[ComplexArray]
    """Vectors from the first pins of the bars to the points where the drive acts, m."""
    across: ComplexArray
    """Vector from one end of the drive to the other, m. For a force at a point it is
    its unit vector.
    """

    @property
    def stroke(self) -> Array:
        """Distance of the ends, m."""
        return np.abs(self.across)

    @property
    def unit(self) -> ComplexArray:
        """Direction; no number where the ends coincide."""
        with np.errstate(all="ignore"):
            return self.across / self.stroke

    def speed(self, omega: dict[int, Array]) -> Array:
        """Return the rate of the stroke at angular velocities of bars 1 to 4, m/s.

        The velocity of an arm's end is across the arm.
        """
        rate: ComplexArray | float = 0.0
        for (sense, place), arm in zip(self.drive.ends, self.arms, strict=True):
            velocity = 1j * omega[place.bar] * arm
            if place.bar == 3:
                velocity = velocity + 1j * omega[2] * self.motion.first_pin[3]
            rate = rate + sense * velocity
        return (np.conj(self.unit) * rate).real

    @property
    def lever(self) -> Array:
        """Distance of a cylinder's line from the ground pin of its bar.

        The bar is 2 or 4; the distance is over the longer of both arms.
        """
        bars = [place.bar for _, place in self.drive.ends]
        arms = dict(zip(bars, self.arms, strict=True))
        bar = max(bars)
        to_ground = arms[1] - self.motion.first_pin[bar]
        longer = np.maximum(np.abs(arms[bar]), np.abs(to_ground))
        return np.abs((np.conj(self.unit) * arms[bar]).imag) / longer

    @property
    def condition(self) -> Array:
        """Compute the rate of the stroke over the most that it could be.

        The speeds close the loop and are finite at its limits.
        """
        linkage = self.motion.linkage
        _, a, b, c = linkage.lengths
        u2, u3, u4 = (self.motion.unit[bar] for bar in MOVING_BARS)
        omega = {
            1: np.zeros(len(u2)),
            2: (np.conj(u3) * u4).imag,
            3: a / b * (np.conj(u4) * u2).imag,
            4: a / c * (np.conj(u3) * u2).imag,
        }
        return np.abs(self.speed(omega)) / find_most(linkage, self.drive)


def find_most(linkage: FourBar, drive: "ForceDrive") -> float:
    """Return the greatest possible movement of a drive's ends, m, as in `condition`."""
    _, a, b, c = linkage.lengths
    reach = {1: (0.0, 0.0), 2: (0.0, 1.0), 3: (a, a / b), 4: (0.0, a / c)}
    most = 0.0
    for _, place in drive.ends:
        least, per_metre = reach[place.bar]
        most += least + per_metre * abs(place.distance)
    return most


def place_line(motion: BodyMotion, drive: "ForceDrive") -> DriveLine:
    """Place the ends on the bars."""
    arms, across = motion.lay([place for _, place in drive.ends])
    if isinstance(drive, PointDrive):
        across = np.exp(1j * drive.direction) * np.ones(len(across))
        if drive.frame == "bar":
            across = across * motion.unit[drive.place.bar]
    return DriveLine(motion, drive, arms, across)
