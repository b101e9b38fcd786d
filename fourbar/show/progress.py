"""What takes minutes shows that it is running."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from typing import TypeVar

T = TypeVar("T")


def count_items(items: Sequence[T], text: str) -> Iterable[T]:
    """Pass the items on, with a bar on standard error that says how many are done; no bar where that is no terminal."""
    from rich.console import Console
    from rich.progress import track

    console = Console(stderr=True)
    return track(items, text, console=console, transient=True, disable=not console.is_terminal)


@contextmanager
def show_running(text: str) -> Iterator[Callable[[float], None] | None]:
    """Move a line on standard error while the body runs; nothing where that is no terminal.

    Yields what the body may report the share that is done to; None where there is no terminal.
    """
    from rich.console import Console

    console = Console(stderr=True)
    if not console.is_terminal:
        yield None
        return
    with console.status(f"{text}; Ctrl-C stops it") as line:
        yield lambda share: line.update(f"{text}, {100.0 * share:.0f} % done; Ctrl-C stops it")
