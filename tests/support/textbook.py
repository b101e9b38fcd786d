"""A program as a textbook has it: maximal coordinates and Lagrange multipliers.

Three bodies have x, y of the mass centre and an angle each. Eight equations of the pins
and one of the command close the loop by Newton's method; their derivatives give speeds
and accelerations, and M a = Q + J^T lambda gives pin forces and torque (E. J. Haug,
Computer Aided Kinematics and Dynamics of Mechanical Systems, 1989, ch. 3 and 6).
Nothing of the formulas and of the harness's engines is used.
"""

import math

import numpy as np
from numpy.typing import NDArray

from fourbar.effects import Friction, Gravity, Load, Viscous
from fourbar.quantities import PIN_FORCES
from fourbar.scene import Command, Scene
from fourbar_validation.compare.answer import Answer
from fourbar_validation.compare.pins import (
    find_centre,
    find_inertia,
    find_mass,
    state_from_pins,
)

Array = NDArray[np.float64]
_PINS = {"O2": (1, 2), "A": (2, 3), "B": (3, 4), "O4": (1, 4)}
"""Bars that meet at each pin."""
_ANGLES = ("theta_3", "theta_4", "omega_3", "omega_4", "alpha_3", "alpha_4")
NEWTON_STEPS = 60


class Textbook:
    """Answers motion, pin forces and torque, one position after another."""

    name = "textbook"
    quantities = (*_ANGLES, *PIN_FORCES, "torque")
    effects = ("loads", "drive", "gravity", "viscous", "friction")

    def answer(self, scene: Scene, command: Command) -> Answer:
        """Answer, or refuse a scene with other effects."""
        known = (Gravity, Viscous, Friction)
        if (
            scene.drive is not None
            or any(load.table is not None for load in scene.loads)
            or not all(isinstance(effect, known) for effect in scene.effects)
        ):
            return Answer(self.name, "exact", refusal="an effect has no model here")
        scene = state_from_pins(scene)
        n = len(command.theta_2)
        values = {
            name: np.full((n, 2) if name in PIN_FORCES else n, np.nan)
            for name in self.quantities
        }
        assembled = np.zeros(n, dtype=bool)
        omega = np.broadcast_to(command.omega_2, n)
        alpha = np.broadcast_to(command.alpha_2, n)
        for i in range(n):
            bodies = _Bodies(scene, float(command.theta_2[i]))
            try:
                assembled[i] = bodies.close(int(command.branch[i]))
                if not assembled[i]:
                    continue
                answered = bodies.solve(float(omega[i]), float(alpha[i]))
            except np.linalg.LinAlgError:  # on a change point
                assembled[i] = True
                continue
            for name, number in answered.items():
                values[name][i] = number
        return Answer(self.name, "exact", command, assembled, values)


class _Bodies:
    """Bars 2, 3, 4 at one position of the input."""

    def __init__(self, scene: Scene, theta_2: float) -> None:
        link = scene.linkage
        self.scene, self.theta_2 = scene, theta_2
        self.lengths = link.lengths
        self.ground = link.ground * np.exp(1j * link.ground_angle)
        self.bars = {k: link.bar(k) for k in (2, 3, 4)}
        self.centres = {}
        for k, bar in self.bars.items():
            distance, angle = find_centre(bar)
            self.centres[k] = distance * np.exp(1j * angle)

    def arms(self, pin: str) -> dict[int, complex]:
        """Return a pin's place from the centre of each bar there, in its frame."""
        begins = {"O2": 2, "A": 3, "O4": 4}.get(pin)
        return {
            k: (0.0 if k == begins else self.bars[k].length) - self.centres[k]
            for k in _PINS[pin]
            if k != 1
        }

    def close(self, branch: int) -> bool:
        """Find the nine coordinates by Newton's method on the constraints."""
        _, a, b, c = self.lengths
        A = a * np.exp(1j * self.theta_2)
        diagonal = self.ground - A
        e = abs(diagonal)
        cosine = (b * b + e * e - c * c) / (2.0 * b * e)
        if abs(cosine) > 1.0:
            return False
        theta_3 = np.angle(diagonal) + branch * math.acos(cosine)
        B = A + b * np.exp(1j * theta_3)
        self.theta = {2: self.theta_2, 3: theta_3, 4: float(np.angle(B - self.ground))}
        first = {2: 0j, 3: A, 4: self.ground}
        self.place = {
            k: first[k] + self.centres[k] * np.exp(1j * self.theta[k]) for k in first
        }
        gap = self._gap()
        for _ in range(NEWTON_STEPS):
            step = np.linalg.solve(self.jacobian(), -gap)
            before = self.place, self.theta
            steps = {k: step[3 * (k - 2) : 3 * (k - 1)] for k in (2, 3, 4)}
            self.place = {
                k: place + complex(steps[k][0], steps[k][1])
                for k, place in self.place.items()
            }
            self.theta = {k: x + float(steps[k][2]) for k, x in self.theta.items()}
            last, gap = gap, self._gap()
            if not np.abs(gap).max() < np.abs(last).max():
                self.place, self.theta = before
                break
        return True

    def _gap(self) -> Array:
        gaps = []
        for pin, (one, other) in _PINS.items():
            points = [self._point(pin, k) for k in (one, other)]
            gaps += [(points[1] - points[0]).real, (points[1] - points[0]).imag]
        return np.array([*gaps, self.theta[2] - self.theta_2])

    def _point(self, pin: str, bar: int) -> complex:
        if bar == 1:
            return complex(self.ground) if pin == "O4" else 0j
        return complex(
            self.place[bar] + self.arms(pin)[bar] * np.exp(1j * self.theta[bar])
        )

    def jacobian(self, bar: int = 2) -> Array:
        """Return the derivatives of the constraints, (9, 9); the last is of a bar."""
        rows = np.zeros((9, 9))
        for i, (pin, (one, other)) in enumerate(_PINS.items()):
            for k, sign in ((one, -1.0), (other, 1.0)):
                if k == 1:
                    continue
                arm = self.arms(pin)[k] * np.exp(1j * self.theta[k])
                column = 3 * (k - 2)
                rows[2 * i, column] = rows[2 * i + 1, column + 1] = sign
                rows[2 * i, column + 2] = -sign * arm.imag
                rows[2 * i + 1, column + 2] = sign * arm.real
        rows[8, 3 * (bar - 2) + 2] = 1.0
        return rows

    def solve(self, omega_2: float, alpha_2: float) -> dict[str, object]:
        """Solve speeds, accelerations and multipliers."""
        jacobian = self.jacobian()
        speeds = np.linalg.solve(jacobian, [0.0] * 8 + [omega_2])
        omega = {k: float(speeds[3 * (k - 2) + 2]) for k in (2, 3, 4)}
        gamma = []
        for pin, (one, other) in _PINS.items():
            centripetal = 0j
            for k, sign in ((one, -1.0), (other, 1.0)):
                if k != 1:
                    arm = self.arms(pin)[k] * np.exp(1j * self.theta[k])
                    centripetal += sign * omega[k] ** 2 * arm
            gamma += [centripetal.real, centripetal.imag]
        accelerations = np.linalg.solve(jacobian, [*gamma, alpha_2])
        alpha = {k: float(accelerations[3 * (k - 2) + 2]) for k in (2, 3, 4)}
        needed = np.zeros(9)
        for k, bar in self.bars.items():
            at = 3 * (k - 2)
            needed[at : at + 2] = find_mass(bar) * accelerations[at : at + 2]
            needed[at + 2] = find_inertia(bar) * alpha[k]
        needed -= self._applied(omega)
        driven = self.jacobian(self.scene.drive_bar)
        multipliers = np.linalg.solve(driven.T, needed)
        values: dict[str, object] = {"torque": multipliers[8]}
        for k in (3, 4):
            values |= {f"theta_{k}": self.theta[k], f"omega_{k}": omega[k]}
            values[f"alpha_{k}"] = alpha[k]
        pairs = zip(PIN_FORCES, _PINS.values(), strict=True)
        for row, (name, (_, second)) in enumerate(pairs):
            on_second = multipliers[2 * row : 2 * row + 2]
            values[name] = on_second if second == int(name[2]) else -on_second
        return values

    def _applied(self, omega: dict[int, float]) -> Array:
        """Return the generalized forces of loads and effects, (9,)."""
        applied = np.zeros(9)

        def push(bar: int, force: complex, arm: complex, couple: float = 0.0) -> None:
            """Push at an arm from the mass centre, in world axes."""
            at = 3 * (bar - 2)
            moment = (arm.conjugate() * force).imag + couple
            applied[at : at + 3] += force.real, force.imag, moment

        for load in self.scene.loads:
            push(load.bar, *self._find_load(load), load.moment)
        for effect in self.scene.effects:
            if isinstance(effect, Gravity):
                g = effect.magnitude * np.exp(1j * effect.angle)
                for k, bar in self.bars.items():
                    push(k, find_mass(bar) * complex(g), 0j)
                continue
            at_pins = (
                effect.coefficients if isinstance(effect, Viscous) else effect.torques
            )
            for pin, size in at_pins:
                one, other = _PINS[pin]
                slip = omega.get(other, 0.0) - omega.get(one, 0.0)
                couple = -size * (
                    slip if isinstance(effect, Viscous) else np.sign(slip)
                )
                for bar, sign in ((other, 1.0), (one, -1.0)):
                    if bar != 1:
                        push(bar, 0j, 0j, sign * couple)
        return applied

    def _find_load(self, load: Load) -> tuple[complex, complex]:
        """Return a load's force and its arm from the mass centre, in world axes."""
        if load.force is None:
            return 0j, 0j
        size, direction = load.force
        turned = self.theta[load.bar]
        if load.frame == "bar":
            direction = direction + turned
        force = complex(size * np.exp(1j * direction))
        if load.place is None:
            assert load.arm is not None
            distance, angle = load.arm
            return force, complex(distance * np.exp(1j * angle))
        assert load.place.from_pin is not None
        distance, angle = load.place.from_pin
        local = distance * np.exp(1j * angle) - self.centres[load.bar]
        return force, complex(local * np.exp(1j * turned))
