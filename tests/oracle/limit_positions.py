"""Check the range of each bar: the loop closes inside it and not beyond.

At a limit the bar is at rest.

The loop is a sum of vectors, d u_1 = a u_2 + b u_3 - c u_4, and any moving bar may come
first in it: an engine that turns bar 2 alone is given the linkage with bar k in that
place. The distance that the other two bars have to span grows steadily while bar k
turns from the ground's direction to the opposite one, so the answers beyond and on the
limits and along the ground settle every angle.
"""

import itertools
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from fractions import Fraction
from typing import NamedTuple

import numpy as np

from fourbar.errors import LimitError
from fourbar.formulas import mobility
from fourbar.formulas.mobility import TURN
from fourbar.linkage import MOVING_BARS, FourBar, copy_with, uniform
from fourbar.quantities import FORCE_NAMES, UNKNOWNS, Array
from fourbar.scene import Command, Scene, find_signs
from fourbar.scene.motion import Motion
from fourbar_validation.compare.answer import Adapter, Answer
from fourbar_validation.compare.rows import Row
from fourbar_validation.compare.tolerance import (
    EPS,
    EQUIVALENCE,
    NOTHING_TO_TELL,
    TOUCHING_MARGIN,
    Mask,
    compute_closing_margin,
    count_half_turns,
    find_lever,
    find_roundoff,
    find_used,
    wrap_difference,
)

LimitPlace = tuple[float, int]
"""theta_2 (rad) and branch."""
Seen = Mapping[LimitPlace, Mapping[str, float]]
"""Values that an engine finds at some places."""
_OF_BARS = [name for name in UNKNOWNS if name not in FORCE_NAMES]


class Finding(NamedTuple):
    """Error of a statement against the engine, and the allowed error.

    The error is in rad, or the number of wrong answers.
    """

    error: float
    allowed: float
    theta_2: float
    what: str


def make_worst_row(
    name: str,
    answer: Answer,
    quantity: str,
    findings: Sequence[Finding],
) -> Row:
    """Make the row of the finding that exceeds most what it is allowed."""
    errors = np.array([finding.error for finding in findings])
    allowed = np.array([finding.allowed for finding in findings])
    worst = findings[int(find_used(errors, allowed).argmax())]
    condition = EQUIVALENCE.factor / max(worst.allowed, EQUIVALENCE.factor)
    return Row.judged(
        (name, answer.engine, answer.setting),
        quantity,
        worst.error,
        worst.allowed,
        worst.what,
        worst.theta_2,
        condition,
    )


class Visit(NamedTuple):
    """Places at which engines are asked, as a motion of bar 2 at 1 rad/s."""

    scene: Scene
    command: Command
    places: list[LimitPlace]
    """In the order of the command."""


def plan_visit(linkage: FourBar, places: Iterable[LimitPlace]) -> Visit:
    """Plan a visit of some places of a linkage.

    The bars are uniform: masses play no part.
    """
    # neighbours in turn: an engine starts from the position before
    ordered = sorted(set(places), key=lambda place: place[::-1])
    bars = copy_with(uniform(*linkage.lengths), ground_angle=linkage.ground_angle)
    theta_2, branch = (np.array(column) for column in zip(*ordered, strict=True))
    command = Command(theta_2, branch.astype(np.int8), 1.0, 0.0)
    return Visit(Scene(bars, Motion(0.0, 1.0)), command, ordered)


def look(engine: Adapter, visit: Visit) -> Seen:
    """Ask an engine at the places of a visit.

    `assembled` is 1.0 where it finds that the loop closes, 0.0 elsewhere.
    """
    answer = _require_answer(engine, visit.scene, visit.command)
    assert answer.assembled is not None
    names = ["assembled"] + [name for name in _OF_BARS if name in answer.quantities]
    columns = [answer.assembled] + [answer.quantities[name] for name in names[1:]]
    rows = zip(*(column.astype(float).tolist() for column in columns), strict=True)
    return {
        place: dict(zip(names, row, strict=True))
        for place, row in zip(visit.places, rows, strict=True)
    }


def _require_answer(engine: Adapter, scene: Scene, command: Command) -> Answer:
    """Give an engine's answer; LimitError where it refuses those positions."""
    answer = engine.answer(scene, command)
    if answer.refusal is not None:
        raise LimitError(answer.refusal)
    return answer


def _compare_angles(
    what: str,
    stated: Sequence[float],
    answered: Sequence[float],
    linkage: FourBar,
) -> Finding:
    """Compare lists of angles, modulo 2 pi in any order.

    Return the largest distance of one from the nearest of the other.
    """
    if not stated or not answered:
        return Finding(
            0.0 if len(stated) == len(answered) else math.inf, 0.0, 0.0, what
        )
    apart = np.abs(
        wrap_difference(np.subtract.outer(np.array(stated), np.array(answered)))
    )
    error = float(max(apart.min(axis=0).max(), apart.min(axis=1).max()))
    return Finding(
        error,
        EQUIVALENCE.factor * count_half_turns(linkage.ground_angle, np.array(stated)),
        stated[0],
        what,
    )


_BEYOND = 4.0 * TOUCHING_MARGIN
"""Distance past a limit at which the engine is tried. The loop closes or misses by this
part of the sum of the lengths.
"""

_LENGTHS_ROUNDED = (EPS / 4.0, 2.125 * EPS)
"""Bounds of the gap, in parts of the perimeter, between which either answer holds.

A length that is computed, as the distance of two points, is right to four units of
round-off, 2 EPS; an eighth of EPS is for the comparison's own round-off.
"""
_PAST = 1e-3
"""Distance on either side of a change point, rad. The speeds of the two motions differ
visibly there.
"""


def _compare_change_points(linkage: FourBar) -> Finding:
    """Decide by exact sums of the lengths in which position all bars are collinear.

    Input and ground are collinear in two positions.
    """
    d, a, b, c = (Fraction(length) for length in linkage.lengths)
    missing = {0.0: abs(abs(d - a) - abs(b - c)), math.pi: abs(d + a - b - c)}
    stated = mobility.change_points(linkage)
    wrong = 0
    decided = 0
    for psi, gap in missing.items():
        part = float(gap / (d + a + b + c))
        angle = linkage.ground_angle + psi
        allowed = EQUIVALENCE.factor * max(1.0, abs(angle))
        here = any(
            abs(math.remainder(point - angle, TURN)) <= allowed for point in stated
        )
        decided += here
        wrong += part > _LENGTHS_ROUNDED[1] if here else part < _LENGTHS_ROUNDED[0]
    return Finding(
        float(wrong + len(stated) - decided), 0.0, linkage.ground_angle, "change points"
    )


def _compute_step_beyond(linkage: FourBar, theta_2: float) -> float:
    """Compute the angle by which bar 2 turns beyond a limit, rad.

    The loop then closes, or misses, by _BEYOND more.
    """
    d, a, *_ = linkage.lengths
    psi = theta_2 - linkage.ground_angle
    little = _BEYOND * sum(linkage.lengths)
    e = max(abs(d - a * np.exp(1j * psi)), little)
    # e grows by d a sin(psi)/e to first order, by d a/(2 e) to second where the bar
    # lies along the ground
    slope = max(d * a * abs(math.sin(psi)) / e, math.sqrt(0.5 * little * d * a / e))
    return float(little / slope) + 4.0 * EPS * (abs(theta_2) + TURN)


class _LimitTrial(NamedTuple):
    """Scene and command that an engine is tried with for one bar, and what is
    stated.
    """

    scene: Scene
    """The linkage with the bar in the place of bar 2."""
    command: Command
    angles: Array
    """Angles of the bar, rad."""
    inside: Mask
    """True where the loop closes."""
    decidable: Mask
    """True where rounding does not decide whether the loop closes."""
    findings: tuple[Finding, ...]
    """Findings from comparing the statements with each other."""

    @property
    def places(self) -> list[LimitPlace]:
        """Places of the command."""
        theta_2 = self.command.theta_2.tolist()
        branch = self.command.branch.tolist()
        return list(zip(theta_2, branch, strict=True))


def _try_bar(
    scene: Scene,
    bar: int,
    limits: Iterable[mobility.LimitPosition],
) -> _LimitTrial:
    """Plan the trial of a bar of a scene that has nothing but a linkage."""
    linkage = scene.linkage
    second, third = (linkage.bar(k) for k in MOVING_BARS if k != bar)
    first = copy_with(linkage, input=linkage.bar(bar), coupler=second, output=third)
    shift = math.pi if bar == 4 else 0.0  # the loop runs along bar 4 from B to O4
    spans = mobility.find_intervals(linkage, bar)
    full = mobility.turns_fully(linkage, bar)
    expected = [((start + stop) / 2.0, True) for start, stop in spans]
    # that the loop closes up to its limits is seen where the limit positions themselves
    # are examined
    for i, (start, stop) in enumerate(() if full else spans):
        before = (start - spans[i - 1][1]) % TURN
        after = (spans[i + 1 - len(spans)][0] - stop) % TURN
        expected.append(
            (
                start - min(_compute_step_beyond(first, start + shift), 0.5 * before),
                False,
            )
        )
        expected.append(
            (stop + min(_compute_step_beyond(first, stop + shift), 0.5 * after), False)
        )
    along = [
        linkage.ground_angle + angle - shift for angle in (0.0, math.pi)
    ]  # the ground, in both directions
    within = [
        any((angle - start) % TURN < stop - start for start, stop in spans)
        for angle in along
    ]
    expected += zip(along, within, strict=True)
    if bar == 2:
        expected += [(angle, True) for angle in mobility.choose_range(linkage)]
    angles, inside = (np.array(column) for column in zip(*expected, strict=True))
    findings = (
        _compare_angles(
            f"limits of bar {bar}",
            [limit[MOVING_BARS.index(bar)] for limit in limits],
            [] if full else [end for span in spans for end in span],
            linkage,
        ),
        _compare_angles(
            f"swing of bar {bar}",
            [mobility.swing(linkage, bar)],
            [spans[0][1] - spans[0][0]],
            linkage,
        ),
        Finding(
            float(full != all(within)), 0.0, along[0], f"whether bar {bar} turns fully"
        ),
    )
    decidable = np.abs(compute_closing_margin(first, angles + shift)) > TOUCHING_MARGIN
    command = Command(angles + shift, np.ones(len(angles), np.int8), None, 0.0)
    tried = copy_with(scene, linkage=first)
    return _LimitTrial(tried, command, angles, inside, decidable, findings)


def _compute_inwards(linkage: FourBar, theta_2: float) -> float:
    """Compute the angle of bar 2 from its limit to where the loop closes, rad."""
    step = _compute_step_beyond(linkage, theta_2)
    ahead, behind = compute_closing_margin(
        linkage, np.array([theta_2 + step, theta_2 - step])
    )
    return step if ahead > behind else -step


class _InputLimit(NamedTuple):
    """A limit of bar 2, where rounding decides if the loop closes."""

    limit: mobility.LimitPosition
    step: float
    """Small angle from the limit to where an engine is asked, rad."""
    turned: float
    """Angle by which bars 3 and 4 turn meanwhile, and by which rounding may, rad."""

    @classmethod
    def of(
        cls,
        linkage: FourBar,
        limit: mobility.LimitPosition,
        roundoff: float,
    ) -> "_InputLimit":
        """Compute how far inside it an engine is asked."""
        d, a, *_ = linkage.lengths
        step = _compute_inwards(linkage, limit.theta_2)
        e = abs(d - a * np.exp(1j * (limit.theta_2 - linkage.ground_angle)))
        moved = _compute_moved(linkage, 2, limit, roundoff)
        return cls(limit, step, a / e * (abs(step) + moved))


class _OtherLimit(NamedTuple):
    """A limit of bar 3 or 4."""

    limit: mobility.LimitPosition
    collinear: bool
    """True if all bars are collinear there. Rounding counts as collinear."""
    moved: float
    """Angle by which rounding may turn it, rad."""


def _list_limits(
    linkage: FourBar,
    bar: int,
    limits: Sequence[mobility.LimitPosition],
    roundoff: float,
) -> list[_OtherLimit]:
    """List the limits of bar 3 or 4."""
    angles = np.array([limit.theta_2 for limit in limits])
    touching = np.abs(compute_closing_margin(linkage, angles)) <= TOUCHING_MARGIN
    return [
        _OtherLimit(limit, collinear, _compute_moved(linkage, bar, limit, roundoff))
        for limit, collinear in zip(limits, touching.tolist(), strict=True)
    ]


class _Passage(NamedTuple):
    """An assembly through a change point, with the sign of sin(theta_4 - theta_3)
    stated on either side.
    """

    point: float
    """theta_2, rad."""
    assembly: int
    before: int
    after: int

    @property
    def places(self) -> list[LimitPlace]:
        """Places before the change point and beyond it.

        Beyond it they have the stated sign and the other one.
        """
        beyond = self.point + _PAST
        return [
            (self.point - _PAST, self.before),
            (beyond, self.after),
            (beyond, -self.after),
        ]


def _list_passages(linkage: FourBar) -> Iterator[_Passage]:
    """List both assemblies through every change point, now and a turn later."""
    for change_point in mobility.change_points(linkage):
        for turn, assembly in itertools.product((0, 1), (1, -1)):
            point = change_point + TURN * turn
            around = np.array([point - _PAST, point + _PAST])
            before, after = find_signs(linkage, around, assembly).tolist()
            yield _Passage(point, assembly, before, after)


class StatedLimits(NamedTuple):
    """Statements of the formulas on the limits, evaluated once for all engines."""

    linkage: FourBar
    lever: float
    """As from `find_lever`."""
    roundoff: float
    """As from `find_roundoff`, rad."""
    positions: dict[int, tuple[mobility.LimitPosition, ...]]
    """Limits as the formulas list them, by moving bar."""
    trials: dict[int, _LimitTrial]
    """Trials by moving bar."""
    inside: list[_InputLimit]
    """Limits of bar 2."""
    limits: dict[int, list[_OtherLimit]]
    """Limits of bars 3 and 4."""
    passages: list[_Passage]
    change_points: Finding
    """Finding from comparing the change points with exact sums of the lengths."""

    @classmethod
    def of(cls, linkage: FourBar) -> "StatedLimits":
        """Evaluate the formulas."""
        scene = Scene(linkage)
        roundoff = find_roundoff(linkage)
        positions = {bar: mobility.limit_positions(linkage, bar) for bar in MOVING_BARS}
        return cls(
            linkage,
            find_lever(linkage),
            roundoff,
            positions,
            {bar: _try_bar(scene, bar, positions[bar]) for bar in MOVING_BARS},
            [_InputLimit.of(linkage, limit, roundoff) for limit in positions[2]],
            {
                bar: _list_limits(linkage, bar, positions[bar], roundoff)
                for bar in (3, 4)
            },
            list(_list_passages(linkage)),
            _compare_change_points(linkage),
        )

    def dead_centres(self, bar: int) -> list[_OtherLimit]:
        """Select the limits of a bar that are of one branch, as they should be."""
        return [
            one
            for one in self.limits[bar]
            if not one.collinear and one.limit.branch != 0
        ]


def compare_ranges(
    stated: StatedLimits,
    engine: Adapter,
    seen: Seen,
) -> Iterator[Finding]:
    """Compare ranges, limits and full turns of every moving bar.

    The range of a sweep and the change points are compared too.
    """
    for bar, tried in stated.trials.items():
        if bar == 2:
            closes = np.array(
                [seen[place]["assembled"] > 0.0 for place in tried.places]
            )
        else:
            answer = _require_answer(engine, tried.scene, tried.command)
            assert answer.assembled is not None
            closes = answer.assembled
        wrong = tried.decidable & (closes != tried.inside)
        angle = float(tried.angles[wrong.argmax()])
        if wrong.any():
            what = f"bar {bar} at {angle!r} rad: the engine finds the opposite"
        else:
            what = "closes where stated"
        yield Finding(float(np.count_nonzero(wrong)), 0.0, angle, what)
        yield from tried.findings
    yield stated.change_points


def choose_places(stated: StatedLimits) -> list[LimitPlace]:
    """Return the places where an engine is evaluated to check these statements."""
    places = [*stated.trials[2].places]
    places += [
        (limit.theta_2 + step, branch)
        for limit, step, _ in stated.inside
        for branch in (1, -1)
    ]
    places += [
        (limit.theta_2, limit.branch)
        for bar in (3, 4)
        for limit, *_ in stated.dead_centres(bar)
    ]
    for passage in stated.passages:
        places += passage.places
    return places


def compare_limit_positions(stated: StatedLimits, seen: Seen) -> Iterator[Finding]:
    """Compare the limits of every moving bar.

    Where all bars are collinear no side can be stated.
    """
    yield Finding(0.0, 0.0, stated.linkage.ground_angle, "the same positions")
    yield from _check_input(stated, seen)
    for bar in (3, 4):
        yield from _check_dead_centres(stated, bar, seen)


def _check_input(stated: StatedLimits, seen: Seen) -> Iterator[Finding]:
    """Check that bars 3 and 4 just inside each limit of bar 2 are off their common
    line by the same angles on both branches.
    """
    for limit, step, turned in stated.inside:
        open_, crossed = (
            {
                name: seen[(limit.theta_2 + step, branch)][name]
                for name in ("theta_3", "theta_4")
            }
            for branch in (1, -1)
        )
        yield Finding(
            float(limit.branch != 0),
            0.0,
            limit.theta_2,
            "both branches meet at a limit of bar 2",
        )
        digits = stated.lever * abs(math.sin(open_["theta_4"] - open_["theta_3"]))
        if digits * NOTHING_TO_TELL <= EPS:
            continue
        allowed = stated.roundoff / digits + turned
        middle = {}
        for name, angle in (("theta_3", limit.theta_3), ("theta_4", limit.theta_4)):
            middle[name] = open_[name] + 0.5 * wrap_difference(
                crossed[name] - open_[name]
            )
            error = abs(wrap_difference(middle[name] - angle))
            yield Finding(error, allowed, limit.theta_2, f"{name} at a limit of bar 2")
        aligned = math.cos(middle["theta_4"] - middle["theta_3"]) < 0.0
        yield Finding(
            float(aligned != limit.stretched), 0.0, limit.theta_2, "stretched or folded"
        )


def _compute_moved(
    linkage: FourBar,
    bar: int,
    limit: mobility.LimitPosition,
    roundoff: float,
) -> float:
    """Compute by what rounding may turn a limit.

    The triangle is that of the ground, the bar, and the other two in one line.
    """
    upright = abs(math.sin(limit[MOVING_BARS.index(bar)] - linkage.ground_angle))
    d, *moving = linkage.lengths
    spread = sum(linkage.lengths) / d * (1.0 + sum(moving) / linkage.bar(bar).length)
    return roundoff * spread / max(upright, EPS)


def _check_dead_centres(
    stated: StatedLimits,
    bar: int,
    seen: Seen,
) -> Iterator[Finding]:
    """Check that the other two bars are in one line there, and the bar is at rest."""
    for limit, collinear, _ in stated.limits[bar]:
        signs = (
            (0, 1, -1) if collinear else (1, -1)
        )  # all bars collinear: rounding decides
        yield Finding(
            float(limit.branch not in signs),
            0.0,
            limit.theta_2,
            f"branch of a limit of bar {bar}",
        )
    for limit, _, moved in stated.dead_centres(bar):
        what = f"bar {bar} at theta_2 = {limit.theta_2!r}"
        place = (limit.theta_2, limit.branch)
        theta_3, theta_4, omega_3, omega_4 = (
            seen[place][q] for q in ("theta_3", "theta_4", "omega_3", "omega_4")
        )
        sine = abs(math.sin(theta_4 - theta_3))
        speed = max(1.0, abs(omega_3), abs(omega_4))
        digits = stated.lever * sine
        if digits * NOTHING_TO_TELL <= EPS:
            continue
        for angle, of_formula in ((theta_3, limit.theta_3), (theta_4, limit.theta_4)):
            error = abs(wrap_difference(angle - of_formula))
            yield Finding(
                error,
                stated.roundoff / digits + moved * speed,
                limit.theta_2,
                what,
            )
        # the loop runs along bar 4 from B to O4
        aligned = (
            math.cos({3: theta_4 + math.pi, 4: theta_3}[bar] - limit.theta_2) > 0.0
        )
        yield Finding(
            float(aligned != limit.stretched), 0.0, limit.theta_2, "stretched or folded"
        )
        slowing = abs(seen[place][f"alpha_{bar}"])
        at_rest = stated.roundoff * speed / (digits * sine) + slowing * moved
        yield Finding(
            abs({3: omega_3, 4: omega_4}[bar]),
            at_rest,
            limit.theta_2,
            f"{what}: at rest",
        )


def check_through(stated: StatedLimits, seen: Seen) -> Iterator[Finding]:
    """Check the assemblies through a change point.

    The engine finds the speeds of each one continuous.
    """
    for passage in stated.passages:
        rates = np.array(
            [
                [seen[place][name] for place in passage.places]
                for name in ("omega_3", "omega_4")
            ]
        )
        jumps = np.abs(rates[:, 1:] - rates[:, :1]).max(axis=0)
        goes_on = (passage.after, -passage.after)[int(np.argmin(jumps))]
        yield Finding(
            float(passage.after != goes_on),
            0.0,
            passage.point,
            f"assembly {passage.assembly:+d} at {passage.point!r} rad",
        )
