"""Two compiled models are compared by every field that MuJoCo has: each is distinguished, or it cannot act."""

import copy
import re
from collections.abc import Iterator
from fnmatch import fnmatchcase
from functools import cache
from typing import Any

import mujoco
import numpy as np
import pytest

from fourbar.effects import Friction, Gravity, Spring, SpringEnd, Springs, Torsion, Viscous
from fourbar.errors import InputError
from fourbar.linkage import PINS
from fourbar.mjcf import write_mjcf
from fourbar_validation.check.differences import find_differences
from fourbar_validation.engines.mujoco import model_fields
from fourbar_validation.engines.mujoco.attached import Described
from fourbar_validation.engines.mujoco.describe import describe_model
from fourbar_validation.engines.mujoco.model_fields import COMPARED, list_members, list_of
from fourbar_validation.engines.mujoco.topology import Topology
from tests.support.scenes import crank_rocker

SPRING = Spring(SpringEnd(1, 0.1, -1.5), SpringEnd(4, 0.08, 0.2), 200.0, 0.05)
EVERYTHING = crank_rocker(
    effects=(
        Gravity(),
        Viscous(tuple((pin, 0.01) for pin in PINS)),
        Friction(tuple((pin, 0.02) for pin in PINS)),
        Torsion.at(O2=(0.3, 0.4, 0.0), A=(0.3, 0.4, 0.0), B=(0.3, 0.4, 0.0), O4=(0.3, 0.4, 0.0)),
        Springs((SPRING,)),
    )
)
GENERATED = write_mjcf(EVERYTHING)
ANCHORED = re.sub(
    '(mass="0.4") diaginertia="[^"]*"', r'\1 axisangle="1 0 0 0.3" diaginertia="3e-3 2e-3 4e-3"', GENERATED
)
ANCHORED = ANCHORED.replace('<site name="O2"', '<site name="O2" axisangle="0 0 1 0.3"')
ANCHORED = ANCHORED.replace('site1="B3" site2="B4"', 'body1="coupler" body2="output" anchor="0.25 0 0"')
"""Closed by body anchors, axes of inertia and of loads turned."""
DIRECT = {*model_fields.PIN, *model_fields.TENDON, *model_fields.ACTUATOR, *model_fields.RANGES}
"""Compared as they stand: no element of them may be missed, but for those of the drive, which is taken off."""
DRIVE = 0
"""The row of the drive among the actuators."""


def compiled(text: str) -> mujoco.MjModel:
    """A model of one's own with everything switched on that a field could hang on."""
    return copy.copy(_compiled(text))


@cache
def _compiled(text: str) -> mujoco.MjModel:
    model = mujoco.MjModel.from_xml_string(text)
    for on, (holds, _) in model_fields.RANGES.items():
        getattr(model, holds)[:] = True
        getattr(model, on)[:] = (-9.0, 9.0)
    model.tendon_frictionloss[:] = 0.02
    model.actuator_dyntype[:] = mujoco.mjtDyn.mjDYN_FILTER
    model.eq_solimp[0, :2] = 0.9, 0.95
    model.opt.tolerance, model.opt.noslip_iterations, model.opt.density = 1e-8, 3, 1.2
    model.opt.enableflags |= int(mujoco.mjtEnableBit.mjENBL_SLEEP)
    model.opt.disableflags &= ~int(mujoco.mjtDisableBit.mjDSBL_LIMIT)
    return model


@cache
def written(text: str) -> Described:
    return describe_model(Topology(compiled(text), {}))


def where(model: mujoco.MjModel, field: str) -> Any:
    """The part of a model that has a field."""
    return next(thing for thing in (model, model.opt, model.stat) if hasattr(thing, field))


ALL = [
    field
    for thing in (compiled(GENERATED), compiled(GENERATED).opt, compiled(GENERATED).stat)
    for field in list_members(thing)
]


def differing(text: str, field: str, element: int) -> Iterator[str]:
    """The keys that differ when one element of a field has other values; "refused" where that is no four-bar."""
    was = np.ravel(getattr(where(compiled(text), field), field))[element]
    for value in (not was,) if was.dtype.kind == "b" else range(8) if was.dtype.kind == "i" else (was + 0.1, -was):
        model = compiled(text)
        thing = where(model, field)
        if np.ndim(getattr(thing, field)):
            getattr(thing, field).reshape(-1)[element] = value
        else:
            setattr(thing, field, type(getattr(thing, field))(value))
        try:
            yield from [d.key for d in find_differences(written(text), describe_model(Topology(model, {})))]
        except (InputError, IndexError, StopIteration, ValueError):  # no compiled model has an index out of range
            yield "refused"


def test_every_field_is_on_a_list() -> None:
    assert [field for field in ALL if list_of(field) is None] == []
    assert set(COMPARED) <= set(ALL)
    for known in (
        model_fields.GATED,
        model_fields.FOLLOWS,
        model_fields.CANNOT_ACT,
    ):  # and no list has what MuJoCo has not
        assert [each for each in known if not any(fnmatchcase(field, each) for field in ALL)] == []
    keys = {re.sub(r"\d+", "*", key) for key in written(GENERATED)}
    assert {key for key in model_fields.GATED.values() if key not in keys} == set()


@pytest.mark.slow
@pytest.mark.parametrize("field", sorted(COMPARED.keys() - model_fields.COUNTED.keys()))
def test_a_change_in_a_compared_field_is_named(field: str) -> None:
    def seen(text: str) -> Iterator[bool]:
        entries = np.atleast_1d(getattr(where(compiled(text), field), field))
        for element in range(entries.size):
            if not (field.startswith("actuator") and element // (entries.size // len(entries)) == DRIVE):
                keys = differing(text, field, element)
                yield any(key == "refused" or fnmatchcase(key, COMPARED[field]) for key in keys)

    if field in DIRECT:
        assert all(found := list(seen(GENERATED))) and found
    else:
        assert any(named for text in (GENERATED, ANCHORED) for named in seen(text))


def test_what_cannot_act_moves_nothing() -> None:
    """Other values in every such field that is a real number: not one bit of the motion and the forces is another."""

    def run(model: mujoco.MjModel) -> list[bytes]:
        data = mujoco.MjData(model)
        mujoco.mj_resetDataKeyframe(model, data, 0)
        data.time = 0.0
        mujoco.mj_step(model, data, 5)
        return [array.tobytes() for array in (data.qpos, data.qvel, data.qacc, data.efc_force, data.actuator_force)]

    model = mujoco.MjModel.from_xml_string(GENERATED)
    expected = run(model)
    tried = []
    for field in ALL:
        if list_of(field) not in ("CANNOT_ACT", "GATED") or field.startswith("key_"):
            continue
        thing = where(model, field)
        was = getattr(thing, field)
        if isinstance(was, float):
            setattr(thing, field, was + 0.1)
        elif isinstance(was, np.ndarray) and was.dtype.kind == "f" and was.size:
            was += 0.1
        else:
            continue
        tried.append(field)
        assert run(model) == expected, field
    assert len(tried) > 40 and {"actuator_gainprm", "geom_friction", "meanmass"} <= set(tried)


def test_what_follows_is_made_anew_from_the_rest() -> None:
    """Other values in it are gone once MuJoCo computes what it derives."""
    model = mujoco.MjModel.from_xml_string(GENERATED)
    tried = []
    for field in ALL:
        was = getattr(where(model, field), field)
        if list_of(field) == "FOLLOWS" and isinstance(was, np.ndarray) and was.dtype.kind == "f" and was.size:
            before = was.copy()
            was += 0.1
            mujoco.mj_setConst(model, mujoco.MjData(model))
            np.testing.assert_allclose(was, before, rtol=1e-12, atol=1e-15, err_msg=field)
            tried.append(field)
    assert {"dof_M0", "dof_invweight0", "body_subtreemass", "tendon_length0"} <= set(tried)
