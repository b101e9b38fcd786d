"""Tasks into which a run is cut.

Every machine cuts a run alike.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from fourbar.errors import FAILED, DependencyError, InputError
from fourbar_validation.compare.rows import FAILS, escape_controls
from fourbar_validation.engines.registry import Engine
from fourbar_validation.report.machine import name_code
from fourbar_validation.report.run_summary import PICTURED, SKETCHED, Summary
from fourbar_validation.run.jobs import judge_tasks, make_jobs
from fourbar_validation.run.store import Store
from fourbar_validation.scenes.suites import Suite

WORKERS = 2
SCENES_OF_A_SLOW_TASK = 1
"""Scenes per task if something is simulated or drawn: a second each."""
SCENES_OF_A_QUICK_TASK = 20
"""Scenes per task otherwise: a second together."""
_MOST_TASKS = 10_000
"""Each has a file while the run goes on. Of a million scenes a hundred stand in one."""
_MOST_KEPT_NAMED = 5
"""Scenes whose kept answers a resumed run names; further ones are counted."""
JUDGING, COLLECTING, DRAWING = "judging", "collecting", "drawing"
"""Stages of a run, as its progress is told."""


class Progress:
    """Listener to a run; this one ignores what it is told."""

    def note(self, line: str) -> None:
        """Hear why a task of an earlier run is judged again."""

    def advance(self, stage: str, scenes: int) -> None:
        """Note that a stage has done so many scenes more."""


UNHEARD = Progress()


def read_part(text: str) -> tuple[int, int]:
    """Read `K/N`, part K of N parts; InputError for anything else."""
    number, _, of = text.partition("/")
    if number.isdecimal() and of.isdecimal() and 1 <= int(number) <= int(of):
        return int(number), int(of)
    allowed = "must be K/N, part K of N parts: --part 1/8 to --part 8/8"
    raise InputError("--part", text, allowed)


@dataclass(frozen=True)
class Plan:
    """A suite, the engines that are asked, and the tasks of this run.

    The tasks are the same on every machine.
    """

    suite: Suite
    engines: tuple[Engine, ...]
    workers: int = WORKERS
    """Number of processes."""
    drawn: bool = True
    """True for pictures. A long suite has them at the end, of the scenes that fail or
    come nearest to failing.
    """
    against: Path | None = None
    """Earlier run that `--against` names. The failure that the verdict names is looked
    up there, and its rules must not be stricter.
    """
    part: tuple[int, int] = (1, 1)
    """Number of the part of the run that is judged here, and how many there are."""
    missing: Sequence[tuple[str, str]] = ()
    """Engines that cannot answer here, each with the reason."""
    chosen: str = ""
    """Engines that were asked for by name; empty for all of ours."""
    suite_name: str = ""
    """Name of the suite; empty where scenes were chosen one by one."""

    @property
    def asked(self) -> dict[str, str]:
        """Return what was asked for, as the record of a run keeps it."""
        return {"chosen": self.chosen, "scenes of": self.suite_name}

    @property
    def draw_at_once(self) -> bool:
        """Return whether scenes are drawn as they are judged, because there are few."""
        pictures = len(self.suite) - len(self.suite.not_drawn)
        return self.drawn and pictures <= PICTURED

    @property
    def sketch(self) -> bool:
        """Return whether scenes have small pictures."""
        return self.drawn and len(self.suite) <= SKETCHED

    @cached_property
    def tasks(self) -> list[range]:
        """Return the scenes of each task."""
        count = len(self.suite)
        slow = self.draw_at_once or any(one.through_time for one in self.engines)
        least = SCENES_OF_A_SLOW_TASK if slow else SCENES_OF_A_QUICK_TASK
        size = max(least, math.ceil(count / _MOST_TASKS))
        scenes = range(count)
        return [scenes[start : start + size] for start in scenes[::size]]

    @cached_property
    def identity(self) -> dict[str, Any]:
        """Return all that a result depends on.

        Two folders hold results of one run if it is equal.
        """
        return {
            "scenes": self.suite.fingerprint(),
            "engines": [engine.fingerprint() for engine in self.engines],
            **name_code(),
            "draw": self.draw_at_once,
            "sketch": self.sketch,
        }

    @property
    def part_tasks(self) -> range:
        """Return the numbers of the tasks of its part: every N-th, from the K-th on."""
        number, of = self.part
        return range(len(self.tasks))[number - 1 :: of]

    @property
    def part_scenes(self) -> int:
        """Return how many scenes its part has."""
        return sum(len(self.tasks[task]) for task in self.part_tasks)

    def judge(self, store: Store, progress: Progress) -> None:
        """Judge the tasks of its part that the store does not have yet."""
        done = store.done()
        for line in store.notes:
            progress.note(line)
        left = [task for task in self.part_tasks if task not in done]
        kept = [i for task in self.part_tasks if task in done for i in self.tasks[task]]
        if kept:
            progress.note(self._tell_kept(kept))
        progress.advance(JUDGING, len(kept))
        how = self.engines, self.draw_at_once, self.sketch
        jobs = ((task, make_jobs(self.suite, self.tasks[task], *how)) for task in left)
        for task, records in judge_tasks(self.suite, self.engines, jobs, self.workers):
            store.put(task, [record.kept_all() for record in records])
            progress.advance(JUDGING, len(records))

    def _tell_kept(self, scenes: Sequence[int]) -> str:
        """Say which answers of an interrupted run are kept."""
        names = [escape_controls(self.suite.name(i)) for i in scenes[:_MOST_KEPT_NAMED]]
        more = len(scenes) - len(names)
        listed = ", ".join(names) + f" and {more} more" * bool(more)
        return (
            "kept from an interrupted run: the answers of all engines on"
            f" {len(scenes)} of {len(self.suite)} scenes, {listed}"
        )

    def summarise(self) -> Summary:
        """Return a summary that knows the engines, and no scene yet."""
        return Summary(self.engines, self.missing, bool(self.chosen))

    def conclude(self, summary: Summary, *, worse: bool = False) -> int:
        """Return the exit status of a run.

        Nothing compared is no success, also of one engine that was asked for by name.
        Raises DependencyError if only an engine is missing.

        `worse`: whether the run is worse than the one that it is compared with.
        """
        counts = summary.counts
        if counts[FAILS] or worse or summary.unchecked:
            return FAILED
        self.require_engines()
        return counts.status

    def require_engines(self) -> None:
        """Raise DependencyError if an engine could not answer here."""
        if self.missing:
            names = ",".join(engine.name for engine in self.engines)
            raise DependencyError(
                f"{self.missing[0][1]}, or say --engines {names} where those are all"
                " that is wanted"
            )
