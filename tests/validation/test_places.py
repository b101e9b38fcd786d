"""The harness calls itself by the command that started it."""

import pytest

from fourbar_validation.places import find_program
from tests.support.rows import read_rows


@pytest.mark.parametrize(
    "started, program",
    read_rows("""
/usr/bin/fourbar-validation | fourbar-validation
/code/fourbar_validation/__main__.py | fourbar-validation
/code/validation/__main__.py | python -m validation
/code/validation/bin/fourbar-validation | fourbar-validation
 | fourbar-validation
"""),
)
def test_the_command_follows_from_the_file_that_was_started(started, program):
    assert find_program(started) == program
