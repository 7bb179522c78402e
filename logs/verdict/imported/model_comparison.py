"""Compare an imported flight with a simulated flight of the same mission: leg by leg, turn by turn."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields

import numpy as np

from flight.simulation.setup import FlightSetup, MissionStretch
from flight.simulation.track import ROLL, THROTTLE, Track
from logs.verdict.imported.flown_legs import FlownLegs
from logs.verdict.measures.route_requirements import RouteRequirements, route_requirements
from logs.verdict.measures.track_alignment import AlignedTrack, align_track, project_onto_leg
from logs.verdict.measures.turns import TurnMeasure, measure_turns
from world.arrays import Floats
from world.errors import LogError

# Spacing along a leg of the points at which the flights are compared, m.
COMPARISON_STEP_M = 10.0
# Seconds per hour.
SECONDS_PER_HOUR = 3600.0


@dataclass(frozen=True, slots=True, eq=False)
class Profile:
    """Measurements of a flight at n points along its route; NaN where the route was not flown.

    cross_track: distance to the right of the legs, m.
    height_error: height above the legs, m.
    ground_speed: m/s.
    bank: rad.
    energy: energy used since the first point, Wh.
    airspeed: m/s, true.
    throttle: 0..1.
    power: W from the battery; NaN for a log without current.
    """

    cross_track: Floats
    height_error: Floats
    ground_speed: Floats
    bank: Floats
    energy: Floats
    airspeed: Floats
    throttle: Floats
    power: Floats


@dataclass(frozen=True, slots=True)
class LegPair:
    """Comparison of one leg; each pair is the flown and the simulated value, NaN if unknown.

    leg: index in the whole route.
    cross_track, height_error: signed value with the largest absolute value, m.
    ground_speed: mean ground speed, m/s.
    bank: maximum absolute bank, deg.
    energy: energy used on the leg, Wh.
    """

    leg: int
    cross_track: tuple[float, float]
    height_error: tuple[float, float]
    ground_speed: tuple[float, float]
    bank: tuple[float, float]
    energy: tuple[float, float]


@dataclass(frozen=True, slots=True)
class TurnPair:
    """Comparison of one turn; each pair is the flown and the simulated value, NaN if unknown.

    waypoint: index in the whole route.
    turn: planned course change, deg.
    overshoot: maximum distance outside the next leg, m.
    bank: maximum absolute bank, deg.
    passed: minimum distance from the waypoint, m.
    """

    waypoint: int
    turn: float
    overshoot: tuple[float, float]
    bank: tuple[float, float]
    passed: tuple[float, float]


@dataclass(frozen=True, slots=True)
class Spread:
    """Absolute difference between two flights in one quantity, in ``unit``.

    median, percentile_95: median and 95th percentile of the difference over all compared points.
    """

    name: str
    unit: str
    median: float
    percentile_95: float


@dataclass(frozen=True, slots=True, eq=False)
class Reflight:
    """Imported flight and simulated flight side by side.

    stretch: part of the imported flight that is compared.
    setup: setup of the simulated flight.
    simulated: track of the simulated flight.
    ended: reason for the end of the simulated flight.
    distance: distances along the route's legs at which the flights are compared, m, (n,).
    ends: distance along the route at which each leg ends, m, (legs,).
    flown, model: profiles of the imported and the simulated flight.
    first: index of the first compared leg in the whole route.
    legs, turns, spreads: comparisons of the legs, of the turns, and of each quantity over all points.
    stands_in: True if the log's aircraft is unknown, and another aircraft's model flew.
    """

    stretch: MissionStretch
    setup: FlightSetup
    simulated: Track
    ended: str
    distance: Floats
    ends: Floats
    flown: Profile
    model: Profile
    first: int
    legs: tuple[LegPair, ...]
    turns: tuple[TurnPair, ...]
    spreads: tuple[Spread, ...]
    stands_in: bool


def compare_with_model(
    setup: FlightSetup, stretch_legs: FlownLegs, simulated: Track, end_reason: str, *, stands_in: bool = False
) -> Reflight:
    """Compare an imported flight with a simulated flight of the same route.

    setup: setup of the simulated flight.
    stretch_legs: legs that the imported flight flew.
    simulated: track of the simulated flight.
    end_reason: reason for the end of the simulated flight.
    stands_in: True if the log's aircraft is unknown, and another aircraft's model flew.

    Raises LogError if the simulated flight has too few rows.

    >>> from flight.simulation.setup import MissionStretch
    >>> from logs.recording.example_log import example_log
    >>> from logs.verdict.imported.flown_legs import flown_legs
    >>> log = example_log()
    >>> flown = flown_legs(log.setup, log.track, MissionStretch(0.0, 36.5, "AUTO", "log"))
    >>> again = compare_with_model(log.setup, flown, log.track, "completed")
    >>> [(one.name, one.percentile_95) for one in again.spreads]
    [('cross_track', 0.0), ('height_error', 0.0), ('ground_speed', 0.0), ('bank', 0.0)]
    """
    requirements = route_requirements(setup)
    aligned = align_track(requirements, simulated)
    if aligned is None:
        raise LogError(f"{setup.scenario.name}: the model's flight has too few rows", file=setup.scenario.name)
    pairs = (stretch_legs.requirements, stretch_legs.aligned), (requirements, aligned)
    ends = np.cumsum(requirements.runs)
    distances_on_legs = [np.arange(0.0, leg_length, COMPARISON_STEP_M) for leg_length in requirements.runs]
    profiles = [_flight_profile(flight_requirements, track, distances_on_legs) for flight_requirements, track in pairs]
    leg_starts = np.concatenate([[0.0], ends[:-1]])
    distance = np.concatenate(
        [leg_start + leg_distances for leg_start, leg_distances in zip(leg_starts, distances_on_legs, strict=True)]
    )
    counts = np.concatenate([[0], np.cumsum([len(leg_distances) for leg_distances in distances_on_legs])])
    legs = tuple(
        _leg_pair(stretch_legs.first + k, slice(int(counts[k]), int(counts[k + 1])), profiles)
        for k in range(requirements.legs)
    )
    measures = [measure_turns(flight_requirements, track, follows_arcs=False) for flight_requirements, track in pairs]
    turns = tuple(
        _turn_pair(stretch_legs.first + k, float(stretch_legs.requirements.turns[k]), *turn_measures)
        for k, turn_measures in enumerate(zip(*measures, strict=True), 1)
    )
    # The differences between both flights in each quantity, at the points where both flights have it.
    (flown_profile, model_profile), spreads = profiles, []
    for name, unit, factor in (
        ("cross_track", "m", 1.0),
        ("height_error", "m", 1.0),
        ("ground_speed", "m/s", 1.0),
        ("bank", "deg", 180.0 / math.pi),
    ):
        difference = factor * np.abs(getattr(flown_profile, name) - getattr(model_profile, name))
        known = difference[np.isfinite(difference)]
        if known.size:
            spreads.append(Spread(name, unit, float(np.median(known)), float(np.percentile(known, 95.0))))
    return Reflight(
        stretch=stretch_legs.stretch,
        setup=setup,
        simulated=simulated,
        ended=end_reason,
        distance=distance,
        ends=ends,
        flown=flown_profile,
        model=model_profile,
        first=stretch_legs.first,
        legs=legs,
        turns=turns,
        spreads=tuple(spreads),
        stands_in=stands_in,
    )


def _flight_profile(
    requirements: RouteRequirements, aligned: AlignedTrack, distances_on_legs: Sequence[Floats]
) -> Profile:
    """Measure a flight at points along its legs; a leg that was not flown has only NaN values.

    distances_on_legs: for each leg, the distances of its points from the leg's start, m.
    """
    parts: list[Floats] = []
    track = aligned.track
    speed = np.hypot(track.velocity[:, 0], track.velocity[:, 1]).astype(np.float64)
    bank, energy, airspeed, throttle = (
        values.astype(np.float64)
        for values in (track.attitude[:, ROLL], track.energy, track.airspeed, track.controls[:, THROTTLE])
    )
    power = SECONDS_PER_HOUR * np.gradient(energy, track.time) if len(energy) > 1 else np.full(len(energy), math.nan)
    for leg, leg_distances in enumerate(distances_on_legs):
        if not aligned.has_flown(leg):
            parts.append(np.full((len(fields(Profile)), len(leg_distances)), math.nan))
            continue
        rows = aligned.leg_rows(leg)
        distance_along, lateral_offset = project_onto_leg(requirements, leg, track.position[rows])
        # If the flight passes a point several times, as on a loiter, the first pass is taken.
        is_forward = np.concatenate([[True], distance_along[1:] > np.maximum.accumulate(distance_along)[:-1]])
        line_altitude = requirements.points[leg, 2] + distance_along * math.tan(requirements.slopes[leg])
        height_error = track.position[rows, 2] - line_altitude
        columns = (
            lateral_offset,
            height_error,
            *(column[rows] for column in (speed, bank, energy, airspeed, throttle, power)),
        )
        parts.append(
            np.array(
                [
                    np.interp(
                        leg_distances, distance_along[is_forward], column[is_forward], left=math.nan, right=math.nan
                    )
                    for column in columns
                ]
            )
        )
    values = np.concatenate(parts, axis=1)
    known_energy = values[4][np.isfinite(values[4])]
    values[4] -= known_energy[0] if known_energy.size else 0.0
    return Profile(*values)


def _leg_pair(leg: int, rows: slice, profiles: Sequence[Profile]) -> LegPair:
    """Compare one leg of the flown profile with the same leg of the simulated profile.

    leg: index of the leg in the whole route.
    rows: range of the profiles' points that lie on the leg.
    profiles: profiles of the flown and of the simulated flight.
    """

    def pair(name: str, reduce: Callable[[Floats], float]) -> tuple[float, float]:
        """Return one quantity of the flown and the simulated leg, each reduced to one number; NaN if unknown."""
        columns = [getattr(profile, name)[rows] for profile in profiles]
        flown_values, model_values = (column[np.isfinite(column)] for column in columns)
        return (
            float(reduce(flown_values)) if flown_values.size else math.nan,
            float(reduce(model_values)) if model_values.size else math.nan,
        )

    def farthest(values: Floats) -> float:
        """Return the value with the largest absolute value."""
        return float(values[np.argmax(np.abs(values))])

    flown_bank, model_bank = pair("bank", lambda values: np.abs(values).max())
    return LegPair(
        leg,
        cross_track=pair("cross_track", farthest),
        height_error=pair("height_error", farthest),
        ground_speed=pair("ground_speed", np.mean),
        bank=(math.degrees(flown_bank), math.degrees(model_bank)),
        energy=pair("energy", lambda values: values[-1] - values[0]),
    )


def _turn_pair(waypoint: int, planned_turn: float, flown: TurnMeasure, model: TurnMeasure) -> TurnPair:
    """Compare the flown and the simulated turn at a waypoint.

    waypoint: index of the waypoint in the whole route.
    planned_turn: planned course change, rad.
    flown, model: measures of the turn in the imported and in the simulated flight.
    """

    def value_pair(name: str, factor: float = 1.0) -> tuple[float, float]:
        """Return one quantity of the flown and the simulated turn, each times a factor; NaN if not measured."""
        values = (getattr(flown, name), getattr(model, name))
        flown_value, model_value = (math.nan if value is None else value * factor for value in values)
        return flown_value, model_value

    return TurnPair(
        waypoint,
        math.degrees(planned_turn),
        overshoot=value_pair("overshoot"),
        bank=value_pair("peak_bank", 180.0 / math.pi),
        passed=value_pair("min_distance"),
    )
