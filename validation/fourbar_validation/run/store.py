"""The folder of whatever runs long: a lock, finished tasks, and at the end the results.

lock               held while a run goes on; the system frees it when the process dies
run.json           what is being run; a rerun of the same thing resumes, of another
                   starts over
parts/000012       results of task 12, written atomically: a line of JSON that says of
                   which run it is, and the SHA-256 of what follows; then a line of JSON
                   for each result, packed by gzip

A part K of N, as `run --part` has it, is another thing: the tasks of one machine.
"""

import gzip
import hashlib
import json
import shutil
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from fourbar.errors import DependencyError, FourBarError, InputError
from fourbar.writing import require_file, write_bytes, write_text
from fourbar_validation.regression.record import UNFINISHED


class RunningError(FourBarError):
    """Another run is writing into the same folder."""


class Store:
    """The finished tasks of one run in its folder, a file each.

    `identity`: what they depend on. `outcome`: the files it ends with.
    """

    def __init__(
        self,
        folder: Path,
        identity: dict[str, Any],
        outcome: Sequence[str] = (),
    ) -> None:
        self.folder = folder
        self.parts = folder / "parts"
        self._written = ("lock", UNFINISHED, *outcome)
        self._identity = json.dumps(identity, indent=1, sort_keys=True) + "\n"
        self._run = hashlib.sha256(self._identity.encode()).hexdigest()
        self.notes: list[str] = []
        """Tasks of an earlier run that are done again, each with the reason."""

    @contextmanager
    def held(self) -> Iterator["Store"]:
        """Hold the folder for one run.

        The tasks that an interrupted run of the same thing left are kept.
        """
        from filelock import FileLock, Timeout

        self.folder.mkdir(parents=True, exist_ok=True)
        for name in self._written:
            require_file(self.folder / name)
        if self.parts.exists() and not self.parts.is_dir():
            why = "must be a folder, in which a run keeps its parts"
            raise InputError("--out", str(self.parts), why)
        try:
            lock = FileLock(self.folder / "lock", timeout=0).acquire()
        except Timeout:
            why = "another run is writing into this folder"
            raise RunningError(f"{self.folder}: {why}") from None
        with lock:
            self._begin()
            yield self

    def _begin(self) -> None:
        marker = self.folder / UNFINISHED
        same = marker.is_file() and marker.read_text(encoding="utf-8") == self._identity
        if not same:
            if marker.is_file() and any(self.parts.glob("*")):
                difference = self._name_difference(marker)
                note = f"made again: the parts of another run ({difference})"
                self.notes.append(note)
            marker.unlink(missing_ok=True)
            shutil.rmtree(self.parts, ignore_errors=True)
        self.parts.mkdir(exist_ok=True)
        for leftover in self.parts.glob(".*.part"):
            _remove(leftover)
        if not same:
            write_text(marker, self._identity)

    def _name_difference(self, marker: Path) -> str:
        """Return what the earlier run differs in from this one, or ""."""
        now = json.loads(self._identity)
        try:
            before = dict(json.loads(marker.read_text(encoding="utf-8")))
        except (TypeError, ValueError):
            return "its run.json is damaged"
        names = sorted({*before, *now})
        return ", ".join(name for name in names if before.get(name) != now.get(name))

    def require_same(self) -> None:
        """Raise InputError unless the folder holds tasks of this run."""
        marker = self.folder / UNFINISHED
        if not marker.is_file() or not self.parts.is_dir():
            why = "must hold a run.json and the parts that `run --part` wrote"
            raise InputError("DIR", str(self.folder), why)
        if difference := self._name_difference(marker):
            why = (
                "is no part of the run that the command of the first DIR makes here"
                f" now: it differs in {difference}"
            )
            raise InputError("DIR", str(self.folder), why)

    def done(self) -> set[int]:
        """List the tasks whose files are complete and of this run.

        Others are removed, and noted.
        """
        done = set()
        for path, damage in self.examine():
            if damage:
                self.notes.append(f"made again: parts/{path.name}: {damage}")
                _remove(path)
            else:
                done.add(int(path.name))
        return done

    def examine(self) -> Iterator[tuple[Path, str]]:
        """Yield the file of each task with what is wrong with it.

        The text is empty if the file is complete and of this run.
        """
        for path in sorted(self.parts.iterdir()):
            try:
                self._unpack(path)
            except ValueError as error:
                yield path, str(error)
            else:
                yield path, ""

    def put(self, task: int, results: Sequence[Any]) -> None:
        """Write a finished task, its results as JSON has them."""
        lines = "\n".join(json.dumps(result) for result in results)
        packed = gzip.compress(lines.encode(), 1, mtime=0)
        digest = hashlib.sha256(packed).hexdigest()
        head = json.dumps({"task": task, "run": self._run, "sha256": digest})
        write_bytes(self._find_path(task), f"{head}\n".encode() + packed)

    def _find_path(self, task: int) -> Path:
        return self.parts / f"{task:06d}"

    def _unpack(self, path: Path) -> bytes:
        """Read what follows the first line of a task's file.

        Raises a ValueError that says what is wrong with it.
        """
        if not path.is_file():
            raise ValueError("is no file")
        first, _, packed = path.read_bytes().partition(b"\n")
        head = {}
        with suppress(TypeError, ValueError):
            head = dict(json.loads(first))
        if head.get("sha256") != hashlib.sha256(packed).hexdigest():
            raise ValueError("is damaged")
        if head.get("run") != self._run:
            raise ValueError("is of another run")
        if path.name != str(head.get("task")).zfill(6):
            raise ValueError("is another part")
        return packed

    def read(self, task: int) -> list[Any]:
        """Read the results of a task, in order.

        Raises DependencyError if its file was damaged meanwhile.
        """
        path = self._find_path(task)
        try:
            lines = gzip.decompress(self._unpack(path)).decode().splitlines()
        except (ValueError, FileNotFoundError) as error:
            why = f"{error}; run it again, and this part is made again"
            raise DependencyError(f"{path}: {why}") from None
        return [json.loads(line) for line in lines]

    def finish(self) -> None:
        """Remove the files of tasks, once the results are written."""
        shutil.rmtree(self.parts)
        (self.folder / UNFINISHED).unlink()


def _remove(path: Path) -> None:
    """Remove whatever lies there under the name of a file."""
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path)
    else:
        path.unlink()
