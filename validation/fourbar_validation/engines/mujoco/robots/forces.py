"""Forces in MuJoCo's arrays: of a body's bearer on it, and of an equality."""

from functools import cache

import mujoco
import numpy as np

from fourbar.quantities import Array
from fourbar_validation.engines.mujoco.closed_loop import find_site_load
from fourbar_validation.engines.mujoco.robots.ancestry import (
    climb,
    list_lifted_masses,
)


class BearerForces:
    """Forces on the bodies of a model from those that bear them.

    MuJoCo's `cfrc_int` counts in what an actuator on a site and gravity compensation
    exert on the body, and on all that it bears.
    """

    def __init__(self, model: mujoco.MjModel) -> None:
        self.model = model
        on_sites = model.actuator_trntype == mujoco.mjtTrn.mjTRN_SITE
        self.loads: list[int] = np.flatnonzero(on_sites).tolist()
        self.lifted = list_lifted_masses(model)
        self.find_borne = cache(self._find_borne)

    def read(self, data: mujoco.MjData, body: int) -> Array:
        """Return the force of a body's bearer on it, world axes, (3,), N.

        The state is one after `mj_rnePostConstraint`.
        """
        loads, lift = self.find_borne(body)
        force = data.cfrc_int[body, 3:] - lift
        for load in loads:
            force -= find_site_load(self.model, data, load)()
        return np.asarray(force)

    def _find_borne(self, body: int) -> tuple[list[int], Array]:
        """Return the actuators and the lift, (3,), N, on a body and what it bears."""
        model = self.model
        loads = []
        for load in self.loads:
            site = model.actuator_trnid[load, 0]
            if body in climb(model, model.site_bodyid[site]):
                loads.append(load)
        lifted = np.flatnonzero(self.lifted)
        borne = [number for number in lifted if body in climb(model, int(number))]
        return loads, np.asarray(-self.lifted[borne].sum() * model.opt.gravity)


def read_equality_force(data: mujoco.MjData, equality: int) -> Array:
    """Return the force of a connect or a weld on its first body, world axes, (3,), N.

    An equality that is switched off has no rows: its force is NaN.
    """
    kinds = data.efc_type[: data.nefc]
    of_equalities = kinds == mujoco.mjtConstraint.mjCNSTR_EQUALITY
    rows = np.flatnonzero(of_equalities & (data.efc_id[: data.nefc] == equality))
    if not len(rows):
        return np.full(3, np.nan)
    return np.asarray(data.efc_force[rows[:3]])
