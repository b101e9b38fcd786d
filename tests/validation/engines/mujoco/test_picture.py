"""MuJoCo's own picture of the generated MJCF.

What it shows, and that a machine without OpenGL gets a reason.
"""

import base64
import io

import numpy as np
import pytest

import fourbar
from fourbar.mjcf import write_mjcf
from fourbar.mjcf.model import compute_frame
from fourbar_validation.engines.mujoco.picture import (
    MOST_SCENES_DRAWN,
    PIXELS_HIGH,
    PIXELS_WIDE,
    render_pictures,
)
from tests.support.scenes import crank_rocker, thesis

HUES = {2: (0.0, 0.5, 1.0), 3: (1.0, 0.6, 0.0), 4: (0.1, 0.9, 0.2)}
"""About the colours of the bars as they are lit."""
NEAR = 0.45
"""Distance in RGB that tells them from each other and from the background."""


@pytest.mark.slow
def test_the_bars_are_seen_where_the_formulas_put_them():
    scene = thesis(np.radians([100.0, 250.0]))
    drawn, why_not = render_pictures({"thesis": write_mjcf(scene)})
    if why_not:
        pytest.skip(why_not)
    from matplotlib.image import imread

    image = imread(io.BytesIO(base64.b64decode(drawn["thesis"])))[..., :3]
    assert image.shape == (PIXELS_HIGH, PIXELS_WIDE, 3)
    seen = compute_frame(scene.linkage)
    s = fourbar.solve(scene)
    O4 = scene.linkage.ground * np.exp(1j * scene.linkage.ground_angle)
    ends = {
        2: (np.zeros(2), s.A[0]),
        3: (s.A[0], s.B[0]),
        4: (np.array([O4.real, O4.imag]), s.B[0]),
    }
    for number, (start, end) in ends.items():
        middle = start + 0.4 * (end - start)  # at 0.5 lies the site of a load
        x = PIXELS_WIDE / 2 + (middle[0] - seen.x) / seen.half_height * PIXELS_HIGH / 2
        y = PIXELS_HIGH / 2 - (middle[1] - seen.y) / seen.half_height * PIXELS_HIGH / 2
        around = image[
            round(y) - 2 : round(y) + 3, round(x) - 2 : round(x) + 3
        ].reshape(-1, 3)
        assert np.linalg.norm(around - HUES[number], axis=1).min() < NEAR, number
    assert image[3, 3].min() > 0.85  # a light background


@pytest.mark.parametrize(
    "scene",
    [thesis(), crank_rocker()],
    ids=["thesis", "crank-rocker"],
)
def test_no_position_leaves_the_frame(scene):
    seen = compute_frame(scene.linkage)
    linkage = scene.linkage
    for branch in (1, -1):
        motion = fourbar.Motion(fourbar.Sweep(0.0, 6.3, 500), branch=branch)
        s = fourbar.solve(fourbar.Scene(linkage, motion))
        for points in (s.A, s.B):
            offset = np.abs(points[s.assembled] - (seen.x, seen.y)).max(axis=0)
            assert (
                offset[1] < seen.half_height
                and offset[0] < seen.half_height * PIXELS_WIDE / PIXELS_HIGH
            )


@pytest.mark.slow
def test_without_opengl_there_is_a_reason(monkeypatch):
    monkeypatch.setenv("MUJOCO_GL", "disabled")
    drawn, why_not = render_pictures({"thesis": write_mjcf(thesis())})
    assert drawn == {} and "off screen" in why_not


def test_many_scenes_are_left_out_with_a_reason():
    drawn, why_not = render_pictures(
        dict.fromkeys(map(str, range(MOST_SCENES_DRAWN + 1)), "")
    )
    assert drawn == {} and str(MOST_SCENES_DRAWN) in why_not
