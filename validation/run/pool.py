"""Chunks of scenes over processes or machines, the same results whatever their number and order.

A worker that dies or hangs costs the scene and engine that killed it, and no other: its chunk is
done again scene by scene, and the scene at fault engine by engine.
"""

import faulthandler
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from dataclasses import replace
from importlib import import_module

from fourbar.errors import DependencyError, InputError
from validation.compare.plain import plain
from validation.engines.memory import bound_memory
from validation.engines.witnesses import Witness
from validation.report.record import Record
from validation.run.breakdown import breakdown
from validation.run.judge import judged
from validation.scenes.suites import Files, Suite

SECONDS_PER_SCENE = 60.0
"""A scene takes 0.05 to 3 s; one that takes longer than this hangs."""
SECONDS_PER_POSITION = 0.03
"""Ten times what a position takes with all engines: scenes of many positions have that much longer."""
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
    """The scheduler has no workers, or those of this machine all die."""


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
    """The same in a worker that nobody stops from outside: it ends its own process where it takes longer."""
    faulthandler.dump_traceback_later(seconds, exit=True)
    try:
        return judge_chunk(suite, scenes, witnesses, draw)
    finally:
        faulthandler.cancel_dump_traceback_later()


def ready() -> None:
    """Bound the memory, and import what every scene needs."""
    bound_memory()
    import_module("validation.run.judge")
    import_module("validation.engines.free_body")


def over_processes(
    suite: Suite,
    chunks: Iterable[Chunk],
    witnesses: Sequence[Witness],
    draw: bool,
    workers: int,
    seconds: float | None = None,
) -> Iterator[tuple[int, list[Record]]]:
    """Over processes of this machine; `seconds`: after which a scene is taken to hang."""
    seconds = longest(suite) if seconds is None else seconds
    left = dict(chunks)
    in_vain = 0
    while left:
        try:
            for number, records in _over_one_pool(suite, list(left.items()), witnesses, draw, workers, seconds):
                yield number, records
                del left[number]
                in_vain = 0
        except StalledError:
            in_vain += 1
            if in_vain == POOLS:
                raise NoWorkersError("the workers die before they finish a scene; what is finished is kept") from None


def _over_one_pool(
    suite: Suite, chunks: Iterable[Chunk], witnesses: Sequence[Witness], draw: bool, workers: int, seconds: float
) -> Iterator[tuple[int, list[Record]]]:
    from multiprocessing import get_context

    from pebble import ProcessPool

    # a worker imports before its first task, so that the time for it is not taken from a scene
    with ProcessPool(max_workers=workers, context=get_context("spawn"), initializer=ready) as pool:
        try:

            def submit(scenes: Sequence[int], who: Sequence[Witness]) -> Future[list[Record]]:
                task = (*part(suite, scenes), who, draw)
                allowed = seconds * len(scenes)
                try:
                    future: Future[list[Record]] = pool.schedule(judge_chunk, args=task, timeout=allowed)
                except RuntimeError:  # a broken pool takes no more
                    raise StalledError from None
                return future

            def lost(running: Iterable[Future[list[Record]]]) -> bool:
                return not pool.active or not any(future.running() for future in running)

            yield from _as_done(suite, chunks, witnesses, submit, IN_FLIGHT * workers, lost)
        except BaseException:
            pool.stop()  # type: ignore[no-untyped-call]
            raise


def over_machines(
    suite: Suite,
    chunks: Iterable[Chunk],
    witnesses: Sequence[Witness],
    draw: bool,
    scheduler: str,
    seconds: float | None = None,
) -> Iterator[tuple[int, list[Record]]]:
    """Over the workers of a Dask scheduler; each needs this checkout importable, and what witnesses are added."""
    seconds = longest(suite) if seconds is None else seconds
    from distributed import Client

    try:
        connected = Client(scheduler)  # type: ignore[no-untyped-call]
    except (OSError, ValueError) as error:  # no answer, or no address
        why = str(error) or "no answer"
        raise InputError("--scheduler", scheduler, f"must be the address of a Dask scheduler: {why}") from None
    workers = max(1, len(connected.nthreads()))  # type: ignore[no-untyped-call]
    # threads that wait for Dask's futures: those of its executor never end where a result was lost in transit;
    # the client is left first, which ends what is still waited for
    with ThreadPoolExecutor(IN_FLIGHT * workers) as waiting, connected as client:

        def submit(scenes: Sequence[int], who: Sequence[Witness]) -> Future[list[Record]]:
            task = (seconds * len(scenes), *part(suite, scenes), who, draw)
            return waiting.submit(client.submit(judge_watched, *task, retries=0, pure=False).result)

        def deserted(_: Iterable[Future[list[Record]]]) -> bool:
            return not client.nthreads()

        try:
            yield from _as_done(suite, chunks, witnesses, submit, IN_FLIGHT * workers, deserted)
        except StalledError:
            raise NoWorkersError(f"{scheduler}: no workers; start some, what is finished is kept") from None


def _as_done(
    suite: Suite,
    chunks: Iterable[Chunk],
    witnesses: Sequence[Witness],
    submit: Callable[[Sequence[int], Sequence[Witness]], "Future[list[Record]]"],
    in_flight: int,
    lost: "Callable[[Iterable[Future[list[Record]]]], bool]",
) -> Iterator[tuple[int, list[Record]]]:
    """Keep a bounded number of chunks running; yield each as it is done."""
    waiting = iter(chunks)
    running: dict[Future[list[Record]], Chunk] = {}
    exhausted = False
    while True:
        while not exhausted and len(running) < in_flight:
            chunk = next(waiting, None)
            if chunk is None:
                exhausted = True
            else:
                running[submit(chunk[1], witnesses)] = chunk
        if not running:
            return
        done, _ = wait(running, STALL, FIRST_COMPLETED)
        if not done and lost(running):
            raise StalledError
        for future in done:
            number, scenes = running.pop(future)
            try:
                yield number, _outcome(future, lost)
            except StalledError:
                raise
            except Exception:  # the worker died or hung; find out on whose account
                yield number, [_alone(suite, scene, witnesses, submit, lost) for scene in scenes]


def _outcome(future: "Future[list[Record]]", lost: "Callable[[Iterable[Future[list[Record]]]], bool]") -> list[Record]:
    """The result of a task, or StalledError where no worker takes it up or the pool breaks."""
    while True:
        wait([future], STALL)
        if future.done():
            try:
                return future.result()
            except BrokenProcessPool:  # workers died while they had nothing to do: on nobody's account
                raise StalledError from None
        if lost([future]):
            raise StalledError


def _alone(
    suite: Suite,
    scene: int,
    witnesses: Sequence[Witness],
    submit: Callable[[Sequence[int], Sequence[Witness]], "Future[list[Record]]"],
    lost: "Callable[[Iterable[Future[list[Record]]]], bool]",
) -> Record:
    """One scene by itself, and if that breaks down too, one engine at a time."""
    try:
        return _outcome(submit([scene], witnesses), lost)[0]
    except StalledError:
        raise
    except Exception:
        pass
    name = plain(suite.name(scene))
    record: Record | None = None
    failed = []
    for who in ([], *([witness] for witness in witnesses)):
        for attempt in range(ATTEMPTS):
            try:
                part = _outcome(submit([scene], who), lost)[0]
            except StalledError:
                raise
            except Exception as error:
                if getattr(error, "exitcode", None) in FROM_OUTSIDE and attempt + 1 < ATTEMPTS:
                    continue  # somebody killed it: that is not the engine's doing
                failed.append(breakdown(name, who[0].name if who else "formulas", error))
            else:
                record = part if record is None else record.joined(part)
            break
    record = record or Record(name)
    return replace(record, rows=[*record.rows, *failed])
