"""Pictures named in a scene file.

Kept by it, shown by the page, and no path out of the scene's folder.
"""

import base64
from dataclasses import replace

from pytest import approx, mark, raises

from fourbar import InputError, solve
from fourbar.files import dump, load, loads, save
from fourbar.scene.pictures import LARGEST_PICTURE, Picture, TracedPicture
from fourbar.show import animate
from tests.fourbar.show.test_animate import PNG, embedded
from tests.support.rows import read_rows, refused
from tests.support.scenes import crank_rocker
from tests.support.texts import LENGTHS

EMBEDDED = "data:image/png;base64," + base64.b64encode(PNG).decode()


def scene_file(folder, name, bar="coupler"):
    file = folder / "scene.toml"
    file.write_text(f'{LENGTHS}[bars.{bar}]\npicture = "{name}"\n', encoding="utf-8")
    return file


def test_a_scene_saved_elsewhere_names_the_same_file_or_says_why_not(tmp_path):
    inner = tmp_path / "inner"
    inner.mkdir()
    (inner / "bar.png").write_bytes(PNG)
    scene = load(scene_file(inner, "bar.png", "output"))
    save(scene, tmp_path / "outer.toml")
    assert 'picture = "inner/bar.png"' in (tmp_path / "outer.toml").read_text()
    assert embedded(animate.write_page(load(tmp_path / "outer.toml")))["pictures"] == {
        "4": EMBEDDED
    }
    elsewhere = tmp_path / "other"
    elsewhere.mkdir()
    with raises(
        InputError,
        match=r"^bars\.output\.picture.*copy it there first[^\n]*$",
    ):
        save(scene, elsewhere / "scene.toml")
    assert not list(elsewhere.iterdir())


def test_one_given_with_the_command_takes_its_place(tmp_path):
    (tmp_path / "bar.png").write_bytes(PNG)
    (tmp_path / "other.png").write_bytes(PNG + b"x")
    scene = load(scene_file(tmp_path, "bar.png"))
    shown = embedded(animate.write_page(scene, {"coupler": tmp_path / "other.png"}))[
        "pictures"
    ]["3"]
    assert base64.b64decode(shown.partition(",")[2]) == PNG + b"x"


@mark.parametrize(
    "name",
    [
        *r"""
.
..
../secret.png
a/../../secret.png
/etc/passwd
//host/x.png
a//b.png
..\\secret.png
C:/x.png
C:x.png
a\u0000b.png
a\nb.png
file:x.png
./x.png
""".splitlines(),
        "x" * 300,
    ],
)
def test_a_name_that_leads_elsewhere_is_refused_when_the_file_is_read(name):
    with raises(InputError, match=r"^s.toml: bars\.coupler\.picture .*PNG or JPEG"):
        loads(f'{LENGTHS}[bars.coupler]\npicture = "{name}"\n', "s.toml")


def test_what_the_name_leads_to_is_looked_at_before_it_is_shown(tmp_path):
    inner = tmp_path / "inner"
    inner.mkdir()
    (tmp_path / "secret.png").write_bytes(PNG)
    (inner / "link.png").symlink_to(tmp_path / "secret.png")
    (inner / "up").symlink_to(tmp_path)
    (inner / "text.png").write_text("<svg onload='alert(1)'/>")
    (inner / "big.png").write_bytes(PNG + bytes(LARGEST_PICTURE))
    (inner / "folder.png").mkdir()
    for name, word in (
        ("link.png", "out of the scene's folder"),
        ("up/secret.png", "out of the scene's folder"),
        ("text.png", "PNG or JPEG"),
        ("big.png", "must not exceed 2000000"),
        ("folder.png", "is a directory"),
        ("missing.png", "file not found"),
    ):
        scene = load(scene_file(inner, name))
        solve(scene)  # nobody has to see it to compute
        with raises(
            InputError,
            match=rf"^bars\.coupler\.picture[^\n]*{word}[^\n]*$",
        ):
            animate.write_animation(scene, tmp_path / "page.html")
        assert not (tmp_path / "page.html").exists()


def test_a_bar_has_one_picture_and_the_ground_none():
    with refused("one picture"):
        replace(crank_rocker(), pictures=[Picture(3, "a.png"), Picture(3, "b.png")])
    with refused("2, 3 or 4"):
        Picture(1, "a.png")


TRACED = (
    '[picture]\nfile = "photo.jpg"\norigin = [120, 80.5]\nscale = "0.5 mm"\n'
    'angle = "-3 deg"\nopacity = 0.25\n'
)


def test_the_picture_under_the_drawing_is_read_and_written_and_need_not_be_there(
    tmp_path, show
):
    file = tmp_path / "scene.toml"
    file.write_text(LENGTHS + TRACED)
    scene = load(file)
    picture = scene.picture
    assert (picture.origin, picture.scale) == ((120.0, 80.5), 5e-4)
    assert (picture.angle, picture.opacity) == (approx(-0.0523598776), 0.25)
    assert loads(dump(scene), str(file)).picture == picture
    show("analyze", file, "-o", "a.csv")
    file.write_text(LENGTHS + '[picture]\nfile = "photo.jpg"\n')
    bare = load(file)
    assert loads(dump(bare), str(file)).picture == bare.picture
    assert bare.linkage == scene.linkage
    (tmp_path / "inner").mkdir()
    with refused("copy it there first"):
        save(scene, tmp_path / "inner" / "scene.toml")


@mark.parametrize(
    "stated, words",
    read_rows(r"""
file = "../photo.jpg" | picture.file .*next to the scene file
file = "photo.jpg"\nscale = "0 mm" | picture.scale .*> 0, like
file = "photo.jpg"\nscale = "2 kg" | picture.scale
file = "photo.jpg"\norigin = [1] | picture.origin .*pair like \[1, 1\]
file = "photo.jpg"\nopacity = 1.5 | picture.opacity .*0 to 1
file = "photo.jpg"\ncolour = "red" | picture.colour
scale = "1 mm" | picture.file
"""),
)
def test_a_wrong_entry_of_the_picture_is_refused(stated, words):
    with raises(InputError, match=words):
        loads(f"{LENGTHS}[picture]\n{stated}\n".replace(r"\n", "\n"))


@mark.parametrize(
    "content, kind",
    [
        (PNG, "image/png"),
        (b"\xff\xd8\xff\xe0", "image/jpeg"),
        (b"<?xml version='1.0'?>\n<svg/>", "image/svg+xml"),
        (b"<html>", None),
    ],
)
def test_what_is_traced_is_a_picture(tmp_path, content, kind):
    (tmp_path / "photo").write_bytes(content)
    picture = TracedPicture("photo", folder=str(tmp_path))
    if kind is None:
        with refused("must be a PNG, JPEG or SVG picture"):
            picture.read()
    else:
        assert picture.read() == (content, kind)
