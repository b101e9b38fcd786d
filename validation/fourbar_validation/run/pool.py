"""Chunks of scenes over processes or machines, the same results whatever their number and order.

A worker that dies or hangs costs the scene and engine that killed it, and no other: its chunk is
done again scene by scene, and the scene at fault engine by engine.
"""

import faulthandler
import os
import threading
import time
from collections.abc import Collection, Iterable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, wait
from concurrent.futures.process import BrokenProcessPool
from dataclasses import replace
from importlib import import_module
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

from fourbar.errors import DependencyError
from fourbar_validation.compare.answer import WitnessError
from fourbar_validation.compare.rows import breakdown, in_words, plain
from fourbar_validation.engines.memory import bound_memory
from fourbar_validation.engines.output import keep_output
from fourbar_validation.engines.witnesses import Witness
from fourbar_validation.engines.workers import Workers as Spawned
from fourbar_validation.report.record import Record
from fourbar_validation.run.judge import judged
from fourbar_validation.scenes.suites import Files, Suite

if TYPE_CHECKING:
    from pebble import ProcessPool

SECONDS_PER_SCENE = 60.0
"""A scene takes 0.05 to 3 s; one that takes longer than this hangs."""
SECONDS_PER_POSITION = 0.03
"""Ten times what a position takes with all engines: scenes of many positions have that much longer."""
LATER = 10.0
"""Seconds after which a worker whose parent should have stopped it ends itself."""
IN_FLIGHT = 4
"""Chunks submitted per worker: enough to keep it busy, few enough to keep the memory bounded."""
STALL = 20.0
"""Seconds in which no worker takes up any of the waiting chunks: one was killed while it held the
lock of the queue that they share, and the pool is made anew."""
FROM_OUTSIDE = (-9, 1)
"""Exit codes of a worker that was killed, and of one that waited in vain for a lock that a killed one held;
one that crashes leaves with another."""
ATTEMPTS = 5
"""An engine may be killed from outside so often on one scene before the scene is given up."""
POOLS = 100
"""Pools made anew, one after the other without a chunk done, before the run is given up: a worker that
dies while it starts breaks its pool, and somebody may well kill a few in a row."""
Chunk = tuple[int, range]


class StalledError(Exception):
    """The workers no longer take up tasks, or the pool broke."""


class NoWorkersError(DependencyError):
    """The cluster has no workers, or those of this machine all die."""


def part(suite: Suite, scenes: Sequence[int]) -> tuple[Suite, Sequence[int]]:
    """What a worker needs of a suite: of files those scenes alone, else each task would carry all the texts."""
    if isinstance(suite, Files):
        return replace(suite, texts=tuple(suite.texts[i] for i in scenes)), range(len(scenes))
    return suite, scenes


def longest(suite: Suite) -> float:
    """Seconds after which a scene of the suite is taken to hang."""
    return SECONDS_PER_SCENE + SECONDS_PER_POSITION * (suite.positions if isinstance(suite, Files) else 0)


def judge_chunk(suite: Suite, scenes: Sequence[int], witnesses: Sequence[Witness], draw: bool) -> list[Record]:
    """The records of some scenes; runs in a worker."""
    return [judged(plain(suite.name(i)), suite.scene(i), witnesses, draw=draw) for i in scenes]


def judge_watched(
    seconds: float, suite: Suite, scenes: Sequence[int], witnesses: Sequence[Witness], draw: bool
) -> list[Record]:
    """The same in a worker that ends its own process where one scene takes longer, whatever the engine holds."""
    records = []
    with Path(os.devnull).open("w", encoding="utf-8") as silent:
        for scene in scenes:
            faulthandler.dump_traceback_later(seconds, exit=True, file=silent)
            try:
                records += judge_chunk(suite, [scene], witnesses, draw)
            except Exception:
                raise
            except BaseException as error:  # in the parent it would end the run
                raise WitnessError(in_words(error)) from None
            finally:
                faulthandler.cancel_dump_traceback_later()
    return records


def ready(parent: int = 0) -> None:
    """Bound the memory, keep what is printed, import what scenes need, and end with the parent, whose id is given."""
    bound_memory()
    keep_output()
    if parent:
        threading.Thread(target=_end_with, args=(parent,), daemon=True).start()
    import_module("fourbar_validation.run.judge")
    import_module("fourbar_validation.engines.free_body")


def _end_with(parent: int) -> None:
    """End this process when another has become its parent: the first one was killed and cannot stop it."""
    while os.getppid() == parent:
        time.sleep(1.0)
    os._exit(1)


class Workers(Protocol):
    """What carries out tasks: processes of this machine, or the workers of a cluster."""

    @property
    def in_flight(self) -> int:
        """Chunks submitted at a time."""

    def submit(self, scenes: Sequence[int], who: Sequence[Witness]) -> Any:
        """Hand in some scenes; the task."""

    def done(self, tasks: Collection[Any], seconds: float) -> set[Any]:
        """Those that are finished, as soon as there is one; none after some seconds."""

    def result(self, task: Any) -> list[Record]:
        """What a finished task returned or raised; StalledError where it is on nobody's account."""

    def lost(self, tasks: Collection[Any]) -> bool:
        """Whether nobody takes up the tasks any more."""


class Processes:
    """The processes of a Pebble pool."""

    def __init__(
        self, pool: "ProcessPool", suite: Suite, witnesses: Sequence[Witness], draw: bool, workers: int, seconds: float
    ) -> None:
        self._pool, self._suite, self._draw, self._seconds = pool, suite, draw, seconds
        self.in_flight = IN_FLIGHT * workers

    def submit(self, scenes: Sequence[int], who: Sequence[Witness]) -> "Future[list[Record]]":
        """Hand in some scenes: one by itself is stopped from outside, among several the worker ends itself, or else
        they are stopped together."""
        alone = len(scenes) == 1
        own = self._seconds + LATER if alone else self._seconds
        task = (own, *part(self._suite, scenes), who, self._draw)
        try:
            future: Future[list[Record]] = self._pool.schedule(
                judge_watched, args=task, timeout=self._seconds if alone else self._seconds * len(scenes) + LATER
            )
        except RuntimeError:  # a broken pool takes no more
            raise StalledError from None
        return future

    def done(self, tasks: "Collection[Future[Any]]", seconds: float) -> "set[Future[Any]]":
        """Those that are finished, as soon as there is one; none after some seconds."""
        return wait(tasks, seconds, FIRST_COMPLETED).done

    def result(self, task: "Future[list[Record]]") -> list[Record]:
        """What a task returned or raised."""
        try:
            return task.result()
        except BrokenProcessPool:  # workers died while they had nothing to do
            raise StalledError from None

    def lost(self, tasks: "Collection[Future[Any]]") -> bool:
        """Whether the pool broke, or none of its workers takes up a task."""
        return not self._pool.active or not any(task.running() for task in tasks)


def over_processes(
    suite: Suite,
    chunks: Iterable[Chunk],
    witnesses: Sequence[Witness],
    draw: bool,
    workers: int,
    seconds: float | None = None,
) -> Iterator[tuple[int, list[Record]]]:
    """Over processes of this machine; `seconds`: after which a scene is taken to hang."""
    from pebble import ProcessPool

    seconds = longest(suite) if seconds is None else seconds
    left = dict(chunks)
    in_vain = 0
    while left:
        # a worker imports before its first task, so that the time for it is not taken from a scene
        me = os.getpid()
        with ProcessPool(max_workers=workers, context=Spawned(), initializer=ready, initargs=[me]) as pool:
            try:
                crew = Processes(pool, suite, witnesses, draw, workers, seconds)
                for number, records in as_done(suite, list(left.items()), witnesses, crew):
                    yield number, records
                    del left[number]
                    in_vain = 0
            except StalledError:
                pool.stop()  # type: ignore[no-untyped-call]
                in_vain += 1
                if in_vain == POOLS:
                    lost = "the workers die before they finish a scene; what is finished is kept"
                    raise NoWorkersError(lost) from None
            except BaseException:
                pool.stop()  # type: ignore[no-untyped-call]
                raise


def as_done(
    suite: Suite, chunks: Iterable[Chunk], witnesses: Sequence[Witness], workers: Workers
) -> Iterator[tuple[int, list[Record]]]:
    """Keep a bounded number of chunks running; yield each as it is done."""
    waiting = iter(chunks)
    running: dict[Any, Chunk] = {}
    most = workers.in_flight
    while True:
        for chunk in islice(waiting, most - len(running)):
            running[workers.submit(chunk[1], witnesses)] = chunk
        if not running:
            return
        done = workers.done(running, STALL)
        if not done and workers.lost(running):
            raise StalledError
        for task in done:
            number, scenes = running.pop(task)
            try:
                yield number, workers.result(task)
            except (StalledError, DependencyError):
                raise
            except Exception:  # the worker died or hung; find out on whose account
                yield number, [_alone(suite, scene, witnesses, workers) for scene in scenes]


def _outcome(scene: int, who: Sequence[Witness], workers: Workers) -> Record | Exception:
    """One scene by some engines, or what its worker died of; StalledError where no worker takes it up."""
    task = workers.submit([scene], who)
    while not workers.done([task], STALL):
        if workers.lost([task]):
            raise StalledError
    try:
        return workers.result(task)[0]
    except (StalledError, DependencyError):
        raise
    except Exception as error:
        return error


def _alone(suite: Suite, scene: int, witnesses: Sequence[Witness], workers: Workers) -> Record:
    """One scene by itself, and if that breaks down too, one engine at a time."""
    found = _outcome(scene, witnesses, workers)
    if isinstance(found, Record):
        return found
    name = plain(suite.name(scene))
    record: Record | None = None
    failed = []
    for who in ([], *([witness] for witness in witnesses)):
        for _ in range(ATTEMPTS):
            found = _outcome(scene, who, workers)
            if isinstance(found, Record) or getattr(found, "exitcode", None) not in FROM_OUTSIDE:
                break  # otherwise somebody killed it: that is not the engine's doing
        if isinstance(found, Record):
            record = found if record is None else record.joined(found)
        else:
            failed.append(breakdown(name, who[0].name if who else "formulas", found))
    record = record or Record(name)
    return replace(record, rows=[*record.rows, *failed])
