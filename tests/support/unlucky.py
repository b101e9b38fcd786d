"""Scenes and engines that cost a worker its life.

A worker that imports them imports no more than it needs to judge.
"""

import os
import signal
from dataclasses import dataclass
from pathlib import Path
from time import sleep

from fourbar_validation.compare.answer import Answer
from fourbar_validation.scenes.suites import Suite
from tests.support.scenes import crank_rocker


@dataclass(frozen=True)
class Few(Suite):
    """Scenes made in code; the names say which engine misbehaves where."""

    names: tuple = ("a", "b", "c", "d")

    def __len__(self):
        return len(self.names)

    def name(self, index):
        return self.names[index]

    def scene(self, index):
        return crank_rocker(title=self.names[index])

    def fingerprint(self):
        return repr(self.names)


class Declines:
    """Answers no scene, after what it does."""

    def answer(self, scene, command):
        self.act(scene)
        return Answer(self.name, "exact", refusal="declined")


class Unlucky(Declines):
    """Kills its process as often as the folder LIVES has files, and then agrees."""

    name = "unlucky"

    def act(self, scene):
        for life in sorted(Path(os.environ["LIVES"]).iterdir()):
            life.unlink()
            os.kill(os.getpid(), signal.SIGKILL)


class Moody(Declines):
    """Agrees, except that it kills its process on scene b and hangs on scene c."""

    name = "moody"

    def act(self, scene):
        if scene.title == "b":
            os.kill(os.getpid(), signal.SIGSEGV)
        if scene.title == "c":
            sleep(3600.0)


def dies_at_first(*_):
    """End the process and take one of its lives as long as the folder LIVES has any."""
    lives = sorted(Path(os.environ["LIVES"]).iterdir())
    if lives:
        lives[0].unlink(missing_ok=True)
        os._exit(1)


def start_and_sleep(starts):
    """Work for some looks of the pool, before and after telling of it in a file."""
    sleep(1.0)
    with starts.open("a") as file:
        file.write("begun\n")
    sleep(1.0)
    return "done"
