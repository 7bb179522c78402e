"""Opening whatever a person brings: a plan, or a mission file with or without a scenario."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from flight.export import plan_mission
from flight.foreign import foreign_scenario
from flight.mission_files import read_mission
from flight.setup import FlightSetup
from planfly.pipeline import make_setup
from planfly.vehicle import Vehicle, choose_seed, load_vehicle
from planner.plan import read_plan
from world.errors import MissionError
from world.scenario import Scenario, load_scenario


@dataclass(frozen=True, slots=True)
class OpenedMission:
    """A mission ready to be judged or flown; name is a stem for file names."""

    setup: FlightSetup
    vehicle: Vehicle
    name: str


def open_mission(
    path: Path,
    scenario_name: str | None,
    terrain: str | None,
    *,
    seed: int | None = None,
    change: Callable[[Scenario], Scenario] = lambda scenario: scenario,
) -> OpenedMission:
    """Read a plan.json, .waypoints or .plan, in its own, a named or a made scenario.

    terrain: replaces the scenario's.  seed: of the turbulence; None takes the plan's, the scenario's, or 1.
    change: makes another scenario of it, in other wind or with another aircraft.  Raises MissionError, ScenarioError or
    TerrainError.
    """
    if not path.is_file():
        raise MissionError(f"{path}: no such file; a plan.json, .waypoints or .plan file is expected")
    if path.suffix.lower() == ".json":
        return _open_plan(path, scenario_name, terrain, seed, change)
    mission = read_mission(path)
    if scenario_name is not None:
        scenario = load_scenario(scenario_name, terrain)
    else:
        scenario = foreign_scenario(mission, terrain, on_the_spot=True)
    scenario = change(scenario)
    vehicle = load_vehicle(scenario)
    number = choose_seed(scenario, seed)
    return OpenedMission(make_setup(scenario, vehicle, mission, number, on_the_spot=True), vehicle, path.stem)


def _open_plan(
    path: Path, scenario_name: str | None, terrain: str | None, seed: int | None, change: Callable[[Scenario], Scenario]
) -> OpenedMission:
    made = read_plan(path, terrain=terrain)
    # The plan's waypoints are in the map of the scenario it was made for; another scenario judges its mission.
    own = change(made.scenario)
    vehicle = load_vehicle(own)
    mission = plan_mission(made, vehicle.airspeed, vehicle.max_bank, source=str(path))
    number = seed if seed is not None else made.seed
    if scenario_name is not None:
        other = change(load_scenario(scenario_name, terrain))
        vehicle = load_vehicle(other)
        return OpenedMission(make_setup(other, vehicle, mission, number), vehicle, path.stem)
    return OpenedMission(make_setup(own, vehicle, mission, number, plan=made), vehicle, own.name)
