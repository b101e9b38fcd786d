"""A process that asks for too much memory gets a MemoryError; it takes no other process with it."""

from contextlib import suppress

WORKER_MEMORY = 8 * 2**30
"""Bytes of address space of one process; a scene takes a hundredth, most of it libraries."""


def bound_memory() -> None:
    """Bound this process's address space; where the system cannot, nothing happens."""
    try:
        import resource
    except ImportError:  # only systems of the Unix family have it
        return
    _, hard = resource.getrlimit(resource.RLIMIT_AS)
    with suppress(ValueError, OSError):  # macOS knows the limit and sets none
        resource.setrlimit(resource.RLIMIT_AS, (WORKER_MEMORY if hard < 0 else min(WORKER_MEMORY, hard), hard))
