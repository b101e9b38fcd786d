"""Pinocchio's lcaba leaves the closing force with the other sign and in local axes,
where constraintDynamics does not.

Engine: pin (pinocchio)
Expected: for the same RigidConstraintModel (CONTACT_3D, LOCAL_WORLD_ALIGNED)
  contact_force means the same after constraintDynamics and after lcaba, whose
  accelerations agree to 1e-6.
Found: After constraintDynamics, contact_force is the force on joint 1 in world axes;
  after lcaba it is the force on joint 2 in the axes of joint 1. lcaba's docstring names
  data.lambdaA[0], which the Python bindings do not have.
Since: 4.0.0 or before (3.9.0 has another interface)
Until: still in 4.1.0
Reported: not reported yet
"""

import sys

import numpy as np
import pinocchio as pin

model = pin.Model()
placed = {"a": (0, [0, 0]), "b": (1, [1, 0]), "c": (0, [1, 2])}
for name, (parent, at) in placed.items():
    joint = model.addJoint(
        parent, pin.JointModelRZ(), pin.SE3(np.eye(3), np.array([*at, 0.0])), name
    )
    model.appendBodyToJoint(
        joint,
        pin.Inertia(1.0, np.array([0.5, 0.0, 0.0]), 0.1 * np.eye(3)),
        pin.SE3.Identity(),
    )
ends = (
    2,
    pin.SE3(np.eye(3), np.array([2.0, 0, 0])),
    3,
    pin.SE3(np.eye(3), np.array([2.0, 0, 0])),
)
q, v = np.array([np.pi, -np.pi / 2, np.pi]), np.array([1.0, -1.0, 0.5])
found = {}
for name in ("constraintDynamics", "lcaba"):
    data, models, datas = (
        model.createData(),
        pin.StdVec_RigidConstraintModel(),
        pin.StdVec_RigidConstraintData(),
    )
    models.append(
        pin.RigidConstraintModel(
            pin.ContactType.CONTACT_3D,
            model,
            *ends,
            pin.ReferenceFrame.LOCAL_WORLD_ALIGNED,
        )
    )
    datas.append(models[0].createData())
    pin.initConstraintDynamics(model, data, models, datas)
    pin.computeJointMinimalOrdering(model, data, models)
    a = getattr(pin, name)(
        model,
        data,
        q,
        v,
        np.zeros(3),
        models,
        datas,
        pin.ProximalSettings(1e-14, 1e-8, 10),
    )
    found[name] = a.copy(), datas[0].contact_force.linear.copy()
    print(name, "acceleration", found[name][0], "force", found[name][1])
(a, one), (b, other) = found.values()
assert np.abs(a - b).max() < 1e-6
if np.abs(one - other).max() < 1e-6:
    sys.exit("fixed")
