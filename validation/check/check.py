"""`python -m validation check SCENE THEIRS.csv`: judge a user's own torques and forces."""

import math
from dataclasses import dataclass
from pathlib import Path

import click
import numpy as np

from fourbar.errors import FAILED, HOLDS, InputError
from fourbar.files import load
from fourbar.quantities import OK
from fourbar.scene import Command, Scene, command
from fourbar.solve import solve
from validation.check.mistakes import NEARER, Explanation, explain
from validation.check.theirs import Array, Table, read_table
from validation.compare.error import difference, in_own_unit, magnitude, relative, relative_error
from validation.compare.plain import plain
from validation.compare.scales import yardstick
from validation.compare.tolerance import EPS, EQUIVALENCE, NOTHING_TO_TELL, condition_of

SHOWN = 20


@dataclass(frozen=True, slots=True)
class Finding:
    """One quantity at one position of the user's table."""

    line: int
    """In the user's file."""
    quantity: str
    error: float
    allowed: float
    theta_2: float

    @property
    def told(self) -> bool:
        """Whether any digit is left by which it can be judged."""
        return self.allowed != math.inf

    @property
    def agrees(self) -> bool:
        """Whether it is within what is allowed."""
        return self.told and self.error <= self.allowed


@dataclass(frozen=True, slots=True)
class Judgement:
    """All findings, and the known mistakes that would explain them."""

    findings: list[Finding]
    not_assembled: list[int]
    """Lines at which this linkage does not assemble, or is singular: there is no right answer there."""
    explanations: list[Explanation]

    @property
    def differing(self) -> list[Finding]:
        """The findings that do not agree, though there are digits to tell by."""
        return [finding for finding in self.findings if finding.told and not finding.agrees]

    @property
    def agreeing(self) -> int:
        """How many numbers agree."""
        return sum(finding.agrees for finding in self.findings)

    @property
    def untold(self) -> int:
        """How many numbers nothing can be told of."""
        return sum(not finding.told for finding in self.findings)


def judge_table(scene: Scene, table: Table) -> Judgement:
    """Judge every number by K eps/condition plus half a unit of its last printed digit, and of theta_2's."""
    base = command(scene)
    if np.ndim(base.omega_2 or 0.0) or np.ndim(base.alpha_2):
        raise InputError("motion.law", scene.title, "a table is judged at one omega_2 and alpha_2, not along a law")
    if scene.motion.free is not None:
        raise InputError("motion.free", scene.title, "a table is judged at one omega_2 and alpha_2, not while released")
    branch = np.full(len(table.theta_2), scene.motion.branch, dtype=np.int8)
    at = Command(table.theta_2, branch, base.omega_2, base.alpha_2)
    right = solve(scene, "position" if at.omega_2 is None else "force", at=at)
    ok = right.status_code == OK
    beside = []  # the same half a unit of a rounded theta_2 away
    if table.theta_2_rounding.any():
        for shift in (-table.theta_2_rounding, table.theta_2_rounding):
            moved = at._replace(theta_2=at.theta_2 + shift)
            beside.append(solve(scene, "position" if at.omega_2 is None else "force", at=moved))

    def judged(quantity: str, ours: Array, theirs: Array) -> tuple[Array, Array]:
        yard = yardstick(quantity, scene, right, getattr(right, quantity))
        scale = in_own_unit(yard)  # what all its terms leave 0
        theirs = np.where(np.isnan(theirs), ours, theirs)  # a component that their table does not have
        error = relative_error(quantity, ours, theirs, scale)
        condition = condition_of(quantity, scene.linkage, right)
        # what a mistake would have printed is rounded at its own size, however much larger
        size = np.nanmax(magnitude(ours)[ok], initial=0.0) if not quantity.startswith("theta") else 0.0
        there = getattr(right, quantity)
        larger = 1.0 if ours is there else np.maximum(size / scale, 1.0)
        moves = [difference(quantity, there, getattr(other, quantity)) for other in beside]
        spread = relative(np.fmax.reduce(moves), scale) if moves else 0.0
        exact = np.where(yard == 0.0, 0.0, EQUIVALENCE.allowed(condition))
        allowed = (exact + spread) * larger + relative(table.rounding[quantity], scale)
        return error[ok], np.where(condition * NOTHING_TO_TELL > EPS, allowed, np.inf)[ok]

    findings = []
    for quantity, theirs in table.values.items():
        ours = getattr(right, quantity)
        if ours is None:
            if at.omega_2 is None:
                raise InputError("motion.omega_2", None, f"is needed in the scene to judge {quantity}")
            raise InputError("header", quantity, "does not exist in this scene: it has no dry friction")
        error, allowed = judged(quantity, ours, theirs)
        label = table.label(quantity)
        for index, e, most in zip(np.flatnonzero(ok).tolist(), error.tolist(), allowed.tolist(), strict=True):
            findings.append(Finding(table.lines[index], label, e, most, float(table.theta_2[index])))
    found = {finding.quantity for finding in findings if finding.told and not finding.agrees}
    differing = sorted(quantity for quantity in table.values if table.label(quantity) in found)
    known = explain(table, scene, at, right, differing, judged) if differing else []
    return Judgement(findings, [table.lines[index] for index in np.flatnonzero(~ok)], known)


def said(explanation: Explanation) -> str:
    """How far a mistake explains what differs."""
    if explanation.complete:
        return "explains everything that differs: " + ", ".join(explanation.quantities)
    parts = []
    if explanation.quantities:
        parts.append("explains " + ", ".join(explanation.quantities))
    if explanation.nearer:
        parts.append(", ".join(explanation.nearer) + f" then at least {NEARER:g} times nearer")
    return "; ".join(parts)


@click.command()
@click.argument("scene", type=click.Path(path_type=Path))
@click.argument("theirs", type=click.Path(path_type=Path))
def check(scene: Path, theirs: Path) -> int:
    """Judge a table of torques and forces (THEIRS.csv) against the formulas, row by row.

    Columns are named as by `fourbar analyze --csv`; a unit may follow in brackets:
    theta_2 [deg], torque [N cm], F12_x, F12_y. Half a unit of the last printed digit is allowed.
    """
    from rich.console import Console
    from rich.markup import escape
    from rich.table import Table as Shown

    judgement = judge_table(load(scene), read_table(theirs))
    console = Console(soft_wrap=True)
    differing = judgement.differing
    if differing:
        shown = Shown(title=f"{escape(plain(theirs.name))}: what differs, worst first")
        for heading in ("line", "theta_2 [deg]", "quantity", "error", "allowed"):
            shown.add_column(heading, justify="right")
        for finding in sorted(differing, key=lambda f: -f.error)[:SHOWN]:
            degrees = f"{math.degrees(finding.theta_2):.4f}"
            numbers = (f"{finding.error:.2e}", f"{finding.allowed:.2e}")
            shown.add_row(str(finding.line), degrees, finding.quantity, *numbers)
        console.print(shown)
    for line in judgement.not_assembled:
        console.print(f"line {line}: the linkage has no motion there (it does not assemble, or is singular)")
    for explanation in judgement.explanations:
        console.print(f"looks like: {escape(explanation.text)} ({said(explanation)})")
    if differing and not any(explanation.complete for explanation in judgement.explanations):
        console.print("no single known mistake explains all of it")
    count = len(judgement.findings) - judgement.untold
    apart = f"; nothing can be told of {judgement.untold} more" if judgement.untold else ""
    told = f"{judgement.agreeing} of {count} numbers agree" if count else "Nothing was compared"
    console.print(f"[bold]{told}{apart}[/]")
    return FAILED if differing or judgement.not_assembled or not count else HOLDS
