"""Units by the properties' own names and by the international yard and pound, and JSBSim's word for it."""

import math
from typing import Any

import jsbsim
import pytest

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
)
from flight.dynamics.silence import silence
from flight.dynamics.state import STATE
from world.kernels import field_names


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
