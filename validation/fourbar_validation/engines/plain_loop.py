"""Ask an engine as a user would, in a plain loop over its own calls.

Asked for are torque and pin forces alone.

With the gap g(q) at pin B and its derivative J = dg/dq, one position takes Newton's
steps on g from the triangle of the lengths, the speeds and accelerations of

    J v = 0,   J a + (dJ/dt) v = 0,

one inverse dynamics tau(q, v, a), and the multipliers of

    [J^T e_drive] [lambda; T] = tau.
"""

from collections.abc import Callable
from typing import Any

from fourbar.errors import LimitError
from fourbar.quantities import PIN_FORCES, Array
from fourbar.scene import Command, Scene, with_signs
from fourbar_validation.compare.pins import state_from_pins
from fourbar_validation.engines.loop import Assembler, read_each
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

        def read(
            theta: float, branch: int, speed: float, acceleration: float
        ) -> dict[str, Any]:
            if self.position.find(theta, branch) is None:
                raise LimitError("the loop does not close at every position")
            jacobian = tree.jacobian()
            v = solve_closed(jacobian, speed)
            a = solve_closed(jacobian, acceleration, drift=tree.drift(v))
            tree.moving(v, a)
            x, y, torque = solve_multipliers(jacobian, self.drive, tree.torques())
            forces = tree.forces(complex(x, y), torque)
            return {"torque": torque, "F43": (x, y), **forces}

        signed = with_signs(self.linkage, command)
        answered, _ = read_each(signed, ("torque", *PIN_FORCES), read)
        return answered
