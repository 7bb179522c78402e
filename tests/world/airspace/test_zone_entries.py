"""What files state of a zone: our own keys, openAIP's limits in both of its spellings, and what is refused."""

from typing import Any

import pytest

from world.airspace.zone_entries import FLIGHT_LEVEL_ERROR, zone_entries
from world.errors import ScenarioError


def limit(value: Any, unit: Any, datum: Any) -> dict[str, Any]:
    return {"value": value, "unit": unit, "referenceDatum": datum}


def test_our_own_keys_are_taken_and_others_left() -> None:
    stated = {"kind": "inclusion", "floor_agl_m": 30.0, "ceiling_amsl_m": None, "colour": "red", "icaoClass": 3}
    assert zone_entries(stated, "a file") == {"kind": "inclusion", "floor_agl_m": 30.0}


@pytest.mark.parametrize(
    ("low", "high"),
    [
        (limit(500, 1, 1), limit(400, 1, 0)),
        (limit(500, "FT", "MSL"), limit(400, "FT", "GND")),
        (limit(152.4, "M", "MSL"), limit(121.92, 0, 0)),
    ],
)
def test_feet_and_metres_above_the_sea_and_the_ground(low: dict[str, Any], high: dict[str, Any]) -> None:
    entries = zone_entries({"lowerLimit": low, "upperLimit": high}, "a file")
    assert entries == {"kind": "exclusion", "floor_amsl_m": 152.4, "ceiling_agl_m": 121.92}
    assert zone_entries({"lowerCeiling": low, "upperCeiling": high}, "a file") == entries


def test_the_ground_is_no_floor() -> None:
    assert zone_entries({"lowerLimit": limit(0, 1, 0)}, "a file") == {"kind": "exclusion"}


def test_a_flight_level_bounds_an_exclusion_on_the_safe_side() -> None:
    entries = zone_entries({"lowerLimit": limit(65, 6, 2), "upperLimit": limit(195, "FL", "STD")}, "a file")
    assert entries["floor_amsl_m"] == pytest.approx(6500 * 0.3048 - FLIGHT_LEVEL_ERROR)
    assert entries["ceiling_amsl_m"] == pytest.approx(19500 * 0.3048 + FLIGHT_LEVEL_ERROR)
    # FL 660 is above every height that a scenario knows.
    assert zone_entries({"upperLimit": limit(660, 6, 2)}, "a file")["ceiling_amsl_m"] == 9000.0


FAULTS: dict[str, tuple[dict[str, Any], str]] = {
    "a key misspelt": ({"ceiling_m": 100.0}, "ceiling_m: unknown; known are kind, floor_amsl_m"),
    "another misspelt": ({"radius": 100.0}, "radius: unknown"),
    "a limit that is a number": ({"upperLimit": 100.0}, "upperLimit: a table of value, unit and referenceDatum"),
    "no value": ({"upperLimit": {"unit": 1, "referenceDatum": 1}}, "upperLimit.value: a number"),
    "a truth": ({"upperLimit": limit(True, 1, 1)}, "upperLimit.value: a number"),
    "a unit": ({"upperLimit": limit(5, 2, 1)}, "upperLimit.unit: allowed 0, M, 1, FT, 6, FL"),
    "a list of units": ({"upperLimit": limit(5, [1], 1)}, "upperLimit.unit: allowed"),
    "a datum": ({"lowerLimit": limit(5, 1, "QFE")}, "lowerLimit.referenceDatum: allowed 0, GND, 1, MSL, 2, STD"),
    "a flight level of an inclusion": ({"kind": "inclusion", "upperLimit": limit(65, 6, 2)}, "bounds no inclusion"),
}


@pytest.mark.parametrize("case", FAULTS)
def test_what_is_refused(case: str) -> None:
    properties, wanted = FAULTS[case]
    with pytest.raises(ScenarioError) as caught:
        zone_entries(properties, "a file")
    assert str(caught.value).startswith("a file: ")
    assert wanted in str(caught.value)
