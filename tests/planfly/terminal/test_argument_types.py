"""Texts of the command line as values: both ends of each range, and what lies just beyond."""

import argparse
from collections.abc import Callable
from typing import Any

import pytest

from planfly.terminal import argument_types as types

TAKEN: list[tuple[Callable[[str], Any], str, Any]] = [
    (types.seed, "0", 0),
    (types.seed, "9223372036854775807", 2**63 - 1),
    (types.count, "20", 20),
    (types.positive, "1e6", 1e6),
    (types.positive, "0.25", 0.25),
    (types.speedup, "0.1", 0.1),
    (types.speedup, "100", 100.0),
    (types.wind, "40,-360", (40.0, -360.0)),
    (types.wind, "0,360", (0.0, 360.0)),
    (types.flight_time, "0", 0.0),
    (types.flight_time, "1e7", 1e7),
    (types.time_or_stations, "12.5", 12.5),
    (types.time_or_stations, "127.0.0.1:14550", "127.0.0.1:14550"),
    (types.budget, "4", (4, None)),
    (types.budget, "2.5s", (None, 2.5)),
    (types.leg, "10000", 10_000),
    (types.threat, "-5,6.5,0,300", (-5.0, 6.5, 0.0, 300.0)),
    (types.problems, "60, 7,7", (7, 60)),
    (types.positive_count, "1000", 1000),
    (types.port, "65535", 65535),
    (types.port, "0", 0),
]

REFUSED: list[tuple[Callable[[str], Any], tuple[str, ...]]] = [
    (types.seed, ("-1", "9223372036854775808", "1.0", "")),
    (types.count, ("21", "-1", "\u0663", "2.0")),
    (types.positive, ("0", "-1", "1000001", "nan", "inf", "ten")),
    (types.speedup, ("0.09", "100.1", "nan")),
    (types.wind, ("5", "5,6,7", "-1,0", "40.1,0", "5,361", "nan,0", "5,nan")),
    (types.flight_time, ("-0.1", "10000001", "nan")),
    (types.time_or_stations, ("-1", "soon")),
    (types.budget, ("3", "10000000001", "0s", "nans", "-2s", "s", "1000001s")),
    (types.leg, ("-1", "10001", "1.5")),
    (types.threat, ("1,2,3", "1,2,-3,4", "1,2,3,-4", "nan,2,3,4", "1,inf,3,4", "1,2,nan,4")),
    (types.problems, ("8", "7,", "7,-15", "")),
    (types.positive_count, ("0", "1001", "-1", "2.5")),
    (types.port, ("65536", "-1", "80.0")),
]


@pytest.mark.parametrize(("take", "text", "value"), TAKEN)
def test_a_text_is_the_value_that_it_states(take: Callable[[str], Any], text: str, value: Any) -> None:
    assert take(text) == value


@pytest.mark.parametrize(("take", "text"), [(take, text) for take, texts in REFUSED for text in texts])
def test_what_lies_outside_is_refused_with_the_text_given(take: Callable[[str], Any], text: str) -> None:
    with pytest.raises(argparse.ArgumentTypeError, match="expected") as caught:
        take(text)
    assert repr(text) in str(caught.value)
