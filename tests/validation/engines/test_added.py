"""Witnesses from outside: the documented one is run, and one that breaks costs its own rows."""

import re
import sys
from collections.abc import Iterator
from importlib import import_module
from importlib.metadata import EntryPoint
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pytest

import fourbar
from fourbar.effects.spring import SpringEnd
from fourbar.errors import InputError
from fourbar.files import save
from fourbar.quantities import UNKNOWNS
from fourbar_validation import Answer
from fourbar_validation.cli import status
from fourbar_validation.compare.rows import FAILS, REFUSES
from fourbar_validation.engines import added, workers
from fourbar_validation.engines.free_body import FreeBody
from fourbar_validation.engines.witnesses import WITNESSES
from fourbar_validation.run import pool
from fourbar_validation.run.judge import judge
from fourbar_validation.run.selection import choose_witnesses, find_askable, select_scenes
from tests.support.scenes import crank_rocker

HERE = "tests.validation.engines.test_added:"
SCENE = crank_rocker(motion=fourbar.Motion(fourbar.Sweep(0.1, 6.38, 8), 10.0), loads=())
FREE_BODY = tuple(witness for witness in WITNESSES if witness.name == "free-body")


def verdicts(scene: fourbar.Scene, *names: str) -> dict[str, dict[str, str]]:
    """By engine and quantity, of the witnesses of these names in this file and the free bodies."""
    witnesses = (*added.read_witnesses([name if ":" in name else HERE + name for name in names], ()), *FREE_BODY)
    found: dict[str, dict[str, str]] = {}
    for row in judge("scene", scene, witnesses).rows:
        found.setdefault(row.engine, {})[row.quantity] = row.verdict
    return found


@pytest.fixture(scope="module")
def adapter(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    folder = tmp_path_factory.mktemp("witness")
    page = (Path(__file__).parents[3] / "docs" / "adding-a-witness.md").read_text(encoding="utf-8")
    (code,) = re.findall(r"```python\n(.*?)```", page, re.DOTALL)
    (folder / "toy_witness.py").write_text(code)
    (folder / "toy_world.py").write_text((Path(__file__).parents[2] / "support" / "toy_world.py").read_text())
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "path", [str(folder), *sys.path])
        import_module("toy_witness")  # while the folder is on the path
        yield "toy_witness:Toy"


def test_the_documented_one_agrees(adapter: str) -> None:
    found = verdicts(SCENE, adapter)["toy-world"]
    assert set(found.values()) == {"agrees"}
    assert {"theta_3", "theta_4", "F12", "F32", "F43", "F14", "torque", "closure"} <= found.keys()
    assert "alpha_3" not in found


def test_the_documented_one_refuses_what_it_cannot(adapter: str) -> None:
    found = verdicts(crank_rocker(), adapter)
    assert found["toy-world"]["all"] == REFUSES and FAILS not in found["free-body"].values()


def test_another_mass_in_the_documented_one_fails(adapter: str, monkeypatch: pytest.MonkeyPatch) -> None:
    import toy_world

    right = toy_world.World.bar
    monkeypatch.setattr(toy_world.World, "bar", lambda self, mass, *rest: right(self, 1.00001 * mass, *rest))
    assert verdicts(SCENE, adapter)["toy-world"]["F12"] == FAILS


class Right:
    """The free bodies under another name, held to round-off."""

    name = "right"

    def answer(self, scene: Any, at: Any) -> Answer:
        return FreeBody().answer(scene, at)


class OfAnyBar(Right):
    name = "of any bar"
    commands = ("theta_4", "stroke")
    linear_drive = True

    def answer(self, scene: Any, at: Any) -> Answer:
        assert at.stroke is None or np.isnan(at.angle).all()
        answer = super().answer(scene, at)
        return Answer(self.name, "exact", at, answer.assembled, answer.quantities)


class ThetaFourAlone(OfAnyBar):
    """It does not say where the input stands."""

    name = "theta_4 alone"

    def answer(self, scene: Any, at: Any) -> Answer:
        answer = super().answer(scene, at)
        del answer.quantities["theta_2"]
        return answer


def test_a_witness_is_asked_for_the_commands_that_its_class_names() -> None:
    four = crank_rocker(motion=fourbar.Motion(theta_4=fourbar.Sweep(1.8, 2.5, 8), omega_4=3.0))
    three = crank_rocker(motion=fourbar.Motion(theta_3=fourbar.Sweep(0.4, 0.8, 8), omega_3=3.0))
    stroke = fourbar.Motion(stroke=fourbar.Sweep(0.25, 0.35, 8), stroke_speed=0.2, side="left")
    drive = fourbar.LinearDrive(SpringEnd(1, 0.3, 2.2), SpringEnd(2, 0.12, 0.4))
    for scene in (four, crank_rocker(motion=stroke, drive=drive)):
        found = verdicts(scene, "OfAnyBar", "ThetaFourAlone", "Right")
        assert set(found["of any bar"].values()) == set(found["theta_4 alone"].values()) == {"agrees"}
        assert {"theta_3", "alpha_4", "F12"} <= found["of any bar"].keys() and "closure" not in found["theta_4 alone"]
        assert found["right"] == {"all": REFUSES}
    assert verdicts(three, "OfAnyBar")["of any bar"] == {"all": REFUSES}


class Angle(Right):
    name = "angle"
    quantities: ClassVar[tuple[str, ...]] = ("theta_3",)

    def answer(self, scene: Any, at: Any) -> Answer:
        answer = super().answer(scene, at)
        return Answer(self.name, "exact", at, answer.assembled, {"theta_3": answer.quantities["theta_3"]})


class Raises(Right):
    name = "raises"

    def answer(self, scene: Any, at: Any) -> Answer:
        raise RuntimeError("no\nlicence")


class Empty(Right):
    name = "empty"

    def answer(self, scene: Any, at: Any) -> Any:
        return None


class Lacks(Right):
    """One quantity NaN, one missing."""

    name = "lacks"
    quantities: ClassVar[tuple[str, ...]] = ("theta_3", "theta_4", "torque")

    def answer(self, scene: Any, at: Any) -> Answer:
        answer = super().answer(scene, at)
        theta = answer.quantities["theta_3"]
        return Answer(self.name, "wrong", at, answer.assembled, {"theta_3": theta, "theta_4": np.nan * theta})


class Shapes(Right):
    name = "shapes"

    def answer(self, scene: Any, at: Any) -> Answer:
        answer = super().answer(scene, at)
        answer.quantities["F12"] = answer.quantities["F12"].T
        return answer


class Text(Right):
    name = "text"

    def answer(self, scene: Any, at: Any) -> Answer:
        return Answer(self.name, "wrong", at, np.ones(len(at.theta_2), dtype=bool), {"torque": "much"})  # type: ignore[dict-item]


class Nameless:
    pass


class Loose(Right):
    name = "loose"
    tolerance = (0.1, "")


class Else(Right):
    name = "else"
    quantities = ("heat",)


class OfAnother(Right):
    name = "free-body"


def test_what_answers_as_the_free_bodies_agrees_as_they_do() -> None:
    found = verdicts(SCENE, "Right")
    assert set(found["right"].values()) == {"agrees"}
    assert found["right"].keys() == {*UNKNOWNS, "assembled", "undecided", "closure", "torque_inertia"}
    page = (Path(__file__).parents[3] / "docs" / "adding-a-witness.md").read_text(encoding="utf-8")
    (stated,) = re.findall(r"left out all of (.*?);", page, re.DOTALL)
    assert tuple(re.findall(r"`(\w+)`", stated)) == UNKNOWNS


def test_one_that_answers_no_torque_is_not_held_to_its_inertial_part() -> None:
    found = verdicts(SCENE, "Angle")["angle"]
    assert found == dict.fromkeys(("assembled", "theta_3", "undecided"), "agrees")


def test_wrong_answers_fail_in_their_own_rows_alone() -> None:
    found = verdicts(SCENE, "Raises", "Empty", "Lacks", "Text", "Shapes")
    assert set(found.pop("free-body").values()) == set(found.pop("formulas").values()) == {"agrees"}
    assert found.pop("lacks") == {
        **{"assembled": "agrees", "undecided": "agrees", "theta_3": "agrees", "theta_4": FAILS, "torque": FAILS},
        **{"closure": FAILS, "torque_inertia": FAILS},
    }
    assert {(quantity, verdict) for rows in found.values() for quantity, verdict in rows.items()} == {("all", FAILS)}
    assert found.keys() == {"raises", "empty", "text", "shapes"}


def test_from_the_command_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """`--witness` and `--time-limit`, the scene judged in this process."""
    save(SCENE, tmp_path / "scene.toml")
    limits = []

    over_processes = workers.apply_over_processes

    def here(function: Any, chunks: Any, *rest: Any, seconds: float, instead: Any) -> Iterator[Any]:
        if function is not pool.judge_job:
            return over_processes(function, chunks, *rest, seconds=seconds, instead=instead)
        limits.append(seconds)
        return ((number, [function(job) for job in jobs]) for number, jobs in chunks)

    monkeypatch.setattr(workers, "apply_over_processes", here)
    monkeypatch.setattr("fourbar_validation.run.run.write_html", lambda *_, **__: "")
    out = ["--out", str(tmp_path / "out"), "--engines", "free-body", "--time-limit", "2.5", "--no-pictures"]
    assert (
        status(["run", str(tmp_path / "scene.toml"), "--witness", HERE + "Right", "--witness", HERE + "Raises", *out])
        == 1
    )
    assert limits == [2.5]
    table = (tmp_path / "out" / "results.csv").read_text()
    assert "scene,raises,-,all,,,false,fails,RuntimeError: no licence," in table
    assert re.search(r"^scene,right,exact,torque,.*,true,agrees,equivalence,", table, re.MULTILINE)
    assert "| right | " in (tmp_path / "out" / "report.md").read_text()


@pytest.mark.parametrize(
    ("adapter", "part"),
    [
        ("Right", "must be module:Class"),
        ("no.such:Class", "ModuleNotFoundError"),
        (HERE + "Absent", "AttributeError"),
        (HERE + "Nameless", "`name`"),
        (HERE + "Loose", "`tolerance`"),
        (HERE + "Else", "`quantities`"),
        (HERE + "OfAnother", "name of its own"),
    ],
)
def test_what_is_no_witness_is_refused_in_one_line(adapter: str, part: str) -> None:
    with pytest.raises(InputError) as error:
        select_scenes((), None, None, 0, "", (adapter,))
    assert str(error.value).startswith(f"--witness = {adapter!r}: ") and part in str(error.value)
    assert "\n" not in str(error.value)


def test_entry_points_join_and_a_broken_one_is_missing_with_its_reason(monkeypatch: pytest.MonkeyPatch) -> None:
    points = [EntryPoint("one", HERE + "Right", added.GROUP), EntryPoint("two", "no.such:Class", added.GROUP)]
    monkeypatch.setattr(added, "entry_points", lambda group: [p for p in points if p.group == group])
    _, witnesses = select_scenes((), None, None, 0, "")
    present, missing = find_askable(choose_witnesses(None, witnesses), by_name=False)
    assert present[-1].name == "right"
    assert "No module named 'no'" in dict(missing)["two"]


def test_the_hard_suite_holds_it_to_what_it_states() -> None:
    _, witnesses = select_scenes((), "hard", None, 0, "", (HERE + "Right",))
    assert witnesses[-1].predictor and witnesses[-1].engine().name == "right"
