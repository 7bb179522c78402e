"""The speed rule: compare commanded airspeed with the envelope, and flown with commanded airspeed."""

import math
from typing import NamedTuple

import numpy as np

from flight.mission.items import Command
from logs.verdict.findings import (
    NOT_FLOWN,
    UNKNOWN_AIRCRAFT,
    Fact,
    Finding,
    Message,
    finding_reason,
    make_finding,
    message,
)
from logs.verdict.measures.route_requirements import RouteRequirements, slope_limit
from logs.verdict.measures.slopes import measure_ability, steady_rows
from logs.verdict.measures.track_alignment import AlignedTrack
from logs.verdict.places import FLIGHT
from logs.verdict.rule import LogNeeds, Rule
from logs.verdict.suggestions import suggest_level_flight_speed
from logs.verdict.tolerances import (
    GUST_DURATION_S,
    GUST_SIGMAS,
    GUST_SPEED_FRACTION,
    HELD_SPEED_FRACTION,
    LEVEL_SLOPE_RAD,
    MAX_STEADY_ACCELERATION_MPS2,
    MEAN_SPEED_TOLERANCE_MPS,
    MEASURED_FRACTION,
    MIN_CONTROLLED_AIRSPEED_MPS,
    MIN_GROUND_SPEED_MPS,
    PLAN_TOLERANCE_RAD,
    SATURATED_TIME_S,
    SLOPE_CHANGE_LAG_M,
)
from logs.verdict.wording import compared_texts
from world.arrays import Floats
from world.wind import W20


def speed_findings(
    requirements: RouteRequirements, aligned: AlignedTrack | None, *, geometric: bool = False
) -> list[Finding]:
    """Compare each leg's commanded airspeed with the envelope, and the flown airspeed with the command.

    geometric: True to judge the planned path only; findings on the autopilot's parameters then come first.
    """
    # The property `demanded_route` computes the route at each access: read it once, not for each leg.
    demanded_speeds = requirements.setup.demanded_route.leg_airspeeds
    findings = [
        _speed_finding(requirements, aligned, leg, float(demanded_speeds[leg]), geometric=geometric)
        for leg in range(requirements.legs)
    ]
    parameters = requirements.setup.autopilot.parameters
    parameter_findings = []
    if parameters is not None and parameters.contradictions and requirements.setup.imported_log is None:
        more_text = f", and {len(parameters.contradictions) - 1} more" if len(parameters.contradictions) > 1 else ""
        fault = message(
            f"{parameters.contradictions[0]}{more_text}", "; only a simulated flight shows which airspeed is held"
        )
        parameter_findings = [
            make_finding("speed", FLIGHT, ok=None, reason=fault.text, faults=[fault], check=NOT_FLOWN)
        ]
    return [*parameter_findings, *findings] if geometric else findings


def _speed_finding(
    requirements: RouteRequirements, aligned: AlignedTrack | None, leg: int, demanded: float, *, geometric: bool
) -> Finding:
    """Judge the airspeed that is commanded on a leg, and the flown airspeed.

    demanded: airspeed as the mission states it, m/s: true airspeed, or equivalent airspeed for some autopilots.
    """
    commanded = float(requirements.route.leg_airspeeds[leg])
    min_speed, max_speed, faults = _level_speed_range(requirements, leg, commanded)
    notes = _command_notes(requirements, leg, demanded, min_speed, max_speed)
    margin = min(commanded - min_speed, max_speed - commanded)
    at_least = commanded - min_speed <= max_speed - commanded
    limit = min_speed if at_least else max_speed
    mean_speed, tolerance, facts, source, check = math.nan, 0.0, [], "aircraft", ""
    is_unflown = not geometric and (aligned is None or not aligned.has_flown(leg))
    if is_unflown:
        notes.append("the leg was not flown")
    elif aligned is not None:
        measurement = _measure_airspeed(requirements, aligned, leg)
        if measurement is None:
            # The one-second mean nearest to the command; on a leg shorter than one second, the mean over the leg.
            means = _one_second_means(aligned, aligned.leg_rows(leg))
            mean_speed = float(means[np.argmin(np.abs(means - commanded))])
            notes.append(f"{mean_speed:.1f} m/s reached; the leg is too short to hold it")
        else:
            mean_speed, tolerance, min_mean = measurement
            error = mean_speed - commanded
            notes.append(f"flown {mean_speed:.2f} m/s on average, {min_mean:.1f} m/s at the slowest second")
            is_off = abs(error) > MEAN_SPEED_TOLERANCE_MPS + tolerance
            if is_off and not _is_caused_by_vertical_wind(requirements, aligned, leg, error):
                text = (
                    f"flown {mean_speed:.1f} m/s on average, {abs(error):.1f} m/s off the commanded {commanded:.1f} m/s"
                )
                notes += [text] if requirements.envelope else []
                faults += [] if requirements.envelope else [message(text)]
            if not faults and (held_speed := _find_held_speed(requirements, aligned, leg, commanded)):
                # The finding then compares the flown speed with the command, not the command with the envelope.
                mean_speed, allowed_error, source = held_speed.speed, held_speed.allowed_error, "mission"
                limit = commanded + math.copysign(allowed_error, mean_speed - commanded)
                at_least = mean_speed < commanded
                margin, tolerance = allowed_error - abs(mean_speed - commanded), held_speed.tolerance
                faults.append(message(f"{mean_speed:.1f} m/s held instead of the commanded {commanded:.1f} m/s"))
        facts.append(Fact("speed error", mean_speed - commanded, "m/s"))
    envelope = requirements.setup.envelope
    if envelope.fastest_sd:
        # The maximum airspeed is uncertain: the command should stay below it by a margin.
        altitudes, certain_envelope = requirements.points[leg : leg + 2, 2].tolist(), envelope.with_margin()
        if commanded > min(certain_envelope.level_speeds(altitude)[1] for altitude in altitudes):
            limit_text = f"the maximum level speed according to {envelope.source} is {max_speed:.1f} m/s TAS"
            notes.insert(0, f"{commanded:.1f} m/s TAS is commanded; {limit_text} ± {envelope.fastest_sd:.1f} m/s")
            check = "" if faults else UNKNOWN_AIRCRAFT
    ok = None if check else not faults
    return make_finding(
        "speed",
        requirements.leg_place(leg),
        ok=None if ok and is_unflown else ok,
        reason=finding_reason(faults, notes),
        faults=faults,
        planned=commanded,
        flown=mean_speed,
        limit=limit,
        at_least=at_least,
        source=source,
        tolerance=tolerance,
        margin=margin,
        unit="m/s",
        method="commanded airspeed in the envelope",
        check=check,
        facts=facts,
    )


class _HeldSpeed(NamedTuple):
    """Airspeed that was held instead of the commanded airspeed.

    speed: mean airspeed, m/s.
    allowed_error: tolerated difference from the command, m/s.
    tolerance: further difference that gusts may cause, m/s.
    """

    speed: float
    allowed_error: float
    tolerance: float


def _find_held_speed(
    requirements: RouteRequirements, aligned: AlignedTrack, leg: int, commanded: float
) -> _HeldSpeed | None:
    """Return the airspeed held on a leg if it differs too much from the command, otherwise None.

    The airspeed is the mean over the second half of the leg's steady rows, because the aircraft may still change its
    speed in the first half.  Return None also in these cases:
    - The leg was flown steadily for too short a time.
    - The leg is too steep, which the slope rule reports.
    - The flight was imported, so that its airspeed sensor may be wrong.
    - The airspeed was raised to keep a minimum ground speed, or vertical wind caused the difference.
    """
    if abs(float(requirements.slopes[leg])) > slope_limit(requirements, leg)[0] + PLAN_TOLERANCE_RAD:
        return None
    rows = steady_rows(requirements, aligned, leg)
    time = aligned.track.time[rows]
    if (
        requirements.setup.imported_log is not None
        or time.size < 2
        or 0.5 * float(time[-1] - time[0]) < SATURATED_TIME_S
    ):
        return None
    middle_row = rows.start + int(np.searchsorted(time, 0.5 * float(time[0] + time[-1])))
    speed = float(aligned.track.airspeed[middle_row : rows.stop].astype(np.float64).mean())
    error = speed - commanded
    allowed_error = max(MEAN_SPEED_TOLERANCE_MPS, HELD_SPEED_FRACTION * commanded)
    tolerance = _gust_spread(requirements, float(aligned.track.time[rows.stop - 1] - aligned.track.time[middle_row]))
    if abs(error) <= allowed_error + tolerance or _is_caused_by_vertical_wind(requirements, aligned, leg, error):
        return None
    if error > 0.0 and float(requirements.ground_speed[leg]) < MIN_GROUND_SPEED_MPS:
        return None
    if error > 0.0 and requirements.setup.min_ground_speeds[leg + 1] > 0.0:
        # The airspeed is raised for a minimum ground speed.
        return None
    return _HeldSpeed(speed, allowed_error, tolerance)


def _command_notes(
    requirements: RouteRequirements, leg: int, demanded: float, min_speed: float, max_speed: float
) -> list[str]:
    """Describe the airspeed that the mission commands on a leg.

    Also state what keeps the aircraft from flying it.

    demanded: airspeed as the mission states it, m/s: true airspeed, or equivalent airspeed for some autopilots.
    min_speed, max_speed: range of airspeeds in level flight, m/s.
    """
    setup, autopilot = requirements.setup, requirements.setup.autopilot
    # The airspeed as it is set, and as true airspeed.
    setting, commanded = float(setup.route.leg_airspeeds[leg]), float(requirements.route.leg_airspeeds[leg])
    limits, notes = autopilot.speeds.limits, []
    if limits is not None and not limits.min <= setting <= limits.max:
        # The autopilot does not accept the airspeed, which an item, the scenario or an option, or a parameter sets.
        commands = [
            item.seq
            for item in setup.mission.items
            if item.command == Command.DO_CHANGE_SPEED
            and item.params[:2] == (0.0, setting)
            and item.seq < int(setup.route.items[leg + 1])
        ]
        parameter = autopilot.speeds.cruise_parameter
        if commands:
            source = f"item {commands[-1]} commands"
        elif setting != setup.airspeed:
            source = "the mission commands"
        elif setup.scenario.flight.airspeed_mps is not None:
            source = "the scenario or --airspeed sets"
        elif autopilot.stated_value(parameter) is not None:
            source = f"{parameter} is"
        else:
            source = "the aircraft's cruise speed is"
        range_text = f"{limits.min_name} {limits.min:g} to {limits.max_name} {limits.max:g} m/s"
        accepted = float(autopilot.speeds.flown_airspeeds(setup.route.leg_airspeeds, setup.airspeed)[leg])
        flown = min(limits.max, max(limits.min, accepted))
        notes.append(f"{source} {setting:g} m/s; {autopilot.title} accepts {range_text}, and flies {flown:g} m/s")
    kind_text = "TAS" if demanded == commanded else f"EAS ({commanded:.1f} m/s TAS)"
    if math.isfinite(min_speed) and math.isfinite(max_speed):
        level_text = f"; level flight is possible from {min_speed:.1f} to {max_speed:.1f} m/s TAS"
    else:
        level_text = ", but no level flight is known"
    notes.append(f"{demanded:.1f} m/s {kind_text} is commanded{level_text}")
    # The leg may be too short to reach the airspeed with an acceleration of `MAX_STEADY_ACCELERATION_MPS2`.
    previous_speed = float(requirements.route.leg_airspeeds[leg - 1]) if leg else commanded
    change, leg_length = commanded - previous_speed, float(requirements.runs[leg])
    duration = abs(change) / MAX_STEADY_ACCELERATION_MPS2
    # Distance at the mean of both speeds over ground, in the wind along the leg.
    start_ground_speed = float(requirements.ground_speed[leg]) - change
    needed_length = duration * (start_ground_speed + 0.5 * change)
    if needed_length > leg_length and start_ground_speed > 0.0:
        # Speed after the leg's length at constant acceleration: v² = start_ground_speed² + 2 acceleration leg_length.
        acceleration = math.copysign(MAX_STEADY_ACCELERATION_MPS2, change)
        squared_end_speed = start_ground_speed * start_ground_speed + 2.0 * acceleration * leg_length
        end_speed = math.sqrt(max(0.0, squared_end_speed)) - start_ground_speed + previous_speed
        notes.append(
            f"the change from {previous_speed:.1f} to {commanded:.1f} m/s takes about {duration:.0f} s and"
            f" {needed_length:.0f} m, but the leg has {leg_length:.0f} m, so about {end_speed:.1f} m/s are reached"
        )
    return notes


def _one_second_means(aligned: AlignedTrack, rows: slice) -> Floats:
    """Return the moving one-second means of the airspeed, m/s, (n,); a single mean for less than a second."""
    speed = aligned.track.airspeed[rows].astype(np.float64)
    width = max(1, min(speed.size, round(1.0 / aligned.tick)))
    sums = np.concatenate([[0.0], np.cumsum(speed)])
    return np.asarray((sums[width:] - sums[:-width]) / width)


def _is_caused_by_vertical_wind(requirements: RouteRequirements, aligned: AlignedTrack, leg: int, error: float) -> bool:
    """Return True if a speed error (m/s) was caused by vertical air motion, not by a lack of performance.

    This is assumed if the aircraft was too slow in a climb or too fast in a descent, although the flight shows that it
    can fly the leg's slope.
    """
    if error * requirements.slopes[leg] >= 0.0:
        return False
    ability = measure_ability(requirements, aligned, leg)
    return ability is not None and ability.exceeds(float(requirements.slopes[leg]))


def _level_speed_range(
    requirements: RouteRequirements, leg: int, commanded: float
) -> tuple[float, float, list[Message]]:
    """Return minimum and maximum airspeed of level flight on a leg, m/s, and the command's faults.

    Both airspeeds are NaN if level flight is impossible at one end of the leg.

    commanded: commanded true airspeed, m/s.
    """
    altitudes = (float(requirements.points[leg, 2]), float(requirements.points[leg + 1, 2]))
    speeds = [requirements.setup.envelope.level_speeds(altitude) for altitude in altitudes]
    # If level flight is impossible at one altitude, NaN remains for the whole leg.
    min_speed = float(np.max([lower for lower, _ in speeds]))
    max_speed = float(np.min([upper for _, upper in speeds]))
    faults = []
    if math.isnan(requirements.ground_speed[leg]):
        number = requirements.leg_place(leg).number
        faults.append(message(f"the wind is too strong to hold the course of leg {number} at {commanded:.0f} m/s"))
    max_altitude = max(altitudes)
    if math.isnan(min_speed) or math.isnan(max_speed):
        faults.append(message(f"the aircraft cannot fly level at {max_altitude:.0f} m AMSL"))
    if commanded < min_speed:
        speed_text, limit_text = compared_texts(commanded, min_speed, "m/s", 1)
        slow_text = f"{speed_text} TAS is below the minimum level speed, {limit_text} TAS at {max_altitude:.0f} m AMSL"
        faults.append(message(slow_text))
    if commanded > max_speed:
        speed_text, limit_text = compared_texts(commanded, max_speed, "m/s", 1)
        fast_text = f"{speed_text} TAS is above the maximum level speed, {limit_text} TAS at {max_altitude:.0f} m AMSL"
        faults.append(message(fast_text))
    return min_speed, max_speed, faults


def _measure_airspeed(
    requirements: RouteRequirements, aligned: AlignedTrack, leg: int
) -> tuple[float, float, float] | None:
    """Return a leg's mean airspeed, the mean's tolerance, and the minimum one-second mean, m/s.

    The tolerance allows for gusts and for a change of slope at the start of the leg.  Return None if the leg was flown
    steadily for too short a time.
    """
    rows = steady_rows(requirements, aligned, leg)
    time = aligned.track.time[rows]
    if time.size < 2 or time[-1] - time[0] < min(
        SATURATED_TIME_S, MEASURED_FRACTION * float(requirements.runs[leg]) / MIN_CONTROLLED_AIRSPEED_MPS
    ):
        return None
    speed = aligned.track.airspeed[rows].astype(np.float64)
    duration = float(time[-1] - time[0])
    min_mean = float(_one_second_means(aligned, rows).min())
    spread = _gust_spread(requirements, duration)
    is_steepened = leg > 0 and abs(float(requirements.slopes[leg] - requirements.slopes[leg - 1])) > LEVEL_SLOPE_RAD
    return float(speed.mean()), spread + (SLOPE_CHANGE_LAG_M / duration if is_steepened else 0.0), min_mean


def _gust_spread(requirements: RouteRequirements, duration: float) -> float:
    """Return the error that gusts may cause in a mean airspeed over a duration (s), m/s."""
    gust = GUST_SPEED_FRACTION * W20[requirements.setup.scenario.wind.turbulence]
    return GUST_SIGMAS * gust * math.sqrt(min(1.0, 2.0 * GUST_DURATION_S / max(duration, 1e-3)))


RULE = Rule(
    name="speed",
    tolerances=(
        *(
            "MAX_STEADY_ACCELERATION_MPS2",
            "GUST_SPEED_FRACTION",
            "GUST_SIGMAS",
            "GUST_DURATION_S",
            "HELD_SPEED_FRACTION",
            "MIN_GROUND_SPEED_MPS",
            "LEVEL_SLOPE_RAD",
        ),
        *(
            "MEASURED_FRACTION",
            "MEAN_SPEED_TOLERANCE_MPS",
            "PLAN_TOLERANCE_RAD",
            "SATURATED_TIME_S",
            "MIN_CONTROLLED_AIRSPEED_MPS",
            "SLOPE_CHANGE_LAG_M",
            "UNDECIDED_FRACTION",
        ),
    ),
    judge=speed_findings,
    suggest=suggest_level_flight_speed,
    log=LogNeeds(("airspeed",), needs_aircraft=True, needs_full_leg=True),
)
