"""README and docs are run: commands, program, scene file.

Every link leads somewhere, every page is listed. `test_tutorial.py` runs the commands
and programs of which pages show what they print.
"""

import math
import re
import runpy
import shlex

import click
import numpy as np
from pytest import approx, fixture, mark

import fourbar
from fourbar import solve, swing
from fourbar.cli import group, status
from fourbar.effects import list_kinds
from fourbar.errors import FAILED, HOLDS
from fourbar.files import load
from fourbar_lab.cli import group as lab
from fourbar_validation.cli import group as harness
from fourbar_validation.cli import status as run_harness
from fourbar_validation.compare.results_file import read_columns
from fourbar_validation.scenes.suites import read_suite
from tests.support.checkout import ROOT, find_lines, read
from tests.support.here import judge_here

DOCS = ROOT / "docs"
GALLERY = ROOT / "models" / "gallery"
GROUPS = {
    "fourbar": group,
    "validation": harness,
    "fourbar-validation": harness,
    "fourbar_lab": lab,
}
TOP = ("README", "CHANGELOG", "CONTRIBUTING", "SECURITY", "paper/paper")
PAGES = [*(ROOT / f"{name}.md" for name in TOP), *sorted(DOCS.rglob("*.md"))]
FORMS = sorted((ROOT / ".github" / "ISSUE_TEMPLATE").glob("*.yml"))


def first_column(name, heading):
    """Return the first cells of a page's first table after some words, head apart."""
    table = read(f"docs/{name}.md").partition(heading)[2].partition("\n\n")[0]
    return "".join(row.split("|")[1] for row in table.splitlines()[2:])


def commands_of(group):
    """Return the commands of a program by their names."""
    context = click.Context(group)
    return {
        name: group.get_command(context, name) for name in group.list_commands(context)
    }


def blocks(language, text):
    return re.findall(rf"^```{language}\n(.*?)^```$", text, re.MULTILINE | re.DOTALL)


def test_the_examples_of_continuous_integration_use_commands_that_exist():
    for file in sorted((DOCS / "ci").glob("*.yml")):
        text = re.sub(r"\\\n\s*|>\n\s*|(?<=\S)\n\s+(?=--)", " ", file.read_text())
        lines = re.findall(r"(validation|fourbar_lab) ([\w-]+)(.*)", text)
        assert "run" in {name for _, name, _ in lines}
        for program, name, options in lines:
            options_of = commands_of(GROUPS[program])[name].params
            taken = {name for option in options_of for name in option.opts}
            wanted = set(re.findall(r"(?<=\s)--[a-z-]+", options))
            assert wanted <= taken and wanted


def test_every_long_part_is_run_in_the_night():
    parts = find_lines(r"^LONG [:+]= (.*)$", read("Makefile"))
    (nightly,) = re.findall(r"part: \[(.*)\]", read(".github/workflows/nightly.yml"))
    assert nightly.split(", ") == " ".join(parts).split()


def test_one_version_stands_everywhere():
    for name, line in (
        ("pyproject.toml", 'version = "{}"'),
        ("CITATION.cff", "version: {}"),
        ("CHANGELOG.md", "## {}"),
    ):
        assert line.format(fourbar.__version__) in read(name).splitlines()


@fixture
def checkout(tmp_path, monkeypatch):
    """A folder that looks like a checkout and may be written to."""
    (tmp_path / "models").symlink_to(ROOT / "models")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_the_readme_goes_on_from_its_first_scene(checkout, capsys):
    """The commands and the call that stand in its sentences."""
    begin, *_ = find_lines(r"^\$ fourbar (new .*)$", read("README.md"))
    sentences = read("README.md").partition("rounding changes none")[2]
    at, pins, _ = re.findall(r"`fourbar ((?:analyze|new|edit) .*?)`", sentences)
    for command in (begin, at, pins):
        assert status(shlex.split(command)) == HOLDS, command
    assert "at theta_2 = 60 deg" in capsys.readouterr().out.replace(",", "")
    (call,) = re.findall(r"In Python `(.*?)` is an array", sentences)
    assert isinstance(eval(call, {"fourbar": fourbar}), np.ndarray)
    assert load(checkout / "first.toml").linkage.lengths == (0.3, 0.1, 0.25, 0.22)
    by_pins = np.hypot((0.25, 0.0, 0.175, 0.075), (0.05, 0.1, 0.05, 0.0))
    assert load(checkout / "second.toml").linkage.lengths == approx(by_pins)


def test_the_table_of_the_exercise_is_right(checkout, capsys):
    (table,) = blocks("csv", read("docs/tutorial.md"))
    wrong = table.replace("0.4467", "0.4476")
    for text, code, words in ((table, HOLDS, "4 of 4"), (wrong, FAILED, "3 of 4")):
        (checkout / "theirs.csv").write_text(text, "utf-8")
        assert run_harness(["check", "models/crank_rocker.toml", "theirs.csv"]) == code
        assert f"{words} numbers agree" in capsys.readouterr().out


@mark.slow
def test_the_engine_of_the_guide_agrees(checkout, monkeypatch):
    (program,) = blocks("python", read("docs/guide-simulator.md"))
    (checkout / "closure.py").write_text(program, "utf-8")
    monkeypatch.syspath_prepend(str(checkout))
    judge_here(monkeypatch)
    # the second of them begins at a limit
    line = (
        "run models/crank_rocker.toml models/double_rocker.toml --engines free-body"
        " --guest closure:Closure --no-pictures --out out"
    )
    assert run_harness(line.split()) == HOLDS
    rows = read_columns(checkout / "out" / "results.csv")
    held = {row.quantity for row in rows if row.engine == "closure" and row.passed}
    assert held >= {"theta_3", "theta_4", "omega_3", "omega_4"}


def test_the_scene_file_is_one(checkout):
    # a scene; a bar by its material; pins in place of the lengths; an example of each
    # effect; a picture
    text, material, pins, *_, picture = blocks("toml", read("docs/scene-file.md"))
    fourbar.files.loads(pins)
    assert fourbar.files.loads(pins + picture).picture.scale == 0.5e-3
    lengths = text[text.index("[lengths]") : text.index("[bars.input]")]
    steel = fourbar.files.loads(lengths + material).linkage.coupler
    assert steel.mass == approx(7850.0 * 0.02 * 0.005 * steel.length)
    (checkout / "example.toml").write_text(text)
    scene = fourbar.load(checkout / "example.toml")
    assert set(solve(scene).status) == {"ok"}
    assert {effect.key for effect in scene.effects} <= list_kinds().keys()


@mark.parametrize("page", [*PAGES, *FORMS], ids=lambda page: page.name)
def test_every_other_command_line_is_one_that_its_program_takes(page):
    """Parse the command lines, which run for minutes or name a SCENE, in running text
    and shell blocks.
    """
    text = read(page)
    lines = re.findall(
        r"`((?:fourbar|python -m validation|python -m fourbar_lab|fourbar-validation)"
        r" [^`]+)`",
        text,
    )
    lines += find_lines(
        r"^((?:python -m |fourbar-)(?:validation|fourbar_lab) .*)$",
        "".join(blocks("sh", text)),
    )
    for line in lines:
        words = shlex.split(line.removeprefix("python -m "), comments=True)
        program = GROUPS[words[0]]
        if words[1:] == ["--version"]:
            continue
        _, command, arguments = program.resolve_command(
            click.Context(program), words[1:]
        )
        assert command is not None, line
        if arguments:
            command.make_context(words[1], arguments)


def options():
    """Return the names of each option of each command, its short one among them."""
    return [
        {*param.opts, *param.secondary_opts}
        for program in (group, harness, lab)
        for command in (program, *commands_of(program).values())
        for param in command.params
    ]


@mark.parametrize(
    "name", ["commands", "checks", "results", "guide-designer", "guide-roboticist"]
)
def test_every_option_that_a_page_names_is_one(name):
    named = re.findall(r"(?<![\w-])--[a-z][a-z-]*", read(f"docs/{name}.md"))
    assert {*named} <= set().union(*options())


def test_every_out_has_its_short_name():
    writing = [names for names in options() if "--out" in names]
    assert len(writing) > 12 and all("-o" in names for names in writing)


@mark.parametrize(
    "page, heading, program",
    [
        ("commands", "| command | result |", group),
        ("checks", "`fourbar-validation` |", harness),
        ("checks", "`fourbar_lab` |", lab),
    ],
)
def test_every_command_is_listed(page, heading, program):
    listed = re.findall("`([a-z-]+)[^`]*`", first_column(page, heading))
    assert sorted(listed) == sorted(commands_of(program))


def anchors(page):
    """Return the anchors of the headings, as GitHub and the site name them."""
    headings = find_lines(r"^#+ (.*)$", read(page).lower())
    return {re.sub(r"[^\w\- ]", "", words).replace(" ", "-") for words in headings}


@mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_every_link_leads_somewhere(page):
    for target in re.findall(r"\]\(([^)\s]+)\)", read(page)):
        if target.startswith("http"):
            continue
        file, _, anchor = target.partition("#")
        to = page.parent / file if file else page
        assert to.is_file(), target
        assert not anchor or anchor in anchors(to), target


def test_the_index_lists_every_page_for_readers_and_for_the_site():
    text = read("docs/index.md")
    pages = {
        page.relative_to(DOCS).as_posix() for page in PAGES if DOCS in page.parents
    } - {"index.md"}
    assert pages == set(re.findall(r"\]\(([^)]+\.md)\)", text))
    trees = "".join(blocks(r"\{toctree\}", text))
    listed = find_lines(r"^(?!:)(?:.* <)?(.*?)>?$", trees)
    assert sorted(pages) == sorted(f"{name}.md" for name in listed if name)


@mark.parametrize("page", sorted(DOCS.rglob("*.md")), ids=lambda page: page.stem)
def test_pages_keep_to_their_length(page):
    assert len(re.findall(r"\S*[^|:\-\s]\S*", read(page))) <= 3200


def test_the_readme_keeps_to_its_length():
    assert len(read("README.md").splitlines()) <= 90


COLUMN, CELL, LETTER, CAPITAL = 830, 27, 8, 3
"""px: the column in which GitHub shows a page, the margins of a cell, a letter, and by
how much a capital is broader.
"""


@mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_no_table_is_wider_than_the_column_of_a_page(page):
    """A cell breaks between words, so its longest word decides."""
    prose = re.sub(r"^(```|\$\$).*?\1$", "", read(page), flags=re.MULTILINE | re.DOTALL)
    text = re.sub(r"\[([^]\n]*)\]\([^)\n]*\)", r"\1", prose)
    for table in find_lines(r"(?:^\|.*\n)+", text):
        head, _, *rows = (line.strip("|").split("|") for line in table.splitlines())
        width = 0
        for column in zip(head, *rows, strict=False):
            width += CELL + max(map(measure_word, " ".join(column).split()), default=0)
        assert width <= COLUMN, head


def measure_word(word):
    return LETTER * len(word) + CAPITAL * sum(map(str.isupper, word))


def test_the_reference_of_the_commands_lists_every_option():
    commands = commands_of(group)
    reference = runpy.run_path(DOCS / "commands.py")["text"]()
    assert find_lines(r"^## (\w+)$", reference) == [*commands]
    described = find_lines(r"^\| `(-.*?)` \|", reference)
    names = {name.split()[0] for row in described for name in row.split(", ")}
    for command in commands.values():
        for option in command.params:
            assert names >= {name for name in option.opts if name[0] == "-"}, option
    assert "None |" not in reference


@mark.slow
def test_the_architecture_names_every_layer_and_no_other():
    uses = runpy.run_path(DOCS / "architecture.py")["uses"]
    for package in ("fourbar", "fourbar_validation"):
        first = first_column("architecture", f"\n## {package}\n\n")
        assert sorted(re.findall(r"`(\w+)/?`", first)) == sorted(uses(package))


def test_the_figure_of_the_theory_is_the_one_that_is_drawn():
    assert read("docs/theory.svg") == runpy.run_path(DOCS / "theory.py")["text"]()


@mark.slow
@mark.parametrize(
    "name, options",
    [
        ("crank_rocker.svg", ()),
        ("crank_rocker-linkage.svg", ("--figure", "linkage")),
        ("bars.svg", ("--figure", "bars")),
    ],
)
def test_the_pictures_are_those_that_are_drawn(name, options, tmp_path):
    """Compare what is written in the pictures.

    Another matplotlib draws other paths.
    """
    scene, drawn = ROOT / "models" / "crank_rocker.toml", tmp_path / "drawn.svg"
    assert status(["plot", str(scene), "-o", str(drawn), *options]) == HOLDS
    words = [re.findall("<!-- (.*) -->", read(path)) for path in (drawn, DOCS / name)]
    assert words[0] == words[1]


@mark.parametrize("path", sorted(DOCS.rglob("*.svg")), ids=lambda path: path.name)
def test_every_figure_has_a_form_for_dark_pages(path):
    assert "prefers-color-scheme" in read(path)


@mark.slow
def test_the_gallery_is_a_suite_with_pictures_and_sources():
    suite = read_suite(GALLERY / "suite.txt")
    names = [suite.name(index) for index in range(8)]
    assert names == sorted(path.stem for path in GALLERY.glob("*.toml"))
    for name in names:
        scene = shown(name)
        assert set(solve(scene, "force").status) == {"ok"}
        assert len(scene.source) > 100
        assert (DOCS / "gallery" / f"{name}.svg").is_file()
        assert f"gallery/{name}.svg" in read("docs/gallery.md")


def shown(name):
    return load(GALLERY / f"{name}.toml")


def test_the_pump_jack_has_a_stroke_of_54_inches():
    assert swing(shown("pump_jack").linkage) * 72.0 == approx(54.0, rel=0.03)


def test_the_cylinder_of_the_bucket_has_the_stroke_of_its_source():
    stroke = solve(shown("excavator_bucket")).stroke
    assert [round(float(end), 1) for end in (stroke.min(), stroke.max())] == [1.3, 2.1]


def test_the_tailgate_has_one_unstable_equilibrium_that_is_held():
    positions = fourbar.equilibrium(shown("tailgate")).found
    (rest,) = [one for one in positions if one.place.branch == -1]
    assert rest.stability == "unstable" and rest.held is not None


def test_the_wiper_goes_60_degrees_to_and_fro_in_the_same_time():
    wiper = shown("wiper").linkage
    assert math.degrees(swing(wiper)) == approx(60.0, rel=1e-8)
    assert fourbar.time_ratio(wiper) == approx(1.0, rel=1e-8)


def test_the_landing_gear_ends_plumb_under_O4():
    first, *_, last = solve(shown("landing_gear")).points["foot"]
    assert first == approx([-0.250962, -0.162331], abs=2e-5)  # D of the source
    assert last == approx([0.654038, -1.067331], abs=3e-4)


def test_the_second_crank_of_the_pump_goes_240_to_375_times_a_minute():
    speed = solve(shown("double_crank_pump")).omega_4 / math.tau * 60.0
    assert (speed.min(), speed.max()) == approx((240.0, 375.0), rel=1e-3)


def test_hoecken_s_curve_is_straight_to_1_5_mm_over_440():
    curve = fourbar.coupler_curve(shown("hoecken").linkage, 0.5, 0.0, steps=720)
    straight = curve.y < 0.4015
    assert straight.mean() > 0.5 and curve.y.min() > 0.3999
    assert np.ptp(curve.x[straight]) > 0.44


def test_the_python_page_goes_to_a_table_of_torque_in_five_lines(capsys):
    program = blocks("python", read("docs/api.md"))[0]
    assert len(list(filter(None, program.splitlines()))) == 5
    names = {}
    exec(program, names)
    table = names["table"]
    assert table.columns.tolist() == ["theta_2", "torque"] and len(table) == 361
    assert "torque" in capsys.readouterr().out
