"""report.html in a real browser.

Quiet, readable in the dark, its links and its download right.
"""

import base64
import gzip
import json
import re

import pytest

from fourbar_validation.compare.rows import FORMULAS, write_rows
from fourbar_validation.report.html import ALL_OPEN
from tests.validation.report.test_report import copies, report
from tests.whole.test_imports import ROOT

pytest.importorskip(
    "selenium",
    reason="pages are driven by selenium: pip install selenium",
)

CONTRAST = 4.5
"""WCAG 2.1, level AA, for text."""
LOADED = 5.0
"""s for 200 scenes on a busy machine; measured 0.7."""
CONTRASTS = """
function rgb(text) {
  const c = document.createElement("canvas").getContext("2d");
  c.fillStyle = text; c.fillRect(0, 0, 1, 1);
  return [...c.getImageData(0, 0, 1, 1).data].slice(0, 3);
}
const lights = new Map();  // of each colour once: a canvas takes milliseconds
const linear = v => v <= .03928 ? v / 12.92 : ((v + .055) / 1.055) ** 2.4;
const light = c => {
  if (!lights.has(c)) {
    const [r, g, b] = rgb(c).map(v => linear(v / 255));
    lights.set(c, .2126 * r + .7152 * g + .0722 * b);
  }
  return lights.get(c);
};
const ground = e => {
  for (; e; e = e.parentElement) {
    const c = getComputedStyle(e).backgroundColor;
    if (c !== "rgba(0, 0, 0, 0)" && c !== "transparent") return c;
  }
  return "white";
};
const texts = "h1, h2, h3, p, li, a, td, th, summary, svg text, figcaption";
const found = [];
for (const e of document.querySelectorAll(texts)) {
  if (!e.textContent.trim() || !e.getClientRects().length) continue;
  const style = getComputedStyle(e);
  const a = light(e instanceof SVGElement ? style.fill : style.color);
  const b = light(ground(e));
  const contrast = (Math.max(a, b) + .05) / (Math.min(a, b) + .05);
  found.push([contrast, e.tagName + ": " + e.textContent.trim().slice(0, 40)]);
}
return found.sort((a, b) => a[0] - b[0]).slice(0, 5);
"""


SMALLEST = 9.0
"""px, of text at the size at which it is shown. Its box is two px more: room above its
letters.
"""
TEXTS = """
const clipped = [];
let smallest = Infinity;
for (const text of document.querySelectorAll("svg text")) {
  const box = text.getBoundingClientRect();
  if (!box.width) continue;
  const frame = text.ownerSVGElement.getBoundingClientRect();
  const inside = box.left >= frame.left - 2 && box.right <= frame.right + 2
    && box.top >= frame.top - 2 && box.bottom <= frame.bottom + 2;
  if (!inside) clipped.push(text.textContent);
  const m = text.getScreenCTM();
  const size = parseFloat(getComputedStyle(text).fontSize) * Math.hypot(m.a, m.b);
  smallest = Math.min(smallest, size);
}
return [clipped, smallest];
"""
PAPERS = """
return [...document.querySelectorAll("svg path, svg rect")].filter(shape => {
  const frame = shape.ownerSVGElement.getBoundingClientRect();
  const box = shape.getBoundingClientRect();
  const whole = box.width > 0.95 * frame.width && box.height > 0.95 * frame.height;
  return frame.width && whole && getComputedStyle(shape).fill !== "none";
}).map(shape => getComputedStyle(shape).fill);
"""


def wait(driver, condition):
    """What the condition gives once it holds: a body is unpacked in its own time."""
    from selenium.webdriver.support.wait import WebDriverWait

    return WebDriverWait(driver, LOADED).until(lambda _: condition())


def require_contrast(driver):
    worst = driver.execute_script(CONTRASTS)
    assert len(worst) == 5
    assert worst[0][0] >= CONTRAST, worst


@pytest.mark.slow
@pytest.mark.parametrize("dark", [False, True])
def test_all_text_is_readable(browse, dark):
    """Also in the matrix of the benchmark, with its grounds of green, yellow and red.

    A light paper of a picture would hide the light text of a dark page.
    """
    driver = browse(report(copies(2, failing=1))[1], dark=dark)
    require_contrast(driver)
    assert driver.find_elements("css selector", "svg")
    assert driver.execute_script(PAPERS) == []
    page = (ROOT / "docs" / "examples" / "benchmark.html").read_text()
    require_contrast(browse(page[: page.index("</table>")], dark=dark))


@pytest.mark.slow
def test_engines_stand_before_what_checks_fourbar_against_itself(browse):
    """The columns that a phone shows are those of engines, and so are the marks."""
    driver = browse(report(copies(2, failing=1))[1], 400)
    heads = driver.execute_script(
        "return [...document.querySelectorAll('details.scene[open] table')][0]"
        ".querySelectorAll('thead th').values().map(e => e.textContent).toArray()"
    )
    names = [re.sub("^[^a-z]+", "", head) for head in heads[1:]]
    own = [name == FORMULAS for name in names]
    assert own == sorted(own) and True in own and False in own
    caption = driver.find_element("css selector", "details.scene[open] .pictures + p")
    told = [name for name in names if re.search(rf"\W {name}\b", caption.text)]
    assert told == [name for name in names if name != FORMULAS]


@pytest.mark.slow
@pytest.mark.parametrize("width", [1440, 400, 360])
def test_every_text_is_whole_and_large_enough_and_nothing_is_left_out(browse, width):
    """The pictures of the first screen, those of a scene that is open, and tables."""
    pages = copies(2, failing=1)
    orders = {"error_at_4h": 1e-3, "error_at_2h": 1e-4, "observed_order": 3.0}
    for record in pages:
        record.evidence = {"mujoco-simulated": orders}
    driver = browse(report(pages)[1], width)
    assert driver.execute_script("return document.documentElement.scrollWidth") <= width
    assert len(driver.find_elements("css selector", "details[open] svg")) == 3
    clipped, smallest = driver.execute_script(TEXTS)
    assert clipped == []
    assert smallest >= SMALLEST or width < 400
    heads = driver.execute_script(
        "return [...document.querySelectorAll('table.engines th')]"
        ".map(e => [e.textContent, e.checkVisibility()])"
    )
    assert len(heads) > 10 and all(visible for _, visible in heads)
    widths = driver.execute_script(
        "return [...document.querySelectorAll('table.short')]"
        ".map(e => [e.scrollWidth, e.parentElement.clientWidth])"
    )
    assert widths and all(table <= room for table, room in widths)


@pytest.mark.slow
@pytest.mark.parametrize("count", [2, ALL_OPEN + 2])
def test_a_number_leads_to_its_row(browse, count):
    driver = browse(report(copies(count))[1])
    link = driver.find_elements("css selector", "#overview ~ details td.cell a")[-1]
    target = link.get_attribute("href").rpartition("#")[2]
    assert count <= ALL_OPEN or not driver.find_elements(
        "id", target
    )  # not unpacked yet
    driver.execute_script("arguments[0].click()", link)
    row = wait(driver, lambda: driver.find_element("id", target))
    wait(driver, row.is_displayed)
    position = "return arguments[0].getBoundingClientRect().top"
    assert wait(driver, lambda: 0 <= driver.execute_script(position, row) <= 900)
    assert row.find_elements("tag name", "td")[0].text == target.removeprefix("row-")


@pytest.mark.slow
def test_the_download_is_results_csv(browse):
    pages = copies(2)
    driver = browse(report(pages)[1])
    script = "return document.querySelector('a[download]').href"
    data = driver.execute_script(script).partition(";base64,")[2]
    assert gzip.decompress(base64.b64decode(data)).decode() == write_rows(
        row for page in pages for row in page.rows
    )


@pytest.mark.slow
def test_200_scenes_open_quickly_and_a_scene_when_opened(browse):
    driver = browse(report(copies(200))[1])
    times = driver.execute_script(
        "return JSON.stringify(performance.getEntriesByType('navigation')[0])"
    )
    assert json.loads(times)["loadEventEnd"] / 1e3 < LOADED
    scene = driver.find_element("id", "scene-7")
    assert not scene.find_elements("tag name", "svg")
    driver.execute_script("arguments[0].open = true", scene)
    assert wait(driver, lambda: len(scene.find_elements("tag name", "svg")) == 3)
    assert scene.find_element("tag name", "table").is_displayed()


@pytest.mark.slow
def test_it_prints_on_paper(browse):
    driver = browse(report(copies(2, failing=1))[1], dark=True)
    pdf = driver.execute_cdp_cmd(
        "Page.printToPDF",
        {"printBackground": True, "paperWidth": 8.27, "paperHeight": 11.69},
    )
    pages = base64.b64decode(pdf["data"]).count(b"/Type /Page\n")
    assert 2 <= pages <= 6
    driver.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": "print"})
    paper = driver.execute_script(
        "return getComputedStyle(document.body).backgroundColor"
    )
    # white on paper, also where the screen is dark
    assert paper == "rgb(254, 254, 254)"
