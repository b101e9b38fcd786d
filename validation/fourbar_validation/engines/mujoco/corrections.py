"""One entry of somebody's compiled model made as in the generated one, and nothing else: what that entry costs.

Derived constants follow (mj_setConst), as if the file had been written so and compiled.
"""

import copy
import math
from collections.abc import Callable, Mapping

import mujoco
import numpy as np

from fourbar.linkage import BAR_NAMES, FIRST_PIN
from fourbar_validation.compare.answer import Array
from fourbar_validation.engines.mujoco.attached import Value
from fourbar_validation.engines.mujoco.describe import ENUMERATIONS, describe_model
from fourbar_validation.engines.mujoco.model_fields import PIN
from fourbar_validation.engines.mujoco.topology import ENDS, Topology

Edit = Callable[[Topology, mujoco.MjModel, list[str], Value], None]
NUMBER = {name: number for number, name in BAR_NAMES.items()}
FLAG = {"damping": "DAMPER", "friction": "FRICTIONLOSS", "stiffness": "SPRING", "range": "LIMIT"}
OF_PIN = {"damping": "dof_damping", "friction": "dof_frictionloss", "stiffness": "jnt_stiffness",
          "armature": "dof_armature"}  # fmt: skip
FIELD_OF = {name: field for field, name in PIN.items()}
SOLREF = {"time constant": 0, "damping ratio": 1}


def correct(topology: Topology, key: str, value: Value) -> mujoco.MjModel | None:
    """Copy the model with that entry of its description as specified; None where it cannot be set alone."""
    model = copy.copy(topology.model)
    subject, *rest = key.split(".")
    edit = EDITS.get(subject)
    if edit is None:
        return None
    try:
        edit(topology, model, rest, value)
    except (KeyError, TypeError, ValueError, AttributeError):  # an entry of another kind than this one sets
        return None
    return model


def _settle(model: mujoco.MjModel) -> None:
    """Derive what the compiler does from masses and places."""
    model.body_sameframe[:] = mujoco.mjtSameFrame.mjSAMEFRAME_NONE
    model.body_simple[:] = model.dof_simplenum[:] = 0
    mujoco.mj_setConst(model, mujoco.MjData(model))


def _switch_on(model: mujoco.MjModel, *flags: str) -> None:
    for flag in flags:
        model.opt.disableflags &= ~int(getattr(mujoco.mjtDisableBit, f"mjDSBL_{flag}", 0))


def _correct_bar(topology: Topology, model: mujoco.MjModel, rest: list[str], value: Value) -> None:
    """Mass, inertia or mass centre, the others of the bar kept; what is welded to it gives it all it has."""
    name, *part = rest
    bar, entry = NUMBER[name], ".".join(part)
    here = describe_model(topology)
    entries = {each: here[f"bars.{name}.{each}"] for each in ("mass", "inertia", "centre.distance", "centre.angle")}
    if entry not in entries:
        raise KeyError(entry)
    entries[entry] = value
    mass, inertia, distance, angle = (float(entries[each]) for each in entries)  # type: ignore[arg-type]
    parts, root = np.flatnonzero(model.body_weldid == topology.root[bar]), topology.root[bar]
    model.body_mass[parts], model.body_inertia[parts] = 0.0, 0.0
    model.body_mass[root], model.body_inertia[root] = mass, inertia
    model.body_iquat[root] = (1.0, 0.0, 0.0, 0.0)
    x, y = topology.line(topology.data, bar)
    turned = math.atan2(y, x) + angle
    arm = _place_in_space(topology, distance * np.array([math.cos(turned), math.sin(turned)]))
    model.body_ipos[root] = topology.point[bar, FIRST_PIN[bar]] + _rotate(topology, bar).T @ arm
    _settle(model)


def _place_in_space(topology: Topology, vector: Array) -> Array:
    full = np.zeros(3)
    full[list(topology.axes)] = vector
    return full


def _rotate(topology: Topology, bar: int) -> Array:
    return np.asarray(topology.data.xmat[topology.root[bar]].reshape(3, 3))


def _correct_length(topology: Topology, model: mujoco.MjModel, rest: list[str], value: Value) -> None:
    """Move a bar's pin along its line; whatever turns about it, or closes the loop there, goes with it."""
    bar = NUMBER[rest[0]]
    own = next((pin for pin, joint in topology.hinge.items() if model.body_weldid[model.jnt_bodyid[joint]]
                == topology.root[bar]), "O2" if bar == 1 else None)  # fmt: skip
    fixed = own or ENDS[bar][0]
    moved = next(pin for pin in ENDS[bar] if pin != fixed)
    line = topology.point[bar, moved] - topology.point[bar, fixed]
    across = _rotate(topology, bar).T @ topology.normal
    line = line - across * float(across @ line)
    shift = line * (float(value) / math.hypot(*line) - 1.0)  # type: ignore[arg-type]
    if moved in topology.hinge:
        child = int(model.jnt_bodyid[topology.hinge[moved]])
        parent = int(model.body_parentid[child])
        frame = topology.data.xmat[parent].reshape(3, 3).T @ _rotate(topology, bar)
        model.body_pos[child] += frame @ shift
    else:
        _move_closure(topology, model, bar, shift)
    if moved == FIRST_PIN.get(bar):  # the mass centre is laid off from there
        model.body_ipos[model.body_weldid == topology.root[bar]] += shift
    _settle(model)


def _move_closure(topology: Topology, model: mujoco.MjModel, bar: int, shift: Array) -> None:
    if topology.closure is None:
        raise KeyError("closure")
    number, first = topology.closure, topology.first == bar
    end = int((model.eq_obj1id if first else model.eq_obj2id)[number])
    if model.eq_objtype[number] == mujoco.mjtObj.mjOBJ_SITE:
        body = int(model.site_bodyid[end])
        frame = topology.data.xmat[body].reshape(3, 3).T @ _rotate(topology, bar)
        model.site_pos[end] += frame @ shift
        model.site_sameframe[end] = mujoco.mjtSameFrame.mjSAMEFRAME_NONE
        return
    swapped = model.eq_type[number] == mujoco.mjtEq.mjEQ_WELD  # it keeps the second body's anchor first
    start = 0 if first != swapped else 3
    frame = topology.data.xmat[end].reshape(3, 3).T @ _rotate(topology, bar)
    model.eq_data[number, start : start + 3] += frame @ shift


def _correct_gravity(topology: Topology, model: mujoco.MjModel, rest: list[str], value: Value) -> None:
    _switch_on(model, "GRAVITY")
    axis = topology.normal if rest == ["across"] else np.eye(3)[topology.axes["xy".index(rest[0])]]
    model.opt.gravity += axis * (float(value) - np.dot(axis, model.opt.gravity))  # type: ignore[arg-type]


def _pin(topology: Topology, model: mujoco.MjModel, rest: list[str], value: Value) -> None:
    pin, name = rest
    joint = topology.hinge[pin]
    row = joint if name in ("stiffness", "range") else int(model.jnt_dofadr[joint])
    if name in FLAG:
        _switch_on(model, FLAG[name], "PASSIVE")
    if name in OF_PIN:
        getattr(model, OF_PIN[name])[row] = value
    elif name == "range":
        model.jnt_limited[joint] = value != "free"
        model.jnt_range[joint] = value if value != "free" else (0.0, 0.0)
    else:
        field = FIELD_OF[name]
        getattr(model, field)[row if field.startswith("dof") else joint] = value


def _correct_closure(topology: Topology, model: mujoco.MjModel, rest: list[str], value: Value) -> None:
    (name,), number = rest, topology.closure
    if number is None:
        raise KeyError(name)
    if name in SOLREF:
        model.eq_solref[number, SOLREF[name]] = value
    elif name == "impedance":
        model.eq_solimp[number, :2] = value
    elif name == "softness":
        model.body_invweight0[:] *= float(value) / float(describe_model(topology)["closure.softness"])  # type: ignore[arg-type]
    elif name == "impedance when open" and value == "the same":
        model.eq_solimp[number, 1] = model.eq_solimp[number, 0]
    else:
        raise KeyError(name)


def _correct_option(topology: Topology, model: mujoco.MjModel, rest: list[str], value: Value) -> None:
    name = rest[0]
    if name in ENUMERATIONS:
        kind, prefix = ENUMERATIONS[name]
        value = int(getattr(mujoco, kind).__members__[prefix + str(value)])
    if name == "meaninertia":
        model.stat.meaninertia = value
    else:
        now = getattr(model.opt, name)
        setattr(model.opt, name, int(value) if isinstance(now, int) else value)  # type: ignore[arg-type]


def _correct_contacts(topology: Topology, model: mujoco.MjModel, rest: list[str], value: Value) -> None:
    if value != "off":
        raise KeyError("contacts")
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONTACT)


EDITS: Mapping[str, Edit] = {
    "bars": _correct_bar,
    "lengths": _correct_length,
    "gravity": _correct_gravity,
    "pins": _pin,
    "closure": _correct_closure,
    "option": _correct_option,
    "contacts": _correct_contacts,
}
"""Corrections by the first word of a key; actuators and tendons cannot be added to a compiled model."""
