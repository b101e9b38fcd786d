"""PyBullet's default solverResidualThreshold makes forces worse as the timestep falls:
1e-7 is a speed, not a force.

Engine: pybullet (pybullet)
Expected: a motor's torque converges as the timestep falls.
Found: In a parallelogram that turns at 1 rad/s under its weight, the torque with the
  default differs from that with solverResidualThreshold=0 over 100 times more at a step
  of 10 us than at 100 us. The guide says that the solver stops when the speeds of all
  constraints miss by less than the threshold; over 10 us this is an acceleration of
  0.01.
Since: 3.2.7 or before
Until: still in 3.2.7
Reported: not reported yet; the threshold became one of speed in bulletphysics/bullet3
  #1798
"""

import sys
import tempfile
from pathlib import Path

import pybullet as bullet

LINK = (
    '<link name="{}"><inertial><origin xyz=".5 0 0"/><mass value="1"/>'
    '<inertia ixx=".1" iyy=".1" izz=".1" ixy="0" ixz="0" iyz="0"/></inertial></link>'
)
JOINT = (
    '<joint name="to_{1}" type="continuous"><parent link="{0}"/><child'
    ' link="{1}"/><origin xyz="{2} 0 0"/><axis xyz="0 0 1"/></joint>'
)
PLACES = ("ground", "a", 0), ("a", "b", 1), ("ground", "c", 1)
URDF = "".join(LINK.format(name) for name in ("ground", "a", "b", "c")) + "".join(
    JOINT.format(*place) for place in PLACES
)


def torque(step: float, **settings: float) -> float:
    """Return the torque of the motor after a tenth of a second."""
    client = bullet.connect(bullet.DIRECT)
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "loop.urdf"
        file.write_text(f'<robot name="loop">{URDF}</robot>')
        body = bullet.loadURDF(
            str(file),
            useFixedBase=True,
            flags=bullet.URDF_USE_INERTIA_FROM_FILE,
        )
    bullet.setPhysicsEngineParameter(fixedTimeStep=step, **settings)
    bullet.setGravity(0, -9.81, 0)
    for joint, (angle, speed) in enumerate(((1.5, 1.0), (-1.5, -1.0), (1.5, 1.0))):
        bullet.changeDynamics(
            body,
            joint,
            linearDamping=0,
            angularDamping=0,
            jointDamping=0,
        )
        bullet.resetJointState(body, joint, angle, speed)
        bullet.setJointMotorControl2(body, joint, bullet.VELOCITY_CONTROL, force=0)
    bullet.setJointMotorControl2(
        body,
        0,
        bullet.VELOCITY_CONTROL,
        targetVelocity=1.0,
        force=1e9,
    )
    end = [0.5, 0, 0]  # from the mass centre
    bullet.changeConstraint(
        bullet.createConstraint(
            body, 1, body, 2, bullet.JOINT_POINT2POINT, [0, 0, 0], end, end
        ),
        maxForce=1e9,
    )
    for _ in range(round(0.1 / step)):
        bullet.stepSimulation()
    found = bullet.getJointState(body, 0)[3]
    bullet.disconnect(client)
    return float(found)


apart = {}
for step in (1e-4, 1e-5):
    default, none = torque(step), torque(step, solverResidualThreshold=0.0)
    apart[step] = abs(default - none)
    print(
        f"step {step:g} s: torque {default:.9f} N m by default, {none:.9f} with no"
        " threshold"
    )
if not (apart[1e-5] > 1e-5 and apart[1e-5] > 100.0 * apart[1e-4]):
    sys.exit("fixed")
