"""A function over many items by processes, the same results whatever their number and order.

A worker that dies or hangs costs the item that killed it, and no other: its chunk is done again item by item.
"""

import faulthandler
import os
import threading
import time
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, wait
from concurrent.futures.process import BrokenProcessPool
from itertools import chain, islice
from multiprocessing.context import SpawnContext, SpawnProcess
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn

from fourbar.errors import DependencyError
from fourbar_validation.compare.answer import EngineError
from fourbar_validation.compare.rows import say_error
from fourbar_validation.engines.processes import bound_memory, keep_output

if TYPE_CHECKING:
    from pebble import ProcessPool

SECONDS = 60.0
"""A scene takes 0.05 to 3 s; what takes longer than this hangs."""
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
"""A worker may be killed from outside so often on one item before the item is given up."""
POOLS = 100
"""Pools made anew, one after the other without a chunk done, before the run is given up: a worker that
dies while it starts breaks its pool, and somebody may well kill a few in a row."""
Chunk = tuple[int, Sequence[Any]]
"""Number and items."""
Attempt = Callable[[Any], Any]
"""Do one item by itself: its result, or the exception that it ended with."""
Instead = Callable[[Any, Exception, Attempt], Any]
"""Make the result of an item that failed by itself, too: item, exception, how to try another."""


class StalledError(Exception):
    """The workers no longer take up tasks, or the pool broke."""


class NoWorkersError(DependencyError):
    """All workers die before they finish anything."""


class Worker(SpawnProcess):
    """A worker that ends with exit code 0 has not ended in order: Pebble would wait for its answer for ever."""

    @property
    def exitcode(self) -> int | None:
        """Return the exit code; None also for 0."""
        return super().exitcode or None


class WorkerContext(SpawnContext):
    """Context with which Pebble starts its processes."""

    Process = Worker


def apply_watched(
    seconds: float | None, function: Callable[[Any], Any], items: Sequence[Any]
) -> list[Any]:
    """Apply the function in a worker that ends its own process where one item takes longer, whatever holds it up."""
    results = []
    with Path(os.devnull).open("w", encoding="utf-8") as silent:
        for item in items:
            if seconds is not None:
                faulthandler.dump_traceback_later(seconds, exit=True, file=silent)
            try:
                results.append(function(item))
            except Exception:
                raise
            except BaseException as error:  # in the parent it would end the run
                raise EngineError(say_error(error)) from None
            finally:
                faulthandler.cancel_dump_traceback_later()
    return results


def prepare_worker(parent: int, _: object = None) -> None:
    """Bound the memory, keep what is printed, and end with the parent, whose id is given.

    The function comes along so that a worker imports what it needs before its first item, whose time is limited.
    """
    bound_memory()
    keep_output()
    threading.Thread(target=_end_with, args=(parent,), daemon=True).start()


def _end_with(parent: int) -> None:
    """End this process when another has become its parent: the first one was killed and cannot stop it."""
    while os.getppid() == parent:
        time.sleep(1.0)
    os._exit(1)


class Workers:
    """Processes of a Pebble pool, which carry out tasks."""

    def __init__(
        self,
        pool: "ProcessPool",
        function: Callable[[Any], Any],
        workers: int,
        seconds: float | None,
    ) -> None:
        self._pool, self._function, self._seconds = pool, function, seconds
        self._in_flight = IN_FLIGHT * workers

    def submit(self, items: Sequence[Any]) -> "Future[list[Any]]":
        """Hand in some items.

        One by itself is stopped from outside; among several the worker ends itself, or else they are stopped together.
        """
        inside, outside = self._seconds, self._seconds
        if inside is not None and outside is not None:
            single = len(items) == 1
            inside, outside = (
                (inside + LATER, outside)
                if single
                else (inside, outside * len(items) + LATER)
            )
        try:
            future: Future[list[Any]] = self._pool.schedule(
                apply_watched, args=(inside, self._function, items), timeout=outside
            )
        except RuntimeError:  # a broken pool takes no more
            raise StalledError from None
        return future

    def wait_for(self, tasks: "Collection[Future[Any]]") -> "set[Future[Any]]":
        """Wait for some that are finished; StalledError where the pool broke, or no worker takes up a task."""
        while not (done := wait(tasks, STALL, FIRST_COMPLETED).done):
            if not self._pool.active or not any(task.running() for task in tasks):
                raise StalledError
        return done

    def result(self, task: "Future[list[Any]]") -> list[Any]:
        """Return or raise what a finished task did; StalledError where it is on nobody's account."""
        try:
            return task.result()
        except BrokenProcessPool:  # workers died while they had nothing to do
            raise StalledError from None

    def attempt(self, item: Any) -> Any:
        """Do one item by itself: its result, or the exception that it ended with."""
        for _ in range(ATTEMPTS):
            task = self.submit([item])
            self.wait_for([task])
            try:
                return self.result(task)[0]
            except (StalledError, DependencyError):
                raise
            except Exception as error:
                outcome = error
            if getattr(outcome, "exitcode", None) not in FROM_OUTSIDE:
                break  # otherwise somebody killed it: that is not the item's doing
        return outcome

    def over(
        self, chunks: Iterable[Chunk], instead: Instead
    ) -> Iterator[tuple[int, list[Any]]]:
        """Keep a bounded number of chunks running; yield each as it is done."""
        waiting = iter(chunks)
        running: dict[Any, Chunk] = {}
        while True:
            for chunk in islice(waiting, self._in_flight - len(running)):
                running[self.submit(chunk[1])] = chunk
            if not running:
                return
            for task in self.wait_for(running):
                number, items = running.pop(task)
                try:
                    results = self.result(task)
                except (StalledError, DependencyError):
                    raise
                except Exception as error:  # the worker died or hung, or the function failed; on whose account?
                    clear = (
                        len(items) == 1
                        and getattr(error, "exitcode", None) not in FROM_OUTSIDE
                    )
                    results = [error if clear else self.attempt(item) for item in items]
                    for place, (item, outcome) in enumerate(
                        zip(items, results, strict=True)
                    ):
                        if isinstance(outcome, Exception):
                            results[place] = instead(item, outcome, self.attempt)
                yield number, results


def fail(_: object, error: Exception, __: Attempt) -> NoReturn:
    """Raise what an item failed with."""
    raise error


def apply_each(
    function: Callable[[Any], Any], items: Iterable[Any], workers: int
) -> Iterator[Any]:
    """Apply the function to each item, however long it takes; results in the order of the items."""
    result: dict[int, list[Any]] = {}
    turn = 0
    chunks = enumerate([item] for item in items)
    for number, results in apply_over_processes(
        function, chunks, workers, seconds=None, instead=fail
    ):
        result[number] = results
        while turn in result:
            yield from result.pop(turn)
            turn += 1


def apply_over_processes(
    function: Callable[[Any], Any],
    chunks: Iterable[Chunk],
    workers: int,
    *,
    seconds: float | None,
    instead: Instead,
) -> Iterator[tuple[int, list[Any]]]:
    """Apply the function to each item of the chunks, over processes; chunks as they are done.

    `seconds`: after which an item is taken to hang; None: never.
    """
    from pebble import ProcessPool

    unfinished: dict[int, Sequence[Any]] = {}
    in_vain = 0

    def started() -> Iterator[Chunk]:
        for number, items in chunks:
            unfinished[number] = items
            yield number, items

    waiting = started()
    while True:
        with ProcessPool(
            max_workers=workers,
            context=WorkerContext(),
            initializer=prepare_worker,
            initargs=[os.getpid(), function],
        ) as pool:
            try:
                crew = Workers(pool, function, workers, seconds)
                for number, results in crew.over(
                    chain(list(unfinished.items()), waiting), instead
                ):
                    yield number, results
                    del unfinished[number]
                    in_vain = 0
                return
            except StalledError:
                pool.stop()  # type: ignore[no-untyped-call]
                in_vain += 1
                if in_vain == POOLS:
                    lost = "the workers die before they finish anything; what is finished is kept"
                    raise NoWorkersError(lost) from None
            except BaseException:
                pool.stop()  # type: ignore[no-untyped-call]
                raise
