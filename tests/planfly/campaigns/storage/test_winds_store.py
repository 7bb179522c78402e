"""The table of a search: what was asked for and what came of it, and another question is refused by name."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from logs.verdict.places import Place
from planfly.campaigns.flights.campaign_base import CampaignBase
from planfly.campaigns.flights.flight_row import lost_row
from planfly.campaigns.flights.varied_flight import GivenWind
from planfly.campaigns.storage.held_table import StoreError
from planfly.campaigns.storage.winds_store import FIXED, AskedFlight, FlownFlight, WindsStore
from tests.planfly.campaigns.made_campaigns import all_fly, made_flight, table

QUESTION: dict[str, Any] = {"target": 0.99, "confidence": 0.95, "directions": 16, "most": 20.0, "flights": 99}


def opened(path: Path, *, resume: bool = True, **other: float) -> WindsStore:
    return WindsStore(path, "a", QUESTION | other, resume=resume)


def test_what_was_asked_for_comes_back_in_order(base: CampaignBase, tmp_path: Path) -> None:
    later, first = AskedFlight(7, 3, 0.1 * 3, 2), AskedFlight(2, 3, 12.300000000000001, 2)
    narrow = (("slope", Place("leg", 1), 0.1 * 3), ("threat", Place("missile", 0, name="Alfa"), 0.0))
    bad = replace(made_flight(base, 3, GivenWind(15.0, 0.0)), narrow=narrow)
    with opened(tmp_path / "w.sqlite", resume=False) as store:
        store.add(later, all_fly(base, 2))
        store.add(AskedFlight(8, 3, 15.0, 3), bad)
        # The draw of another direction's flight: a number of its own.
        store.add(first, lost_row(base, 2, "lost: x"))
        assert list(store.known().items()) == [
            (2, (first, FlownFlight("lost", ()))),
            (7, (later, FlownFlight("flyable", ()))),
            (8, (AskedFlight(8, 3, 15.0, 3), FlownFlight("not flyable", (("clearance", Place("leg", 1)),), narrow))),
        ]
        with pytest.raises(StoreError, match="UNIQUE"):
            store.add(first, all_fly(base, 2))
    assert [row[:4] for row in table(tmp_path / "w.sqlite")][:2] == [(2, 3, 12.300000000000001, 2), (7, 3, 0.1 * 3, 2)]


@pytest.mark.parametrize(
    ("name", "value", "words"),
    [
        ("target", 0.9, "target 0.9: the flights there were asked for with 0.99"),
        ("confidence", 0.9, "confidence 0.9"),
        ("directions", 8, "directions 8: the flights there were asked for with 16"),
        ("most", 30.0, "most 30.0"),
    ],
)
def test_another_question_is_refused_by_name(tmp_path: Path, name: str, value: float, words: str) -> None:
    assert name in FIXED
    opened(tmp_path / "w.sqlite", resume=False).__exit__(None, None, None)
    with pytest.raises(StoreError, match=words):
        opened(tmp_path / "w.sqlite", **{name: value})
    opened(tmp_path / "w.sqlite", flights=7).__exit__(None, None, None)
