"""What is known of one scene once it is judged: a record while it is, what the report keeps of it afterwards."""

from dataclasses import asdict, dataclass, field, replace
from typing import Any

from fourbar.scene import Scene
from fourbar.solution import Solution
from validation.compare.answer import Answer
from validation.compare.identities import FORMULAS
from validation.compare.reversals import Reversal
from validation.compare.rows import Row


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
    """Everything the report needs of one scene."""

    name: str
    scene: Scene
    rows: list[Row] = field(default_factory=list)
    timings: list[Timing] = field(default_factory=list)
    left_out: list[str] = field(default_factory=list)
    reversals: list[Reversal] = field(default_factory=list)
    solution: Solution | None = None
    answers: list[Answer] = field(default_factory=list)


@dataclass(slots=True)
class Judged:
    """What is kept of one scene once it is judged: small, and storable as JSON but for its rows."""

    name: str
    title: str = ""
    source: str = ""
    rows: list[Row] = field(default_factory=list)
    timings: list[Timing] = field(default_factory=list)
    left_out: list[str] = field(default_factory=list)
    reversals: list[str] = field(default_factory=list)
    """Where dry friction reverses and the pin forces jump, in words."""
    independence: dict[str, tuple[str, str]] = field(default_factory=dict)
    """engine: (shared with the formulas, found alone)."""
    evidence: dict[str, dict[str, float]] = field(default_factory=dict)
    figure: str | None = None
    """SVG of the answers, or None where there is nothing to draw."""

    def without_rows(self) -> dict[str, Any]:
        """Everything but the rows, which have their own table."""
        kept = asdict(replace(self, rows=[]))
        del kept["rows"]
        return kept

    @classmethod
    def restore(cls, kept: dict[str, Any], rows: list[Row]) -> "Judged":
        """From what `without_rows` gave."""
        timings = [Timing(**timing) for timing in kept["timings"]]
        independence = {engine: (shared, own) for engine, (shared, own) in kept["independence"].items()}
        return cls(**{**kept, "timings": timings, "independence": independence}, rows=rows)

    def joined(self, other: "Judged") -> "Judged":
        """The same scene with the answers of another set of engines; the rows of the formulas stand once."""
        known = set(self.rows)
        return replace(
            self,
            rows=[*self.rows, *(row for row in other.rows if row not in known)],
            timings=[*self.timings, *(timing for timing in other.timings if timing.engine != FORMULAS)],
            left_out=[*self.left_out, *other.left_out],
            independence={**self.independence, **other.independence},
            evidence={**self.evidence, **other.evidence},
        )
