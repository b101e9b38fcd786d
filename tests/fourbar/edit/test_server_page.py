"""A designer's path in a real browser.

From an empty scene to a saved file, numbers equal to `analyze`'s.
"""

import json
from math import cos, degrees, hypot, remainder, sin
from time import monotonic, sleep

import numpy as np
from numpy.testing import assert_allclose
from pytest import approx, fixture, importorskip, mark

from fourbar import load, solve

importorskip(
    "selenium",
    reason="pages are driven by selenium: pip install selenium",
)
from selenium.webdriver.common.action_chains import ActionChains
from selenium.webdriver.common.keys import Keys
from selenium.webdriver.support.ui import Select

from fourbar.files import loads
from fourbar_validation.places import MODELS
from tests.fourbar.edit.test_server import start
from tests.support.scenes import find_angle

pytestmark = mark.slow

PRINTED = 6e-5
"""Numbers are shown with five significant digits."""
WAIT = 15.0
"""s, for what follows in a few hundredths on an idle machine."""
PIXELS = 4.0
"""px between a pin dropped and its place: the grain, and the browser's own rounding."""


SAVED = "/^saved|is saved/.test(document.getElementById('bench').textContent)"


class Page:
    """A page of the workbench in the browser, and the servers of its files."""

    def __init__(self, driver):
        self.driver = driver
        self.servers = []

    def serve(self, path, port="0"):
        """Serve a scene file, and return the address of its page."""
        self.servers.append(start(path, "--no-browser", "--port", port))
        return str(self.servers[-1].stdout.readline().strip())

    def end(self):
        while self.servers:
            server = self.servers.pop()
            server.terminate()
            server.communicate(timeout=20)

    def is_quiet(self):
        assert not self.driver.get_log("browser")

    def run(self, script, *arguments):
        return self.driver.execute_script(script, *arguments)

    def value(self, expression, *arguments):
        return self.run(f"return {expression}", *arguments)

    def wait(self, expression):
        deadline = monotonic() + WAIT
        while not (value := self.value(expression)):
            assert monotonic() < deadline, f"{expression} stays {value!r}"
            sleep(0.02)
        return value

    def get(self, path):
        address = self.serve(path)
        self.driver.get(address)
        return address

    def open(self, path):
        """Open a file; where it is new, with the linkage that it begins with."""
        address = self.get(path)
        self.wait("offers && document.getElementById('field:lengths/input')")
        if self.value("Boolean(sketch)"):
            self.click("no-sketch")
        return address

    def element(self, name):
        return self.driver.find_element("id", name)

    def all(self, selector):
        return self.driver.find_elements("css selector", selector)

    def choose_stroke(self):
        self.all("#command option[value=stroke]")[0].click()

    def wait_for_text(self, name, text):
        words = json.dumps(text)
        self.wait(f"document.getElementById('{name}').textContent.includes({words})")

    def click(self, name):
        self.element(name).click()

    def text(self, name):
        return str(self.element(name).text)

    def shows(self, name):
        return bool(self.element(name).is_displayed())

    def type(self, field, text):
        self.element(field).send_keys(Keys.CONTROL, "a")
        self.element(field).send_keys(text)

    def press(self, path):
        self.driver.find_element("xpath", path).click()

    def numbers(self, *names):
        return [float(self.text(name).replace("−", "-")) for name in names]

    def click_at(self, x, y, *held):
        """Click a pixel of the picture while keys are held."""
        picture = self.element("picture")
        off = x - picture.size["width"] / 2, y - picture.size["height"] / 2
        chain = ActionChains(self.driver)
        for key in held:
            chain.key_down(key)
        chain.move_to_element_with_offset(picture, *off).click()
        for key in held:
            chain.key_up(key)
        chain.perform()

    def click_pins(self, width, *pixels):
        """Draw O2, A, B and O4 in an empty drawing of a width, off the grid."""
        self.type("sketch-width", width)
        for pixel in pixels:
            self.click_at(*pixel, Keys.SHIFT)

    def save(self):
        self.click("save")
        self.wait(SAVED)


@fixture
def path(tmp_path):
    return tmp_path / "mine.toml"


@fixture
def page(chromium):
    """The one browser, whose console must be empty but where a line was cut."""
    page = Page(chromium)
    size = {"width": 1280, "height": 900, "mobile": False, "deviceScaleFactor": 1}
    chromium.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
    yield page
    chromium.get("about:blank")
    page.end()
    chromium.get_log("browser")


def test_a_designer_goes_from_an_empty_scene_to_a_saved_file(page, path):
    page.open(path)
    page.type("field:title", "<b>Mine</b><script>alert(1)</script>")
    page.type("field:lengths/input", "4 in")
    page.wait("data.lengths[1] === 0.1016")
    page.type("field:lengths/input", "4 lb")
    # the keys before the last one are refused too, each with a line of its own
    page.wait_for_text("field:lengths/input!", "does not convert to m")
    assert page.element("field:lengths/input").get_attribute("aria-invalid") == "true"
    assert page.value("data.lengths[1]") == 0.1016
    page.element("field:lengths/input").send_keys(Keys.ESCAPE)
    page.type("field:bars/coupler/mass", "2 kg")
    page.wait("plain.bars.coupler.mass === '2 kg'")
    page.element("field:bars/coupler/mass").send_keys(Keys.ARROW_DOWN)
    page.wait("plain.bars.coupler.mass === '1.99 kg'")
    page.press("//button[.='+ force']")
    page.wait("plain.loads?.length === 1 && data.handles.length === 4")
    # the scale stays, as while something is dragged
    page.run("window.scrollTo(0, 0); go(40); held = true")
    before = page.value("at(row).B")
    handle = page.all(".handle")[1]
    assert "pin B" in handle.get_attribute("aria-label")
    scale = page.value("view.k * picture.clientWidth / view.width")
    chain = ActionChains(page.driver).move_to_element(handle).click_and_hold()
    chain.move_by_offset(12, -9).move_by_offset(8, -11).release().perform()
    page.wait("!inFlight && !waiting.length && plain.lengths.output !== '220 mm'")
    moved = np.subtract(page.value("at(row).B"), before) * scale
    assert moved == approx([20.0, 20.0], abs=PIXELS)
    page.wait("'torque_error' in table()")
    assert page.text("compared").startswith("Peak torque on bar 2")
    assert page.value("document.querySelectorAll('#chart .behind').length") == 1
    steps = page.value("plain")
    page.click("undo")
    page.wait("plain.lengths.output === '220 mm'")
    page.click("redo")
    page.wait("plain.lengths.output !== '220 mm'")
    assert page.value("plain") == steps
    page.driver.refresh()  # a reload loses nothing
    page.wait("offers && plain.lengths && 'torque_error' in table()")
    assert page.value("plain") == steps
    assert page.all("h1")[0].text.startswith("<b>")
    page.save()
    solution = solve(loads(path.read_text(), str(path)), "error")
    for row in (0, 90, 217):
        page.run(f"go({row})")
        shown = page.numbers("torque", "F12_x", "alpha_4")
        expected = [solution.torque[row], solution.F12[row, 0], solution.alpha_4[row]]
        assert shown == approx(expected, rel=PRINTED)
    held = page.value("JSON.stringify(table().torque)")
    assert json.loads(held) == solution.torque.tolist()
    page.all("#positions tbody tr:nth-child(4) td")[2].click()
    assert page.value("row") == 30
    assert page.text("theta-text") == f"{degrees(solution.theta_2[30]):.2f}°"
    page.is_quiet()


SHOWN_FIELDS = (
    "[...document.querySelectorAll('.editor :is(input, select, textarea, button)')]"
    ".filter(e => e.checkVisibility())"
)


def test_a_linkage_is_drawn_by_four_clicks_and_its_numbers_are_typed_over(page, path):
    """The drawing is empty, and no numbers of a linkage that nobody sees stand beside
    it. The pins state the lengths, and none can be removed.
    """
    page.get(path)
    page.wait("offers && sketch")
    assert not page.shows("bar-2") and not page.shows("strip")
    said = page.text("next-pin")
    assert said.startswith("Click where pin O2 joins the input to the ground; or")
    x, y, pixel = page.run(
        "const {pixels} = gridOf(), [x, y] = snapped({clientX: 300, clientY: 300});"
        " return [x - sketch.origin[0], y - sketch.origin[1], pixels]"
    )
    assert abs(remainder(x, pixel)) + abs(remainder(y, pixel)) < 1e-6
    pixels = {"O2": (120, 300), "A": (170, 220), "B": (400, 120), "O4": (380, 330)}
    page.click_pins("50 in", *pixels.values())
    scale = 50.0 / page.element("picture").size["width"]
    page.wait("!sketch && plain.pins?.O4[0].endsWith(' in')")
    stated = {
        name: complex(*(float(text.split()[0]) for text in place))
        for name, place in page.value("plain.pins").items()
    }
    for name, (x, y) in pixels.items():
        clicked = complex(x - 120, 300 - y) * scale
        assert stated[name] - stated["O2"] == approx(clicked, abs=PIXELS * scale)
    shown = page.run("const p = at(row); return [p.A, p.B]")
    for place, pin in zip(shown, ("A", "B"), strict=True):
        drawn = stated[pin] - stated["O2"]
        assert complex(*place) / 0.0254 == approx(drawn, abs=PIXELS * scale)
    assert "lbf" in page.text("forces")  # results follow the file
    assert not page.all("[id='field:lengths/input']")
    names = [page.element(f"field:pins/A/{n}").accessible_name for n in (0, 1)]
    assert names == ["x", "y"]
    assert not page.driver.find_elements("xpath", "//button[.='Remove A']")
    page.type("field:pins/A/1", "6 in")
    typed = 0.0254 * abs(complex(stated["A"].real, 6.0) - stated["O2"])
    page.wait(f"Math.abs(data.lengths[1] - {typed!r}) < 1e-12")
    page.click("sketch")
    page.wait("sketch")
    page.click("no-sketch")
    page.wait("!sketch && document.getElementById('bar-2').checkVisibility()")
    page.click("sketch")
    page.type("sketch-width", "2 m")
    # as they stand in somebody's drawing
    for place in ("0, 0", "nowhere", "0, 0.125", "1.5 0.5", "1.25; -0.25"):
        page.type("pin-xy", place + Keys.ENTER)
    page.wait("!sketch && Math.abs(data.lengths[1] - 0.125) < 1e-6")
    lengths = [hypot(1.25, 0.25), 0.125, hypot(1.5, 0.375), hypot(0.25, 0.75)]
    assert page.value("data.lengths") == approx(lengths, abs=2e-6)
    page.is_quiet()


def test_a_designer_draws_a_cylinder_drive_and_analyze_gives_the_same(page, path, show):
    page.get(path)
    page.wait("offers && sketch")
    page.click_pins("1000 mm", (120, 300), (170, 180), (400, 120), (380, 330))
    page.wait("!sketch && plain.pins")
    page.type("field:bars/output/mass", "80 kg")
    page.wait("plain.bars.output.mass === '80 kg'")
    page.press("//button[.='+ cylinder in place of the bar']")
    page.wait("plain.drive.from && document.getElementById('field:drive/from/bar')")
    page.press("//fieldset[legend='from']//button[.='By x and y']")
    page.wait("plain.drive.from.from_pin.x")
    for name, value in (("x", "300 mm"), ("y", "-250 mm")):
        page.type(f"field:drive/from/from_pin/{name}", value)
        page.wait(f"plain.drive.from.from_pin.{name} === '{value}'")
    page.choose_stroke()
    page.wait("plain.motion.stroke && 'drive_force_error' in table()")
    assert page.value("data.over.name") == "stroke"
    page.run("go(17)")
    (force,) = page.numbers("drive_force")
    page.type("pressure", "210 bar" + Keys.ENTER)
    page.wait_for_text("summary", "bore     at least")
    summary = page.text("summary")
    page.save()
    scene = load(path)
    assert scene.drive and scene.effects and scene.motion.stroke is not None
    assert 'from_pin = { x = "300 mm", y = "-250 mm" }' in path.read_text()
    solution = solve(scene)
    stroke = page.value("data.over.values[17]")
    assert force == approx(
        solution.drive_force[abs(solution.stroke - stroke).argmin()],
        rel=PRINTED,
    )
    printed = show("analyze", path, "--pressure", "210 bar")
    assert " ".join(summary.split()).startswith(" ".join(printed.split()))
    assert "cylinder" in printed
    page.is_quiet()


def test_the_keyboard_alone_draws_types_drags_undoes_and_saves(page, path):
    page.get(path)
    page.wait("offers && sketch && document.activeElement === picture")

    def press(*keys):
        ActionChains(page.driver).send_keys(*keys).perform()

    def with_control(key):
        chain = ActionChains(page.driver).key_down(Keys.CONTROL).send_keys(key)
        chain.key_up(Keys.CONTROL).perform()

    def tab_to(goal):
        for _ in range(200):
            if page.value(f"document.activeElement.matches({goal!r})"):
                return
            press(Keys.TAB)
        raise AssertionError(f"{goal} is not reached by Tab")

    press(Keys.ENTER, 5 * Keys.ARROW_UP, Keys.ENTER, 14 * Keys.ARROW_RIGHT)
    press(6 * Keys.ARROW_UP, Keys.ENTER, 12 * Keys.ARROW_DOWN, Keys.ENTER)
    page.wait("!sketch && plain.pins")
    lengths = page.value("data.lengths")
    page.run("document.activeElement.blur(); window.scrollTo(0, 0)")
    reached = set()
    for _ in range(200):  # every field and button of the editor, in turn
        press(Keys.TAB)
        reached.add(
            page.value(
                "document.activeElement.id || document.activeElement.textContent"
            )
        )
        summary = "document.querySelector('.editor > details > summary')"
        if page.value(f"document.activeElement === {summary}"):
            break
    missing = page.value(
        f"{SHOWN_FIELDS}.filter(e => !e.disabled && e.id !== 'file-text').map(e"
        " => e.id || e.textContent)"
    )
    assert set(missing) - reached == {""} - reached
    page.run("document.activeElement.blur()")
    tab_to("[id='field:bars/coupler/mass']")
    with_control("a")
    press("2 kg")
    page.wait("plain.bars.coupler.mass === '2 kg'")
    press(Keys.ARROW_UP)
    page.wait("plain.bars.coupler.mass === '2.01 kg'")
    assert not page.all("[id='field:motion/branch']")  # the pins state it
    tab_to("[id='field:drive/bar']")
    press(Keys.ARROW_DOWN)
    page.wait("plain.drive?.bar")
    tab_to(".handle[aria-label^='pin B']")
    before = page.value("plain.pins.B[0]")
    press(Keys.ARROW_RIGHT)
    page.wait(f"plain.pins.B[0] !== {before!r}")
    with_control("z")
    page.wait(f"plain.pins.B[0] === {before!r}")
    assert page.value("data.lengths") == lengths
    with_control("s")
    page.wait(SAVED)
    assert load(path).linkage.coupler.mass == 2.01


def test_each_label_is_what_a_screen_reader_says_and_each_choice_a_list(page, path):
    """What does not apply to a stroke is not there once it is commanded."""
    path.write_text((MODELS / "gallery/excavator_bucket.toml").read_text())
    page.open(path)
    page.choose_stroke()
    page.wait("plain.motion.stroke && document.getElementById('field:motion/side')")
    entries = page.all("#fields :is(input, select)")
    visible = (
        "e => [...e.labels].map(l => [...l.childNodes]"
        ".filter(n => n.nodeType === 3).map(n => n.data).join('')).join()"
    )
    words = page.value(f"arguments[0].map({visible})", entries)
    assert len(entries) > 20 and all(words)
    for entry, word in list(zip(entries, words, strict=True))[::3]:
        assert entry.accessible_name == word
    tags = {entry.get_attribute("id"): entry.tag_name for entry in entries}
    lists = {name.rpartition("/")[2] for name in tags if tags[name] == "select"}
    assert {"branch", "bar", "frame", "side"} <= lists
    gone = ("motion/theta_2", "motion/omega_2", "motion/through", "drive/bar")
    assert not {f"field:{name}" for name in gone} & tags.keys()
    motions = "//button[.='+ sweep' or .='+ released' or .='+ law over time']"
    assert not page.driver.find_elements("xpath", motions)


def test_undo_takes_a_refused_entry_back_and_leaves_the_last_good_state(page, path):
    page.open(path)
    page.type("field:lengths/input", "110 mm")
    page.wait("data.lengths[1] === 0.11")
    page.type("field:lengths/coupler", "240 mm")
    page.wait("data.lengths[2] === 0.24")
    page.type("field:lengths/input", "4 lb")
    undo = Keys.CONTROL, "z"
    entry = page.element("field:lengths/input")
    entry.send_keys(*undo)  # while the refusals are on their way
    page.wait(
        "(e => e.value === '110 mm' && e.getAttribute('aria-invalid') !== 'true')"
        "(document.getElementById('field:lengths/input'))"
    )
    assert page.value("data.lengths.slice(1, 3)") == [0.11, 0.24]
    entry.send_keys(*undo)
    page.wait("data.lengths[2] === 0.25")
    page.run("document.getElementById('file-text').closest('details').open = true")
    page.run("document.getElementById('file-text').value = 'lengths = 3'")
    page.click("apply")
    page.wait(
        "document.getElementById('file-text').getAttribute('aria-invalid') === 'true'",
    )
    page.click("undo")
    page.wait("document.getElementById('file-text').value.includes('110 mm')")
    assert page.value("data.lengths.slice(1, 3)") == [0.11, 0.25]


def test_a_page_finds_its_server_again_and_a_new_one_goes_on_from_the_state(page, path):
    server = page.open(path)
    page.run("line.close()")
    page.type("field:lengths/input", "110 mm")
    page.wait("data.lengths[1] === 0.11")
    page.end()
    page.wait_for_text("bench", "The server has stopped")
    again = page.serve(path, server.split("/")[2].partition(":")[2])
    assert again != server  # the token is another one, and the old page is told nothing
    sleep(2.0)
    assert page.value("line.readyState") != 1
    page.driver.get(again)
    page.wait("offers && data.lengths[1] === 0.11")
    page.click("undo")
    page.wait("data.lengths[1] === 0.1")


def test_a_refused_entry_stays_with_its_message_when_tab_follows_at_once(page, path):
    page.open(path)
    page.type("field:lengths/input", f"4 lb{Keys.TAB}")
    entry = "document.getElementById('field:lengths/input')"
    page.wait(f"{entry}.getAttribute('aria-invalid') === 'true'")
    # the half-typed "4" is refused too, in other words
    message = "document.getElementById('field:lengths/input!').innerText"
    page.wait(f"{message}.includes('does not convert to m')")
    words = page.text("field:lengths/input!")
    page.type("field:lengths/coupler", f"260 mm{Keys.TAB}")
    page.wait("data.lengths[2] === 0.26")
    page.press("//button[.='+ force']")
    page.wait("plain.loads?.length === 1")  # the fields are built anew
    assert page.value(f"{entry}.value") == "4 lb"
    assert page.text("field:lengths/input!") == words
    page.type("field:lengths/input", f"110 mm{Keys.TAB}")
    page.wait("data.lengths[1] === 0.11")
    assert not page.shows("field:lengths/input!")


PHOTO = {"O2": (800, 1500), "A": (1000, 1150), "B": (1900, 900), "O4": (2200, 1500)}
"""Pixels of the pins in a photo whose pixels are 0.25 mm."""
MORE = {"P": (1300, 700), "Q": (1940, 940)}
"""Pixels of a point of the coupler, and of a place where B lies rather."""
CLICKS = 2.0
"""px between two clicks: each is off by one, as the driver points at whole ones."""


def test_a_photo_is_traced_to_a_scene(page, path):
    from PIL import Image

    noise = Image.effect_noise((3000, 2000), 60.0).convert("RGB")
    photo = path.with_name("photo.jpg")
    noise.save(photo, quality=97)  # larger than a request
    page.get(path)
    page.wait("offers && sketch")
    page.element("picture-file").send_keys(str(photo))
    page.wait("data.traced && tracedSize && sketch")
    share = page.value("tracedSize[0]") / 3000.0

    def find(expression, pixel, *more):
        """Return a place on the screen, or how far another place is from it, px."""
        script = f"const q = toScreen(ofPixel(arguments[0])); return {expression}"
        return page.run(script, [share * x for x in pixel], *more)

    def click(pixel):
        page.click_at(*find("q", pixel))

    def place(what, pixel):
        Select(page.element("place")).select_by_value(what)
        click(pixel)
        page.wait("!aimed && !inFlight && !waiting.length")

    apart = 1400.0 * share * page.value("view.k * tracedScale()")
    page.click("measure")
    click(PHOTO["O2"])
    click(PHOTO["O4"])
    page.driver.switch_to.alert.send_keys("35 cm")
    page.driver.switch_to.alert.accept()
    page.wait("data.traced.scale && sketch")  # the drawing goes on
    scale = page.value("data.traced.scale") * share
    assert scale == approx(0.25e-3, rel=CLICKS / apart)
    for pixel in PHOTO.values():
        click(pixel)
    page.wait("plain.pins?.O4[0].endsWith(' cm') && at(row)")
    distance = "((a, b) => Math.hypot(a[0] - b[0], a[1] - b[1]))"
    place("a new point of the coupler", MORE["P"])
    drawn = "toScreen(framed(at(row), data.points[0].bar, data.points[0].at))"
    assert find(f"{distance}({drawn}, q)", MORE["P"]) < PIXELS
    place("pin B", MORE["Q"])
    for pin, pixel in (PHOTO | {"B": MORE["Q"]}).items():  # it lies on the picture
        off = find(f"{distance}(toScreen(at(row)[arguments[1]]), q)", pixel, pin)
        assert off < PIXELS, pin
    page.save()
    assert load(path).picture.name == "mine.jpg"


def test_a_path_stays_as_a_target_with_the_dead_centres_of_both(page, path):
    lengths = {"ground": 300, "input": 100, "coupler": 250, "output": 220}
    rows = "\n".join(f'{name} = "{value} mm"' for name, value in lengths.items())
    path.write_text(f"[lengths]\n{rows}\n")
    page.get(path)
    page.wait("offers && document.getElementById('field:lengths/input')")

    def list_marks(kind):
        return page.value(
            "[...document.querySelectorAll(arguments[0])].map(e => ["
            "(e.getBBox().x + e.getBBox().width / 2 - view.x) / view.k,"
            " (view.y - e.getBBox().y - e.getBBox().height / 2) / view.k])",
            kind,
        )

    def find_dead_centres():
        """Middles of the coupler where it lies in line with the input."""
        d, a, b, c = page.value("data.lengths")
        middles = []
        for reach, along in ((b + a, a + 0.5 * b), (b - a, 0.5 * b - a)):
            angle = find_angle(c, d, reach)
            middles.append((along * cos(angle), along * sin(angle)))
        return sorted(middles)

    before = find_dead_centres()
    pixel = 1.0 / page.value("view.k")
    assert_allclose(sorted(list_marks(".mark")), before, atol=pixel)
    page.type("field:lengths/output", "235 mm")
    page.wait("data.lengths[3] === 0.235 && !inFlight && !waiting.length")
    kept, shown = list_marks(".mark.behind"), list_marks(".mark:not(.behind)")
    assert_allclose(sorted(kept), before, atol=pixel)
    assert_allclose(sorted(shown), find_dead_centres(), atol=pixel)
