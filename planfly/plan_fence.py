"""Write a plan's threats, area and zones as a fence of its mission.

The planned path does not violate this fence.
"""

from flight.mission.fences import fence_zones, with_fences
from flight.mission.items import Mission, MissionItem
from flight.simulation.setup import FlightSetup
from logs.verdict.rules.fence_rule import make_zone_test


def add_plan_fence(setup: FlightSetup) -> tuple[Mission, tuple[str, ...]]:
    """Return a plan's mission with a fence, and notes on shapes that the fence omits.

    The fence is made from the threats, the area and the zones of the scenario.

    Shapes that the planned path violates according to the rule `fence` are omitted, and named in the notes.

    >>> from logs.recording.example_log import example_log
    >>> mission, notes = add_plan_fence(example_log().setup)
    >>> [item.command for item in mission.fences]  # the area; the example has no missiles
    [5001, 5001, 5001, 5001]
    """
    is_entered_zone = make_zone_test(setup)

    def is_entered_shape(shape: tuple[MissionItem, ...]) -> bool:
        """Return True if the planned path violates a zone of a fence shape."""
        return any(is_entered_zone(zone) for zone in fence_zones(shape, setup.scenario.origin))

    return with_fences(setup.mission, setup.scenario, is_entered_shape)
