"""What takes minutes shows that it is running."""

from collections.abc import Iterator
from contextlib import contextmanager


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
