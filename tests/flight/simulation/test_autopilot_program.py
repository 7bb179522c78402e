"""Which real autopilot flew: data that a setup carries and that compares by value."""

from flight.simulation.autopilot_program import AutopilotProgram


def test_two_records_of_one_program_are_one() -> None:
    first = AutopilotProgram("ArduPlane V4.6.0", "ab" * 32, {"WP_RADIUS": 90.0}, {})
    assert first == AutopilotProgram("ArduPlane V4.6.0", "ab" * 32, {"WP_RADIUS": 90.0}, {}, ())
    assert first != AutopilotProgram("ArduPlane V4.6.0", "ab" * 32, {"WP_RADIUS": 60.0}, {})
