"""A flight of a campaign, varied by its draw: the setup that is flown, and how it differs from what guidance knows."""

import math
from dataclasses import dataclass, replace
from typing import Literal, NamedTuple

import numpy as np

from aircraft.path_limits import Limits
from flight.ardupilot.tracking_error import tracking_error
from flight.dynamics.fdm import Variation
from flight.simulation.flight_setup import FlightSetup, make_limits
from planfly.airframe import Airframe
from planfly.campaigns.flights.campaign_base import CampaignBase
from planfly.campaigns.spread.draws import Draw
from planfly.pipeline import OffNominal, make_setup
from world.scenario import Scenario
from world.scenario_tables import WindTable
from world.terrain import Terrain
from world.wind import Wind

# In the order in which turbulence grows.
LEVELS: tuple[Literal["none", "light", "moderate"], ...] = ("none", "light", "moderate")
MOST_WIND, MOST_GRADIENT = 40.0, 0.05


class GivenWind(NamedTuple):
    """A mean wind that takes the place of a scenario's: speed in m/s, and where it comes from, degrees."""

    speed: float
    from_deg: float


@dataclass(frozen=True)
class VariedFlight:
    """A setup in its own wind, over its own terrain, and the rest of its draw."""

    setup: FlightSetup
    airframe: Airframe
    off_nominal: OffNominal


def vary(base: CampaignBase, draw: Draw, wind: GivenWind | None = None) -> VariedFlight:
    """The flight of a draw; wind: about which it varies, None for the scenario's.

    Scenario and limits are in the flight's wind, as `planfly fly --wind` has them; mass, drag, control power and the
    start's place are known to nobody who steers.
    """
    values = draw.values
    scenario = _in_wind(base.scenario, values, wind)
    if values["terrain_height"] and scenario.terrain is not None:
        scenario = replace(scenario, terrain=_raised(scenario.terrain, values["terrain_height"]))
    battery = base.airframe.battery * values["battery"]
    airframe = replace(base.airframe, limits=_limits(base.airframe, scenario), battery=battery)
    setup = make_setup(scenario, airframe, base.mission, draw.seed, plan=base.plan, placed=base.placed)
    variation = Variation(mass=values["mass"], drag=values["drag"], control=values["control_power"])
    offset = (values["start_east"], values["start_north"], values["start_up"])
    return VariedFlight(setup, airframe, OffNominal(variation, offset))


def _in_wind(scenario: Scenario, values: dict[str, float], mean: GivenWind | None) -> Scenario:
    """The scenario in the wind of a draw; gusts have the flight's seed, whatever the scenario states."""
    old = scenario.wind
    about = mean or GivenWind(old.speed, math.degrees(old.from_course))
    speed = min(MOST_WIND, max(0.0, about.speed + values["wind_speed"]))
    from_deg = (about.from_deg + values["wind_from"]) % 360.0
    gradient = min(MOST_GRADIENT, max(-MOST_GRADIENT, old.gradient + values["wind_gradient"]))
    level = LEVELS.index(old.turbulence) + round(values["turbulence"])
    turbulence = LEVELS[min(len(LEVELS) - 1, max(0, level))]
    table = WindTable(speed_mps=speed, from_deg=from_deg, gradient=gradient, turbulence=turbulence)
    wind = Wind(speed, math.radians(from_deg), gradient, turbulence, None, old.reference_amsl)
    return replace(scenario, spec=scenario.spec.model_copy(update={"wind": table}), wind=wind)


def _raised(terrain: Terrain, by: float) -> Terrain:
    return replace(terrain, heights=(terrain.heights + np.float32(by)).astype(np.float32))


def _limits(airframe: Airframe, scenario: Scenario) -> Limits:
    """The airframe's limits in another wind."""
    old = airframe.limits
    limits = make_limits(scenario, old.envelope, old.airspeed, math.radians(scenario.flight.max_bank_deg))
    if airframe.parameters is None:
        return replace(limits, tracking=old.tracking)
    table, turbulence = scenario.flight, scenario.wind.turbulence
    tracking = tracking_error(
        airframe.parameters, old.airspeed, table.steering.nav, fly_over=table.fly_over, turbulence=turbulence
    )
    return replace(limits, tracking=tracking)
