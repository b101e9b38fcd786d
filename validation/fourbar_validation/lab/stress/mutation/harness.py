"""The harness alone against mutants of the formulas: no unit test takes part.

Run in a tree that mutmut has generated, in which every mutant is switched on by its name. A mutant counts
where it changes a number that `solve` returns, or that is stated of the linkage, by more than 1e-9 of its
scale (or what assembles, or which numbers exist, or raises); it is caught where a comparison then fails.
"""

import json
import math
import signal
import sys
from importlib import import_module
from typing import Any

import numpy as np

from fourbar.formulas import mobility, transmission
from fourbar.formulas.path import state as state_of
from fourbar.linkage import MOVING_BARS, FourBar
from fourbar.quantities import UNITS
from fourbar.scene import Command, Scene, command
from fourbar.solve import solve
from fourbar_validation.compare.answer import Answer
from fourbar_validation.compare.basis import basis_of
from fourbar_validation.compare.compare import compare
from fourbar_validation.compare.identities import identities
from fourbar_validation.compare.rows import FAILS
from fourbar_validation.compare.statements.statements import statements
from fourbar_validation.engines.free_body import NAME as FREE_BODY
from fourbar_validation.engines.witnesses import WITNESSES, Witness, predicting_from
from fourbar_validation.run.values import compare_status

CHANGES = 1e-9
SECONDS = 20
"""A mutant that computes longer than this hangs: the run would be stopped, which is a failure too."""
MODULES = ("arithmetic", "position", "motion", "pin_forces", "torque", "path", "mobility", "transmission")
SCENES = 10
EXACT = ("pinocchio-inverse", "mujoco-inverse", FREE_BODY)


class HangError(Exception):
    """A mutant did not come back."""


def mutants(module: str) -> list[str]:
    """Full names of the mutants of a module."""
    tables = [value for name, value in vars(import_module(module)).items() if name.endswith("__mutmut")]
    return [f"{module}.{key}" for table in tables if isinstance(table, dict) for key in table if key != "_mutmut_orig"]


def scenes() -> list[Scene]:
    """Random linkages of every type, drive and branch, and a parallelogram near and on its change point."""
    from fourbar_validation.scenes.hard_families import change_point, sweep_of
    from fourbar_validation.scenes.hard_linkages import dressed
    from fourbar_validation.scenes.random import DrawnType, random_scene

    chosen = [random_scene(0, index, tuple(DrawnType)) for index in range(SCENES)]
    chosen.append(sweep_of(dressed((0.3, 0.1, 0.25, 0.22)), 12))
    chosen += [scene for name, scene in change_point(distances=(1e-2, 1e-4)) if name.startswith(("par", "kite a = d"))]
    return chosen


def numbers(scene: Scene, at: Command) -> dict[str, Any]:
    """Everything that the formulas say of a scene and of its linkage."""
    solution = solve(scene, "force", at=at)
    found = {name: getattr(solution, name) for name in UNITS if getattr(solution, name) is not None}
    found["status"] = solution.status_code.astype(float)
    return found | stated(scene.linkage) | stated_of_motion(scene, at)


def stated(linkage: FourBar) -> dict[str, Any]:
    """What the formulas state of a linkage whatever its motion."""
    found: dict[str, Any] = {
        "default_range": mobility.default_range(linkage),
        "change_points": mobility.change_points(linkage),
        "time_ratio": mobility.time_ratio(linkage) or math.nan,
        "extremes": [*transmission.transmission_extremes(linkage), transmission.transmission_extremes(linkage).worst],
    }
    for bar in MOVING_BARS:
        found[f"limits_{bar}"] = mobility.limit_positions(linkage, bar)
        found[f"intervals_{bar}"] = mobility.intervals(linkage, bar)
        found[f"turns_{bar}"] = mobility.turns_fully(linkage, bar)
        found[f"swing_{bar}"] = mobility.swing(linkage, bar)
    sweep = linkage.ground_angle + np.array([-0.5, 0.5, 4.0, 2.0])  # through both change points, and back
    found["through"] = mobility.on_smooth_path(linkage, sweep, 1)
    return {name: np.array(value, dtype=float) for name, value in found.items()}


def stated_of_motion(scene: Scene, at: Command) -> dict[str, Any]:
    """How well the positions of a motion transmit."""
    state = state_of(scene.linkage, at.theta_2, at.branch)
    branch = at.branch.astype(float)
    return {
        "transmission_angle": transmission.transmission_angle(state),
        "speed_ratio": transmission.speed_ratio(state),
        "mechanical_advantage": transmission.mechanical_advantage(state, 0.2, 0.3),
        "to_singular": transmission.distance_to_singular(scene.linkage, at.theta_2, scene.drive_bar, branch),
    }


def changed(before: dict[str, Any], after: dict[str, Any]) -> bool:
    """Whether any number differs by more than 1e-9 of its scale."""
    for name, old in before.items():
        new = after.get(name)
        if new is None or np.shape(old) != np.shape(new):
            return True
        scale = float(np.max(np.abs(old), initial=0.0, where=np.isfinite(old))) or 1.0
        if not np.allclose(new, old, rtol=0.0, atol=CHANGES * scale, equal_nan=True):
            return True
    return False


def caught(scene: Scene, at: Command, answers: list[tuple[Witness, Answer]]) -> bool:
    """Whether any comparison or identity fails."""
    solution = solve(scene, at=at)
    rows = identities("", scene, at, solution)
    for witness, answer in answers:
        predicted = predicting_from(witness, scene, at, answer)
        rows += compare("", scene, answer, solution, witness.tolerance, witness.expected, predicted)
        if witness.name == FREE_BODY and (basis := basis_of(scene, answer)) is not None:
            rows.append(compare_status("", scene, solution, basis))
    if not any(row.verdict == FAILS for row in rows):
        rows += [row for witness, answer in answers for row in statements("", scene, witness.engine(), answer)]
    return any(row.verdict == FAILS for row in rows)


def main(only: str, most: int) -> dict[str, dict[str, Any]]:
    """Per module: mutants tried, those that change a number, those caught, and the names of the others."""
    from mutmut.mutation.trampoline import set_mutant_under_test

    def alarm(*_: object) -> None:
        raise HangError

    signal.signal(signal.SIGALRM, alarm)
    set_mutant_under_test("")
    cases = []
    for scene in scenes():
        at = command(scene)
        answers = [(w, w.engine().answer(scene, at)) for w in WITNESSES if w.name in EXACT]
        cases.append((scene, at, answers, numbers(scene, at)))
        if caught(scene, at, answers):
            raise RuntimeError(f"the harness fails without a mutant: {scene.title}")
    result: dict[str, dict[str, Any]] = {}
    for module in MODULES:
        if only and only != module:
            continue
        names = mutants(f"fourbar.formulas.{module}")
        if most and len(names) > most:
            names = [names[i] for i in np.random.default_rng(0).choice(len(names), most, replace=False)]
        tally: dict[str, Any] = {"mutants": len(names), "changing": 0, "caught": 0, "missed": []}
        for name in names:
            set_mutant_under_test(name)
            verdict = _try(cases)
            set_mutant_under_test("")
            tally["changing"] += verdict is not None
            tally["caught"] += bool(verdict)
            if verdict is False:
                tally["missed"].append(name)
        result[module] = tally
        print(module, {key: value for key, value in tally.items() if key != "missed"}, file=sys.stderr, flush=True)
    return result


def _try(cases: list[Any]) -> bool | None:
    """None where nothing changes, else whether it is caught."""
    differs = False
    signal.alarm(SECONDS)
    try:
        with np.errstate(all="ignore"):
            for scene, at, answers, before in cases:
                if changed(before, numbers(scene, at)):
                    differs = True
                    if caught(scene, at, answers):
                        return True
    except Exception:  # a mutant that raises or hangs ends the run: that is noticed
        return True
    finally:
        signal.alarm(0)
    return False if differs else None


if __name__ == "__main__":
    print(json.dumps(main(sys.argv[1] if len(sys.argv) > 1 else "", int(sys.argv[2]) if len(sys.argv) > 2 else 0)))
