"""What a compiled MJCF says of a four-bar, under names that two models can be compared by."""

import math

import mujoco
import numpy as np

from fourbar.linkage import BAR_NAMES, FIRST_PIN, MOVING_BARS
from validation.engines.mujoco.anatomy import ENDS, Anatomy

Described = dict[str, float | str]


def described(anatomy: Anatomy) -> Described:
    """Lengths, masses, pins, closure, drive and options as compiled; numbers in SI and rad."""
    model = anatomy.model
    found: Described = {"plane": anatomy.plane}
    for bar, name in BAR_NAMES.items():
        found[f"lengths.{name}"] = anatomy.length(bar)
    found["lengths.ground_angle"] = anatomy.ground_angle
    for bar in MOVING_BARS:
        found |= _bar(anatomy, bar)
    on = not model.opt.disableflags & mujoco.mjtDisableBit.mjDSBL_GRAVITY
    gravity = model.opt.gravity if on else np.zeros(3)
    found["gravity.x"], found["gravity.y"] = (float(g) for g in anatomy.in_plane(gravity))
    found["gravity.across"] = float(gravity @ anatomy.normal)
    for pin, joint in sorted(anatomy.hinge.items()):
        found |= _pin(anatomy, pin, joint)
    found |= _closure(anatomy)
    found |= _options(model)
    names = [model.actuator(i).name or f"(unnamed {i})" for i in range(model.nu)]
    found["actuators"] = ", ".join(names) or "none"
    found["tendons"] = float(model.ntendon)
    others = [
        model.equality(i).name or f"(unnamed {i})"
        for i in range(model.neq)
        if i != anatomy.closure and model.eq_active0[i]
    ]
    found["other equalities"] = ", ".join(others) or "none"
    return found


def _bar(anatomy: Anatomy, bar: int) -> Described:
    """Mass, mass centre from the first pin, and inertia about it, of a body and all that is welded to it."""
    model, data = anatomy.model, anatomy.data
    parts = np.flatnonzero(model.body_weldid == anatomy.root[bar])
    masses = model.body_mass[parts]
    mass = float(masses.sum())
    at = np.array([anatomy.in_plane(data.xipos[part]) for part in parts])
    centre = masses @ at / mass if mass else at[0]
    inertia = 0.0
    for part, m, x in zip(parts, masses, at, strict=True):
        across = data.ximat[part].reshape(3, 3).T @ anatomy.normal
        inertia += float(across**2 @ model.body_inertia[part] + m * (x - centre) @ (x - centre))
    arm = centre - anatomy.in_plane(anatomy.world(data, bar, FIRST_PIN[bar]))
    x, y = anatomy.line(data, bar)
    key = f"bars.{BAR_NAMES[bar]}"
    angle = math.remainder(math.atan2(arm[1], arm[0]) - math.atan2(y, x), math.tau) if arm.any() else 0.0
    where = {f"{key}.centre.distance": math.hypot(*arm), f"{key}.centre.angle": angle}
    return {f"{key}.mass": mass, f"{key}.inertia": inertia, **where}


def _pin(anatomy: Anatomy, pin: str, joint: int) -> Described:
    model = anatomy.model
    dof = model.jnt_dofadr[joint]
    found: Described = {
        f"pins.{pin}.damping": float(model.dof_damping[dof]),
        f"pins.{pin}.friction": float(model.dof_frictionloss[dof]),
        f"pins.{pin}.stiffness": float(model.jnt_stiffness[joint]),
        f"pins.{pin}.armature": float(model.dof_armature[dof]),
        f"pins.{pin}.positive": "counter-clockwise" if anatomy.sense[pin] > 0 else "clockwise",
    }
    limited = model.jnt_limited[joint] and not model.opt.disableflags & mujoco.mjtDisableBit.mjDSBL_LIMIT
    low, high = model.jnt_range[joint]
    found[f"pins.{pin}.range"] = f"{low:g} .. {high:g} rad" if limited else "free"
    return found


def _closure(anatomy: Anatomy) -> Described:
    model, number = anatomy.model, anatomy.closure
    found: Described = {"closure.pin": anatomy.cut, "closure.by": anatomy.closed_by}
    first, second = (bar for bar, ends in ENDS.items() if anatomy.cut in ends)
    gap = anatomy.world(anatomy.data, first, anatomy.cut) - anatomy.world(anatomy.data, second, anatomy.cut)
    found["closure.out of plane"] = abs(float(gap @ anatomy.normal))
    if number is None:
        return found
    bodies = (model.eq_obj1id[number], model.eq_obj2id[number])
    if model.eq_objtype[number] == mujoco.mjtObj.mjOBJ_SITE:
        bodies = tuple(model.site_bodyid[list(bodies)])
    impedance = float(np.clip(model.eq_solimp[number, 0], 1e-4, 0.9999))
    softness = (1.0 - impedance) / impedance * float(model.body_invweight0[list(bodies), 0].sum())
    names = ("time constant", "damping ratio")
    found |= {f"closure.{name}": float(x) for name, x in zip(names, model.eq_solref[number], strict=True)}
    found["closure.impedance"], found["closure.softness"] = impedance, softness
    return found


def _options(model: mujoco.MjModel) -> Described:
    option, flags = model.opt, mujoco.mjtDisableBit
    contacts = not option.disableflags & flags.mjDSBL_CONTACT and bool(
        model.npair or (model.geom_contype.any() and model.geom_conaffinity.any())
    )
    watched = ("CONSTRAINT", "EQUALITY", "ACTUATION", "REFSAFE", "AUTORESET")
    off = [name.lower() for name in watched if option.disableflags & getattr(flags, f"mjDSBL_{name}")]
    return {
        "option.timestep": float(option.timestep),
        "option.integrator": mujoco.mjtIntegrator(option.integrator).name.removeprefix("mjINT_"),
        "option.solver": mujoco.mjtSolver(option.solver).name.removeprefix("mjSOL_"),
        "option.tolerance": float(option.tolerance),
        "option.iterations": float(option.iterations),
        "option.medium": "none" if option.density == option.viscosity == 0.0 else "has density or viscosity",
        "option.switched off": ", ".join(off) or "nothing that matters here",
        "contacts": "possible" if contacts else "off",
    }
