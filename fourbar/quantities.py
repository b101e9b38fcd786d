"""The quantities of a solution, one row each, and the statuses of a position: every other list of them follows."""

from typing import NamedTuple


class Quantity(NamedTuple):
    """One array of a solution."""

    name: str
    unit: str
    stage: str | None
    """That computes it; None: it is commanded."""
    kind: str
    """scalar, (n,), or vector, (n, 2)."""
    meaning: str
    group: str = ""
    """unknown: of the equations of a position, which an engine can be held to; dry friction, pin loads, linear drive:
    exists only where the scene has dry friction, friction that depends on the pin forces, a drive along a line."""


QUANTITIES = tuple(
    Quantity(*row)
    for row in (
        ("theta_2", "rad", None, "scalar", "angle of the input"),
        ("theta_3", "rad", "position", "scalar", "angle of the coupler", "unknown"),
        ("theta_4", "rad", "position", "scalar", "angle of the output", "unknown"),
        ("sin_mu", "1", "position", "scalar", "sin(theta_4 - theta_3), signed like the branch"),
        ("condition", "1", "position", "scalar", "motion condition |sin_mu|, in (0, 1]; 1 is best"),
        ("A", "m", "position", "vector", "pin of input and coupler"),
        ("B", "m", "position", "vector", "pin of coupler and output"),
        ("G2", "m", "position", "vector", "mass centre of the input"),
        ("G3", "m", "position", "vector", "mass centre of the coupler"),
        ("G4", "m", "position", "vector", "mass centre of the output"),
        ("stroke", "m", "position", "scalar", "distance of the linear drive's ends", "linear drive"),
        ("drive_line", "1", "position", "vector", "unit vector from its one end to the other", "linear drive"),
        ("omega_2", "rad/s", "velocity", "scalar", "angular velocity of the input"),
        ("omega_3", "rad/s", "velocity", "scalar", "angular velocity of the coupler", "unknown"),
        ("omega_4", "rad/s", "velocity", "scalar", "angular velocity of the output", "unknown"),
        ("v_A", "m/s", "velocity", "vector", "velocity of A"),
        ("v_B", "m/s", "velocity", "vector", "velocity of B"),
        ("v_G2", "m/s", "velocity", "vector", "velocity of G2"),
        ("v_G3", "m/s", "velocity", "vector", "velocity of G3"),
        ("v_G4", "m/s", "velocity", "vector", "velocity of G4"),
        ("stroke_speed", "m/s", "velocity", "scalar", "speed at which the stroke grows", "linear drive"),
        ("alpha_2", "rad/s^2", "acceleration", "scalar", "angular acceleration of the input"),
        ("alpha_3", "rad/s^2", "acceleration", "scalar", "angular acceleration of the coupler", "unknown"),
        ("alpha_4", "rad/s^2", "acceleration", "scalar", "angular acceleration of the output", "unknown"),
        ("a_A", "m/s^2", "acceleration", "vector", "acceleration of A"),
        ("a_B", "m/s^2", "acceleration", "vector", "acceleration of B"),
        ("a_G2", "m/s^2", "acceleration", "vector", "acceleration of G2"),
        ("a_G3", "m/s^2", "acceleration", "vector", "acceleration of G3"),
        ("a_G4", "m/s^2", "acceleration", "vector", "acceleration of G4"),
        ("F12", "N", "force", "vector", "force of ground on the input, at O2", "unknown"),
        ("F32", "N", "force", "vector", "force of the coupler on the input, at A", "unknown"),
        ("F43", "N", "force", "vector", "force of the output on the coupler, at B", "unknown"),
        ("F14", "N", "force", "vector", "force of ground on the output, at O4", "unknown"),
        ("torque", "N m", "force", "scalar", "couple of ground on the driven bar", "unknown"),
        ("drive_force", "N", "force", "scalar", "force of the linear drive, pushing its ends apart", "linear drive"),
        ("power", "W", "force", "scalar", "power of the drive"),
        ("drive_condition", "1", "force", "scalar", "leverage of the drive, in (0, 1]; 1 is best"),
        ("torque_error", "N m", "error", "scalar", "error bar of the torque"),
        ("drive_force_error", "N", "error", "scalar", "error bar of the drive's force", "linear drive"),
        ("force_error", "N", "error", "scalar", "error bar of the pin forces, of the worst of the four"),
        ("torque_low", "N m", "force", "scalar", "least torque where dry friction holds a pin at rest", "dry friction"),
        ("torque_high", "N m", "force", "scalar", "the greatest torque there", "dry friction"),
        ("drive_force_low", "N", "force", "scalar", "least force of the linear drive there", "dry friction"),
        ("drive_force_high", "N", "force", "scalar", "the greatest force there", "dry friction"),
        ("friction_residual", "N m", "force", "scalar", "what the solved pin friction leaves", "pin loads"),
        ("time", "s", None, "scalar", "of a motion law or a free motion"),
    )
)
"""In the order of the fields of `Solution`, which is that of its columns."""
UNITS = {q.name: q.unit for q in QUANTITIES}
STAGE_OF = {q.name: q.stage for q in QUANTITIES if q.stage is not None}
"""Every evaluated quantity and the stage that computes it."""
STAGES = tuple(dict.fromkeys(STAGE_OF.values()))
KIND = {q.name: q.kind for q in QUANTITIES}
VECTORS = tuple(q.name for q in QUANTITIES if q.kind == "vector")
ANGLES = tuple(q.name for q in QUANTITIES if q.unit == "rad" and q.stage is not None)
PIN_FORCES = tuple(name for name in VECTORS if UNITS[name] == "N")
"""F_ij, of bar i on bar j, in the order of the pins O2, A, B, O4."""
UNKNOWNS = tuple(q.name for q in QUANTITIES if q.group == "unknown")
"""Every unknown of a position, in the order of the mechanics."""


class DriveNames(NamedTuple):
    """What the quantities of a kind of drive are called."""

    value: str
    error: str
    low: str
    high: str


COUPLE = DriveNames("torque", "torque_error", "torque_low", "torque_high")
"""Of a drive that turns a bar."""
LINE = DriveNames("drive_force", "drive_force_error", "drive_force_low", "drive_force_high")
"""Of one that pushes along a line."""
OF_LINE = (*dict.fromkeys((*(q.name for q in QUANTITIES if q.group == "linear drive"), *LINE)),)
"""Every quantity that exists only where the drive is linear."""
FORCES = (*PIN_FORCES, COUPLE.value, LINE.value, "power")
OF_DRY_FRICTION = tuple(q.name for q in QUANTITIES if q.group == "dry friction")
OF_PIN_LOADS = tuple(q.name for q in QUANTITIES if q.group == "pin loads")

STATUS_NAMES = (
    *("ok", "not_assembled", "singular", "jammed", "several", "no_direction", "wound"),
    *("no_torque", "overflow", "invalid", "no_lever"),
)
"""By code; `Solution.status_code` says what each means."""
OK, NOT_ASSEMBLED, SINGULAR, JAMMED, SEVERAL, NO_DIRECTION, WOUND, NO_TORQUE, OVERFLOW, INVALID, NO_LEVER = range(
    len(STATUS_NAMES)
)


def is_scalar(name: str) -> bool:
    """Whether a quantity is a number at each position; the others, a scene's own points too, are vectors."""
    return KIND.get(name) == "scalar"
