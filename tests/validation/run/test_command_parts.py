"""A run in parts.

The bytes of a whole one, and a line that names what is missing, damaged or of another
run.
"""

import json
import shutil
from pathlib import Path

from pytest import MonkeyPatch, fixture, mark, raises

from fourbar.errors import BAD_INPUT, HOLDS, InputError
from fourbar_validation.cli import status
from fourbar_validation.places import MODELS
from fourbar_validation.run import run as plan
from fourbar_validation.run.run import read_part
from fourbar_validation.run.store import Store
from tests.support.here import judge_here

OPTIONS = ["--random", "7", "--engines", "free-body", "--no-pictures"]


@fixture(autouse=True)
def small_tasks(monkeypatch):
    """Two scenes a task, judged in this process."""
    judge_here(monkeypatch)
    monkeypatch.setattr(plan, "SCENES_OF_A_QUICK_TASK", 2)


@fixture
def run(tmp_path):
    """Judges a part, or all, into a folder of this name, and returns the folder."""

    def judge(name, *options, code=HOLDS):
        out = str(tmp_path / name)
        assert status(["run", *OPTIONS, *options, "-o", out]) == code
        return out

    return judge


@fixture
def parts(run):
    """The folders of three parts.

    Of four tasks the first and the last are of part 1.
    """
    return [run(f"part-{k}", "--part", f"{k}/3") for k in (1, 2, 3)]


def judge_nothing(job):
    raise AssertionError(f"{job} was judged again")


@mark.slow
def test_a_run_over_all_parts_in_one_folder_writes_the_report(run):
    """In the bytes of a whole run; it judges nothing again."""
    for k in (2, 1):
        out = Path(run("out", "--part", f"{k}/2"))
        assert not (out / "results.csv").exists()
    assert len(list((out / "parts").iterdir())) == 4
    with MonkeyPatch.context() as patch:
        patch.setattr("fourbar_validation.run.run.judge_job", judge_nothing)
        run("out")
    assert not (out / "request.json").exists() and not (out / "parts").exists()
    whole = Path(run("whole"))
    assert (out / "report.html").is_file()
    for name in ("results.csv", "results.parquet"):
        assert (out / name).read_bytes() == (whole / name).read_bytes()


@fixture
def refusal(tmp_path, capsys):
    """Collects folders, and returns the line with which that is refused."""

    def collect(*folders, out=str(tmp_path / "all")):
        capsys.readouterr()
        assert status(["collect", *folders, "-o", out]) == BAD_INPUT
        return " ".join(capsys.readouterr().err.split())

    return collect


@mark.slow
def test_what_is_missing_is_named_by_its_part(parts, tmp_path, refusal):
    said = refusal(parts[0], parts[2])
    assert "1 of 4 tasks are missing: run --part 2/3 again" in said
    damaged = Path(parts[0], "parts", "000003")
    damaged.write_bytes(damaged.read_bytes()[:-3])
    said = refusal(*parts)
    assert "000003 is damaged" in said and "--part 1/3 again" in said
    assert damaged.exists() and not (tmp_path / "all" / "results.csv").exists()


def test_parts_of_another_run_are_refused(parts, run, refusal):
    said = refusal(parts[0], run("other", "--seed", "1", "--part", "2/3"), parts[2])
    assert "other" in said and "makes here now: it differs in scenes" in said
    marker = Path(parts[1], "run.json")
    judged_with = json.loads(marker.read_text()) | {"code": "of yesterday"}
    marker.write_text(json.dumps(judged_with))
    assert "it differs in code" in refusal(*parts)


@mark.slow
def test_of_two_copies_of_a_part_one_that_is_whole_is_enough(parts, run, tmp_path):
    copy = run("copy", "--part", "2/3")  # in other times
    (task,) = Path(copy, "parts").iterdir()
    task.write_bytes(task.read_bytes()[:-3])
    out = ["-o", str(tmp_path / "all")]
    assert status(["collect", copy, *parts, *out]) == HOLDS


@mark.slow
def test_two_copies_of_a_part_that_differ_are_refused(
    parts, run, tmp_path, monkeypatch, refusal
):
    """In another error in one row."""
    put = Store.put

    def put_worse(store, task, results):
        row = next(row for row in results[0]["rows"] if row[1] == "free-body")
        row[4] = 0.5
        put(store, task, results)

    monkeypatch.setattr(Store, "put", put_worse)
    copy = run("copy", "--part", "2/3")
    said = refusal(*parts, copy)
    assert f"DIR = '{copy}': holds another result than {parts[1]}: " in said
    assert " of free-body in random-0-000000002" in said
    out = ["-o", str(tmp_path / "all")]
    assert status(["collect", parts[0], copy, parts[2], *out]) == HOLDS


def test_a_resumed_run_says_which_answers_it_keeps(run, capsys):
    for _ in range(2):
        capsys.readouterr()
        run("part-1", "--part", "1/3")
    said = " ".join(capsys.readouterr().err.split())
    assert "kept from an interrupted run: the answers of all engines on 3 of 7" in said
    assert "scenes, random-0-000000000, random-0-000000001, random-0-000000006" in said


@mark.slow
def test_what_is_no_folder_of_a_part_is_refused(parts, tmp_path, refusal):
    assert "must be a folder that `run --part` wrote" in refusal(str(tmp_path))
    said = refusal(*parts, out=parts[1])
    assert "holds parts of a run" in said and list(Path(parts[1], "parts").iterdir())
    Path(parts[0], "request.json").write_text('{"parts": 3}')
    assert "must be a folder that `run --part` wrote" in refusal(*parts)


@mark.slow
def test_scene_files_need_not_be_where_parts_are_collected(tmp_path):
    scene = tmp_path / "models" / "mine.toml"
    scene.parent.mkdir()
    shutil.copy(MODELS / "crank_rocker.toml", scene)
    part, out = str(tmp_path / "part"), tmp_path / "all"
    asked = [str(scene), *OPTIONS[2:], "--part", "1/1", "-o", part]
    assert status(["run", *asked]) == HOLDS
    scene.unlink()
    assert status(["collect", part, "-o", str(out)]) == HOLDS
    assert (out / "results.csv").read_text().count("\nmine,") > 20


@mark.parametrize("text", ["0/3", "4/3", "1", "1/", "a/b", "-1/3", "1/0", "1.5/3"])
def test_a_part_is_k_of_n(text):
    assert read_part("2/3") == (2, 3)
    with raises(InputError, match="must be K/N"):
        read_part(text)


def test_a_part_has_no_verdict_to_compare(run, capsys):
    run(
        "out",
        "--part",
        "1/3",
        "--against",
        "accepted",
        code=BAD_INPUT,
    )
    said = " ".join(capsys.readouterr().err.split())
    assert "--against" in said and "collect the parts first" in said
