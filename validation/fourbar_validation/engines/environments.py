"""The one table of engines, by their names, and engines in environments of their own.

Every engine that a run may ask is an entry of the table: those of harness and lab
(`list_engines`), guests of the command line, and entries of engines.toml, whose
environments are made when they are chosen. engines.toml says what pip installs, and
which adapter or command answers.
"""

import hashlib
import os
import re
import shutil
import sys
import sysconfig
import tomllib
from collections.abc import Collection, Iterable, Sequence
from dataclasses import replace
from importlib.metadata import requires
from pathlib import Path

from filelock import FileLock

from fourbar.errors import DependencyError, InputError, list_allowed
from fourbar.linkage import record
from fourbar.writing import read_text, write_text
from fourbar_validation.engines.guests import (
    Guest,
    Texts,
    name_by_versions,
    name_guests,
    read_guests,
    serve_adapter,
)
from fourbar_validation.engines.programs import (
    Message,
    Program,
    run_to_end,
)
from fourbar_validation.engines.registry import (
    BALLS,
    LAB_FOLDERS,
    Engine,
    list_engines,
    load_further,
)

LARGEST_ENGINES_FILE = 10**6
"""Bytes."""
ENGINES_FILE = "engines.toml"
_CACHE = (
    Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "fourbar-engines"
)
_KEPT_FIELDS = (
    "tolerance",
    "answers",
    "positions",
    "through_time",
    "predictor",
    "residuals",
    "answers_nearby",
)
"""Fields of an engine that an adapter of ours keeps in every environment."""
_DONE = "installed"
"""File in the folder of an environment that is complete."""


@record
class EngineEntry:
    """One table of engines.toml."""

    name: str
    adapter: str = ""
    """One of our adapters, or module:Class."""
    command: Texts = ()
    """Command line of a foreign program, which takes the adapter's place."""
    requires: Texts = ()
    """Requirements that pip installs."""
    python: str = ""
    """Another interpreter than this one."""
    setting: str = ""
    """Name of its setting, one of those that its hello lists."""
    steps: tuple[int, ...] = ()
    """Steps in a turn of an engine that runs through time. A run asks for the most, a
    benchmark for each.
    """


def read_engines(folders: Iterable[Path]) -> dict[str, EngineEntry]:
    """Read engines.toml of these folders, of the package and of the lab, by name.

    Raises InputError for what is no entry.
    """
    entries: dict[str, EngineEntry] = {}
    for folder in dict.fromkeys((*folders, Path(__file__).parent, *LAB_FOLDERS)):
        file = folder / ENGINES_FILE
        if file.is_file():
            of_file = read_engines_of(file)
            entries |= {name: of_file[name] for name in of_file if name not in entries}
    return entries


def read_engines_of(file: Path) -> dict[str, EngineEntry]:
    """Read the engines of one file, by name."""
    text = read_text(file, "engines", LARGEST_ENGINES_FILE)
    entries: dict[str, EngineEntry] = {}
    try:
        for table in tomllib.loads(text).get("engine", []):
            entry = _read_entry(table)
            entries.setdefault(entry.name, entry)
    except tomllib.TOMLDecodeError as error:
        raise InputError("engine", None, f"is no TOML: {error}", str(file)) from None
    except InputError as error:
        raise error.in_file(str(file)) from None
    return entries


def _read_entry(table: object) -> EngineEntry:
    texts = ("name", "adapter", "python", "setting")
    lists = ("command", "requires")
    if not isinstance(table, dict) or not table.get("name"):
        raise InputError("engine", table, "must be a table [[engine]] with a name")
    for key, value in table.items():
        if key == "steps" or key in lists:
            kind = int if key == "steps" else str
            fits = isinstance(value, list) and all(type(part) is kind for part in value)
        else:
            fits = key in texts and isinstance(value, str)
        if not fits:
            allowed = (
                f"allowed: {', '.join(texts)} (texts), {', '.join(lists)} (lists of"
                " texts), steps (whole numbers)"
            )
            raise InputError(f"engine.{key}", value, allowed)
    if bool(table.get("adapter")) == bool(table.get("command")):
        raise InputError("engine", table["name"], "must have an adapter or a command")
    stated: Message = {
        key: tuple(value) if isinstance(value, list) else value
        for key, value in table.items()
    }
    return EngineEntry(**stated)


def make_environment(entry: EngineEntry, cache: Path = _CACHE) -> str:
    """Return the interpreter of an engine's environment, which is made once.

    Raises DependencyError if pip fails. Engines with the same requirements share it.
    With this Python all else comes from the environment that runs here; another gets
    what the harness needs as well.
    """
    if not entry.requires and not entry.python:
        return sys.executable
    python: str | None = sys.executable
    wanted = list(entry.requires)
    if entry.python:
        python = shutil.which(entry.python)
        wanted += [text for text in requires("fourbar") or [] if "extra ==" not in text]
    if python is None:
        raise DependencyError(f"{entry.name}: no {entry.python} is found")
    key = hashlib.sha256(
        repr((python, sys.version_info[:2], sys.prefix, wanted)).encode()
    ).hexdigest()[:12]
    named = re.sub(r"[^a-zA-Z0-9.]+", "-", " ".join(entry.requires) or entry.python)
    folder = cache / f"{named[:40]}-{key}"
    inside = folder / ("Scripts/python.exe" if os.name == "nt" else "bin/python")
    cache.mkdir(parents=True, exist_ok=True)
    with FileLock(f"{folder}.lock"):
        if not (folder / _DONE).is_file():
            # an environment made by uv, which may be the one that runs here, has no pip
            pip = [inside, "-m", "pip", "--disable-pip-version-check"]
            for line in (
                [python, "-m", "venv", "--clear", folder],
                [*pip, "install", *wanted],
            ):
                if why := run_to_end(line).why:
                    raise DependencyError(
                        f"{entry.name}: its environment cannot be made: {why}"
                    )
            if not entry.python:
                (site,) = folder.rglob("site-packages")
                ours = dict.fromkeys(
                    sysconfig.get_path(name) for name in ("purelib", "platlib")
                )
                lines = [f"import site; site.addsitedir({path!r})\n" for path in ours]
                write_text(
                    site / "zz_of_the_harness.pth", "".join(lines)
                )  # read after all others
            (folder / _DONE).touch()
    return str(inside)


def prepare_program(entry: EngineEntry, seconds: float | None) -> Program:
    """Make an engine's environment; return the program that answers there."""
    python = make_environment(entry)
    if entry.adapter:
        return serve_adapter(entry.adapter, seconds, python)
    program = shutil.which(
        entry.command[0],
        path=f"{Path(python).parent}{os.pathsep}{os.environ.get('PATH')}",
    )
    if program is None:
        raise InputError(
            "engine.command",
            entry.command[0],
            "no such program",
            ENGINES_FILE,
        )
    return Program((program, *entry.command[1:]), seconds)


def start_engine(
    entry: EngineEntry,
    taken: Collection[str] = (),
    seconds: float | None = None,
    like: Engine | None = None,
) -> Guest:
    """Make the environment of an engine and read its hello.

    `taken`: names that others have. `like`: the adapter of ours that answers there; the
    engine is then held to what that one is held to here.
    """
    program = prepare_program(entry, seconds)
    (guest,) = name_guests([(entry.adapter or entry.name, entry.name, program)], taken)
    if like is not None:
        guest = replace(guest, **{name: getattr(like, name) for name in _KEPT_FIELDS})
    setting: Message = {"name": entry.setting} if entry.setting else {}
    if entry.steps:
        setting["steps_per_turn"] = entry.steps[-1]
    return guest.at_setting(**setting) if setting else guest


Table = dict[str, Engine | EngineEntry]


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
    if names is None:
        wanted = {name for name, one in table.items() if isinstance(one, Engine)}
    else:
        asked = [name.strip() for name in names.split(",") if name.strip()] or [names]
        for name in asked:
            if name not in table:
                raise InputError("--engines", name, list_allowed(name, table))
        guests = {name for name, one in table.items() if isinstance(one, Guest)}
        wanted = {*asked, *guests}
    optional = load_further() if names is None else ()
    chosen: list[Engine] = []
    for name in filter(wanted.__contains__, table):
        engine = table[name]
        if isinstance(engine, EngineEntry):
            taken = {*table, *(one.name for one in chosen)} - {name}
            ours = list_engines().get(engine.adapter)
            engine = start_engine(engine, taken, seconds, like=ours)
        if engine in optional and engine.missing():
            continue
        if isinstance(engine, Guest):
            engine = replace(engine, number=len(chosen))
        chosen.append(engine)
    return name_by_versions(chosen, table)
