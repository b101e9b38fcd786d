"""A function over many items by Pebble's processes.

The results are the same whatever the number of processes. A task has some items, and
each item a limit of time. A worker that dies or hangs costs the item that it was at.
"""

import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import Future
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from multiprocessing import get_context
from typing import Any

from fourbar.errors import DependencyError
from fourbar_validation.engines.programs import (
    bound_memory,
    end_with_parent,
    hold_interruption,
    keep_output,
    open_no_windows,
)

SCENE_SECONDS = 180.0
"""A scene takes 0.05 to 3 s, one released for 100 s some 50 s of processor time; what
takes longer than this, on a machine that does other work too, hangs.
"""
Task = tuple[int, Sequence[Any]]
"""Number and items."""
Attempt = Callable[[Any], Any]
"""Do one item by itself: its result, or the exception that it ended with."""
_Submitted = tuple["Future[Any]", float]
"""An item's future, and when the item was handed in by the monotonic clock, s."""
_Instead = Callable[[Any, BaseException, Attempt], Any]
"""Make the result of an item that failed: item, exception, how to try another one."""
_IN_FLIGHT = 4
"""Tasks submitted per worker: enough that it is always busy, few enough that the memory
stays bounded.
"""
_LOCKED = 10.0
"""Seconds for which a worker waits for the pipe that all workers share.

A worker that is killed while it reads or writes there leaves the pipe locked for good:
the others then wait twice as long, and the run ends and can be resumed. A message takes
milliseconds.
"""


class NoWorkersError(DependencyError):
    """The workers died while none of them was at work."""


def prepare_worker(_: object = None) -> None:
    """Bound the memory and the waiting for other workers, and keep what is printed.

    The function comes along, so that a worker imports what it needs before its first
    item, whose time is limited.
    """
    from pebble import CONSTS

    CONSTS.channel_lock_timeout = _LOCKED
    end_with_parent()
    open_no_windows()
    bound_memory()
    keep_output()


@dataclass(frozen=True)
class _PoolOfItems:
    """Items handed to a pool, each with its limit of time."""

    pool: Any
    function: Callable[[Any], Any]
    seconds: float | None
    instead: _Instead

    def submit(self, item: Any) -> _Submitted:
        """Hand in an item; NoWorkersError where the pool is broken."""
        try:
            with hold_interruption():
                future: Future[Any] = self.pool.schedule(
                    self.function, args=(item,), timeout=self.seconds
                )
        except RuntimeError:
            raise _lost_workers() from None
        return future, time.monotonic()

    def attempt(self, item: Any) -> Any:
        """Do one item: its result, or the exception that it ended with."""
        return self.outcome(item, *self.submit(item))

    def outcome(self, item: Any, future: "Future[Any]", since: float) -> Any:
        """Return an item's result, or the exception that it ended with.

        A worker may have been killed from outside, for example where memory ran out.
        Its item is tried once more, and then it is held to have killed the worker.
        Pebble measures the limit of time by the clock on the wall, which jumps when a
        machine sleeps: an item that was ended too soon is tried again.
        """
        from pebble import ProcessExpired

        while self._is_too_soon(future.exception(), since):
            future, _ = self.submit(item)
        if isinstance(future.exception(), ProcessExpired):
            future, _ = self.submit(item)
        error = future.exception()
        if isinstance(error, BrokenProcessPool):
            raise _lost_workers()
        if isinstance(error, DependencyError):
            raise error
        return future.result() if error is None else error

    def _is_too_soon(self, error: BaseException | None, since: float) -> bool:
        # first argument of the TimeoutError of an item that took too long; one that an
        # item raises itself has another
        return (
            self.seconds is not None
            and isinstance(error, TimeoutError)
            and error.args[:1] == ("Task timeout",)
            and time.monotonic() - since < self.seconds
        )

    def finish(
        self, number: int, items: Sequence[Any], waiting: Sequence[_Submitted]
    ) -> tuple[int, list[Any]]:
        """Return a task's number and the results of its items in order.

        An item that failed has its replacement in the result's place.
        """
        results = []
        for item, submitted in zip(items, waiting, strict=True):
            result = self.outcome(item, *submitted)
            if isinstance(result, BaseException):
                result = self.instead(item, result, self.attempt)
            results.append(result)
        return number, results


def _lost_workers() -> NoWorkersError:
    return NoWorkersError(
        "the workers died while none was at work; what is finished is kept: "
        "give the same command again, and it goes on from there"
    )


def apply_over_processes(
    function: Callable[[Any], Any],
    tasks: Iterable[Task],
    workers: int,
    *,
    seconds: float | None,
    instead: _Instead,
) -> Iterator[tuple[int, list[Any]]]:
    """Apply the function to each item of the tasks, over processes; tasks in order.

    `seconds`: after which an item is taken to hang; None: never.
    """
    from pebble import ProcessPool

    with ProcessPool(
        max_workers=workers,
        context=get_context("spawn"),
        initializer=prepare_worker,
        initargs=[function],
    ) as pool:
        items_of = _PoolOfItems(pool, function, seconds, instead)
        in_flight: deque[tuple[int, Sequence[Any], list[_Submitted]]] = deque()
        try:
            for number, items in tasks:
                waiting = [items_of.submit(item) for item in items]
                in_flight.append((number, items, waiting))
                if len(in_flight) > _IN_FLIGHT * workers:
                    yield items_of.finish(*in_flight.popleft())
            for submitted in in_flight:
                yield items_of.finish(*submitted)
        except BaseException:
            pool.stop()  # type: ignore[no-untyped-call]
            raise
