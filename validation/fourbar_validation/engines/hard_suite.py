"""The hard cases as a suite of a run, and the witnesses with their predictions."""

from dataclasses import dataclass, replace
from functools import cache

from fourbar.scene import Scene
from fourbar_validation.compare.tolerance import EQUIVALENCE, FULL_ACCURACY
from fourbar_validation.engines.witnesses import FROM_DATA, WITNESSES, Witness
from fourbar_validation.scenes.hard_families import FAMILIES

BALLS = Witness(
    "ball-arithmetic",
    "fourbar_validation.engines.exact:BallArithmetic",
    FULL_ACCURACY,
    nearby="fourbar_validation.engines.exact:where_it_closes",
    library="flint",
)


def predicting(witness: Witness) -> Witness:
    """The witness held to full accuracy, or else to the error predicted for each position."""
    if witness.tolerance not in (EQUIVALENCE, FULL_ACCURACY):
        return witness
    return replace(witness, tolerance=FULL_ACCURACY, predictor=witness.predictor or FROM_DATA)


HARD_WITNESSES = tuple(predicting(witness) for witness in (BALLS, *WITNESSES))


@dataclass(frozen=True, slots=True)
class Hard:
    """Every scene of every family, by name; a worker makes them again from the parameters alone."""

    families: tuple[str, ...] = tuple(family.name for family in FAMILIES)

    def __len__(self) -> int:
        return len(_scenes(self.families))

    def name(self, index: int) -> str:
        """Name of a scene; ascending."""
        return _scenes(self.families)[index][0]

    def scene(self, index: int) -> Scene:
        """The scene itself."""
        return _scenes(self.families)[index][1]

    def fingerprint(self) -> str:
        """The families by name, and how many scenes they make."""
        return f"hard {' '.join(self.families)} {len(self)}"


@cache
def _scenes(families: tuple[str, ...]) -> list[tuple[str, Scene]]:
    """Names and scenes of some families, by name."""
    found = []
    for family in FAMILIES:
        for label, scene in family.scenes() if family.name in families else ():
            titled = replace(scene, title=f"{family.name}: {label}", source=family.statement)
            found.append((f"{family.name} {label}".replace(" ", "-"), titled))
    return sorted(found, key=lambda pair: pair[0])
