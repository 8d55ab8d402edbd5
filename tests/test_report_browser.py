"""A report page in a real browser: quiet, readable at 1280 and at 400 px, units switch."""

import pytest
from test_report import HOSTILE, page

from omnijax.report import SpeedAxis


@pytest.fixture(scope="module")
def address(tmp_path_factory):
    made = page(HOSTILE.replace("alert", "window.hacked="), SpeedAxis("frequency", "Hz", 1.2))
    return made.write(tmp_path_factory.mktemp("page")).as_uri()


@pytest.fixture(params=[1280, 400])
def opened(request, open_page, address):
    """The page at one width, with what it asked for and complained about."""
    return open_page(address, request.param)


def test_page_is_quiet_and_asks_for_nothing(opened, address):
    tab, seen = opened
    assert seen["errors"] == []
    assert [url for url in seen["requests"] if not url.startswith(("data:", address))] == []
    assert tab.evaluate("window.hacked") is None


def test_page_fits_the_screen_with_readable_text(opened):
    tab, _ = opened
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
    tab, _ = opened

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
