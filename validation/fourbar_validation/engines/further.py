"""Engines of the lab: they join a run where the lab and the engine are installed, and where they are named."""

import tomllib
from collections.abc import Iterable
from importlib.metadata import EntryPoint, PackageNotFoundError, distribution
from importlib.util import find_spec
from pathlib import Path

from fourbar_validation.engines.witnesses import Witness
from fourbar_validation.places import CHECKOUT

LAB, GROUP = "fourbar-lab", "fourbar.engines"
"""Distribution and group of its entry points; no other distribution adds an engine to the judge's process."""


def load_further() -> tuple[Witness, ...]:
    """Load the engines that the lab registers; none if it is not installed."""
    try:
        registered: Iterable[EntryPoint] = distribution(LAB).entry_points.select(group=GROUP)
    except PackageNotFoundError:  # the environment of one engine has the lab of a checkout on its path alone
        if CHECKOUT is None or find_spec(LAB.replace("-", "_")) is None:
            return ()
        project = tomllib.loads((CHECKOUT / "lab" / "pyproject.toml").read_text(encoding="utf-8"))["project"]
        registered = [EntryPoint(name, value, GROUP) for name, value in project["entry-points"][GROUP].items()]
    return tuple(entry.load() for entry in sorted(registered))


FURTHER = load_further()
FOLDERS = tuple(Path(folder) for spec in [find_spec(LAB.replace("-", "_"))] if spec is not None
                for folder in spec.submodule_search_locations or ())  # fmt: skip
"""Folder of the lab, whose engines.toml a run reads too; none if the lab is not installed."""
