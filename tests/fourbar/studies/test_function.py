"""A scene as a function of its numbers: in JAX and PyTorch as in NumPy, its derivatives, its edges, bad input."""

import importlib.util
from collections.abc import Iterator
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import fourbar
from fourbar import FromLimit, InputError, Motion, Point, Scene, uniform
from fourbar.effects import (
    Friction,
    Gravity,
    LinearDrive,
    Load,
    PinFriction,
    Spring,
    SpringEnd,
    Springs,
    Table,
    Viscous,
)
from fourbar.formulas.arithmetic import namespace
from fourbar.quantities import LINE_QUANTITIES, STAGE_OF
from fourbar.scene.motion import Free
from fourbar.studies.function import NEVER, function
from fourbar.studies.keys import command_key
from fourbar_lab.families import FAMILIES
from fourbar_lab.slopes import list_numbers

EPS = 2.0**-52
ROUNDED = 200.0 * EPS
"""Of the greatest value: other libraries round sines otherwise and contract products and sums, on well-posed scenes."""
HALF_ANGLE = 8.0 * EPS
"""Over sin(mu) squared: near a limit position a rounding of the half angle, of which a library's sine and cosine and
NumPy's tangent each have their own, moves sin(mu) by eps/sin(mu); a slope there goes with its powers. At a change
point sin(mu) keeps its digits, for a sum of the lengths is exactly 0."""
DIFFERENCES = 1e-7
"""What central differences of a step of 1e-6 leave of a derivative."""
STEP = 1e-6
LIBRARIES = ("jax", pytest.param("torch", marks=pytest.mark.nightly))  # of gigabytes
pytestmark = pytest.mark.filterwarnings(
    "ignore:There is a performance drop"
)  # PyTorch maps no product's derivative


class Library(SimpleNamespace):
    """One array library: its name, arrays of doubles, compiled, mapped and differentiated functions."""


def _jax() -> Library:
    import jax

    return Library(array=jax.numpy.asarray, jit=jax.jit, vmap=jax.vmap, grad=jax.grad, jacfwd=jax.jacfwd,
                   jacrev=jax.jacrev, xp=jax.numpy)  # fmt: skip


def _torch() -> Library:
    import torch
    from torch import func

    return Library(array=lambda x: torch.asarray(np.asarray(x, dtype=float)), jit=lambda f: f, vmap=func.vmap, xp=torch,
                   grad=func.grad, jacfwd=func.jacfwd, jacrev=func.jacrev)  # fmt: skip


@pytest.fixture(params=LIBRARIES)
def library(request: pytest.FixtureRequest) -> Iterator[Library]:
    name = request.param
    if name == "numpy":
        yield Library(array=np.asarray, jit=lambda f: f, xp=np)
        return
    for needed in (name, "array_api_compat"):
        if importlib.util.find_spec(needed) is None:
            pytest.skip(f"{needed} is not installed")
    if name == "jax":
        import jax

        with jax.enable_x64(True):
            yield _jax()
    else:
        yield _torch()


TURNING = Table((0.0, 2.0, 2.0 * np.pi), (1.0, -0.5, 1.0))
LOADED = Scene(
    uniform(0.3, 0.1, 0.25, 0.22, per_metre=2.0),
    Motion(0.5, 8.0, 3.0),
    loads=(
        Load(4, force=(5.0, 0.3), at=(0.02, 1.0), frame="bar"),
        Load(3, moment=-0.2, table=TURNING),
    ),
    effects=(
        Gravity(),
        Viscous.at(A=0.01),
        Friction.at(B=0.02),
        Springs(
            (Spring(SpringEnd(1, 0.1, 1.0), SpringEnd(3, 0.1, -1.0), 50.0, 0.05, 1.0),)
        ),
    ),
    points=(Point("P", 3, (0.1, 0.4)),),
)
EVERY = [
    *(name for name in STAGE_OF if name not in {*NEVER, *LINE_QUANTITIES}),
    "P",
    "v_P",
    "a_P",
]
ANGLES = np.linspace(0.0, 6.0, 13)


def of_solution(solution: Any, name: str) -> Any:
    """A quantity, those of the scene's own points too."""
    places = {
        "P": solution.points,
        "v_P": solution.velocity,
        "a_P": solution.acceleration,
    }
    return places[name]["P"] if name in places else getattr(solution, name)


def wrapped(x: Any) -> Any:
    return (x + np.pi) % (2.0 * np.pi) - np.pi


def on_line(start_bar: int, end_bar: int) -> Scene:
    line = LinearDrive(SpringEnd(start_bar, 0.1, 1.0), SpringEnd(end_bar, 0.1, -1.0))
    return replace(LOADED, drive_bar=None, drive=line)


def on_stroke(bar: int, side: str, length: float) -> Scene:
    line = LinearDrive(SpringEnd(1, 0.3, 2.2), SpringEnd(bar, -0.12, 0.4))
    motion = Motion(stroke=length, stroke_speed=0.1, side=side)
    return replace(LOADED, drive_bar=None, drive=line, loads=(), motion=motion)


STROKES = {
    "stroke of bar 2": on_stroke(2, "left", 0.35),
    "stroke of bar 4": on_stroke(4, "right", 0.5),
}
SCENES = {
    **{
        f"bar {bar}": replace(LOADED, drive_bar=bar, motion=Motion(ANGLES, 8.0, 3.0))
        for bar in (2, 3, 4)
    },
    **{
        f"line from {start} to {end}": on_line(start, end)
        for start, end in ((1, 3), (1, 4), (2, 4))
    },
    "theta_3": replace(
        LOADED, motion=Motion(theta_3=0.6, omega_3=2.0), loads=(), drive_bar=4
    ),
    "theta_4": replace(
        LOADED,
        motion=Motion(theta_4=2.2, omega_4=-1.0, alpha_4=2.0),
        loads=(),
        drive_bar=3,
    ),
    **STROKES,
}


@pytest.mark.parametrize(
    "library",
    ["numpy", pytest.param("jax", marks=pytest.mark.slow), LIBRARIES[1]],
    indirect=True,
)
@pytest.mark.parametrize("name", SCENES)
def test_every_quantity_is_that_of_solve(library: Library, name: str) -> None:
    scene = SCENES[name]
    quantities = [
        quantity for quantity in EVERY if scene.drive is None or quantity != "torque"
    ]
    quantities += [] if scene.drive is None else LINE_QUANTITIES[:4]
    f = function(
        scene, ["lengths.coupler", "effects.gravity.0", command_key(scene)], quantities
    )
    values, solution = (
        library.jit(f)(*map(library.array, (0.25, 9.81, scene.motion.angle))),
        fourbar.solve(scene),
    )
    assert set(values) == set(quantities)
    for quantity in quantities:
        theirs = of_solution(solution, quantity)
        gap = np.reshape(values[quantity], theirs.shape) - theirs
        gap = wrapped(gap) if quantity.startswith("theta") else gap
        assert np.abs(gap).max() <= ROUNDED * max(1.0, np.abs(theirs).max()), quantity


@pytest.mark.slow
@pytest.mark.parametrize("name", STROKES)
def test_a_stroke_that_the_cylinder_cannot_have_leaves_the_others_their_derivatives(
    library: Library, name: str
) -> None:
    scene, keys, quantities = (
        STROKES[name],
        ["motion.stroke", "drive.to.at.0"],
        ["drive_force", "alpha_3", "condition"],
    )
    slopes, strokes = (
        fourbar.sensitivity(scene),
        np.array([0.01, scene.motion.angle, 3.0]),
    )
    f, jacobian = function(scene, keys, quantities), jacobian_of(library)
    at_strokes = library.jit(f)(library.array(strokes), library.array(-0.12))

    def summed(x: Any) -> Any:
        values = f(x[0] + library.array(strokes), x[1] + library.array(-0.12))
        return {
            quantity: library.xp.nansum(value) for quantity, value in values.items()
        }

    by = library.jit(jacobian(summed))(library.array([0.0, 0.0]))
    for quantity in quantities:
        assert np.isnan(np.asarray(at_strokes[quantity])).tolist() == [
            True,
            False,
            True,
        ]
        exact = [slopes.of(quantity, key)[0] for key in keys]
        assert np.asarray(by[quantity]) == pytest.approx(exact, rel=ROUNDED)


def jacobian_of(library: Library) -> Any:
    """Forwards in JAX and backwards in PyTorch, which are no derivation of ours."""
    return library.jacrev if library.xp.__name__ == "torch" else library.jacfwd


@pytest.mark.slow
@pytest.mark.parametrize("family", [name for name in FAMILIES if name != "tables"])
def test_derivatives_are_those_of_sensitivity(library: Library, family: str) -> None:
    scene = FAMILIES[family](np.random.default_rng([3, list(FAMILIES).index(family)]))
    wanted = fourbar.sensitivity(scene)
    numbers = list_numbers(scene)
    quantities = ["torque", "F12", "F43", "theta_4", "alpha_3"]
    if scene.drive is not None:
        quantities[:1] = ["drive_force", "stroke_speed", "drive_condition"]
    f = function(scene, list(numbers), quantities)
    values = library.array(list(numbers.values()))
    slopes = jacobian_of(library)(lambda x: f(*x))(values)
    for name in quantities:
        ours = np.asarray(slopes[name])
        assert np.isfinite(ours).all()
        exact = np.stack(
            [wanted.by[name][list(wanted.keys).index(key), 0] for key in numbers],
            axis=-1,
        )
        weights = np.abs(list(numbers.values()))
        size = (
            np.abs(exact * weights).max() + np.abs(getattr(wanted.solution, name)).max()
        )
        blur = (
            HALF_ANGLE / float(wanted.solution.condition[0]) ** 2
            if family == "limit"
            else 0.0
        )
        assert np.abs((ours - exact) * weights).max() <= (ROUNDED + blur) * size, name


@pytest.mark.slow
@pytest.mark.parametrize(
    "motion",
    [Motion(np.pi, 8.0), Motion(np.pi - 1e-6, 8.0), Motion(theta_4=np.pi, omega_4=2.0)],
)
def test_derivatives_keep_their_digits_beside_half_a_turn(
    library: Library, motion: Motion
) -> None:
    """There the tangent of half the angle is large: at 1e-6 rad nine digits of the slopes once were left."""
    lengths = (0.22, 0.25, 0.1) if motion.bar == 4 else (0.1, 0.25, 0.22)
    scene = replace(
        LOADED,
        linkage=uniform(0.3, *lengths),
        motion=motion,
        loads=(),
        effects=(Gravity(),),
    )
    key, wanted = command_key(scene), fourbar.sensitivity(scene)
    f = function(scene, [key], ["torque", "A", "alpha_3"])
    for transform in {library.jacrev, jacobian_of(library)}:
        slopes = transform(f)(library.array(motion.angle))
        for name, slope in slopes.items():
            exact = wanted.of(name, key)[0]
            assert (
                np.abs(np.asarray(slope) - exact).max() <= ROUNDED * np.abs(exact).max()
            ), name


@pytest.mark.slow
def test_peak_pin_force_of_a_thousand_positions(library: Library) -> None:
    angles = np.linspace(0.0, 6.28, 1000)
    f = function(LOADED, ["lengths.input", "motion.theta_2"], ["F32"])

    def peak(a: Any) -> Any:
        return library.xp.max(
            library.xp.sum(f(a, library.array(angles))["F32"] ** 2, axis=-1)
        )

    slope = float(library.jit(library.grad(peak))(library.array(0.1)))
    ahead, back = (
        (f(0.1 + step, angles)["F32"] ** 2).sum(axis=-1).max() for step in (STEP, -STEP)
    )  # of NumPy, and no derivative at all
    assert slope == pytest.approx((ahead - back) / (2.0 * STEP), rel=DIFFERENCES)


@pytest.mark.slow
@pytest.mark.timeout(300)  # JAX compiles each operation for each of two shapes
def test_positions_that_do_not_close_leave_the_others_their_derivatives(
    library: Library,
) -> None:
    """A sweep through both limits of a rocker, and lengths that close nowhere."""
    scene = replace(LOADED, linkage=uniform(0.2, 0.3, 0.25, 0.15, per_metre=2.0))
    angles = np.linspace(-3.0, 3.0, 61)
    f = function(
        scene,
        ["lengths.input", "lengths.coupler", "motion.theta_2"],
        ["torque", "a_P", "F14"],
    )
    closes = np.isfinite(np.asarray(f(0.3, 0.25, angles)["torque"]))
    assert 10 < closes.sum() < 50
    assert (
        closes
        == (
            fourbar.solve(fourbar.vary(scene, {"motion.theta_2": angles})).status_code[
                0
            ]
            == 0
        )
    ).all()

    def total(lengths: Any, theta_2: Any) -> Any:
        values = f(lengths[0], lengths[1], library.array(theta_2))
        return sum(library.xp.nansum(value**2) for value in values.values())

    lengths = library.array([0.3, 0.25])
    of_all, of_closed = (
        np.asarray(library.grad(total)(lengths, theta_2))
        for theta_2 in (angles, angles[closes])
    )
    assert np.isfinite(of_all).all() and of_all == pytest.approx(of_closed, rel=1e-12)
    assert (
        np.asarray(library.grad(total)(library.array([3.0, 0.25]), angles)) == 0.0
    ).all()
    assert (
        np.asarray(library.grad(total)(library.array([-1.0, np.nan]), angles)) == 0.0
    ).all()


@pytest.mark.slow
def test_mapped_over_linkages_as_vary(library: Library) -> None:
    lengths = np.linspace(0.05, 0.9, 10_000)
    solution = fourbar.solve(fourbar.vary(LOADED, {"lengths.input": lengths}))
    f = function(LOADED, ["lengths.input"], ["torque", "F43"])
    mapped = library.vmap(f)(library.array(lengths))
    closes = solution.status_code[:, 0] == 0
    assert 0 < closes.sum() < len(lengths)
    for name, value in mapped.items():
        ours, theirs = np.asarray(value), getattr(solution, name)[:, 0]
        assert (np.isfinite(ours).reshape(len(ours), -1).all(axis=1) == closes).all()
        # beside a limit each library's rounding of a sine is amplified: 1/sin^2 of the transmission angle
        gap = np.abs(ours - theirs)[closes] / np.nanmax(np.abs(theirs))
        sine = np.abs(solution.sin_mu[closes, 0])
        assert (gap.reshape(len(sine), -1).max(axis=1) * sine**2 <= ROUNDED).all()


@pytest.mark.slow
def test_derivatives_are_mapped_over_linkages_and_positions(library: Library) -> None:
    """In a table's piece too, which a transformed index looks up."""
    f = function(LOADED, ["lengths.input", "motion.theta_2"], ["torque"])
    pairs = np.array([[0.1, 0.5], [0.11, 4.0]])
    mapped = library.jit(library.vmap(library.grad(lambda x: f(x[0], x[1])["torque"])))(
        library.array(pairs)
    )
    one = library.jit(library.vmap(library.grad(lambda a: f(a, 4.0)["torque"])))(
        library.array([0.1, 0.11])
    )
    for row, (a, theta) in zip(np.asarray(mapped), pairs, strict=True):
        linkage = replace(LOADED.linkage, input=replace(LOADED.linkage.input, length=a))
        slopes = fourbar.sensitivity(
            replace(LOADED, linkage=linkage, motion=Motion(theta, 8.0, 3.0))
        )
        exact = [
            slopes.of("torque", key)[0] for key in ("lengths.input", "motion.theta_2")
        ]
        assert row == pytest.approx(exact, rel=ROUNDED)
    assert float(one[1]) == pytest.approx(float(mapped[1, 0]), rel=ROUNDED)


@pytest.mark.nightly
def test_numbers_of_the_scene_go_to_the_device_of_the_values() -> None:
    """One that computes nothing, and like a GPU takes no array of another."""
    torch = pytest.importorskip("torch")
    pytest.importorskip("array_api_compat")
    f = function(replace(LOADED, motion=Motion(ANGLES, 8.0)), ["lengths.input"], EVERY)
    assert {
        value.device.type for value in f(torch.tensor(0.1, device="meta")).values()
    } == {"meta"}


NO_VALUE = {
    "no_torque": replace(
        LOADED, linkage=uniform(0.3, 0.1, 0.3, 0.1), drive_bar=3, loads=()
    ),
    "overflow": replace(LOADED, motion=Motion(0.5, 1e153)),
}


@pytest.mark.slow
@pytest.mark.parametrize("status", NO_VALUE)
def test_where_solve_has_no_value_there_is_none(library: Library, status: str) -> None:
    """Of the second the power alone is beyond the range of doubles; of the first F32 is (inf, -inf): no warning."""
    scene = NO_VALUE[status]
    assert fourbar.solve(scene).status == [status]
    for make in (float, np.array, library.array):
        values = function(scene, ["motion.theta_2"], ["power", "theta_4", "F32"])(
            make(2.0)
        )
        assert np.isnan(float(values["power"])) and np.isfinite(
            float(values["theta_4"])
        )


@pytest.mark.slow
def test_a_lever_that_only_rounding_leaves_holds_nothing(library: Library) -> None:
    """A kite whose input lies on the ground's line at any theta_4: its couple has no lever, in any arithmetic."""
    motion = Motion(theta_4=np.linspace(0.2, 2.9, 12), omega_4=2.0)
    scene = replace(
        LOADED,
        linkage=uniform(0.24491877, 0.24491877, 0.10712378, 0.10712378),
        motion=motion,
    )
    assert set(fourbar.solve(scene).status) == {"no_torque"}
    f = library.jit(function(scene, ["lengths.input"], ["F43", "torque", "theta_3"]))
    values = f(library.array(0.24491877))
    assert (
        np.isnan(np.asarray(values["torque"])).all()
        and np.isnan(np.asarray(values["F43"])).all()
    )
    assert np.isfinite(np.asarray(values["theta_3"])).all()


@pytest.mark.slow
def test_single_precision_stays_single(library: Library) -> None:
    f = function(LOADED, ["lengths.input", "motion.theta_2"], ["torque"])
    kind = library.xp.float32
    single = f(
        library.xp.asarray(0.1, dtype=kind), library.xp.asarray(ANGLES, dtype=kind)
    )["torque"]
    assert single.dtype == kind
    exact = f(0.1, ANGLES)["torque"]
    assert (
        np.abs(np.asarray(single) - exact).max() <= 1e-5 * np.abs(exact).max()
    )  # some 80 of its roundings


def test_scenes_state_the_positions_and_shapes_are_broadcast() -> None:
    one, many = (
        function(LOADED, ["bars.input.mass"]),
        function(replace(LOADED, motion=Motion(ANGLES, 8.0)), ["lengths.ground"]),
    )
    assert one(1.0)["torque"].shape == () and one(np.ones(3))["torque"].shape == (3,)
    assert many(0.3)["torque"].shape == (13,)
    assert one(np.float32([1.0]))["torque"].tolist() == [
        one(1.0)["torque"]
    ]  # NumPy's are all made doubles
    assert (
        many(0.3)["torque"]
        == fourbar.solve(replace(LOADED, motion=Motion(ANGLES, 8.0))).torque
    ).all()


REFUSED = {
    "effects.pin_friction": replace(
        LOADED, effects=(PinFriction((("A", 0.1, 0.01),)),)
    ),
    "motion.free": replace(LOADED, motion=Motion(0.5, 0.0, free=Free(1.0, 10))),
    "motion.theta_2": replace(LOADED, motion=Motion(FromLimit(1, 0.1), 1.0)),
    "motion.through": replace(
        LOADED,
        linkage=uniform(0.3, 0.1, 0.3, 0.1),
        motion=Motion(1.0, 1.0, through="follow"),
    ),
    "loads.0.table": replace(
        LOADED, loads=(Load(3, moment=1.0, table=Table((0.0, 1.0), (1.0, 2.0))),)
    ),
    "motion.omega_2": replace(LOADED, motion=Motion(0.5)),
}


@pytest.mark.parametrize("key", REFUSED)
def test_what_cannot_be_traced_is_refused_when_the_function_is_made(key: str) -> None:
    with pytest.raises(InputError) as error:
        function(REFUSED[key], ["bars.input.mass"])
    assert error.value.key == key and "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("keys", "quantities", "key"),
    [(["lengths.inptu"], ["torque"], "lengths.inptu"), (["lengths.input"], ["torqe"], "quantities"),
     (["motion.branch"], ["torque"], "motion.branch"), ([], ["torque"], "keys"), ("lengths.input", ["torque"], "keys"),
     (["lengths.input"] * 2, ["torque"], "keys"), (["lengths.input"], ["torque_error"], "quantities")],
)  # fmt: skip
def test_unknown_keys_and_quantities(keys: Any, quantities: Any, key: str) -> None:
    with pytest.raises(InputError) as error:
        function(LOADED, keys, quantities)
    assert error.value.key == key and "\n" not in str(error.value)


class Poor:
    """An array of a library that has no complex numbers."""

    shape, dtype = (), "float64"

    def __array_namespace__(self, api_version: Any = None) -> Any:
        return SimpleNamespace(__name__="poor", float64="float64")


@pytest.mark.parametrize(
    "values",
    [(1, np.array([1, 2])), (0.1, np.ones((2, 2))), (np.ones(2), np.ones(3)), (0.1,), ("0.1", 0.2), (True, 0.2),
     (0.1, 1j), (0.1, np.array([1j])), (0.1, Poor())],
)  # fmt: skip
def test_values_of_the_wrong_kind(values: Any) -> None:
    if isinstance(values[-1], Poor):
        pytest.importorskip("array_api_compat")
    with pytest.raises(InputError) as error:
        function(LOADED, ["lengths.input", "motion.theta_2"])(*values)
    assert "\n" not in str(error.value)


def test_mixed_libraries(library: Library) -> None:
    f = function(LOADED, ["lengths.input", "motion.theta_2"])
    with pytest.raises(InputError, match="one library"):
        f(library.array(0.1), ANGLES)
    with pytest.raises(InputError, match="floating-point"):
        f(0.1, library.xp.asarray([1, 2]))


def test_numbers_of_numpy_need_no_other_library() -> None:
    assert namespace(1.0, 2, 1j, np.float64(1.0), np.ones(2)) is np
