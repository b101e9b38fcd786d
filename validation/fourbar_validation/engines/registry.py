"""The engines (independent solvers) of the harness, a line each in `ENGINES`.

The line says what starts the engine, what it needs, and how it is judged.
"""

from collections.abc import Callable
from dataclasses import fields, replace
from functools import cache
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from pkgutil import resolve_name
from typing import Any

import numpy as np

from fourbar.errors import say_install
from fourbar.linkage import record
from fourbar.quantities import DRY_FRICTION_QUANTITIES, STAGE_OF, UNKNOWNS, Array
from fourbar.scene import Command, LimitOrigin, Scene, StrokeOrigin, with_signs
from fourbar.solution import Solution
from fourbar_validation.compare.answer import Adapter, Answer, Arrays
from fourbar_validation.compare.compare import (
    COMPARED_QUANTITIES,
    AnswerNearby,
    Demands,
    Predicted,
)
from fourbar_validation.compare.rows import say_error
from fourbar_validation.compare.tolerance import (
    EQUIVALENCE,
    FULL_ACCURACY,
    SIMULATED,
    ErrorBound,
    Mask,
)
from fourbar_validation.engines.free_body import FreeBody
from fourbar_validation.engines.loop import make_blank
from fourbar_validation.engines.prediction import (
    predict_about_mass_centre,
    predict_for_any_method,
    predict_for_free_bodies,
    predict_from_data,
    predict_in_world_axes,
)
from fourbar_validation.engines.protocol import require_near

Predictor = Callable[[Scene, Command, str, Mask], Array]
"""Predicts the absolute error of a quantity at the positions of a mask, (n,)."""


@record
class Engine:
    """An independent solver, and what it is held to."""

    name: str
    start: Callable[[], Adapter]
    """Starts it; importable by name, or `Later`."""
    tolerance: ErrorBound
    answers: tuple[str, ...] = COMPARED_QUANTITIES
    """Quantities that it must answer."""
    positions: tuple[str, ...] = ()
    """Quantities it must answer if the scene states positions only. If empty, it is not
    started for such a scene.
    """
    through_time: bool = False
    """True if it runs through the motion in time."""
    generated: bool = False
    """True if it runs the generated MJCF, which is then also compared as shipped."""
    predictor: Predictor | None = None
    """Function that predicts the errors to be expected beyond the tolerance. It works
    from the description.
    """
    residuals: bool = False
    """True if the engine's own residuals predict the errors to be expected."""
    answers_nearby: bool = False
    """True if it answers at the angle that `Command.remainder` completes, so that where
    an error is beyond the tolerance it can answer again within the rounding of theta_2.
    """
    code: str = ""
    """Hash of an adapter that the harness does not ship. No answer of another one is
    resumed.
    """
    library: str = ""
    """Module that its adapter imports. Empty: it needs no more than the formulas."""

    def fingerprint(self) -> str:
        """Return everything on which the engine's answers and verdicts depend.

        The text is the same in every process.
        """
        values = (getattr(self, part.name) for part in fields(self))
        return ", ".join(
            (
                f"{value.__module__}:{name}"
                if (name := getattr(value, "__qualname__", ""))
                else repr(value)
            )
            for value in values
        )

    def missing(self) -> str | None:
        """Say why it cannot answer in this environment, if it cannot."""
        if self.library:
            return find_missing(self.library)
        return None


IN_EXTRA = ("mujoco", "pinocchio", "flint")
"""Modules of engines that the extra "validation" brings. Others are installed by the
name of their package.
"""
_PACKAGE_OF = {"pydrake": "drake"}
"""Module of an engine: its package, where that has another name."""


def find_missing(library: str) -> str | None:
    """Return the reason why a module is not found or does not load, or None."""
    try:
        import_module(library)
    except ModuleNotFoundError as error:
        if error.name == library:
            package = f"pip install {_PACKAGE_OF.get(library, library)}"
            how = say_install("validation") if library in IN_EXTRA else package
            return f"{library} is not installed: {how}"
        return _find_broken(library, error)
    except (
        Exception,
        SystemExit,
    ) as error:  # whatever a library raises that was built for another machine
        return _find_broken(library, error)
    return None


def _find_broken(library: str, error: BaseException) -> str:
    """Say that a library does not load.

    Raises KeyboardInterrupt where Ctrl-C ended the start of a compiled module, which
    says so as the cause of its ImportError.
    """
    if isinstance(error.__cause__, KeyboardInterrupt):
        raise error.__cause__
    return f"{library} is installed, but does not load: {say_error(error)}"


_ONE_BY_ONE = (
    "each position by itself, in Python: Newton on its own gap, its own speeds and"
    " accelerations, then inverse dynamics with the loop's multipliers: pin forces and"
    " torque"
)
WORK = {
    "formulas": (
        "all positions in one call on arrays: angles, speeds, accelerations, pin forces"
        " and torque"
    ),
    **dict.fromkeys(
        (
            "pinocchio-inverse",
            "mujoco-inverse",
            "exudyn-constraints",
            "opensim-constraints",
            "drake-inverse",
        ),
        _ONE_BY_ONE,
    ),
    "mujoco-simulated": (
        "one motion: every position assembled, the model compiled, Runge-Kutta steps"
        " from position to position (the fewer positions, the dearer each), then pin"
        " forces and torque read"
    ),
    "free-body": (
        "all positions in one call on arrays: Newton on the closure, speeds and"
        " accelerations, thirteen equations each for pin forces and torque"
    ),
    "ball-arithmetic": (
        "each position by itself, in Python, in many digits with an error bound: pin"
        " forces and torque"
    ),
}
"""Work of each engine, by its name. The times that are compared are not for the same
work.
"""
_OF_A_POSITION = tuple(
    name for name in COMPARED_QUANTITIES if STAGE_OF[name] == "position"
)


@record
class Later:
    """Class or function that is imported when it is called.

    A library that is missing costs its own rows only.
    """

    name: str
    """The module and the name in it, as `module:name`."""

    def __call__(self, *arguments: Any) -> Any:
        """Import and call it."""
        return resolve_name(self.name)(*arguments)


ENGINES_PACKAGE = "fourbar_validation.engines"
SIMULATED_TO_ERROR = Later(f"{ENGINES_PACKAGE}.mujoco.trial:SimulatedToError")
"""Simulation with settings for a wanted error."""
ENGINES = (
    Engine(
        "pinocchio-inverse",
        Later(f"{ENGINES_PACKAGE}.pinocchio:PinocchioInverse"),
        EQUIVALENCE,
        predictor=predict_in_world_axes,
        library="pinocchio",
    ),
    Engine(
        "mujoco-inverse",
        Later(f"{ENGINES_PACKAGE}.mujoco.inverse:MujocoInverse"),
        EQUIVALENCE,
        predictor=predict_about_mass_centre,
        library="mujoco",
    ),
    Engine(
        "mujoco-simulated",
        Later(f"{ENGINES_PACKAGE}.mujoco.simulate:MujocoSimulated"),
        SIMULATED,
        UNKNOWNS,
        through_time=True,
        generated=True,
        residuals=True,
        library="mujoco",
    ),
    Engine(
        "free-body",
        FreeBody,
        EQUIVALENCE,
        (*COMPARED_QUANTITIES, *DRY_FRICTION_QUANTITIES),
        positions=_OF_A_POSITION,
        predictor=predict_for_free_bodies,
    ),
)


BALLS = Engine(
    "ball-arithmetic",
    Later(f"{ENGINES_PACKAGE}.balls:BallArithmetic"),
    FULL_ACCURACY,
    answers_nearby=True,
    library="flint",
)


_ANY_METHOD = ", by a method in world axes or about the mass centres"
"""Words of a reason on an error predicted for an engine of an unknown method."""


def hold_fully(engine: Engine) -> Engine:
    """Hold the engine to full accuracy, or else to the error predicted.

    The prediction is for each position.
    """
    if engine.tolerance not in (EQUIVALENCE, FULL_ACCURACY):
        return engine
    unstated: Predictor = predict_for_any_method
    if engine.answers_nearby:
        unstated = predict_from_data
    return replace(
        engine,
        tolerance=FULL_ACCURACY,
        predictor=engine.predictor or unstated,
    )


HARD_ENGINES = tuple(hold_fully(engine) for engine in (BALLS, *ENGINES))
LAB_DISTRIBUTION = "fourbar-lab"
LAB = find_spec(LAB_DISTRIBUTION.replace("-", "_"))
"""Its package, if it is installed or lies on the path. No other adds an engine to the
judge's process.
"""
LAB_FOLDERS = tuple(map(Path, LAB.submodule_search_locations or ())) if LAB else ()
"""Folder of the lab, whose engines.toml a run reads too. Empty without the lab."""


@cache
def load_further() -> tuple[Engine, ...]:
    """Load the engines that the lab lists in its `engines`; none without the lab."""
    if LAB is None:
        return ()
    engines: tuple[Engine, ...] = import_module(f"{LAB.name}.engines").ENGINES
    return engines


def list_engines() -> dict[str, Engine]:
    """Return the engines of harness and lab by name, ball arithmetic first."""
    return {engine.name: engine for engine in (BALLS, *ENGINES, *load_further())}


def make_demands(
    engine: Engine,
    scene: Scene,
    command: Command,
    answer: Answer,
    formulas: Solution | None = None,
) -> Demands:
    """Return what an answer is held to: the engine's tolerance and quantities.

    Ten times the errors predicted for it are allowed too (`TIMES_PREDICTED`).

    Parameters
    ----------
    command : what was commanded; errors are predicted at its positions.
    formulas : the formulas' solution at the command. If it is given, an engine with
        `answers_nearby` may answer again within the rounding of theta_2 where an error
        is beyond the tolerance.
    """
    if formulas is None:
        answer_nearby = None
    else:
        answer_nearby = make_answer_nearby(engine, scene, command, formulas)
    method = ""
    if engine.predictor is predict_for_any_method:
        method = _ANY_METHOD
    return Demands(
        engine.tolerance,
        engine.answers,
        make_prediction(engine, scene, command, answer),
        answer_nearby,
        method,
        engine.residuals,
    )


def make_prediction(
    engine: Engine,
    scene: Scene,
    command: Command,
    answer: Answer,
) -> Predicted | None:
    """Give what computes the errors to be expected, should any be asked for.

    After an alarm the engine's own residuals excuse no error.
    """
    if answer.refusal is not None:
        return None
    if engine.residuals:
        if answer.alarms:
            return None
        return lambda quantity, mask: answer.predicted.get(
            quantity, np.zeros(len(mask))
        )
    predict = engine.predictor
    if command.bar != 2 or command.moves_stroke:
        return None  # the prediction knows the command of bar 2 alone
    conditioned = engine.tolerance.conditioned
    if predict is None or (conditioned and find_missing("flint")):
        return None  # the law in the condition stands alone
    in_balls = scene
    if conditioned:
        known = tuple(effect for effect in scene.effects if effect.in_balls)
        in_balls = replace(scene, effects=known)

    def predict_known(quantity: str, mask: Mask) -> Array | None:
        # effects have no part in the motion
        if in_balls != scene and STAGE_OF.get(quantity) == "force":
            return None
        return predict(in_balls, command, quantity, mask)

    return predict_known


def make_answer_nearby(
    engine: Engine,
    scene: Scene,
    command: Command,
    formulas: Solution,
) -> AnswerNearby | None:
    """Give what answers within the rounding of the stated theta_2.

    None if the engine does not. Near a limit position the last digits of theta_2 decide
    sin(theta_4 - theta_3), and with it every other number: once they are chosen such
    that this sine is that of the formulas, all the others have their digits.

    A drive on bar 3 or 4 has poles of its own, which another theta_2 for the same sine
    does not correct.
    """
    by_input = scene.drive_bar == 2 and command.bar == 2
    if (
        not engine.answers_nearby
        or not by_input
        or command.remainder is not None
        or command.speed is None
    ):
        return None

    @cache
    def answer() -> Arrays:
        from fourbar_validation.engines.balls import shift_to

        adapter = engine.start()
        out = make_blank(len(formulas), COMPARED_QUANTITIES)
        told = formulas.assembled & np.isfinite(formulas.sin_mu)
        for i in np.flatnonzero(told).tolist():
            shift = shift_to(
                scene.linkage,
                float(command.theta_2[i]),
                float(formulas.sin_mu[i]),
            )
            if shift is not None:
                row = slice(i, i + 1)
                moved = command.part(row)._replace(origin=LimitOrigin(shift))
                for name, values in ask_at(adapter, scene, moved).quantities.items():
                    out[name][row] = values
        return out

    return answer


def ask_at(
    adapter: Adapter,
    scene: Scene,
    command: Command,
) -> Answer:
    """Give an engine what is commanded, with the sign of its sine.

    The sign is at each position; nothing else of the formulas is given.
    """
    bare = remove_angles(with_signs(scene.linkage, command))
    answer = adapter.answer(scene, bare)
    if answer.at is bare:
        return replace(answer, at=command)
    if answer.at is None:
        return answer
    if command.moves_stroke:
        require_near(answer.at, command)
    return replace(answer, at=with_signs(scene.linkage, answer.at))


def remove_angles(command: Command) -> Command:
    """Put NaN for the bar's motion in a command by a stroke.

    The formulas computed it from the stroke.
    """
    if not isinstance(command.origin, StrokeOrigin):
        return command
    unknown = np.full_like(command.angle, np.nan)
    speed = None if command.speed is None else unknown
    return command._replace(
        angle=unknown,
        speed=speed,
        acceleration=unknown,
        origin=StrokeOrigin(*command.stated),
    )
