"""report.html in a real browser.

Quiet, readable in the dark, its links and its download right.
"""

import base64
import gzip
import json

from pytest import importorskip, mark

from fourbar_validation.compare.rows import write_rows
from fourbar_validation.report.html import ALL_OPEN
from tests.support.checkout import read
from tests.validation.report.test_report import copies, report

importorskip(
    "selenium",
    reason="pages are driven by selenium: pip install selenium",
)
pytestmark = mark.slow

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


@mark.parametrize("dark", [False, True])
def test_all_text_is_readable(browse, dark):
    """Also in the matrix of the benchmark, with its grounds of green, yellow and red.

    A light paper of a picture would hide the light text of a dark page.
    """
    driver = browse(report(copies(2, failing=1))[1], dark=dark)
    require_contrast(driver)
    assert driver.find_elements("css selector", "svg")
    assert driver.execute_script(PAPERS) == []
    page = read("docs/examples/benchmark.html")
    require_contrast(browse(page[: page.index("</table>")], dark=dark))


@mark.parametrize("count", [2, ALL_OPEN + 2])
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


def test_the_download_is_results_csv(browse):
    pages = copies(2)
    driver = browse(report(pages)[1])
    script = "return document.querySelector('a[download]').href"
    data = driver.execute_script(script).partition(";base64,")[2]
    assert gzip.decompress(base64.b64decode(data)).decode() == write_rows(
        row for page in pages for row in page.rows
    )


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
