"""PyBullet's reaction of the second of two bars in series is wrong where both joints
turn; its accelerations are right.

Engine: pybullet (pybullet)
Expected: enableJointForceTorqueSensor gives the force that Newton's law asks for: mass
  times acceleration of what hangs on the joint, with the accelerations that the same
  step found.
Found: Two bars in series in the plane, without loop, gravity or motor, stand at 0.3 and
  0.7 rad and turn at 2 and -3 rad/s. The second joint is said to carry 6.14 N where
  Newton's law asks for 2.62 N. It is exact when either joint stands still: a term with
  the product of both speeds is in question. gz-physics' bullet-featherstone plugin uses
  the same code.
Since: 3.2.7 or before
Until: still in 3.2.7
Reported: not reported yet; bulletphysics/bullet3 #4451 and #4462 fixed another term
"""

import math
import sys
import tempfile
from pathlib import Path

import pybullet as bullet

LINK = (
    '<link name="{0}"><inertial><origin xyz=".5 0 0"/><mass value="1"/><inertia'
    ' ixx=".1" iyy=".1" izz=".1" ixy="0" ixz="0" iyz="0"/></inertial></link><joint'
    ' name="to_{0}" type="continuous"><parent link="{1}"/><child link="{0}"/><origin'
    ' xyz="{2} 0 0"/><axis xyz="0 0 1"/></joint>'
)
URDF = (
    '<robot name="two"><link'
    f' name="ground"/>{LINK.format("a", "ground", 0)}{LINK.format("b", "a", 1)}</robot>'
)
STEP = 1e-5


def reaction(q: tuple[float, float], v: tuple[float, float]) -> tuple[float, float]:
    """Return the second joint's reaction, as reported and by Newton's law.

    The accelerations are those from the speeds before and after the step.
    """
    client = bullet.connect(bullet.DIRECT)
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "two.urdf"
        file.write_text(URDF)
        body = bullet.loadURDF(
            str(file),
            useFixedBase=True,
            flags=bullet.URDF_USE_INERTIA_FROM_FILE,
        )
    bullet.setPhysicsEngineParameter(fixedTimeStep=STEP)
    bullet.setGravity(0, 0, 0)
    for joint in range(2):
        bullet.changeDynamics(
            body,
            joint,
            linearDamping=0,
            angularDamping=0,
            jointDamping=0,
        )
        bullet.resetJointState(body, joint, q[joint], v[joint])
        bullet.setJointMotorControl2(body, joint, bullet.VELOCITY_CONTROL, force=0)
        bullet.enableJointForceTorqueSensor(body, joint, True)
    bullet.stepSimulation()
    states = [bullet.getJointState(body, joint) for joint in range(2)]
    bullet.disconnect(client)
    a1, a2 = ((state[1] - speed) / STEP for state, speed in zip(states, v, strict=True))
    w, turning = v[0] + v[1], a1 + a2
    parts = []
    # of the mass centre of bar 2: at the end of bar 1, and half a bar further
    for part in (math.cos, math.sin):
        across = (lambda x: -math.sin(x)) if part is math.cos else math.cos
        parts.append(
            a1 * across(q[0])
            - v[0] ** 2 * part(q[0])
            + 0.5 * (turning * across(q[0] + q[1]) - w**2 * part(q[0] + q[1]))
        )
    return math.hypot(*states[1][2][:2]), math.hypot(*parts)


worst = {}
for v in ((2.0, -3.0), (2.0, 0.0), (0.0, -3.0)):
    reported, right = reaction((0.3, 0.7), v)
    worst[v] = abs(reported - right)
    print(
        f"speeds {v}: second joint {reported:.4f} N, mass times acceleration"
        f" {right:.4f} N"
    )
if not (worst[2.0, -3.0] > 1.0 and max(worst[2.0, 0.0], worst[0.0, -3.0]) < 1e-3):
    sys.exit("fixed")
