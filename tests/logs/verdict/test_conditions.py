"""What a verdict says it is for: an aircraft that somebody named or nobody did, its speed, the weather, the ground."""

import json
from dataclasses import asdict, replace

import numpy as np
import pytest

from aircraft.catalog import load_aircraft
from flight.autopilots.arduplane.autopilot import ArduPlane
from flight.autopilots.arduplane.parameters import ArduPilotParameters
from flight.autopilots.px4.autopilot import Px4
from flight.simulation.setup import FlightSetup, ImportedLog
from logs.verdict.conditions import (
    condition_lines,
    corridor_line,
    flown_condition_lines,
    judging_conditions,
    min_leg_spacing,
)
from logs.verdict.judge_flight import judge_flight, judge_geometry, judge_plan_only
from logs.verdict.verdict import verdict_json
from tests.logs.made_flight import make_setup, make_track
from tests.logs.verdict.judging import bad_plan
from world.airspace.zones import Cylinder, Zone
from world.errors import FlightError
from world.scenario import with_flight, with_wind
from world.scenario_tables import FlightTable


def lines_of(setup: FlightSetup) -> list[str]:
    return condition_lines(judging_conditions(setup))


def test_an_aircraft_that_nobody_named_is_said_to_be_the_default() -> None:
    setup = make_setup()
    unnamed = replace(setup.scenario, flight=FlightTable(aircraft_by_default=True))
    line, _ = lines_of(setup.in_scenario(unnamed))
    assert line.startswith("Aircraft: aerosonde, 11 kg, ")
    assert line.endswith("; no aircraft was named, so this is the default (name yours with --aircraft)")
    # An option that says nothing of the aircraft names none either.
    line, _ = lines_of(setup.in_scenario(with_flight(unnamed, airspeed_mps=24.0)))
    assert "no aircraft was named" in line
    assert "(from the scenario or an option)" in line
    line, _ = lines_of(setup.in_scenario(with_flight(unnamed, aircraft="aerosonde")))
    assert "as this is the default" not in line


def test_weather_and_ground() -> None:
    setup = make_setup()
    windy = with_wind(setup.scenario, 8.04, 3.0 * 3.14159265 / 2.0, "moderate")
    _, line = lines_of(setup.in_scenario(windy))
    begin = (
        "Conditions: wind 8.04 m/s from 270 degrees at 420 m AMSL, +0.1 m/s per 100 m of height, moderate turbulence"
        " (vertical gusts: 1.54 m/s RMS); navigation without position error; terrain "
    )
    assert line.startswith(begin)
    assert "heights above " in line
    calm = replace(with_wind(setup.scenario, 0.0, 0.0, "none"), terrain=None)
    _, line = lines_of(setup.in_scenario(calm))
    assert line == (
        "Conditions: no wind at 420 m AMSL, +0.1 m/s per 100 m of height, no turbulence;"
        " navigation without position error; no terrain; 1 zone"
    )
    _, line = lines_of(replace(setup, nav="gnss"))
    assert "; navigation with a GNSS error of 1.5 m on each axis; " in line


def test_the_gradient_of_the_wind_is_stated_with_its_altitude() -> None:
    """0.05 per second are 5 m/s more in 100 m; without a gradient there is no altitude."""
    setup = make_setup()
    wind = replace(with_wind(setup.scenario, 4.0, 0.0, None).wind, gradient=0.05, reference_amsl=445.2)
    found = judging_conditions(setup.in_scenario(replace(setup.scenario, wind=wind)))
    assert (found.wind_gradient_per_s, found.wind_amsl_m) == (0.05, 445.2)
    said = "wind 4 m/s from 0 degrees at 445 m AMSL, +5 m/s per 100 m of height"
    assert condition_lines(found)[1].startswith(f"Conditions: {said}, ")
    any_wind = condition_lines(replace(found, wind_mps=None))[1]
    assert any_wind.startswith(
        "Conditions: wind from every direction in turn at 445 m AMSL, +5 m/s per 100 m of height, "
    )
    slower = replace(setup.scenario, wind=replace(wind, gradient=-0.004))
    assert " m AMSL, -0.4 m/s per 100 m of height" in lines_of(setup.in_scenario(slower))[1]
    even = judging_conditions(setup.in_scenario(replace(setup.scenario, wind=replace(wind, gradient=0.0))))
    assert (even.wind_gradient_per_s, even.wind_amsl_m) == (0.0, None)
    assert "AMSL" not in condition_lines(even)[1].partition(";")[0]


def test_the_zones_are_counted_the_missions_own_among_them() -> None:
    tower = Zone("tower", "exclusion", Cylinder(0.0, 0.0, 50.0))
    setup = make_setup()
    (own,) = setup.mission.fences
    for of_scenario, fences, said in (
        (0, (), ""),
        (1, (), "; 1 zone"),
        (0, (own,), "; 1 zone"),
        (12, (own,), "; 13 zones"),
    ):
        world = replace(setup.scenario, zones=(tower,) * of_scenario)
        judged = replace(setup, mission=replace(setup.mission, fences=fences)).in_scenario(world)
        line = lines_of(judged)[1]
        assert "zone" not in line if not said else line.endswith(said)
        assert judging_conditions(judged).zones == of_scenario + len(fences)


def test_a_logs_aircraft_need_not_be_on_this_machine(monkeypatch: pytest.MonkeyPatch) -> None:
    def missing(name: str, _asked: str) -> None:
        raise FlightError(f"{name}: no such folder")

    monkeypatch.setattr("logs.verdict.conditions.find_logged_aircraft", missing)
    line, _ = lines_of(make_setup())
    assert " kg" not in line


def test_the_kind_of_an_airspeed_and_who_states_it() -> None:
    """ArduPlane and PX4 fly equivalent airspeeds, planfly's guidance true ones."""
    setup = make_setup()
    mine = ArduPilotParameters.from_text("AIRSPEED_CRUISE 21\n", "mine.parm")
    unstated = setup.in_scenario(replace(setup.scenario, flight=FlightTable()))
    said = [
        lines_of(replace(unstated, autopilot=autopilot))[0].partition(" kg, ")[2]
        for autopilot in (setup.autopilot, ArduPlane(ArduPilotParameters.defaults()), ArduPlane(mine))
    ]
    assert said == [
        "25.2 m/s true airspeed (its cruise speed)",
        "25.2 m/s equivalent airspeed (its cruise speed)",
        "25.2 m/s equivalent airspeed (from the autopilot's parameters)",
    ]
    assert judging_conditions(replace(unstated, autopilot=ArduPlane(mine))).autopilot_version == "4.7"
    px4 = Px4.load(FlightTable(autopilot="px4", px4_version="1.16"), load_aircraft("aerosonde"), "a")
    found = judging_conditions(replace(unstated, autopilot=px4))
    assert (found.autopilot_version, found.airspeed_kind) == ("1.16", "equivalent")


def test_every_verdict_is_told_what_it_is_for_and_holds_it_as_data() -> None:
    """Of a route, of a plan that is not feasible, and of a flight: in its first lines and in its JSON."""
    setup = make_setup()
    conditions = judging_conditions(setup)
    said = [*condition_lines(conditions), "Autopilot: planfly's guidance on the fly-by path"]
    geometric, planned = judge_geometry(setup), judge_plan_only(bad_plan(setup), conditions)
    assert list(geometric.lines[2:5]) == said  # after the answer, and how it starts
    assert list(planned.lines[1:4]) == said
    for verdict in (geometric, planned):
        assert json.loads(verdict_json(verdict))["conditions"] == json.loads(json.dumps(asdict(conditions)))


def test_an_imported_flight_is_told_as_far_as_its_log_goes() -> None:
    setup = make_setup()
    source = ImportedLog("a.BIN", "", "ArduPilot dataflash log", "ArduPlane V4.6.0", holds=("airspeed",))
    setup = replace(setup.in_scenario(replace(setup.scenario, flight=FlightTable())), imported_log=source)
    lines = lines_of(setup)
    assert lines[0] == (
        "Aircraft: not named, so none of its limits are judged (name yours with --aircraft);"
        " 25.2 m/s true airspeed (from the log)"
    )
    assert "turbulence" not in lines[1]
    assert "navigation" not in lines[1]
    named = replace(setup, imported_log=replace(source, aircraft_known=True, holds=()))
    assert lines_of(named)[0] == "Aircraft: aerosonde, 11 kg, 25.2 m/s true airspeed (its cruise speed)"
    verdict = judge_flight(setup, make_track(), "")
    assert list(verdict.lines[1:3]) == lines
    assert verdict.lines[3].startswith("Flown by: ArduPlane V4.6.0 (ArduPilot dataflash log a.BIN")
    assert corridor_line(setup, verdict.findings) in verdict.lines


def lines(gap: float, *, overlap: float = 1.0) -> np.ndarray:
    """Two lines of 900 m side by side, flown to and fro."""
    end = 900.0 * (1.0 - overlap)
    return np.array([[0, 0, 300], [0, 900, 300], [gap, 900, 300], [gap, end, 300]], dtype=float)


@pytest.mark.parametrize(
    ("waypoints", "gap"),
    [
        (lines(40.0), 40.0),
        (lines(-40.0), 40.0),
        # A line that leads away, and one that is flown back, are none beside each other.
        (np.array([[0, 0, 300], [0, 900, 300], [40, 900, 300], [40, 1800, 300]], dtype=float), None),
        (np.array([[0, 0, 300], [0, 900, 300], [40, 900, 300], [900, 900, 300]], dtype=float), None),
        (lines(0.5), None),
    ],
)
def test_the_gap_between_lines_of_a_survey(waypoints: np.ndarray, gap: float | None) -> None:
    found = min_leg_spacing(waypoints)
    assert (None if found is None else found[0]) == pytest.approx(gap)


def test_a_corridor_that_nobody_stated_says_what_it_is_made_of_and_what_it_is_wider_than() -> None:
    """30 m by default, and twice the 90 m at which ArduPlane takes a waypoint for reached."""
    setup = make_setup()
    survey = replace(setup, route=setup.route.with_fields(position=lines(20.0)))
    assert setup.corridor == 30.0
    default = "Corridor: 30 m to either side of the legs, planfly's default. To change it, set [limits] corridor_m"
    assert corridor_line(survey, ()) == (
        f"{default}. The corridor is wider than the 20 m between legs 0 and 2, so a flight within the corridor may"
        " not have followed the lines"
    )
    assert corridor_line(replace(setup, route=setup.route.with_fields(position=lines(31.0))), ()) == default
    assert corridor_line(setup, ()) == default
    assert corridor_line(replace(setup, autopilot=ArduPlane(ArduPilotParameters.defaults())), ()) == (
        "Corridor: 180 m to either side of the legs, 2 times ArduPlane's acceptance radius of 90 m."
        " To change it, set [limits] corridor_m"
    )
    stated = setup.scenario.limits.model_copy(update={"corridor_m": 30.0})
    assert corridor_line(survey.in_scenario(replace(setup.scenario, limits=stated)), ()) == ""


def test_all_names_of_a_parameter_file_without_effect_are_data() -> None:
    """A line names four of them; the conditions name all."""
    names = [f"CAM{k}_FEEDBACK" for k in range(9)]
    law = ArduPlane(
        ArduPilotParameters.from_text("\n".join(f"{name} 1" for name in names) + "\nWP_RADIUS 60\n", "a.parm")
    )
    assert judging_conditions(replace(make_setup(), autopilot=law)).unused_parameters == tuple(names)
    assert judging_conditions(make_setup()).unused_parameters == ()


def test_every_command_says_that_px4_requires_a_landing() -> None:
    """`planfly fly` says it in the headline; campaigns, winds and returns have only the conditions."""
    autopilot = Px4.load(FlightTable(autopilot="px4", px4_version="1.16"), load_aircraft("aerosonde"), "a")
    setup = replace(make_setup(), autopilot=autopilot)
    note = "by default (MIS_TKO_LAND_REQ 2) PX4 rejects a mission without a landing"
    conditions = judging_conditions(setup)
    assert conditions.notes == (note,)
    assert flown_condition_lines(conditions)[-1] == f"Note: {note}"
    assert note in judge_flight(setup, make_track(), "completed").lines[0]
    assert judging_conditions(make_setup()).notes == ()
