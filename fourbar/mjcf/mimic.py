"""MJCF in which joints that follow the input take the place of the closed loop."""

import math
from collections.abc import Sequence
from xml.etree import ElementTree as ET

import numpy as np
from numpy.polynomial import Polynomial

from fourbar.mjcf.document import NOTES, find_start
from fourbar.mjcf.model import join
from fourbar.scene import Scene

STEPS = 2.0
"""Time constant in timesteps, the least that MuJoCo holds: its joint equality leaves out P'' omega^2, and lags by that
times the square of the time constant (measured: 4e-4 rad at 628 steps a turn)."""


def replace_loop(model: str, scene: Scene, about: float, joint_A: Sequence[float], theta_4: Sequence[float]) -> str:
    """Replace the loop's closure in the MJCF text of a scene by polynomials in theta_2 - about.

    Parameters
    ----------
    model : as `mjcf` writes it, with its keyframe.
    about : rad.
    joint_A, theta_4 : coefficients of theta_3 - theta_2 and of theta_4 (rad), lowest power first, five at most.
    """
    root, start = ET.fromstring(model), find_start(scene)
    for line in reversed(NOTES["mimic"].values()):
        root.insert(0, ET.Comment(f" {line} "))
    for body in list(root.iter("body")):  # they only carried the closure; its sites stay, and show what it is open by
        for pad in [each for each in body.findall("body") if each.get("name", "").endswith("_pad")]:
            body.remove(pad)
            body.extend(pad.findall("site"))
    option, equality, key = root.find("option"), root.find("equality"), root.find("keyframe/key")
    assert option is not None and equality is not None and key is not None
    (closure,) = equality.findall("connect")
    equality.remove(closure)
    timestep = float(option.get("timestep", "nan"))
    solref, solimp = join(STEPS * timestep, 1.0), closure.get("solimp", "")
    qpos, qvel = ([float(x) for x in key.get(name, "").split()] for name in ("qpos", "qvel"))
    for index, joint, coefficients in ((1, "A", joint_A), (2, "O4", theta_4)):
        # by what the joints have turned since the start, for in that pose the bodies are put down
        own = Polynomial(coefficients)(Polynomial([start.qpos[0] - about, 1.0]))
        rest = np.pad(own.coef, (0, 5 - len(own.coef)))
        rest[0] = math.remainder(rest[0] - start.qpos[index], math.tau)
        ET.SubElement(
            equality, "joint", name=joint, joint1=joint, joint2="O2", polycoef=join(*rest), solref=solref, solimp=solimp
        )
        qpos[index], qvel[index] = qpos[index] + float(rest[0]), float(rest[1]) * qvel[0]
    key.set("qpos", join(*qpos))
    key.set("qvel", join(*qvel))
    ET.indent(root)
    return ET.tostring(root, encoding="unicode") + "\n"
