"""The page in a real Chromium: what hands do, what is shown, and what happens when the server goes."""

import base64
import contextlib
import http.server
import json
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from flight.mission.items import MissionItem
from flight.mission_files.formats import mission_text, parse_mission
from planfly.studio.autosave import mission_from_data
from tests.browser import Browser
from tests.logs.views.report.page_in_browser import grave_findings, prefer
from tests.planfly.studio.drafts import drawn_session
from tests.planfly.studio.served import Served, served
from tests.soak import SOAK, at_most, only_in_soak, scaled

ROOT = Path(__file__).parents[3]
TABS = ("verdict", "items", "plan", "settings", "files")
STATE = "document.getElementById('{}').dataset.state"
READY = "document.querySelectorAll('.mark').length > 1 && document.querySelector('#map-box image[href]') !== null"
CENTRE = """(() => {{ const r = document.querySelectorAll({0})[{1}].getBoundingClientRect();
 return [r.x + r.width / 2, r.y + r.height / 2]; }})()"""
# Pairs of names that stand over each other, or over a dot or a diamond.
OVERLAPS = """(() => { let n = 0;
 const boxes = [...document.querySelectorAll('.names text')].map((one) => one.getBoundingClientRect());
 const marks = [...document.querySelectorAll('.mark .dot, .diamonds path')].map((one) => one.getBoundingClientRect());
 boxes.forEach((a, i) => [...boxes.slice(i + 1), ...marks].forEach((b) => {
 n += a.left < b.right - 1 && b.left < a.right - 1 && a.top < b.bottom - 2 && b.top < a.bottom - 2; }));
 return n; })()"""
# Parts of the mission that the map does not show, or that lie under its legend and its compass.
UNSEEN = """(() => { const [box, ...tools] = ['#map', '#legend', '#compass'].map((one) =>
 document.querySelector(one).getBoundingClientRect());
 const parts = [...document.querySelectorAll('.mark .dot, .legs path')].map((one) => one.getBoundingClientRect());
 return parts.filter((a) =>
 a.left < box.left || a.right > box.right || a.top < box.top || a.bottom > box.bottom ||
 tools.some((b) => a.left < b.right && b.left < a.right && a.top < b.bottom && b.top < a.bottom)).length; })()"""
UNNAMED = """[...document.querySelectorAll('button, input, select, [role=button]')].filter((one) =>
 one.checkVisibility() && !(one.ariaLabel || one.textContent.trim() || one.labels?.length || one.title))
 .map((one) => one.outerHTML)"""


class Studio:
    """A studio of a mission file: outside a soak in a thread of this process, which has imported what it needs."""

    def __init__(self, folder: Path) -> None:
        self.folder, self.file = folder, folder / "m.waypoints"
        self.file.write_text(mission_text(drawn_session(8, 8).mission, "waypoints"), encoding="utf-8")
        self.port = 0
        self.start()

    def start(self) -> None:
        """Start it, on the port of the last time."""
        if SOAK:
            self._start_process()
        else:
            self._ending = contextlib.ExitStack()
            started = served(self.file, scenario="jacksboro", port=self.port, keep=self.folder / "kept")
            self.address = self._ending.enter_context(started).address
        self.port = int(self.address.split(":")[2].partition("/")[0])

    def _start_process(self) -> None:
        command = [sys.executable, "-m", "planfly", "studio", "m.waypoints", "--scenario", "jacksboro", "--no-browser"]
        self.process = subprocess.Popen(
            [*command, "--port", str(self.port), "--keep", "kept"],
            cwd=self.folder,
            stdout=subprocess.PIPE,
            text=True,
            env=os.environ | {"PYTHONPATH": str(ROOT)},
        )
        assert self.process.stdout is not None
        line = ""
        while "#t=" not in line:
            line = self.process.stdout.readline()
            assert self.process.poll() is None
        self.address = line.split()[-1]

    def kill(self) -> None:
        """End it, in a soak as a crash does."""
        self.end(signal.SIGKILL)

    def end(self, how: int = signal.SIGTERM) -> None:
        """End it, and what it wrote to."""
        if not SOAK:
            self._ending.close()
            return
        self.process.send_signal(how)
        self.process.communicate(timeout=20)


# What a page of another origin can get of the studio: fetched texts, a frame's document, a script, a session.
TAKEN = """(async (base, token) => {
 const text = (path, mode) => fetch(base + path, { mode }).then((r) => r.status + r.type, () => 'refused');
 const part = (name, more) => new Promise((done) => {
  const one = Object.assign(document.createElement(name), more);
  one.onload = () => {
   try { done(name === 'iframe' ? one.contentDocument.title || 'empty' : 'loaded'); } catch { done('refused'); } };
  one.onerror = () => done('refused');
  document.body.append(one); });
 const session = new Promise((done) => {
  const socket = new WebSocket(base.replace('http', 'ws') + '/session');
  socket.onopen = () => socket.send(JSON.stringify({ kind: 'hello', token }));
  socket.onmessage = () => done('answered');
  socket.onclose = () => done('refused'); });
 return [await text('/', 'cors'), await text('/studio.js', 'no-cors'), await part('iframe', { src: base + '/' }),
  await part('script', { src: base + '/link.js', type: 'module' }), await session]; })"""


def test_a_page_of_another_origin_or_name_gets_nothing_even_with_the_token(studio: Studio, tmp_path: Path) -> None:
    """Another port of this machine, and a name that an attacker lets point to it (DNS rebinding)."""
    other = http.server.ThreadingHTTPServer(("127.0.0.1", 0), http.server.SimpleHTTPRequestHandler)
    threading.Thread(target=other.serve_forever, daemon=True).start()
    token = studio.address.partition("#t=")[2]
    flags = ("--host-resolver-rules=MAP evil.test 127.0.0.1",)
    try:
        with Browser(tmp_path / "profile", 800, 600, flags=flags) as browser:
            for name in ("127.0.0.1", "evil.test"):
                browser.go(f"http://{name}:{other.server_port}/")
                taken = browser.value(f"{TAKEN}('http://127.0.0.1:{studio.port}', '{token}')")
                assert taken == ["refused"] * 5, name
            browser.go(f"http://evil.test:{studio.port}/")
            assert browser.value("document.body.innerText") == "this host is not served here"
            taken = browser.value(f"{TAKEN}('http://evil.test:{studio.port}', '{token}')")
            assert taken == ["421basic", "421basic", "refused", "refused", "refused"]
    finally:
        other.shutdown()
        other.server_close()


@pytest.fixture(scope="module")
def studio(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Studio]:
    running = Studio(tmp_path_factory.mktemp("studio-page"))
    yield running
    running.end()


@pytest.fixture(scope="module")
def browser(studio: Studio, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Browser]:
    with Browser(tmp_path_factory.mktemp("chromium"), 1400, 900) as opened:
        yield opened


@pytest.fixture
def page(browser: Browser, studio: Studio) -> Browser:
    """The page, open with its mission and its flight."""
    browser.problems.clear()
    browser.requests.clear()
    if browser.value("location.pathname") != "/" or not browser.value(READY):
        browser.go(studio.address)
        browser.wait_for(READY)
    browser.wait_for("['ok', 'fail', 'open'].includes(" + STATE.format("flown") + ")")
    return browser


def centre(page: Browser, selector: str, number: int = 0) -> list[float]:
    found: list[float] = page.value(CENTRE.format(json.dumps(selector), number))
    return found


def drag(page: Browser, start: list[float], way: tuple[float, float], *, let_go: bool = True) -> None:
    x, y = start
    page.mouse("mousePressed", x, y, button="left", clickCount=1)
    for k in range(1, 6):
        page.mouse("mouseMoved", x + k * way[0] / 5, y + k * way[1] / 5, button="left", buttons=1)
    if let_go:
        page.mouse("mouseReleased", x + way[0], y + way[1], button="left", clickCount=1)


def key(page: Browser, name: str, code: int, *, control: bool = False) -> None:
    for kind in ("rawKeyDown", "keyUp"):
        page.call(
            "Input.dispatchKeyEvent", type=kind, key=name, windowsVirtualKeyCode=code, modifiers=2 if control else 0
        )


def undo_text(page: Browser) -> str:
    return str(page.value("document.getElementById('undo').title"))


def undo_all(page: Browser) -> None:
    """Undo until nothing is left to undo."""
    while not page.value("document.getElementById('undo').disabled"):
        rev = page.value("document.documentElement.dataset.rev")
        page.value("document.getElementById('undo').click()")
        page.wait_for(f"document.documentElement.dataset.rev !== '{rev}'")


def marks(page: Browser) -> int:
    return int(page.value("document.querySelectorAll('.mark').length"))


def saved(page: Browser) -> str:
    """The mission as the page saves it."""
    catch = (
        "window.kept = []; URL.createObjectURL = (blob) => { blob.text().then((t) => kept.push(t)); return 'blob:x'; }"
    )
    page.value(f"{catch}; HTMLAnchorElement.prototype.click = () => {{}}; 1")
    page.value("document.getElementById('tab-files').click()")
    page.value(
        "[...document.querySelectorAll('#panel-files button')].find((b) => b.textContent === '.waypoints').click()"
    )
    text = page.wait_for("window.kept.length && kept[0]")
    return str(text)


def kept_items(studio: Studio) -> list[tuple[MissionItem, ...]]:
    """The items of each mission that is kept, as a file has them."""
    first = drawn_session(8, 8).mission
    kept = [json.loads(file.read_text())["mission"] for file in (studio.folder / "kept").glob("*.json")]
    return [parse_mission(mission_text(mission_from_data(one, first), "waypoints"), "m").items for one in kept]


def test_it_opens_with_the_mission_and_asks_for_nothing_elsewhere(page: Browser, studio: Studio) -> None:
    assert marks(page) == len(drawn_session(8, 8).mission_message()["items"])
    assert page.value("location.hash + location.search") == ""
    own = f"http://127.0.0.1:{studio.port}/"
    assert [one for one in page.requests if not one.startswith((own, "blob:"))] == []
    assert page.problems == []
    assert page.value(OVERLAPS) == 0
    assert page.value(UNSEEN) == 0
    assert page.value(UNNAMED) == []
    lines = page.value("[...document.querySelectorAll('#legend li')].map((one) => one.textContent)")
    assert {"passes", "near a limit", "fails", "not judged in full", "flown", "missile\u2019s reach"} <= set(lines)
    # Open, the legend covers none of the mission either.
    page.value("document.getElementById('legend').open = true")
    page.wait_for("document.getElementById('legend').offsetHeight > 100")
    page.wait_for(f"{UNSEEN} === 0")
    page.value("document.getElementById('legend').open = false")
    # The wind of the scenario; the arrow points to where it blows.
    assert page.value("document.getElementById('compass').ariaLabel") == "North is up; wind 5.0 m/s from 250\u00b0"
    assert page.value("document.querySelector('#compass .wind').getAttribute('transform')") == "rotate(250)"


# The compass of a forecast's wind: its words, as they are shown and as they are read out.
FORECAST_COMPASS = """import('/legend.js').then(({ drawCompass }) => {
  const box = document.createElement('p');
  drawCompass(box, { wind_speed: 4, wind_from: 300, forecast: 'forecast a.nc' });
  return [box.querySelector('span').textContent, box.ariaLabel];
})"""


def test_the_compass_turns_with_the_scene_and_says_which_wind_it_has(page: Browser) -> None:
    """The scene is turned by half a radian at first, north to the right, and by 0.008 for each pixel of a drag."""
    label = "document.getElementById('compass').ariaLabel"
    shown = "document.getElementById('begin').checkVisibility()"
    assert page.value(shown)
    page.value("document.getElementById('three').click()")
    assert page.value(label) == "North is 029\u00b0 clockwise from up; wind 5.0 m/s from 250\u00b0"
    assert not page.value(shown)
    # As the scene draws it: from above, a point to the north lies to the right of up by this angle.
    north = page.value(
        "import('/scene.js').then(({ Scene }) => { const one = new Scene(document.createElement('canvas'));"
        " Object.assign(one, { east: [0, 0], north: [0, 0], base: 0, scale: 1, width: 0, height: 0 });"
        " one.tilt = Math.PI / 2;"
        " const [[x, y], [u, v]] = [one.point(0, 0, 0), one.point(0, 1, 0)];"
        " return 180 / Math.PI * Math.atan2(u - x, y - v); })"
    )
    assert north == pytest.approx(28.6, abs=0.1)
    drag(page, centre(page, "#scene"), (100.0, 0.0))
    page.wait_for(f"{label}.startsWith('North is 343\u00b0 clockwise')", 5.0)
    turned = page.value("document.querySelector('#compass .north').getAttribute('transform')")
    assert float(turned[7:-1]) == pytest.approx(28.65 - 45.84, abs=0.01)
    page.value("document.getElementById('three').click()")
    assert page.value(label).startswith("North is up")
    assert page.value(shown)
    words = "wind 4.0 m/s from 300\u00b0"
    assert page.value(FORECAST_COMPASS) == [f"{words}mean at the start", f"North is up; {words}, mean at the start"]


def test_what_is_said_of_a_saved_file_ends_with_the_next_change(page: Browser) -> None:
    saved(page)
    said = "document.querySelector('#panel-files [role=status]').textContent"
    page.wait_for(f"{said} === 'm.waypoints is downloaded by your browser. It contains the whole mission.'")
    drag(page, centre(page, ".mark .dot", 2), (40.0, 25.0))
    page.wait_for(f"{said} === 'm.waypoints was downloaded by your browser, without the changes since.'")
    undo_all(page)
    # The mission is again the saved one.
    page.wait_for(f"{said} === 'm.waypoints was downloaded by your browser.'")


def test_a_save_leaves_the_view(page: Browser) -> None:
    page.value("document.getElementById('tab-verdict').click(); document.activeElement.blur()")
    key(page, "s", 83, control=True)
    page.wait_for("document.getElementById('message').textContent.startsWith('m.waypoints is saved in ')")
    assert page.value("document.getElementById('panel-verdict').hidden") is False


def test_a_waypoint_is_dragged_judged_flown_and_undone(page: Browser) -> None:
    before = saved(page)
    drag(page, centre(page, ".mark .dot", 2), (40.0, 25.0), let_go=False)
    page.wait_for("Number(document.documentElement.dataset.shown) > 0")
    page.wait_for(STATE.format("flown") + " === 'stale'")
    shown = page.value("document.getElementById('hint').textContent")
    assert "m AMSL" in shown
    x, y = centre(page, ".mark.selected .dot")
    page.mouse("mouseReleased", x, y, button="left", clickCount=1)
    page.wait_for("document.getElementById('undo').title.startsWith('Undo: move item 3')")
    page.wait_for("['ok', 'fail', 'open'].includes(" + STATE.format("flown") + ")")
    assert saved(page) != before
    page.value("document.activeElement.blur()")
    page.mouse("mouseMoved", x + 1.0, y)
    page.wait_for("!document.getElementById('hint').hidden")
    key(page, "z", 90, control=True)
    page.wait_for("document.getElementById('undo').disabled")
    assert page.value("document.getElementById('hint').hidden")
    assert parse_mission(saved(page), "m.waypoints") == parse_mission(before, "m.waypoints")
    assert page.problems == []


def test_the_table_has_a_row_for_each_item_of_the_mission(page: Browser) -> None:
    """Also for those without a place on the map, which have no field and no button, and the heights of the ground."""
    page.value("document.getElementById('tab-items').click()")
    rows = page.value(
        "[...document.querySelectorAll('#panel-items tbody tr')].map((row) => "
        "[row.cells[0].textContent, row.classList.contains('command'), row.querySelectorAll('input, button').length])"
    )
    items = drawn_session(8, 8).mission.items
    assert [int(row[0]) for row in rows] == [item.seq for item in items]
    assert [row[1] for row in rows] == [item.command in (177, 178) for item in items]
    assert all(row[2] == (0 if row[1] else 3) for row in rows)
    page.wait_for("!isNaN(Number(document.querySelector('#panel-items td.number').textContent.replace('\u2212', '-')))")
    page.value("document.getElementById('tab-verdict').click()")


def test_header_and_cards_say_the_same_words(page: Browser) -> None:
    words = "[...document.querySelectorAll({})].map((one) => one.textContent.replace(/[: ]+/, ': '))"
    header = page.value(words.format("'.answer'"))
    assert len(header) == 2
    assert header[1] != "Flown: not yet"
    assert page.value(words.format("'#panel-verdict > .card > h2'"))[:2] == header


def test_a_drag_is_taken_back_by_escape(page: Browser) -> None:
    place = centre(page, ".mark .dot", 2)
    drag(page, place, (60.0, 0.0), let_go=False)
    key(page, "Escape", 27)
    page.mouse("mouseReleased", place[0] + 60.0, place[1], button="left", clickCount=1)
    page.settle()
    assert centre(page, ".mark .dot", 2) == pytest.approx(place, abs=1.0)
    assert page.value("document.getElementById('undo').disabled")


def test_keys_move_raise_and_delete(page: Browser) -> None:
    count = marks(page)
    x, y = centre(page, ".mark .dot", 1)
    page.mouse("mousePressed", x, y, button="left", clickCount=1)
    page.mouse("mouseReleased", x, y, button="left", clickCount=1)
    assert page.value("document.activeElement.getAttribute('aria-label')").startswith("waypoint 2,")
    key(page, "ArrowUp", 38)
    page.wait_for("document.getElementById('undo').title.startsWith('Undo: move item 2')")
    key(page, "PageUp", 33)
    page.wait_for("document.querySelector('.mark.selected') !== null")
    key(page, "Delete", 46)
    page.wait_for(f"document.querySelectorAll('.mark').length === {count - 1}")
    undo_all(page)
    assert marks(page) == count


def test_a_key_for_a_field_changes_no_waypoint(page: Browser) -> None:
    count = marks(page)
    page.value("document.querySelectorAll('.mark')[1].focus()")
    key(page, "n", 78)
    assert page.value("document.activeElement.getAttribute('aria-label')").startswith("waypoint 3,")
    page.value("document.activeElement.blur()")
    key(page, "Delete", 46)
    page.value("document.getElementById('tab-items').click()")
    page.value("document.getElementById('tab-items').focus()")
    key(page, "Backspace", 8)
    page.value(
        "(() => { const one = document.querySelectorAll('#panel-items td input')[1]; one.focus(); one.value = 99999;"
        " one.dispatchEvent(new Event('change', { bubbles: true })); })()"
    )
    # A height beyond those that the server takes is refused in a line, and the field has the item's own again.
    said = "Item 2: 99999 m: a height is from -500 to 9000 m above mean sea level."
    assert page.value("document.getElementById('message').textContent") == said
    assert page.value("Number(document.activeElement.value)") < 9000.0
    assert marks(page) == count
    undo_all(page)


CLEARED = """(() => {{ const one = {}, before = one.value; one.focus(); one.value = '';
 one.dispatchEvent(new Event('change', {{ bubbles: true }})); return [before, one.value]; }})()"""


def test_a_number_that_there_has_to_be_is_restored_where_it_is_cleared(page: Browser) -> None:
    rev = page.value("document.documentElement.dataset.rev")
    for tab, field in (
        ("items", "document.querySelectorAll('#panel-items td input')[1]"),
        ("items", "document.getElementById('raise-by')"),
        ("plan", "document.getElementById('plan-seed')"),
        *(("settings", f"document.getElementById('set-{name}')") for name in ("airspeed", "wind_speed", "ceiling")),
    ):
        page.value(f"document.getElementById('tab-{tab}').click()")
        before, after = page.value(CLEARED.format(field))
        assert before
        assert after == before, field
    # Cleared, and built anew before the browser told of it.
    page.call("Emulation.setFocusEmulationEnabled", enabled=True)
    page.value("document.getElementById('tab-items').click()")
    field = "document.querySelectorAll('#panel-items td input')[1]"
    before = page.value(f"{field}.value")
    page.value(f"{field}.focus(); {field}.value = ''")
    page.value("document.getElementById('tab-items').click()")
    assert page.value(f"{field}.value") == ""
    page.value(f"{field}.blur()")
    assert page.value(f"{field}.value") == before
    assert page.value("document.documentElement.dataset.rev") == rev


def test_the_place_below_the_pointer_is_said_while_a_waypoint_is_dragged(page: Browser) -> None:
    place = "document.getElementById('place').textContent"
    x, y = centre(page, ".mark .dot", 2)
    page.mouse("mouseMoved", x, y)
    said = page.value(place)
    assert ", ground " in said
    drag(page, [x, y], (80.0, 40.0), let_go=False)
    assert page.value(place) != said
    key(page, "Escape", 27)
    page.mouse("mouseReleased", x + 80.0, y + 40.0, button="left", clickCount=1)


def test_every_place_of_a_drag_is_sent_and_no_stale_or_late_answer_is_shown(page: Browser) -> None:
    program = """import('/link.js').then(({ Link }) => {
      const shown = [], sent = [];
      const link = Object.assign(Object.create(Link.prototype), {
        number: 0, handlers: { preview: (one) => shown.push(one.n) }, send: (one) => sent.push(one.n) });
      for (let i = 0; i < 3; i++) link.drag({ k: 1 });
      link.hear(JSON.stringify({ kind: 'preview', n: 2, stale: true }));
      link.hear(JSON.stringify({ kind: 'preview', n: 3 }));
      link.settle();
      link.hear(JSON.stringify({ kind: 'preview', n: 4 }));
      return [sent, shown];
    })"""
    assert page.value(program) == [[1, 2, 3], [3]]


# A map of two laps over the same items: the first lap fails on its way to item 4, the second one is near a limit.
LAPS = """Promise.all([import('/map.js'), import('/hands.js')]).then(([{ MapView, cornerStates }, { Hands }]) => {
  const box = document.createElementNS('http://www.w3.org/2000/svg', 'svg'), said = [];
  document.createElement('div').append(box);
  const map = new MapView(box), flat = [0, 0, 9, 1000, 0, 9];
  const model = {
    items: [{ k: 3, seq: 3, at: [0, 0, 9] }, { k: 4, seq: 4, at: [1000, 0, 9] }], of: [3, 4, 3, 4],
    route: [[0, 0, 9], [1000, 0, 9], [0, 0, 9], [1000, 0, 9]], path: [flat, [], flat],
    states: { legs: [['ok', ''], ['ok', ''], ['ok', '']], corners: [1, 2, 3, 4].map(() => ['ok', '']) },
    violated: { threats: [], zones: [] } };
  map.resize(900, 500);
  map.show(model);
  map.view.fit([[0, 1000], [-100, 100]]);
  const legs = [['fail', 'clearance: 29.3 m'], ['ok', ''], ['near', 'clearance 31 m']];
  const corners = [['ok', ''], ['fail', 'missed'], ['ok', ''], ['near', 'waypoint 4 m']];
  map.update({ ...model, states: { legs, corners } });
  const app = { map, model: () => map.model, showPlace() {}, hint: (lines, x, y, state) => said.push(...lines, state) };
  Object.assign(Object.create(Hands.prototype), { app }).hover(map.view.x(300), map.view.y(0), 'mouse');
  const drawn = [...map.legs.querySelectorAll('path')].map((one) => one.getAttribute('class'));
  return [drawn, said, cornerStates(map.model).get(4)];
})"""


def test_the_worst_lap_is_drawn_last_and_named_first(page: Browser) -> None:
    drawn, said, corner = page.value(LAPS)
    assert drawn == ["leg ok", "leg near", "leg fail"]
    assert said == ["leg 0 (to item 4)", "clearance: 29.3 m", "leg 2 (to item 4): clearance 31 m", "fail"]
    assert corner == ["fail", "missed"]


# A profile whose ground is unknown from 2 to 3 of its 5 samples: the ends of what is drawn of it.
GROUND = """import('/profile.js').then(({ Profile }) => {
  const profile = new Profile(document.createElementNS('http://www.w3.org/2000/svg', 'svg'));
  const states = { legs: [['ok', '']], corners: [['ok', ''], ['ok', '']] };
  const samples = { x: [0, 100, 200, 300, 400], ground: [500, 510, null, null, 520], cuts: [] };
  profile.resize(600, 200);
  profile.show({ route: [[0, 0, 600], [400, 0, 600]], of: [-1, -1], items: [], states, profile: samples },
    { clearance: 30 }, null, null);
  const ends = (kind) => [...profile.root.querySelectorAll('.' + kind)].map((one) => {
    const x = one.getAttribute('d').match(/[-\\d.]+ [-\\d.]+(?=L|Z|$)/g).map((point) => Number(point.split(' ')[0]));
    return [Math.min(...x), Math.max(...x)]; });
  return [profile.x(0), profile.x(100), profile.x(400), ends('ground'), ends('clearance'), ends('clearance-line')];
})"""


# An item that is passed in three laps, by legs and corners of one state: the closest to its limit decides.
CLOSEST = """import('/map.js').then(({ cornerStates }) => {
  const leg = ['fail', 'clearance: 55 m', -5], ok = ['ok', '', null];
  const [bank, clearance] = [['fail', 'bank: 40', -2], ['fail', 'clearance: 29 m', -31]];
  const slope = ['fail', 'slope: 9', -4];
  const corners = [ok, bank, ok, clearance, ok, slope, ok];
  const model = { of: [0, 1, 0, 1, 0, 1, 0], states: { corners, legs: Array(6).fill(leg) } };
  return [[true, false].map((legs) => cornerStates(model, legs).get(1)[1]), cornerStates(model, true).get(0)[1]];
})"""


def test_the_table_names_the_lap_that_decides(page: Browser) -> None:
    assert page.value(CLOSEST) == [["clearance: 29 m", "clearance: 29 m"], "clearance: 55 m"]


def test_the_profile_has_a_gap_where_the_ground_is_not_known(page: Browser) -> None:
    start, before, end, *drawn = page.value(GROUND)
    for parts in drawn:
        assert np.ravel(parts) == pytest.approx([start, before, end, end], abs=0.1)


# A profile of a waypoint at 600 m and a landing at 310 m: altitudes of the dots, as kept and as drawn, and of the ends
# of the dashed glide.
LANDING = """import('/profile.js').then(({ Profile }) => {
  const profile = new Profile(document.createElementNS('http://www.w3.org/2000/svg', 'svg'));
  const states = { legs: [['ok', '']], corners: [['ok', ''], ['ok', '']] };
  const items = [{ k: 0, seq: 1, at: [0, 0, 600] }, { k: 1, seq: 2, at: [400, 0, 310], touchdown: true }];
  profile.resize(600, 200);
  profile.show({ route: [[0, 0, 600], [400, 0, 600]], of: [0, 1], items, states, profile: null }, {}, null, null);
  const dots = [...profile.root.querySelectorAll('.dot')].map((one) => Number(one.getAttribute('cy')));
  const glide = profile.root.querySelector('.glide').getAttribute('d').match(/[\\d.]+/g).map(Number);
  const altitudes = (places) => places.map((y) => profile.upAt(y));
  return [profile.places.map((one) => one.up), altitudes(dots), altitudes([glide[1], glide[3]])];
})"""


def test_the_dot_of_a_landing_lies_at_its_touchdown_and_the_glide_ends_there(page: Browser) -> None:
    places, dots, glide = page.value(LANDING)
    assert places == [600, 310]
    assert dots == pytest.approx([600.0, 310.0], abs=1e-6)
    assert glide == pytest.approx([600.0, 310.0], abs=0.2)


# The verdict's panel with findings by geometry and of a flight: titles, and each place with what is offered there.
FINDINGS = """import('/panel.js').then(({ Panel }) => {
  const sent = [], raise = { text: 'raise it', apply: true }, verdict = { state: 'fail', answer: 'not flyable',
    headline: '', lines: [], failed: 1 };
  const finding = (title, where, ok, ...offers) => (
    { title, where, ok, offers, number: sent.length + offers.length, place: { kind: 'leg', index: null }, reason: '' });
  const show = (planned, flown, rev = 1) => {
    const app = { now: { work: {} }, commit: (one) => sent.push([one.finding, one.flown]) };
    const box = document.createElement('div');
    const now = { rev: 1, verdict, notes: [], findings: planned };
    const flight = { rev, verdict, changes: [], autopilot: '', seconds: 1, early: true, findings: flown };
    Object.assign(Object.create(Panel.prototype), { app, boxes: { verdict: box }, now, flight }).buildVerdict();
    box.querySelector('.apply')?.click();
    const parts = box.querySelectorAll(':scope > h2, :scope > .findings > li');
    return [...parts].map((one) => one.textContent);
  };
  const leg = (ok, ...more) => finding('slopes', 'leg 1', ok, ...more);
  const [other, open] = [finding('clearance', 'leg 2', false), finding('slopes', 'leg 3', null)];
  return [show([leg(false, raise), other], [leg(false), open]),
    show([leg(false, raise)], [leg(null)]), show([leg(null)], [leg(true)]), sent,
    show([leg(true)], [finding('slopes', 'leg 3', true)]), show([leg(true)], [finding('slopes', 'leg 3', true)], 0)];
})"""


def test_a_place_is_listed_once_under_a_title_of_what_it_is(page: Browser) -> None:
    both, flown, planned, sent, closest, stale = page.value(FINDINGS)
    assert both == [
        "What fails",
        "clearance leg 2",
        "What fails or is not judged in flight",
        "slopes leg 1",
        "slopes leg 3",
    ]
    # What failed in flight has only changes that were flown; what the flight did not reach has those of the geometry.
    untried = "slopes leg 1Applyraise it (not tried in flight, because the flight ended before it)"
    assert flown == ["What is not judged in flight", untried]
    assert planned[0] == "What is not judged"
    # The geometry's own finding is applied.
    assert sent == [[1, False]]
    # Below the card of the flight stand the flight's numbers, until the mission is changed.
    assert closest == ["Closest to its limit in flight, by rule", "slopes leg 3"]
    assert stale == ["Closest to its limit by geometry, by rule", "slopes leg 1"]


# A panel less high than its questions: where an answer stands, and whether it is seen when it comes.
ANSWER = """import('/panel.js').then(({ Panel }) => {
  const box = document.createElement('div'), verdict = { state: 'ok', answer: 'flyable', headline: '', lines: [] };
  Object.assign(box.style, { position: 'fixed', top: 0, width: '380px', height: '160px', overflow: 'auto' });
  document.body.append(box);
  const app = { now: { work: {} }, send: () => {} }, now = { rev: 1, verdict, notes: [], findings: [] };
  const panel = Object.assign(Object.create(Panel.prototype), { app, boxes: { verdict: box }, now, answers: {} });
  panel.asked = new Set();
  panel.drawVerdict();
  box.querySelector('[data-job=battery]').click();
  const seen = ['returns', 'battery'].map((job) => {
    panel.answered(job, { rev: 1, state: 'ok', headline: `of ${job}`, lines: [] });
    const card = box.querySelector(`[data-answer=${job}]`);
    const [a, b] = [card, box].map((one) => one.getBoundingClientRect());
    const { job: asked } = card.previousElementSibling.querySelector('button').dataset;
    return [asked, a.top >= b.top && a.bottom <= b.bottom + 1];
  });
  box.remove();
  return seen;
})"""


def test_an_answer_stands_below_its_question_and_is_seen_where_it_was_asked(page: Browser) -> None:
    assert page.value(ANSWER) == [["returns", False], ["battery", True]]


def test_a_drag_ends_where_another_page_changes_the_items(page: Browser, studio: Studio) -> None:
    x, y = centre(page, ".mark .dot", 2)
    drag(page, [x, y], (30.0, 0.0), let_go=False)
    page.wait_for("document.querySelector('#map.dragging') !== null")
    with Served(studio.address).page() as program:
        sheet = program.until("sheet")
        program.send(kind="delete", rev=sheet["rev"], ks=[sheet["items"][-1]["k"]])
        page.wait_for("document.querySelector('#map.dragging') === null")
    page.mouse("mouseReleased", x + 30.0, y, button="left", clickCount=1)
    assert marks(page) == len(sheet["items"]) - 1
    key(page, "Escape", 27)
    page.value("document.getElementById('undo').click()")
    page.wait_for(f"document.querySelectorAll('.mark').length === {len(sheet['items'])}")
    assert page.value("document.getElementById('undo').disabled")


def test_a_diamond_inserts_and_a_profiles_dot_raises(page: Browser) -> None:
    count = marks(page)
    x, y = centre(page, ".diamonds path")
    page.mouse("mousePressed", x, y, button="left", clickCount=1)
    page.mouse("mouseReleased", x, y, button="left", clickCount=1)
    page.wait_for(f"document.querySelectorAll('.mark').length === {count + 1}")
    drag(page, centre(page, "#profile .dot", 2), (0.0, -30.0))
    page.wait_for("document.getElementById('undo').title.startsWith('Undo: move item')")
    undo_all(page)
    assert marks(page) == count


def test_a_suggestion_is_applied_by_its_button(page: Browser) -> None:
    page.value("document.getElementById('tab-verdict').click()")
    failed = int(page.value("document.querySelectorAll('#panel-verdict li[data-state=fail]').length"))
    assert failed
    # Where the flight fails, too, a change is offered once it was flown.
    page.wait_for("document.querySelector('#panel-verdict .apply') !== null", 150.0)
    page.value("document.querySelector('#panel-verdict .apply').click()")
    page.wait_for("document.getElementById('undo').title.startsWith('Undo: apply a suggestion')")
    undo_all(page)


def test_a_suggestion_of_the_flight_is_offered_once_it_was_flown_and_applied(page: Browser) -> None:
    page.value("document.getElementById('tab-verdict').click()")
    own = (
        "[...document.querySelectorAll('#panel-verdict h2')].find((one) => /^What .* in flight$/.test(one.textContent))"
    )
    apply = f"{own}?.nextElementSibling.querySelector('.apply')"
    page.wait_for(f"{apply} && document.getElementById('stop').hidden", 150.0)
    page.value(f"{apply}.click()")
    page.wait_for("document.getElementById('undo').title.includes('a suggestion of the flight: ')")
    undo_all(page)


def test_the_map_has_the_worse_colour_of_geometry_and_flight(page: Browser, studio: Studio) -> None:
    """80 m lower the flight ends in the ground before an item whose corner passes by geometry."""
    page.value("document.getElementById('tab-items').click()")
    page.value("document.getElementById('raise-by').value = 80")
    page.value("[...document.querySelectorAll('#panel-items button')].find((b) => b.textContent === 'Lower').click()")
    page.wait_for("document.getElementById('undo').title.startsWith('Undo: lower all')")
    with Served(studio.address).page() as program:
        sheet = program.until("sheet")
        flown = program.until("flown", rev=sheet["rev"])
    corners = [[state for state, *_ in one["states"]["corners"]] for one in (sheet, flown)]
    failing = [k for k, *pair in zip(sheet["of"], *corners, strict=True) if pair == ["ok", "fail"]]
    assert failing
    look = f"document.querySelector('.mark[data-k=\"{failing[0]}\"]').getAttribute('class')"
    page.wait_for(f"{look}.includes('fail')")
    undo_all(page)
    page.wait_for(f"!{look}.includes('fail')")


def test_one_place_has_one_suggestion(page: Browser) -> None:
    """A place that fails by geometry and in flight offers the change that was flown."""
    page.value("document.getElementById('tab-verdict').click()")
    page.wait_for("document.querySelector('#panel-verdict .apply') && document.getElementById('stop').hidden", 150.0)
    places = page.value(
        "[...document.querySelectorAll('#panel-verdict .findings:not(.passed) > li')].filter((one) =>"
        " one.querySelector('.apply')).map((one) => one.querySelector('p').textContent)"
    )
    assert places
    assert len(places) == len(set(places))


# The progress of a plan on the planner's two buttons, after either of them was pressed.
PRESSED = """import('/panel.js').then(({ Panel }) => {
  const buttons = ['1', '6'].map((ways) => document.querySelector(`#panel-plan [data-job=plan][data-ways="${ways}"]`));
  return [1, 6].map((waysAsked) => {
    const panel = Object.assign(Object.create(Panel.prototype), { waysAsked });
    panel.working({ job: 'plan', share: 0, text: '' }, false);
    const shares = buttons.map((one) => one.dataset.share || null);
    panel.stopped('plan');
    return shares;
  });
})"""


def test_of_two_buttons_of_one_work_the_pressed_one_shows_its_progress(page: Browser) -> None:
    assert page.value(PRESSED) == [["0 %", None], [None, "0 %"]]


def test_stop_and_a_mended_error_are_said(page: Browser) -> None:
    page.value("document.getElementById('tab-verdict').click()")
    message = "document.getElementById('message')"
    page.value("document.querySelector('[data-job=campaign]').click()")
    # The button shows at once that its work has begun.
    page.wait_for("document.querySelector('[data-job=campaign]').dataset.share !== undefined", 2.0)
    page.value("document.getElementById('stop').click()")
    page.wait_for(f"{message}.textContent === 'Stopped; earlier results stay.'", 60.0)
    page.value("document.querySelector('[data-job=returns]').click()")
    page.wait_for(f"{message}.hidden", 5.0)
    page.value("document.getElementById('stop').click()")
    page.wait_for(f"{message}.textContent === 'Stopped; earlier results stay.'", 60.0)
    page.value("document.getElementById('tab-files').click()")
    page.value("document.getElementById('open-path').value = 'nope.waypoints'")
    page.value("document.getElementById('open-path').focus()")
    page.key("Enter")
    page.wait_for(f"{message}.textContent.includes(\"'nope.waypoints': no such file in\")")
    drag(page, centre(page, ".mark .dot", 1), (20.0, 10.0))
    page.wait_for("document.getElementById('undo').title.startsWith('Undo: move')")
    assert page.value(f"{message}.hidden")
    undo_all(page)


def test_settings_say_what_is_allowed_and_take_parameters(page: Browser) -> None:
    page.value("document.getElementById('tab-settings').click()")
    enter = (
        "(() => {{ const one = document.getElementById('{}'); one.focus(); one.value = '{}';"
        " one.dispatchEvent(new Event('change', {{ bubbles: true }})); }})()"
    )
    page.value(enter.format("set-min_clearance_m", "99999"))
    page.wait_for("document.getElementById('message').textContent === 'Minimum clearance: 99999: allowed 0..5000'")
    assert page.value("document.getElementById('set-min_clearance_m').value") == "60"
    page.value(enter.format("set-parameter", "WP_RADIUS=45"))
    page.key("Enter")
    page.wait_for("document.querySelector('.parameters')?.textContent.includes('WP_RADIUS = 45')")
    page.value("document.querySelector('.parameters button').click()")
    page.wait_for("document.querySelector('.parameters') === null")
    assert page.problems == []


SCREENS = [("light", 1400, "verdict"), ("dark", 420, "settings")]
if SOAK:
    SCREENS = [(look, width, tab) for look in ("light", "dark") for width in (1400, 420) for tab in TABS]


def test_axe_finds_nothing_grave(page: Browser) -> None:
    page.value("document.querySelectorAll('.mark')[1].focus()")
    page.wait_for("document.querySelector('#panel-verdict .apply') !== null", 150.0)
    for look, width, tab in SCREENS:
        prefer(page, look, width)
        page.value(f"document.getElementById('tab-{tab}').click()")
        page.settle()
        assert (look, width, tab, grave_findings(page)) == (look, width, tab, [])
    prefer(page, "light", 1400)
    page.settle()


def test_a_path_is_planned_between_two_items(page: Browser) -> None:
    page.value("document.getElementById('tab-items').click()")
    page.value("document.getElementById('raise-by').value = 150")
    page.value("[...document.querySelectorAll('#panel-items button')].find((b) => b.textContent === 'Raise').click()")
    page.wait_for("document.getElementById('undo').title.startsWith('Undo: raise all')")
    page.value("document.getElementById('tab-plan').click()")
    page.value("document.getElementById('plan-first').selectedIndex = 1")
    page.value("document.getElementById('plan-last').selectedIndex = 3")
    page.value("document.querySelector('#panel-plan .main').click()")
    # A search is long on a machine with other work.
    page.wait_for("document.querySelector('#panel-plan .card button') !== null", 150.0)
    page.value("document.querySelector('#panel-plan .card button').click()")
    page.wait_for("document.getElementById('undo').title === 'Undo: plan a part'")
    undo_all(page)


def test_a_dropped_file_is_opened(page: Browser) -> None:
    text = mission_text(drawn_session(9, 6).mission, "waypoints")
    data = base64.b64encode(text.encode()).decode()
    page.value(
        f"(() => {{ const data = new DataTransfer(); data.items.add(new File([atob('{data}')], 'dropped.waypoints'));"
        " dispatchEvent(new DragEvent('drop', { dataTransfer: data, cancelable: true })); return 1; })()"
    )
    page.wait_for("document.getElementById('name').textContent === 'dropped.waypoints'")
    page.value("document.getElementById('tab-files').click()")
    page.value(
        "document.getElementById('open-path').value = './m.waypoints'; document.getElementById('open-path').focus()"
    )
    page.key("Enter")
    page.wait_for("document.getElementById('name').textContent === 'm.waypoints'")


def test_a_circle_at_the_end_leaves_the_dots_large_and_the_names_beside_the_legs(page: Browser) -> None:
    """The many corners of a loiter are no waypoints that lie close together."""
    lines = [
        "QGC WPL 110",
        "0 1 0 16 0 0 0 0 36.2578 -84.1401 335 1",
        "1 0 3 16 0 0 0 0 36.2676 -84.1537 220 1",
        "2 0 3 16 0 0 0 0 36.2838 -84.1761 220 1",
        "3 0 3 16 0 0 0 0 36.2668 -84.1641 220 1",
        "4 0 3 18 3 0 80 0 36.2578 -84.1401 220 1",
    ]
    data = base64.b64encode("\n".join([lines[0], *(line.replace(" ", "\t") for line in lines[1:])]).encode()).decode()
    page.value(
        f"(() => {{ const data = new DataTransfer(); data.items.add(new File([atob('{data}')], 'circle.waypoints'));"
        " dispatchEvent(new DragEvent('drop', { dataTransfer: data, cancelable: true })); return 1; })()"
    )
    page.wait_for("document.getElementById('name').textContent === 'circle.waypoints'")
    page.wait_for("document.querySelectorAll('.mark').length === 4")
    assert page.value("document.querySelector('.markers').classList.contains('dense')") is False
    assert page.value(OVERLAPS) == 0
    card = "document.querySelector('#panel-verdict > .card').textContent"
    assert page.value(f"{card}.split('not flyable').length") <= 2
    page.value("document.getElementById('tab-files').click()")
    page.value(
        "document.getElementById('open-path').value = 'm.waypoints'; document.getElementById('open-path').focus()"
    )
    page.key("Enter")
    page.wait_for("document.getElementById('name').textContent === 'm.waypoints'")


# The connection breaks once: before an edit that raises all items gets through, or just after it.
BREAK = """(() => { const { send } = WebSocket.prototype; WebSocket.prototype.send = function (text) {
 if (!text.includes('"raise"')) return send.call(this, text);
 WebSocket.prototype.send = send; if (%s) send.call(this, text); this.close(); return undefined; }; })()"""


@pytest.mark.parametrize("arrives", [False, True])
def test_an_edit_during_which_the_connection_breaks_is_made_once(page: Browser, *, arrives: bool) -> None:
    undo_all(page)
    page.value(BREAK % str(arrives).lower())
    page.value("document.getElementById('tab-items').click()")
    page.value("[...document.querySelectorAll('#panel-items button')].find((b) => b.textContent === 'Raise').click()")
    page.wait_for("document.getElementById('message').textContent.includes('1 edit is not saved')")
    page.wait_for("document.getElementById('undo').title.startsWith('Undo: raise all')")
    page.wait_for("document.getElementById('message').hidden")
    page.value("document.getElementById('undo').click()")
    page.wait_for("document.getElementById('redo').title.startsWith('Redo: raise all')")
    assert page.value("document.getElementById('undo').disabled")


def test_edits_that_are_made_while_the_server_is_stopped_are_made_when_it_runs_again(
    page: Browser, studio: Studio
) -> None:
    undo_all(page)
    message, height = "document.getElementById('message').textContent", "'#panel-items tr[data-k=\"3\"] td input'"
    page.value("document.getElementById('tab-items').click()")
    studio.kill()
    page.wait_for(f"{message}.endsWith('Your edits are saved.')")
    place = centre(page, ".mark .dot", 2)
    drag(page, place, (20.0, 10.0))
    assert page.value(message).endswith("1 edit is not saved: it is sent when the studio answers again in this tab.")
    # It stands where it was dragged to, and so it does when another is edited.
    enter = "one.value = 777; one.dispatchEvent(new Event('change', { bubbles: true }))"
    page.value(f"(() => {{ const one = document.querySelector({height}); {enter}; }})()")
    assert "2 edits are not saved: they are sent when" in page.value(message)
    assert centre(page, ".mark .dot", 2) == pytest.approx([place[0] + 20.0, place[1] + 10.0], abs=1.0)
    studio.start()
    page.wait_for(f"{message}.includes('another run')")
    page.go(studio.address)
    page.wait_for(f"({READY}) && document.getElementById('undo').title.startsWith('Undo: move')")
    page.value("document.getElementById('tab-items').click()")
    page.wait_for(f"document.querySelector({height}).value === '777'")
    undo_all(page)
    # Both were made, once.
    redo = "document.getElementById('redo')"
    for number in (3, 4):
        page.wait_for(f"{redo}.title === 'Redo: move item {number}'")
        page.value(f"{redo}.click()")
    page.wait_for(f"{redo}.disabled")
    undo_all(page)


@only_in_soak
def test_what_was_done_survives_a_reload_and_a_server_that_dies(page: Browser, studio: Studio) -> None:
    undo_all(page)
    with Served(studio.address).page() as program:
        program.send(kind="settings", wind_speed=6.5)
        program.until("sheet")
        program.until("sheet")
    drag(page, centre(page, ".mark .dot", 3), (20.0, 10.0))
    page.wait_for("document.getElementById('undo').title.startsWith('Undo: move')")
    done = saved(page)
    page.call("Page.reload")
    page.wait_for(f"({READY}) && document.getElementById('undo').title.startsWith('Undo: move')")
    deadline = time.monotonic() + 30.0
    while parse_mission(done, "m").items not in kept_items(studio):
        assert time.monotonic() < deadline
        time.sleep(0.1)
    studio.kill()
    page.wait_for("!document.getElementById('message').hidden")
    studio.start()
    page.wait_for("document.getElementById('message').textContent.includes('another run')")
    page.go(studio.address)
    page.wait_for(f"({READY}) && document.getElementById('undo').title.startsWith('Undo: move')")
    assert parse_mission(saved(page), "m").items == parse_mission(done, "m").items
    with Served(studio.address).page() as program:
        assert program.until("world")["settings"]["wind_speed"] == 6.5


def test_a_phone_drags_by_touch(browser: Browser, studio: Studio) -> None:
    phone = browser
    prefer(phone, "light", 420)
    phone.problems.clear()
    phone.go(studio.address)
    phone.wait_for(READY)
    assert phone.value("document.documentElement.scrollWidth <= innerWidth")
    assert phone.value(OVERLAPS) == 0
    for answer in ("geometry", "flown"):
        phone.value(f"document.querySelector('#{answer} span').textContent = 'not flyable: 17 findings, changed since'")
        assert phone.value(
            f"(([one]) => one.scrollWidth <= one.clientWidth)(document.querySelectorAll('#{answer} span'))"
        )
    before = undo_text(phone)
    x, y = centre(phone, ".mark .dot", 2)

    def touch(kind: str, dx: float) -> None:
        points: list[dict[str, Any]] = [] if kind == "touchEnd" else [{"x": x + dx, "y": y, "id": 1}]
        phone.call("Input.dispatchTouchEvent", type=kind, touchPoints=points)

    touch("touchStart", 0.0)
    for k in range(1, 13):
        touch("touchMove", 4.0 * k)
    touch("touchEnd", 0.0)
    phone.wait_for(f"document.getElementById('undo').title !== {json.dumps(before)}")
    assert undo_text(phone).startswith("Undo: move item")
    assert phone.problems == []
    prefer(phone, "light", 1400)
    phone.go("about:blank")


@only_in_soak
def test_a_drag_is_coloured_in_time(page: Browser) -> None:
    from benchmarks.studio import DRAG, timed

    count = scaled(40, 15)
    moves = timed(page.value(DRAG % {"mark": 3, "moves": count}))
    assert len(moves) == count
    assert sorted(moves)[count - 3] < 1000.0 * at_most(0.15)
