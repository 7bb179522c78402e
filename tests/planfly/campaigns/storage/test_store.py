"""The table of a campaign: by index, and in order of index whoever came first."""

from dataclasses import replace
from pathlib import Path

import pytest

from planfly.campaigns.flights.campaign_base import CampaignBase
from planfly.campaigns.flights.flight_row import fly_one, lost_row
from planfly.campaigns.statistics.proportions import Tally
from planfly.campaigns.storage.held_table import StoreError
from planfly.campaigns.storage.store import Store
from tests.planfly.campaigns.made_campaigns import made_flight


def test_rows_come_back_as_they_were_in_order_of_index(base: CampaignBase, tmp_path: Path) -> None:
    real, made, lost = replace(fly_one(base, 2), narrow=()), made_flight(base, 0), lost_row(base, 1, "died")
    with Store(tmp_path / "c.sqlite", "a", {}, resume=False) as store:
        for row in (real, made, lost):
            store.add(row)
        rows = list(store.rows())
        assert [row.draw.index for row in rows] == [0, 1, 2]
        assert rows[2] == real
        assert store.flight(2) == real
        assert store.flight(3) is None
        assert store.tally() == Tally(1, 1, 1)
        assert store.outcomes()[1] == "lost"
        # The lost first, then the one that failed.
        assert [row.draw.index for row in store.closest(3)] == [1, 0, 2]
        assert store.has_track() == [False, False, True]
        assert store.column("mass").tolist() == [row.draw.values["mass"] for row in rows]
        store.drop_from(1)
        assert list(store.outcomes()) == [0]
        with pytest.raises(StoreError, match="UNIQUE"):
            store.add(made)
