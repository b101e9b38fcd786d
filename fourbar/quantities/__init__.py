"""The quantities of a solution, one line each, and the statuses of a position.

Every other list of them follows from these.
"""

# ruff: noqa: RUF009 - the lines are fields
import re
from dataclasses import dataclass, field, fields
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]
Mask = NDArray[np.bool_]
"""True or False at each position."""
Indices = NDArray[np.intp]
"""Indices of positions, or of rows of another array."""
Signs = NDArray[np.int8]
"""Small whole numbers with a sign: assemblies (+1 or -1), bars, circuits."""
Codes = NDArray[np.uint8]
"""Small codes, as the status of each position."""


class Quantity(NamedTuple):
    """Declaration of one array of a solution."""

    name: str
    kind: str
    """scalar, (n,), or vector, (n, 2)."""
    unit: str
    stage: str | None
    """Stage that computes the quantity; None: it is commanded."""
    meaning: str
    group: str = ""
    """unknown: of the equations of a position, which an engine can be held to; dry
    friction, pin loads, linear drive: exists only where the scene has dry friction,
    friction that depends on the pin forces, a drive that exerts a force.
    """

    @property
    def stage_number(self) -> int:
        """Return the index of the stage in `STAGES`; 0 if it is commanded."""
        return STAGES.index(self.stage or STAGES[0])


def _scalar(*line: str | None) -> Any:
    """Declare a number at each position: unit, stage, meaning and group."""
    return field(default=None, metadata={"line": ("scalar", *line)})


def _declare_vector(*line: str | None) -> Any:
    """Declare a vector at each position: unit, stage, meaning and group."""
    return field(default=None, metadata={"line": ("vector", *line)})


@dataclass(frozen=True, eq=False, kw_only=True)
class Quantities:
    """The quantities, one line each.

    `Solution` inherits them as fields, and tables have them in this order. A quantity
    of a stage that was not asked for, or of a drive that the scene does not have, is
    None. The types are those of what was asked for, so that nobody asserts the arrays.
    """

    theta_2: Array = _scalar("rad", None, "angle of the input")
    theta_3: Array = _scalar("rad", "position", "angle of the coupler", "unknown")
    theta_4: Array = _scalar("rad", "position", "angle of the output", "unknown")
    sin_mu: Array = _scalar(
        "1",
        "position",
        "sin(theta_4 - theta_3); its sign is the branch",
    )
    condition: Array = _scalar(
        "1",
        "position",
        "motion condition |sin_mu|, in (0, 1]; 1 is best",
    )
    A: Array = _declare_vector("m", "position", "pin of input and coupler")
    B: Array = _declare_vector("m", "position", "pin of coupler and output")
    G2: Array = _declare_vector("m", "position", "mass centre of the input")
    G3: Array = _declare_vector("m", "position", "mass centre of the coupler")
    G4: Array = _declare_vector("m", "position", "mass centre of the output")
    stroke: Array = _scalar(
        "m",
        "position",
        "distance of the linear drive's ends",
        "linear drive",
    )
    drive_line: Array = _declare_vector(
        "1",
        "position",
        "unit vector from its one end to the other, or of the force at a point",
        "linear drive",
    )
    omega_2: Array = _scalar(
        "rad/s",
        "velocity",
        "angular velocity of the input",
    )
    omega_3: Array = _scalar(
        "rad/s",
        "velocity",
        "angular velocity of the coupler",
        "unknown",
    )
    omega_4: Array = _scalar(
        "rad/s",
        "velocity",
        "angular velocity of the output",
        "unknown",
    )
    v_A: Array = _declare_vector("m/s", "velocity", "velocity of A")
    v_B: Array = _declare_vector("m/s", "velocity", "velocity of B")
    v_G2: Array = _declare_vector("m/s", "velocity", "velocity of G2")
    v_G3: Array = _declare_vector("m/s", "velocity", "velocity of G3")
    v_G4: Array = _declare_vector("m/s", "velocity", "velocity of G4")
    stroke_speed: Array = _scalar(
        "m/s",
        "velocity",
        "speed at which the stroke grows, or of the driven point along the force",
        "linear drive",
    )
    alpha_2: Array = _scalar(
        "rad/s^2",
        "acceleration",
        "angular acceleration of the input",
    )
    alpha_3: Array = _scalar(
        "rad/s^2",
        "acceleration",
        "angular acceleration of the coupler",
        "unknown",
    )
    alpha_4: Array = _scalar(
        "rad/s^2",
        "acceleration",
        "angular acceleration of the output",
        "unknown",
    )
    a_A: Array = _declare_vector("m/s^2", "acceleration", "acceleration of A")
    a_B: Array = _declare_vector("m/s^2", "acceleration", "acceleration of B")
    a_G2: Array = _declare_vector("m/s^2", "acceleration", "acceleration of G2")
    a_G3: Array = _declare_vector("m/s^2", "acceleration", "acceleration of G3")
    a_G4: Array = _declare_vector("m/s^2", "acceleration", "acceleration of G4")
    F12: Array = _declare_vector(
        "N",
        "force",
        "force of ground on the input, at O2",
        "unknown",
    )
    F32: Array = _declare_vector(
        "N",
        "force",
        "force of the coupler on the input, at A",
        "unknown",
    )
    F43: Array = _declare_vector(
        "N",
        "force",
        "force of the output on the coupler, at B",
        "unknown",
    )
    F14: Array = _declare_vector(
        "N",
        "force",
        "force of ground on the output, at O4",
        "unknown",
    )
    torque: Array = _scalar(
        "N m",
        "force",
        "couple of ground on the driven bar",
        "unknown",
    )
    drive_force: Array = _scalar(
        "N",
        "force",
        "force of the drive, pushing its ends apart or along its direction",
        "linear drive",
    )
    power: Array = _scalar("W", "force", "power of the drive")
    drive_condition: Array = _scalar(
        "1",
        "force",
        "leverage of the drive, in (0, 1]; 1 is best",
    )
    torque_error: Array = _scalar(
        "N m",
        "error",
        "error bar of the torque: what rounding makes it scatter by",
    )
    drive_force_error: Array = _scalar(
        "N",
        "error",
        "error bar of the drive's force",
        "linear drive",
    )
    force_error: Array = _scalar(
        "N",
        "error",
        "error bar of the pin forces, of the worst of the four",
    )
    torque_low: Array = _scalar(
        "N m",
        "force",
        "least torque while dry friction holds a pin",
        "dry friction",
    )
    torque_high: Array = _scalar(
        "N m",
        "force",
        "greatest then; otherwise both are torque",
        "dry friction",
    )
    drive_force_low: Array = _scalar(
        "N",
        "force",
        "least force of the drive then",
        "dry friction",
    )
    drive_force_high: Array = _scalar(
        "N",
        "force",
        "greatest then",
        "dry friction",
    )
    friction_residual: Array = _scalar(
        "N m",
        "force",
        "largest remaining |mu r |F| - couple|",
        "pin loads",
    )
    time: Array = _scalar("s", None, "of a motion law or a free motion")


QUANTITIES = tuple(
    Quantity(declared.name, *declared.metadata["line"])
    for declared in fields(Quantities)
)
_QUANTITY_OF = {q.name: q for q in QUANTITIES}
UNITS = {q.name: q.unit for q in QUANTITIES}
STAGE_OF = {q.name: q.stage for q in QUANTITIES if q.stage is not None}
"""Every evaluated quantity and the stage that computes it."""
STAGES = tuple(dict.fromkeys(STAGE_OF.values()))
SCALARS = frozenset(q.name for q in QUANTITIES if q.kind == "scalar")
VECTORS = tuple(q.name for q in QUANTITIES if q.kind == "vector")
ANGLES = tuple(q.name for q in QUANTITIES if q.unit == "rad" and q.stage is not None)
RATES = tuple(q.name for q in QUANTITIES if q.name.startswith(("omega_", "alpha_")))
"""Speeds and accelerations of the bars."""
PIN_FORCES = tuple(name for name in VECTORS if UNITS[name] == "N")
"""F_ij, of bar i on bar j, in the order of the pins O2, A, B, O4."""
UNKNOWNS = tuple(q.name for q in QUANTITIES if q.group == "unknown")
"""Every unknown of a position, in the order of the mechanics."""


DERIVED_QUANTITIES = (
    Quantity(
        "shaking_force",
        "vector",
        "N",
        "force",
        "force of bars and drive on the frame",
    ),
    Quantity("shaking_moment", "scalar", "N m", "force", "their moment about O2"),
    Quantity("transmission", "scalar", "rad", "position", "acute angle of bars 3, 4"),
    Quantity("omega_3/omega_2", "scalar", "1", "position", "speed ratio"),
    Quantity("omega_4/omega_2", "scalar", "1", "position", "speed ratio"),
    Quantity(
        "mechanical_advantage",
        "scalar",
        "1",
        "position",
        "omega_2/omega_4, signed",
    ),
    Quantity("I13", "vector", "m", "position", "instant centre of the coupler"),
    Quantity("I24", "vector", "m", "position", "instant centre of bars 2 and 4"),
)
"""Quantities that follow from those of a solution; tables, plots and CSV have them."""
DERIVED_NAMES = {q.name: q for q in DERIVED_QUANTITIES}
SPRING_QUANTITIES = (
    Quantity("length", "scalar", "m", "position", "distance of the ends of a spring"),
    Quantity("force", "scalar", "N", "force", "pull of a spring; negative: it pushes"),
)
"""Derived quantities of each spring, under names like "spring_0_length"."""
SPRING_NAME = re.compile(
    rf"spring_(0|[1-9][0-9]*)_({'|'.join(q.name for q in SPRING_QUANTITIES)})"
)
"""Name of a quantity of a spring: its index in the file, from 0, and what it is."""


def find_derived(name: str) -> Quantity | None:
    """Return a derived quantity by its name, a spring's too; None for another name."""
    of_spring = SPRING_NAME.fullmatch(name)
    if of_spring is None:
        return DERIVED_NAMES.get(name)
    return next(q for q in SPRING_QUANTITIES if q.name == of_spring[2])


OF_POINTS = {
    start: Quantity("", "vector", unit, stage, f"{stage} of a point of the scene")
    for start, unit, stage in (
        ("", "m", "position"),
        ("v_", "m/s", "velocity"),
        ("a_", "m/s^2", "acceleration"),
    )
}
"""Quantities of a point of the scene, by the start of the name."""


def find_quantity(name: str) -> Quantity:
    """Return a quantity by its name, which may be derived or that of a point."""
    of_point = OF_POINTS.get(name[:2], OF_POINTS[""])
    return _QUANTITY_OF.get(name) or find_derived(name) or of_point


class DriveNames(NamedTuple):
    """Names of the quantities of one kind of drive."""

    value: str
    error: str
    low: str
    high: str


COUPLE = DriveNames("torque", "torque_error", "torque_low", "torque_high")
"""Names for a drive that turns a bar."""
LINE = DriveNames(
    "drive_force",
    "drive_force_error",
    "drive_force_low",
    "drive_force_high",
)
"""Names for a drive that exerts a force."""
LINE_QUANTITIES = (
    *dict.fromkeys((*(q.name for q in QUANTITIES if q.group == "linear drive"), *LINE)),
)
"""Every quantity that exists only where the drive is a force."""
STROKE = "stroke"
"""Quantity of a linear drive that a force at a point does not have."""
FORCE_NAMES = (*PIN_FORCES, COUPLE.value, LINE.value, "power")
DRY_FRICTION_QUANTITIES = tuple(q.name for q in QUANTITIES if q.group == "dry friction")
PIN_LOAD_QUANTITIES = tuple(q.name for q in QUANTITIES if q.group == "pin loads")
STATUS_NAMES = (
    "ok",
    "not_assembled",
    "singular",
    "jammed",
    "several",
    "no_direction",
    "wound",
    "no_torque",
    "overflow",
    "invalid",
    "no_lever",
    "change_point",
)
"""Status names by code; `Solution.status_code` explains each."""
(
    OK,
    NOT_ASSEMBLED,
    SINGULAR,
    JAMMED,
    SEVERAL,
    NO_DIRECTION,
    WOUND,
    NO_TORQUE,
    OVERFLOW,
    INVALID,
    NO_LEVER,
    CHANGE_POINT,
) = range(len(STATUS_NAMES))
