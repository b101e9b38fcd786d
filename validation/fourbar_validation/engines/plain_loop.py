"""Ask an engine as a user would, in a plain loop over its own calls.

Asked for are torque and pin forces alone.

With the gap g(q) at pin B and its derivative J = dg/dq, one position takes Newton's
steps on g from the triangle of the lengths, the speeds and accelerations of

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
from fourbar_validation.engines.tree import Tree, solve_closed, solve_multipliers


class PlainLoop:
    """A scene in the tree of one engine.

    Raises LimitError for a cylinder, and for friction that depends on the pin forces.
    """

    def __init__(self, build: Callable[[Scene], Tree], scene: Scene) -> None:
        if scene.drive is not None:
            raise LimitError("the plain loop has a couple on a bar, no cylinder")
        self.linkage = scene.linkage
        self.tree = tree = build(state_from_pins(scene))
        if tree.loaded:
            raise LimitError("the plain loop does not iterate over loads of pins")
        self.position = Assembler(tree)
        self.drive = tree.turns[scene.drive_bar]

    def answer(self, command: Command) -> dict[str, Array]:
        """Return the torque, (n,), and the pin forces, (n, 2)."""
        tree = self.tree
        n = len(command.theta_2)
        torque = np.empty(n)
        forces = {name: np.empty((n, 2)) for name in PIN_FORCES}
        signed = with_signs(self.linkage, command)
        columns = signed.theta_2, signed.branch, *list_speeds(command)
        positions = zip(*(column.tolist() for column in columns), strict=True)
        for row, (theta, branch, speed, acceleration) in enumerate(positions):
            if self.position.find(theta, branch) is None:
                raise LimitError("the loop does not close at every position")
            jacobian = tree.jacobian()
            v = solve_closed(jacobian, speed)
            a = solve_closed(jacobian, acceleration, drift=tree.drift(v))
            tree.moving(v, a)
            x, y, torque[row] = solve_multipliers(jacobian, self.drive, tree.torques())
            forces["F43"][row] = x, y
            for name, force in tree.forces(complex(x, y), torque[row]).items():
                forces[name][row] = force
        return {"torque": torque, **forces}
