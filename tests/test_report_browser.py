"""A report page in a real browser: quiet, readable at 1280 and at 400 px, units switch."""

import shutil

import pytest
from test_report import HOSTILE, page

from omnijax.report import SpeedAxis

FLAGS = ["--no-sandbox", "--disable-gpu"]


@pytest.fixture(scope="module")
def browser():
    playwright = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
    chromium = shutil.which("chromium") or shutil.which("chromium-browser")
    if chromium is None:
        pytest.skip("no chromium on this machine")
    with playwright.sync_playwright() as p:
        found = p.chromium.launch(executable_path=chromium, args=FLAGS)
        yield found
        found.close()


@pytest.fixture(scope="module")
def address(tmp_path_factory):
    made = page(HOSTILE.replace("alert", "window.hacked="), SpeedAxis("frequency", "Hz", 1.2))
    return made.write(tmp_path_factory.mktemp("page")).as_uri()


@pytest.fixture(params=[1280, 400])
def opened(request, browser, address):
    """The page at one width, with what it asked for and complained about."""
    tab = browser.new_page(viewport={"width": request.param, "height": 800})
    asked, complaints = [], []
    tab.on("request", lambda r: asked.append(r.url))
    tab.on("console", lambda m: complaints.append(m.text) if m.type == "error" else None)
    tab.on("pageerror", lambda e: complaints.append(str(e)))
    tab.goto(address)
    yield tab, asked, complaints
    tab.close()


def test_page_is_quiet_and_asks_for_nothing(opened, address):
    tab, asked, complaints = opened
    assert complaints == []
    assert [url for url in asked if not url.startswith(("data:", address))] == []
    assert tab.evaluate("window.hacked") is None


def test_page_fits_the_screen_with_readable_text(opened):
    tab, *_ = opened
    width = tab.viewport_size["width"]
    assert tab.evaluate("document.documentElement.scrollWidth") <= width
    assert tab.evaluate("parseFloat(getComputedStyle(document.body).fontSize)") >= 16
    sizes = tab.evaluate(
        """[...document.querySelectorAll('figure svg text')]
           .filter(t => t.getBoundingClientRect().width > 0)
           .map(t => t.getBoundingClientRect().height)"""
    )
    assert sizes and min(sizes) >= 9


def test_unit_buttons_switch_the_axis(opened):
    tab, *_ = opened

    def shown():
        return tab.evaluate(
            """[...document.querySelectorAll('.drawing')].filter(d => !d.hidden)
               .map(d => d.dataset.unit)"""
        )

    assert shown() == ["Hz"]
    for unit in ("rpm", "orders", "rad/s"):
        tab.click(f'.units button[data-unit="{unit}"]')
        assert shown() == [unit]
        pressed = tab.get_attribute(f'.units button[data-unit="{unit}"]', "aria-pressed")
        assert pressed == "true"
