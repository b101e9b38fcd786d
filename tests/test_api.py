"""What `fourbar` offers in Python: every public name documented, the list of them, and what a slip is answered."""

import json
import runpy
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import fourbar
from fourbar.cli import status
from fourbar.files import save
from tests.scenes import crank_rocker

DOCS = Path(__file__).parents[1] / "docs"


def test_the_page_of_the_api_is_the_one_that_the_docstrings_make() -> None:
    written = (DOCS / "api.md").read_text(encoding="utf-8")
    assert written == runpy.run_path(str(DOCS / "api.py"))["text"](), "python docs/api.py"
    assert all(f"\n## {name}\n" in written for name in dir(fourbar) if name != "__version__")


def test_dir_shows_what_there_is_and_nothing_else() -> None:
    assert {"classify", "limit_positions", "coupler_curve", "point_coefficients", "instant_centres"} <= set(
        dir(fourbar)
    )
    for name in dir(fourbar):
        thing = getattr(fourbar, name)
        assert name == "__version__" or (thing.__doc__ and thing.__module__.startswith("fourbar.")), name


@pytest.mark.parametrize("number", [0.25, np.float64(0.25)])
def test_a_number_where_a_bar_belongs_gets_a_sentence(number: float) -> None:
    with pytest.raises(fourbar.InputError, match=r"bars.coupler = .*0\.25.*must be a Bar, like fourbar\.Bar"):
        fourbar.FourBar(0.3, fourbar.Bar(0.1), number, fourbar.Bar(0.22))  # type: ignore[arg-type]


def test_an_argument_of_another_type_gets_one_line() -> None:
    scene = fourbar.Scene(fourbar.uniform(0.3, 0.1, 0.25, 0.22), fourbar.Motion(1.0, 10.0))
    solution = fourbar.solve(scene)
    calls: list[Callable[[Any], object]] = [
        *(fourbar.sensitivity, fourbar.tolerances, fourbar.extremes, fourbar.dump, fourbar.load, fourbar.units),
        *(fourbar.shaking_force, fourbar.motor_duty, lambda x: fourbar.bearing_load(x, "A")),
        *(lambda x: fourbar.vary(x, {}), lambda x: fourbar.vary(scene, x), lambda x: fourbar.vary(scene, {5: x})),
        *(lambda x: fourbar.vary(scene, {"nothing": x}), lambda x: fourbar.save(scene, x)),
        *(lambda x: fourbar.save(x, "a.toml"), lambda x: fourbar.extremes(scene, x)),
        *(lambda x: fourbar.bearing_load(solution, x), lambda x: fourbar.shaking_moment(x, solution)),
        *(lambda x: fourbar.in_units(x, "SI"), lambda x: fourbar.in_units(scene, x)),
        *(lambda x: scene.plot("torque", position=x), lambda x: scene.plot("torque", units=x), scene.plot),
    ]
    for call in calls:
        for wrong in (5j, [[1, 2], [3]], np.zeros((3, 3)), object()):
            with pytest.raises(fourbar.InputError) as caught:
                call(wrong)
            assert "\n" not in str(caught.value)


def test_the_public_formulas_agree_with_a_solution() -> None:
    """A point's velocity is its coefficient times omega_2; the coupler curve passes through the point at each angle."""
    scene = crank_rocker()
    solution, linkage = fourbar.solve(scene), scene.linkage
    z = linkage.coupler.to_centre
    found = fourbar.point_coefficients(linkage, solution.theta_2, solution.branch, 3, z)
    assert solution.omega_2 is not None and solution.a_G3 is not None and solution.alpha_2 is not None
    a = found.first * solution.alpha_2 + found.second * solution.omega_2**2
    assert np.allclose(np.column_stack([np.real(a), np.imag(a)]), solution.a_G3, rtol=1e-12, atol=1e-12)
    curve = fourbar.coupler_curve(linkage, z.real, z.imag)
    gap = np.hypot(curve.x[:, None] - solution.G3[:, 0], curve.y[:, None] - solution.G3[:, 1]).min(axis=0)
    assert gap.max() < 0.01 * linkage.coupler.length
    pin = fourbar.instant_centres(linkage, solution.theta_2, solution.branch)[2, 3].point
    assert np.allclose(np.column_stack(pin), solution.A, rtol=0.0, atol=1e-15)


def test_classify_as_json_is_what_the_formulas_say(capsys: pytest.CaptureFixture[str]) -> None:
    assert status(["classify", "0.3", "0.1", "0.25", "0.22", "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    linkage = fourbar.uniform(0.3, 0.1, 0.25, 0.22)
    assert document["name"] == "crank-rocker" and document["turning"] == [2]
    assert document["swing"]["output"] == fourbar.swing(linkage) and document["time_ratio"] == fourbar.time_ratio(
        linkage
    )
    limits = [tuple(limit.values()) for limit in document["limit_positions"]["output"]]
    assert limits == [tuple(limit) for limit in fourbar.limit_positions(linkage, 4)] and len(limits) == 4
    assert document["transmission"]["worst"] == fourbar.transmission_extremes(linkage).worst
    assert status(["classify", "3", "1", "1", "1", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["barker"] is None


def test_a_scene_draws_itself(tmp_path: Path) -> None:
    pytest.importorskip("matplotlib", reason="drawing needs matplotlib: pip install matplotlib")
    drawing = crank_rocker().plot("torque")  # type: ignore[attr-defined]
    assert drawing._repr_svg_().rstrip().endswith("</svg>")
    drawing.save(tmp_path / "a.png")
    assert (tmp_path / "a.png").read_bytes()[:4] == b"\x89PNG"
    with pytest.raises(fourbar.InputError, match="must be one of"):
        crank_rocker().plot("pie")  # type: ignore[attr-defined]


def test_loads_without_a_speed_are_pointed_to_the_static_torque(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    save(crank_rocker(motion=fourbar.Motion(1.0)), tmp_path / "still.toml")
    assert status(["analyze", str(tmp_path / "still.toml")]) == 0
    hint = 'omega_2 = "0 rad/s" gives the static torque and pin forces'
    assert hint in capsys.readouterr().out
    assert status(["plot", str(tmp_path / "still.toml"), "--figure", "torque", "-o", str(tmp_path / "a.svg")]) == 2
    assert hint in capsys.readouterr().err
    bare = fourbar.FourBar(0.3, fourbar.Bar(0.1), fourbar.Bar(0.25), fourbar.Bar(0.22))
    save(fourbar.Scene(bare, fourbar.Motion(1.0)), tmp_path / "bare.toml")
    assert status(["analyze", str(tmp_path / "bare.toml")]) == 0 and hint not in capsys.readouterr().out
