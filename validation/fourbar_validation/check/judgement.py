"""A whole table judged: how many numbers agree, what explains the others; and that as JSON and as JUnit XML."""

import json
import math
from collections.abc import Iterator
from dataclasses import asdict, dataclass

from fourbar.errors import FAILED, HOLDS
from fourbar.scene import Scene
from fourbar_validation.check.judge import Allowance, Discrepancy, Judge
from fourbar_validation.check.mistakes import Explanation, explain
from fourbar_validation.check.theirs import TheirTable
from fourbar_validation.report.junit import JunitCase, write_document


@dataclass(frozen=True, slots=True)
class Judgement:
    """All findings, and the known mistakes that would explain them."""

    findings: list[Discrepancy]
    not_assembled: list[int]
    """Lines at which this linkage does not assemble, or is singular: there is no right answer there."""
    explanations: list[Explanation]
    tolerance: Allowance | None = None

    @property
    def differing(self) -> list[Discrepancy]:
        """Return the findings that do not agree, though there are digits to judge by."""
        return [finding for finding in self.findings if finding.judged and not finding.agrees]

    @property
    def agreeing(self) -> int:
        """Return how many numbers agree."""
        return sum(finding.agrees for finding in self.findings)

    @property
    def exact(self) -> int:
        """Return how many numbers agree to round-off and their printed digits."""
        return sum(finding.exact for finding in self.findings)

    @property
    def not_judged(self) -> int:
        """Return how many numbers have no digit left to judge by."""
        return sum(not finding.judged for finding in self.findings)

    @property
    def compared(self) -> int:
        """Return how many numbers were judged."""
        return len(self.findings) - self.not_judged

    @property
    def status(self) -> int:
        """Exit status; nothing compared is no success."""
        return FAILED if self.differing or self.not_assembled or not self.compared else HOLDS

    def sentence(self) -> str:
        """Write how many numbers agree, exactly and within the stated tolerance."""
        if not self.compared:
            agreed = "Nothing was compared"
        elif self.tolerance is None:
            agreed = f"{self.agreeing} of {self.compared} numbers agree"
        else:
            within = f"rtol {self.tolerance.rtol:g}, atol {self.tolerance.atol:g}"
            agreed = f"{self.agreeing} of {self.compared} numbers agree within {within}; {self.exact} to round-off"
        return agreed + (f"; no digit left to judge {self.not_judged} more by" if self.not_judged else "")

    def together(self) -> bool:
        """Return whether the explanations together account for every quantity that differs."""
        explained = {quantity for explanation in self.explanations for quantity in explanation.quantities}
        return explained >= {finding.quantity for finding in self.differing}


def judge_table(scene: Scene, table: TheirTable, tolerance: Allowance | None = None) -> Judgement:
    """Judge every number by K eps/condition plus half a unit of its last printed digit, and of theta_2's.

    With a tolerance that decides, and what explains the rest is held to it too.
    """
    judge = Judge(scene, table, tolerance)
    findings = judge.findings()
    result = {finding.quantity for finding in findings if finding.judged and not finding.agrees}
    differing = sorted(key for key in table.values if table.label(key) in result)
    known = explain(judge, differing) if differing else []
    return Judgement(findings, judge.without_answer(), known, tolerance)


def write_json(judgement: Judgement, table: TheirTable) -> str:
    """Return one object in SI: the counts, every number that differs with theirs and ours, and what explains it."""
    tolerance = judgement.tolerance
    result = {
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
            {name: None if isinstance(x, float) and not math.isfinite(x) else x for name, x in asdict(finding).items()}
            for finding in judgement.differing
        ],
        "explanations": [asdict(explanation) for explanation in judgement.explanations],
    }
    return json.dumps(result, indent=1, allow_nan=False) + "\n"


def write_junit(judgement: Judgement, name: str) -> str:
    """Return one case per quantity: a failure if any of its numbers differs, skipped if none could be judged."""
    return write_document(judgement.sentence(), _list_cases(judgement, name))


def _list_cases(judgement: Judgement, name: str) -> Iterator[JunitCase]:
    by_quantity = {quantity: [f for f in judgement.findings if f.quantity == quantity] for quantity in
                   dict.fromkeys(f.quantity for f in judgement.findings)}  # fmt: skip
    for quantity, findings in by_quantity.items():
        judged = [finding for finding in findings if finding.judged]
        differing = [finding for finding in judged if not finding.agrees]
        if differing:
            worst = max(differing, key=lambda finding: finding.error)
            text = f"{len(differing)} of {len(judged)} differ; line {worst.line}: theirs {worst.theirs}, ours "
            text += f"{worst.ours} in SI, error {worst.error:.2e}, allowed {worst.allowed:.2e}"
            yield JunitCase(name, name, quantity, "failure", "differs", text)
        else:
            skipped = "no digit is left to judge by"
            yield JunitCase(name, name, quantity, *(("passed",) if judged else ("skipped", "not judged", skipped)))
    for line in judgement.not_assembled:
        yield JunitCase(name, name, f"line {line}", "failure", "no motion", "the linkage has no motion there")
    if not judgement.compared:
        yield JunitCase(name, name, "anything is compared", "failure", "nothing compared", judgement.sentence())
