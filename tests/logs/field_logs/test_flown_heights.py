import numpy as np

from flight.mission.items import Mission, MissionItem
from logs.field_logs.flown_heights import with_flown_heights


def test_across_the_180th_meridian_the_near_row_counts() -> None:
    task = Mission(None, (MissionItem(1, 16, 0, (0.0,) * 4, -17.0, -179.999, 0.0),))
    lon = np.array([179.9, 179.9995, -179.9])
    flown = with_flown_heights(task, np.full(3, -17.0), lon, np.array([100.0, 200.0, 300.0]))
    assert flown.items[0].alt == 200.0


def test_rows_without_a_height_do_not_count() -> None:
    task = Mission(None, (MissionItem(1, 16, 0, (0.0,) * 4, 46.0, 8.0, 0.0),))
    flown = with_flown_heights(task, np.array([46.0, 46.1]), np.full(2, 8.0), np.array([np.nan, 300.0]))
    assert flown.items[0].alt == 300.0
