"""Describe the four-bar of a compiled MJCF under names by which two models can be compared."""

import math
from typing import Any

import mujoco
import numpy as np

from fourbar.linkage import BAR_NAMES, FIRST_PIN, MOVING_BARS
from fourbar_validation.engines.mujoco.attached import (
    Described,
    describe_actuators,
    describe_tendons,
    read_range,
    read_row,
    sum_damping_of_drive,
)
from fourbar_validation.engines.mujoco.model_fields import COUNTED, FLAGS, PIN, list_members, list_of
from fourbar_validation.engines.mujoco.topology import ENDS, Topology

NOT_HERE = ("opt", "stat", "vis")
ENUMERATIONS = {"integrator": ("mjtIntegrator", "mjINT_"), "solver": ("mjtSolver", "mjSOL_")}
OPTIONS = (
    *("timestep", "integrator", "solver", "tolerance", "iterations", "ls_tolerance", "ls_iterations"),
    *("noslip_tolerance", "noslip_iterations", "density", "viscosity", "wind", "sleep_tolerance"),
)


def describe_model(topology: Topology) -> Described:
    """Lengths, masses, pins, closure, drive and options as compiled; numbers in SI and rad."""
    model = topology.model
    result: Described = {"plane": topology.plane}
    for bar, name in BAR_NAMES.items():
        result[f"lengths.{name}"] = topology.length(bar)
    result["lengths.ground_angle"] = topology.ground_angle
    for bar in MOVING_BARS:
        result |= _describe_bar(topology, bar)
    gravity = model.opt.gravity * _is_on(model, "GRAVITY")
    result["gravity.x"], result["gravity.y"] = (float(g) for g in topology.in_plane(gravity))
    result["gravity.across"] = float(gravity @ topology.normal)
    for pin, joint in sorted(topology.hinge.items()):
        result |= _pin(topology, pin, joint)
    result |= _describe_closure(topology)
    result |= _describe_options(model)
    result |= describe_actuators(topology) | describe_tendons(topology)
    others = [
        model.equality(i).name or f"(unnamed {i})"
        for i in range(model.neq)
        if i != topology.closure and model.eq_active0[i]
    ]
    result["other equalities"] = ", ".join(others) or "none"
    result |= {f"others.{name}": float(getattr(model, field, 0)) for field, name in COUNTED.items()}
    for thing in (model, model.opt, model.stat):
        for field in list_members(thing):
            if field not in NOT_HERE and list_of(field) is None:
                result[f"unknown.{field}"] = np.array2string(np.asarray(getattr(thing, field)), threshold=2**10)
    return result


def find_element(topology: Topology) -> dict[str, str]:
    """Part of a key: the element of the user's file that it is of."""
    model = topology.model

    def element(word: str, name: str, number: int) -> str:
        return f'{word} "{name}"' if name else f"{word} {number} (unnamed)"

    result = {f"bars.{BAR_NAMES[bar]}": f'body "{model.body(topology.root[bar]).name}"' for bar in MOVING_BARS}
    for pin, joint in topology.hinge.items():
        result[f"pins.{pin}"] = element("joint", model.joint(joint).name, joint)
    if topology.closure is not None:
        number = topology.closure
        result["closure"] = element(topology.closed_by.partition(" ")[0], model.equality(number).name, number)
    for i in range(len(model.actuator_trntype)):
        result[f"actuators.{i}"] = element("actuator", model.actuator(i).name, i)
    return result | {f"tendons.{i}": element("tendon", model.tendon(i).name, i) for i in range(model.ntendon)}


def _is_on(model: mujoco.MjModel, *features: str) -> bool:
    """Tell whether no flag switches a feature off; a flag that this MuJoCo does not have switches nothing."""
    flags = mujoco.mjtDisableBit
    return not any(model.opt.disableflags & getattr(flags, f"mjDSBL_{name}", 0) for name in features)


def _describe_bar(topology: Topology, bar: int) -> Described:
    """Mass, mass centre from the first pin, and inertia about it, of a body and all that is welded to it."""
    model, data = topology.model, topology.data
    parts = np.flatnonzero(model.body_weldid == topology.root[bar])
    masses = model.body_mass[parts]
    mass = float(masses.sum())
    at = np.array([topology.in_plane(data.xipos[part]) for part in parts])
    centre = masses @ at / mass if mass else at[0]
    inertia = 0.0
    for part, m, x in zip(parts, masses, at, strict=True):
        across = data.ximat[part].reshape(3, 3).T @ topology.normal
        inertia += float(across**2 @ model.body_inertia[part] + m * (x - centre) @ (x - centre))
    arm = centre - topology.in_plane(topology.world(data, bar, FIRST_PIN[bar]))
    x, y = topology.line(data, bar)
    key = f"bars.{BAR_NAMES[bar]}"
    angle = math.remainder(math.atan2(arm[1], arm[0]) - math.atan2(y, x), math.tau) if arm.any() else 0.0
    where = {f"{key}.centre.distance": math.hypot(*arm), f"{key}.centre.angle": angle}
    held = float(masses @ model.body_gravcomp[parts]) / mass if mass else 0.0
    return {f"{key}.mass": mass, f"{key}.inertia": inertia, **where, f"{key}.gravcomp": held}


def _pin(topology: Topology, pin: str, joint: int) -> Described:
    model = topology.model
    dof = model.jnt_dofadr[joint]
    spring, damper = (float(_is_on(model, name, "PASSIVE")) for name in ("SPRING", "DAMPER"))
    key = f"pins.{pin}"
    result: Described = {
        f"{key}.damping": damper * float(model.dof_damping[dof]),
        f"{key}.friction": float(model.dof_frictionloss[dof]) * _is_on(model, "FRICTIONLOSS"),
        f"{key}.stiffness": spring * float(model.jnt_stiffness[joint]),
        f"{key}.armature": float(model.dof_armature[dof]),
        f"{key}.positive": "counter-clockwise" if topology.sense[pin] > 0 else "clockwise",
    }
    address = model.jnt_qposadr[joint]
    turned = topology.sense[pin] * float(model.qpos_spring[address] - model.qpos0[address])
    result[f"{key}.spring angle"] = topology.rest_angle(pin) + turned
    for field, name in PIN.items():
        result |= read_row(model, field, dof if field.startswith("dof") else joint, f"{key}.{name}")
    for field in ("jnt_range", "jnt_actfrcrange"):
        result |= read_range(model, field, joint, key, switched_on=field != "jnt_range" or _is_on(model, "LIMIT"))
    return result | sum_damping_of_drive(topology, pin)


def _describe_closure(topology: Topology) -> Described:
    model, number = topology.model, topology.closure
    result: Described = {"closure.pin": topology.cut, "closure.by": topology.closed_by}
    first, second = (bar for bar, ends in ENDS.items() if topology.cut in ends)
    gap = topology.world(topology.data, first, topology.cut) - topology.world(topology.data, second, topology.cut)
    result["closure.out of plane"] = abs(float(gap @ topology.normal))
    if number is None:
        return result
    bodies = (model.eq_obj1id[number], model.eq_obj2id[number])
    if model.eq_objtype[number] == mujoco.mjtObj.mjOBJ_SITE:
        bodies = tuple(model.site_bodyid[list(bodies)])
    first_d, last_d, *opening = (float(x) for x in model.eq_solimp[number])
    impedance = float(np.clip(first_d, 1e-4, 0.9999))
    softness = (1.0 - impedance) / impedance * float(model.body_invweight0[list(bodies), 0].sum())
    names = ("time constant", "damping ratio")
    result |= {f"closure.{name}": float(x) for name, x in zip(names, model.eq_solref[number], strict=True)}
    result["closure.impedance"], result["closure.softness"] = impedance, softness
    result["closure.impedance when open"] = "the same" if first_d == last_d else (last_d, *opening)
    return result


def _describe_options(model: mujoco.MjModel) -> Described:
    option = model.opt
    result: Described = {}
    for name in OPTIONS:
        kept: Any = getattr(option, name, None)
        if name in ENUMERATIONS:
            kind, prefix = ENUMERATIONS[name]
            result[f"option.{name}"] = getattr(mujoco, kind)(kept).name.removeprefix(prefix)
        elif kept is not None:
            result[f"option.{name}"] = float(kept) if np.ndim(kept) == 0 else tuple(map(float, kept))
    result["option.meaninertia"] = float(model.stat.meaninertia)
    for state, flags, prefix in (("off", mujoco.mjtDisableBit, "mjDSBL_"), ("on", mujoco.mjtEnableBit, "mjENBL_")):
        bits = getattr(option, "disableflags" if state == "off" else "enableflags")
        names = [name for name in flags.__members__ if name.startswith(prefix)]
        named = [name.removeprefix(prefix) for name in names if bits & int(flags.__members__[name])]
        names = [name.lower() for name in named if name not in FLAGS]
        result[f"option.switched {state}"] = ", ".join(names) or "nothing that matters here"
    groups = [str(group) for group in range(31) if option.disableactuator >> group & 1]
    result["option.actuatorgroupdisable"] = " ".join(groups) or "none"
    possible = _is_on(model, "CONTACT") and (model.npair or (model.geom_contype.any() and model.geom_conaffinity.any()))
    return result | {"contacts": "possible" if possible else "off"}
