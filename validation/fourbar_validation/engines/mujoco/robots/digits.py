"""Lengths of a loop within the digits of its file.

MuJoCo saves positions and quaternions with six significant digits, and so do many
generators. The lengths of a parallelogram then differ in their seventh digit, and the
linkage as it stands has no change point and another range. As in a scene that states
rounded lengths or coordinates, the lengths are those of the parallelogram or kite that
the digits cannot tell from the file's.
"""

import math
from collections.abc import Iterable, Iterator
from decimal import Decimal

import mujoco

from fourbar.formulas.mobility import (
    DIGITS_STATED,
    count_equalities,
    meet_change_points,
)
from fourbar.linkage import Lengths
from fourbar_validation.engines.mujoco.robots.ancestry import (
    climb,
    find_tied_bodies,
)
from fourbar_validation.engines.mujoco.robots.compiled import CompiledRobot
from fourbar_validation.engines.mujoco.robots.loop_facts import RobotLoop

_TURN_OF_A_QUATERNION = 2.0
"""Angle by which a rotation changes over the change of its unit quaternion."""


def meet_lengths(compiled: CompiledRobot, loop: RobotLoop, lengths: Lengths) -> Lengths:
    """Return the lengths of a loop, of a parallelogram or a kite without its rounding.

    Parameters
    ----------
    lengths : those of ground, input, coupler and output as measured, m.
    """
    finest = DIGITS_STATED * math.fsum(lengths)
    rounding = 0.0
    for moved in _list_roundings(compiled, loop, max(lengths)):
        if moved <= finest:  # numbers of fewer digits are meant as they stand
            rounding += moved
    fine = [find_rounding([length]) <= finest for length in lengths]
    if not any(fine):
        return lengths
    share = rounding / sum(fine)
    d, a, b, c = (share if is_fine else 0.0 for is_fine in fine)
    met = meet_change_points(lengths, (d, a, b, c))
    # one equality alone is met by chance: nobody builds it
    return met if count_equalities(met) > 1 else lengths


def _list_roundings(
    compiled: CompiledRobot,
    loop: RobotLoop,
    longest: float,
) -> Iterator[float]:
    """List by how much the rounding of each stated place and turn moves a pin, m."""
    model = compiled.model
    first, second = find_tied_bodies(model, loop.equality)
    if model.eq_objtype[loop.equality] == mujoco.mjtObj.mjOBJ_SITE:
        sites = (model.eq_obj1id[loop.equality], model.eq_obj2id[loop.equality])
        places = [model.site_pos[site] for site in sites]
    else:
        places = [model.eq_data[loop.equality, 0:3]]
    places += [model.jnt_pos[joint] for joint in loop.hinges.values()]
    for body in {*climb(model, first)} ^ {*climb(model, second)}:
        places.append(model.body_pos[body])
        turned = find_rounding(compiled.quaternions.get(body, ()))
        yield _TURN_OF_A_QUATERNION * longest * turned
    yield from map(find_rounding, places)


def find_rounding(vector: Iterable[float]) -> float:
    """Return the size of the rounding of a vector of numbers as they are written.

    All have as many significant digits as the one that shows most, since zeros at the
    end are not written. A zero is exact.
    """
    numbers = [Decimal(repr(float(number))) for number in vector if number]
    digits = max((len(n.normalize().as_tuple().digits) for n in numbers), default=0)
    return math.hypot(*(0.5 * 10.0 ** (n.adjusted() + 1 - digits) for n in numbers))
