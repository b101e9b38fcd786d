"""Bare steps of an MJCF, for counting their instructions."""

from collections.abc import Callable

import mujoco


def steps(text: str) -> Callable[[int], None]:
    """A function that steps the model on from its first keyframe, as often as asked."""
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)

    def work(amount: int) -> None:
        mujoco.mj_step(model, data, amount)

    return work
