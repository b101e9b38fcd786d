"""Points of a study of the cost, of stated errors."""

from fourbar_validation.advise.worst_errors import QUANTITIES, WorstErrors
from fourbar_validation.cost.study import STEPPED, CostPoint


def point(
    steps: float, worst: float, curve: str = "c", kind: str = STEPPED
) -> CostPoint:
    """Return a point with one error of all quantities.

    It takes a microsecond a step.
    """
    errors = WorstErrors(*[worst] * len(QUANTITIES))
    return CostPoint(
        curve,
        kind,
        f"{steps:g} steps a revolution",
        steps,
        int(steps),
        steps,
        errors,
        errors,
        2.0 * steps * 1e-6,
        steps * 1e-6,
        0.03,
    )
