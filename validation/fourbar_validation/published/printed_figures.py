"""Printed figures, ours beside them, and what the named errata make of ours."""

import csv
import math
import tomllib
from collections.abc import Iterator
from decimal import ROUND_DOWN, ROUND_HALF_EVEN, Decimal
from pathlib import Path
from typing import NamedTuple

FOLDER = Path(__file__).parent
FIGURE_VERDICTS = ("rounded", "truncated", "differs")


class Erratum(NamedTuple):
    """One error of a source."""

    id: str
    where: str
    title: str
    printed: str
    right: str
    derivation: str
    effect: str
    reproduced: bool = True
    """True if making the error gives the printed digits."""
    transcription: bool = False
    """True if it may be a slip of the transcription that was read."""


_FILE = tomllib.loads((FOLDER / "errata.toml").read_text(encoding="utf-8"))
ERRATA = {entry["id"]: Erratum(**entry) for entry in _FILE["erratum"]}
"""The errata of the sources, as data: `errata.toml` says what each field is."""


class PublishedFigure(NamedTuple):
    """One printed figure and ours, in the unit printed."""

    table: str
    name: str
    printed: str
    ours: float = math.nan
    errata: tuple[str, ...] = ()
    """Ids of the errata that lead from ours to what is printed, in the order in which
    they are made.
    """
    made: float = math.nan
    """Ours after those of these errata that can be computed."""
    noise: float = 0.0
    """Round-off of whoever printed 15 digits or more, in the unit printed."""

    def verdict(self) -> str:
        """Return "rounded", "truncated" or "differs": ours against the printed."""
        return compare_figure(self.printed, self.ours, self.noise)

    def reproduced(self) -> bool:
        """Tell whether the errata give the published digits, rounded or truncated."""
        return compare_figure(self.printed, self.made, self.noise) != "differs"

    def explained(self) -> bool:
        """Tell whether the errata account for a difference.

        A misprint that no erratum can give is accounted for too.
        """
        known = all(ERRATA[name].reproduced for name in self.errata)
        return bool(self.errata) and (self.reproduced() or not known)


def read_printed() -> Iterator[PublishedFigure]:
    """Read the figures of the thesis and of a Maple worksheet, without ours."""
    for row in _read_rows("positions.csv"):
        for name in ("theta3_1", "theta4_2", "theta3_2", "theta4_1"):
            place = f"{row['theta2_deg']} {name}"
            errata = ("6",) if place == "136 theta3_1" else ()
            printed = row[f"{name}_deg"]
            yield PublishedFigure("2.4 positions", place, printed, errata=errata)
    for row in _read_rows("figures.csv"):
        yield PublishedFigure(
            row["table"],
            row["name"],
            row["printed"],
            errata=tuple(row["errata"].split()),
            noise=float(row["noise"] or 0.0),
        )


def _read_rows(name: str) -> Iterator[dict[str, str]]:
    text = (FOLDER / "data" / name).read_text(encoding="utf-8")
    yield from csv.DictReader(text.splitlines())


def compare_figure(printed: str, value: float, noise: float) -> str:
    """Return "rounded", "truncated" or "differs", at the printed decimals."""
    theirs = Decimal(printed)
    ours = Decimal(value)
    unit = Decimal(1).scaleb(int(theirs.as_tuple().exponent))
    if ours.quantize(unit, ROUND_HALF_EVEN) == theirs:
        return "rounded"
    if abs(ours - theirs) <= Decimal(noise):
        return "rounded"
    if ours.quantize(unit, ROUND_DOWN) == theirs:
        return "truncated"
    return "differs"
