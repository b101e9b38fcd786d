"""The workers of a Dask scheduler in place of the processes of this machine."""

import gc
import logging
import time
from collections import Counter
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from concurrent.futures import CancelledError
from contextlib import suppress
from typing import TYPE_CHECKING, Any

from fourbar.errors import DependencyError, InputError
from fourbar_validation.engines import workers as processes
from fourbar_validation.report.machine import find_differing, name_code, name_machine

if TYPE_CHECKING:
    from distributed import Future

POLL = 0.05
"""Seconds between two looks at which tasks are done: a look is at this machine's own notes, and asks nobody."""
ENDING = 2.0
"""Seconds for taking leave of a scheduler; one that is gone answers never."""


class ClusterError(DependencyError):
    """The scheduler is gone, or its workers are not set up for this run; what is finished is kept."""


def describe_here() -> tuple[dict[str, str], str]:
    """Tell what decides the numbers of this worker, and its machine."""
    return name_code(), name_machine()


def apply_alike(
    wanted: dict[str, str], seconds: float, function: Callable[[Any], Any], items: Sequence[Any]
) -> list[Any]:
    """Apply a function in a worker, which may have joined later: with the code and libraries of here, or not at all."""
    if difference := find_differing(wanted, name_code()):
        raise ClusterError(f"a worker is not set up as this machine: {difference}")
    return processes.apply_watched(seconds, function, items)


class Cluster:
    """The workers of a scheduler: each with this checkout, these libraries, and the engines that are added."""

    def __init__(self, scheduler: str) -> None:
        """Connect, and look at every worker.

        Raises InputError for what is no scheduler, ClusterError for one whose workers are set up otherwise.
        """
        from distributed import Client

        for of_dask in ("client", "batched"):  # one line of ours replaces their log of a lost scheduler
            logging.getLogger(f"distributed.{of_dask}").setLevel(logging.CRITICAL)
        self.scheduler, why = scheduler, ""
        try:
            self.client = Client(scheduler, set_as_default=False)  # type: ignore[no-untyped-call]
        except (OSError, TypeError, ValueError) as error:  # no answer, no certificate, or no address
            why = str(error) or "no answer"
        if why:
            gc.collect()  # its client closes here: in the thread of a later one, which waits for it, it would wait too
            raise InputError("--scheduler", scheduler, f"must be the address of a Dask scheduler: {why}")
        try:
            self.machines = self._name_alike()
        except BaseException:
            self._leave()
            raise

    def _name_alike(self) -> str:
        """Name the machines of the workers."""
        try:
            self.client.wait_for_workers(1, timeout=processes.STALL)
        except TimeoutError:
            raise self._say_no_workers() from None
        workers = self.client.nthreads()  # type: ignore[no-untyped-call]
        counts: Counter[str] = Counter()
        try:
            tasks = {self.client.submit(describe_here, workers=[worker], pure=False): worker for worker in workers}
            for task, worker in tasks.items():
                while not self.done([task], processes.STALL):
                    if self.lost([task]):
                        raise self._say_no_workers()
                code, machine = self.result(task)
                if difference := find_differing(name_code(), code):
                    raise ClusterError(f"{self.scheduler}: worker {worker} is not set up as this machine: {difference}")
                counts[machine] += 1
        except DependencyError:
            raise
        except Exception as error:  # whatever a scheduler or a worker without this checkout comes up with
            raise self._find_unfit(error) from None
        return "; ".join(f"{count} workers on {machine}" for machine, count in sorted(counts.items()))

    def over(
        self,
        function: Callable[[Any], Any],
        chunks: Iterable[processes.Chunk],
        seconds: float,
        instead: processes.Instead,
    ) -> Iterator[tuple[int, list[Any]]]:
        """Apply a function to chunks of items, each as it is done; `seconds`: after which an item is taken to hang."""
        self.task = (seconds, function)
        try:
            yield from processes.yield_done(chunks, self, instead)
        except processes.StalledError:
            raise self._say_no_workers() from None
        finally:
            self._leave()

    @property
    def in_flight(self) -> int:
        """Chunks submitted at a time."""
        return processes.IN_FLIGHT * max(1, len(self.client.nthreads()))  # type: ignore[no-untyped-call]

    def submit(self, items: Sequence[Any]) -> "Future[list[Any]]":
        """Hand in some items."""
        return self.client.submit(apply_alike, name_code(), *self.task, items, retries=0, pure=False)

    def done(self, tasks: "Collection[Future[Any]]", seconds: float) -> "set[Future[Any]]":
        """Wait for those that are finished, until there is one; none after some seconds."""
        until = time.monotonic() + seconds
        while True:
            finished = {task for task in tasks if task.done()}  # type: ignore[no-untyped-call]
            if finished or time.monotonic() > until:
                return finished
            if not self._connect():
                raise self._say_gone()
            time.sleep(POLL)

    def result(self, task: "Future[Any]") -> Any:
        """Return or raise what a task did; ClusterError where that is not the task's own doing."""
        while True:
            try:
                return task.result(timeout=processes.STALL)
            except TimeoutError:  # the worker that has it is gone, or the result was lost in transit
                if self.lost([task]):
                    raise processes.StalledError from None
            except CancelledError:  # unfinished when the scheduler was lost
                raise self._say_gone() from None
            except ImportError as error:  # a worker that joined later; what an engine does not find is in its row
                raise self._find_unfit(error) from None
            except Exception:
                if not self._connect():
                    raise self._say_gone() from None
                raise

    def lost(self, _: "Collection[Future[Any]]") -> bool:
        """Tell whether no worker remains."""
        try:
            return not self.client.nthreads()  # type: ignore[no-untyped-call]
        except (OSError, RuntimeError):
            raise self._say_gone() from None

    def _connect(self) -> bool:
        comm = self.client.scheduler_comm
        return self.client.status == "running" and comm is not None and not comm.comm.closed()

    def _leave(self) -> None:
        """Close without waiting for a scheduler that is gone."""
        with suppress(OSError, RuntimeError):  # nobody is there, or nobody answers
            self.client.close(timeout=ENDING)  # type: ignore[no-untyped-call]

    def _say_gone(self) -> ClusterError:
        return ClusterError(f"{self.scheduler}: the scheduler is gone; what is finished is kept")

    def _say_no_workers(self) -> processes.NoWorkersError:
        return processes.NoWorkersError(f"{self.scheduler}: no workers; start some, what is finished is kept")

    def _find_unfit(self, error: BaseException) -> ClusterError:
        why = error.__cause__ or error
        return ClusterError(
            f"{self.scheduler}: scheduler and workers must be able to import fourbar_validation (PYTHONPATH) and its "
            f"libraries: {type(why).__name__}: {' '.join(str(why).split())}"
        )
