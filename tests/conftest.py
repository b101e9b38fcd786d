"""What tests of several folders need: a headless Chromium, where the machine has one.

Programs that Ctrl-C stops.
"""

import gc
import os
import shutil
import signal
import sys

from pytest import fixture, hookimpl, mark, skip

# NumPy and SciPy are loaded after this. Each worker of the tests has a core of its own:
# threads that wait for one another would take time from the other worker.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

CHROMIUM = (
    shutil.which("chromium")
    or shutil.which("chromium-browser")
    or shutil.which("google-chrome")
)
DRIVER = shutil.which("chromedriver")
FLAGS = (
    "--headless",
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--disable-dev-shm-usage",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--hide-scrollbars",
)

HERE = {"posix": hasattr(os, "fork"), "linux": sys.platform == "linux"}


def pytest_collection_modifyitems(items):
    for item in items:
        for system in (
            name
            for name, here in HERE.items()
            if not here and item.get_closest_marker(name)
        ):
            item.add_marker(mark.skip(reason=f"of {system} alone"))


@hookimpl(wrapper=True)
def pytest_collection():
    """Modules and tests are kept to the end: looking for garbage among them takes a
    sixth of the time in which they are loaded.
    """
    gc.disable()
    collected = yield
    gc.freeze()
    gc.enable()
    return collected


@fixture
def interruptible():
    """Programs started here heed SIGINT.

    A job in the background ignores it, and what is ignored would be inherited.
    """
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@fixture(scope="session")
def chromium(tmp_path_factory):
    """One browser for all tests of pages; each test opens its own page in it."""
    if CHROMIUM is None or DRIVER is None:
        skip(
            "pages are tested in Chromium: install chromium and chromedriver"
            " (chromium-driver)"
        )
    from selenium import webdriver

    options = webdriver.ChromeOptions()
    for flag in (*FLAGS, f"--user-data-dir={tmp_path_factory.mktemp('chromium')}"):
        options.add_argument(flag)
    options.binary_location = CHROMIUM
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    driver = webdriver.Chrome(options=options, service=webdriver.ChromeService(DRIVER))
    yield driver
    driver.quit()


@fixture
def browse(chromium, tmp_path):
    """Opens page text at a width, light or dark.

    After the test the console must be empty.
    """

    def open_page(text, width=1100, *, dark=False, still=False):
        path = tmp_path / "page.html"
        path.write_text(text, encoding="utf-8")
        metrics = {
            "width": width,
            "height": 900,
            "deviceScaleFactor": 1,
            "mobile": False,
        }
        chromium.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", metrics)
        media = [
            {"name": "prefers-color-scheme", "value": "dark" if dark else "light"},
            {
                "name": "prefers-reduced-motion",
                "value": "reduce" if still else "no-preference",
            },
        ]
        chromium.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": media})
        chromium.get(path.as_uri())
        return chromium

    yield open_page
    # the browser goes on to the tests of other pages, for which nothing is printed
    chromium.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": ""})
    assert chromium.get_log("browser") == []
