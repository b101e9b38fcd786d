"""The guide's example is a working effect.

Read from the page, registered, and judged by the engines.
"""

import re
import shutil
import sys
import textwrap
from math import radians

from pytest import fixture, mark, raises

from fourbar import effects, errors, mjcf
from fourbar.files import dump, loads
from fourbar_validation.compare import effect_sizes as in_scales
from fourbar_validation.engines import free_body
from fourbar_validation.engines import loaded as on_bars
from fourbar_validation.engines.registry import ENGINES, HARD_ENGINES
from fourbar_validation.run.judge import judge
from tests.support.checkout import ROOT, read, run_python
from tests.validation.engines.test_tree import (
    EXACT,
    ON_TREES,
    outcome,
)

SIMULATED = [engine for engine in ENGINES if engine.through_time]
FOLDERS = ("", "fourbar", "validation", "validation/fourbar_validation")
THE_READER_MAKES = {"fourbar/effects/latch.py", "tests/fourbar/effects/test_latch.py"}
PAGE, QUANTITY = read("docs/extending.md").split("\n## A quantity\n")
REFERENCE = read("docs/scene-file.md")
SCENE = """
[lengths]
ground = "300 mm"
input = "100 mm"
coupler = "250 mm"
output = "220 mm"
[bars]
input = { mass = "0.2 kg" }
coupler = { mass = "0.5 kg" }
output = { mass = "0.4 kg" }
[motion]
theta_2 = { from = "5 deg", to = "365 deg", steps = 36 }
omega_2 = "10 rad/s"
"""


def block(language, page=PAGE, number=0):
    return re.findall(rf"```{language}\n(.*?)```", page, re.S)[number]


@fixture
def latch(monkeypatch, tmp_path):
    """The effect of the page, from its one file in the folder of effects."""
    (tmp_path / "latch.py").write_text(block("python"), "utf-8")
    monkeypatch.setattr(effects, "__path__", [*effects.__path__, str(tmp_path)])
    forget = effects.list_classes.cache_clear
    forget()
    yield effects.Latch
    forget()
    sys.modules.pop("fourbar.effects.latch")
    del effects.Latch


def test_one_file_is_all_that_the_example_needs(latch):
    """The page's own test, with nothing registered anywhere."""
    names = {}
    exec(block("python", number=1), names)
    names["test_every_exact_engine_agrees"]()
    assert "latch" in effects.list_kinds()


def guide_scene():
    return loads(SCENE + block("toml"))


def test_the_example_is_read_written_and_agreed_on(latch):
    scene = guide_scene()
    assert scene.effects == (latch(4, 0.2, radians(115.0), radians(5.0)),)
    assert loads(dump(scene)) == scene
    assert latch.example in block("toml")


@mark.parametrize(
    "engines, missing, refusing",
    [
        (EXACT, (), set()),
        (EXACT, ("act_on_engine",), ON_TREES),
        (EXACT, ("act_on_free_bodies",), {"free-body"}),
        (SIMULATED, (), {"mujoco-simulated"}),  # MJCF has no counterpart
    ],
)
def test_engines_without_a_model_refuse_the_example(
    latch, engines, missing, refusing, monkeypatch
):
    for method in missing:
        monkeypatch.delattr(latch, method)
    rows = judge("scene", guide_scene(), engines).rows
    assert not [row for row in rows if row.failed]
    reasons = {row.engine: row.reason for row in rows if row.verdict == "refuses"}
    assert reasons.keys() == refusing
    assert all("'latch'" in reason for reason in reasons.values())


def test_mjcf_has_no_counterpart_of_the_example(latch):
    with raises(errors.LimitError, match="'latch'"):
        mjcf.write_mjcf(guide_scene())


def test_without_its_size_nothing_is_judged_by_another_scale(latch, monkeypatch):
    monkeypatch.delattr(latch, "size")
    rows = judge("scene", guide_scene(), EXACT).rows
    engines = {row.engine for row in rows if row.failed and "'latch'" in row.reason}
    assert engines >= {engine.name for engine in EXACT}


@mark.parametrize("key", effects.list_kinds())
def test_the_example_of_each_effect_is_read_and_written_back(key):
    example = effects.list_kinds()[key].example
    scene = loads(f"{SCENE}[effects]\n{example}")
    assert [effect.key for effect in scene.effects] == [key]
    assert loads(dump(scene)) == scene
    assert example.split("=")[0] in REFERENCE


def test_every_effect_of_the_package_has_a_row_in_each_table():
    """Loads have a table of their own in a file."""
    keys = {*effects.list_kinds()}
    assert keys == {*free_body.WRENCH_OF}
    assert keys | {"load"} == {*on_bars.TERM_OF} == {*in_scales.SIZE_OF}
    for kind in (*effects.list_kinds().values(), effects.Load):
        assert kind.size is effects.Effect.size  # nothing judged sets its own scale
    without_mjcf = {
        key
        for key, kind in effects.list_kinds().items()
        if kind.add_to_mjcf is effects.Effect.add_to_mjcf
    }
    assert without_mjcf == {"pin_friction"}


def test_the_scene_of_the_reference_names_everything_and_is_agreed_on():
    scene = loads(SCENE.partition("[motion]")[0] + block("toml", REFERENCE, 5))
    assert [effect.key for effect in scene.effects] == list(effects.list_kinds())
    assert scene.motion.law is not None and scene.loads[0].table is not None
    assert loads(dump(scene)) == scene
    assert outcome(scene, EXACT)[0] == []


@mark.parametrize("page", ["architecture", "extending"])
def test_each_file_and_each_name_in_one_is_where_the_page_says(page):
    text = read(f"docs/{page}.md")
    stated = re.findall(r"`(\w+(?:/[\w.-]+)*/[\w-]+\.\w+)`", text)
    placed = re.findall(
        r"`([\w.]+)(?:\([\w, ]*\))?`(?: \w+)? (?:in|of|\() ?`([\w/]+\.\w+)`", text
    )
    assert len(stated) > 40 and len(placed) > 20
    for file in {*stated} - THE_READER_MAKES:
        assert find_files(file), file
    for name, file in placed:
        word = re.compile(rf"\b{name.rpartition('.')[2]}\b")
        assert any(map(word.search, map(read, find_files(file)))), name


def find_files(name):
    """Find the files that a page means: paths start at the checkout or a package."""
    paths = [ROOT / folder / name for folder in FOLDERS]
    return [path for path in paths if path.is_file()]


ADDED = {
    "fourbar/quantities/__init__.py": "    v_A: Array",
    "fourbar/evaluation/evaluate.py": '    "condition": lambda',
    "fourbar_validation/compare/scales.py": "        known |= motion.",
    "fourbar_validation/engines/balls.py": '    y |= {f"omega_{bar}"',
}
"""Files in which the guide puts a line of its quantity, and the line beside it."""
JUDGED = """
from fourbar.files import loads
from fourbar_validation.engines.registry import HARD_ENGINES
from fourbar_validation.run.judge import judge

exact = [engine for engine in HARD_ENGINES if not engine.through_time]
rows = judge("slip", loads(SCENE), exact).rows
for row in rows:
    if row.quantity == "slip_B":
        print(row.engine, row.verdict)
"""


@mark.slow
def test_the_example_of_a_quantity_is_judged_by_every_exact_engine(tmp_path):
    """The lines of the page stand in a copy of both packages, and nothing else."""
    for package in (ROOT / "fourbar", ROOT / "validation" / "fourbar_validation"):
        shutil.copytree(package, tmp_path / package.name)
    for number, (file, beside) in enumerate(ADDED.items()):
        assert f"`{file}`" in QUANTITY
        path = tmp_path / file
        lines = path.read_text("utf-8").splitlines()
        (index,) = (i for i, line in enumerate(lines) if line.startswith(beside))
        stated = block("python", QUANTITY, number)
        indent = " " * (len(beside) - len(beside.lstrip()))
        lines.insert(index + ("|=" in beside), textwrap.indent(stated, indent))
        path.write_text("\n".join(lines), "utf-8")
    loop = tmp_path / "fourbar_validation" / "engines" / "loop.py"
    text = loop.read_text("utf-8")
    loop.write_text(text.replace('"v_A",', '"slip_B", "v_A",'), "utf-8")
    code = f"SCENE = {SCENE!r}\n{JUDGED}"
    judged = run_python("-c", code, folder=tmp_path, PYTHONPATH=str(tmp_path))
    assert judged.returncode == 0, judged.stderr
    exact = {engine.name for engine in HARD_ENGINES if not engine.through_time}
    assert {*judged.stdout.splitlines()} == {f"{name} agrees" for name in exact}
