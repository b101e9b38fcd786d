"""The block that `analyze` prints of a solution."""

from fourbar.show.block import SceneBlock
from fourbar.show.lines import BLOCK_WIDTH
from fourbar.show.shown_units import COMMON


def read_block(solution, units=COMMON, pressure=None):
    """Return the block in one line, whose breaks depend on the width."""
    lines = SceneBlock(solution, units, pressure).write()
    assert max(map(len, lines)) <= BLOCK_WIDTH, lines
    return " ".join(" ".join(lines).split())
