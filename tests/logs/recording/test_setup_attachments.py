"""A written log's attachments are named and typed as this module has it."""

import dataclasses
import hashlib
import json
from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import zstandard
from mcap.reader import make_reader

from aircraft.envelope import Envelope
from aircraft.path_limits import Limits
from flight.autopilots.arduplane.autopilot import ArduPlane
from flight.autopilots.arduplane.parameters import ArduPilotParameters
from flight.autopilots.arduplane_sitl.autopilot import ArduPlaneSitl
from flight.autopilots.autopilot import AutopilotProgram
from flight.mission.items import Mission, MissionItem
from flight.mission.route import ROUTE_POINT, Route
from flight.simulation.setup import FlightSetup
from flight.simulation.track import Track
from logs.recording import setup_attachments
from logs.recording.reader import read_log
from logs.recording.setup_attachments import pack_setup, unpack_setup
from logs.recording.setup_schema import EnvelopeTable, RouteTable
from tests.logs.log_copies import Attachments, same
from tests.logs.made_flight import make_setup, record
from world import scenario as scenario_module
from world.errors import LogError
from world.forecast.forecast import ForecastFacts
from world.forecast.wind_field import WindField
from world.kernels import field_names
from world.scenario import load_scenario, scenario_from_spec


def test_a_log_holds_exactly_these(log_file: Path) -> None:
    with log_file.open("rb") as file:
        found = {one.name: one.media_type for one in make_reader(file).iter_attachments()}
    assert found == {
        "setup.json": "application/json",
        "scenario.json": "application/json",
        "plan.json": "application/json",
        "mission.waypoints": "text/plain",
        "terrain.json": "application/json",
        "terrain-000.heights": "application/octet-stream",
        "verdict.json": "application/json",
        "result.json": "application/json",
    }
    fixed = {
        setup_attachments.SETUP_FILE,
        setup_attachments.SCENARIO_FILE,
        setup_attachments.PLAN_FILE,
        setup_attachments.MISSION_FILE,
        setup_attachments.TERRAIN_FILE,
        setup_attachments.VERDICT_FILE,
        setup_attachments.RESULT_FILE,
    }
    assert fixed | {setup_attachments.heights_name(0)} == set(found)
    assert setup_attachments.RECOVERY_FILE not in found


def test_parts_of_the_terrain_sort_in_their_order() -> None:
    parts = [setup_attachments.heights_name(part) for part in range(120)]
    assert sorted(parts) == parts
    assert len(set(parts)) == 120


def test_a_name_of_no_kind_has_no_media_type() -> None:
    with pytest.raises(KeyError):
        setup_attachments.media_type("picture.png")


# ----------------------------------------------------------------------
# Terrain is read from the log alone, bit for bit.


def test_a_dem_comes_from_the_log_and_not_from_its_file(
    tmp_path: Path, track: Track, monkeypatch: pytest.MonkeyPatch
) -> None:
    scenario = load_scenario("jacksboro-air")
    assert scenario.terrain is not None
    setup = dataclasses.replace(make_setup(with_plan=False), scenario=scenario)
    path = record(tmp_path / "a.mcap", setup, track)

    def refuse(*_: object) -> None:
        raise AssertionError("the elevation file was opened")

    monkeypatch.setattr(scenario_module, "open_tiles", refuse)
    same(read_log(path).setup.scenario, scenario)


# ----------------------------------------------------------------------
# A setup comes back whole from its attachments, and one that does not fit is refused.


@pytest.mark.parametrize("with_plan", [True, False])
def test_the_setup_comes_back_whole(tmp_path: Path, track: Track, with_plan: bool) -> None:
    setup = make_setup(with_plan=with_plan)
    log = read_log(record(tmp_path / "a.mcap", setup, track))
    same(log.setup, setup)
    assert log.versions["numpy"] == np.__version__


def test_what_is_not_known_of_an_aircraft_comes_back(tmp_path: Path, track: Track) -> None:
    made = make_setup()
    envelope = dataclasses.replace(
        made.envelope,
        source="a data sheet",
        climb_sd=0.1,
        descent_sd=0.02,
        fastest_sd=1.5,
        power_sd=0.25,
        battery_guessed=True,
        climb_guessed=True,
        bank_guessed=True,
        climb_shortfall=0.05,
    )
    limits = dataclasses.replace(made.limits, envelope=envelope)
    setup = dataclasses.replace(made, limits=limits)
    same(read_log(record(tmp_path / "a.mcap", setup, track)).setup, setup)


def test_the_real_autopilot_that_flew_comes_back(tmp_path: Path, track: Track) -> None:
    given, changed = {"NAVL1_PERIOD": 15.0, "WP_RADIUS": 90.5}, {"NAVL1_PERIOD": 15.0}
    program = AutopilotProgram("ArduPlane V4.6.0 (0badc0de)", "ab" * 32, given, changed, ("FOO",))
    setup = dataclasses.replace(make_setup(), autopilot=ArduPlaneSitl(ArduPilotParameters.defaults(), program))
    log = read_log(record(tmp_path / "a.mcap", setup, track))
    assert log.setup.autopilot.program == program
    assert read_log(record(tmp_path / "b.mcap", make_setup(), track)).setup.autopilot.program is None


def test_no_field_of_a_setup_is_left_behind() -> None:
    # A field with a default could be forgotten in silence: these are all that the log knows of.  What a setup works
    # out of its other fields, it works out again; what plans keep for an autopilot and gusts is no flight's; and a
    # choice between flight models that give the same flight is not recorded.
    kinds = (FlightSetup, Limits, Mission, Route, Envelope)
    names = {kind: [item.name for item in dataclasses.fields(kind) if item.init] for kind in kinds}
    not_recorded = {item.name for item in dataclasses.fields(FlightSetup) if item.init and not item.compare}
    assert not_recorded == {"engine"}
    assert len(set(names[FlightSetup]) - not_recorded) == 13
    assert len(names[Limits]) == 14
    assert len(names[Mission]) == 9
    route_fields = {*names[Route], *field_names(ROUTE_POINT)} - {"points"}
    assert len(route_fields) == 20
    assert route_fields == set(RouteTable.model_fields)
    assert set(names[Envelope]) == set(EnvelopeTable.model_fields)
    assert len(names[Envelope]) == 23
    assert len(dataclasses.fields(MissionItem)) == 8


def test_arduplanes_parameters_come_back_with_who_states_them(tmp_path: Path, track: Track) -> None:
    parameters = ArduPilotParameters.from_text("NAVL1_PERIOD 16.3\nLIM_ROLL_CD 3210\nFS_LONG_ACTN 0\n", "mine.parm")
    setup = dataclasses.replace(make_setup(with_plan=False), autopilot=ArduPlane(parameters), nav="gnss")
    log = read_log(record(tmp_path / "a.mcap", setup, track))
    assert log.setup.autopilot.parameters == parameters
    same(log.setup, setup)


def test_a_log_of_before_there_were_parameters_was_flown_by_guidance(tmp_path: Path, track: Track) -> None:
    attachments = altered(make_setup(with_plan=False), lambda data: data.pop("parameters"))
    assert unpack_setup(attachments, "old.mcap").setup.autopilot.parameters is None


def test_a_parameter_that_is_not_allowed_is_refused() -> None:
    def change(data: dict[str, Any]) -> None:
        data["parameters"]["values"]["WP_RADIUS"] = -5.0

    setup = dataclasses.replace(make_setup(with_plan=False), autopilot=ArduPlane(ArduPilotParameters.defaults()))
    with pytest.raises(LogError, match=r"setup.json: parameters.values: WP_RADIUS: -5: allowed"):
        unpack_setup(altered(setup, change), "a.mcap")


def test_an_external_mission_without_terrain_comes_back(tmp_path: Path, track: Track) -> None:
    spec = make_setup().scenario.to_json() | {"terrain": {"kind": "none"}, "threats": []}
    setup = dataclasses.replace(make_setup(with_plan=False), scenario=scenario_from_spec(spec, "t", external=True))
    log = read_log(record(tmp_path / "a.mcap", setup, track))
    assert log.setup.scenario.terrain is None
    assert log.setup.scenario.external
    same(log.setup, setup)


def altered(setup: FlightSetup, change: Callable[[dict[str, Any]], None]) -> Attachments:
    attachments = pack_setup(setup)
    data = json.loads(attachments["setup.json"])
    change(data)
    return attachments | {"setup.json": json.dumps(data).encode()}


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda data: data["route"]["items"].append(3), r"route\.items: 5 values: expected 4"),
        (lambda data: data["route"].update(waypoints_east_north_amsl_m=[[0.0, 0.0, 9.0]]), "waypoints"),
        (lambda data: data["route"].update(waypoints_east_north_amsl_m=[[0.0, 0.0, 9.0]] * 4), "without horizontal"),
        (lambda data: data["envelope"]["climb_rad"].pop(), r"envelope\.climb_rad: shape \[2, 2\]: expected \[3, 2\]"),
        (lambda data: data["envelope"]["climb_rad"][0].pop(), r"envelope\.climb_rad: shape"),
        (lambda data: data["route"]["items"].__setitem__(0, 2**70), r"route\.items\.0"),
        (
            lambda data: data["route"].update(airspeed=data["route"].pop("airspeed_mps")),
            r"route\.airspeed_mps: missing",
        ),
        (lambda data: data["mission"]["items"][0]["params"].pop(), r"mission\.items\.0\.params\.3"),
        (
            lambda data: data.update(program={"version": "", "sha256": "", "parameters": {"A": "nan"}}),
            r"program\.parameters\.A",
        ),
        (lambda data: data["envelope"]["amsl_m"].reverse(), r"envelope\.amsl_m: not increasing"),
        (lambda data: data.pop("seed"), "seed"),
        (lambda data: data.update(surprise=1), "surprise: unknown key"),
        (lambda data: data.update(schema="planfly.log/9"), "schema"),
        (lambda data: data.update(airspeed_mps="nan"), "airspeed_mps"),
        (lambda data: data["route"]["waypoints_east_north_amsl_m"][0].__setitem__(0, "inf"), "waypoints"),
        (lambda data: data["sha256"].update({"plan.json": "0"}), r"plan\.json: altered"),
        (lambda data: data["sha256"].pop("scenario.json"), r"scenario\.json: missing"),
        (lambda data: data["sha256"].pop("terrain.json"), r"terrain\.kind: 'peaks': the log contains no terrain\.json"),
        (lambda data: data["sha256"].pop("terrain-000.heights"), r"terrain\.json: parts"),
    ],
)
def test_a_setup_that_does_not_fit_is_refused(change: Callable[[dict[str, Any]], None], message: str) -> None:
    with pytest.raises(LogError, match=message) as caught:
        unpack_setup(altered(make_setup(), change), "x.mcap")
    assert "\n" not in str(caught.value)


def test_a_log_does_not_make_its_reader_open_files(track: Track, monkeypatch: pytest.MonkeyPatch) -> None:
    def trap(*_: object) -> None:
        raise AssertionError("a file was opened")

    setup = make_setup(with_plan=False)
    attachments = pack_setup(setup)
    spec = json.loads(attachments["scenario.json"]) | {"terrain": {"kind": "dem", "path": "/etc/passwd"}}
    attachments["scenario.json"] = json.dumps(spec).encode()
    data = json.loads(attachments["setup.json"])
    data["sha256"]["scenario.json"] = hashlib.sha256(attachments["scenario.json"]).hexdigest()
    del data["sha256"]["terrain.json"]
    attachments["setup.json"] = json.dumps(data).encode()
    monkeypatch.setattr(scenario_module, "open_tiles", trap)
    with pytest.raises(LogError, match=r"terrain\.kind: 'dem'"):
        unpack_setup(attachments, "x.mcap")


# ----------------------------------------------------------------------
# The wind of a forecast.

_NOON = datetime(2026, 5, 1, 12, tzinfo=UTC)
_FACTS = ForecastFacts("winds.nc", _NOON, _NOON, _NOON, 2.2, 2, 10.0, 900.0, (45.9, 7.9, 46.1, 8.1), "", 1)


def made_field() -> WindField:
    altitudes = np.broadcast_to([100.0, 900.0], (1, 2, 2, 2))
    velocities = np.arange(16.0).reshape(1, 2, 2, 2, 2)
    return WindField(np.array([0.0]), np.array([45.9, 46.1]), np.array([7.9, 8.1]), altitudes, velocities)


def setup_in_forecast(field: WindField | None) -> FlightSetup:
    setup = make_setup(with_plan=False)
    scenario = setup.scenario
    table = scenario.spec.wind.model_copy(update={"forecast": "/nowhere/winds.nc"})
    spec = scenario.spec.model_copy(update={"wind": table, "at": _NOON.isoformat()})
    wind = dataclasses.replace(scenario.wind, field=field, forecast=_FACTS)
    limits = dataclasses.replace(setup.limits, wind=wind)
    return dataclasses.replace(setup, scenario=dataclasses.replace(scenario, spec=spec, wind=wind), limits=limits)


@pytest.mark.parametrize("field", [made_field(), None])
def test_the_wind_of_a_forecast_comes_back_without_its_file(
    tmp_path: Path, track: Track, field: WindField | None
) -> None:
    setup = setup_in_forecast(field)
    found = read_log(record(tmp_path / "a.mcap", setup, track)).setup
    assert found.scenario.wind == setup.scenario.wind
    assert found.scenario.wind.forecast == _FACTS
    same(found, setup)


def with_part(attachments: Attachments, name: str, data: bytes | None) -> Attachments:
    """Return attachments with another content of one of them, whose hash is right; None leaves it out."""
    setup = json.loads(attachments["setup.json"])
    changed = {key: value for key, value in attachments.items() if key != name}
    setup["sha256"].pop(name, None)
    if data is not None:
        changed[name] = data
        setup["sha256"][name] = hashlib.sha256(data).hexdigest()
    return changed | {"setup.json": json.dumps(setup).encode()}


def packed_numbers(change: Callable[[Any], Any]) -> bytes:
    """Return the packed field with changed numbers: 4 counts, 1 + 2 + 2 axes, and 8 nodes of 3 numbers."""
    numbers = made_field().packed()
    assert numbers.size == 4 + 5 + 24
    return zstandard.compress(np.asarray(change(numbers), "<f8").tobytes())


def put(numbers: Any, index: int, value: float) -> Any:
    numbers[index] = value
    return numbers


@pytest.mark.parametrize(
    "change",
    [
        lambda numbers: numbers[:-1],
        lambda numbers: np.append(numbers, 0.0),
        lambda numbers: put(numbers, -1, np.nan),
        lambda numbers: put(numbers, 0, 2.0),
        lambda numbers: put(numbers, 0, -1.0),
        lambda numbers: put(numbers, 0, 1e300),
        # Latitudes in another order, and the upper level of a node below the lower one.
        lambda numbers: put(numbers, 5, 47.0),
        lambda numbers: put(numbers, 12, 50.0),
    ],
)
def test_altered_numbers_of_a_field_are_refused(change: Callable[[Any], Any]) -> None:
    attachments = with_part(pack_setup(setup_in_forecast(made_field())), "forecast.wind", packed_numbers(change))
    with pytest.raises(LogError, match=r"^x\.mcap: forecast\.wind: not the 33 numbers that forecast\.json states$"):
        unpack_setup(attachments, "x.mcap")


@pytest.mark.parametrize(
    ("name", "data", "message"),
    [
        ("forecast.wind", b"text", r"forecast\.wind: not the 33 numbers"),
        ("forecast.wind", b"", r"forecast\.wind: not the 33 numbers"),
        ("forecast.wind", None, r"forecast\.wind: not the 33 numbers"),
        ("forecast.json", None, r"x\.mcap: forecast\.json: missing"),
        ("forecast.json", b"[]", r"forecast\.json"),
        ("forecast.json", b"{", r"forecast\.json"),
    ],
)
def test_a_forecast_that_is_missing_or_no_forecast_is_refused(name: str, data: bytes | None, message: str) -> None:
    attachments = with_part(pack_setup(setup_in_forecast(made_field())), name, data)
    with pytest.raises(LogError, match=message) as caught:
        unpack_setup(attachments, "x.mcap")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    "change",
    [
        {"source": "winds\n.nc"},
        {"ground": "\u202e"},
        {"departure": "2026-05-01T12:00:00"},
        {"issued": "noon"},
        {"grid_km": "Infinity"},
        {"box": [45.9, 7.9, 46.1]},
        {"levels": 1.5},
    ],
)
def test_altered_facts_are_refused(change: dict[str, Any]) -> None:
    attachments = pack_setup(setup_in_forecast(made_field()))
    data = json.loads(attachments["forecast.json"])
    data["facts"] |= change
    with pytest.raises(LogError, match=r"^x\.mcap: forecast\.json: facts") as caught:
        unpack_setup(with_part(attachments, "forecast.json", json.dumps(data).encode()), "x.mcap")
    assert "\n" not in str(caught.value)


def test_an_attachment_whose_hash_is_another_is_refused() -> None:
    attachments = pack_setup(setup_in_forecast(made_field()))
    for name in ("forecast.json", "forecast.wind"):
        with pytest.raises(LogError, match=f"{name}: altered"):
            unpack_setup(attachments | {name: attachments[name] + b" "}, "x.mcap")
