"""How a described MJCF differs from the one generated for the same scene, and what each difference does."""

import math
from collections.abc import Mapping
from dataclasses import dataclass

Described = Mapping[str, float | str]

SAME = 1e-12
"""Relative; a number written with its digits in another order of operations."""
TENFOLD = 1e-9
"""Relative distance from a power of ten at which a ratio is called one."""
OF_THE_DRIVE = {"pins.O2.armature": "the generated file keeps its speed by a flywheel; another drive needs none"}
"""Differences that are no fault: both files are driven alike here."""
REMARKS = (
    ("lengths.ground_angle", "the linkage is turned in the plane"),
    ("lengths.", "another linkage; body anchors of a connect are laid off in the rest state of the file: where it is "
     "not closed they build one of other lengths, sites do not"),
    (".centre", "pin forces and torque carry the mass elsewhere"),
    (".mass", "inertial forces and weight"),
    (".inertia", "about the mass centre, normal to the plane; the torque shows it least, the pin forces more"),
    ("gravity.across", "pulls out of the plane: the pins carry it, the plane does not feel it"),
    ("gravity", "weight of the bars"),
    (".damping", "a couple at this pin that the scene does not have"),
    (".friction", "a couple at this pin that the scene does not have"),
    (".stiffness", "a spring at this pin that the scene does not have"),
    (".armature", "adds to the inertia of what turns at this pin"),
    (".positive", "the hinge's axis points away: its angle, speed and motor torque change sign"),
    (".range", "a stop inside the motion acts as a contact"),
    ("closure.softness", "the loop yields: an error in proportion, at every timestep and unseen in the gap"),
    ("closure.impedance", "the loop yields by (1-d)/d; 0.9999 is the most that MuJoCo takes"),
    ("closure.time constant", "a stiff loop (few timesteps) is integrated badly, a slow one sags under load"),
    ("closure.by", "a tendon leaves out the centripetal term (54 % measured), a weld holds the angle too"),
    ("closure.out of plane", "the closure's ends lie in two planes: it pulls the bars across, without end"),
    ("option.timestep", "the error of the integration goes as h (Euler, implicit) or h^4 (RK4)"),
    ("option.integrator", "Euler and implicit lose one digit per tenth of the timestep, RK4 four"),
    ("option.tolerance", "divided by the inertia of a flywheel, only 0 is tight"),
    ("option.iterations", "matters where the tolerance does not stop the solver"),
    ("option.solver", "CG and PGS leave residuals in the loop's force"),
    ("option.medium", "drag on every body that has a size"),
    ("option.switched off", "see the MuJoCo flags of that name"),
    ("contacts", "bars that touch at the pins push each other: forces of thousands of newtons"),
    ("plane", "x and y of the scene are these axes of the file"),
    ("actuators", "loads are actuators in the generated file; one that is missing is missing in every force"),
    ("other equalities", "switched off here: the four pins are all that joins the bars"),
)  # fmt: skip
"""Part of a key, and what a difference there does; the first that fits."""


@dataclass(frozen=True, slots=True)
class Difference:
    """One entry that is not the same in both files."""

    key: str
    generated: float | str
    theirs: float | str
    remark: str


def differences(generated: Described, theirs: Described) -> list[Difference]:
    """What differs, in the order of the description."""
    scale = float(max(value for key, value in generated.items() if _is_length(key) and not isinstance(value, str)))
    found = []
    for key in [*theirs, *(key for key in generated if key not in theirs)]:
        ours, other = generated.get(key, "none"), theirs.get(key, "none")
        if not _same(key, ours, other, scale):
            found.append(Difference(key, ours, other, _remark(key, ours, other)))
    return found


def _is_length(key: str) -> bool:
    return key.startswith("lengths.") and not key.endswith("angle")


def _same(key: str, ours: float | str, theirs: float | str, length: float) -> bool:
    if isinstance(ours, str) or isinstance(theirs, str):
        return ours == theirs
    if key.endswith("angle"):
        return abs(math.remainder(ours - theirs, math.tau)) <= SAME
    floor = length if "centre" in key or "plane" in key else 1.0 if key.startswith("gravity") else 0.0
    return abs(ours - theirs) <= SAME * max(abs(ours), abs(theirs), floor)


def _remark(key: str, ours: float | str, theirs: float | str) -> str:
    if key in OF_THE_DRIVE:
        return OF_THE_DRIVE[key]
    remark = next((text for part, text in REMARKS if part in key), "")
    if isinstance(ours, float) and isinstance(theirs, float) and ours * theirs > 0.0 and not key.startswith("option"):
        power = math.log10(theirs / ours)
        if round(power) and abs(power - round(power)) <= TENFOLD:
            return f"10^{round(power)} times: units? {remark}"
    return remark
