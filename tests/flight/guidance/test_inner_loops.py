"""Guidance's memory begins as nothing flown, and each law that a scenario may name has a number of its own."""

import math
from dataclasses import replace
from typing import Any, get_args

import numpy as np
import pytest

from aircraft.catalog import load_aircraft
from aircraft.envelope import GRAVITY
from flight.autopilots.planfly.law import CROSS_TRACK, L1, LAWS, VECTOR_FIELD, follow_altitude_profile, steer_bank
from flight.dynamics.state import COMMANDS, STATE
from flight.guidance.gains import Gains, load_gains
from flight.guidance.inner_loops import GUIDANCE_MEMORY, step_roll_model
from flight.guidance.navigation_error import MOTION
from flight.guidance.path import NODE
from world.kernels import Record, field_names
from world.scenario_tables import FlightTable, Guidance


def test_every_law_of_a_scenario_has_its_number() -> None:
    assert set(LAWS) == set(get_args(Guidance))
    assert sorted(LAWS.values()) == sorted({CROSS_TRACK, L1, VECTOR_FIELD})
    assert (LAWS["l1"], LAWS["vector-field"]) == (L1, VECTOR_FIELD)


def test_a_fresh_memory_steers_by_the_default_law_from_the_paths_beginning() -> None:
    memory: Record = np.zeros(1, GUIDANCE_MEMORY)[0]
    assert memory.lateral_law == LAWS[FlightTable().steering.guidance]
    assert (memory.piece, memory.leg, memory.distance, bool(memory.is_finished)) == (0, 0, 0.0, False)


def test_counts_are_whole_and_an_end_is_a_truth() -> None:
    kinds = {name: GUIDANCE_MEMORY[name] for name in field_names(GUIDANCE_MEMORY)}
    whole = {name for name, kind in kinds.items() if kind == np.int64}
    assert whole == {"lateral_law", "piece", "leg", "l1_leg"}
    assert {name for name, kind in kinds.items() if kind == np.bool_} == {"is_finished", "is_in_rtl"}
    assert all(kind == np.float64 for name, kind in kinds.items() if name not in whole | {"is_finished", "is_in_rtl"})


# ----------------------------------------------------------------------
# The vertical channel and the inner loops: nothing to do in steady flight, and each error is worked against.

GAINS = load_gains(load_aircraft("aerosonde"))
DT = 1.0 / 60.0
TRIM = {"trim_elevator": -0.12, "trim_alpha": 0.05, "trim_throttle": 0.6}


def record(dtype: np.dtype[np.record], **values: float) -> Record:
    made: Record = np.zeros(1, dtype)[0]
    for name, value in values.items():
        made[name] = value
    return made


class Channel:
    """Guidance at 500 m on a level path to the north, at the airspeed of the gains."""

    def __init__(self, gains: Gains = GAINS, *, slope: float = 0.0) -> None:
        self.gains, self.speed = gains.record(), gains.reference_airspeed
        self.nodes: Any = np.array([(0.0, 500.0, slope, 0.0)], NODE)
        self.memory = record(GUIDANCE_MEMORY, last_airspeed=-1.0, speed_command=self.speed, **TRIM)
        self.commands = record(COMMANDS)

    def height(
        self, *, up: float = 500.0, climb: float = 0.0, airspeed: float | None = None, roll: float = 0.0
    ) -> Record:
        state = record(STATE, airspeed=self.speed if airspeed is None else airspeed, roll=roll)
        estimated = record(MOTION, up=up, velocity_north=self.speed, velocity_up=climb)
        follow_altitude_profile(state, estimated, self.nodes, self.gains, self.memory, self.commands, 0.0, DT)
        return self.commands

    def bank(self, wanted: float, **state: float) -> Record:
        flown = record(STATE, **({"airspeed": self.speed} | state))
        steer_bank(flown, self.gains, self.memory, self.commands, wanted, DT)
        return self.commands


def test_on_the_path_at_its_speed_the_trim_is_kept() -> None:
    commands = Channel().height()
    assert commands.elevator == pytest.approx(TRIM["trim_elevator"])
    assert commands.throttle == pytest.approx(TRIM["trim_throttle"])


@pytest.mark.parametrize(
    ("idle", "over", "after"),
    [
        # 0.6 - 0.02 x 1 is above 0.4 x 26/25, at which the integral stops: 0.164 below the trim.
        (0.4, 1.0, 0.436),
        # 0.6 - 0.02 x 2 is below 0.55 x 27/25 from the beginning.
        (0.55, 2.0, 0.6),
    ],
)
def test_the_throttle_does_not_wind_up_below_what_gives_thrust(idle: float, over: float, after: float) -> None:
    gains = replace(GAINS, reference_airspeed=25.0, speed_gain=0.02, speed_integral=0.01, throttle_idle=idle)
    channel = Channel(gains)
    for _ in range(60 * 60):
        channel.height(airspeed=25.0 + over)
    assert channel.height(airspeed=25.0).throttle == pytest.approx(after, abs=0.001)


@pytest.mark.parametrize("error", [-3.0, -0.1, 0.1, 3.0])
def test_above_the_path_the_nose_goes_down_and_below_it_up(error: float) -> None:
    channel = Channel()
    commands = channel.height(up=500.0 + error)
    # A trailing edge down, which is positive, takes the nose down.
    assert math.copysign(1.0, commands.elevator - TRIM["trim_elevator"]) == math.copysign(1.0, error)
    assert channel.memory.height_error == pytest.approx(error)


def test_a_climbing_path_wants_its_climb_rate_and_more_throttle() -> None:
    channel = Channel(slope=0.1)
    level = channel.height(climb=0.0).elevator
    climbing = channel.height(climb=0.1 * channel.speed).elevator
    # On the slope there is little to do; level there is much to pull.
    assert abs(climbing - TRIM["trim_elevator"]) < 0.3 * abs(level - TRIM["trim_elevator"])
    assert level < TRIM["trim_elevator"]
    wanted = TRIM["trim_throttle"] + GAINS.throttle_per_slope * 0.1
    assert Channel(slope=0.1).height(climb=0.1 * channel.speed).throttle == pytest.approx(min(1.0, wanted))


def test_too_slow_takes_throttle_too_fast_gives_it_back_within_0_and_1() -> None:
    speed = GAINS.reference_airspeed
    assert Channel().height(airspeed=speed - 0.5).throttle > TRIM["trim_throttle"]
    assert Channel().height(airspeed=speed + 0.5).throttle < TRIM["trim_throttle"]
    assert Channel().height(airspeed=speed - 15.0).throttle == 1.0
    assert Channel().height(airspeed=speed + 15.0).throttle == 0.0


SLOWEST = GAINS.reference_airspeed - GAINS.slow_margin


@pytest.mark.parametrize(
    ("throttle", "airspeed", "stall", "climbs"),
    [
        # At the slowest airspeed allowed, steady, an aircraft gains nothing with all its throttle...
        (1.0, SLOWEST, 0.0, 0.0),
        # ... and with a tenth of it left climbs by that: throttle_per_slope is throttle for a climb of one rad.
        (0.9, SLOWEST, 0.0, 0.1 / GAINS.throttle_per_slope * SLOWEST),
        # An airspeed that is too fast by 2 m/s or too slow by one is brought back in 3 s: v dv / (g t).
        (1.0, SLOWEST + 2.0, 0.0, 2.0 * (SLOWEST + 2.0) / (GRAVITY * 3.0)),
        (1.0, SLOWEST - 1.0, 0.0, -(SLOWEST - 1.0) / (GRAVITY * 3.0)),
        # 1.2 times the stall, at 400 m where true airspeeds are 1.019488 times equivalent ones, is slower than it is...
        (1.0, SLOWEST, 0.9 * SLOWEST / (1.2 * 1.019488), 0.0),
        # ... or faster, by 1 m/s: then that counts.
        (1.0, SLOWEST, (SLOWEST + 1.0) / (1.2 * 1.019488), -SLOWEST / (GRAVITY * 3.0)),
        # Never faster than what is flown: with nothing in hand it would sink all the way.
        (1.0, GAINS.reference_airspeed, GAINS.reference_airspeed, 0.0),
    ],
)
def test_far_below_the_path_it_climbs_by_what_it_gains(
    throttle: float, airspeed: float, stall: float, climbs: float
) -> None:
    held, free = Channel(), Channel(slope=climbs / GAINS.reference_airspeed)
    held.memory.stall_speed, held.commands.throttle = stall, throttle
    # The same pull as on a path of this climb, a little below it and far.
    assert held.height(up=400.0, airspeed=airspeed).elevator == pytest.approx(free.height(airspeed=airspeed).elevator)


@pytest.mark.parametrize(
    ("bank", "multiple"),
    [
        (0.0, 1.2),
        # 1.1 / sqrt(cos 30 degrees) = 1.182 is less than 1.2...
        (30.0, 1.2),
        # ... at 45 degrees it is 1.3081, to either side, at 60 degrees 1.5556...
        (45.0, 1.3081),
        (-45.0, 1.3081),
        (60.0, 1.5556),
        # ... and beyond a cosine of 0.4, or on its back, 1.1 / sqrt 0.4 = 1.7393.
        (75.0, 1.7393),
        (150.0, 1.7393),
    ],
)
def test_in_a_steep_turn_the_stall_is_kept_off_at_a_higher_airspeed(bank: float, multiple: float) -> None:
    """At 1 m/s below this multiple of the stall speed the aircraft must sink by v dv / (g t)."""
    held, free = Channel(), Channel(slope=-SLOWEST / (GRAVITY * 3.0) / GAINS.reference_airspeed)
    held.memory.stall_speed, held.commands.throttle = (SLOWEST + 1.0) / (multiple * 1.019488), 1.0
    flown = {"airspeed": SLOWEST, "roll": math.radians(bank)}
    assert held.height(up=400.0, **flown).elevator == pytest.approx(free.height(**flown).elevator, abs=1e-3)


def test_near_the_stall_a_gust_counts_at_once() -> None:
    """The airspeed without its gusts is still fast; of the gust alone height gives way."""

    def elevator(stall: float) -> float:
        channel = Channel()
        channel.memory.stall_speed = stall
        channel.memory.filtered_airspeed = channel.memory.last_airspeed = GAINS.reference_airspeed
        channel.commands.throttle = 1.0
        # As fast a tick ago: nothing is gained or lost.
        channel.memory.last_airspeed = 20.0
        return float(channel.height(up=480.0, airspeed=20.0).elevator)

    assert elevator(20.0 / 1.2) > elevator(10.0) + 0.01


def test_wings_level_in_still_air_there_is_nothing_to_do() -> None:
    commands = Channel().bank(0.0)
    assert (commands.aileron, commands.rudder) == (0.0, 0.0)


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_a_bank_is_rolled_into_and_a_roll_is_damped(side: float) -> None:
    # Positive aileron rolls right.
    assert side * Channel().bank(side * 0.4).aileron > 0.0
    assert side * Channel().bank(0.0, roll=side * 0.1).aileron < 0.0
    assert side * Channel().bank(0.0, beta=side * 0.1).rudder <= 0.0


def test_in_a_coordinated_turn_the_rudder_has_nothing_to_damp() -> None:
    gains = replace(GAINS, rudder_per_yaw_rate=0.0, sideslip_gain=0.0)
    turning = GRAVITY / gains.reference_airspeed * math.sin(0.4)
    assert Channel(gains).bank(0.4, roll=0.4, yaw_rate=turning).rudder == pytest.approx(0.0, abs=1e-15)
    assert Channel(gains).bank(0.4, roll=0.4).rudder == pytest.approx(-gains.yaw_rate_gain * turning)


@pytest.mark.parametrize("wanted", [-0.6, 0.02, 0.6])
def test_the_model_roll_arrives_within_its_limits_and_does_not_overshoot(wanted: float) -> None:
    gains, bank, rate = GAINS.record(), 0.0, 0.0
    rates, banks, changes = [], [], []
    for _ in range(600):
        bank, rate, change = step_roll_model(wanted, bank, rate, gains, DT)
        banks.append(bank)
        rates.append(abs(rate))
        changes.append(abs(change))
    assert banks[-1] == pytest.approx(wanted, abs=1e-6)
    assert max(math.copysign(1.0, wanted) * np.array(banks)) <= abs(wanted) * (1.0 + 1e-3)
    assert max(rates) <= GAINS.roll_rate_max * (1.0 + 1e-12)
    assert max(changes) <= GAINS.roll_acceleration_max * (1.0 + 1e-12)
    # The first tick's acceleration: of a critically damped oscillator at rest, or as much as is allowed.
    assert changes[0] == pytest.approx(min(GAINS.roll_frequency**2 * abs(wanted), GAINS.roll_acceleration_max))
