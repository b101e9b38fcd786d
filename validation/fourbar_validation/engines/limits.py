"""List as data what the engines cannot do: the measured boundary and the reason.

The limits of MuJoCo were measured with 4.0.0 and the default `Settings`; a test
measures both sides of each again, so an engine that moves one is noticed.
"""

import math
from typing import NamedTuple

import numpy as np

from fourbar.linkage import FourBar
from fourbar.mjcf.document import compute_load_ratio, reduce_mass
from fourbar.quantities import Array, Mask
from fourbar.scene import Scene

ROUNDING = 1e-8
"""Cosine beyond 1 by which a loop that closes but for rounding may miss."""


class Boundary(NamedTuple):
    """A declared limit of an engine."""

    name: str
    boundary: float
    unit: str
    reason: str
    engine: str = "mujoco-simulated"


NO_PUSH = (
    "a force at a point drives, and the file that is simulated drives bar 2: the"
    " inverse dynamics of the same program solve for the force"
)
"""Reason of a simulation to refuse a `PointDrive`."""
NEAREST_TOGGLE = Boundary(
    "|sin(theta_4 - theta_3)|, least",
    0.05,
    "",
    "below 0.05, as near a limit or a change point, bars 3 and 4 speed up faster than"
    " the time step follows: torque 1e-5 wrong at 0.1, 1e-2 at 0.03, data reset at"
    " 0.01",
)
FASTEST = Boundary(
    "omega_2, greatest",
    3e4,
    "rad/s",
    "beyond 3e4 rad/s accelerations pass mjMAXVAL = 1e10, which MuJoCo takes for a bad"
    " state and resets",
)
SLOWEST = Boundary(
    "a omega_2^2, least",
    1e-10,
    "m/s^2",
    "below 1e-10 m/s^2 the accelerations of the crank drown in the constraint solver's"
    " rounding",
)
HEAVIEST = Boundary(
    "loads and weights / inertial forces, greatest",
    1e10,
    "",
    "loads and weights beyond 1e10 times the inertial forces open the soft loop, for"
    " MuJoCo keeps a softness of 1e-15: the gap grows as their ratio",
)
NEAREST_CENTRE = Boundary(
    "distance of a mass centre or force from the bar's first pin, least but 0",
    2e-6,
    "m",
    "a mass centre, or where a force acts, nearer than about 1e-6 m to the first pin is"
    " silently taken to lie on it (the compiler's sameframe)",
)
LIGHTEST = Boundary(
    "mass or inertia of a moving bar, least",
    1e-15,
    "kg or kg m^2",
    "mjMINVAL: the compiler raises ValueError for a moving body below it",
    "mujoco-inverse and mujoco-simulated",
)
QUICKEST_START = Boundary(
    "speed of a bar / two timesteps, greatest",
    1e10,
    "rad/s^2",
    "a drive that brings a bar to its speed in two timesteps passes mjMAXVAL = 1e10,"
    " which MuJoCo takes for a bad state and resets",
)
MOST_UNEVEN = Boundary(
    "greatest / least of lengths, of bars' inertias, of loads and inertial forces",
    1e3,
    "",
    "rounding and the soft loop decide where bars or loads differ by more than 1e3",
)
PROXIMAL_BOUNDARY = Boundary(
    "mu of the proximal iteration, least",
    0.0,
    "",
    "the third row of the planar loop is redundant: without proximal regularisation"
    " every number is NaN",
    "pinocchio-forward",
)
BOUNDARIES = (
    NEAREST_TOGGLE,
    FASTEST,
    SLOWEST,
    HEAVIEST,
    NEAREST_CENTRE,
    LIGHTEST,
    QUICKEST_START,
    MOST_UNEVEN,
    PROXIMAL_BOUNDARY,
)


def find_exceeded(scene: Scene, speed: float) -> str | None:
    """Return the reason of the limit that a scene exceeds, None if it exceeds none.

    Limits are on speed (rad/s) and on loads.
    """
    if speed > FASTEST.boundary:
        return FASTEST.reason
    if scene.linkage.input.length * speed**2 < SLOWEST.boundary:
        return SLOWEST.reason
    if compute_load_ratio(scene) > HEAVIEST.boundary:
        return HEAVIEST.reason
    return None


def find_uneven(scene: Scene) -> str | None:
    """Return why a simulation may lose the motion of a scene's bars, if it may.

    Compared are lengths, inertias about first pins over lengths squared, and loads with
    inertial forces.
    """
    masses = [reduce_mass(bar) for bar in scene.linkage.moving]
    ratios = [max(sizes) / min(sizes) for sizes in (scene.linkage.lengths, masses)]
    uneven = max(*ratios, compute_load_ratio(scene))
    if uneven <= MOST_UNEVEN.boundary:
        return None
    return f"{MOST_UNEVEN.reason}, here by {uneven:.1e}"


def compute_least_sine(
    linkage: FourBar,
    theta_2: Array,
    assembled: Mask,
) -> float:
    """Compute the least |sin(theta_4 - theta_3)| between assembled neighbours.

    The cosine rule gives it.
    """
    d, a, b, c = linkage.lengths
    psi = np.sort(theta_2[assembled] - linkage.ground_angle)
    if not len(psi):
        return 1.0
    # between the positions the sine is least where bars 1 and 2 are in line
    first = math.ceil(psi[0] / math.pi)
    last = math.floor(psi[-1] / math.pi)
    in_line = math.pi * np.arange(first, last + 1)
    angles = np.concatenate((psi, in_line))
    squared = d * d + a * a - 2.0 * d * a * np.cos(angles)
    cosine = (b * b + c * c - squared) / (2.0 * b * c)
    sine = np.sqrt(np.clip(1.0 - cosine**2, 0.0, None))
    # an angle at which the loop is open splits the motion; at a change point it closes
    # but for rounding
    counted = np.abs(cosine) <= 1.0 + ROUNDING
    counted[: len(psi)] = True
    return float(sine[counted].min())
