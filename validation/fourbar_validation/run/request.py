"""Options of a run: its command line, its suite and its engines.

A part keeps them.
"""

import json
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from fourbar.errors import DependencyError, InputError
from fourbar.writing import require_file, write_text
from fourbar_validation.engines.environments import choose_engines, fill_table
from fourbar_validation.engines.guests import adjust_engines
from fourbar_validation.engines.registry import Engine, hold_fully
from fourbar_validation.regression.accept import FORMS
from fourbar_validation.regression.record import find_baseline, open_run
from fourbar_validation.run.plan import (
    WORKERS,
    Plan,
    read_part,
)
from fourbar_validation.scenes.hard_families import Hard
from fourbar_validation.scenes.random import UNEVEN_TYPE, DrawnType
from fourbar_validation.scenes.suites import (
    Files,
    Random,
    Suite,
    read_default_suite,
    read_scene_files,
    read_suite,
)

ALL_TYPES = ",".join(kind.value for kind in DrawnType)
HARD_SUITE = "hard"
"""Name of the suite of hard cases."""
_REQUEST = "request.json"
"""File beside a part that says what was asked for, so that parts can be collected."""


@dataclass(frozen=True, kw_only=True)
class Request:
    """Everything that the command line of a run states, by its options' names.

    An option that is not stated is None.
    """

    scenes: tuple[Path, ...] = ()
    out: Path = Path("results")
    engines: str | None = None
    error: float | None = None
    suite: str | None = None
    random: int | None = None
    seed: int | None = None
    type: str | None = None
    workers: int = WORKERS
    against: str | None = None
    guest: tuple[str, ...] = ()
    time_limit: float | None = None
    part: str | None = None
    verbose: bool = False
    no_pictures: bool = False
    markdown: Path | None = None
    html: Path | None = None
    junit: Path | None = None

    @property
    def forms(self) -> dict[str, Path | None]:
        """Return the files in which differences are written, by their form."""
        return {form: getattr(self, form) for form in FORMS}

    def require_consistent(self) -> None:
        """Refuse options that contradict each other or would do nothing.

        Files that cannot be written are refused too.
        """
        own_scenes = "has its own scenes; leave out scene files and --random"
        of_random = "is of random linkages; say --random N too"
        of_report = "is of a report: leave it out, and collect the parts first"
        of_two = "tells differences; say --against BASELINE too"
        drawn = self.random is not None
        part = self.part is not None
        alone = self.against is None
        for option, wrong, why in (
            (
                "random",
                self.scenes,
                "judges random linkages; leave out the scene files",
            ),
            ("suite", self.scenes or drawn, own_scenes),
            ("seed", not drawn, of_random),
            ("type", not drawn, of_random),
            ("against", part, of_report),
            *((form, part, of_report) for form in FORMS),
            *((form, alone and form != "junit", of_two) for form in FORMS),
        ):
            value = getattr(self, option)
            if value is not None and wrong:
                shown = str(value) if isinstance(value, Path) else value
                raise InputError(f"--{option}", shown, why)
        for path in self.forms.values():
            # the run will make its own folder
            if path is not None and (self.out.exists() or path.parent != self.out):
                require_file(path, *self.scenes)
        if self.against is not None:
            open_run(find_baseline(self.against), "--against")

    @property
    def suite_name(self) -> str:
        """Return the name of the suite; empty if its scenes are chosen one by one."""
        if self.scenes or self.random is not None:
            return ""
        if self.suite in (None, HARD_SUITE):
            return self.suite or "models"
        return Path(str(self.suite)).name


def make_plan(request: Request, files: Files | None = None) -> Plan:
    """Read the scenes and make the engines ready.

    Raises DependencyError if one that is named cannot answer here.

    `files`: the scenes as a part kept them.
    """
    suite = _select_scenes(request) if files is None else files
    reasons = {engine: engine.missing() for engine in select_engines(request)}
    missing = [(one.name, why) for one, why in reasons.items() if why is not None]
    if missing and request.engines is not None:
        raise DependencyError("; ".join(f"{name}: {why}" for name, why in missing))
    return Plan(
        suite,
        tuple(engine for engine, why in reasons.items() if why is None),
        request.workers,
        not request.no_pictures,
        None if request.against is None else find_baseline(request.against),
        (1, 1) if request.part is None else read_part(request.part),
        missing,
        request.engines or "",
        request.suite_name,
    )


def keep_request(request: Request, plan: Plan) -> None:
    """Write what was asked for beside a part, with the text of scene files.

    Another machine need not have the files.
    """
    _, parts = plan.part
    kept: dict[str, Any] = {"parts": parts, "asked": asdict(request)}
    if isinstance(plan.suite, Files):
        files = asdict(plan.suite)
        kept["files"] = files | {"not_drawn": sorted(plan.suite.not_drawn)}
    write_text(request.out / _REQUEST, json.dumps(kept, default=str) + "\n")


def read_request(folder: Path) -> tuple[int, Request, Files | None]:
    """Read beside a part how many there are, and what was asked for.

    The scene files are read too; InputError without them.
    """
    try:
        kept = json.loads((folder / _REQUEST).read_text(encoding="utf-8"))
        asked = kept["asked"]
        asked["scenes"] = tuple(map(Path, asked["scenes"]))
        asked["guest"] = tuple(asked["guest"])
        request = Request(**asked)
        files = kept.get("files")
        if files is not None:
            texts = tuple(map(tuple, files["texts"]))
            files = Files(texts, files["positions"], frozenset(files["not_drawn"]))
        return int(kept["parts"]), request, files
    except (OSError, KeyError, TypeError, ValueError):
        why = "must be a folder that `run --part` wrote and that was not collected yet"
        raise InputError("DIR", str(folder), why) from None


def forget_request(folder: Path) -> None:
    """Remove what was kept beside parts, once their results are written."""
    (folder / _REQUEST).unlink(missing_ok=True)


def _select_scenes(request: Request) -> Suite:
    """Select the scenes."""
    if request.suite == HARD_SUITE:
        return Hard()
    if request.suite is not None:
        return read_suite(Path(request.suite))
    if request.random is not None:
        types = _read_linkage_types(request.type or ALL_TYPES)
        return Random(request.random, request.seed or 0, types)
    if request.scenes:
        return read_scene_files(request.scenes)
    return read_default_suite()


def select_engines(request: Request) -> tuple[Engine, ...]:
    """Select the engines that are to answer, and say what each is held to."""
    hard = request.suite == HARD_SUITE
    folders = [path.parent for path in request.scenes]
    table = fill_table(folders, request.guest, request.time_limit, balls=hard)
    engines = choose_engines(request.engines, table, request.time_limit)
    if hard:
        engines = tuple(map(hold_fully, engines))
    if request.error is not None:
        engines = adjust_engines(engines, request.error)
    return engines


def _read_linkage_types(text: str) -> tuple[DrawnType, ...]:
    """Read the types named in a comma-separated list; none for uneven linkages."""
    if text == UNEVEN_TYPE:
        return ()
    try:
        return tuple(DrawnType(name.strip()) for name in text.split(","))
    except ValueError:
        listed = ALL_TYPES.replace(",", ", ")
        why = f"must be {UNEVEN_TYPE} or a comma-separated list of {listed}"
        raise InputError("--type", text, why) from None
