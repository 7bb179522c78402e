"""An aircraft that touches the ground, slides and comes to rest does so as in JSBSim, to the last bit."""

import math

import numpy as np
import pytest

from aircraft.catalog import load_aircraft
from aircraft.contacts import Gear
from flight.dynamics.compiled_frame import step_repeatedly
from flight.dynamics.compiled_model import CompiledModel
from flight.dynamics.fdm import Fdm
from flight.dynamics.ground_contact import MAX_CONTACTS
from flight.dynamics.model_program import UnsupportedModel
from flight.simulation.tick import READ_FIELDS
from tests.soak import SOAK

# Of flight and sliding, s.
SECONDS = 25.0 if SOAK else 5.0
GROUND_AMSL = 300.0


def begun(
    name: str = "aerosonde", gear: Gear = "belly", *, height: float = 1.6, hz: int = 120
) -> tuple[Fdm, CompiledModel]:
    """Release an aircraft above the ground, sinking, with a little bank."""
    fdm = Fdm(load_aircraft(name), rate_hz=hz, gear=gear)
    fdm.release(
        (36.25, -84.14, GROUND_AMSL + height),
        (0.02, 0.05, 1.0),
        (8.0, 14.0, 0.6),
        wind=(1.0, 2.0, 0.0),
        terrain_amsl=GROUND_AMSL,
        commands=(0.0, 0.0, 0.0, 0.1),
    )
    return fdm, CompiledModel(fdm, READ_FIELDS, 2, gusts=True, terrain=True)


@pytest.mark.parametrize("name", ["aerosonde", "zagi", "x8", "ultrastick25e"] if SOAK else ["aerosonde"])
@pytest.mark.parametrize("gear", ["belly", "wheels"])
def test_every_step_on_the_ground_equals_jsbsims(name: str, gear: Gear) -> None:
    fdm, model = begun(name, gear)
    pressed = 0
    for step in range(round(SECONDS / fdm.dt)):
        fdm.step()
        step_repeatedly(*model.arrays, 1)
        assert model.differing_properties() == [], step
        pressed += int((model.contacts["compression"] != 0.0).sum())
    # On two contacts or more, most of the time.
    assert pressed > 2 * 0.8 * SECONDS / fdm.dt
    assert model.frames[0].geodetic_altitude - model.frames[0].terrain < 3.0


def test_friction_brings_the_aircraft_to_rest() -> None:
    """By the dynamic friction of a belly on grass, 0.4: from 16 m/s in 4.1 s."""
    _, model = begun()
    step_repeatedly(*model.arrays, 120 * 6)
    assert np.linalg.norm(model.frames[0].ground_velocity) < 0.5
    assert np.abs(model.contacts["friction"]).max() > 0.0


@pytest.mark.parametrize("field", ["spring", "damping", "dynamic_friction"])
def test_the_last_bit_of_a_contact_is_noticed(field: str) -> None:
    _, model = begun(height=20.0)
    for contact in range(len(model.contacts)):
        model.contacts[contact][field] = np.nextafter(model.contacts[contact][field], math.inf)
    assert model.find_differences()


def test_the_proof_leaves_the_contacts_as_they_were() -> None:
    _, model = begun(height=20.0)
    before = model.contacts.copy()
    assert model.find_differences() == []
    np.testing.assert_array_equal(model.contacts, before)


def test_a_start_on_the_ground_is_not_covered() -> None:
    with pytest.raises(UnsupportedModel, match="start on the ground"):
        begun(height=0.1)


def test_no_more_contacts_than_the_kernel_has_room_for(monkeypatch: pytest.MonkeyPatch) -> None:
    points = b"".join(
        b'<contact type="STRUCTURE" name="p"><location unit="M"><x>0</x><y>0</y><z>0</z></location>'
        b"<static_friction>1</static_friction><dynamic_friction>1</dynamic_friction>"
        b"<rolling_friction>0</rolling_friction><spring_coeff unit='N/M'>1</spring_coeff>"
        b"<damping_coeff unit='N/M/SEC'>1</damping_coeff></contact>"
        for _ in range(MAX_CONTACTS + 1)
    )
    model = load_aircraft("aerosonde").model_file.read_bytes()
    full = model.replace(b"<ground_reactions/>", b"<ground_reactions>" + points + b"</ground_reactions>")
    monkeypatch.setattr(Fdm, "model_text", lambda _: full)
    with pytest.raises(UnsupportedModel, match="17 contacts"):
        begun()
