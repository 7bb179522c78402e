"""Setups of flights over made ground, shared by the tests of path, guidance and simulation."""

import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import pytest
from numpy.typing import ArrayLike, NDArray

from aircraft.catalog import Aircraft, load_aircraft
from flight.dynamics.envelope_tables import load_envelope
from flight.mission.items import Mission
from flight.mission.route import Route
from flight.simulation.flight_setup import FlightSetup, make_limits
from world.scenario import from_spec

MakeSetup = Callable[..., FlightSetup]


@pytest.fixture(scope="session")
def aerosonde() -> Aircraft:
    return load_aircraft("aerosonde")


def standard() -> NDArray[np.float64]:
    """13 km with turns up to 45 degrees, climbs to 6 and dives to 5."""
    way, course = [np.array([0.0, 0.0, 500.0])], 0.3
    for turn, slope in ((0, 0), (40, 6), (-45, -5), (30, 4), (45, -3), (-35, 0), (-45, 6), (20, -5), (45, 0)):
        course += math.radians(turn)
        up = math.tan(math.radians(slope))
        way.append(way[-1] + 1450.0 * np.array([math.sin(course), math.cos(course), up]))
    return np.array(way)


@pytest.fixture(scope="session")
def make_setup(aerosonde: Aircraft) -> MakeSetup:
    """See `setup_maker`."""
    return setup_maker(aerosonde)


def setup_maker(aircraft: Aircraft) -> MakeSetup:
    """A setup through these points, (w, 3) m, without a mission file.

    wind: speed m/s, from degrees.  speeds: m/s, one or one a leg.  More keywords replace tables of the scenario.
    """
    envelope = load_envelope(aircraft)

    def make(
        points: ArrayLike,
        *,
        wind: tuple[float, float] = (0.0, 0.0),
        turbulence: str = "none",
        seed: int = 1,
        bank_deg: float = 30.0,
        speeds: float | Sequence[float] = 25.0,
        fly_over: Sequence[int] = (),
        **tables: Any,
    ) -> FlightSetup:
        way = np.array(points, dtype=np.float64)
        low, high = way.min(axis=0) - 2000.0, way.max(axis=0) + 2000.0
        ends = [dict(zip(("east_m", "north_m", "amsl_m"), map(float, p), strict=True)) for p in (way[0], way[-1])]
        spec: dict[str, Any] = {
            "name": "made",
            "terrain": {"kind": "flat", "amsl_m": 100.0},
            "area": {
                "east_m": [float(low[0]), float(high[0])],
                "north_m": [float(low[1]), float(high[1])],
                "ceiling_amsl_m": 9000.0,
            },
            "start": ends[0],
            "destination": ends[1],
            "wind": {"speed_mps": wind[0], "from_deg": wind[1], "turbulence": turbulence},
        }
        scenario = from_spec(spec | tables, "made", external=True)
        legs = len(way) - 1
        over = np.zeros(len(way), dtype=bool)
        over[list(fly_over)] = True
        items = np.arange(len(way))
        route = Route(way, np.full(legs, speeds, dtype=np.float64), np.zeros(len(way)), over, items, "")
        cruise = float(route.airspeed[0])
        mission = Mission(None, (), source="made")
        limits = make_limits(scenario, envelope, cruise, math.radians(bank_deg))
        return FlightSetup(scenario, mission, "", route, limits, aircraft.name, 888.0, seed)

    return make
