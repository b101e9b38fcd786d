"""A program as a textbook has it: maximal coordinates and Lagrange multipliers.

Three bodies have x, y of the mass centre and an angle each. Eight equations of the pins
and one of the command close the loop by Newton's method; their derivatives give speeds
and accelerations, and M a = Q + J^T lambda gives pin forces and torque (E. J. Haug,
Computer Aided Kinematics and Dynamics of Mechanical Systems, 1989, ch. 3 and 6).
Nothing of the formulas and of the harness's engines is used.
"""

import math

import numpy as np

from fourbar.effects import Friction, Gravity, Viscous
from fourbar.quantities import PIN_FORCES
from fourbar_validation.compare.answer import Answer
from fourbar_validation.compare.pins import (
    find_centre,
    find_inertia,
    find_mass,
    state_from_pins,
)
from tests.support.scenes import cis

_PINS = ("O2", "A", "B", "O4")
_SIGNS = np.array([[1, 0, 0], [-1, 1, 0], [0, -1, 1], [0, 0, 1]])
"""Sign of bars 2, 3 and 4 in the gap at each pin, (4, 3)."""
_ON_NAMED_BAR = (1, -1, -1, 1)
"""Sign of F12, F32, F43 and F14 in the multiplier of their pins."""
_ANGLES = ("theta_3", "theta_4", "omega_3", "omega_4", "alpha_3", "alpha_4")


class Textbook:
    """Answers motion, pin forces and torque, one position after another."""

    name = "textbook"
    quantities = (*_ANGLES, *PIN_FORCES, "torque")
    effects = ("loads", "drive", "gravity", "viscous", "friction")
    newton_steps = 60
    """Steps of Newton's method at most, after the circles about A and O4 have met."""

    def answer(self, scene, command):
        """Answer, or refuse a scene with other effects."""
        known = (Gravity, Viscous, Friction)
        if (
            scene.drive is not None
            or any(load.table is not None for load in scene.loads)
            or not all(isinstance(effect, known) for effect in scene.effects)
        ):
            return Answer(self.name, "exact", refusal="an effect has no model here")
        bodies = Bodies(state_from_pins(scene), self.newton_steps)
        n = len(command.theta_2)
        values = {
            name: np.full((n, 2) if name in PIN_FORCES else n, np.nan)
            for name in self.quantities
        }
        assembled = np.zeros(n, dtype=bool)
        omega, alpha = np.broadcast_arrays(
            command.omega_2, command.alpha_2, command.theta_2
        )[:2]
        for i, (theta_2, branch) in enumerate(
            zip(command.theta_2, command.branch, strict=True)
        ):
            try:
                assembled[i] = bodies.close(theta_2, branch)
                answered = bodies.solve(omega[i], alpha[i]) if assembled[i] else {}
            except np.linalg.LinAlgError:  # on a change point
                assembled[i], answered = True, {}
            for name, number in answered.items():
                values[name][i] = number
        return Answer(self.name, "exact", command, assembled, values)


class Bodies:
    """Bars 2, 3, 4 at one position of the input: places `z` of G and angles `theta`."""

    def __init__(self, scene, newton_steps):
        link = scene.linkage
        self.newton_steps = newton_steps
        self.scene, self.lengths = scene, link.lengths
        self.ground = link.ground * cis(link.ground_angle)
        bars = [link.bar(k) for k in (2, 3, 4)]
        self.mass = np.array([find_mass(bar) for bar in bars])
        self.inertia = np.array([find_inertia(bar) for bar in bars])
        self.centre = np.array([polar(find_centre(bar)) for bar in bars])
        ends = np.diag(self.lengths[1:])[:2]  # A is the end of bar 2, B that of bar 3
        ends = np.vstack((np.zeros(3), ends, np.zeros(3)))
        ends[2, 2] = self.lengths[3]  # and of bar 4
        self.arms = ends - self.centre
        """Places of the pins from the centre of each bar, in its frame, (4, 3)."""

    def close(self, theta_2, branch):
        """Find the nine coordinates by Newton's method on the constraints."""
        _, a, b, c = self.lengths
        A = a * cis(theta_2)
        diagonal = self.ground - A
        e = abs(diagonal)
        cosine = (b * b + e * e - c * c) / (2.0 * b * e)
        if abs(cosine) > 1.0:
            return False
        theta_3 = np.angle(diagonal) + branch * math.acos(cosine)
        B = A + b * cis(theta_3)
        self.theta_2 = theta_2
        self.theta = np.array([theta_2, theta_3, np.angle(B - self.ground)])
        self.z = np.array([0j, A, self.ground]) + self.centre * cis(self.theta)
        gap = self._gap()
        for _ in range(self.newton_steps):
            x, y, turn = np.split(np.linalg.solve(self.jacobian(), -gap), 3)
            before = self.z, self.theta
            self.z, self.theta = self.z + x + 1j * y, self.theta + turn
            last, gap = gap, self._gap()
            if not abs(gap).max() < abs(last).max():
                self.z, self.theta = before
                break
        return True

    @property
    def turned(self):
        """Return the arms in world axes with their signs."""
        return _SIGNS * self.arms * cis(self.theta)

    def _gap(self):
        gaps = _SIGNS @ self.z + self.turned.sum(axis=1)
        gaps[3] -= self.ground
        return np.array([*gaps.real, *gaps.imag, self.theta[0] - self.theta_2])

    def jacobian(self, bar=2):
        """Return the derivatives of the constraints, (9, 9); the last is of a bar."""
        turning, none = 1j * self.turned, np.zeros((4, 3))
        driven = np.zeros((1, 9))
        driven[0, 4 + bar] = 1.0
        x, y = (_SIGNS, none, turning.real), (none, _SIGNS, turning.imag)
        return np.vstack((np.hstack(x), np.hstack(y), driven))

    def solve(self, omega_2, alpha_2):
        """Solve speeds, accelerations and multipliers."""
        jacobian = self.jacobian()
        omega = np.linalg.solve(jacobian, [0.0] * 8 + [omega_2])[6:]
        centripetal = (self.turned * omega**2).sum(axis=1)
        right = [*centripetal.real, *centripetal.imag, alpha_2]
        accelerations = np.linalg.solve(jacobian, right)
        force, couple = self.applied(omega)
        weights = np.concatenate((self.mass, self.mass, self.inertia))
        needed = weights * accelerations - [*force.real, *force.imag, *couple]
        *pins, torque = np.linalg.solve(self.jacobian(self.scene.drive_bar).T, needed)
        pairs = np.reshape(pins, (2, 4)).T
        values = {"torque": torque}
        for k in (1, 2):
            values |= {f"theta_{k + 2}": self.theta[k], f"omega_{k + 2}": omega[k]}
            values[f"alpha_{k + 2}"] = accelerations[6 + k]
        for name, sign, pair in zip(PIN_FORCES, _ON_NAMED_BAR, pairs, strict=True):
            values[name] = sign * pair
        return values

    def applied(self, omega):
        """Return force and couple about G on each bar, of loads and effects."""
        force, couple = np.zeros(3, dtype=complex), np.zeros(3)
        for load in self.scene.loads:
            push, arm = self._find_load(load)
            force[load.bar - 2] += push
            couple[load.bar - 2] += (arm.conjugate() * push).imag + load.moment
        slip = _SIGNS @ omega
        for effect in self.scene.effects:
            if isinstance(effect, Gravity):
                force += self.mass * polar((effect.magnitude, effect.angle))
                continue
            viscous = isinstance(effect, Viscous)
            sizes = dict(effect.coefficients if viscous else effect.torques)
            resisting = slip if viscous else np.sign(slip)
            couple -= ([sizes.get(pin, 0.0) for pin in _PINS] * resisting) @ _SIGNS
        return force, couple

    def _find_load(self, load):
        """Return a load's force and its arm from the mass centre, in world axes."""
        if load.force is None:
            return 0j, 0j
        turned = cis(self.theta[load.bar - 2])
        push = polar(load.force) * (turned if load.frame == "bar" else 1.0)
        if load.place is None:
            return push, polar(load.arm)
        arm = polar(load.place.from_pin) - self.centre[load.bar - 2]
        return push, arm * turned


def polar(pair):
    """Return a vector of a size and a direction."""
    return complex(pair[0] * cis(pair[1]))
