"""The page of a report works in a browser: wide, narrow, by mouse and keys, light, dark, on paper, without scripts."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from flight.mission.route import route_points
from flight.simulation.setup import FlightSetup
from flight.simulation.track import Track
from logs.recording.reader import FlightLog, read_log
from logs.verdict.judge_flight import judge_flight
from logs.verdict.judge_geometry import judge_geometry
from logs.views.report.compare import compare_logs, write_comparison
from logs.views.report.identification import identification_page
from logs.views.report.page import write_report
from tests.browser import Browser
from tests.logs.blank_pictures import draw_nothing
from tests.logs.views.report.page_in_browser import (
    apart,
    changed,
    grave_findings,
    own_problems,
    picture_when,
    prefer,
    show_all_charts,
    show_chart,
    spread,
    until,
)
from tests.logs.views.report.test_identification import facts
from tests.soak import SOAK, some

pytestmark = [pytest.mark.client, pytest.mark.xdist_group("browser")]

TIME = "document.querySelector('[data-chart=time]')"
READ_OUT = (
    "Object.fromEntries([...document.querySelectorAll('.readout div')].map(d => [...d.children].map(c => c.innerText)))"
)


@pytest.fixture(scope="module")
def browser(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Browser]:
    with Browser(tmp_path_factory.mktemp("profile"), 1400, 900) as browser:
        yield browser


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory, browser: Browser, setup: FlightSetup, track: Track) -> Path:
    folder = tmp_path_factory.mktemp("report")
    verdict = judge_flight(setup, track, "completed")
    arguments: dict[str, Any] = {"ended": "completed", "versions": {"planfly": "0"}, "command": "planfly run small"}
    with pytest.MonkeyPatch.context() as patch:
        if not SOAK:
            draw_nothing(patch)
        page = write_report(folder, setup, track, verdict, **arguments)[-1]
    browser.open(page)
    return page


def middle(browser: Browser, element: str) -> tuple[float, float, float, float]:
    """Bring an element's middle into the screen's; returns where that is, and its half width and height, pixels."""
    browser.value(f"{element}.scrollIntoView({{block: 'center'}})")
    browser.settle()
    box = browser.value(
        f"(() => {{ const b = {element}.getBoundingClientRect(); return [b.x, b.y, b.width, b.height]; }})()"
    )
    x, y, width, height = box
    return x + width / 2, y + height / 2, width / 2, height / 2


@pytest.mark.usefixtures("page")
def test_wide_page_draws_the_view_and_fills_the_tables(browser: Browser) -> None:
    prefer(browser, "light", 1200)
    browser.value("for (const fold of document.querySelectorAll('details')) fold.open = true")
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


SECTIONS = "document.querySelectorAll('details.fold')"


@pytest.mark.parametrize("width", [1400, 420])
def test_the_first_screen_answers_and_the_page_is_short(browser: Browser, page: Path, width: int) -> None:
    prefer(browser, "light", width)
    browser.open(page)
    until(browser, "document.querySelector('[data-chart=map]').dataset.drawn")
    browser.settle()
    shown = "['.badge', '.summary', '[data-chart=map]'].map(one => document.querySelector(one))"
    low = browser.value(f"{shown}.map(one => one.getBoundingClientRect().bottom)")
    assert max(low if width == 1400 else low[:2]) <= 900
    assert browser.value("document.documentElement.scrollHeight") <= 10_000
    assert browser.value("document.documentElement.scrollWidth") <= width


# The pairs of a chart's labels that cover each other, by the boxes that the browser gives their glyphs.
COVERED = """(name => {
    const labels = [...document.querySelectorAll(`[data-chart=${name}] .textpoint text`)].filter(e => e.textContent);
    const boxes = labels.map(e => [e.textContent, e.getBoundingClientRect()]).filter(([, b]) => b.width);
    const cover = (a, b) => a.left < b.right && b.left < a.right && a.top < b.bottom - 4 && b.top < a.bottom - 4;
    const pairs = boxes.flatMap((one, k) => boxes.slice(0, k).map((other) => [one, other]));
    const covered = pairs.filter(([one, other]) => cover(one[1], other[1]));
    return [boxes.length, covered.map(([one, other]) => [one[0], other[0]])];
})"""


@pytest.fixture(scope="module")
def landing_page(tmp_path_factory: pytest.TempPathFactory, setup: FlightSetup) -> Path:
    """Twenty waypoints within 400 m of the destination, as in a landing sequence, after a leg of 2 km."""
    angles = np.linspace(0.0, 4.0 * np.pi, 20)
    circuit = np.column_stack([700.0 + 200.0 * np.cos(angles), 800.0 + 120.0 * np.sin(angles), np.full(20, 440.0)])
    points = np.vstack([[-900.0, -900.0, 420.0], circuit, [900.0, 900.0, 440.0]])
    route = replace(setup.route, points=route_points(points, 25.0, item=np.arange(len(points)) - 1))
    setup = replace(setup, route=route, plan=None)
    arguments: dict[str, Any] = {"ended": None, "versions": {"planfly": "0"}, "command": "planfly check small"}
    with pytest.MonkeyPatch.context() as patch:
        draw_nothing(patch)
        return write_report(tmp_path_factory.mktemp("landing"), setup, None, judge_geometry(setup), **arguments)[-1]


@pytest.fixture
def browser_at_landing(browser: Browser, page: Path, landing_page: Path) -> Iterator[Browser]:
    """The browser at the page of the landing, and afterwards at the page of the other tests again."""
    browser.open(landing_page)
    yield browser
    browser.open(page)


@pytest.mark.parametrize("width", [1400, 420])
def test_labels_cover_no_other_label_at_any_zoom(browser_at_landing: Browser, width: int) -> None:
    browser = browser_at_landing
    prefer(browser, "light", width)
    for name in ("map", "profile"):
        show_chart(browser, name)
        count, covered = browser.value(f"{COVERED}('{name}')")
        assert (count >= 5, covered) == (True, []), name
    show_chart(browser, "map")
    few, _ = browser.value(f"{COVERED}('map')")
    chart = "document.querySelector('[data-chart=map]')"
    browser.value(f"Plotly.relayout({chart}, {{'xaxis.range': [0.4, 1], 'yaxis.range': [0.6, 1]}}).then(() => 1)")
    browser.settle()
    # What had no room is there where a reader zooms in.
    until(browser, f"{COVERED}('map')[0] > {few}")
    assert browser.value(f"{COVERED}('map')")[1] == []


def test_a_link_opens_its_section_and_paper_all(browser: Browser, page: Path) -> None:
    prefer(browser, "light", 1400)
    browser.open(page)
    opened = f"[...{SECTIONS}].filter(fold => fold.open).map(fold => fold.parentNode.id)"
    assert browser.value(opened) == []
    browser.value("document.querySelector('nav a[href=\"#legs\"]').click()")
    assert browser.value(opened) == ["legs"]
    show_chart(browser, "energy")
    browser.value("window.dispatchEvent(new Event('beforeprint'))")
    assert len(browser.value(opened)) == browser.value(f"{SECTIONS}.length") > 5
    browser.value("window.dispatchEvent(new Event('afterprint'))")
    assert browser.value(opened) == ["energy", "legs"]


@pytest.mark.usefixtures("page")
def test_a_chart_tells_values_with_units_zooms_and_moves_the_aircraft(browser: Browser) -> None:
    prefer(browser, "light", 1400)
    show_chart(browser, "time")
    x, y, across, _ = middle(browser, f"{TIME}.querySelector('.nsewdrag')")
    browser.mouse("mouseMoved", x, y)
    until(browser, f"{TIME}.querySelector('.hoverlayer').textContent.includes('m/s')")
    words = browser.value(f"{TIME}.querySelector('.hoverlayer').textContent")
    # All panels are read out together, at one time.
    assert all(unit in words for unit in (" s", "m/s", "°", " g", " m"))
    before = browser.value(f"{TIME}.layout.xaxis.range")
    browser.mouse("mousePressed", x, y, button="left", clickCount=1)
    browser.mouse("mouseReleased", x, y, button="left", clickCount=1)
    until(browser, "Number(document.querySelector('.player input').value) > 0")
    moment = float(browser.value("document.querySelector('.player input').value"))
    assert moment == pytest.approx(np.mean(before), abs=0.1 * np.ptp(before))
    browser.mouse("mousePressed", x - across / 2, y, button="left", clickCount=1)
    browser.mouse("mouseMoved", x, y, button="left", buttons=1)
    browser.mouse("mouseReleased", x, y, button="left", clickCount=1)
    until(browser, f"{TIME}.layout.xaxis.range[1] < {0.75 * before[1]}")
    after = browser.value(f"{TIME}.layout.xaxis.range")
    assert after == pytest.approx([0.25 * before[1], 0.5 * before[1]], rel=0.1)


@pytest.mark.usefixtures("page")
def test_no_legend_covers_a_chart(browser: Browser) -> None:
    prefer(browser, "light", 1400)
    for name in show_all_charts(browser):
        chart = f"document.querySelector('[data-chart={name}]')"
        edges = "(b => [b.top, b.bottom])({}.querySelector('{}').getBoundingClientRect())"
        buttons, legend, panel = (
            browser.value(edges.format(chart, part)) for part in (".modebar", ".legend", ".nsewdrag")
        )
        assert buttons[1] <= legend[0] + 6.0, name
        assert legend[1] <= panel[0] + 1.0, name


@pytest.mark.usefixtures("page")
def test_the_slider_moves_the_aircraft_and_its_read_out(browser: Browser, track: Track) -> None:
    prefer(browser, "light", 1400, 600)
    slider = "document.querySelector('.player input')"
    browser.value("document.querySelector('#view3d').scrollIntoView()")
    browser.value(f"{slider}.value = 0; {slider}.dispatchEvent(new Event('input'))")
    browser.value(f"{slider}.focus()")
    first = picture_when(browser, "#view3d", lambda png: spread(png) > 60)
    for _ in range(3):
        browser.key("ArrowRight")
    browser.settle()
    said = browser.value(READ_OUT)
    assert said["time"] == "3.0 s"
    row = int(np.searchsorted(track.time, 3.0))
    assert float(said["altitude"].split()[0].replace("−", "-")) == pytest.approx(track.position[row, 2], abs=1.0)
    assert float(said["airspeed"].split()[0]) == pytest.approx(float(track.airspeed[row]), abs=0.3)
    assert {"leg", "above ground", "bank"} <= set(said)
    assert browser.value(f"{slider}.getAttribute('aria-valuetext')").startswith("3.0 s, leg ")
    later = picture_when(browser, "#view3d", lambda png: changed(png, first) > 5e-4)
    assert changed(later, first) > 5e-4
    # The last two seconds at five times their speed.
    browser.value(f"{slider}.value = {float(track.time[-1]) - 2.0}; {slider}.dispatchEvent(new Event('input'))")
    speed = "document.querySelector('.player select')"
    browser.value(f"{speed}.value = '5'; {speed}.dispatchEvent(new Event('change'))")
    browser.value("document.querySelector('.player button').click()")
    until(browser, f"Number({slider}.value) >= {float(track.time[-1]) - 0.01}")
    assert browser.value("document.querySelector('.player button').innerText").endswith("Play")


@pytest.mark.usefixtures("page")
def test_names_stay_while_the_view_is_turned(browser: Browser) -> None:
    prefer(browser, "light", 1400, 600)
    browser.value("document.querySelector('[data-do=home]').click()")
    browser.settle()
    names = set(browser.value("document.querySelector('#view3d').dataset.labels").split("|"))
    assert {"start", "destination"} < names
    for _ in range(6):
        browser.value("for (let k = 0; k < 8; k++) document.querySelector('[data-do=left]').click()")
        browser.settle()
        assert set(browser.value("document.querySelector('#view3d').dataset.labels").split("|")) == names


def test_a_finger_scrolls_the_page_past_a_chart(browser: Browser, page: Path) -> None:
    prefer(browser, "light", 390)
    browser.open(page)
    show_chart(browser, "profile")
    assert browser.value("document.querySelector('[data-chart=profile]').layout.dragmode") is False
    until(browser, "document.documentElement.scrollWidth <= 390")


# The page's other scheme and widths are looked at above and below; axe takes five seconds for each.
SCREENS = some([("dark", 390), ("light", 1400), ("dark", 1400), ("light", 390)], 4)


@pytest.mark.usefixtures("page")
@pytest.mark.parametrize(("scheme", "width"), SCREENS)
def test_axe_finds_nothing_grave_and_nothing_stands_out(browser: Browser, scheme: str, width: int) -> None:
    _look_at(browser, scheme, width)


def _look_at(browser: Browser, scheme: str, width: int) -> None:
    prefer(browser, scheme, width)
    browser.settle()
    assert show_all_charts(browser)
    assert browser.value("document.documentElement.scrollWidth") <= width
    too_wide = (
        "[...document.querySelectorAll('.chart svg, .view')].filter(e => e.getBoundingClientRect().right > innerWidth)"
    )
    assert browser.value(f"{too_wide}.length") == 0
    paper = "getComputedStyle(document.body).backgroundColor.match(/\\d+/g).map(Number)"
    assert (max(browser.value(paper)) < 60) == (scheme == "dark")
    # Charts are drawn in the colours of the page.
    ink = browser.value("getComputedStyle(document.body).getPropertyValue('--ink').trim()")
    until(browser, f"document.querySelector('.chart').layout.font.color === '{ink}'")
    assert own_problems(browser) == []
    assert browser.requests == []
    assert grave_findings(browser) == []


@pytest.mark.usefixtures("page")
def test_paper_is_light_whatever_the_screen(browser: Browser) -> None:
    features = [{"name": "prefers-color-scheme", "value": "dark"}]
    browser.call("Emulation.setEmulatedMedia", media="print", features=features)
    assert browser.value("getComputedStyle(document.body).backgroundColor") == "rgb(255, 255, 255)"
    assert browser.value("getComputedStyle(document.body).getPropertyValue('--ink').trim()") == "#1d1d1f"


@pytest.mark.usefixtures("page")
def test_narrow_page_fits_a_phone(browser: Browser) -> None:
    prefer(browser, "light", 420)
    browser.settle()
    assert browser.value("document.documentElement.scrollWidth") <= 420
    assert spread(picture_when(browser, "#view3d", lambda png: spread(png) > 40)) > 40
    # Plotly's own buttons stand apart from each other.
    own = "[...document.querySelectorAll('button:not(.modebar-btn), nav a')]"
    small = browser.value(f"{own}.map(b => b.getBoundingClientRect().height).filter(h => h < 24)")
    assert small == []
    assert own_problems(browser) == []


@pytest.mark.usefixtures("page")
def test_paper_has_every_chart_in_its_width_and_a_copy_of_the_view(browser: Browser) -> None:
    """Also the charts that nobody scrolled to; A4 between margins of 14 mm is 182 mm or 688 px wide."""
    prefer(browser, "light", 1200)
    until(browser, "document.querySelector('.chart').dataset.drawn")
    browser.call("Emulation.setEmulatedMedia", media="print")
    browser.value("window.dispatchEvent(new Event('beforeprint'))")
    until(browser, "[...document.querySelectorAll('.chart')].every(e => e.querySelector('.main-svg'))")
    shown = "[...document.querySelectorAll('SELECTOR')].map(e => getComputedStyle(e).display)"
    assert set(browser.value(shown.replace("SELECTOR", ".chart"))) == {"block"}
    assert set(browser.value(shown.replace("SELECTOR", ".picture, .player, .key"))) == {"none"}
    charts = "[...document.querySelectorAll('.chart .main-svg')]"
    # A chart that was on its way at the width of the screen may come after.
    until(browser, f"{charts}.every(e => e.getBoundingClientRect().width <= 688)")
    widths = browser.value(f"{charts}.map(e => e.getBoundingClientRect().width)")
    assert 600 < min(widths) <= max(widths) <= 688
    # The copy holds what WebGL drew: terrain, sky and lines have many colours.
    copied = """(() => { const c = document.querySelector('.view .paper'), colours = new Set();
        const data = c.getContext('2d').getImageData(0, 0, c.width, c.height).data;
        for (let k = 0; k < data.length; k += 4000) colours.add(data.slice(k, k + 4).join());
        return colours.size; })()"""
    assert browser.value(copied) > 20
    browser.value("window.dispatchEvent(new Event('afterprint'))")
    browser.call("Emulation.setEmulatedMedia", media="screen")


def test_without_a_script_map_and_profile_are_pictures_and_the_rest_says_how_to_draw_it(
    browser: Browser, page: Path
) -> None:
    prefer(browser, "light", 1200)
    browser.call("Emulation.setScriptExecutionDisabled", value=True)
    browser.open(page)
    assert browser.value("getComputedStyle(document.querySelector('#view3d')).display") == "none"
    assert browser.value("document.querySelectorAll('.picture img').length") == 2
    assert "planfly report LOG --pictures" in browser.value("document.querySelector('.still').textContent")
    assert browser.value("getComputedStyle(document.querySelector('.still')).display") == "block"
    browser.call("Emulation.setScriptExecutionDisabled", value=False)


@pytest.mark.skipif(not SOAK, reason="the same charts, twice: in make soak")
def test_the_comparison_has_charts_for_both_and_nothing_grave(
    browser: Browser, log_file: Path, other: FlightLog, tmp_path: Path
) -> None:
    found = compare_logs(read_log(log_file), other, names=("a.mcap", "<b>.mcap"))
    prefer(browser, "dark", 390)
    browser.open(write_comparison(tmp_path, found)[-1])
    _look_at(browser, "dark", 390)
    legend = browser.value("document.querySelector('[data-chart=map] .legend').textContent")
    assert "a.mcap" in legend
    assert "<b>.mcap" in legend


def test_an_identification_is_shown_wide_and_narrow(browser: Browser, tmp_path: Path) -> None:
    file = tmp_path / "identify.html"
    file.write_text(identification_page(facts()), encoding="utf-8")
    browser.problems.clear()
    browser.requests.clear()
    for width in (1280, 390):
        prefer(browser, "light", width)
        if SOAK or width == 1280:
            browser.open(file)
        browser.settle()
        assert browser.value("document.querySelectorAll('.chart').length") == 4
        browser.value("document.querySelector('.chart').scrollIntoView()")
        # The library is unpacked first.
        until(browser, "document.querySelector('.chart').dataset.drawn")
        # No part of the page is wider than the screen.
        until(browser, f"document.documentElement.scrollWidth <= {width}")
        assert browser.problems == []
        assert browser.requests == []
