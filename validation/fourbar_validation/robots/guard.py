"""A process with limits, in which MuJoCo looks at somebody's file."""

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pkgutil import resolve_name
from tempfile import TemporaryDirectory
from typing import Any

from fourbar.errors import FourBarError, InputError
from fourbar.show.tables import show_running
from fourbar_validation.engines.mujoco.robots.loop_facts import RobotFile
from fourbar_validation.engines.programs import (
    WORKER_MEMORY,
    bound_memory,
    bound_processor_time,
    end_with_parent,
    hold_interruption,
    open_no_windows,
)

ROBOT_SECONDS = 120.0
"""A four-bar takes less than one, a humanoid a few."""


@contextmanager
def examine_guarded(
    file: RobotFile,
    seconds: float | None = None,
) -> Iterator[Callable[..., Any]]:
    """Examine a file, by an adapter and its arguments, in another process.

    The process may crash, hang or run out of memory. An adapter is "module:function";
    its arguments and its result are pickled. An error of the adapter on the model
    begins with the format of the file. `seconds`: limit of each call; None:
    ROBOT_SECONDS.
    """
    seconds = ROBOT_SECONDS if seconds is None else seconds
    from multiprocessing import get_context

    from pebble import ProcessExpired, ProcessPool

    waiting = show_running(f"MuJoCo examines the file, in {seconds:g} s at most")
    with (
        waiting,
        TemporaryDirectory() as folder,
        ProcessPool(
            max_workers=1,
            context=get_context("spawn"),
            initializer=_confine,
            initargs=[folder],
        ) as pool,
    ):

        def examined(*arguments: object) -> Any:
            try:
                with hold_interruption():
                    future = pool.schedule(
                        _examine_robot,
                        args=(seconds, *arguments),
                        timeout=seconds,
                    )
                return future.result()
            except FourBarError as error:
                if not isinstance(error, InputError) or error.key != "MJCF":
                    raise
                value = error.value or file.path.name
                raise InputError(
                    file.kind, value, error.allowed, str(file.path)
                ) from None
            except TimeoutError:
                reason = f"MuJoCo did not come back in {seconds:g} s"
            except MemoryError:
                reason = f"asks for more than {WORKER_MEMORY // 2**30} GB of memory"
            except ProcessExpired as error:
                reason = f"MuJoCo crashed on it (exit code {error.exitcode})"
            except KeyboardInterrupt:
                # or the pool would wait for the file to its time limit
                pool.stop()  # type: ignore[no-untyped-call]
                raise
            raise InputError(file.kind, file.path.name, reason, str(file.path))

        yield examined


def _confine(folder: str) -> None:
    """Bound the memory, end with the parent, and leave MuJoCo's log in a folder.

    The folder goes with the call.
    """
    os.chdir(folder)
    bound_memory()
    end_with_parent()
    open_no_windows()


def _examine_robot(seconds: float, adapter: str, *arguments: object) -> Any:
    bound_processor_time(seconds)
    return resolve_name(adapter)(*arguments)
