"""A small flight that never happened: a setup with every field in use, and tracks to record."""

import math
from pathlib import Path

import numpy as np

from aircraft.envelope import Envelope
from flight.mission.items import Home, Mission, MissionItem
from flight.mission.itinerary import NO_ITEM
from flight.mission.route import Route, route_points
from flight.simulation.setup import FlightSetup, make_limits
from flight.simulation.track import Track
from logs.recording.recorder import Recorder
from logs.verdict.findings import Finding
from logs.verdict.places import Place
from logs.verdict.verdict import Verdict
from planner.plan import Certificate, Plan
from world.scenario import scenario_from_spec

WAYPOINTS = np.array([[-900.0, -900.0, 420.0], [0.0, -200.0, 430.0], [300.0, 700.0, 460.0], [900.0, 900.0, 440.0]])


def scenario_spec(**changes: object) -> dict[str, object]:
    spec: dict[str, object] = {
        "name": "synthetic",
        "terrain": {
            "kind": "peaks",
            "peak": [{"east_m": 100.0, "north_m": 200.0, "height_m": 333.3, "sigma_m": 700.0}],
        },
        "area": {"east_m": [-1500, 1500], "north_m": [-1500, 1500], "ceiling_amsl_m": 900.0},
        "start": {"east_m": -900.0, "north_m": -900.0, "amsl_m": 420.0, "course_deg": 52.1},
        "destination": {"east_m": 900.0, "north_m": 900.0, "amsl_m": 440.0},
        "threats": [
            {"name": "Alfa", "east_m": 50.0, "north_m": -200.0, "kill_radius_m": 400.0, "kill_scale_m": 100.0},
            {"east_m": 600.0, "north_m": 800.0, "detection_radius_m": 800.0, "detection_scale_m": 300.0},
        ],
        "limits": {"max_turn_deg": 45.0, "min_clearance_m": 60.0},
        "wind": {"speed_mps": 3.3, "from_deg": 211.0, "gradient": 0.001, "turbulence": "light", "seed": 5},
    }
    return spec | changes


def make_setup(*, with_plan: bool = True, **changes: object) -> FlightSetup:
    scenario = scenario_from_spec(scenario_spec(**changes), "test")
    items = tuple(
        MissionItem(k + 1, 16, 0, (0.0, 25.0, math.nan, math.nan), 46.0 + k / 300, 8.0 + k / 700, float(up), k != 2)
        for k, up in enumerate(WAYPOINTS[:, 2])
    )
    fence = MissionItem(0, 5004, 0, (123.4, 0.0, 0.0, 0.0), 46.001, 8.002, 0.0)
    rally = MissionItem(0, 5100, 3, (0.0, 0.0, 0.0, 0.0), 46.003, 8.004, 77.7)
    mission = Mission(Home(45.99, 7.99, 301.5), items, (fence,), (rally,), 25.5, ("line 3: CRLF",), "a.waypoints")
    route = Route(
        points=route_points(
            WAYPOINTS,
            [25.0, 26.1, 24.7],
            acceptance_radius=[0.0, 25.0, 30.3, 0.0],
            fly_over=[False, True, False, False],
            item=[NO_ITEM, 2, 3, 4],
        ),
        started="Started in the air at waypoint 0.",
        notes=("item 9 is not flown",),
    )
    envelope = Envelope(
        aircraft="aerosonde",
        model_hash="0123abcd",
        motor_braking=True,
        airspeed=np.array([18.0, 25.0, 33.3]),
        amsl=np.array([0.0, 1500.1]),
        climb=np.array([[0.21, math.nan], [0.24, 0.2], [-0.01, math.nan]]),
        descent=np.array([[0.1, 0.11], [0.1 / 3.0, 0.2], [0.3, math.nan]]),
        level_speed_min=np.array([16.1, 17.2]),
        level_speed_max=np.array([35.5, 1.0 / 3.0 + 34.0]),
        max_bank=0.7,
    )
    plan = Plan(
        scenario=scenario,
        waypoints=WAYPOINTS + 0.1,
        violations=np.array([0, 1, 0, 0]),
        objectives=np.array([1.1, 0.0, 2.0 / 3.0, 44.0]),
        certificate=Certificate(0.1, math.inf, 0.02, 12.3, 4.5, 67.8, ("leg 1: slope",)),
        seed=11,
        algorithm="umda",
        evaluations=1234,
        history=np.array([[1.5, 0.1, 3.0], [1.2, 0.0, 1.0]]),
    )
    return FlightSetup(
        scenario=scenario,
        mission=mission,
        route=route,
        limits=make_limits(scenario, envelope, 25.25, 0.5235987755982988),
        aircraft="aerosonde",
        battery=180.5,
        seed=7,
        plan=plan if with_plan else None,
    )


def make_track(seconds: float = 8.0, rate_hz: float = 60.0) -> Track:
    """Along the waypoints at 40 m/s or so, with numbers in every column that a float32 must round."""
    count = round(seconds * rate_hz)
    time = np.arange(count) / rate_hz
    leg_lengths = np.sqrt((np.diff(WAYPOINTS, axis=0) ** 2).sum(axis=1))
    marks = np.concatenate([[0.0], np.cumsum(leg_lengths)])
    along = marks[-1] * np.arange(count) / max(1, count - 1)
    position = np.stack([np.interp(along, marks, WAYPOINTS[:, k]) for k in range(3)], axis=1)
    rng = np.random.default_rng(4)

    def noise(columns: int) -> np.ndarray:
        return rng.normal(size=(count, columns)).astype(np.float32)

    attitude = 0.1 * noise(3)
    attitude[np.abs(along - marks[1]) < 20.0, 0] = 0.45
    commands = np.clip(0.5 + 0.1 * noise(4), 0.0, 0.99)
    commands[count // 4 : count * 3 // 4, 3] = 1.0
    return Track(
        time=time,
        position=position,
        velocity=25.0 + noise(3),
        attitude=attitude,
        rates=noise(3),
        airspeed=25.0 + noise(1)[:, 0],
        flow=noise(2),
        controls=noise(4),
        commands=commands,
        wind=noise(3),
        load_factor=1.0 + noise(1)[:, 0],
        current=noise(1)[:, 0],
        energy=np.linspace(0.0, 9.0, count).astype(np.float32),
        leg=np.minimum(np.searchsorted(marks[1:], along, side="right"), 2).astype(np.int32),
        cross_track=noise(1)[:, 0],
        height_error=noise(1)[:, 0],
        speed_command=noise(1)[:, 0],
        clearance=np.full(count, 999.0, dtype=np.float32),
    )


def make_verdict() -> Verdict:
    finding = Finding("turn", Place("waypoint", 1), 40.0, 41.0, 45.0, "scenario", 1.0, 4.0, "deg", "fit", True, "")
    return Verdict((finding,), flyable=True, complete=True, lines=("flyable",), level="flown")


def record(path: Path, setup: FlightSetup, track: Track, *, rows_a_block: int = 60, ended: str = "completed") -> Path:
    with Recorder(path, setup) as recorder:
        recorder.event(1.25, "half way up", "warning")
        for first in range(0, len(track), rows_a_block):
            recorder.write(track.rows(first, min(len(track), first + rows_a_block)))
        recorder.event(float(track.time[-1]), "arrived")
        recorder.finish(ended, make_verdict())
    return path
