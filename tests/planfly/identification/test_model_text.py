"""The written model does what the parameters say, as JSBSim flies it."""

import re
from pathlib import Path

import numpy as np
import pytest

from aircraft.catalog import Aircraft, load_aircraft, read_aircraft
from aircraft.identification.parameters import INDEX, PARAMETERS, prior_means
from flight.dynamics.fdm import Fdm
from flight.dynamics.trim import steady_flight
from planfly.identification.base_numbers import _Probe, base_model, scale_base_model
from planfly.identification.model_text import check_base, format_identified_model
from tests.instrumented_flights import Truth, changed_aerosonde
from tests.instrumented_wings import MASS, changed_wing
from world.errors import FlightError

BASE = load_aircraft("aerosonde")
FACTORS = {
    "lift-slope": "lift_alpha",
    "zero-lift-drag": "drag_zero",
    "induced-drag": "drag_induced",
    "pitch-stiffness": "pitch_alpha",
    "pitch-damping": "pitch_rate",
    "elevator-power": "pitch_elevator",
    "dihedral-effect": "roll_beta",
    "roll-damping": "roll_roll",
    "roll-from-yaw": "roll_yaw",
    "aileron-power": "roll_aileron",
    "weathercock": "yaw_beta",
    "yaw-from-roll": "yaw_roll",
    "yaw-damping": "yaw_yaw",
    "adverse-yaw": "yaw_aileron",
    "rudder-power": "yaw_rudder",
}


def written(place: Path, values: np.ndarray, mass: float = 11.0, area: float = BASE.wing_area) -> Aircraft:
    folder = place / "mine"
    folder.mkdir()
    numbers = scale_base_model(base_model(BASE), mass, BASE.wing_span, area)
    (folder / "mine.xml").write_text(format_identified_model(BASE, "mine", numbers, values), encoding="utf-8")
    text = (BASE.folder / "aerosonde.toml").read_text(encoding="utf-8").replace("mass_kg = 11.0", f"mass_kg = {mass}")
    text = text.replace("wing_area_m2 = 0.55", f"wing_area_m2 = {area}")
    (folder / "mine.toml").write_text(text, encoding="utf-8")
    return read_aircraft(folder)


def test_every_factor_and_offset_is_in_the_model(tmp_path: Path) -> None:
    values = prior_means() + 0.02 * np.arange(1, len(PARAMETERS) + 1)
    found = _Probe(written(tmp_path, values)).coefficients()
    for name, field in FACTORS.items():
        expected = values[INDEX[name]] * getattr(base_model(BASE).coefficients, field)
        assert getattr(found, field) == pytest.approx(expected, rel=2e-3), name
    assert found.lift_zero == pytest.approx(0.23 + values[INDEX["lift-offset"]], rel=1e-3)
    assert found.pitch_zero == pytest.approx(0.0135 + values[INDEX["pitch-offset"]], rel=1e-3)


def test_a_stubbier_wing_has_the_induced_drag_of_its_aspect_ratio(tmp_path: Path) -> None:
    """1.5 times the area at the same span: 1.5 times the base's own 0.0232 of CL^2, and 1.2 times that as estimated."""
    values = prior_means()
    values[INDEX["induced-drag"]] = 1.2
    found = _Probe(written(tmp_path, values, area=1.5 * BASE.wing_area)).coefficients()
    assert found.drag_induced == pytest.approx(1.2 * 1.5 * base_model(BASE).coefficients.drag_induced, rel=2e-3)
    assert found.drag_zero == pytest.approx(0.043, rel=2e-3)


def test_at_the_prior_it_is_the_base_trim_for_trim(tmp_path: Path) -> None:
    own, base = steady_flight(Fdm(written(tmp_path, prior_means())), 25.0, 500.0), steady_flight(Fdm(BASE), 25.0, 500.0)
    assert own is not None
    assert base is not None
    assert own.vector() == pytest.approx(base.vector(), abs=1e-6)


def test_motor_and_propeller_are_those_of_a_model_edited_by_hand(tmp_path: Path) -> None:
    truth = Truth(thrust=0.8, motor_speed=1.08, propeller_torque=1.15, mass=1.2)
    values = prior_means()
    for name in ("thrust", "motor-speed", "propeller-torque"):
        values[INDEX[name]] = truth.parameters()[name]
    trims = [
        steady_flight(Fdm(aircraft), 25.0, 500.0)
        for aircraft in (written(tmp_path, values, 13.2), changed_aerosonde(tmp_path / "edited", truth))
    ]
    one, other = trims
    assert one is not None
    assert other is not None
    assert one.vector() == pytest.approx(other.vector(), abs=1e-5)


@pytest.mark.parametrize("name", ["x8", "zagi"])
def test_a_wing_is_the_wing_edited_by_hand(tmp_path: Path, name: str) -> None:
    base = load_aircraft(name)
    truth = {
        "zero-lift-drag": 1.2,
        "induced-drag": 0.8,
        "thrust": 1.1,
        "motor-speed": 1.05,
        "propeller-torque": 1.15,
        "lift-slope": 1.1,
        "pitch-stiffness": 0.9,
        "elevator-power": 1.2,
        MASS: 1.1,
    }
    edited = changed_wing(base, tmp_path / "edited", truth)
    values = prior_means()
    for key, value in truth.items():
        if key != MASS:
            values[INDEX[key]] = value
    numbers = scale_base_model(base_model(base), edited.mass, base.wing_span, base.wing_area)
    folder = tmp_path / "mine"
    folder.mkdir()
    (folder / "mine.xml").write_text(format_identified_model(base, "mine", numbers, values), encoding="utf-8")
    (folder / "mine.toml").write_text((edited.folder / "edited.toml").read_text(encoding="utf-8"), encoding="utf-8")
    for climb in (0.0, 0.05):
        trims = []
        for aircraft in (edited, read_aircraft(folder)):
            fdm = Fdm(aircraft)
            found = steady_flight(fdm, base.airspeed, 500.0, climb)
            assert found is not None
            fdm.apply_trim(found.vector())
            trims.append([*found.vector(), fdm.read().power])
        assert trims[1] == pytest.approx(trims[0], rel=1e-4, abs=1e-5)


def test_a_draw_is_a_set_of_properties(tmp_path: Path) -> None:
    fdm = Fdm(written(tmp_path, prior_means()))
    fdm.properties.set("ident/thrust", 0.8)
    weaker = steady_flight(fdm, 25.0, 500.0)
    assert weaker is not None
    base = steady_flight(Fdm(BASE), 25.0, 500.0)
    assert base is not None
    assert weaker.throttle > base.throttle + 0.02
    power = fdm.read().power
    fdm.properties.set("ident/drive-power", 1.5)
    fdm.apply_trim(weaker.vector())
    assert fdm.read().power == pytest.approx(1.5 * power, rel=1e-6)


@pytest.mark.parametrize(
    ("cut", "said"),
    [
        (r"<ixz.*?</ixz>", "no <mass_balance><ixz>"),
        (r"<flight_control.*</flight_control>", "no <flight_control>"),
        (r"<external_reactions>.*</external_reactions>", "no <external_reactions>"),
    ],
)
def test_a_base_whose_model_lacks_a_part_is_refused_in_one_line(tmp_path: Path, cut: str, said: str) -> None:
    own = changed_aerosonde(tmp_path / "own", Truth())
    check_base(own)
    text = own.model_file.read_text(encoding="utf-8")
    own.model_file.write_text(re.sub(cut, "", text, flags=re.DOTALL), encoding="utf-8")
    with pytest.raises(FlightError) as refused:
        check_base(own)
    assert f"own.xml: {said}: " in str(refused.value)
    assert "\n" not in str(refused.value)
