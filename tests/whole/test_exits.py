"""How a command ends.

One table of commands and their statuses, and every command once in a process of its
own.
"""

import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import click
import numpy as np
from pytest import mark, param

import fourbar
import fourbar.cli
import fourbar_lab.cli
import fourbar_validation.cli
from fourbar.errors import (
    BAD_INPUT,
    BROKEN,
    FAILED,
    HOLDS,
    INTERRUPTED,
    LONGEST_MESSAGE,
    DependencyError,
    InputError,
    run,
)
from fourbar_validation.compare.rows import FAILS, write_results
from fourbar_validation.published.printed_figures import PublishedFigure
from fourbar_validation.regression.record import find_baseline
from tests.support.alone import alone
from tests.support.checkout import ROOT, join_paths, run_line, run_python
from tests.support.here import judge_here
from tests.support.runs import ROW, changed
from tests.support.scenes import crank_rocker

MODEL = str(ROOT / "models" / "crank_rocker.toml")
NO_FILE = "no-such-file"


def group_of(go):
    """A group whose command `go` does what the function does."""
    return click.Group(commands={"go": click.command(name="go")(go)})


def raising(error):
    def go():
        raise error

    return group_of(go)


def returning(value):
    return group_of(lambda: value)


def leaving():
    """End as rich ends where the reader of its pipe has gone."""
    try:
        raise BrokenPipeError(32, "Broken pipe")
    except BrokenPipeError:
        raise SystemExit(1) from None


@mark.parametrize(
    "command",
    [
        "check {0} {1} --json {1}",
        "check {0} {1} --junit {0}",
        "advise {0} --error 1e-3 -o {0}",
        "run {0} --junit {0}",
    ],
)
def test_no_command_writes_over_what_it_reads(command, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    texts = {
        "scene.toml": Path(MODEL).read_text(),
        "theirs.csv": "theta_2,torque\n1.0,0.2\n",
    }
    for name, text in texts.items():
        Path(name).write_text(text)
    assert fourbar_validation.cli.status(command.format(*texts).split()) == BAD_INPUT
    assert "is read here, and would be lost" in capsys.readouterr().err
    assert {path.name: path.read_text() for path in tmp_path.iterdir()} == texts


ENDS = {
    HOLDS: [
        *map(returning, (None, 0)),
        *map(raising, (SystemExit(), SystemExit(0))),
        group_of(leaving),
    ],
    FAILED: [
        *map(returning, (1, np.int64(1))),
        *map(raising, (SystemExit(1), click.exceptions.Exit(1))),
    ],
    BAD_INPUT: [
        raising(SystemExit(2)),
        raising(InputError("key", 1, "must be 2")),
        raising(click.UsageError("no such option")),
    ],
    BROKEN: [
        returning("all is well"),  # no status
        raising(SystemExit("it is wrong")),
        raising(DependencyError("no such library")),
        raising(ModuleNotFoundError("No module named 'x'", name="x")),
        raising(OSError(28, "No space left on device")),
        raising(OSError("without a number")),
        # of a worker: standard output is whole
        raising(BrokenPipeError(32, "Broken pipe")),
        raising(RuntimeError("a bug")),
    ],
    INTERRUPTED: [*map(raising, (KeyboardInterrupt(), click.Abort()))],
}
"""Commands by the status that they end with."""


@mark.slow
@mark.parametrize(
    "group, status",
    [(group, status) for status, groups in ENDS.items() for group in groups],
)
def test_every_end_has_its_status(group, status, monkeypatch, capsys):
    monkeypatch.delenv("FOURBAR_TRACEBACK", raising=False)
    monkeypatch.setattr(
        sys, "stdout", sys.stdout
    )  # click lets go of it where a pipe breaks
    monkeypatch.setattr(sys, "stderr", sys.stderr)
    assert run(group, "program", ["go"]) == status
    printed = capsys.readouterr().err.strip()
    assert "\n" not in printed and "None" not in printed
    said = status in (BROKEN, INTERRUPTED) or "must be" in printed or "such" in printed
    assert bool(printed) == said


@mark.parametrize("module", ["fourbar", "validation"])
def test_an_interruption_while_the_libraries_are_imported_is_one_line(module, tmp_path):
    (tmp_path / "numpy.py").write_text("raise KeyboardInterrupt")
    done = run_python("-m", module, "--help", PYTHONPATH=join_paths(tmp_path))
    assert (done.returncode, done.stderr) == (INTERRUPTED, "error: interrupted\n")


@mark.slow
def test_a_program_without_output_streams_runs(monkeypatch):
    """One started with `>&- 2>&-`, or on Windows without a console."""
    for stream in ("stdout", "stderr"):
        monkeypatch.setattr(sys, stream, None)
    assert [fourbar.cli.status(["analyze", file]) for file in (MODEL, NO_FILE)] == [
        HOLDS,
        BAD_INPUT,
    ]
    sys.stdout.close()
    sys.stderr.close()


FOURBAR, LAB = fourbar.cli.status, fourbar_lab.cli.status
VALIDATION = fourbar_validation.cli.status


@mark.parametrize(
    "figures, words",
    [
        (
            [PublishedFigure("2.4 positions", "1 theta3_1", "167.877224", 167.8)],
            "167.8",
        ),
        ([], "Nothing was compared"),
    ],
)
def test_a_figure_that_no_erratum_explains_and_none_are_status_1(
    figures, words, monkeypatch, capsys
):
    listing = "fourbar_validation.published.comparison.list_figures"
    monkeypatch.setattr(listing, lambda: figures)
    assert VALIDATION(["published"]) == FAILED
    assert words in capsys.readouterr().out


STABILITY = ["stability", "--samples", "3", "--family", "random", "--jobs", "1"]


def test_a_torque_off_in_its_twelfth_digit_is_status_1(monkeypatch):
    def off(*arguments, **options):
        solution = fourbar.solve(*arguments, **options)
        return replace(solution, torque=solution.torque * (1.0 + 1e-12))

    judge_here(monkeypatch)
    assert LAB(STABILITY) == HOLDS
    monkeypatch.setattr("fourbar_lab.stability.solve", off)
    assert LAB(STABILITY) == FAILED


COMMANDS = [
    *(("fourbar", name) for name in fourbar.cli.group.commands),
    *(("validation", name) for name in fourbar_validation.cli.COMMANDS),
    *(("fourbar_lab", name) for name in fourbar_lab.cli.LAB_COMMANDS),
]
PROCESSES = [
    ("fourbar", "--version", HOLDS),
    ("fourbar", "--help", HOLDS),
    ("fourbar", "no-such-command", BAD_INPUT),
    ("fourbar", "classify 4 1 3 3", HOLDS),
    ("fourbar", "classify 4 1 3 x", BAD_INPUT),
    ("fourbar", "analyze scene.toml -o out/deep/file", BAD_INPUT),
    ("fourbar", f"new {ROOT / 'README.md'} --lengths 4 1 3 3", BAD_INPUT),
    ("fourbar", f"analyze {MODEL}", HOLDS),
    ("fourbar", f"mjcf {MODEL} -o {os.devnull}", HOLDS),
    ("fourbar", f"plot {NO_FILE} -o a.svg", BAD_INPUT),
    ("validation", "--version", HOLDS),
    ("validation", "no-such-command", BAD_INPUT),
    ("validation", f"run {NO_FILE}", BAD_INPUT),
    ("validation", "run scene.toml --engines nobody --out out", BAD_INPUT),
    ("validation", "compare good.csv bad.csv", FAILED),
    ("validation", "compare good.csv no-such-file", BAD_INPUT),
    ("validation", "check scene.toml theirs.csv", FAILED),
    ("validation", f"compare accepted {find_baseline('accepted')}", HOLDS),
    ("fourbar_lab", "fuzz-files --count 1", HOLDS),
    ("fourbar_lab", "bench --positions 1", BAD_INPUT),
    *((program, f"{name} --no-such-option", BAD_INPUT) for program, name in COMMANDS),
]


@mark.slow
@mark.parametrize(
    "program, line, status",
    PROCESSES,
    ids=[f"{program} {Path(line).name}" for program, line, _ in PROCESSES],
)
def test_each_command_in_a_process_of_its_own(program, line, status, tmp_path):
    write_results([ROW], tmp_path / "good.csv")
    write_results([changed(error=1.0, verdict=FAILS)], tmp_path / "bad.csv")
    # a torque that is not that of the crank-rocker
    (tmp_path / "theirs.csv").write_text("theta_2 [deg], torque\n60, 1.0\n")
    fourbar.save(crank_rocker(), tmp_path / "scene.toml")
    ended, complained = alone(program, line.split(), tmp_path)
    assert ended == status, complained
    assert bool(complained.strip()) == (status == BAD_INPUT), complained


@mark.parametrize(
    "group",
    [fourbar_validation.cli.group, fourbar_lab.cli.group],
    ids=lambda group: group.callback.__module__,
)
def test_the_help_says_of_each_command_what_the_command_says(group):
    context = click.Context(group)
    for name, listed in group.listed.items():
        command = group.get_command(context, name)
        assert listed.about == command.get_short_help_str(limit=200)


def test_the_help_of_the_harness_imports_no_engine():
    code = "import sys; from fourbar_validation.cli import status; status(['--help']); "
    code += "sys.exit(bool({'scipy', 'mujoco', 'pint', 'rich'} & set(sys.modules)))"
    assert run_python("-c", code).returncode == HOLDS


@mark.slow
@mark.linux  # which alone has a device that is always full
def test_what_was_printed_without_being_written_out_is_not_lost_in_silence():
    code = "import click, sys; from fourbar.errors import run; "
    code += "go = click.command(name='go')(lambda: print('printed')); "
    code += "sys.exit(run(click.Group(commands={'go': go}), 'p', ['go']))"
    reading, writing = os.pipe()
    os.close(reading)
    full = os.open("/dev/full", os.O_WRONLY)
    for out, status, printed in (
        (full, BROKEN, "error: output: No space left on device\n"),
        (writing, HOLDS, ""),
    ):
        done = subprocess.run(
            [sys.executable, "-c", code],
            cwd=ROOT,
            stdout=out,
            stderr=subprocess.PIPE,
            text=True,
            check=False,
        )
        os.close(out)
        assert (done.returncode, done.stderr) == (status, printed)


def test_a_module_that_the_harness_lacks_is_in_the_extra_of_the_harness(
    monkeypatch, capsys, tmp_path
):
    monkeypatch.setitem(sys.modules, "filelock", None)
    assert VALIDATION(["run", str(MODEL), "--out", str(tmp_path / "out")]) == BROKEN
    words = 'filelock is not installed: pip install ".[validation]"'
    assert words in capsys.readouterr().err


@mark.parametrize(
    "header, row",
    [
        param("theta_2,torque," + "x" * 20_000, "1,2,3", id="a long heading"),
        param(
            "theta_2,torque" + ",unknown" * 20_000,
            "1,2" + ",3" * 20_000,
            id="many headings",
            marks=mark.slow,
        ),
    ],
)
def test_no_line_is_longer_than_a_screen_can_show(header, row, tmp_path, capsys):
    table = tmp_path / "table.csv"
    table.write_text(f"{header}\n{row}\n")
    VALIDATION(["check", str(MODEL), str(table)])
    unit = tmp_path / "unit.toml"
    unit.write_text(f'[lengths]\nground = "1 {"m" * 12_000}"\n')
    assert FOURBAR(["analyze", str(unit)]) == BAD_INPUT
    columns = ["--columns", "x" * 20_000]
    assert FOURBAR(["analyze", str(MODEL), *columns]) == BAD_INPUT
    printed = capsys.readouterr()
    assert max(map(len, printed.err.splitlines())) <= LONGEST_MESSAGE
    assert len(printed.out) < 4 * LONGEST_MESSAGE


@mark.slow
@mark.posix
def test_a_closed_standard_input_is_one_line():
    done = run_line(f"{sys.executable} -m fourbar analyze - <&-", shell=True)
    assert (done.returncode, done.stdout) == (BAD_INPUT, "")
    assert done.stderr == "error: scene file = '-': standard input is closed\n"
