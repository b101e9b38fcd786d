"""Provide the hard cases as a suite of a run, and the engines with their predictions."""

from dataclasses import replace
from functools import cache

from fourbar.scene import Scene
from fourbar_validation.compare.tolerance import EQUIVALENCE, FULL_ACCURACY
from fourbar_validation.engines.exact import BallArithmetic
from fourbar_validation.engines.prediction import predict_from_data
from fourbar_validation.engines.witnesses import WITNESSES, Witness
from fourbar_validation.scenes.hard_families import FAMILIES

BALLS = Witness("ball-arithmetic", BallArithmetic, FULL_ACCURACY, nearby=True, library="flint")


def hold_fully(witness: Witness) -> Witness:
    """Hold the engine to full accuracy, or else to the error predicted for each position."""
    if witness.tolerance not in (EQUIVALENCE, FULL_ACCURACY):
        return witness
    return replace(witness, tolerance=FULL_ACCURACY, predictor=witness.predictor or predict_from_data)


HARD_WITNESSES = tuple(hold_fully(witness) for witness in (BALLS, *WITNESSES))


class Hard:
    """Every scene of every family, by name; a worker makes them again from the parameters alone."""

    def __len__(self) -> int:
        return len(_make_scenes())

    def name(self, index: int) -> str:
        """Name a scene; ascending."""
        return _make_scenes()[index][0]

    def scene(self, index: int) -> Scene:
        """Return the scene itself."""
        return _make_scenes()[index][1]

    def fingerprint(self) -> str:
        """Name the families and count their scenes."""
        return f"hard {' '.join(family.name for family in FAMILIES)} {len(self)}"


@cache
def _make_scenes() -> list[tuple[str, Scene]]:
    """Make the scenes, by name."""
    result = []
    for family in FAMILIES:
        for label, scene in family.scenes():
            titled = replace(scene, title=f"{family.name}: {label}", source=family.statement)
            result.append((f"{family.name} {label}".replace(" ", "-"), titled))
    return sorted(result, key=lambda pair: pair[0])
