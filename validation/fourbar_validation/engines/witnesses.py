"""The witnesses: each one, where its adapter lives, what it needs, and what it is held to."""

from dataclasses import dataclass
from importlib import import_module
from pkgutil import resolve_name
from typing import NamedTuple

import numpy as np

from fourbar.errors import installing
from fourbar.quantities import OF_DRY_FRICTION, STAGE_OF, UNKNOWNS
from fourbar.scene import Command, Scene
from fourbar.solution import Solution
from fourbar_validation.compare.answer import Answer, Engine
from fourbar_validation.compare.compare import COMPARED, Nearby, Predicted
from fourbar_validation.compare.rows import in_words
from fourbar_validation.compare.tolerance import EQUIVALENCE, SIMULATED, Tolerance
from fourbar_validation.engines.exact import unknown


@dataclass(frozen=True, slots=True)
class Witness:
    """An engine that bears witness, where its adapter lives, and what it is held to."""

    name: str
    adapter: str
    """ "module:class"; imported when it answers, so a missing engine costs only its own rows."""
    tolerance: Tolerance
    expected: tuple[str, ...] = COMPARED
    order: str = ""
    """ "module:function" that runs the engine at two coarser timesteps; its observed order is shown."""
    positions: tuple[str, ...] = ()
    """What it is held to where the scene states positions only; nothing: it is then not started."""
    through_time: bool = False
    """Whether it runs through the motion in time."""
    generated: bool = False
    """Whether it runs the generated MJCF, which is then compared as it is shipped too."""
    predictor: str = ""
    """ "module:function" that predicts, from the description, the errors to be expected beyond the tolerance; "own":
    the engine's own residuals do; nothing: the tolerance is all."""
    nearby: str = ""
    """ "module:function" that answers again where an error is beyond the tolerance: at the theta_2, within its own
    rounding, at which its loop closes as that of the formulas does."""
    stated: bool = True
    """Whether an exact engine is held to what the formulas state of the linkage too, whatever its motion."""
    library: str = ""
    """The module that its adapter imports, a key of `EXTRA`; nothing: it needs no more than the formulas."""

    def engine(self) -> Engine:
        """The adapter."""
        module, _, name = self.adapter.partition(":")
        return getattr(import_module(module), name)()  # type: ignore[no-any-return]

    def missing(self) -> str | None:
        """Why it cannot answer in this environment, or None."""
        return not_installed(self.library) if self.library else None


EXTRA = {name: name for name in ("mujoco", "pinocchio", "exudyn", "opensim")} | {"pydrake": "drake", "flint": "exact"}
"""Module of an engine: the extra that brings it."""


def not_installed(library: str) -> str | None:
    """The reason to give where a module cannot be found, or does not load; None where it does."""
    try:
        import_module(library)
    except ModuleNotFoundError as error:
        if error.name == library:
            return f"{library} is not installed: {installing(EXTRA[library])}"
        return _broken(library, error)
    except (Exception, SystemExit) as error:  # whatever a library raises that was built for another machine
        return _broken(library, error)
    return None


def _broken(library: str, error: BaseException) -> str:
    return f"{library} is installed, but does not load: {in_words(error)}"


class Work(NamedTuple):
    """What the time of an answer goes into."""

    short: str
    """For a legend."""
    full: str
    """For a table."""


ONE_BY_ONE = (
    "each position by itself, in Python: Newton on its own gap, its own speeds and accelerations, then inverse "
    "dynamics with the loop's multipliers: pin forces and torque"
)
WORK = {
    "formulas": Work(
        "forces and torque, all positions at once",
        "all positions in one call on arrays: angles, speeds, accelerations, pin forces and torque",
    ),
    "pinocchio-inverse": Work("assembly, forces and torque, one by one", ONE_BY_ONE),
    "mujoco-inverse": Work("assembly, forces and torque, one by one", ONE_BY_ONE),
    "mujoco-simulated": Work(
        "steps from position to position, forces and torque",
        "one motion: every position assembled, the model compiled, Runge-Kutta steps from position to position (the "
        "fewer positions, the dearer each), then pin forces and torque read",
    ),
    "exudyn-constraints": Work("assembly, constraints and multipliers, one by one", ONE_BY_ONE),
    "opensim-constraints": Work("assembly, constrained dynamics, one by one", ONE_BY_ONE),
    "drake-inverse": Work("assembly, forces and torque, one by one", ONE_BY_ONE),
    "free-body": Work(
        "thirteen equations, all positions at once",
        "all positions in one call on arrays: Newton on the closure, speeds and accelerations, thirteen equations each "
        "for pin forces and torque",
    ),
    "ball-arithmetic": Work(
        "forces and torque in many digits, one by one",
        "each position by itself, in Python, in many digits with an error bound: pin forces and torque",
    ),
}
"""By witness: what is compared is not the same work."""
OF_A_POSITION = tuple(name for name in COMPARED if STAGE_OF[name] == "position")
FROM_DATA, IN_WORLD_AXES, ABOUT_MASS_CENTRE = (
    f"fourbar_validation.engines.prediction:{name}" for name in ("from_data", "in_world_axes", "about_mass_centre")
)
"""How an exact engine measures lever arms; with the data as they are, in world axes, or about all bars' mass centre."""


def _exact(name: str, adapter: str, library: str, predictor: str = IN_WORLD_AXES) -> Witness:
    """An engine that answers every position by itself."""
    return Witness(name, f"fourbar_validation.engines.{adapter}", EQUIVALENCE, predictor=predictor, library=library)


WITNESSES = (
    _exact("pinocchio-inverse", "pinocchio:PinocchioInverse", "pinocchio"),
    _exact("mujoco-inverse", "mujoco.inverse:MujocoInverse", "mujoco", ABOUT_MASS_CENTRE),
    Witness(
        "mujoco-simulated",
        "fourbar_validation.engines.mujoco.simulate:MujocoSimulated",
        SIMULATED,
        UNKNOWNS,
        order="fourbar_validation.engines.mujoco.simulate:observed_order",
        through_time=True,
        generated=True,
        predictor="own",
        library="mujoco",
    ),
    Witness(
        "free-body",
        "fourbar_validation.engines.free_body:FreeBody",
        EQUIVALENCE,
        (*COMPARED, *OF_DRY_FRICTION),
        positions=OF_A_POSITION,
        predictor=FROM_DATA,
    ),
)
FURTHER = (
    _exact("exudyn-constraints", "exudyn:ExudynConstraints", "exudyn"),
    _exact("opensim-constraints", "opensim:OpenSimConstraints", "opensim"),
    _exact("drake-inverse", "drake:DrakeInverse", "pydrake"),
)
"""Engines with extras of their own: they join a run where they are installed, and where they are named."""


def predicting_from(witness: Witness, scene: Scene, at: Command, answer: Answer) -> Predicted | None:
    """What computes the errors to be expected, should any be called for; an alarm leaves an engine no own excuse."""
    if not witness.predictor or answer.refusal is not None:
        return None
    if witness.predictor == "own":
        if answer.alarms:
            return None
        return lambda quantity, where: answer.predicted.get(quantity, np.zeros(len(where)))
    if witness.tolerance.conditioned and (not_installed("flint") or unknown(scene)):
        return None  # the law in the condition stands alone
    module, _, name = witness.predictor.partition(":")
    predict = getattr(import_module(module), name)
    return lambda quantity, where: predict(scene, at, quantity, where)


def answering_nearby(witness: Witness, scene: Scene, at: Command, formulas: Solution) -> Nearby | None:
    """What answers within the rounding of the theta_2 that are stated, where the witness does.

    A drive on bar 3 or 4 has poles of its own, which another theta_2 for the same sine does not mend.
    """
    if not witness.nearby or scene.drive_bar != 2 or at.remainder is not None or at.omega_2 is None:
        return None
    answer = resolve_name(witness.nearby)
    return lambda where: answer(scene, at, formulas.sin_mu, where)
