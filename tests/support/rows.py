"""Tables of cases: their rows, what is refused in one, and which are quick."""

from contextlib import contextmanager

from pytest import mark, param, raises

from fourbar import InputError

each_branch = mark.parametrize("branch", [1, -1])


def read_rows(table):
    """Return the cells of each line, without the spaces around them.

    A line is a case, and " | " stands between its columns. Empty lines, and those that
    begin with #, are none.
    """
    rows = []
    for line in table.splitlines():
        if line and not line.startswith("#"):
            cells = f"{line} ".replace(" | | ", " |  | ").split(" | ")
            rows.append(tuple(cell.strip() for cell in cells))
    return rows


@contextmanager
def refused(*words, start=""):
    """What is done here is refused, in one line with these words and this start."""
    with raises(InputError) as caught:
        yield
    said = str(caught.value)
    assert said.startswith(start) and "\n" not in said, said
    for word in words:
        assert word in said, said


def slow_but(quick, cases):
    """Return the cases of a test, of which all but the quick ones are slow.

    A case of several arguments is a tuple.
    """
    return [
        param(
            *(case if isinstance(case, tuple) else (case,)),
            marks=[] if case in quick else mark.slow,
        )
        for case in cases
    ]
