"""Missions by hand: a line an item, placed in metres about one origin; a plan of any waypoints."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from aircraft.catalog import load_aircraft
from flight.dynamics.envelope_tables import load_envelope
from flight.mission.items import Mission
from flight.mission.route import Route, make_route
from flight.mission_files.formats import parse_mission
from flight.simulation.setup import FlightSetup
from planner.plan import Certificate, Plan
from tests.setups import route_along, setup_along, spec_around
from world.errors import MissionError
from world.frames import GeoOrigin, to_geo
from world.scenario import load_scenario, scenario_from_spec, with_wind
from world.terrain import Terrain, make_flat_terrain

ORIGIN = GeoOrigin(36.5, -84.2)


def ground(amsl: float = 300.0) -> Terrain:
    return make_flat_terrain(np.array([[-5000.0, 5000.0], [-5000.0, 5000.0]]), amsl, 1000.0)


def mission(*lines: str, home: str = "36.5 -84.2 300") -> Mission:
    """A mission of lines without seq, current and autocontinue: "frame command p1 p2 p3 p4 lat lon alt"."""
    rows = [f"{k} 0 {line} 1" for k, line in enumerate([f"0 16 0 0 0 0 {home}", *lines])]
    return parse_mission("\n".join(["QGC WPL 110", *rows]), "a.waypoints")


def wp(east: float, north: float, alt: float = 100.0, command: int = 16, frame: int = 3, p: str = "0 0 0 0") -> str:
    lat, lon = to_geo(ORIGIN, east, north)
    return f"{frame} {command} {p} {float(lat):.7f} {float(lon):.7f} {alt}"


def route(*lines: str, home: str = "36.5 -84.2 300", terrain: Terrain | None = None) -> Route:
    return make_route(mission(*lines, home=home), ORIGIN, terrain, 25.0, False)


def refusal(*lines: str, home: str = "36.5 -84.2 300", terrain: Terrain | None = None) -> str:
    with pytest.raises(MissionError) as caught:
        route(*lines, home=home, terrain=terrain)
    message = str(caught.value)
    assert message.startswith("a.waypoints: ")
    assert "\n" not in message
    return message


def setup_of(*lines: str, home: str = "36.5 -84.2 300", **tables: Any) -> FlightSetup:
    """A mission over flat ground at 100 m, ready to fly."""
    read = mission(*lines, home=home)
    ends = [[0.0, 0.0, 400.0], [500.0, 0.0, 400.0]]
    made = {
        "origin": {"lat_deg": ORIGIN.lat_deg, "lon_deg": ORIGIN.lon_deg},
        "terrain": {"kind": "flat", "amsl_m": 100.0},
        "area": {"east_m": [-6000, 6000], "north_m": [-6000, 6000], "ceiling_amsl_m": 3000.0},
    }
    spec = spec_around(ends, name="loiters", buffer=0.0, ceiling=3000.0, **made)
    scenario, envelope = (
        scenario_from_spec(spec | tables, "loiters", external=True),
        load_envelope(load_aircraft("aerosonde")),
    )
    setup = setup_along(scenario, route_along(ends, 25.0), envelope, airspeed=25.0, battery=888.0)
    flown = make_route(read, ORIGIN, scenario.terrain, 25.0, False, setup.limits)
    return replace(setup, mission=read, route=flown)


def a_plan(points: list[tuple[float, float, float]]) -> Plan:
    scenario = with_wind(load_scenario("jacksboro-air"), 0.0, 0.0, None)
    certificate = Certificate(0.1, 100.0, 0.1, 50.0, 500.0, 100.0, ())
    zeros = np.zeros(4)
    return Plan(scenario, np.array(points), zeros.astype(int), zeros, certificate, 1, "umda", 10, np.zeros((1, 3)))
