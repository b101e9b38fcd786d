"""What takes minutes is seen to be under way."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager


@contextmanager
def under_way(text: str) -> Iterator[None]:
    """A line that moves on standard error while the body runs; nothing where that is no terminal."""
    from rich.console import Console

    console = Console(stderr=True)
    if not console.is_terminal:
        yield
        return
    with console.status(f"{text}; Ctrl-C stops it"):
        yield


@contextmanager
def counted(text: str) -> Iterator[Callable[[float], None] | None]:
    """The same with the share that is done, which the body reports."""
    from rich.console import Console

    console = Console(stderr=True)
    if not console.is_terminal:
        yield None
        return
    with console.status(f"{text}; Ctrl-C stops it") as line:
        yield lambda share: line.update(f"{text}, {100.0 * share:.0f} % done; Ctrl-C stops it")
