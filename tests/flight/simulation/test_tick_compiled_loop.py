"""Flights of the compiled model in the loops of all control laws are those in JSBSim, byte for byte."""

import math
from dataclasses import replace
from typing import Literal

import pytest

from aircraft.catalog import Aircraft, load_aircraft
from flight.autopilots.arduplane.autopilot import ArduPlane
from flight.autopilots.arduplane.parameters import ArduPilotParameters
from flight.autopilots.autopilot import Autopilot
from flight.autopilots.planfly.autopilot import PlanflyGuidance
from flight.autopilots.px4.autopilot import Px4
from flight.dynamics.compiled_model import CompiledModel
from flight.dynamics.fdm import Variation
from flight.simulation.setup import FlightSetup
from flight.simulation.simulate import Flight, fly_to_end
from flight.simulation.track import track_rows
from tests.flight.autopilots.arduplane.flown_grounds import circuit
from tests.setups import MakeSetup, standard
from tests.soak import SOAK
from world.airfield import LandingStrip, Launch
from world.scenario_tables import LaunchMethod

# Flown in turbulence and with position error, s.
SECONDS = 1200 if SOAK else 20
# As long as these seconds take.
WAY = standard(3500.0 if SOAK else 800.0)
STRIP = LandingStrip(500.0, 600.0, length=600.0)


def flown(setup: FlightSetup, aircraft: Aircraft, variation: Variation | None = None) -> tuple[str, bytes, bytes]:
    """Fly for some seconds; return the engine, all rows, and the whole state of the flight at its end."""
    flight = Flight(setup, aircraft, variation)
    rows, _ = flight.fly_block(SECONDS * setup.guidance_hz)
    assert len(rows) > 10 * setup.guidance_hz
    return flight.engine, rows.tobytes(), flight._workspace.block.tobytes()


def setup_with(make_setup: MakeSetup, autopilot: Autopilot, turbulence: str = "moderate") -> FlightSetup:
    made = make_setup(WAY, wind=(8.0, 250.0), turbulence=turbulence, seed=3)
    return replace(made, autopilot=autopilot, nav="gnss")


@pytest.mark.parametrize("name", ["planfly", "ardupilot", "px4"])
@pytest.mark.parametrize("fdm_hz", [120, 60])
def test_each_law_flies_the_same_in_both(
    name: str, fdm_hz: Literal[60, 120], make_setup: MakeSetup, aerosonde: Aircraft
) -> None:
    plain = make_setup(WAY)
    autopilots: dict[str, Autopilot] = {
        "planfly": PlanflyGuidance(),
        "ardupilot": ArduPlane(ArduPilotParameters.load(aerosonde)),
        "px4": Px4.load(plain.scenario.flight, aerosonde, "test"),
    }
    setup = replace(setup_with(make_setup, autopilots[name]), fdm_hz=fdm_hz)
    engine, *compiled = flown(setup, aerosonde)
    assert engine.startswith("compiled model, bit-identical to JSBSim ")
    chosen, *jsbsim = flown(replace(setup, engine="jsbsim"), aerosonde)
    assert chosen == "JSBSim, as requested"
    assert compiled == jsbsim


def test_a_calm_flight_of_another_aircraft_flies_the_same_in_both(make_setup: MakeSetup, aerosonde: Aircraft) -> None:
    """Nothing sets the gust in still air; and the aircraft differs from its model."""
    setup = replace(make_setup(WAY), guidance_hz=30)
    variation = Variation(mass=1.1, drag=1.2)
    _, *compiled = flown(setup, aerosonde, variation)
    _, *jsbsim = flown(replace(setup, engine="jsbsim"), aerosonde, variation)
    assert compiled == jsbsim


@pytest.mark.parametrize("method", ["catapult", "hand"])
def test_a_flight_from_the_ground_to_the_ground_flies_the_same_in_both(method: LaunchMethod) -> None:
    setup = circuit(Launch(method, math.radians(90.0), 20.0, 6.0, math.radians(12.0)), STRIP, wind=(2.0, 60.0))
    aircraft = load_aircraft("aerosonde")
    compiled, jsbsim = (Flight(replace(setup, engine=engine), aircraft) for engine in ("auto", "jsbsim"))
    assert (compiled.engine[:8], jsbsim.engine) == ("compiled", "JSBSim, as requested")
    found, expected = fly_to_end(compiled), fly_to_end(jsbsim)
    assert found.ended == expected.ended == "completed"
    assert float(found.track.airspeed[-1]) < 5.0
    assert track_rows(found.track).tobytes() == track_rows(expected.track).tobytes()
    assert compiled._workspace.block.tobytes() == jsbsim._workspace.block.tobytes()


def test_jsbsim_flies_a_takeoff_from_a_runway() -> None:
    flight = Flight(circuit(Launch("runway", math.radians(90.0)), None), load_aircraft("aerosonde"))
    assert flight.engine == "JSBSim, because the compiled model does not cover a start on the ground"


def test_jsbsim_flies_from_the_start_if_the_compiled_model_differs(
    make_setup: MakeSetup, aerosonde: Aircraft, monkeypatch: pytest.MonkeyPatch
) -> None:
    setup = setup_with(make_setup, PlanflyGuidance())
    _, *expected = flown(replace(setup, engine="jsbsim"), aerosonde)
    find = CompiledModel.find_differences

    def find_one(model: CompiledModel) -> list[str]:
        model.frames[0].wing_span *= 1.0 + 1e-15
        return find(model)

    monkeypatch.setattr(CompiledModel, "find_differences", find_one)
    engine, *found = flown(setup, aerosonde)
    assert engine == "JSBSim, because the compiled model differs from it in metrics/bw-ft"
    assert found == expected


def test_jsbsim_flies_what_is_not_covered(
    make_setup: MakeSetup, aerosonde: Aircraft, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("flight.dynamics.fdm.Fdm.model_text", lambda _: b"<fdm_config><system/></fdm_config>")
    flight = Flight(make_setup(WAY), aerosonde)
    assert flight.engine == "JSBSim, because the compiled model does not cover the section <system>"
