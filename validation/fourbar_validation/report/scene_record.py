"""Record of one scene once it is judged, for every form of the report.

The record of a whole run, record.json, is made in `regression/record.py`.
"""

from collections.abc import Sequence
from dataclasses import asdict, dataclass, field, replace
from operator import attrgetter
from typing import Any

from fourbar_validation.compare.rows import COLUMN_TYPES, FORMULAS, Row, sort_rows


@dataclass(slots=True)
class Timing:
    """Seconds that one answer took, measured in the process that gave it."""

    scene: str
    engine: str
    setting: str
    positions: int
    seconds: float


@dataclass(slots=True)
class Record:
    """Record of one scene, which a run stores."""

    name: str
    title: str = ""
    source: str = ""
    needs: list[str] = field(default_factory=list)
    """What it asks of an engine, in the words of hello's `effects`."""
    rows: list[Row] = field(default_factory=list)
    timings: list[Timing] = field(default_factory=list)
    left_out: list[str] = field(default_factory=list)
    independence: dict[str, Sequence[str]] = field(default_factory=dict)
    """engine: (shared with the formulas, found alone)."""
    evidence: dict[str, dict[str, float]] = field(default_factory=dict)
    output: dict[str, str] = field(default_factory=dict)
    """engine: what it printed."""
    causes: dict[str, list[str]] = field(default_factory=dict)
    """engine: known mistakes that explain all that differs, the simplest first. An
    engine for which none could be looked for is absent.
    """
    against: dict[str, list[str]] = field(default_factory=dict)
    """Quantities in which engines agree with each other and differ from the formulas,
    with the names of these engines.
    """
    figure: str | None = None
    """SVG of the answers, or None where there is nothing to draw."""
    drawn: list[str] = field(default_factory=list)
    """Engines whose answers it shows."""

    def kept_all(self) -> dict[str, Any]:
        """Return everything in lists and dictionaries.

        The rows are sorted.
        """
        cells = attrgetter(*COLUMN_TYPES)
        rows = [[*cells(row)] for row in sort_rows(self.rows)]
        return asdict(replace(self, rows=[])) | {"rows": rows}

    @classmethod
    def restore(cls, kept: dict[str, Any]) -> "Record":
        """Return the record from the data that `kept_all` returned."""
        rows = [Row(*row) for row in kept["rows"]]
        timings = [Timing(**timing) for timing in kept["timings"]]
        return cls(**kept | {"rows": rows, "timings": timings})

    def joined(self, further: "Record") -> "Record":
        """Add the answers of another set of engines.

        The rows of the formulas stand once.
        """
        known = set(self.rows)
        joined: dict[str, Any] = {
            name: getattr(self, name) | getattr(further, name)
            for name in ("independence", "evidence", "output", "causes", "against")
        }
        timings = [timing for timing in further.timings if timing.engine != FORMULAS]
        return replace(
            self,
            **joined,
            rows=self.rows + [row for row in further.rows if row not in known],
            timings=self.timings + timings,
            left_out=self.left_out + further.left_out,
        )
