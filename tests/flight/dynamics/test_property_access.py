"""Properties are looked for before they are asked for, and commands count as their model counts them."""

from pathlib import Path

import pytest

from aircraft.jsbsim_model import CommandProperty
from flight.dynamics.property_access import PropertyAccess
from world.errors import FlightError


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
    message = r"^own/own\.xml: property side is needed and not defined$"
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
    access.set_optional("braking", 0.0, usual=0.0)
    assert "braking" not in manager.nodes
    with pytest.raises(FlightError, match="property braking is needed"):
        access.set_optional("braking", 1.0, usual=0.0)
    # Where it stands, the usual value is set too: the model may have another.
    access.set_optional("speed", 1.0, usual=1.0)
    assert manager.nodes["speed"].value == 1.0
