"""Rows of what `analyze` prints.

They agree, and each number that is off fails its own.
"""

import re
from collections.abc import Callable
from copy import deepcopy
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import fourbar
from fourbar.show import driving
from fourbar.show.summary import Facts
from fourbar_validation.compare.rows import Row
from fourbar_validation.run.judge import make_question
from fourbar_validation.run.question import NotAskedError
from tests.oracle import summary as module
from tests.oracle.summary import summary
from tests.support.scenes import CYLINDER, crank_rocker

TURN = crank_rocker(motion=fourbar.Motion(fourbar.Sweep(0.1, 0.1 + 2 * np.pi, 36), 9.0))
PUSHED = crank_rocker(
    motion=fourbar.Motion(
        stroke=fourbar.Sweep(0.19, 0.31, 36),
        stroke_speed=0.2,
        side="left",
    ),
    drive=CYLINDER,
)


def judge(scene: fourbar.Scene) -> dict[str, Row]:
    return {row.quantity: row for row in summary(make_question("scene", scene, ()))}


@pytest.mark.parametrize("scene", (TURN, PUSHED), ids=("turn", "cylinder"))
def test_the_summary_of_a_scene_agrees_with_free_bodies(scene: fourbar.Scene) -> None:
    rows = judge(scene)
    assert not [row for row in rows.values() if row.failed]
    names = {"ranges", "peaks", "integrals", "pins", "bending"}
    names |= {"bore"} if scene is PUSHED else {"frame_force"}
    assert rows.keys() == names


def move_peak(peak: Any, part: float) -> Any:
    return peak._replace(value=peak.value * (1.0 + part))


FAULTS: dict[str, tuple[str, Callable[[Facts], Facts]]] = {
    "a range that ends short": (
        "ranges",
        lambda f: replace(
            f,
            angles={**f.angles, 4: (f.angles[4][0], move_peak(f.angles[4][1], -1e-6))},
        ),
    ),
    "a range that ends late": (
        "ranges",
        lambda f: replace(
            f,
            angles={**f.angles, 3: (f.angles[3][0], move_peak(f.angles[3][1], 1e-6))},
        ),
    ),
    "a range that is a whole turn too wide": (
        "ranges",
        lambda f: replace(
            f,
            angles={
                **f.angles,
                3: (
                    f.angles[3][0],
                    f.angles[3][1]._replace(value=f.angles[3][1].value + 2.0 * np.pi),
                ),
            },
        ),
    ),
    "a peak of the positions": (
        "peaks",
        lambda f: replace(f, peak=move_peak(f.peak, -1e-6)),
    ),
    "a place of another peak": (
        "peaks",
        lambda f: replace(f, peak=f.peak._replace(place=f.peak.place + 0.01)),  # type: ignore[union-attr]
    ),
    "the load of another pin": (
        "pins",
        lambda f: replace(f, pins={**f.pins, "A": f.pins["B"]}),
    ),
    "a mean of a pin over the positions of an open sweep": (
        "integrals",
        lambda f: replace(
            f,
            pins={**f.pins, "A": f.pins["A"]._replace(rms=f.pins["A"].rms * 1.001)},
        ),
    ),
    "a bending moment of another place": (
        "bending",
        lambda f: replace(
            f,
            bending={**f.bending, 3: f.bending[3]._replace(x=f.bending[3].x * 0.9)},
        ),
    ),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_a_fact_that_is_off_fails_its_row(
    fault: str,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    name, change = FAULTS[fault]
    summarize = module.summarize
    monkeypatch.setattr(module, "summarize", lambda *of: change(summarize(*of)))
    failing = {row.quantity for row in judge(TURN).values() if row.failed}
    assert name in failing


def lose(bars: Any, kept: int) -> Any:
    return {kept: bars[kept]}


def spoil_bending(facts: Facts, value: float) -> Facts:
    spoiled = facts.bending[3]._replace(
        peak=facts.bending[3].peak._replace(value=value)
    )
    return replace(facts, bending={**facts.bending, 3: spoiled})


MISSING: dict[str, tuple[str, Callable[[Facts], Facts]]] = {
    "no pin": ("all", lambda f: replace(f, pins={})),
    "one pin": ("all", lambda f: replace(f, pins={"A": f.pins["A"]})),
    "no bending": ("all", lambda f: replace(f, bending={})),
    "bending of one bar": ("all", lambda f: replace(f, bending=lose(f.bending, 3))),
    "angles of one bar": ("all", lambda f: replace(f, angles=lose(f.angles, 2))),
    "no peak": ("all", lambda f: replace(f, peak=None)),
    "no duty": ("all", lambda f: replace(f, duty=None)),
    "bending that is no number": ("bending", lambda f: spoil_bending(f, np.nan)),
    "bending that is none": ("bending", lambda f: spoil_bending(f, 0.0)),
    "a range whose low end is no number": (
        "all",
        lambda f: replace(
            f,
            angles={
                **f.angles,
                4: (f.angles[4][0]._replace(value=np.nan), f.angles[4][1]),
            },
        ),
    ),
    "a transmission angle that is no number": (
        "ranges",
        lambda f: replace(f, transmission=f.transmission._replace(value=np.nan)),
    ),
    "a peak that is no number": (
        "peaks",
        lambda f: replace(f, peak=f.peak._replace(value=np.nan)),  # type: ignore[union-attr]
    ),
    "a mean of a pin that is no number": (
        "integrals",
        lambda f: replace(f, pins={**f.pins, "O4": f.pins["O4"]._replace(rms=np.nan)}),
    ),
}


@pytest.mark.parametrize("fault", MISSING)
def test_what_is_missing_or_no_number_fails(
    fault: str,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """What the judge cannot find breaks its check down, in a row that fails."""
    name, change = MISSING[fault]
    summarize = module.summarize
    monkeypatch.setattr(module, "summarize", lambda *of: change(summarize(*of)))
    question = make_question("scene", TURN, ())
    rows = [*question.attempt(lambda: summary(question), "summary")]
    assert [row.quantity for row in rows if row.failed] == [name]


def grow(facts: Facts, name: str) -> Facts:
    motion = deepcopy(facts.motion)
    motion.panels.curves[name].poles.append(0)
    return replace(facts, motion=motion)


GROWING = ("torque", "speed", "power", "F12", "F43")


@pytest.mark.parametrize("name", GROWING)
def test_what_is_said_to_grow_far_from_every_pole_fails(
    name: str,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    summarize = module.summarize
    monkeypatch.setattr(module, "summarize", lambda *of: grow(summarize(*of), name))
    rows = judge(TURN)
    assert {row.quantity for row in rows.values() if row.failed} == {"peaks"}


@pytest.mark.parametrize("turns", (1, 24))
def test_what_grows_between_positions_is_believed(turns: int) -> None:
    """The drive's bar stands still between the positions, of which none is near."""
    sweep = fourbar.Sweep(0.12, 0.12 + 2 * np.pi * turns, 40 * turns)
    scene = crank_rocker(motion=fourbar.Motion(sweep, 9.0), drive_bar=4)
    question = make_question("scene", scene, ())
    assert module.summarize_scene(question).motion.panels.growing
    assert not judge(scene)["peaks"].failed


@pytest.mark.parametrize("part", (0.0, 0.137, 0.479, 0.863))
def test_a_bar_that_bends_more_elsewhere_fails(
    part: float,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The largest moment that is said may be a true one, at another place."""
    free_piece = module.free_piece

    def bend_more(*of: Any) -> Any:
        piece = free_piece(*of)
        if piece.bar == 3 and piece.cut == part * TURN.linkage.coupler.length:
            piece.M += 1e3
        return piece

    monkeypatch.setattr(module, "free_piece", bend_more)
    rows = judge(TURN)
    assert {row.quantity for row in rows.values() if row.failed} == {"bending"}


@pytest.mark.parametrize(
    ("key", "name"),
    [
        ("", "all"),
        ("peak_torque", "peaks"),
        ("peak_speed", "peaks"),
        ("peak_power", "peaks"),
        ("rms_torque", "integrals"),
        ("rms_power", "integrals"),
        ("energy_in", "integrals"),
        ("energy_out", "integrals"),
        ("energy_swing", "integrals"),
        ("mean_torque", "integrals"),
        ("pins", "pins"),
    ],
)
def test_what_is_missing_in_the_json_or_no_number_fails(
    key: str,
    name: str,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    write = module.write_motor

    def spoil(*of: Any) -> Any:
        entry = write(*of)
        if not key or entry is None:
            return None
        spoiled: Any = np.nan
        if key == "pins":
            spoiled = {**entry["pins"], "B": {**entry["pins"]["B"], "peak": np.nan}}
        return {**entry, key: spoiled}

    monkeypatch.setattr(module, "write_motor", spoil)
    question = make_question("scene", TURN, ())
    rows = [*question.attempt(lambda: summary(question), "summary")]
    assert [row.quantity for row in rows if row.failed] == [name]


@pytest.mark.parametrize("turns", (1, 2, 3))
def test_a_turn_that_is_taken_for_an_open_motion_fails(
    turns: int,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Its word for a closed motion follows from it."""
    sweep = fourbar.Sweep(0.1, 0.1 + 2 * np.pi * turns, 36 * turns)
    scene = crank_rocker(motion=fourbar.Motion(sweep, 9.0))
    assert not [row for row in judge(scene).values() if row.failed]
    count = driving.count_turns
    monkeypatch.setattr(driving, "count_turns", lambda *of: 5 * count(*of))
    failing = {row.quantity for row in judge(scene).values() if row.failed}
    assert failing == {"integrals"}


def test_an_open_motion_that_is_taken_for_a_turn_fails(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    sweep = fourbar.Sweep(0.1, 0.1 + 1.5 * np.pi, 36)
    scene = crank_rocker(motion=fourbar.Motion(sweep, 9.0))
    assert not [row for row in judge(scene).values() if row.failed]
    count = driving.count_turns
    monkeypatch.setattr(driving, "count_turns", lambda *of: 0.75 * count(*of))
    failing = {row.quantity for row in judge(scene).values() if row.failed}
    assert failing == {"integrals"}


@pytest.mark.parametrize("factor", (1.0 - 2e-3, 1.0 + 2e-3))
@pytest.mark.parametrize(
    ("key", "name"),
    [
        ("peak_torque", "peaks"),
        ("peak_speed", "peaks"),
        ("peak_power", "peaks"),
        ("rms_torque", "integrals"),
        ("rms_power", "integrals"),
        ("energy_in", "integrals"),
        ("energy_out", "integrals"),
        ("energy_swing", "integrals"),
    ],
)
def test_a_number_of_the_json_that_is_off_fails_its_row(
    key: str,
    name: str,
    factor: float,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    write = module.write_motor

    def off(*of: Any) -> Any:
        entry = write(*of)
        assert entry is not None
        return {**entry, key: entry[key] * factor}

    monkeypatch.setattr(module, "write_motor", off)
    rows = judge(TURN)
    assert {row.quantity for row in rows.values() if row.failed} == {name}


def test_a_mean_torque_that_is_off_fails_its_row(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """That of a turn without damping is 0: a part of it would be 0 too."""
    write = module.write_motor

    def off(*of: Any) -> Any:
        entry = write(*of)
        assert entry is not None
        return {**entry, "mean_torque": entry["mean_torque"] + 1e-4}

    monkeypatch.setattr(module, "write_motor", off)
    rows = judge(TURN)
    assert {row.quantity for row in rows.values() if row.failed} == {"integrals"}


def test_a_printed_bore_that_is_off_fails_its_row(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    write = module.write_block

    def off(*of: Any, **options: Any) -> list[str]:
        lines = write(*of, **options)
        return [re.sub(r"at least (\d)", r"at least 1\1", line) for line in lines]

    monkeypatch.setattr(module, "write_block", off)
    rows = judge(PUSHED)
    assert {row.quantity for row in rows.values() if row.failed} == {"bore"}


def test_a_bar_that_bends_the_same_everywhere_agrees_beside_a_pole() -> None:
    """A force drives the coupler, and has no lever at two places within steps."""
    scene = fourbar.load(
        Path(__file__).parents[1]
        / "counterexamples"
        / "bar_without_drive_beside_a_pole.toml"
    )
    rows = judge(scene)
    assert rows["bending"].compared
    assert not [row for row in rows.values() if row.failed]


def test_positions_of_the_judge_on_a_pole_say_nothing() -> None:
    """The force passes through O2 at 65 degrees, where the judge looks too.

    What free bodies say there is rounding over a lever of 4e-17 of the crank.
    """
    pole = np.radians(65.0)
    scene = crank_rocker(
        motion=fourbar.Motion(fourbar.Sweep(0.0, 2.0 * np.pi, 36), 9.0, 3.0),
        drive_bar=None,
        drive=fourbar.PointDrive(fourbar.Place(2, (0.05, 0.0)), pole),
    )
    rows = judge(scene)
    assert rows["bending"].compared
    assert not [row for row in rows.values() if row.failed]


def test_what_has_poles_or_jumps_is_not_asked() -> None:
    rocker = fourbar.Motion(theta_4=fourbar.Sweep(1.5, 3.5, 20), omega_4=2.0)
    for scene, why in (
        (crank_rocker(motion=rocker), "no forces somewhere"),
        (crank_rocker(effects=(fourbar.Friction.at(A=0.1),)), "jump"),
        (crank_rocker(motion=fourbar.Motion(np.array([0.1, 0.2]), 1.0)), "no sweep"),
    ):
        with pytest.raises(NotAskedError, match=why):
            judge(scene)
