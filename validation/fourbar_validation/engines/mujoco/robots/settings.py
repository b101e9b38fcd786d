"""Settings to type into a robot's file.

Softness of a loop and stepping are measured in the file itself, first with one setting
changed alone. Then combinations are tried, those that cost least time first, until one
keeps the torque and the pin forces within the wanted error.
"""

import math
import time
from collections import ChainMap
from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress
from copy import copy
from itertools import chain, compress, islice, product
from xml.etree import ElementTree as ET

import mujoco
import numpy as np

from fourbar.errors import LimitError
from fourbar.mjcf.model import write_six_digits
from fourbar.quantities import Array
from fourbar_validation.engines.mujoco.describe import (
    ENUMERATIONS,
    STIFFEST,
    number_of_word,
    word_of_number,
)
from fourbar_validation.engines.mujoco.robots.ancestry import is_enabled, name_joint
from fourbar_validation.engines.mujoco.robots.inside import LoopInside
from fourbar_validation.engines.mujoco.robots.loop_facts import (
    InsideAnswer,
    RobotFile,
    RobotLoop,
    SettingsAdvice,
    TriedSettings,
    make_motion,
    thin_out,
)

SEARCH_SECONDS = 75.0
"""Processor time in which combinations are tried, s. With the rest the command stays
within two minutes.
"""
POSITIONS_OF_A_TRIAL = 9
"""Positions of a trial."""
STIFFEST_IMPEDANCE = "0.9999 0.9999 0.001 0.5 2"
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
SOLVER = {"solver": "Newton", "iterations": "100", "tolerance": "1e-10"}
"""Solver, iterations and tolerance at which the solver leaves nothing."""
RANGES_TRIED = 4
"""Ranges of the driven joint in which a combination is measured that is not within the
wanted error everywhere.
"""
_FIRST_CONSTANT = 0.02
"""MuJoCo's own time constant, s, tried if the file states a stiffness in its place."""
_OPTIONS = ("timestep", "integrator", *SOLVER)
_OF_CLOSURES = ("solref", "solimp")
_OF_FRICTION = ("solreffriction", "solimpfriction")


def _list_rubbing(model: mujoco.MjModel, loop: RobotLoop) -> list[int]:
    """List the degrees of freedom of a loop's hinges with dry friction."""
    if not is_enabled(model, "frictionloss", "constraint"):
        return []
    dofs: list[int] = model.jnt_dofadr[[*loop.hinges.values()]].tolist()
    return [dof for dof in dofs if model.dof_frictionloss[dof]]


def set_settings(
    model: mujoco.MjModel,
    loop: RobotLoop,
    changes: Mapping[str, str],
) -> mujoco.MjModel:
    """Return a copy of a compiled model with other settings, by their attributes.

    All closures of the loop get the same, and all its hinges with dry friction.
    """
    changed = copy(model)
    for name, text in changes.items():
        if name in _OF_CLOSURES:
            getattr(changed, f"eq_{name}")[[*loop.closures]] = text.split()
        elif name in _OF_FRICTION:
            field = f"dof_{name.removesuffix('friction')}"
            getattr(changed, field)[_list_rubbing(model, loop)] = text.split()
        elif name in ENUMERATIONS:
            setattr(changed.opt, name, number_of_word(name, text))
        else:
            kind = type(getattr(changed.opt, name))
            setattr(changed.opt, name, kind(text))
    return changed


class SettingsSearch:
    """Settings tried on one loop of a robot, for one motion."""

    def __init__(self, inside: LoopInside, motion: Array, share: float = 1.0) -> None:
        self.inside = inside
        self.whole = motion
        self.motion = thin_out(motion, POSITIONS_OF_A_TRIAL)
        model = inside.given
        self.own = {
            name: write_six_digits(*getattr(model, f"eq_{name}")[inside.loop.equality])
            for name in _OF_CLOSURES
        }
        """Settings of the file."""
        for name in _OPTIONS:
            value = getattr(model.opt, name)
            is_word = name in ENUMERATIONS
            text = word_of_number(name, value) if is_word else write_six_digits(value)
            self.own[name] = text
        looser = (
            self.own["solver"] != SOLVER["solver"],
            model.opt.iterations < int(SOLVER["iterations"]),
            model.opt.tolerance > float(SOLVER["tolerance"]),
        )
        self.solver = dict(compress(SOLVER.items(), looser))
        """Settings of the solver that leave less than the file's."""
        self.rubbing = _list_rubbing(model, inside.loop)
        self.tried: dict[frozenset[tuple[str, str]], TriedSettings] = {}
        self.end = time.process_time() + SEARCH_SECONDS * share

    def advise(self, wanted: float, file: RobotFile) -> SettingsAdvice:
        """Find the cheapest combination within an error."""
        before = self.measure({})
        solver = [{name: value} for name, value in self.solver.items()]
        singles = chain(*self._list_choices(), solver)
        alone = sorted(map(self.measure, singles), key=lambda one: one.error)
        best = self._find_cheapest(wanted)
        tried = len(self.tried)
        within = None
        if best.error > wanted:
            within = self.find_range(best.changes, wanted)
        return SettingsAdvice(
            wanted,
            len(self.motion),
            before,
            tuple(alone),
            best,
            tried,
            tuple(self._write_elements(file, best.changes)),
            within,
        )

    def _answer(
        self, changes: Mapping[str, str], motion: Array, wanted: float = math.inf
    ) -> tuple[InsideAnswer, InsideAnswer]:
        """Return the answers at single states and through time.

        One that takes too many steps is empty, and so are both where the settings tear
        the loop. Settings are not simulated whose single states are not within an
        error.
        """
        given = self.inside
        model = set_settings(given.given, given.loop, changes)
        inside = LoopInside(model, given.loop, given.scene)
        states = through = InsideAnswer()
        with suppress(LimitError):
            states = inside.answer_states(motion)
            if states.find_worst(states.scales(inside.lever)).error <= wanted:
                through = inside.answer_through_time(motion)
        return states, through

    def find_range(
        self, changes: Mapping[str, str], wanted: float
    ) -> tuple[float, float] | None:
        """Return the widest range of the driven joint found within an error, rad.

        Ranges are proposed by the states of the whole motion, each error over the
        scale of its range, and then measured by themselves.
        """
        states, through = self._answer(changes, self.whole)
        if through.lost or not len(through.rows):
            return None

        def fits(angles: list[float]) -> bool:
            """Tell whether the states of a range are within the error."""
            low, *_, high = angles
            parts = [
                InsideAnswer(rows[(low <= rows.angle) & (rows.angle <= high)])
                for rows in (states.rows, through.rows)
            ]
            scales = parts[0].scales(self.inside.lever)
            return all(one.find_worst(scales).error <= wanted for one in parts)

        places = np.unique(states.rows.angle).tolist()
        ranges = (
            places[first : first + count]
            for count in range(len(places), 2, -1)
            for first in range(len(places) - count + 1)
        )
        for angles in islice(filter(fits, ranges), RANGES_TRIED):
            motion = make_motion(angles, self.whole[0, 1:])
            search = SettingsSearch(self.inside, motion)
            if search.measure(changes).error <= wanted:
                at_ends = np.isin(states.rows.angle, (angles[0], angles[-1]))
                ends = states.rows.joint[at_ends].tolist()
                return min(ends), max(ends)
        return None

    def measure(
        self, changes: Mapping[str, str], wanted: float = math.inf
    ) -> TriedSettings:
        """Measure what settings reach.

        A setting whose single states are not within the error is not simulated.
        """
        known = self.tried.get(frozenset(changes.items()))
        if known is not None and (
            math.isfinite(known.seconds_per_step) or known.states.error > wanted
        ):
            return known
        states, through = self._answer(changes, self.motion, wanted)
        scales = states.scales(self.inside.lever)
        seconds = through.seconds_per_step
        measured = TriedSettings(
            changes,
            states.find_worst(scales),
            through.find_worst(scales),
            max(through.rows.gap.tolist(), default=math.inf),
            seconds,
            seconds / float({**self.own, **changes}["timestep"]),
        )
        self.tried[frozenset(changes.items())] = measured
        return measured

    def _list_choices(self) -> list[list[dict[str, str]]]:
        """List the changes of each setting that are combined with those of others."""
        model = self.inside.given
        constant, ratio = model.eq_solref[self.inside.loop.equality].tolist()
        if constant <= 0.0:
            constant = _FIRST_CONSTANT
            ratio = 1.0
        finer = [factor * model.opt.timestep for factor in _FINER]
        shortest = FEWEST_TIMESTEPS * model.opt.timestep
        constants = {max(factor * constant, shortest) for factor in _FASTER}
        faster = sorted((one for one in constants if one < constant), reverse=True)
        soft = model.dof_solref[self.rubbing, 0] > shortest
        yielding = model.dof_solimp[self.rubbing, 1] < STIFFEST
        further = {
            "solimp": [STIFFEST_IMPEDANCE],
            "solref": [write_six_digits(one, ratio) for one in faster],
            "integrator": [*INTEGRATORS_TRIED],
            "timestep": [*map(write_six_digits, finer)],
            "solreffriction": [write_six_digits(shortest, 1.0)] * bool(soft.any()),
            "solimpfriction": [STIFFEST_IMPEDANCE] * bool(yielding.any()),
        }
        return [
            [{name: value} for value in values if value != self.own.get(name)]
            for name, values in further.items()
        ]

    def _find_cheapest(self, wanted: float) -> TriedSettings:
        """Try combinations until one serves, first the cheapest with fewest changes.

        If none serves in time, the most accurate one is returned.
        """
        choices = self._list_choices()
        if self.measure(self.solver).error < 0.9 * self.measure({}).error:
            choices.append([self.solver])
        combinations = [
            dict(ChainMap(*chosen))
            for chosen in product(*([{}, *changes] for changes in choices))
        ]
        combinations.sort(key=self._rank)
        for changes in combinations:
            if time.process_time() > self.end:
                break
            measured = self.measure(changes, wanted)
            if measured.error <= wanted:
                return measured
        best = min(self.tried.values(), key=lambda one: one.error)
        for one in sorted(self.tried.values(), key=lambda one: one.states.error):
            if one.states.error >= best.error:
                break
            best = min(best, self.measure(one.changes), key=lambda one: one.error)
        return best

    def _rank(self, changes: Mapping[str, str]) -> tuple[float, int, float]:
        """Return the key by which combinations are sorted.

        Evaluations per simulated second come first, then changes, then stiffness.
        """
        settings = {**self.own, **changes}
        evaluations = _EVALUATIONS.get(settings["integrator"], 1.0)
        constant, _ = settings["solref"].split()
        return evaluations / float(settings["timestep"]), len(changes), -float(constant)

    def _write_elements(
        self, file: RobotFile, changes: Mapping[str, str]
    ) -> Iterator[str]:
        """Write the elements of the file that change, with their new values."""
        loop = self.inside.loop
        model = self.inside.given

        def write(
            tag: str, own: Mapping[str, str], names: Iterable[str]
        ) -> Iterator[str]:
            """Write an element with what changes of some attributes, if anything."""
            changed = {name: changes[name] for name in names if name in changes}
            if changed:
                yield ET.tostring(ET.Element(tag, {**own, **changed}), "unicode")

        yield from write("option", {}, _OPTIONS)
        root = ET.fromstring(file.text)
        elements = root.findall(".//equality/*")
        equalities = [one for one in elements if one.tag != "equality"]
        for number in loop.closures:
            # that of a URDF is no element of it
            one = equalities[number] if equalities else ET.Element("connect")
            own = one.attrib if file.kind == "MJCF" else {}
            yield from write(one.tag, own, _OF_CLOSURES)
        joints = [
            one.attrib
            for one in root.findall(".//worldbody//*")
            if one.tag in ("joint", "freejoint")
        ]
        stated = {attributes.get("name", ""): attributes for attributes in joints}
        in_order = [attributes.get("name", "") for attributes in joints] == [
            model.joint(number).name for number in range(model.njnt)
        ]
        for number in model.dof_jntid[self.rubbing].tolist():
            name = name_joint(model, number)
            own = joints[number] if in_order else stated.get(name, {"name": name})
            yield from write("joint", own, _OF_FRICTION)
