"""What commands print on a terminal of 40 columns: tables that fit, nothing cut."""

import re
import sys
from pathlib import Path

from pytest import mark

import fourbar.cli
import fourbar_validation.cli
from tests.support.checkout import ROOT
from tests.support.here import judge_here

MODELS = ROOT / "models"
MODEL = f"{MODELS}/crank_rocker"
NARROW, WIDE = 40, 80
ALIGNED = re.compile(r"\S {2,}\S|[─━]")
"""What a line of a table has, and one of prose has not."""
STYLE = re.compile(r"\x1b\[[0-9;]*m")
PROGRAMS = {
    "fourbar": fourbar.cli.status,
    "fourbar-validation": fourbar_validation.cli.status,
}
SAME = [
    "fourbar classify 4 1 3 3",
    f"fourbar analyze {MODEL}.toml",
    f"fourbar analyze {MODEL}.toml --sensitivity",
    f"fourbar equilibrium {MODELS}/capabilities/springs.toml",
    f"fourbar tolerance {MODELS}/capabilities/tolerances.toml --samples 64",
    f"fourbar-validation check {MODEL}.toml theirs.csv",
    f"fourbar-validation run {MODEL}.toml --engines free-body --no-pictures --verbose",
]
"""Commands that print the same words at every width."""
OTHER = [
    "fourbar-validation published",
    f"fourbar analyze {MODEL}.toml --table",
    f"fourbar-validation check-mjcf {MODEL}.toml {MODEL}.xml",
    f"fourbar-validation loops {MODELS}/robots/gripper.xml",
    f"fourbar-validation advise {MODEL}.toml {MODELS}/drag_link.toml --error 1e-2",
]
"""Commands that choose columns by the width, print times, or take long."""
NO_TABLE = {
    "fourbar new",
    "fourbar edit",
    "fourbar plot",
    "fourbar animate",
    "fourbar mjcf",
    "fourbar sdf",
    "fourbar usd",
    *(f"fourbar-validation {name}" for name in ("accept", "collect", "compare")),
    "fourbar-validation cost",  # for minutes, and a table like that of `advise`
}


def show(line, width, monkeypatch, capsys):
    """Lines that a command prints on a terminal of a width."""
    program, *words = line.split()
    monkeypatch.setenv("COLUMNS", str(width))
    monkeypatch.setenv("TERM", "xterm")  # rich takes others for 80 columns wide
    monkeypatch.setattr(sys.stdout, "isatty", lambda: True)
    PROGRAMS[program](words)
    printed = capsys.readouterr()
    assert not printed.err
    return STYLE.sub("", printed.out).splitlines()


@mark.slow
@mark.parametrize("line", [*SAME, *OTHER], ids=lambda line: Path(line).name)
def test_tables_fit_a_narrow_terminal(line, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    judge_here(monkeypatch)
    (tmp_path / "theirs.csv").write_text("theta_2 [deg], torque\n60, 1.0\n")
    lines = show(line, NARROW, monkeypatch, capsys)
    assert not [each for each in lines if ALIGNED.search(each) and len(each) > NARROW]
    if line in SAME:
        wide = filter(ALIGNED.search, show(line, WIDE, monkeypatch, capsys))
        words = set(re.sub("[─━]+", " ", " ".join(wide)).split())
        assert words <= set(" ".join(lines).split())


def test_every_command_is_tried_or_has_no_table():
    tried = {" ".join(line.split()[:2]) for line in (*SAME, *OTHER)}
    assert tried | NO_TABLE == {
        *(f"fourbar {name}" for name in fourbar.cli.group.commands),
        *(f"fourbar-validation {name}" for name in fourbar_validation.cli.COMMANDS),
    }
