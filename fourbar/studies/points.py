"""Instant centres and coupler curves of a linkage, of a scene, or of a solution."""

import numpy as np

from fourbar.errors import InputError, expect
from fourbar.formulas.arithmetic import Number, polar
from fourbar.formulas.mobility import TURN, circuits, find_circuit
from fourbar.formulas.path import compute_state, prepare_path
from fourbar.formulas.points import (
    Centre,
    CouplerCurve,
    compute_checked_state,
    list_circuit,
    locate_centres,
)
from fourbar.linkage import (
    A_BRANCH,
    MOST_INTERVALS,
    FourBar,
    Whole,
    require,
    require_whole,
)
from fourbar.quantities import Array
from fourbar.scene import Scene, command
from fourbar.solution import Solution
from fourbar.solving import solve


def instant_centres(
    of: FourBar | Scene | Solution,
    theta_2: Array | None = None,
    branch: Number | None = None,
) -> dict[tuple[int, int], Centre]:
    """Locate the six instant centres I_ij, keyed by (i, j) with i < j.

    I12, I23, I34, I14 are the pins; I13 = line O2 A with line B O4, I24 = line A B with
    line O2 O4 (Aronhold-Kennedy). Where two such lines coincide the centre is
    undetermined: x = y = w = 0.

    Parameters
    ----------
    of : a linkage, a scene (at its own positions), or a solution.
    theta_2 : (n,), rad; of a linkage alone.
    branch : +1 or -1, or one of them for each position; of a linkage alone.

    Source: R. L. Norton, Design of Machinery, ch. 6.
    """
    expect("of", of, FourBar, Scene, Solution)
    if isinstance(of, FourBar):
        if theta_2 is None or branch is None:
            raise InputError(
                "theta_2",
                theta_2,
                "a linkage needs theta_2 and branch; a scene has its own",
            )
        here = compute_checked_state(of, theta_2, branch)
        u1, u2, u3, u4 = here.position[:4]
        O4 = of.ground * u1 + 0.0 * u2
        B = here.point(4, of.output.length)
        return locate_centres(O4, here.foot(3), B, u1, u2, u3, u4)
    for name, value in (("theta_2", theta_2), ("branch", branch)):
        if value is not None:
            raise InputError(name, value, "must be left out: the positions are stated")
    solution = solve(of, "position") if isinstance(of, Scene) else of
    A, B = (v[..., 0] + 1j * v[..., 1] for v in (solution.A, solution.B))
    linkage = solution.stated.linkage
    angle = linkage.ground_angle
    O4 = polar(linkage.ground, angle) + 0.0 * A
    along = [vector / np.abs(vector) for vector in (O4, A, B - A, B - O4)]
    return locate_centres(O4, A, B, *along)


def coupler_curve(
    of: FourBar | Scene | Solution,
    r_along: float | str,
    r_across: float | None = None,
    circuit: int | None = None,
    *,
    branch: int | None = None,
    steps: int = 360,
) -> CouplerCurve:
    """Trace the closed coupler curve of one circuit, through limits and change points.

    Where the input turns fully theta_2 is spaced evenly, over two turns if one turn
    ends on the other branch; else the curve goes from limit to limit on one branch and
    back on the other, spaced by the cosine, so that its points do not thin out at the
    limits.

    Parameters
    ----------
    of : a linkage; or a scene or a solution, which state the circuit by their first
        position.
    r_along, r_across : the point in the coupler's frame at A, m; of a scene or a
        solution the name of one of its points of the coupler will do.
    circuit : index into `circuits`; left out: 0, or that of the scene.
    branch : where to start, for a linkage with change points; left out: open, or that
        of the scene.
    steps : number of intervals, a multiple of 4 (InputError otherwise): limits and
        change points, at which directions are undetermined or lose digits, then fall
        between positions.
    """
    expect("of", of, FourBar, Scene, Solution)
    if isinstance(of, Solution):
        if of.scene is None:
            raise InputError("of", "a study", "has many linkages; take one scene of it")
        of = of.scene
    linkage = of.linkage if isinstance(of, Scene) else of
    if isinstance(of, Scene):
        if isinstance(r_along, str):
            r_along, r_across = _find_in_coupler(of, r_along)
        first = solve(of, "position", at=command(of).part(slice(0, 1)))
        if circuit is None:
            circuit = int(find_circuit(linkage, first.theta_2, first.branch)[0])
        if branch is None:
            branch = int(first.branch[0])
    every = circuits(linkage)
    point = complex(require("r_along", r_along), require("r_across", r_across))
    of_all = Whole(0, len(every) - 1)
    circuit = of_all.check("circuit", 0 if circuit is None else circuit)
    branch = require_whole("branch", 1 if branch is None else branch, (1, -1), A_BRANCH)
    allowed = f"must be a multiple of 4 up to {MOST_INTERVALS}"
    steps = require_whole("steps", steps, range(4, MOST_INTERVALS + 1, 4), allowed)
    theta_2, assembly, turns = list_circuit(linkage, circuit, branch, steps)
    curve = compute_state(linkage, theta_2, assembly).point(3, point)
    path = prepare_path(linkage.lengths, linkage.ground_angle)
    signs = path.sign(theta_2, assembly).astype(np.int8)
    theta_2 = np.append(theta_2, theta_2[0] + turns * TURN)
    signs, x, y = (
        np.append(values, values[0]) for values in (signs, curve.real, curve.imag)
    )
    return CouplerCurve(theta_2, signs, x, y)


def _find_in_coupler(scene: Scene, name: str) -> tuple[float, float]:
    """Return a point of the coupler, along and across at A, m.

    Raises InputError for another name.
    """
    points = scene.settled().points
    of_coupler = {point.name: point for point in points if point.bar == 3}
    if name not in of_coupler:
        allowed = "must be a point of the coupler"
        if of_coupler:
            allowed += f": {', '.join(of_coupler)}"
        raise InputError("point", name, allowed)
    z = of_coupler[name].place.vector()
    return float(z.real), float(z.imag)
