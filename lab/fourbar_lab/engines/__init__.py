"""Engines that join a run where they are installed: Exudyn, OpenSim and Drake.

A library is imported only by its adapter.
"""

import hashlib
from collections.abc import Callable
from functools import partial
from pathlib import Path

from fourbar_validation.compare.tolerance import EQUIVALENCE
from fourbar_validation.engines.prediction import predict_in_world_axes
from fourbar_validation.engines.registry import Engine, Later


def _hash_adapters() -> str:
    digest = hashlib.sha256()
    for path in sorted(Path(__file__).parent.glob("*.py")):
        digest.update(path.read_bytes())
    return digest.hexdigest()[:16]


_exact: Callable[..., Engine] = partial(
    Engine,
    tolerance=EQUIVALENCE,
    predictor=predict_in_world_axes,
    code=_hash_adapters(),
)
EXUDYN = _exact(
    "exudyn-constraints",
    Later("fourbar_lab.engines.exudyn:ExudynConstraints"),
    library="exudyn",
)
OPENSIM = _exact(
    "opensim-constraints",
    Later("fourbar_lab.engines.opensim:OpenSimConstraints"),
    library="opensim",
)
DRAKE = _exact(
    "drake-inverse",
    Later("fourbar_lab.engines.drake:DrakeInverse"),
    library="pydrake",
)
ENGINES = (EXUDYN, OPENSIM, DRAKE)
"""What a run offers besides the engines of the harness, in this order."""
