"""Pages that show commands and programs are run from top to bottom.

Files, commands, programs, and what they print. A line "..." stands for lines that the
page leaves out.
"""

import re
import shlex

import pytest

from fourbar.cli import status
from fourbar.errors import HOLDS
from fourbar_validation.cli import status as harness
from tests.support.checkout import ROOT, read

BLOCK = re.compile(r"^```(\w+)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
SESSION = re.compile(r"^\$ (.*)\n((?:(?!\$ ).*\n)*)", re.MULTILINE)
STATUS_OF = {"fourbar": status, "fourbar-validation": harness}
"""Exit status of each program for some arguments."""
PROGRAMS = ("docs/tutorial", "docs/thesis", "docs/recipes", "docs/inverse-dynamics")
"""Pages whose programs go on from one another."""


@pytest.mark.slow
@pytest.mark.parametrize(
    ("page", "sessions"),
    [
        ("docs/tutorial", 12),
        ("docs/thesis", 3),
        ("docs/recipes", 8),
        ("docs/inverse-dynamics", 0),
        ("README", 2),
        ("docs/commands", 7),
        ("docs/gallery", 1),
        ("docs/guide-designer", 4),
        ("docs/guide-roboticist", 8),
    ],
)
def test_a_page_does_and_prints_what_it_says(
    page, sessions, tmp_path, monkeypatch, capsys
):
    if page == "docs/inverse-dynamics":
        pytest.importorskip("pinocchio", reason="a recipe needs it: pip install pin")
    monkeypatch.chdir(tmp_path)
    (tmp_path / "models").symlink_to(ROOT / "models")
    names = {}
    printed = ""
    commands = 0
    for language, text in BLOCK.findall(read(f"{page}.md")):
        if language == "toml":
            (tmp_path / text.split()[1]).write_text(text, "utf-8")
        elif language == "python" and page in PROGRAMS:
            exec(compile(text, page, "exec"), names)
            printed = capsys.readouterr().out
        elif language == "text" and page in PROGRAMS:
            assert printed == text
        elif language == "console":
            for command, shown in SESSION.findall(text):
                commands += 1
                program, *arguments = shlex.split(command)
                assert STATUS_OF[program](arguments) == HOLDS, command
                captured = capsys.readouterr()
                lines = map(re.escape, re.split(r"(?m)^\.\.\.\n", shown))
                assert re.fullmatch("(?:.*\n)+".join(lines), captured.out), command
                assert captured.err == "", command
                for file in re.findall(r"-o (\S+)", command):
                    assert (tmp_path / file).stat().st_size > 100, command
    assert commands == sessions
