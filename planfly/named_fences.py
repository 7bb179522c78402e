"""Fences that a command names beside its mission or log: files of fence items, and of zones."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from flight.mission.fence_zones import fence_zones
from flight.mission.fences import numbered
from flight.mission.items import Mission, MissionItem
from flight.mission_files.formats import read_fence
from world.airspace.zone_files import SUFFIXES, read_zone_file
from world.airspace.zone_tables import ZoneTable
from world.frames import GeoOrigin
from world.scenario import Scenario
from world.scenario_variants import with_zones


@dataclass(frozen=True, slots=True)
class NamedFences:
    """What the files hold.

    items: of fences, which join the mission's own.
    zones: of GeoJSON and KML, by the file that each comes from; they join the scenario's.
    """

    items: tuple[MissionItem, ...] = ()
    zones: tuple[tuple[str, tuple[ZoneTable, ...]], ...] = ()

    def on_mission(self, mission: Mission) -> Mission:
        """A mission with the fence items beside its own."""
        if not self.items:
            return mission
        warnings = mission.warnings
        if mission.fences:
            warnings = (*warnings, f"its own fence of {len(mission.fences)} items counts beside the one named")
        return replace(mission, fences=numbered([*mission.fences, *self.items]), warnings=warnings)

    def on_scenario(self, scenario: Scenario) -> Scenario:
        """A scenario with the zones beside its own.  Raises ScenarioError as `with_zones` does."""
        for source, tables in self.zones:
            scenario = with_zones(scenario, tables, source)
        return scenario


def read_named_fences(files: Sequence[str]) -> NamedFences:
    """Read what the options ``--fence`` name, by the suffix of each.

    Raises MissionError or ScenarioError for a file that cannot be read, that holds no fence, or one whose shapes are
    none.

    >>> read_named_fences([])
    NamedFences(items=(), zones=())
    """
    items: list[MissionItem] = []
    zones = []
    for file in files:
        path = Path(file)
        if path.suffix.lower() in SUFFIXES:
            zones.append((file, tuple(read_zone_file(path, file))))
            continue
        found = read_fence(path)
        # Shapes are checked while it is known which file they are from.
        fence_zones(found, GeoOrigin(found[0].lat_deg, found[0].lon_deg), file)
        items += found
    return NamedFences(tuple(items), tuple(zones))
