"""Free motions to 1e-9 rad over 5 s against Taylor series in 77 digits.

The linkages are random ones of every type.

`FREE_MOTIONS=n` tests n motions of each kind besides the few that `make test` takes.
"""

import os
from typing import Any, NamedTuple

import numpy as np
import pytest

import fourbar
from fourbar import Bar, FourBar, Gravity, Load, Viscous
from fourbar.evaluation import free_motion
from fourbar.evaluation.free_motion import integrate
from fourbar.scene import Command, with_signs
from tests.support.released_reference import released

PROMISED = 1e-9
"""rad over 5 s, where the motion amplifies errors by no more than AMPLIFIED; beyond it
in proportion.
"""
AMPLIFIED = 1000.0
TIMES = np.linspace(0.0, 5.0, 51)
NUDGE = 1e-6
"""Of the angle at the start (rad), and of the speed by the greatest speed."""
SURE = 1e-6
"""|sin(theta_4 - theta_3)| from which on the branch is known from its sign."""
LOOSE = 1e-10
"""Tolerance of the motions whose difference over NUDGE is the amplification: 1e-4 of
it.
"""


class Released(NamedTuple):
    """A motion to be examined."""

    linkage: FourBar
    terms: tuple[Any, ...]
    theta_2: float
    omega_2: float
    branch: int
    """Sign of sin(theta_4 - theta_3) at the start."""


def four_lengths(rng, grashof):
    """Shortest to longest, m, away from the change points."""
    while True:
        x = sorted(rng.uniform(0.1, 0.6, 4))
        gap = (x[1] + x[2] - x[0] - x[3]) / sum(x)
        if (
            (gap > 0.05)
            if grashof
            else (gap < -0.05 and x[3] < 0.9 * (x[0] + x[1] + x[2]))
        ):
            return [float(v) for v in x]


def with_extreme(place, grashof):
    """Linkages by the place of the shortest bar (Grashof) or of the longest.

    The places are ground, input, coupler and output.
    """

    def lengths(rng):
        others = four_lengths(rng, grashof)
        extreme = others.pop(0 if grashof else -1)
        rng.shuffle(others)
        return [*others[:place], extreme, *others[place:]]

    return lengths


def at_change_point(rng):
    """s + l = p + q exactly: multiples of 2^-10."""
    while True:
        s, p, q = (
            float(round(v * 2**10)) / 2**10 for v in sorted(rng.uniform(0.1, 0.5, 3))
        )
        x = [s, p, q, p + q - s]
        if s < 0.9 * p:
            rng.shuffle(x)
            return x


def parallelogram(rng):
    """Opposite bars equal."""
    x, y = rng.uniform(0.1, 0.5, 2)
    return [float(x), float(y), float(x), float(y)]


KINDS = {
    "double-crank": with_extreme(0, grashof=True),
    "crank-rocker": with_extreme(1, grashof=True),
    "double-rocker": with_extreme(2, grashof=True),
    "rocker-crank": with_extreme(3, grashof=True),
    "triple rocker, longest ground": with_extreme(0, grashof=False),
    "triple rocker, longest input": with_extreme(1, grashof=False),
    "triple rocker, longest coupler": with_extreme(2, grashof=False),
    "triple rocker, longest output": with_extreme(3, grashof=False),
    "change point": at_change_point,
    "parallelogram": parallelogram,
}


PLACES = {
    "world": ("arm", "from_pin", "from_centre"),
    "bar": ("from_pin", "from_centre"),
}
"""Forms in which the place of a force is stated, by the axes that its direction keeps.
"""


def motion(kind, number):
    """One motion at random; it depends on its kind and number alone."""
    rng = np.random.default_rng([list(KINDS).index(kind), number])
    lengths = KINDS[kind](rng)
    bars = []
    for length in lengths[1:]:
        mass = float(rng.uniform(0.2, 2.0))
        centre = (length * float(rng.uniform(0.2, 0.8)), float(rng.uniform(-1, 1)))
        bars.append(
            Bar(length, mass, mass * length**2 * float(rng.uniform(0.05, 0.3)), centre)
        )
    linkage = FourBar(
        lengths[0],
        *bars,
        ground_angle=float(rng.uniform(-3.0, 3.0)),
    )
    weight = 9.81 * sum(bar.mass * bar.length for bar in bars)
    terms = [Gravity()]
    if rng.random() < 0.6:
        damping = {
            pin: 0.01 * weight * float(rng.uniform(0, 1))
            for pin in fourbar.linkage.PINS
            if rng.random() < 0.5
        }
        terms.append(Viscous.at(**damping))
    if rng.random() < 0.6:
        terms.append(
            Load(
                int(rng.integers(2, 5)),
                moment=float(rng.uniform(-0.3, 0.3)) * weight,
            )
        )
    forces = []
    if rng.random() < 0.3:
        force = (float(rng.uniform(0, 2)), float(rng.uniform(-3, 3)))
        bar, frame = int(rng.integers(2, 5)), str(rng.choice(["world", "bar"]))
        forces.append((bar, force, frame))
    branch, omega_2 = int(rng.choice([-1, 1])), float(rng.uniform(-5.0, 5.0))
    chosen = rng.random()
    for bar, force, frame in forces:
        places = PLACES[frame]
        place = {places[int(chosen * len(places))]: (0.1, 1.0)}
        terms.append(Load(bar, force, frame=frame, **place))
    while True:
        theta_2 = float(rng.uniform(-3.0, 3.0))
        command = Command(
            np.array([theta_2]), np.array([branch], dtype=np.int8), None, 0.0
        )
        if fourbar.solve(fourbar.Scene(linkage), at=command).condition[0] > 0.3:
            return Released(linkage, tuple(terms), theta_2, omega_2, branch)


def ours(case, nudge=(0.0, 0.0)):
    """The motion of the formulas."""
    start = (case.theta_2 + nudge[0], case.omega_2 + nudge[1])
    signs = np.array([case.branch], dtype=np.int8)
    at_start = with_signs(case.linkage, Command(np.array(start[:1]), signs, None, 0.0))
    assembly = int(at_start.branch[0])
    terms = [
        term.with_places(lambda place: place.settle(case.linkage, {}))
        for term in case.terms
    ]
    return integrate(case.linkage, terms, *start, assembly, TIMES)


def amplification(case):
    """Largest change of theta_2 over that of the start, by finite differences."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(free_motion, "RELATIVE", LOOSE)
        patch.setattr(free_motion, "ABSOLUTE", LOOSE)
        base = ours(case)
        speed = float(np.abs(base.command.omega_2).max())
        moved = [ours(case, nudge) for nudge in ((NUDGE, 0.0), (0.0, NUDGE * speed))]
    n = min(len(m.command.time) for m in (base, *moved))
    return (
        max(
            float(np.abs(m.command.theta_2[:n] - base.command.theta_2[:n]).max())
            for m in moved
        )
        / NUDGE
    )


TURNS, AT_LIMITS, AT_CHANGE_POINTS, AMPLIFIES = range(4)
SHOWN = {
    ("double-crank", 10): AMPLIFIES,
    ("crank-rocker", 8): TURNS,
    ("triple rocker, longest output", 1): AT_LIMITS,
    ("double-crank", 5): TURNS,
    ("parallelogram", 1): AT_CHANGE_POINTS,
}
"""The motions of `make test`, and what each is to show: a few seconds in all. All kinds
are tested by FREE_MOTIONS.
"""
MANY = [
    (kind, number)
    for kind in KINDS
    for number in range(int(os.environ.get("FREE_MOTIONS", "0")))
]


@pytest.mark.slow
@pytest.mark.timeout(600)
@pytest.mark.parametrize("kind, number", list(dict.fromkeys([*SHOWN, *MANY])))
def test_nine_digits_over_five_seconds(kind, number):
    case = motion(kind, number)
    m, theirs = ours(case), released(*case[:5], TIMES)
    shown = SHOWN.get((kind, number))
    promised, amplified = PROMISED, 0.0
    n = len(theirs.theta_2)
    assert len(m.command.time) == n
    off = [float(np.abs(m.command.theta_2 - theirs.theta_2).max())]
    worst = float(np.max(off))  # NaN where one is
    if (
        worst > PROMISED or shown == AMPLIFIES
    ):  # three more motions, only where they decide
        amplified = amplification(case)
        promised *= max(1.0, amplified / AMPLIFIED)
    assert worst <= promised
    sure = np.abs(theirs.sine) > SURE
    signs = with_signs(case.linkage, m.command).branch
    assert np.array_equal(signs[sure], np.sign(theirs.sine[sure]))
    assert len(m.change_points) == theirs.change_points
    if shown is not None:
        passed = theirs.limits > 0, theirs.change_points > 0
        kinds = [not any(passed), *passed]
        assert [*kinds, amplified > AMPLIFIED][shown]


def test_the_motions_shown_meet_every_force():
    terms = [term for shown in SHOWN for term in motion(*shown).terms]
    assert {type(term) for term in terms} == {
        Gravity,
        Viscous,
        Load,
    }
    loads = [term for term in terms if isinstance(term, Load)]
    assert any(load.moment != 0.0 for load in loads)
    assert {
        (load.frame, place)
        for load in loads
        for place in ("arm", "from_pin", "from_centre")
        if getattr(load, place) is not None
    } == {(frame, place) for frame in PLACES for place in PLACES[frame]}
