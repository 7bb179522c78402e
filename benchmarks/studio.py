"""Measure the studio: a drag to its coloured verdict, a release to the flight, opening of the page, and memory.

``python -m benchmarks.studio`` starts the installed ``planfly studio`` and a headless Chromium.  Both share the cores,
so that times are valid only on an idle machine.  A move is timed in the page, from its event to the first frame after a
verdict on it, or on a newer one, has been drawn.
"""

import contextlib
import json
import math
import os
import re
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import psutil
from websockets.sync.client import connect

from flight.mission.items import Command, Frame, Home, Mission, MissionItem, round_to_grid
from flight.mission_files.formats import mission_text
from planfly.workflow.make_plan import make_plan
from planfly.workflow.uav import load_uav
from planner.plan import plan_json
from tests.browser import Browser
from world.frames import to_geo
from world.scenario import load_scenario

# Number of moves of a drag.
MOVES = 200
# Number of releases.
RELEASES = 7
# Number of edits of the memory test.
EDITS = 1_000
# Scenario of all missions.
SCENARIO = "jacksboro-air"
# Script that sends moves of the pointer, 16 ms apart; returns the time to the frame of each verdict, ms, and the number
# of moves without a verdict.
DRAG = """
new Promise((done) => {
  const page = document.documentElement, map = document.getElementById("map"), asked = [], found = [];
  const mark = document.querySelectorAll(".mark")[%(mark)d].querySelector(".dot").getBoundingClientRect();
  const x = mark.x + mark.width / 2, y = mark.y + mark.height / 2;
  const send = (kind, dx, dy) => map.dispatchEvent(new PointerEvent(kind, {
    pointerId: 1, pointerType: "mouse", isPrimary: true, bubbles: true, button: 0, buttons: 1,
    clientX: x + dx, clientY: y + dy }));
  map.setPointerCapture = () => {};
  const watch = new MutationObserver(() => {
    const shown = Number(page.dataset.shown);
    requestAnimationFrame(() => {
      while (asked.length && asked[0][0] <= shown) found.push(performance.now() - asked.shift()[1]);
    });
  });
  watch.observe(page, { attributes: true, attributeFilter: ["data-shown"] });
  send("pointerdown", 0, 0);
  let k = 0;
  const step = () => {
    k += 1;
    const at = performance.now();
    send("pointermove", 8 + 24 * Math.sin(k / 9), 24 * Math.cos(k / 7));
    asked.push([Number(page.dataset.asked), at]);
    if (k < %(moves)d) setTimeout(step, 16);
    else setTimeout(() => {
      watch.disconnect();
      send("pointerup", 8, 8);
      done({ answered: found, never: asked.length });
    }, 900);
  };
  setTimeout(step, 200);
})
"""
# Script that drags a waypoint and releases it; returns the time from the release to the frame of the flown track, ms.
RELEASE = """
new Promise((done) => {
  const page = document.documentElement, map = document.getElementById("map"), before = page.dataset.flown;
  const mark = document.querySelectorAll(".mark")[%(mark)d].querySelector(".dot").getBoundingClientRect();
  const x = mark.x + mark.width / 2, y = mark.y + mark.height / 2;
  const send = (kind, dx) => map.dispatchEvent(new PointerEvent(kind, {
    pointerId: 1, pointerType: "mouse", isPrimary: true, bubbles: true, button: 0, buttons: 1,
    clientX: x + dx, clientY: y }));
  map.setPointerCapture = () => {};
  send("pointerdown", 0);
  for (let k = 1; k < 6; k++) send("pointermove", %(way)d * k);
  setTimeout(() => {
    const at = performance.now();
    new MutationObserver((_, watch) => {
      if (page.dataset.flown === before) return;
      watch.disconnect();
      requestAnimationFrame(() => done(performance.now() - at));
    }).observe(page, { attributes: true, attributeFilter: ["data-flown"] });
    send("pointerup", %(way)d * 5);
  }, 300);
})
"""
# Script before the page's own ones: times at which waypoints, their colours and the ground first appear, ms.
OPENED = """
window.opened = {};
new MutationObserver(() => {
  const note = (name, there) => {
    if (!opened[name] && there) requestAnimationFrame(() => { opened[name] = performance.now(); });
  };
  note("map", document.querySelectorAll(".mark").length > 1);
  note("ground", document.querySelector("#map-box image[href]"));
}).observe(document, { subtree: true, childList: true, attributes: true, attributeFilter: ["href"] });
"""


def write_missions(folder: Path) -> dict[str, tuple[str, ...]]:
    """Write the missions that are dragged, and return the arguments of the command by description."""
    scenario = load_scenario(SCENARIO)
    plan = make_plan(scenario, load_uav(scenario), 1)
    (folder / "demo.json").write_text(plan_json(plan), encoding="utf-8")
    found: dict[str, tuple[str, ...]] = {"demo, 14 waypoints": ("demo.json",)}
    for count in (100, 500):
        # Waypoints along a gentle wave through the centre of the map, at one altitude.
        wave_east = np.linspace(-9_000.0, 9_000.0, count)
        lat, lon = to_geo(scenario.origin, wave_east, 1_500.0 * np.sin(wave_east / 3_000.0))
        places = [(round_to_grid(a), round_to_grid(b)) for a, b in zip(lat.tolist(), lon.tolist(), strict=True)]
        items = [
            MissionItem(k, int(Command.NAV_WAYPOINT), int(Frame.GLOBAL), (0.0,) * 4, *place, 1_080.0)
            for k, place in enumerate(places, 1)
        ]
        name = f"w{count}.waypoints"
        mission = Mission(Home(*places[0], 300.0), tuple(items))
        (folder / name).write_text(mission_text(mission, "waypoints"), encoding="utf-8")
        found[f"{count} waypoints"] = (name, "--scenario", SCENARIO)
    (folder / "zones.geojson").write_text(_zones(plan.waypoints[:, :2]), encoding="utf-8")
    found["demo, 1,000 zones"] = ("demo.json", "--fence", "zones.geojson")
    return found


def _zones(path: np.ndarray) -> str:
    """Make a thousand square exclusions, up to above the flight, all over the map except near its path."""
    scenario, rng = load_scenario(SCENARIO), np.random.default_rng(38)
    features: list[dict[str, Any]] = []
    while len(features) < 1_000:
        number = len(features)
        east, north = rng.uniform(-10_000.0, 10_000.0, 2)
        # Distances of the place from the legs of the path.
        legs, place = np.diff(path, axis=0), np.array([east, north])
        shares = np.clip(((place - path[:-1]) * legs).sum(axis=1) / (legs**2).sum(axis=1), 0.0, 1.0)
        if float(np.hypot(*(path[:-1] + shares[:, None] * legs - place).T).min()) < 250.0:
            continue
        corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1], [-1, -1]]) * 90.0 + [east, north]
        lat, lon = to_geo(scenario.origin, corners[:, 0], corners[:, 1])
        ring = np.stack([lon, lat], axis=1).tolist()
        properties = {"name": f"zone {number}", "kind": "exclusion", "ceiling_amsl_m": 2_000.0}
        features.append(
            {"type": "Feature", "properties": properties, "geometry": {"type": "Polygon", "coordinates": [ring]}}
        )
    return json.dumps({"type": "FeatureCollection", "features": features})


@contextlib.contextmanager
def running(folder: Path, given: tuple[str, ...]) -> Iterator[tuple[str, psutil.Process]]:
    """Run a studio, and yield its address and its process."""
    command = [sys.executable, "-m", "planfly", "studio", *given, "--no-browser", "--port", "0", "--keep", "kept"]
    with subprocess.Popen(command, cwd=folder, stdout=subprocess.PIPE, text=True, env=os.environ) as process:
        assert process.stdout is not None
        address = ""
        while "#t=" not in address:
            address = process.stdout.readline()
            if process.poll() is not None:
                raise SystemExit("the studio did not start")
        try:
            yield address.split()[-1], psutil.Process(process.pid)
        finally:
            process.terminate()


def drawn(browser: Browser, address: str) -> None:
    """Open the page and wait until the mission, its ground and its flight are shown."""
    browser.go(address)
    browser.wait_for("document.querySelectorAll('.mark').length > 1")
    browser.wait_for("document.querySelector('#map-box image').hasAttribute('href')")
    browser.wait_for("document.documentElement.dataset.flown")
    browser.settle()


def share(values: list[float], part: float) -> float:
    """Return the quantile of values at ``part``."""
    return sorted(values)[min(len(values) - 1, math.ceil(part * len(values)) - 1)]


def timed(drag: dict[str, Any]) -> list[float]:
    """Return the times of a drag's moves, ms; infinite for a move without a verdict."""
    return [*drag["answered"], *[math.inf] * int(drag["never"])]


def measure_drags(folder: Path, missions: dict[str, tuple[str, ...]]) -> list[dict[str, Any]]:
    """Measure the drags of each mission, and return a row for each."""
    rows = []
    for name, given in missions.items():
        with (
            running(folder, given) as (address, _),
            tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as profile,
            Browser(Path(profile), 1400, 900) as browser,
        ):
            drawn(browser, address)
            count = int(browser.value("document.querySelectorAll('.mark').length"))
            moves = timed(browser.value(DRAG % {"mark": count // 2, "moves": MOVES}))
            browser.wait_for("document.getElementById('flown').dataset.state !== 'checking'")
            step = [2, -2]
            flown = [browser.value(RELEASE % {"mark": count // 2, "way": step[k % 2]}) for k in range(RELEASES)]
        row = {"mission": name, "p50": share(moves, 0.5), "p95": share(moves, 0.95), "max": max(moves), "n": len(moves)}
        rows.append(row | {"flown": statistics.median(flown)})
        print(
            f"{name:22} drag to verdict: p50 {row['p50']:5.0f}, p95 {row['p95']:5.0f}, max {row['max']:5.0f} ms of"
            f" {row['n']}; release to flown: median {rows[-1]['flown']:5.0f} ms",
            flush=True,
        )
    return rows


def measure_opening(folder: Path) -> None:
    """Measure the opening of the page by new browsers without a cache."""
    with running(folder, ("demo.json",)) as (address, _):
        time.sleep(3.0)
        for how in ("cold", "cold", "cold"):
            with (
                tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as profile,
                Browser(Path(profile), 1400, 900) as browser,
            ):
                browser.call("Page.addScriptToEvaluateOnNewDocument", source=OPENED)
                drawn(browser, address)
                seen = browser.value("window.opened")
            print(
                f"page opened, {how}: mission coloured {seen['map']:.0f} ms, ground {seen['ground']:.0f} ms", flush=True
            )


def measure_memory(folder: Path) -> None:
    """Measure the growth of the server's memory over many edits."""
    with running(folder, ("demo.json",)) as (address, process):
        port, token = re.findall(r":(\d+)/#t=(.+)", address)[0]
        rng = np.random.default_rng(1)
        with connect(
            f"ws://127.0.0.1:{port}/session",
            origin=f"http://127.0.0.1:{port}",
            max_size=2**30,
        ) as socket:
            socket.send(json.dumps({"kind": "hello", "token": token}))
            sheet = _sheet(socket)
            taken = []
            for number in range(EDITS):
                if number % (EDITS // 10) == 0:
                    taken.append(process.memory_info().rss / 2**20)
                item = sheet["items"][int(rng.integers(1, len(sheet["items"]) - 1))]
                east, north, _ = item["at"]
                step = rng.normal(0.0, 40.0, 2)
                move = {"k": item["k"], "east": east + step[0], "north": north + step[1]}
                socket.send(json.dumps({"kind": "move", "rev": sheet["rev"], **move}))
                sheet = _sheet(socket)
            taken.append(process.memory_info().rss / 2**20)
    print(f"server's memory, MB, over {EDITS} edits: {', '.join(f'{one:.0f}' for one in taken)}", flush=True)


def _sheet(socket: Any) -> dict[str, Any]:
    """Return the next message of the kind "sheet" from a websocket."""
    while True:
        data = socket.recv(timeout=60)
        if isinstance(data, str) and data.startswith('{"kind":"sheet"'):
            return dict(json.loads(data))


def main() -> None:
    """Measure all, and print it."""
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        missions = write_missions(folder)
        measure_drags(folder, missions)
        measure_opening(folder)
        measure_memory(folder)


if __name__ == "__main__":
    main()
