"""Pictures of some scenes of a run: drawn again, and by MuJoCo from their MJCF."""

from collections.abc import Iterable, Iterator, Sequence

from fourbar.errors import FourBarError
from fourbar.mjcf import write_mjcf
from fourbar_validation.compare.rows import make_plain
from fourbar_validation.engines.mujoco.picture import render_pictures
from fourbar_validation.engines.witnesses import Witness
from fourbar_validation.report.record import Record
from fourbar_validation.run import pool
from fourbar_validation.scenes.suites import Suite


def draw_scenes(
    suite: Suite,
    places: Sequence[int],
    records: Iterable[Record],
    witnesses: Sequence[Witness],
    workers: int,
    seconds: float | None,
) -> Iterator[Record]:
    """Judge some scenes once more, now with their pictures: their answers were not kept.

    An engine that broke down, or hung, in a scene is not started in it again.
    """
    broken = {record.name: {row.engine for row in record.rows if row.failed and row.quantity == "all"}
              for record in records}  # fmt: skip
    groups: dict[tuple[Witness, ...], list[int]] = {}
    for index in places:
        without = broken[make_plain(suite.name(index))]
        groups.setdefault(tuple(each for each in witnesses if each.name not in without), []).append(index)
    for who, indices in groups.items():
        chunks = [(index, range(index, index + 1)) for index in indices]
        for _, judged in pool.judge_chunks(suite, chunks, who, True, workers, seconds):
            yield from judged


def picture_models(suite: Suite, places: Iterable[int]) -> tuple[dict[str, str], str]:
    """Picture the MJCF of some scenes by MuJoCo: base64 PNGs by name, and the reason where there are none."""
    texts = {}
    for index in places:
        try:
            texts[suite.name(index)] = write_mjcf(suite.scene(index))
        except FourBarError:  # bars without mass, a motion law: the engines' own rows say so
            continue
    return render_pictures(texts)
