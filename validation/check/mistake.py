"""A mistake as a hypothesis: what was done, and what it turns the right numbers into."""

from collections.abc import Callable
from dataclasses import dataclass

from fourbar.solution import Solution
from validation.check.theirs import Array, quantity_of
from validation.compare.error import magnitude


@dataclass(frozen=True, slots=True)
class Mistake:
    """What was done, and what would have been printed."""

    text: str
    predict: Callable[[str, Solution], Array | None]
    """quantity, right solution -> what would have been printed; None where it changes nothing of it."""
    whole: bool = True
    """Whether it was made in the calculation, and so shows in every quantity; a column's unit shows in its own."""
    times: float = 1.0
    """Of what is allowed: a number that was fitted to rounded ones carries their rounding once more."""

    def prediction(self, key: str, right: Solution) -> Array | None:
        """For a key of the table."""
        predicted = self.predict(quantity_of(key), right)
        return magnitude(predicted) if predicted is not None and key.startswith("|") else predicted
