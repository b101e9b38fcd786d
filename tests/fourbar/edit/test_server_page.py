"""A designer's path in a real browser.

From an empty scene to a saved file, numbers equal to `analyze`'s.
"""

import json
import math
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

import fourbar

pytest.importorskip(
    "selenium",
    reason="pages are driven by selenium: pip install selenium",
)
pytest.importorskip(
    "tornado",
    reason="the workbench is served by tornado: pip install tornado",
)
pytest.importorskip(
    "tomlkit",
    reason="the workbench edits scene files by tomlkit: pip install tomlkit",
)
from selenium.webdriver.common.action_chains import ActionChains
from selenium.webdriver.common.keys import Keys
from selenium.webdriver.support.ui import Select

from fourbar.files import loads
from tests.fourbar.edit.test_server import start

PRINTED = 6e-5
"""Numbers are shown with five significant digits."""
WAIT = 15.0
"""s, for what follows in a few hundredths on an idle machine."""
PIXELS = 4.0
"""px between a pin dropped and its place: the grain, and the browser's own rounding."""


OVERLAPS = """
const boxes = [...picture.querySelectorAll('text')]
  .map(e => [e.textContent, e.getBoundingClientRect()])
  .filter(([words, box]) => words.trim() && box.width);
const found = [];
boxes.forEach(([a, p], n) => boxes.slice(n + 1).forEach(([b, q]) => {
  const wide = Math.min(p.right, q.right) - Math.max(p.left, q.left);
  const high = Math.min(p.bottom, q.bottom) - Math.max(p.top, q.top);
  if (wide > 1.5 && high > 3.5) found.push([a, b]);
}));
return found;
"""
"""Pairs of labels in the picture whose boxes overlap by more than the space around
letters.
"""


SHARE = """
const own = p => [2, 3, 4].filter(k => data.centres[k])
  .map(k => barPoint(p, k, data.centres[k]));
const points = p => data.points.map(point => framed(p, point.bar, point.at));
const P = grid.map((_, i) => at(i)).filter(p => p)
  .flatMap(p => [[0, 0], p.A, p.B, p.O4, ...actingPoints(p), ...own(p), ...points(p)]);
const [wide, high] = [0, 1].map(j =>
  Math.max(...P.map(q => q[j])) - Math.min(...P.map(q => q[j])));
return view.k * Math.max(wide / view.width, high / view.height);
"""
"""Share of the drawing, in its longer direction, that the moving linkage takes."""


AT_REST = "data.summary && data.kept_peaks"
"""True once located peaks and summary have followed."""
SAVED = "/^saved|is saved/.test(document.getElementById('bench').textContent)"
MODELS = Path(__file__).parents[3] / "models"


def wait_for(driver, expression: str):
    deadline = time.monotonic() + WAIT
    while not (value := driver.execute_script(f"return {expression};")):
        assert time.monotonic() < deadline, f"{expression} stays {value!r}"
        time.sleep(0.02)
    return value


def open_scene(driver, address: str) -> None:
    """Open the page; where it is a new scene, with the linkage that it begins with."""
    driver.get(address)
    wait_for(driver, "offers && document.getElementById('field:lengths/input')")
    if driver.execute_script("return Boolean(sketch)"):
        driver.find_element("id", "no-sketch").click()


def type_into(driver, field: str, text: str) -> None:
    entry = driver.find_element("id", field)
    entry.send_keys(Keys.CONTROL, "a")
    entry.send_keys(text)


def resize(driver, width: int) -> None:
    size = {"width": width, "height": 900, "deviceScaleFactor": 1, "mobile": False}
    driver.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)


def click_pins(driver, width: str, *pixels: tuple[float, float]) -> None:
    """Draw O2, A, B and O4 in an empty drawing of a width."""
    type_into(driver, "sketch-width", width)
    picture = driver.find_element("id", "picture")
    middle = picture.size["width"] / 2, picture.size["height"] / 2
    for x, y in pixels:
        off_the_grid = ActionChains(driver).key_down(Keys.SHIFT)
        off_the_grid.move_to_element_with_offset(
            picture, x - middle[0], y - middle[1]
        ).click().key_up(Keys.SHIFT).perform()


def save(driver) -> None:
    driver.find_element("id", "save").click()
    wait_for(driver, SAVED)


def drag_pin_B(driver) -> None:
    driver.execute_script(
        "window.scrollTo(0, 0); go(40); held = true"
    )  # the scale stays, as while something is dragged
    before = driver.execute_script("return at(row).B")
    handles = driver.find_elements("css selector", ".handle")
    assert "pin B" in handles[1].get_attribute("aria-label")
    scale = driver.execute_script("return view.k * picture.clientWidth / view.width")
    ActionChains(driver).move_to_element(handles[1]).click_and_hold().move_by_offset(
        12, -9
    ).move_by_offset(8, -11).release().perform()
    wait_for(
        driver, "!inFlight && !waiting.length && plain.lengths.output !== '220 mm'"
    )
    moved = np.subtract(driver.execute_script("return at(row).B"), before) * scale
    assert moved == pytest.approx([20.0, 20.0], abs=PIXELS)


class Servers:
    """The command for scene files.

    Called, it starts one and returns the address that this prints.
    """

    def __init__(self) -> None:
        self.processes: list[subprocess.Popen] = []

    def __call__(self, path: Path, port: str = "0") -> str:
        self.processes.append(start(path, "--no-browser", "--port", port))
        return self.processes[-1].stdout.readline().strip()

    def end(self) -> None:
        while self.processes:
            process = self.processes.pop()
            process.terminate()
            process.communicate(timeout=20)


@pytest.fixture
def opened(chromium):
    resize(chromium, 1280)
    servers = Servers()
    yield servers
    chromium.get("about:blank")
    servers.end()
    chromium.get_log("browser")  # of lines that were cut on purpose


@pytest.mark.slow
def test_the_table_of_limits_keeps_its_columns_in_a_narrow_window(
    chromium,
    opened,
    tmp_path: Path,
) -> None:
    (tmp_path / "a.toml").write_text(
        fourbar.dump(fourbar.Scene(fourbar.uniform(0.3, 0.1, 0.25, 0.22)))
    )
    resize(chromium, 400)
    chromium.get(opened(tmp_path / "a.toml"))
    lines = "[...document.querySelectorAll('#summary .columns')]"
    wait_for(chromium, f"{lines}.length")
    told, heights = zip(
        *chromium.execute_script(
            f"return {lines}.map(e => [e.textContent, e.offsetHeight])"
        ),
        strict=True,
    )
    assert any("limit positions" in line for line in told) and len(told) > 2
    assert len(set(heights)) == 1  # of one line each
    # so does the table of a check, whose sentences break
    printed = (
        "                     torque        pin forces            motion",
        " free bodies     1.1e-15 of 3e-14  1.1e-15 of 2e-14  9.1e-16 of 2e-14",
        "All 219 comparisons on 1 scene hold",
    )
    kinds = chromium.execute_script(
        "return arguments[0].map(line => lineOf(line).className)", printed
    )
    assert kinds == ["columns", "columns", ""]
    assert chromium.execute_script("return document.documentElement.scrollWidth") <= 400


@pytest.mark.slow
def test_a_designer_goes_from_an_empty_scene_to_a_saved_file(
    chromium,
    opened,
    tmp_path: Path,
) -> None:
    path, driver = tmp_path / "mine.toml", chromium
    open_scene(driver, opened(path))
    type_into(driver, "field:title", "<b>Mine</b><script>alert(1)</script>")
    type_into(driver, "field:lengths/input", "4 in")
    wait_for(driver, "data.lengths[1] === 0.1016")
    type_into(driver, "field:lengths/input", "4 lb")
    # the keys before the last one are refused too, each with a line of its own
    wait_for(
        driver,
        "document.getElementById('field:lengths/input!').textContent.includes('does not"
        " convert to m')",
    )
    assert (
        driver.find_element("id", "field:lengths/input").get_attribute("aria-invalid")
        == "true"
    )
    assert driver.execute_script("return data.lengths[1]") == 0.1016
    driver.find_element("id", "field:lengths/input").send_keys(Keys.ESCAPE)
    type_into(driver, "field:bars/coupler/mass", "2 kg")
    wait_for(driver, "plain.bars.coupler.mass === '2 kg'")
    driver.find_element("id", "field:bars/coupler/mass").send_keys(Keys.ARROW_DOWN)
    wait_for(driver, "plain.bars.coupler.mass === '1.99 kg'")
    next(
        button
        for button in driver.find_elements("css selector", ".parts button")
        if button.text == "+ force"
    ).click()
    wait_for(driver, "plain.loads?.length === 1 && data.handles.length === 4")
    drag_pin_B(driver)
    wait_for(driver, "'torque_error' in table()")
    assert driver.find_element("id", "compared").text.startswith("Peak torque on bar 2")
    assert (
        driver.execute_script(
            "return document.querySelectorAll('#chart .behind').length"
        )
        == 1
    )
    steps = driver.execute_script("return plain")
    driver.find_element("id", "undo").click()
    wait_for(driver, "plain.lengths.output === '220 mm'")
    driver.find_element("id", "redo").click()
    wait_for(driver, "plain.lengths.output !== '220 mm'")
    assert driver.execute_script("return plain") == steps
    driver.refresh()  # a reload loses nothing
    wait_for(driver, "offers && plain.lengths && 'torque_error' in table()")
    assert driver.execute_script("return plain") == steps and driver.find_element(
        "tag name", "h1"
    ).text.startswith("<b>")
    save(driver)
    solution = fourbar.solve(loads(path.read_text(), str(path)), "error")
    for row in (0, 90, 217):
        driver.execute_script(f"go({row})")
        shown = [
            driver.find_element("id", name).text.replace("−", "-")
            for name in ("torque", "F12_x", "alpha_4")
        ]
        expected = [solution.torque[row], solution.F12[row, 0], solution.alpha_4[row]]
        assert [float(text) for text in shown] == pytest.approx(expected, rel=PRINTED)
    held = json.loads(driver.execute_script("return JSON.stringify(table().torque)"))
    np.testing.assert_array_equal(held, solution.torque)
    cells = driver.find_elements("css selector", "#positions tbody tr:nth-child(4) td")
    cells[2].click()
    assert driver.execute_script("return row") == 30
    assert (
        driver.find_element("id", "theta-text").text
        == f"{math.degrees(solution.theta_2[30]):.2f}°"
    )
    assert not driver.get_log("browser")


SHOWN_FIELDS = (
    "[...document.querySelectorAll('.editor :is(input, select, textarea, button)')]"
    ".filter(e => e.checkVisibility())"
)


@pytest.mark.slow
def test_a_linkage_is_drawn_by_four_clicks_and_its_numbers_are_typed_over(
    chromium,
    opened,
    tmp_path: Path,
) -> None:
    path, driver = tmp_path / "mine.toml", chromium
    driver.get(opened(path))
    wait_for(driver, "offers && sketch")
    assert not driver.find_element("id", "bar-2").is_displayed()  # the drawing is empty
    # nor do numbers of a linkage stand beside it that nobody sees
    assert not driver.find_element("id", "strip").is_displayed()
    said = driver.find_element("id", "next-pin").text
    assert said.startswith("Click where pin O2 joins the input to the ground; or")
    on_grid = (
        "const {pixels} = gridOf(), [x, y] = snapped({clientX: 300, clientY: 300})"
    )
    off = f"{on_grid}; return [x - sketch.origin[0], y - sketch.origin[1], pixels]"
    x, y, pixel = driver.execute_script(off)
    assert abs(math.remainder(x, pixel)) + abs(math.remainder(y, pixel)) < 1e-6
    pixels = {"O2": (120, 300), "A": (170, 220), "B": (400, 120), "O4": (380, 330)}
    click_pins(driver, "50 in", *pixels.values())
    scale = 50.0 / driver.find_element("id", "picture").size["width"]
    wait_for(driver, "!sketch && plain.pins?.O4[0].endsWith(' in')")
    pins = {name: complex(x - 120, 300 - y) * scale for name, (x, y) in pixels.items()}
    bars = (pins["O4"], pins["A"], pins["B"] - pins["A"], pins["B"] - pins["O4"])
    stated = {
        name: complex(*(float(text.split()[0]) for text in place))
        for name, place in driver.execute_script("return plain.pins").items()
    }
    for name, pin in pins.items():
        vector = stated[name] - stated["O2"]
        assert vector == pytest.approx(pin, abs=PIXELS * scale)
    lengths = driver.execute_script("return data.lengths")
    assert [length / 0.0254 for length in lengths] == pytest.approx(
        [abs(bar) for bar in bars],
        abs=PIXELS * scale,
    )
    shown = driver.execute_script(
        "const p = at(row); return [p.A, p.B]"
    )  # the position shown is the one drawn
    for place, pin in zip(shown, ("A", "B"), strict=True):
        assert complex(*place) / 0.0254 == pytest.approx(
            pins[pin],
            abs=2 * PIXELS * scale,
        )
    assert "lbf" in driver.find_element("id", "forces").text  # results follow the file
    assert not driver.find_elements("id", "field:lengths/input")  # the pins state them
    coordinates = (
        driver.find_element("id", f"field:pins/A/{n}").accessible_name for n in (0, 1)
    )
    assert [*coordinates] == ["x", "y"]
    # a linkage keeps its four pins: none can be removed
    assert not driver.find_elements("xpath", "//button[.='Remove A']")
    type_into(driver, "field:pins/A/1", "6 in")
    typed = 0.0254 * abs(complex(stated["A"].real, 6.0) - stated["O2"])
    wait_for(driver, f"Math.abs(data.lengths[1] - {typed!r}) < 1e-12")
    driver.find_element("id", "sketch").click()
    wait_for(driver, "sketch")
    driver.find_element("id", "no-sketch").click()
    wait_for(driver, "!sketch && document.getElementById('bar-2').checkVisibility()")
    driver.find_element("id", "sketch").click()
    type_into(driver, "sketch-width", "2 m")
    for place in (
        "0, 0",
        "nowhere",
        "0, 0.125",
        "1.5 0.5",
        "1.25; -0.25",
    ):  # as they stand in somebody's drawing
        type_into(driver, "pin-xy", place + Keys.ENTER)
    wait_for(driver, "!sketch && Math.abs(data.lengths[1] - 0.125) < 1e-6")
    expected = [
        math.hypot(1.25, 0.25),
        0.125,
        math.hypot(1.5, 0.375),
        math.hypot(0.25, 0.75),
    ]
    assert driver.execute_script("return data.lengths") == pytest.approx(
        expected,
        abs=2e-6,
    )
    assert not driver.get_log("browser")


@pytest.mark.slow
def test_a_designer_draws_a_cylinder_drive_and_analyze_gives_the_same(
    chromium,
    opened,
    tmp_path: Path,
) -> None:
    path, driver = tmp_path / "mine.toml", chromium
    driver.get(opened(path))
    wait_for(driver, "offers && sketch")
    click_pins(driver, "1000 mm", (120, 300), (170, 180), (400, 120), (380, 330))
    wait_for(driver, "!sketch && plain.pins")
    type_into(driver, "field:bars/output/mass", "80 kg")
    wait_for(driver, "plain.bars.output.mass === '80 kg'")
    driver.find_element("xpath", "//button[.='+ cylinder in place of the bar']").click()
    wait_for(
        driver, "plain.drive.from && document.getElementById('field:drive/from/bar')"
    )
    driver.find_element(
        "xpath", "//fieldset[legend='from']//button[.='By x and y']"
    ).click()
    wait_for(driver, "plain.drive.from.from_pin.x")
    for name, value in (("x", "300 mm"), ("y", "-250 mm")):
        type_into(driver, f"field:drive/from/from_pin/{name}", value)
        wait_for(driver, f"plain.drive.from.from_pin.{name} === '{value}'")
    driver.find_element("css selector", "#command option[value=stroke]").click()
    wait_for(
        driver,
        "plain.motion.stroke && data.over.name === 'stroke' && 'drive_force_error' in"
        " table()",
    )
    driver.execute_script("go(17)")
    force = float(driver.find_element("id", "drive_force").text.replace("−", "-"))
    type_into(driver, "pressure", "210 bar" + Keys.ENTER)
    wait_for(
        driver,
        "document.getElementById('summary').textContent.includes('bore     at least')",
    )
    summary = driver.find_element("id", "summary").text
    save(driver)
    scene = fourbar.load(path)
    assert scene.drive is not None and scene.effects and scene.motion.stroke is not None
    assert 'from_pin = {x = "300 mm", y = "-250 mm"}' in path.read_text()
    solution, stroke = (
        fourbar.solve(scene),
        driver.execute_script("return data.over.values[17]"),
    )
    assert force == pytest.approx(
        solution.drive_force[np.abs(solution.stroke - stroke).argmin()],
        rel=PRINTED,
    )
    command = [
        sys.executable,
        "-m",
        "fourbar",
        "analyze",
        str(path),
        "--pressure",
        "210 bar",
    ]
    printed = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    assert (
        " ".join(summary.split()).startswith(" ".join(printed.split()))
        and "cylinder" in printed
    )
    assert not driver.get_log("browser")


@pytest.mark.slow
def test_the_keyboard_alone_draws_types_drags_undoes_and_saves(
    chromium,
    opened,
    tmp_path: Path,
) -> None:
    path, driver = tmp_path / "mine.toml", chromium
    driver.get(opened(path))
    wait_for(driver, "offers && sketch && document.activeElement === picture")

    def press(*keys: str) -> None:
        ActionChains(driver).send_keys(*keys).perform()

    def with_control(key: str) -> None:
        ActionChains(driver).key_down(Keys.CONTROL).send_keys(key).key_up(
            Keys.CONTROL
        ).perform()

    def tab_to(goal: str) -> None:
        for _ in range(200):
            if driver.execute_script(
                f"return document.activeElement.matches({goal!r})"
            ):
                return
            press(Keys.TAB)
        raise AssertionError(f"{goal} is not reached by Tab")

    press(
        Keys.ENTER,
        *[Keys.ARROW_UP] * 5,
        Keys.ENTER,
        *[Keys.ARROW_RIGHT] * 14,
        *[Keys.ARROW_UP] * 6,
        Keys.ENTER,
    )
    press(*[Keys.ARROW_DOWN] * 12, Keys.ENTER)
    wait_for(driver, "!sketch && plain.pins")
    lengths = driver.execute_script("return data.lengths")
    driver.execute_script("document.activeElement.blur(); window.scrollTo(0, 0)")
    reached = set()
    for _ in range(200):  # every field and button of the editor, in turn
        press(Keys.TAB)
        reached.add(
            driver.execute_script(
                "return document.activeElement.id || document.activeElement.textContent"
            )
        )
        if driver.execute_script(
            "return document.activeElement === document.querySelector('.editor"
            " > details > summary')"
        ):
            break
    missing = driver.execute_script(
        f"return {SHOWN_FIELDS}.filter(e => !e.disabled && e.id !== 'file-text').map(e"
        " => e.id || e.textContent)"
    )
    assert set(missing) - reached == {""} - reached
    driver.execute_script("document.activeElement.blur()")
    tab_to("[id='field:bars/coupler/mass']")
    with_control("a")
    press("2 kg")
    wait_for(driver, "plain.bars.coupler.mass === '2 kg'")
    press(Keys.ARROW_UP)
    wait_for(driver, "plain.bars.coupler.mass === '2.01 kg'")
    assert not driver.find_elements("id", "field:motion/branch")  # the pins state it
    tab_to("[id='field:drive/bar']")
    press(Keys.ARROW_DOWN)
    wait_for(driver, "plain.drive?.bar")
    tab_to(".handle[aria-label^='pin B']")
    before = driver.execute_script("return plain.pins.B[0]")
    press(Keys.ARROW_RIGHT)
    wait_for(driver, f"plain.pins.B[0] !== {before!r}")
    with_control("z")
    wait_for(driver, f"plain.pins.B[0] === {before!r}")
    assert driver.execute_script("return data.lengths") == lengths
    with_control("s")
    wait_for(driver, SAVED)
    assert fourbar.load(path).linkage.coupler.mass == 2.01


@pytest.mark.slow
def test_each_label_is_what_a_screen_reader_says_and_each_choice_a_list(
    chromium,
    opened,
    tmp_path: Path,
) -> None:
    path, driver = tmp_path / "bucket.toml", chromium
    path.write_text((MODELS / "gallery" / "excavator_bucket.toml").read_text())
    open_scene(driver, opened(path))
    visible = (
        "e => [...e.labels].map(l => [...l.childNodes]"
        ".filter(n => n.nodeType === 3).map(n => n.data).join('')).join()"
    )
    for command in ("theta_2", "stroke"):
        if command == "stroke":
            driver.find_element("css selector", "#command option[value=stroke]").click()
            wait_for(
                driver,
                "plain.motion.stroke && document.getElementById('field:motion/side')",
            )
        entries = driver.find_elements("css selector", "#fields :is(input, select)")
        words = driver.execute_script(f"return arguments[0].map({visible})", entries)
        assert len(entries) > 20 and all(words)
        for entry, word in list(zip(entries, words, strict=True))[::3]:
            assert entry.accessible_name == word
        ids = [entry.get_attribute("id") for entry in entries]
        lists = {
            name.rpartition("/")[2]
            for entry, name in zip(entries, ids, strict=True)
            if entry.tag_name == "select"
        }
        assert {"branch", "bar", "frame"} <= lists and not any(
            name.endswith("theta_2") for name in ids if command != "theta_2"
        )
        if command == "stroke":  # what does not apply is not there
            assert "side" in lists and not {
                "field:motion/omega_2",
                "field:motion/through",
                "field:drive/bar",
            } & {*ids}
            assert not driver.find_elements(
                "xpath",
                "//button[.='+ sweep' or .='+ released' or .='+ law over time']",
            )
    side = driver.find_element("id", "field:motion/side")
    assert [option.text for option in side.find_elements("tag name", "option")] == [
        "left",
        "right",
    ]
    assert len(driver.find_elements("css selector", "#units option")) > 5


@pytest.mark.slow
def test_it_opens_in_the_middle_with_a_linkage_that_fills_half_and_labels_apart(
    chromium,
    opened,
    tmp_path: Path,
) -> None:
    driver = chromium
    for model in (
        "crank_rocker",
        "gallery/excavator_bucket",
        "gallery/tailgate",
        "gallery/landing_gear",
    ):
        path = tmp_path / f"{model.rpartition('/')[2]}.toml"
        path.write_text((MODELS / f"{model}.toml").read_text())
        address = opened(path)
        for width in (1440, 390):
            resize(driver, width)
            driver.get(address)
            wait_for(driver, "data.summary")
            rows = driver.execute_script("return [row, grid.length]")
            assert abs(rows[0] - rows[1] / 2) <= 1, model
            assert driver.find_element("id", "compared").text == ""  # nothing changed
            assert driver.execute_script(SHARE) >= 0.5, model
            for row in range(0, rows[1], rows[1] // 8):
                driver.execute_script(f"go({row})")
                assert driver.execute_script(OVERLAPS) == [], (model, row)
            wide = driver.execute_script("return document.documentElement.scrollWidth")
            assert wide <= width


@pytest.mark.slow
def test_undo_takes_a_refused_entry_back_and_leaves_the_last_good_state(
    chromium,
    opened,
    tmp_path: Path,
) -> None:
    driver = chromium
    open_scene(driver, opened(tmp_path / "mine.toml"))
    type_into(driver, "field:lengths/input", "110 mm")
    wait_for(driver, "data.lengths[1] === 0.11")
    type_into(driver, "field:lengths/coupler", "240 mm")
    wait_for(driver, "data.lengths[2] === 0.24")
    type_into(driver, "field:lengths/input", "4 lb")
    driver.find_element("id", "field:lengths/input").send_keys(
        Keys.CONTROL, "z"
    )  # while the refusals are on their way
    entry = "document.getElementById('field:lengths/input')"
    wait_for(
        driver,
        f"{entry}.value === '110 mm' && {entry}.getAttribute('aria-invalid') !=="
        " 'true'",
    )
    assert driver.execute_script("return data.lengths.slice(1, 3)") == [0.11, 0.24]
    driver.find_element("id", "field:lengths/input").send_keys(Keys.CONTROL, "z")
    wait_for(driver, "data.lengths[2] === 0.25")
    driver.execute_script(
        "document.getElementById('file-text').closest('details').open = true"
    )
    driver.execute_script("document.getElementById('file-text').value = 'lengths = 3'")
    driver.find_element("id", "apply").click()
    wait_for(
        driver,
        "document.getElementById('file-text').getAttribute('aria-invalid') === 'true'",
    )
    driver.find_element("id", "undo").click()
    wait_for(driver, "document.getElementById('file-text').value.includes('110 mm')")
    assert driver.execute_script("return data.lengths.slice(1, 3)") == [0.11, 0.25]


@pytest.mark.slow
def test_a_page_finds_its_server_again_and_a_new_one_goes_on_from_the_state(
    chromium,
    opened,
    tmp_path: Path,
) -> None:
    path, driver = tmp_path / "mine.toml", chromium
    server = opened(path)
    open_scene(driver, server)
    driver.execute_script("line.close()")
    type_into(driver, "field:lengths/input", "110 mm")
    wait_for(driver, "data.lengths[1] === 0.11")
    opened.end()
    wait_for(
        driver,
        "document.getElementById('bench').textContent.includes('The server has"
        " stopped')",
    )
    again = opened(path, server.split("/")[2].partition(":")[2])
    assert again != server  # the token is another one, and the old page is told nothing
    time.sleep(2.0)
    assert driver.execute_script("return line.readyState") != 1
    driver.get(again)
    wait_for(driver, "offers && data.lengths[1] === 0.11")
    driver.find_element("id", "undo").click()
    wait_for(driver, "data.lengths[1] === 0.1")


@pytest.mark.slow
def test_a_refused_entry_stays_with_its_message_when_tab_follows_at_once(
    chromium,
    opened,
    tmp_path: Path,
) -> None:
    driver = chromium
    open_scene(driver, opened(tmp_path / "mine.toml"))
    type_into(driver, "field:lengths/input", f"4 lb{Keys.TAB}")
    entry = "document.getElementById('field:lengths/input')"
    wait_for(driver, f"{entry}.getAttribute('aria-invalid') === 'true'")
    # the half-typed "4" is refused too, in other words
    message = "document.getElementById('field:lengths/input!').innerText"
    wait_for(driver, f"{message}.includes('does not convert to m')")
    words = driver.find_element("id", "field:lengths/input!").text
    type_into(driver, "field:lengths/coupler", f"260 mm{Keys.TAB}")
    wait_for(driver, "data.lengths[2] === 0.26")
    buttons = driver.find_elements("css selector", ".parts button")
    next(button for button in buttons if button.text == "+ force").click()
    wait_for(driver, "plain.loads?.length === 1")  # the fields are built anew
    assert driver.execute_script(f"return {entry}.value") == "4 lb"
    assert driver.find_element("id", "field:lengths/input!").text == words
    type_into(driver, "field:lengths/input", f"110 mm{Keys.TAB}")
    wait_for(driver, "data.lengths[1] === 0.11")
    assert not driver.find_element("id", "field:lengths/input!").is_displayed()


@pytest.mark.slow
def test_a_strip_beside_the_drawing_tells_the_largest_numbers_and_a_change_of_type(
    chromium,
    opened,
    tmp_path: Path,
) -> None:
    driver = chromium
    open_scene(driver, opened(tmp_path / "mine.toml"))
    wait_for(driver, AT_REST)
    drive, pins, _ = driver.find_element("id", "strip").text.split("; ")
    summary = " ".join(driver.find_element("id", "summary").text.split())
    assert f"torque {drive.replace(' torque', '')} at" in summary
    assert pins.removeprefix("largest pin force ").split(" at ")[0] in summary
    assert not driver.find_element("id", "type-change").is_displayed()
    type_into(driver, "field:lengths/input", f"290 mm{Keys.TAB}")
    wait_for(driver, "!document.getElementById('type-change').hidden")
    said = driver.find_element("id", "type-change").text
    assert said.startswith("The type has changed from crank-rocker to ")
    changed = "document.getElementById('strip').textContent.split(';')[0]"
    wait_for(driver, f"{changed} !== {json.dumps(drive)}")


@pytest.mark.slow
def test_choosing_another_commanded_angle_keeps_the_position(
    chromium,
    opened,
    tmp_path: Path,
) -> None:
    driver = chromium
    open_scene(driver, opened(tmp_path / "mine.toml"))
    driver.execute_script("go(nearest(2.0))")
    choose = "const s = document.getElementById('command'); s.value = 'theta_4'; "
    driver.execute_script(choose + "s.dispatchEvent(new Event('change'))")
    wait_for(driver, "plain.motion.theta_4 && data.over.commanded === 'theta_4'")
    speed = driver.execute_script("return plain.motion.omega_4")
    assert speed.endswith(" rpm")  # as the file stated it
    assert driver.execute_script("return grid[row]") == pytest.approx(2.0, abs=0.03)


@pytest.mark.slow
def test_no_number_of_the_scene_is_cut_off_in_its_field(
    chromium,
    opened,
    tmp_path: Path,
) -> None:
    """The pump-jack states a ground of 98.595131725659 in, which no half line holds."""
    path, driver = tmp_path / "pump.toml", chromium
    path.write_text((MODELS / "gallery" / "pump_jack.toml").read_text())
    cut_off = (
        "[...document.querySelectorAll('#fields input')].filter(e => e.value"
        " && e.id !== 'field:source' && e.scrollWidth > e.clientWidth).map(e => e.id)"
    )
    address = opened(path)
    for width, typed in ((1440, "24.0000000000001 in"), (400, "24.0000000000002 in")):
        resize(driver, width)
        open_scene(driver, address)
        ground = driver.find_element("id", "field:lengths/ground")
        assert ground.get_attribute("value") == "98.595131725659 in"
        assert driver.execute_script(f"return {cut_off}") == []
        type_into(driver, "field:lengths/input", f"{typed}{Keys.TAB}")
        wait_for(driver, f"plain.lengths.input === '{typed}'")
        wait_for(driver, f"!{cut_off}.length")


@pytest.mark.slow
def test_a_change_beyond_ten_times_is_no_percentage(
    chromium,
    opened,
    tmp_path: Path,
) -> None:
    driver = chromium
    open_scene(driver, opened(tmp_path / "mine.toml"))
    said = driver.execute_script(
        "return [changeOf(1, 8835.11), changeOf(2, 3), changeOf(2, 1.9),"
        " changeOf(1e-17, 1), changeOf(0, 1)]"
    )
    assert said == [" (8.84e3 times)", " (+50\u00a0%)", " (\u22125.0\u00a0%)", "", ""]


PHOTO = {"O2": (800, 1500), "A": (1000, 1150), "B": (1900, 900), "O4": (2200, 1500)}
"""Pixels of the pins in a photo whose pixels are 0.25 mm."""
MORE = {"P": (1300, 700), "Q": (1940, 940)}
"""Pixels of a point of the coupler, and of a place where B lies rather."""
CLICKS = 2.0
"""px between two clicks: each is off by one, as the driver points at whole ones."""


@pytest.mark.slow
def test_a_photo_is_traced_to_a_scene(chromium, opened, tmp_path: Path) -> None:
    from PIL import Image

    driver = chromium
    noise = Image.effect_noise((3000, 2000), 60.0).convert("RGB")
    noise.save(tmp_path / "photo.jpg", quality=97)  # larger than a request
    driver.get(opened(tmp_path / "mine.toml"))
    wait_for(driver, "offers && sketch")
    driver.find_element("id", "picture-file").send_keys(str(tmp_path / "photo.jpg"))
    wait_for(driver, "data.traced && tracedSize && sketch")
    share = driver.execute_script("return tracedSize[0]") / 3000.0
    picture = driver.find_element("id", "picture")

    def click(pin: str) -> None:
        pixel = [share * x for x in (PHOTO | MORE)[pin]]
        x, y = driver.execute_script("return toScreen(ofPixel(arguments[0]))", pixel)
        from_middle = x - picture.size["width"] / 2, y - picture.size["height"] / 2
        chain = ActionChains(driver)
        chain.move_to_element_with_offset(picture, *from_middle).click().perform()

    def place(what: str, pixel: str) -> None:
        Select(driver.find_element("id", "place")).select_by_value(what)
        click(pixel)
        wait_for(driver, "!aimed && !inFlight && !waiting.length")

    apart = 1400.0 * share * driver.execute_script("return view.k * tracedScale()")
    driver.find_element("id", "measure").click()
    click("O2")
    click("O4")
    driver.switch_to.alert.send_keys("35 cm")
    driver.switch_to.alert.accept()
    wait_for(driver, "data.traced.scale && sketch")  # the drawing goes on
    scale = driver.execute_script("return data.traced.scale") * share
    assert scale == pytest.approx(0.25e-3, rel=CLICKS / apart)
    for pin in PHOTO:
        click(pin)
    wait_for(driver, "plain.pins?.O4[0].endsWith(' cm') && at(row)")
    lengths = driver.execute_script("return data.lengths")
    for length, (one, other) in zip(
        lengths, (("O2", "O4"), ("O2", "A"), ("A", "B"), ("B", "O4")), strict=True
    ):
        true = 0.25e-3 * math.dist(PHOTO[one], PHOTO[other])
        off = (
            CLICKS * driver.execute_script("return 1 / view.k") + true * CLICKS / apart
        )
        assert length == pytest.approx(true, abs=off), (one, other)
    place("a new point of the coupler", "P")
    off = driver.execute_script(
        "const {bar, at: place} = data.points[0], p = toScreen(framed(at(row), bar,"
        " place)), q = toScreen(ofPixel(arguments[0])); return Math.hypot(p[0] - q[0],"
        " p[1] - q[1])",
        [share * x for x in MORE["P"]],
    )
    assert off < PIXELS
    place("pin B", "Q")
    for pin, (x, y) in (PHOTO | {"B": MORE["Q"]}).items():  # it lies on the picture
        off = driver.execute_script(
            "const p = toScreen(at(row)[arguments[0]]), q ="
            " toScreen(ofPixel(arguments[1])); return Math.hypot(p[0] - q[0], p[1] -"
            " q[1])",
            pin,
            [share * x, share * y],
        )
        assert off < PIXELS, pin
    save(driver)
    scene = fourbar.load(tmp_path / "mine.toml")
    assert scene.picture is not None and scene.picture.name == "mine.jpg"


@pytest.mark.slow
def test_what_one_drags_for_is_seen_without_a_scroll(
    chromium,
    opened,
    tmp_path: Path,
) -> None:
    driver = chromium
    path = tmp_path / "mine.toml"
    path.write_text((MODELS / "crank_rocker.toml").read_text())
    size = {"width": 1024, "height": 700, "deviceScaleFactor": 1, "mobile": False}
    driver.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
    driver.get(opened(path))
    wait_for(driver, AT_REST)
    for name in ("picture", "chart", "forces", "torque", "strip"):
        bottom = f"document.getElementById('{name}').getBoundingClientRect().bottom"
        assert driver.execute_script(f"return {bottom}") <= 700, name
    size |= {"width": 400, "height": 800}
    driver.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
    driver.get(driver.current_url)
    wait_for(driver, AT_REST)
    driver.execute_script("scrollTo(0, document.documentElement.scrollHeight)")
    for name in ("undo", "save"):
        box = driver.find_element("id", name).rect
        top = box["y"] - driver.execute_script("return scrollY")
        assert 0 <= top <= 800 - box["height"], name
    assert driver.execute_script("return document.documentElement.scrollHeight") < 4000


@pytest.mark.slow
def test_a_path_stays_as_a_target_with_the_dead_centres_of_both(
    chromium,
    opened,
    tmp_path: Path,
) -> None:
    driver = chromium
    lengths = {"ground": 300, "input": 100, "coupler": 250, "output": 220}
    rows = "\n".join(f'{name} = "{value} mm"' for name, value in lengths.items())
    (tmp_path / "a.toml").write_text(f"[lengths]\n{rows}\n")
    driver.get(opened(tmp_path / "a.toml"))
    wait_for(driver, "offers && document.getElementById('field:lengths/input')")

    def list_marks(kind: str) -> list[list[float]]:
        return driver.execute_script(
            "return [...document.querySelectorAll(arguments[0])].map(e => ["
            "(e.getBBox().x + e.getBBox().width / 2 - view.x) / view.k,"
            " (view.y - e.getBBox().y - e.getBBox().height / 2) / view.k])",
            kind,
        )

    def find_dead_centres() -> list[tuple[float, float]]:
        """Middles of the coupler where it lies in line with the input."""
        d, a, b, c = driver.execute_script("return data.lengths")
        middles = []
        for reach, along in ((b + a, a + 0.5 * b), (b - a, 0.5 * b - a)):
            angle = math.acos((d * d + reach * reach - c * c) / (2.0 * d * reach))
            middles.append((along * math.cos(angle), along * math.sin(angle)))
        return sorted(middles)

    before = find_dead_centres()
    pixel = 1.0 / driver.execute_script("return view.k")
    np.testing.assert_allclose(sorted(list_marks(".mark")), before, atol=pixel)
    type_into(driver, "field:lengths/output", "235 mm")
    wait_for(driver, "data.lengths[3] === 0.235 && !inFlight && !waiting.length")
    kept, shown = list_marks(".mark.behind"), list_marks(".mark:not(.behind)")
    np.testing.assert_allclose(sorted(kept), before, atol=pixel)
    np.testing.assert_allclose(sorted(shown), find_dead_centres(), atol=pixel)


@pytest.mark.slow
def test_a_force_that_grows_between_the_positions_is_said_beside_its_curve(
    chromium,
    opened,
    tmp_path: Path,
) -> None:
    """The cylinder's stroke stands still twice in a turn, at no position of these."""
    cylinder = (
        'from = { bar = 1, from_pin = ["100 mm", "-60 deg"] }\n'
        'to = { bar = 4, from_pin = ["80 mm", "0 deg"] }\n'
    )
    text = (MODELS / "crank_rocker.toml").read_text().replace("bar = 2\n", cylinder)
    (tmp_path / "a.toml").write_text(text)
    chromium.get(opened(tmp_path / "a.toml"))
    wait_for(chromium, AT_REST)
    assert chromium.execute_script("return data.peaks.drive_force") is None
    for name in ("strip", "chart-note"):
        told = chromium.find_element("id", name).text
        assert "grows without bound" in told, name
