"""List every field of a compiled model: under which key two models are compared by it, or why it adds nothing.

The lists are complete for the MuJoCo of this harness (a test reads the fields off the model itself); a field of
another MuJoCo that no list knows is compared as it stands.
"""

from fnmatch import fnmatchcase
from functools import cache
from typing import Any

PIN = {
    "jnt_stiffnesspoly": "stiffness of higher order",
    "jnt_springyield": "springyield",
    "jnt_solref": "solreflimit",
    "jnt_solimp": "solimplimit",
    "jnt_margin": "margin",
    "jnt_actgravcomp": "actuatorgravcomp",
    "dof_dampingpoly": "damping of higher order",
    "dof_solref": "solreffriction",
    "dof_solimp": "solimpfriction",
}
"""Hinge properties as pairs (field of MjModel, attribute in MJCF)."""
TENDON = {
    "tendon_stiffness": "stiffness",
    "tendon_stiffnesspoly": "stiffness of higher order",
    "tendon_springyield": "springyield",
    "tendon_damping": "damping",
    "tendon_dampingpoly": "damping of higher order",
    "tendon_frictionloss": "frictionloss",
    "tendon_solref_fri": "solreffriction",
    "tendon_solimp_fri": "solimpfriction",
    "tendon_solref_lim": "solreflimit",
    "tendon_solimp_lim": "solimplimit",
    "tendon_margin": "margin",
    "tendon_armature": "armature",
}
ACTUATOR = {
    "actuator_biastype": "biastype",
    "actuator_dyntype": "dyntype",
    "actuator_dynprm": "dynprm",
    "actuator_actearly": "actearly",
    "actuator_damping": "damping",
    "actuator_dampingpoly": "damping of higher order",
    "actuator_armature": "armature",
    "actuator_group": "group",
    "actuator_cranklength": "cranklength",
}
RANGES = {
    "jnt_range": ("jnt_limited", "range"),
    "jnt_actfrcrange": ("jnt_actfrclimited", "actuatorfrcrange"),
    "tendon_range": ("tendon_limited", "range"),
    "tendon_actfrcrange": ("tendon_actfrclimited", "actuatorfrcrange"),
    "actuator_forcerange": ("actuator_forcelimited", "forcerange"),
    "actuator_ctrlrange": ("actuator_ctrllimited", "ctrlrange"),
    "actuator_actrange": ("actuator_actlimited", "actrange"),
}
"""Fields, each with the field that says whether it holds."""
COUNTED = {"nflex": "flexes", "nplugin": "plugins"}
"""Elements that the generated file never has: any of them is a difference."""

_KEYS = {"jnt": "pins", "dof": "pins", "tendon": "tendons", "actuator": "actuators"}
_DIRECT = {**PIN, **TENDON, **ACTUATOR, **{field: name for field, (_, name) in RANGES.items()}}
COMPARED = {
    **{field: f"{_KEYS[field.partition('_')[0]]}.*.{name}" for field, name in _DIRECT.items()},
    **{on: f"{_KEYS[on.partition('_')[0]]}.*.{name}" for on, name in RANGES.values()},
    **{field: f"others.{name}" for field, name in COUNTED.items()},
    "body_mass": "bars.*.mass",
    "body_inertia": "bars.*.inertia",
    "body_iquat": "bars.*.inertia",
    "body_ipos": "bars.*.centre.*",
    "body_gravcomp": "bars.*.gravcomp",
    "body_pos": "lengths.*",
    "body_quat": "lengths.*",
    "body_invweight0": "closure.softness",
    "jnt_pos": "lengths.*",
    "jnt_axis": "pins.*.positive",
    "jnt_stiffness": "pins.*.stiffness",
    "qpos0": "pins.*.spring angle",
    "qpos_spring": "pins.*.spring angle",
    "dof_damping": "pins.*.damping",
    "dof_frictionloss": "pins.*.friction",
    "dof_armature": "pins.*.armature",
    "site_pos": "lengths.*",
    "site_quat": "actuators.*.gear",
    "site_bodyid": "actuators.*",
    "eq_active0": "closure.by",
    "eq_type": "closure.by",
    "eq_solref": "closure.*",
    "eq_solimp": "closure.*",
    "eq_data": "lengths.*",
    "eq_obj1id": "closure.pin",
    "eq_obj2id": "closure.pin",
    "eq_objtype": "closure.by",
    "actuator_trntype": "actuators.*",
    "actuator_trnid": "actuators.*",
    "actuator_gear": "actuators.*.gear",
    "actuator_biasprm": "actuators.*.gear",
    "tendon_lengthspring": "tendons.*.springlength",
    "wrap_type": "tendons.*",
    "wrap_objid": "tendons.*",
    "wrap_prm": "tendons.*.path",
    **{name: f"option.{name}" for name in ("timestep", "integrator", "solver", "tolerance", "iterations")},
    **{name: f"option.{name}" for name in ("ls_tolerance", "ls_iterations", "noslip_tolerance", "noslip_iterations")},
    **{name: f"option.{name}" for name in ("density", "viscosity", "wind", "sleep_tolerance", "meaninertia")},
    "gravity": "gravity.*",
    "disableflags": "option.switched off",
    "enableflags": "option.switched on",
    "disableactuator": "option.actuatorgroupdisable",
}
"""Field of MjModel, MjOption or MjStatistic: the key of the description that a change in it changes."""

GATED = {
    **dict.fromkeys(("geom_*", "pair_*", "npair", "exclude_*", "nexclude", "hfield_*", "mesh_*", "oct_*"), "contacts"),
    **dict.fromkeys(("body_contype", "body_conaffinity", "body_margin", "bvh_*", "body_bvh*"), "contacts"),
    **dict.fromkeys(("impratio", "cone", "ccd_*", "o_*", "sdf_*", "flg_surfacevel", "flg_adhesion"), "contacts"),
    **dict.fromkeys(("flex*", "efm*"), "others.flexes"),
    **dict.fromkeys(("plugin*", "*_plugin"), "others.plugins"),
    "tree_sleep_policy": "option.switched on",
    "actuator_lengthrange": "actuators.*.biastype",
}
"""Acts only where this key differs too: the generated file has no contact, medium, flex, plugin, sleep or muscle."""

FOLLOWS = {
    "*_M0": "masses, inertias and lengths",
    "dof_invweight0": "masses, inertias and lengths",
    "tendon_invweight0": "masses, inertias and lengths",
    "dof_length": "lengths",
    "body_subtreemass": "masses",
    "actuator_acc0": "masses and gear",
    "*_length0": "lengths",
    "flg_gravcomp": "gravcomp of the bodies",
    "*_sameframe": "positions and orientations",
    "body_simple": "the tree of bodies",
    **dict.fromkeys(("*adr", "*num", "tree_*", "B_*", "D_*", "M_*", "map*", "ten_J_*"), "the tree of bodies"),
    **dict.fromkeys(("body_*id", "jnt_*id", "dof_*id", "tendon_tree*", "tendon_*id"), "the tree of bodies"),
    "jnt_type": "three hinges: every other joint is refused",
    "tendon_type": "what a tendon runs over",
    "signature": "everything: it is a checksum",
}
"""Compiled from what is compared, and restored from it: the message names the cause."""

CANNOT_ACT = {
    **dict.fromkeys(("opt", "stat"), "is compared field by field"),
    "n[a-zA-Z]*": "a number of things, which are compared themselves; or a name",
    **dict.fromkeys(("vis", "cam_*", "light_*", "mat_*", "tex_*", "skin_*", "*_rgba"), "is for the eye"),
    **dict.fromkeys(("*_matid", "tendon_width", "site_size", "site_type", "site_dataid"), "is for the eye"),
    **dict.fromkeys(("site_group", "jnt_group", "tendon_group"), "is for the eye"),
    **dict.fromkeys(("center", "extent", "meanmass", "meansize"), "sets the camera and the size of what is drawn"),
    "paths": "where textures lie",
    "sensor_*": "is read, and moves nothing",
    "magnetic": "is read by a sensor alone",
    "key_*": "a state to start from: positions and speeds are found here",
    **dict.fromkeys(("*_user", "text_*", "tuple_*"), "data of the user's own"),
    "jacobian": "dense or sparse: the same sums, up to round-off",
    **dict.fromkeys(
        ("actuator_gain*", "actuator_ctrlspec", "actuator_delay", "actuator_history"), "no control is given"
    ),
}
"""Fields that move no bar and bear on no pin, each with the reason."""

FLAGS = {
    **dict.fromkeys(("GRAVITY", "SPRING", "DAMPER", "PASSIVE", "FRICTIONLOSS", "LIMIT"), "counts in the values"),
    **dict.fromkeys(("CONTACT", "FILTERPARENT", "MIDPHASE", "NATIVECCD", "MULTICCD", "OVERRIDE"), "counts in contacts"),
    **dict.fromkeys(("IPC", "SPECULATIVE"), "counts in contacts"),
    **dict.fromkeys(("SENSOR", "ENERGY"), "is read, and moves nothing"),
    **dict.fromkeys(("FWDINV", "INVDISCRETE"), "of inverse dynamics, which plays no part"),
    "CLAMPCTRL": "no control is given",
    "ISLAND": "the same equations in parts, up to round-off",
}
"""Bits of disableflags and enableflags that are not named, and why."""


def list_members(thing: Any) -> list[str]:
    """List the fields of a model or of its options, read off the object itself."""
    return [name for name in dir(thing) if not name.startswith("_") and not callable(getattr(thing, name))]


@cache
def list_of(field: str) -> str | None:
    """Find the list that knows a field, the first that fits; None: no list does."""
    if field in COMPARED:
        return "COMPARED"
    lists = {"GATED": GATED, "CANNOT_ACT": CANNOT_ACT, "FOLLOWS": FOLLOWS}
    return next((name for name, known in lists.items() if any(fnmatchcase(field, each) for each in known)), None)
