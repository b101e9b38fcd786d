"""A designer's path in a real browser: from an empty scene to a saved file, numbers equal to `analyze`'s."""

import json
import math
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

import fourbar

pytest.importorskip("selenium", reason="pages are driven by selenium: pip install selenium")
pytest.importorskip("tornado", reason="the workbench is served by tornado: pip install tornado")
pytest.importorskip("tomlkit", reason="the workbench edits scene files by tomlkit: pip install tomlkit")
from selenium.webdriver.common.action_chains import ActionChains
from selenium.webdriver.common.keys import Keys

from fourbar.files import loads

PRINTED = 6e-5
"""Numbers are shown with five significant digits."""
WAIT = 15.0
"""s, for what follows in a few hundredths on an idle machine."""
PIXELS = 4.0
"""px between a pin dropped and its place: the grain, and the browser's own rounding."""


class Opened:
    """The command, and what it says."""

    def __init__(self, path: Path, port: str = "0") -> None:
        command = [sys.executable, "-m", "fourbar", "edit", str(path), "--no-browser", "--port", port]
        self.process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
        assert self.process.stdout is not None
        self.address = self.process.stdout.readline().strip()

    def end(self) -> None:
        self.process.terminate()
        self.process.communicate(timeout=20)


def wait_for(driver, expression: str):
    deadline = time.monotonic() + WAIT
    while not (found := driver.execute_script(f"return {expression};")):
        assert time.monotonic() < deadline, f"{expression} stays {found!r}"
        time.sleep(0.02)
    return found


def type_into(driver, field: str, text: str) -> None:
    entry = driver.find_element("id", field)
    entry.send_keys(Keys.CONTROL, "a")
    entry.send_keys(text)


def drag_pin_B(driver) -> None:
    driver.execute_script(
        "window.scrollTo(0, 0); go(40); held = true"
    )  # the scale stays, as while something is dragged
    before = driver.execute_script("return at(row).B")
    handles = driver.find_elements("css selector", ".handle")
    assert "pin B" in handles[1].get_attribute("aria-label")
    scale = driver.execute_script("return view.k * picture.clientWidth / view.width")
    ActionChains(driver).move_to_element(handles[1]).click_and_hold().move_by_offset(12, -9).move_by_offset(
        8, -11
    ).release().perform()
    wait_for(driver, "!inFlight && !waiting.length && plain.lengths.output !== '220 mm'")
    moved = np.subtract(driver.execute_script("return at(row).B"), before) * scale
    assert moved == pytest.approx([20.0, 20.0], abs=PIXELS)


@pytest.fixture
def opened(chromium, tmp_path: Path):
    chromium.execute_cdp_cmd(
        "Emulation.setDeviceMetricsOverride", {"width": 1280, "height": 900, "deviceScaleFactor": 1, "mobile": False}
    )
    servers = []

    def start(path: Path, port: str = "0") -> Opened:
        servers.append(Opened(path, port))
        return servers[-1]

    yield start
    chromium.get("about:blank")
    for server in servers:
        server.end()
    chromium.get_log("browser")  # of lines that were cut on purpose


@pytest.mark.slow
def test_the_table_of_limits_keeps_its_columns_in_a_narrow_window(chromium, opened, tmp_path: Path) -> None:
    (tmp_path / "a.toml").write_text(fourbar.dump(fourbar.Scene(fourbar.uniform(0.3, 0.1, 0.25, 0.22))))
    chromium.execute_cdp_cmd(
        "Emulation.setDeviceMetricsOverride", {"width": 400, "height": 900, "deviceScaleFactor": 1, "mobile": False}
    )
    chromium.get(opened(tmp_path / "a.toml").address)
    lines = "[...document.querySelectorAll('#summary .columns')]"
    wait_for(chromium, f"{lines}.length")
    told, heights = zip(
        *chromium.execute_script(f"return {lines}.map(e => [e.textContent, e.offsetHeight])"), strict=True
    )
    assert any("limit positions" in line for line in told) and len(told) > 2
    assert len(set(heights)) == 1  # of one line each
    assert chromium.execute_script("return document.documentElement.scrollWidth") <= 400


@pytest.mark.slow
def test_a_designer_goes_from_an_empty_scene_to_a_saved_file(chromium, opened, tmp_path: Path) -> None:
    path, driver = tmp_path / "mine.toml", chromium
    server = opened(path)
    driver.get(server.address)
    wait_for(driver, "offers && document.getElementById('field:lengths/input')")
    type_into(driver, "field:title", "<b>Mine</b><script>alert(1)</script>")
    type_into(driver, "field:lengths/input", "4 in")
    wait_for(driver, "data.lengths[1] === 0.1016")
    type_into(driver, "field:lengths/input", "4 lb")
    # the keys before the last one are refused too, each with a line of its own
    wait_for(driver, "document.getElementById('field:lengths/input!').textContent.includes('does not convert to m')")
    assert driver.find_element("id", "field:lengths/input").get_attribute("aria-invalid") == "true"
    assert driver.execute_script("return data.lengths[1]") == 0.1016
    driver.find_element("id", "field:lengths/input").send_keys(Keys.ESCAPE)
    type_into(driver, "field:bars/coupler/mass", "2 kg")
    wait_for(driver, "plain.bars.coupler.mass === '2 kg'")
    driver.find_element("id", "field:bars/coupler/mass").send_keys(Keys.ARROW_DOWN)
    wait_for(driver, "plain.bars.coupler.mass === '1.99 kg'")
    next(button for button in driver.find_elements("css selector", ".parts button") if button.text == "+ force").click()
    wait_for(driver, "plain.loads?.length === 1 && data.handles.length === 4")
    drag_pin_B(driver)
    wait_for(driver, "'torque_error' in table()")
    assert driver.find_element("id", "compared").text.startswith("peak torque on bar 2")
    assert driver.execute_script("return document.querySelectorAll('#chart .behind').length") == 1
    steps = driver.execute_script("return plain")
    driver.find_element("id", "undo").click()
    wait_for(driver, "plain.lengths.output === '220 mm'")
    driver.find_element("id", "redo").click()
    wait_for(driver, "plain.lengths.output !== '220 mm'")
    assert driver.execute_script("return plain") == steps
    driver.refresh()  # a reload loses nothing
    wait_for(driver, "offers && plain.lengths && 'torque_error' in table()")
    assert driver.execute_script("return plain") == steps and driver.find_element("tag name", "h1").text.startswith(
        "<b>"
    )
    driver.find_element("id", "save").click()
    wait_for(driver, "/^saved|is saved/.test(document.getElementById('bench').textContent)")
    solution = fourbar.solve(loads(path.read_text(), str(path)), "error")
    for row in (0, 90, 217):
        driver.execute_script(f"go({row})")
        shown = [driver.find_element("id", name).text.replace("−", "-") for name in ("torque", "F12_x", "alpha_4")]
        expected = [solution.torque[row], solution.F12[row, 0], solution.alpha_4[row]]
        assert [float(text) for text in shown] == pytest.approx(expected, rel=PRINTED)
    held = json.loads(driver.execute_script("return JSON.stringify(table().torque)"))
    np.testing.assert_array_equal(held, solution.torque)
    cells = driver.find_elements("css selector", "#positions tbody tr:nth-child(4) td")
    cells[2].click()
    assert driver.execute_script("return row") == 30
    assert driver.find_element("id", "theta-text").text == f"{math.degrees(solution.theta_2[30]):.2f}°"
    assert not driver.get_log("browser")


@pytest.mark.slow
def test_undo_takes_a_refused_entry_back_and_leaves_the_last_good_state(chromium, opened, tmp_path: Path) -> None:
    driver = chromium
    driver.get(opened(tmp_path / "mine.toml").address)
    wait_for(driver, "offers && document.getElementById('field:lengths/input')")
    type_into(driver, "field:lengths/input", "110 mm")
    wait_for(driver, "data.lengths[1] === 0.11")
    type_into(driver, "field:lengths/coupler", "240 mm")
    wait_for(driver, "data.lengths[2] === 0.24")
    type_into(driver, "field:lengths/input", "4 lb")
    driver.find_element("id", "field:lengths/input").send_keys(Keys.CONTROL, "z")  # while the refusals are on their way
    entry = "document.getElementById('field:lengths/input')"
    wait_for(driver, f"{entry}.value === '110 mm' && {entry}.getAttribute('aria-invalid') !== 'true'")
    assert driver.execute_script("return data.lengths.slice(1, 3)") == [0.11, 0.24]
    driver.find_element("id", "field:lengths/input").send_keys(Keys.CONTROL, "z")
    wait_for(driver, "data.lengths[2] === 0.25")
    driver.execute_script("document.getElementById('file-text').closest('details').open = true")
    driver.execute_script("document.getElementById('file-text').value = 'lengths = 3'")
    driver.find_element("id", "apply").click()
    wait_for(driver, "document.getElementById('file-text').getAttribute('aria-invalid') === 'true'")
    driver.find_element("id", "undo").click()
    wait_for(driver, "document.getElementById('file-text').value.includes('110 mm')")
    assert driver.execute_script("return data.lengths.slice(1, 3)") == [0.11, 0.25]


@pytest.mark.slow
def test_a_page_whose_line_is_cut_finds_its_server_again(chromium, opened, tmp_path: Path) -> None:
    driver = chromium
    driver.get(opened(tmp_path / "mine.toml").address)
    wait_for(driver, "offers && document.getElementById('field:lengths/input')")
    driver.execute_script("line.close()")
    type_into(driver, "field:lengths/input", "110 mm")
    wait_for(driver, "data.lengths[1] === 0.11")


@pytest.mark.slow
def test_a_stopped_server_is_named_and_a_new_one_goes_on_from_its_state(chromium, opened, tmp_path: Path) -> None:
    path, driver = tmp_path / "mine.toml", chromium
    server = opened(path)
    port = server.address.split("/")[2].partition(":")[2]
    driver.get(server.address)
    wait_for(driver, "offers && document.getElementById('field:lengths/input')")
    type_into(driver, "field:lengths/input", "110 mm")
    wait_for(driver, "data.lengths[1] === 0.11")
    server.end()
    wait_for(driver, "document.getElementById('bench').textContent.includes('The server has stopped')")
    again = opened(path, port)
    assert again.address != server.address  # the token is another one, and the old page is told nothing
    time.sleep(2.0)
    assert driver.execute_script("return line.readyState") != 1
    driver.get(again.address)
    wait_for(driver, "offers && data.lengths[1] === 0.11")
    driver.find_element("id", "undo").click()
    wait_for(driver, "data.lengths[1] === 0.1")
