"""Mistakes in a calculation of forces, as hypotheses: what its free bodies would give.

Of each bar, p is the mass times the acceleration of G less what acts from outside, and
q the same for moments about G. The pins and the drive must give both:

    bar 2:  p2 = F12 + F32      bar 3:  p3 = F43 - F32      bar 4:  p4 = F14 - F43

The right p and q follow from the right forces, whatever acts; a mistake changes some of
them, or a force in place of a balance.
"""

import math
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fourbar.effects import Gravity
from fourbar.errors import FourBarError
from fourbar.linkage import BAR_NAMES, MOVING_BARS
from fourbar.quantities import FORCE_NAMES, PIN_FORCES, VECTORS, Array
from fourbar.scene import Scene
from fourbar.solution import Solution
from fourbar.solving import solve
from fourbar_validation.check.judge import Judge
from fourbar_validation.check.theirs import name_quantity
from fourbar_validation.check.variants import Mistake
from fourbar_validation.compare.line import place_line
from fourbar_validation.compare.tolerance import EPS
from fourbar_validation.engines.description import FORCE_BETWEEN, name_driving
from fourbar_validation.engines.free_body import solve_system

MistakenNumbers = dict[str, Array]
"""Numbers that a mistake leads to, by quantity; others stay right."""
_CHAINS = {
    "B": ((2, 3), (4,)),
    "A": ((2,), (4, 3)),
    "O4": ((2, 3, 4),),
}
"""Pins at which a loop is cut into a tree, the commonest first: the chains of bars that
are left, each from the ground on.
"""
ENOUGH_POSITIONS = 3
"""Columns or positions that a hypothesis with a number in it needs."""
SOFT_TORQUE = 1e-6
"""Part of the torque that a soft constraint still carries at rest in MuJoCo's inverse
dynamics of a loop; 2e-8 was seen.
"""


EPS_SINGLE = float(np.finfo(np.float32).eps)
"""Round-off of numbers of single precision."""
LEAST_OF_SINGLE = EPS_SINGLE / 100.0
"""Median error, as a part of each size, from which numbers may be single ones."""
MOST_IN_COMMON = 0.5
"""Correlation of the errors of neighbours that round-off does not reach."""
_LATE = {
    "one step late: numbers of the position before": 1,
    "one step early: numbers of the position after": -1,
}
"""Mistakes in time, and by how many positions the numbers are late."""


class _BarWrenches(NamedTuple):
    """Bars at n positions, and what their pins and the drive must give them."""

    arms: dict[int, Array]
    """Vector from the bar's first pin (O2, A, O4) to G, (n, 2)."""
    bars: dict[int, Array]
    """Vector from the bar's first pin to its second one, (n, 2)."""
    p: dict[int, Array]
    q: dict[int, Array]
    drive_bar: int
    """Bar on which the ground's couple acts."""
    driving: str
    """Name of what is solved for: the torque, or the force of the drive."""
    push: dict[int, Array]
    """Force of 1 N of a drive that exerts a force, (n, 2); zero for a couple."""
    twist: dict[int, Array]
    """Its moment about the bar's first pin, or 1 for a couple, (n,)."""

    def changed(
        self,
        bar: int,
        p: Array | float = 0.0,
        q: Array | float = 0.0,
    ) -> "_BarWrenches":
        """Return the wrenches with more force and moment needed by one bar."""
        return self._replace(
            p={**self.p, bar: self.p[bar] + p},
            q={**self.q, bar: self.q[bar] + q},
        )

    def about_pin(self, bar: int) -> Array:
        """Compute the moment that a bar needs about its first pin, N m."""
        return self.q[bar] + cross_vectors(self.arms[bar], self.p[bar])

    def solve(self) -> MistakenNumbers:
        """Solve the three free bodies.

        Moments about the first pins of bars 2, 3 and 4, where a drive of size s exerts
        s f_k and the moment s m_k on bar k:

            a x F43 + s (m2 + a x f3) = moment of bar 2 + a x p3
            b x F43 + s m3            = moment of bar 3
           -c x F43 + s m4            = moment of bar 4
        """
        a, b, c = (self.bars[bar] for bar in MOVING_BARS)
        twist = {**self.twist, 2: self.twist[2] + cross_vectors(a, self.push[3])}
        moment = {bar: self.about_pin(bar) for bar in MOVING_BARS}
        moment[2] = moment[2] + cross_vectors(a, self.p[3])
        matrix = np.stack(
            [
                np.stack((-lever[:, 1], lever[:, 0], twist[bar]), axis=1)
                for bar, lever in {2: a, 3: b, 4: -c}.items()
            ],
            axis=1,
        )
        right = np.stack([moment[bar] for bar in MOVING_BARS], axis=1)
        x = solve_system(matrix, right[:, :, None])[0][:, :, 0]
        F43 = x[:, :2]
        size = x[:, 2]
        f2, f3, f4 = (size[:, None] * self.push[bar] for bar in MOVING_BARS)
        F32 = F43 - self.p[3] + f3
        return {
            "F43": F43,
            "F32": F32,
            "F12": self.p[2] - F32 - f2,
            "F14": self.p[4] + F43 - f4,
            self.driving: size,
        }

    def cut(self, pin: str) -> MistakenNumbers:
        """Return forces and torque of the tree that a cut at a pin leaves.

        No force is passed at the cut. The torque is that of the joint by which the
        driven bar hangs on the ground or on the bar before it in its chain; the joint
        carries the bar and all behind it.
        """
        none = np.zeros_like(self.p[2])
        if pin == "A":
            F32 = none
            F43 = self.p[3]
        elif pin == "B":
            F32 = -self.p[3]
            F43 = none
        else:
            F32 = -self.p[3] - self.p[4]
            F43 = -self.p[4]
        return {
            "F12": self.p[2] - F32,
            "F32": F32,
            "F43": F43,
            "F14": self.p[4] + F43,
            "torque": self._torque_of_tree(pin),
        }

    def _torque_of_tree(self, pin: str) -> Array:
        """Compute the moment of the driven bar's joint in the tree cut at a pin."""
        A = self.bars[2]
        B = A + self.bars[3]
        first_pins = {
            2: np.zeros_like(A),
            3: A,
            4: B - self.bars[4],
        }
        chain = next(chain for chain in _CHAINS[pin] if self.drive_bar in chain)
        place = chain.index(self.drive_bar)
        joint = first_pins[self.drive_bar]
        if (pin, self.drive_bar) in (("A", 3), ("O4", 4)):
            joint = B
        torque = np.zeros(len(A))
        for bar in chain[place:]:
            arm = first_pins[bar] - joint
            torque = torque + self.about_pin(bar) + cross_vectors(arm, self.p[bar])
        return torque


def cross_vectors(u: Array, v: Array) -> Array:
    """Compute the z component of the cross product of vectors, (n, 2)."""
    return np.asarray(u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0])


def _turn_by_quarter(v: Array) -> Array:
    """Turn vectors, (n, 2), by 90 deg."""
    return np.stack((-v[:, 1], v[:, 0]), axis=1)


def turn(v: Array, angle: Array) -> Array:
    """Turn vectors, (n, 2), by an angle, rad."""
    x = v[:, 0]
    y = v[:, 1]
    cosine = np.cos(angle)
    sine = np.sin(angle)
    return np.stack((cosine * x - sine * y, sine * x + cosine * y), axis=1)


def find_wrenches(scene: Scene, right: Solution) -> _BarWrenches:
    """Compute what each bar needs of its pins, from the right forces."""
    theta_1 = scene.linkage.ground_angle
    O4 = scene.linkage.ground * np.array([[np.cos(theta_1), np.sin(theta_1)]])
    A = right.A
    B = right.B
    first = {
        2: np.zeros_like(A),
        3: A,
        4: O4 + np.zeros_like(A),
    }
    second = {2: A, 3: B, 4: B}
    F12, F32, F43, F14 = (getattr(right, name) for name in PIN_FORCES)
    acting = {
        2: (F12, F32),
        3: (-F32, F43),
        4: (F14, -F43),
    }
    arms = {}
    bars = {}
    p = {}
    q = {}
    for bar in MOVING_BARS:
        G = getattr(right, f"G{bar}")
        arms[bar] = G - first[bar]
        bars[bar] = second[bar] - first[bar]
        at_first, at_second = acting[bar]
        p[bar] = at_first + at_second
        about_first = cross_vectors(first[bar] - G, at_first)
        about_second = cross_vectors(second[bar] - G, at_second)
        q[bar] = about_first + about_second
    driving = name_driving(scene)
    push, twist = _place_drive(scene, right)
    size = np.asarray(getattr(right, driving))
    for bar in MOVING_BARS:
        about_G = twist[bar] - cross_vectors(arms[bar], push[bar])
        p[bar] = p[bar] + size[:, None] * push[bar]
        q[bar] = q[bar] + size * about_G
    return _BarWrenches(arms, bars, p, q, scene.drive_bar, driving, push, twist)


def _place_drive(
    scene: Scene,
    right: Solution,
) -> tuple[dict[int, Array], dict[int, Array]]:
    """Return force and moment about its first pin of each bar by a drive of size 1."""
    push = {bar: np.zeros((len(right), 2)) for bar in MOVING_BARS}
    twist = {bar: np.zeros(len(right)) for bar in MOVING_BARS}
    if scene.drive is None:
        twist[scene.drive_bar] += 1.0
        return push, twist
    theta = {bar: getattr(right, f"theta_{bar}") for bar in MOVING_BARS}
    line = place_line(scene.linkage, scene.drive, theta)
    for (sense, point), arm in zip(scene.drive.ends, line.arms, strict=True):
        if point.bar in MOVING_BARS:
            force = sense * line.unit
            push[point.bar] += np.stack((force.real, force.imag), axis=1)
            twist[point.bar] += (np.conj(arm) * force).imag
    return push, twist


@dataclass(frozen=True)
class _Calculation:
    """A judge's right numbers, as wrenches of free bodies."""

    judge: Judge
    wrenches: _BarWrenches

    @property
    def right(self) -> Solution:
        """Return the right numbers."""
        return self.judge.right

    def mistakes(self) -> Iterator[Mistake]:
        """List the mistakes that this calculation can have, the simplest first."""
        scene = self.judge.scene
        if scene.drive is None:
            yield from self._open_tree()
        yield from self._frames()
        yield from self._equal_forces()
        if any(effect.loaded_pins for effect in scene.effects):
            return  # what acts follows the pin forces
        yield from self._velocity_terms()
        yield from self._accelerations_of_centres()
        yield from self._inertias()
        yield from self._weights()
        yield from self._arms_of_loads()

    def _open_tree(self) -> Iterator[Mistake]:
        trees = {pin: self.wrenches.cut(pin) for pin in _CHAINS}
        how = "the loop force is 0, as from mj_inverse or rnea of a loop"
        for pin, values in trees.items():
            text = f"forces and torque of the open tree, cut at {pin}: {how}"
            yield _state(text, values, left=SOFT_TORQUE)
        for pin, values in trees.items():
            text = f"torque of the open tree, cut at {pin}: {how}"
            yield _state(
                text,
                {"torque": values["torque"]},
                whole=False,
                left=SOFT_TORQUE,
            )

    def _frames(self) -> Iterator[Mistake]:
        ways = {
            "each force is in the frame of the bar on which it acts": 1,
            "each force is in the frame of the bar that exerts it": 0,
        }
        for text, side in ways.items():
            frames = {name: bars[side] for name, bars in FORCE_BETWEEN.items()}
            yield _state(f"{text}, not in world axes", self._turned(frames))
        for bar in (1, *MOVING_BARS):
            text = f"forces are in the frame of bar {bar}, not in world axes"
            yield _state(text, self._turned(dict.fromkeys(FORCE_BETWEEN, bar)))
        for name in FORCE_BETWEEN:
            for bar in (1, *MOVING_BARS):
                text = f"{name} is in the frame of bar {bar}, not in world axes"
                yield _state(text, self._turned({name: bar}), whole=False)

    def _turned(self, frames: dict[str, int]) -> MistakenNumbers:
        theta: dict[int, Array] = {
            bar: getattr(self.right, f"theta_{bar}") for bar in MOVING_BARS
        }
        theta_1 = self.judge.scene.linkage.ground_angle
        theta[1] = np.full_like(theta[2], theta_1)
        return {
            name: turn(getattr(self.right, name), -theta[bar])
            for name, bar in frames.items()
        }

    def _equal_forces(self) -> Iterator[Mistake]:
        for name in PIN_FORCES:
            for other in PIN_FORCES:
                if other == name:
                    continue
                values = getattr(self.right, other)
                yield _state(f"{name} = {other}", {name: values}, whole=False)
                yield _state(f"{name} = -{other}", {name: -values}, whole=False)

    def _velocity_terms(self) -> Iterator[Mistake]:
        """Leave out (dJ/dt) v.

        The accelerations of the other bars then follow that of the commanded one alone.
        """
        right = self.right
        with np.errstate(divide="ignore", invalid="ignore"):
            at = right.at
            gain = np.asarray(at.acceleration) / np.asarray(at.speed)
        wrenches = self.wrenches
        moved = MistakenNumbers()
        for bar in MOVING_BARS:
            if bar == at.bar:
                continue
            alpha = gain * getattr(right, f"omega_{bar}")
            more = alpha - getattr(right, f"alpha_{bar}")
            a = more[:, None] * _turn_by_quarter(wrenches.arms[bar])
            wrenches, a_G = self._accelerate(wrenches, bar, a, more)
            moved |= {f"alpha_{bar}": alpha, **a_G}
        text = "(dJ/dt) v is missing in the accelerations of the loop"
        yield from _state_with_forces(text, moved, wrenches)

    def _accelerations_of_centres(self) -> Iterator[Mistake]:
        """Leave out a part of the acceleration of each G about its bar's first pin."""
        right = self.right
        centripetal = {}
        tangential = {}
        for bar in MOVING_BARS:
            omega = np.broadcast_to(getattr(right, f"omega_{bar}"), len(right))
            alpha = np.broadcast_to(getattr(right, f"alpha_{bar}"), len(right))
            arm = self.wrenches.arms[bar]
            centripetal[bar] = -(omega**2)[:, None] * arm
            tangential[bar] = alpha[:, None] * _turn_by_quarter(arm)
        parts = {
            "-omega^2 r is missing in a_G": (centripetal, -1.0),
            "-omega^2 r has the wrong sign in a_G": (centripetal, -2.0),
            "-omega^2 r is doubled in a_G": (centripetal, 1.0),
            "alpha x r is missing in a_G": (tangential, -1.0),
            "alpha x r has the wrong sign in a_G": (tangential, -2.0),
            "alpha x r is doubled in a_G": (tangential, 1.0),
        }
        for text, (part, times) in parts.items():
            wrenches = self.wrenches
            moved = MistakenNumbers()
            for bar in MOVING_BARS:
                wrenches, a_G = self._accelerate(wrenches, bar, times * part[bar])
                moved |= a_G
            whose = "of every bar, r from its first pin to G"
            yield from _state_with_forces(f"{text} {whose}", moved, wrenches)
        for bar in MOVING_BARS:
            a = -centripetal[bar] - tangential[bar]
            wrenches, moved = self._accelerate(self.wrenches, bar, a)
            text = f"the acceleration of bar {bar}'s first pin is used as its a_G"
            yield from _state_with_forces(text, moved, wrenches)

    def _accelerate(
        self,
        wrenches: _BarWrenches,
        bar: int,
        a: Array,
        alpha: Array | float = 0.0,
    ) -> tuple[_BarWrenches, MistakenNumbers]:
        """Return the wrenches and a_G of a bar under an added acceleration.

        `a` and `alpha` are added to its acceleration.
        """
        body = self.judge.scene.linkage.bar(bar)
        needed = wrenches.changed(bar, body.mass * a, body.moment_of_inertia * alpha)
        return needed, {f"a_G{bar}": getattr(self.right, f"a_G{bar}") + a}

    def _inertias(self) -> Iterator[Mistake]:
        """Take a moment of inertia about G for that about the bar's first pin."""
        every = self.wrenches
        text = "inertia about G used as the inertia about the pin"
        for bar in MOVING_BARS:
            body = self.judge.scene.linkage.bar(bar)
            alpha = np.asarray(getattr(self.right, f"alpha_{bar}"))
            less = -body.mass * body.mass_centre[0] ** 2 * alpha
            every = every.changed(bar, q=less)
            alone = self.wrenches.changed(bar, q=less)
            yield _state(f"{BAR_NAMES[bar]}: {text}", alone.solve())
        yield _state(f"every bar: {text}", every.solve())

    def _weights(self) -> Iterator[Mistake]:
        """Leave out the weight of one bar."""
        for effect in self.judge.scene.effects:
            if not isinstance(effect, Gravity):
                continue
            direction = np.array([np.cos(effect.angle), np.sin(effect.angle)])
            for bar in MOVING_BARS:
                mass = self.judge.scene.linkage.bar(bar).mass
                weight = mass * effect.magnitude * direction
                without = self.wrenches.changed(bar, weight)
                yield _state(f"the weight of bar {bar} is missing", without.solve())

    def _arms_of_loads(self) -> Iterator[Mistake]:
        """Measure where a force acts from the wrong point, or turn it with its bar."""
        scene = self.judge.scene
        for number, load in enumerate(scene.loads):
            if not load.force:
                continue
            others = scene.loads[:number] + scene.loads[number + 1 :]
            without = solve(replace(scene, loads=others), "force", at=self.judge.at)
            bar = load.bar
            needed = find_wrenches(scene, without)
            force = needed.p[bar] - self.wrenches.p[bar]
            moment = cross_vectors(self.wrenches.arms[bar], force)
            if load.table is None:
                yield from self._move_load(number, needed, load.moment, moment)
            name = f"load {number + 1} (bar {bar})"
            what = "its place"
            if load.arm is not None:
                what = "its arm"
            if load.from_pin is None:
                yield _state(
                    f"{name}: {what} is measured from the bar's first pin, not from G",
                    self.wrenches.changed(bar, q=moment).solve(),
                )
            if load.arm is not None:
                theta = getattr(self.right, f"theta_{bar}")
                more = turn(force, theta) - force
                r, phi = load.arm
                arm = np.array([[r * np.cos(phi), r * np.sin(phi)]])
                turned = self.wrenches.changed(bar, -more, -cross_vectors(arm, more))
                yield _state(
                    f"{name}: its direction turns with the bar", turned.solve()
                )
            else:  # an engine is told every place from the first pin
                yield _state(
                    f"{name}: {what} is measured from G, not from the bar's first pin",
                    self.wrenches.changed(bar, q=-moment).solve(),
                )

    def _move_load(
        self,
        number: int,
        without: _BarWrenches,
        couple: float,
        moment: Array,
    ) -> Iterator[Mistake]:
        """Let the force of a load act at G, or at the bar's first pin.

        `without`: what the bars need without it; `moment`: of the force at G about that
        pin.
        """
        bar = self.judge.scene.loads[number].bar
        name = f"load {number + 1} (bar {bar})"
        at_centre = without.q[bar] - self.wrenches.q[bar] - couple
        for place, more in (("G", at_centre), ("the first pin", at_centre + moment)):
            text = f"{name}: its force acts at {place} of the bar"
            yield _state(text, self.wrenches.changed(bar, q=more).solve())


def find_miscalculated(judge: Judge) -> Iterator[Mistake]:
    """List the mistakes of a calculation, or of a simulation, that a table can show."""
    if judge.stage == "force":
        mistakes: list[Mistake] = []
        with np.errstate(all="ignore"), suppress(FourBarError):
            # a scene without one of its loads may be none
            wrenches = find_wrenches(judge.scene, judge.right)
            mistakes.extend(_Calculation(judge, wrenches).mistakes())
        yield from mistakes
    if judge.stage == "force":
        yield from _find_impulses(judge)
    yield from _find_late(judge)
    yield from _find_other_branch(judge)


def find_single_precision(judge: Judge) -> Iterator[Mistake]:
    """Yield the mistake of too short numbers if errors are such as these leave.

    No error is beyond what round-off of that size allows, most are larger than those of
    a file that is rounded elsewhere, and those of neighbours have nothing in common.
    """
    errors = []
    common = []
    for key, theirs in judge.table.values.items():
        mask = judge.where(key)
        error = judge.judged_right(key)[0][mask]
        if not np.all(error <= EPS_SINGLE / EPS * judge.find_exact(key)[mask]):
            return
        errors.append(error[error > 0.0])
        apart = (theirs - judge.ours(key))[mask]
        common.append(np.nansum(apart[1:] * apart[:-1]) / np.nansum(apart**2))
    typical = np.median(np.concatenate(errors))
    if typical >= LEAST_OF_SINGLE and np.nanmedian(common) < MOST_IN_COMMON:
        text = "numbers have some 7 digits, as those of single precision"
        yield _state(text, judge.table.values)


def _state(
    text: str,
    values: MistakenNumbers,
    *,
    whole: bool = True,
    left: float = 0.0,
) -> Mistake:
    def predict(quantity: str, right: Solution) -> Array | None:
        return values.get(quantity)

    return Mistake(text, predict, whole=whole, left=left)


def _state_with_forces(
    text: str,
    moved: MistakenNumbers,
    wrenches: _BarWrenches,
) -> Iterator[Mistake]:
    """Yield a mistake in accelerations: with its wrong forces, and these alone."""
    forces = wrenches.solve()
    yield _state(text, {**moved, **forces})
    yield _state(f"{text}, from which the forces follow", forces)


def _find_impulses(judge: Judge) -> Iterator[Mistake]:
    """Fit one time by which all forces and the torque are multiplied."""
    ours = []
    theirs = []
    for key in judge.table.values:
        if name_quantity(key) in FORCE_NAMES:
            mask = judge.where(key)
            ours.append(judge.ours(key)[mask].ravel())
            theirs.append(judge.table.values[key][mask].ravel())
    if len(ours) < ENOUGH_POSITIONS:
        return
    x = np.concatenate(ours)
    y = np.concatenate(theirs)
    stated = np.isfinite(y)
    x = x[stated]
    y = y[stated]
    with np.errstate(all="ignore"):
        squares = float(x @ x)
        if squares:
            time = float(x @ y) / squares
        else:
            time = math.nan
    if len(x) < ENOUGH_POSITIONS:
        return
    if not 0.0 < time < 1.0:
        return

    def predict(quantity: str, right: Solution) -> Array | None:
        if quantity in FORCE_NAMES:
            values = getattr(right, quantity, None)
        else:
            values = None
        if values is None:
            return None
        return np.asarray(time * values)

    text = f"impulses in place of forces: every force and the torque times {time:.4g} s"
    yield Mistake(text, predict, times=2.0)


def _find_late(judge: Judge) -> Iterator[Mistake]:
    """Give each position the numbers of the one before, or of the one after."""
    n = len(judge.at.angle)
    if n < ENOUGH_POSITIONS + 1:
        return
    of_forces: Callable[[str], bool] = (*FORCE_NAMES, *PIN_FORCES).__contains__
    for text, step in _LATE.items():
        rows = np.clip(np.arange(n) - step, 0, n - 1)
        edge = 0 if step == 1 else n - 1
        for what, applies in (("", bool), (" (forces alone)", of_forces)):

            def predict(
                quantity: str,
                right: Solution,
                rows: NDArray[np.intp] = rows,
                edge: int = edge,
                applies: Callable[[str], bool] = applies,
            ) -> Array | None:
                if quantity == right.commanded or not applies(quantity):
                    return None
                values = getattr(right, quantity, None)
                if values is None:
                    return None
                moved = np.array(values[rows])
                theirs = judge.table.values.get(quantity)
                if theirs is not None and theirs.shape == moved.shape:
                    moved[edge] = theirs[edge]  # it may be anything
                return moved

            yield Mistake(text + what, predict)


def _find_other_branch(judge: Judge) -> Iterator[Mistake]:
    """Yield the mistake of the other branch from where the numbers change."""
    key = next(
        (
            key
            for key in ("theta_3", "theta_4", *judge.table.values)
            if key in judge.table.values
        ),
        None,
    )
    if key is None:
        return
    try:
        other = solve(
            judge.scene,
            judge.stage,
            at=judge.at._replace(branch=-judge.at.branch),
        )
    except FourBarError:
        return
    error = judge.judged_right(key)[0]
    of_other = judge.judged(key, judge.ours(key, other))[0]
    left = of_other < error
    places = np.flatnonzero(left)
    if not len(places) or places[0] == 0:
        return
    start = int(places[0])
    later = np.arange(len(left)) >= start
    here = np.degrees(judge.at.angle[start])

    def predict(quantity: str, right: Solution) -> Array | None:
        ours, theirs = (getattr(one, quantity, None) for one in (right, other))
        if ours is None or theirs is None:
            return None
        if quantity in VECTORS:
            mask = later[:, None]
        else:
            mask = later
        return np.asarray(np.where(mask, theirs, ours))

    place = f"{judge.at.commanded} = {here:.4g} deg"
    yield Mistake(f"the other branch from {place} on", predict)
