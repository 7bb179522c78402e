"""The page works in a browser: wide and narrow, with mouse and keys, without a script, on paper."""

from pathlib import Path
from typing import Any

import pytest

from flight.simulation.setup import FlightSetup
from flight.simulation.track import Track
from logs.verdict.judge_flight import judge_flight
from logs.views.report.page import write_report
from tests.browser import Browser
from tests.logs.views.report.page_in_browser import apart, changed, own_problems, picture_when, spread

pytestmark = [pytest.mark.client, pytest.mark.xdist_group("browser")]


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory, setup: FlightSetup, track: Track) -> Path:
    folder = tmp_path_factory.mktemp("report")
    verdict = judge_flight(setup, track, "completed")
    arguments: dict[str, Any] = {"ended": "completed", "versions": {"planfly": "0"}, "command": "planfly run small"}
    return write_report(folder, setup, track, verdict, **arguments)[-1]


def test_wide_page_draws_the_view_and_fills_the_tables(page: Path, tmp_path: Path) -> None:
    with Browser(tmp_path / "profile", 1200, 900) as browser:
        browser.open(page)
        browser.settle()
        assert browser.value("document.querySelector('.badge').innerText").strip()
        tables = browser.value(
            "[...document.querySelectorAll('table')].map(t => [t.tBodies[0].rows.length,"
            " [...t.tBodies[0].rows].every(r => r.innerText.trim().length > 3)])"
        )
        assert len(tables) >= 5
        assert all(rows > 0 and full for rows, full in tables)
        assert browser.value("[...document.images].every(i => i.complete && i.naturalWidth > 500)")
        browser.value("document.querySelector('#view3d').scrollIntoView()")
        first = picture_when(browser, "#view3d", lambda png: spread(png) > 60)
        assert spread(first) > 60
        assert browser.value("getComputedStyle(document.querySelector('.still')).display") == "none"
        _try_the_controls(browser, first)
        assert len(browser.printed()) > 50_000
        assert own_problems(browser) == []
        assert browser.requests == []


def _try_the_controls(browser: Browser, first: bytes) -> None:
    """Mouse, wheel, keys and buttons change the picture; Back brings it back."""
    x, y = 600.0, 250.0
    browser.mouse("mousePressed", x, y, button="left", clickCount=1)
    browser.mouse("mouseMoved", x + 120, y + 40, button="left", buttons=1)
    browser.mouse("mouseReleased", x + 120, y + 40, button="left", clickCount=1)
    pictures = [first]
    for act in (
        lambda: None,
        lambda: browser.mouse("mouseWheel", x, y, deltaX=0, deltaY=-240),
        lambda: browser.key("ArrowLeft"),
        lambda: browser.key("-"),
        lambda: browser.value("document.querySelector('[data-do=top]').click()"),
        lambda: browser.value("document.querySelector('[data-do=stretch]').click()"),
    ):
        act()
        before = pictures[-1]
        pictures.append(picture_when(browser, "#view3d", lambda png, before=before: changed(png, before) > 0.005))
        assert changed(pictures[-1], before) > 0.005, len(pictures)
    browser.value("document.querySelector('[data-do=home]').click()")
    last = picture_when(browser, "#view3d", lambda png: apart(png, first) < 0.01)
    assert apart(last, first) < 0.01


def test_narrow_page_fits_a_phone(page: Path, tmp_path: Path) -> None:
    with Browser(tmp_path / "profile", 420, 860, phone=True) as browser:
        browser.open(page)
        browser.settle()
        assert browser.value("document.documentElement.scrollWidth") <= 420
        assert spread(picture_when(browser, "#view3d", lambda png: spread(png) > 40)) > 40
        small = browser.value(
            "[...document.querySelectorAll('button, nav a')]"
            ".map(b => b.getBoundingClientRect().height).filter(h => h < 24)"
        )
        assert small == []
        assert own_problems(browser) == []


def test_without_a_script_the_still_picture_stands(page: Path, tmp_path: Path) -> None:
    with Browser(tmp_path / "profile", 1200, 900) as browser:
        browser.call("Emulation.setScriptExecutionDisabled", value=True)
        browser.open(page)
        still = browser.value("getComputedStyle(document.querySelector('.still')).display")
        assert still == "block"
        assert browser.value("getComputedStyle(document.querySelector('#view3d')).display") == "none"
        assert spread(browser.picture(".still")) > 60


def test_on_paper_the_still_picture_stands(page: Path, tmp_path: Path) -> None:
    with Browser(tmp_path / "profile", 1200, 900) as browser:
        browser.open(page)
        browser.call("Emulation.setEmulatedMedia", media="print")
        assert browser.value("getComputedStyle(document.querySelector('#view3d')).display") == "none"
        assert browser.value("getComputedStyle(document.querySelector('.still')).display") == "block"
        shown = "[...document.querySelectorAll('SELECTOR')].map(e => getComputedStyle(e).display)"
        assert set(browser.value(shown.replace("SELECTOR", ".chart, .player, .key"))) == {"none"}
        assert set(browser.value(shown.replace("SELECTOR", ".picture"))) == {"block"}
