"""The mission of a flight of the field, flown again by the model of its aircraft."""

from dataclasses import replace

from flight.dynamics.envelope_tables import load_envelope
from flight.simulation.flight_setup import FlightSetup, make_limits
from flight.simulation.simulate import simulate
from flight.simulation.track import Track
from logs.verdict.field.flown_legs import FlownLegs, flown_legs
from logs.verdict.field.model_comparison import Reflight, compare_with_model
from planfly.airframe import find_airframe
from planfly.pipeline import Advance
from world.errors import LogError
from world.scenario_variants import with_flight, with_wind


def fly_again(
    setup: FlightSetup, track: Track, aircraft: str | None, turbulence: str | None, advance: Advance, most: int = 9
) -> tuple[Reflight, ...]:
    """Fly the legs of every stretch again, in the wind of the log, and hold the flights side by side: longest first.

    setup: with its source.  aircraft: that flies it, in place of the setup's.  turbulence: in place of the scenario's.
    most: of the stretches, the longest.

    Raises LogError for a flight that followed none of its mission, and StartError where the model cannot begin.
    """
    return tuple(_one_again(setup, legs, aircraft, turbulence, advance) for legs in _stretches(setup, track)[:most])


def _one_again(
    setup: FlightSetup, legs: FlownLegs, aircraft: str | None, turbulence: str | None, advance: Advance
) -> Reflight:
    scenario = with_wind(with_flight(setup.scenario, aircraft=aircraft), None, None, turbulence)
    model, battery = find_airframe(scenario)
    limits = setup.limits
    if model.name != setup.aircraft:
        envelope = load_envelope(model, motor_braking=scenario.flight.motor_braking)
        limits = make_limits(scenario, envelope, setup.airspeed, min(setup.max_bank, envelope.max_bank))
    own = replace(
        legs.demands.setup,
        scenario=scenario,
        limits=limits,
        aircraft=model.name,
        battery=battery,
        source=None,
        nav="perfect",
    )

    def report(done: float, whole: float) -> None:
        advance(done, whole, f"{done / 1000:.1f} of {whole / 1000:.1f} km")

    flown = simulate(own, model, progress=report)
    if len(flown.track) < 2:
        raise LogError(f"{scenario.name}: {model.name} flew none of the mission: {flown.ended}", file=scenario.name)
    stands_in = setup.source is not None and not setup.source.aircraft_known and aircraft is None
    return compare_with_model(own, legs, flown.track, flown.ended, stands_in=stands_in)


def _stretches(setup: FlightSetup, track: Track) -> list[FlownLegs]:
    source = setup.source
    stretches = () if source is None else source.stretches
    found = [legs for stretch in stretches if (legs := flown_legs(setup, track, stretch)) is not None]
    if not found:
        name = "the log" if source is None else source.file
        raise LogError(f"{name}: none of its mission's legs was flown: there is nothing to fly again", file=name)
    return sorted(found, key=lambda legs: legs.first - legs.last)
