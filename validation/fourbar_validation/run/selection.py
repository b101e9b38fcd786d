"""Select what a run judges: scenes, their types, and engines."""

from collections.abc import Sequence
from pathlib import Path

from fourbar.errors import DependencyError, InputError
from fourbar_validation.engines.environments import read_engines, start_engines
from fourbar_validation.engines.further import FURTHER
from fourbar_validation.engines.guests import Guest, read_guests
from fourbar_validation.engines.hard_suite import HARD_WITNESSES, Hard, hold_fully
from fourbar_validation.engines.witnesses import WITNESSES, Witness
from fourbar_validation.scenes.random import UNEVEN_TYPE, DrawnType
from fourbar_validation.scenes.suites import Random, Suite, read_default_suite, read_scene_files, read_suite


def select_scenes(
    scenes: tuple[Path, ...],
    named: str | None,
    count: int | None,
    seed: int,
    types: str,
    guests: Sequence[str] = (),
    seconds: float | None = None,
) -> tuple[Suite, tuple[Witness, ...]]:
    """Select the scenes, and the engines with their tolerances there.

    `guests`: those of the command line, with the time in which each must answer, s.
    """
    if named == "hard":
        own = (*HARD_WITNESSES, *map(hold_fully, FURTHER))
        return Hard(), (*own, *map(hold_fully, read_guests(guests, [witness.name for witness in own], seconds)))
    own = (*WITNESSES, *FURTHER)
    witnesses = (*own, *read_guests(guests, [witness.name for witness in own], seconds))
    if named is not None:
        return read_suite(Path(named)), witnesses
    if count:
        return Random(count, seed, read_linkage_types(types)), witnesses
    return (read_scene_files(scenes) if scenes else read_default_suite()), witnesses


def choose_witnesses(
    engines: str | None,
    witnesses: tuple[Witness, ...] = WITNESSES,
    folders: Sequence[Path] = (),
    seconds: float | None = None,
) -> tuple[Witness, ...]:
    """Choose the engines named in a comma-separated list, and the guests, which are named by being given.

    Where there is no list, all but those that need not be installed. A name that is no witness's is sought in the
    engines.toml of these folders and of the package; `seconds`: in which such an engine must answer.
    """
    if engines is None:
        further = {witness.name for witness in FURTHER}
        return tuple(witness for witness in witnesses if witness.name not in further or not witness.missing())
    known = {witness.name: witness for witness in witnesses}
    names = [name.strip() for name in engines.split(",") if name.strip()]
    described = read_engines(folders)
    for name in names or [engines]:
        if name not in known and name not in described:
            raise InputError("--engines", name, "must be among " + ", ".join([*known, *described]))
    chosen = tuple(witness for name, witness in known.items() if name in names or isinstance(witness, Guest))
    return (*chosen, *start_engines([described[name] for name in names if name not in known], witnesses, seconds))


def find_askable(witnesses: tuple[Witness, ...], *, by_name: bool) -> tuple[tuple[Witness, ...], list[tuple[str, str]]]:
    """Find those that can answer here, and the others with the reason; DependencyError where those were named."""
    missing = [(witness.name, reason) for witness in witnesses if (reason := witness.missing())]
    if missing and by_name:
        raise DependencyError("; ".join(f"{name}: {reason}" for name, reason in missing))
    return tuple(witness for witness in witnesses if not witness.missing()), missing


def read_linkage_types(text: str) -> tuple[DrawnType, ...]:
    """Read the types named in a comma-separated list; none for uneven linkages."""
    if text == UNEVEN_TYPE:
        return ()
    try:
        return tuple(DrawnType(name.strip()) for name in text.split(","))
    except ValueError:
        allowed = ", ".join(kind.value for kind in DrawnType)
        raise InputError("--type", text, f"must be {UNEVEN_TYPE} or a comma-separated list of {allowed}") from None
