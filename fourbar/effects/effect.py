"""What every effect is made of, and the engine's side that its engine term may use."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any, ClassVar, Protocol, Self

import numpy as np
from numpy.typing import NDArray

from fourbar.effects.wrenches import Wrenches
from fourbar.linkage import FourBar
from fourbar.solution import Solution
from fourbar.state import Array, State

Act = Callable[[], None]
Joints = tuple[float, float, float]


class Tree(Protocol):
    """An engine holding the open tree of bars at its present motion; every number is the engine's own.

    The ground (bar 1) does not move; its line points from O2 to O4.
    """

    def gravity(self, vector: tuple[float, float]) -> None:
        """Give the engine's own gravity a field (g_x, g_y), m/s^2."""

    def push(self, bar: int, force: Array, point: Array) -> None:
        """Add a force (N, world axes) at a point (m, world axes); on the ground it does nothing."""

    def twist(self, bar: int, couple: float) -> None:
        """Add a couple, N m; on the ground it does nothing."""

    def angle(self, bar: int) -> float:
        """Direction of a bar's line, in (-pi, pi], rad."""

    def velocity(self, bar: int) -> float:
        """Angular velocity of a bar, rad/s."""

    def alpha(self, bar: int) -> float:
        """Angular acceleration of a bar, rad/s^2."""

    def turned(self, bar: int, x: float, y: float) -> Array:
        """World axes of the vector that is (x, y) along and across a bar's line, (2,)."""

    def foot(self, bar: int) -> Array:
        """First pin of a bar (O2, O2, A, O4 of bars 1, 2, 3, 4), m, (2,)."""

    def centre(self, bar: int) -> Array:
        """Mass centre of a moving bar, m, (2,)."""

    def pin_load(self, pin: str) -> float:
        """Magnitude of the pin force that the engine itself found in its last pass, N."""


class Effect:
    """One effect in one file: each method is its whole presence in one part of the project.

    A subclass is a frozen dataclass. What it leaves at the default it does not have.
    """

    __slots__ = ()
    key: ClassVar[str]
    """Its name under ``[effects]``."""
    example: ClassVar[str]
    """One line of a scene file."""
    dry: ClassVar[bool] = False
    """Whether its couples jump where the relative rotation at a pin changes its sense."""

    counts_turns: ClassVar[bool] = False
    """Whether it depends on where the motion began (`begun`)."""

    @property
    def loaded_pins(self) -> tuple[str, ...]:
        """Pins whose forces it depends on itself."""
        return ()

    @property
    def dry_pins(self) -> tuple[str, ...]:
        """Pins at which its couples jump."""
        return ()

    @classmethod
    def read(cls, value: object, reader: Any) -> Self:
        """From the entry of a scene file; the reader checks units."""
        raise NotImplementedError

    def write(self, writer: Any) -> Any:
        """Back to the form of a scene file."""
        raise NotImplementedError

    def add_wrenches(self, wrenches: Wrenches, state: State) -> None:
        """Its forces and couples on the bars, in Newton-Euler."""

    def add_known(self, wrenches: Wrenches, state: State, forces: Mapping[str, Array]) -> None:
        """What `add_wrenches` leaves to the solution of the pin forces, once these are known (name: (n, 2), N)."""

    def rounded_anew(self, beside: Callable[[float], float], *, all_of_it: bool) -> Self:
        """The same with its own numbers moved in their last digits, for the error bars.

        Without `all_of_it` those remain whose rounding is in the moment or force that they make alone.
        """
        return self

    def begun(self, start: State) -> Self:
        """The same effect in a motion that begins at the first of these positions that assembles."""
        return self

    def unsettled(self, state: State) -> NDArray[np.uint8] | None:
        """Status codes, (n,): other than `OK` where it has no value; None: it has one everywhere."""
        return None

    def power(self, state: State) -> Array | float:
        """The power it puts into the linkage, W, for the energy method: derived on its own."""
        return 0.0

    def carried_by(self, linkage: FourBar) -> FourBar:
        """The linkage that the energy method moves: with the inertia that the effect adds."""
        return linkage

    def engine_term(self, tree: Tree) -> Act | None:
        """What acts at each state of an engine's tree, from the engine's own numbers; None: set once and for all."""
        raise NotImplementedError

    def add_mjcf(self, model: Any) -> None:
        """Its MJCF; LimitError where MJCF has no counterpart."""
        raise NotImplementedError

    def unwind(self, linkage: FourBar, q: Joints) -> Joints:
        """The MJCF's angles of pins O2, A, O4, moved by the whole turns that the effect tells apart; rad."""
        return q

    def size(self, linkage: FourBar, solution: Solution) -> Array | float:
        """Its forces, couples divided by a bar's length, N: the scale of what vanishes."""
        raise NotImplementedError

    def couple(self, linkage: FourBar, speed: float) -> float:
        """The couple that it may ask of the drive at a speed (rad/s), N m: lays out the flywheel of the MJCF."""
        return 0.0

    def leaning(self, side: int) -> Self:
        """The same effect with every pin at rest about to turn (+1: as theta_2 grows, -1: as it falls)."""
        return replace(self, side=side) if self.dry else self  # type: ignore[type-var]
