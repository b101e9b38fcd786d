"""The entries of a four-bar's MJCF that decide its motion and forces.

Entries are read from a compiled model, and set in the generated one. Each entry stands
under a name by which two files can be compared, whatever the tree of their bodies,
their axes and their names. What an entry costs is seen by setting it, alone, in the
generated file.
"""

import math
from collections.abc import Iterator
from itertools import chain, count
from typing import Any

import mujoco
import numpy as np

from fourbar.linkage import BAR_NAMES, BAR_NUMBERS, FIRST_PIN, MOVING_BARS, PINS
from fourbar.quantities import Array
from fourbar_validation.engines.description import ModelEntry, Value
from fourbar_validation.engines.mujoco.robots.ancestry import (
    is_enabled,
    list_actuators,
    list_lifted_masses,
    list_wraps,
    take_control,
)
from fourbar_validation.engines.mujoco.robots.closures import describe_equality
from fourbar_validation.engines.mujoco.robots.seen import SeenLoop

Described = dict[str, ModelEntry]
UNLIMITED_RANGE = "free"
"""Range of a pin that no stop ends."""
_GROUND_PINS = ("O2", "O4")

PIN_PROPERTIES = {
    "damping": ("dof_damping", "damping", "damper"),
    "friction": ("dof_frictionloss", "frictionloss", "frictionloss"),
    "stiffness": ("jnt_stiffness", "stiffness", "spring"),
    "armature": ("dof_armature", "armature", ""),
}
"""Property of a pin as field of MjModel and attribute of its joint. The flag switches
it off.
"""
FRICTION_COMPLIANCE = {"dof_solref": "solreffriction", "dof_solimp": "solimpfriction"}
"""Fields of MjModel and attributes by which dry friction yields, compared if there is
any friction.
"""
_FIELDS_OF_A_PIN = {name: entry[0] for name, entry in PIN_PROPERTIES.items()}
_FIELDS_OF_A_PIN |= {attribute: one for one, attribute in FRICTION_COMPLIANCE.items()}
_TENDON = {
    "stiffness": "stiffness",
    "damping": "damping",
    "frictionloss": "frictionloss",
    "armature": "armature",
    "solref_fri": "solreffriction",
    "solimp_fri": "solimpfriction",
}
COMPARED_OPTIONS = (
    "timestep",
    "integrator",
    "solver",
    "tolerance",
    "iterations",
    "ls_iterations",
    "noslip_iterations",
    "density",
    "viscosity",
    "wind",
)
ENUMERATIONS = {"integrator": mujoco.mjtIntegrator, "solver": mujoco.mjtSolver}
_MJCF_WORDS = {
    "EULER": "Euler",
    "IMPLICIT": "implicit",
    "IMPLICITFAST": "implicitfast",
    "NEWTON": "Newton",
}
"""Integrators and solvers as MJCF spells them, where MuJoCo spells them otherwise."""
STIFFEST = 0.9999
"""Greatest impedance that MuJoCo lets a constraint have."""
PARALLEL_AXES = 1e-9
"""rad; axes that are nearer to each other are parallel but for rounding."""


def describe_model(seen: SeenLoop, flywheel: float = 0.0) -> Described:
    """Describe lengths, masses, pins, gravity, closure, loads, and more, as compiled.

    Tendons and options are described too.

    `flywheel`: the part of the armature of pin O2 that drives, kg m^2, and so is no
    inertia of the input.
    """
    return _Description(seen, flywheel).described


class _Description:
    """The entries of one loop, put together part by part."""

    def __init__(self, seen: SeenLoop, flywheel: float) -> None:
        self.seen = seen
        self.model = model = seen.model
        self.pins = seen.pins
        self.described: Described = {}
        skew = seen.loop.misaligned
        self.put("plane", seen.plane)
        self.put("skew", skew if skew > PARALLEL_AXES else 0.0)
        # those of a parallelogram or kite within the digits of the file, else its own
        lengths = seen.loop.met if seen.loop.rounding else seen.loop.lengths
        for name, length in zip(BAR_NAMES.values(), lengths, strict=True):
            self.put(f"lengths.{name}", length)
        for bar in MOVING_BARS:
            self.add_bar(bar, flywheel if bar == 2 else 0.0)
        gravity = model.opt.gravity * is_enabled(model, "gravity")
        for axis, size in zip("xy", seen.in_plane(gravity), strict=True):
            self.put(f"gravity.{axis}", size, "option", "gravity")
        self.put("gravity.across", gravity @ seen.normal, "option", "gravity")
        for pin in PINS:
            self.add_pin(pin)
        self.add_closure()
        self.add_loads()
        self.add_tendons()
        for name in COMPARED_OPTIONS:
            setting = getattr(model.opt, name)
            if name in ENUMERATIONS:
                setting = word_of_number(name, setting)
            self.put(f"option.{name}", setting, "option", name)
        touching = model.npair or (
            model.geom_contype.any() and model.geom_conaffinity.any()
        )
        touching = touching and seen.is_alone and is_enabled(model, "contact")
        self.put("contacts", "possible" if touching else "off")

    def put(
        self, key: str, value: object, element: str = "", attribute: str = ""
    ) -> None:
        """Put an entry; numbers of NumPy become plain ones."""
        if not isinstance(value, str):
            read = np.asarray(value, dtype=float).tolist()
            value = tuple(read) if isinstance(read, list) else read
        self.described[key] = ModelEntry(value, element, attribute)

    def name(self, kind: str, number: int, tag: str = "") -> str:
        """Return an element of a kind by its tag and name, or by its number."""
        name = getattr(self.model, kind)(number).name
        tag = tag or kind
        return f'{tag} "{name}"' if name else f"{tag} {number} (unnamed)"

    def add_bar(self, bar: int, flywheel: float) -> None:
        """Describe mass, inertia about the mass centre, and its place.

        The place is from the first pin; all that is welded to the bar is included. The
        armature of a hinge on the ground turns with the bar, and is inertia of it.
        """
        seen = self.seen
        mass, (distance, angle), inertia = seen.lump(bar)
        key = f"bars.{BAR_NAMES[bar]}"
        element = f'body "{self.model.body(seen.loop.bodies[bar][0]).name}"'
        self.put(f"{key}.mass", mass, element, "inertial")
        self.put(f"{key}.inertia", inertia, element, "inertial")
        self.put(f"{key}.centre.distance", distance, element, "inertial")
        self.put(f"{key}.centre.angle", angle, element, "inertial")
        pin = FIRST_PIN[bar]
        joint = seen.hinge.get(pin)
        if pin in _GROUND_PINS and joint is not None:
            armature = self.model.dof_armature[self.model.jnt_dofadr[joint]] - flywheel
            if armature:
                hinge = self.name("joint", joint)
                where = f"{element} inertial and {hinge}"
                self.put(f"{key}.inertia", inertia + armature, where, "armature")
        lifted = list_lifted_masses(self.model)[seen.list_parts(bar)].sum()
        self.put(f"lift.{BAR_NAMES[bar]}", lifted, element, "gravcomp")

    def add_pin(self, pin: str) -> None:
        """Describe what acts at a pin; nothing acts where the loop is cut."""
        seen = self.seen
        model = self.model
        key = f"pins.{pin}"
        joint = seen.hinge.get(pin)
        if joint is None:
            for name in PIN_PROPERTIES:
                self.put(f"{key}.{name}", 0.0)
            self.put(f"{key}.range", UNLIMITED_RANGE)
            return
        dof = int(model.jnt_dofadr[joint])
        element = self.name("joint", joint)
        acting = {}
        for name, (field, attribute, flag) in PIN_PROPERTIES.items():
            if name == "armature" and pin in _GROUND_PINS:
                continue  # it is inertia of the bar there
            size = getattr(model, field)[joint if field.startswith("jnt") else dof]
            acting[name] = size * (not flag or is_enabled(model, flag))
            self.put(f"{key}.{name}", acting[name], element, attribute)
        if acting["friction"]:
            for field, attribute in FRICTION_COMPLIANCE.items():
                value = getattr(model, field)[dof]
                self.put(f"{key}.{attribute}", value, element, attribute)
        if acting["stiffness"]:
            angle = seen.rest_angle(pin, spring=True)
            self.put(f"{key}.spring angle", angle, element, "springref")
        stops = seen.stops(pin) if seen.is_alone else None
        self.put(f"{key}.range", stops or UNLIMITED_RANGE, element, "range")
        sense = "counter-clockwise" if seen.sense[pin] > 0 else "clockwise"
        self.put(f"{key}.positive", sense, element, "axis")

    def add_closure(self) -> None:
        """Describe how the loop is closed, and how softly."""
        seen = self.seen
        model = self.model
        number = seen.closure
        self.put("closure.pin", seen.loop.cut or "within a bar")
        self.put("closure.by", seen.closed_by)
        self.put("closure.out of plane", seen.measure_offset())
        names = (describe_equality(model, one) for one in seen.loop.other_equalities)
        self.put("other equalities", ", ".join(names) or "none")
        if not model.eq_active0[number]:
            return
        kind = seen.closed_by.partition(" ")[0]
        element = self.name("equality", number, kind)
        self.put("closure.solref", model.eq_solref[number], element, "solref")
        self.put("closure.solimp", model.eq_solimp[number], element, "solimp")
        # MuJoCo's inverse weights of the two bodies that the equality joins, 1/kg
        bodies = [model.eq_obj1id[number], model.eq_obj2id[number]]
        if model.eq_objtype[number] == mujoco.mjtObj.mjOBJ_SITE:
            bodies = [model.site_bodyid[site] for site in bodies]
        self.put("closure.weight", model.body_invweight0[bodies, 0].sum())

    def add_loads(self) -> None:
        """Describe what actuators exert with a control of 0.

        Couples at sites of a bar and constant ones at its hinge on the ground add up,
        and so do forces at sites that keep their axes: to one force, and the first
        moments r x F and r . F about the bar's first pin, which tell where it acts. At
        other hinges it is the couple. The drive is taken off, and is no load.
        """
        seen = self.seen
        model = self.model
        is_off = take_control(model) & (not seen.is_alone)
        is_off[seen.drives] = True
        loads: dict[str, dict[str, Array]] = {}
        for i in np.flatnonzero(~is_off).tolist():
            bias = _read_bias(model, i)
            if not bias.any():
                continue  # it exerts what it is told to, and it is told nothing
            number = int(model.actuator_trnid[i, 0])
            exerted = model.actuator_gear[i, 0] * bias
            kind = model.actuator_trntype[i]
            element = self.name("actuator", i)
            if on_bar := dict(self.read_loads(i, bias)):
                for key, load in on_bar.items():
                    loads.setdefault(key, {})[element] = load
            elif kind == mujoco.mjtTrn.mjTRN_JOINT:
                if pin := self.pins.get(number):
                    self.put(f"pins.{pin}.motor", seen.sense[pin] * exerted, element)
            elif kind == mujoco.mjtTrn.mjTRN_TENDON:
                if seen.touches_tendon(number):
                    self.put(f"{self.name_tendon(number)}.tension", exerted, element)
            elif seen.is_alone:
                words = "acts on no pin, bar or tendon"
                self.put(f"actuators.{model.actuator(i).name or i}", words, element)
        for key, on_bar in loads.items():
            element = ", ".join(on_bar)
            fx, fy, couple, along = np.sum([*on_bar.values()], axis=0)
            if squared := fx * fx + fy * fy:
                x = (fx * along + fy * couple) / squared
                y = (fy * along - fx * couple) / squared
                self.put(f"{key}.force", (fx, fy), element)
                self.put(f"{key}.point", (x, y), element)
            else:
                self.put(f"{key}.couple", couple, element)

    def read_loads(self, actuator: int, bias: Array) -> Iterator[tuple[str, Array]]:
        """Yield key and sums of the couple and the force of an actuator on a bar.

        The sums are force, couple or r x F, and r . F, in N and N m.
        """
        seen = self.seen
        model = self.model
        kind = model.actuator_trntype[actuator]
        pin = self.pins.get(model.actuator_trnid[actuator, 0], "")
        on_ground = kind == mujoco.mjtTrn.mjTRN_JOINT and pin in _GROUND_PINS
        if on_ground and not bias[1:].any():
            size = seen.sense[pin] * model.actuator_gear[actuator, 0] * bias[0]
            key = f"loads.{BAR_NAMES[PINS[pin][1]]}"
            yield key, np.array([0.0, 0.0, size, 0.0])
        if kind != mujoco.mjtTrn.mjTRN_SITE:
            return
        site, frame = (int(index) for index in model.actuator_trnid[actuator])
        bar = seen.loop.bars[model.site_bodyid[site]]
        if bar not in MOVING_BARS:
            return
        axes_of = frame if frame >= 0 else site
        axes = seen.data.site_xmat[axes_of].reshape(3, 3)
        gear = model.actuator_gear[actuator].reshape(2, 3)
        force, couple = (axes @ one * bias[0] for one in gear)
        if couple.any():
            turning = np.array([0.0, 0.0, couple @ seen.normal, 0.0])
            yield f"loads.{BAR_NAMES[bar]}", turning
        if not force.any():
            return
        bearer = seen.loop.bars[model.site_bodyid[axes_of]]
        directions = "world axes"
        if bearer in MOVING_BARS:
            fx, fy = seen.resolve(bearer, force)
            directions = f"axes of the {BAR_NAMES[bearer]}"
        else:
            fx, fy = seen.in_plane(force)
        x, y = seen.along_bar(bar, seen.data.site_xpos[site])
        sums = np.array([fx, fy, x * fy - y * fx, x * fx + y * fy])
        yield f"loads.{BAR_NAMES[bar]}, {directions}", sums

    def name_tendon(self, number: int) -> str:
        """Return a tendon's name: its pins, or else the bars that it runs between."""
        parts = []
        for kind, index, _ in list_wraps(self.model, number):
            if kind == mujoco.mjtWrap.mjWRAP_JOINT:
                parts.append(self.pins.get(index, "another joint"))
            elif kind == mujoco.mjtWrap.mjWRAP_SITE:
                bar = self.seen.loop.bars[self.model.site_bodyid[index]]
                parts.append("no bar" if bar is None else BAR_NAMES[bar])
            else:
                parts.append(kind.name.removeprefix("mjWRAP_").lower())
        return f"tendons.{' '.join(sorted(parts))}"

    def add_tendons(self) -> None:
        """Describe every tendon by its path, and what it does.

        The path tells several tendons between the same bars apart.
        """
        seen = self.seen
        model = self.model
        tendons = list[tuple[str, tuple[float, ...], int]]()
        rest: dict[int, float] = {}
        for i in filter(seen.touches_tendon, range(model.ntendon)):
            path: list[tuple[Any, ...]] = []
            for kind, index, by_turn in list_wraps(model, i):
                if kind == mujoco.mjtWrap.mjWRAP_JOINT and index in self.pins:
                    pin = self.pins[index]
                    coefficient = seen.sense[pin] * by_turn
                    path.append((pin, coefficient))
                    before = rest.get(i, -float(model.tendon_length0[i]))
                    rest[i] = before + coefficient * seen.rest_angle(pin)
                elif kind == mujoco.mjtWrap.mjWRAP_SITE:
                    bar = seen.loop.bars[model.site_bodyid[index]]
                    place = bar and seen.along_bar(bar, seen.data.site_xpos[index])
                    path.append((str(bar), *(place or ())))
            numbers = tuple(number for _, *place in sorted(path) for number in place)
            tendons.append((self.name_tendon(i), numbers, i))
        for name, numbers, i in sorted(tendons):
            counted = (f"{name} ({number})" for number in count(2))
            keys = chain([name], counted)
            key = next(one for one in keys if one not in self.described)
            element = self.name("tendon", i)
            self.put(key, "present", element)
            self.put(f"{key}.path", numbers, element)
            for attribute, written in _TENDON.items():
                if model.tendon_frictionloss[i] or not attribute.endswith("_fri"):
                    value = getattr(model, f"tendon_{attribute}")[i]
                    self.put(f"{key}.{written}", value, element, written)
            if model.tendon_stiffness[i]:
                end = "springlength angle" if i in rest else "springlength"
                lengths = model.tendon_lengthspring[i] + rest.get(i, 0.0)
                self.put(f"{key}.{end}", lengths, element, "springlength")


def _read_bias(model: mujoco.MjModel, actuator: int) -> Array:
    """Return the force of an actuator without control, and its slopes, (3,).

    The slopes are by length and by speed. Of direct-current motors that have no
    control, those are read whose force is constant: a cogging without a period.
    """
    bias = model.actuator_biasprm[actuator, :3]
    kinds = mujoco.mjtBias
    if model.actuator_biastype[actuator] == kinds.mjBIAS_AFFINE:
        return np.array(bias)
    direct = getattr(kinds, "mjBIAS_DCMOTOR", None)
    if direct is not None and model.actuator_biastype[actuator] == direct:
        amplitude, periods, phase = bias
        if not periods:
            return np.array([amplitude * math.sin(phase), 0.0, 0.0])
    return np.zeros(3)


def mend_entry(
    seen: SeenLoop,
    key: str,
    value: Value | None,
) -> bool:
    """Make one entry of a compiled model that of the generated file.

    False if that is not possible. Contacts are switched off, a
    stop and the motors at a pin are removed, the loop is made as stiff as MuJoCo lets
    it be unless it is, and a setting, and what acts at a pin or along a tendon, gets
    its value.
    """
    model = seen.model
    subject, _, rest = key.partition(".")
    pin, _, what = rest.partition(".")
    if key == "contacts":
        model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONTACT)
    elif subject == "lift":
        model.body_gravcomp[seen.list_parts(BAR_NUMBERS[rest])] = 0.0
    elif subject == "option" and rest in ENUMERATIONS:
        setattr(model.opt, rest, number_of_word(rest, str(value)))
    elif subject == "option":
        was = getattr(model.opt, rest)
        setattr(model.opt, rest, np.asarray(value).astype(np.asarray(was).dtype))
    elif key == "closure.solref":
        model.eq_solref[seen.closure] = value
    elif key == "closure.solimp":
        if np.all(model.eq_solimp[seen.closure, :2] == STIFFEST):
            return False
        model.eq_solimp[seen.closure, :2] = STIFFEST
    elif subject == "pins" and pin in seen.hinge:
        return _mend_pin(seen, pin, what, value)
    elif subject == "tendons":
        return _mend_tendon(seen, key, value)
    else:
        return False
    return True


def _mend_pin(seen: SeenLoop, pin: str, what: str, value: Value | None) -> bool:
    """Make what acts at a pin, or how it yields, that of the generated file.

    Stops and motors are removed.
    """
    model = seen.model
    joint = seen.hinge[pin]
    if value is None and what != "motor":
        return False
    if what == "range":
        model.jnt_limited[joint] = 0
    elif what == "motor":
        for i in list_actuators(model, joint):
            model.actuator_gainprm[i] = model.actuator_biasprm[i] = 0.0
    elif what == "spring angle":
        turned = np.subtract(value, seen.rest_angle(pin, spring=True))  # type: ignore[arg-type]
        model.qpos_spring[model.jnt_qposadr[joint]] += seen.sense[pin] * turned
    elif what in _FIELDS_OF_A_PIN:
        field = _FIELDS_OF_A_PIN[what]
        row = joint if field.startswith("jnt") else model.jnt_dofadr[joint]
        getattr(model, field)[row] = value
    else:
        return False
    return True


def _mend_tendon(seen: SeenLoop, key: str, value: Value | None) -> bool:
    """Make one entry of a tendon that of the generated file, 0 where it has none."""
    entry = describe_model(seen).get(key)
    if entry is None or not entry.attribute:
        return False
    value = 0.0 if value is None else value
    number = seen.model.tendon(entry.element.partition(" ")[2].strip('"')).id
    if entry.attribute == "springlength":
        longer = np.subtract(value, entry.value)
        seen.model.tendon_lengthspring[number] += longer
        return True
    (field,) = (one for one, written in _TENDON.items() if written == entry.attribute)
    getattr(seen.model, f"tendon_{field}")[number] = value
    return True


def word_of_number(name: str, number: int) -> str:
    """Return the word by which MJCF calls an integrator or a solver."""
    kind: str = ENUMERATIONS[name](number).name.partition("_")[2]
    return _MJCF_WORDS.get(kind, kind)


def number_of_word(name: str, word: str) -> int:
    """Find the number of an integrator or a solver that MJCF calls by a word."""
    members = ENUMERATIONS[name].__members__
    prefix = next(iter(members)).partition("_")[0]
    return int(members[f"{prefix}_{word.upper()}"])
