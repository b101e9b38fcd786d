"""An SDF is the mechanism that it states, in whichever way it states it."""

import math
import re
from functools import partial

import mujoco
import numpy as np
import pytest
from pytest import approx, raises
from scipy.spatial.transform import Rotation

import fourbar
from fourbar_validation.compare.tolerance import magnitude
from fourbar_validation.engines.mujoco.describe import UNLIMITED_RANGE
from fourbar_validation.engines.mujoco.robots.loop_facts import SETTINGS_OF_AN_SDF
from fourbar_validation.engines.mujoco.robots.pose import (
    compile_robot,
)
from fourbar_validation.robots.files import read_robot
from tests.support.robots import (
    examine_text,
    judge_path,
    measure,
    read_scene,
    report_of,
)
from tests.support.rows import read_rows
from tests.support.scenes import meet_circles
from tests.support.texts import put
from tests.validation.robots.test_files import TETRAHEDRON

AGREES = 1e-9
"""Parts of the largest: sines of angles that are written with 17 digits, and a linear
system of 13 equations.
"""
D, A, B, C = 0.3, 0.1, 0.25, 0.22
DENSITY = 2700.0
WIDTH, DEPTH = 0.02, 0.01


START = math.radians(50.0)
PIN_A = A * complex(math.cos(START), math.sin(START))
PIN_B = meet_circles(PIN_A, D, B, C)
ROD = math.atan2((PIN_B - PIN_A).imag, (PIN_B - PIN_A).real)
ROCKER = math.atan2(PIN_B.imag, PIN_B.real - D)


def make_bar(length):
    """Return a bar that is a box of WIDTH in the plane."""
    mass = DENSITY * length * WIDTH * DEPTH
    return fourbar.Bar(length, mass, inertia=mass * (length**2 + WIDTH**2) / 12.0)


SCENE = fourbar.Scene(
    fourbar.FourBar(D, make_bar(A), make_bar(B), make_bar(C)),
    fourbar.Motion(np.radians(np.arange(0.0, 360.0, 30.0)), 10.0),
    effects=(fourbar.effects.Gravity(9.81, -0.5 * math.pi),),
)


def write_inertial(length):
    bar = make_bar(length)
    around = f"<ixx>1</ixx><iyy>1</iyy><izz>{bar.inertia}</izz>"
    return (
        f"<inertial><pose>{length / 2} 0 0 0 0 0</pose><mass>{bar.mass}</mass>"
        f"<inertia>{around}</inertia></inertial>"
    )


def write_link(name, length, pose):
    return f'<link name="{name}">{pose}{write_inertial(length)}</link>'


AXIS = "<axis><xyz>0 0 1</xyz></axis>"
CRANK = write_link("crank", A, f"<pose>0 0 0 0 0 {START}</pose>")
COUPLER = write_link("rod", B, f"<pose>{PIN_A.real} {PIN_A.imag} 0 0 0 {ROD}</pose>")
OUTPUT = write_link("rocker", C, f"<pose>{D} 0 0 0 0 {ROCKER}</pose>")
PIN_OF_CRANK = (
    '<joint name="A" type="revolute"><parent>crank</parent><child>rod</child>'
    f"{AXIS}</joint>"
)
CLOSING = (
    '<joint name="B" type="revolute"><parent>rocker</parent><child>rod</child>'
    f"<pose>{B} 0 0 0 0 0</pose>{AXIS}</joint>"
)
UNIVERSAL = '"A" type="universal"'


MODEL = f"""<model name="linkage">
{CRANK}{COUPLER}{OUTPUT}
<joint name="O2" type="revolute"><parent>world</parent><child>crank</child>{AXIS}
</joint>
<joint name="O4" type="continuous"><parent>world</parent><child>rocker</child>{AXIS}
</joint>{PIN_OF_CRANK}{CLOSING}</model>"""
PLAIN = f"""<sdf version="1.9"><world name="w"><gravity>0 -9.81 0</gravity>{MODEL}
</world></sdf>"""


def write_box(length):
    return (
        f'<inertial auto="true"/><collision name="c"><density>{DENSITY}</density>'
        f"<pose>{length / 2} 0 0 0 0 0</pose><geometry><box><size>{length} {WIDTH} "
        f"{DEPTH}</size></box></geometry></collision><collision name='p'><geometry>"
        "<plane/></geometry></collision>"
    )


changed = partial(put, PLAIN)
"""The plain file with other words."""
OF_INNER = (
    PIN_OF_CRANK,
    PIN_OF_CRANK.replace(">rod<", ">inner::rod<"),
    CLOSING,
    CLOSING.replace(">rod<", ">inner::rod<"),
)
"""The rod is that of a model within the model."""
STATED = {
    "plain": PLAIN,
    "turned out of its plane, gravity too": changed(
        '<model name="linkage">',
        '<model name="linkage"><pose degrees="true">1 2 3 90 0 30</pose>',
        "<gravity>0 -9.81 0<",
        "<gravity>0 0 -9.81<",
    ),
    "joints from the other side": changed(
        "<parent>crank</parent><child>rod</child>",
        f"<parent>rod</parent><child>crank</child><pose>{A} 0 0 0 0 0</pose>",
    ),
    "frames, degrees": changed(
        f"<pose>{PIN_A.real} {PIN_A.imag} 0 0 0 {ROD}</pose>",
        '<pose relative_to="turned"/>',
        PIN_OF_CRANK,
        f'{PIN_OF_CRANK}<frame name="end" attached_to="crank"><pose>{A} 0 0 0 0 0'
        '</pose></frame><frame name="turned" attached_to="end">'
        '<pose degrees="true">'
        f"0 0 0 0 0 {math.degrees(ROD - START)}</pose></frame>",
        "<parent>world</parent><child>crank</child>",
        "<parent>world</parent><child>foot</child>",
        CRANK,
        f'{CRANK}<frame name="foot" attached_to="crank"/>',
    ),
    "placed by a joint": changed(
        f"<pose>{D} 0 0 0 0 {ROCKER}</pose>",
        f'<pose relative_to="B">{-C} 0 0 0 0 0</pose>',
        f"<pose>{B} 0 0 0 0 0</pose>",
        f'<pose relative_to="rod">{B} 0 0 0 0 {ROCKER - ROD}</pose>',
    ),
    "quaternion": changed(
        f"<pose>{D} 0 0 0 0 {ROCKER}</pose>",
        f'<pose rotation_format="quat_xyzw">{D} 0 0 0 0 {math.sin(ROCKER / 2)} '
        f"{math.cos(ROCKER / 2)}</pose>",
    ),
    "nested model": changed(
        COUPLER,
        f'<model name="inner"><pose>0 0 0 0 0 0.3</pose>{COUPLER}</model>'.replace(
            f"{PIN_A.real} {PIN_A.imag} 0 0 0 {ROD}",
            f"{(PIN_A * np.exp(-0.3j)).real} {(PIN_A * np.exp(-0.3j)).imag} "
            f"0 0 0 {ROD - 0.3}",
        ),
        *OF_INNER,
    ),
    "included, placed by a frame": changed(
        COUPLER,
        "<include><uri>model://rod</uri><name>inner</name><pose>"
        f"{PIN_A.real} {PIN_A.imag} 0 0 0 {ROD}</pose><placement_frame>start"
        "</placement_frame></include>",
        *OF_INNER,
    ),
    "ball constraint": changed(
        "<sdf ",
        '<sdf xmlns:drake="http://drake.mit.edu" ',
        CLOSING,
        "<drake:ball_constraint><drake:ball_constraint_body_A>rod"
        "</drake:ball_constraint_body_A><drake:ball_constraint_body_B>rocker"
        f"</drake:ball_constraint_body_B><drake:ball_constraint_p_AP>{B} 0 0"
        f"</drake:ball_constraint_p_AP><drake:ball_constraint_p_BQ>{C} 0 0"
        "</drake:ball_constraint_p_BQ></drake:ball_constraint>",
    ),
    "auto-inertials": changed(
        *(
            write(length)
            for length in (A, B, C)
            for write in (write_inertial, write_box)
        )
    ),
    "inertia in a turned frame": changed(
        f"<pose>{B / 2} 0 0 0 0 0</pose><mass>{make_bar(B).mass}</mass>"
        f"<inertia><ixx>1</ixx><iyy>1</iyy><izz>{make_bar(B).inertia}</izz>",
        f"<pose>{B / 2} 0 0 {math.pi / 2} 0 0</pose><mass>{make_bar(B).mass}</mass>"
        f"<inertia><ixx>1</ixx><izz>1</izz><iyy>{make_bar(B).inertia}</iyy>",
    ),
    "axis in another frame": changed(
        PIN_OF_CRANK,
        PIN_OF_CRANK.replace(
            "<xyz>0 0 1</xyz>", '<xyz expressed_in="lying">0 -1 0</xyz>'
        )
        + f'<frame name="lying"><pose>5 5 5 {math.pi / 2} 0 0</pose></frame>',
    ),
}


def write_drake():
    """Return thin rods drawn anywhere, whose joints have a frame on each link.

    The prefix is bound nowhere, as in Drake's own files.
    """
    frames = (
        ("Gc", "ground", 0.0, START),
        ("Gr", "ground", D, ROCKER),
        ("Ca", "crank", A, ROD - START),
        ("Rb", "rod", B, 0.0),
        ("Ro", "rocker", C, 0.0),
    )
    joints = read_rows("""
O2 | ground | crank | Gc | crank
O4 | ground | rocker | Gr | rocker
A | crank | rod | Ca | rod
B | rocker | rod | Ro | Rb
""")
    nothing = "<mass>0</mass><inertia><ixx>0</ixx><iyy>0</iyy><izz>0</izz></inertia>"
    text = "".join(
        write_link(name, length, "<pose>7 8 9 0 0 1</pose>")
        for name, length in (("crank", A), ("rod", B), ("rocker", C))
    )
    text = re.sub(
        "<ixx>1</ixx><iyy>1</iyy><izz>(.*?)<",
        r"<ixx>0</ixx><iyy>\1</iyy><izz>\1<",
        text,
    )
    text += f'<link name="ground"><inertial>{nothing}</inertial></link>'
    text += '<joint name="G" type="fixed"><parent>world</parent><child>ground</child>'
    text += "</joint>"
    for name, link, x, angle in frames:
        text += f'<frame name="{name}" attached_to="{link}">'
        text += f"<pose>{x} 0 0 0 0 {angle}</pose></frame>"
    for name, parent, child, at_parent, at_child in joints:
        text += f'<joint name="{name}" type="revolute"><parent>{parent}</parent>'
        text += f"<child>{child}</child><drake:parent_frame>{at_parent}"
        text += f"</drake:parent_frame><drake:child_frame>{at_child}"
        text += f"</drake:child_frame>{AXIS}</joint>"
    return changed(MODEL, f'<model name="linkage">{text}</model>')


def write_halves():
    """Return the rod as two halves on each other, which a constraint welds."""
    rod = make_bar(B)
    half = COUPLER.replace(f"<mass>{rod.mass}", f"<mass>{rod.mass / 2.0}")
    half = half.replace(f"<izz>{rod.inertia}", f"<izz>{rod.inertia / 2.0}")
    weld = "<parent>rod</parent><child>shadow</child></drake:weld_constraint>"
    return changed(
        COUPLER,
        half + half.replace('"rod"', '"shadow"'),
        CLOSING,
        CLOSING.replace(">rod<", ">shadow<") + f"<drake:weld_constraint>{weld}",
    )


def write_urdf(closing):
    """Write the linkage as a URDF, in the plane of x and z."""
    text = '<robot name="r"><link name="base"/>'
    for name, parent, along, angle, length in (
        ("crank", "base", 0.0, START, A),
        ("rod", "crank", A, ROD - START, B),
        ("rocker", "base", D, ROCKER, C),
    ):
        bar = make_bar(length)
        text += (
            f'<link name="{name}"><inertial><origin xyz="{length / 2} 0 0"/>'
            f'<mass value="{bar.mass}"/><inertia ixx="1" ixy="0" ixz="0"'
            f' iyy="{bar.inertia}" iyz="0" izz="1"/></inertial></link>'
            f'<joint name="pin of {name}" type="continuous"><parent link="{parent}"/>'
            f'<child link="{name}"/><origin xyz="{along} 0 0" rpy="0 {-angle} 0"/>'
            '<axis xyz="0 -1 0"/></joint>'
        )
    return f"{text}{closing}</robot>"


LOOP_JOINT = (
    f'<loop_joint name="B" type="spherical"><link1 link="rod" xyz="{B} 0 0" rpy="0 0 0"'
    f'/><link2 link="rocker" xyz="{C} 0 0" rpy="0 0 0"/></loop_joint>'
)
STATED["a prefix that nothing binds"] = changed(
    '<model name="linkage">', '<model name="linkage" gz:kind="12:30 a:b">'
)
STATED["loop joint of a URDF"] = write_urdf(LOOP_JOINT)
GRAVITY = '<mujoco><compiler/><option gravity="0 -9.81 0"/></mujoco>'
STATED["gravity in <mujoco> of a URDF"] = write_urdf(LOOP_JOINT + GRAVITY).replace(
    '<link name="base"/>',
    '<link name="world"/><link name="base"/><joint name="tilt" type="fixed"><parent'
    f' link="world"/><child link="base"/><origin rpy="{-math.pi / 2} 0 0"/></joint>',
)
STATED["frame without mass in a URDF"] = write_urdf(
    f'{LOOP_JOINT}<link name="tip"><inertial><mass value="1e-12"/><inertia ixx="0"'
    ' ixy="0" ixz="0" iyy="0" iyz="0" izz="0"/></inertial></link><joint name="to tip"'
    ' type="fixed"><parent link="rod"/><child link="tip"/></joint>'
)
STATED["ball constraint of a URDF"] = write_urdf(
    '<drake:ball_constraint><drake:ball_constraint_body_A name="rod"/>'
    f'<drake:ball_constraint_p_AP value="{B} 0 0"/>'
    '<drake:ball_constraint_body_B name="rocker"/>'
    f'<drake:ball_constraint_p_BQ value="{C} 0 0"/></drake:ball_constraint>'
).replace("<robot", '<robot xmlns="http://drake.mit.edu"')
STATED["two frames of each joint"] = write_drake()
STATED["weld constraint"] = write_halves()
ROD_MODEL = f"""<sdf version="1.9"><model name="rod"><pose>9 9 9 0 0 0</pose>
{COUPLER.replace(f"{PIN_A.real} {PIN_A.imag} 0 0 0 {ROD}", "1 2 3 0 0 0.4")}
<frame name="start" attached_to="rod"/></model></sdf>"""


def read(folder, text):
    path = folder / "linkage.sdf"
    path.write_text(text)
    return read_robot(path)


@pytest.mark.parametrize("way", STATED)
def test_torque_and_pin_forces_are_those_of_the_bars(way, tmp_path):
    (tmp_path / "rod").mkdir()
    (tmp_path / "rod" / "model.sdf").write_text(ROD_MODEL)
    made = read_scene(read(tmp_path, STATED[way]), speed=10.0).scene
    assert made.linkage.lengths == approx((D, A, B, C), rel=AGREES)
    command = fourbar.command(SCENE)
    turned = command._replace(angle=command.theta_2 + made.linkage.ground_angle)
    expected = fourbar.solve(SCENE)
    theirs = fourbar.solve(made, at=turned)
    for name in ("torque", "F12", "F32", "F43", "F14"):
        ours, size = magnitude(expected[name]), magnitude(theirs[name])
        np.testing.assert_allclose(size, ours, atol=AGREES * ours.max(), rtol=0.0)


@pytest.fixture
def compiled(tmp_path):
    """Compiles a text: the model, and the notes on it."""

    def compile_text(text):
        robot = compile_robot(read(tmp_path, text))
        return robot.model, robot.notes

    return compile_text


@pytest.mark.parametrize("way", ["plain", "joints from the other side"])
def test_angles_of_a_joint_turn_the_child_against_the_parent(way, compiled):
    text = STATED[way].replace(CLOSING, "").replace('"A" type="revolute"', UNIVERSAL)
    text = text.replace(AXIS, f"{AXIS}<axis2><xyz>1 0 0</xyz></axis2>")
    model, _ = compiled(text)
    data = mujoco.MjData(model)
    angles = (0.2, 0.3)
    relative = []
    for turned in ((0.0, 0.0), angles):
        data.joint("A").qpos[0], data.joint("A::axis2").qpos[0] = turned
        mujoco.mj_kinematics(model, data)
        ends = ("crank", "rod") if way == "plain" else ("rod", "crank")
        parent, child = (data.body(name).xmat.reshape(3, 3) for name in ends)
        relative.append(parent.T @ child)
    expected = relative[0] @ Rotation.from_euler("ZX", angles).as_matrix()
    np.testing.assert_allclose(relative[1], expected, atol=AGREES)


def test_the_joint_farthest_from_the_world_closes_the_loop(compiled):
    last = changed(PIN_OF_CRANK, "", CRANK, PIN_OF_CRANK + CRANK)
    assert compiled(last)[0].eq(0).name == "B"
    both = last.replace(CLOSING, "").replace(CRANK, CLOSING + CRANK)
    assert compiled(both)[0].eq(0).name in ("A", "B")
    mimic = '<mimic joint="O2"><multiplier>0</multiplier></mimic></axis>'
    follows = CLOSING.replace("</axis>", mimic)
    assert compiled(changed(CLOSING, follows))[0].eq("A").id == 0


DAMPED = "<dynamics><damping>0.1</damping></dynamics></axis>"
LIMITED = "<limit><lower>-3</lower></limit></axis>"


@pytest.mark.parametrize(
    "kinds, closing",
    [
        ({}, "B"),
        ({"B": LIMITED}, "A"),
        ({"A": LIMITED, "B": DAMPED}, "O4"),
        ({pin: LIMITED for pin in ("O2", "A", "B", "O4")}, "B"),
        ({"B": DAMPED, "A": DAMPED, "O2": DAMPED, "O4": LIMITED}, "O4"),
        ({pin: DAMPED for pin in ("O2", "A", "B", "O4")}, "halves"),
    ],
)
def test_the_joint_that_loses_least_closes_the_loop(kinds, closing, tmp_path):
    """The rod is in two halves on each other that a fixed joint holds together."""
    shadow = COUPLER.replace('"rod"', '"shadow"')
    halves = (
        '<joint name="halves" type="fixed"><parent>rod</parent>'
        "<child>shadow</child></joint>"
    )
    on_shadow = CLOSING.replace(">rod<", ">shadow<") + halves
    text = changed(COUPLER, COUPLER + shadow, CLOSING, on_shadow)
    for pin, more in kinds.items():
        start = text.index(f'<joint name="{pin}"')
        text = text[:start] + text[start:].replace("</axis>", more, 1)
    robot = read(tmp_path, text)
    (closure,) = report_of(robot).closures
    assert closure.name == closing
    lengths = sorted(closure.loop.lengths)
    assert lengths == approx(sorted((D, A, B, C)), rel=AGREES)
    lost = [note.partition("; lost: ")[2] for note in robot.notes]
    assert lost == ([] if closing == "halves" else ["range" * (closing in kinds)])


def test_a_tensor_is_turned_with_its_frame(compiled):
    stated = (
        "<inertial><pose>0 0 0 0.3 0.4 0.5</pose><mass>1</mass><inertia><ixx>2</ixx>"
        "<iyy>3</iyy><izz>4</izz><ixy>0.1</ixy><ixz>0.2</ixz><iyz>0.3</iyz></inertia>"
        "</inertial>"
    )
    model, _ = compiled(changed(write_inertial(A), stated))
    body = model.body("crank")
    principal = Rotation.from_quat(body.iquat, scalar_first=True).as_matrix()
    turned = Rotation.from_euler("xyz", (0.3, 0.4, 0.5)).as_matrix()
    own = np.array([[2.0, 0.1, 0.2], [0.1, 3.0, 0.3], [0.2, 0.3, 4.0]])
    np.testing.assert_allclose(
        principal @ np.diag(body.inertia) @ principal.T,
        turned @ own @ turned.T,
        atol=AGREES,
    )


@pytest.mark.parametrize(
    "shape, volume",
    [
        ("<box><size>1 2 3</size></box>", 6.0),
        ("<sphere><radius>2</radius></sphere>", 32.0 * math.pi / 3.0),
        (
            "<cylinder><radius>2</radius><length>3</length></cylinder>",
            12.0 * math.pi,
        ),
        (
            "<capsule><radius>2</radius><length>3</length></capsule>",
            12.0 * math.pi + 32.0 * math.pi / 3.0,
        ),
        ("<ellipsoid><radii>1 2 3</radii></ellipsoid>", 8.0 * math.pi),
        ("<mesh><uri>model://rod/part.obj</uri><scale>2 1 1</scale></mesh>", 1e-3 / 3),
    ],
)
@pytest.mark.parametrize(
    "density, stated",
    [(1000.0, ""), (500.0, "<density>500</density>")],
)
def test_auto_inertials_are_volumes_by_densities(
    shape, volume, density, stated, tmp_path, compiled
):
    (tmp_path / "rod").mkdir()
    (tmp_path / "rod" / "part.obj").write_text(TETRAHEDRON)
    collision = f"<collision name='c'>{stated}<geometry>{shape}</geometry>"
    text = f'<inertial auto="true"/>{collision}</collision>'
    model, _ = compiled(changed(write_inertial(A), text))
    assert model.body("crank").mass[0] == approx(density * volume, rel=1e-7)


def test_numbers_of_a_joint_are_those_of_its_file(compiled):
    axis = (
        "<axis><xyz>0 0 1</xyz><dynamics><damping>0.1</damping><friction>0.2</friction>"
        "<spring_stiffness>0.3</spring_stiffness><spring_reference>0.4"
        "</spring_reference></dynamics><limit><lower>-1e16</lower><upper>0.7</upper>"
        "</limit></axis>"
    )
    joint = CLOSING.replace(AXIS, axis)
    text = changed(
        CLOSING,
        joint,
        "<gravity>",
        "<physics><max_step_size>0.002</max_step_size></physics><gravity>",
        '<link name="rod">',
        '<link name="rod"><gravity>false</gravity>',
    )
    model, notes = compiled(text)
    number = model.joint("B").id  # what would lose its damping closes no loop
    assert model.dof_damping[number] == 0.1
    assert model.dof_frictionloss[number] == 0.2
    assert model.jnt_stiffness[number] == 0.3
    assert model.qpos_spring[number] == 0.4
    assert model.jnt_range[number].tolist() == [-1e9, 0.7]
    assert model.opt.timestep == 0.002
    assert model.body_gravcomp[model.body("rod").id] == 1.0
    assert model.eq("A").id == 0
    assert notes == (
        "A closes a loop: it is a <connect>, which holds its point and not its axis",
    )


@pytest.mark.parametrize(
    "kind, names, freedoms",
    read_rows("""
fixed |  | 0
prismatic | A | 1
ball | A | 3
universal | A A::axis2 | 2
screw |  | 6
"""),
)
def test_joints_of_each_type_leave_its_freedoms(kind, names, freedoms, compiled):
    joint = PIN_OF_CRANK.replace("revolute", kind)
    joint = joint.replace(AXIS, f"{AXIS}<axis2><xyz>1 0 0</xyz></axis2>")
    model, notes = compiled(changed(PIN_OF_CRANK, joint, CLOSING, ""))
    assert model.nv == 2 + int(freedoms)
    joints = [model.joint(number).name for number in range(model.njnt)]
    assert [name for name in joints if name[0] == "A"] == names.split()
    assert notes == (("left out of the SDF: the screw joint A",) * (kind == "screw"))


def start_at(axis, angle):
    """Return an axis of SDF with the position at which its joint begins."""
    start = f"<initial_position>{angle}</initial_position></axis>"
    return axis.replace("</axis>", start)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_loop_begins_at_the_initial_positions_of_its_joints(sign, tmp_path, compiled):
    """All links are drawn along the ground; the positions alone tell the assembly."""
    turned = [sign * angle for angle in (START, ROD - START, ROCKER)]
    text = put(
        STATED["ball constraint"],
        f"<pose>0 0 0 0 0 {START}</pose>",
        "",
        f"<pose>{PIN_A.real} {PIN_A.imag} 0 0 0 {ROD}</pose>",
        f"<pose>{A} 0 0 0 0 0</pose>",
        f"0 0 0 0 {ROCKER}</pose>",
        "0 0 0 0 0</pose>",
        PIN_OF_CRANK,
        start_at(PIN_OF_CRANK, turned[1]),
        f"<child>crank</child>{AXIS}",
        f"<child>crank</child>{start_at(AXIS, turned[0])}",
        f"<child>rocker</child>{AXIS}",
        f"<child>rocker</child>{start_at(AXIS, turned[2])}",
    )
    (closure,) = report_of(read(tmp_path, text)).closures
    (gap,) = re.findall(r"gap (\S+) mm", closure.text)
    assert 1e-3 * float(gap) == approx(0.0, abs=AGREES * D)
    model, _ = compiled(text)
    assert [model.joint(name).qpos0[0] for name in ("O2", "A", "O4")] == turned
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    end = data.body("rod").xpos + data.body("rod").xmat.reshape(3, 3) @ [B, 0.0, 0.0]
    np.testing.assert_allclose(
        end, [PIN_B.real, sign * PIN_B.imag, 0.0], rtol=0.0, atol=AGREES * D
    )


def test_a_slide_begins_at_its_initial_position(compiled):
    joint = PIN_OF_CRANK.replace("revolute", "prismatic")
    text = changed(PIN_OF_CRANK, start_at(joint, 0.07), CLOSING, "")
    model, _ = compiled(text)
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    assert data.body("rod").xpos[2] == approx(0.07, rel=AGREES)
    assert model.joint("A").qpos0[0] == 0.07


@pytest.mark.parametrize("starts", [(0.0, 0.0), (0.2, 0.5)])
def test_a_joint_follows_by_its_multiplier_offset_and_reference(
    starts, tmp_path, compiled
):
    """MuJoCo's own residual of the line is zero where SDF's line goes through."""
    mimic = (
        '<mimic joint="O2"><multiplier>-2</multiplier><offset>0.3</offset>'
        "<reference>0.1</reference></mimic></axis>"
    )
    crank = f"<child>crank</child>{AXIS}"
    joint = start_at(PIN_OF_CRANK.replace("</axis>", mimic), starts[1])
    text = changed(PIN_OF_CRANK, joint, crank, start_at(crank, starts[0]), CLOSING, "")
    (closure,) = report_of(read(tmp_path, text)).closures
    assert closure.reason.startswith("A follows O2, polycoef ")
    model, _ = compiled(text)
    data = mujoco.MjData(model)
    data.joint("O2").qpos[0] = 0.7
    data.joint("A").qpos[0] = -2.0 * (0.7 - 0.1) + 0.3
    mujoco.mj_forward(model, data)
    assert data.efc_pos[:1] == approx([0.0], abs=AGREES)


@pytest.mark.parametrize("stated", [True, False])
def test_gravity_that_no_world_states_is_named(stated, compiled):
    gravity = () if stated else ("<gravity>0 -9.81 0</gravity>", "")
    model, notes = compiled(changed(*gravity))
    assert model.opt.gravity.tolist() == ([0, -9.81, 0] if stated else [0, 0, -9.8])
    named = "no <world> states gravity: SDFormat's own, 9.8 m/s^2, is taken" in notes
    assert named == (not stated)


def test_a_bushing_is_left_out_with_the_pin_to_put_in_its_place(compiled):
    text = changed(
        "<sdf ",
        '<sdf xmlns:drake="http://drake.mit.edu" ',
        CLOSING,
        "<drake:linear_bushing_rpy/>",
    )
    notes = compiled(text)[1]
    assert "left out of the SDF: drake:linear_bushing_rpy" in notes
    assert any("put <drake:ball_constraint> in its place" in note for note in notes)


def test_what_stands_and_what_floats(compiled):
    alone = "<model name='{}'>{}<link name='part'/></model>"
    hinge = "<joint name='j' type='revolute'><parent>part</parent><child>{}</child>"
    idle = f"{hinge}{AXIS}</joint>"  # among what stands, and of a link on itself
    board = alone.format("board", "") + idle.format("board::part")
    shelf = alone.format("shelf", f"<static>1</static>{board}")
    models = shelf + alone.format("ball", idle.format("part"))
    model, notes = compiled(changed("</world>", f"{models}<plugin/><light/></world>"))
    names = {model.body(number).name for number in range(model.nbody)}
    assert {"shelf::part", "ball::part"} <= names
    assert model.body("shelf::part").weldid == 0
    assert model.body("shelf::board::part").weldid == 0
    assert model.body("ball::part").mass == 1.0
    assert model.body("ball::part").inertia.tolist() == [1.0, 1.0, 1.0]
    assert model.nv == 3 + 6
    assert model.neq == 1
    assert "left out of the SDF: plugin" in notes


NOWHERE = "<include><uri>model://nowhere</uri>"


@pytest.mark.parametrize(
    "old, new, message",
    [
        (MODEL, "", None),
        ("<parent>crank</parent>", "<parent>crunk</parent>", "'crunk'.*is no link"),
        (f"<pose>0 0 0 0 0 {START}</pose>", "<pose>0 0 0</pose>", "6 finite numbers"),
        (
            f"<pose>0 0 0 0 0 {START}</pose>",
            "<pose relative_to='crank'/>",
            "placed relative to itself",
        ),
        (write_inertial(A), '<inertial auto="true"/>', "has no collision"),
        (
            write_inertial(A),
            '<inertial auto="true"><mass>1</mass></inertial>',
            "not read",
        ),
        (
            write_inertial(A),
            write_box(A).replace("box", "cone"),
            "'cone'.*has no inertia here",
        ),
        (CRANK, CRANK + CRANK, "name of its own"),
        (CRANK, f"{NOWHERE}<name>crank</name></include>", "is not there"),
        (MODEL, f"{NOWHERE}</include>", "is not there"),
        (f"<mass>{make_bar(A).mass}</mass>", "<mass>-1</mass>", "above 0"),
    ],
)
def test_what_contradicts_itself_is_refused_in_one_line(old, new, message, compiled):
    text = changed(old, new)
    if message is None:
        assert compiled(text)[0].nbody == 1
        return
    with raises(fourbar.InputError, match=message):
        compiled(text)


def test_a_model_that_is_missing_and_in_no_loop_is_left_out_and_named(tmp_path):
    path = tmp_path / "world.sdf"
    path.write_text(changed(CRANK, f"{CRANK}{NOWHERE}</include>"), "utf-8")
    file = read_robot(path)
    assert "models that are missing are left out: model://nowhere" in file.notes
    path.write_text(PLAIN, "utf-8")
    assert file.text == read_robot(path).text


def test_a_step_beyond_the_end_of_a_motion_meets_no_stop(tmp_path):
    stops = "<limit><lower>-1</lower><upper>1</upper></limit></axis>"
    crank = f"<child>crank</child>{AXIS}"
    file = read(tmp_path, changed(crank, crank.replace("</axis>", stops)))
    examined = examine_text(read_scene(file, speed=1.0).scene, file)
    end = examined.loops[0].through_time.rows.joint.max()
    assert end > 1.0
    assert examined.loops[0].described["pins.O2.range"].value == UNLIMITED_RANGE


@pytest.mark.slow
@pytest.mark.parametrize("way", ["plain", "loop joint of a URDF"])
def test_settings_are_not_asked_of_a_file_that_cannot_state_them(way, tmp_path):
    path = tmp_path / "robot.sdf"
    path.write_text(STATED[way], "utf-8")
    judgement = judge_path("linkage", SCENE, path)
    written = {one.key: one.write() for one in judgement.differences}
    assert "in the file" not in written["closure.solimp"]
    assert SETTINGS_OF_AN_SDF in judgement.notes
    assert not any("What to type" in text for text in judgement.sentences())
    assert "not looked at" not in " ".join(judgement.notes)


@pytest.mark.slow
def test_the_pin_of_a_urdf_is_what_advice_changes(tmp_path):
    file = read(tmp_path, STATED["loop joint of a URDF"])
    assert measure(file, error=0.01).advice.typed == (
        '<connect solimp="0.9999 0.9999 0.001 0.5 2" />',
    )


CYCLE = '<joint name="last"><parent link="rod"/><child link="{}"/></joint>'


@pytest.mark.parametrize(
    "old, new, said",
    [
        (
            "</loop_joint>",
            "<limit/><dynamics/></loop_joint>",
            "left out of the URDF: dynamics, limit",
        ),
        ("spherical", "fixed", "<loop_joint> B joins two links, but is left out"),
        ("loop_joint", "loop", "<loop> B joins two links, but is left out"),
        ('"rocker" xyz', '"racker" xyz', "must name two links"),
        (f'xyz="{C} 0 0"', "", "must name two links"),
        (f'xyz="{C} 0 0"', 'xyz="1 0"', "size 3"),
        (
            LOOP_JOINT,
            f"{LOOP_JOINT}<mujoco><size/></mujoco>",
            "left out of the URDF: s",
        ),
        (LOOP_JOINT, CYCLE.format("rocker"), "'last': closes a loop at rod and rocker"),
        (LOOP_JOINT, CYCLE.format("base"), "'last': closes a loop at rod and base"),
        (LOOP_JOINT, CYCLE.format("world"), "rod and world, which must both be links"),
    ],
)
def test_what_a_loop_joint_of_a_urdf_loses_or_lacks_is_said(
    old, new, said, tmp_path, compiled
):
    text = write_urdf(LOOP_JOINT.replace(old, new))
    if "left out" not in said:
        with raises(fourbar.InputError, match=said):
            compiled(text)
        return
    notes = read(tmp_path, text).notes
    told = " ".join(notes)
    assert said in told and told.count("left out") == 1
    assert (TREE in notes) == ("joins" in said)


URDF = """<robot name="r"><link name="base"/>
<link name="one"><inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0"
ixz="0" iyz="0"/></inertial><visual><geometry><mesh filename="none.dae"/></geometry>
</visual></link>
<link name="two"><inertial><mass value="0"/><inertia ixx="0" iyy="0" izz="0" ixy="0"
ixz="0" iyz="0"/></inertial></link><gazebo/>
<joint name="hip" type="continuous"><parent link="base"/><child link="one"/></joint>
<joint name="knee" type="continuous"><parent link="one"/><child link="two"/>
<mimic joint="hip" multiplier="-1.5" offset="0.2"/></joint></robot>"""


TREE = (
    'no loop is closed in this URDF: <loop_joint name="B" type="revolute"> <link1'
    ' link="ONE" xyz="0 0 0"/> <link2 link="TWO" xyz="0 0 0"/> </loop_joint> closes'
    " one, with the pin's place in each link; where a mimic joint stands for a loop,"
    " check-mjcf SCENE FILE --mimic JOINT judges it"
)
IN_GAZEBO = (
    "a joint in <gazebo> may close a loop, but is no URDF (last):"
    ' "gz sdf -p FILE > robot.sdf" writes an SDF that has it'
)


@pytest.mark.parametrize(
    "gazebo, ways",
    [
        ("<gazebo/>", (TREE,)),
        ('<gazebo><joint name="last"/></gazebo>', (IN_GAZEBO, TREE)),
    ],
)
def test_of_a_urdf_mimic_joints_are_listed_and_the_way_on_is_said(
    gazebo, ways, tmp_path
):
    text = URDF.replace("<gazebo/>", gazebo)
    report = report_of(read(tmp_path, text))
    (closure,) = report.closures
    assert closure.reason.startswith("knee follows hip, polycoef 0.2 -1.5 0 0 0")
    *notes, raised, _ = report.notes
    assert notes == ["left out of the URDF: gazebo", *ways]
    assert re.search("refuses .* 'two'.*: masses below 1e-06 kg", raised)


def test_two_points_of_one_pin_are_two_connects(compiled):
    """Drake's constraints have no names, and join the same two links twice."""
    for way in ("ball constraint of a URDF", "ball constraint"):
        text = STATED[way]
        start = text.index("<drake:ball_constraint>")
        stop = text.index("</drake:ball_constraint>") + len("</drake:ball_constraint>")
        model, _ = compiled(text[:stop] + text[start:])
        assert model.neq == 2


def test_a_loop_joint_within_another_element_is_left_out(compiled):
    text = write_urdf(f"<isaac>{LOOP_JOINT}</isaac>")
    model, notes = compiled(text)
    assert model.neq == 0 and "left out of the URDF: isaac" in notes
