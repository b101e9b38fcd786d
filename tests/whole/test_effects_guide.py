"""The guide's example is a working effect: read from the page, registered, and judged by the engines."""

import re
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest

from fourbar import effects
from fourbar.errors import InputError, LimitError
from fourbar.files import dump, loads
from fourbar.files import effects as in_files
from fourbar.files.effects import REGISTRY
from fourbar.mjcf import mjcf
from fourbar.mjcf.effects import MJCF_OF
from fourbar.scene import Scene, command
from fourbar.solve import solve
from fourbar_validation.compare import effects as in_scales
from fourbar_validation.engines import effects as on_trees
from fourbar_validation.engines import free_body_effects
from fourbar_validation.engines.free_body import FreeBody
from fourbar_validation.run.judge import judge
from tests.validation.engines.test_effects import ENGINES, EXACT, SIMULATED, failing

PAGE = (Path(__file__).parents[2] / "docs" / "adding-an-effect.md").read_text(encoding="utf-8")
REFERENCE = (Path(__file__).parents[2] / "docs" / "effects.md").read_text(encoding="utf-8")
TABLES: list[tuple[ModuleType, str]] = [
    (in_files, "REGISTRY"),
    (on_trees, "TERM_OF"),
    (in_scales, "SIZE_OF"),
    (free_body_effects, "WRENCH_OF"),
]
"""Module and table of each row, in the order of the page."""
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
    monkeypatch.setitem(effects.FILE_OF, "Windage", "windage")
    for number, (translator, table) in enumerate(TABLES, 1):
        assert f"`{table}` in `{translator.__name__.replace('.', '/')}.py`" in PAGE
        names = {**vars(translator), table: {}}
        exec(block("python", number=number), names)
        monkeypatch.setitem(getattr(translator, table), "windage", names[table]["windage"])
    yield module.Windage
    vars(effects).pop("Windage", None)


def guide_scene() -> Scene:
    return loads(SCENE + block("toml"))


def refusals(scene: Scene, witnesses: list[Any]) -> dict[str, str]:
    """By engine, why it refuses."""
    return {r.engine: r.reason for r in judge("scene", scene, witnesses).rows if r.verdict == "refuses"}


def test_the_page_is_one_page() -> None:
    assert len(PAGE.splitlines()) <= 120


def test_the_example_is_read_written_and_agreed_on(windage: Any) -> None:
    scene = guide_scene()
    assert scene.effects == (windage(4, 0.002),)
    assert loads(dump(scene)).effects == scene.effects
    assert REGISTRY["windage"].example in block("toml")
    assert failing(scene, EXACT) == []
    assert refusals(scene, EXACT) == {}


@pytest.mark.parametrize(
    ("table", "engines"), [(on_trees.TERM_OF, ENGINES), (free_body_effects.WRENCH_OF, {"free-body"})]
)
def test_engines_without_its_row_refuse_the_example(
    windage: Any, table: dict[str, Any], engines: set[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delitem(table, "windage")
    assert failing(guide_scene(), EXACT) == []
    found = refusals(guide_scene(), EXACT)
    assert found.keys() == engines
    assert all("'windage'" in reason for reason in found.values())


def test_mjcf_has_no_row_of_the_example_and_refuses_it(windage: Any) -> None:
    assert failing(guide_scene(), SIMULATED) == []
    found = refusals(guide_scene(), SIMULATED)
    assert found.keys() == {"mujoco-simulated"} and "'windage'" in found["mujoco-simulated"]
    with pytest.raises(LimitError, match="'windage'"):
        mjcf(guide_scene())


def test_without_its_row_nothing_is_judged_by_another_scale(windage: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delitem(in_scales.SIZE_OF, "windage")
    rows = judge("scene", guide_scene(), EXACT).rows
    engines = {row.engine for row in rows if row.failed and "'windage'" in row.reason}
    assert engines >= {witness.name for witness in EXACT}


def test_without_its_row_a_file_neither_reads_nor_writes_the_example(
    windage: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    scene = guide_scene()
    monkeypatch.delitem(REGISTRY, "windage")
    with pytest.raises(InputError, match=r"effects\.windage"):
        guide_scene()
    with pytest.raises(InputError, match=r"effects\.windage"):
        dump(scene)


def test_the_drive_makes_up_for_what_the_example_takes(windage: Any) -> None:
    """Power c |omega|^3, omega that of the free bodies."""
    scene = guide_scene()
    with_it, without = solve(scene).torque, solve(replace(scene, effects=())).torque
    assert with_it is not None and without is not None
    omega_4 = FreeBody().answer(scene, command(scene)).quantities["omega_4"]
    taken = 0.002 * np.abs(omega_4) ** 3
    assert taken.max() > 0.1
    assert (with_it - without) * 10.0 == pytest.approx(taken, abs=1e-12 * np.abs(with_it).max(), rel=0)


@pytest.mark.parametrize("place", ["act", "term"])
def test_a_fault_in_the_example_is_caught(windage: Any, place: str, monkeypatch: pytest.MonkeyPatch) -> None:
    right = windage.act if place == "act" else on_trees.TERM_OF["windage"]

    def three_times(*arguments: Any) -> None:
        for _ in range(3):
            right(*arguments)

    if place == "act":
        monkeypatch.setattr(windage, "act", three_times)
    else:
        monkeypatch.setitem(on_trees.TERM_OF, "windage", three_times)
    assert "torque" in {quantity for _, quantity, _ in failing(guide_scene(), EXACT)}


@pytest.mark.parametrize("key", REGISTRY)
def test_the_example_of_each_effect_is_read_and_written_back(key: str) -> None:
    example = REGISTRY[key].example
    scene = loads(f"{SCENE}[effects]\n{example}")
    assert [each.key for each in scene.effects] == [key]
    assert loads(dump(scene)).effects == scene.effects
    assert example.split("=")[0] in REFERENCE


def test_every_effect_has_a_row_in_each_table() -> None:
    """But friction by the pin forces in MJCF, which has no counterpart; loads have a table of their own in a file."""
    keys = {getattr(effects, name).key for name in effects.FILE_OF}
    assert keys == {*REGISTRY} == {*free_body_effects.WRENCH_OF}
    assert keys | {"load"} == {*on_trees.TERM_OF} == {*in_scales.SIZE_OF} == {*MJCF_OF, "pin_friction"}


def test_the_scene_of_the_reference_names_everything_and_is_agreed_on() -> None:
    scene = loads(SCENE.partition("[motion]")[0] + block("toml", REFERENCE))
    assert [effect.key for effect in scene.effects] == list(REGISTRY)
    assert scene.motion.law is not None and scene.loads[0].table is not None
    again = loads(dump(scene))
    assert (again.effects, again.loads, again.motion.law) == (scene.effects, scene.loads, scene.motion.law)
    assert failing(scene, EXACT) == []
