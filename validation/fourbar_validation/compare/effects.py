"""Find the size of the forces of each load and effect, which its own file declares.

A sum of forces that (nearly) vanishes is judged by these.
"""

from typing import TYPE_CHECKING

from fourbar.errors import FourBarError
from fourbar.linkage import FourBar
from fourbar.solution import Solution
from fourbar_validation.compare.tolerance import Array

if TYPE_CHECKING:
    from fourbar.effects import Effect


def find_size(effect: "Effect", linkage: FourBar, formulas: Solution) -> Array | float:
    """Return the size of an effect's forces, N, (n,) or one for all positions.

    An effect without one raises FourBarError: nothing is judged by another effect's
    scale.
    """
    try:
        size: Array | float = effect.size(linkage, formulas)
    except NotImplementedError:
        raise FourBarError(
            f"the effect {effect.key!r} has no size to judge forces by"
        ) from None
    return size
