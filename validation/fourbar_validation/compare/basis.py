"""Reference conditions: conditions and sizes of the formulas and of another derivation, the stricter ones.

A wrong formula would otherwise widen what it is allowed: an angle between bars 3 and 4 that is too small, an
acceleration that is too large.
"""

import numpy as np

from fourbar.linkage import MOVING_BARS, FourBar
from fourbar.quantities import OK, UNITS
from fourbar.scene import Scene
from fourbar.solution import Solution
from fourbar_validation.compare.answer import Answer
from fourbar_validation.compare.scales import yardstick
from fourbar_validation.compare.tolerance import Array, condition_of

SIZED_BY = ("omega_3", "alpha_3", "a_G2", "a_G3", "a_G4")
"""What the size of a force is made of; a basis without them has none."""


def basis_of(scene: Scene, answer: Answer) -> Solution | None:
    """Make a solution of an answer, its conditions by the sines between its own angles; None without angles."""
    if answer.at is None or not {"theta_3", "theta_4"} <= answer.quantities.keys():
        return None
    known = answer.quantities
    theta_2 = known["theta_2"] if answer.at.bar != 2 else answer.at.angle
    theta = {2: theta_2, 3: known["theta_3"], 4: known["theta_4"]}
    code = np.full(len(theta_2), OK, dtype=np.uint8)
    basis = Solution(scene.title, scene.drive_bar, code, answer.at.branch, theta_2, theta[3], theta[4])
    for name in UNITS:
        if name in known:
            setattr(basis, name, known[name])
    basis.commanded = answer.at.commanded
    if answer.at.speed is not None:
        for name, x in (("omega", answer.at.speed), ("alpha", answer.at.acceleration)):
            setattr(basis, f"{name}_{answer.at.bar}", np.broadcast_to(np.asarray(x, float), theta_2.shape))
        if basis.omega_3 is not None and basis.omega_4 is not None:
            _add_velocities(scene.linkage, theta, basis)
    one, other = (theta[bar] for bar in theta if bar != answer.at.bar)
    basis.sin_mu = np.sin(theta[4] - theta[3])
    basis.condition = np.abs(np.sin(other - one))
    one, other = (theta[bar] for bar in theta if bar != scene.drive_bar)
    if basis.drive_condition is None:  # one that knows how near friction is to jamming answers it
        # not of their difference: of an angle many turns away that has fewer digits than its sine
        basis.drive_condition = np.abs(np.sin(other) * np.cos(one) - np.cos(other) * np.sin(one))
    return basis


def _add_velocities(linkage: FourBar, theta: dict[int, Array], basis: Solution) -> None:
    """Add those of A, B and the mass centres, from the answer's own angles and speeds, m/s."""

    def swung(bar: int, distance: float, angle: float) -> Array:
        speed, direction = distance * getattr(basis, f"omega_{bar}"), theta[bar] + angle
        return np.stack((-speed * np.sin(direction), speed * np.cos(direction)), axis=1)

    basis.v_A, basis.v_B = swung(2, linkage.input.length, 0.0), swung(4, linkage.output.length, 0.0)
    for bar in MOVING_BARS:
        centre = swung(bar, *linkage.bar(bar).mass_centre)
        setattr(basis, f"v_G{bar}", centre + basis.v_A if bar == 3 else centre)


def strictest_condition(quantity: str, linkage: FourBar, formulas: Solution, basis: Solution | None) -> Array:
    """Take the better of two conditions of a quantity at each position, (n,)."""
    ours = condition_of(quantity, linkage, formulas)
    return ours if basis is None else np.fmin(np.fmax(ours, condition_of(quantity, linkage, basis)), 1.0)


def smallest_yardstick(quantity: str, scene: Scene, formulas: Solution, basis: Solution | None) -> Array:
    """Take the smaller of two sizes of a quantity at each position, (n,)."""
    ours = yardstick(quantity, scene, formulas, getattr(formulas, quantity))
    of_motion = basis is not None and (basis.omega_2 is None or all(getattr(basis, q) is not None for q in SIZED_BY))
    if basis is None or not of_motion or getattr(basis, quantity) is None:
        return ours
    return np.fmin(ours, yardstick(quantity, scene, basis, getattr(basis, quantity)))
