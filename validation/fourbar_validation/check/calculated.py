"""Mistakes in a calculation of forces, as hypotheses: what its free bodies would give.

A mistake lets act on bars 2, 3 and 4 what does not, or leaves out what does. Pins and
drive follow from this change by the equations of the free bodies, which are solved for
all changes at once.
"""

from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fourbar.effects import Flywheel, Gravity, Load
from fourbar.errors import FourBarError
from fourbar.linkage import BAR_NAMES, MOVING_BARS, PINS
from fourbar.quantities import FORCE_NAMES, PIN_FORCES, VECTORS, Array, ComplexArray
from fourbar.scene import Scene
from fourbar.solution import Solution
from fourbar.solving import solve
from fourbar_validation.check.judge_table import Judge
from fourbar_validation.check.theirs import name_quantity
from fourbar_validation.check.variants import Mistake, Wanted, always
from fourbar_validation.compare.pins import find_inertia, find_mass, state_from_pins
from fourbar_validation.compare.tolerance import EPS, Mask, magnitude
from fourbar_validation.engines.description import (
    FORCE_AT,
    FORCE_BETWEEN,
    name_driving,
)
from fourbar_validation.engines.free_body import (
    DRIVE_COLUMN,
    FORCE_COLUMNS,
    STEPS_FROM_NEARBY,
    balance,
    solve_couples,
    solve_unit_couples,
    solve_wrenches,
    stack_components,
)
from fourbar_validation.engines.free_body_closure import cross_products
from fourbar_validation.engines.free_body_effects import (
    BodyMotion,
    BodyWrenches,
    apply_effect,
    apply_load,
    find_arm,
    has_wrench,
    list_sliding_pins,
)

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
_CENTIMETRES = "m a and I alpha in kg cm/s^2 and kg cm^2/s^2, added to N and N cm"
_MILLIMETRES = "m a and I alpha in kg mm/s^2 and kg mm^2/s^2, added to N and N mm"
_D_ALEMBERT = "(d'Alembert's forces put on the side of m a)"
_INERTIAL = {
    f"{_CENTIMETRES}: 100 times": (1e2, 1e2),
    "m a in kg cm/s^2 added to N: 100 times too large": (1e2, 1.0),
    "I alpha in kg cm^2/s^2 added to N cm: 100 times too large": (1.0, 1e2),
    f"{_MILLIMETRES}: 1000 times": (1e3, 1e3),
    "m a in kg mm/s^2 added to N: 1000 times too large": (1e3, 1.0),
    f"inertial forces with the wrong sign {_D_ALEMBERT}": (-1.0, -1.0),
    "I alpha with the wrong sign": (1.0, -1.0),
}
"""Factors on m a and I alpha of every bar, by the mistake behind them."""
_EFFECT_NAMES = {
    "gravity": "gravity",
    "springs": "the springs",
    "torsion": "the torsion springs",
    "viscous": "the viscous damping",
    "friction": "the dry friction",
    "pin_friction": "the friction of the pin load",
    "flywheel": "the flywheel",
}
"""Names of the effects of the package, by their keys."""
DRY = ("friction", "pin_friction")
"""Keys of the effects of dry friction."""
_PART_FIELDS = {
    "springs": "springs",
    "torsion": "springs",
    "viscous": "coefficients",
    "friction": "torques",
    "pin_friction": "pins",
}
"""Field with the parts of an effect, by its key."""
_SCALED = {0.0: "missing", 2.0: "doubled", -1.0: "reversed"}
"""Factors on what acts besides inertia, and what was done to it."""
_IN_DEGREES = {
    np.degrees(1.0): "taken of degrees: 57.2958 times",
    np.radians(1.0): "taken per degree: 0.0174533 times",
}
"""Factors on what follows an angle or its rate, and what was done to it."""
_WHERE = {
    "": FORCE_NAMES,
    " in the pin forces alone": PIN_FORCES,
    " in what drives alone": tuple(set(FORCE_NAMES) - set(PIN_FORCES)),
}
"""Quantities in which that was done."""
_SPRING_NUMBERS = {
    "springs": ("preload", "free length"),
    "torsion": ("preload", "rest angle", "rest angle, its turn counted from 0,"),
}
"""Numbers that shift the force of a spring, by the effect's key."""
_SPRINGS = {"springs": "spring", "torsion": "torsion spring"}
"""Name of one spring, by the effect's key."""


class Change(NamedTuple):
    """What a mistake changes of what acts on the bars."""

    text: str
    wrenches: BodyWrenches
    """Forces and moments that act besides the right ones."""
    moved: Mapping[str, Array] = {}
    """Wrong motion from which they follow."""
    where: Mapping[str, Collection[str]] = {"": FORCE_NAMES}
    """Quantities in which it shows, by what is added to the text."""
    friction: Mapping[str, float] = {}
    """Factors on the friction of pins that is no right one."""


class Calculation:
    """The right numbers of a scene, and the free bodies that they balance."""

    def __init__(
        self,
        scene: Scene,
        right: Solution,
        wanted: Wanted = always,
    ) -> None:
        self.stated = scene
        self.wanted = wanted
        self.scene = state_from_pins(scene)
        self.right = right
        linkage = scene.linkage
        zero = np.zeros(len(right))
        ground = np.exp(1j * linkage.ground_angle)
        theta = {bar: getattr(right, f"theta_{bar}") for bar in MOVING_BARS}
        unit = {bar: np.exp(1j * angle) for bar, angle in theta.items()}
        O4 = zero + linkage.ground * ground
        first_pin = {1: 0j * zero, 2: 0j * zero, 3: join(right.A), 4: O4}
        omega, alpha = (
            {1: zero} | {bar: zero + getattr(right, f"{rate}_{bar}") for bar in theta}
            for rate in ("omega", "alpha")
        )
        self.motion = BodyMotion(
            linkage, theta[2], {1: zero + ground, **unit}, first_pin, omega, alpha
        )
        self.driving = name_driving(scene)
        fields = [one for one in scene.effects if isinstance(one, Gravity)]
        self.weighs = bool(fields)
        self.wheels = [one for one in scene.effects if isinstance(one, Flywheel)]
        self.weights = self.apply(*fields).force

    def none(self) -> BodyWrenches:
        """Return wrenches of nothing."""
        return BodyWrenches(len(self.right))

    def apply(self, *terms: Any) -> BodyWrenches:
        """Sum what loads and effects do; one that the free bodies do not know, no."""
        wrenches = self.none()
        for term in terms:
            if term.key == "load":
                apply_load(term, self.motion, wrenches)
            elif has_wrench(term):
                apply_effect(term, self.motion, wrenches)
        return wrenches

    def solve(self, changes: list[Change]) -> Iterator[Mistake]:
        """Solve the free bodies under each change, all at once."""
        changes = [change for change in changes if self._is_wanted(change)]
        if not changes:
            return
        more = [change.wrenches for change in changes]
        unknowns, _ = solve_wrenches(self.scene, self.motion, more)
        if list_sliding_pins(self.scene):
            unknowns = self._follow_friction(unknowns, changes)
        for i, change in enumerate(changes):
            numbers = self._read(unknowns[..., i])
            if change.moved:
                yield _state(change.text, {**change.moved, **numbers})
            for words, names in change.where.items():
                shown = {name: numbers[name] for name in names if name in numbers}
                yield _state(f"{change.text}{words}", shown)

    def _is_wanted(self, change: Change) -> bool:
        return any(
            map(self.wanted, [f"{change.text}{words}" for words in ("", *change.where)])
        )

    def _read(self, more: Array) -> MistakenNumbers:
        """Return forces, drive and power under unknowns that are added, (n, 13)."""
        right = self.right
        forces = {
            name: getattr(right, name) + more[:, column : column + 2]
            for name in PIN_FORCES
            for column in (FORCE_COLUMNS[name],)
        }
        effort = getattr(right, self.driving) + more[:, DRIVE_COLUMN]
        if self.scene.drive is None:
            speed = self.motion.omega[self.scene.drive_bar]
        else:
            speed = right.stroke_speed
        return {**forces, self.driving: effort, "power": effort * speed}

    def _follow_friction(self, unknowns: Array, changes: list[Change]) -> Array:
        """Add what the pins' friction changes with their load, (n, 13, k)."""
        pins = list_sliding_pins(self.scene)
        usual, loads, arms, _ = solve_unit_couples(self.scene, self.motion)
        n, _, k = unknowns.shape
        right = self._find_couples()
        factors = np.array(
            [[change.friction.get(pin, 1.0) for pin in pins] for change in changes]
        )
        first = [FORCE_COLUMNS[FORCE_AT[pin]] for pin in pins]
        more = unknowns[:, first] + 1j * unknowns[:, [column + 1 for column in first]]
        F = np.moveaxis(loads[..., :1] + more, 2, 0).reshape(k * n, -1)
        C = np.tile(loads[..., 1:], (k, 1, 1))
        k_of_rows = np.repeat(arms * factors, n, axis=0)
        start = np.tile(right, (k, 1))
        couples, _, _ = solve_couples(F, C, k_of_rows, start, STEPS_FROM_NEARBY)
        added = couples.reshape(k, n, -1) - right
        return np.asarray(unknowns + np.einsum("nup,knp->nuk", usual[..., 1:], added))

    def _find_couples(self) -> Array:
        """Return the friction couples that follow the pins' loads, (n, p), N m."""
        pins = list_sliding_pins(self.scene)
        couples = np.zeros((len(self.right), len(pins)))
        for i, (pin, arm) in enumerate(pins.items()):
            couples[:, i] = arm * magnitude(getattr(self.right, FORCE_AT[pin]))
        return couples

    def cut(self, pin: str) -> MistakenNumbers:
        """Return forces and torque of the tree that a cut at a pin leaves.

        No force is passed at the cut. The torque is that of the joint by which the
        driven bar hangs on the ground or on the bar before it in its chain; the joint
        carries the bar and all behind it.
        """
        F12, F32, F43, F14 = (join(getattr(self.right, name)) for name in PIN_FORCES)
        motion = self.motion
        needed = {2: F12 + F32, 3: F43 - F32, 4: F14 - F43}
        at_second = {2: F32, 3: F43, 4: -F43}
        moment = {
            bar: cross_products(
                motion.linkage.bar(bar).length * motion.unit[bar], at_second[bar]
            )
            for bar in MOVING_BARS
        }
        drive_bar = self.scene.drive_bar
        moment[drive_bar] = moment[drive_bar] + self.right.torque
        none = 0.0 * F12
        if pin == "A":
            F32, F43 = none, needed[3]
        elif pin == "B":
            F32, F43 = -needed[3], none
        else:
            F32, F43 = -needed[3] - needed[4], -needed[4]
        chain = next(chain for chain in _CHAINS[pin] if drive_bar in chain)
        joint = motion.first_pin[drive_bar]
        if (pin, drive_bar) in (("A", 3), ("O4", 4)):
            joint = join(self.right.B)
        torque = np.zeros(len(joint))
        for bar in chain[chain.index(drive_bar) :]:
            arm = motion.first_pin[bar] - joint
            torque = torque + moment[bar] + cross_products(arm, needed[bar])
        F12 = needed[2] - F32
        F14 = needed[4] + F43
        forces = zip(PIN_FORCES, (F12, F32, F43, F14), strict=True)
        vectors = {name: stack_components(force) for name, force in forces}
        return {**vectors, "torque": torque}

    def mistakes(self) -> Iterator[Mistake]:
        """List the mistakes that this calculation can have, the simplest first."""
        if self.scene.drive is None:
            yield from self._open_tree()
        yield from self._frames()
        yield from self._equal_forces()
        changes = [
            *self._scale_inertial(),
            *self._scale_actions(),
            *self._velocity_terms(),
            *self._accelerations_of_centres(),
            *self._change_bars(),
            *self._change_loads(),
        ]
        yield from self.solve(changes)
        if self.scene.drive is None and all(map(has_wrench, self.scene.effects)):
            yield from self._drive_other_bars()

    def _open_tree(self) -> Iterator[Mistake]:
        trees = {pin: self.cut(pin) for pin in _CHAINS}
        how = "the loop force is 0, as from mj_inverse or rnea of a loop"
        for pin, values in trees.items():
            text = f"forces and torque of the open tree, cut at {pin}: {how}"
            yield _state(text, values, left=SOFT_TORQUE)
        for pin, values in trees.items():
            text = f"torque of the open tree, cut at {pin}: {how}"
            torque = {"torque": values["torque"]}
            yield _state(text, torque, whole=False, left=SOFT_TORQUE)

    def _frames(self) -> Iterator[Mistake]:
        ways = {
            "each force is in the frame of the bar on which it acts": 1,
            "each force is in the frame of the bar that exerts it": 0,
        }
        for text, side in ways.items():
            frames = {name: bars[side] for name, bars in FORCE_BETWEEN.items()}
            yield _state(f"{text}, not in world axes", self._turn(frames))
        for bar in (1, *MOVING_BARS):
            text = f"forces are in the frame of bar {bar}, not in world axes"
            yield _state(text, self._turn(dict.fromkeys(FORCE_BETWEEN, bar)))
        for name in FORCE_BETWEEN:
            for bar in (1, *MOVING_BARS):
                text = f"{name} is in the frame of bar {bar}, not in world axes"
                yield _state(text, self._turn({name: bar}), whole=False)

    def _turn(self, frames: dict[str, int]) -> MistakenNumbers:
        return {
            name: stack_components(
                join(getattr(self.right, name)) * np.conj(self.motion.unit[bar])
            )
            for name, bar in frames.items()
        }

    def _equal_forces(self) -> Iterator[Mistake]:
        text = f"the power is given in place of the {self.driving}"
        yield _state(text, {self.driving: self.right.power}, whole=False)
        for name in PIN_FORCES:
            for other in PIN_FORCES:
                if other == name:
                    continue
                values = getattr(self.right, other)
                yield _state(f"{name} = {other}", {name: values}, whole=False)
                yield _state(f"{name} = -{other}", {name: -values}, whole=False)

    def _scale_inertial(self) -> Iterator[Change]:
        """Scale the inertial forces against the loads."""
        every = self.none()
        turning = self.none()
        for bar in MOVING_BARS:
            self._accelerate(every, bar, join(getattr(self.right, f"a_G{bar}")))
            alpha = self.motion.alpha[bar]
            turning.couple(bar, -find_inertia(self.motion.linkage.bar(bar)) * alpha)
        for text, (by_mass, by_inertia) in _INERTIAL.items():
            more = (
                self.none().plus(every, by_mass - 1.0).plus(turning, by_inertia - 1.0)
            )
            yield Change(text, more)

    def _accelerate(
        self,
        wrenches: BodyWrenches,
        bar: int,
        a: ComplexArray,
        alpha: Array | float = 0.0,
    ) -> MistakenNumbers:
        """Add d'Alembert's forces of an added acceleration of a bar; return its a_G."""
        body = self.motion.linkage.bar(bar)
        wrenches.push(bar, -find_mass(body) * a, self.motion.to_centre(bar))
        wrenches.couple(bar, -find_inertia(body) * alpha)
        a_G = getattr(self.right, f"a_G{bar}")
        return {f"a_G{bar}": a_G + stack_components(a)}

    def _scale_actions(self) -> Iterator[Change]:
        """Leave out, double or reverse each load and effect, and each part of one."""
        for name, acting, pins in self._list_acting():
            for factor, done in _SCALED.items():
                yield self._scale(
                    name,
                    done,
                    acting,
                    factor,
                    where=_WHERE,
                    friction=dict.fromkeys(pins, factor),
                )
        for factor, done in _SCALED.items():
            for name, more in self._list_numbers(factor):
                yield Change(f"{name} is {done}", more, where=_WHERE)
        for effect in self.scene.effects:
            yield from self._change_effect(effect)
        every = (*self.scene.loads, *self.scene.effects)
        if self.scene.effects and len(every) > 1:
            less = self.none().plus(self.apply(*every), -1.0)
            dry = dict.fromkeys(list_sliding_pins(self.scene), 0.0)
            text = "all loads and effects are missing: inertia alone"
            yield Change(text, less, friction=dry)
        if not self.weighs:
            text = "gravity along -y is included though the scene has none"
            yield Change(text, self.apply(Gravity()))

    def _scale(
        self, name: str, done: str, acting: BodyWrenches, factor: float, **more: Any
    ) -> Change:
        """Return the change that gives a factor to what acts."""
        text = f"{name} {'are' if _is_plural(name) else 'is'} {done}"
        return Change(text, self.none().plus(acting, factor - 1.0), **more)

    def _change_effect(self, effect: Any) -> Iterator[Change]:
        """State an effect otherwise, or let it act on one of two bars alone."""
        name = _name_effect(effect)
        for text, other in _list_other_forms(effect, self.scene.linkage.ground_angle):
            more = self.apply(other).plus(self.apply(effect), -1.0)
            yield Change(f"{name} {text}", more)
        parts = _split_effect(effect)
        if effect.key in ("viscous", "torsion"):
            linear_parts = parts
            if effect.key == "torsion":
                linear_parts = [_change_number(part, "preload", 0.0) for part in parts]
            linear = self.apply(*linear_parts)
            for factor, done in _IN_DEGREES.items():
                yield self._scale(name, done, linear, factor)
        if effect.key == "viscous":
            more = self.none()
            for pin, k in effect.coefficients:
                more.twist_at(pin, -k * self.motion.omega[PINS[pin][0]])
            how = "is of the second bar's own speed"
            yield Change(f"{name} {how}", more)
        verb = "act" if _is_plural(name) else "acts"
        if all(1 in _list_bars(part) for part in parts):
            return  # on the ground nothing is missed
        for left_out, words in enumerate(("second", "first")):
            less = self.none()
            for part in parts:
                bar = _list_bars(part)[left_out]
                if bar in MOVING_BARS:
                    less = less.plus(self.apply(part).on(bar), -1.0)
            yield Change(f"{name} {verb} on the {words} of two bars alone", less)

    def _list_acting(self) -> Iterator[tuple[str, BodyWrenches, list[str]]]:
        """List what acts besides inertia, with pins whose friction depends on loads."""
        scene = self.scene
        if scene.loads:
            yield "the loads", self.apply(*scene.loads), []
        for number, load in enumerate(scene.loads, 1):
            name = f"load {number} (bar {load.bar})"
            acting = self.apply(load)
            yield name, acting, []
            if load.force is not None and load.moment:
                force = self.apply(replace(load, moment=0.0))
                yield f"the force of {name}", force, []
                yield f"the couple of {name}", acting.plus(force, -1.0), []
        forces = [replace(one, moment=0.0) for one in scene.loads if one.force]
        if len(forces) > 1 and forces != list(scene.loads):
            yield "the forces of the loads", self.apply(*forces), []
        dry = [effect for effect in scene.effects if effect.key in DRY]
        if len(dry) > 1:
            yield "all dry friction", self.apply(*dry), list(list_sliding_pins(scene))
        for effect in scene.effects:
            name = _name_effect(effect)
            acting = self.apply(effect)
            yield name, acting, list(effect.loaded_pins)
            parts = _split_effect(effect)
            if len(parts) > 1:
                for number, part in enumerate(parts, 1):
                    pins = list(part.loaded_pins)
                    yield f"part {number} of {name}", self.apply(part), pins

    def _list_numbers(self, factor: float) -> Iterator[tuple[str, BodyWrenches]]:
        """List what acts besides where a number of springs has a factor."""
        for effect in self.scene.effects:
            springs = _SPRINGS.get(effect.key)
            if springs is None:
                continue
            every: dict[str, BodyWrenches] = {}
            parts = _split_effect(effect)
            for i, part in enumerate(parts, 1):
                for number, more in self._change_spring(part, factor):
                    yield f"the {number} of {springs} {i}", more
                    every[number] = every.get(number, self.none()).plus(more)
            if len(parts) > 1:
                for number, more in every.items():
                    yield f"the {number} of every {springs}", more

    def _change_spring(
        self, effect: Any, factor: float
    ) -> Iterator[tuple[str, BodyWrenches]]:
        """List each number of one spring with what its factor lets act besides."""
        right = self.apply(effect)
        for number in _SPRING_NUMBERS[effect.key]:
            changed = _change_number(effect, number, factor)
            if changed != effect:
                yield number, self.apply(changed).plus(right, -1.0)
        relaxed = _change_number(effect, "preload", 0.0)
        if relaxed != effect:  # else the stiffness scales the whole force
            yield "stiffness", self.none().plus(self.apply(relaxed), factor - 1.0)

    def _velocity_terms(self) -> Iterator[Change]:
        """Leave out (dJ/dt) v, or reverse it, in the accelerations of the other bars.

        Without it these follow that of the commanded bar alone, by the ratios of the
        speeds: a omega_2 u_2 + b omega_3 u_3 = c omega_4 u_4 fixes them at rest too.
        """
        motion = self.motion
        right = self.right
        _, a, b, c = motion.linkage.lengths
        u = motion.unit
        speeds = {
            2: cross_products(u[3], u[4]) / a,
            3: cross_products(u[4], u[2]) / b,
            4: -cross_products(u[2], u[3]) / c,
        }
        bar = right.at.bar
        with np.errstate(divide="ignore", invalid="ignore"):
            alone = {k: motion.alpha[bar] * speeds[k] / speeds[bar] for k in speeds}
        for factor, done in _VELOCITY_TERM.items():
            added = {k: factor * (motion.alpha[k] - alone[k]) for k in speeds}
            added[bar] = np.zeros(len(right))
            of_A = 1j * added[2] * a * u[2]
            of_B = 1j * added[4] * c * u[4]
            moved: MistakenNumbers = {
                **{f"alpha_{k}": motion.alpha[k] + added[k] for k in speeds},
                "a_A": right.a_A + stack_components(of_A),
                "a_B": right.a_B + stack_components(of_B),
            }
            wrenches = self.none()
            for k, more in added.items():
                of_pin = of_A if k == 3 else 0.0
                swing = of_pin + 1j * more * motion.to_centre(k)
                moved |= self._accelerate(wrenches, k, swing, more)
                for wheel in self.wheels:
                    if wheel.bar == k:
                        wrenches.couple(k, -wheel.inertia * more)
            text = f"(dJ/dt) v {done} in the accelerations of the loop"
            yield Change(text, wrenches, moved, _FOLLOWING)

    def _accelerations_of_centres(self) -> Iterator[Change]:
        """Leave out a part of the acceleration of each G about its bar's first pin."""
        motion = self.motion
        arms = {bar: motion.to_centre(bar) for bar in MOVING_BARS}
        centripetal = {bar: -(motion.omega[bar] ** 2) * arms[bar] for bar in arms}
        tangential = {bar: 1j * motion.alpha[bar] * arms[bar] for bar in arms}
        whose: dict[str, tuple[int, ...]] = {"every bar": MOVING_BARS}
        whose |= {f"bar {bar}": (bar,) for bar in MOVING_BARS}
        for part, of_bars in (("-omega^2 r", centripetal), ("alpha x r", tangential)):
            for factor, done in _PART_OF_ACCELERATION.items():
                for name, bars in whose.items():
                    wrenches = self.none()
                    moved = MistakenNumbers()
                    for bar in bars:
                        a = factor * of_bars[bar]
                        moved |= self._accelerate(wrenches, bar, a)
                    text = f"{part} {done} in a_G of {name}, r from its first pin to G"
                    yield Change(text, wrenches, moved, _FOLLOWING)
        for bar in MOVING_BARS:
            wrenches = self.none()
            a = -centripetal[bar] - tangential[bar]
            moved = self._accelerate(wrenches, bar, a)
            text = f"the acceleration of bar {bar}'s first pin is used as its a_G"
            yield Change(text, wrenches, moved, _FOLLOWING)

    def _change_bars(self) -> Iterator[Change]:
        """Give each bar, and every bar, another mass or moment of inertia."""
        if self.weighs:
            for bar in MOVING_BARS:
                less = self.none()
                less.push(bar, -self.weights[bar], self.motion.to_centre(bar))
                yield Change(f"the weight of bar {bar} is missing", less)
        for name, text, wrenches in self._list_bar_mistakes():
            yield Change(f"{name}: {text}", wrenches)

    def list_factors(self) -> Iterator[tuple[str, BodyWrenches]]:
        """List what may have a factor, with what it lets act on the bars."""
        for name, text, less in self._list_bar_mistakes():
            if text.endswith(_LEFT_OUT):
                what = text.removesuffix(_LEFT_OUT)
                yield f"{name}: {what}", self.none().plus(less, -1.0)
        for name, wrenches, _ in self._list_acting():
            yield name, wrenches
        for name, less in self._list_numbers(0.0):
            yield name, self.none().plus(less, -1.0)

    def _list_bar_mistakes(self) -> Iterator[tuple[str, str, BodyWrenches]]:
        """List mistakes in mass and inertia of each bar, then of every bar."""
        every: dict[str, BodyWrenches] = {}
        for bar in MOVING_BARS:
            for text, wrenches in self._list_mistakes_of(bar):
                every[text] = every.get(text, self.none()).plus(wrenches)
                yield BAR_NAMES[bar], text, wrenches
        for text, wrenches in every.items():
            yield "every bar", text, wrenches

    def _list_mistakes_of(self, bar: int) -> Iterator[tuple[str, BodyWrenches]]:
        """List mistakes in mass and inertia of a bar, with what they let act."""
        body = self.motion.linkage.bar(bar)
        mass, inertia = find_mass(body), find_inertia(body)
        alpha = self.motion.alpha[bar]
        to_centre = self.motion.to_centre(bar)
        about_pin, massless, pointlike = (self.none() for _ in range(3))
        about_pin.couple(bar, -mass * np.abs(to_centre) ** 2 * alpha)
        massless.push(bar, mass * join(getattr(self.right, f"a_G{bar}")), to_centre)
        massless.push(bar, -self.weights[bar], to_centre)
        pointlike.couple(bar, inertia * alpha)
        if mass:
            yield "inertia about the pin used as the inertia about G", about_pin
            text = "inertia about G used as the inertia about the pin"
            yield text, self.none().plus(about_pin, -1.0)
            yield f"mass{_LEFT_OUT}", massless
        if inertia:
            yield f"moment of inertia{_LEFT_OUT}", pointlike
            if mass:
                both = massless.plus(pointlike)
                yield f"mass and moment of inertia{_LEFT_OUT}", both

    def _change_loads(self) -> Iterator[Change]:
        """Let each load, and every load, act elsewhere or in another direction."""
        every: dict[str, BodyWrenches] = {}
        loads = zip(self.stated.loads, self.scene.loads, strict=True)
        for number, (stated, load) in enumerate(loads, 1):
            for text, more in self._list_load_mistakes(stated, load):
                yield Change(f"load {number} (bar {load.bar}): {text}", more)
                every[text] = every.get(text, self.none()).plus(more)
        if len(self.scene.loads) > 1:
            for text, more in every.items():
                yield Change(f"every load: {text}", more)

    def _list_load_mistakes(
        self, stated: Load, load: Load
    ) -> Iterator[tuple[str, BodyWrenches]]:
        """List what else may be made of a load, with what it lets act more."""
        right = self.apply(load)
        others = {}
        if load.table is not None:
            others["its table is left out"] = replace(load, table=None)
        if load.force is not None and load.frame == "bar":
            size, angle = load.force
            text = "the angle of its force has the wrong sign"
            others[text] = replace(load, force=(size, -angle))
        for text, other in others.items():
            yield text, self.apply(other).plus(right, -1.0)
        if load.force is None:
            return
        bar = load.bar
        what = "its place" if load.arm is None else "its arm"
        force = right.force[bar]
        arm = find_arm(load, self.motion)
        to_centre = self.motion.to_centre(bar)
        unit = self.motion.unit[bar]
        moved = {
            "its force acts at G of the bar": to_centre - arm,
            "its force acts at the first pin of the bar": -arm,
            "its force acts at the second pin of the bar": (
                self.motion.linkage.bar(bar).length * unit - arm
            ),
        }
        if stated.from_pin is None:
            from_pin = f"{what} is measured from the bar's first pin, not from G"
            moved[from_pin] = -to_centre
        if load.arm is None:  # an engine is told every place from the first pin
            from_G = f"{what} is measured from G, not from the bar's first pin"
            moved[from_G] = to_centre
        else:
            moved["its arm turns with the bar"] = (arm - to_centre) * (unit - 1.0)
        for text, shift in moved.items():
            couple = self.none()
            couple.couple(bar, cross_products(shift, force))
            yield text, couple
        directions = {"its force has y reversed": np.conj(force)}
        if load.frame == "bar":
            directions["its direction is kept"] = force * np.conj(unit)
        else:
            directions["its direction turns with the bar"] = force * unit
        for text, pushed in directions.items():
            turned = self.none()
            turned.push(bar, pushed - force, arm)
            yield text, turned

    def _drive_other_bars(self) -> Iterator[Mistake]:
        for bar in MOVING_BARS:
            where = f"on bar {bar} instead of bar {self.scene.drive_bar}"
            text = f"the torque acts {where}"
            if bar != self.scene.drive_bar and self.wanted(text):
                scene = replace(self.scene, drive_bar=bar)
                unknowns = balance(scene, self.motion, self._find_couples())[0]
                numbers = {"torque": unknowns[:, DRIVE_COLUMN]}
                for name in PIN_FORCES:
                    column = FORCE_COLUMNS[name]
                    numbers[name] = unknowns[:, column : column + 2]
                yield _state(text, numbers)


_LEFT_OUT = " left out"
_FOLLOWING = {", from which the forces follow": FORCE_NAMES}
_PART_OF_ACCELERATION = {
    -1.0: "is missing",
    -2.0: "has the wrong sign",
    1.0: "is doubled",
}
"""What is added of a part of an acceleration, and what was done to it."""
_VELOCITY_TERM = {-1.0: "is missing", -2.0: "has the wrong sign"}
"""The same of the part of the others' accelerations that the speeds make."""


def join(vectors: Array) -> ComplexArray:
    """Return vectors (n, 2) as complex numbers x + i y, (n,)."""
    return np.asarray(vectors[:, 0] + 1j * vectors[:, 1])


def _name_effect(effect: Any) -> str:
    return _EFFECT_NAMES.get(effect.key, f"effect {effect.key}")


def _is_plural(name: str) -> bool:
    return name.startswith("the ") and name.endswith("s")


def _list_bars(part: Any) -> tuple[int, int]:
    """Return the two bars on which an effect of one part acts."""
    (one,) = getattr(part, _PART_FIELDS[part.key])
    if part.key == "springs":
        return one.start.bar, one.end.bar
    return PINS[one[0]]


def _split_effect(effect: Any) -> list[Any]:
    """List the effects of one part each that an effect consists of."""
    field = _PART_FIELDS.get(effect.key, "")
    parts = getattr(effect, field, ())
    return [replace(effect, **{field: (part,)}) for part in parts]


def _change_number(effect: Any, number: str, factor: float) -> Any:
    """Return an effect of one spring with a factor on one of its numbers.

    A rest angle that is left out turns as more preload does. A length has no sign.
    """
    (spring,) = effect.springs
    if effect.key == "torsion":
        pin, k, rest, preload = spring
        ways = {
            "preload": (rest, factor * preload),
            "rest angle": (rest, preload + (1.0 - factor) * k * rest),
        }
        changed = (pin, k, *ways.get(number, (factor * rest, preload)))
        return replace(effect, springs=(changed,))
    changes = {"preload": factor * spring.preload}
    if number == "free length":
        changes = {"length": abs(factor) * spring.length, "stroke": None}
    try:
        changed = replace(spring, **changes)
    except FourBarError:  # it pulls at every length
        changed = replace(spring, **changes, acts=None)
        if spring.acts == "push":
            changed = replace(changed, stiffness=0.0, preload=0.0)
    return replace(effect, springs=(changed,))


def _list_other_forms(effect: Any, ground_angle: float) -> Iterator[tuple[str, Any]]:
    """List effects that may be taken for one, by what was done to it."""
    if isinstance(effect, Gravity):
        angles = {
            "turned by 90 deg": effect.angle + np.pi / 2.0,
            "turned by -90 deg": effect.angle - np.pi / 2.0,
            "taken along -y": -np.pi / 2.0,
            "turned with the ground": effect.angle + ground_angle,
        }
        for text, angle in angles.items():
            yield f"is {text}", replace(effect, angle=float(angle))
    elif isinstance(effect, Flywheel):
        other = {2: 4, 4: 2}[effect.bar]
        yield f"is on bar {other}", replace(effect, bar=other)
    elif effect.key == "springs" and any(spring.acts for spring in effect.springs):
        both = tuple(replace(spring, acts=None) for spring in effect.springs)
        yield "act both ways", replace(effect, springs=both)


def find_miscalculated(judge: Judge, wanted: Wanted) -> Iterator[Mistake]:
    """List the mistakes of a calculation, or of a simulation, that a table can show."""
    if judge.stage == "force":
        yield from Calculation(judge.scene, judge.right, wanted).mistakes()
        yield from _find_impulses(judge)
        yield from _find_stale(judge)
    yield from _find_late(judge)
    yield from _find_other_branch(judge)


def find_single_precision(judge: Judge) -> Iterator[Mistake]:
    """Yield the mistake of too short numbers if errors are such as these leave.

    Each number is one of single precision, or ours but for the rounding to one. No
    error is beyond what round-off of that size allows, most are larger than those of a
    file that is rounded elsewhere, and those of neighbours have nothing in common.
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
        if not np.all(_is_single(judge, key)[mask] | np.isnan(theirs[mask])):
            return
        common.append(np.nansum(apart[1:] * apart[:-1]) / np.nansum(apart**2))
    typical = np.median(np.concatenate(errors))
    if typical >= LEAST_OF_SINGLE and np.nanmedian(common) < MOST_IN_COMMON:
        text = "numbers have some 7 digits, as those of single precision"
        yield _state(text, judge.table.values)


def _is_single(judge: Judge, key: str) -> Mask:
    """Mark the numbers that single precision holds, or that are off by its rounding."""
    theirs = judge.table.values[key]
    factor = judge.table.units[key].factor
    rounding = judge.table.rounding[key].reshape(-1, *[1] * (theirs.ndim - 1))
    printed = theirs / factor
    held = np.abs(np.float32(printed) - printed) - EPS * np.abs(printed)
    off = np.abs(theirs - judge.ours(key)) - 0.5 * EPS_SINGLE * np.abs(theirs)
    return np.asarray((held * factor <= rounding) | (off <= rounding))


def _state(
    text: str,
    values: MistakenNumbers,
    **more: Any,
) -> Mistake:
    """Return the mistake that leads to these numbers; `more`: fields of `Mistake`."""
    return Mistake(text, lambda quantity, right: values.get(quantity), **more)


def _find_impulses(judge: Judge) -> Iterator[Mistake]:
    """Fit one time by which all forces and the torque are multiplied."""
    keys = [key for key in judge.table.values if name_quantity(key) in FORCE_NAMES]
    if len(keys) < ENOUGH_POSITIONS:
        return
    ours, theirs = (
        np.concatenate([numbers(key)[judge.where(key)].ravel() for key in keys])
        for numbers in (judge.ours, judge.table.values.__getitem__)
    )
    stated = np.isfinite(theirs)
    squares = float(ours[stated] @ ours[stated])
    if np.count_nonzero(stated) < ENOUGH_POSITIONS or not squares:
        return
    time = float(ours[stated] @ theirs[stated]) / squares
    if 0.0 < time < 1.0:
        forces = ((name, getattr(judge.right, name)) for name in FORCE_NAMES)
        impulses = {name: time * force for name, force in forces if force is not None}
        how = f"every force and the torque times {time:.4g} s"
        yield _state(f"impulses in place of forces: {how}", impulses, times=2.0)


def _find_late(judge: Judge) -> Iterator[Mistake]:
    """Give each position the numbers of the one before, or of the one after."""
    n = len(judge.at.angle)
    if n < ENOUGH_POSITIONS + 1:
        return
    of_forces: Callable[[str], bool] = (*FORCE_NAMES, *PIN_FORCES).__contains__
    for text, step in _LATE.items():
        rows = np.clip(np.arange(n) - step, 0, n - 1)
        edge = 0 if step == 1 else n - 1
        moved = {}
        for key in judge.table.values:
            quantity = name_quantity(key)
            if quantity != judge.right.commanded:
                moved[quantity] = _take_edge(judge, quantity, rows, edge)
        forces = {name: values for name, values in moved.items() if of_forces(name)}
        yield _state(text, moved)
        yield _state(f"{text} (forces alone)", forces)
        yield _state(text, moved, whole=False)


def _take_edge(
    judge: Judge,
    quantity: str,
    rows: NDArray[np.intp],
    edge: int,
) -> Array:
    """Return the numbers of other rows, and at the edge theirs: it may be anything."""
    moved = np.array(judge.ours(quantity)[rows])
    theirs = judge.table.values.get(quantity)
    if theirs is not None and theirs.shape == moved.shape:
        moved[edge] = theirs[edge]
    return moved


def _find_stale(judge: Judge) -> Iterator[Mistake]:
    """Balance each position with the force at B of the one before."""
    scene = judge.scene
    if scene.drive is not None or len(judge.at.angle) <= ENOUGH_POSITIONS:
        return
    right = judge.right
    stale = join(np.roll(right.F43, 1, axis=0) - right.F43)
    linkage = scene.linkage
    unit = np.exp(1j * getattr(right, f"theta_{scene.drive_bar}"))
    arm = linkage.bar(scene.drive_bar).length * unit
    sense = 1.0 if scene.drive_bar == 4 else -1.0
    numbers = {"torque": right.torque + sense * cross_products(arm, stale)}
    for name in PIN_FORCES:
        less = -1.0 if name == "F12" else 1.0
        numbers[name] = getattr(right, name) + less * stack_components(stale)
    for name, values in numbers.items():
        theirs = judge.table.values.get(name)
        if theirs is not None:
            values[0] = theirs[0]
    text = "the force at B is that of the position before: a constraint one step old"
    yield _state(text, numbers)


def _find_other_branch(judge: Judge) -> Iterator[Mistake]:
    """Yield the mistake of the other branch from where the numbers change."""
    keys = ("theta_3", "theta_4", *judge.table.values)
    key = next(filter(judge.table.values.__contains__, keys))
    error, allowed, _ = judge.judged_right(key)
    if not (error > allowed).any():
        return
    try:
        other = solve(
            judge.scene,
            judge.stage,
            at=judge.at._replace(branch=-judge.at.branch),
        )
    except FourBarError:
        return
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
        mask = later[:, None] if quantity in VECTORS else later
        return np.asarray(np.where(mask, theirs, ours))

    place = f"{judge.at.commanded} = {here:.4g} deg"
    yield Mistake(f"the other branch from {place} on", predict)
