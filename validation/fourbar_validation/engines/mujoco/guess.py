"""Guess which body of a MJCF is which bar, if not stated, from bodies connected as a four-bar, and its lengths."""

import math
from collections.abc import Mapping, Sequence
from itertools import permutations

import mujoco

from fourbar.errors import InputError
from fourbar.linkage import BAR_NAMES, MOVING_BARS
from fourbar_validation.engines.mujoco.topology import Topology, find_body, find_stated_body, list_bodies

ROLES = tuple(BAR_NAMES[bar] for bar in MOVING_BARS)
SITES = ("B3", "B4")
ALIKE = 1e-9
"""Two guesses whose lengths fit equally well to this are distinguished by the drive."""
MOST_BODIES = 8
"""Bodies on hinges among which three are looked for."""


def find_topology(
    model: mujoco.MjModel, names: Mapping[str, str], lengths: Sequence[float]
) -> tuple[Topology, list[str]]:
    """Find the four-bar in a model; add a note on what was guessed. Names that are given, or in the file, stand.

    `lengths`: of ground, input, coupler and output in the scene, m: the guess that fits them best is taken.

    Raises InputError in one line: why no three bodies fit.
    """
    known = {role: names.get(role, role) for role in (*ROLES, *SITES)}
    bodies = [find_stated_body(model, names, role) if role in names else find_body(model, role) for role in ROLES]
    if None not in bodies and (_find_site(model, known["B3"]) or names.keys() & {*SITES} or not _open_sites(model)):
        return Topology(model, names), []
    candidates = sorted({int(model.body_weldid[model.jnt_bodyid[joint]]) for joint in range(model.njnt)})
    free = [body for body in candidates if body not in bodies]
    missing = [role for role, body in zip(ROLES, bodies, strict=True) if body is None]
    result: list[tuple[float, bool, Topology, dict[str, str]]] = []
    refused: list[str] = []
    for chosen in permutations(free[:MOST_BODIES], len(missing)):
        guess = {role: model.body(body).name for role, body in zip(missing, chosen, strict=True)}
        if not all(guess.values()):
            refused.append("a body without a name, which --name cannot state either")
            continue
        for sites in _list_sites(model, {**known, **guess}, names):
            try:
                topology = Topology(model, {**names, **guess, **sites})
                result.append((_measure_misfit(topology, lengths), not topology.drives(), topology, {**guess, **sites}))
            except InputError as error:
                refused.append(error.allowed)
    if not result:
        few = (
            "it has fewer bodies on hinges"
            if len(free) < len(missing)
            else "no connect, weld or pair of sites closes it"
        )
        why = refused[0] if refused else few
        nowhere = f"no body is named {', '.join(missing) or 'B3, B4'}, and no guess makes a four-bar ({why})"
        raise InputError("MJCF", list_bodies(model), f"{nowhere}; say which is which: --name input=BODY, and so on")
    best = min(each[0] for each in result)
    _, _, topology, guessed = min((each for each in result if each[0] <= best + ALIKE), key=lambda each: each[1])
    pairs = ", ".join(f"{role}={name}" for role, name in guessed.items())
    return topology, [f"guessed from what hangs together and from the lengths: {pairs} (--name states it otherwise)"]


def _find_site(model: mujoco.MjModel, name: str) -> bool:
    return bool(mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_SITE, name) >= 0)


def _open_sites(model: mujoco.MjModel) -> bool:
    """Tell whether only sites can say where the loop closes."""
    kinds = mujoco.mjtEq
    return not any(kinds(kind) in (kinds.mjEQ_CONNECT, kinds.mjEQ_WELD) for kind in model.eq_type)


def _list_sites(model: mujoco.MjModel, known: Mapping[str, str], names: Mapping[str, str]) -> list[dict[str, str]]:
    """List pairs of sites that may mark pin B; none need be given where a connect or a weld closes the loop."""
    if not _open_sites(model) or names.keys() & {*SITES} or _find_site(model, known["B3"]):
        return [{}]
    on = {role: [model.site(i).name for i in range(model.nsite) if model.site(i).name
                 and int(model.body_weldid[model.site_bodyid[i]]) == find_body(model, known[role])]
          for role in ("coupler", "output")}  # fmt: skip
    return [{"B3": three, "B4": four} for three in on["coupler"] for four in on["output"]]


def _measure_misfit(topology: Topology, lengths: Sequence[float]) -> float:
    """Measure how far its lengths are from the scene's: the sum of |log ratio|."""
    theirs = [topology.length(bar) for bar in BAR_NAMES]
    if min(theirs) <= 0.0:
        return math.inf
    return sum(abs(math.log(one / other)) for one, other in zip(theirs, lengths, strict=True))
