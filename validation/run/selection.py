"""What a run is of: which scenes, of which types, by which witnesses."""

from pathlib import Path

from fourbar.errors import DependencyError, InputError
from validation.engines.hard_suite import HARD_WITNESSES, Hard
from validation.engines.witnesses import WITNESSES, Witness
from validation.scenes.random import LinkageType
from validation.scenes.suites import Random, Suite, model_files, scene_files, suite_file


def selected(
    scenes: tuple[Path, ...], named: str | None, count: int | None, seed: int, types: str
) -> tuple[Suite, tuple[Witness, ...]]:
    """The scenes wanted, and the witnesses with what they are held to there."""
    if named == "hard":
        return Hard(), HARD_WITNESSES
    if named is not None:
        return suite_file(Path(named)), WITNESSES
    if count:
        return Random(count, seed, linkage_types(types)), WITNESSES
    return scene_files(scenes or model_files()), WITNESSES


def chosen(engines: str | None, witnesses: tuple[Witness, ...] = WITNESSES) -> tuple[Witness, ...]:
    """The witnesses named in a comma-separated list; all of them where there is none."""
    if engines is None:
        return witnesses
    known = {witness.name: witness for witness in witnesses}
    names = [name.strip() for name in engines.split(",") if name.strip()]
    for name in names or [engines]:
        if name not in known:
            raise InputError("--engines", name, "must be among " + ", ".join(known))
    return tuple(witness for name, witness in known.items() if name in names)


def askable(witnesses: tuple[Witness, ...], *, by_name: bool) -> tuple[tuple[Witness, ...], list[tuple[str, str]]]:
    """Those that can answer here, and the others with the reason; DependencyError where those were named."""
    missing = [(witness.name, reason) for witness in witnesses if (reason := witness.missing())]
    if missing and by_name:
        raise DependencyError("; ".join(f"{name}: {reason}" for name, reason in missing))
    return tuple(witness for witness in witnesses if not witness.missing()), missing


def linkage_types(text: str) -> tuple[LinkageType, ...]:
    """The types named in a comma-separated list."""
    try:
        return tuple(LinkageType(name.strip()) for name in text.split(","))
    except ValueError:
        allowed = ", ".join(kind.value for kind in LinkageType)
        raise InputError("--type", text, f"must be a comma-separated list of {allowed}") from None
