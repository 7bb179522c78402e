"""The zones that a flight is judged by: those of its scenario, then those of its mission's own fence."""

from dataclasses import dataclass, replace

from flight.mission.fence_zones import fence_zones
from flight.simulation.flight_setup import FlightSetup
from logs.verdict.places import Place
from world.airspace.zone_kernels import ZoneRecords, zone_records
from world.airspace.zones import Zone
from world.errors import MissionError


@dataclass(frozen=True, slots=True)
class Airspace:
    """Zones in the order in which findings number them.

    zones: the scenario's, then the fence's.
    records: the same, for compiled code.
    of_scenario: how many are the scenario's.
    fault: why the mission's fence makes no zones; "" where it does, or where there is none.
    """

    zones: tuple[Zone, ...]
    records: ZoneRecords
    fault: str = ""
    of_scenario: int = 0

    def place(self, index: int) -> Place:
        """A zone as the place of a finding."""
        zone = self.zones[index]
        return Place(zone.kind, index, name=zone.name)


def airspace_of(setup: FlightSetup) -> Airspace:
    """The zones that a setup's flight is to keep out of or to stay in.

    A fence that makes no zones, which a log of before fences were judged may hold, is left out and named.

    >>> from logs.recording.example_log import example_log
    >>> airspace_of(example_log().setup).zones
    ()
    """
    fault, own = "", tuple[Zone, ...]()
    try:
        own = fence_zones(setup.mission.fences, setup.scenario.origin, "the mission")
    except MissionError as error:
        fault = str(error)
    zones = (*setup.scenario.zones, *own)
    return Airspace(zones, zone_records(zones), fault, len(setup.scenario.zones))


def with_fence_zones(setup: FlightSetup) -> FlightSetup:
    """The setup with its mission's fence among its scenario's zones, for whatever draws them.

    >>> from logs.recording.example_log import example_log
    >>> with_fence_zones(example_log().setup).scenario.zones
    ()
    """
    if not setup.mission.fences:
        return setup
    return setup.in_scenario(replace(setup.scenario, zones=airspace_of(setup).zones))
