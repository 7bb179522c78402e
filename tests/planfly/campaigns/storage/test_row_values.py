"""A row as values and back: all of it, and what makes it another flight."""

from dataclasses import replace
from pathlib import Path

from planfly.campaigns.flights.campaign_base import CampaignBase
from planfly.campaigns.flights.flight_row import fly_one, lost_row
from planfly.campaigns.storage.row_values import NOT_THE_SAME, ROW_COLUMNS, row_of, row_values, same_flight
from tests.planfly.campaigns.made_campaigns import made_flight


def test_values_make_the_row_again(base: CampaignBase) -> None:
    for row in (fly_one(base, 1), made_flight(base, 2), lost_row(base, 3, "lost: x")):
        values = row_values(row, "a")
        assert tuple(values) == tuple(ROW_COLUMNS)
        # But for its narrow passes, which a search's table keeps for itself.
        assert row_of(row.draw.index, values) == replace(row, narrow=())


def test_who_flew_and_how_long_makes_no_other_flight(base: CampaignBase, tmp_path: Path) -> None:
    row = made_flight(base, 1)
    assert NOT_THE_SAME == ("seconds", "worker")
    assert same_flight(row, replace(row, worker="tcp://x", seconds=9.0))
    assert not same_flight(row, replace(row, ended="x"))
    assert not same_flight(row, replace(row, draw=replace(row.draw, index=2)))
