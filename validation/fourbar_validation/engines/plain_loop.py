"""Ask an engine as a user would, in a plain loop over its own calls.

Asked for are torque and pin forces alone.

Each position is assembled from the one before. With the gap g(q) at pin B and its
derivative J = dg/dq, one position takes Newton's steps on g, the speeds and
accelerations of

    J v = 0,   J a + (dJ/dt) v = 0,

one inverse dynamics tau(q, v, a), and the multipliers of

    [J^T e_drive] [lambda; T] = tau.
"""

from collections.abc import Callable

import numpy as np

from fourbar.errors import LimitError
from fourbar.quantities import PIN_FORCES, Array
from fourbar.scene import Command, Scene, with_signs
from fourbar_validation.compare.pins import state_from_pins
from fourbar_validation.engines.description import list_speeds
from fourbar_validation.engines.loop import Assembler
from fourbar_validation.engines.tree import KeptTree, solve_closed, solve_multipliers

MOST_CLOSURE_STEPS = 20
"""Newton's steps of one position; from its neighbour two or three are enough."""
_SQUARES_AWAY = 1e-7
"""A step (rad) after which Newton's method, which squares it, is at round-off."""


class PlainLoop:
    """A scene in the tree of one engine.

    Raises LimitError for a cylinder, and for friction that depends on the pin forces.
    """

    def __init__(self, build: Callable[[Scene], KeptTree], scene: Scene) -> None:
        if scene.drive is not None:
            raise LimitError("the plain loop has a couple on a bar, no cylinder")
        self.linkage = scene.linkage
        self.tree = tree = build(state_from_pins(scene))
        if tree.loaded:
            raise LimitError("the plain loop does not iterate over loads of pins")
        self.drive = tree.turns[scene.drive_bar]

    def answer(self, command: Command) -> dict[str, Array]:
        """Return the torque, (n,), and the pin forces, (n, 2)."""
        tree = self.tree
        n = len(command.theta_2)
        torque = np.empty(n)
        forces = {name: np.empty((n, 2)) for name in PIN_FORCES}
        speeds, accelerations = (values.tolist() for values in list_speeds(command))
        q = self._assemble_first(command)
        rates = np.zeros(3)
        for row, theta in enumerate(command.theta_2.tolist()):
            # along the motion from the position before
            q = q + rates * (theta - q[0])
            q[0] = theta
            jacobian = self._close(q)
            v = solve_closed(jacobian, speeds[row])
            rates = v / speeds[row]
            x, y = tree.drift(v)
            a = solve_closed(jacobian, accelerations[row], x=x, y=y)
            tree.moving(v, a)
            x, y, torque[row] = solve_multipliers(jacobian, self.drive, tree.torques())
            forces["F43"][row] = x, y
            for name, force in tree.forces(complex(x, y), torque[row]).items():
                forces[name][row] = force
        return {"torque": torque, **forces}

    def _assemble_first(self, command: Command) -> Array:
        """Find the joint angles of the first position, (3,), rad."""
        first = with_signs(self.linkage, command.part(slice(0, 1)))
        q = Assembler(self.tree).find(float(first.theta_2[0]), int(first.branch[0]))
        if q is None:
            raise LimitError("the loop does not close at the first position")
        return np.array(q)

    def _close(self, q: Array) -> Array:
        """Close the gap by bars 3 and 4, in place.

        Return the derivative of the gap there.
        """
        converged = False
        for _ in range(MOST_CLOSURE_STEPS):
            self.tree.place(q.tolist())
            jacobian = self.tree.jacobian()
            if converged:
                return jacobian
            x, y = self.tree.gap()
            (_, a, b), (_, c, d) = jacobian.tolist()
            determinant = a * d - b * c
            first = (b * y - d * x) / determinant
            second = (c * x - a * y) / determinant
            q[1] += first
            q[2] += second
            converged = abs(first) + abs(second) < _SQUARES_AWAY
        raise LimitError("Newton's method did not close the loop")
