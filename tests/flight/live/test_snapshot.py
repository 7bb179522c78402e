"""Snapshots: what was flown comes out under its name, true courses for courses on the map, and survives packing."""

import math

import numpy as np
import pytest

from flight.live.snapshot import Snapshot, SnapshotMaker
from flight.simulation.local_map import LocalMap
from flight.simulation.track import Track, track_rows
from tests.mission_lines import setup_of, wp


def a_track() -> Track:
    """One row, each number of it another."""
    return Track(
        time=np.array([7.0]),
        position=np.array([[120.0, 340.0, 560.0]]),
        velocity=np.array([[3.0, 4.0, 5.0]]),
        attitude=np.array([[0.1, 0.2, 0.3]]),
        rates=np.array([[0.01, 0.02, 0.03]]),
        airspeed=np.array([25.5]),
        flow=np.array([[0.04, 0.05]]),
        controls=np.array([[0.11, 0.12, 0.13, 0.75]]),
        commands=np.array([[0.21, 0.22, 0.23, 0.25]]),
        wind=np.array([[1.5, -2.5, 0.5]]),
        load_factor=np.array([1.25]),
        current=np.array([6.5]),
        energy=np.array([8.25]),
        leg=np.array([2]),
        cross_track=np.array([0.5]),
        height_error=np.array([0.125]),
        speed_command=np.array([24.0]),
        clearance=np.array([460.0]),
    )


def test_a_row_comes_out_under_its_names() -> None:
    """On the meridian of the map's origin north is true north."""
    setup = setup_of(wp(0, 0), wp(0, 2000))
    track = a_track()
    snapshot = SnapshotMaker(setup, LocalMap.around(setup)).snapshot(track_rows(track)[0])
    assert (snapshot.time, snapshot.amsl, snapshot.height, snapshot.leg) == (7.0, 560.0, 460.0, 2.0)
    assert (snapshot.airspeed, snapshot.throttle, snapshot.current, snapshot.energy) == (25.5, 0.75, 6.5, 8.25)
    assert (snapshot.roll, snapshot.pitch) == pytest.approx((0.1, 0.2))
    assert (snapshot.p, snapshot.q, snapshot.r) == pytest.approx((0.01, 0.02, 0.03))
    assert (snapshot.v_north, snapshot.v_east, snapshot.v_down) == pytest.approx((4.0, 3.0, -5.0), abs=1e-3)
    assert (snapshot.wind_north, snapshot.wind_east) == pytest.approx((-2.5, 1.5), abs=1e-3)
    assert snapshot.yaw == pytest.approx(0.3, abs=1e-4)
    assert Snapshot.unpack(snapshot.pack()) == snapshot
    assert snapshot.finite


def test_an_aircraft_waits_at_the_start_on_its_first_course() -> None:
    setup = setup_of(wp(0, 500), wp(2000, 500))
    snapshot = SnapshotMaker(setup, LocalMap.around(setup)).before_start(setup)
    assert snapshot.amsl == pytest.approx(400.0)
    assert snapshot.height == pytest.approx(300.0)
    assert snapshot.yaw == pytest.approx(math.pi / 2.0, abs=1e-3)
    assert (snapshot.time, snapshot.airspeed, snapshot.leg) == (0.0, 0.0, -1.0)
