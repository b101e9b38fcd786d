"""Processes that Pebble starts anew, and whose end it notices whatever their exit code."""

from multiprocessing.context import SpawnContext, SpawnProcess


class Worker(SpawnProcess):
    """A worker that ends with exit code 0 has not ended in order: Pebble would wait for its answer for ever."""

    @property
    def exitcode(self) -> int | None:
        """The exit code; None also for 0."""
        return super().exitcode or None


class Workers(SpawnContext):
    """What Pebble starts its processes by."""

    Process = Worker
