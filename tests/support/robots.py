"""MJCF of robots with loops of known lengths, written from points in a plane."""

import math
from dataclasses import dataclass, field, replace
from pathlib import Path

import mujoco
import numpy as np
from scipy.spatial.transform import Rotation

from fourbar_validation.engines.mujoco.robots.closures import (
    find_closures,
    list_closures,
)
from fourbar_validation.engines.mujoco.robots.loop_facts import (
    MeasureOptions,
    PoseOptions,
    RobotFile,
)
from fourbar_validation.engines.mujoco.robots.loop_scene import read_loop_scene
from fourbar_validation.engines.mujoco.robots.measure import (
    examine_mended,
    measure_loops,
)
from fourbar_validation.engines.mujoco.robots.pose import pose_robot
from fourbar_validation.places import MODELS
from fourbar_validation.robots.files import read_robot
from fourbar_validation.robots.judge_loop import judge_file, list_answers

FOOT, GRIPPER = (
    (MODELS / "robots" / f"{name}.xml").read_text()
    for name in ("biped_foot", "gripper")
)
"""Our models of a biped's foot and of a gripper of two fingers."""
TILT = (0.3, -0.2, 0.7, 0.5)
"""Quaternion of the ground's body, not normalized."""


FINGER = """
<mujoco model="finger of a hand">
  <compiler angle="radian" autolimits="false"/>
  <default>
    <default class="finger">
      <joint axis="1 0 0" damping="0.001" limited="true" range="-0.2 1.7"/>
      <default class="driven">
        <joint armature="2e-5" frictionloss="0.002"/>
      </default>
    </default>
  </default>
  <worldbody>
    <body name="palm" pos="0 0 0.3" euler="0 1.2 0.3">
      <inertial pos="0 0 0.03" mass="0.5" diaginertia="4e-4 4e-4 2e-4"/>
      <body name="knuckle" pos="0 0.02 0.09" childclass="finger">
        <inertial pos="0 0 0" mass="0.01" diaginertia="1e-6 1e-6 1e-6"/>
        <joint name="abduction" axis="0 1 0"/>
        <body name="proximal">
          <joint name="mcp" class="driven"/>
          <inertial pos="0 0 0.02" quat="0.9 0.1 0.1 0" mass="0.025"
              diaginertia="6e-6 6e-6 2e-6"/>
          <body name="middle" pos="0 0 0.045">
            <joint name="pip"/>
            <inertial pos="0 0 0.014" mass="0.015" diaginertia="2e-6 2e-6 6e-7"/>
            <body name="distal" pos="0 0 0.027">
              <joint name="dip"/>
              <inertial pos="0 0 0.01" mass="0.008" diaginertia="8e-7 8e-7 3e-7"/>
            </body>
          </body>
          <body name="dip_link" pos="0 -0.0068 0.043">
            <joint name="dip_link"/>
            <inertial pos="0 0.004 0.015" mass="0.002" diaginertia="1e-7 1e-7 1e-8"/>
          </body>
        </body>
        <body name="pip_link" pos="0 -0.007 0.002">
          <joint name="pip_link"/>
          <inertial pos="0 0.004 0.02" mass="0.002" diaginertia="3e-7 3e-7 1e-8"/>
        </body>
      </body>
    </body>
  </worldbody>
  <equality>
    <connect name="dip_loop" body1="dip_link" body2="distal" anchor="0 0.0035 0.0335"/>
    <connect body1="pip_link" body2="middle" anchor="0 0.012 0.047"/>
  </equality>
  <actuator>
    <position name="mcp" joint="mcp" kp="3" forcelimited="true" forcerange="-1 1"/>
  </actuator>
</mujoco>
"""
"""Two loops of which one drives the other."""
ADAPTIVE = """
<mujoco model="adaptive gripper">
  <compiler angle="radian" autolimits="true"/>
  <option cone="elliptic"/>
  <default>
    <joint axis="1 0 0"/>
    <default class="driver">
      <joint range="0 0.8" armature="0.005" damping="0.1"/>
    </default>
    <default class="spring_link">
      <joint range="-0.3 0.8" stiffness="0.05" springref="2.62"/>
    </default>
  </default>
  <worldbody>
    <body name="base" quat="1 0 0 -1">
      <inertial pos="0 0 0.035" mass="0.8" diaginertia="3e-4 2e-4 2e-4"/>
      <body name="driver" pos="0 0.03 0.055">
        <joint name="driver" class="driver"/>
        <inertial pos="0 0.0178 0.001" quat="0.68 0.73 0 0" mass="0.009"
            diaginertia="1.7e-6 1.6e-6 3e-7"/>
        <body name="coupler" pos="0 0.0315 -0.0041">
          <joint name="coupler" range="-1.57 0.2"/>
          <inertial pos="0 0.003 0.023" quat="0.7 -0.05 0.05 0.7" mass="0.014"
              diaginertia="4.2e-6 3.5e-6 9e-7"/>
        </body>
      </body>
      <body name="spring_link" pos="0 0.013 0.061">
        <joint name="spring_link" class="spring_link"/>
        <inertial pos="0 0.018 0.021" quat="0.66 -0.24 0.24 0.66" mass="0.022"
            diaginertia="9e-6 6.7e-6 2.6e-6"/>
        <body name="follower" pos="0 0.055 0.0375">
          <joint name="follower" pos="0 -0.018 0.0065" range="-0.87 0.87"/>
          <inertial pos="0 -0.011 0.0125" mass="0.0125"
              diaginertia="2.7e-6 2.5e-6 6e-7"/>
        </body>
      </body>
      <body name="other" pos="0 -0.03 0.055">
        <joint name="other" class="driver"/>
        <inertial pos="0 -0.0178 0.001" mass="0.009" diaginertia="1.7e-6 1.6e-6 3e-7"/>
      </body>
    </body>
  </worldbody>
  <tendon>
    <fixed name="split">
      <joint joint="driver" coef="0.5"/>
      <joint joint="other" coef="0.5"/>
    </fixed>
  </tendon>
  <equality>
    <connect anchor="0 0 0" body1="follower" body2="coupler" solimp="0.95 0.99 0.001"
        solref="0.005 1"/>
    <joint joint1="driver" joint2="other" polycoef="0 1 0 0 0"/>
  </equality>
  <actuator>
    <general tendon="split" forcerange="-5 5" gainprm="0.3 0 0" biasprm="0 -100 -10"
        biastype="affine"/>
  </actuator>
</mujoco>
"""
"""Five hinges, one of them with a spring, and a joint that follows that of the other
finger.
"""
EXCAVATOR = """
<mujoco model="excavator">
  <compiler angle="degree" autolimits="true"/>
  <default>
    <joint axis="0 -1 0" damping="500"/>
    <geom type="capsule" contype="0" conaffinity="0"/>
  </default>
  <worldbody>
    <body name="stick" pos="4 0 1">
      <joint name="stick" range="-120 10"/>
      <geom fromto="0 0 0 2 0 -0.5" size=".12" mass="450"/>
      <body name="bucket" pos="2 0 -0.5">
        <joint name="bucket" range="-90 40"/>
        <geom type="box" size=".4 .5 .3" pos="0.3 0 -0.4" mass="600"/>
      </body>
      <body name="rocker" pos="1.7 0 -0.42">
        <joint name="rocker"/>
        <geom fromto="0 0 0 0.1 0 0.4" size=".05" mass="40"/>
        <site name="rocker_top" pos="0.1 0 0.4"/>
        <body name="link" pos="0.1 0 0.4">
          <joint name="link"/>
          <geom fromto="0 0 0 0.45 0 -0.1" size=".05" mass="35"/>
        </body>
      </body>
      <body name="cylinder" pos="0.3 0 0.3">
        <joint name="cylinder"/>
        <geom fromto="0 0 0 0.9 0 -0.1" size=".07" mass="60"/>
        <body name="piston" pos="0.9 0 -0.1">
          <joint name="stroke" type="slide" axis="0.98 0 -0.19" range="-0.5 0.6"/>
          <geom fromto="0 0 0 0.6 0 -0.2" size=".04" mass="25"/>
          <site name="piston_end" pos="0.6 0 -0.22"/>
        </body>
      </body>
    </body>
  </worldbody>
  <equality>
    <connect name="bucket_linkage" body1="link" body2="bucket" anchor="0.45 0 -0.1"/>
    <connect name="piston_pin" site1="piston_end" site2="rocker_top"/>
  </equality>
  <actuator>
    <motor joint="stroke"/>
  </actuator>
</mujoco>
"""
"""A linkage that the cylinder of another loop moves."""


LIFTED = """
<mujoco model="arm with a tool">
  <compiler angle="degree" autolimits="true" inertiafromgeom="true"/>
  <default>
    <geom type="capsule" size=".01" contype="0" conaffinity="0"/>
    <default class="pin">
      <joint axis="0 0 1" stiffness="0.2" springref="20" frictionloss="0.01"/>
    </default>
  </default>
  <worldbody>
    <body name="base" pos="0 0 1" axisangle="1 1 0 40">
      <joint name="lift" axis="0 1 0" type="slide"/>
      <geom type="sphere" size="0.1"/>
      <body name="arm" childclass="pin">
        <joint name="arm" range="-30 60"/>
        <geom fromto="0 0 0 .08 0 0"/>
        <body name="tool" pos="0.05 0 0.02" gravcomp="1">
          <joint name="tool" axis="1 0 0" range="-90 90"/>
          <geom type="box" size=".02 .01 .03"/>
        </body>
      </body>
      <body name="lever" pos=".2 0.01 0" childclass="pin">
        <joint name="lever" axis="0 0 -1" range="-80 80" armature="0.001"/>
        <geom fromto="0 0 0 .03 .12 0"/>
        <body name="rod" pos=".03 .12 0" gravcomp="0.5">
          <joint name="rod"/>
          <geom fromto="0 0 0 -.08 -.06 0"/>
        </body>
      </body>
    </body>
  </worldbody>
  <equality>
    <weld body1="rod" body2="arm" torquescale="0" anchor=".08 0 0" solref="0.01 1"/>
  </equality>
  <actuator>
    <position joint="arm" kp="5" kv=".1"/>
    <motor joint="tool"/>
  </actuator>
</mujoco>
"""
"""A weld that is a pin, springs, friction, and bodies that are held against gravity."""


def file_of(text):
    """Return a text as a file that names no other, and a file as it is."""
    if isinstance(text, RobotFile):
        return text
    return RobotFile(Path("robot.xml"), text)


def report_of(file, **pose):
    """Return the closures of a file or text in a pose."""
    return list_closures(file_of(file), PoseOptions(**pose))


def pose_loop(file, name=None, **pose):
    """Return a robot in its pose, and its loop of this name or the first one."""
    posed = pose_robot(file_of(file), PoseOptions(**pose))
    return posed, next(one.loop for one in find_closures(posed, name) if one.loop)


def read_scene(text, loop=None, speed=3.0, **pose):
    """Return what is read of a loop of a text in a pose, as a scene."""
    return read_loop_scene(file_of(text), PoseOptions(**pose), loop, speed)


AS_DRAWN = MeasureOptions(PoseOptions())
"""A robot is measured in the pose of its file."""


def forward(text):
    """Return the model of a text, and its data where it begins."""
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return model, data


def measure_all(file, scene=None, joints=(), **options):
    """Measure the loops of a file or text with its joints where they are stated."""
    asked = MeasureOptions(PoseOptions(dict(joints)), **options)
    return measure_loops(file_of(file), asked, scene)


def measure(*asked, **options):
    """Measure the one loop of a file or text, or the one that is chosen."""
    (loop,) = measure_all(*asked, **options).loops
    return loop


def examine_text(scene, text=None, **names):
    """Examine a text as a file that names no other.

    Without a text it is the file generated from the scene.
    """
    file = None if text is None else file_of(text)
    return measure_loops(file, replace(AS_DRAWN, names=names), scene)


def mend(scene, file, names, changes):
    """Return the answers of a file with each entry as in the generated one."""
    options = replace(AS_DRAWN, names=names)
    mended = examine_mended(scene, file_of(file), options, changes)
    return [measured and list_answers(measured) for measured in mended]


def judge_path(name, scene, path):
    """Judge a file as `check-mjcf SCENE FILE` does."""
    return judge_file(name, scene, read_robot(path), AS_DRAWN)


def notes_of(examined):
    """Return the notes on a file and on what was found in it."""
    (loop,) = examined.loops
    return [*examined.notes, *loop.parts, *loop.remarks]


def answers_of(examined):
    """Return the answers of a file that was examined."""
    return list_answers(examined.loops[0])


def answer_of(examined, how):
    """Return the answer of one engine to a file; it has one."""
    (answer,) = (one for one in answers_of(examined) if one.engine == how)
    assert answer.refusal is None, answer.refusal
    return answer


@dataclass
class Planar:
    """A four-bar in the pose of its pins, and how the tree of its bodies is cut."""

    pins: dict = field(
        default_factory=lambda: {
            "O2": (0.0, 0.0),
            "A": (0.03, 0.08),
            "B": (0.25, 0.17),
            "O4": (0.3, 0.02),
        }
    )
    cut: str = "B"
    by: str = "anchor"
    """How the loop is closed: anchor, site, or weld within the coupler."""
    joint: str = ""
    """Further attributes of every hinge."""
    equality: str = ""
    """Further attributes of the equality."""
    base: str = "<freejoint/>"
    ground: str = ""
    """Further elements of the ground's body."""
    on_coupler: str = ""
    """Further elements of the coupler's body."""
    axes: dict = field(default_factory=dict)
    """Axis of a pin where it is not z."""
    drive: str = "O2"
    more: str = ""
    """Further elements of the file."""

    def body(self, name, pin, at, inside=""):
        """Return a body on a hinge at a pin, its frame there.

        The frame of its parent is at `at`.
        """
        x, y = np.subtract(self.pins[pin], at).tolist()
        axis = self.axes.get(pin, "0 0 1")
        return (
            f'<body name="{name}" pos="{x!r} {y!r} 0">'
            f'<joint name="{pin}" axis="{axis}" {self.joint}/>'
            '<inertial pos="0.01 0.02 0.003" mass="0.3" diaginertia="1e-3 1e-3 1e-3"/>'
            f"{inside}</body>"
        )

    def end(self, name, bar_at):
        """Return a site at the cut pin on a body whose frame is at `bar_at`."""
        x, y = np.subtract(self.pins[self.cut], bar_at).tolist()
        return f'<site name="{name}" pos="{x!r} {y!r} 0"/>'

    def hang(self, bars, site):
        """Return the last of the bodies that hang on each other, each by its pin, its
        place, and all of them as text with a site at the cut pin on the last.
        """
        places = [(0.0, 0.0), *(self.pins[pin] for pin, _ in bars)]
        text = self.end(site, places[-1])
        for (pin, name), before in reversed([*zip(bars, places, strict=False)]):
            if name == "coupler":
                text += self.on_coupler
            text = self.body(name, pin, before, text)
        return ("ground", *(name for _, name in bars))[-1], places[-1], text

    def text(self):
        """Write the MJCF."""
        p = self.pins
        if self.by == "weld":
            half = self.body("coupler_half", "B", p["O4"])
            coupler = self.body("coupler", "A", p["O2"], self.on_coupler)
            bodies = self.body("input", "O2", (0.0, 0.0), coupler)
            bodies += self.body("output", "O4", (0.0, 0.0), half)
            closed = f'<weld body1="coupler" body2="coupler_half" {self.equality}/>'
            return self._wrap(bodies, closed)
        ring = [("O2", "input"), ("A", "coupler"), ("B", "output"), ("O4", "ground")]
        index = [pin for pin, _ in ring].index(self.cut)
        # behind the cut pin bars hang on the pin at their other end
        other_way = [
            (ring[i + 1][0], ring[i][1]) for i in reversed(range(index, len(ring) - 1))
        ]
        first, at, one = self.hang(ring[:index], "one")
        second, _, two = self.hang(other_way, "two")
        bodies = one + two
        x, y = np.subtract(p[self.cut], at).tolist()
        closed = (
            f'<connect site1="one" site2="two" {self.equality}/>'
            if self.by == "site"
            else (
                f'<connect body1="{first}" body2="{second}" anchor="{x!r} {y!r} 0" '
                f"{self.equality}/>"
            )
        )
        return self._wrap(bodies, closed)

    def _wrap(self, bodies, closed):
        quat = " ".join(map(repr, TILT))
        motor = f'<actuator><motor name="motor" joint="{self.drive}"/></actuator>'
        return (
            '<mujoco><compiler angle="radian"/><worldbody>'
            f'<body name="ground" pos="1 2 3" quat="{quat}">{self.base}'
            '<inertial pos="0 0 0" mass="5" diaginertia="1 1 1"/>'
            f"{self.ground}{bodies}</body></worldbody>"
            f"<equality>{closed}</equality>{motor if self.drive else ''}{self.more}"
            "</mujoco>"
        )

    def lengths(self):
        """Return the lengths of ground, input, coupler and output, m."""
        p = self.pins
        pairs = (("O2", "O4"), ("O2", "A"), ("A", "B"), ("O4", "B"))
        return tuple(math.dist(p[one], p[other]) for one, other in pairs)


def rotation(quaternion):
    """Return the matrix of a quaternion (w, x, y, z), which is normalized first."""
    return Rotation.from_quat(quaternion, scalar_first=True).as_matrix()


PARALLELOGRAM = """
<mujoco>
  <option gravity="{gravity}"/>
  <worldbody>
    <body name="link_1">
      <geom type="capsule" size=".02" fromto="0 0 0 0 0 {ground}"/>
      <body name="link_2">
        <joint name="hinge_1" axis="1 0 0"/>
        <geom type="capsule" size=".02" fromto="0 0 0 0 {crank} 0"/>
        <body name="link_3" pos="0 {crank} 0">
          <joint name="hinge_2" axis="1 0 0"/>
          <geom type="capsule" size=".02" fromto="0 0 0 0 0 {ground}"/>
          <body name="link_4" pos="0 0 {ground}">
            <joint name="hinge_3" axis="1 0 0"/>
            <geom type="capsule" size=".02" fromto="0 0 0 0 -{crank} 0"/>
          </body>
        </body>
      </body>
    </body>
  </worldbody>
  <equality>
    <connect name="link" body1="link_1" body2="link_4" anchor="0 0 {ground}"/>
  </equality>
  <actuator>
    <motor joint="hinge_1"/>
    <motor joint="hinge_2"/>
  </actuator>
</mujoco>
"""
"""Bars of uniform rods; the rest pose is the rectangle."""


def make_parallelogram(ground, crank, gravity):
    text = PARALLELOGRAM.format(ground=ground, crank=crank, gravity=gravity)
    return RobotFile(Path("parallelogram.xml"), text)


FOOT_PARALLELOGRAM = """
<mujoco>
  <compiler angle="radian"/>
  <default><geom type="capsule" contype="0" conaffinity="0"/></default>
  <worldbody>
    <body name="foot" pos="0 0 0.15">
      <joint name="pitch" axis="0 1 0" damping="0.5"/>
      <geom fromto="-0.055821 0 0.022 0 0 0" size="0.01" mass="0.27"/>
      <body name="rod" pos="-0.055821 0 0.022">
        <joint name="ankle" axis="0 1 0"/>
        <geom fromto="0 0 0 0 0 0.14" size="0.005" mass="0.014"/>
      </body>
    </body>
    <body name="crank" pos="0 0 0.29" quat="0.982434 0 0.18661 0">
      <joint name="motor" axis="0 1 0" range="-1.2 1.2" damping="0.5"/>
      <geom fromto="0 0 0 -0.06 0 0" size="0.005" mass="0.016"/>
    </body>
  </worldbody>
  <equality>
    <connect name="rod" body1="crank" body2="rod" anchor="-0.06 0 0"/>
  </equality>
  <actuator><motor joint="motor"/></actuator>
</mujoco>
"""
"""A foot that a crank moves by a parallelogram of six-digit numbers: 140, 60, 140 and
60 mm but for 0.2 um. The range of its motor ends at a change point.
"""


def draw_knee(drawn):
    """Write a parallelogram of 250 and 30 mm, drawn with all bars in line.

    `drawn`: 0 or 180 deg, the angle of the crank from the ground.
    """
    crank = 0.03 * math.cos(math.radians(drawn))
    return f"""
<mujoco><option gravity="0 -9.81 0"/><worldbody>
<body name="crank"><joint name="motor" axis="0 0 1"/>
 <inertial pos="{crank / 2.0} 0 0" mass=".6" diaginertia="8e-4 8e-4 8e-4"/>
 <body name="coupler" pos="{crank} 0 0"><joint name="pin" axis="0 0 1"/>
  <inertial pos=".12 0 0" mass=".1" diaginertia="9e-4 9e-4 9e-4"/>
  <site name="s3" pos=".25 0 0"/></body></body>
<body name="calf" pos=".25 0 0"><joint name="knee" axis="0 0 1"/>
 <inertial pos=".1 0 0" mass=".3" diaginertia="2e-3 2e-3 2e-3"/>
 <site name="s4" pos="{crank} 0 0"/></body>
</worldbody><equality><connect name="rod" site1="s3" site2="s4"/></equality>
<actuator><motor joint="motor"/></actuator></mujoco>
"""
