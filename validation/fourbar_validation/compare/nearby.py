"""The theta_2, within the rounding of the one commanded, at which sin(theta_4 - theta_3) is that of the formulas."""

from typing import Any

from fourbar.formulas.many_digits import DIGITS
from fourbar.linkage import FourBar
from fourbar_validation.compare.tolerance import EPS, ROUNDINGS


def shift_to(linkage: FourBar, theta_2: float, sin_mu: float) -> Any:
    """Compute what to add to theta_2 (mpmath, rad) for sin(theta_4 - theta_3) to be +-sin_mu; None if beyond rounding.

    The diagonal e from A to O4 has d^2 + a^2 - 2 a d cos(theta_2 - theta_1) = e^2 = b^2 + c^2 -+ 2 b c cos(mu).
    """
    from mpmath import mp, mpf

    with mp.workdps(DIGITS):
        d, a, b, c = map(mpf, linkage.lengths)
        theta_1, shifts = mpf(linkage.ground_angle), []
        cos_mu = mp.sqrt(max(1 - mpf(sin_mu) ** 2, 0))
        for side in (2 * b * c * cos_mu, -2 * b * c * cos_mu):
            cosine = (d * d + a * a - b * b - c * c + side) / (2 * a * d)
            if abs(cosine) <= 1:
                shifts += [theta_1 + sign * mp.acos(cosine) - theta_2 for sign in (1, -1)]
        shifts = [shift - 2 * mp.pi * mp.nint(shift / (2 * mp.pi)) for shift in shifts]
        nearest = min(shifts, key=abs, default=mp.inf)
        return nearest if abs(nearest) <= ROUNDINGS * EPS * max(1.0, abs(theta_2), abs(linkage.ground_angle)) else None
