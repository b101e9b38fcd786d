"""Settings to type into a robot's file.

Softness of a loop and stepping are measured in the file itself, first with one setting
changed alone. Then combinations are tried, those that cost least time first, until one
keeps the torque and the pin forces within the wanted error.
"""

import math
import time
from collections.abc import Iterator, Sequence
from contextlib import suppress
from copy import copy
from dataclasses import replace
from itertools import product
from typing import Any
from xml.etree import ElementTree as ET

import mujoco
import numpy as np

from fourbar.errors import LimitError
from fourbar.quantities import Array
from fourbar_validation.engines.mujoco.describe import number_of_word, word_of_number
from fourbar_validation.engines.mujoco.robots.ancestry import is_enabled, name_joint
from fourbar_validation.engines.mujoco.robots.answers import (
    InsideAnswer,
    RobotSettings,
    SettingsAdvice,
    TriedSettings,
    WorstState,
    make_motion,
    thin_out,
)
from fourbar_validation.engines.mujoco.robots.inside import LoopInside
from fourbar_validation.engines.mujoco.robots.loop_facts import RobotFile, RobotLoop

SEARCH_SECONDS = 75.0
"""Processor time in which combinations are tried, s. With the rest the command stays
within two minutes.
"""
POSITIONS_OF_A_TRIAL = 9
"""Positions of a trial."""
STIFFEST_IMPEDANCE = (0.9999, 0.9999, 0.001, 0.5, 2.0)
"""The stiffest impedance: MuJoCo clamps it there."""
_FASTER = (0.5, 0.2, 0.1, 0.05)
"""Factors on the closure's time constant."""
FEWEST_TIMESTEPS = 2.0
"""Timesteps of the time constant, below which MuJoCo keeps it."""
_FINER = (0.5, 0.2, 0.1)
"""Factors on the timestep."""
INTEGRATORS_TRIED = ("Euler", "implicit", "implicitfast", "RK4")
_EVALUATIONS = {"RK4": 4.0}
"""Evaluations of a step, for the order in which combinations are tried. The others have
one.
"""
SOLVER: dict[str, Any] = {"solver": "Newton", "iterations": 100, "tolerance": 1e-10}
"""Solver, iterations and tolerance at which the solver leaves nothing."""
RANGES_TRIED = 4
"""Ranges of the driven joint in which a combination is measured that is not within the
wanted error everywhere.
"""
_FIRST_CONSTANT = 0.02
"""MuJoCo's own time constant, s, tried if the file states a stiffness in its place."""
_OF_CLOSURES = ("solref", "solimp")
_OF_FRICTION = ("solreffriction", "solimpfriction")


def read_settings(model: mujoco.MjModel, loop: RobotLoop) -> RobotSettings:
    """Read the settings of a compiled model."""
    option = model.opt
    return RobotSettings(
        tuple(model.eq_solref[loop.equality].tolist()),
        tuple(model.eq_solimp[loop.equality].tolist()),
        float(option.timestep),
        word_of_number("integrator", option.integrator),
        word_of_number("solver", option.solver),
        int(option.iterations),
        float(option.tolerance),
    )


def _list_rubbing(model: mujoco.MjModel, loop: RobotLoop) -> list[int]:
    """List the degrees of freedom of a loop's hinges with dry friction."""
    if not is_enabled(model, "frictionloss", "constraint"):
        return []
    dofs: list[int] = model.jnt_dofadr[[*loop.hinges.values()]].tolist()
    return [dof for dof in dofs if model.dof_frictionloss[dof]]


def _set_settings(
    model: mujoco.MjModel,
    loop: RobotLoop,
    settings: RobotSettings,
) -> mujoco.MjModel:
    """Return a copy of a compiled model with other settings.

    All closures of the loop get the same.
    """
    changed = copy(model)
    closures = [*loop.closures]
    rubbing = _list_rubbing(model, loop)
    changed.eq_solref[closures] = settings.solref
    changed.eq_solimp[closures] = settings.solimp
    if settings.solreffriction is not None:
        changed.dof_solref[rubbing] = settings.solreffriction
    if settings.solimpfriction is not None:
        changed.dof_solimp[rubbing] = settings.solimpfriction
    option = changed.opt
    option.integrator = number_of_word("integrator", settings.integrator)
    option.solver = number_of_word("solver", settings.solver)
    option.timestep = settings.timestep
    option.iterations = settings.iterations
    option.tolerance = settings.tolerance
    return changed


class SettingsSearch:
    """Settings tried on one loop of a robot, for one motion."""

    def __init__(self, inside: LoopInside, motion: Array, share: float = 1.0) -> None:
        self.inside = inside
        self.whole = motion
        self.motion = thin_out(motion, POSITIONS_OF_A_TRIAL)
        self.own = read_settings(inside.given, inside.loop)
        self.rubbing = _list_rubbing(inside.given, inside.loop)
        self.tried: dict[RobotSettings, TriedSettings] = {}
        self.end = time.process_time() + SEARCH_SECONDS * share

    def advise(self, wanted: float, file: RobotFile) -> SettingsAdvice:
        """Find the cheapest combination within an error."""
        before = self.measure(self.own)
        alone = sorted(map(self.measure, self._list_alone()), key=lambda one: one.error)
        best = self._find_cheapest(wanted)
        tried = len(self.tried)
        within = None
        if best.error > wanted:
            within = self.find_range(best.settings, wanted)
        model = self.inside.given
        joints = model.dof_jntid[self.rubbing].tolist()
        return SettingsAdvice(
            wanted,
            len(self.motion),
            before,
            tuple(alone),
            best,
            tried,
            _write_elements(file, self.inside.loop, best, model, joints),
            within,
        )

    def _answer(
        self, settings: RobotSettings, motion: Array, wanted: float = math.inf
    ) -> list[InsideAnswer]:
        """Return the answers at single states and through time.

        One that takes too many steps is left out, as are those after it, and so are all
        where the settings tear the loop. Settings are not simulated whose single states
        are not within an error.
        """
        given = self.inside
        inside = given.with_model(_set_settings(given.given, given.loop, settings))
        answers = []
        with suppress(LimitError):
            states = inside.answer_states(motion)
            answers.append(states)
            if states.find_worst(states.scales(inside.lever)).error <= wanted:
                answers.append(inside.answer_through_time(motion))
        return answers

    def find_range(
        self, settings: RobotSettings, wanted: float
    ) -> tuple[float, float] | None:
        """Return the widest range of the driven joint found within an error, rad.

        Ranges are proposed by the states of the whole motion, each error over the
        scale of its range, and then measured by themselves.
        """
        answers = self._answer(settings, self.whole)
        if len(answers) < 2 or answers[1].lost:
            return None
        places = np.unique(answers[0].rows.angle).tolist()
        ranges = (
            places[first : first + count]
            for count in range(len(places), 2, -1)
            for first in range(len(places) - count + 1)
        )
        tried = 0
        for inside in ranges:
            low = inside[0]
            high = inside[-1]
            states, through = (
                InsideAnswer(rows[(low <= rows.angle) & (rows.angle <= high)])
                for rows in (one.rows for one in answers)
            )
            if tried == RANGES_TRIED:
                return None
            scales = states.scales(self.inside.lever)
            if max(one.find_worst(scales) for one in (states, through)).error > wanted:
                continue
            tried += 1
            motion = make_motion(inside, self.whole[0, 1:])
            search = SettingsSearch(self.inside, motion)
            if search.measure(settings).error <= wanted:
                at_ends = np.isin(states.rows.angle, (low, high))
                ends = states.rows.joint[at_ends].tolist()
                return min(ends), max(ends)
        return None

    def measure(
        self, settings: RobotSettings, wanted: float = math.inf
    ) -> TriedSettings:
        """Measure what settings reach.

        They are not simulated where their single states are not within an error.
        """
        known = self.tried.get(settings)
        if known is not None and (known.is_simulated or known.states.error > wanted):
            return known
        states = through = WorstState(math.inf)
        gap = seconds = math.inf
        answers = self._answer(settings, self.motion, wanted)
        if answers:
            scales = answers[0].scales(self.inside.lever)
            states = answers[0].find_worst(scales)
        if len(answers) == 2:
            answer = answers[1]
            through = answer.find_worst(scales)
            seconds = answer.seconds_per_step
            gap = float(answer.rows.gap.max()) if len(answer.rows) else math.inf
        changes = settings.list_changes(self.own)
        measured = TriedSettings(settings, changes, states, through, gap, seconds)
        self.tried[settings] = measured
        return measured

    def _list_alone(self) -> Iterator[RobotSettings]:
        """List each setting changed by itself."""
        own = self.own
        for name, values in self._list_values().items():
            for value in values[1:]:
                yield replace(own, **{name: value})
        if own.solver != SOLVER["solver"]:
            yield replace(own, solver=SOLVER["solver"])
        if own.iterations < SOLVER["iterations"]:
            yield replace(own, iterations=SOLVER["iterations"])
        if own.tolerance > SOLVER["tolerance"]:
            yield replace(own, tolerance=SOLVER["tolerance"])

    def _list_values(self) -> dict[str, list[Any]]:
        """Return the values of each setting that are combined, the file's own first."""
        own = self.own
        constant, ratio = own.solref
        if constant <= 0.0:
            constant = _FIRST_CONSTANT
            ratio = 1.0
        shortest = FEWEST_TIMESTEPS * own.timestep
        constants = {max(factor * constant, shortest) for factor in _FASTER}
        faster = sorted((one for one in constants if one < constant), reverse=True)
        model = self.inside.given
        soft = model.dof_solref[self.rubbing, 0] > shortest
        yielding = model.dof_solimp[self.rubbing, 1] < STIFFEST_IMPEDANCE[1]
        further: dict[str, list[Any]] = {
            "solimp": [STIFFEST_IMPEDANCE],
            "solref": [(one, ratio) for one in faster],
            "integrator": [*INTEGRATORS_TRIED],
            "timestep": [factor * own.timestep for factor in _FINER],
            "solreffriction": [(shortest, 1.0)] * bool(soft.any()),
            "solimpfriction": [STIFFEST_IMPEDANCE] * bool(yielding.any()),
        }
        return {
            name: [*dict.fromkeys((getattr(own, name), *values))]
            for name, values in further.items()
        }

    def _find_cheapest(self, wanted: float) -> TriedSettings:
        """Try combinations until one serves, first the cheapest with fewest changes.

        If none serves in time, the most accurate one is returned.
        """
        values = self._list_values()
        solvers: list[dict[str, Any]] = [{}]
        tight = self.measure(replace(self.own, **SOLVER))
        if tight.error < 0.9 * self.measure(self.own).error:
            solvers.append(SOLVER)
        combinations = [
            replace(self.own, **dict(zip(values, chosen, strict=True)), **solver)
            for *chosen, solver in product(*values.values(), solvers)
        ]
        combinations.sort(key=self._rank)
        for settings in combinations:
            if time.process_time() > self.end:
                break
            measured = self.measure(settings, wanted)
            if measured.error <= wanted:
                return measured
        best = min(self.tried.values(), key=lambda one: one.error)
        for one in sorted(self.tried.values(), key=lambda one: one.states.error):
            if one.states.error >= best.error:
                break
            best = min(best, self.measure(one.settings), key=lambda one: one.error)
        return best

    def _rank(self, settings: RobotSettings) -> tuple[float, int, float]:
        """Return the key by which combinations are sorted.

        Evaluations per simulated second come first, then changes, then stiffness.
        """
        evaluations = _EVALUATIONS.get(settings.integrator, 1.0) / settings.timestep
        changes = settings.list_changes(self.own)
        return evaluations, len(changes), -settings.solref[0]


def _write_elements(
    file: RobotFile,
    loop: RobotLoop,
    tried: TriedSettings,
    model: mujoco.MjModel,
    rubbing: Sequence[int],
) -> tuple[str, ...]:
    """Return the elements of the file that are to be changed, with their new values.

    `rubbing`: hinges with dry friction.
    """

    def write(tag: str, attributes: dict[str, str]) -> str:
        return ET.tostring(ET.Element(tag, attributes), encoding="unicode")

    option = dict(tried.changes)
    closure, friction = (
        {name: option.pop(name) for name in names if name in option}
        for names in (_OF_CLOSURES, _OF_FRICTION)
    )
    written = []
    if option:
        written.append(write("option", option))
    root = ET.fromstring(file.text)
    elements = root.findall(".//equality/*")
    equalities = [one for one in elements if one.tag != "equality"]
    for number in loop.closures if closure else ():
        # that of a URDF is no element of it
        one = (
            equalities[number] if equalities else ET.Element("connect", name=loop.name)
        )
        written.append(write(one.tag, one.attrib | closure))
    joints = [
        one.attrib
        for one in root.findall(".//worldbody//*")
        if one.tag in ("joint", "freejoint")
    ]
    stated = {attributes.get("name", ""): attributes for attributes in joints}
    in_order = [attributes.get("name", "") for attributes in joints] == [
        model.joint(number).name for number in range(model.njnt)
    ]
    for number in rubbing if friction else ():
        name = name_joint(model, number)
        own = joints[number] if in_order else stated.get(name, {"name": name})
        written.append(write("joint", own | friction))
    return tuple(written)
