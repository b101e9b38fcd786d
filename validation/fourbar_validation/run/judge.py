"""One scene through the formulas and every engine: its rows, its timings, and what was left out and why."""

import math
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from pkgutil import resolve_name
from typing import Any
from zlib import crc32

import numpy as np

from fourbar.errors import LimitError
from fourbar.mjcf.settings import LIGHT
from fourbar.quantities import FORCES
from fourbar.scene import Command, Scene, command
from fourbar.solution import Solution
from fourbar.solve import solve
from fourbar_validation.compare.answer import Answer, Engine
from fourbar_validation.compare.basis import basis_of
from fourbar_validation.compare.compare import Yardsticks, compare
from fourbar_validation.compare.identities import FORMULAS, closure, identities
from fourbar_validation.compare.reversals import reversals
from fourbar_validation.compare.rows import FAILS, REFUSES, VERDICTS, Row, breakdown, plain
from fourbar_validation.compare.statements.finding import Stated
from fourbar_validation.compare.statements.statements import statements
from fourbar_validation.compare.tolerance import EQUIVALENCE
from fourbar_validation.compare.withheld import OfSome, withheld
from fourbar_validation.engines.exact import sines
from fourbar_validation.engines.free_body import FreeBody, solutions
from fourbar_validation.engines.output import kept
from fourbar_validation.engines.witnesses import WITNESSES, Witness, answering_nearby, not_installed, predicting_from
from fourbar_validation.report.record import Record, Timing
from fourbar_validation.run.printed import piece, printed
from fourbar_validation.run.shipped.checks import judge_shipped

OF_MANY = 500
"""Of so many scenes of a long suite one has what else is shipped judged, which takes as long as judging thirty."""
SIMULATION = "mujoco-simulated"
"""The witness that runs the generated MJCF."""
OUTPUT = "output.txt"
"""In the folder of a run: what the engines printed."""


def judged(name: str, scene: Scene, witnesses: Sequence[Witness] = WITNESSES, *, draw: bool = True) -> Record:
    """Judge a scene and keep what the report needs of it.

    `draw`: with its pictures and observed orders, and with what else is shipped; otherwise, in a long suite, that is
    judged of one scene in OF_MANY, by its name.
    """
    shipped = draw or crc32(name.encode(errors="replace")) % OF_MANY == 0
    record = judge(name, scene, witnesses, order=draw, shipped=shipped)
    record.rows = [naming_output(row) if row.engine in record.output else row for row in record.rows]
    figure = None
    if draw:
        from fourbar_validation.report.figures import scene_figure

        figure = scene_figure(record)
    return record.kept(figure)


def naming_output(row: Row) -> Row:
    """A row that fails says where to read what its engine printed."""
    return replace(row, reason=f"{row.reason}; what it printed: {OUTPUT}") if row.failed else row


def judge(
    name: str,
    scene: Scene,
    witnesses: Sequence[Witness] = WITNESSES,
    *,
    order: bool = True,
    shipped: bool = False,
) -> Record:
    """Let every witness answer one scene and compare; an engine that breaks down costs its own rows.

    `order`: measure the observed order of what is simulated, which takes two more simulations and changes no row.
    `shipped`: judge what else is shipped (studies, sensitivities, files of other simulators), which takes a second.
    """
    record = Record(name, scene, plain(scene.title), plain(scene.source))
    if scene.motion.free is not None:
        from fourbar_validation.run.released import judge_released

        return judge_released(record, witnesses)
    at = _once(command(scene), record)
    witnesses = list(_called_for(witnesses, at, record))
    stage = _stage(at)
    solve(scene, stage, at=at)  # untimed: the first call of a process pays for what every later one finds loaded
    record.solution, seconds = _timed(lambda: solve(scene, stage, at=at))
    record.timings.append(Timing(name, FORMULAS, "exact", len(at.theta_2), seconds))
    record.rows += identities(name, scene, at, record.solution)
    engines = _Engines(scene, at)
    free_body = engines.free_body()
    basis = _basis(scene, free_body)
    if basis is not None and at.omega_2 is not None:
        record.rows.append(withheld(name, scene, record.solution, basis, *_by_exact_means(scene, at)))
    elif basis is None and (free_body is None or free_body.refusal is None):
        what = "the free bodies, by which it is judged, broke down"
        record.rows.append(Row.unmeasured(name, FORMULAS, "exact", "status", FAILS, what))
    record.rows += printed(name, scene, at, record.solution, basis)
    record.jumps = reversals(scene, at, record.solution)
    stated, yardsticks = Stated(scene.linkage), Yardsticks()
    for witness in witnesses:
        answer = _ask(witness, engines, record)
        if answer is None:
            continue
        record.answers.append(answer)
        record.rows += _judged(name, scene, at, record.solution, answer, witness, basis, yardsticks)
        exact = witness.tolerance == EQUIVALENCE and answer.refusal is None and "theta_3" in witness.expected
        if exact and witness.stated:
            record.rows += _stated(name, scene, at, witness, engines.started(witness), answer, stated)
        if order and witness.order and answer.refusal is None:
            answer.evidence |= _observed_order(name, scene, at, record.solution, witness)
    if any(witness.name == SIMULATION for witness in witnesses):
        record.rows += _shipped(name, scene, at)
    _judge_inertia(record, scene, at, witnesses, free_body)
    if shipped:
        for row in judge_shipped(name, scene, at, record.solution, free_body):
            if isinstance(row, str):
                record.left_out.append(row)
            else:
                record.rows.append(row)
    return record


def _shipped(name: str, scene: Scene, at: Command) -> list[Row]:
    """The generated MJCF as it is shipped, if one is."""
    try:
        row = resolve_name("fourbar_validation.engines.mujoco.shipped:shipped")(name, scene, at)
    except Exception as error:  # as of any engine
        return [breakdown(name, SIMULATION, error, "MJCF as shipped")]
    return [] if row is None else [row]


def _stage(at: Command) -> str:
    """As far as anything is compared: the formulas' own error bars take ten times as long as all the rest."""
    return "position" if at.omega_2 is None else "force"


def _once(at: Command, record: Record) -> Command:
    """One position where all of them are the same: constant conditions are not swept."""
    numbers = (at.theta_2, at.branch, 0.0 if at.omega_2 is None else at.omega_2, at.alpha_2)
    if len(at.theta_2) == 1 or any(np.ptp(values) != 0 for values in numbers):
        return at
    record.left_out.append("positions: all are the same, one is evaluated")
    return piece(at, np.array([0]))._replace(time=None)


def _called_for(witnesses: Iterable[Witness], at: Command, record: Record) -> Iterator[Witness]:
    """The witnesses that the question needs; the others are left out before their engine is imported."""
    for witness in witnesses:
        reason = None
        if at.omega_2 is None:
            reason = None if witness.positions else "the scene states positions only, and it gives forces"
        elif witness.through_time and not np.any(at.omega_2):
            reason = "omega_2 is 0: nothing moves through time"
        elif witness.through_time and len(at.theta_2) == 1:
            reason = "one position is no motion through time"
        if reason is None:
            yield witness if at.omega_2 is not None else replace(witness, expected=witness.positions)
        else:
            record.left_out.append(f"{witness.name}: {reason}")


class _Engines:
    """What answers one scene: each engine is started once, and the free bodies, by which all is judged, answer once."""

    def __init__(self, scene: Scene, at: Command) -> None:
        self.scene, self.at = scene, at
        self._started: dict[str, Engine] = {}
        self._answered: dict[str, tuple[Answer, float]] = {}

    def started(self, witness: Witness) -> Engine:
        """The engine of a witness."""
        if witness.adapter not in self._started:
            self._started[witness.adapter] = witness.engine()
        return self._started[witness.adapter]

    def answer(self, witness: Witness) -> tuple[Answer, float]:
        """The answer of a witness, and the seconds that it took."""
        if witness.adapter in self._answered:
            return self._answered[witness.adapter]
        return _timed(lambda: self.started(witness).answer(self.scene, self.at))

    def free_body(self) -> Answer | None:
        """The answer of the free bodies, or None where they break down: a row of their own fails."""
        adapter = f"{FreeBody.__module__}:{FreeBody.__name__}"
        try:
            with np.errstate(all="ignore"):
                self._answered[adapter] = _timed(lambda: FreeBody().answer(self.scene, self.at))
        except Exception:  # as of any engine: what it leaves undone has rows that fail
            return None
        return self._answered[adapter][0]


def _basis(scene: Scene, free_body: Answer | None) -> Solution | None:
    """Conditions and sizes of the positions by free bodies: nothing is allowed on the word of the formulas alone.

    Without them each answer is measured by itself.
    """
    try:
        with np.errstate(all="ignore"):
            return None if free_body is None else basis_of(scene, free_body)
    except ArithmeticError:
        return None


def _by_exact_means(scene: Scene, at: Command) -> tuple[OfSome | None, OfSome | None]:
    """The sine between bars 3 and 4 in many digits, and how many solutions friction has, at some positions."""

    unknown = at.remainder is not None or not_installed("flint")
    loaded = any(effect.loaded_pins for effect in scene.effects)
    return (
        None if unknown else lambda where: sines(scene.linkage, piece(at, where)),
        (lambda where: solutions(scene, piece(at, where))) if loaded else None,
    )


def _judged(
    name: str,
    scene: Scene,
    at: Command,
    solution: Solution,
    answer: Answer,
    witness: Witness,
    basis: Solution | None,
    yardsticks: Yardsticks,
) -> list[Row]:
    """The rows of one answer, against the formulas at the motion that the engine really made."""
    theirs = answer.at if answer.at is not None else at
    formulas = solution
    if theirs is not at:
        basis = _basis(scene, _Engines(scene, theirs).free_body())
        formulas, yardsticks = solve(scene, _stage(theirs), at=theirs), {}
    predicted = predicting_from(witness, scene, theirs, answer)
    nearby = answering_nearby(witness, scene, theirs, formulas)
    rows = compare(
        name, scene, answer, formulas, witness.tolerance, witness.expected, predicted, basis, yardsticks, nearby
    )
    if (ratio := answer.evidence.get("mass_ratio", 1.0)) > LIGHT:
        why = f"; of coupler and output one is {ratio:.1e} times lighter"
        rows = [replace(row, reason=row.reason + why) if row.failed else row for row in rows]
    answers = answer.assembled is not None and len(answer.assembled) == len(formulas)  # otherwise a row has failed
    if answers and answer.at is not None and {"theta_3", "theta_4"} <= answer.quantities.keys():
        rows.append(closure(name, scene, answer, witness.tolerance))
    return rows


def _stated(
    name: str, scene: Scene, at: Command, witness: Witness, engine: Engine, answer: Answer, stated: Stated
) -> list[Row]:
    """What the formulas state of the linkage whatever its motion, held against an exact engine."""
    try:
        predicted = predicting_from(witness, scene, at, answer)
        return statements(name, scene, engine, answer, stated, predicted)
    except LimitError as limit:
        return [Row.unmeasured(name, witness.name, "statements of the linkage", "all", REFUSES, str(limit))]
    except Exception as error:  # whatever an engine raises is its own failure, in its own row
        return [breakdown(name, witness.name, error, "statements of the linkage")]


def _observed_order(name: str, scene: Scene, at: Command, solution: Solution, witness: Witness) -> dict[str, float]:
    """The worst error of the torque and the pin forces at 4h and 2h, and the order in h that they show."""

    def error(answer: Answer) -> float:
        rows = _judged(name, scene, at, solution, answer, replace(witness, expected=FORCES), None, {})
        return max((row.error for row in rows if row.quantity in FORCES), default=math.nan)  # a refusal has none

    coarse, fine, order = resolve_name(witness.order)(scene, at, error)
    seen = {"error_at_4h": coarse, "error_at_2h": fine, "observed_order": order}
    return seen if all(map(math.isfinite, seen.values())) else {}  # a coarse run may leave what the scene covers


def _judge_inertia(
    record: Record, scene: Scene, at: Command, witnesses: Iterable[Witness], free_body: Answer | None
) -> None:
    """The inertial part of the torque by itself: loads can hide an inertia that is 24 times wrong.

    An exact engine answers it in the same assembly; another one is started once more.
    """
    if at.omega_2 is None or not (scene.loads or scene.effects):
        return
    bare = replace(scene, loads=(), effects=())
    ours = solve(bare, _stage(at), at=at)
    refused = {answer.engine for answer in record.answers if answer.refusal is not None}  # and has its row
    engines = _Engines(bare, at)
    of_bare, yardsticks = _basis(bare, _of_inertia(free_body) or engines.free_body()), Yardsticks()
    for witness in witnesses:
        if "torque" not in witness.expected:
            continue
        answer = _of_inertia(next((each for each in record.answers if each.engine == witness.name), None))
        if answer is None:
            answer = _ask(witness, engines, record, part="inertia alone")
        if answer is None or (answer.refusal is not None and answer.engine in refused):
            continue
        rows = _judged(record.name, bare, at, ours, answer, replace(witness, expected=("torque",)), of_bare, yardsticks)
        rows = [row for row in rows if row.quantity == "torque" or row.verdict in (REFUSES, FAILS)]
        rows = [row for row in rows if row.quantity != "undecided"]
        if rows:  # what fails besides the torque, or stands in place of it, is not left out
            worst = max(rows, key=lambda row: VERDICTS.index(row.verdict))
            reason = worst.reason if worst.quantity in ("torque", "all") else f"{worst.quantity}: {worst.reason}"
            record.rows.append(replace(worst, quantity="torque_inertia", reason=reason))


def _of_inertia(answer: Answer | None) -> Answer | None:
    """The part of an answer that is of the bars alone, or None."""
    if answer is None or "torque_inertia" not in answer.quantities:
        return None
    alone = {**answer.quantities, "torque": answer.quantities["torque_inertia"]}
    alone.pop("drive_condition", None)  # which holds how near loads and friction are to jamming
    return replace(answer, quantities=alone, evidence={}, alarms=[])


def _ask(witness: Witness, engines: _Engines, record: Record, part: str = "") -> Answer | None:
    try:
        with kept(record.output, witness.name):
            answer, seconds = engines.answer(witness)
    except Exception as error:  # whatever an engine raises is its own failure, in its own row
        record.rows.append(breakdown(record.name, witness.name, error, part))
        return None
    if not part:
        record.timings.append(Timing(record.name, answer.engine, answer.setting, len(engines.at.theta_2), seconds))
        if answer.refusal is not None:
            record.left_out.append(f"{answer.engine}: {answer.refusal}")
    return answer


def _timed(action: Callable[[], Any]) -> tuple[Any, float]:
    start = time.perf_counter()
    result = action()
    return result, time.perf_counter() - start
