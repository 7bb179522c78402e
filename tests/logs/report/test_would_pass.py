"""What would have passed is the limit on the side to which the margin counts, with what the verdict knows beside it."""

from dataclasses import replace

import pytest

from logs.report.would_pass import would_pass
from logs.verdict.findings import Finding, make_finding
from logs.verdict.levels import DecidingParameter
from logs.verdict.places import Change, Place

LEG = Place("leg", 4)
DECIDING = DecidingParameter("TECS_HDEM_TCONST", 3.0, 1.2, "s", "clearance", LEG, -8.2)


def failed(rule: str, flown: float | None, limit: float, margin: float | None, place: Place = LEG) -> Finding:
    return make_finding(rule, place, ok=False, reason="", flown=flown, limit=limit, margin=margin)


@pytest.mark.parametrize(
    ("rule", "flown", "limit", "margin", "bound"),
    [
        ("clearance", 52.0, 60.0, -8.0, "at least"),
        ("stall", 15.0, 17.5, -2.5, "at least"),
        ("bounds", -7.0, 0.0, -7.0, "at least"),
        ("turn", 59.0, 9.0, -50.0, "at most"),
        ("threat", 1.6, 0.0, -1.6, "at most"),
        # Descents: the steepness is bounded, not the number.
        ("slope", -11.0, -9.5, -1.5, "at most"),
        ("energy", 800.0, 710.0, -90.0, "at most"),
    ],
)
def test_the_number_that_passes_bounds_on_the_side_of_the_margin(
    rule: str, flown: float, limit: float, margin: float, bound: str
) -> None:
    found = would_pass(failed(rule, flown, limit, margin), None)
    assert (found.bound, found.value, found.misses) == (bound, limit, -margin)
    assert found


def test_a_finding_that_fails_by_other_evidence_names_no_number() -> None:
    found = would_pass(failed("turn", 6.9, 15.6, 8.7), None)
    assert (found.bound, found.value, found.misses) == (None, None, None)
    assert not found


def test_the_parameter_stands_at_the_finding_that_it_decides_alone() -> None:
    low = failed("clearance", 52.0, 60.0, -8.0)
    assert would_pass(low, DECIDING).parameter == DECIDING
    assert would_pass(failed("clearance", 52.0, 60.0, -8.0, Place("leg", 5)), DECIDING).parameter is None
    assert would_pass(failed("height", 52.0, 60.0, -8.0), DECIDING).parameter is None


def test_suggestions_are_those_of_the_finding() -> None:
    change = (Change("height", LEG, None, 9.0, "m"),)
    assert would_pass(replace(failed("turn", 6.9, 15.6, 8.7), suggestions=(change,)), None).suggestions == (change,)
