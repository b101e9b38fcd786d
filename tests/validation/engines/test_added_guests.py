"""Hostile witnesses: whatever one does costs its own rows, and nothing that it does makes a run green."""

import ctypes
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pytest

import fourbar
from fourbar.errors import FAILED, InputError
from fourbar.files import save
from fourbar_validation import Answer
from fourbar_validation.compare.columns import read_columns
from fourbar_validation.compare.rows import AGREES, FAILS, REFUSES, Row
from fourbar_validation.engines import added, output
from fourbar_validation.engines.free_body import FreeBody
from fourbar_validation.report.record import Record
from fourbar_validation.report.summary import Summary
from fourbar_validation.run import pool
from fourbar_validation.run.run import RunOptions, run
from fourbar_validation.run.selection import choose_witnesses
from fourbar_validation.scenes.suites import read_scene_files
from tests.support.here import judge_here
from tests.support.scenes import crank_rocker
from tests.whole.test_imports import ROOT

HERE = "tests.validation.engines.test_added_guests:"
SCENE = crank_rocker(motion=fourbar.Motion(fourbar.Sweep(0.1, 6.38, 8), 10.0))


class Right:
    """The free bodies under another name, and what the hostile ones change of them."""

    name = "right"

    def answer(self, scene: Any, at: Any) -> Answer:
        return FreeBody().answer(scene, at)


class Leaves(Right):
    name = "sys.exit(0)"

    def answer(self, scene: Any, at: Any) -> Answer:
        sys.exit(0)


class Hopeless(BaseException):
    def __str__(self) -> str:
        raise RuntimeError


class Raises(Right):
    name = "a BaseException whose message raises"

    def answer(self, scene: Any, at: Any) -> Answer:
        raise Hopeless


class Interrupts(Right):
    name = "KeyboardInterrupt"

    def answer(self, scene: Any, at: Any) -> Answer:
        raise KeyboardInterrupt


class Setting(Right):
    name = "a setting that is no text"

    def answer(self, scene: Any, at: Any) -> Answer:
        answer = super().answer(scene, at)
        answer.setting = 628  # type: ignore[assignment]
        return answer


class Writes(Right):
    name = "writes into the command"

    def answer(self, scene: Any, at: Any) -> Answer:
        at.theta_2[:] = 0.0
        return super().answer(scene, at)


class Forces(Right):
    """Whatever it is given, made writable by force."""

    name = "writes by force"

    def answer(self, scene: Any, at: Any) -> Answer:
        object.__setattr__(scene.linkage, "input", scene.linkage.output)
        for array in (at.theta_2, at.branch):
            array.flags.writeable = True
            array[:] = 0
        return Answer(self.name, "wrong", refusal="done")


class Complex(Right):
    name = "complex numbers"
    become: ClassVar[Any] = complex

    def answer(self, scene: Any, at: Any) -> Answer:
        answer = super().answer(scene, at)
        answer.quantities["torque"] = answer.quantities["torque"].astype(self.become)
        return answer


class Objects(Complex):
    name = "objects"
    become = object


class Texts(Complex):
    name = "texts"
    become = str


class Infinite(Right):
    name = "infinite"

    def answer(self, scene: Any, at: Any) -> Answer:
        answer = super().answer(scene, at)
        answer.quantities["F12"] = np.inf * answer.quantities["F12"]
        return answer


class Mute(Right):
    name = "an empty refusal"

    def answer(self, scene: Any, at: Any) -> Answer:
        return Answer(self.name, "exact", refusal=" ")


class Elsewhere(Right):
    name = "answers another motion"

    def answer(self, scene: Any, at: Any) -> Answer:
        return super().answer(scene, at._replace(speed=0.0))


class Nowhere(Right):
    name = "a motion of no positions"

    def answer(self, scene: Any, at: Any) -> Answer:
        return Answer(self.name, "exact", at._replace(angle=at.theta_2[:0], branch=at.branch[:0]), np.ones(0, bool))


class Evidence(Right):
    """Which the report would take for an observed order, and an excuse."""

    name = "evidence of its own"

    def answer(self, scene: Any, at: Any) -> Answer:
        answer = super().answer(scene, at)
        answer.evidence = {"observed_order": "high", "mass_ratio": None}  # type: ignore[dict-item]
        answer.quantities["torque"] = 1.01 * answer.quantities["torque"]
        answer.predicted = {"torque": np.full(len(at.theta_2), np.inf)}
        return answer


class Loud(Right):
    name = "200 kB"

    def answer(self, scene: Any, at: Any) -> Answer:
        print("\x1b]0;owned\x07begin")
        ctypes.CDLL(None).puts(b"from C")
        os.write(2, b"x" * 200_000)
        print("end", file=sys.stderr)
        raise ValueError("y" * 200_000)


class Closes(Right):
    name = "closes its output"

    def answer(self, scene: Any, at: Any) -> Answer:
        sys.stdout.close()
        os.close(1)
        os.close(2)
        raise ValueError("closed")


class Numpy(Right):
    name = "another arithmetic"

    def answer(self, scene: Any, at: Any) -> Answer:
        np.seterr(all="raise")
        raise ValueError("all raise")


class Exits(Right):
    name = "os._exit(0)"

    def answer(self, scene: Any, at: Any) -> Answer:
        os._exit(0)


REASONS = {
    "Leaves": "SystemExit: 0",
    "Raises": "Hopeless: its message raises RuntimeError",
    "Interrupts": "KeyboardInterrupt:",
    "Setting": "TypeError: setting must be a text, not a int",
    "Writes": "ValueError: assignment destination is read-only",
    "Complex": "TypeError: torque must hold real numbers, not complex128",
    "Objects": "TypeError: torque must hold real numbers, not object",
    "Texts": "TypeError: torque must hold real numbers, not <U",
    "Mute": "ValueError: an empty refusal refuses without a reason",
    "Elsewhere": "ValueError: at.omega_2 is too far from the command",
    "Nowhere": "ValueError: at",
    "Loud": "ValueError: yyyy",
    "Closes": "ValueError: closed",
    "Numpy": "ValueError: all raise",
}
"""Of those that the whole answer fails."""
OTHERS = ("Forces", "Infinite", "Evidence")


def by_command(out: Path, names: Sequence[str], *options: str) -> "subprocess.CompletedProcess[str]":
    """Two scenes judged in one worker by witnesses of this file and the free bodies, over an earlier run's table."""
    for name in ("scene", "second"):
        save(SCENE, out / f"{name}.toml")
    (out / "out").mkdir()
    (out / "out" / "results.csv").write_text("of an earlier run")
    line = [sys.executable, "-m", "validation", "run", str(out / "scene.toml"), str(out / "second.toml")]
    line += ["--engines=free-body", "--workers=1", f"--out={out / 'out'}", *options]
    line += [f"--witness={HERE}{name}" for name in names]
    return subprocess.run(line, cwd=ROOT, capture_output=True, text=True, check=False)


def rows_of(out: Path) -> dict[str, list[Row]]:
    rows: dict[str, list[Row]] = {}
    for row in read_columns(out / "out" / "results.csv"):
        rows.setdefault(row.engine, []).append(row)
    return rows


@pytest.fixture(scope="module")
def judged(tmp_path_factory: pytest.TempPathFactory) -> dict[str, list[Row]]:
    """The rows of each engine in one run with all that leave their process alive, pictures and all."""
    out = tmp_path_factory.mktemp("hostile")
    done = by_command(out, ["Right", *REASONS, *OTHERS])
    assert done.returncode == 1, done.stderr
    assert not re.search("\x1b]0|owned|xxx|from C", done.stdout + done.stderr)
    text = (out / "out" / "output.txt").read_text()
    assert text.count("second: 200 kB\n\\x1b]0;owned\\x07begin") == 1 and "from C" in text and "end\n" in text
    assert "bytes left out" in text and len(text) < 5 * output.KEPT
    return rows_of(out)


@pytest.mark.timeout(300)
@pytest.mark.parametrize("name", REASONS)
def test_a_hostile_witness_fails_under_its_own_name(name: str, judged: dict[str, list[Row]]) -> None:
    rows = judged[globals()[name].name]
    assert {(row.scene, row.quantity, row.verdict) for row in rows} == {(s, "all", FAILS) for s in ("scene", "second")}
    assert all(row.reason.startswith(REASONS[name]) and len(row.reason) < 600 for row in rows)
    assert {row.reason.endswith("; what it printed: output.txt") for row in rows} == {name == "Loud"}


def test_no_other_witness_fails_by_a_hostile_one(judged: dict[str, list[Row]]) -> None:
    for name in ("formulas", "free-body", "right"):
        assert {row.verdict for row in judged[name]} == {AGREES}
    assert {row.verdict for row in judged["writes by force"]} == {REFUSES}
    assert {row.quantity for row in judged["infinite"] if row.failed} == {"F12"}
    assert {row.quantity for row in judged["evidence of its own"] if row.failed} == {"torque"}


@pytest.mark.timeout(300)
def test_one_that_ends_its_process_as_if_in_order_fails_alone(tmp_path: Path) -> None:
    assert by_command(tmp_path, ["Exits"], "--no-pictures").returncode == 1
    rows = rows_of(tmp_path)
    assert {row.reason for row in rows["os._exit(0)"]} == {"the engine crashed its process (exit code 0)"}
    assert {row.verdict for row in rows["free-body"]} == {AGREES} and len(rows["os._exit(0)"]) == 2


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("import sys; sys.exit(0)", "cannot be imported: SystemExit: 0"),
        ("import os; os._exit(0)", "it ends its process (exit code 0)"),
        ("import atexit, os; atexit.register(os._exit, 0)", "AttributeError: module 'imported' has no attribute"),
        ("import time; time.sleep(3600)", "it takes more than 2 s"),
        ("print(1 / 0)", "ZeroDivisionError"),
    ],
)
def test_what_a_module_does_where_it_is_imported_is_one_line(
    text: str, reason: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "imported.py").write_text(text)
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr(added, "LONGEST_IMPORT", 2.0 if "sleep" in text else 60.0)
    with pytest.raises(InputError, match=re.escape(reason)):
        added.read_witnesses(["imported:Witness"], ())
    assert "imported" not in sys.modules


WITNESS = """
class Mine:
    name = "mine"

    def answer(self, scene, at):
        import near
        return near.answer(scene, at)
"""
NEAR = """
from fourbar_validation.engines.free_body import FreeBody

def answer(scene, at):
    answer = FreeBody().answer(scene, at)
    answer.quantities["torque"] = FACTOR * answer.quantities["torque"]
    return answer
"""


def test_parts_judged_with_another_code_or_limit_are_made_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Runs that are interrupted once the first part is there; what the second one says of its parts."""
    monkeypatch.syspath_prepend(tmp_path)
    (tmp_path / "mine.py").write_text(WITNESS)
    save(SCENE, tmp_path / "scene.toml")
    suite = read_scene_files((tmp_path / "scene.toml",))
    judge_here(monkeypatch)

    def notes(factor: str, seconds: float | None = None) -> list[str]:
        (tmp_path / "near.py").write_text(NEAR.replace("FACTOR", factor))
        steps = run(
            suite, tmp_path / "out", added.read_witnesses(["mine:Mine"], ()), RunOptions(seconds=seconds, drawn=False)
        )
        found = []
        for step in steps:
            found += [step] if isinstance(step, str) else []
            if any((tmp_path / "out" / "parts").iterdir()):
                break
        steps.close()
        return found

    again = "made again: the parts of another run"
    notes("1.0")
    shutil.rmtree(tmp_path / "out")
    monkeypatch.setattr(added, "OURS", frozenset(sys.modules) - {"mine", "near"})  # not loaded by the witness, but here
    assert notes("1.0") == [] == notes("1.0")
    assert notes("1.01") == [f"{again} (witnesses)"]
    assert notes("1.01", 5.0) == [f"{again} (time limit)"]


def test_a_scene_without_rows_fails(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    save(SCENE, tmp_path / "scene.toml")
    judge_here(monkeypatch)
    monkeypatch.setattr(pool, "judge_for_report", lambda name, *_, **__: Record(name))
    *_, last = run(
        read_scene_files((tmp_path / "scene.toml",)),
        tmp_path / "out",
        choose_witnesses("free-body"),
        RunOptions(drawn=False),
    )
    assert isinstance(last, Summary) and last.counts.status == FAILED
    assert "nothing was judged" in (tmp_path / "out" / "results.csv").read_text()
