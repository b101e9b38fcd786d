"""What an engine is told, and at what its answer is taken."""

import numpy as np

import fourbar
from fourbar.scene import Command, Scene
from fourbar_validation.compare.answer import Answer
from fourbar_validation.engines.registry import ask_at
from tests.support.rows import each_branch


class Told:
    """An engine that keeps what it is told, and answers at a motion of its own."""

    name, commands = "told", ("theta_2", "stroke")
    at: Command | None = None

    def answer(self, scene, command):
        self.command = command
        return Answer(self.name, "exact", at=self.at or command)


@each_branch
def test_an_engine_is_told_the_sign_and_answers_at_the_assembly(branch):
    """With a single change point the sign is back after two turns alone.

    A motion that the engine made is named by its assembly too.
    """
    linkage = fourbar.uniform(0.4, 0.1, 0.27, 0.23)
    angles = np.radians([90.0, 270.0, 450.0, 630.0])
    scene = Scene(linkage, fourbar.Motion(angles, 3.0, branch=branch))
    engine, command = Told(), fourbar.command(scene)
    ask_at(engine, scene, command)
    told = engine.command
    assert told.branch.tolist() == [branch, -branch, -branch, branch]
    engine.at = told._replace(angle=angles + 1e-3)
    assert ask_at(engine, scene, command).at.branch.tolist() == [branch] * 4
