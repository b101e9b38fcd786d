"""The history of one engine: its released versions, installed by themselves, and where something changed."""

import csv
import io
import json
import math
import os
import sys
import zipfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from fourbar_validation.cli import status
from fourbar_validation.compare.rows import AGREES, FAILS, Row, write_rows
from fourbar_validation.lab.simulators import releases, versions, versions_page
from fourbar_validation.lab.simulators.releases import Release
from fourbar_validation.regression.history import HistoryRun
from fourbar_validation.regression.record import About, write_about
from fourbar_validation.run.elsewhere import ElsewhereError, Ended
from tests.support.here import judge_here

LISTED = "pin (3.2)\nAvailable versions: 3.2, 3.1, 3.0, 2.7\n"


def wheel(folder: Path, version: str, code: str) -> None:
    """A release of the engine "toy", of one module."""
    info = f"toy-{version}.dist-info"
    files = {
        "toy.py": code,
        f"{info}/METADATA": f"Metadata-Version: 2.1\nName: toy\nVersion: {version}\n",
        f"{info}/WHEEL": "Wheel-Version: 1.0\nGenerator: test\nRoot-Is-Purelib: true\nTag: py3-none-any\n",
    }
    files[f"{info}/RECORD"] = "".join(f"{name},,\n" for name in (*files, f"{info}/RECORD"))
    with zipfile.ZipFile(folder / f"toy-{version}-py3-none-any.whl", "w") as archive:
        for name, text in files.items():
            archive.writestr(name, text)


def unpacking(folder: Path) -> Callable[..., Ended]:
    """What pip does with wheels that require nothing."""

    def pip(python: Path, *arguments: str) -> Ended:
        if arguments[0] == "index":
            return Ended("toy (1.1)\nAvailable versions: 1.1, 1.0\n", "", False, "")
        file = folder / f"{arguments[3].replace('==', '-')}-py3-none-any.whl"
        if len(arguments) > 4 or not file.is_file():
            missing = f"Could not find a version that satisfies the requirement {arguments[-1]}"
            return Ended("", f"ERROR: {missing} (from versions: none)\nERROR: No match\n", True, "ERROR: No match")
        with zipfile.ZipFile(file) as archive:
            archive.extractall(next(python.parents[1].rglob("site-packages")))
        return Ended("", "", False, "")

    return pip


def test_each_release_loads_by_itself_or_says_why(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of two local wheels; RELEASES=pip lets pip itself install them."""
    wheel(tmp_path, "1.0", "import numpy")
    wheel(tmp_path, "1.1", "raise ImportError('libtoy.so.7 is not there')")
    if os.environ.get("RELEASES") == "pip":
        for name, value in {"CONFIG_FILE": "/dev/null", "NO_INDEX": "1", "FIND_LINKS": str(tmp_path)}.items():
            monkeypatch.setenv(f"PIP_{name}", value)
    else:
        monkeypatch.setattr(releases, "run_pip", unpacking(tmp_path))
    monkeypatch.setitem(releases.MODULES, "toy", "toy")
    assert releases.list_released("toy", None, None) == ["1.0", "1.1"]
    python, why = releases.install_version("toy", "1.0", tmp_path / "cache")
    assert python is not None and python.is_file() and python != Path(sys.executable) and not why
    python, why = releases.install_version("toy", "1.1", tmp_path / "cache")
    assert python is None and why == "does not load: ImportError: libtoy.so.7 is not there"
    assert releases.install_version("toy", "1.0", tmp_path / "cache", ["nothing-such"])[1] == "", (
        "it is installed alone"
    )
    missing = "Could not find a version that satisfies the requirement toy==0.9"
    assert releases.install_version("toy", "0.9", tmp_path / "cache") == (None, f"does not install: {missing}")
    monkeypatch.setitem(releases.MODULES, "toy", "numpy")  # which the harness has
    stead = releases.install_version("toy", "1.0", tmp_path / "cache")
    assert stead == (None, "does not load: another toy is found in its stead") and "toy" not in sys.modules


@pytest.mark.parametrize(
    ("arguments", "stated"),
    [
        (["mujco"], 'must be one of mujoco, pinocchio, exudyn, opensim, drake; did you mean "mujoco"?'),
        (["pin"], 'did you mean "pinocchio"?'),
        (["pinocchio", "no_such_scene.toml"], "no_such_scene.toml"),
        (["pinocchio", "--from", "3.4"], "is no released version; there are 2.7 to 3.2"),
        (["pinocchio", "--from", "3.1", "--to", "3.0"], "must come before --to (3.0): two versions make a history"),
    ],
)
def test_bad_input_is_one_line(
    arguments: list[str], stated: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(releases, "run_pip", lambda *_: Ended(LISTED, "", False, ""))
    assert status(["standing", "--versions", *arguments]) == 2
    error = capsys.readouterr().err
    assert stated in error and error.count("\n") == 1


@pytest.mark.parametrize("answer", ["", "bye", "[]", '{"a": NaN}', '{"a": -1.0}', '{"a": "soon"}', '{"b": 1.0}'])
def test_a_time_that_is_none_is_left_out(answer: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(versions, "start_harness", lambda _: Ended(answer, "", False, ""))
    assert versions.time_position(Path("python"), Path("scene.toml"), ["a"]) == {}


def judged(version: str, error: float, verdict: str = AGREES) -> Release:
    """A run of two rows, of which the first errs so."""
    about = About({"mujoco": version, "numpy": "2"}, "here", {"engines": "mujoco-inverse"})
    rows = [
        Row("a", "mujoco-inverse", "exact", "F43", error, 1e-6, verdict, "", 0.0, 1.0),
        Row("a", "mujoco-inverse", "exact", "torque", 1e-9, 1e-6, AGREES, "", 0.0, 1.0),
    ]
    return Release(version, HistoryRun(about, rows, {}), seconds={"mujoco-inverse": 1e-3})


def made_up(changes: dict[int, tuple[float, str]], broken: set[int], tried: list[int]) -> versions.Try:
    """An engine of versions "0", "1", ... whose error changes at some of them."""

    def attempt(version: str) -> Release:
        number = int(version)
        tried.append(number)
        if number in broken:
            return Release(version, None, "does not load: no reason")
        return judged(version, *changes[max(at for at in changes if at <= number)])

    return attempt


FROM_0_TO_31 = [str(number) for number in range(32)]


def test_a_bisection_runs_what_it_needs_and_names_every_change() -> None:
    tried: list[int] = []
    changes = {0: (0.5, FAILS), 7: (1e-7, AGREES), 21: (1e-3, FAILS)}
    found = versions.bisect_versions(FROM_0_TO_31, made_up(changes, {0, 15, 20}, tried))
    assert len(tried) == len(set(tried)) == len(found) <= 17
    sentences = versions_page.describe_changed(found)
    assert [sentence.partition(":")[0] for sentence in sentences] == ["6 -> 7", "19 -> 21"]
    assert "verdict got better" in sentences[0] and "F43: error 5.00e-01 -> 1.00e-07" in sentences[0]
    alike: list[int] = []
    assert not versions_page.describe_changed(
        versions.bisect_versions(FROM_0_TO_31, made_up({0: (1e-7, AGREES)}, set(), alike))
    )
    assert alike == [0, 31]


def test_a_scan_runs_every_version(monkeypatch: pytest.MonkeyPatch) -> None:
    judge_here(monkeypatch)
    tried: list[int] = []
    changes = {0: (1e-7, AGREES), 3: (1e-3, FAILS), 4: (1e-7, AGREES)}
    found = list(versions.apply_each(made_up(changes, set(), tried), FROM_0_TO_31[:6], 2, seconds=None))
    assert sorted(tried) == list(range(6)) == [int(release.version) for release in found]
    assert [sentence.partition(":")[0] for sentence in versions_page.describe_changed(found)] == ["2 -> 3", "3 -> 4"]


def test_the_command_runs_each_version_and_says_why_one_has_no_answer(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    given = {"3.0": judged("3.0", 1e-3, FAILS), "3.2": judged("3.2", 1e-7)}

    def elsewhere(python: Path, arguments: list[str], out: Path) -> None:
        assert python == Path("its") and "--engines=pinocchio-inverse" in arguments
        if (release := given.get(out.name)) is None:
            raise ElsewhereError("its: the suite did not run there: no reason")
        assert release.run is not None
        (out / "results.csv").write_text(
            write_rows(replace(row, engine="pinocchio-inverse") for row in release.run.rows)
        )
        write_about(release.run.about, out)

    judge_here(monkeypatch)
    monkeypatch.setattr(releases, "run_pip", lambda *_: Ended(LISTED, "", False, ""))
    loads = {"2.7": (None, "does not load: libtoy.so.7")}
    monkeypatch.setattr(versions, "install_version", lambda _, version, *__: loads.get(version, (Path("its"), "")))
    monkeypatch.setattr(versions, "run_elsewhere", elsewhere)
    monkeypatch.setattr(versions, "time_position", lambda *_: {"pinocchio-inverse": 1e-3})
    assert status(["standing", "--versions", "pinocchio", "--out", str(tmp_path)]) == 0
    printed = capsys.readouterr().out
    for line in (
        "2.7 does not load: libtoy.so.7",
        "3.1 the suite did not run there: no reason",
        "3.0 -> 3.2: 1 verdict",
    ):
        assert line in printed
    assert {file.name for file in tmp_path.glob("versions.*")} == {
        f"versions.{x}" for x in ("md", "svg", "csv", "json")
    }
    assert status(["standing", "--versions", "pinocchio", "--to", "3.1", "--out", str(tmp_path)]) == 3, (
        "one version is no history"
    )


def test_page_table_and_chart_show_each_version_or_why_not() -> None:
    nan = judged("1.2", math.nan, FAILS)
    found = [judged("1.0", 1e-3, FAILS), Release("1.1", None, "does not load: libtoy.so.7"), nan, judged("2.0", 1e-7)]
    texts = versions_page.write_files("mujoco", found, 5)
    page = texts["versions.md"]
    assert "4 released versions of mujoco" in page and "| 1.1 |" in page and "libtoy.so.7" in page
    assert "5 more versions were not needed" in page and "- 1.2 -> 2.0: 1 verdict got better" in page
    rows = list(csv.DictReader(io.StringIO(texts["versions.csv"])))
    assert [row["version"] for row in rows] == ["1.0", "1.1", "1.2", "2.0"] and float(rows[3]["F43"]) == 1e-7
    kept = json.loads(texts["versions.json"])
    assert kept["schema"] == "fourbar-versions/1" and [each.get("F43") for each in kept["versions"]][::3] == [
        1e-3,
        1e-7,
    ]
    assert texts["versions.svg"].startswith("<svg") and "1.2" in texts["versions.svg"]
