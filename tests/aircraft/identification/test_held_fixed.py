"""What a base leaves out is not certain for that: its doubt is the Aerosonde's at least."""

from dataclasses import replace
from typing import Any

import pytest

from aircraft.catalog import load_aircraft
from aircraft.identification.base_model import BaseModel
from aircraft.identification.held_fixed import HELD_FIXED
from planfly.identification.base_numbers import base_model

# Half, or all, of what Beard and McLain have for the Aerosonde (table E.2).
LEAST = {
    "side force of the rudder": ("side_rudder", 0.5 * 0.19),
    "side force of the ailerons": ("side_aileron", 0.075),
    "roll of the rudder": ("roll_rudder", 0.0024),
}


def changed(title: str, base: BaseModel) -> BaseModel:
    (held,) = (held for held in HELD_FIXED if held.name.startswith(title))
    signals: Any = None
    return held.change(signals, base)[1]


@pytest.mark.parametrize("title", LEAST)
def test_a_coefficient_of_0_is_in_doubt(title: str) -> None:
    name, least = LEAST[title]
    base = base_model(load_aircraft("aerosonde"))
    for value, expected in ((0.0, least), (1e-6, 1e-6 + least)):
        flat = replace(base, coefficients=replace(base.coefficients, **{name: value}))
        assert getattr(changed(title, flat).coefficients, name) == pytest.approx(expected)
    # A large one by its share.
    large = replace(base, coefficients=replace(base.coefficients, **{name: -1.0}))
    share = 1.5 if name == "side_rudder" else 2.0
    assert getattr(changed(title, large).coefficients, name) == pytest.approx(-share)


def test_no_product_of_inertia_is_in_doubt() -> None:
    base = replace(base_model(load_aircraft("aerosonde")), inertia=(1.0, 2.0, 4.0, 0.0))
    assert changed("product of inertia", base).inertia == pytest.approx((1.0, 2.0, 4.0, 0.1))
