"""A verdict as data: the place of every kind of finding, what could be changed, and both in a verdict.json."""

import json
import sys
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import pytest

from flight.autopilots.arduplane.autopilot import ArduPlane
from flight.autopilots.arduplane.parameters import ArduPilotParameters
from flight.autopilots.arduplane_sitl.autopilot import ArduPlaneSitl
from flight.autopilots.autopilot import AutopilotProgram
from flight.simulation.setup import FlightSetup
from flight.simulation.track import Track
from logs.recording.reader import read_log
from logs.recording.recorder import Recorder
from logs.verdict.document import SCHEMA
from logs.verdict.findings import UNKNOWN_AIRCRAFT, Fact, Finding, closest_to_limit, make_finding
from logs.verdict.judge_flight import judge_flight, judge_geometry, judge_plan_only
from logs.verdict.places import (
    FLIGHT,
    PLAN,
    AirframeAnswer,
    Change,
    DecidingParameter,
    Disagreement,
    Place,
    ReferenceFlights,
)
from logs.verdict.presentation import findings_by_rule
from logs.verdict.reference_attachment import parse_reference_flights, reference_flights_json
from logs.verdict.rules.registry import RULES
from logs.verdict.verdict import Verdict, verdict_json
from logs.verdict.wording import place_text, suggestions_text
from planfly.campaigns.flight_row import find_minimum_margins
from planfly.terminal.verdict_lines import verdict_lines
from tests.logs.verdict.judging import ROUTE, bad_plan, judge, leg, of, suggested, waypoint
from tests.mission_lines import setup_of, wp
from tests.synthetic import fly_path, make_setup
from world.errors import LogError, MissingExtraError

THREAT = {
    "name": "Alfa",
    "east_m": 300.0,
    "north_m": 1000.0,
    "amsl_m": 300.0,
    "kill_radius_m": 500.0,
    "kill_scale_m": 200.0,
    "detection_radius_m": 700.0,
    "detection_scale_m": 400.0,
}


def test_a_real_autopilot_that_flew_is_data_too(setup: FlightSetup, track: Track) -> None:
    program = AutopilotProgram("ArduPlane V4.6.0", "ab" * 32, {"WP_RADIUS": 60.0}, {"WP_RADIUS": 60.0}, ("FOO",))
    verdict = judge(replace(setup, autopilot=ArduPlaneSitl(ArduPilotParameters.defaults(), program)), track)
    assert "\nFlown by: ArduPlane V4.6.0 (sha256 abababab...), 1 parameter set for" in verdict.summary
    assert json.loads(verdict_json(verdict))["flown_by"] == {
        "version": "ArduPlane V4.6.0",
        "sha256": "ab" * 32,
        "parameters": {"WP_RADIUS": 60.0},
        "changed": {"WP_RADIUS": 60.0},
        "unused": ["FOO"],
    }
    assert json.loads(verdict_json(judge(setup, track)))["flown_by"] is None


def test_parameters_are_data_with_who_states_them(setup: FlightSetup, track: Track) -> None:
    assert json.loads(verdict_json(judge(setup, track)))["parameters"] is None
    mine = ArduPilotParameters.from_text("LIM_ROLL_CD 3000\nFOO 1\n", "mine.parm")
    data = json.loads(verdict_json(judge(replace(setup, autopilot=ArduPlane(mine)), track)))["parameters"]
    assert (data["file"], data["unused"]) == ("mine.parm", ["FOO"])
    assert data["not_flown"] == ["TERRAIN_FOLLOW"]
    values = {value["name"]: (value["value"], value["origin"]) for value in data["values"]}
    assert values["ROLL_LIMIT_DEG"] == (30.0, "file")
    assert values["WP_RADIUS"] == (90.0, "default")


def test_each_rule_names_its_places(setup: FlightSetup, track: Track) -> None:
    verdict = judge(setup, track)
    places = {rule: [item.place for item in verdict.findings if item.rule == rule] for rule in RULES}
    legs = [Place("leg", k) for k in range(4)]
    waypoints = [Place("waypoint", k, item=k) for k in range(5)]
    assert places["slope"] == places["clearance"] == places["speed"] == legs
    assert (places["turn"], places["waypoint"]) == (waypoints[1:-1], waypoints)
    for rule in ("threat", "bounds", "energy", "departure", "completion"):
        assert places[rule] == [FLIGHT]


def test_a_threat_says_its_number_its_name_and_which_side() -> None:
    far = THREAT | {"name": "far", "east_m": 9000.0}
    setup = make_setup([[0, 0, 300], [0, 2000, 300]], threats=[far, THREAT])
    places = [item.place for item in judge_geometry(setup).findings if item.rule == "threat"]
    assert places == [Place("missile", 1, name="Alfa"), Place("radar", 1, name="Alfa")]


def test_a_loiter_lies_at_its_first_corner_and_a_check_at_its_item() -> None:
    setup = setup_of(wp(0, 500), wp(0, 1500, command=18, p="1 0 150 0"), wp(1500, 1500, command=82))
    verdict = judge_geometry(setup)
    loiter = of(verdict, "loiter")
    assert (loiter.place.kind, loiter.place.item) == ("waypoint", 2)
    missions = [item for item in verdict.findings if item.rule == "mission"]
    assert Place("mission", item=3) in [item.place for item in missions if item.check == "checkMissionItemValidity"]
    assert len({item.check for item in missions}) == len(missions)


def test_a_plan_that_was_not_flown_is_the_place(setup: FlightSetup) -> None:
    assert {item.place for item in judge_plan_only(bad_plan(setup)).findings} == {PLAN}


def test_a_change_says_what_where_from_and_to() -> None:
    steep = of(judge_geometry(make_setup([[0, 0, 300], [0, 2000, 300], [0, 3000, 600]])), "slope", leg(1))
    assert suggested(steep, "length") == Change("length", leg(1), 1000.0, 1241.0, "m")
    assert suggested(steep, "rise").current == 300.0
    fast = of(judge_geometry(make_setup(ROUTE, airspeed=33.0)), "speed", leg(0))
    assert fast.suggestions == ((Change("airspeed", leg(0), 33.0, 16.5, "m/s", most=31.0),),)
    sharp = judge_geometry(make_setup([[0, 0, 300], [0, 1000, 300], [150, 1000, 300], [150, 2000, 300]]))
    turn = suggested(of(sharp, "turn", waypoint(1)), "turn")
    assert (turn.place, turn.current, turn.unit) == (Place("waypoint", 1, item=1), pytest.approx(90.0), "deg")


def test_steps_have_no_value_now() -> None:
    low = of(judge_geometry(make_setup([[0, 0, 50], [0, 3000, 50]], limits={"min_clearance_m": 60.0})), "clearance")
    assert low.suggestions == ((Change("height", leg(0), None, 11.0, "m"),),)
    setup = replace(make_setup(ROUTE), battery=30.0)
    empty = of(judge(setup, fly_path(setup)), "energy")
    assert [[change.what for change in one] for one in empty.suggestions] == [["duration"], ["battery"]]
    high = of(judge_geometry(make_setup([[0, 0, 4900], [0, 3000, 5100], [0, 6000, 4900]])), "bounds")
    assert high.suggestions == ((Change("inset", FLIGHT, None, 101.0, "m"),),)


def test_both_legs_of_a_steep_arc_are_one_suggestion() -> None:
    item = of(judge_geometry(make_setup([[0, 0, 1500], [0, 2000, 1254], [1732, 1000, 1044]])), "slope", leg(0))
    (suggestion,) = item.suggestions
    assert [(change.what, change.place, change.wanted < 0.0) for change in suggestion] == [
        ("rise", leg(0), True),
        ("rise", leg(1), True),
    ]


def test_a_file_holds_the_data_and_the_words(setup: FlightSetup) -> None:
    wide = fly_path(setup, across=lambda s: 0.0 * s + 35.0, stop=6000.0)
    verdict = judge_flight(setup, wide, "ground contact")
    written = json.loads(verdict_json(verdict))
    assert written["schema"] == SCHEMA == "planfly.verdict/3"
    assert written["summary"].splitlines() == list(verdict.lines)
    for item, found in zip(verdict.findings, written["findings"], strict=True):
        assert found["place"] == asdict(item.place)
        assert found["where"] == place_text(item.place)
        assert found["suggestions"] == [[asdict(change) for change in one] for one in item.suggestions]
        assert found["suggestion"] == suggestions_text(item.suggestions)
        assert found["reason"] == item.reason
    geometry, own = verdict.levels
    assert (geometry.name, own.name, own.flyable, own.headline) == ("geometry", "airframe", False, verdict.headline)
    differences = [Disagreement("corridor", leg(k), "geometry", there=True, here=False) for k in range(3)]
    assert [one for one in geometry.disagreements if one.rule == "corridor"] == differences
    texts = [f"corridor at leg {k} (to item {k + 1}) passes by geometry and fails in flight" for k in range(3)]
    levels = written["levels"]
    assert [level["name"] for level in levels] == ["geometry", "airframe"]
    assert [text for text in levels[0]["disagreements"] if text in texts] == texts
    assert len(levels[0]["differences"]) == len(levels[0]["disagreements"])
    assert written["deciding_parameter"] is None


def test_a_margin_that_says_the_opposite_is_left_out() -> None:
    def margin(value: float, ok: bool) -> float | None:
        return make_finding("turn", waypoint(1), ok=ok, reason="", margin=value).margin

    assert (margin(2.0, True), margin(-2.0, False), margin(2.0, False)) == (2.0, -2.0, None)


def test_a_verdict_without_lines_has_an_empty_headline() -> None:
    finding = Finding("turn", waypoint(1), None, None, None, "none", None, None, "deg", "", None, "")
    verdict = Verdict((finding,), False, False, (), "plan")
    assert (verdict.headline, verdict.summary) == ("", "")


# ----------------------------------------------------------------------
# What flights beside a recorded one gave: written, read back, and refused where it does not fit.

FAILED = (("clearance", Place("leg", 4)), ("threat", Place("missile", 0, name="Alfa")))
DECIDING = DecidingParameter("TECS_HDEM_TCONST", 3.0, 1.2, "s", "clearance", Place("leg", 4), -8.25)
REFERENCES = [
    ReferenceFlights(),
    ReferenceFlights(AirframeAnswer(True, "flyable")),
    ReferenceFlights(AirframeAnswer(False, "not flyable: …", FAILED)),
    ReferenceFlights(AirframeAnswer(True, "flyable"), DECIDING),
]


@pytest.mark.parametrize("reference", REFERENCES)
def test_it_reads_back(reference: ReferenceFlights) -> None:
    assert parse_reference_flights(reference_flights_json(reference), "a.mcap") == reference


@pytest.mark.parametrize("reference", [None, *REFERENCES])
def test_a_log_carries_it(tmp_path: Path, setup: FlightSetup, track: Track, reference: ReferenceFlights | None) -> None:
    path = tmp_path / "flight.mcap"
    with Recorder(path, setup) as recorder:
        recorder.write(track)
        recorder.finish("completed", reference=reference)
    log = read_log(path)
    assert (log.reference, log.complete) == (reference, True)


def changed(**fields: Any) -> bytes:
    return json.dumps(json.loads(reference_flights_json(REFERENCES[3])) | fields).encode()


@pytest.mark.parametrize(
    ("data", "said"),
    [
        (b"", "a.mcap: "),
        (b"{}", "a.mcap: airframe"),
        (changed(schema="planfly.beside/9"), "a.mcap: schema"),
        (changed(more=1), "a.mcap: more"),
        (changed(airframe={"flyable": True, "headline": "", "failed": [["juggling", {}]]}), "a.mcap: airframe"),
        (changed(airframe=7), "a.mcap: airframe"),
    ],
)
def test_what_does_not_fit_is_refused_in_a_line(data: bytes, said: str) -> None:
    with pytest.raises(LogError) as refused:
        parse_reference_flights(data, "a.mcap")
    assert str(refused.value).startswith(said)
    assert "\n" not in str(refused.value)


def test_a_rule_that_there_is_not_is_refused() -> None:
    place = {"kind": "leg", "index": 1, "item": None, "name": ""}
    airframe = {"flyable": False, "headline": "", "failed": [["juggling", place]]}
    with pytest.raises(LogError, match="'juggling' is not a rule"):
        parse_reference_flights(changed(airframe=airframe), "a.mcap")


# ----------------------------------------------------------------------
# A failed finding is closest to its limit, whatever passes beside it.


def slope_finding(leg: int, margin: float | None, *, ok: bool | None) -> Finding:
    return make_finding("slope", Place("leg", leg), ok=ok, reason="", flown=3.0, limit=7.0, margin=margin, unit="deg")


PASSED = [slope_finding(1, 9.0, ok=True), slope_finding(2, 1.5, ok=True), slope_finding(3, 0.1, ok=None)]
BEYOND = [slope_finding(4, -0.5, ok=False), slope_finding(5, -2.5, ok=False)]
# It fails by other evidence than its number, which is within the limit.
OTHERWISE = slope_finding(6, 4.0, ok=False)


@pytest.mark.parametrize(
    ("findings", "leg", "margin"),
    [
        (PASSED, 2, 1.5),
        ([*PASSED, *BEYOND, OTHERWISE], 5, -2.5),
        ([*PASSED, OTHERWISE], 6, None),
        (PASSED[2:], None, None),
    ],
)
def test_a_failed_finding_is_closest_to_its_limit_everywhere(
    findings: list[Finding], leg: int | None, margin: float | None
) -> None:
    closest = closest_to_limit(findings)
    assert (closest and closest.place.index, closest and closest.margin) == (leg, margin)
    verdict = Verdict(tuple(findings), flyable=False, complete=True, lines=("not flyable",), level="flown")
    # The terminal names the place only with a number that tells how far it is.
    (line,) = (line for line in verdict_lines(verdict, []) if line.startswith("  slope"))
    assert ("limit at" in line) == (margin is not None)
    if margin is not None:
        assert ("furthest beyond its limit at" if margin < 0.0 else "closest to its limit at") in line
        assert f"at leg {leg}" in line
    (rule,) = findings_by_rule(findings)
    assert rule.cells[3] == ("" if leg is None else f"leg {leg}")
    assert [(rule, least.value) for rule, least in find_minimum_margins(tuple(findings))] == (
        [] if margin is None else [("slope", margin)]
    )


@pytest.mark.parametrize(("margin", "kept"), [(-0.2, None), (-1.1, None), (-1.2, -1.2)])
def test_a_finding_that_fails_within_its_tolerance_fails_by_other_evidence(margin: float, kept: float | None) -> None:
    item = make_finding("slope", Place("leg", 1), ok=False, reason="too weak", margin=margin, tolerance=1.1, unit="deg")
    assert item.margin == kept


@pytest.mark.parametrize(("margin", "kept"), [(-1.2, None), (-1.1, -1.1), (0.1, 0.1)])
def test_a_finding_that_passes_beyond_its_tolerance_passes_by_other_evidence(margin: float, kept: float | None) -> None:
    item = make_finding("slope", Place("leg", 1), ok=True, reason="a step", margin=margin, tolerance=1.1, unit="deg")
    assert item.margin == kept
    # Campaigns rank flights by margins that can fail, with the tolerance.
    ranked = [] if kept is None else [pytest.approx(kept + 1.1)]
    assert [least.value for _, least in find_minimum_margins((item,))] == ranked


def test_a_rule_with_a_finding_left_open_is_not_called_ok_in_the_report() -> None:
    passed = make_finding("slope", Place("leg", 0), ok=True, reason="", margin=1.0, unit="deg")
    unsure = make_finding("slope", Place("leg", 1), ok=None, reason="", check=UNKNOWN_AIRCRAFT)
    assert [rule.state for rule in findings_by_rule([passed])] == ["ok"]
    (row,) = findings_by_rule([passed, unsure])
    # The row names the leg that is open, not the one that passes.
    assert (row.state, *row.cells[2:4]) == ("open", "1 ok, 1 not judged", "leg 1")
    failed = make_finding("slope", Place("leg", 2), ok=False, reason="too steep")
    assert [rule.cells[3] for rule in findings_by_rule([passed, unsure, failed])] == ["leg 2"]


def made_verdict() -> Verdict:
    """Two slopes of which one fails, a turn without a number, and a corridor that was not judged."""
    findings = (
        make_finding("slope", Place("leg", 0), ok=True, reason="", margin=2.0, planned=3.0, unit="deg"),
        make_finding("slope", Place("leg", 1), ok=False, reason="too steep", margin=-1.5, tolerance=1.0, unit="deg"),
        make_finding("turn", Place("turn", 1), ok=True, reason="", unit="deg"),
        make_finding("corridor", Place("leg", 0), ok=None, reason="off the map", unit="m"),
        make_finding("threat", FLIGHT, ok=True, reason="", margin=0.0, unit="s", facts=[Fact("nearest", 18.0, "m")]),
    )
    return Verdict(findings, flyable=False, complete=True, lines=("not flyable",), level="flown")


def test_the_closest_of_each_rule() -> None:
    closest = made_verdict().closest
    assert {rule: (one.place.index, one.margin) for rule, one in closest.items()} == {
        "slope": (1, -1.5),
        "threat": (None, 0.0),
    }
    assert closest["threat"].nearest_distance == 18.0


def test_a_table_has_a_row_a_finding(monkeypatch: pytest.MonkeyPatch) -> None:
    table = made_verdict().to_pandas()
    assert table["rule"].tolist() == ["slope", "slope", "turn", "corridor", "threat"]
    assert table["index"].tolist()[:4] == [0, 1, 1, 0]
    assert table["ok"].tolist() == [True, False, True, None, True]
    assert (table["nearest"].min(), table["nearest"].count()) == (18.0, 1)
    assert table.loc[table["ok"] == False, "reason"].tolist() == ["too steep"]  # noqa: E712
    # Numbers of which there are none are NaN, so that a column can be reckoned with.
    assert table["margin"].min() == -1.5
    assert table["margin"].isna().tolist() == [False, False, True, True, False]
    assert table.dtypes[["planned", "flown", "limit", "tolerance", "margin", "nearest"]].unique().tolist() == [float]
    empty = Verdict((), flyable=True, complete=True, lines=(), level="flown").to_pandas()
    assert list(empty.columns) == list(table.columns)
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(MissingExtraError, match=r"^to_pandas\(\) needs the extra 'tables'"):
        made_verdict().to_pandas()


def test_the_value_of_a_flight_inside_a_limit_is_not_the_planned_one_beyond_it() -> None:
    """The planned path violates a zone by 38.5 m; the flight stays 21 m away from the violation: its depth is 0."""
    place = Place("inclusion", 0)
    depths = {"planned": 38.5, "flown": 0.0, "limit": 0.0, "tolerance": 0.02, "margin": 21.0, "unit": "m"}
    assert make_finding("fence", place, ok=True, reason="", **depths).value == 0.0
    # The other way round, the flight violates the zone.
    depths |= {"planned": 0.0, "flown": 38.5, "margin": -38.5}
    assert make_finding("fence", place, ok=False, reason="", **depths).value == 38.5
