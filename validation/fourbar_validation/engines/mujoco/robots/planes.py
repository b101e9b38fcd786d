"""Closures of a loop whose hinges are parallel, seen in the plane of its motion.

Nothing moves the ends of such a closure along the axes, or tilts them: what is left
there decides neither whether the loop closes nor how it moves. Forces are read from
MuJoCo's arrays: of a body's bearer on it, and of an equality.
"""

import math
from collections.abc import Iterable, Mapping, Set
from copy import copy

import mujoco
import numpy as np

from fourbar.quantities import Array, Indices
from fourbar_validation.engines.mujoco.closed_loop import find_site_load
from fourbar_validation.engines.mujoco.robots.ancestry import (
    find_bits,
    find_tied_bodies,
    list_closing,
    list_joints_between,
    list_lifted_masses,
)

PARALLEL = math.radians(0.5)
"""Largest angle between the axes of a planar linkage, rad. Beyond it forces across the
plane reach a hundredth.
"""


def find_mean_axis(data: mujoco.MjData, hinges: Iterable[int]) -> Array:
    """Return the mean direction of the axes of hinges, up to its sign, (3,)."""
    axes = data.xaxis[[*hinges]]
    axes = axes * np.sign(axes @ axes[0])[:, None]
    total = axes.sum(axis=0)
    return np.asarray(total / np.linalg.norm(total))


def find_normals(
    model: mujoco.MjModel,
    data: mujoco.MjData,
    held: Set[int],
) -> dict[int, Array]:
    """Return the normal of the plane of each connect and weld that moves in one, (3,).

    `held`: joints that stay where they are.
    """
    normals = {}
    for number in list_closing(model):
        ends = find_tied_bodies(model, number)
        joints = [j for j in list_joints_between(model, *ends) if j not in held]
        hinges = model.jnt_type[joints] == mujoco.mjtJoint.mjJNT_HINGE
        if not joints or not hinges.all():
            continue
        normal = find_mean_axis(data, joints)
        tilts = np.linalg.norm(np.cross(data.xaxis[joints], normal), axis=1)
        if tilts.max() <= math.sin(PARALLEL):
            normals[number] = normal
    return normals


def evaluate_closures(
    model: mujoco.MjModel,
    data: mujoco.MjData,
    normals: Mapping[int, Array],
) -> tuple[Array, Array]:
    """Return residual (m,) and Jacobian (m, nv) of all equalities in a placed state.

    What no planar motion changes is left out: of the first three rows of a connect or
    a weld, a shift, the part along the normal, and of three more of a weld, a turn,
    the parts across it. The derivative of the model is dense.

    Parameters
    ----------
    normals : of the plane of each equality that has one, by its number.
    """
    jacobian = data.efc_J.reshape(-1, model.nv)[: data.ne]
    values = np.column_stack([data.efc_pos[: data.ne], jacobian])
    for number, normal in normals.items():
        rows = _find_rows(data, number)
        if not len(rows):  # it is switched off
            continue
        values[rows[:3]] -= np.outer(normal, normal) @ values[rows[:3]]
        if len(rows) == len(normal):
            continue
        # MuJoCo states the turn of a weld in the axes of its second body or site
        second = model.eq_obj2id[number]
        by_sites = model.eq_objtype[number] == mujoco.mjtObj.mjOBJ_SITE
        axes = data.site_xmat[second] if by_sites else data.xmat[second]
        turned = axes.reshape(3, 3).T @ normal
        values[rows[3:]] = np.outer(turned, turned) @ values[rows[3:]]
    return values[:, 0], values[:, 1:]


def _find_rows(data: mujoco.MjData, equality: int) -> Indices:
    """Return the rows of an equality in MuJoCo's arrays; none if it is switched off."""
    return np.flatnonzero(data.efc_id[: data.ne] == equality)


def copy_for_closures(
    model: mujoco.MjModel,
    closures: Iterable[int],
) -> mujoco.MjModel:
    """Copy a model so that closures are its only constraints beside dry friction.

    The derivative is dense.
    """
    alone = copy(model)
    alone.opt.jacobian = mujoco.mjtJacobian.mjJAC_DENSE
    alone.opt.disableflags |= find_bits("contact", "limit", "island")
    alone.eq_active0[:] = 0
    alone.eq_active0[[*closures]] = 1
    return alone


def find_bearer_forces(model: mujoco.MjModel, data: mujoco.MjData) -> Array:
    """Return the force of each body's bearer on it, world axes, (nbody, 3), N.

    MuJoCo's `cfrc_int` balances the forces that it knows of. Those of actuators on
    sites and of gravity compensation are generalized forces to it, which it would count
    into what the bearer exerts; here they are applied to the bodies.
    """
    applied = data.xfrc_applied.copy()
    on_sites = model.actuator_trntype == mujoco.mjtTrn.mjTRN_SITE
    for load in np.flatnonzero(on_sites).tolist():
        body = model.site_bodyid[model.actuator_trnid[load, 0]]
        data.xfrc_applied[body, :3] += find_site_load(model, data, load)()
    data.xfrc_applied[:, :3] -= np.outer(list_lifted_masses(model), model.opt.gravity)
    mujoco.mj_rnePostConstraint(model, data)
    data.xfrc_applied[:] = applied
    return np.array(data.cfrc_int[:, 3:])


def read_equality_force(data: mujoco.MjData, equality: int) -> Array:
    """Return the force of a connect or a weld on its first body, world axes, (3,), N.

    An equality that is switched off has no rows: its force is NaN.
    """
    rows = _find_rows(data, equality)
    return np.array(data.efc_force[rows[:3]]) if len(rows) else np.full(3, np.nan)
