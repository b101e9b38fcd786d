"""The folder of a run: a lock, finished parts, and at the end the results.

lock               held while a run goes on; the system frees it when the process dies
run.json           what is being run; a rerun of the same thing resumes, of another starts over
parts/000012.csv   the rows of chunk 12, written whole; its presence says the chunk is done
parts/000012.json  what the report needs of it: timings, evidence, pictures
"""

import json
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from fourbar.errors import FourBarError
from fourbar.writing import write_text
from validation.compare.rows import Row, from_csv, to_csv
from validation.report.record import Record


class RunningError(FourBarError):
    """Another run is writing into the same folder."""


class Store:
    """The parts of one run in its folder."""

    def __init__(self, folder: Path, identity: dict[str, Any]) -> None:
        self.folder, self.parts = folder, folder / "parts"
        self._identity = json.dumps(identity, indent=1, sort_keys=True) + "\n"

    @contextmanager
    def held(self) -> Iterator["Store"]:
        """Hold the folder for one run and keep the parts that an interrupted run of the same thing left."""
        from filelock import FileLock, Timeout

        self.folder.mkdir(parents=True, exist_ok=True)
        lock = FileLock(self.folder / "lock", timeout=0)
        try:
            lock.acquire()
        except Timeout:
            raise RunningError(f"{self.folder}: another run is writing into this folder") from None
        try:
            self._begin()
            yield self
        finally:
            lock.release()

    def _begin(self) -> None:
        marker = self.folder / "run.json"
        same = marker.is_file() and marker.read_text(encoding="utf-8") == self._identity
        if not same:
            marker.unlink(missing_ok=True)
            shutil.rmtree(self.parts, ignore_errors=True)
        self.parts.mkdir(exist_ok=True)
        for leftover in self.parts.glob(".*.part"):
            leftover.unlink()
        if not same:
            write_text(marker, self._identity)

    def done(self) -> set[int]:
        """The chunks whose parts are complete."""
        return {int(path.stem) for path in self.parts.glob("*.csv")}

    def put(self, chunk: int, records: list[Record]) -> None:
        """Write a finished chunk; the rows come last, since they say that it is done."""
        rows = [row for record in records for row in record.rows]
        text = json.dumps([record.without_rows() for record in records])
        write_text(self.parts / f"{chunk:06d}.json", text)
        write_text(self.parts / f"{chunk:06d}.csv", to_csv(rows))

    def rows(self, chunks: int) -> Iterator[list[Row]]:
        """The rows of each chunk, in order; sorted within and across chunks."""
        for chunk in range(chunks):
            yield from_csv(self.parts / f"{chunk:06d}.csv")

    def records(self, chunks: int) -> Iterator[Record]:
        """The records, in order, with their rows."""
        for chunk, rows in enumerate(self.rows(chunks)):
            by_scene: dict[str, list[Row]] = {}
            for row in rows:
                by_scene.setdefault(row.scene, []).append(row)
            for record in json.loads((self.parts / f"{chunk:06d}.json").read_text(encoding="utf-8")):
                yield Record.restore(record, by_scene.get(record["name"], []))

    def finish(self) -> None:
        """The results are written: the parts have served."""
        shutil.rmtree(self.parts)
        (self.folder / "run.json").unlink()
