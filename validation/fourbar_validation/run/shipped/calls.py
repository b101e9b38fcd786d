"""Studies of many linkages, by the free bodies of each linkage for itself."""

from contextlib import suppress
from dataclasses import replace

import numpy as np

import fourbar
from fourbar.effects import Load
from fourbar.effects.load import Table
from fourbar.scene import Scene
from fourbar.scene.point import Point
from fourbar.studies.keys import command_key
from fourbar_validation.compare.rows import Row
from fourbar_validation.compare.tolerance import magnitude
from fourbar_validation.run.question import NotAskedError, Question
from fourbar_validation.run.shipped.variants import (
    SceneFile,
    ask_free_bodies,
    at_places,
    hold_to,
    keep_worst,
    take_few,
    take_member,
)

MEMBERS = 5
"""Members of the study, as many as positions: a square study, whose axes only its numbers tell apart."""
APART = 1e-2
"""Difference of its numbers from member to member, relative, for angles in rad."""
CORNERS = (0.07, 2.3, 4.1, 0.07 + 2.0 * np.pi)
"""rad from the first position; where the table of a load that the run adds is bent."""


def furnish(scene: Scene, question: Question) -> Scene:
    """Give the scene a point on each bar and a load over a table, as large as its forces, where it has none."""
    coupler, first = scene.linkage.coupler, float(question.solution.theta_2[0])
    if not scene.points:
        arms = {bar: (0.6 * scene.linkage.bar(bar).length, 0.4 * bar) for bar in (2, 3, 4)}
        scene = replace(scene, points=tuple(Point(f"P{bar}", bar, arm) for bar, arm in arms.items()))
    assert question.free_body is not None
    size = magnitude(question.free_body.quantities["F12"])
    positive = size[np.isfinite(size) & (size > 0.0)]
    if not any(load.table for load in scene.loads) and positive.size and scene.motion.law is None:
        force, table = 0.5 * float(np.median(positive)), Table(tuple(first + x for x in CORNERS), (1.0, -0.5, 2.0, 1.0))
        load = Load(3, (force, 0.3), (0.2 * coupler.length, 0.5), 0.1 * force * coupler.length, "bar", table)
        scene = replace(scene, loads=(*scene.loads, load))
    return scene


def study(question: Question) -> list[Row]:
    """Judge a square study in which every number varies, member by member."""
    scene = furnish(take_few(question), question)
    places, key = np.asarray(scene.motion.angle), command_key(scene)
    stated = SceneFile(scene).find_stated(fourbar.sensitivity(scene).keys)
    del stated[key]
    values = {
        key: np.array([x + number * APART * step for number in range(MEMBERS)]) for key, (x, step) in stated.items()
    }
    # the places of each member lie within those of the scene: nothing says that a table reaches further
    positions = np.array([places + APART * number * (places.mean() - places) for number in range(MEMBERS)])
    members: dict[int, Scene] = {}
    for number, member_positions in enumerate(positions):
        with suppress(NotAskedError):  # the others are judged, beside one that never assembles
            changes = {name: number * APART * entry.step for name, entry in stated.items()}
            members[number] = SceneFile(at_places(scene, member_positions)).move(changes)
    rows = []
    with np.errstate(all="ignore"):
        solved = fourbar.solve(fourbar.vary(scene, values | {key: positions}))
        for number, one in members.items():
            rows += hold_to(question, "study", one, take_member(solved, number), ask_free_bodies(one))
    return keep_worst(rows)
