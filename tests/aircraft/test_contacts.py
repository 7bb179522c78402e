"""Where aircraft meet the ground: the points, the model with them, and an aircraft at rest on them in JSBSim."""

import math

import pytest

from aircraft.catalog import load_aircraft
from aircraft.contacts import (
    Gear,
    _center_of_gravity,
    _model_contacts,
    default_contacts,
    find_contacts,
    with_contacts,
)
from flight.dynamics.fdm import Fdm

START = (46.0, 8.0)


@pytest.mark.parametrize("gear", ["belly", "wheels"])
def test_contacts_are_the_same_on_both_sides_and_carry_on_three_points(gear: Gear) -> None:
    made = default_contacts(load_aircraft("x8"), gear)
    assert sum(one.is_support for one in made) == 3
    assert sum(one.right for one in made) == pytest.approx(0.0)
    # The centre of gravity is within what carries.
    ahead = [one.forward for one in made if one.is_support]
    assert min(ahead) < 0.0 < max(ahead)


def test_a_model_gets_contacts_once_and_its_own_stay() -> None:
    aerosonde, cessna = load_aircraft("aerosonde"), load_aircraft("c172x")
    once = with_contacts(aerosonde.model_file.read_bytes(), aerosonde, "belly")
    assert once.count(b"<contact ") == 7
    assert with_contacts(once, aerosonde, "wheels") == once
    own = cessna.model_file.read_bytes()
    assert with_contacts(own, cessna, "belly") == own


def test_a_model_without_a_section_for_the_ground_gets_one() -> None:
    aerosonde = load_aircraft("aerosonde")
    bare = aerosonde.model_file.read_bytes().replace(b"<ground_reactions/>", b"")
    assert with_contacts(bare, aerosonde, "belly").count(b"<contact ") == 7


def test_places_count_from_the_centre_of_gravity_and_in_the_model_s_unit() -> None:
    """An aircraft whose model counts inches from its nose, with its centre 40 in behind that and 5 in above."""
    model = b"""<fdm_config>
    <mass_balance><location name="CG" unit="IN"><x>40</x><y>0</y><z>5</z></location></mass_balance>
    <ground_reactions>
    <contact type="BOGEY" name="N"><location unit="IN"><x>20</x><y>-10</y><z>-35</z></location></contact>
    </ground_reactions></fdm_config>"""
    (wheel,) = _model_contacts(model)
    assert (wheel.forward, wheel.right, wheel.down) == pytest.approx((20 * 0.0254, -10 * 0.0254, 40 * 0.0254))


def test_the_centre_of_gravity_is_that_of_the_loaded_aircraft_as_jsbsim_has_it() -> None:
    """A Cessna with its people, luggage and fuel: 11 cm further aft than empty, and 3 cm lower."""
    cessna = load_aircraft("c172x")
    fdm = Fdm(cessna)
    fdm.release((*START, 900.0), (0.0, 0.0, 0.0), (50.0, 0.0, 0.0))
    stated = [fdm.properties.getter(f"inertia/cg-{axis}-in")() * 0.0254 for axis in "xyz"]
    assert _center_of_gravity(cessna.model_file.read_bytes()) == pytest.approx(stated, abs=0.002)
    assert (stated[0] - 41.0 * 0.0254, 36.5 * 0.0254 - stated[2]) == pytest.approx((0.114, 0.027), abs=0.003)


def contact_xml(kind: str, name: str, forward: float, down: float) -> str:
    return (
        f'<contact type="{kind}" name="{name}">'
        f'<location unit="M"><x>{-forward}</x><y>0</y><z>{-down}</z></location></contact>'
    )


def test_a_model_with_skids_of_its_own_stands_on_its_lowest_points_and_one_with_wheels_on_those() -> None:
    """A nose 0.05 m deep is none of the skids at 0.2 and 0.16 m, which are none where there is a wheel."""
    skids = [("STRUCTURE", "nose", 0.6, 0.05), ("STRUCTURE", "front", 0.3, 0.2), ("STRUCTURE", "rear", -0.3, 0.16)]

    def standing(*contacts: tuple[str, str, float, float]) -> list[str]:
        text = "".join(contact_xml(*one) for one in contacts)
        model = f"<fdm_config><ground_reactions>{text}</ground_reactions></fdm_config>".encode()
        return [one.name for one in _model_contacts(model) if one.is_support]

    assert standing(*skids) == ["front", "rear"]
    assert standing(*skids, ("BOGEY", "wheel", 0.1, 0.3)) == ["wheel"]


@pytest.mark.parametrize(("name", "gear"), [("aerosonde", "belly"), ("zagi", "belly"), ("ultrastick25e", "wheels")])
@pytest.mark.parametrize("slope", [0.0, 0.08])
def test_an_aircraft_at_rest_stays_where_it_is(name: str, gear: Gear, slope: float) -> None:
    """On level ground, and on ground that is as high as a slope of 8 % makes it below the aircraft."""
    aircraft = load_aircraft(name)
    stands = max(one.down for one in find_contacts(aircraft, gear) if one.is_support)
    fdm = Fdm(aircraft, gear=gear)
    fdm.release((*START, 300.0 + stands), (0.0, 0.0, 0.5), (0.0, 0.0, 0.0), terrain_amsl=300.0)
    terrain = fdm.properties.setter("position/terrain-elevation-asl-ft")
    begin = float(fdm.read().latitude)
    for _ in range(180):
        terrain((300.0 + slope * (float(fdm.read().latitude) - begin) * 6.37e6) / 0.3048)
        fdm.step(2)
    state = fdm.read()
    assert abs(state.latitude - begin) * 6.37e6 < 0.02
    assert math.hypot(state.velocity_north, state.velocity_east, state.velocity_down) < 0.01
    # The weight presses it in by 0.6 % of the span.
    assert state.amsl - 300.0 == pytest.approx(stands - 0.0062 * aircraft.wing_span, abs=0.003 * aircraft.wing_span)
    assert abs(state.roll) < math.radians(2.0)


def test_in_the_air_contacts_change_nothing() -> None:
    aircraft = load_aircraft("aerosonde")
    states = []
    for gear in (None, "belly"):
        fdm = Fdm(aircraft, gear=gear)
        fdm.start(*START, 600.0, 0.3, 25.0, 0.02, (2.0, 1.0, 0.0), 300.0)
        fdm.step(240)
        states.append(fdm.read().tolist())
    assert states[0] == states[1]
