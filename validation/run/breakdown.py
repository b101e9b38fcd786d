"""The row of an engine that broke down: its own failure, in its own row."""

from validation.compare.plain import plain
from validation.compare.rows import FAILS, Row


def breakdown(scene: str, engine: str, error: BaseException) -> Row:
    """The row of an engine that took its process with it, or never came back."""
    if isinstance(error, TimeoutError):
        reason = "the engine hung and was stopped"
    elif type(error).__name__ == "ProcessExpired":  # of Pebble
        reason = f"the engine crashed its process (exit code {getattr(error, 'exitcode', 'unknown')})"
    elif type(error).__name__ == "KilledWorker":  # of Dask
        reason = "the engine crashed its process, or hung and was stopped"
    else:
        reason = " ".join(f"{type(error).__name__}: {error}".split())
    return failure(scene, engine, "", reason)


def failure(scene: str, engine: str, part: str, reason: str) -> Row:
    """A failing row with its reason."""
    nan = float("nan")
    return Row(scene, engine, part or "-", "all", nan, nan, FAILS, plain(reason), nan, nan)
