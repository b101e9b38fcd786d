"""An MJCF compiled and opened; bare steps of it, for counting their instructions, and all that it compiles to."""

from collections.abc import Callable

import mujoco
import numpy as np


def opened(text: str) -> tuple[mujoco.MjModel, mujoco.MjData]:
    """Compiled, at keyframe 0, evaluated there."""
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    mujoco.mj_forward(model, data)
    return model, data


def steps(text: str) -> Callable[[int], None]:
    """Make a function that steps the model on from its first keyframe, as often as wanted."""
    model, data = opened(text)

    def work(amount: int) -> None:
        mujoco.mj_step(model, data, amount)

    return work


def compiled(text: str) -> dict[str, object]:
    """Compile a model: sizes, rows of its constraints at the keyframe, flags, and the whole of it as bytes."""
    model, data = opened(text)
    whole = np.zeros(mujoco.mj_sizeModel(model), dtype=np.uint8)
    mujoco.mj_saveModel(model, None, whole)
    sizes = {name: int(getattr(model, name)) for name in ("nv", "neq", "nu", "ntendon", "nsensor", "njnt")}
    flags = {"disabled": int(model.opt.disableflags), "enabled": int(model.opt.enableflags)}
    return {**sizes, "nefc": int(data.nefc), **flags, "bytes": whole.tobytes()}
