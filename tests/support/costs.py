"""Points of a study of the cost, of stated errors."""

from fourbar_validation.advise.matters import ERROR_NAMES, WorstErrors
from fourbar_validation.cost.work_precision import STEPPED_MOTION, CostPoint


def point(steps, worst, curve="c"):
    """Return a point with one error of all quantities and a microsecond a step."""
    errors = WorstErrors(*[worst] * len(ERROR_NAMES))
    return CostPoint(
        curve,
        STEPPED_MOTION,
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
