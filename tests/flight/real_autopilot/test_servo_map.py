"""Servos as an aircraft's folder has them: pulses to controls, and the parameters that make the outputs these."""

import math
from dataclasses import replace
from pathlib import Path

import pytest

from aircraft.catalog import aircraft_names, load_aircraft
from flight.dynamics.fdm import Fdm
from flight.dynamics.trim import straight
from flight.real_autopilot.servo_map import ServoOutput, load_servo_map
from world.errors import FlightError

AEROSONDE = load_aircraft("aerosonde")
GOOD = """
[aileron]
output = 1
pulse_us = [1100, 1500, 1900]
value_deg = [-20.0, 0.0, 20.0]
[elevator]
output = 2
pulse_us = [1000, 1400, 2000]
value_deg = [10.0, 0.0, -15.0]
[throttle]
output = 5
pulse_us = [1000, 2000]
value = [0.0, 1.0]
[rudder]
output = 32
pulse_us = [1100, 1900]
value_deg = [30.0, -30.0]
"""


def write(folder: Path, text: str) -> Path:
    (folder / "ardupilot.toml").write_text(text, encoding="utf-8")
    return folder


def test_pulses_move_the_controls_linearly_between_the_knots_and_no_further() -> None:
    output = ServoOutput(2, (1000.0, 1400.0, 2000.0), (0.2, 0.0, -0.3))
    pulses = (900, 1000, 1200, 1400, 1700, 2000, 2100)
    assert [output.value(pulse) for pulse in pulses] == pytest.approx([0.2, 0.2, 0.1, 0.0, -0.15, -0.3, -0.3])
    # No pulse leaves a servo at rest.
    assert output.value(0) == 0.0
    assert output.rest == 1400.0


def test_the_controls_come_from_their_outputs(tmp_path: Path) -> None:
    servos = load_servo_map(replace(AEROSONDE, folder=write(tmp_path, GOOD)))
    pulses = [0] * 32
    pulses[0], pulses[1], pulses[4], pulses[31] = 1900, 2000, 1250, 1900
    assert servos.commands(pulses) == pytest.approx((math.radians(-15), math.radians(20), math.radians(-30), 0.25))
    assert {name: value for name, value in servos.parameters().items() if name.startswith("SERVO2_")} == {
        "SERVO2_FUNCTION": 19.0, "SERVO2_MIN": 1000.0, "SERVO2_MAX": 2000.0, "SERVO2_TRIM": 1400.0
    }  # fmt: skip
    assert servos.parameters()["SERVO5_TRIM"] == 1000.0
    assert servos.parameters()["SERVO32_FUNCTION"] == 21.0


@pytest.mark.parametrize("name", aircraft_names())
def test_full_pulses_are_the_aircrafts_full_throws(name: str) -> None:
    aircraft = load_aircraft(name)
    servos = load_servo_map(aircraft)
    elevator, *full = servos.commands([1900, 1900, 2000, 1900])
    # More is: roll right, nose up, full throttle, nose right; a trailing edge down and a yaw to the left are positive.
    assert full == pytest.approx([aircraft.max_aileron, -aircraft.max_rudder, 1.0])
    middle, *rest = servos.commands([1500, 1500, 1000, 1500])
    assert rest == pytest.approx([0.0, 0.0, 0.0])
    # The elevator moves by as much about the place where level flight at cruise has it.
    level = straight(Fdm(aircraft), aircraft.airspeed, 500.0)
    assert level is not None
    assert middle == pytest.approx(level.elevator, abs=math.radians(0.1))
    assert elevator - middle == pytest.approx(-aircraft.max_elevator)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (("[rudder]", "[flaps]"), "tables aileron, elevator, flaps, throttle: elevator, aileron, rudder, throttle are"),
        (("output = 5", "output = 0"), "throttle.output = 0: allowed 1..32"),
        (("output = 5", "output = true"), "throttle.output = True: allowed 1..32"),
        (("[1000, 1400, 2000]", "[1000, 2000, 1400]"), "elevator.pulse_us = .*: increasing, and as many as value_deg"),
        (("[1000, 1400, 2000]", "[1000, 1400]"), "elevator.pulse_us = .*: increasing, and as many as value_deg"),
        (("[1000, 1400, 2000]", "[1000]"), "elevator.pulse_us = .*: two finite numbers or more"),
        (("value = [0.0, 1.0]", "value = [0.0, nan]"), "throttle.value = .*: two finite numbers or more"),
        (("value = [0.0", "value_deg = [0.0"), "throttle: keys output, pulse_us and value are expected"),
        (("[aileron]", "[aileron"), "ardupilot.toml: .*line"),
    ],
)
def test_a_bad_file_is_one_line(tmp_path: Path, change: tuple[str, str], said: str) -> None:
    folder = write(tmp_path, GOOD.replace(*change))
    with pytest.raises(FlightError, match=said):
        load_servo_map(replace(AEROSONDE, folder=folder))


def test_an_aircraft_without_the_file_says_what_it_is_for(tmp_path: Path) -> None:
    with pytest.raises(FlightError, match=r"ardupilot.toml: .*: a real autopilot needs to know which servo moves what"):
        load_servo_map(replace(AEROSONDE, folder=tmp_path))
