"""A plan's threats, area and zones as the fence of its mission: one that its judge finds kept."""

from flight.mission.fence_zones import fence_zones
from flight.mission.fences import with_fences
from flight.mission.items import Mission, MissionItem
from flight.simulation.flight_setup import FlightSetup
from logs.verdict.rules.fence_rule import zone_test


def fence_of_plan(setup: FlightSetup) -> tuple[Mission, tuple[str, ...]]:
    """The setup's mission with its scenario as a fence beside its own, and notes on what the fence cannot hold.

    Each shape is asked for as the verdict's rule `fence` asks, of the planned path with its arcs: what the rule would
    find violated is left out, and named in the notes.

    >>> from logs.recording.example_log import example_log
    >>> mission, notes = fence_of_plan(example_log().setup)
    >>> [item.command for item in mission.fences]  # the area; the example has no missiles
    [5001, 5001, 5001, 5001]
    """
    is_entered = zone_test(setup)

    def passes(shape: tuple[MissionItem, ...]) -> bool:
        return any(is_entered(zone) for zone in fence_zones(shape, setup.scenario.origin))

    return with_fences(setup.mission, setup.scenario, passes)
