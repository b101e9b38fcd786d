"""Printed figures, ours beside them, and what the named errata make of ours."""

import csv
import tomllib
from collections.abc import Iterator
from decimal import ROUND_DOWN, ROUND_HALF_EVEN, Decimal
from pathlib import Path
from typing import NamedTuple

FOLDER = Path(__file__).parent
FIGURE_VERDICTS = ("rounded", "truncated", "differs")
POSITIONS = "2.4 positions"


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


class PrintedFigure(NamedTuple):
    """Digits as printed, and the errata that lead from ours to them, as they are made.

    The errata are named by their ids.
    """

    printed: str
    errata: tuple[str, ...] = ()
    noise: float = 0.0
    """Round-off of whoever printed 15 digits or more, in the unit printed."""


def read_printed() -> dict[str, dict[str, PrintedFigure]]:
    """Read the figures of the thesis and of a Maple worksheet, by table and name."""
    tables: dict[str, dict[str, PrintedFigure]] = {POSITIONS: {}}
    for pair in (("theta3_1", "theta4_2"), ("theta3_2", "theta4_1")):
        for row in _read_rows("positions.csv"):
            for name in pair:
                place = f"{row['theta2_deg']} {name}"
                made = ("6",) if place == "136 theta3_1" else ()
                tables[POSITIONS][place] = PrintedFigure(row[f"{name}_deg"], made)
    for row in _read_rows("figures.csv"):
        errata = tuple(row["errata"].split())
        figure = PrintedFigure(row["printed"], errata, float(row["noise"] or 0.0))
        tables.setdefault(row["table"], {})[row["name"]] = figure
    return tables


def _read_rows(name: str) -> Iterator[dict[str, str]]:
    text = (FOLDER / "data" / name).read_text(encoding="utf-8")
    yield from csv.DictReader(text.splitlines())


class PublishedFigure(NamedTuple):
    """One printed figure and ours, in the unit printed."""

    table: str
    name: str
    printed: str
    ours: float
    errata: tuple[str, ...] = ()
    """Ids of the errata that lead from ours to what is printed, in the order in which
    they are made.
    """
    made: float | None = None
    """Ours after those of these errata that can be computed."""
    noise: float = 0.0
    """Round-off of whoever printed 15 digits or more, in the unit printed."""

    def verdict(self) -> str:
        """Return "rounded", "truncated" or "differs": ours against the printed."""
        return compare_figure(self.printed, self.ours, self.noise)

    def reproduced(self) -> bool:
        """Tell whether the errata give the published digits, rounded or truncated."""
        return (
            self.made is not None
            and compare_figure(self.printed, self.made, self.noise) != "differs"
        )


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
