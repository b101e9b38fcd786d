"""The guide's example is a working effect: read from the page, registered, and judged by the engines."""

import math
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
from fourbar.mjcf import write_mjcf
from fourbar.mjcf.effects import MJCF_OF, NO_MJCF
from fourbar.scene import Scene, command
from fourbar.solve import solve
from fourbar.studies.derivatives import sensitivity
from fourbar.studies.study import vary
from fourbar_validation.compare import effects as in_scales
from fourbar_validation.engines import effects as on_trees
from fourbar_validation.engines import free_body_effects
from fourbar_validation.engines.free_body import FreeBody
from fourbar_validation.run.judge import judge
from tests.validation.engines.test_effects import EXACT, ON_TREES, SIMULATED, failing

PAGE = (Path(__file__).parents[2] / "docs" / "extending.md").read_text(encoding="utf-8")
REFERENCE = (Path(__file__).parents[2] / "docs" / "scene-file.md").read_text(
    encoding="utf-8"
)
PAGE, QUANTITY = PAGE.split("\n## A quantity\n")
TABLES: list[tuple[ModuleType, str]] = [
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
theta_2 = { from = "5 deg", to = "365 deg", steps = 36 }
omega_2 = "10 rad/s"
"""


def block(language: str, page: str = PAGE, number: int = 0) -> str:
    return re.findall(rf"```{language}\n(.*?)```", page, re.S)[number]


@pytest.fixture
def latch(monkeypatch: pytest.MonkeyPatch) -> Iterator[Any]:
    module = ModuleType("fourbar.effects.latch")
    monkeypatch.setitem(sys.modules, module.__name__, module)
    exec(block("python"), module.__dict__)
    monkeypatch.setitem(effects.FILE_OF, "Latch", "latch")
    for number, (translator, table) in enumerate(TABLES, 1):
        assert re.search(
            rf"`{table}` in\s+`{translator.__name__.replace('.', '/')}\.py`", PAGE
        ), table
        names = {**vars(translator), table: {}}
        exec(block("python", number=number), names)
        monkeypatch.setitem(getattr(translator, table), "latch", names[table]["latch"])
    yield module.Latch
    vars(effects).pop("Latch", None)


def guide_scene() -> Scene:
    return loads(SCENE + block("toml"))


def refusals(scene: Scene, engines: list[Any]) -> dict[str, str]:
    """Return the reason of each engine that refuses."""
    return {
        r.engine: r.reason
        for r in judge("scene", scene, engines).rows
        if r.verdict == "refuses"
    }


def test_the_example_is_read_written_and_agreed_on(latch: Any) -> None:
    scene = guide_scene()
    assert scene.effects == (latch(4, 0.2, math.radians(115.0), math.radians(5.0)),)
    assert loads(dump(scene)).effects == scene.effects
    assert latch.example in block("toml")
    assert failing(scene, EXACT) == []
    assert refusals(scene, EXACT) == {}


@pytest.mark.parametrize(
    ("table", "engines"),
    [(on_trees.TERM_OF, ON_TREES), (free_body_effects.WRENCH_OF, {"free-body"})],
)
def test_engines_without_its_row_refuse_the_example(
    latch: Any,
    table: dict[str, Any],
    engines: set[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.delitem(table, "latch")
    assert failing(guide_scene(), EXACT) == []
    reasons = refusals(guide_scene(), EXACT)
    assert reasons.keys() == engines
    assert all("'latch'" in reason for reason in reasons.values())


def test_mjcf_has_no_row_of_the_example_and_refuses_it(latch: Any) -> None:
    assert failing(guide_scene(), SIMULATED) == []
    reasons = refusals(guide_scene(), SIMULATED)
    assert (
        reasons.keys() == {"mujoco-simulated"}
        and "'latch'" in reasons["mujoco-simulated"]
    )
    with pytest.raises(LimitError, match="'latch'"):
        write_mjcf(guide_scene())


def test_without_its_row_nothing_is_judged_by_another_scale(
    latch: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delitem(in_scales.SIZE_OF, "latch")
    rows = judge("scene", guide_scene(), EXACT).rows
    engines = {row.engine for row in rows if row.failed and "'latch'" in row.reason}
    assert engines >= {engine.name for engine in EXACT}


def test_without_its_line_a_file_neither_reads_nor_writes_the_example(
    latch: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    scene = guide_scene()
    monkeypatch.delitem(effects.FILE_OF, "Latch")
    with pytest.raises(InputError, match=r"effects\.latch"):
        guide_scene()
    with pytest.raises(InputError, match=r"effects\.latch"):
        dump(scene)


def test_the_drive_makes_up_for_what_the_example_takes(latch: Any) -> None:
    """Power of the couple, angle and speed those of the free bodies; it acts at few positions, and in both senses."""
    scene = guide_scene()
    with_it, without = solve(scene).torque, solve(replace(scene, effects=())).torque
    assert with_it is not None and without is not None
    motion = FreeBody().answer(scene, command(scene)).quantities
    x = (np.degrees(motion["theta_4"]) - 115.0) / 5.0
    couple = np.where(np.abs(x) < 1.0, -0.8 * x * (1.0 - np.abs(x)), 0.0)
    assert 2 <= np.count_nonzero(couple) < 20 and couple.min() < 0.0 < couple.max()
    power = -couple * motion["omega_4"]
    assert (with_it - without) * 10.0 == pytest.approx(
        power, abs=1e-12 * np.abs(with_it).max(), rel=0
    )


def test_studies_and_sensitivities_know_the_numbers_of_the_example(latch: Any) -> None:
    scene, step = guide_scene(), 1e-6
    couples = [0.2 + step, 0.2 - step]
    torque = solve(vary(scene, {"effects.latch.couple": couples})).torque
    slope = sensitivity(scene).of("torque", "effects.latch.couple")
    assert torque is not None and np.count_nonzero(slope) >= 2
    assert slope == pytest.approx((torque[0] - torque[1]) / (2.0 * step), abs=1e-8)


@pytest.mark.parametrize("place", ["act", "term"])
def test_a_fault_in_the_example_is_caught(
    latch: Any, place: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    right = latch.act if place == "act" else on_trees.TERM_OF["latch"]

    def three_times(*arguments: Any) -> None:
        for _ in range(3):
            right(*arguments)

    if place == "act":
        monkeypatch.setattr(latch, "act", three_times)
    else:
        monkeypatch.setitem(on_trees.TERM_OF, "latch", three_times)
    assert "torque" in {quantity for _, quantity, _ in failing(guide_scene(), EXACT)}


@pytest.mark.parametrize("key", effects.list_kinds())
def test_the_example_of_each_effect_is_read_and_written_back(key: str) -> None:
    example = effects.list_kinds()[key].example
    scene = loads(f"{SCENE}[effects]\n{example}")
    assert [effect.key for effect in scene.effects] == [key]
    assert loads(dump(scene)).effects == scene.effects
    assert example.split("=")[0] in REFERENCE


def test_every_effect_has_a_row_in_each_table() -> None:
    """In MJCF those that have a counterpart; loads have a table of their own in a file."""
    keys = {*effects.list_kinds()}
    assert keys == {*free_body_effects.WRENCH_OF}
    assert (
        keys | {"load"}
        == {*on_trees.TERM_OF}
        == {*in_scales.SIZE_OF}
        == {*MJCF_OF, *NO_MJCF}
    )


def test_the_scene_of_the_reference_names_everything_and_is_agreed_on() -> None:
    scene = loads(SCENE.partition("[motion]")[0] + block("toml", REFERENCE, 1))
    assert [effect.key for effect in scene.effects] == list(effects.list_kinds())
    assert scene.motion.law is not None and scene.loads[0].table is not None
    again = loads(dump(scene))
    assert (again.effects, again.loads, again.motion.law) == (
        scene.effects,
        scene.loads,
        scene.motion.law,
    )
    assert failing(scene, EXACT) == []


NEED_NO_LINE = {
    "docs/findings.md",
    *("lab/fourbar_lab/fault_scenes.py", "lab/fourbar_lab/effects.py"),
}
"""Files in which a new effect need not be named: fed to injected faults, or measured by its example."""


def test_the_guide_names_every_file_that_names_every_effect() -> None:
    root = Path(__file__).parents[2]
    kinds = {getattr(effects, name).key: name for name in effects.FILE_OF}
    files = []
    for path in (
        path
        for top in ("fourbar", "validation", "lab", "docs")
        for path in (root / top).rglob("*.*")
    ):
        if path.suffix in (".py", ".md", ".js"):
            text, name = (
                path.read_text(encoding="utf-8"),
                path.relative_to(root).as_posix(),
            )
            files += (
                [name]
                if all(
                    re.search(rf"\b({key}|{kind})\b", text)
                    for key, kind in kinds.items()
                )
                else []
            )
    assert len(files) > 8
    assert not [
        name
        for name in files
        if name not in NEED_NO_LINE and name.removeprefix("validation/") not in PAGE
    ]


def test_each_name_that_the_guide_places_in_a_file_is_there() -> None:
    root = Path(__file__).parents[2]
    places = re.findall(r"`(\w+)`(?: \w+)? (?:in|of) `([\w/]+\.\w+)`", PAGE + QUANTITY)
    assert len(places) > 9
    for name, file in places:
        folder = root / ("validation" if file.startswith("fourbar_v") else "")
        path = (
            root / "validation" / "fourbar_validation" / file
            if file.startswith("run/")
            else folder / file
        )
        assert re.search(rf"\b{name}\b", path.read_text(encoding="utf-8")), (name, file)


def test_the_places_that_the_guide_to_a_quantity_names_are_there() -> None:
    root = Path(__file__).parents[2]
    files = set(
        re.findall(
            r"`((?:fourbar|fourbar_validation|docs|tests)/[\w/-]+\.\w+)`", QUANTITY
        )
    )
    texts = {
        name: (
            root / ("validation" if name.startswith("fourbar_v") else ".") / name
        ).read_text()
        for name in files
    }
    for name, word in (("__init__", "_scalar("), ("evaluate", "SCALAR_F"), ("loop", "NOT_ANSWERED"), ("scales", "v_A"),
                       ("balls", "omega[k]"), ("results", "`v_A`")):  # fmt: skip
        assert any(
            file.rpartition("/")[2].startswith(name) and word in text
            for file, text in texts.items()
        ), name
