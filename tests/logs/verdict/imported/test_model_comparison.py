from dataclasses import replace

import numpy as np
import pytest

from flight.simulation.setup import ImportedLog, MissionStretch
from flight.simulation.track import Track
from logs.recording.example_log import example_log
from logs.verdict.imported.flown_legs import FlownLegs, flown_legs
from logs.verdict.imported.model_comparison import Reflight, compare_with_model

LOG = example_log()
SETUP = replace(LOG.setup, imported_log=ImportedLog("a.BIN", "", ""))


def flown(track: Track) -> FlownLegs:
    found = flown_legs(SETUP, track, MissionStretch(0.0, 36.5, "AUTO", "log"))
    assert found is not None
    return found


def against(model: Track) -> Reflight:
    return compare_with_model(LOG.setup, flown(LOG.track), model, "completed")


def test_a_flight_against_itself_differs_in_nothing() -> None:
    again = against(LOG.track)
    assert all(one.median == one.percentile_95 == 0.0 for one in again.spreads)
    assert [leg.leg for leg in again.legs] == [0, 1]
    assert [turn.waypoint for turn in again.turns] == [1]


def test_differences_are_what_was_added() -> None:
    """3 m higher, 2 m to the right on the first leg, which goes east: south."""
    moved = replace(LOG.track, position=LOG.track.position + np.array([0.0, -2.0, 3.0]))
    again = against(moved)
    spread = {one.name: one for one in again.spreads}
    assert spread["height_error"].median == pytest.approx(3.0, abs=0.15)
    assert again.legs[0].cross_track == pytest.approx((0.0, 2.0), abs=1e-6)
    assert again.legs[0].height_error == pytest.approx((0.0, 3.0), abs=0.15)


def test_energy_is_that_of_each_leg() -> None:
    # 0.1 Wh a second, 20 s on the first leg; its last place compared is 10 m before its end.
    assert against(LOG.track).legs[0].energy == pytest.approx((1.96, 1.96), abs=0.01)


def test_what_one_flight_lacks_is_no_number() -> None:
    silent = replace(LOG.track, energy=np.full(len(LOG.track), np.nan, dtype=np.float32))
    again = compare_with_model(LOG.setup, flown(silent), LOG.track, "completed")
    assert np.isnan(again.legs[0].energy[0])
    assert np.isfinite(again.legs[0].energy[1])
