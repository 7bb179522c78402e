"""A metadata file's table of JSBSim properties: what it leaves out is ours, and each fault names its key."""

from typing import Any

import pytest

from aircraft.jsbsim_model import DEFAULT_MODEL, CommandProperty, Reading, read_model
from world.errors import FlightError

ORDER = ("elevator", "aileron", "rudder", "throttle")


def test_an_empty_table_is_our_own_models() -> None:
    assert read_model({}, "a") == DEFAULT_MODEL
    assert [command.name.removesuffix("-rad") for command in DEFAULT_MODEL.commands[:3]] == [
        f"command/{c}" for c in ORDER[:3]
    ]
    assert DEFAULT_MODEL.commands[3].name == "command/throttle-norm"
    assert len(DEFAULT_MODEL.readings) == 6


@pytest.mark.parametrize("k", range(4))
def test_a_command_replaces_its_own_and_no_other(k: int) -> None:
    model = read_model({"command": {ORDER[k]: ["fcs/stick", -2, 3.5]}}, "a")
    assert model.commands[k] == CommandProperty("fcs/stick", -2.0, 3.5)
    assert [model.commands[i] for i in range(4) if i != k] == [DEFAULT_MODEL.commands[i] for i in range(4) if i != k]
    assert model.readings == DEFAULT_MODEL.readings


@pytest.mark.parametrize(("k", "name"), list(enumerate((*ORDER, "current", "power"))))
def test_a_reading_replaces_its_own_and_an_empty_one_reads_as_zero(k: int, name: str) -> None:
    model = read_model({"reading": {name: ["fcs/pos", 0.5]}}, "a")
    assert model.readings[k] == Reading("fcs/pos", 0.5)
    assert [model.readings[i] for i in range(6) if i != k] == [DEFAULT_MODEL.readings[i] for i in range(6) if i != k]
    assert read_model({"reading": {name: []}}, "a").readings[k] == Reading("", 0.0)


def test_what_kind_of_model_it_is() -> None:
    model = read_model({"shipped_by_jsbsim": True}, "c172x")
    assert (model.shipped, model.settles) == ("c172x", False)
    # A folder of one's own has another name than the model of JSBSim's that it flies.
    assert read_model({"shipped_by_jsbsim": "c172x"}, "mine").shipped == "c172x"
    model = read_model({"engine_settles": True}, "c172x")
    assert (model.shipped, model.settles) == ("", True)


@pytest.mark.parametrize(
    ("table", "message"),
    [
        (None, r"^model = None is not a table$"),
        ({"b": 1, "a": 1}, r"^model: unknown key a, b$"),
        ({"command": []}, r"^model\.command = \[\] is not a table$"),
        ({"reading": {"flap": []}}, r"^model\.reading: unknown key flap$"),
        ({"command": {"elevator": []}}, r"^model\.command\.elevator = \[\] is not a property name and 2 number"),
        ({"command": {"elevator": ["a", 1]}}, r"^model\.command\.elevator = .* is not a property name and 2 number"),
        (
            {"command": {"elevator": ["a", 1, 1, 1]}},
            r"^model\.command\.elevator = .* is not a property name and 2 number",
        ),
        ({"command": {"elevator": ["", 1, 1]}}, r"^model\.command\.elevator = .* is not a property name and 2 number"),
        (
            {"command": {"elevator": ["a\tb", 1, 1]}},
            r"^model\.command\.elevator = .* is not a property name and 2 number",
        ),
        (
            {"command": {"elevator": ["\u00e4", 1, 1]}},
            r"^model\.command\.elevator = .* is not a property name and 2 number",
        ),
        ({"reading": {"power": ["a", 0.0]}}, r"^model\.reading\.power = .* is not a property name and 1 number"),
        (
            {"reading": {"power": ["a", float("nan")]}},
            r"^model\.reading\.power = .* is not a property name and 1 number",
        ),
        ({"reading": {"power": "ab"}}, r"^model\.reading\.power = 'ab' is not a property name and 1 number"),
        ({"shipped_by_jsbsim": 1}, r"^model\.shipped_by_jsbsim = 1 is not true, false or the name of a model"),
        ({"shipped_by_jsbsim": "../c172x"}, r"^model\.shipped_by_jsbsim = '\.\./c172x' is not true, false or"),
        ({"shipped_by_jsbsim": ""}, r"^model\.shipped_by_jsbsim = '' is not true, false or"),
        ({"engine_settles": 1}, r"^model\.engine_settles = 1 is not true or false$"),
    ],
)
def test_each_fault_begins_with_its_key(table: Any, message: str) -> None:
    with pytest.raises(FlightError, match=message) as caught:
        read_model(table, "a")
    assert "\n" not in str(caught.value)
