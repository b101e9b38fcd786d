"""Each effect and each pair of effects through every engine that has it.

The run must catch the faults.
"""

from functools import cache

import numpy as np
from pytest import mark, param

import fourbar
from fourbar.effects import (
    Effect,
    Flywheel,
    Friction,
    Gravity,
    Load,
    PinFriction,
    Place,
    Spring,
    Springs,
    Table,
    Torsion,
    Viscous,
    list_kinds,
)
from fourbar_validation.engines import free_body
from fourbar_validation.engines.loaded import TERM_OF
from fourbar_validation.run.judge import judge
from tests.support.here import EXACT, THROUGH_TIME
from tests.support.rows import read_rows, slow_but
from tests.support.scenes import crank_rocker

SPRINGS = read_rows("""
1 0.1 -1.5 | 4 0.08 0.2 | 200 0.05 3 |
2 0.05 0.5 | 3 0.1 0.3 | 50 0.05 1 |
1 0.15 -0.6 | 4 0.1 0.4 | 0 0 -2 |
1 0.12 -2 | 2 0.05 0.4 | 30 0 2 |
1 0 0 | 3 0.1 0.3 | 90 0.15 0 | push
1 0 0 | 4 0.1 0.3 | 70 0.25 -2 | pull
""")
"""Bar and polar place of both ends; stiffness, length, preload; how it acts."""


def make_spring(one, other, numbers, acts):
    places = (map(float, end.split()) for end in (one, other))
    ends = [Place(int(bar), tuple(polar)) for bar, *polar in places]
    return Spring(*ends, *map(float, numbers.split()), acts=acts or None)


ACTING = {
    "gravity": Gravity(9.81, 0.3),
    "viscous": Viscous.at(O2=0.02, A=0.03, B=0.04, O4=0.05),
    "friction": Friction.at(O2=0.02, A=0.03, B=0.04, O4=0.05),
    "pin_friction": PinFriction.at(
        O2=(0.2, 0.01), A=(0.3, 0.01), B=(0.1, 0.02), O4=(0.2, 0.01)
    ),
    "torsion": Torsion.at(O4=(2.0, 1.9, 0.1), B=(1.0, 0.8, -0.2)),
    "springs": Springs(
        (
            *(make_spring(*row) for row in SPRINGS),
            Spring.gas(Place(1, (0.2, 2.0)), Place(3, (0.05, 1.0)), 0.5, 0.3, 4.0, 7.0),
        )
    ),
    "flywheel": Flywheel(0.02, 2),
    "load": Load(
        4,
        (3.0, 0.7),
        from_centre=(0.05, 1.0),
        moment=0.2,
        frame="bar",
    ),
    "load over theta_2": Load(
        3,
        (4.0, 0.7),
        arm=(0.05, 1.0),
        moment=0.2,
        frame="world",
        table=Table((0.0, 1.0, 2.5, 2 * np.pi), (0.0, 1.0, -0.5, 0.0)),
    ),
}
ON_TREES = {"pinocchio-inverse", "mujoco-inverse"}
"""What acts by `TERM_OF`, the table of the engines."""
NO_COUNTERPART = {
    "mujoco-simulated": {
        key
        for key, kind in list_kinds().items()
        if kind.add_to_mjcf is Effect.add_to_mjcf
    }
}
"""What an engine cannot do; it must say so, and the others remain."""


@cache
def scene(*names):
    """A crank-rocker with the effects named, driven on bar 2.

    One for all faults in them.
    """
    terms = [ACTING[name] for name in names]
    return crank_rocker(
        fourbar.Motion(fourbar.Sweep(0.13, 0.13 + 2 * np.pi, 12), 10.0, 3.0),
        loads=tuple(term for term in terms if isinstance(term, Load)),
        effects=tuple(term for term in terms if not isinstance(term, Load)),
    )


def outcome(posed, engines):
    """What fails, and who refuses."""
    rows = judge("scene", posed, engines).rows
    return [(r.engine, r.quantity, r.reason) for r in rows if r.failed], {
        r.engine for r in rows if r.verdict == "refuses"
    }


def test_every_effect_of_the_registry_is_here():
    assert set(list_kinds()) <= set(ACTING)


ALONE = [(name,) for name in ACTING]


@mark.parametrize("names", ALONE, ids="+".join)
def test_exact_engines_agree(names):
    assert outcome(scene(*names), EXACT) == ([], set())


@mark.parametrize(
    "names",
    [
        *ALONE,
        tuple(one for one in ACTING if one not in NO_COUNTERPART["mujoco-simulated"]),
        param(tuple(ACTING), marks=mark.slow),
    ],
    ids="+".join,
)
def test_the_simulation_agrees_or_says_what_it_has_no_counterpart_for(names):
    missing = NO_COUNTERPART["mujoco-simulated"] & set(names)
    refusing = {"mujoco-simulated"} if missing else set()
    assert outcome(scene(*names), THROUGH_TIME) == ([], refusing)


def fail_with(name, engines):
    """Engines and quantities that fail with one effect."""
    chosen = [engine for engine in EXACT if engine.name in engines]
    failed, _ = outcome(scene(name), chosen)
    return {engine for engine, _, _ in failed}, {quantity for _, quantity, _ in failed}


MORE = 1.0 + 1e-6
"""Factor on what acts: a wrong sign or a missing term is a larger fault of its kind."""


class FaultyTree:
    """An engine's tree on which a little more acts."""

    def __init__(self, tree):
        self.tree = tree

    def __getattr__(self, name):
        return getattr(self.tree, name)

    def push(self, bar, force, point):
        self.tree.push(bar, [MORE * axis for axis in force], point)

    def couple(self, bar, couple):
        self.tree.couple(bar, MORE * couple)

    def gravity(self, vector):
        self.tree.gravity((MORE * vector[0], MORE * vector[1]))


@mark.parametrize(
    "name",
    slow_but({"viscous", "load"}, [name for name in ACTING if name != "pin_friction"]),
)
def test_a_fault_in_the_wrench_on_the_free_bodies_fails_the_run(name, monkeypatch):
    def faulty(right):
        def act(effect, motion, wrenches):
            alone = free_body.BodyWrenches(len(motion.theta_2))
            right(effect, motion, alone)
            for bar in (2, 3, 4):
                wrenches.push(bar, MORE * alone.force[bar], 0.0)
                wrenches.couple(bar, MORE * alone.moment[bar])

        return act

    if isinstance(ACTING[name], Load):
        right = free_body.apply_load
        monkeypatch.setattr(free_body, "apply_load", faulty(right))
    else:
        table = free_body.WRENCH_OF
        monkeypatch.setitem(table, name, faulty(table[name]))
    _, quantities = fail_with(name, {"free-body"})
    assert "torque" in quantities


def test_what_the_formulas_make_of_a_spring_does_not_reach_the_engines(monkeypatch):
    monkeypatch.setattr(Spring, "slack", 0.0)
    assert fail_with("springs", ON_TREES)[0] >= ON_TREES


@mark.parametrize("name", slow_but({"viscous", "load", "gravity"}, ACTING))
def test_a_fault_in_the_engine_term_fails_the_run(name, monkeypatch):
    key = ACTING[name].key
    right = TERM_OF[key]
    monkeypatch.setitem(
        TERM_OF, key, lambda effect, tree: right(effect, FaultyTree(tree))
    )
    assert fail_with(name, ON_TREES)[0] >= ON_TREES
