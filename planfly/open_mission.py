"""Opening whatever a person brings: a plan, or a mission file with or without a scenario."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from flight.mission.from_plan import plan_mission
from flight.mission.implied_scenario import implied_scenario
from flight.mission_files.formats import read_mission
from flight.simulation.flight_setup import FlightSetup
from planfly.airframe import Airframe, choose_seed, load_airframe
from planfly.pipeline import make_setup
from planner.plan import read_plan
from world.errors import MissionError
from world.scenario import Scenario, load_scenario


@dataclass(frozen=True, slots=True)
class OpenedMission:
    """A mission ready to be judged or flown; name is a stem for file names."""

    setup: FlightSetup
    airframe: Airframe
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
        scenario = implied_scenario(mission, terrain, vertical_legs=True)
    scenario = change(scenario)
    airframe = load_airframe(scenario)
    number = choose_seed(scenario, seed)
    return OpenedMission(make_setup(scenario, airframe, mission, number, vertical_legs=True), airframe, path.stem)


def _open_plan(
    path: Path, scenario_name: str | None, terrain: str | None, seed: int | None, change: Callable[[Scenario], Scenario]
) -> OpenedMission:
    made = read_plan(path, terrain=terrain)
    # The plan's waypoints are in the map of the scenario it was made for; another scenario judges its mission.
    own = change(made.scenario)
    airframe = load_airframe(own)
    mission = plan_mission(made, airframe.airspeed, airframe.max_bank, source=str(path))
    number = seed if seed is not None else made.seed
    if scenario_name is not None:
        other = change(load_scenario(scenario_name, terrain))
        airframe = load_airframe(other)
        return OpenedMission(make_setup(other, airframe, mission, number), airframe, path.stem)
    return OpenedMission(make_setup(own, airframe, mission, number, plan=made), airframe, own.name)
