"""The one table of engines, by their names.

Every engine that a run may ask is an entry: those of harness and lab (`list_engines`),
guests of the command line, and entries of engines.toml, whose environments are made
when they are chosen.
"""

from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path

from fourbar.errors import InputError, list_allowed
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
from fourbar_validation.engines.registry import (
    BALLS,
    Engine,
    list_engines,
    load_further,
)

Table = dict[str, Engine | Entry]


def fill_table(
    folders: Iterable[Path] = (),
    guests: Sequence[str] = (),
    seconds: float | None = None,
    *,
    balls: bool = False,
) -> Table:
    """Fill the table of engines, by name; the first to bear a name keeps it.

    Parameters
    ----------
    folders : whose engines.toml is read before those of the package and of the lab.
    guests : each as `--guest` takes it; they are started, and their hello names them.
    seconds : time limit for each answer of a guest.
    balls : offer ball arithmetic too, which is for hard positions.
    """
    table: Table = {**list_engines()}
    if not balls:
        del table[BALLS.name]
    table |= {guest.name: guest for guest in read_guests(guests, list(table), seconds)}
    return table | read_engines(folders) | table


def choose_engines(
    names: str | None,
    table: Table | None = None,
    seconds: float | None = None,
) -> tuple[Engine, ...]:
    """Choose the engines named in a comma-separated list, and every guest.

    Without a list these are all of the harness, and those of the lab that are
    installed. `seconds`: time limit for each answer of an engine of engines.toml.
    """
    table = fill_table() if table is None else table
    ready = {name for name, one in table.items() if isinstance(one, Engine)}
    guests = {name for name in ready if isinstance(table[name], Guest)}
    wanted = ready if names is None else {*_read_names(names, table), *guests}
    optional = load_further() if names is None else ()
    chosen: list[Engine] = []
    for name in filter(wanted.__contains__, table):
        engine = table[name]
        if isinstance(engine, Entry):
            taken = {*table, *(one.name for one in chosen)} - {name}
            ours = list_engines().get(engine.adapter)
            engine = start_engine(engine, taken, seconds, like=ours)
        if engine in optional and engine.missing():
            continue
        if isinstance(engine, Guest):
            engine = replace(engine, number=len(chosen))
        chosen.append(engine)
    return name_by_versions(chosen, table)


def _read_names(text: str, table: Table) -> list[str]:
    names = [name.strip() for name in text.split(",") if name.strip()]
    for name in names or [text]:
        if name not in table:
            raise InputError("--engines", name, list_allowed(name, table))
    return names
