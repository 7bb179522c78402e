"""Compute a flight log by formula, to test readers, figures and reports without a simulator or a file."""

from pathlib import Path

import numpy as np

from aircraft.envelope import Envelope
from flight.mission.items import Command, Mission, MissionItem
from flight.mission.route import Route, route_points
from flight.simulation.setup import FlightSetup, make_limits
from flight.simulation.track import COLUMNS, Track
from logs.recording.reader import FlightLog, LogEvent
from logs.recording.recorder import Recorder
from logs.recording.setup_attachments import package_versions
from world.arrays import Floats
from world.frames import to_geo
from world.scenario import scenario_from_spec

# Waypoints of two legs with a turn of 14 degrees between them: east, north and up, m.
_WAYPOINTS = np.array([[-500.0, 0.0, 200.0], [0.0, 0.0, 200.0], [400.0, 100.0, 220.0]])
# Airspeed, m/s.
_AIRSPEED = 25.0
# Rate of the rows, Hz.
_RATE_HZ = 10.0
_SCENARIO = {
    "name": "example",
    "terrain": {"kind": "flat", "amsl_m": 100.0},
    "area": {"east_m": [-600.0, 600.0], "north_m": [-400.0, 400.0], "ceiling_amsl_m": 500.0},
    "start": {"east_m": -500.0, "north_m": 0.0, "amsl_m": 200.0},
    "destination": {"east_m": 400.0, "north_m": 100.0, "amsl_m": 220.0},
    "threats": [{"name": "Alfa", "east_m": 0.0, "north_m": 250.0, "kill_radius_m": 300.0, "kill_scale_m": 100.0}],
}


def example_log() -> FlightLog:
    """Return a log of two legs over level ground in calm air, flown exactly along the legs at 25 m/s.

    The log has 10 rows per second.  The range of one missile covers part of the path.  The envelope is simplified, not
    computed from a model.

    >>> log = example_log()
    >>> log.setup.route.legs, len(log.track), log.end_time
    (2, 366, 36.5)
    >>> log.ended, log.complete
    ('completed', True)
    """
    scenario = scenario_from_spec(dict(_SCENARIO), "example")
    lat, lon = to_geo(scenario.origin, _WAYPOINTS[:, 0], _WAYPOINTS[:, 1])
    command, params = int(Command.NAV_WAYPOINT), (0.0, 0.0, 0.0, 0.0)
    items = tuple(
        MissionItem(k + 1, command, 0, params, float(lat[k]), float(lon[k]), float(up))
        for k, up in enumerate(_WAYPOINTS[:, 2])
    )
    mission = Mission(home=None, items=items, source="example")
    envelope = Envelope(
        aircraft="aerosonde",
        model_hash="",
        motor_braking=True,
        airspeed=np.array([18.0, 33.0]),
        amsl=np.array([0.0, 2000.0]),
        climb=np.full((2, 2), 0.2),
        descent=np.full((2, 2), 0.15),
        level_speed_min=np.full(2, 16.0),
        level_speed_max=np.full(2, 35.0),
        max_bank=0.7,
    )
    setup = FlightSetup(
        scenario=scenario,
        mission=mission,
        route=Route(
            points=route_points(_WAYPOINTS, _AIRSPEED, item=[item.seq for item in mission.items]),
            started="Started in the air at waypoint 0.",
        ),
        limits=make_limits(scenario, envelope, _AIRSPEED, 0.5),
        aircraft="aerosonde",
        battery=200.0,
        seed=1,
    )
    track = _track()
    end = float(track.time[-1])
    return FlightLog(
        source="example",
        setup=setup,
        track=track,
        events=(LogEvent(end, "flight ended: completed", "info"),),
        ended="completed",
        recorded_verdict=None,
        versions=package_versions(),
        complete=True,
        problem="",
        end_time=end,
    )


def write_example_log(path: Path) -> Path:
    """Record the flight of `example_log` in a file, and return the file's path.

    An existing file is replaced.  Raises OSError if the file cannot be written.

    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     write_example_log(Path(folder) / "example.mcap").read_bytes()[1:5]
    b'MCAP'
    """
    log = example_log()
    with Recorder(path, log.setup) as recorder:
        recorder.write(log.track)
        for event in log.events:
            recorder.event(event.time, event.text, event.level)
        recorder.finish("completed")
    return path


def _track() -> Track:
    """Return a track along the waypoints at constant speed, with wings level and heading along each leg."""
    leg_vectors = np.diff(_WAYPOINTS, axis=0)
    lengths = np.sqrt((leg_vectors**2).sum(axis=1))
    waypoint_distances = np.concatenate([[0.0], np.cumsum(lengths)])
    time = np.arange(int(waypoint_distances[-1] / _AIRSPEED * _RATE_HZ) + 1) / _RATE_HZ
    distance = _AIRSPEED * time
    leg = np.minimum(np.searchsorted(waypoint_distances[1:], distance, side="right"), len(leg_vectors) - 1)
    velocity = (_AIRSPEED * leg_vectors / lengths[:, None])[leg]
    values: dict[str, Floats] = {
        name: np.zeros((len(time), width)) if width > 1 else np.zeros(len(time)) for name, width in COLUMNS.items()
    }
    values |= {
        "time": time,
        "position": np.column_stack([np.interp(distance, waypoint_distances, axis) for axis in _WAYPOINTS.T]),
        "velocity": velocity,
        "attitude": np.column_stack([np.zeros(len(time)), np.zeros(len(time)), np.arctan2(*velocity[:, :2].T)]),
        "airspeed": np.full(len(time), _AIRSPEED),
        "controls": np.tile([0.0, 0.0, 0.0, 0.5], (len(time), 1)),
        "commands": np.tile([0.0, 0.0, 0.0, 0.5], (len(time), 1)),
        "load_factor": np.ones(len(time)),
        "current": np.full(len(time), 10.0),
        "energy": 0.1 * time,
        "speed_command": np.full(len(time), _AIRSPEED),
        "leg": leg,
    }
    return Track(**values)  # type: ignore[arg-type]  # Track converts each column to its type
