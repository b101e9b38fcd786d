"""The one table of engines: their names, and how each is made ready.

Four sources fill it: `ENGINES` of the harness (`registry`) and of the lab where it is
there, the files engines.toml, and the guests that the command line names.
"""

from collections.abc import Callable, Collection, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

from fourbar.errors import InputError
from fourbar_validation.engines.environments import (
    Entry,
    read_engines,
    start_engine,
)
from fourbar_validation.engines.guests import (
    Guest,
    name_by_versions,
    read_guests,
)
from fourbar_validation.engines.registry import BALLS, ENGINES, Engine, load_further

HARNESS_ENGINES, LAB_ENGINES, ENGINES_TOML, GUEST = (
    "harness",
    "lab",
    "engines.toml",
    "--guest",
)
"""Sources of engines."""


@dataclass(frozen=True, slots=True)
class _TableEntry:
    """A line of the table."""

    source: str
    open: Callable[[Collection[str]], Engine]
    """Make the engine ready, given the names that others have already."""


def fill_table(
    folders: Iterable[Path] = (),
    guests: Sequence[str] = (),
    seconds: float | None = None,
    *,
    balls: bool = False,
) -> dict[str, _TableEntry]:
    """Fill the table of engines, by name; the first to bear a name keeps it.

    Parameters
    ----------
    folders : whose engines.toml is read before those of the package and of the lab.
    guests : each as `--guest` takes it; they are started, and their hello names them.
    seconds : time limit for each answer of an engine in another process.
    balls : offer ball arithmetic too, which is for hard positions.
    """
    ours = [BALLS] * balls + list(ENGINES)
    by_source = {HARNESS_ENGINES: ours, LAB_ENGINES: list(load_further())}
    table: dict[str, _TableEntry] = {}
    for source, engines in by_source.items():
        for engine in engines:
            table[engine.name] = _TableEntry(source, partial(_ready, engine))
    for guest in read_guests(guests, list(table), seconds):
        table[guest.name] = _TableEntry(GUEST, partial(_ready, guest))
    for name, entry in read_engines(folders).items():
        table.setdefault(
            name, _TableEntry(ENGINES_TOML, partial(_start_environment, entry, seconds))
        )
    return table


def _ready(engine: Engine, _: Collection[str]) -> Engine:
    return engine


def _start_environment(
    entry: Entry,
    seconds: float | None,
    taken: Collection[str],
) -> Engine:
    """Make the environment of an engine of engines.toml and read its hello."""
    ours = {engine.name: engine for engine in (*ENGINES, *load_further())}
    return start_engine(entry, taken, seconds, like=ours.get(entry.adapter))


def choose_engines(
    names: str | None,
    table: dict[str, _TableEntry] | None = None,
) -> tuple[Engine, ...]:
    """Choose the engines named in a comma-separated list, and every guest.

    Without a list these are all of the harness, and those of the lab that are
    installed.
    """
    table = fill_table() if table is None else table
    if names is None:
        wanted = {name for name, one in table.items() if one.source != ENGINES_TOML}
    else:
        guests = {name for name, one in table.items() if one.source == GUEST}
        wanted = {*_read_names(names, table), *guests}
    chosen: list[Engine] = []
    for name in [name for name in table if name in wanted]:
        taken = {*table, *(engine.name for engine in chosen)} - {name}
        engine = table[name].open(taken)
        optional = names is None and table[name].source == LAB_ENGINES
        if optional and engine.missing():
            continue
        if isinstance(engine, Guest):
            engine = replace(engine, number=len(chosen))
        chosen.append(engine)
    return name_by_versions(chosen, table)


def _read_names(text: str, table: dict[str, _TableEntry]) -> list[str]:
    names = [name.strip() for name in text.split(",") if name.strip()]
    for name in names or [text]:
        if name not in table:
            raise InputError("--engines", name, f"must be among {', '.join(table)}")
    return names
