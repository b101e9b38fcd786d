"""Runs judged in this process, where it is not their workers that are tested."""

from collections import Counter

from fourbar_validation.engines.registry import ENGINES
from fourbar_validation.report.run_summary import Summary
from fourbar_validation.run import question
from fourbar_validation.run.judge import judge
from fourbar_validation.run.run import Progress

EXACT = [engine for engine in ENGINES if not engine.through_time]
THROUGH_TIME = [engine for engine in ENGINES if engine.through_time]


class Heard(Progress):
    """Listener that keeps what a run told: its notes, and the scenes of each stage."""

    def __init__(self):
        self.lines = []
        self.scenes = Counter()

    def note(self, line):
        self.lines.append(line)

    def advance(self, stage, scenes):
        self.scenes[stage] += scenes


def summary_of(records):
    """What a run comes to in which these scenes were judged."""
    summary = Summary()
    for record in records:
        summary.add(record)
    return summary


def judge_by(engine, scene):
    """The rows of one engine on a scene, by quantity."""
    rows = judge("scene", scene, [engine]).rows
    return {row.quantity: row for row in rows if row.engine == engine.name}


def spoil_formulas(monkeypatch, spoil):
    """Let the harness have solutions that are changed, in place or for others."""
    true = question.solve

    def solve(*arguments, **keywords):
        solution = true(*arguments, **keywords)
        return spoil(solution) or solution

    monkeypatch.setattr(question, "solve", solve)


def list_failed(scene, engines):
    """The rows that fail where a scene is judged by engines."""
    return [row for row in judge("scene", scene, engines).rows if row.failed]


def judge_here(monkeypatch):
    """Do the items of the workers in this process, one after another."""

    def over_none(function, tasks, *_, **__):
        for number, items in tasks:
            yield number, [function(item) for item in items]

    over_processes = "fourbar_validation.engines.workers.apply_over_processes"
    monkeypatch.setattr(over_processes, over_none)
