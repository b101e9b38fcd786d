"""The guide's example is a working effect: read from the page, registered, and judged by the engines."""

import re
import sys
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest

from fourbar.effects import REGISTRY
from fourbar.files import dump, loads
from fourbar.scene import Scene, command, solve
from tests.test_effects import EXACT, SIMULATED, failing, refusing
from validation.engines import free_body_effects
from validation.stability.energy import by_energy

PAGE = (Path(__file__).parent.parent / "docs" / "adding-an-effect.md").read_text(encoding="utf-8")
REFERENCE = (Path(__file__).parent.parent / "docs" / "effects.md").read_text(encoding="utf-8")
SCENE = """
[lengths]
ground = "300 mm"
input = "100 mm"
coupler = "250 mm"
output = "220 mm"
[bars]
input = { mass = "0.2 kg" }
coupler = { mass = "0.5 kg" }
output = { mass = "0.4 kg" }
[motion]
theta_2 = { from = "5 deg", to = "365 deg", steps = 12 }
omega_2 = "10 rad/s"
"""


def block(language: str, page: str = PAGE, number: int = 0) -> str:
    return re.findall(rf"```{language}\n(.*?)```", page, re.S)[number]


@pytest.fixture
def windage(monkeypatch: pytest.MonkeyPatch) -> Iterator[Any]:
    module = ModuleType("fourbar.effects.windage")
    monkeypatch.setitem(sys.modules, module.__name__, module)
    exec(block("python"), module.__dict__)
    monkeypatch.setitem(REGISTRY, "windage", module.Windage)
    row = dict(vars(free_body_effects))
    exec(block("python", number=1), row)
    monkeypatch.setitem(free_body_effects.WRENCH_OF, "windage", row["_windage"])
    yield module.Windage


def asked() -> Scene:
    return loads(SCENE + block("toml"))


def test_the_page_is_one_page() -> None:
    assert len(PAGE.splitlines()) <= 120


def test_the_example_is_read_written_and_agreed_on(windage: Any) -> None:
    scene = asked()
    assert scene.effects == (windage(4, 0.002),)
    assert loads(dump(scene)).effects == scene.effects
    assert windage.example in PAGE
    assert failing(scene, EXACT) == []
    assert refusing(scene, SIMULATED) == {"mujoco-simulated"}


def test_without_its_row_the_free_bodies_refuse_the_example(windage: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delitem(free_body_effects.WRENCH_OF, "windage")
    assert failing(asked(), EXACT) == []
    assert refusing(asked(), EXACT) == {"free-body"}


def test_the_power_of_the_example_is_that_of_its_couple(windage: Any) -> None:
    scene = asked()
    s, (_, energy) = solve(scene), by_energy(scene, command(scene))
    assert s.torque == pytest.approx(energy["torque"], abs=1e-13 * np.abs(energy["torque"]).max(), rel=0)


@pytest.mark.parametrize("method", ["add_wrenches", "engine_term"])
def test_a_fault_in_the_example_is_caught(windage: Any, method: str, monkeypatch: pytest.MonkeyPatch) -> None:
    right = getattr(windage, method)

    def three_times(self: Any, *arguments: Any) -> Any:
        acts = [right(self, *arguments) for _ in range(3)]
        return (lambda: [act() for act in acts]) if method == "engine_term" else None

    monkeypatch.setattr(windage, method, three_times)
    assert "torque" in {quantity for _, quantity, _ in failing(asked(), EXACT)}


@pytest.mark.parametrize("key", REGISTRY)
def test_the_example_of_each_effect_is_read_and_written_back(key: str) -> None:
    effect = REGISTRY[key]
    scene = loads(f"{SCENE}[effects]\n{effect.example}")
    assert [type(each) for each in scene.effects] == [effect]
    assert loads(dump(scene)).effects == scene.effects
    assert effect.example.split("=")[0] in REFERENCE


def test_the_scene_of_the_reference_names_everything_and_is_agreed_on() -> None:
    scene = loads(SCENE.partition("[motion]")[0] + block("toml", REFERENCE))
    assert [effect.key for effect in scene.effects] == list(REGISTRY)
    assert scene.motion.law is not None and scene.loads[0].table is not None
    again = loads(dump(scene))
    assert (again.effects, again.loads, again.motion.law) == (scene.effects, scene.loads, scene.motion.law)
    assert failing(scene, EXACT) == []
