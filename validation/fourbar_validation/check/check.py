"""`fourbar-validation check SCENE THEIRS.csv`: judge a user's torques and forces."""

import json
import math
from collections import Counter
from collections.abc import Iterator
from copy import copy
from dataclasses import replace
from functools import cached_property, partial
from pathlib import Path

import click
import numpy as np

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
from fourbar_validation.check.judge_table import (
    Allowance,
    Discrepancy,
    Judge,
)
from fourbar_validation.check.mistakes import Explanation, explain
from fourbar_validation.check.theirs import read_table
from fourbar_validation.compare.rows import escape_controls
from fourbar_validation.compare.tolerance import EPS
from fourbar_validation.report.junit import JunitCase, write_document
from fourbar_validation.report.sentences import make_words_table, print_sentence


class Judgement(Judge):
    """All findings, and the known mistakes that would explain them.

    What is allowed is K eps/condition, plus half a unit of the last printed digit, and
    of the angle's. A tolerance decides if it is given, and what explains the rest is
    held to it too.
    """

    @cached_property
    def explanations(self) -> list[Explanation]:
        """Return the known mistakes that explain what differs.

        All columns are explained at once, or the quantities of a solution, or else its
        motion.
        """
        labels = {finding.quantity for finding in self.differing}
        every = self.columns
        known = [k for k, one in every.items() if one.quantity in UNITS]
        motion = [k for k in known if STAGE_OF.get(every[k].quantity) != "force"]
        if all(one.quantity in UNITS for one in every.values() if one.label in labels):
            known = list(every)  # what is derived and agrees refutes a mistake
        for keys in dict.fromkeys(map(tuple, (every, known, motion))):
            part = copy(self)
            part.columns = {key: every[key] for key in keys}
            wrong = [every[key] for key in sorted(keys) if every[key].label in labels]
            found = explain(part, wrong) if wrong else []
            if found:
                is_all = len(wrong) == len(labels)
                return [one._replace(complete=one.complete and is_all) for one in found]
        return []

    @cached_property
    def differing(self) -> list[Discrepancy]:
        """The findings that do not agree, though digits are left to judge by."""
        return [one for one in self.findings if one.judged and not one.agrees]

    @property
    def blank(self) -> int:
        """How many cells of the judged columns have no number."""
        columns = self.columns.values()
        return sum(int((~column.stated).sum()) for column in columns)

    @property
    def agreeing(self) -> int:
        """How many numbers agree."""
        return sum(finding.agrees for finding in self.findings)

    @property
    def exact(self) -> int:
        """How many numbers agree to round-off and their printed digits."""
        return sum(finding.exact for finding in self.findings)

    @property
    def compared(self) -> int:
        """How many numbers have a digit left to judge by."""
        return sum(finding.judged for finding in self.findings)

    @property
    def agreed_power(self) -> int | None:
        """Power of ten within which all numbers agree, as a part of each.

        The power is None if a tolerance was stated, or if one of them is off by more
        than any table that is right in the digits it has.
        """
        sizes = np.array([math.hypot(*finding.ours) for finding in self.differing])
        if self.tolerance is not None or self.not_assembled or not sizes.all():
            return None
        apart = [finding.difference for finding in self.differing]
        worst = np.max(apart / sizes, initial=0.0)
        return math.ceil(math.log10(worst)) if 0.0 < worst <= FEWEST_DIGITS else None

    def describe_unexplained(self) -> str:
        """Say that no mistake explains what differs, or that the angle's digits do."""
        rounded = replace(self.stated, is_rounded=True)
        if not Judgement(self.scene, rounded, self.tolerance).differing:
            rates = filter(rounded.columns.__contains__, self.rows.rates)
            names = ", ".join([rounded.found_by, *rates])
            within = f"what differs is within half a digit of {names}"
            return f"{within}: print more digits there"
        what = "the rest" if self.explanations else "it"
        found = f"no single known mistake explains {what}"
        if self.tolerance is None:
            found += "; of numbers right in fewer digits --rtol may find one"
        return found

    @cached_property
    def not_compared(self) -> list[str]:
        """Names of the lines and quantities of which no number has a digit.

        A line whose right numbers have none, as at a change point, is not among them.
        """
        compared = dict[str, bool]()
        for finding in self.findings:
            hopeless = math.isinf(finding.allowed)
            for name, is_compared in (
                (f"line {finding.line}", finding.judged or hopeless),
                (finding.quantity, finding.judged),
            ):
                compared[name] = compared.get(name, False) or is_compared
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
        if not self.compared:
            agreed = "Nothing was compared"
        else:
            agreed = f"{self.agreeing} of {self.compared} numbers agree"
        if self.tolerance is None:
            agreed += f", compared to {self.digits}" if self.digits else ""
        elif self.compared:
            rtol, atol = self.tolerance
            agreed += f" within rtol {rtol:g}, atol {atol:g}; {self.exact} to round-off"
        if not_judged := len(self.findings) - self.compared:
            agreed += f"; no digit left to judge {not_judged} more by"
        if self.blank:
            cells = len(self.findings) + self.blank
            agreed += f"; {self.blank} of {cells} cells are blank"
        return agreed

    @property
    def digits(self) -> str:
        """To how many digits each quantity was compared.

        Of the numbers of a quantity the one with the fewest digits counts.
        """
        fewest: dict[int, list[str]] = {}
        for column in self.columns.values():
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
        "not_judged": len(judgement.findings) - judgement.compared,
        "blank": judgement.blank,
        "tolerance": judgement.tolerance,
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
    judged = [each for each in judgement.findings if each.judged]
    counts = Counter(each.quantity for each in judged)
    worst = {each.quantity: each for each in _sort_differing(judgement)[::-1]}
    differing = Counter(each.quantity for each in judgement.differing)
    for quantity, count in counts.items():
        if quantity in worst:
            each = worst[quantity]
            text = (
                f"{differing[quantity]} of {count} differ; line {each.line}: theirs"
                f" {each.theirs}, ours {each.ours} in SI, error {each.error:.2e},"
                f" allowed {each.allowed:.2e}"
            )
            yield case(quantity, "failure", "differs", text)
        else:
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


def _sort_differing(judgement: Judgement) -> list[Discrepancy]:
    """Sort what differs, the largest error first."""
    return sorted(judgement.differing, key=lambda each: -each.error)


MOST_SHOWN_OF_EACH = 3
FEWEST_DIGITS = 1e-4
"""Part of each number by which a table may be off that is right, in fewer digits than
it prints.
"""


def list_names_of_points(scene: Scene) -> list[str]:
    """List the columns of the points of a scene."""
    return [
        f"{start}{point.name}" for start in ("", "v_", "a_") for point in scene.points
    ]


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
    may follow in brackets or after " / ": theta_2 [deg], torque [lbf ft], F12_x, F12_y,
    F43 [kN] (a magnitude). A spreadsheet's semicolons, blank cells, thousands
    separators and lines of comments are understood. Half a unit of the last printed
    digit is allowed; the command prints to how many digits the numbers were compared.
    If --rtol or --atol is given, these decide, and the number of exact agreements is
    printed too. If the scene states no speed, each row is judged at its own, say
    omega_2 and alpha_2. Along a law each has the law's at its time, a column beside or
    without the angle, or its own; at one speed a row without an angle is found by its
    time.

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
    table = read_table(theirs, stated.motion.commanded, points)
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
    try:
        judgement = Judgement(stated, table, tolerance)
    except InputError as error:
        is_theirs = error.key.startswith(("line ", "table", "header"))
        raise error.in_file(str(theirs if is_theirs else scene)) from None
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
    for note in (*table.notes, *judgement.describe_held()):
        print_sentence(note)
    for why in dict.fromkeys(table.left_out.values()):
        headings = [one for one, reason in table.left_out.items() if reason == why]
        text = f"left out ({why}): {', '.join(headings)}"
        print_sentence(abbreviate(text, LONGEST_MESSAGE))
    differing = judgement.differing
    if differing:
        _show_differing(judgement, name)
        counted = Counter(finding.quantity for finding in differing)
        counts = (f"{count} of {quantity}" for quantity, count in counted.items())
        print_sentence(f"in all: {', '.join(counts)}")
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
        explained = {one for each in judgement.explanations for one in each.quantities}
        if not explained.issuperset(counted):
            print_sentence(judgement.describe_unexplained())
        elif not any(one.complete for one in judgement.explanations):
            print_sentence("these together explain all of it")
    if power is not None:
        within = f"all agree within 1e{power} of each number"
        print_sentence(f"{within}: --rtol 1e{power} judges so")
    print_sentence(judgement.sentence())


def _show_differing(judgement: Judgement, name: str) -> None:
    """Print the largest differences of each quantity, the worst quantity first.

    Numbers are in the unit of their column.
    """
    from rich.console import Console
    from rich.markup import escape

    units = {one.label: one.unit for one in judgement.columns.values()}
    rows: dict[str, list[tuple[str, ...]]] = {}
    for each in _sort_differing(judgement):
        unit = units[each.quantity]
        theirs, ours = (
            ", ".join(f"{x / unit.factor:.9g}" for x in numbers)
            for numbers in (each.theirs, each.ours)
        )
        row = (
            str(each.line),
            f"{math.degrees(each.place):.7g}",
            f"{each.quantity} [{escape_controls(unit.text)}]",
            theirs,
            ours,
            f"{each.error:.1e}",
            f"{each.allowed:.1e}",
        )
        rows.setdefault(each.quantity, []).append(row)
    angle = f"{judgement.table.found_by}\ndeg"
    head = ("line", angle, "quantity", "theirs", "ours", "error", "allowed")
    title = (
        f"{escape(escape_controls(name))}: what differs,"
        f" the {MOST_SHOWN_OF_EACH} worst of each quantity"
    )
    shown = [row for several in rows.values() for row in several[:MOST_SHOWN_OF_EACH]]
    table = make_words_table(
        head, shown, title=title, show_edge=False, padding=(0, 1, 0, 0)
    )
    Console(soft_wrap=True).print(table)
