"""The benchmark.

Engines are asked by the protocol, a letter is what the numbers earn, and nothing is
asked twice.
"""

import csv
import json
import re

import pytest

from fourbar_lab.benchmark import (
    BENCHMARKED_ENGINES,
    PANELS,
    REFUSED,
    find_panel,
    read_reasons,
    read_work,
)
from fourbar_lab.cli import status
from fourbar_lab.simulators.problems import PROBLEMS
from fourbar_validation.check.problem import judge_answers, read_problem, read_result
from fourbar_validation.compare.rows import read_cell_text
from fourbar_validation.engines.environments import read_engines, read_engines_of
from tests.whole.test_imports import ROOT

WRONG = ('"torque": moments[0]', '"torque": 1.1 * moments[0]')


@pytest.fixture
def folder(tmp_path):
    """A stranger's folder.

    The engine of the page, one that is wrong, and the entries of both.
    """
    (code,) = re.findall(
        r"```python\n(.*?)```", (ROOT / "docs" / "protocol.md").read_text(), re.DOTALL
    )[:1]
    assert WRONG[0] in code
    (tmp_path / "mine.py").write_text(code)
    (tmp_path / "wrong.py").write_text(code.replace(*WRONG))
    (tmp_path / "dead.py").write_text("raise SystemExit('no licence')")
    entries = [
        f'[[engine]]\nname = "{name}"\ncommand = ["python", "{tmp_path / name}.py"]\n'
        for name in ("mine", "wrong", "dead")
    ]
    entries.append('[[engine]]\nname = "absent"\ncommand = ["no_such_program"]\n')
    (tmp_path / "engines.toml").write_text("\n".join(entries))
    return tmp_path


def run(folder, *problems):
    """Return the letters of a run by engine and problem, and the rows of its table."""
    out = folder / "out"
    words = ["--engines", folder / "engines.toml", "-o", out, "--time-limit", 60]
    for problem in problems:
        words += ["--problem", problem]
    assert status(["benchmark", *map(str, words)]) == 0
    table = list(csv.DictReader((out / "benchmark.csv").read_text().splitlines()))
    letters = {
        (row["engine"], row["problem"]): read_cell_text(row["letters"])
        for row in table
        if row["letters"]
    }
    return letters, table


def find_rows(table, column, **values):
    """Return the rows with these values by one of their columns."""
    return {row[column]: row for row in table if values.items() <= row.items()}


@pytest.mark.slow
def test_a_stranger_s_engine_has_the_letters_that_its_numbers_earn(folder):
    letters, table = run(folder, "crank_rocker", "slider_crank", "sprung")
    first = {engine: letters[engine, "crank_rocker"] for engine, _ in letters}
    assert first == {"mine": "AA", "wrong": "AD", "dead": "-", "absent": "-"}
    assert letters["mine", "slider_crank"] == letters["mine", "sprung"] == REFUSED
    rows = find_rows(table, "engine", problem="crank_rocker")
    assert "no licence" in rows["dead"]["reason"]
    assert "no_such_program" in rows["absent"]["reason"]
    wrong = find_rows(table, "quantity", engine="wrong", problem="crank_rocker")
    assert wrong["torque"]["level"] == "D" and wrong["F12"]["level"] == "A"
    assert 5e-3 < float(wrong["torque"]["error"]) < 2e-1
    page = (folder / "out" / "benchmark.html").read_text()
    assert all(
        f'href="#{name}-crank_rocker"' in page and f'id="{name}-crank_rocker"' in page
        for name in ("mine", "dead")
    )


@pytest.mark.slow
def test_what_was_answered_is_not_asked_again(folder):
    first = run(folder, "crank_rocker")
    code = (folder / "mine.py").read_text()
    told = "        told = ["
    (folder / "mine.py").write_text(code.replace(told, f"        1 / 0\n{told}"))
    assert run(folder, "crank_rocker") == first
    file = folder / "out" / "results" / "mine" / "crank_rocker.json"
    problem = read_problem(PROBLEMS / "crank_rocker.json")
    judged = judge_answers(problem, read_result(file, problem))
    assert {row.level for row in judged} == {"A"}
    file.unlink()
    assert run(folder, "crank_rocker")[0]["mine", "crank_rocker"] == "-"


def test_the_engines_of_the_lab_are_entries_that_a_run_finds_too():
    engines = read_engines_of(BENCHMARKED_ENGINES)
    assert len(engines) >= 25 and engines.items() <= read_engines([]).items()
    # `run --engines` takes a comma-separated list
    assert not [name for name in engines if "," in name]
    rows = tuple(name.partition(":")[0] for name in engines)
    assert all(reason.startswith(rows) for reason in read_reasons(BENCHMARKED_ENGINES))


@pytest.mark.slow
@pytest.mark.parametrize("library", ["mujoco", "pinocchio"])
def test_an_engine_answers_the_slider_cranks(library, folder):
    pytest.importorskip(library)
    program = ["python", "-m", "fourbar_lab.simulators.slider_engines", library]
    (folder / "engines.toml").write_text(
        f'[[engine]]\nname = "it"\ncommand = {json.dumps(program)}\n'
    )
    letters, _ = run(folder, "slider_crank", "slider_crank_offset", "crank_rocker")
    assert sorted(letters.values()) == ["AA", "AA", REFUSED]


SLOW = """
import json, sys
text = open({path!r}).read().split("for question in")[0]
exec(text)
for question in map(json.loads, sys.stdin):
    reply = {{
        "engine": "slow",
        "version": "2",
        "answers": NAMES,
        "effects": ["gravity"],
        "settings": ["good", "bad"],
    }}
    if question["ask"] == "answer":
        steps, rows = question["setting"]["steps_per_turn"], []
        if steps == 9:
            refusal = {{"id": question["id"], "error": "too coarse"}}
            print(json.dumps(refusal), flush=True)
            continue
        told = question["command"]
        bad = question["setting"]["name"] == "bad"
        for theta in told["theta_2"]:
            row = solve(question["scene"], theta, told["omega_2"], 0.0, told["branch"])
            row["torque"] *= 1.0 + 100.0 / steps**2 * bad
            rows.append(row)
        answers = {{name: [row[name] for row in rows] for name in NAMES}}
        if not bad:
            del answers["F43"]
        reply = {{"answers": answers, "setting": f"RK4 {{steps}}/rev"}}
    elif question["ask"] == "slopes":
        reply = {{"slopes": [{{"how": "by hand"}}]}}
    print(json.dumps({{"id": question["id"], **reply}}), flush=True)
"""


@pytest.mark.slow
def test_of_several_timesteps_the_finest_is_judged_and_each_setting_is_a_row(folder):
    (folder / "slow.py").write_text(SLOW.format(path=str(folder / "mine.py")))
    (folder / "engines.toml").write_text(
        '[[engine]]\nname = "slow"\n'
        f'command = ["python", "{folder / "slow.py"}"]\nsteps = [9, 100, 1000]\n'
        '[because]\n"slow: bad" = "its torque is wrong on purpose"\n'
        '"slow" = "another reason"\n'
    )
    letters, table = run(folder, "crank_rocker", "sprung")
    assert letters["slow: good", "crank_rocker"] == "AA"
    assert letters["slow: bad", "crank_rocker"] == "AC"
    assert letters["slow: bad", "sprung"] == REFUSED
    torque = find_rows(table, "setting", engine="slow: bad", quantity="torque")
    assert {setting: row["level"] for setting, row in torque.items()} == {
        "RK4 100/rev": "",
        "RK4 1000/rev": "C",
    }
    assert torque["RK4 1000/rev"]["reason"] == "its torque is wrong on purpose"
    missing = find_rows(table, "level", engine="slow: good", quantity="F43")
    assert missing["-"]["reason"] == "not read" and missing.keys() == {"-", ""}
    page = (folder / "out" / "benchmark.html").read_text()
    for text in ("order 2.0", "Derivatives of the torque, by hand", "slow 2: bad"):
        assert text in page


def test_the_picture_has_every_run_through_time_in_the_panel_of_its_family():
    table = ROOT / "docs" / "examples" / "benchmark.csv"
    with table.open(encoding="utf-8", newline="") as file:
        lines = read_work(csv.DictReader(file))
    picture = table.with_suffix(".svg").read_text(encoding="utf-8")
    assert len(lines) > 15
    assert {find_panel(name) for name in lines} == set(PANELS)
    assert all(f">{text}<" in picture for text in (*lines, *PANELS))
    for name, family in (
        ("MuJoCo 4.0.0: simulated", "MuJoCo"),
        ("MuJoCo Warp 4.0.0: simulated", "Descendants of MuJoCo"),
        ("Newton 1.8.0: MuJoCo solver", "Descendants of MuJoCo"),
        ("Newton 1.8.0: Kamino", "Others"),
    ):
        assert find_panel(name) == family
    # the worst of torque and pin forces, of each number of steps
    exact = lines["Pinocchio 4.1.0: constraintDynamics"]
    assert [len(lines["Newton 1.8.0: Kamino"]), len(exact)] == [2, 3]
    assert all(0.0 < run.error < 1e-6 for run in exact)
