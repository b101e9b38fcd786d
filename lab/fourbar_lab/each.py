"""A function over items in several processes, where a failure ends all."""

from collections.abc import Callable, Iterable, Iterator
from typing import Any, NoReturn

from fourbar_validation.engines import workers


def _fail(
    _: object,
    error: BaseException,
    __: workers.Attempt,
) -> NoReturn:
    """Raise what an item failed with."""
    raise error


def apply_each(
    function: Callable[[Any], Any],
    items: Iterable[Any],
    processes: int,
) -> Iterator[Any]:
    """Apply the function to each item, however long it takes; results in order."""
    tasks = enumerate([item] for item in items)
    for _, results in workers.apply_over_processes(
        function,
        tasks,
        processes,
        seconds=None,
        instead=_fail,
    ):
        yield from results
