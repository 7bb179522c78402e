"""The loop reads each property once, ticks, sets each property once, and then steps, in this order."""

import hashlib
import math
import os
import pickle
import re
import subprocess
import sys
import tracemalloc
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from aircraft.catalog import Aircraft, load_aircraft
from flight.dynamics.fdm import Variation
from flight.guidance.gains import load_gains
from flight.mission.items import Mission
from flight.mission.return_path import ReturnCircle
from flight.simulation.setup import FlightSetup
from flight.simulation.simulate import (
    BANK_RESERVE_RAD,
    BLOCK_DURATION_S,
    TIME_LIMIT_BASE_S,
    TIME_LIMIT_FACTOR,
    Flight,
    RunningFlight,
    fly_to_end,
    make_loop,
)
from flight.simulation.tick import OUTPUT, READ_FIELDS, Workspace
from flight.simulation.track import COLUMNS, TRACK_ROW, Rows, Track, TrackBuilder
from tests.flight.simulation.hand_made import make_workspace
from tests.logs.verdict.rules.test_loiter_rule_own_radius import SPEED, loiter, radius_at
from tests.mission_lines import setup_of, wp
from tests.setups import MakeSetup, setup_maker, standard
from tests.soak import SOAK, some
from world.errors import FlightError
from world.kernels import field_names

# As long as its turns and slopes take to settle.
WAY = standard() if SOAK else standard(800.0)


OUTPUTS = field_names(OUTPUT)


class Recorded:
    """A JSBSim of lists: what was called, in order, and what was set."""

    def __init__(self, statuses: list[int], steps: int) -> None:
        self.space: Workspace = make_workspace()
        self.calls: list[str] = []
        self.set: list[tuple[str, float]] = []
        self.seen: list[list[float]] = []
        self.statuses = statuses
        self.round = 0
        self.fly = make_loop(
            [self._getter(k, name) for k, name in enumerate(READ_FIELDS)],
            [self._setter(name) for name in OUTPUTS],
            self._tick,
            self.space,
            lambda: self.calls.append("run"),
            steps,
        )

    def _getter(self, k: int, name: str) -> Callable[[], float]:
        def get() -> float:
            self.calls.append(f"get {name}")
            return 1000.0 * self.round + k

        return get

    def _setter(self, name: str) -> Callable[[float], object]:
        def put(value: float) -> None:
            self.calls.append(f"set {name}")
            self.set.append((name, value))

        return put

    def _tick(self) -> int:
        self.calls.append("tick")
        self.seen.append([self.space.record.state[name] for name in READ_FIELDS])
        self.space.output[:] = 10.0 * self.round + np.arange(len(OUTPUTS))
        self.round += 1
        return self.statuses.pop(0)


def test_a_round_reads_ticks_sets_and_runs() -> None:
    flown = Recorded([0, 0], steps=3)
    assert flown.fly(2) == 0
    a_round = [*(f"get {name}" for name in READ_FIELDS), "tick", *(f"set {name}" for name in OUTPUTS), *["run"] * 3]
    assert flown.calls == 2 * a_round


def test_each_reading_and_each_output_is_the_one_of_its_name() -> None:
    flown = Recorded([0, 0], steps=1)
    flown.fly(2)
    assert flown.seen == [list(range(22)), list(range(1000, 1022))]
    assert flown.set == [(name, 10.0 * turn + k) for turn in range(2) for k, name in enumerate(OUTPUTS)]


@pytest.mark.parametrize("status", [1, 5])
def test_the_end_of_a_flight_sets_and_steps_nothing_more(status: int) -> None:
    flown = Recorded([0, status, 0], steps=2)
    assert flown.fly(3) == status
    assert flown.calls.count("tick") == 2
    assert flown.calls[-1] == "tick"
    assert flown.calls.count("run") == 2
    assert len(flown.set) == len(OUTPUTS)


def test_no_rounds_do_nothing() -> None:
    flown = Recorded([], steps=2)
    assert flown.fly(0) == 0
    assert flown.calls == []


# ----------------------------------------------------------------------
# Whole flights in JSBSim: how closely they follow, how they end, and that they repeat bit for bit.

ROOT = Path(__file__).parents[3]
TICK = 1 / 60


def _within(track: Track, cross: tuple[float, float], height: tuple[float, float]) -> None:
    for name, values, (rms, most) in (("cross", track.cross_track, cross), ("height", track.height_error, height)):
        kept = values[track.time > 5.0]
        assert math.sqrt(float((kept.astype(np.float64) ** 2).mean())) <= rms, name
        assert float(np.abs(kept).max()) <= most, name


def _digest(track: Track) -> str:
    digest = hashlib.sha256()
    for name in COLUMNS:
        digest.update(getattr(track, name).tobytes())
    return digest.hexdigest()


def test_calm(make_setup: MakeSetup, aerosonde: Aircraft) -> None:
    flown = fly_to_end(Flight(make_setup(WAY), aerosonde))
    track = flown.track
    assert flown.ended == "completed"
    _within(track, (0.10, 0.6), (0.05, 0.3))
    assert np.diff(track.time) == pytest.approx(TICK, abs=1e-9)
    assert track.time[-1] == pytest.approx(flown.path.length / 25.0, rel=0.01)
    assert track.leg.tolist() == sorted(track.leg.tolist())
    assert set(track.leg.tolist()) == set(range(9))
    assert np.abs(track.airspeed - 25.0).max() < 1.25
    # Guidance may go beyond the planned bank by its reserve, and the roll loop over its command by next to nothing.
    assert math.degrees(np.abs(track.attitude[:, 0]).max()) < 30.0 + math.degrees(BANK_RESERVE_RAD) + 0.5
    assert track.position[-1] == pytest.approx(WAY[-1], abs=1.0)
    assert track.position[0] == pytest.approx(WAY[0], abs=1e-3)


def test_what_the_track_says_of_itself(make_setup: MakeSetup, aerosonde: Aircraft) -> None:
    # 60 km from the map's origin, where north is not the map's: velocity, attitude and wind stand in map axes.
    way = WAY[:4] + np.array([60_000.0, 20_000.0, 0.0])
    setup = make_setup(way, wind=(8.0, 60.0), origin={"lat_deg": 60.0, "lon_deg": 10.0})
    flown = fly_to_end(Flight(setup, aerosonde))
    track = flown.track
    assert flown.ended == "completed"
    _within(track, (0.10, 0.6), (0.10, 0.4))
    velocity = np.gradient(track.position, track.time, axis=0)[5:-5]
    assert velocity == pytest.approx(track.velocity[5:-5], abs=0.02)
    east, north = setup.scenario.wind.velocity_at(500.0)
    assert track.wind == pytest.approx(np.tile([east, north, 0.0], (len(track), 1)), abs=5e-4)
    # Ground velocity less wind is what the air sees: its size the airspeed, its direction the nose's but for sideslip.
    # Each axis is kept to 1 mm/s.
    air = track.velocity.astype(np.float64) - track.wind
    assert np.linalg.norm(air, axis=1) == pytest.approx(track.airspeed, abs=3e-3)
    heading = np.arctan2(air[:, 0], air[:, 1])
    level = np.abs(track.attitude[:, 0]) < 0.02
    assert np.abs(np.remainder(heading - track.attitude[:, 2] + math.pi, math.tau) - math.pi)[level].max() < 0.01
    assert track.clearance == pytest.approx(track.position[:, 2] - 100.0, abs=0.01)
    assert (np.diff(track.energy) > 0.0).all()
    # Watt hours from volts and amperes.
    assert float(track.energy[-1]) == pytest.approx(float((track.current * 44.4 * TICK / 3600).sum()), rel=0.05)


@pytest.mark.parametrize(("from_deg", "seed"), some([(0.0, 1), (120.0, 2), (240.0, 3)], 3))
def test_wind_and_moderate_turbulence(make_setup: MakeSetup, aerosonde: Aircraft, from_deg: float, seed: int) -> None:
    flown = fly_to_end(Flight(make_setup(WAY, wind=(10.0, from_deg), turbulence="moderate", seed=seed), aerosonde))
    assert flown.ended == "completed"
    _within(flown.track, (0.15, 1.0), (0.3, 1.0))
    gusts = flown.track.wind - flown.track.wind.mean(axis=0)
    assert 0.7 < float(gusts.std()) < 3.0


@pytest.mark.parametrize(
    "variation",
    some([Variation(drag=1.3), Variation(mass=1.1), Variation(control=0.75), Variation(mass=0.9)], 4),
    ids=str,
)
def test_an_aircraft_that_differs_from_its_model(
    make_setup: MakeSetup, aerosonde: Aircraft, variation: Variation
) -> None:
    calm = fly_to_end(Flight(make_setup(WAY), aerosonde, variation=variation))
    assert calm.ended == "completed"
    _within(calm.track, (0.15, 1.5), (0.15, 1.5))
    windy = fly_to_end(
        Flight(make_setup(WAY, wind=(10.0, 200.0), turbulence="moderate"), aerosonde, variation=variation)
    )
    assert windy.ended == "completed"
    _within(windy.track, (0.25, 2.0), (0.3, 1.5))
    assert _digest(calm.track) != _digest(fly_to_end(Flight(make_setup(WAY), aerosonde)).track)


_FLY_AGAIN = """
import hashlib, pickle, sys
from aircraft.catalog import load_aircraft
from flight.simulation.simulate import Flight, fly_to_end
from flight.simulation.track import COLUMNS
with open(sys.argv[1], "rb") as file:
    track = fly_to_end(Flight(pickle.load(file), load_aircraft("aerosonde"))).track
print(hashlib.sha256(b"".join(getattr(track, name).tobytes() for name in COLUMNS)).hexdigest())
"""


def blocks_of(flight: Flight, seconds: float = BLOCK_DURATION_S) -> Iterator[tuple[Rows, str, float]]:
    """The rows of each block of a flight, how the flight ended with them, and how far along its path."""
    end_reason = ""
    while not end_reason:
        rows, end_reason = flight.fly_block(round(seconds / flight.dt))
        yield rows, end_reason, flight.distance


def test_a_track_is_built_in_little_more_memory_than_its_own() -> None:
    """An hour of rows of 35 float64 each, for a track of 4 columns of float64 and 31 of 4 bytes."""
    block, seconds = np.zeros(60, TRACK_ROW), 3600
    track_bytes = seconds * 60 * (4 * 8 + 31 * 4)
    tracemalloc.start()
    builder = TrackBuilder()
    for _ in range(seconds):
        builder.add(block.copy())
    track = builder.track()
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert len(track) == seconds * 60
    assert sum(getattr(track, name).nbytes for name in COLUMNS) == track_bytes
    assert peak < track_bytes + 2 * 600 * block.nbytes + 5e6


def test_the_same_setup_gives_the_same_bytes(make_setup: MakeSetup, aerosonde: Aircraft, tmp_path: Path) -> None:
    def setup(seed: int) -> FlightSetup:
        return make_setup(WAY[:4], wind=(7.0, 30.0), turbulence="light", seed=seed)

    def fly(seed: int) -> str:
        return _digest(fly_to_end(Flight(setup(seed), aerosonde)).track)

    first = fly(5)
    assert fly(5) == first
    assert fly(6) != first
    flight = Flight(setup(5), aerosonde)
    blocks = list(blocks_of(flight))
    builder = TrackBuilder()
    for rows, _, _ in blocks:
        builder.add(rows)
    assert _digest(builder.track()) == first
    # A second of flight each, up to the end of the path.
    assert {len(rows) for rows, _, _ in blocks[:-1]} == {60}
    assert [end_reason for _, end_reason, _ in blocks] == [""] * (len(blocks) - 1) + ["completed"]
    distances = [distance for _, _, distance in blocks]
    assert distances == sorted(distances)
    assert distances[-1] == flight.path.length
    if not SOAK:
        return  # Other processes are tried in test_same_bytes_in_any_process.
    # Nor does another process, with another order of hashes.
    (tmp_path / "setup").write_bytes(pickle.dumps(setup(5)))
    run = subprocess.run(
        [sys.executable, "-c", _FLY_AGAIN, str(tmp_path / "setup")],
        cwd=ROOT,
        env=os.environ | {"PYTHONHASHSEED": "77"},
        capture_output=True,
        text=True,
        check=True,
        timeout=120,
    )
    assert run.stdout.split() == [first]


def test_a_seed_of_the_wind_wins(make_setup: MakeSetup, aerosonde: Aircraft) -> None:
    def fly(seed: int, own: int | None) -> str:
        setup = make_setup(WAY[:2], turbulence="light", seed=seed)
        scenario = replace(setup.scenario, wind=replace(setup.scenario.wind, seed=own))
        return _digest(fly_to_end(Flight(replace(setup, scenario=scenario), aerosonde)).track)

    assert fly(1, 9) == fly(2, 9)
    assert fly(1, None) != fly(2, None)


def test_not_a_number(make_setup: MakeSetup, aerosonde: Aircraft) -> None:
    flight = Flight(replace(make_setup(WAY), engine="jsbsim"), aerosonde)
    for _ in range(8):
        rows, ended = flight.fly_block(60)
        assert not ended
    flight.fdm.write(np.full(4, math.nan))
    flight.fdm.step()
    rows, ended = flight.fly_block(60)
    assert ended == "loss of control: the state is not a number"
    assert len(rows) == 0
    assert np.isfinite(flight.guidance_memory.tolist()).all()


def test_dive_into_a_hill(make_setup: MakeSetup, aerosonde: Aircraft) -> None:
    peaks = {"kind": "peaks", "peak": [{"east_m": 0.0, "north_m": 3000.0, "height_m": 600.0, "sigma_m": 400.0}]}
    flown = fly_to_end(Flight(make_setup([[0, 0, 300], [0, 6000, 300]], terrain=peaks), aerosonde))
    assert flown.ended == "ground contact"
    last = flown.track.position[-1]
    assert flown.track.clearance[-1] <= 0.0
    assert (flown.track.clearance[:-1] > 0.0).all()
    # exp(-d^2 / (2 sigma^2)) = 1/2 at 1.177 sigma before the summit.
    assert last[1] == pytest.approx(3000.0 - 1.1774 * 400.0, abs=5.0)
    assert last[2] == pytest.approx(300.0, abs=2.0)


def test_start_under_the_terrain(make_setup: MakeSetup, aerosonde: Aircraft) -> None:
    setup = make_setup([[0, 0, 500], [0, 3000, 500]])
    route = setup.route.with_fields(position=np.array([[0.0, 0.0, 99.0], [0.0, 3000.0, 500.0]]))
    with pytest.raises(FlightError, match="start at 99 m AMSL: not above the terrain, which is at 100 m"):
        fly_to_end(Flight(replace(setup, route=route), aerosonde))


def test_a_corner_that_cannot_be_flown(make_setup: MakeSetup, aerosonde: Aircraft) -> None:
    # A hairpin of 60 m: its arcs are of 30 m, a quarter of what the bank allows.
    flown = fly_to_end(Flight(make_setup([[0, 0, 500], [0, 1500, 500], [60, 1500, 500], [60, 0, 500]]), aerosonde))
    assert float(np.abs(flown.track.cross_track).max()) > 20.0
    assert math.degrees(np.abs(flown.track.attitude[:, 0]).max()) < 36.0
    assert flown.ended == "completed"  # it comes back; that it left the path is for the verdict


def test_a_climb_that_cannot_be_flown(make_setup: MakeSetup, aerosonde: Aircraft) -> None:
    # 25 degrees, where 14 can be climbed at 25 m/s: height is given up for speed, and the flight does not stall.
    setup = make_setup([[0, 0, 300], [0, 1000, 300], [0, 2500, 1000], [0, 4500, 1000]])
    flown = fly_to_end(Flight(setup, aerosonde))
    assert flown.ended == "completed"
    assert float(flown.track.height_error.min()) < -120.0
    assert float(flown.track.airspeed.min()) > 19.0
    climbing = (flown.track.position[:, 1] > 1400.0) & (flown.track.position[:, 1] < 2400.0)
    slope = np.polyfit(flown.track.position[climbing, 1], flown.track.position[climbing, 2], 1)[0]
    able, _ = setup.envelope.air_angles(float(flown.track.airspeed[climbing].mean()), 500.0)
    assert math.degrees(math.atan(slope)) == pytest.approx(math.degrees(able), abs=0.7)


def test_u_turn_comes_back(make_setup: MakeSetup, aerosonde: Aircraft) -> None:
    flown = fly_to_end(Flight(make_setup([[0, 0, 500], [0, 2000, 500], [0, 20, 500]]), aerosonde))
    assert flown.ended == "completed"
    for point in ([0, 2000, 500], [0, 20, 500]):
        assert np.linalg.norm(flown.track.position - point, axis=1).min() < 2.0


def test_a_wind_that_cannot_be_beaten_ends(make_setup: MakeSetup, aerosonde: Aircraft) -> None:
    # 30 m/s from ahead of an aircraft that holds 25.
    setup = make_setup([[0, 0, 500], [0, 1500, 500]], wind=(30.0, 0.0))
    with pytest.raises(FlightError, match=r"^made: no progress along the course of -?0 degrees") as caught:
        fly_to_end(Flight(setup, aerosonde))
    assert "\n" not in str(caught.value)


def test_time_limit(make_setup: MakeSetup, aerosonde: Aircraft) -> None:
    # It starts downwind and can, but the leg back against 27 m/s never ends.
    setup = make_setup([[0, 0, 500], [0, 1000, 500], [300, 0, 500]], wind=(27.0, 180.0))
    flown = fly_to_end(Flight(setup, aerosonde))
    assert re.fullmatch(r"time limit of \d+ s reached", flown.ended)
    assert len(flown.track) < 60_000


def test_unknown_ground(make_setup: MakeSetup, aerosonde: Aircraft) -> None:
    setup = make_setup([[0, 0, 500], [0, 1500, 500]], terrain={"kind": "none"}, turbulence="light")
    flown = fly_to_end(Flight(setup, aerosonde))
    assert flown.ended == "completed"
    assert np.isnan(flown.track.clearance).all()


def test_each_leg_at_its_speed(make_setup: MakeSetup, aerosonde: Aircraft) -> None:
    flown = fly_to_end(
        Flight(make_setup([[0, 0, 500], [0, 2000, 500], [0, 4500, 500]], speeds=[22.0, 28.0]), aerosonde)
    )
    track = flown.track
    assert track.speed_command[track.leg == 0] == pytest.approx(22.0)
    assert track.speed_command[track.leg == 1] == pytest.approx(28.0)
    assert track.airspeed[(track.leg == 1) & (track.position[:, 1] > 3500)] == pytest.approx(28.0, abs=0.3)


def test_a_flight_crosses_the_180th_meridian(make_setup: MakeSetup, aerosonde: Aircraft) -> None:
    points = [[-2000, 0, 500], [2000, 500, 520]]
    here = fly_to_end(Flight(make_setup(points, origin={"lat_deg": -17.0, "lon_deg": 179.999}), aerosonde))
    there = fly_to_end(Flight(make_setup(points, origin={"lat_deg": -17.0, "lon_deg": 100.0}), aerosonde))
    assert here.ended == there.ended == "completed"
    assert np.abs(here.track.cross_track).max() < 0.5
    assert np.allclose(here.track.position, there.track.position, atol=0.01)


def test_guidance_at_thirty_hertz_follows_too(make_setup: MakeSetup, aerosonde: Aircraft) -> None:
    setup = make_setup([[0, 0, 500], [0, 1500, 500], [800, 2600, 520]])
    track = fly_to_end(Flight(replace(setup, guidance_hz=30), aerosonde)).track
    assert np.diff(track.time) == pytest.approx(1 / 30, abs=1e-9)
    assert float(np.abs(track.cross_track[150:]).max()) < 0.6


def test_the_length_of_blocks_does_not_change_the_track(make_setup: MakeSetup, aerosonde: Aircraft) -> None:
    setup = replace(make_setup(WAY[:4], wind=(7.0, 30.0), turbulence="light", seed=5), nav="gnss")
    tracks, lengths = [], []
    for duration in (1.0, 7.0, 10.0, 25.0):
        builder = TrackBuilder()
        blocks = [rows for rows, _, _ in blocks_of(Flight(setup, aerosonde), duration)]
        for rows in blocks:
            builder.add(rows)
        tracks.append(_digest(builder.track()))
        lengths.append({len(rows) for rows in blocks[:-1]})
    assert len(set(tracks)) == 1
    assert lengths == [{60}, {420}, {600}, {1500}]


# ----------------------------------------------------------------------
# An aircraft in the air: where its route has it start, and how long it may take.

AEROSONDE = load_aircraft("aerosonde")
MAKE = setup_maker(AEROSONDE)
NOTHING = Mission(None, ())


class Gliding(RunningFlight):
    """Nobody steers it."""

    def _fly_ticks(self, count: int) -> int:
        return 0


def airborne(points: object, **keywords: object) -> Gliding:
    setup = MAKE(points, **keywords)
    return Gliding(setup, AEROSONDE, load_gains(AEROSONDE))


def test_a_route_starts_at_its_first_waypoint_on_its_first_leg() -> None:
    points = [[0.0, 0.0, 500.0], [1000.0, 1000.0, 600.0]]
    setup = MAKE(points, wind=(6.0, 270.0))
    start = Gliding(setup, AEROSONDE, load_gains(AEROSONDE)).start
    assert (start.amsl, start.ground, start.airspeed) == (500.0, 100.0, 25.0)
    assert start.course == pytest.approx(math.pi / 4.0, abs=1e-6)
    assert start.slope == pytest.approx(math.atan2(100.0, math.hypot(1000.0, 1000.0)))
    # From the west: the air moves east.
    assert start.wind == pytest.approx((0.0, 6.0, 0.0), abs=1e-6)


def test_a_start_in_the_ground_is_refused() -> None:
    setup = MAKE([[0.0, 0.0, 150.0], [1000.0, 0.0, 200.0]])
    low = setup.route.positions - [0.0, 0.0, 51.0]
    setup = replace(setup, route=setup.route.with_fields(position=low))
    with pytest.raises(FlightError, match="start at 99 m AMSL: not above the terrain, which is at 100 m"):
        Gliding(setup, AEROSONDE, load_gains(AEROSONDE))


def test_a_flight_may_take_its_length_at_its_slowest_ground_speed_and_more() -> None:
    flight = airborne([[0.0, 0.0, 500.0], [0.0, 3000.0, 500.0]], wind=(5.0, 0.0))
    seconds = TIME_LIMIT_FACTOR * 3000.0 / 20.0 + TIME_LIMIT_BASE_S
    assert flight.max_ticks == pytest.approx(seconds / flight.dt, abs=60)


def test_a_return_may_take_five_minutes_more_for_its_circles() -> None:
    setup = MAKE([[0.0, 0.0, 500.0], [0.0, 3000.0, 500.0]])
    back = replace(setup, route=replace(setup.route, rtl_start=0, rtl_loiter=ReturnCircle(0.0, 3000.0, 500.0, 80.0)))
    plain, longer = (Gliding(one, AEROSONDE, load_gains(AEROSONDE)) for one in (setup, back))
    assert (longer.max_ticks - plain.max_ticks) * plain.dt == pytest.approx(300.0, abs=1.0)


def test_a_returns_circles_are_as_wide_as_its_height_makes_them() -> None:
    """3,000 m up they grow by the standard atmosphere's density, 1.225 / 0.9091 kg/m3, and take as much longer."""
    setup, gains = MAKE([[0.0, 0.0, 500.0], [0.0, 3000.0, 500.0]]), load_gains(AEROSONDE)
    plain = Gliding(setup, AEROSONDE, gains).max_ticks
    low, high = (
        Gliding(replace(setup, route=replace(setup.route, rtl_start=0, rtl_loiter=circle)), AEROSONDE, gains).max_ticks
        for circle in (ReturnCircle(0.0, 3000.0, up, 2000.0) for up in (0.0, 3000.0))
    )
    assert (high - plain) / (low - plain) == pytest.approx(1.225 / 0.9091, rel=1e-3)


def test_turns_too_tight_for_the_bank_may_take_as_long_as_it_makes_them() -> None:
    """40 turns and one to line up, of 116 m by 30 degrees; 60 m, 63 m at 500 m, are drawn, and held by 60 degrees."""
    setup, gains = loiter("18 40 0 0 0", {"WP_LOITER_RAD": 60.0}), load_gains(AEROSONDE)
    steep = replace(setup, limits=replace(setup.limits, max_bank=math.radians(60.0)))
    wide, plain = (Gliding(one, AEROSONDE, gains) for one in (setup, steep))
    held, drawn = radius_at(30.0), 60.0 * (SPEED / 25.0) ** 2
    longer = TIME_LIMIT_FACTOR * 2.0 * math.pi * (40.0 * (held - drawn) + held) / 25.0
    assert (wide.max_ticks - plain.max_ticks) * plain.dt == pytest.approx(longer, rel=0.003)
    tangents = replace(setup, autopilot=MAKE([[0.0, 0.0, 500.0], [0.0, 3000.0, 500.0]]).autopilot)
    assert Gliding(tangents, AEROSONDE, gains).max_ticks == pytest.approx(plain.max_ticks, rel=0.01)


def test_a_loiter_may_take_as_long_as_its_item_says() -> None:
    lines = wp(0, -1500), wp(0, 0, 100, 19, p="120 0 150 0"), wp(1500, 1500)
    setup = setup_of(*lines)
    waits, plain = (Gliding(one, AEROSONDE, load_gains(AEROSONDE)) for one in (setup, replace(setup, mission=NOTHING)))
    assert (waits.max_ticks - plain.max_ticks) * plain.dt == pytest.approx(120.0, abs=1.0)


def test_a_flight_that_still_circles_when_its_time_is_over_says_so() -> None:
    setup = setup_of(wp(0, -1500), wp(0, 0, 100, 18, p="3 0 150 0"), wp(1500, 1500))
    for leg, place in ((0, " in the loiter of item 2"), (setup.route.legs - 1, "")):
        flight = Gliding(setup, AEROSONDE, load_gains(AEROSONDE))
        flight.max_ticks, flight.guidance_memory.leg = 0, leg
        assert flight.fly_block(10)[1] == f"time limit of 0 s reached{place}"


def test_a_block_ends_with_the_time() -> None:
    flight = airborne([[0.0, 0.0, 500.0], [0.0, 300.0, 500.0]])
    flight.max_ticks = 0
    rows, ended = flight.fly_block(10)
    assert len(rows) == 0
    assert ended == "time limit of 0 s reached"
