"""A robot's file with its includes and meshes: what is read, left out and refused."""

import mujoco
import pytest

from fourbar.errors import BAD_INPUT, InputError
from fourbar_validation.cli import status
from fourbar_validation.engines.mujoco.robots.pose import (
    compile_robot,
    list_unknown_parts,
)
from fourbar_validation.places import MODELS
from fourbar_validation.robots import files
from fourbar_validation.robots.files import read_robot
from tests.support.rows import read_rows

TETRAHEDRON = (
    "v 0 0 0\nv 0.1 0 0\nv 0 0.1 0\nv 0 0 0.1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"
)

ROBOT = """
<mujoco>
  <compiler meshdir="{meshdir}"/>
  <include file="{include}"/>
  <asset><texture name="t" type="2d" file="paint.png"/><material name="m" texture="t"/>
    <mesh file="part.obj"/></asset>
  <worldbody><body name="arm"><joint name="arm" axis="0 1 0"/>{inertial}
    <geom type="mesh" mesh="part" material="m" density="1000"/></body></worldbody>
</mujoco>
"""
INERTIAL = '<inertial pos="0 0 0" mass="2" diaginertia="1 1 1"/>'


def make(
    folder,
    *,
    meshdir="assets",
    include="options.xml",
    inertial="",
):
    """Write the robot with an include into a folder."""
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / "robot.xml"
    path.write_text(ROBOT.format(meshdir=meshdir, include=include, inertial=inertial))
    options = '<mujocoinclude><option timestep="0.004"/></mujocoinclude>'
    (folder / "options.xml").write_text(options)
    return path


@pytest.mark.parametrize("where", ["beside", "assets"])
def test_meshes_beside_it_and_of_the_option_are_read(tmp_path, where):
    path = make(tmp_path / "robot", meshdir="../meshes" if where == "beside" else "")
    elsewhere = tmp_path / ("meshes" if where == "beside" else "far/away")
    elsewhere.mkdir(parents=True)
    (elsewhere / "part.obj").write_text(TETRAHEDRON)
    file = read_robot(path, None if where == "beside" else elsewhere)
    assert not file.missing
    assert compile_robot(file).model.nmesh == 1


def test_a_complaint_of_mujoco_names_the_element_and_no_line_of_another_text(tmp_path):
    path = make(tmp_path)
    path.write_text(path.read_text().replace("<joint ", '<joint ref="high" '))
    with pytest.raises(InputError, match=r"'ref' Element 'joint'$"):
        compile_robot(read_robot(path))


@pytest.mark.parametrize("discards", ["true", "false"])
def test_a_missing_mesh_that_is_the_mass_is_said(discards, tmp_path):
    path = make(tmp_path)
    compiler = f'<compiler discardvisual="{discards}"'
    path.write_text(path.read_text().replace("<compiler", compiler))
    fixed = '<body name="base"><geom type="mesh" mesh="part"/></body><body name="arm">'
    path.write_text(path.read_text().replace('<body name="arm">', fixed))
    robot = compile_robot(read_robot(path))
    body = robot.model.body("arm").id
    assert robot.unknown_masses == (body,)
    assert not robot.model.geom_contype.any() and not robot.model.geom_conaffinity.any()
    assert "masses of arm are unknown" in robot.notes[1]
    with pytest.raises(InputError, match="--assets DIR"):
        list_unknown_parts(robot, {body})
    assert list_unknown_parts(robot, set()) == []


def test_a_part_without_a_mass_is_named(tmp_path):
    part = '<geom size="0.1"/><body name="part"><geom type="mesh" mesh="part"/></body>'
    robot = compile_robot(read_robot(make(tmp_path, inertial=INERTIAL + part)))
    body = robot.model.body("part").id
    assert list_unknown_parts(robot, {body}) == ["part"]
    assert robot.model.body("part").mass[0] < 1e-6  # of the stand-in


def test_no_file_outside_is_opened(tmp_path):
    home = tmp_path / "a" / "b"
    (tmp_path / "secret.xml").write_text("<mujocoinclude/>")
    (tmp_path / "part.obj").write_text(TETRAHEDRON)
    for name in ("../../secret.xml", str(tmp_path / "secret.xml")):
        path = make(home, include=name)
        with pytest.raises(InputError, match="is not there; it must lie in"):
            read_robot(path)
    file = read_robot(make(home, meshdir=str(tmp_path)))
    assert list(file.missing.values()) == ["part.obj"]
    link = home / "link.obj"
    link.symlink_to(tmp_path / "part.obj")
    path = make(home, meshdir="")
    path.write_text(path.read_text().replace("part.obj", "link.obj"))
    assert list(read_robot(path).missing.values()) == ["link.obj"]


@pytest.mark.parametrize(
    "text, words",
    [
        *read_rows("""
<mujoco><include file='robot.xml'/></mujoco> | nested deeper than 100
<mujoco><asset><model file='x.xml'/></asset></mujoco> | mj_saveLastXML
<mujoco><worldbody><body><attach name='x'/></body></worldbody></mujoco> | '<attach>': \
is not read here
<!DOC<!-- -->TYPE m [<!ENT<!-- -->ITY a "b">]><mujoco name="&a;"/> | needs no document \
type
<mujoco><option iterations='100000'/></mujoco> | whole number up to 1000
<mujoco><option ls_iterations=' 1001'/></mujoco> | up to 1000
<mujoco><option noslip_iterations='0x7fffffff'/></mujoco> | up to 1000
<mujoco><option ccd_iterations='1e9'/></mujoco> | up to 1000
<!DOCTYPE a [<!ENTITY b 'c'>]><mujoco/> | no document type
<mujoco model='a\\x00b'/> | no XML
\\xff\\xfe\\x00 | UTF-8
<mujoco model='\\xff'/> | UTF-8
<svg/> | must be an MJCF, an SDF or a URDF
<mujoco> | no XML
<robot xmlns:xacro='http://ros.org/wiki/xacro'><xacro:macro/></robot> | is a xacro: \
"xacro FILE > robot.urdf"
"""),
        ("<mujoco>" + 200 * "<body>" + 200 * "</body>" + "</mujoco>", "deeper"),
    ],
)
def test_what_a_file_may_not_hold_is_one_line(tmp_path, text, words):
    path = tmp_path / "robot.xml"
    path.write_bytes(text.encode().decode("unicode_escape").encode("latin-1"))
    assert_refused(path, words)


@pytest.mark.parametrize(
    "name, text, kind",
    read_rows("""
robot.xml | <mujoco><worldbody><body/></worldbody></mujoco> | MJCF
robot.sdf | <sdf | SDF
robot.world | <sdf><world/><!DOCTYPE a></sdf> | SDF
robot.xml | <sdf><world/></sdf> | SDF
robot.urdf | <robot | URDF
robot.xml | <robot name='r'><link name='a'/></robot> | URDF
"""),
)
def test_a_message_begins_with_the_format_of_the_file(
    name, text, kind, tmp_path, capsys
):
    path = tmp_path / name
    path.write_text(text)
    scene = str(MODELS / "crank_rocker.toml")
    out = str(tmp_path / "out")
    assert status(["check-mjcf", scene, str(path), "--out", out]) == BAD_INPUT
    message = capsys.readouterr().err.strip().splitlines()[-1]
    assert message.startswith(f"error: {path}: {kind} = ")
    others = {"MJCF", "SDF", "URDF"} - {kind}
    assert not any(other in message.partition(f"{kind} = ")[2] for other in others)


@pytest.mark.parametrize(
    "name, words",
    [("r.usd", "USD: give the robot's MJCF, SDF or URDF"), ("r.mjb", "give the MJCF")],
)
def test_a_binary_file_is_refused_by_its_name(name, words, tmp_path):
    path = tmp_path / name
    path.write_bytes(b"PXR-USDC")
    assert_refused(path, words)


def assert_refused(path, words):
    """Reading a file ends in one line with these words."""
    with pytest.raises(InputError, match=words) as caught:
        read_robot(path)
    assert "\n" not in str(caught.value)


def test_what_a_file_reads_is_limited_together(tmp_path, monkeypatch):
    """Its text with three includes, and two meshes."""
    path = make(tmp_path, meshdir="", inertial=INERTIAL)
    include = '<include file="options.xml"/>'
    text = path.read_text().replace(include, 3 * include)
    path.write_text(text.replace("</asset>", '<mesh file="other.obj"/></asset>'))
    for name in ("part.obj", "other.obj"):
        (tmp_path / name).write_text(TETRAHEDRON)
    alone, included = (p.stat().st_size for p in (path, tmp_path / "options.xml"))
    for limit, most, words in (
        ("LARGEST_TEXT", alone + 3 * included, "xml': and its includes exceed {} B"),
        ("LARGEST_ASSETS", 2 * len(TETRAHEDRON), "obj': and other meshes exceed {} B"),
        ("MOST_INCLUDES", 3, "more than {} files are included"),
    ):
        with monkeypatch.context() as patch:
            patch.setattr(files, limit, most)
            assert len(read_robot(path).assets) == 2
            patch.setattr(files, limit, most - 1)
            assert_refused(path, words.format(most - 1))
    monkeypatch.setattr(files, "LARGEST_TEXT", alone - 1)
    assert_refused(path, f"must not exceed {alone - 1}")


@pytest.mark.parametrize("rows", ["file='hills.png'", "nrow='60000' ncol='60000'"])
def test_height_fields_are_left_out_and_said(tmp_path, rows):
    """However large they are."""
    path = tmp_path / "robot.xml"
    path.write_text(
        f"<mujoco><asset><hfield name='h' {rows} size='1 1 1"
        " 1'/></asset><worldbody><geom type='hfield' hfield='h'/></worldbody></mujoco>"
    )
    file = read_robot(path)
    assert file.notes == ("left out, as no part of a loop: <hfield>",)
    model = compile_robot(file).model
    assert model.ngeom == model.nhfield == 0


PLUGIN = """
<mujoco><extension><plugin plugin="mujoco.sdf.torus"><instance name="s"/></plugin>
</extension><asset><mesh name="ring"><plugin instance="s"/></mesh></asset>
<worldbody><body name="arm"><joint name="arm" axis="0 1 0"/>{inertial}
<geom type="sdf" mesh="ring"><plugin instance="s"/></geom></body></worldbody>
<sensor><jointpos joint="arm"/><plugin name="touch" instance="s"/></sensor></mujoco>
"""


@pytest.mark.parametrize("inertial", [INERTIAL, ""])
def test_a_plugin_is_left_out_and_said(tmp_path, inertial):
    path = tmp_path / "robot.xml"
    path.write_text(PLUGIN.format(inertial=inertial))
    robot = compile_robot(read_robot(path))
    assert "left out, as no part of a loop: <extension>, <plugin>" in robot.notes
    assert bool(inertial) == (not robot.unknown_masses)
    if inertial:
        assert robot.model.body("arm").mass == 2.0
    assert (
        "meshes that are missing are left out: 1, the first of them ring of a plugin"
        in robot.notes
    )


@pytest.mark.parametrize(
    "before, text",
    read_rows(r"""
 | <geom type="sphere"size=".1"/>
 | <geom type='sphere'size='.1'/>
 | <geom type="sphere" size=".1" name="a & b"/>
 | <geom type="sphere" size=".1" name="a&foo;b"/>
 | <geom type="sphere" size=".1" name="a<b"/>
 | <geom type="sphere" size=".1"/>\x01
 | <!-- a -- b --><geom type="sphere" size=".1"/>
 | <!position joint="a" kp="3"/><geom type="sphere" size=".1"/>
\x20\x20<?xml version='1.0'?>\n | <geom size=".1"/>
<?xml version=1.0?><?xml version='1.0'?> | <geom size=".1"/>
a robot\x20 | <geom size=".1"/>
"""),
)
def test_what_mujoco_reads_is_read(tmp_path, before, text):
    inside = f"<worldbody><body><joint/>{text}</body></worldbody>"
    written = f"{before}<mujoco>{inside}</mujoco>".encode().decode("unicode_escape")
    of_mujoco = mujoco.MjModel.from_xml_string(written)
    path = tmp_path / "robot.xml"
    path.write_text(written)
    robot = compile_robot(read_robot(path))
    assert robot.model.body_mass.tolist() == of_mujoco.body_mass.tolist()
    assert robot.model.geom(0).name == of_mujoco.geom(0).name
    (note,) = robot.notes
    assert note.startswith("robot.xml is no XML")
