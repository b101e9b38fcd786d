"""Tutorial, thesis page and recipes are run from top to bottom.

Files, commands, programs, and what they print. A line "..." stands for lines that the
page leaves out.
"""

import contextlib
import io
import re
import shlex
from pathlib import Path

import pytest

from fourbar.cli import status

ROOT = Path(__file__).parents[2]
BLOCK = re.compile(r"^```(\w+)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
SESSION = re.compile(r"^\$ (.*)\n((?:(?!\$ ).*\n)*)", re.MULTILINE)


@pytest.mark.slow
@pytest.mark.parametrize("page", ["tutorial", "thesis", "recipes"])
def test_a_page_does_and_prints_what_it_says(
    page: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    pytest.importorskip(
        "pandas",
        reason="the tutorial makes a table of pandas: pip install pandas",
    )
    if page == "recipes":
        pytest.importorskip("pinocchio", reason="a recipe needs it: pip install pin")
    monkeypatch.chdir(tmp_path)
    (tmp_path / "models").symlink_to(ROOT / "models")
    names: dict[str, object] = {}
    printed = ""
    blocks = BLOCK.findall((ROOT / "docs" / f"{page}.md").read_text(encoding="utf-8"))
    for language, text in blocks:
        if language == "toml":
            (tmp_path / text.split()[1]).write_text(text, encoding="utf-8")
        elif language == "python":
            out = io.StringIO()
            with contextlib.redirect_stdout(out):
                exec(compile(text, page, "exec"), names)
            printed = out.getvalue()
        elif language == "text":
            assert printed == text
        elif language == "console":
            for command, shown in SESSION.findall(text):
                program, *arguments = shlex.split(command)
                assert program == "fourbar"
                assert status(arguments) == 0, command
                shown_lines = ".*".join(
                    re.escape(lines) for lines in re.split(r"(?m)^\.\.\.\n", shown)
                )
                assert re.fullmatch(shown_lines, capsys.readouterr().out, re.DOTALL), (
                    command
                )
                for file in re.findall(r"-o (\S+)", command):
                    assert (tmp_path / file).stat().st_size > 100, command
    languages = [language for language, _ in blocks]
    assert (
        languages.count("console") >= 2
        and languages.count("python") == languages.count("text") >= 1
    )
