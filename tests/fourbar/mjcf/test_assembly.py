"""Files of `fourbar mjcf --for`, `sdf` and `usd`: what they hold, and refuse.

The adapters of the lab read them in each simulator as their comments say.
"""

import re
from functools import partial
from xml.etree import ElementTree

from pytest import approx, mark, raises

from fourbar import Free, Gravity, Load, Motion, Torsion, Viscous, solve
from fourbar.errors import LimitError
from fourbar.mjcf import write_mjcf_for
from fourbar.mjcf.assembly import write_sdf, write_usd
from tests.support.scenes import cis, crank_rocker


def test_a_file_for_genesis_says_what_it_leaves_out():
    said = write_mjcf_for(crank_rocker(), "genesis")
    for name in ("loads", "springs", "at pin B", "rest angles of torsion"):
        assert name in said


def released(**changes):
    """A linkage let go under its weight, with a damper."""
    motion = Motion(1.0, 3.0, free=Free(0.2, 2))
    effects = (Gravity(), Viscous.at(O2=0.05))
    return crank_rocker(
        **({"motion": motion, "effects": effects, "loads": ()} | changes)
    )


def test_the_pin_at_B_alone_closes_the_loop_from_outside():
    sdf, usd = write_sdf(released()), write_usd(released(effects=()))
    assert re.findall(r'joint name="(\w+)"', sdf) == [
        "ground_on_world",
        "O2",
        "A",
        "O4",
        "B",
    ]
    assert re.findall(r'Joint "(\w+)"', usd) == ["O2", "A", "O4", "B"]
    assert re.findall(r"Articulation = (\w+)", usd) == [
        "false",
        "false",
        "false",
        "true",
    ]


@mark.parametrize("reader", ["gazebo", "drake"])
def test_an_sdf_stands_closed_at_B_and_its_joints_are_damped(reader):
    root = ElementTree.fromstring(write_sdf(released(), reader))
    places = {}
    for link in root.iter("link"):
        x, y, *_, turn = map(float, link.findtext("pose").split())
        places[link.get("name")] = complex(x, y), cis(turn)

    def stand(bar, along):
        foot, direction = places[bar]
        return foot + float(along.split()[0]) * direction

    output = f"{released().linkage.output.length} 0 0"
    ball = root.find(".//{*}ball_constraint")
    joint = root.find(".//joint[@name='B']")
    if reader == "gazebo":
        assert [joint.findtext(end) for end in ("parent", "child")] == [
            "output",
            "coupler",
        ]
        of_coupler = joint.findtext("pose")
    else:
        bodies = [ball.findtext(f"{{*}}ball_constraint_body_{end}") for end in "AB"]
        assert bodies == ["coupler", "output"] and joint is None
        of_coupler, output = (
            ball.findtext(f"{{*}}ball_constraint_{name}") for name in ("p_AP", "p_BQ")
        )
    assert stand("coupler", of_coupler) == approx(stand("output", output), abs=1e-12)
    assert [one.text for one in root.iter("damping")] == ["0.05"]


LOADED = crank_rocker(loads=(Load(4, moment=1.0),))
AT_B = (Viscous.at(B=1.0),)


@mark.parametrize(
    "write, scene, words",
    [
        (
            write_sdf,
            LOADED,
            r"^loads \(here on bar 4\) have no counterpart in SDF for gazebo",
        ),
        (
            partial(write_sdf, reader="drake"),
            released(effects=(Torsion.at(O2=(1.0, 0.0, 0.0)),)),
            "torsion",
        ),
        (partial(write_sdf, reader="drake"), released(effects=AT_B), "pin B"),
        (write_usd, LOADED, "no counterpart in USD"),
        (write_usd, released(effects=AT_B), "no counterpart in USD"),
    ],
)
def test_what_a_file_cannot_hold_is_refused(write, scene, words):
    with raises(LimitError, match=words):
        write(scene)


@mark.parametrize("write", [write_sdf, partial(write_sdf, reader="drake"), write_usd])
def test_without_loads_a_file_says_so_and_how_to_start(write):
    scene = crank_rocker(Motion(1.0, 3.0))
    text = write(scene, without_loads=True)
    assert "loads are left out" in text and "puts on bar 2" in text
    s = solve(scene, "velocity")
    rates = 3.0, s.omega_3[0] - 3.0, s.omega_4[0]
    stated = [float(number) for number in re.findall(r"(-?[\d.]+) rad", text)[:6]]
    assert stated == approx([1.0, s.theta_3[0], s.theta_4[0], *rates])
