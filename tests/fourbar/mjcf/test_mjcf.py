"""The MJCF on its own.

Exact numbers, clear refusals, and a file that runs in plain MuJoCo.
"""

from dataclasses import replace
from math import dist, log10, pi, radians, sqrt, tau

import mujoco
import numpy as np
from pytest import approx, mark, raises

from fourbar import (
    Bar,
    FourBar,
    Free,
    InputError,
    Load,
    Motion,
    Scene,
    Sweep,
    Torsion,
    load,
    solve,
    uniform,
)
from fourbar.formulas.mobility import choose_range, turns_fully
from fourbar.mjcf import RECIPE, Settings, write_mjcf
from fourbar.mjcf.document import SETTLING, choose_run
from fourbar.mjcf.model import FINEST_STEPS
from fourbar_validation.scenes.random import (
    MACHINES,
    DrawnType,
    draw_decades,
    draw_lengths,
    draw_scene,
    draw_uniform,
)
from fourbar_validation.scenes.suites import list_model_files
from tests.support.rows import each_branch, read_rows, refused, slow_but
from tests.support.scenes import WEIGHT, crank_rocker

GAP = 1e-4
"""The promise of the file: the loop closed within this part of the longest bar."""
SHORT_OF_LIMIT = radians(2.0)
SEED = 20261121
ANY_SIZE = replace(
    MACHINES,
    centre=draw_uniform(0.0, 1.2),
    centre_angle=draw_uniform(-3.0, 3.0),
    speed=draw_decades(-1.0, 2.5),
)


def random_scene(rng, kind):
    """Lengths from 5 mm to 100 m, any speed, branch and direction.

    Bars are ten times lighter or heavier.
    """
    size = 10.0 ** rng.uniform(log10(0.05), 2.0)
    scene = draw_scene(rng, [size * x for x in draw_lengths(rng, kind)], ANY_SIZE)
    start, stop = choose_range(scene.linkage)
    short = (
        0.0
        if turns_fully(scene.linkage)
        else min(SHORT_OF_LIMIT, 0.25 * (stop - start))
    )
    motion = scene.motion.replace(
        angle=Sweep(start + short, stop - short, 90),
        acceleration=0.0,
    )
    return replace(scene, motion=motion, drive=None, drive_bar=2, loads=())


def gap(data):
    return dist(data.site("B3").xpos, data.site("B4").xpos)


OPEN = 1e-9
"""m; of the loop as the file opens: sixteen roundings of 100 m are 4e-13 m."""
LAG = 1e-3
"""Of the crank behind omega_2 t, beyond the settling of its drive, in timesteps."""


def opened(scene):
    """As MuJoCo's viewer does it: no keyframe, no control."""
    model = mujoco.MjModel.from_xml_string(write_mjcf(scene))
    data = mujoco.MjData(model)
    mujoco.mj_resetData(model, data)
    mujoco.mj_forward(model, data)
    return model, data


@each_branch
@mark.parametrize(
    "lengths, points",
    read_rows("""
0.3 0.1 0.3 0.1 | 0 1
0.3 0.1 0.1 0.3 | 0 1
0.1 0.1 0.3 0.3 | 0
0.4 0.1 0.27 0.23 | 1
"""),
)
def test_the_file_opens_in_the_assembly_beyond_change_points(lengths, points, branch):
    """Pin B lies left of the diagonal from A to O4 in the open assembly's first
    half, and changes its side at each change point that the input passes, and
    nowhere else.
    """
    linkage = replace(uniform(*map(float, lengths.split())), ground_angle=0.3)
    turns = pi * np.add.outer(np.array(points.split(), float), [-2, 0, 2]).ravel()
    for psi in (-2.5, -0.5, 0.5, 2.5, 3.8, 6.0, 6.8):
        passed = sum((at > 0.5) != (at > psi) for at in turns)
        _, data = opened(Scene(linkage, Motion(0.3 + psi, 5.0, branch=branch)))
        O4, A, B = (data.site(name).xpos[:2] for name in ("O4", "A", "B3"))
        left = np.cross([*(O4 - A), 0.0], [*(B - A), 0.0])[2]
        assert np.sign(left) == branch * (-1) ** passed, psi
        assert gap(data) < OPEN


def test_the_joints_count_the_turns_of_every_spring():
    """The springs at O4 and B rest three turns up and two down.

    The joint at A, which none holds, takes the rest.
    """
    rests = {"O4": 1.0 + 3 * tau, "B": 0.5 - 2 * tau}
    springs = Torsion.at(**{pin: (0.1, rest, 0.0) for pin, rest in rests.items()})
    _, data = opened(crank_rocker(Motion(1.0, 10.0), effects=(springs,)))
    at_O2, at_A, at_O4 = data.qpos
    assert gap(data) < OPEN
    assert abs(at_O4 - rests["O4"]) < pi
    assert abs(at_O4 - at_O2 - at_A - rests["B"]) < pi


@mark.slow
def test_opens_assembled_and_moves_without_keyframe_or_control():
    rng = np.random.default_rng(SEED)
    # the joints start where these put them, far from the angles' first turn
    springs = Torsion.at(O2=(0.1, 9.0, 0.0), A=(0.1, -12.0, 0.0))
    sprung = crank_rocker(Motion(1.0, 10.0), effects=(springs,))
    scenes = [sprung, *map(load, list_model_files())]
    for scene in [*scenes, *(random_scene(rng, kind) for kind in [*DrawnType] * 3)]:
        model, data = opened(scene)
        assert gap(data) < OPEN and (model.qpos0 == model.key_qpos[0]).all()
        omega = scene.motion.omega_2
        assert omega and not data.qvel.any() and not data.ctrl.any()
        # a second, or what is left of the range where it ends before; longer than the
        # drive settles
        travel, settling = scene.motion.theta_2, 20.0 * SETTLING * model.opt.timestep
        travelled = (
            0.9 * (travel.stop - travel.start) if isinstance(travel, Sweep) else 0.5
        )
        steps = int(
            min(max(1.0, settling), travelled / abs(omega)) / model.opt.timestep
        )
        worst = 0.0
        for _ in range(steps):
            mujoco.mj_step(model, data)
            worst = max(worst, gap(data))
        assert worst < GAP * max(scene.linkage.lengths), scene
        turned = data.qpos[0] - model.qpos0[0]
        assert turned == approx(
            omega * (data.time - SETTLING * model.opt.timestep),
            abs=LAG * abs(omega) * model.opt.timestep,
        )


RELEASE = 1e-4
"""rad, of a free motion of half a second at the file's own timestep; measured 1e-6."""


@mark.parametrize("scale", slow_but({0.01}, [1.0, 0.01]))
@mark.slow
def test_a_released_linkage_falls_by_itself(scale):
    bars = [
        Bar(scale * length, mass)
        for length, mass in ((0.1, 0.2), (0.25, 0.5), (0.22, 0.4))
    ]
    linkage = FourBar(scale * 0.3, *bars, ground_angle=0.2)
    motion = Motion(0.5, 0.0, free=Free(0.5 * sqrt(scale), 10))
    scene = Scene(linkage, motion, effects=WEIGHT)
    model, data = opened(scene)
    assert gap(data) < OPEN and model.nu == 0 and model.dof_armature[0] == 0.0
    expected = solve(scene)
    assert np.ptp(expected.theta_2) > 0.5
    for time, theta_2 in zip(expected.time[1:], expected.theta_2[1:], strict=True):
        mujoco.mj_step(model, data, round((time - data.time) / model.opt.timestep))
        assert data.qpos[0] + data.qvel[0] * (time - data.time) == approx(
            theta_2,
            abs=RELEASE,
        )


@mark.parametrize("mass, inertia", [(0.0, None), (1e-16, 1.0), (1.0, 1e-16)])
def test_massless_bar_is_refused_in_one_line(mass, inertia):
    linkage = FourBar(
        0.3,
        Bar(0.1, 1.0),
        Bar(0.25, mass, inertia),
        Bar(0.22, 1.0),
    )
    with raises(InputError, match=r"^bars\.coupler\..*massless[^\n]*$"):
        write_mjcf(crank_rocker(linkage=linkage))


def test_a_bar_so_short_that_the_compiler_would_open_the_loop_is_refused():
    short = FourBar(0.3, Bar(0.1, 1.0), Bar(9e-7, 1.0), Bar(0.22, 1.0))
    with raises(InputError, match=r"^lengths.coupler = 9e-07 m: [^\n]*$"):
        write_mjcf(crank_rocker(linkage=short))


def test_a_force_whose_flywheel_is_no_double_is_refused_in_one_line():
    scene = crank_rocker(loads=(Load(3, (1e308, 0.4)),))
    with raises(InputError, match=r"^flywheel = inf kg m\^2: [^\n]*$"):
        write_mjcf(scene)


def test_without_keyframe_no_position_is_written():
    text = write_mjcf(crank_rocker(), Settings(timestep=1e-3), keyframe=False)
    assert mujoco.MjModel.from_xml_string(text).nkey == 0
    with refused("timestep"):
        write_mjcf(crank_rocker(), keyframe=False)


def test_a_window_has_its_steps_wherever_it_lies():
    """A quarter radian at 3 rad/s takes 1/12 s.

    The steps in it do not depend on the angle at which it begins.
    """
    steps = {
        choose_run(np.array([start, start + 0.25]), 3.0, 0.0).timestep()
        for start in (0.1, 2.0, 4.0)
    }
    assert max(steps) == approx(min(steps), rel=1e-12)
    run = choose_run(np.array([2.0, 2.25]), 3.0, 0.0)
    count = run.time(run.stop) / run.timestep()
    assert count == approx(round(count)) and count >= RECIPE.steps_per_window


def test_a_narrow_window_has_no_finer_steps_than_the_finest():
    run = choose_run(np.array([2.0, 2.001]), 3.0, 0.0)
    assert run.timestep() == approx(tau / 3.0 / FINEST_STEPS, rel=0.03)
