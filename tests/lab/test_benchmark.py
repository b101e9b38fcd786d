"""The benchmark.

Engines are asked by the protocol, a letter is what the numbers earn, and nothing is
asked twice.
"""

import csv
import json

from pytest import fixture, importorskip, mark

from fourbar_lab.benchmark import BENCHMARKED_ENGINES, REFUSED, read_reasons
from fourbar_lab.cli import status
from fourbar_validation.compare.rows import read_cell_text
from fourbar_validation.engines.environments import read_engines, read_engines_of
from tests.support.guests import PLAIN

WRONG = ('"torque": moments[0]', '"torque": 1.1 * moments[0]')


@fixture
def folder(tmp_path):
    """A stranger's folder.

    The engine of the page, one that is wrong, and the entries of both.
    """
    assert WRONG[0] in PLAIN
    (tmp_path / "mine.py").write_text(PLAIN)
    (tmp_path / "wrong.py").write_text(PLAIN.replace(*WRONG))
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


@mark.slow
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


def test_the_engines_of_the_lab_are_entries_that_a_run_finds_too():
    engines = read_engines_of(BENCHMARKED_ENGINES)
    assert len(engines) >= 25 and engines.items() <= read_engines([]).items()
    # `run --engines` takes a comma-separated list
    assert not [name for name in engines if "," in name]
    rows = tuple(name.partition(":")[0] for name in engines)
    assert all(reason.startswith(rows) for reason in read_reasons(BENCHMARKED_ENGINES))


@mark.slow
@mark.parametrize("library", ["mujoco", "pinocchio"])
def test_an_engine_answers_the_slider_cranks(library, folder):
    importorskip(library)
    program = ["python", "-m", "fourbar_lab.simulators.slider_engines", library]
    (folder / "engines.toml").write_text(
        f'[[engine]]\nname = "it"\ncommand = {json.dumps(program)}\n'
    )
    letters, _ = run(folder, "slider_crank", "slider_crank_offset", "crank_rocker")
    assert sorted(letters.values()) == ["AA", "AA", REFUSED]
