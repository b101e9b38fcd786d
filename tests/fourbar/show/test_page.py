"""The moving page in a real browser, against the formulas in Python."""

import base64
import re
from dataclasses import replace
from math import atan2, cos, degrees, pi, remainder, sin
from time import monotonic, sleep

import numpy as np
from numpy.testing import assert_allclose
from pytest import approx, fixture, mark

import fourbar
from fourbar import Motion, Place, Scene, Sweep, Tolerance, solve, uniform, units
from fourbar.files import loads
from fourbar.show import animate
from fourbar.show.duty import compute_energies
from fourbar.show.tolerances import PAGE_SAMPLES
from fourbar_validation.places import MODELS
from tests.fourbar.show.test_animate import HOSTILE, PNG, RELEASED
from tests.support.scenes import CYLINDER, RESTING, crank_rocker, thesis

PRINTED = 6e-5
"""Numbers are shown with five significant digits."""


PRINTED_DEG = 6e-4
"""Angles are shown with three decimals of a degree."""


PIXEL = 0.01
"""Coordinates in the picture are exact but for rounding; a hundredth of a pixel is far
below what is seen.
"""


BACKGROUND = "getComputedStyle(document.body).backgroundColor"


def number(text):
    return float(text.replace("−", "-"))


class Page:
    """A page in the browser; its elements are items by their id."""

    def __init__(self, driver):
        self.driver = driver
        self.run = driver.execute_script

    def __getitem__(self, name):
        return self.driver.find_element("id", name)

    def state(self, expression):
        return self.run(f"return {expression};")

    def list(self, selector):
        return self.driver.find_elements("css selector", selector)

    def numbers(self, *names):
        return [number(self[name].text) for name in names]

    def print(self):
        self.driver.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": "print"})

    def pins(self):
        """The pins as drawn, in lengths of the ground from O2 and in its axes."""
        script = """
            const place = name => {
              const e = document.getElementById("pin-" + name);
              return [name, ["cx", "cy"].map(k => Number(e.getAttribute(k)))];
            };
            return Object.fromEntries(["O2", "A", "B", "O4"].map(place));
        """
        points = {name: np.array([x, -y]) for name, (x, y) in self.run(script).items()}
        return {name: point - points["O2"] for name, point in points.items()}

    def require(self, s, row, *names):
        """The page shows these numbers of a position, and draws A and B there."""
        for name in names:
            quantity, _, axis = name.partition("_" if name[0] == "F" else " ")
            value = s[quantity][row]
            if axis:
                value = value["xy".index(axis)]
            expected = approx(value, rel=PRINTED)
            if name.startswith("theta"):
                expected = approx(degrees(value), abs=PRINTED_DEG)
            assert self.numbers(name) == [expected], name
        drawn = self.pins()
        scale = np.hypot(*drawn["O4"]) / s.scene.linkage.ground
        for pin in ("A", "B"):
            assert_allclose(drawn[pin], scale * s[pin][row], atol=PIXEL)

    def play(self, ticks):
        """Play without waiting: frames 50 ms apart, and the row after each."""
        script = """
            window.requestAnimationFrame = () => 0;
            play(true);
            const rows = [];
            for (let i = 0; i < arguments[0]; i++) {
              frame(50 * i);
              rows.push(row);
            }
            play(false);
            return rows;
        """
        return self.run(script, ticks)


@fixture
def show(browse):
    """Opens the page of a scene."""

    def open_page(scene, *width, dark=False, still=False, **options):
        text = animate.write_page(scene, **options)
        return Page(browse(text, *width, dark=dark, still=still))

    return open_page


POINTS = """
const points = e => [...e.getAttribute("d").matchAll(/[ML]([^ ]+) ([^ML]+)/g)]
  .map(m => [Number(m[1]), Number(m[2])]);
"""
"""Script of the points of a path, px."""


@mark.slow
def test_numbers_are_shown_in_the_units_of_the_page(show):
    scene = crank_rocker()
    page = show(scene, units=units("mm kN N.mm rpm"))
    s = solve(scene)
    expected = [s.torque[0] * 1e3, s.F43[0, 0] * 1e-3, s.omega_4[0] * 30.0 / pi]
    assert page.numbers("torque", "F43_x", "omega_4") == approx(expected, rel=PRINTED)
    text = page.list("body")[0].text
    for unit in ("N mm", "kN", "rpm", "rad/s²"):
        assert unit in text
    options = page.list("#quantity option")
    names = {"torque on bar 2, N mm", "|F₁₂|, kN", "acceleration of G₄, mm/s²"}
    assert names <= {option.text for option in options}
    assert len(page.list("#traces .b2, #traces .b4")) == 2
    texts = page.list("#chart text")[-3:]
    top = max(number(text.text) for text in texts if text.text)
    assert top == approx(1e3 * s.torque.max(), rel=0.01)


@fixture
def turning(show):
    """The page of the crank-rocker, and its solution."""
    return show(crank_rocker()), solve(crank_rocker())


def test_each_step_and_each_branch_shows_the_numbers_of_its_position(turning):
    page, s = turning
    assert page.driver.title == "crank-rocker"
    angles = ("theta_2", "theta_3", "theta_4", "omega_3", "alpha_4")
    forces = ("torque", "F12_x", "F43_x", "F14_y", "F32_y")
    for row in (0, 1, 2, 3):
        page.require(s, row, *angles, *forces)
        page["forward"].click()
    page["back"].click()
    page.require(s, 3, "torque")
    assert page.state("fixed(-1e-9, 2) + fixed(-1.5, 1)") == "0.00−1.5"
    assert "torque" in page.state("document.getElementById('live').textContent")
    page.run("chooseBranch(-1)")
    crossed = s.scene.motion.replace(branch=-1)
    page.require(solve(replace(s.scene, motion=crossed)), 3, *forces)


@mark.slow
def test_play_moves_the_linkage_and_pause_leaves_true_numbers(turning):
    page, s = turning
    start = page.pins()["A"]
    page["play"].click()
    assert page["play"].text == "Pause"
    deadline = monotonic() + 10.0
    while page.state("row") < 4:
        assert monotonic() < deadline, "the linkage does not move"
    page["play"].click()
    assert np.hypot(*(page.pins()["A"] - start)) > 10
    page.require(s, page.state("row"), "torque", "omega_4")


@mark.slow
def test_an_input_that_turns_fully_goes_round(show):
    rows = show(crank_rocker()).play(241)  # 12 s: two sweeps
    assert set(range(60)) <= set(rows) <= set(range(61))
    assert sum(np.diff(rows) < 0) == 2


@mark.slow
def test_an_input_that_does_not_turn_fully_swings(show):
    scene = thesis(Sweep(0.0, 2 * pi, 180))
    page = show(scene)
    # less than a row per frame
    page.run("go(100); document.getElementById('speed').value = '0.5'")
    rows = page.play(600)
    closes = np.flatnonzero(solve(scene).assembled[10:]) + 10
    assert (min(rows), max(rows)) == (closes[0], closes[-1])
    assert abs(np.diff(rows)).max() <= 1  # it never jumps


@mark.slow
def test_a_free_motion_plays_once_in_its_own_time(show):
    page = show(RELEASED)
    s = solve(RELEASED)
    # it has one branch: no key promises another, and none takes the linkage away
    for name in ("branch", "torque", "branch-key"):
        assert not page[name].is_displayed(), name
    page["picture"].send_keys("b")
    assert page.state("branch") == 1
    rows = page.play(20)  # 0.95 s: the first frame starts the clock
    assert_allclose(s.time[rows], 0.05 * np.arange(20), atol=0.011)  # half a row
    assert page.play(41)[-1] == 90 and not page.state("playing")
    page.run("go(37)")
    assert page["theta-text"].text == "0.740 s"
    assert page["theta"].get_attribute("aria-valuetext") == "0.740 seconds"
    page.require(s, 37, "omega_2", "alpha_4")
    kinetic = compute_energies(RELEASED, s).kinetic[37]
    assert page.numbers("energy") == approx([kinetic], rel=PRINTED)


@mark.slow
@mark.parametrize(
    "motion, place, over, pace",
    [
        (
            Motion(stroke=Sweep(0.17, 0.33, 40), stroke_speed=0.2, side="left"),
            "250.00 mm",
            "Over stroke",
            "stroke speed = 0.2 m/s the mechanism",
        ),
        (
            Motion(theta_4=Sweep(1.75, 2.95, 40), omega_4=4.0),
            "134.65°",
            "Over θ₄",
            "ω₄ = 4 rad/s the mechanism takes 0.3 s",
        ),
    ],
)
def test_another_command_is_the_axis_and_the_linkage_follows(
    show, motion, place, over, pace
):
    """The ends of the sweep of the output do not assemble."""
    scene = crank_rocker(motion, drive=CYLINDER)
    page = show(scene)
    s = solve(scene)
    page.run("go(20)")
    assert page["theta-text"].text == place
    assert page["over"].text == over
    assert pace in page["pace"].text
    assert not page["branch"].is_displayed()
    angles = ("theta_2", "theta_3", "theta_4")
    page.require(s, 20, *angles, "drive_force", "condition")
    assert page.numbers("stroke") == approx([1000.0 * s.stroke[20]], rel=PRINTED)
    assert page.state("plotted.over") == approx(s.at.places)
    page["chart"].click()  # its middle
    assert abs(page.state("row") - 20) <= 2
    closed = np.flatnonzero(s.assembled)
    rows = page.play(400)
    assert (min(rows), max(rows)) == (closed[0], closed[-1])
    assert abs(np.diff(rows)).max() <= 1
    page.run("play(false); go(0)")
    assert page["status"].is_displayed() == (not s.assembled[0])


@mark.slow
def test_what_is_downloaded_is_the_scene_on_the_branch_shown(show, tmp_path):
    motion = Motion(np.array([0.1, 0.2, 0.3, 0.4]), 10.0, 5.0)
    scene = crank_rocker(motion, title="a\\nb")
    page = show(scene)
    assert "at ω₂ = 10 rad/s the mechanism takes 0.03 s." in page["pace"].text
    assert loads(page.state("sceneFile()")).motion.branch == 1
    page.run("chooseBranch(-1)")
    folder = {"behavior": "allow", "downloadPath": str(tmp_path)}
    page.driver.execute_cdp_cmd("Browser.setDownloadBehavior", folder)
    page["download"].click()
    until = monotonic() + 10.0
    file = tmp_path / "linkage.toml"  # made empty at first
    while not (file.exists() and file.stat().st_size) and monotonic() < until:
        sleep(0.02)
    saved = loads(file.read_text())
    assert (saved.linkage, saved.loads) == (scene.linkage, scene.loads)
    assert (saved.title, saved.motion.branch) == ("a\\nb", -1)
    assert saved.motion.angle.tolist() == scene.motion.angle.tolist()


def test_what_acts_is_drawn_at_its_place_and_dimensions_on_request(show):
    spring = fourbar.Spring(Place(1, (0.1, -0.5)), Place(4, (0.08, 0.0)), 20.0, 0.1)
    load = fourbar.Load(3, (2.0, 0.5), from_centre=(0.03, 1.0), frame="bar")
    scene = crank_rocker(
        loads=(load,), effects=(fourbar.Springs((spring,)), fourbar.Gravity())
    )
    page = show(scene)
    page.run("go(20); toggle('show-v'); toggle('show-a')")
    s = solve(scene)
    theta_3 = s.theta_3[20]
    theta_4 = s.theta_4[20]
    script = f"""{POINTS}
        return [...document.querySelectorAll("path.act")].map(e => [
          e.getAttribute("class"),
          points(e).map(p => [(p[0] - view.x) / view.k, (view.y - p[1]) / view.k])]);
    """
    acting = dict(page.run(script))
    assert acting.keys() >= {"act act-drive", "act act-gravity"}
    end = s.B[20] + (0.08 - 0.22) * np.array([cos(theta_4), sin(theta_4)])
    assert_allclose(acting["act act-spring"][-1], end, atol=1e-4)
    tail, tip = np.array(acting["act act-force"])
    off = 0.03 * np.array([cos(theta_3 + 1.0), sin(theta_3 + 1.0)])
    assert_allclose(tail, s.G3[20] + off, atol=1e-4)
    assert atan2(*(tip - tail)[::-1]) == approx(theta_3 + 0.5, abs=0.01)
    script = f'{POINTS}return [...document.querySelectorAll("#motion path.act")]'
    arrows = np.array(page.run(script + ".map(points)"))
    assert len(arrows) == 2 * 5
    moving = ("v_A", "v_G3", "a_A", "a_G3")
    for (start, stop), name in zip(arrows[[0, 3, 5, 8]], moving, strict=True):
        x, y = stop - start
        assert atan2(-y, x) == approx(atan2(*s[name][20][::-1]), abs=0.001), name
    script = "['1', '3'].map(k => parts.label[k])"
    texts = script + ".map(e => e.textContent)"
    assert page.state(texts) == ["1", "3"]
    assert page.state(script + ".map(e => e.style.display)") == ["none", ""]
    page.run("toggle('show-dimensions'); toggle('show-acting')")
    assert page.state(texts) == ["1: 300 mm", "3: 250 mm"]
    assert not page.list("#acting *, #under .act")


@mark.parametrize("scaling", ("sweep", "position"))
def test_arrows_point_along_the_forces_to_the_scale_of_the_legend(turning, scaling):
    page, s = turning
    choose = """
        const e = document.getElementById("arrow-scale");
        e.value = arguments[0];
        e.dispatchEvent(new Event("change"));
        go(50);
        const bar = document.querySelector("#force-scale line");
        return Number(bar.getAttribute("x2")) - Number(bar.getAttribute("x1"));
    """
    length = page.run(choose, scaling)
    script = """
        const shaft = document.getElementById("arrow-" + arguments[0]);
        const n = k => Number(shaft.getAttribute(k));
        const tip = shaft.nextElementSibling.getAttribute("d").match(/M(\\S+) ([^L]+)/);
        return [Number(tip[1]) - n("x1"), n("y1") - Number(tip[2])];
    """
    (text,) = (one.text for one in page.list("#force-scale text"))
    scale = length / float(text.split()[0])
    for name in ("F12", "F32", "F43", "F14"):
        drawn = np.array(page.run(script, name))
        assert_allclose(drawn, s[name][50] * scale, atol=PIXEL)


@mark.slow
def test_keyboard_drives_it(turning):
    from selenium.webdriver.common.action_chains import ActionChains
    from selenium.webdriver.common.keys import Keys

    page, _ = turning
    press = lambda *keys: ActionChains(page.driver).send_keys(*keys).perform()  # noqa: E731
    press(Keys.ARROW_RIGHT, Keys.ARROW_RIGHT, Keys.ARROW_LEFT, Keys.ARROW_RIGHT)
    assert page.state("row") == 2
    for playing in (True, False):
        press(Keys.SPACE)
        assert page.state("playing") == playing
    press(Keys.HOME)
    assert page.state("row") == 0
    press("b")
    assert page.state("branch") == 1  # single letters act only on the picture in focus
    page.run("document.getElementById('picture').focus()")
    assert page["branch-key"].is_displayed()
    press("b", "f")
    assert page.state("branch") == -1
    assert not page.state("document.getElementById('show-forces').checked")
    assert not page["arrow-F12"].is_displayed()
    order = []
    page.run("document.body.tabIndex = -1; document.body.focus()")
    for _ in range(6):
        press(Keys.TAB)
        order.append(page.state("document.activeElement.id"))
    # first the link that skips to the controls
    assert order == ["", "picture", "play", "back", "forward", "reset"]


@mark.slow
def test_every_control_has_a_name(turning):
    page, _ = turning
    controls = page.list("button, select, input, [role=img]")
    assert len(controls) > 15
    for control in (c for c in controls if c.is_displayed()):
        assert control.accessible_name.strip(), control.get_attribute("id")
    page.run("go(3)")
    assert page["theta"].get_attribute("aria-valuetext").endswith("degrees")


@mark.slow
@mark.parametrize("dark", (False, True))
@mark.parametrize("scene", (crank_rocker(), thesis()), ids=("crank-rocker", "thesis"))
def test_at_360_pixels_nothing_sticks_out_and_all_text_is_readable(show, scene, dark):
    page = show(scene, 360, dark=dark)
    assert page.state("document.documentElement.scrollWidth") <= 360
    assert page["picture"].rect["width"] > 300
    for control in page.list("button, select, input[type=number], input[type=range]"):
        if control.is_displayed():
            assert control.size["height"] >= 40  # large enough for a finger
    script = """
        const hasText = e => [...e.childNodes]
          .some(c => c.nodeType === 3 && c.textContent.trim());
        const leftOut = "svg, noscript, script, [disabled]";
        const background = e => getComputedStyle(e).backgroundColor;
        return [...document.querySelectorAll("body *")]
          .filter(hasText)
          .filter(e => e.checkVisibility() && !e.closest(leftOut))
          .map(e => {
            let ground = e;
            while (background(ground) === "rgba(0, 0, 0, 0)") {
              ground = ground.parentElement;
            }
            const text = e.textContent.trim().slice(0, 30);
            return [getComputedStyle(e).color, background(ground), text];
          });
    """
    seen = page.run(script)
    assert len(seen) > 40
    for colour, ground, text in seen:
        low, high = sorted((luminance(colour), luminance(ground)))
        assert high + 0.05 >= 4.5 * (low + 0.05), (text, colour, ground)  # WCAG AA
    page = luminance(page.state(BACKGROUND))
    assert page < 0.05 if dark else page > 0.9


def luminance(colour):
    parts = np.array(re.findall(r"\d+", colour)[:3], dtype=float) / 255
    linear = np.where(parts <= 0.03928, parts / 12.92, ((parts + 0.055) / 1.055) ** 2.4)
    return linear @ [0.2126, 0.7152, 0.0722]


COVERED = """
const marks = '.pin, .centre-disc, .own-point, .head, .support';
const boxes = kind => [...picture.querySelectorAll(kind)]
  .map(e => [e.textContent || e.getAttribute('class'), e.getBoundingClientRect()])
  .filter(([, box]) => box.width);
const labels = boxes('text').filter(([words]) => words.trim());
return labels.flatMap(([a, p], n) => [...labels.slice(n + 1), ...boxes(marks)]
  .filter(([, q]) => Math.min(p.right, q.right) - Math.max(p.left, q.left) > 1.5
    && Math.min(p.bottom - 1.5, q.bottom) - Math.max(p.top + 2.5, q.top) > 1.5)
  .map(([b]) => `${a} on ${b}`));
"""
"""Labels that stand on another one, or on a pin or mark, by more than the space around
letters, px.
"""


@mark.slow
@mark.parametrize("width", [400, 1024, 1440])
def test_no_label_of_the_gallery_covers_another_one_or_a_symbol(show, width):
    gallery = sorted((MODELS / "gallery").glob("*.toml"))
    for path in (*gallery, MODELS / "thesis.toml", MODELS / "crank_rocker.toml"):
        page = show(fourbar.load(path), width, vectors=True)
        page.run("byId('show-dimensions').click()")
        for sixth in range(6):
            page.run(f"go(Math.floor({sixth} * grid.length / 6))")
            assert page.run(COVERED) == [], (path.stem, sixth)
            shown = page.run("return wanted.map(one => one.element.style.display)")
            assert len(shown) > 10 and "none" not in shown, (path.stem, sixth)


def test_hostile_titles_do_nothing_but_appear(show):
    page = show(replace(crank_rocker(), title=HOSTILE))
    assert "<script>alert(1)</script>" in page.list("h1")[0].text
    page["forward"].click()
    assert page.state("row") == 1


def test_a_picture_lies_along_its_bar(show, tmp_path):
    picture = tmp_path / "bar.png"
    picture.write_bytes(PNG)
    page = show(crank_rocker(), pictures={"output": picture})
    page.run("go(9)")
    element = page["picture-4"]
    drawn = page.pins()
    length = np.hypot(*(drawn["B"] - drawn["O4"]))
    assert float(element.get_attribute("width")) == approx(length)
    _, turn = element.get_attribute("transform").split("rotate(")
    away = float(turn.rstrip(")")) + degrees(solve(crank_rocker()).theta_4[9])
    assert remainder(away, 360) == approx(0, abs=1e-6)


def test_with_reduced_motion_it_moves_twice_a_second(show):
    page = show(crank_rocker(), still=True)
    script = """
        window.requestAnimationFrame = () => 0;
        play(true);
        const seen = new Set();
        const x = () => document.getElementById("pin-A").getAttribute("cx");
        for (let i = 0; i < 60; i++) {
          frame(10000 + 50 * i);
          seen.add(x());
        }
        play(false);
        return seen.size;
    """
    assert 4 <= page.run(script) <= 8  # 3 s


def test_positions_alone_show_no_dynamics(show):
    page = show(crank_rocker(Motion(Sweep(0.0, 2 * pi, 36))))
    assert not page["forces"].is_displayed()
    assert page["omega_3"].text == "–"
    page["forward"].click()
    assert page.numbers("theta_2") == approx([10.0], abs=PRINTED_DEG)


def test_the_drive_at_rest_has_the_range_that_dry_friction_leaves_it(show):
    page = show(RESTING)
    torque = solve(RESTING).torque[0]
    ends = [number(end) for end in page["torque"].text.split(" to ")]
    assert ends == approx([torque - 0.2, torque + 0.2], rel=PRINTED)
    assert page["status"].text.startswith("At rest dry friction leaves")


def test_it_says_why_a_position_has_no_forces(show):
    """T3 of a parallelogram exists nowhere.

    On its input the drive has forces everywhere, and no remark is shown.
    """
    motion = Motion(Sweep(0.3, 2.0, 4), 1.0)
    remark = "no torque of the drive holds them in balance"
    for drive_bar in (3, 2):
        status = show(Scene(uniform(1.0, 0.5, 1.0, 0.5), motion, drive_bar))["status"]
        assert (remark in status.text) == status.is_displayed() == (drive_bar == 3)


@mark.slow
def test_tolerances_have_bands_and_shares_in_the_units_of_the_page(show):
    loose = (
        Tolerance("lengths.input", 5e-5),
        Tolerance("bars.coupler.mass", 0.001, True),
    )
    scene = crank_rocker(tolerances=loose, points=(fourbar.Point("P", 3, (0.1, 0.2)),))
    page = show(scene, 360, units=units("N.mm"))
    study = fourbar.tolerances(scene, PAGE_SAMPLES)
    page.run("go(20)")
    rows = {}
    for row in page.list("#spreads tbody tr, #shares tbody tr"):
        heading, *cells = row.find_elements("css selector", "th, td")
        rows[heading.text] = [number(cell.text.replace("±", "")) for cell in cells]
    names = ("nominal", "deviation", "low", "high", "worst", "least", "greatest")
    for label, part, factor in (
        ("torque, N mm", "torque", 1e3),
        ("|F₄₃|, N", "|F43|", 1.0),
        ("P_x, mm", "P_x", 1e3),
    ):
        spread = study.spreads[part]
        expected = [factor * getattr(spread, name)[20] for name in names]
        # numbers beside the worst case have its digits, three significant ones
        close = 6e-3 * factor * spread.worst[20]
        assert_allclose(rows[label], expected, rtol=0, atol=close)
    shares = study.spreads["torque"].shares[:, 20]
    shown_shares = [rows[tolerance.key][0] for tolerance in loose]
    assert shown_shares == approx(100 * shares / shares.sum(), abs=0.51)
    assert page.state("document.documentElement.scrollWidth") <= 360
    box = page.list("#bands .band")[0].rect
    assert box["height"] > 40 and box["width"] > 200
    page.run("chooseBranch(-1)")
    assert not page["spreads"].is_displayed()
    assert "belong to the branch of the scene" in page["tolerance-note"].text


@mark.slow
def test_the_bars_of_the_sheet_have_the_units_of_its_heads(show):
    inch, pound = 0.0254, 0.45359237
    scene = crank_rocker()
    page = show(scene, units=units("imperial"))
    assert not page["bars"].is_displayed()
    page.print()
    table = page["bars"]
    assert "mass lb inertia lb in²" in table.text
    rows = table.find_elements("css selector", "tbody tr")
    for bar, row in zip(scene.linkage.moving, rows[1:], strict=True):
        *cells, centre = (cell.text for cell in row.find_elements("tag name", "td")[:4])
        inertia = bar.moment_of_inertia / (pound * inch**2)
        stated = [bar.length / inch, bar.mass / pound, inertia]
        assert [number(cell) for cell in cells] == approx(stated, rel=PRINTED)
        to_centre = bar.to_centre / inch
        place = [number(part) for part in centre.split(", ")]
        stated = [to_centre.real, to_centre.imag]
        assert place == approx(stated, rel=PRINTED, abs=PRINTED)


@mark.slow
def test_a_printed_page_is_one_sheet_with_lengths_and_the_chart_s_name(show):
    page = show(crank_rocker(), dark=True)
    printed = page.driver.execute_cdp_cmd("Page.printToPDF", {"printBackground": True})
    assert base64.b64decode(printed["data"]).count(b"/Type /Page\n") == 1

    page.print()
    page.run("window.dispatchEvent(new Event('beforeprint'))")
    labels = page["labels"].text
    for text in ("1: 300 mm", "2: 100 mm", "3: 250 mm", "4: 220 mm"):
        assert text in labels
    assert page["plotted"].text == "torque on bar 2, N m"
    assert page.state(BACKGROUND) == "rgb(255, 255, 255)"
    hidden = ("play", "show-labels", "quantity", "download")
    assert not any(page[name].is_displayed() for name in hidden)

    page.run("window.dispatchEvent(new Event('afterprint'))")
    assert "300 mm" not in page["labels"].text
