"""Fixtures of the tests of tables."""

import pytest

from fourbar_validation.check.theirs import read_table


@pytest.fixture
def read(tmp_path):
    """Reads the text of a table."""

    def read_text(text, *how, **more):
        path = tmp_path / "theirs.csv"
        path.write_text(text)
        return read_table(path, *how, **more)

    return read_text
