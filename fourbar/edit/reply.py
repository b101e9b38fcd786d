"""Reply to the page about a scene: JSON, and columns as doubles, as writing these as text takes longer than solving.

The frame: four bytes with the length of the JSON (little-endian), the JSON padded to a multiple of eight bytes, then
the columns one after the other, as the JSON lists them.
"""

import json
import struct
from typing import Any

import numpy as np

from fourbar.edit.dragging import list_handles
from fourbar.errors import NotAssembledError
from fourbar.scene import Scene
from fourbar.show.animate import collect_live_data
from fourbar.show.block import write_block
from fourbar.show.studies import write_type
from fourbar.show.units import COMMON
from fourbar.solution import Conversion
from fourbar.solve import find_last_stage, solve


def evaluate_scene(
    scene: Scene, plain: dict[str, Any], units: Conversion, *, settled: bool = False, pressure: float | None = None
) -> dict[str, Any]:
    """Evaluate a scene for the page; `settled`: with error bars and summary, which cost more than the rest.

    `pressure`: of a cylinder, Pa; the summary then has the bore that it needs.

    Raises NotAssembledError where no position assembles, InputError as `solve` does.
    """
    stage = find_last_stage(scene) if settled else None
    solution = solve(scene, stage)
    if not solution.assembled.any():
        raise NotAssembledError("motion.theta_2: the linkage assembles at none of the positions requested")
    data = collect_live_data(scene, units, stage=stage, midway=True) | {
        "tolerances": None,
        "pictures": {},
        "toml": None,
    }
    data["handles"] = [handle.drawn() for handle in list_handles(scene, plain)]
    if settled:  # what `analyze` and `classify` print
        block = write_block(scene, solution, {**COMMON, **units}, pressure=pressure)
        data["summary"] = [*block, "", *write_type(scene.linkage, everything=True)]
    return data


def pack_frame(about: dict[str, Any]) -> bytes:
    """Pack an answer: arrays in `about["data"]["branches"]` become columns."""
    columns: list[tuple[str, str, int, int]] = []
    arrays: list[bytes] = []
    if "data" in about:
        branches: dict[str, dict[str, Any]] = {}
        for sign, table in about["data"]["branches"].items():
            branches[sign] = {name: column for name, column in table.items() if not isinstance(column, np.ndarray)}
            for name, column in table.items():
                if isinstance(column, np.ndarray):
                    columns.append((sign, name, len(column), column.ndim))
                    arrays.append(np.ascontiguousarray(column, dtype="<f8").tobytes())
        about = about | {"data": about["data"] | {"branches": branches}, "columns": columns}
    text = json.dumps(about, allow_nan=False, separators=(",", ":")).encode()
    text += b" " * (-(len(text) + 4) % 8)
    return b"".join((struct.pack("<I", len(text)), text, *arrays))
