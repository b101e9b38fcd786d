"""What takes minutes shows that it is running."""

from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from typing import TypeVar

T = TypeVar("T")


@contextmanager
def running(text: str) -> Iterator[None]:
    """A line that moves on standard error while the body runs; nothing where that is no terminal."""
    from rich.console import Console

    console = Console(stderr=True)
    if not console.is_terminal:
        yield
        return
    with console.status(f"{text}; Ctrl-C stops it"):
        yield


def counted(items: Sequence[T], text: str) -> Iterable[T]:
    """The items, with a bar on standard error that says how many are done; nothing where that is no terminal."""
    from rich.console import Console
    from rich.progress import track

    console = Console(stderr=True)
    if not console.is_terminal:
        return items
    return track(items, text, console=console, transient=True)
