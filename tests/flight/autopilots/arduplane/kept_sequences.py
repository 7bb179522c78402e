"""Landing sequences that ArduPlane itself flew, as `kept_sequences/` holds them, and the same returns by its law."""

import csv
import functools
import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from flight.mission.items import Command, Frame, Home, Mission, MissionItem
from flight.simulation.setup import FlightSetup
from tests.flight.autopilots.arduplane.flown_grounds import HOME, RAIL, Flown, fly, make_ground_setup
from world.airfield import LandingStrip
from world.arrays import Floats
from world.frames import to_geo
from world.scenario import Scenario, load_scenario
from world.wind import Wind

FOLDER = Path(__file__).with_name("kept_sequences")
FLIGHTS: dict[str, dict[str, Any]] = json.loads((FOLDER / "flights.json").read_text(encoding="utf-8"))
PARAMETERS = {
    **{"TKOFF_THR_MINACC": 15.0, "LAND_PITCH_DEG": 3.0, "LAND_FLARE_SEC": 3.0, "TECS_LAND_ARSPD": 20.0},
    # The default of the release that flew them.
    "TKOFF_LVL_ALT": 5.0,
}


@functools.cache
def kept_sequence(flight: str) -> dict[str, Floats]:
    """Columns of a kept flight."""
    with (FOLDER / "tracks.csv").open(encoding="utf-8") as file:
        rows = [row for row in csv.DictReader(file) if row["flight"] == flight]
    return {name: np.array([float(row[name]) for row in rows]) for name in rows[0] if name != "flight"}


@functools.cache
def field() -> Scenario:
    """The scenario in the flights' wind, with the catapult and the field that they landed on."""
    place = FLIGHTS["abort"]["landing"]
    strip = LandingStrip(place["east_m"], place["north_m"], math.radians(place["course_deg"]), length=300.0)
    return replace(load_scenario("jacksboro"), wind=Wind(5.0, math.radians(250.0)), launch=RAIL, landing=strip)


def _item(seq: int, command: int, lat: float, lon: float, amsl: float, *params: float) -> MissionItem:
    has_place = command not in (Command.DO_LAND_START, Command.NAV_RETURN_TO_LAUNCH)
    frame = int(Frame.GLOBAL if has_place else Frame.MISSION)
    p1, p2 = (*params, 0.0, 0.0)[:2]
    return MissionItem(seq, command, frame, (p1, p2, 0.0, 0.0), lat, lon, amsl)


def kept_mission(flight: str, abort_height: float = 50.0) -> Mission:
    """The mission of a kept flight; where RTL was set in it, a waypoint stands there, and the return after it."""
    items = FLIGHTS[flight]["items"]
    lat, lon = (float(value) for value in to_geo(field().origin, *HOME[:2]))
    made = [_item(1, *items[0], 10.0)]
    if flight == "abort":
        made += [_item(k, *item) for k, item in enumerate(items[1:], 2)]
        made[-1] = replace(made[-1], params=(abort_height, 0.0, 0.0, 0.0))
    else:
        begins = {name: float(column[0]) for name, column in kept_sequence(flight).items()}
        place = (float(value) for value in to_geo(field().origin, begins["east_m"], begins["north_m"]))
        made.append(_item(2, Command.NAV_WAYPOINT, *place, begins["amsl_m"], 0.0, 1.0))
        made.append(_item(3, Command.NAV_RETURN_TO_LAUNCH, 0.0, 0.0, 0.0))
        made += [_item(k, *item) for k, item in enumerate(items[4:], 4)]
    return Mission(Home(lat, lon, HOME[2]), tuple(made), source=f"{flight}.waypoints")


def kept_setup(flight: str, **parameters: float) -> FlightSetup:
    """A kept flight's setup with its parameters, and others that are changed."""
    autoland = {} if flight == "abort" else {"RTL_AUTOLAND": float(flight[-1])}
    return make_ground_setup(field(), kept_mission(flight), **PARAMETERS | autoland | parameters)


@functools.cache
def flown_sequence(flight: str) -> Flown:
    """A kept flight by the law."""
    return fly(kept_setup(flight))
