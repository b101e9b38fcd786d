"""Files are data.

Hostile names and titles end escaped wherever they are shown, and no path escapes.
"""

import csv
import json
import re
import xml.etree.ElementTree as ET
from unittest.mock import Mock

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from pytest import mark

import fourbar
from fourbar.errors import BAD_INPUT, FAILED
from fourbar.files import save
from fourbar.mjcf import write_mjcf
from fourbar.mjcf.assembly import write_sdf, write_usd
from fourbar_validation.cli import status
from fourbar_validation.compare.results_file import LONGEST_CELL, read_columns
from fourbar_validation.compare.rows import COLUMN_TYPES, FAILS, RESULT_COLUMNS
from fourbar_validation.compare.tolerance import EQUIVALENCE
from fourbar_validation.engines import environments, programs, registry
from fourbar_validation.regression.record import MOST_ROWS_COMPARED, About, write_about
from fourbar_validation.report.terminal import print_table
from fourbar_validation.run.run import Plan, run
from fourbar_validation.scenes.suites import LARGEST_LIST, read_suite
from tests.support.checkout import read_complaint
from tests.support.here import judge_here
from tests.support.rows import refused
from tests.support.scenes import crank_rocker
from tests.support.unlucky import Declines, Few

HOSTILE = {
    "html": "<script>alert(1)</script><img src=x onerror=alert(2)>",
    "attribute": '" onmouseover="alert(3)" x="',
    "xml": "</testcase></mujoco>]]><!--",
    "markdown": (
        "| [x](javascript:alert(4)) `![y](http://example.invalid/z)` |\n# heading"
    ),
    "ansi": "\x1b[2J\x1b]0;owned\x07\x9b31m",
    "rich": "[bold red]not ours[/] [link=http://example.invalid]x[/link]",
    "null": "before\x00after",
    "template": "{{ 7*7 }}${7*7}%s",
    "bidi": "\u202etxt.exe\u202c",
    "path": "../../../../tmp/escaped",
}
STEERING = re.compile("[\x00-\x08\x0b-\x1f\x7f-\x9f]")
"""Control characters, but for the ends of lines."""
ACTIVE = re.compile('<script>alert|<img src=x|" onmouseover="')
"""What a browser would run."""
EXACT = environments.choose_engines("free-body")
FORMS = ("markdown", "html", "junit")


NAMES = (
    *(HOSTILE[kind] for kind in ("path", "markdown", "rich")),
    " ".join(HOSTILE.values()),
)
"""Where the beginning or the whole matters each by itself."""


class Named(Few):
    """Scenes whose name, title and source are hostile."""

    def scene(self, index):
        text = self.names[index]
        motion = fourbar.Motion(fourbar.Sweep(0.1, 1.0, 3), 1.0)
        return crank_rocker(motion, title=text, source=text)


@mark.slow
def test_reports_hold_hostile_text_as_text(tmp_path, monkeypatch, capsys):
    judge_here(monkeypatch)
    out = tmp_path / "deep" / "out"
    summary = run(Plan(Named(NAMES), EXACT, workers=1), out)
    html = (out / "report.html").read_text()
    assert not ACTIVE.search(html) and "7*7 }}" in html
    markdown = (out / "report.md").read_text()
    assert not re.search(r"<script>|\n# heading|(?<!\\)\]\(", markdown)
    print_table(summary, out, verbose=True)
    shown = capsys.readouterr().out
    assert "[bold red]" in shown
    for name, output in (("terminal", shown), ("markdown", markdown), ("html", html)):
        assert not STEERING.search(output), name
    folders = {path.name for path in tmp_path.rglob("*") if path.is_dir()}
    assert folders == {"deep", "out"}  # nothing was written outside of them


@mark.parametrize("title", [*HOSTILE.values(), "\ud800", "é" * 10_000, ""])
def test_model_files_hold_a_hostile_title_as_a_text(title):
    scene = crank_rocker(title=title)
    mjcf = ET.fromstring(write_mjcf(scene))
    sdf = ET.fromstring(write_sdf(scene, without_loads=True))
    usd = write_usd(scene, without_loads=True)
    (model,) = sdf.iter("model")
    *_, doc = re.findall(r"^ *doc = (.*)$", usd, re.MULTILINE)
    shown = mjcf.attrib["model"] + model.attrib["name"] + json.loads(doc)
    assert not STEERING.search(shown)
    assert mjcf.tag == "mujoco" and not [*mjcf.iter("script"), *sdf.iter("script")]


@mark.slow
def test_differences_hold_hostile_names_as_text(tmp_path, capsys):
    # a table written by somebody else, whose names nothing has looked at
    for folder, cells in (
        ("old", ("1e-15", "1e-14", "true", "agrees")),
        ("new", ("1e-3", "1e-14", "false", "fails")),
    ):
        (tmp_path / folder).mkdir()
        with (tmp_path / folder / "results.csv").open("w", newline="") as file:
            writer = csv.writer(file)
            writer.writerow(RESULT_COLUMNS)
            for name in HOSTILE.values():
                who = (name, name[:7], "exact", "torque")
                writer.writerow([*who, *cells, name, 1.0, 1.0])
        versions = dict.fromkeys(HOSTILE.values(), folder)
        machine = " ".join(HOSTILE.values()) + folder
        write_about(About(versions, machine, {}), tmp_path / folder)
    forms = [f"--{form}={tmp_path / form}" for form in FORMS]
    code = status(["compare", str(tmp_path / "old"), str(tmp_path / "new"), *forms])
    assert code == FAILED and not STEERING.search(capsys.readouterr().out)
    assert len(ET.parse(tmp_path / "junit").findall(".//failure")) == len(HOSTILE)
    texts = {form: (tmp_path / form).read_text() for form in FORMS}
    assert not STEERING.search("".join(texts.values()))
    assert not ACTIVE.search(texts["html"]) and "<script>" not in texts["markdown"]


@mark.parametrize(
    "text",
    [
        "scene\n",
        "scene,engine\nx\n",
        "\0",
        "a" * 200_000 + ",b\n1,2\n",
        '"',
        "[" * 9999,
    ],
)
def test_what_is_no_table_of_results_is_one_line(text, tmp_path, capsys):
    good = ",".join(RESULT_COLUMNS) + "\n"
    for rows, record in (
        (text, "{}"),
        (good + "x,y\n", "{}"),
        (good, text),
        (good, '{"versions": 3}'),
        (good, "[]"),
    ):
        (tmp_path / "results.csv").write_text(rows)
        (tmp_path / "record.json").write_text(record)
        assert status(["compare", str(tmp_path), str(tmp_path)]) == BAD_INPUT, rows[:20]
        read_complaint(capsys)


@mark.slow
@mark.parametrize(
    "rows, reason, words",
    [
        (MOST_ROWS_COMPARED + 1, "", f"has {MOST_ROWS_COMPARED + 1} rows"),
        (1000, "a" * (LONGEST_CELL + 1), "is not a table written by `run`"),
    ],
    ids=["rows", "a cell"],
)
def test_a_small_parquet_of_very_much_is_one_line(
    rows, reason, words, tmp_path, capsys
):
    """Of one row many times, or of one long text, a file has some kilobytes."""
    index = pa.array(np.zeros(rows, np.int32))
    columns = {
        name: (
            pa.array(np.ones(rows))
            if kind is float
            else pa.DictionaryArray.from_arrays(
                index, pa.array([reason if name == "reason" else "agrees"])
            )
        )
        for name, kind in COLUMN_TYPES.items()
    }
    file = tmp_path / "results.parquet"
    pq.write_table(pa.table(columns), file)
    assert file.stat().st_size < 2 * LONGEST_CELL
    assert status(["compare", str(tmp_path), str(tmp_path)]) == BAD_INPUT
    assert words in read_complaint(capsys)


@mark.parametrize(
    "name", ["../out", "/tmp/out", "a/b", "..", ".", "", "a\x00b", "a\x1b[0m"]
)
def test_a_baseline_has_a_name_and_no_path(name, capsys):
    assert status(["accept", "results", "--as", name]) == BAD_INPUT
    printed = capsys.readouterr().err
    assert "--as" in printed and not STEERING.search(printed)


@mark.parametrize("name", ["\x1b[31mred.toml", "a\nb.toml", "<b>.toml", "[red]x.toml"])
def test_a_hostile_name_of_a_bad_file_is_shown_and_not_sent(name, tmp_path, capsys):
    (tmp_path / name).write_text('title = "no lengths"')
    line = ["run", str(tmp_path / name), "--out", str(tmp_path / "out")]
    assert status(line) == BAD_INPUT
    assert not STEERING.search(read_complaint(capsys))


def listed(tmp_path, text):
    for file in ("a.toml", "b.toml"):
        save(crank_rocker(title=file), tmp_path / file)
    path = tmp_path / "suite.txt"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return path


@mark.parametrize("text", ["a.toml  # the first\n\n# none\nb.toml\n", "*.toml\n"])
def test_a_suite_file_lists_scenes_from_its_own_folder(text, tmp_path):
    suite = read_suite(listed(tmp_path, text))
    assert [suite.name(i) for i in range(len(suite))] == ["a", "b"]


OUTSIDE = ("../a.toml", "/etc/passwd", "../*.toml", "a\0.toml")


@mark.parametrize(
    "text, words",
    [
        *((path, "must lie in the folder") for path in OUTSIDE),
        ("c.toml", "c.toml"),
        ("*.xml", "names no file"),
        ("", "no scene file"),
        (b"\xff\xfe", "must be UTF-8 text"),
        (b" " * (LARGEST_LIST + 1), "must not exceed"),
    ],
    ids=lambda value: str(value)[:15],
)
def test_a_bad_suite_file_is_one_line(text, words, tmp_path):
    with refused(words):
        read_suite(listed(tmp_path, text))


class Greedy(Declines):
    """Agrees, except that it asks for all memory on scene b."""

    name = "greedy"

    def act(self, scene):
        if scene.title == "b.toml":
            bytearray(2 * programs.WORKER_MEMORY)


@mark.linux
def test_a_system_that_sets_no_limit_of_memory_goes_on_without(monkeypatch):
    refuse = Mock(side_effect=ValueError("current limit exceeds maximum limit"))
    monkeypatch.setattr("resource.prlimit", refuse)
    programs.bound_memory()
    refuse.assert_called()


@mark.slow
@mark.linux
def test_running_out_of_memory_costs_its_own_row(tmp_path, monkeypatch):
    suite = read_suite(listed(tmp_path, "a.toml\nb.toml\n"))
    for size in ("SCENES_OF_A_SLOW_TASK", "SCENES_OF_A_QUICK_TASK"):
        monkeypatch.setattr(f"fourbar_validation.run.run.{size}", 2)
    greedy = registry.Engine("greedy", Greedy, EQUIVALENCE)
    run(Plan(suite, (*EXACT, greedy), workers=1, drawn=False), tmp_path / "run")
    rows = list(read_columns(tmp_path / "run" / "results.csv"))
    (failing,) = (row for row in rows if row.verdict == FAILS)
    assert (failing.scene, failing.engine) == ("b", "greedy")
    assert "MemoryError" in failing.reason
