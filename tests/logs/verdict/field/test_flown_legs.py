from flight.simulation.field_source import MissionStretch
from logs.recording.example_log import example_log
from logs.verdict.field.flown_legs import flown_legs, part_of_route
from logs.verdict.tolerances import PARTLY_FLOWN

LOG = example_log()
# The turn is passed at 20 s, the end at 36.5 s.
TURN = 20.0


def legs(start: float, end: float) -> tuple[int, int, bool] | None:
    found = flown_legs(LOG.setup, LOG.track, MissionStretch(start, end, "AUTO", "log"))
    return None if found is None else (found.first, found.last, found.partial)


def test_the_whole_route() -> None:
    assert legs(0.0, 36.5) == (0, 2, False)


def test_a_stretch_that_goes_on_has_flown_a_part_of_the_next_leg() -> None:
    assert legs(0.0, TURN + PARTLY_FLOWN - 0.2) == (0, 1, False)
    assert legs(0.0, TURN + PARTLY_FLOWN + 0.2) == (0, 2, True)


def test_what_was_flown_to_the_first_waypoint_is_no_leg() -> None:
    assert legs(10.0, 36.5) == (1, 2, False)


def test_a_stretch_between_waypoints_has_no_leg() -> None:
    assert legs(5.0, 12.0) is None
    assert legs(5.0, 5.05) is None


def test_a_part_of_a_route_keeps_what_belongs_to_its_waypoints() -> None:
    route = LOG.setup.route
    part = part_of_route(route, 1, 2)
    assert part.waypoints.tolist() == route.waypoints[1:].tolist()
    assert (part.legs, part.items.tolist()) == (1, route.items[1:].tolist())
    assert part_of_route(route, 0, 2) is route
