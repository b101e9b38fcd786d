"""Tables of cases as text: a line is a case, and " | " stands between its columns."""


def read_rows(table):
    """Return the cells of each line, without the spaces around them.

    Empty lines, and those that begin with #, are none.
    """
    rows = []
    for line in table.splitlines():
        if line and not line.startswith("#"):
            cells = f"{line} ".replace(" | | ", " |  | ").split(" | ")
            rows.append(tuple(cell.strip() for cell in cells))
    return rows
