"""A flywheel on a bar that ground carries: more inertia, and no weight."""

from dataclasses import dataclass, replace
from typing import Any, ClassVar

from fourbar.effects.effect import Act, Effect, Tree
from fourbar.effects.wrenches import Wrenches
from fourbar.errors import InputError
from fourbar.linkage import FourBar, require
from fourbar.solution import Solution
from fourbar.state import Array, State, is_zero


@dataclass(frozen=True, slots=True)
class Flywheel(Effect):
    """A wheel that turns with the driven bar about its fixed pin.

    Parameters
    ----------
    inertia : kg m^2, >= 0.
    bar : 2 (on pin O2) or 4 (on pin O4).
    """

    inertia: float
    bar: int = 2
    key: ClassVar[str] = "flywheel"
    example: ClassVar[str] = 'flywheel = { bar = 2, inertia = "0.02 kg m^2" }'

    def __post_init__(self) -> None:
        require("effects.flywheel.inertia", self.inertia, at_least_zero=True)
        if self.bar not in (2, 4) or isinstance(self.bar, bool):
            raise InputError("effects.flywheel.bar", self.bar, "must be 2 or 4, a bar on a fixed pin")

    @classmethod
    def read(cls, value: object, reader: Any) -> "Flywheel":
        """From ``{ bar = 2, inertia = "0.02 kg m^2" }``; bar 2 where none is named."""
        key = "effects.flywheel"
        entry = reader.table(key, value, ("bar", "inertia"))
        inertia = reader.quantity(f"{key}.inertia", entry.get("inertia"), "kg m^2", at_least_zero=True)
        return cls(inertia, reader.whole(f"{key}.bar", entry.get("bar", 2), 2, 4))

    def write(self, writer: Any) -> Any:
        """Back to the form of a scene file."""
        return {"bar": self.bar, "inertia": writer.quantity(self.inertia, "kg m^2")}

    def add_wrenches(self, wrenches: Wrenches, state: State) -> None:
        """M = -J alpha (d'Alembert)."""
        alpha = state.alpha(self.bar)
        if not is_zero(alpha):
            wrenches.add_moment(self.bar, -self.inertia * alpha)

    def carried_by(self, linkage: FourBar) -> FourBar:
        """The bar with the wheel's inertia added: a rotation has no other."""
        bar = linkage.bar(self.bar)
        assert bar.inertia is not None
        heavier = replace(bar, inertia=bar.inertia + self.inertia)
        return replace(linkage, input=heavier) if self.bar == 2 else replace(linkage, output=heavier)

    def engine_term(self, tree: Tree) -> Act:
        """The couple that turning the wheel takes, from the engine's own angular acceleration."""

        def act() -> None:
            tree.twist(self.bar, -self.inertia * tree.alpha(self.bar))

        return act

    def add_mjcf(self, model: Any) -> None:
        """Inertia of the body: MuJoCo's armature of pin O2 is what drives."""
        model.inertia[self.bar] += self.inertia

    def size(self, linkage: FourBar, solution: Solution) -> Array:
        """J |alpha|, divided by the bar's length, N."""
        alpha = getattr(solution, f"alpha_{self.bar}")
        return self.inertia * abs(alpha) / linkage.bar(self.bar).length  # type: ignore[no-any-return]
