"""Describe what is attached to the bars of a compiled MJCF: actuators that are loads, tendons, limits."""

from collections.abc import Sequence

import mujoco
import numpy as np

from fourbar.linkage import BAR_NAMES, MOVING_BARS
from fourbar_validation.compare.answer import Array
from fourbar_validation.engines.mujoco.model_fields import ACTUATOR, RANGES, TENDON
from fourbar_validation.engines.mujoco.topology import Topology

Value = float | str | tuple[float, ...]
Described = dict[str, Value]
ACTUATOR_RANGES = ("actuator_forcerange", "actuator_ctrlrange", "actuator_actrange")
DRIVE = {"actuator_damping": "drive damping", "actuator_dampingpoly": "drive damping of higher order"}
"""Fields of an actuator on the crank that remain when its gain and bias are taken off."""


def read_row(model: mujoco.MjModel, field: str, row: int, key: str) -> Described:
    """Read one row of a field as it stands; nothing where this MuJoCo does not have it."""
    if not hasattr(model, field):
        return {}
    return {key: _read_numbers(getattr(model, field)[row])}


def _read_numbers(entry: Array) -> Value:
    return float(entry) if np.ndim(entry) == 0 else tuple(float(x) for x in entry)


def read_range(model: mujoco.MjModel, field: str, row: int, key: str, *, switched_on: bool = True) -> Described:
    """Read a range, or "free" where it does not hold."""
    holds, name = RANGES[field]
    if not hasattr(model, field):
        return {}
    free = not switched_on or not getattr(model, holds)[row]
    return {f"{key}.{name}": "free" if free else _read_numbers(getattr(model, field)[row])}


def sum_damping_of_drive(topology: Topology, pin: str) -> Described:
    """Damping that actuators on the crank's pin bring along."""
    model = topology.model
    if pin != "O2":
        return {}
    return {
        f"pins.O2.{name}": _read_numbers(getattr(model, field)[topology.drives()].sum(axis=0))
        for field, name in DRIVE.items()
        if hasattr(model, field)
    }


def describe_actuators(topology: Topology) -> Described:
    """Describe every actuator but the drive, which is taken off: what it acts on, where, and with which wrench."""
    model, result = topology.model, Described()
    for i in sorted({*range(len(model.actuator_trntype))} - {*topology.drives()}):
        key = f"actuators.{i}"
        result[f"{key}.name"] = model.actuator(i).name
        out = int(model.actuator_outadr[i]) if hasattr(model, "actuator_outadr") else i
        gear = model.actuator_gear[out] * model.actuator_biasprm[i, 0]  # a control is 0: the bias is all there is
        site, frame = (int(number) for number in model.actuator_trnid[i])
        if model.actuator_trntype[i] == mujoco.mjtTrn.mjTRN_SITE:
            result |= _resolve_at_site(topology, key, gear, site, frame)
        else:
            result[key] = _describe_target(topology, i)
            result[f"{key}.gear"] = _read_numbers(gear)
        result[f"{key}.biasprm"] = _read_numbers(model.actuator_biasprm[i, 1:])
        for field, name in ACTUATOR.items():
            result |= read_row(model, field, i, f"{key}.{name}")
        for field in ACTUATOR_RANGES:
            result |= read_range(model, field, i, key)
    return result


def _resolve_at_site(topology: Topology, key: str, gear: Array, site: int, frame: int) -> Described:
    """Resolve a force along and across the linkage's plane in the axes that it keeps, (Fx, Fy, Fz, Mx, My, Mz)."""
    model, data = topology.model, topology.data
    bar, bearer = topology.bar(model.site_bodyid[site]), topology.bar(model.site_bodyid[frame if frame >= 0 else site])
    axes = data.site_xmat[frame if frame >= 0 else site].reshape(3, 3)
    wrench: list[float] = []
    for vector in (axes @ gear[:3], axes @ gear[3:]):
        x, y = topology.turned_back(bearer, vector) if bearer in MOVING_BARS else topology.in_plane(vector)
        wrench += [float(x), float(y), float(vector @ topology.normal)]
    name = "no bar" if bar is None else f"the {BAR_NAMES[bar]}"
    turning = f"axes of the {BAR_NAMES[bearer]}" if bearer in MOVING_BARS else "world axes"
    at: Value = "anywhere: it has no force"
    if bar is not None and any(wrench[:3]):
        at = topology.along_bar(bar, data.site_xpos[site])
    return {key: f"a site of {name}, in {turning}", f"{key}.site": at, f"{key}.gear": tuple(wrench)}


def _describe_target(topology: Topology, actuator: int) -> str:
    model = topology.model
    kind, number = model.actuator_trntype[actuator], int(model.actuator_trnid[actuator, 0])
    if kind in (mujoco.mjtTrn.mjTRN_JOINT, mujoco.mjtTrn.mjTRN_JOINTINPARENT):
        return f"pin {next(pin for pin, joint in topology.hinge.items() if joint == number)}"
    return str(mujoco.mjtTrn(kind).name).removeprefix("mjTRN_").lower()


def describe_tendons(topology: Topology) -> Described:
    """Describe every tendon: over which pins or between which points, and what it does."""
    model, result = topology.model, Described()
    for i in range(model.ntendon):
        key = f"tendons.{i}"
        result[f"{key}.name"] = model.tendon(i).name
        run = range(model.tendon_adr[i], model.tendon_adr[i] + model.tendon_num[i])
        spring = [float(x) for x in model.tendon_lengthspring[i]]
        if model.wrap_type[run[0]] == mujoco.mjtWrap.mjWRAP_JOINT:
            result |= _read_fixed_tendon(topology, key, run, spring, float(model.tendon_length0[i]))
        else:
            result |= _read_spatial_tendon(topology, key, run)
            result[f"{key}.springlength"] = tuple(spring)
        for field, name in TENDON.items():
            result |= read_row(model, field, i, f"{key}.{name}")
        for field in ("tendon_range", "tendon_actfrcrange"):
            result |= read_range(model, field, i, key)
    return result


def _read_fixed_tendon(topology: Topology, key: str, run: range, spring: Sequence[float], rest: float) -> Described:
    """Read a fixed tendon: coefficients by pin, counter-clockwise positive; its spring by the angles of the bars."""
    model, turns = topology.model, {}
    for pin, joint in topology.hinge.items():
        coefficients = [float(model.wrap_prm[w]) for w in run if model.wrap_objid[w] == joint]
        if coefficients:
            turns[pin] = topology.sense[pin] * sum(coefficients)
    at_rest = sum(turn * topology.rest_angle(pin) for pin, turn in turns.items())
    pins = sorted(turns)
    return {
        key: f"over the pins {', '.join(pins)}",
        f"{key}.path": tuple(turns[pin] for pin in pins),
        f"{key}.springlength angle": tuple(length - rest + at_rest for length in spring),
    }


def _read_spatial_tendon(topology: Topology, key: str, run: range) -> Described:
    """Read a spatial tendon: the points of the bars that it runs through; what it winds round counts as no point."""
    model, data = topology.model, topology.data
    bars, path = [], []
    for w in run:
        if model.wrap_type[w] != mujoco.mjtWrap.mjWRAP_SITE:
            bars.append(mujoco.mjtWrap(model.wrap_type[w]).name.removeprefix("mjWRAP_").lower())
            path += [float(model.wrap_prm[w])]
            continue
        site = int(model.wrap_objid[w])
        bar = topology.bar(model.site_bodyid[site])
        bars.append("no bar" if bar is None else BAR_NAMES[bar])
        path += () if bar is None else topology.along_bar(bar, data.site_xpos[site])
    return {key: f"from {' to '.join(bars)}", f"{key}.path": tuple(path)}
