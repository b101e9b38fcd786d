"""Classes that our host serves.

Free bodies under other names, and what the hostile ones do besides.
"""

import os
import sys

import numpy as np

from fourbar_validation.engines.free_body import FreeBody


class Right:
    name = "right"

    def answer(self, scene, command):
        answer = FreeBody().answer(scene, command)
        self.spoil(answer.quantities)
        return answer

    def spoil(self, quantities):
        """Change what is answered."""


class Angle(Right):
    name = "angle"
    quantities = ("theta_3",)

    def spoil(self, quantities):
        for name in quantities.keys() - {"theta_3"}:
            del quantities[name]


class Releases(Right):
    """MuJoCo's forward dynamics, and a step that it is given."""

    name = "releases"

    def __init__(self, step=1e-3):
        self.step = step

    def release(self, scene, times):
        from fourbar_validation.engines.mujoco.runner import MujocoForward

        return MujocoForward(self.step).release(scene, times)


class OfAnyBar(Right):
    """What is commanded of a stroke's bar is not given."""

    name = "of any bar"
    commands = ("theta_4", "stroke")
    effects = ("gravity", "loads", "cylinder")

    def answer(self, scene, command):
        assert not command.moves_stroke or np.isnan(command.angle).all()
        return super().answer(scene, command)


class Changes(Right):
    """Makes every verdict that it can import a good one, and every tolerance wide."""

    name = "changes"

    def spoil(self, quantities):
        from fourbar_validation.compare import compare, rows
        from fourbar_validation.compare.tolerance import EQUIVALENCE
        from fourbar_validation.run import judge

        for module in (compare, rows, judge):
            module.FAILS = module.AGREES = "agrees"
        object.__setattr__(EQUIVALENCE, "factor", 1e30)
        quantities["torque"] = 1.01 * quantities["torque"]


class Prints(Right):
    name = "prints"

    def answer(self, scene, command):
        print("\x1b]0;owned\x07begin")
        sys.stdout.flush()
        os.system("echo from a shell")
        raise ValueError("no\nlicence")


class Empty(Right):
    name = "empty"

    def answer(self, scene, command):
        return None


class Leaves(Right):
    name = "leaves"

    def answer(self, scene, command):
        sys.exit(0)


class Lacks(Right):
    """One quantity NaN, one missing."""

    name = "lacks"
    quantities = ("theta_3", "theta_4", "torque")

    def spoil(self, quantities):
        quantities["theta_4"] = np.nan * quantities["theta_4"]
        for name in quantities.keys() - {"theta_3", "theta_4"}:
            del quantities[name]


class Shapes(Right):
    name = "shapes"

    def spoil(self, quantities):
        quantities["F12"] = quantities["F12"].T


class Complex(Right):
    name = "complex"

    def spoil(self, quantities):
        quantities["torque"] = quantities["torque"].astype(complex)


class Elsewhere(Right):
    name = "elsewhere"

    def answer(self, scene, command):
        return super().answer(scene, command._replace(speed=0.0))


class Nameless:
    pass


class Loose(Right):
    name = "loose"
    tolerance = (0.1, "")


class Else(Right):
    name = "else"
    quantities = ("heat",)


class Misspelt(Right):
    name = "misspelt"
    effects = ("gravity", "spring")


class OfAnother(Right):
    name = "free-body"
