"""A loop closed by circles that meet, in as many digits as mpmath works with."""

from mpmath import mp


class ExactLoop:
    """Directions of the bars of a linkage, apart from every formula of the package."""

    def __init__(self, linkage):
        self.lengths = [mp.mpf(float(length)) for length in linkage.lengths]
        self.theta_1 = mp.mpf(float(linkage.ground_angle))

    def close(self, bar, angle, sign):
        """Return e^{i theta} of bars 1 to 4 at the angle of bar 2, 3 or 4.

        `sign`: of sin(theta_4 - theta_3), sin(theta_4 - theta_2) or
        sin(theta_3 - theta_2), the sine between the two other bars.
        """
        d, a, b, c = self.lengths
        turned, ground = mp.expj(angle), mp.expj(self.theta_1)
        O4 = d * ground
        if bar == 2:
            A = a * turned
            B = _meet(A, b, O4, c, sign)
            return {1: ground, 2: turned, 3: (B - A) / b, 4: (B - O4) / c}
        if bar == 3:
            A = _meet(
                mp.mpc(0),
                a,
                O4 - b * turned,
                c,
                sign,
            )
            return {1: ground, 2: A / a, 3: turned, 4: (A + b * turned - O4) / c}
        B = O4 + c * turned
        A = _meet(mp.mpc(0), a, B, b, -sign)
        return {1: ground, 2: A / a, 3: (B - A) / b, 4: turned}

    def rates(self, bar, angle, sign):
        """Return the first and second derivative of each bar's angle by that of one.

        They are those of angles about the direction itself, which do not jump.
        """
        here = self.close(bar, angle, sign)

        def turn(number, x):
            return mp.arg(self.close(bar, x, sign)[number] / here[number])

        return {
            number: tuple(
                mp.diff(lambda x, k=number: turn(k, x), angle, n) for n in (1, 2)
            )
            for number in (2, 3, 4)
        }


def _meet(first, r, second, s, side):
    """Return where two circles meet: left of the way between them if side is +1."""
    apart = second - first
    e = abs(apart)
    along = (e**2 + r**2 - s**2) / (2 * e)
    return first + apart / e * mp.mpc(along, side * mp.sqrt(r**2 - along**2))
