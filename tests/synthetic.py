"""Flights with known answers: a setup of given waypoints, and a track that flies it by kinematics alone.

The track follows straight legs joined by fly-by arcs of a given radius and by parabola-like slope blends, at
constant airspeed in a steady wind.  Bumps in cross-track, height, speed, throttle and bank are put on top, so that a
rule's number is known before it is measured.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import fields, replace
from typing import Any

import numpy as np

from aircraft.envelope import GRAVITY, Envelope
from flight.simulation.setup import FlightSetup
from flight.simulation.track import Track
from tests.setups import route_along, setup_along, spec_around
from world.arrays import Floats
from world.geometry import leg_courses, leg_runs, signed_turns
from world.scenario import Scenario, scenario_from_spec
from world.terrain import Terrain

Profile = Callable[[Floats], Any]

CALM_CLIMB, CALM_DESCENT = 13.7, 7.8  # degrees at 25 m/s


def envelope(climb_deg: float = CALM_CLIMB, descent_deg: float = CALM_DESCENT) -> Envelope:
    """An Aerosonde-like table: slower is steeper, no change with height."""
    speeds = np.array([15.0, 20.0, 25.0, 30.0, 35.0])
    climb = np.radians(climb_deg + np.array([3.0, 2.0, 0.0, -8.0, -20.0]))
    descent = np.radians(descent_deg + np.array([-2.0, -1.0, 0.0, 3.0, 6.0]))
    heights = np.array([0.0, 1000.0, 4000.0])
    return Envelope(
        aircraft="aerosonde",
        model_hash="synthetic",
        motor_braking=False,
        airspeed=speeds,
        amsl=heights,
        climb=np.tile(climb[:, None], (1, 3)),
        descent=np.tile(descent[:, None], (1, 3)),
        level_speed_min=np.full(3, 16.0),
        level_speed_max=np.full(3, 32.0),
        max_bank=math.radians(45.0),
    )


def make_scenario(
    waypoints: Any,
    *,
    ground: Terrain | None = None,
    terrain: dict[str, Any] | None = None,
    threats: Sequence[dict[str, Any]] = (),
    limits: dict[str, Any] | None = None,
    wind: dict[str, Any] | None = None,
    area_margin: float = 1500.0,
    battery_wh: float | None = None,
) -> Scenario:
    """A scenario around some waypoints: flat ground at sea level unless ``terrain`` or ``ground`` says otherwise."""
    spec = spec_around(
        waypoints,
        name="synthetic",
        buffer=area_margin,
        ceiling=5000.0,
        origin={"lat_deg": 46.0, "lon_deg": 8.0},
        terrain=terrain or {"kind": "flat", "amsl_m": 0.0},
        threats=list(threats),
        limits=limits or {},
        flight={} if battery_wh is None else {"battery_wh": battery_wh},
        wind=wind or {},
    )
    return scenario_from_spec(spec, "synthetic", ground=ground)


def make_setup(
    waypoints: Any,
    *,
    airspeed: float = 25.0,
    speeds: Sequence[float] | None = None,
    bank_deg: float = 30.0,
    fly_over: Sequence[int] = (),
    table: Envelope | None = None,
    scenario: Scenario | None = None,
    **world: Any,
) -> FlightSetup:
    """A setup that flies these waypoints (w, 3); further arguments as of `make_scenario`."""
    started = "trimmed at the first waypoint, on course to the second"
    route = route_along(waypoints, airspeed if speeds is None else speeds, fly_over=fly_over, started=started)
    scenario = scenario or make_scenario(waypoints, **world)
    return setup_along(scenario, route, table or envelope(), airspeed=airspeed, bank_deg=bank_deg)


def bank_radius(speed: float = 25.0, bank_deg: float = 30.0) -> float:
    """Radius of a level turn, m, from speed (m/s) and bank."""
    return speed**2 / (GRAVITY * math.tan(math.radians(bank_deg)))


def bump(at: float, height: float, width: float) -> Profile:
    """A bell of this height about a distance along the path (m)."""
    return lambda s: height * np.exp(-0.5 * ((s - at) / width) ** 2)


def fly_path(
    setup: FlightSetup,
    *,
    radius: float | Sequence[float] | None = None,
    rate: float = 60.0,
    across: Profile | None = None,
    up: Profile | None = None,
    airspeed: Profile | None = None,
    throttle: Profile | None = None,
    stop: float | None = None,
    power: float = 300.0,
    blend: float = 30.0,
) -> Track:
    """A track along the setup's waypoints.

    radius: of the arcs, m, one or one per inner waypoint; default: the bank limit's at the setup's airspeed.  across,
    up, airspeed, throttle: what is added to the right, upwards, to the airspeed and the throttle (0.6), by distance
    along the path.  stop: distance at which the track ends.  power: W.  blend: m beyond each arc on which slopes
    change.
    """
    path, stations, arcs = _horizontal(setup, radius)
    heights, slopes = _heights(setup, stations, arcs, blend, path[:, 0])
    s, course = path[:, 0], path[:, 3]
    side = np.zeros_like(s) if across is None else across(s)
    right = np.stack([np.cos(course), -np.sin(course)], axis=1)
    place = path[:, 1:3] + side[:, None] * right
    heights = heights if up is None else heights + up(s)
    speed = np.full_like(s, setup.airspeed) + (0.0 if airspeed is None else airspeed(s))
    if setup.route.leg_airspeeds.min() != setup.route.leg_airspeeds.max():
        leg = np.clip(np.searchsorted(stations, s, side="right") - 1, 0, setup.route.legs - 1)
        speed = setup.route.leg_airspeeds[leg] + (0.0 if airspeed is None else airspeed(s))
    wind = setup.scenario.wind.velocities_at(np.asarray(heights, dtype=np.float64))
    ground = _ground_speed(speed * np.cos(slopes), course, wind)
    moved = np.hypot(*np.diff(place, axis=0).T)
    time = np.concatenate([[0.0], np.cumsum(moved / (0.5 * (ground[1:] + ground[:-1])))])
    if stop is not None:
        time = time[s <= stop]
    ticks = np.arange(0.0, time[-1] + 0.5 / rate, 1.0 / rate)
    ticks[-1] = min(ticks[-1], time[-1])

    def at(column: Floats) -> Floats:
        return np.interp(ticks, time, column[: time.size])

    # Curvature over about half a second, as a roll that takes its time.
    turning = np.gradient(np.unwrap(course), s) * ground
    bank = np.arctan(np.convolve(np.pad(turning, 20, mode="edge"), np.ones(41) / 41, "valid") * ground / GRAVITY)
    position = np.stack([at(place[:, 0]), at(place[:, 1]), at(heights)], axis=1)
    track = _level_track(ticks, position, 0.6 + (0.0 if throttle is None else at(throttle(s))), power)
    return replace(
        track,
        attitude=np.stack([at(bank), at(slopes), at(np.unwrap(course))], axis=1),
        airspeed=at(speed),
        wind=np.stack([at(wind[:, 0]), at(wind[:, 1]), np.zeros(ticks.size)], axis=1),
        speed_command=np.full(ticks.size, setup.airspeed, dtype=np.float32),
    )


def _ground_speed(airspeed: Floats, course: Floats, wind: Floats) -> Floats:
    """Speed over the ground, m/s, of a course held against the wind (n, 2); airspeed: its horizontal part."""
    tail = wind[:, 0] * np.sin(course) + wind[:, 1] * np.cos(course)
    cross = wind[:, 0] * np.cos(course) - wind[:, 1] * np.sin(course)
    return np.asarray(np.sqrt(airspeed**2 - cross**2) + tail)


def _level_track(ticks: Floats, position: Floats, throttle: Floats | float, power: float) -> Track:
    """A track through these positions (t, 3), far above the ground, in level attitude; power: W, at 44.4 V."""
    count = ticks.size
    controls = np.zeros((count, 4))
    controls[:, 3] = np.clip(throttle, 0.0, 1.0)
    return Track(
        time=ticks,
        position=position,
        velocity=np.gradient(position, ticks, axis=0),  # type: ignore[arg-type]  # Track gives each array its own type
        attitude=np.zeros((count, 3)),
        rates=np.zeros((count, 3), dtype=np.float32),
        airspeed=np.zeros(count, dtype=np.float32),
        flow=np.zeros((count, 2), dtype=np.float32),
        controls=controls,  # type: ignore[arg-type]  # Track gives each array its own type
        commands=controls,  # type: ignore[arg-type]  # Track gives each array its own type
        wind=np.zeros((count, 3)),
        load_factor=np.ones(count, dtype=np.float32),
        current=np.full(count, power / 44.4, dtype=np.float32),
        energy=ticks * power / 3600.0,  # type: ignore[arg-type]  # Track gives each array its own type
        leg=np.zeros(count, dtype=np.int32),
        cross_track=np.zeros(count, dtype=np.float32),
        height_error=np.zeros(count, dtype=np.float32),
        speed_command=np.zeros(count, dtype=np.float32),
        clearance=np.full(count, 1000.0, dtype=np.float32),
    )


def edited(track: Track, **columns: Any) -> Track:
    """The same track with some columns replaced."""
    return replace(track, **columns)


def copied(track: Track) -> dict[str, Any]:
    """Writable copies of a track's columns, by name."""
    return {item.name: getattr(track, item.name).copy() for item in fields(track)}


def waypoint_stations(setup: FlightSetup, radius: float | Sequence[float] | None = None) -> Floats:
    """Distance along the fly-by path at which each waypoint is passed, (w,) m."""
    return _horizontal(setup, radius)[1]


def _horizontal(
    setup: FlightSetup, radius: float | Sequence[float] | None
) -> tuple[Floats, Floats, list[tuple[float, float]]]:
    """Rows of distance, east, north, course every 0.25 m; each waypoint's distance; each arc's start and end."""
    points = setup.route.positions
    courses, runs, turns = leg_courses(points), leg_runs(points), signed_turns(points)
    inner = len(points) - 2
    if radius is None:
        radius = bank_radius(setup.airspeed, math.degrees(setup.max_bank))
    radii = np.broadcast_to(np.asarray(radius, dtype=np.float64), (inner,))
    tangents = np.concatenate([[0.0], radii * np.tan(np.abs(turns) / 2), [0.0]])
    rows: list[Floats] = []
    arcs, stations = [], [0.0]
    s, course = 0.0, float(courses[0])
    place = points[0, :2].copy()

    def draw(length: float, bend: float) -> None:
        nonlocal s, course, place
        steps = np.linspace(0.0, length, max(2, int(length / 0.25) + 1))
        angle = course + bend * steps
        if bend:
            east = place[0] + (np.cos(course) - np.cos(angle)) / bend
            north = place[1] + (np.sin(angle) - np.sin(course)) / bend
        else:
            east, north = place[0] + steps * np.sin(course), place[1] + steps * np.cos(course)
        rows.append(np.stack([s + steps, east, north, angle], axis=1)[:-1])
        s, course, place = s + length, float(angle[-1]), np.array([east[-1], north[-1]])

    for leg in range(len(runs)):
        straight = runs[leg] - tangents[leg] - tangents[leg + 1]
        if straight > 1e-6:
            draw(float(straight), 0.0)
        if leg < inner:
            length = float(radii[leg] * abs(turns[leg]))
            arcs.append((s, s + length))
            stations.append(s + length / 2)
            if length > 1e-9:
                draw(length, math.copysign(1.0 / radii[leg], turns[leg]))
    stations.append(s)
    rows.append(np.array([[s, *place, course]]))
    return np.concatenate(rows), np.array(stations), arcs


def _heights(
    setup: FlightSetup, stations: Floats, arcs: list[tuple[float, float]], blend: float, s: Floats
) -> tuple[Floats, Floats]:
    """Height and slope angle at distances s: the legs' own lines, joined across each arc by a cubic."""
    points = setup.route.positions
    runs = leg_runs(points)
    rise = np.diff(points[:, 2]) / runs
    up, slope = np.empty_like(s), np.empty_like(s)
    begin = 0.0  # distance along the path at which the leg's line is at its own start
    starts = []
    for leg in range(len(runs)):
        tangent_in = 0.0
        if leg:
            first, last = arcs[leg - 1]
            turn = abs(float(signed_turns(points)[leg - 1]))
            tangent_in = (last - first) / turn * math.tan(turn / 2) if turn > 1e-9 else 0.0
            begin = last - tangent_in
        starts.append(begin)
        on = (s >= stations[leg] - 1e-9) & (s <= stations[leg + 1] + 1e-9)
        up[on] = points[leg, 2] + rise[leg] * (s[on] - begin)
        slope[on] = rise[leg]
    for k, (first, last) in enumerate(arcs):
        a, b = max(first - blend, stations[k] + 1.0), min(last + blend, stations[k + 2] - 1.0)
        on = (s > a) & (s < b)
        x = (s[on] - a) / (b - a)
        up_a = points[k, 2] + rise[k] * (a - starts[k])
        up_b = points[k + 1, 2] + rise[k + 1] * (b - starts[k + 1])
        m_a, m_b = rise[k] * (b - a), rise[k + 1] * (b - a)
        up[on] = (
            (2 * x**3 - 3 * x**2 + 1) * up_a
            + (x**3 - 2 * x**2 + x) * m_a
            + (3 * x**2 - 2 * x**3) * up_b
            + (x**3 - x**2) * m_b
        )
        slope[on] = (
            (6 * x**2 - 6 * x) * up_a
            + (3 * x**2 - 4 * x + 1) * m_a
            + (6 * x - 6 * x**2) * up_b
            + (3 * x**2 - 2 * x) * m_b
        ) / (b - a)
    return up, np.arctan(slope)
