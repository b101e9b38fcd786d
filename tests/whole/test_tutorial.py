"""The tutorial is run from top to bottom: its files, commands and programs, and what they print."""

import contextlib
import io
import re
import shlex
from pathlib import Path

import pytest

from fourbar.cli import status

TUTORIAL = Path(__file__).parents[2] / "docs" / "tutorial.md"
BLOCK = re.compile(r"^```(\w+)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
SESSION = re.compile(r"^\$ (.*)\n((?:(?!\$ ).*\n)*)", re.MULTILINE)
WRITTEN = (
    "first.toml",
    "thesis.csv",
    "thesis.toml",
    "freebody.svg",
    "overview.svg",
    "thesis.html",
    "pictured.html",
    "energy.svg",
    "released.html",
    "play.svg",
    "play.html",
    "thesis.xml",
)


def test_the_tutorial_does_and_prints_what_it_says(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("pandas", reason="the tutorial makes a table of pandas: pip install pandas")
    monkeypatch.chdir(tmp_path)
    names: dict[str, object] = {}
    printed = ""
    done = {"toml": 0, "console": 0, "python": 0, "text": 0}
    for language, text in BLOCK.findall(TUTORIAL.read_text(encoding="utf-8")):
        done[language] += 1
        if language == "toml":
            (tmp_path / text.split()[1]).write_text(text, encoding="utf-8")
        elif language == "python":
            out = io.StringIO()
            with contextlib.redirect_stdout(out):
                exec(compile(text, "tutorial", "exec"), names)
            printed = out.getvalue()
        elif language == "text":
            assert printed == text
        else:
            for command, shown in SESSION.findall(text):
                program, *arguments = shlex.split(command)
                assert program == "fourbar"
                assert status(arguments) == 0, command
                assert capsys.readouterr().out == shown, command
    assert done["console"] >= 5 and done["python"] == done["text"] >= 5
    assert all((tmp_path / name).stat().st_size > 100 for name in WRITTEN)
