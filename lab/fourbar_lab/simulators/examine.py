"""Compare each simulator, in its own environment, with the formulas at the states that it reached by itself."""

import json
import math
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

import fourbar
from fourbar.errors import FourBarError
from fourbar.quantities import PIN_FORCES
from fourbar.scene import Command, Scene
from fourbar_validation.compare.answer import Array
from fourbar_validation.compare.rows import say_error
from fourbar_validation.compare.tolerance import find_error, magnitude
from fourbar_validation.engines.processes import run_to_end, start_harness

SIMULATORS = {
    "mujoco_c": ("MuJoCo", "mujoco"),
    "pinocchio_simulated": ("Pinocchio", "pinocchio"),
    "mujoco_warp": ("MuJoCo Warp", "mujoco_warp"),
    "mujoco_mjx": ("MJX-JAX", "mujoco.mjx"),
    "newton_mujoco": ("Newton, MuJoCo solver", "newton"),
    "newton_kamino": ("Newton, Kamino", "newton"),
    "genesis_rigid": ("Genesis", "genesis"),
    "pybullet": ("PyBullet", "pybullet"),
    "drake_sap": ("Drake, SAP", "pydrake"),
    "exudyn_simulated": ("Exudyn", "exudyn"),
}
"""Name of each simulator and the package that must be importable, by module."""
NOT_EXAMINED = {
    "Drake, CENIC": "its convex integrator with error control is not read here",
    "Newton, other solvers": "Featherstone, XPBD, VBD and the rest are not read here",
    "DART": "dartpy 6.20 gives the joints' wrenches and no force of the closing constraint; not read here",
}
"""Simulators that could be examined and are not, each with the reason."""
LOOK = "import importlib.metadata, importlib.util as u, sys; u.find_spec({0!r}) or sys.exit(1)"
"""Program for a Python interpreter that fails if a module is not installed."""
TORQUE_AND_FORCES = ("torque", *PIN_FORCES)


@dataclass(slots=True)
class Line:
    """One setting of a simulator, over single states or over a turn in so many steps."""

    simulator: str
    version: str
    setting: str
    steps: int | None
    errors: dict[str, float]
    """Greatest of the readings, by the greatest value in a turn; a quantity that cannot be read is left out."""
    gap: float
    """Gap of the loop, relative to the longest bar."""
    cost: float | None
    """Seconds of the processor for one simulated second."""
    order: float | None = None
    """Order of the torque's error, from the previous number of steps to this one."""
    apart: str = ""
    """Why it does not stand with the others: what the setting is not meant for."""

    @property
    def worst(self) -> float:
        """Return the greatest of the errors, NaN where one is."""
        return float(np.max(list(self.errors.values())))


@dataclass(slots=True)
class Differentiated:
    """Driving torque at a state and its derivatives, by a simulator that can be differentiated."""

    simulator: str
    version: str
    how: str
    """Method of differentiation, or the reason why there is none."""
    errors: dict[str, float | None] = field(default_factory=dict)
    """Errors of the torque and of its derivative by each number, relative to ours; None if the simulator says 0."""


@dataclass(slots=True)
class Examination:
    """Data that the page shows."""

    lines: list[Line] = field(default_factory=list)
    changed: dict[str, str] = field(default_factory=dict)
    devices: dict[str, str] = field(default_factory=dict)
    """Device that each simulator ran on."""
    made_for: dict[str, str] = field(default_factory=dict)
    """Purpose of each simulator that is made for something else than what is asked here."""
    left_out: dict[str, str] = field(default_factory=dict)
    slopes: list[Differentiated] = field(default_factory=list)


def examine(scene: Scene, file: Path, pythons: list[Path], seconds: float) -> Examination:
    """Examine every simulator under the first of the interpreters that has it."""
    found = Examination()
    for module, (name, library) in SIMULATORS.items():
        python = next((python for python in pythons if _has(python, library)), None)
        if python is None:
            found.left_out[name] = "not installed under any --python"
            continue
        line = [python, "-m", "fourbar_lab.simulators.work", module, file.absolute()]
        done = start_harness(line, seconds=seconds)
        if done.why:
            found.left_out[name] = done.why
            continue
        try:
            answer = json.loads(done.out)
            judged, changed = compare_lines(scene, name, answer), str(answer["changed"])
            differentiated = slopes(scene, name, answer)
            ran_on = f"{answer['device']}, Python {answer['python']}"
            not_run = {f"{name}, {what}": str(why) for what, why in answer.get("not_run", {}).items()}
        except (AttributeError, IndexError, KeyError, TypeError, ValueError, FourBarError) as error:
            found.left_out[name] = f"no answer that can be read: {say_error(error)}"
            continue
        found.lines += judged
        found.slopes += differentiated
        found.changed[name], found.devices[name] = changed, ran_on
        found.made_for[name] = str(answer.get("made_for", ""))
        found.left_out |= not_run
    found.left_out |= NOT_EXAMINED
    return found


def compare_lines(scene: Scene, name: str, answer: dict[str, Any]) -> list[Line]:
    """Compare one simulator's readings with the formulas, line by line."""
    made: list[Line] = []
    turn = abs(math.tau / scene.motion.omega_2) if scene.motion.omega_2 else math.nan
    for reading in answer["readings"]:
        found = compute_errors(scene, reading)
        steps = reading["steps"]
        line = Line(
            name,
            answer["version"],
            reading["setting"],
            steps,
            found,
            reading["gap"] / max(scene.linkage.lengths),
            None if steps is None else reading["seconds"] / turn,
            apart=answer.get("apart", {}).get(reading["setting"], ""),
        )
        before = made[-1] if made else None
        if before is not None and steps and before.steps and before.setting == line.setting:
            ratio = before.errors["torque"] / found["torque"] if found["torque"] else math.inf
            if 0.0 < ratio < math.inf:  # one that diverged has none
                line.order = math.log(ratio) / math.log(steps / before.steps)
        made.append(line)
    return made


def slopes(scene: Scene, name: str, answer: dict[str, Any]) -> list[Differentiated]:
    """Compare one simulator's derivatives of the driving torque with the formulas' at its own state."""
    made = []
    for each in answer.get("slopes", ()):
        line = Differentiated(name, answer["version"], str(each["how"]))
        if "by" in each:
            angle, speed, acceleration = (each[key] for key in scene.motion.names)
            motion = scene.motion.replace(angle=angle, speed=speed, acceleration=acceleration)
            ours = fourbar.sensitivity(replace(scene, motion=motion))
            pairs = {"torque": (each["torque"], ours.value("torque"))}
            pairs |= {key: (theirs, ours.of("torque", key)) for key, theirs in each["by"].items()}
            line.errors = {
                key: None if theirs == 0.0 else float(abs(theirs - own[0]) / abs(own[0]))
                for key, (theirs, own) in pairs.items()
            }
        made.append(line)
    return made


def compute_errors(scene: Scene, reading: dict[str, Any]) -> dict[str, float]:
    """Compute the errors of torque and pin forces at the simulator's own state; NaN where it answers NaN."""
    theta = np.array(reading["theta"], dtype=float)
    n = len(theta)
    if not n or any(np.shape(reading[name]) != (n,) for name in ("omega_2", "alpha_2")) or theta.shape != (n, 3):
        raise ValueError("its angles, speeds and accelerations are not of one length")
    at = Command(
        theta[:, 0],
        np.full(n, scene.motion.branch, dtype=np.int8),
        np.array(reading["omega_2"]),
        np.array(reading["alpha_2"]),
    )
    ours, whole = fourbar.solve(scene, "force", at=at), fourbar.solve(scene, "force")
    answered: dict[str, Array] = {name: np.array(values, float) for name, values in reading["forces"].items()}
    answered["torque"] = np.array(reading["torque"], float)
    found = {}
    for name in TORQUE_AND_FORCES:
        if name not in answered:
            continue
        size = np.full(n, magnitude(getattr(whole, name)).max())
        found[name] = float(np.max(find_error(name, getattr(ours, name), answered[name], size)))  # NaN stays NaN
    return found


def _has(python: Path, library: str) -> bool:
    return not run_to_end([python, "-c", LOOK.format(library)]).failed
