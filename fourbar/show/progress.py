"""What takes minutes shows that it is running."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager


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
