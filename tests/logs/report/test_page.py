"""The report: whole in one file, safe with hostile names, the verdict first and the numbers those of the data."""

import base64
import hashlib
import json
import math
import re
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import logs.figures.draw_all
from aircraft.envelope import Envelope
from flight.mission.items import Mission, MissionItem
from flight.mission.route import Route
from flight.simulation.flight_setup import FlightSetup, make_limits
from flight.simulation.track import COLUMNS, Track
from logs.figures.draw_all import FIGURE_FILES
from logs.figures.exposure import exposure_rates
from logs.report.page import report_html, write_report
from logs.report.tables import LEG_COLUMNS, PASSAGE_COLUMNS, leg_rows, passage_rows, saturation_rows
from logs.report.text import badge_of, finding_rows, number, quantity, rule_rows
from logs.verdict.findings import Finding, Verdict
from logs.verdict.places import FLIGHT, Place
from logs.verdict.wording import place_text
from world.scenario import from_spec

ROUTE = np.array([[-900.0, -400.0, 300.0], [100.0, -400.0, 340.0], [100.0, 400.0, 380.0], [700.0, 400.0, 360.0]])
EVIL = "<script>alert('x')</script> & \"q\""
PNG = b"\x89PNG\r\n\x1a\nnot drawn here"


@pytest.fixture
def undrawn(monkeypatch: pytest.MonkeyPatch) -> None:
    """Pictures cost most of a second; most tests here read words."""

    def draw(
        setup: FlightSetup, track: Track | None, verdict: Verdict | None, *, svg: bool = False
    ) -> dict[str, bytes]:
        flown = ("time", "exposure", "controls", "energy") if track is not None and len(track) else ()
        return {f"{name}.png": PNG for name in (*FIGURE_FILES, *flown)}

    monkeypatch.setattr(logs.figures.draw_all, "draw_pictures", draw)


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
    scenario = from_spec(spec | changes, "test")
    return FlightSetup(
        scenario=scenario,
        mission=Mission(None, items, warnings=("line 7: CRLF",), source="his.waypoints"),
        mission_text="QGC WPL 110\n",
        route=Route(
            ROUTE,
            np.full(3, 25.0),
            np.zeros(4),
            np.zeros(4, bool),
            np.arange(4),
            "starts trimmed",
            ("item 9: no loiter",),
        ),
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
VERDICT = Verdict(FINDINGS, False, True, ("not flyable: slope on leg 1", "Start: in the air"), "flown")
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
        self.words: list[str] = []
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
        self.words.append(data)
        if self.open and "tr" in self.open and self.rows[-1][1]:
            self.rows[-1][1][-1] += data.strip()

    def text(self) -> str:
        return re.sub(r"\s+", " ", " ".join(self.words))


@pytest.mark.usefixtures("undrawn")
def test_page_is_whole_and_asks_nobody() -> None:
    html = report_html(make_setup(), make_track(), VERDICT, **ARGUMENTS)
    page = Page(html)
    names = [name for name, _ in page.tags]
    assert not {"link", "iframe", "object", "form", "base"} & set(names)
    assert [attributes.get("type") for name, attributes in page.tags if name == "script"] == ["application/json", None]
    assert dict(page.tags)["html"]["lang"] == "en"
    for name, attributes in page.tags:
        for key in ("src", "href", "srcset", "action"):
            value = attributes.get(key)
            assert value is None or value.startswith(("data:image/png;base64,", "#")), (name, value)
        assert not [key for key in attributes if key.startswith("on")]
    script = html.rpartition("<script>")[2].partition("</script>")[0]
    digest = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
    policy = next(str(a["content"]) for _, a in page.tags if a.get("http-equiv") == "Content-Security-Policy")
    assert f"script-src 'sha256-{digest}'" in policy
    assert "default-src 'none'" in policy
    assert "http:" not in html
    assert "https:" not in html
    assert "url(" not in html
    images = [attributes for name, attributes in page.tags if name == "img"]
    assert [base64.b64decode(str(image["src"]).partition(",")[2]) for image in images] == [PNG] * 9
    assert all(len(str(image["alt"])) > 30 for image in images)
    targets = {attributes.get("id") for _, attributes in page.tags}
    links = [str(attributes["href"]) for name, attributes in page.tags if name == "a"]
    assert links
    assert all(link[1:] in targets for link in links)


@pytest.mark.usefixtures("undrawn")
def test_verdict_comes_first_then_what_fails() -> None:
    page = Page(report_html(make_setup(), make_track(), VERDICT, **ARGUMENTS))
    text = page.text()
    order = [
        "Not flyable",
        "not flyable: slope on leg 1",
        "2 of 3 judged findings hold, 1 fails; 1 could not be judged",
        "Start: in the air",
        "What fails",
        "leg 1, slope: flown 11.2°, limit 7.80° (aircraft), beyond it by 3.45°; why leg 1",
        "item 9: no loiter",
        "By rule",
        "Leg by leg",
        "The failing first",
        "planfly run small",
    ]
    places = [text.index(words) for words in order]
    assert places == sorted(places)
    tables = [row for row in page.rows if row[0] in ("fail", "pass", "unjudged") and len(row[1]) == 10]
    assert [state for state, _ in tables] == ["fail", "pass", "pass", "unjudged"]
    assert tables[0][1][:9] == ["leg 1", "slope", "✗ fails", "4.00", "11.2", "7.80", "−3.45", "°", "aircraft"]
    assert "no scenario was given" in tables[3][1][9]
    rules = [cells for state, cells in page.rows if state and len(cells) == 9]
    assert rules[1] == ["slope", "✗ fails", "1 of 2 fail", "leg 1", "4.00", "11.2", "7.80", "−3.45", "°"]
    assert rules[2] == ["bounds", "? not judged", "1 not judged", "no scenario was given", "–", "–", "–", "–", ""]


@pytest.mark.usefixtures("undrawn")
def test_hostile_words_stay_words() -> None:
    setup = make_setup(name=EVIL, description=EVIL)
    setup = replace(setup, mission=replace(setup.mission, source=EVIL, warnings=(EVIL,)), aircraft=EVIL)
    evil = finding("threat", Place("missile", 0, name=EVIL), False, -1.0, reason=EVIL, method=EVIL, unit=EVIL)
    verdict = Verdict((evil,), False, False, (EVIL,), EVIL)
    html = report_html(setup, make_track(), verdict, ended=EVIL, versions={EVIL: EVIL}, command=EVIL)
    assert len(re.findall("<script", html)) == 2
    assert len(re.findall("</script", html)) == 2
    assert Page(html).text().count("<script>alert('x')</script>") > 8
    scene = json.loads(html.partition('id="scene-data">')[2].partition("</script>")[0])
    assert scene["name"] == EVIL
    assert scene["threats"][0]["name"] == EVIL[:90]


@pytest.mark.usefixtures("undrawn")
def test_a_plan_that_was_not_flown_has_a_report() -> None:
    setup = make_setup(terrain={"kind": "none"}, threats=[])
    verdict = Verdict(FINDINGS, False, False, ("no feasible plan: slope",), "plan")
    for track in (None, make_track().rows(0, 0)):
        html = report_html(setup, track, verdict, ended=None, versions={}, command="planfly run small")
        text = Page(html).text()
        assert "Not flyable: no feasible plan" in text
        assert "Nothing was flown" in text
        assert "none was given" in text
        assert "Energy" not in text
        assert html.count("<img") == 5


def test_pictures_are_drawn_into_page_and_files(tmp_path: Path) -> None:
    out = tmp_path / "made" / "here"
    paths = write_report(out, make_setup(), make_track(), VERDICT, **ARGUMENTS)
    assert [path.name for path in paths] == [*(f"{name}.png" for name in FIGURE_FILES), "report.html"]
    assert {path.name for path in out.iterdir()} == {path.name for path in paths}
    html = paths[-1].read_text(encoding="utf-8")
    assert len(html) < 8e6
    assert base64.b64encode(paths[0].read_bytes()).decode() in html
    assert base64.b64encode(paths[1].read_bytes()).decode() in html
    assert html.count("data:image/png;base64,iVBOR") == 9
    before = {path.name: path.read_bytes() for path in paths}
    more = write_report(out, make_setup(), make_track(), VERDICT, svg=True, **ARGUMENTS)
    assert {path.name: path.read_bytes() for path in paths} == before
    drawn = [path for path in more if path.suffix == ".svg"]
    assert [path.stem for path in drawn] == list(FIGURE_FILES)
    first = [path.read_bytes() for path in drawn]
    assert all(ElementTree.fromstring(data).tag.endswith("svg") for data in first)
    write_report(out, make_setup(), make_track(), VERDICT, svg=True, **ARGUMENTS)
    assert [path.read_bytes() for path in drawn] == first


@pytest.mark.usefixtures("undrawn")
def test_a_report_that_cannot_be_written_leaves_nothing(tmp_path: Path) -> None:
    (tmp_path / "map.png").mkdir()
    with pytest.raises(OSError, match=r"map\.png"):
        write_report(tmp_path, make_setup(), make_track(), VERDICT, **ARGUMENTS)
    assert [path.name for path in tmp_path.iterdir()] == ["map.png"]


def test_legs_add_up_to_the_flight() -> None:
    rows = [
        dict(zip(LEG_COLUMNS, row.cells, strict=True)) for row in leg_rows(make_setup(), make_track(), frozenset({1}))
    ]
    assert [row["length (m)"] for row in rows] == ["1\u2009000", "800", "600"]
    assert [row["course (°)"] for row in rows] == ["090.0", "000.0", "090.0"]
    # atan(40/1000), atan(40/800), atan(-20/600)
    assert [row["slope (°)"] for row in rows] == ["+2.29", "+2.86", "−1.91"]
    assert [row["turn at its end (°)"] for row in rows] == ["90.0 left", "90.0 right", "–"]
    assert sum(float(row["flown (s)"]) for row in rows) == pytest.approx(96.0)
    assert sum(float(row["energy (Wh)"]) for row in rows) == pytest.approx(48.0)
    assert [row["peak bank (°)"] for row in rows] == ["0.0", "28.6", "0.0"]
    assert [row["peak cross-track (m)"] for row in rows] == ["3.25", "0.00", "0.00"]
    # 200 m of ground under 300 m at the start, 340 m after the first leg, 360 m at the end
    assert [row["least height above ground (m)"] for row in rows] == ["100.0", "140.0", "160.0"]
    assert [row.failing for row in leg_rows(make_setup(), None, frozenset({1}))] == [False, True, False]


@pytest.mark.parametrize(
    ("flyable", "complete", "level", "findings", "word"),
    [
        (True, True, "flown", FINDINGS[:2], "Flyable"),
        (True, True, "geometric", FINDINGS[:2], "Flyable on paper, not flown"),
        (False, True, "flown", FINDINGS, "Not flyable"),
        (False, False, "flown", FINDINGS, "Not flyable, and incomplete"),
        (False, False, "flown", (finding("completion", FLIGHT, False, None),), "Incomplete, so not flyable"),
        (False, False, "plan", FINDINGS, "Not flyable: no feasible plan"),
    ],
)
def test_badge(flyable: bool, complete: bool, level: str, findings: tuple[Finding, ...], word: str) -> None:
    badge = badge_of(Verdict(findings, flyable, complete, (), level))
    assert badge.word == word
    assert badge.state == ("pass" if flyable else "fail")


@given(st.floats(-1e9, 1e9))
def test_numbers_keep_their_value(value: float) -> None:
    text = number(value)
    back = float(text.replace("\u2009", "").replace("−", "-"))
    half_a_last_digit = 5.1e-5 if abs(value) < 0.01 else 5.1e-4 if abs(value) < 0.1 else 5.1e-3
    assert back == pytest.approx(value, rel=0.006, abs=half_a_last_digit)
    assert number(value, signed=True).lstrip("+−") == text.lstrip("−")
    assert not text.startswith(("−0.0000", "-"))
    assert text.lstrip("−0.").strip() or not text.startswith("−")


def test_numbers_with_units() -> None:
    assert number(None) == number(math.nan) == number(math.inf) == "–"
    assert number(12345.6) == "12\u2009346"
    assert number(-0.001, digits=1) == "0.0"
    assert quantity(math.pi / 6, "rad") == "30.0°"
    assert quantity(4.0, "m/s") == "4.00\u00a0m/s"
    (row,) = finding_rows([finding("turn", Place("waypoint", 1), True, 0.1, unit="rad", planned=0.5, tolerance=0.01)])
    assert (row.planned, row.margin, row.unit) == ("28.6", "+5.73", "°")
    assert row.method == "least squares (±\u00a00.57°)"


@given(st.lists(st.tuples(st.sampled_from([True, False, None]), st.floats(-10, 10)), min_size=1, max_size=12))
def test_rules_show_their_worst_finding(kinds: list[tuple[bool | None, float]]) -> None:
    findings = [finding("slope", Place("leg", k), ok, margin) for k, (ok, margin) in enumerate(kinds)]
    (row,) = rule_rows(findings)
    judged = [item for item in findings if item.ok is not None]
    failed = [item for item in judged if item.ok is False]
    assert row.state == ("fail" if failed else "pass" if judged else "unjudged")
    if judged:
        worst = min(item.margin or 0.0 for item in (failed or judged))
        assert row.where in [place_text(item.place) for item in findings if item.margin == worst]
    states = [item.state for item in finding_rows(findings)]
    assert states == sorted(states, key=["fail", "pass", "unjudged"].index)


def test_stays_and_held_controls_are_those_of_the_track() -> None:
    threat = {"name": "M", "east_m": 100, "north_m": 0, "amsl_m": 360, "kill_radius_m": 250, "kill_scale_m": 50}
    setup, track = make_setup(threats=[threat]), make_track()
    (row,) = passage_rows(setup, track)
    # On the northward leg at 100 m east: in and out where the sphere's surface crosses it.
    assert dict(zip(PASSAGE_COLUMNS, row, strict=True))["closest (m)"] == "0"
    assert float(row[4]) == pytest.approx(20.0, abs=0.05)
    commands = track.commands.copy()
    commands[10:30, 3] = 1.0
    commands[50:55, 0] = -2.0
    held = saturation_rows(setup, replace(track, commands=commands))
    assert [cells[0] for cells in held] == ["elevator", "aileron", "rudder", "throttle"]
    assert [cells[3] for cells in held[:3]] == ["5.0", "0.0", "0.0"]
    # A closed throttle is at a limit, too: the track's is, all the time.
    assert held[3][3] == number(float(track.time[-1]), digits=1)
    assert held[0][2] == "114.6°"


def test_exposure_is_that_of_the_segments() -> None:
    # Past a unit at 100 m with scale 100: (100/d)^4 inside 300 m, integrated over s in closed form.
    position = np.column_stack([np.linspace(-500.0, 500.0, 401), np.full(401, 100.0), np.zeros(401)])
    rate = exposure_rates(position, np.zeros((1, 3)), np.array([300.0]), np.array([100.0]))
    far = math.sqrt(300.0**2 - 100.0**2)
    exact = 100.0**4 * (far / (1e4 * 300.0**2) + math.atan(far / 100.0) / 1e6)
    assert float(rate.sum() * 2.5) == pytest.approx(exact, rel=1e-9)
    assert float(rate.max()) == pytest.approx(1.0, rel=1e-3)
