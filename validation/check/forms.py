"""A judgement as JSON and as JUnit XML."""

import json
import math
from collections.abc import Iterator
from dataclasses import asdict
from typing import TYPE_CHECKING

from validation.check.theirs import Table
from validation.report.junit import Case, document

if TYPE_CHECKING:
    from validation.check.check import Judgement


def as_json(judgement: "Judgement", table: Table) -> str:
    """One object in SI: the counts, every number that differs with theirs and ours, and what explains it."""
    tolerance = judgement.tolerance
    found = {
        "schema": 1,
        "verdict": judgement.sentence(),
        "holds": judgement.status == 0,
        "compared": judgement.compared,
        "agree": judgement.agreeing,
        "agree_to_round_off": judgement.exact,
        "not_judged": judgement.not_judged,
        "tolerance": None if tolerance is None else asdict(tolerance),
        "left_out": table.left_out,
        "lines_without_motion": judgement.not_assembled,
        "differing": [
            {name: value if _is_json(value) else None for name, value in asdict(finding).items()}
            for finding in judgement.differing
        ],
        "explanations": [asdict(explanation) for explanation in judgement.explanations],
    }
    return json.dumps(found, indent=1, allow_nan=False) + "\n"


def _is_json(value: object) -> bool:
    return not isinstance(value, float) or math.isfinite(value)


def junit(judgement: "Judgement", name: str) -> str:
    """One case per quantity: a failure where any of its numbers differs, skipped where none could be judged."""
    return document(judgement.sentence(), _cases(judgement, name))


def _cases(judgement: "Judgement", name: str) -> Iterator[Case]:
    by_quantity = {quantity: [f for f in judgement.findings if f.quantity == quantity] for quantity in
                   dict.fromkeys(f.quantity for f in judgement.findings)}  # fmt: skip
    for quantity, findings in by_quantity.items():
        judged = [finding for finding in findings if finding.judged]
        differing = [finding for finding in judged if not finding.agrees]
        if differing:
            worst = max(differing, key=lambda finding: finding.error)
            text = f"{len(differing)} of {len(judged)} differ; line {worst.line}: theirs {worst.theirs}, ours "
            text += f"{worst.ours} in SI, error {worst.error:.2e}, allowed {worst.allowed:.2e}"
            yield Case(name, name, quantity, "failure", "differs", text)
        else:
            skipped = "no digit is left to judge by"
            yield Case(name, name, quantity, *(("passed",) if judged else ("skipped", "not judged", skipped)))
    for line in judgement.not_assembled:
        yield Case(name, name, f"line {line}", "failure", "no motion", "the linkage has no motion there")
    if not judgement.compared:
        yield Case(name, name, "anything is compared", "failure", "nothing compared", judgement.sentence())
