"""One tick of ArduPlane: ten times a second it navigates and weighs energies, and at each tick follows its attitude.

Attitudes are followed through planfly's inner loops (`flight.guidance.inner_loops`), as late as ArduPlane's controllers
follow them, whose gains are tuned to the aircraft and are no part of the law.
"""

import math

from aircraft.envelope import GRAVITY
from flight.ardupilot.height_law import demand_height, weigh_energies
from flight.ardupilot.lateral_law import navigate_legs, roll_demand
from flight.guidance.inner_loops import follow_roll, steer_elevator
from flight.guidance.lateral import find_on_path
from flight.guidance.path_kernels import Records, profile
from world.kernels import Record, compiled

# ArduPlane navigates and updates its height and speed law so often, s (its scheduler's table: 10 Hz).
NAVIGATION_TICK = 0.1
# A bank follows its demand so much later than RLL2SRV_TCONST says, as a share of it; and a pitch angle.
ROLL_LAG = 0.84
PITCH_LAG = 1.1
# TECS's two integrals of the pitch balance each other, and no steady flight tells how large they are; what came before
# the first waypoint has left this in the one of speed, m^2/s^3 (12 to 39, 27 on average, in 18 flights of ArduPlane).
SPEED_SUM = 27.0
# The international standard atmosphere below 11 km: temperature falls by this share of sea level's a metre, and density
# with that power of the temperature.
_LAPSE, _DENSITY_POWER = 2.25577e-5, 4.25588
# Highest that the ratio is worked out for, m.
_HIGHEST = 11_000.0
_FASTEST_PITCH = math.radians(40.0)


@compiled
def true_by_equivalent(amsl: float) -> float:  # pragma: no cover - compiled
    """True airspeed by equivalent airspeed in the standard atmosphere at a height, m; 1.05 at 1,000 m."""
    ratio: float = (1.0 - _LAPSE * min(_HIGHEST, amsl)) ** (-0.5 * _DENSITY_POWER)
    return ratio


@compiled
def fly_as_ardupilot(
    state: Record,
    estimated: Record,
    pieces: Records,
    nodes: Records,
    waypoints: Records,
    gains: Record,
    memory: Record,
    parameters: Record,
    own: Record,
    commands: Record,
    dt: float,
) -> None:  # pragma: no cover - compiled
    """One tick of ``dt`` seconds: fill the commands, and the memories for the next one.

    parameters: a record of `flight.ardupilot.parameters.ARDUPILOT_PARAMETERS`.
    own: of `flight.ardupilot.law_memory.ARDUPILOT_MEMORY`.
    The others are as `flight.guidance.lateral.guide` takes them; the path is what the track is measured against, and no
    part of the law.
    """
    find_on_path(estimated, pieces, memory)
    memory.height_error = estimated.up - profile(nodes, memory.distance)[0]
    factor = true_by_equivalent(estimated.up)
    if not own.begun:
        _begin(state, estimated, waypoints, memory, parameters, own)
    own.clock -= dt
    if own.clock < 0.5 * dt:
        own.clock += NAVIGATION_TICK
        navigate_legs(estimated, waypoints, parameters, own, factor, NAVIGATION_TICK)
        demand_height(estimated, waypoints[own.leg + 1], parameters, own, NAVIGATION_TICK)
        wanted = min(parameters.airspeed_max, max(parameters.airspeed_min, waypoints[own.leg].airspeed))
        memory.speed_command = wanted * factor
        weigh_energies(state, estimated, parameters, own, wanted * factor, factor, NAVIGATION_TICK)
    _follow(state, estimated, gains, memory, parameters, own, factor, commands, dt)


@compiled
def _begin(
    state: Record, estimated: Record, waypoints: Records, memory: Record, parameters: Record, own: Record
) -> None:  # pragma: no cover - compiled
    """Take over in steady flight at the first waypoint."""
    own.begun = True
    own.from_east, own.from_north, own.from_up = waypoints[0].east, waypoints[0].north, waypoints[0].up
    own.height_asked = estimated.up
    own.height_limited = estimated.up
    own.height_demand = estimated.up
    own.climb_share, own.sink_share = 1.0, 1.0
    own.airspeed_read = state.airspeed
    own.airspeed = state.airspeed
    own.airspeed_demand = state.airspeed
    # As it has flown before: what level flight here takes is known.
    own.pitch_demand = state.alpha - parameters.pitch_trim
    own.speed_sum = SPEED_SUM
    own.balance_sum = own.pitch_demand * state.airspeed * GRAVITY - SPEED_SUM
    own.throttle_demand = memory.trim_throttle
    own.throttle_before = parameters.throttle_cruise
    own.throttle_sum = memory.trim_throttle - parameters.throttle_cruise


@compiled
def _follow(
    state: Record,
    estimated: Record,
    gains: Record,
    memory: Record,
    parameters: Record,
    own: Record,
    factor: float,
    commands: Record,
    dt: float,
) -> None:  # pragma: no cover - compiled
    """Roll and pitch to their demands, each with the lag of ArduPlane's controllers; throttle as it is demanded."""
    own.roll_demand = roll_demand(own.side_acceleration, state.pitch, state.airspeed / factor, parameters)
    before = memory.bank_rate
    rate = (own.roll_demand - memory.bank) / (ROLL_LAG * parameters.roll_time)
    rate = min(gains.roll_rate_max, max(-gains.roll_rate_max, rate))
    most = gains.roll_acceleration_max * dt
    rate = before + min(most, max(-most, rate - before))
    follow_roll(state, gains, memory, commands, memory.bank + rate * dt, rate, (rate - before) / dt, dt)
    pitch_rate = (own.pitch_demand + parameters.pitch_trim - state.pitch) / (PITCH_LAG * parameters.pitch_time)
    pitch_rate = min(_FASTEST_PITCH, max(-_FASTEST_PITCH, pitch_rate))
    steer_elevator(state, gains, memory, commands, estimated.velocity_up, state.airspeed * pitch_rate)
    commands.throttle = own.throttle_demand
