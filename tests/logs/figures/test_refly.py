from dataclasses import replace

import numpy as np

from flight.simulation.field_source import MissionStretch
from logs.figures.refly import refly_figures, refly_pictures
from logs.recording.example_log import example_log
from logs.verdict.field.flown_legs import flown_legs
from logs.verdict.field.model_comparison import compare_with_model

LOG = example_log()
FLOWN = flown_legs(LOG.setup, LOG.track, MissionStretch(0.0, 36.5, "AUTO", "log"))
assert FLOWN is not None
MOVED = replace(LOG.track, position=LOG.track.position + np.array([0.0, -2.0, 0.0]))
AGAIN = compare_with_model(LOG.setup, FLOWN, MOVED, "completed")
NONE = np.full(len(AGAIN.distance), np.nan)


def test_a_picture_a_quantity_and_none_of_what_was_not_logged() -> None:
    assert len(refly_figures(AGAIN)) == 5
    silent = replace(AGAIN, flown=replace(AGAIN.flown, energy=np.full(len(AGAIN.distance), np.nan)))
    assert "refly-energy.png" not in refly_figures(silent)


def test_lines_are_where_the_data_puts_them() -> None:
    upper, lower = refly_figures(AGAIN)["refly-cross-track.png"].axes
    flown, model = (line.get_ydata() for line in upper.lines[:2])
    assert np.nanmax(np.abs(flown)) < 1e-6
    assert abs(np.nanmedian(model[: len(model) // 2]) - 2.0) < 1e-6
    assert lower.get_xlabel() == "along the legs (km)"


def test_the_same_bytes_twice() -> None:
    one = replace(AGAIN, flown=replace(AGAIN.flown, **dict.fromkeys(("bank", "energy", "ground_speed"), NONE)))
    assert refly_pictures(one) == refly_pictures(one)
