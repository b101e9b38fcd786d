"""The README's blocks are run: its commands, its program, its scene file."""

import contextlib
import io
import re
import shlex
from pathlib import Path

import pytest

import fourbar
from fourbar.cli import status
from fourbar.errors import HOLDS
from fourbar.files.effects import REGISTRY
from validation.cli import COMMANDS

ROOT = Path(__file__).parent.parent
TEXT = (ROOT / "README.md").read_text(encoding="utf-8")


def blocks(language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```$", TEXT, re.MULTILINE | re.DOTALL)


@pytest.fixture
def checkout(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder that looks like a checkout and may be written to."""
    (tmp_path / "models").symlink_to(ROOT / "models")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_every_command_prints_what_is_shown(checkout: Path, capsys: pytest.CaptureFixture[str]) -> None:
    sessions = re.findall(r"^\$ (.*)\n((?:(?!\$ ).*\n)*)", "".join(blocks("console")), re.MULTILINE)
    assert len(sessions) == 8
    for command, shown in sessions:
        program, *arguments = shlex.split(command)
        assert program == "fourbar" and status(arguments) == HOLDS, command
        told = capsys.readouterr()
        printed = told.out
        beginning = shown.removesuffix("...\n")
        assert printed.startswith(beginning), command
        assert (len(printed) > len(beginning)) == (shown != beginning), command
        assert told.err == ""
        for file in re.findall(r"-o (\S+)", command):
            assert (checkout / file).stat().st_size > 0, command


@pytest.mark.usefixtures("checkout")
def test_the_program_prints_what_is_shown() -> None:
    (program,), (shown,) = blocks("python"), blocks("text")
    printed = io.StringIO()
    with contextlib.redirect_stdout(printed):
        exec(compile(program, "README.md", "exec"), {})
    # the error bar is itself rounding: its digits may differ from one machine to the next
    assert re.sub(r"take .*", "take", printed.getvalue()) == re.sub(r"take .*", "take", shown)


def test_the_scene_file_is_one(checkout: Path) -> None:
    (text,) = blocks("toml")
    (checkout / "example.toml").write_text(text)
    scene = fourbar.load(checkout / "example.toml")
    assert set(fourbar.solve(scene).status) == {"ok"}
    assert {effect.key for effect in scene.effects} <= set(REGISTRY)


def test_every_command_of_the_harness_is_listed() -> None:
    table = TEXT[TEXT.index("| `python -m validation` |") : TEXT.index("The columns of the results:")]
    listed = re.findall(r"`([a-z-]+)[^`]*`", "".join(line.split("|")[1] for line in table.splitlines()[2:] if line))
    assert sorted(listed) == sorted(COMMANDS)


def test_every_link_leads_somewhere() -> None:
    for target in re.findall(r"\]\(([^)#]+)\)", TEXT):
        assert (ROOT / target).is_file(), target
