"""Flights from the ground to the ground by ArduPlane's law, those of `kept_landings/` among them."""

import csv
import functools
import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np

from aircraft.catalog import find_logged_aircraft
from flight.mission.ground_phases import Approach
from flight.mission.items import Command, Frame, Home, Mission, MissionItem
from flight.simulation.setup import FlightSetup
from flight.simulation.simulate import Flight, SimulatedFlight, fly_to_end
from flight.simulation.track import Track
from planfly.workflow.open_flight import make_setup
from planfly.workflow.uav import load_uav
from tests.setups import spec_around
from world.airfield import LandingStrip, Launch
from world.arrays import Floats
from world.frames import to_geo
from world.scenario import Scenario, load_scenario, scenario_from_spec
from world.wind import Wind

FOLDER = Path(__file__).with_name("kept_landings")
FLIGHTS: dict[str, dict[str, Any]] = json.loads((FOLDER / "flights.json").read_text(encoding="utf-8"))
HOME = (9500.0, -5000.0, 335.055)
# The kept landings are of 4.6.0-dev, whose flare pushed the nose down on a field higher than home
# (`AP_TECS::_update_height_demand` up to 4.6.2): it touched down up to so many metres before the corrected flare.
# A flight of 4.6.3 on such a field touched down later still than the law (`kept_releases`, low-pitch: 30 m).
LATER_M = 45.0
RAIL = Launch("catapult", math.radians(280.0), 20.0, 6.0, math.radians(12.0))


@functools.cache
def _kept_rows() -> list[dict[str, str]]:
    with (FOLDER / "tracks.csv").open(encoding="utf-8") as file:
        return list(csv.DictReader(file))


def kept(flight: str, phase: str) -> dict[str, Floats]:
    """Columns of the kept take-off or landing of a flight."""
    rows = [row for row in _kept_rows() if (row["flight"], row["phase"]) == (flight, phase)]
    return {name: np.array([float(row[name]) for row in rows]) for name in rows[0] if name not in ("flight", "phase")}


@dataclass(frozen=True)
class Flown:
    """A flight from the ground, or to it, or both."""

    setup: FlightSetup
    flight: SimulatedFlight

    @property
    def track(self) -> Track:
        """What was flown."""
        return self.flight.track

    @property
    def approach(self) -> Approach:
        """The landing that was to be flown."""
        assert self.setup.ground_phases.approach is not None
        return self.setup.ground_phases.approach


def make_ground_setup(scenario: Scenario, mission: Mission, **parameters: float) -> FlightSetup:
    """A setup by ArduPlane 4.6's law with these parameters over the aircraft's, and exact navigation."""
    exact = {"autopilot": "ardupilot", "arduplane_version": "4.6", "nav": "perfect"}
    made = replace(scenario, flight=scenario.flight.model_copy(update=exact))
    return make_setup(made, load_uav(made, parameters), mission, 1)


def fly(setup: FlightSetup) -> Flown:
    """Fly a setup to its end."""
    return Flown(setup, fly_to_end(Flight(setup, find_logged_aircraft(setup.aircraft, setup.scenario.flight.aircraft))))


@functools.cache
def fly_kept(flight: str) -> Flown:
    """A kept flight by the law."""
    one = FLIGHTS[flight]
    place = one["landing"]
    strip = LandingStrip(place["east_m"], place["north_m"], math.radians(place["course_deg"]), length=300.0)
    wind = Wind(one["wind_mps"], math.radians(250.0))
    scenario = replace(load_scenario("jacksboro-air"), wind=wind, launch=RAIL, landing=strip)
    lat, lon = (float(value) for value in to_geo(scenario.origin, *HOME[:2]))
    items = []
    for k, (command, item_lat, item_lon, amsl) in enumerate(one["items"], 1):
        mark = command == Command.DO_LAND_START
        pitch = 10.0 if command == Command.NAV_TAKEOFF else 0.0
        frame = int(Frame.MISSION if mark else Frame.GLOBAL)
        items.append(MissionItem(k, command, frame, (pitch, 0.0, 0.0, 0.0), item_lat, item_lon, amsl))
    mission = Mission(Home(lat, lon, HOME[2]), tuple(items))
    # TKOFF_LVL_ALT is the default of the release that flew them.
    return fly(make_ground_setup(scenario, mission, TKOFF_THR_MINACC=15.0, TKOFF_LVL_ALT=5.0, **one["parameters"]))


def circuit(
    launch: Launch | None,
    strip: LandingStrip | None,
    *,
    wind: tuple[float, float] = (5.0, 60.0),
    pitch: float = 10.0,
    aircraft: str = "aerosonde",
    point: float = 0.0,
    world: Mapping[str, Any] = MappingProxyType({}),
    **parameters: float,
) -> FlightSetup:
    """A take-off to the east over level ground at the sea, a turn to the left, and a landing to the west at 500, 600 m.

    wind: m/s, from degrees.  pitch: of the take-off item, degrees.  point: of the landing item over home, m.
    world: further tables of the scenario.
    """
    spec = spec_around(
        [[0.0, 0.0, 60.0], [1500.0, 600.0, 54.0]],
        buffer=3000.0,
        ceiling=1000.0,
        origin={"lat_deg": 46.0, "lon_deg": 8.0},
        flight={"aircraft": aircraft},
        wind={"speed_mps": wind[0], "from_deg": wind[1]},
        **world,
    )
    scenario = replace(scenario_from_spec(spec, "circuit"), launch=launch, landing=strip)

    def place(east: float, north: float) -> tuple[float, float]:
        lat, lon = to_geo(scenario.origin, east, north)
        return float(lat), float(lon)

    over, none = int(Frame.GLOBAL_RELATIVE_ALT), (0.0,) * 4
    items = (
        MissionItem(1, Command.NAV_TAKEOFF, over, (pitch, 0.0, 0.0, 0.0), *place(0.0, 0.0), 60.0),
        MissionItem(2, Command.NAV_WAYPOINT, over, none, *place(1500.0, 0.0), 80.0),
        MissionItem(3, Command.NAV_WAYPOINT, over, none, *place(1500.0, 600.0), 70.0),
        MissionItem(4, Command.NAV_WAYPOINT, over, none, *place(1100.0, 600.0), 54.0),
        MissionItem(5, Command.NAV_LAND, over, none, *place(500.0, 600.0), point),
    )
    return make_ground_setup(scenario, Mission(Home(*place(0.0, 0.0), 0.0), items), **parameters)
