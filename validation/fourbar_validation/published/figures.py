"""A printed figure, ours, and what the named errata make of ours."""

import tomllib
from collections.abc import Mapping
from decimal import ROUND_DOWN, ROUND_HALF_EVEN, Decimal
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple

FIGURE_VERDICTS = ("rounded", "truncated", "differs")


class _Erratum(NamedTuple):
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


LISTED_ERRATA = tomllib.loads(
    (Path(__file__).parent / "errata.toml").read_text(encoding="utf-8")
)["erratum"]
ERRATA = {entry["id"]: _Erratum(**entry) for entry in LISTED_ERRATA}
"""The errata of the sources, as data: `errata.toml` says what each field is."""


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
    """Ours after these errata; None where they cannot be computed."""
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


Slips = dict[str, tuple[tuple[str, ...], float | None]]
"""Figures that errata touch, by name: the errata, and ours after them."""
_NONE: Mapping[str, Any] = MappingProxyType({})


def compare_table(
    table: str,
    printed: Mapping[str, str],
    ours: Mapping[str, float],
    slips: Mapping[str, Any] = _NONE,
    noise: Mapping[str, float] = _NONE,
) -> list[PublishedFigure]:
    """Put ours beside the figures of a printed table, by their names."""
    figures = []
    for name, text in printed.items():
        figure = PublishedFigure(table, name, text, ours[name], *slips.get(name, ()))
        figures.append(figure._replace(noise=noise.get(name, 0.0)))
    return figures


def compare_figure(
    printed: str,
    value: float,
    noise: float = 0.0,
) -> str:
    """Return "rounded", "truncated" or "differs", at the printed decimals."""
    theirs = Decimal(printed)
    ours = Decimal(value)
    unit = Decimal(1).scaleb(int(theirs.as_tuple().exponent))
    if ours.quantize(unit, ROUND_HALF_EVEN) == theirs or abs(ours - theirs) <= Decimal(
        noise
    ):
        return "rounded"
    if ours.quantize(unit, ROUND_DOWN) == theirs:
        return "truncated"
    return "differs"
