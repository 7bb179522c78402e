"""A small flight, findings of every kind and hostile names, for the tests of the report; and a reader of its page."""

import math
import re
import tempfile
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np

from aircraft.envelope import Envelope
from flight.mission.items import Mission, MissionItem
from flight.mission.route import Route, route_points
from flight.simulation.setup import FlightSetup, make_limits
from flight.simulation.track import COLUMNS, Track
from logs.verdict.findings import Finding
from logs.verdict.places import FLIGHT, Place
from logs.verdict.verdict import Verdict
from logs.verdict.wording import place_text
from logs.views.report.page import write_report
from world.scenario import scenario_from_spec

ROUTE = np.array([[-900.0, -400.0, 300.0], [100.0, -400.0, 340.0], [100.0, 400.0, 380.0], [700.0, 400.0, 360.0]])
EVIL = "<script>alert('x')</script> & \"q\""
PNG = b"\x89PNG\r\n\x1a\nnot drawn here"


def make_setup(**changes: Any) -> FlightSetup:
    spec: dict[str, Any] = {
        "name": "small",
        "description": "a hill and two units",
        "terrain": {"kind": "flat", "amsl_m": 200},
        "area": {"east_m": [-1200, 1200], "north_m": [-800, 800], "ceiling_amsl_m": 500},
        "start": {"east_m": -900, "north_m": -400, "amsl_m": 300},
        "destination": {"east_m": 700, "north_m": 400, "amsl_m": 360},
        "threats": [{"name": EVIL[:90], "east_m": 300, "north_m": 0, "kill_radius_m": 250, "kill_scale_m": 50}],
        "wind": {"speed_mps": 5, "from_deg": 250, "gradient": 0.01},
    }
    envelope = Envelope(
        aircraft="aerosonde",
        model_hash="feed" * 16,
        motor_braking=False,
        airspeed=np.array([20.0, 30.0]),
        amsl=np.array([0.0, 2000.0]),
        climb=np.full((2, 2), 0.2),
        descent=np.full((2, 2), 0.1),
        level_speed_min=np.full(2, 17.0),
        level_speed_max=np.full(2, 36.0),
        max_bank=0.7,
    )
    items = tuple(MissionItem(k + 1, 16, 0, (0.0, 0.0, 0.0, 0.0), 46.0, 8.0 + k, float(ROUTE[k, 2])) for k in range(4))
    scenario = scenario_from_spec(spec | changes, "test")
    return FlightSetup(
        scenario=scenario,
        mission=Mission(None, items, warnings=("line 7: CRLF",), source="his.waypoints"),
        route=Route(route_points(ROUTE, 25.0, item=np.arange(4)), "starts trimmed", ("item 9: no loiter",)),
        limits=make_limits(scenario, envelope, 25.0, math.radians(30.0)),
        aircraft="aerosonde",
        battery=100.0,
        seed=7,
    )


def make_track() -> Track:
    """Along the route at 25 m/s, a row a second: 40, 32 and 25 rows to the legs."""
    at = np.array([0.0, 1000.0, 1800.0, 2400.0])
    along = np.arange(0.0, 2400.1, 25.0)
    values: dict[str, np.ndarray] = {
        name: np.zeros((along.size, width)) if width > 1 else np.zeros(along.size) for name, width in COLUMNS.items()
    }
    values["time"] = along / 25.0
    values["position"] = np.column_stack([np.interp(along, at, ROUTE[:, axis]) for axis in range(3)])
    values["leg"] = np.clip(np.searchsorted(at, along, side="right") - 1, 0, 2)
    values["airspeed"] = np.full(along.size, 25.0)
    values["energy"] = 0.5 * values["time"]
    values["attitude"][41, 0] = -0.5
    values["cross_track"][10] = -3.25
    return Track(**values)  # type: ignore[arg-type]  # the track gives each column its type


def finding(rule: str, place: Place, ok: bool | None, margin: float | None, **changes: Any) -> Finding:
    reason = f"why {place_text(place)}"
    base = Finding(rule, place, 4.0, 4.25, 7.8, "aircraft", 0.1, margin, "deg", "least squares", ok, reason)
    return replace(base, **changes)


FINDINGS = (
    finding("turn", Place("waypoint", 1, 2), True, 12.3),
    finding("slope", Place("leg", 0), True, 3.5),
    finding("slope", Place("leg", 1), False, -3.45, flown=11.25),
    finding("bounds", FLIGHT, None, None, planned=None, flown=None, limit=None, reason="no scenario was given"),
)
VERDICT = Verdict(
    FINDINGS, False, True, ("not flyable: slope on leg 1", "Start: in the air"), "flown", leg_ends=(40.0, 72.0)
)
ARGUMENTS: dict[str, Any] = {
    "ended": "completed",
    "versions": {"planfly": "0.1.0", "jsbsim": "1.3.3"},
    "command": "planfly run small",
}


class Page(HTMLParser):
    """Reads a page, and keeps what a check needs; balance is checked on the way."""

    VOID = ("meta", "img", "br", "link", "input", "hr")

    def __init__(self, text: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.texts: list[str] = []
        self.rows: list[tuple[str, list[str]]] = []
        self.feed(text)
        self.close()
        assert self.open == []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attrs)))
        if tag not in self.VOID:
            self.open.append(tag)
        if tag == "tr":
            self.rows.append((dict(attrs).get("class") or "", []))
        if tag in ("td", "th"):
            self.rows[-1][1].append("")

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.texts.append(data)
        if self.open and "tr" in self.open and self.rows[-1][1]:
            self.rows[-1][1][-1] += data.strip()

    def text(self) -> str:
        return re.sub(r"\s+", " ", " ".join(self.texts))


def report_html(setup: FlightSetup, track: Track | None, verdict: Verdict, **arguments: Any) -> str:
    """The page alone, of a report that is written and thrown away."""
    with tempfile.TemporaryDirectory() as folder:
        *_, page = write_report(Path(folder), setup, track, verdict, **arguments)
        return page.read_text(encoding="utf-8")
