"""A run in parts.

The bytes of a whole one, and a line that names what is missing, damaged or of another
run.
"""

import json
import shutil
from pathlib import Path

import pytest

from fourbar.errors import BAD_INPUT, BROKEN, HOLDS, InputError
from fourbar_validation.cli import status
from fourbar_validation.engines.registry import Engine
from fourbar_validation.run import plan
from fourbar_validation.run.plan import RunPart
from fourbar_validation.run.store import Store
from tests.support.here import judge_here

OPTIONS = ["--random", "7", "--engines", "free-body", "--no-pictures"]
TABLES = ("results.csv", "results.parquet")


@pytest.fixture(autouse=True)
def small_tasks(monkeypatch):
    """Two scenes a task, judged in this process."""
    judge_here(monkeypatch)
    monkeypatch.setattr(plan, "SCENES_OF_A_QUICK_TASK", 2)


@pytest.fixture
def parts(tmp_path):
    """The folders of three parts.

    Of four tasks the first and the last are of part 1.
    """
    folders = [str(tmp_path / f"part-{k}") for k in (1, 2, 3)]
    for k, folder in enumerate(folders, 1):
        assert status(["run", *OPTIONS, "--part", f"{k}/3", "-o", folder]) == HOLDS
    return folders


def assert_same(out, whole):
    assert status(["run", *OPTIONS, "-o", str(whole)]) == HOLDS
    for name in TABLES:
        assert (out / name).read_bytes() == (whole / name).read_bytes()


@pytest.mark.slow
def test_parts_are_collected_into_the_bytes_of_a_whole_run(parts, tmp_path):
    out = tmp_path / "all"
    assert status(["collect", *reversed(parts), "-o", str(out)]) == HOLDS
    assert_same(out, tmp_path / "whole")
    assert (out / "report.html").is_file() and not (out / "run.json").exists()
    tasks = [sorted(p.name for p in Path(f, "parts").iterdir()) for f in parts]
    assert tasks == [["000000", "000003"], ["000001"], ["000002"]]
    assert not Path(parts[0], "results.csv").exists()


def judge_nothing(job):
    raise AssertionError(f"{job} was judged again")


@pytest.mark.slow
def test_a_run_over_all_parts_in_one_folder_writes_the_report(tmp_path):
    out = tmp_path / "out"
    for k in (2, 1):
        assert status(["run", *OPTIONS, "--part", f"{k}/2", "-o", str(out)]) == HOLDS
    assert len(list((out / "parts").iterdir())) == 4
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("fourbar_validation.run.pool.judge_job", judge_nothing)
        assert status(["run", *OPTIONS, "-o", str(out)]) == HOLDS
    assert not (out / "request.json").exists() and not (out / "parts").exists()
    assert_same(out, tmp_path / "whole")


def refusal(line, capsys):
    """The one line with which a command refuses its input."""
    capsys.readouterr()
    assert status(line) == BAD_INPUT
    return " ".join(capsys.readouterr().err.split())


@pytest.mark.slow
def test_what_is_missing_is_named_by_its_part(parts, tmp_path, capsys):
    out = ["-o", str(tmp_path / "all")]
    said = refusal(["collect", parts[0], parts[2], *out], capsys)
    assert "1 of 4 tasks are missing: run --part 2/3 again" in said
    damaged = Path(parts[0], "parts", "000003")
    damaged.write_bytes(damaged.read_bytes()[:-3])
    said = refusal(["collect", *parts, *out], capsys)
    assert "000003 is damaged" in said and "--part 1/3 again" in said
    assert damaged.exists() and not (tmp_path / "all" / "results.csv").exists()


def test_parts_of_another_run_are_refused(parts, tmp_path, capsys):
    out, other = ["-o", str(tmp_path / "all")], str(tmp_path / "other")
    asked = [*OPTIONS, "--seed", "1", "--part", "2/3", "-o", other]
    assert status(["run", *asked]) == HOLDS
    said = refusal(["collect", parts[0], other, parts[2], *out], capsys)
    assert "other" in said and "is of another run: it differs in scenes" in said
    marker = Path(parts[1], "run.json")
    judged_with = json.loads(marker.read_text()) | {"code": "of yesterday"}
    marker.write_text(json.dumps(judged_with))
    said = refusal(["collect", *parts, *out], capsys)
    assert "it differs in code" in said


@pytest.mark.slow
def test_two_copies_of_a_part_are_one_only_if_their_rows_are_the_same(
    parts, tmp_path, monkeypatch, capsys
):
    copy = str(tmp_path / "copy")
    again = ["run", *OPTIONS, "--part", "2/3", "-o", copy]
    assert status(again) == HOLDS  # in other times
    out = ["-o", str(tmp_path / "all")]
    assert status(["collect", *parts, copy, *out]) == HOLDS
    (task,) = Path(copy, "parts").iterdir()
    task.write_bytes(task.read_bytes()[:-3])
    said = refusal(["collect", *parts, copy, *out], capsys)
    assert "is damaged" in said and "differs from another folder's" in said
    shutil.rmtree(copy)
    monkeypatch.setattr(Store, "put", worsen(Store.put))
    assert status(again) == HOLDS
    said = refusal(["collect", *parts, copy, *out], capsys)
    assert f"DIR = '{copy}': holds another result than {parts[1]}: " in said
    assert " of free-body in random-0-000000002" in said
    assert status(["collect", parts[0], copy, parts[2], *out]) == HOLDS


def worsen(put):
    """A store that writes another error into one row of its results."""

    def put_worse(store, task, results):
        row = next(row for row in results[0]["rows"] if row[1] == "free-body")
        row[4] = 0.5
        put(store, task, results)

    return put_worse


def test_a_resumed_run_says_which_answers_it_keeps(parts, capsys):
    capsys.readouterr()
    assert status(["run", *OPTIONS, "--part", "1/3", "-o", parts[0]]) == HOLDS
    said = " ".join(capsys.readouterr().err.split())
    assert "kept from an interrupted run: the answers of all engines on 3 of 7" in said
    assert "scenes, random-0-000000000, random-0-000000001, random-0-000000006" in said


@pytest.mark.slow
def test_what_is_no_folder_of_a_part_is_refused(parts, tmp_path, capsys):
    line = ["collect", str(tmp_path), "-o", str(tmp_path / "all")]
    assert "must be a folder that `run --part` wrote" in refusal(line, capsys)
    said = refusal(["collect", *parts, "-o", parts[1]], capsys)
    assert "holds parts of a run" in said and list(Path(parts[1], "parts").iterdir())
    Path(parts[0], "request.json").write_text('{"parts": 3}')
    line = ["collect", *parts, "-o", str(tmp_path / "all")]
    assert "must be a folder that `run --part` wrote" in refusal(line, capsys)


@pytest.mark.slow
def test_scene_files_need_not_be_where_parts_are_collected(tmp_path):
    scene = tmp_path / "models" / "mine.toml"
    scene.parent.mkdir()
    root = Path(__file__).parents[3]
    shutil.copy(root / "models" / "crank_rocker.toml", scene)
    asked = [str(scene), "--engines", "free-body", "--no-pictures"]
    part = str(tmp_path / "part")
    assert status(["run", *asked, "--part", "1/1", "-o", part]) == HOLDS
    scene.unlink()
    out = tmp_path / "all"
    assert status(["collect", part, "-o", str(out)]) == HOLDS
    assert (out / "results.csv").read_text().count("\nmine,") > 20


@pytest.mark.slow
def test_an_engine_that_is_missing_has_the_status_of_a_whole_run(
    tmp_path, monkeypatch, capsys
):
    def miss(engine):
        return f"{engine.library} is not installed" if engine.library else None

    monkeypatch.setattr(Engine, "missing", miss)
    options = ["--random", "3", "--no-pictures"]
    folders = [str(tmp_path / f"part-{k}") for k in (1, 2)]
    for k, folder in enumerate(folders, 1):
        assert status(["run", *options, "--part", f"{k}/2", "-o", folder]) == BROKEN
    for line in (
        ["run", *options, "-o", str(tmp_path / "whole")],
        ["collect", *folders, "-o", str(tmp_path / "all")],
    ):
        capsys.readouterr()
        assert status(line) == BROKEN
        assert "is not installed, or say --engines free-body" in capsys.readouterr().err
        assert (Path(line[-1]) / "results.csv").is_file()


@pytest.mark.parametrize(
    "text", ["0/3", "4/3", "1", "1/", "a/b", "-1/3", "1/0", "1.5/3"]
)
def test_a_part_is_k_of_n(text):
    assert RunPart.read("2/3") == (2, 3)
    with pytest.raises(InputError, match="must be K/N"):
        RunPart.read(text)


def test_a_part_has_no_verdict_to_compare(tmp_path, capsys):
    line = ["run", *OPTIONS, "--part", "1/3", "--against", "accepted"]
    said = refusal([*line, "-o", str(tmp_path / "out")], capsys)
    assert "--against" in said and "collect the parts first" in said
