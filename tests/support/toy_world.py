"""A small integrator of bars, pins and a motor in the plane: the simulator of docs/adding-a-witness.md."""

import numpy as np


class World:
    """Bars in absolute coordinates (x, y of the mass centre, angle), accelerations and multipliers from one system."""

    def __init__(self) -> None:
        self.mass: list[float] = []
        self.q: list[float] = []
        self.v = np.zeros(0)
        self.field = (0.0, 0.0)
        self.pins: list[tuple[int | None, complex, int, complex]] = []

    def bar(self, mass: float, inertia: float, centre: complex, angle: float) -> int:
        """Add a bar; its number."""
        self.mass += [mass, mass, inertia]
        self.q += [centre.real, centre.imag, angle]
        return len(self.q) // 3 - 1

    def pin(self, one: int | None, at_one: complex, other: int, at_other: complex) -> None:
        """Join two points, each in the axes of its bar from its mass centre; None is the ground."""
        self.pins.append((one, at_one, other, at_other))

    def _constraints(self, q: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Rows of each pin and of the motor on the first bar, and their accelerations where nothing accelerates."""
        rows, bias = np.zeros((2 * len(self.pins) + 1, len(q))), np.zeros(2 * len(self.pins) + 1)
        for k, (one, at_one, other, at_other) in enumerate(self.pins):
            for bar, at, sign in ((one, at_one, -1.0), (other, at_other, 1.0)):
                if bar is None:
                    continue
                arm = at * np.exp(1j * q[3 * bar + 2])
                rows[2 * k, 3 * bar], rows[2 * k + 1, 3 * bar + 1] = sign, sign
                rows[2 * k : 2 * k + 2, 3 * bar + 2] = -sign * arm.imag, sign * arm.real
                bias[2 * k : 2 * k + 2] -= sign * v[3 * bar + 2] ** 2 * np.array([arm.real, arm.imag])
        rows[-1, 2] = 1.0
        return rows, bias

    def start(self, speed: float) -> None:
        """Velocities with which the motor turns the first bar at a constant speed."""
        rows, _ = self._constraints(np.array(self.q), np.zeros(len(self.q)))
        self.v = np.linalg.solve(rows, np.append(np.zeros(len(rows) - 1), speed))

    def solve(self, q: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Accelerations, and what each pin does to its second bar, (n, 2), with the motor's torque in the last row."""
        rows, bias = self._constraints(q, v)
        m = np.array(self.mass)
        force = m * np.tile([*self.field, 0.0], len(q) // 3)
        system = np.block([[np.diag(m), -rows.T], [rows, np.zeros((len(rows), len(rows)))]])
        found = np.linalg.solve(system, np.append(force, -bias))
        return found[: len(q)], np.append(found[len(q) :], 0.0).reshape(-1, 2)

    def step(self, h: float) -> None:
        """One Runge-Kutta step of fourth order."""
        n = len(self.q)

        def rate(y: np.ndarray) -> np.ndarray:
            return np.append(y[n:], self.solve(y[:n], y[n:])[0])

        y = np.append(self.q, self.v)
        k1 = rate(y)
        k2 = rate(y + h / 2 * k1)
        k3 = rate(y + h / 2 * k2)
        y = y + h / 6 * (k1 + 2 * k2 + 2 * k3 + rate(y + h * k3))
        self.q, self.v = y[:n].tolist(), y[n:]

    def forces(self) -> np.ndarray:
        """The second part of `solve` now."""
        return self.solve(np.array(self.q), self.v)[1]
