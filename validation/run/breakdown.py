"""The row of an engine that broke down: its own failure, in its own row."""

from validation.compare.rows import FAILS, Row


def breakdown(scene: str, engine: str, error: BaseException, part: str = "") -> Row:
    """The row of an engine that raised, took its process with it, or never came back; `part`: in what."""
    if isinstance(error, TimeoutError):
        reason = "the engine hung and was stopped"
    elif type(error).__name__ == "ProcessExpired":  # of Pebble
        reason = f"the engine crashed its process (exit code {getattr(error, 'exitcode', 'unknown')})"
    elif type(error).__name__ == "KilledWorker":  # of Dask
        reason = "the engine crashed its process, or hung and was stopped"
    else:
        reason = " ".join(f"{type(error).__name__}: {error}".split())
    return Row.unmeasured(scene, engine, part, "all", FAILS, reason)
