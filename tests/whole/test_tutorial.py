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
from tests.support.rows import slow_but

BLOCK = re.compile(r"^```(\w+)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
SESSION = re.compile(r"^\$ (.*)\n((?:(?!\$ ).*\n)*)", re.MULTILINE)
STATUS_OF = {"fourbar": status, "fourbar-validation": harness}
"""Exit status of each program for some arguments."""
GOING_ON = ("docs/tutorial", "docs/thesis", "docs/recipes", "docs/inverse-dynamics")
"""Pages whose programs go on from one another."""
SHOWN = {
    "docs/tutorial": 16,
    "docs/thesis": 4,
    "docs/recipes": 16,
    "docs/inverse-dynamics": 2,
    "README": 2,
    "docs/commands": 7,
    "docs/gallery": 1,
    "docs/guide-designer": 12,
    "docs/guide-roboticist": 12,
    "docs/theory": 2,
}
"""Commands and programs of each page."""


@pytest.mark.parametrize("page", slow_but(("docs/theory",), SHOWN))
def test_a_page_does_and_prints_what_it_says(page, tmp_path, monkeypatch, capsys):
    if page == "docs/inverse-dynamics":
        pytest.importorskip("pinocchio", reason="a recipe needs it: pip install pin")
    monkeypatch.chdir(tmp_path)
    (tmp_path / "models").symlink_to(ROOT / "models")
    names = {}
    shown = 0
    for language, text in BLOCK.findall(read(f"{page}.md")):
        if language == "toml":
            (tmp_path / text.split()[1]).write_text(text, "utf-8")
        elif language == "python":
            shown += 1
            exec(compile(text, page, "exec"), names if page in GOING_ON else {})
        elif language == "text" and page != "README":
            assert capsys.readouterr().out == text
        elif language == "console":
            for command, result in SESSION.findall(text):
                shown += 1
                program, *arguments = shlex.split(command)
                assert STATUS_OF[program](arguments) == HOLDS, command
                captured = capsys.readouterr()
                lines = map(re.escape, re.split(r"(?m)^\.\.\.\n", result))
                assert re.fullmatch("(?:.*\n)+".join(lines), captured.out), command
                assert captured.err == "", command
                for file in re.findall(r"-o (\S+)", command):
                    assert (tmp_path / file).stat().st_size > 100, command
    assert shown == SHOWN[page]
