"""An MJCF compiled and opened, and bare steps of it."""

from collections.abc import Callable

import mujoco


def open_model(text: str) -> tuple[mujoco.MjModel, mujoco.MjData]:
    """Compiled, at keyframe 0, evaluated there."""
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    mujoco.mj_forward(model, data)
    return model, data


def make_stepper(text: str) -> Callable[[int], None]:
    """Make a function that steps the model on from its first keyframe, as often as wanted."""
    model, data = open_model(text)

    def work(amount: int) -> None:
        mujoco.mj_step(model, data, amount)

    return work
