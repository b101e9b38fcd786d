"""Printed figures, ours beside them, and what the named errata make of ours."""

import csv
import math
import tomllib
from collections.abc import Iterator
from decimal import ROUND_DOWN, ROUND_HALF_EVEN, Decimal
from pathlib import Path
from typing import Any, NamedTuple

FOLDER = Path(__file__).parent
FIGURE_VERDICTS = ("rounded", "truncated", "differs")


def _read(name: str) -> str:
    return (FOLDER / name).read_text(encoding="utf-8")


_ENTRIES = tomllib.loads(_read("errata.toml"))["erratum"]
ERRATA: dict[str, dict[str, Any]] = {entry["id"]: entry for entry in _ENTRIES}
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
    quantity: str = ""
    """What is printed: a result of ours, or the sum of several."""
    scene: str = ""
    """Scene of `models/textbook` that has the result; empty for the thesis."""
    position: int = 0
    where: str = ""
    """Address of a public test case."""
    note: str = ""

    def verdict(self) -> str:
        """Return "rounded", "truncated" or "differs": ours against the printed."""
        return compare_figure(self.printed, self.ours, self.noise)


def read_printed() -> Iterator[PublishedFigure]:
    """Read the figures of the thesis, a Maple worksheet and public test cases."""
    for row in _read_rows("positions.csv"):
        for name in ("theta3_1", "theta4_2", "theta3_2", "theta4_1"):
            place = f"{row['theta2_deg']} {name}"
            errata = ("6",) if place == "136 theta3_1" else ()
            yield PublishedFigure(
                "2.4 positions",
                place,
                row[f"{name}_deg"],
                errata=errata,
                quantity=f"{name}_deg",
                position=int(row["theta2_deg"]),
            )
    for row in _read_rows("figures.csv"):
        errata = tuple(row["errata"].split())
        numbers = {"noise": float(row["noise"]), "position": int(row["position"])}
        yield PublishedFigure(**row | numbers | {"errata": errata})
    for answer in tomllib.loads(_read("textbook.toml"))["answer"]:
        name = f"{answer['scene']} {answer['quantity']}"
        yield PublishedFigure("public test cases", name, **answer)


def _read_rows(name: str) -> Iterator[dict[str, Any]]:
    yield from csv.DictReader(_read(f"data/{name}").splitlines())


def compare_figure(printed: str, value: float, noise: float) -> str:
    """Return "rounded", "truncated" or "differs", at the printed decimals."""
    theirs = Decimal(printed)
    ours = Decimal(value)
    if abs(ours - theirs) <= Decimal(noise):
        return "rounded"
    for verdict, mode in (("rounded", ROUND_HALF_EVEN), ("truncated", ROUND_DOWN)):
        if ours.quantize(theirs, mode) == theirs:
            return verdict
    return "differs"
