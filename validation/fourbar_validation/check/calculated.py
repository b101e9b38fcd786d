"""Mistakes in a calculation of forces, as hypotheses: what its free bodies would give.

A mistake lets act on bars 2, 3 and 4 what does not, or leaves out what does. Pins and
drive follow from this change by the equations of the free bodies, which are solved for
all changes at once.
"""

from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import replace
from itertools import permutations
from typing import Any, NamedTuple

import numpy as np

from fourbar.effects import Flywheel, Friction, Gravity, Load, Viscous
from fourbar.errors import FourBarError
from fourbar.linkage import BAR_NAMES, MOVING_BARS, PINS
from fourbar.quantities import FORCE_NAMES, PIN_FORCES, Array, ComplexArray
from fourbar.scene import Scene
from fourbar.solution import Solution
from fourbar.solving import solve
from fourbar_validation.check.csv_columns import compute_column
from fourbar_validation.check.judge_table import Judge, JudgedColumn
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
    speeds_and_accelerations,
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
MISSING = {
    f"{name} at {pin} [{unit}]:": (effect, pin)
    for name, unit, effect in (
        ("viscous damping", "N m s/rad", Viscous),
        ("dry friction", "N m", Friction),
    )
    for pin in PINS
}
"""What a scene may leave out at a pin, by name."""
_SPRINGS = {"springs": "spring", "torsion": "torsion spring"}
"""Name of one spring, by the effect's key."""


class Change(NamedTuple):
    """What a mistake changes of the unknowns of the free bodies."""

    text: str
    more: Array
    """What is added to the right unknowns, (n, 13)."""
    moved: Mapping[str, Array] = {}
    """Wrong motion from which they follow."""
    where: Mapping[str, Collection[str]] = {"": FORCE_NAMES}
    """Quantities in which it shows, by what is added to the text."""
    friction: Mapping[str, float] = {}
    """Factors on the friction of pins that is no right one."""


class Calculation:
    """The right numbers of a scene, and the free bodies that they balance.

    The free bodies are linear in what acts on them: what a wrench adds to the unknowns,
    (n, 13), is scaled and summed as the wrench is.
    """

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
        theta = {bar: right[f"theta_{bar}"] for bar in MOVING_BARS}
        theta[1] = zero + linkage.ground_angle
        unit = {bar: np.exp(1j * angle) for bar, angle in theta.items()}
        O4 = linkage.ground * unit[1]
        first_pin = {1: 0j * zero, 2: 0j * zero, 3: join(right.A), 4: O4}
        omega, alpha = (
            {1: zero} | {bar: right[f"{rate}_{bar}"] for bar in MOVING_BARS}
            for rate in ("omega", "alpha")
        )
        self.motion = BodyMotion(linkage, theta[2], unit, first_pin, omega, alpha)
        self.driving = name_driving(scene)
        self.gravity = [one for one in scene.effects if isinstance(one, Gravity)]
        units = []
        for bar in MOVING_BARS:
            for force, couple in ((1.0, 0.0), (1.0j, 0.0), (0.0, 1.0)):
                one = BodyWrenches(len(right))
                one.push(bar, force, 0.0)
                one.couple(bar, couple)
                units.append(one)
        self.response, _ = solve_wrenches(self.scene, self.motion, units)
        self.of_bar = {bar: self.motion.linkage.bar(bar) for bar in MOVING_BARS}
        self.to_centre = {bar: self.motion.to_centre(bar) for bar in MOVING_BARS}
        self.a_G = {bar: join(right[f"a_G{bar}"]) for bar in MOVING_BARS}

    def respond(
        self, wrenches: BodyWrenches, bars: Collection[int] = MOVING_BARS
    ) -> Array:
        """Return what the wrenches on some bars add to the unknowns, (n, 13)."""
        components = np.zeros((9, len(self.right)))
        for bar in bars:
            force = wrenches.force[bar]
            rows = slice(3 * bar - 6, 3 * bar - 3)
            components[rows] = force.real, force.imag, wrenches.moment[bar]
        return np.asarray(np.einsum("nuk,kn->nu", self.response, components))

    def push(self, bar: int, force: Any, arm: Any = 0.0, couple: Any = 0.0) -> Array:
        """Return what a force at an arm from a bar's first pin, and a couple, add."""
        wrenches = BodyWrenches(len(self.right))
        wrenches.push(bar, force, arm)
        wrenches.couple(bar, couple)
        return self.respond(wrenches, [bar])

    def accelerate(
        self, a: Mapping[int, ComplexArray], alpha: Mapping[int, Array] = {}
    ) -> Array:
        """Return what d'Alembert's forces of added accelerations of bars add."""
        wrenches = BodyWrenches(len(self.right))
        for bar, body in self.of_bar.items():
            force = -find_mass(body) * a.get(bar, 0.0)
            wrenches.push(bar, force, self.to_centre[bar])
            wrenches.couple(bar, -find_inertia(body) * alpha.get(bar, 0.0))
        return self.respond(wrenches)

    def apply(self, *terms: Any, bars: Collection[int] = MOVING_BARS) -> Array:
        """Sum what loads and effects do; one that the free bodies do not know, no."""
        wrenches = BodyWrenches(len(self.right))
        for term in terms:
            if term.key == "load":
                apply_load(term, self.motion, wrenches)
            elif has_wrench(term):
                apply_effect(term, self.motion, wrenches)
        return self.respond(wrenches, bars)

    def solve(self, changes: list[Change]) -> Iterator[Mistake]:
        """Yield the numbers that each change leads to."""
        wanted = [
            change
            for change in changes
            if any(self.wanted(change.text + words) for words in ("", *change.where))
        ]
        if not wanted:
            return
        unknowns = np.stack([change.more for change in wanted], axis=-1)
        if list_sliding_pins(self.scene):
            unknowns = self._follow_friction(unknowns, wanted)
        for i, change in enumerate(wanted):
            numbers = self._read(unknowns[..., i])
            if change.moved:
                yield Mistake(change.text, {**change.moved, **numbers}.get)
            for words, names in change.where.items():
                shown = {name: numbers[name] for name in names if name in numbers}
                yield Mistake(f"{change.text}{words}", shown.get)

    def _read(self, more: Array) -> MistakenNumbers:
        """Return forces, drive and power under unknowns that are added, (n, 13)."""
        numbers = {
            name: self.right[name] + more[:, FORCE_COLUMNS[name] :][:, :2]
            for name in PIN_FORCES
        }
        effort = self.right[self.driving] + more[:, DRIVE_COLUMN]
        speed = self.right.stroke_speed
        if self.scene.drive is None:
            speed = self.motion.omega[self.scene.drive_bar]
        return {**numbers, self.driving: effort, "power": effort * speed}

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
        pins = list_sliding_pins(self.scene).items()
        of_pins = [arm * magnitude(self.right[FORCE_AT[pin]]) for pin, arm in pins]
        return np.reshape(of_pins, (len(pins), len(self.right))).T

    def shift_loop_force(self, more: ComplexArray) -> MistakenNumbers:
        """Return the pin forces under another force on bar 3 at B.

        The sum of the forces on each bar stays.
        """
        signs = {"F12": -1.0, "F32": 1.0, "F43": 1.0, "F14": 1.0}
        return {
            name: self.right[name] + sign * stack_components(more)
            for name, sign in signs.items()
        }

    def cut(self, pin: str) -> MistakenNumbers:
        """Return forces and torque of the tree that a cut at a pin leaves.

        No force is passed at the cut. The torque is that of the joint by which the
        driven bar hangs on the ground or on the bar before it in its chain; the joint
        carries the bar and all behind it.
        """
        F12, F32, F43, F14 = (join(self.right[name]) for name in PIN_FORCES)
        motion = self.motion
        sums = {2: F12 + F32, 3: F43 - F32, 4: F14 - F43}
        at_second = {2: F32, 3: F43, 4: -F43}
        drive_bar = self.scene.drive_bar
        joint = motion.first_pin[drive_bar]
        if (pin, drive_bar) in (("A", 3), ("O4", 4)):
            joint = join(self.right.B)
        torque = self.right.torque
        chain = next(chain for chain in _CHAINS[pin] if drive_bar in chain)
        for bar in chain[chain.index(drive_bar) :]:
            tip = self.of_bar[bar].length * motion.unit[bar]
            arm = motion.first_pin[bar] - joint
            torque = torque + cross_products(tip, at_second[bar])
            torque = torque + cross_products(arm, sums[bar])
        passed = {"A": F32, "B": F43, "O4": F14}[pin]
        return {**self.shift_loop_force(-passed), "torque": torque}

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
            yield Mistake(text, values.get, left=SOFT_TORQUE)
        for pin, values in trees.items():
            text = f"torque of the open tree, cut at {pin}: {how}"
            torque = {"torque": values["torque"]}
            yield Mistake(text, torque.get, whole=False, left=SOFT_TORQUE)

    def _frames(self) -> Iterator[Mistake]:
        frames = {
            f"each force is in the frame of the bar {words}": {
                name: bars[side] for name, bars in FORCE_BETWEEN.items()
            }
            for words, side in (("on which it acts", 1), ("that exerts it", 0))
        }
        of_every = {"forces are": FORCE_BETWEEN.keys()}
        of_one = {f"{name} is": [name] for name in FORCE_BETWEEN}
        for words, names in {**of_every, **of_one}.items():
            for bar in (1, *MOVING_BARS):
                frames[f"{words} in the frame of bar {bar}"] = dict.fromkeys(names, bar)
        for text, bars in frames.items():
            turned = {
                name: stack_components(
                    join(self.right[name]) * np.conj(self.motion.unit[bar])
                )
                for name, bar in bars.items()
            }
            whole = len(turned) > 1
            yield Mistake(f"{text}, not in world axes", turned.get, whole=whole)

    def _equal_forces(self) -> Iterator[Mistake]:
        text = f"the power is given in place of the {self.driving}"
        yield Mistake(text, {self.driving: self.right.power}.get, whole=False)
        for name, other in permutations(PIN_FORCES, 2):
            values = self.right[other]
            yield Mistake(f"{name} = {other}", {name: values}.get, whole=False)
            yield Mistake(f"{name} = -{other}", {name: -values}.get, whole=False)

    def _scale_inertial(self) -> Iterator[Change]:
        """Scale the inertial forces against the loads."""
        every = self.accelerate(self.a_G)
        turning = self.accelerate({}, self.motion.alpha)
        for text, (by_mass, by_inertia) in _INERTIAL.items():
            more = (by_mass - 1.0) * every + (by_inertia - 1.0) * turning
            yield Change(text, more)

    def _scale_actions(self) -> Iterator[Change]:
        """Leave out, double or reverse each load and effect, and each part of one."""
        for name, acting, pins in self._list_acting():
            for factor, done in _SCALED.items():
                friction = dict.fromkeys(pins, factor)
                text = f"{_name_with_verb(name)} {done}"
                yield Change(
                    text, (factor - 1.0) * acting, where=_WHERE, friction=friction
                )
        for factor, done in _SCALED.items():
            for name, more in self._list_numbers(factor):
                yield Change(f"{name} is {done}", more, where=_WHERE)
        for effect in self.scene.effects:
            yield from self._change_effect(effect)
        every = (*self.scene.loads, *self.scene.effects)
        if self.scene.effects and len(every) > 1:
            dry = dict.fromkeys(list_sliding_pins(self.scene), 0.0)
            text = "all loads and effects are missing: inertia alone"
            yield Change(text, -self.apply(*every), friction=dry)
        if not self.gravity:
            text = "gravity along -y is included though the scene has none"
            yield Change(text, self.apply(Gravity()))

    def _change_effect(self, effect: Any) -> Iterator[Change]:
        """State an effect otherwise, or let it act on one of two bars alone."""
        name = _name_effect(effect)
        for text, other in _list_other_forms(effect, self.scene.linkage.ground_angle):
            yield Change(f"{name} {text}", self.apply(other) - self.apply(effect))
        parts = _split_effect(effect)
        if effect.key in ("viscous", "torsion"):
            linear = self.apply(effect)
            if effect.key == "torsion":
                relaxed = [_change_number(part, "preload", 0.0) for part in parts]
                linear = self.apply(*relaxed)
            for factor, done in _IN_DEGREES.items():
                text = f"{_name_with_verb(name)} {done}"
                yield Change(text, (factor - 1.0) * linear)
        if effect.key == "viscous":
            own = BodyWrenches(len(self.right))
            for pin, k in effect.coefficients:
                own.twist_at(pin, -k * self.motion.omega[PINS[pin][0]])
            how = "is of the second bar's own speed"
            yield Change(f"{name} {how}", self.respond(own))
        bars_of_parts = [_list_bars(part) for part in parts]
        if all(1 in bars for bars in bars_of_parts):
            return  # on the ground nothing is missed
        verb = "act" if _is_plural(name) else "acts"
        for left_out, words in enumerate(("second", "first")):
            less = np.zeros((len(self.right), 13))
            for part, bars in zip(parts, bars_of_parts, strict=True):
                if bars[left_out] in MOVING_BARS:
                    less -= self.apply(part, bars=[bars[left_out]])
            yield Change(f"{name} {verb} on the {words} of two bars alone", less)

    def _list_acting(self) -> Iterator[tuple[str, Array, list[str]]]:
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
                yield f"the couple of {name}", acting - force, []
        forces = [replace(one, moment=0.0) for one in scene.loads if one.force]
        if len(forces) > 1 and forces != list(scene.loads):
            yield "the forces of the loads", self.apply(*forces), []
        dry = [effect for effect in scene.effects if effect.key in DRY]
        if len(dry) > 1:
            yield "all dry friction", self.apply(*dry), list(list_sliding_pins(scene))
        for effect in scene.effects:
            name = _name_effect(effect)
            yield name, self.apply(effect), list(effect.loaded_pins)
            parts = _split_effect(effect)
            if len(parts) > 1:
                for number, part in enumerate(parts, 1):
                    pins = list(part.loaded_pins)
                    yield f"part {number} of {name}", self.apply(part), pins

    def _list_numbers(self, factor: float) -> Iterator[tuple[str, Array]]:
        """List what acts besides where a number of springs has a factor."""
        for effect in self.scene.effects:
            springs = _SPRINGS.get(effect.key)
            if springs is not None:
                parts = _split_effect(effect)
                of_parts = (
                    (f"{springs} {i}", number, more)
                    for i, part in enumerate(parts, 1)
                    for number, more in self._change_spring(part, factor)
                )
                every = f"every {springs}" if len(parts) > 1 else None
                for whose, number, more in _add_sums(of_parts, every):
                    yield f"the {number} of {whose}", more

    def _change_spring(self, effect: Any, factor: float) -> Iterator[tuple[str, Array]]:
        """List each number of one spring with what its factor lets act besides."""
        right = self.apply(effect)
        for number in _SPRING_NUMBERS[effect.key]:
            changed = _change_number(effect, number, factor)
            if changed != effect:
                yield number, self.apply(changed) - right
        relaxed = _change_number(effect, "preload", 0.0)
        if relaxed != effect:  # else the stiffness scales the whole force
            yield "stiffness", (factor - 1.0) * self.apply(relaxed)

    def _velocity_terms(self) -> Iterator[Change]:
        """Leave out (dJ/dt) v, or reverse it, in the accelerations of the other bars.

        Without it these follow that of the commanded bar alone, by the ratios of the
        speeds: a omega_2 u_2 + b omega_3 u_3 = c omega_4 u_4 fixes them at rest too.
        """
        motion = self.motion
        right = self.right
        bar = right.at.bar
        at_rest = speeds_and_accelerations(
            motion.linkage,
            motion.theta_2,
            motion.alpha[bar],
            np.zeros(len(right)),
            right.theta_3,
            right.theta_4,
            bar,
        )
        alone = at_rest.omega
        for factor, done in _VELOCITY_TERM.items():
            added = {k: factor * (motion.alpha[k] - alone[k]) for k in MOVING_BARS}
            added[bar] = np.zeros(len(right))
            of_A, of_B = (
                1j * added[k] * self.of_bar[k].length * motion.unit[k] for k in (2, 4)
            )
            moved: MistakenNumbers = {
                **{f"alpha_{k}": motion.alpha[k] + more for k, more in added.items()},
                "a_A": right.a_A + stack_components(of_A),
                "a_B": right.a_B + stack_components(of_B),
            }
            swing = {k: 1j * added[k] * self.to_centre[k] for k in added}
            swing[3] = swing[3] + of_A
            more = self.accelerate(swing, added)
            for wheel in self.scene.effects:
                if isinstance(wheel, Flywheel):
                    couple = -wheel.inertia * added[wheel.bar]
                    more = more + self.push(wheel.bar, 0.0, couple=couple)
            text = f"(dJ/dt) v {done} in the accelerations of the loop"
            moved |= self._move_centres(swing)
            yield Change(text, more, moved, _FOLLOWING)

    def _move_centres(self, swing: Mapping[int, ComplexArray]) -> MistakenNumbers:
        """Return the accelerations of the mass centres where some are added."""
        return {
            f"a_G{bar}": stack_components(self.a_G[bar] + a) for bar, a in swing.items()
        }

    def _accelerations_of_centres(self) -> Iterator[Change]:
        """Leave out a part of the acceleration of each G about its bar's first pin."""
        motion = self.motion
        arms = self.to_centre
        centripetal = {bar: -(motion.omega[bar] ** 2) * arms[bar] for bar in arms}
        tangential = {bar: 1j * motion.alpha[bar] * arms[bar] for bar in arms}
        whose: dict[str, tuple[int, ...]] = {"every bar": MOVING_BARS}
        whose |= {f"bar {bar}": (bar,) for bar in MOVING_BARS}
        wrong: dict[str, dict[int, ComplexArray]] = {}
        for part, of_bars in (("-omega^2 r", centripetal), ("alpha x r", tangential)):
            for factor, done in _PART_OF_ACCELERATION.items():
                for name, bars in whose.items():
                    text = f"{part} {done} in a_G of {name}, r from its first pin to G"
                    wrong[text] = {bar: factor * of_bars[bar] for bar in bars}
        for bar in MOVING_BARS:
            text = f"the acceleration of bar {bar}'s first pin is used as its a_G"
            wrong[text] = {bar: -centripetal[bar] - tangential[bar]}
        for text, added in wrong.items():
            more = self.accelerate(added)
            yield Change(text, more, self._move_centres(added), _FOLLOWING)

    def _change_bars(self) -> Iterator[Change]:
        """Give each bar, and every bar, another mass or moment of inertia."""
        if self.gravity:
            for bar in MOVING_BARS:
                less = -self.apply(*self.gravity, bars=[bar])
                yield Change(f"the weight of bar {bar} is missing", less)
        for name, text, more in self._list_bar_mistakes():
            yield Change(f"{name}: {text}", more)

    def list_factors(self) -> Iterator[tuple[str, list[Array]]]:
        """List what may have another amount, with what a unit of it adds, (n, 13) each.

        A unit is as much as there is. A mass centre has three: 1 m along and across its
        bar, and 1 m^2 of the square of both.
        """
        for name, text, less in self._list_bar_mistakes():
            if text.endswith(_LEFT_OUT):
                yield f"{name}: {text.removesuffix(_LEFT_OUT)}", [-less]
        for name, acting, _ in self._list_acting():
            yield name, [acting]
        for name, less in self._list_numbers(0.0):
            yield name, [-less]
        for name, (effect, pin) in MISSING.items():
            there = [one for one in self.scene.effects if one.key == effect.key]
            if not any(
                pin in dict(getattr(one, _PART_FIELDS[one.key])) for one in there
            ):
                yield name, [self.apply(effect.at(**{pin: 1.0}))]
        for bar in MOVING_BARS:
            if mass := find_mass(self.of_bar[bar]):
                yield f"{BAR_NAMES[bar]}: mass centre", self._shift_centre(bar, mass)

    def _shift_centre(self, bar: int, mass: float) -> list[Array]:
        """Return what shifts of a mass centre add, and their square.

        A load that is stated from the centre goes with it.
        """
        motion = self.motion
        acting = BodyWrenches(len(self.right))
        for effect in self.gravity:
            apply_effect(effect, motion, acting)
        for stated, load in zip(self.stated.loads, self.scene.loads, strict=True):
            if stated.from_centre is not None:
                apply_load(load, motion, acting)
        force = acting.force[bar] - mass * self.a_G[bar]
        swing = 1j * motion.alpha[bar] - motion.omega[bar] ** 2
        shifts = [
            self.push(
                bar,
                -mass * swing * shift,
                self.to_centre[bar],
                cross_products(shift, force),
            )
            for shift in (motion.unit[bar], 1j * motion.unit[bar])
        ]
        return [*shifts, self.push(bar, 0.0, couple=-mass * motion.alpha[bar])]

    def _list_bar_mistakes(self) -> Iterator[tuple[str, str, Array]]:
        """List mistakes in mass and inertia of each bar, then of every bar."""
        of_bars = (
            (BAR_NAMES[bar], text, more)
            for bar in MOVING_BARS
            for text, more in self._list_mistakes_of(bar)
        )
        return _add_sums(of_bars, "every bar")

    def _list_mistakes_of(self, bar: int) -> Iterator[tuple[str, Array]]:
        """List mistakes in mass and inertia of a bar, with what they add."""
        mass, inertia = find_mass(self.of_bar[bar]), find_inertia(self.of_bar[bar])
        alpha = self.motion.alpha[bar]
        steiner = mass * np.abs(self.to_centre[bar]) ** 2
        about_pin = self.push(bar, 0.0, couple=-steiner * alpha)
        weight = self.apply(*self.gravity, bars=[bar])
        massless = -self.accelerate({bar: self.a_G[bar]}) - weight
        pointlike = -self.accelerate({}, {bar: alpha})
        if mass:
            yield "inertia about the pin used as the inertia about G", about_pin
            yield "inertia about G used as the inertia about the pin", -about_pin
            yield f"mass{_LEFT_OUT}", massless
        if inertia:
            yield f"moment of inertia{_LEFT_OUT}", pointlike
            if mass:
                yield f"mass and moment of inertia{_LEFT_OUT}", massless + pointlike

    def _change_loads(self) -> Iterator[Change]:
        """Let each load, and every load, act elsewhere or in another direction."""
        loads = zip(self.stated.loads, self.scene.loads, strict=True)
        of_loads = (
            (f"load {number} (bar {load.bar})", text, more)
            for number, (stated, load) in enumerate(loads, 1)
            for text, more in self._list_load_mistakes(stated, load)
        )
        every = "every load" if len(self.scene.loads) > 1 else None
        for whose, text, more in _add_sums(of_loads, every):
            yield Change(f"{whose}: {text}", more)

    def _list_load_mistakes(
        self, stated: Load, load: Load
    ) -> Iterator[tuple[str, Array]]:
        """List what else may be made of a load, with what it lets act more."""
        right = self.apply(load)
        if load.table is not None:
            yield "its table is left out", self.apply(replace(load, table=None)) - right
        if load.force is None:
            return
        bar = load.bar
        if load.frame == "bar":
            size, angle = load.force
            mirrored = self.apply(replace(load, force=(size, -angle)))
            yield "the angle of its force has the wrong sign", mirrored - right
        what = "its place" if load.arm is None else "its arm"
        acting = BodyWrenches(len(self.right))
        apply_load(load, self.motion, acting)
        force = acting.force[bar]
        arm = find_arm(load, self.motion)
        to_centre = self.to_centre[bar]
        unit = self.motion.unit[bar]
        moved = {
            "its force acts at G of the bar": to_centre - arm,
            "its force acts at the first pin of the bar": -arm,
            "its force acts at the second pin of the bar": (
                self.of_bar[bar].length * unit - arm
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
            yield text, self.push(bar, 0.0, couple=cross_products(shift, force))
        directions = {"its force has y reversed": np.conj(force)}
        if load.frame == "bar":
            directions["its direction is kept"] = force * np.conj(unit)
        else:
            directions["its direction turns with the bar"] = force * unit
        for text, pushed in directions.items():
            yield text, self.push(bar, pushed - force, arm)

    def _drive_other_bars(self) -> Iterator[Mistake]:
        for bar in MOVING_BARS:
            where = f"on bar {bar} instead of bar {self.scene.drive_bar}"
            text = f"the torque acts {where}"
            if bar != self.scene.drive_bar and self.wanted(text):
                scene = replace(self.scene, drive_bar=bar)
                unknowns = balance(scene, self.motion, self._find_couples())[0]
                numbers = {"torque": unknowns[:, DRIVE_COLUMN]}
                for name in PIN_FORCES:
                    numbers[name] = unknowns[:, FORCE_COLUMNS[name] :][:, :2]
                yield Mistake(text, numbers.get)


def _add_sums(
    parts: Iterable[tuple[str, str, Array]], every: str | None
) -> Iterator[tuple[str, str, Array]]:
    """Yield parts, each with its owner and a text, then the sum of each text's.

    The owner of the sums is `every`; None: there are none.
    """
    sums: dict[str, Any] = {}
    for whose, text, more in parts:
        yield whose, text, more
        sums[text] = sums.get(text, 0.0) + more
    if every is not None:
        for text, more in sums.items():
            yield every, text, more


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


def _name_with_verb(name: str) -> str:
    return f"{name} {'are' if _is_plural(name) else 'is'}"


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
        calculation = Calculation(judge.scene, judge.right, wanted)
        yield from calculation.mistakes()
        yield from _find_impulses(judge)
        yield from _find_stale(judge, calculation)
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
    for column in judge.columns.values():
        mask = column.where
        error = column.judged_right[0][mask]
        if not np.all(error <= EPS_SINGLE / EPS * column.exact[mask]):
            return
        errors.append(error[error > 0.0])
        apart = (column.theirs - column.ours)[mask]
        if not np.all(_is_single(column)[mask] | np.isnan(column.theirs[mask])):
            return
        common.append(np.nansum(apart[1:] * apart[:-1]) / np.nansum(apart**2))
    typical = np.median(np.concatenate(errors))
    if typical >= LEAST_OF_SINGLE and np.nanmedian(common) < MOST_IN_COMMON:
        theirs = {key: column.theirs for key, column in judge.columns.items()}
        text = "numbers have some 7 digits, as those of single precision"
        yield Mistake(text, theirs.get)


def _is_single(column: JudgedColumn) -> Mask:
    """Mark the numbers that single precision holds, or that are off by its rounding."""
    theirs = column.theirs
    factor = column.unit.factor
    rounding = (column.rounding * column.divisor).reshape(-1, *[1] * (theirs.ndim - 1))
    printed = theirs / factor
    held = np.abs(np.float32(printed) - printed) - EPS * np.abs(printed)
    off = np.abs(theirs - column.ours) - 0.5 * EPS_SINGLE * np.abs(theirs)
    return np.asarray((held * factor <= rounding) | (off <= rounding))


def _find_impulses(judge: Judge) -> Iterator[Mistake]:
    """Fit one time by which all forces and the torque are multiplied."""
    columns = [one for one in judge.columns.values() if one.quantity in FORCE_NAMES]
    if len(columns) < ENOUGH_POSITIONS:
        return
    ours, theirs = (
        np.concatenate([getattr(one, side)[one.where].ravel() for one in columns])
        for side in ("ours", "theirs")
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
        text = f"impulses in place of forces: {how}"
        yield Mistake(text, impulses.get, times=2.0)


def _take_edge(judge: Judge, name: str, values: Array, row: int) -> None:
    """Give a row of predicted numbers those of the table: it may be anything there."""
    column = judge.columns.get(name)
    if column is not None and column.theirs.shape == values.shape:
        values[row] = column.theirs[row]


def _find_late(judge: Judge) -> Iterator[Mistake]:
    """Give each position the numbers of the one before, or of the one after."""
    n = len(judge.at.angle)
    if n < ENOUGH_POSITIONS + 1:
        return
    for text, step in _LATE.items():
        rows = np.clip(np.arange(n) - step, 0, n - 1)
        moved = {}
        for name in {column.quantity for column in judge.columns.values()}:
            values = compute_column(judge.right, name)
            if values is not None and name != judge.right.commanded:
                moved[name] = values[rows]
                _take_edge(judge, name, moved[name], 0 if step == 1 else n - 1)
        forces = {name: moved[name] for name in FORCE_NAMES if name in moved}
        yield Mistake(text, moved.get)
        yield Mistake(f"{text} (forces alone)", forces.get)
        yield Mistake(text, moved.get, whole=False)


def _find_stale(judge: Judge, calculation: Calculation) -> Iterator[Mistake]:
    """Balance each position with the force at B of the one before."""
    bar = judge.scene.drive_bar
    if judge.scene.drive is not None or len(judge.at.angle) <= ENOUGH_POSITIONS:
        return
    right = judge.right
    stale = join(np.roll(right.F43, 1, axis=0) - right.F43)
    arm = calculation.of_bar[bar].length * calculation.motion.unit[bar]
    sense = 1.0 if bar == 4 else -1.0
    numbers = calculation.shift_loop_force(stale)
    numbers["torque"] = right.torque + sense * cross_products(arm, stale)
    for name, values in numbers.items():
        _take_edge(judge, name, values, 0)
    text = "the force at B is that of the position before: a constraint one step old"
    yield Mistake(text, numbers.get)


def _find_other_branch(judge: Judge) -> Iterator[Mistake]:
    """Yield the mistake of the other branch from where the numbers change."""
    keys = ("theta_3", "theta_4", *judge.columns)
    column = judge.columns[next(filter(judge.columns.__contains__, keys))]
    error, allowed, _ = column.judged_right
    if not (error > allowed).any():
        return
    try:
        opposite = judge.at._replace(branch=-judge.at.branch)
        other = solve(judge.scene, judge.stage, at=opposite)
    except FourBarError:
        return
    left = column.compare(column.take(other))[0] < error
    places = np.flatnonzero(left)
    if not len(places) or places[0] == 0:
        return
    start = int(places[0])
    here = np.degrees(judge.at.angle[start])

    def predict(quantity: str) -> Array | None:
        ours, theirs = (getattr(one, quantity, None) for one in (judge.right, other))
        if ours is None or theirs is None:
            return None
        return np.concatenate((ours[:start], theirs[start:]))

    place = f"{judge.at.commanded} = {here:.4g} deg"
    yield Mistake(f"the other branch from {place} on", predict)
