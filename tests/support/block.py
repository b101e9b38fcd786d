"""The block that `analyze` prints of a solution."""

from fourbar.show.block import write_block
from fourbar.show.lines import BLOCK_WIDTH


def read_block(solution, *units, **options):
    """Return the block in one line, whose breaks depend on the width."""
    lines = write_block(solution, *units, **options)
    assert max(map(len, lines)) <= BLOCK_WIDTH, lines
    return " ".join(" ".join(lines).split())
