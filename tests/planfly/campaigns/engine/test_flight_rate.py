"""Flights a second, and when to tell again."""

import time

import pytest

from planfly.campaigns.engine.flight_rate import TOLD_EVERY, FlightRate


def test_flights_that_were_there_before_are_not_counted(monkeypatch: pytest.MonkeyPatch) -> None:
    now = 100.0
    monkeypatch.setattr(time, "monotonic", lambda: now)
    rate = FlightRate(40)
    assert not rate.due()
    now += 4.0
    assert rate.a_second(60) == 5.0
    assert rate.due()
    assert not rate.due()
    now += TOLD_EVERY
    assert rate.due()
