"""Draw off-screen pictures of MJCF texts by MuJoCo's own renderer.

Pictures are drawn in a separate process, because a missing or broken OpenGL may end the
process that asks for it. `render_pictures` asks from outside: ``python -m
fourbar_validation.engines.mujoco.picture`` reads {name: MJCF} and answers {name: base64
of a PNG}.
"""

import base64
import io
import json
import os
import subprocess
import sys

PIXELS_WIDE = 480
PIXELS_HIGH = 360
PICTURE_SECONDS = 120.0
"""A picture takes half of one; a driver that takes this long for a handful hangs."""
MOST_SCENES_DRAWN = 8
"""Scenes that are drawn: more cost the reader of a long run minutes."""
_BACKENDS = ("egl", "osmesa") if sys.platform == "linux" else ("glfw",)
"""Values of MUJOCO_GL that are tried where the environment does not name one."""


def render_pictures(texts: dict[str, str]) -> tuple[dict[str, str], str]:
    """Render MJCF texts at their keyframes as base64 PNGs.

    Return also the reason if there are none.
    """
    if not texts:
        return {}, ""
    if len(texts) > MOST_SCENES_DRAWN:
        return {}, f"they are drawn for at most {MOST_SCENES_DRAWN} scenes"
    named = os.environ.get("MUJOCO_GL")
    for backend in (named,) if named else _BACKENDS:
        environment = {**os.environ, "MUJOCO_GL": backend}
        try:
            done = subprocess.run(
                [sys.executable, "-m", __name__],
                input=json.dumps(texts).encode(),
                capture_output=True,
                timeout=PICTURE_SECONDS,
                env=environment,
                check=True,
            )
            drawn: dict[str, str] = json.loads(done.stdout)
        except (subprocess.SubprocessError, OSError, ValueError):
            continue
        return drawn, ""
    return {}, "MuJoCo cannot render off screen here (it needs libegl1 or libosmesa6)"


def draw_here(texts: dict[str, str]) -> dict[str, str]:
    """Draw in this process."""
    import matplotlib.image
    import mujoco

    from fourbar_validation.engines.mujoco.closed_loop import open_model

    drawn = {}
    for name, text in texts.items():
        model, data = open_model(text)
        with mujoco.Renderer(model, PIXELS_HIGH, PIXELS_WIDE) as renderer:
            renderer.update_scene(data, camera="plane")
            png = io.BytesIO()
            matplotlib.image.imsave(png, renderer.render(), format="png")
        drawn[name] = base64.b64encode(png.getvalue()).decode("ascii")
    return drawn


if __name__ == "__main__":
    json.dump(draw_here(json.load(sys.stdin)), sys.stdout)
    sys.stdout.flush()
    # some drivers crash while Python takes them down, after the pictures are drawn
    os._exit(0)
