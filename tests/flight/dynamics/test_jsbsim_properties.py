"""Units by the properties' own names and by the international yard and pound, and JSBSim's word for it."""

import math
from pathlib import Path
from typing import Any

import jsbsim
import pytest

from aircraft.jsbsim_model import CommandProperty
from flight.dynamics.jsbsim_properties import (
    FLAT_DENSITY,
    FLAT_PLANET,
    FOOT,
    GUST,
    HEIGHT,
    IC_MOTION,
    IC_POSITION,
    MODEL_FIELDS,
    POUND,
    RATE_FACTORS,
    RATES,
    SLUG_FT3,
    STATE_PROPERTIES,
    TERRAIN,
    WIND,
    PropertyAccess,
)
from flight.dynamics.state import STATE
from world.errors import FlightError
from world.kernels import field_names
from world.silent_output import silence


def _in_feet(name: str) -> bool:
    """Whether a property's name says that it counts feet."""
    return name.rsplit("-", 1)[-1] in {"ft", "fps", "ft_sec2"}


@pytest.fixture(scope="module")
def bare() -> Any:
    with silence():
        instance = jsbsim.FGFDMExec(None)
        instance.set_debug_level(0)
    return instance


def test_a_foot_a_pound_and_a_slug_are_what_they_are_defined_as() -> None:
    # International yard and pound, 1959; a slug is a pound force second^2 a foot, with standard gravity.
    assert FOOT == 0.9144 / 3
    assert POUND == 0.45359237
    assert pytest.approx(POUND * 9.80665 / 0.3048 / 0.3048**3, rel=1e-12) == SLUG_FT3


def test_every_factor_is_that_of_the_unit_in_the_name() -> None:
    for name, factor in STATE_PROPERTIES.values():
        assert factor == (FOOT if _in_feet(name) else 1.0), name
    assert RATE_FACTORS.tolist() == [FOOT if _in_feet(name) else 1.0 for name in RATES]


def test_each_field_of_the_state_has_one_property() -> None:
    assert set(STATE_PROPERTIES) | set(MODEL_FIELDS) == set(field_names(STATE))
    assert not set(STATE_PROPERTIES) & set(MODEL_FIELDS)
    properties = [name for name, _ in STATE_PROPERTIES.values()]
    assert len(set(properties)) == len(properties)


def test_jsbsim_knows_every_property(bare: Any) -> None:
    manager = bare.get_property_manager()
    names = [name for name, _ in STATE_PROPERTIES.values()]
    for name in (*names, *WIND, *GUST, *IC_POSITION, *IC_MOTION, *RATES, TERRAIN, HEIGHT):
        assert manager.hasNode(name), name


def test_directions_stand_in_the_order_north_east_down() -> None:
    for names in (WIND, GUST):
        assert [name.split("-")[-2] for name in names] == ["north", "east", "down"]
    for k, axis in enumerate(("north", "east", "down")):
        assert f"v-{axis}-" in STATE_PROPERTIES[f"velocity_{axis}"][0]
        assert f"wind-{axis}-" in STATE_PROPERTIES[f"wind_{axis}"][0]
        assert IC_MOTION[3 + k] == f"ic/v{axis[0]}-fps"


def test_the_flat_planet_has_the_books_gravity_and_density() -> None:
    # Beard and McLain, appendix E.2: 9.81 m/s^2 (GM / r^2 at the surface) and 1.2682 kg/m^3.
    values = {
        tag: float(FLAT_PLANET.split(f"<{tag}", 1)[1].split(">", 1)[1].split("<", 1)[0])
        for tag in ("semimajor_axis", "semiminor_axis", "rotation_rate", "GM", "J2")
    }
    assert values["GM"] / values["semimajor_axis"] ** 2 == pytest.approx(9.81)
    assert values["semimajor_axis"] == values["semiminor_axis"]
    assert (values["rotation_rate"], values["J2"]) == (0.0, 0.0)
    assert FLAT_DENSITY == 1.2682
    # 10 km on it bend by less than 6 cm.
    assert math.hypot(values["semimajor_axis"], 1e4) - values["semimajor_axis"] < 0.06


# ----------------------------------------------------------------------
# Properties are looked for before they are asked for, and commands count as their model counts them.


class FakeNode:
    def __init__(self, value: float) -> None:
        self.value = value

    def get_double_value(self) -> float:
        return self.value

    def set_double_value(self, value: float) -> None:
        self.value = value


class FakeManager:
    """Like JSBSim's: a node that is asked for is made."""

    def __init__(self, **values: float) -> None:
        self.nodes = {name: FakeNode(value) for name, value in values.items()}

    def hasNode(self, name: str) -> bool:
        return name in self.nodes

    def get_node(self, name: str) -> FakeNode:
        return self.nodes.setdefault(name, FakeNode(0.0))


@pytest.fixture
def manager() -> FakeManager:
    return FakeManager(speed=5.0, stick=0.0)


@pytest.fixture
def access(manager: FakeManager) -> PropertyAccess:
    return PropertyAccess(manager, Path("own/own.xml"))


def test_a_getter_reads_what_stands_there_now(manager: FakeManager, access: PropertyAccess) -> None:
    speed = access.getter("speed")
    assert speed() == 5.0
    manager.nodes["speed"].value = 6.0
    assert speed() == 6.0


def test_what_an_aircraft_does_not_have_reads_as_zero(access: PropertyAccess) -> None:
    assert access.getter("")() == 0.0


def test_a_property_that_is_not_defined_is_refused_and_not_made(manager: FakeManager, access: PropertyAccess) -> None:
    message = r"^own/own\.xml: the model does not define the property side, which planfly needs$"
    for ask in (access.getter, access.setter, lambda name: access.set(name, 1.0)):
        with pytest.raises(FlightError, match=message):
            ask("side")
    with pytest.raises(FlightError, match=message):
        access.command_setter(CommandProperty("side", 1.0, 1.0))
    assert set(manager.nodes) == {"speed", "stick"}


def test_setters_set(manager: FakeManager, access: PropertyAccess) -> None:
    access.setter("speed")(7.0)
    assert manager.nodes["speed"].value == 7.0
    access.set("speed", 8.0)
    assert manager.nodes["speed"].value == 8.0


@pytest.mark.parametrize(("value", "wanted"), [(0.5, 1.0), (-0.5, 2.0), (0.0, 0.0)])
def test_a_stick_has_a_factor_for_each_side(
    manager: FakeManager, access: PropertyAccess, value: float, wanted: float
) -> None:
    access.command_setter(CommandProperty("stick", 2.0, -4.0))(value)
    assert manager.nodes["stick"].value == wanted
    access.command_setter(CommandProperty("stick", 1.0, 1.0))(value)
    assert manager.nodes["stick"].value == value


def test_an_optional_property_is_needed_only_for_an_unusual_value(manager: FakeManager, access: PropertyAccess) -> None:
    access.set_optional("braking", 0.0, default=0.0)
    assert "braking" not in manager.nodes
    with pytest.raises(FlightError, match="does not define the property braking"):
        access.set_optional("braking", 1.0, default=0.0)
    # Where it stands, the usual value is set too: the model may have another.
    access.set_optional("speed", 1.0, default=1.0)
    assert manager.nodes["speed"].value == 1.0
