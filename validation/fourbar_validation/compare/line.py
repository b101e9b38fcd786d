"""The line of a drive that exerts a force: its stroke, speed and leverage.

All follow from the angles of the bars alone.
"""

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from fourbar.effects import PointDrive
from fourbar.linkage import FourBar
from fourbar.quantities import Array, ComplexArray

if TYPE_CHECKING:
    from fourbar.effects import ForceDrive


class DriveLine(NamedTuple):
    """The line at n positions."""

    linkage: FourBar
    drive: "ForceDrive"
    directions: dict[int, ComplexArray]
    """e^{i theta} of bars 1 to 4."""
    arms: tuple[ComplexArray, ...]
    """Vectors from the first pins of the bars to the points where the drive acts, m."""
    across: ComplexArray
    """Vector from one end of the drive to the other, m. For a force at a point it is
    its unit vector.
    """

    @property
    def stroke(self) -> Array:
        """Distance of the ends, m."""
        return np.hypot(self.across.real, self.across.imag)

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
        for (sense, point), arm in zip(self.drive.ends, self.arms, strict=True):
            velocity = 1j * omega[point.bar] * arm
            if point.bar == 3:
                velocity = (
                    velocity
                    + 1j * omega[2] * self.linkage.input.length * self.directions[2]
                )
            rate = rate + sense * velocity
        return (np.conj(self.unit) * rate).real

    @property
    def lever(self) -> Array:
        """Distance of a cylinder's line from the ground pin of its bar.

        The bar is 2 or 4; the distance is over the longer of both arms.
        """
        points = [point for _, point in self.drive.ends]
        on_bar, on_ground = (0, 1) if points[0].bar != 1 else (1, 0)
        point = points[on_bar]
        to_ground = self.arms[on_ground] - (
            0.0 if point.bar == 2 else self.linkage.ground * self.directions[1]
        )
        longer = np.maximum(np.abs(self.arms[on_bar]), np.abs(to_ground))
        return np.abs((np.conj(self.unit) * self.arms[on_bar]).imag) / longer

    @property
    def most(self) -> float:
        """Return the greatest possible movement of its ends, m, as in `condition`."""
        _, a, b, c = self.linkage.lengths
        reach = {1: (0.0, 0.0), 2: (0.0, 1.0), 3: (a, a / b), 4: (0.0, a / c)}
        return float(
            sum(
                reach[p.bar][0] + reach[p.bar][1] * abs(p.distance)
                for _, p in self.drive.ends
            )
        )

    @property
    def condition(self) -> Array:
        """Compute the rate of the stroke over the most that it could be.

        The speeds close the loop and are finite at its limits.
        """
        _, a, b, c = self.linkage.lengths
        u2, u3, u4 = (self.directions[bar] for bar in (2, 3, 4))
        zero = np.zeros(len(u2))
        omega = {
            1: zero,
            2: (np.conj(u3) * u4).imag,
            3: a / b * (np.conj(u4) * u2).imag,
        }
        omega[4] = a / c * (np.conj(u3) * u2).imag
        return np.abs(self.speed(omega)) / self.most


def place_line(
    linkage: FourBar,
    drive: "ForceDrive",
    theta: dict[int, Array],
) -> DriveLine:
    """Place the ends at angles of bars 2, 3, 4, each (n,)."""
    directions = {bar: np.exp(1j * angle) for bar, angle in theta.items()}
    directions[1] = np.full(len(theta[2]), np.exp(1j * linkage.ground_angle))
    feet = {
        1: 0.0,
        2: 0.0,
        3: linkage.input.length * directions[2],
        4: linkage.ground * directions[1],
    }
    points = [point for _, point in drive.ends]
    arms = tuple(
        point.distance * np.exp(1j * point.angle) * directions[point.bar]
        for point in points
    )
    if isinstance(drive, PointDrive):
        across = np.exp(1j * drive.direction) * np.ones(len(theta[2]))
        if drive.frame == "bar":
            across = across * directions[drive.place.bar]
        return DriveLine(linkage, drive, directions, arms, across)
    start, end = points
    across = feet[end.bar] + arms[1] - feet[start.bar] - arms[0]
    return DriveLine(linkage, drive, directions, arms, across)
