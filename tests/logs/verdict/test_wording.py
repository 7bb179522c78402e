"""Words of places and changes, as terminal, report and verdict.json have them."""

import pytest

from logs.verdict.places import FLIGHT, MISSION, PLAN, Change, Place
from logs.verdict.wording import change_text, place_text, shortened, suggestion_text, suggestions_text
from tests.logs.verdict.judging import leg, missile, waypoint

LONGER = Change("length", leg(1), 150.0, 300.0, "m")


@pytest.mark.parametrize(
    ("place", "text"),
    [
        (FLIGHT, "flight"),
        (MISSION, "mission"),
        (PLAN, "plan"),
        (leg(0), "leg 0"),
        (waypoint(0), "waypoint 0"),
        (Place("waypoint", 0, item=0), "waypoint 0 (item 0)"),
        (Place("mission", item=0), "item 0"),
        (Place("missile", 0, name="Alfa"), "Alfa (missile)"),
        (Place("radar", 2, name="threat 3"), "threat 3 (radar)"),
        (Place("radar", 2), "threat 3 (radar)"),
    ],
)
def test_places(place: Place, text: str) -> None:
    assert place_text(place) == text


@pytest.mark.parametrize(
    ("change", "text"),
    [
        (LONGER, "make leg 1 300 m long instead of 150 m"),
        (Change("length", leg(1), 0.2, 300.0, "m"), "make leg 1 300 m long; it goes nowhere now"),
        (Change("rise", leg(2), 60.0, 44.0, "m"), "climb 44 m on leg 2 instead of 60 m"),
        (Change("rise", leg(2), -60.0, -44.0, "m"), "fall 44 m on leg 2 instead of 60 m"),
        (Change("rise", leg(2), None, -0.0, "m"), "fall 0 m on leg 2"),
        (Change("airspeed", waypoint(1), 25.0, 20.5, "m/s"), "fly it at 20.5 m/s instead of 25 m/s"),
        (Change("airspeed", leg(3), 35.0, 18.1, "m/s", most=31.0), "command 18.1 to 31.0 m/s on leg 3"),
        (Change("turn", waypoint(1), 90.0, 61.2, "deg"), "turn at most 61.2° there"),
        (Change("height", leg(4), None, 12.0, "m"), "fly leg 4 12 m higher"),
        (Change("inset", FLIGHT, None, 7.0, "m"), "bring the path 7 m further inside"),
        (Change("distance", missile("Alfa"), None, 41.0, "m"), "pass Alfa 41 m further away"),
        (Change("distance", Place("missile", 1), None, 41.0, "m"), "pass threat 2 41 m further away"),
        (Change("duration", FLIGHT, None, 12.0, "%"), "shorten the flight by 12 %"),
        (Change("battery", FLIGHT, None, 1.13, "1"), "take a battery 1.13 times as large"),
        (Change("tank", FLIGHT, None, 2.0, "1"), "take a tank 2.00 times as large"),
    ],
)
def test_changes(change: Change, text: str) -> None:
    assert change_text(change) == suggestion_text((change,)) == suggestions_text(((change,),)) == text


def test_changes_together_and_alternatives() -> None:
    gentler = tuple(Change("rise", leg(k), None, -20.0, "m") for k in (1, 2))
    assert suggestion_text(gentler) == "fall 20 m on leg 1 and fall 20 m on leg 2"
    text = "make leg 1 300 m long instead of 150 m and leg 1 300 m long instead of 150 m"
    assert suggestion_text((LONGER, LONGER)) == text
    assert suggestions_text((gentler, (LONGER, LONGER))) == f"{suggestion_text(gentler)}, or {text}"
    assert suggestions_text(()) == ""


def test_a_headline_takes_eighty_characters_of_a_statement() -> None:
    assert shortened("m" * 80) == "m" * 80
    assert shortened("m" * 81) == "m" * 77 + "..."
