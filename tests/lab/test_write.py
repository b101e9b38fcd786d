"""The named mechanisms.

Each says where it comes from, and its generated MJCF is not stale.
"""

import pytest

from fourbar.files import load
from fourbar_lab.write import find_stale, write_models
from fourbar_validation.scenes.suites import MODELS, list_model_files

FILES = list_model_files()


@pytest.mark.parametrize("file", FILES, ids=lambda file: file.stem)
def test_every_model_names_its_source_and_has_its_mjcf(file):
    scene = load(file)
    assert scene.title and scene.source
    assert not find_stale([file]), "stale: run `make models`"


def test_no_mjcf_without_its_scene():
    assert {xml.stem for xml in MODELS.glob("*.xml")} <= {file.stem for file in FILES}


def test_a_changed_scene_makes_its_mjcf_stale(tmp_path):
    file = tmp_path / "scene.toml"
    file.write_text(FILES[0].read_text("utf-8"), "utf-8")
    assert find_stale([file]) == [file]
    write_models([file])
    assert find_stale([file]) == []
    xml = file.with_suffix(".xml")
    text = xml.read_text("utf-8")
    xml.write_text(text.replace("0.1 ", "0.1000000001 ", 1), "utf-8")
    assert text != xml.read_text("utf-8")
    assert find_stale([file]) == [file]
    xml.write_text(text, "utf-8")
    changed = file.read_text("utf-8").replace(
        "branch = ", 'alpha_2 = "1 rad/s^2"\nbranch = '
    )
    file.write_text(changed, "utf-8")
    assert find_stale([file]) == [file]
