"""Simulate a go-around with a point mass, up to the return to the landing approach.

A simulation takes a few milliseconds.

The simulation follows `AP_Landing::type_slope_verify_abort_landing`, `restart_landing_sequence` (libraries/AP_Landing)
and `Plane::takeoff_calc_pitch`, `takeoff_calc_throttle` (ArduPlane/takeoff.cpp) in ArduPlane 4.6. The aircraft climbs
with level wings at the pitch of the last take-off and with open throttle, until it is above the go-around altitude.
This altitude is relative to *home*: at an airfield above home, the climb may end at once. Then it joins the nearest
landing sequence: it takes the shorter turn to the first stop of the sequence, on a straight slope from its altitude,
and then flies the other stops.

The point mass and the control law are the same as in `flight.autopilots.arduplane.rtl_point_mass`.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from flight.autopilots.arduplane.parameters import ArduPilotParameters
from flight.autopilots.arduplane.rtl_point_mass import (
    CLIMB,
    fill_stage,
    fly_stages,
    rtl_timeout,
    truncate_at_first_loiter,
    waypoint_ahead,
)
from flight.autopilots.point_mass import PointMass
from flight.autopilots.simulated_returns import RETURN_RESULT, RETURN_START, ReturnEnvironment
from flight.guidance.lateral_reference_laws import WAYPOINT
from flight.mission.return_path import LandingStart, nearest_landing_sequence
from world.arrays import Floats
from world.kernels import Record, Records


@dataclass(frozen=True, slots=True)
class GoArounds:
    """Simulated go-arounds.

    results: outcomes, (n,) of dtype `flight.autopilots.simulated_returns.RETURN_RESULT`.
    tracks: n arrays (t, 3) of positions at intervals of 1 s, m.
    landings: the landing sequence that each go-around joins, n in all.
    """

    results: Records
    tracks: tuple[Floats, ...]
    landings: tuple[LandingStart, ...]


def count_climb_rows(positions: Floats, end_altitude: float) -> int:
    """Return the number of positions up to the end of a go-around's climb; all if the climb never ends.

    positions: positions of the go-around, m, (t, 3).
    end_altitude: altitude above which the climb ends, m AMSL.

    >>> count_climb_rows(np.array([[0.0, 0.0, 10.0], [0.0, 20.0, 14.0], [0.0, 40.0, 18.0]]), 13.0)
    1
    """
    is_above = positions[:, 2] > end_altitude
    return int(np.argmax(is_above)) if is_above.any() else len(positions)


def make_abort_start(
    position: Sequence[float],
    course: float,
    slope: float,
    airspeed: float,
    wind: tuple[float, float] = (0.0, 0.0),
    time: float = 0.0,
) -> Records:
    """Return the start of a go-around at a position on a landing glide: one `RETURN_START` record, (1,).

    position: east, north, up, m.
    course: course of the glide over the ground, rad.
    slope: slope of the glide, m per m.
    airspeed: true airspeed, m/s.
    wind: m/s, east and north.
    time: time after take-off, s.
    """
    start: Records = np.zeros(1, RETURN_START)
    wind_east, wind_north = wind
    sin, cos = math.sin(course), math.cos(course)
    cross_wind = wind_east * cos - wind_north * sin
    speed = max(
        1.0, math.sqrt(max(1.0, airspeed * airspeed - cross_wind * cross_wind)) + wind_east * sin + wind_north * cos
    )
    start["east"], start["north"], start["up"] = position
    start["time"] = time
    start["velocity_east"], start["velocity_north"], start["velocity_up"] = speed * sin, speed * cos, -speed * slope
    return start


def fly_go_arounds(
    starts: Records,
    end_altitude: float,
    pitch: float,
    landings: Sequence[LandingStart],
    parameters: ArduPilotParameters,
    aircraft: PointMass,
    environment: ReturnEnvironment,
) -> GoArounds:
    """Simulate n go-arounds, each from a start on a landing glide to the end of a landing sequence.

    starts: (n,) of `flight.autopilots.simulated_returns.RETURN_START`.
    end_altitude: altitude above which the climb ends, m AMSL.
    pitch: pitch angle during the climb, rad.
    landings: one or more landing sequences; each go-around joins the sequence that is nearest at the end of its climb.
        In a sequence with a loiter, the go-around ends there after one circle.

    >>> from aircraft.catalog import load_aircraft
    >>> from flight.autopilots.arduplane.parameters import ArduPilotParameters
    >>> from flight.autopilots.point_mass import make_point_mass
    >>> from flight.autopilots.simulated_returns import make_return_environment
    >>> from flight.dynamics.envelope_tables import load_envelope
    >>> from world.scenario import load_scenario
    >>> from world.wind import Wind
    >>> aerosonde = load_aircraft("aerosonde")
    >>> aircraft = make_point_mass(aerosonde, load_envelope(aerosonde), 25.0, Wind())
    >>> start = make_abort_start((0.0, 0.0, 800.0), 0.0, 0.06, 20.0)
    >>> landings = [LandingStart(3, (800.0, -400.0, 860.0), (800.0, -400.0, 860.0))]
    >>> world, parameters = make_return_environment(load_scenario("jacksboro")), ArduPilotParameters.load(aerosonde)
    >>> (track,) = fly_go_arounds(start, 840.0, 0.17, landings, parameters, aircraft, world).tracks
    >>> k = count_climb_rows(track, 840.0)
    >>> bool(abs(track[k, 0]) < 1.0), bool(abs(track[-1, 0] - 800.0) < 100.0), bool(track[:, 2].min() > 797.0)
    (True, True, True)
    """
    results = np.zeros(len(starts), RETURN_RESULT)
    record, (climb, climb_parameters) = parameters.record(), _make_climb(parameters, end_altitude, pitch)

    def fly(k: int, landing: LandingStart) -> Floats:
        """Simulate go-around `k` to a landing sequence, fill its result, and return its positions, (t, 3) m."""
        # The sequence is flown up to its first loiter.
        stops = truncate_at_first_loiter((landing, *landing.next_stops))
        stages: Records = np.concatenate([waypoint_ahead(starts[k]), np.zeros(len(stops), WAYPOINT)])
        for stage, stop in zip(stages[1:], stops, strict=True):
            fill_stage(stage, stop, parameters)
        stages["airspeed"], stages["min_ground_speed"] = aircraft.record.airspeed, parameters.ground_speed_min
        timeout = rtl_timeout(starts[k], stages[1:], aircraft) + max(0.0, end_altitude - float(starts[k]["up"]))
        track = np.zeros((int(timeout) + 2, 3))
        fly_stages(
            starts[k],
            stages,
            record,
            climb_parameters,
            climb,
            *aircraft.tables,
            environment.heights,
            environment.to_pixel,
            environment.spheres,
            environment.radii,
            environment.known,
            timeout,
            -math.inf,
            -math.inf,
            False,
            track,
            results[k],
        )
        return track[: int(results[k]["position_count"])].copy()

    flights = []
    for k in range(len(starts)):
        track, landing = fly(k, landings[0]), landings[0]
        # The climb does not depend on the sequence.
        climb_end = track[min(count_climb_rows(track, end_altitude), len(track) - 1)]
        nearest_sequence = nearest_landing_sequence(tuple(climb_end.tolist()), landings)
        if nearest_sequence is not None and nearest_sequence != landing:
            track, landing = fly(k, nearest_sequence), nearest_sequence
        flights.append((track, landing))
    return GoArounds(results, tuple(track for track, _ in flights), tuple(landing for _, landing in flights))


def _make_climb(parameters: ArduPilotParameters, end_altitude: float, pitch: float) -> tuple[Record, Record]:
    """Return the `CLIMB` record of a go-around, and the control parameters of its climb.

    Both pitch limits of the climb are ``pitch`` (rad), and TECS_SPDWEIGHT is 2, so that pitch controls the airspeed.

    parameters: ArduPlane's parameters, which state the throttle of the climb and the rate at which it increases.
    end_altitude: altitude above which the climb ends, m AMSL.
    """
    climb: Record = np.zeros(1, CLIMB)[0]
    climb.is_required, climb.top, climb.slew = True, end_altitude, parameters.throttle_slew or math.inf
    climb.throttle = parameters.takeoff_throttle or parameters.throttle_max
    climb_parameters = parameters.record()
    climb_parameters.tecs_speed_weight = 2.0
    climb_parameters.tecs_pitch_min = 0.0
    climb_parameters.pitch_limit_min = climb_parameters.pitch_limit_max = pitch
    return climb, climb_parameters
