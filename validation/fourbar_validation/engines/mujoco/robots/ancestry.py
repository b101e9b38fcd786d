"""Bodies of a model, the joints between them, and what acts on them."""

from collections.abc import Iterator, Sequence
from itertools import pairwise, permutations
from typing import NamedTuple

import mujoco
import numpy as np

from fourbar.errors import InputError
from fourbar.quantities import Array, Mask

EQUALITY_KINDS = {
    int(getattr(mujoco.mjtEq, f"mjEQ_{name.upper()}")): name
    for name in ("connect", "weld", "joint", "tendon")
}
_CLOSING = (int(mujoco.mjtEq.mjEQ_CONNECT), int(mujoco.mjtEq.mjEQ_WELD))
_ON_JOINTS = (int(mujoco.mjtTrn.mjTRN_JOINT), int(mujoco.mjtTrn.mjTRN_JOINTINPARENT))


def climb(model: mujoco.MjModel, body: int) -> list[int]:
    """List a body and its ancestors up to the world."""
    bodies = [body]
    while bodies[-1]:
        bodies.append(int(model.body_parentid[bodies[-1]]))
    return bodies


def list_joints(model: mujoco.MjModel, body: int) -> range:
    """List the joints of a body in the order in which they turn it."""
    start = int(model.body_jntadr[body])
    return range(start, start + int(model.body_jntnum[body]))


def find_roots(model: mujoco.MjModel, held: set[int]) -> list[int]:
    """Return for each body the highest one that it is rigidly joined to.

    Some joints may be held.
    """
    roots = [0]
    for body in range(1, model.nbody):
        moves = any(joint not in held for joint in list_joints(model, body))
        roots.append(body if moves else roots[model.body_parentid[body]])
    return roots


def list_joints_between(model: mujoco.MjModel, first: int, second: int) -> list[int]:
    """List the joints from one body up to the common ancestor, and down to another.

    MuJoCo counts bodies and joints from the world outwards.
    """
    above = [
        {joint for body in climb(model, end) for joint in list_joints(model, body)}
        for end in (first, second)
    ]
    up, down = above[0] - above[1], above[1] - above[0]
    return [*sorted(up, reverse=True), *sorted(down)]


def list_closing(model: mujoco.MjModel) -> list[int]:
    """List the connects and welds of a model, also those that are switched off."""
    closing: list[int] = np.flatnonzero(np.isin(model.eq_type, _CLOSING)).tolist()
    return closing


def find_tied_bodies(model: mujoco.MjModel, equality: int) -> tuple[int, int]:
    """Return the two bodies of a connect or a weld, or what else is tied."""
    objects = (int(model.eq_obj1id[equality]), int(model.eq_obj2id[equality]))
    if model.eq_objtype[equality] == mujoco.mjtObj.mjOBJ_SITE:
        first, second = model.site_bodyid[[*objects]].tolist()
        return first, second
    return objects


def name_part(model: mujoco.MjModel, kind: str, number: int) -> str:
    """Name a joint, body or tendon: as the file does, or by its number."""
    return getattr(model, kind)(number).name or f"{kind} {number}"


def name_joint(model: mujoco.MjModel, joint: int) -> str:
    """Name a joint: as the file does, or by its number."""
    return name_part(model, "joint", joint)


def name_body(model: mujoco.MjModel, body: int) -> str:
    """Name a body; the world is its own."""
    return name_part(model, "body", body)


def find_named(
    names: Sequence[str], name: str, what: str, option: str, value: str = ""
) -> int:
    """Find the place of a name; an InputError lists what is there.

    `value`: of the option, if it is not the name alone.
    """
    if name in names:
        return names.index(name)
    listed = ", ".join(filter(None, names)) or "none"
    reason = f"no such {what}; the file has: {listed}"
    raise InputError(option, value or name, reason)


class Follower(NamedTuple):
    """Joint that an equality lets follow another, both counted from their rest pose."""

    joint: int
    leader: int
    coefficients: tuple[float, ...]
    """a0 to a4 of the follower's position over the leader's."""


def list_followers(model: mujoco.MjModel, equality: int) -> list[Follower]:
    """List the joints that an equality of joints or a fixed tendon lets follow others.

    A tendon over two joints that is kept at a length, c1 q1 + c2 q2 = a0, lets each of
    them follow the other. By an equality that is switched off none follows.
    """
    kind = model.eq_type[equality]
    first, second = find_tied_bodies(model, equality)
    powers = model.eq_data[equality, :5].tolist()
    if not model.eq_active0[equality]:
        return []
    if kind == mujoco.mjtEq.mjEQ_JOINT and second >= 0:
        return [Follower(first, second, tuple(powers))]
    if kind != mujoco.mjtEq.mjEQ_TENDON or second >= 0:
        return []
    joints = list_tendon_joints(model, first)
    if len(joints) != 2 or not all(joints.values()):
        return []
    return [
        Follower(joint, leader, (powers[0] / factor, -other / factor, 0, 0, 0))
        for (joint, factor), (leader, other) in permutations(joints.items())
    ]


def list_wraps(
    model: mujoco.MjModel, tendon: int
) -> Iterator[tuple[mujoco.mjtWrap, int, float]]:
    """List kind, index and coefficient of each thing that a tendon runs over."""
    first = model.tendon_adr[tendon]
    for wrap in range(first, first + model.tendon_num[tendon]):
        kind = mujoco.mjtWrap(model.wrap_type[wrap])
        yield kind, int(model.wrap_objid[wrap]), float(model.wrap_prm[wrap])


def list_tendon_joints(model: mujoco.MjModel, tendon: int) -> dict[int, float]:
    """Return the coefficient of each joint of a fixed tendon; none of a spatial one.

    A tendon below 0 is none.
    """
    if tendon < 0:
        return {}
    wraps = list_wraps(model, tendon)
    return {
        joint: factor
        for kind, joint, factor in wraps
        if kind == mujoco.mjtWrap.mjWRAP_JOINT
    }


def list_joints_of_tendon(model: mujoco.MjModel, tendon: int) -> set[int]:
    """List the joints on which the length of a tendon depends."""
    joints = {*list_tendon_joints(model, tendon)}
    kinds = mujoco.mjtWrap
    bearers = {
        kinds.mjWRAP_SITE: model.site_bodyid,
        kinds.mjWRAP_SPHERE: model.geom_bodyid,
        kinds.mjWRAP_CYLINDER: model.geom_bodyid,
    }
    for wraps in pairwise(list_wraps(model, tendon)):
        # nothing runs over a pulley, from one branch of the tendon to the next
        if all(kind in bearers for kind, _, _ in wraps):
            ends = (int(bearers[kind][index]) for kind, index, _ in wraps)
            joints.update(list_joints_between(model, *ends))
    return joints


def list_tied_joints(model: mujoco.MjModel, equality: int) -> set[int]:
    """List the joints on which the residual of an equality depends."""
    kind = model.eq_type[equality]
    objects = find_tied_bodies(model, equality)
    if kind in _CLOSING:
        return {*list_joints_between(model, *objects)}
    tied = {one for one in objects if one >= 0}
    if kind == mujoco.mjtEq.mjEQ_JOINT:
        return tied
    return {joint for one in tied for joint in list_joints_of_tendon(model, one)}


def describe_actuator(model: mujoco.MjModel, actuator: int) -> str:
    """Describe an actuator: as the file names it, or by its number."""
    name = model.actuator(actuator).name or f"number {actuator} of the file"
    return f"the actuator {name}"


def list_motors(model: mujoco.MjModel) -> list[int]:
    """List the joints that what takes a control acts on, a joint for each motor."""
    motors = []
    for number in np.flatnonzero(take_control(model)):
        kind = model.actuator_trntype[number]
        target = int(model.actuator_trnid[number, 0])
        if kind in _ON_JOINTS:
            motors.append(target)
        elif kind == mujoco.mjtTrn.mjTRN_TENDON:
            motors += list_tendon_joints(model, target)
    return motors


def list_actuators(model: mujoco.MjModel, joint: int | None) -> list[int]:
    """List the actuators on a joint; none on no joint."""
    of_joints = np.isin(model.actuator_trntype, _ON_JOINTS)
    on_this = model.actuator_trnid[:, 0] == joint
    actuators: list[int] = np.flatnonzero(of_joints & on_this).tolist()
    return actuators


def take_control(model: mujoco.MjModel) -> Mask:
    """Tell motors from loads, springs and dampers that are actuators, (nu,)."""
    return np.asarray(model.actuator_gainprm.any(axis=1))


def find_bits(*flags: str) -> int:
    """Return the bits that switch features off, by the names of <flag>."""
    bits = (getattr(mujoco.mjtDisableBit, f"mjDSBL_{one.upper()}") for one in flags)
    return sum(map(int, bits))


def is_enabled(model: mujoco.MjModel, *flags: str) -> bool:
    """Tell whether no flag switches a feature off."""
    return not model.opt.disableflags & find_bits(*flags)


def list_lifted_masses(model: mujoco.MjModel) -> Array:
    """Return the mass of each body that MuJoCo compensates gravity of, (nbody,), kg.

    Gravity compensation is a passive force: it is off with gravity, and where neither
    springs nor dampers act.
    """
    passive = is_enabled(model, "spring") or is_enabled(model, "damper")
    acts = passive and is_enabled(model, "gravity")
    return np.asarray(model.body_mass * model.body_gravcomp * acts)


def find_ends(model: mujoco.MjModel, data: mujoco.MjData, equality: int) -> list[Array]:
    """Locate both ends of a connect or a weld in world axes, (3,) each, m."""
    if model.eq_objtype[equality] == mujoco.mjtObj.mjOBJ_SITE:
        sites = (model.eq_obj1id[equality], model.eq_obj2id[equality])
        return [data.site_xpos[site].copy() for site in sites]
    anchors = [model.eq_data[equality, 0:3], model.eq_data[equality, 3:6]]
    if model.eq_type[equality] == mujoco.mjtEq.mjEQ_WELD:
        anchors.reverse()  # it keeps the second body's anchor first
    return [
        data.xpos[body] + data.xmat[body].reshape(3, 3) @ anchor
        for body, anchor in zip(find_tied_bodies(model, equality), anchors, strict=True)
    ]
