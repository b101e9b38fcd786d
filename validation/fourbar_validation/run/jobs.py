"""Scenes judged over processes, which `engines/workers.py` keeps.

A scene that breaks down is judged again engine by engine.
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

from fourbar_validation.compare.rows import FORMULAS, escape_controls, make_breakdown
from fourbar_validation.engines import workers as worker_processes
from fourbar_validation.engines.guests import QUESTIONS, Guest
from fourbar_validation.engines.programs import SECONDS_PER_POSITION
from fourbar_validation.engines.registry import Engine
from fourbar_validation.report.scene_record import Record
from fourbar_validation.run.judge import judge_for_report
from fourbar_validation.scenes.suites import Suite


@dataclass(frozen=True, slots=True)
class Job:
    """One scene of a task, for a worker.

    The scene is a number in a suite; beside it stand its engines, and what is made of
    it.
    """

    suite: Suite
    scene: int
    engines: Sequence[Engine]
    draw: bool
    sketch: bool = False

    @property
    def name(self) -> str:
        """Return the scene's name."""
        return escape_controls(self.suite.name(self.scene))


def make_jobs(
    suite: Suite,
    scenes: Iterable[int],
    engines: Sequence[Engine],
    draw: bool,
    sketch: bool = False,
) -> list[Job]:
    """Make the jobs of some scenes; one of a file carries its own text alone."""
    return [
        Job(
            *suite.alone(i),
            engines,
            draw and suite.name(i) not in suite.not_drawn,
            sketch,
        )
        for i in scenes
    ]


def judge_job(job: Job) -> Record:
    """Judge one scene; runs in a worker."""
    scene = job.suite.scene(job.scene)
    how = {"draw": job.draw, "sketch": job.sketch}
    return judge_for_report(job.name, scene, job.engines, **how)


def _judge_by_engine(
    job: Job,
    _: BaseException,
    attempt: worker_processes.Attempt,
) -> Record:
    """Judge a scene that broke down one engine at a time.

    An engine at fault gets a row that says what broke down; where the formulas do, no
    engine is asked.
    """
    record = attempt(replace(job, engines=[]))
    if not isinstance(record, Record):
        return Record(job.name, rows=[make_breakdown(job.name, FORMULAS, record)])
    breakdowns = []
    for engine in job.engines:
        outcome = attempt(replace(job, engines=[engine]))
        if isinstance(outcome, Record):
            record = record.joined(outcome)
        else:
            breakdowns.append(make_breakdown(job.name, engine.name, outcome))
    return replace(record, rows=[*record.rows, *breakdowns])


def find_time_limit(suite: Suite, engines: Iterable[Engine]) -> float:
    """Return the seconds after which a scene of the suite counts as hanging.

    Guests have limits of their own besides.
    """
    limit = worker_processes.SCENE_SECONDS + SECONDS_PER_POSITION * suite.positions
    return limit + QUESTIONS * sum(
        guest.seconds or limit for guest in engines if isinstance(guest, Guest)
    )


def judge_tasks(
    suite: Suite,
    engines: Iterable[Engine],
    tasks: Iterable[tuple[int, list[Job]]],
    workers: int,
) -> Iterator[tuple[int, list[Record]]]:
    """Judge numbered tasks, each as it is done; a job that takes too long hangs."""
    return worker_processes.apply_over_processes(
        judge_job,
        tasks,
        workers,
        seconds=find_time_limit(suite, engines),
        instead=_judge_by_engine,
    )
