"""The workspace's views are its record's own memory, and its parts are what it was given."""

import numpy as np
import pytest

from flight.guidance.fly_by_path import FlyByPath
from flight.guidance.lateral_reference_laws import WAYPOINT
from flight.guidance.path_kernels import NODE, PIECE
from flight.simulation.workspace import BLOCK_TICKS, OUTPUT, READ_FIELDS, Workspace
from tests.flight.simulation.hand_made import GAINS, linear_map, make_workspace
from world.frames import polymap
from world.kernels import field_names


@pytest.fixture
def space() -> Workspace:
    return make_workspace()


def test_readings_are_the_state_by_name(space: Workspace) -> None:
    assert len(READ_FIELDS) == 22
    assert not {"time", "wind_north", "wind_east", "wind_down"} & set(READ_FIELDS)
    space.readings[:] = np.arange(22)
    assert [space.record.state[name] for name in READ_FIELDS] == list(range(22))
    space.record.state.airspeed = -5.0
    assert space.readings[READ_FIELDS.index("airspeed")] == -5.0


def test_output_is_what_is_set_by_name(space: Workspace) -> None:
    names = field_names(OUTPUT)
    wanted = ("elevator", "aileron", "rudder", "throttle", "gust_north", "gust_east", "gust_down", "ground")
    assert names == wanted
    for k, name in enumerate(names):
        space.record.output[name] = 3.0 + k
    assert space.output.tolist() == [3.0 + k for k in range(len(names))]


def test_counters_noise_and_rows_share_memory_with_the_record(space: Workspace) -> None:
    for view in (
        space.readings,
        space.output,
        space.ticks_flown,
        space.rows_filled,
        space.turbulence,
        space.navigation,
    ):
        assert np.shares_memory(view, space.array)
    assert np.shares_memory(space.rows, space.array)
    space.record.timing.tick, space.record.timing.row = 7, 3
    assert (space.ticks_flown.tolist(), space.rows_filled.tolist()) == ([7], [3])
    space.ticks_flown[0] = 8
    assert space.record.timing.tick == 8
    space.turbulence[2], space.navigation[2] = (1.0, 2.0, 3.0), (4.0, 5.0, 6.0)
    drawn = space.record.noise[2]
    assert (drawn.turbulence.tolist(), drawn.navigation.tolist()) == ([1.0, 2.0, 3.0], [4.0, 5.0, 6.0])
    space.record.rows[5].airspeed = 26.0
    assert space.rows["airspeed"][5] == 26.0
    assert len(space.rows) == len(space.turbulence) == len(space.navigation) == BLOCK_TICKS


def test_views_of_one_field_do_not_reach_into_another(space: Workspace) -> None:
    space.readings[:] = 9.0
    assert all(space.record.state[name] == 0.0 for name in ("time", "wind_north", "wind_east", "wind_down"))
    space.output[:] = 9.0
    assert all(value == 1.0 for value in space.record.scale_above.tolist())


def test_gains_are_the_aircrafts(space: Workspace) -> None:
    assert space.record.gains.reference_airspeed == 25.0
    assert space.record.gains.roll_frequency == GAINS.roll_frequency == 5.0


def test_the_path_table_holds_each_part_and_how_many_there_are() -> None:
    pieces, nodes, waypoints = np.zeros(2, PIECE), np.zeros(3, NODE), np.zeros(4, WAYPOINT)
    pieces["length"], nodes["height"], waypoints["airspeed"] = (1, 2), (3, 4, 5), (6, 7, 8, 9)
    space = Workspace(GAINS, FlyByPath(pieces, nodes, 3.0), waypoints)
    settings = space.record.settings
    assert (settings.pieces, settings.nodes, settings.waypoints) == (2, 3, 4)
    assert len(space.path) == 4
    assert space.path["piece"]["length"].tolist() == [1.0, 2.0, 0.0, 0.0]
    assert space.path["node"]["height"].tolist() == [3.0, 4.0, 5.0, 0.0]
    assert space.path["waypoint"]["airspeed"].tolist() == [6.0, 7.0, 8.0, 9.0]


def test_copies_of_maps_answer_as_the_maps(space: Workspace) -> None:
    curved = linear_map((5.0, 2.0, -3.0), (-1.0, 0.5, 4.0), 10.0)
    for name in ("position_map", "north_map", "pixel_map"):
        setattr(space.record, name, curved.record)
        for x, y in ((0.0, 0.0), (3.0, -7.0), (-10.0, 10.0)):
            got = polymap(getattr(space.record, name), x, y)
            assert got == polymap(curved.record, x, y)
            assert got == pytest.approx((5.0 + 2.0 * x - 3.0 * y, -1.0 + 0.5 * x + 4.0 * y))
