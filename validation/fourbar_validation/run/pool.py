"""Scenes judged over processes or machines; one that breaks down is judged again engine by engine."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from fourbar_validation.compare.rows import make_breakdown, make_plain
from fourbar_validation.engines import workers as processes
from fourbar_validation.engines.guests import QUESTIONS, Guest
from fourbar_validation.engines.witnesses import Witness
from fourbar_validation.report.record import Record
from fourbar_validation.run.judge import judge_for_report
from fourbar_validation.scenes.suites import Files, Suite

if TYPE_CHECKING:
    from fourbar_validation.run.machines import Cluster

SECONDS_PER_POSITION = 0.03
"""Ten times what a position takes with all engines: scenes of many positions have that much longer."""


@dataclass(frozen=True, slots=True)
class Job:
    """One scene for a worker: its place in a suite, its engines, whether it is drawn, and judged as shipped too."""

    suite: Suite
    scene: int
    witnesses: Sequence[Witness]
    draw: bool
    shipped: bool

    @property
    def name(self) -> str:
        """Return the scene's name."""
        return make_plain(self.suite.name(self.scene))


def make_jobs(
    suite: Suite, scenes: Iterable[int], witnesses: Sequence[Witness], draw: bool, sample: int = 0
) -> list[Job]:
    """Make the jobs of some scenes; one of a file carries its own text alone.

    `sample`: of so many scenes of the suite, evenly chosen, what else is shipped is judged too.
    """
    jobs = []
    for i in scenes:
        shipped = (i + 1) * sample // len(suite) > i * sample // len(suite)
        if isinstance(suite, Files):
            drawn = draw and suite.name(i) not in suite.not_drawn
            jobs.append(Job(replace(suite, texts=(suite.texts[i],)), 0, witnesses, drawn, shipped))
        else:
            jobs.append(Job(suite, i, witnesses, draw, shipped))
    return jobs


def find_longest(suite: Suite) -> float:
    """Give the seconds after which a scene of the suite is taken to hang."""
    return processes.SECONDS + SECONDS_PER_POSITION * (suite.positions if isinstance(suite, Files) else 0)


def judge_job(job: Job) -> Record:
    """Judge one scene; runs in a worker."""
    scene = job.suite.scene(job.scene)
    return judge_for_report(job.name, scene, job.witnesses, draw=job.draw, shipped=job.shipped)


def judge_by_engine(job: Job, _: Exception, attempt: processes.Attempt) -> Record:
    """Judge a scene that broke down one engine at a time; those at fault have a row that says of what."""
    record: Record | None = None
    failed = []
    for who in ([], *([witness] for witness in job.witnesses)):
        result = attempt(replace(job, witnesses=who))
        if isinstance(result, Record):
            record = result if record is None else record.joined(result)
        else:
            failed.append(make_breakdown(job.name, who[0].name if who else "formulas", result))
    record = record or Record(job.name)
    return replace(record, rows=[*record.rows, *failed])


def judge_chunks(
    suite: Suite,
    chunks: Iterable[tuple[int, range]],
    witnesses: Sequence[Witness],
    draw: bool,
    workers: int,
    seconds: float | None = None,
    cluster: "Cluster | None" = None,
    sample: int = 0,
) -> Iterator[tuple[int, list[Record]]]:
    """Judge chunks of scenes, each as it is done; `seconds`: after which a scene is taken to hang."""
    made = ((number, make_jobs(suite, scenes, witnesses, draw, sample)) for number, scenes in chunks)
    seconds = find_longest(suite) if seconds is None else seconds
    guests = [guest.seconds or find_longest(suite) for guest in witnesses if isinstance(guest, Guest)]
    seconds += QUESTIONS * sum(guests)  # each of their questions has a limit of its own
    if cluster is not None:
        return cluster.over(judge_job, made, seconds, judge_by_engine)
    return processes.apply_over_processes(judge_job, made, workers, seconds=seconds, instead=judge_by_engine)
