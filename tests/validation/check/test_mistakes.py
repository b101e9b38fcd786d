"""Tables of simulators that solve another problem, whose cause is named first.

The free bodies answer in place of the simulator, and print seven digits.
"""

import math
from dataclasses import replace

import numpy as np
from pytest import mark

from fourbar import Bar, Friction, Gravity, Motion, Rise, Sweep, Viscous
from fourbar.quantities import PIN_FORCES
from fourbar.scene import command
from fourbar_validation.check.check import Judgement
from fourbar_validation.engines.free_body import FreeBody
from tests.support.scenes import cis, crank_rocker, relink

FORCES = ("torque", *PIN_FORCES)
DAMPED = replace(
    relink(
        crank_rocker(Motion(Sweep(0.0, math.radians(345.0), 24), 10.0)),
        input=Bar(0.1, 0.2, 5e-4, (0.03, 0.0)),
        output=Bar(0.22, 0.4, 3e-3, (0.1, -0.2)),
    ),
    effects=(Gravity(), Viscous.at(O4=0.3), Friction.at(A=0.2)),
)
SLENDER = {"centre": None, "inertia": None}
FROM_B = 0.22 - 0.1 * cis(-0.2)
THETA = command(DAMPED).angle


def answer(scene=DAMPED, turned=0.0, sense=1.0, alpha=0.0):
    """Answer at the angles of the damped scene, turned, in the one sense or another."""
    at = command(DAMPED)
    at = at._replace(angle=sense * THETA + turned, speed=sense * 10.0)
    return FreeBody().answer(scene, at._replace(acceleration=alpha)).quantities


def effects(*others):
    return answer(replace(DAMPED, effects=others))


def bars(**changes):
    """Answer with bars that have other fields."""
    moving = {
        name: replace(getattr(DAMPED.linkage, name), **fields)
        for name, fields in changes.items()
    }
    return answer(relink(DAMPED, **moving))


def columns(**changed):
    """Answer right, but for some columns."""
    return answer() | changed


def write(columns, names=FORCES, **place):
    """Write seven digits of columns beside the place of each row."""
    table = place or {"theta_2": THETA}
    for name in names:
        values = columns[name]
        axes = {f"{name}_x": 0, f"{name}_y": 1} if values.ndim == 2 else {name: ...}
        table |= {
            key: values[:, axis] if axis is not ... else values
            for key, axis in axes.items()
        }
    rows = np.transpose([*table.values()])
    lines = [",".join(f"{number:.7g}" for number in row) for row in rows]
    return "\n".join([",".join(table), *lines, ""])


OMEGA_4 = answer()["omega_4"]
CAUSES = {
    "gravity points to 180 deg": effects(Gravity(9.81, math.pi), *DAMPED.effects[1:]),
    "effects.*: damping and friction left out": effects(Gravity()),
    "bars.output: mass centre measured from the wrong pin, its angle too": bars(
        output={"centre": (abs(FROM_B), np.angle(FROM_B))}
    ),
    "bars.*: mass centre taken at mid-bar, with m L^2/12": bars(
        input=SLENDER, coupler=SLENDER, output=SLENDER
    ),
    "the motion is clockwise: theta_2, omega_2 and alpha_2 are reversed": answer(
        sense=-1.0
    ),
    "the torque acts on bar 4 instead of bar 2 in what drives alone": columns(
        torque=answer()["torque"] * 10.0 / OMEGA_4
    ),
}


CAUSES |= {
    "gravity points to -70 deg": effects(
        Gravity(9.81, math.radians(-70.0)), *DAMPED.effects[1:]
    ),
    "gravity points to -52.5 deg (fitted)": effects(
        Gravity(9.81, math.radians(-52.5)), *DAMPED.effects[1:]
    ),
    "alpha_2 = 20 rad/s^2, and not 0": answer(alpha=20.0),
    "every number is ours +0.08 N m (fitted)": columns(
        torque=answer()["torque"] + 0.08
    ),
}


CAUSES["1 row alone: line 9"] = columns(
    torque=answer()["torque"] * np.where(THETA[7] == THETA, 1.3, 1.0)
)


@mark.parametrize("cause", CAUSES)
def test_the_cause_is_named_first_and_explains_all(cause, read):
    first = Judgement(DAMPED, read(write(CAUSES[cause]))).explanations[0]
    assert first.text == cause and first.complete


def test_the_right_table_of_the_free_bodies_differs_in_nothing(read):
    assert not Judgement(DAMPED, read(write(answer()))).differing


@mark.parametrize(
    "names, turned, said",
    [
        (FORCES, -0.02, "2 ms late (forces of an earlier instant)"),
        (("omega_4", *FORCES), -0.02, "2 ms late"),
        (FORCES, 0.005, "0.5 ms early (forces of a later instant) (fitted)"),
        (FORCES, math.radians(90.0), "theta_2 +90 deg is what they solved"),
    ],
)
def test_a_table_by_time_is_late_or_its_crank_has_another_zero(
    names, turned, said, read
):
    table = read(write(answer(turned=turned), names, time=THETA / 10.0))
    first = Judgement(DAMPED, table).explanations[0]
    assert first.text.endswith(said) and first.complete


def test_forces_are_late_along_a_law_that_rests_at_its_ends(read):
    law = Rise("345", ("120 deg", "0.8 s"), theta_2="20 deg", steps=24)
    scene = replace(DAMPED, motion=Motion(law=law), effects=DAMPED.effects[:2])
    at, times = command(scene).part(slice(21)), np.linspace(0.0, 0.8, 21)
    fields = ("angle", "speed", "acceleration")
    earlier = scene.motion.law.at(np.maximum(times - 0.002, 0.0))
    at = at._replace(**dict(zip(fields, earlier, strict=True)))
    late = FreeBody().answer(scene, at).quantities
    for angles in ({}, {"theta_2": scene.motion.law.at(times)[0]}):
        table = read(write(late, time=times, **angles))
        first = Judgement(scene, table).explanations[0]
        assert first.text == "2 ms late (forces of an earlier instant)"


def test_another_speed_moves_every_row_of_a_table_by_time(read):
    at = command(DAMPED)._replace(angle=1.04 * THETA, speed=10.4)
    faster = FreeBody().answer(DAMPED, at).quantities
    told = Judgement(DAMPED, read(write(faster, time=THETA / 10.0))).explanations
    assert [one.text for one in told] == ["omega_2 1.04 times ours (fitted)"]


def test_each_force_has_its_own_frame_and_sign(read):
    """A simulator prints each joint's force in the frame of the joint's child."""
    numbers = answer()
    frames = {"F12": (2, ""), "F32": (3, ", with the other sign"), "F14": (4, "")}
    for name, (bar, sign) in frames.items():
        force = cis(-numbers[f"theta_{bar}"]) * (numbers[name] @ (1.0, 1.0j))
        force *= -1.0 if sign else 1.0
        numbers[name] = np.column_stack((force.real, force.imag))
    table = read(write(numbers, ("torque", *frames)))
    told = {one.quantities: one.text for one in Judgement(DAMPED, table).explanations}
    for name, (bar, sign) in frames.items():
        text = f"{name} is in the frame of bar {bar}, not in world axes{sign}"
        assert told.pop((name,)) == text
    assert not told


@mark.parametrize(
    "branch, words", [(-1, "counted to 180 deg"), (1, ", on the other side")]
)
def test_transmission_angles_may_be_counted_to_180_deg(branch, words, read):
    scene = replace(DAMPED, motion=replace(DAMPED.motion, branch=branch))
    numbers = FreeBody().answer(scene, command(scene)).quantities
    angle = np.arccos(-branch * np.cos(numbers["theta_4"] - numbers["theta_3"]))
    assert angle.max() > math.pi / 2.0 > angle.min()
    table = read(write({"transmission": angle}, ["transmission"]))
    first = Judgement(scene, table).explanations[0]
    assert first.text.endswith(words) and first.complete
