"""The harness calls itself by the command that started it."""

import subprocess
import sys
from pathlib import Path

import pytest

from fourbar_validation.places import CHECKOUT, find_program


@pytest.mark.parametrize(
    ("started", "program"),
    [
        ("/usr/bin/fourbar-validation", "fourbar-validation"),
        ("/code/fourbar_validation/__main__.py", "fourbar-validation"),
        ("/code/validation/__main__.py", "python -m validation"),
        ("/code/validation/bin/fourbar-validation", "fourbar-validation"),
        ("", "fourbar-validation"),
    ],
)
def test_the_command_follows_from_the_file_that_was_started(started, program):
    assert find_program(started) == program


@pytest.mark.slow
@pytest.mark.parametrize(
    ("command", "program"),
    [
        (
            [str(Path(sys.executable).with_name("fourbar-validation"))],
            "fourbar-validation",
        ),
        ([sys.executable, "-m", "fourbar_validation"], "fourbar-validation"),
        ([sys.executable, "-m", "validation"], "python -m validation"),
    ],
)
def test_help_names_the_command_that_was_typed(command, program):
    done = subprocess.run(
        [*command, "-h"],
        cwd=CHECKOUT,
        capture_output=True,
        text=True,
        check=True,
    )
    assert done.stdout.startswith(f"Usage: {program} [OPTIONS]")
