"""The two inverse engines: published figures, round-off agreement, the right branch, faults that must show."""

import math
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np
import pytest

from fourbar.effects import Friction, Gravity, Load, Viscous
from fourbar.errors import InputError
from fourbar.linkage import Bar, FourBar
from fourbar.scene import Command, Scene, command
from fourbar.scene.motion import Motion
from fourbar.solve import solve
from validation.compare.compare import COMPARED, compare
from validation.compare.identities import closure
from validation.compare.tolerance import EPS, EQUIVALENCE, K
from validation.engines import loop
from validation.engines.free_body import FreeBody
from validation.engines.mujoco.inverse import LEAST, MujocoInverse, MujocoTree
from validation.engines.pinocchio import PinocchioInverse, PinocchioTree

ENGINES = [PinocchioInverse(), MujocoInverse()]
TREES = [PinocchioTree, MujocoTree]
IDS = ["pinocchio", "mujoco"]
each_engine = pytest.mark.parametrize("engine", ENGINES, ids=IDS)
each_witness = pytest.mark.parametrize("engine", [*ENGINES, FreeBody()], ids=[*IDS, "free-body"])
PRINTED = 5e-10
"""The last digit of the figures, which were computed with ten."""

LOADS = (
    Load(2, (10.0, 1.0), (0.05, 2.0), -0.15),
    Load(3, (4.0, 0.3), (0.1, 0.5), 0.3, "bar"),
    Load(4, (3.0, 0.1), (0.02, 2.0), 1.0),
)
EFFECTS = (
    Gravity(),
    Viscous.at(O2=0.1, A=0.2, B=0.3, O4=0.1),
    Friction.at(O2=0.2, A=0.5, B=0.7, O4=0.1),
)
MECHANISMS = {  # ground, input, coupler, output
    "crank-rocker": (0.3, 0.1, 0.25, 0.22),
    "drag link": (0.1, 0.3, 0.25, 0.22),
    "Grashof double rocker": (0.3, 0.25, 0.1, 0.22),
    "triple rocker": (0.3, 0.25, 0.22, 0.3),
}


def bars(lengths: tuple[float, ...], ground_angle: float = 0.4) -> FourBar:
    """Bars whose mass centres lie off their lines."""
    d, *moving = lengths
    two, three, four = (Bar(x, 1.0 + x, 0.3 * x * x, (0.6 * x, 0.5 + x)) for x in moving)
    return FourBar(d, two, three, four, ground_angle)


def random_linkage(rng: np.random.Generator) -> FourBar:
    while True:
        try:
            return bars(tuple(10.0 ** rng.uniform(-1.0, 0.0, 4)), rng.uniform(-3.0, 3.0))
        except InputError:
            continue


def thesis() -> Scene:
    """Linares Mendoza (UNAM FES Cuautitlan), model mechanism, with inertias of bars 2.54 cm wide."""

    def bar(length: float, mass: float, centre: float) -> Bar:
        return Bar(length, mass, mass * (length**2 + 0.0254**2) / 12.0, (centre, 0.0))

    linkage = FourBar(0.2, bar(0.48, 57.0, 0.765), bar(0.55, 0.544, 0.275), bar(0.2, 0.2, 0.1), math.pi / 4)
    loads = (
        Load(2, (10.0, 0.0), (0.05, math.radians(265.0)), -0.15),
        Load(3, moment=-0.15),
        Load(4, moment=-0.15),
    )
    return Scene(linkage, Motion(math.radians(135.0), 0.2244), 4, loads)


def failures(engine: Any, scene: Scene, at: Command) -> list[str]:
    """Quantities on which an engine and the formulas disagree."""
    answer = engine.answer(scene, at)
    rows = compare("scene", scene, answer, solve(scene, at=at), EQUIVALENCE, COMPARED)
    rows.append(closure("scene", scene, answer))
    return [row.quantity for row in rows if not row.passed]


@each_witness
def test_thesis_figures(engine: Any) -> None:
    scene = thesis()
    got = engine.answer(scene, command(scene)).quantities
    assert got["torque"][0] == pytest.approx(3.0930935923, abs=PRINTED, rel=0.0)
    figures = {
        "F12": (7.033117757, -2.121209407),
        "F32": (-15.480491243, 0.568582894),
        "F43": (-15.476569658, 0.555136181),
        "F14": (-15.476837016, 0.551901654),
    }
    for name, figure in figures.items():
        assert got[name][0] == pytest.approx(figure, abs=PRINTED, rel=0.0), name


@each_witness
@pytest.mark.parametrize("lengths", MECHANISMS.values(), ids=MECHANISMS.keys())
def test_agrees_to_round_off(engine: Any, lengths: tuple[float, ...]) -> None:
    for drive in (2, 3, 4):
        for branch in (1, -1):
            scene = Scene(bars(lengths), Motion(None, 10.0, 3.0, branch), drive, LOADS, EFFECTS)
            at = command(scene)
            at = at._replace(theta_2=at.theta_2[::12], branch=at.branch[::12])
            assert failures(engine, scene, at) == [], (drive, branch)


@each_engine
def test_accelerations_of_points(engine: Any) -> None:
    scene = Scene(bars(MECHANISMS["crank-rocker"]), Motion(np.linspace(0.0, 6.0, 25), 10.0, 3.0), 2, (), (Gravity(),))
    ours, got = solve(scene), engine.answer(scene, command(scene)).quantities
    for name in ("A", "B", "G2", "G3", "G4", "a_A", "a_B", "a_G2", "a_G3", "a_G4"):
        expected = getattr(ours, name)
        allowed = K * EPS * np.abs(expected).max() / ours.condition.min() ** 2
        assert np.abs(got[name] - expected).max() <= allowed, name


@each_engine
def test_the_branch_is_the_commanded_one(engine: Any) -> None:
    """On 300 random linkages, cold and warm; B lies left of the diagonal from A to O4 on branch +1."""
    rng = np.random.default_rng(7)
    missing = 0
    for _ in range(300):
        linkage = random_linkage(rng)
        theta_2 = rng.uniform(-10.0, 10.0, 8)
        branch = rng.choice(np.array([1, -1], dtype=np.int8), 8)
        scene = Scene(linkage, Motion(theta_2))
        answer = engine.answer(scene, Command(theta_2, branch, None, 0.0))
        here = answer.assembled
        a, b = answer.quantities["A"], answer.quantities["B"]
        foot = linkage.ground * np.array([math.cos(linkage.ground_angle), math.sin(linkage.ground_angle)])
        side = (foot - a)[:, 0] * (b - a)[:, 1] - (foot - a)[:, 1] * (b - a)[:, 0]
        assert np.array_equal(np.sign(side[here]), branch[here])
        assert np.isnan(b[~here]).all()
        # circles about A and O4 meet: the criterion, from squares of lengths alone
        d2 = ((foot - linkage.input.length * np.c_[np.cos(theta_2), np.sin(theta_2)]) ** 2).sum(axis=1)
        lengths = linkage.coupler.length, linkage.output.length
        meets = (d2 <= sum(lengths) ** 2) & (d2 >= (lengths[0] - lengths[1]) ** 2)
        assert np.array_equal(meets, here)
        missing += int((~here).sum())
    assert missing > 100, "the sample must hold positions that do not assemble"


@each_witness
@pytest.mark.parametrize("offset", [1e-3, 1e-6, 1e-9, 1e-12])
def test_assembles_up_to_a_limit_and_not_beyond(engine: Any, offset: float) -> None:
    linkage = bars(MECHANISMS["triple rocker"], 0.0)
    d, a, b, c = linkage.lengths
    limit = math.acos((d * d + a * a - (b + c) ** 2) / (2.0 * d * a))  # bars 3 and 4 stretched
    inward = -offset
    for sign in (1, -1):
        for branch in (1, -1):
            scene = Scene(linkage, Motion(limit + sign * inward, 1.0, branch=branch))
            answer = engine.answer(scene, command(scene))
            assert bool(answer.assembled[0]) == (sign > 0)
            assert np.isnan(answer.quantities["torque"][0]) == (not answer.assembled[0])


@each_witness
def test_positions_only(engine: Any) -> None:
    scene = Scene(bars(MECHANISMS["crank-rocker"]), Motion(np.array([0.5, 1.0])))
    quantities = engine.answer(scene, command(scene)).quantities
    assert "theta_3" in quantities and "torque" not in quantities and "omega_3" not in quantities


@each_engine
def test_angles_are_continuous(engine: Any) -> None:
    scene = Scene(bars(MECHANISMS["drag link"]), Motion(np.linspace(0.0, 12.0, 240), 1.0))
    answer = engine.answer(scene, command(scene))
    assert -math.pi < answer.quantities["theta_4"][0] <= math.pi
    assert np.abs(np.diff(answer.quantities["theta_4"])).max() < 1.0
    assert np.ptp(answer.quantities["theta_4"]) > math.tau


def test_massless_bars() -> None:
    d, a, b, c = MECHANISMS["crank-rocker"]
    linkage = FourBar(d, Bar(a, 1.0), Bar(b), Bar(c))
    scene = Scene(linkage, Motion(np.linspace(0.0, 6.0, 7), 10.0), 2, LOADS)
    assert failures(ENGINES[0], scene, command(scene)) == []
    refused = MujocoInverse().answer(scene, command(scene))
    assert refused.refusal is not None and "bar 3" in refused.refusal and not refused.quantities


def test_the_floor_of_mujoco_is_where_it_is_stated_to_be() -> None:
    d, a, b, c = MECHANISMS["crank-rocker"]
    scene = Scene(FourBar(d, Bar(a, 1.0), Bar(b, 1.0), Bar(c, LEAST, LEAST)))
    MujocoTree(scene)
    for mass, inertia in ((0.9 * LEAST, LEAST), (LEAST, 0.9 * LEAST)):
        below = replace(scene, linkage=replace(scene.linkage, output=Bar(c, mass, inertia)))
        assert MujocoInverse().answer(below, command(below)).refusal is not None
        with pytest.raises(ValueError, match="mass and inertia"):
            MujocoTree(below)


@dataclass(frozen=True)
class Wind:
    """An effect that no engine knows."""

    key: ClassVar[str] = "wind"


@each_witness
def test_an_unknown_effect_is_refused_by_name(engine: Any) -> None:
    scene = Scene(bars(MECHANISMS["crank-rocker"]), Motion(1.0, 1.0), 2, (), (Wind(),))  # type: ignore[arg-type]
    assert "'wind'" in (engine.answer(scene, command(scene)).refusal or "")


@pytest.mark.parametrize("tree", TREES, ids=IDS)
class TestPlantedFaults:
    """Each fault inside an engine must show in the comparison with the formulas."""

    def judged(self, tree: Any) -> list[str]:
        scene = Scene(bars(MECHANISMS["crank-rocker"]), Motion(np.linspace(0.3, 6.0, 6), 10.0, 3.0), 4, LOADS, EFFECTS)
        engine = dict(zip(TREES, ENGINES, strict=True))[tree]
        return failures(engine, scene, command(scene))

    def test_none(self, tree: Any) -> None:
        assert self.judged(tree) == []

    def test_no_drift(self, tree: Any, monkeypatch: pytest.MonkeyPatch) -> None:
        right = tree.drift
        monkeypatch.setattr(tree, "drift", lambda self, v: 0.0 * right(self, v))
        assert {"alpha_3", "alpha_4", "torque", "F12"} <= set(self.judged(tree))

    def test_torque_off_by_1e9(self, tree: Any, monkeypatch: pytest.MonkeyPatch) -> None:
        right = tree.turn
        monkeypatch.setattr(tree, "turn", lambda self, bar: right(self, bar) * (1.0 + 1e-9))
        assert {"torque", "omega_3"} <= set(self.judged(tree))

    def test_loop_force_put_back_with_the_wrong_sign(self, tree: Any, monkeypatch: pytest.MonkeyPatch) -> None:
        right = tree.forces
        monkeypatch.setattr(tree, "forces", lambda self, force, torque: right(self, -force, torque))
        assert {"F12", "F32", "F14"} <= set(self.judged(tree))

    def test_an_effect_left_out(self, tree: Any, monkeypatch: pytest.MonkeyPatch) -> None:
        right = tree.twist
        monkeypatch.setattr(tree, "twist", lambda self, bar, m: None if bar == 3 else right(self, bar, m))
        assert "torque" in self.judged(tree)

    def test_the_other_branch(self, tree: Any, monkeypatch: pytest.MonkeyPatch) -> None:
        right = loop.Position.find
        monkeypatch.setattr(loop.Position, "find", lambda self, theta_2, branch: right(self, theta_2, -branch))
        assert {"theta_3", "theta_4", "torque"} <= set(self.judged(tree))

    def test_an_angle_off_by_1e13(self, tree: Any, monkeypatch: pytest.MonkeyPatch) -> None:
        right = tree.angle
        monkeypatch.setattr(tree, "angle", lambda self, bar: right(self, bar) + 1e-13)
        assert {"theta_3", "theta_4"} <= set(self.judged(tree))
