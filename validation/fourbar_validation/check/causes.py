"""List what a model differs in, the worst first: each entry is mended alone, and the error that goes is its share."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from fourbar.quantities import FORCES
from fourbar_validation.check.differences import Difference, Value
from fourbar_validation.compare.rows import Row

MATTERS = 0.005
"""Smallest share of the error of a quantity that is printed; a smaller one is printed as none."""


@dataclass(frozen=True, slots=True)
class Cause:
    """One difference and its share of the error."""

    difference: Difference
    share: float | None = None
    """Share of the error of `quantity` that goes when this entry is mended; None if it was not mended."""
    quantity: str = ""
    gain: float = 0.0
    """Amount by which that error falls, relative to the scale."""

    def percent(self) -> str:
        """Write the share with its quantity."""
        if self.share is None:
            return "-"
        return f"{100.0 * self.share:.0f} % {self.quantity}" if self.share >= MATTERS else "0 %"

    def line(self) -> str:
        """Write the entry, and both values where they are short."""
        d = self.difference
        return f"{d.key}: {write_value(d.theirs)}, generated {write_value(d.generated)}"

    def texts(self) -> list[str]:
        """Say what it is in their file, and what it does."""
        d = self.difference
        return [text for text in (f"in the file: {d.written}" if d.written else "", d.remark) if text]

    def cells(self) -> tuple[str, ...]:
        """Return the cells of a row of the page."""
        d = self.difference
        key = f"{d.key} ({d.written})" if d.written else d.key
        return self.percent(), key, write_value(d.generated), write_value(d.theirs), d.remark


def order_causes(
    differences: Sequence[Difference], before: Sequence[Row], after: Sequence[Sequence[Row]]
) -> list[Cause]:
    """Order differences by their shares, the one whose correction gains most first; the others keep their order.

    `before`: rows of the file as it is.
    `after`: for each difference, rows of the file with that one mended; empty where it was not.
    """
    errors = _collect_errors(before)
    result = []
    for number, difference in enumerate(differences):
        mended = _collect_errors(after[number]) if number < len(after) else {}
        gains = {key: errors[key] - mended[key] for key in errors if key in mended and errors[key] > 0.0}
        if not gains:
            result.append(Cause(difference))
            continue
        key = max(gains, key=lambda each: gains[each])
        share = max(gains[key] / errors[key], 0.0)
        result.append(Cause(difference, share, key[1], max(gains[key], 0.0)))
    return sorted(result, key=lambda cause: (cause.share is None, -cause.gain))


def _collect_errors(rows: Sequence[Row]) -> dict[tuple[str, str], float]:
    """Collect the error of the torque and of each pin force, by method."""
    return {
        (row.engine, row.quantity): row.error for row in rows if row.quantity in FORCES and math.isfinite(row.error)
    }


def write_value(entry: Value) -> str:
    """Numbers with the digits that set them apart, or the word itself."""
    if isinstance(entry, str):
        return entry
    return " ".join(f"{x:.12g}" for x in (entry if isinstance(entry, tuple) else (entry,)))
