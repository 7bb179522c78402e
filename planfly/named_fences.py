"""Read files of fences and zones, and add them to the fence of a mission and the zones of a scenario."""

from dataclasses import dataclass, replace
from pathlib import Path

from flight.mission.fences import fence_zones, number_items
from flight.mission.items import Mission, MissionItem
from flight.mission_files.formats import read_fence
from planfly.flight_options import FencePaths
from world.airspace.zone_files import FileZones, is_zone_file, read_zone_file
from world.frames import GeoOrigin
from world.scenario import Scenario, with_zones
from world.wording import count_text


@dataclass(frozen=True, slots=True)
class NamedFences:
    """Content of the named files of fences, zones and rally points.

    items: fence items.
    rally: rally points.
    zones: zones of each file, with the file's name.
    """

    items: tuple[MissionItem, ...] = ()
    zones: tuple[tuple[str, FileZones], ...] = ()
    rally: tuple[MissionItem, ...] = ()

    def add_to_mission(self, mission: Mission) -> Mission:
        """Add fence and rally points to a mission; warnings state that those of the mission still apply."""
        if not self.items and not self.rally:
            return mission
        warnings = mission.warnings
        if mission.fences and self.items:
            own_fence = f"the mission's own fence of {count_text(len(mission.fences), 'item')}"
            warnings = (*warnings, f"{own_fence} applies in addition to the named fence")
        if mission.rally and self.rally:
            own_count = count_text(len(mission.rally), "rally point")
            warnings = (*warnings, f"the mission's own {own_count} may be used in addition to the named ones")
        fences = number_items([*mission.fences, *self.items])
        rally = number_items([*mission.rally, *self.rally])
        return replace(mission, fences=fences, rally=rally, warnings=warnings)

    def add_to_scenario(self, scenario: Scenario) -> Scenario:
        """Return the scenario with the zones of all files added.  Raises ScenarioError for an invalid zone."""
        for source, file_zones in self.zones:
            scenario = with_zones(scenario, file_zones.zones, source, file_zones.notes)
        return scenario


def read_named_fences(files: FencePaths) -> NamedFences:
    """Read one or more files of fences, zones or rally points; the suffix of each file determines its format.

    Raises MissionError or ScenarioError for a file that cannot be read, for a file without a fence or a rally point,
    and for invalid shapes.

    >>> read_named_fences([])
    NamedFences(items=(), zones=(), rally=())
    """
    all_items: list[MissionItem] = []
    rally: list[MissionItem] = []
    zones = []
    for file in [files] if isinstance(files, str | Path) else files:
        path = Path(file)
        if is_zone_file(path):
            zones.append((str(file), read_zone_file(path, str(file))))
            continue
        contents = read_fence(path)
        rally += contents.rally
        # Check the shapes here, because the file they are from is known only here.
        for first in contents.fences[:1]:
            fence_zones(contents.fences, GeoOrigin(first.lat_deg, first.lon_deg), str(file))
        all_items += contents.fences
    return NamedFences(tuple(all_items), tuple(zones), tuple(rally))
