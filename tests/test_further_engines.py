"""The engines that join a run where they are installed: round-off agreement, every element, limits, planted faults."""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from importlib import import_module
from importlib.util import find_spec
from typing import Any, ClassVar

import numpy as np
import pytest

from fourbar.linkage import Bar, FourBar
from fourbar.scene import Scene, command
from fourbar.scene.motion import Motion
from fourbar.solve import solve
from tests.scenes import thesis
from tests.test_effects import ACTING, scene
from validation.compare.compare import COMPARED, compare
from validation.compare.identities import closure
from validation.compare.tolerance import EQUIVALENCE
from validation.engines.witnesses import FURTHER
from validation.scenes.random import LinkageType
from validation.scenes.suites import Random

WITNESS = {witness.library: witness for witness in FURTHER}
LACKS = {"exudyn": {"pin_friction"}, "opensim": {"pin_friction"}, "pydrake": set[str]()}
"""Effects that an engine has no element for."""
PRINTED = 5e-10
"""The last digit of the figures, which were computed with ten."""


def present(*libraries: str) -> list[Any]:
    """The libraries, each skipped by its name where it is not installed."""
    return [
        pytest.param(name, marks=pytest.mark.skipif(find_spec(name) is None, reason=str(WITNESS[name].missing())))
        for name in libraries
    ]


each_library = pytest.mark.parametrize("library", present(*WITNESS))


def failures(library: str, case: Scene, every: int = 1) -> list[tuple[str, str]]:
    """Quantities on which an engine and the formulas disagree, or its refusal."""
    at = command(case)
    at = at._replace(theta_2=at.theta_2[::every], branch=at.branch[::every])
    answer = WITNESS[library].engine().answer(case, at)
    if answer.refusal is not None:
        return [("refusal", answer.refusal)]
    rows = compare("scene", case, answer, solve(case, "force", at=at), EQUIVALENCE, COMPARED)
    rows.append(closure("scene", case, answer))
    return [(row.quantity, row.reason) for row in rows if not row.passed]


@each_library
def test_thesis_figures(library: str) -> None:
    got = WITNESS[library].engine().answer(thesis(), command(thesis())).quantities
    assert got["torque"][0] == pytest.approx(3.0930935923, abs=PRINTED, rel=0.0)
    figures = {"F12": (7.033117757, -2.121209407), "F32": (-15.480491243, 0.568582894)}
    figures |= {"F43": (-15.476569658, 0.555136181), "F14": (-15.476837016, 0.551901654)}
    for name, figure in figures.items():
        assert got[name][0] == pytest.approx(figure, abs=PRINTED, rel=0.0), name


def known(library: str) -> list[str]:
    """The loads and effects that an engine has."""
    return [name for name in ACTING if name not in LACKS[library]]


@each_library
def test_each_load_and_effect(library: str) -> None:
    assert {name: failures(library, scene(name)) for name in known(library)} == {name: [] for name in known(library)}


@each_library
def test_all_at_once_on_every_drive_and_branch(library: str) -> None:
    case = scene(*known(library))
    for drive in (2, 3, 4):
        for branch in (1, -1):
            motion = replace(case.motion, branch=branch, omega_2=-7.0)
            assert failures(library, replace(case, drive_bar=drive, motion=motion)) == [], (drive, branch)


@each_library
def test_random_linkages(library: str) -> None:
    suite = Random(20, 3, tuple(LinkageType))
    for index in range(len(suite)):
        assert failures(library, suite.scene(index), every=6) == [], suite.name(index)


@each_library
def test_accelerations_of_points(library: str) -> None:
    case = scene("gravity")
    ours, got = solve(case), WITNESS[library].engine().answer(case, command(case)).quantities
    for name in ("A", "B", "G2", "G3", "G4", "a_A", "a_B", "a_G2", "a_G3", "a_G4"):
        expected = getattr(ours, name)
        allowed = EQUIVALENCE.factor * np.abs(expected).max() / ours.condition.min() ** 2
        assert np.abs(got[name] - expected).max() <= allowed, name


@dataclass(frozen=True)
class Wind:
    """An effect that no engine knows."""

    key: ClassVar[str] = "wind"


@each_library
def test_what_has_no_element_is_refused_by_name(library: str) -> None:
    effects: list[Any] = [Wind(), *(ACTING[name] for name in LACKS[library])]
    for effect in effects:
        case = replace(scene(), effects=(effect,))
        assert repr(effect.key) in (WITNESS[library].engine().answer(case, command(case)).refusal or "")


def with_bar(number: int, **values: Any) -> Scene:
    """A crank-rocker with another mass, inertia or mass centre of one bar."""
    bars = {2: Bar(0.1, 0.2), 3: Bar(0.25, 0.5), 4: Bar(0.22, 0.4)}
    bars[number] = Bar(bars[number].length, **values)
    return Scene(FourBar(0.3, bars[2], bars[3], bars[4]), Motion(np.linspace(0.1, 6.0, 6), 10.0, 3.0))


@each_library
def test_bars_without_mass_or_inertia(library: str) -> None:
    """Exudyn holds them; OpenSim would drop a bar without mass, and it and Drake divide by some inertias."""
    divides = {"exudyn": (), "opensim": (2,), "pydrake": (3, 4)}[library]
    for number in (2, 3, 4):
        for values in ({"mass": 0.0}, {"mass": 0.0, "inertia": 0.1}):
            found = failures(library, with_bar(number, **values))
            assert found == [] if library == "exudyn" else found[0][0] == "refusal" and f"bar {number}" in found[0][1]
        found = failures(library, with_bar(number, mass=1.0, inertia=0.0, centre=(0.0, 0.0)))
        assert found == [] if number not in divides else found[0][0] == "refusal"


@pytest.mark.parametrize("library", present("opensim"))
def test_simbody_loses_a_constraint_where_the_limit_says(library: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Bars 3 and 4 nearly in one line: just inside the limit it is exact, well beyond it the force is lost."""
    from validation.engines import opensim

    linkage = with_bar(2, mass=0.2).linkage
    linkage = replace(linkage, input=Bar(0.25, 0.2), coupler=Bar(0.22, 0.5), output=Bar(0.3, 0.4))
    d, a, b, c = linkage.lengths
    limit = math.acos((d * d + a * a - (b + c) ** 2) / (2.0 * d * a))

    def near(offset: float) -> Scene:
        return Scene(linkage, Motion(limit - offset, 1.0))

    assert failures(library, near(1e-6)) == []
    assert "drops" in failures(library, near(1e-13))[0][1]
    monkeypatch.setattr(opensim, "LEAST_CONDITIONED", 0.0)
    assert {"F12", "F32", "F43", "F14", "torque"} <= {quantity for quantity, _ in failures(library, near(1e-13))}


def scaled(method: Callable[..., Any], factor: float) -> Callable[..., Any]:
    """A method that answers another number."""
    return lambda *arguments: method(*arguments) * factor


PLANTED = {
    "exudyn": {
        "_needed": (1.0 + 1e-9, {"F12", "F32", "F43", "F14", "torque"}),
        "_constraint_jacobian": (1.0 + 1e-9, {"omega_3", "omega_4", "torque"}),
        "angle": (1.0 + 1e-12, {"theta_3", "theta_4"}),
    },
    "opensim": {
        "_equations": (1.0 + 1e-9, {"omega_3", "omega_4", "torque"}),
        "_reaction": (1.0 + 1e-9, {"F12", "F43", "F14"}),
        "_closing_force": (-1.0, {"F32"}),
        "angle": (1.0 + 1e-12, {"theta_3", "theta_4"}),
    },
    "pydrake": {
        "turn": (1.0 + 1e-9, {"omega_3", "torque"}),
        "drift": (0.0, {"alpha_3", "alpha_4", "torque", "F12"}),
        "rotation": (1.0 + 1e-9, {"F12", "F14"}),
    },
}


@pytest.mark.parametrize(
    ("library", "method"),
    [
        pytest.param(*name.values, method, marks=name.marks)
        for name in present(*PLANTED)
        for method in PLANTED[name.values[0]]
    ],
)
def test_a_planted_fault_shows(library: str, method: str, monkeypatch: pytest.MonkeyPatch) -> None:
    module = import_module(WITNESS[library].adapter.partition(":")[0])
    bars = {"exudyn": "ExudynBars", "opensim": "OpenSimBars", "pydrake": "DrakeTree"}[library]
    factor, seen = PLANTED[library][method]
    monkeypatch.setattr(getattr(module, bars), method, scaled(getattr(getattr(module, bars), method), factor))
    assert seen <= {quantity for quantity, _ in failures(library, replace(scene("load"), drive_bar=4))}
