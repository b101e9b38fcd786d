"""`fourbar-validation check SCENE THEIRS.csv`: judge a user's torques and forces."""

import json
import math
from collections import Counter
from collections.abc import Collection, Iterator
from dataclasses import dataclass, replace
from functools import cached_property, partial
from pathlib import Path

import click

from fourbar.errors import (
    FAILED,
    HOLDS,
    LONGEST_MESSAGE,
    InputError,
    abbreviate,
    write_count,
)
from fourbar.files import load
from fourbar.quantities import STAGE_OF, UNITS
from fourbar.scene import Scene
from fourbar.writing import null_nan, require_file, write_text
from fourbar_validation.check.csv_columns import list_names_of_points
from fourbar_validation.check.judge_table import (
    Allowance,
    Discrepancy,
    Judge,
)
from fourbar_validation.check.mistakes import Explanation, explain
from fourbar_validation.check.row_commands import find_steady
from fourbar_validation.check.theirs import TheirTable, Unit, read_table
from fourbar_validation.compare.rows import escape_controls
from fourbar_validation.compare.tolerance import EPS
from fourbar_validation.report.junit import JunitCase, write_document
from fourbar_validation.report.sentences import make_words_table, print_sentence


@dataclass(frozen=True)
class Judgement:
    """All findings, and the known mistakes that would explain them."""

    judge: Judge

    @cached_property
    def explanations(self) -> list[Explanation]:
        """Return the known mistakes that explain what differs."""
        labels = {finding.quantity for finding in self.differing}
        return _explain(self.judge, labels)

    @cached_property
    def table(self) -> TheirTable:
        """Return the table as it was read, with what is to be said of it."""
        table = self.judge.table
        return replace(table, notes=(*table.notes, *self.judge.describe_held()))

    @cached_property
    def findings(self) -> list[Discrepancy]:
        """Return every number that the table states where the formulas have one."""
        return self.judge.findings()

    @cached_property
    def differing(self) -> list[Discrepancy]:
        """Return the findings that do not agree, though digits are left to judge by."""
        return [one for one in self.findings if one.judged and not one.agrees]

    @cached_property
    def not_assembled(self) -> list[int]:
        """Return the lines at which the linkage does not assemble, or is singular.

        There is no right answer there.
        """
        return self.judge.without_answer()

    @property
    def blank(self) -> int:
        """Return how many cells of the judged columns have no number."""
        columns = self.judge.columns.values()
        return sum(int((~column.stated).sum()) for column in columns)

    @property
    def agreeing(self) -> int:
        """Return how many numbers agree."""
        return sum(finding.agrees for finding in self.findings)

    @property
    def exact(self) -> int:
        """Return how many numbers agree to round-off and their printed digits."""
        return sum(finding.exact for finding in self.findings)

    @cached_property
    def not_judged(self) -> int:
        """Return how many numbers have no digit left to judge by."""
        return sum(not finding.judged for finding in self.findings)

    @property
    def compared(self) -> int:
        """Return how many numbers were judged."""
        return len(self.findings) - self.not_judged

    @property
    def agreed_power(self) -> int | None:
        """Power of ten within which all numbers agree, as a part of each.

        The power is None if a tolerance was stated, or if one of them is off by more
        than any table that is right in the digits it has.
        """
        if self.judge.tolerance is not None or not self.differing or self.not_assembled:
            return None
        sizes = [math.hypot(*finding.ours) for finding in self.differing]
        if not all(sizes):
            return None
        worst = max(
            finding.difference / size
            for finding, size in zip(self.differing, sizes, strict=True)
        )
        return math.ceil(math.log10(worst)) if worst <= FEWEST_DIGITS else None

    def describe_unexplained(self) -> str:
        """Say that no mistake explains what differs, or that the angle's digits do."""
        stated, rates = self.judge.stated, self.judge.rows.rates
        judge = Judge(
            self.judge.scene, replace(stated, is_rounded=True), self.judge.tolerance
        )
        if not Judgement(judge).differing:
            rounded = [stated.found_by, *filter(stated.columns.__contains__, rates)]
            within = f"what differs is within half a digit of {', '.join(rounded)}"
            return f"{within}: print more digits there"
        what = "the rest" if self.explanations else "it"
        found = f"no single known mistake explains {what}"
        if self.judge.tolerance is None:
            found += "; of numbers right in fewer digits --rtol may find one"
        return found

    @cached_property
    def not_compared(self) -> list[str]:
        """Name the lines and quantities of which no number has a digit to compare."""
        compared = dict[str, bool]()
        for finding in self.findings:
            for name in (f"line {finding.line}", finding.quantity):
                compared[name] = compared.get(name, False) or finding.judged
        return [name for name, is_compared in compared.items() if not is_compared]

    @property
    def status(self) -> int:
        """Exit status; a row or a column that is not compared is no success."""
        compares = self.compared and not self.not_compared
        if self.differing or self.not_assembled or not compares:
            return FAILED
        return HOLDS

    def sentence(self) -> str:
        """Write how many numbers agree, exactly and within the stated tolerance."""
        tolerance = self.judge.tolerance
        if not self.compared:
            agreed = "Nothing was compared"
        elif tolerance is None:
            agreed = f"{self.agreeing} of {self.compared} numbers agree"
        else:
            within = f"rtol {tolerance.rtol:g}, atol {tolerance.atol:g}"
            agreed = (
                f"{self.agreeing} of {self.compared} numbers agree within {within};"
                f" {self.exact} to round-off"
            )
        if self.digits and tolerance is None:
            agreed += f", compared to {self.digits}"
        if self.not_judged:
            agreed += f"; no digit left to judge {self.not_judged} more by"
        if self.blank:
            cells = len(self.findings) + self.blank
            agreed += f"; {self.blank} of {cells} cells are blank"
        return agreed

    @property
    def digits(self) -> str:
        """Say to how many digits each quantity was compared.

        Of the numbers of a quantity the one with the fewest digits counts.
        """
        fewest: dict[int, list[str]] = {}
        for column in self.judge.columns.values():
            if math.isfinite(most := column.precision):
                digits = math.floor(-math.log10(max(most, EPS)))
                fewest.setdefault(digits, []).append(column.label)
        if len(fewest) == 1:
            (digits,) = fewest
            return write_count(digits, "digit")
        return "; ".join(
            f"{write_count(digits, 'digit')} of {', '.join(names)}"
            for digits, names in sorted(fewest.items())
        )

    def is_explained(self) -> bool:
        """Return whether the explanations account for every quantity that differs."""
        explained = {
            quantity
            for explanation in self.explanations
            for quantity in explanation.quantities
        }
        return explained >= {finding.quantity for finding in self.differing}


def judge_table(
    scene: Scene,
    table: TheirTable,
    tolerance: Allowance | None = None,
) -> Judgement:
    """Judge every number of a table, and find the mistakes that explain what differs.

    The allowed error is K eps/condition, plus half a unit of the last printed digit,
    and of the angle's. A tolerance decides if it is given, and what explains the rest
    is held to it too.
    """
    return Judgement(Judge(scene, table, tolerance))


def _explain(judge: Judge, labels: Collection[str]) -> list[Explanation]:
    """Explain what differs of the quantities of a solution, or else of its motion."""
    columns = {
        key: column for key, column in judge.columns.items() if column.quantity in UNITS
    }
    motion = [key for key in columns if STAGE_OF.get(columns[key].quantity) != "force"]
    for keys in dict.fromkeys((tuple(columns), tuple(motion))):
        table = {key: judge.table.columns[key] for key in keys}
        part = Judge(
            judge.scene,
            replace(judge.table, columns=table),
            judge.tolerance,
            judge.rows,
        )
        wrong = [key for key in sorted(keys) if columns[key].label in labels]
        found = explain(part, [part.columns[key] for key in wrong]) if wrong else []
        if found:
            is_all = len(keys) == len(columns)
            return [one._replace(complete=one.complete and is_all) for one in found]
    return []


def write_judgement_json(judgement: Judgement) -> str:
    """Return one object in SI units: counts, and every number that differs.

    A number that differs is stated as theirs and ours, with what explains it.
    """
    table = judgement.table
    document = {
        "schema": 1,
        "verdict": judgement.sentence(),
        "holds": judgement.status == 0,
        "compared": judgement.compared,
        "agree": judgement.agreeing,
        "agree_to_round_off": judgement.exact,
        "not_judged": judgement.not_judged,
        "blank": judgement.blank,
        "tolerance": judgement.judge.tolerance,
        "found_by": table.found_by,
        "left_out": table.left_out,
        "lines_without_motion": judgement.not_assembled,
        "without_digits": judgement.not_compared,
        "differing": judgement.differing,
        "explanations": judgement.explanations,
    }
    return json.dumps(null_nan(document), indent=1, allow_nan=False) + "\n"


def _list_cases_of_table(judgement: Judgement, name: str) -> Iterator[JunitCase]:
    case = partial(JunitCase, name, name)
    for quantity in dict.fromkeys(each.quantity for each in judgement.findings):
        judged = [
            each
            for each in judgement.findings
            if each.quantity == quantity and each.judged
        ]
        differing = [finding for finding in judged if not finding.agrees]
        if differing:
            worst = max(differing, key=lambda finding: finding.error)
            text = (
                f"{len(differing)} of {len(judged)} differ; line {worst.line}: theirs"
                f" {worst.theirs}, ours {worst.ours} in SI, error {worst.error:.2e},"
                f" allowed {worst.allowed:.2e}"
            )
            yield case(quantity, "failure", "differs", text)
        elif judged:
            yield case(quantity, "passed")
    for name_of_part in judgement.not_compared:
        text = "no number has a digit to compare"
        yield case(name_of_part, "failure", "not compared", text)
    for line in judgement.not_assembled:
        text = "the linkage has no motion there"
        yield case(f"line {line}", "failure", "no motion", text)
    if not judgement.compared:
        text = judgement.sentence()
        yield case("anything is compared", "failure", "nothing compared", text)


MOST_SHOWN_OF_EACH = 3
FEWEST_DIGITS = 1e-4
"""Part of each number by which a table may be off that is right, in fewer digits than
it prints.
"""


@click.command("check")
@click.argument("scene", type=click.Path(path_type=Path))
@click.argument("theirs", type=click.Path(path_type=Path))
@click.option(
    "--rtol",
    type=float,
    metavar="R",
    help="Allow this part of each number too.",
)
@click.option(
    "--atol",
    type=float,
    metavar="A",
    help="Allow this too, in the SI unit of each quantity.",
)
@click.option(
    "--json",
    type=click.Path(path_type=Path, dir_okay=False),
    help="Write it as JSON too.",
)
@click.option(
    "--junit",
    type=click.Path(path_type=Path, dir_okay=False),
    help="Write it as JUnit too.",
)
def check_command(
    scene: Path,
    theirs: Path,
    rtol: float | None,
    atol: float | None,
    json: Path | None,
    junit: Path | None,
) -> int:
    """Judge your own torques and forces.

    THEIRS.csv is a table, whose rows are judged against the formulas.
    `check PROBLEM.json RESULT.json` judges the answers to a problem of models/problems,
    by its levels of accuracy.

    Columns are named as by `fourbar analyze --csv`, whose file is read as it is; a unit
    may follow in brackets: theta_2 [deg], torque [lbf ft], F12_x, F12_y, F43 [kN] (a
    magnitude). A spreadsheet's semicolons, blank cells, thousands separators and lines
    of comments are understood. Half a unit of the last printed digit is allowed; the
    command prints to how many digits the numbers were compared. If --rtol or --atol is
    given, these decide, and the number of exact agreements is printed too. If the scene
    states no speed, each row is judged at its own, say omega_2 and alpha_2. Along a law
    each has the law's at its time, a column beside or without the angle, or its own; at
    one speed a row without an angle is found by its time.

    A row is found by what the scene commands (theta_2, theta_3, theta_4 or a stroke).
    In its place the angle of another bar may stand, if the motion passes it once or the
    rows are the scene's own positions.
    """
    given = {"--rtol": rtol, "--atol": atol, "--json": json, "--junit": junit}
    if scene.suffix == ".json":
        wrong = "is of a table: a problem has its own levels"
        for option, value in given.items():
            if value is not None:
                raise InputError(option, str(value), wrong)
        from fourbar_validation.check.problem import check_problem

        return check_problem(scene, theirs)
    stated = load(scene)
    points = list_names_of_points(stated)
    motion = stated.motion
    law = motion.law or find_steady(stated)
    table = read_table(theirs, motion.commanded, points, law)
    for path in (json, junit):
        if path is not None:
            require_file(path, scene, theirs)
    for option, value in (("--rtol", rtol), ("--atol", atol)):
        if value is not None and not 0.0 <= value < math.inf:
            raise InputError(option, value, "must be a finite number >= 0")
    if rtol is None and atol is None:
        tolerance = None
    else:
        tolerance = Allowance(rtol or 0.0, atol or 0.0)
    table = table.from_pin(stated.origin)
    judgement = judge_table(stated, table, tolerance)
    if json is not None:
        write_text(json, write_judgement_json(judgement))
    if junit is not None:
        cases = _list_cases_of_table(judgement, theirs.name)
        write_text(junit, write_document(judgement.sentence(), cases))
    show_judgement(judgement, theirs.name)
    return judgement.status


def show_judgement(judgement: Judgement, name: str) -> None:
    """Print what differs, what explains it, and the count."""
    table = judgement.table
    for note in table.notes:
        print_sentence(note)
    for why in dict.fromkeys(table.left_out.values()):
        headings = ", ".join(
            heading for heading, reason in table.left_out.items() if reason == why
        )
        print_sentence(abbreviate(f"left out ({why}): {headings}", LONGEST_MESSAGE))
    differing = judgement.differing
    if differing:
        from rich.console import Console
        from rich.markup import escape

        title = (
            f"{escape(escape_controls(name))}: what differs,"
            f" the {MOST_SHOWN_OF_EACH} worst of each quantity"
        )
        units = {one.label: one.unit for one in judgement.judge.columns.values()}
        head = (
            "line",
            f"{table.found_by}\ndeg",
            "quantity",
            "theirs",
            "ours",
            "error",
            "allowed",
        )
        rows = [
            (
                str(each.line),
                f"{math.degrees(each.place):.7g}",
                *_write_in_their_unit(each, units),
                f"{each.error:.1e}",
                f"{each.allowed:.1e}",
            )
            for each in _choose_worst(differing)
        ]
        Console(soft_wrap=True).print(
            make_words_table(
                head,
                rows,
                title=title,
                show_edge=False,
                padding=(0, 1, 0, 0),
            )
        )
        counted = Counter(finding.quantity for finding in differing)
        print_sentence(
            "in all: "
            + ", ".join(f"{count} of {quantity}" for quantity, count in counted.items())
        )
    for line in judgement.not_assembled:
        print_sentence(
            f"line {line}: the linkage has no motion there (it does not assemble, or is"
            " singular)"
        )
    if judgement.not_compared:
        names = ", ".join(judgement.not_compared)
        text = f"no number has a digit to compare, print more digits: {names}"
        print_sentence(abbreviate(text, LONGEST_MESSAGE))
    for explanation in judgement.explanations:
        extent = "everything that differs: " if explanation.complete else ""
        extent += ", ".join(explanation.quantities)
        print_sentence(f"looks like: {explanation.text} (explains {extent})")
    power = judgement.agreed_power
    if differing:
        if not judgement.is_explained():
            print_sentence(judgement.describe_unexplained())
        elif not any(one.complete for one in judgement.explanations):
            print_sentence("these together explain all of it")
    if power is not None:
        within = f"all agree within 1e{power} of each number"
        print_sentence(f"{within}: --rtol 1e{power} judges so")
    print_sentence(judgement.sentence())


def _choose_worst(differing: list[Discrepancy]) -> list[Discrepancy]:
    """Choose the largest differences of each quantity, the worst quantity first."""
    by_quantity: dict[str, list[Discrepancy]] = {}
    for finding in sorted(differing, key=lambda f: -f.error):
        by_quantity.setdefault(finding.quantity, []).append(finding)
    return [
        finding
        for findings in by_quantity.values()
        for finding in findings[:MOST_SHOWN_OF_EACH]
    ]


def _write_in_their_unit(
    finding: Discrepancy, units: dict[str, Unit]
) -> tuple[str, ...]:
    """Write the quantity with the unit of their column, and both numbers in it."""
    unit = units[finding.quantity]
    written = (
        ", ".join(f"{x / unit.factor:.9g}" for x in numbers)
        for numbers in (finding.theirs, finding.ours)
    )
    return f"{finding.quantity} [{escape_controls(unit.text)}]", *written
