"""The small aircraft that come along: their files are made of the published numbers, and trim as was published."""

import math
from dataclasses import replace

import numpy as np
import pytest

from aircraft.catalog import load_aircraft
from aircraft.model_writer import model_xml
from benchmarks.tuning.published_aircraft import PUBLISHED
from flight.autopilots.arduplane.autopilot import ArduPlane
from flight.autopilots.arduplane.parameters import ArduPilotParameters
from flight.dynamics.characteristics import level_flight_modes
from flight.dynamics.fdm import Fdm
from flight.dynamics.trim import fastest_level_flight, linearise, slowest_level_flight, steady_flight
from flight.guidance.gains import load_gains
from flight.guidance.model_gains import gains_from_model
from flight.simulation.simulate import Flight, fly_to_end
from tests.setups import setup_maker

NAMES = sorted(PUBLISHED)


@pytest.mark.parametrize("name", NAMES)
def test_files_are_made_of_the_numbers(name: str) -> None:
    aircraft = load_aircraft(name)
    assert aircraft.model_file.read_text(encoding="utf-8") == model_xml(name, PUBLISHED[name])
    made, kept = gains_from_model(aircraft), load_gains(aircraft)
    for field in made.__dataclass_fields__:
        assert getattr(kept, field) == pytest.approx(getattr(made, field), rel=1e-3, abs=1e-9), field


@pytest.mark.parametrize("name", NAMES)
def test_speeds_are_those_of_its_trims(name: str) -> None:
    aircraft = load_aircraft(name)
    fdm = Fdm(aircraft)
    slow, fast = slowest_level_flight(fdm, 0.0), fastest_level_flight(fdm, 500.0)
    assert slow is not None
    assert fast is not None
    assert slow.airspeed == pytest.approx(aircraft.stall_speed, abs=0.1)
    assert aircraft.airspeed_max < fast.airspeed
    assert aircraft.airspeed_min > 1.1 * aircraft.stall_speed
    modes = {mode.name: mode for mode in level_flight_modes(aircraft, aircraft.airspeed)}
    assert modes["short period"].damping > 0.3
    assert modes["Dutch roll"].damping > 0.1


def test_the_ultra_stick_is_the_universitys() -> None:
    """UAV_trimcondition.mat, and the matrices of its linear model, at 17 m/s and 100 m; see the folder's README.md."""
    fdm = Fdm(load_aircraft("ultrastick25e"))
    trim = steady_flight(fdm, 17.0, 100.0)
    assert trim is not None
    assert trim.alpha == pytest.approx(0.0550619, rel=1e-3)
    assert trim.elevator == pytest.approx(-0.0971978, rel=1e-3)
    # Their torque rolls the other way.
    assert (trim.aileron, trim.rudder) == pytest.approx((0.0100394, -0.0031702), rel=5e-3)
    assert trim.throttle == pytest.approx(0.5694718, rel=3e-3)
    assert fdm.properties.getter("motor/propeller-rad_sec")() == pytest.approx(826.672, rel=2e-3)
    a, b = linearise(fdm, trim)
    v, w, p, q, r, elevator, aileron, rudder = 1, 2, 3, 4, 5, 0, 1, 2
    published = {
        (p, p): -16.09328,
        (p, r): 3.36733,
        (r, p): 0.514002,
        (r, r): -2.775022,
        (r, v): 1.701517,
        (q, q): -15.80737,
    }
    for at, value in published.items():
        assert a[at] == pytest.approx(value, rel=2e-3), at
    # A change of airspeed moves the propeller's speed at once here, with its inertia there.
    assert a[q, w] == pytest.approx(-7.404696, rel=5e-3)
    assert a[p, v] == pytest.approx(-2.823361, rel=0.03)
    assert b[q, elevator] == pytest.approx(-133.6905, rel=1e-3)
    assert b[r, rudder] == pytest.approx(-82.04106, rel=1e-3)
    # Both ailerons: 78.23 each.
    assert b[p, aileron] == pytest.approx(2.0 * 78.23494, rel=1e-3)


def test_the_x8_trims_as_its_source_does() -> None:
    # simX8.m: u 17.9914, w 0.5551 m/s, elevator 0.0370 rad, in air of 1.225 kg/m^3.
    trim = steady_flight(Fdm(load_aircraft("x8")), math.hypot(17.9914, 0.5551), 0.0)
    assert trim is not None
    assert trim.alpha == pytest.approx(math.atan2(0.5551, 17.9914), rel=2e-3)
    assert trim.elevator == pytest.approx(0.0370, abs=5e-5)


def test_the_x8_has_its_sources_drag() -> None:
    aero = PUBLISHED["x8"].aero
    for alpha in (-0.1, 0.0, 0.05, 0.2):
        lift = 0.08673556671610734 + 4.020328244000679 * alpha
        ours = aero.drag_min + aero.drag_lift * (lift - aero.lift_at_least_drag) ** 2
        assert ours == pytest.approx(0.01970001181915082 + 0.07909146315766297 * alpha + 1.0554699867680841 * alpha**2)


def test_the_zagi_is_the_books_equations() -> None:
    fdm = Fdm(load_aircraft("zagi"))
    trim = steady_flight(fdm, 15.0, 0.0)
    assert trim is not None
    pressure = 0.5 * 1.225 * 225.0 * 0.2589
    thrust = fdm.properties.getter("motor/thrust-n")()
    # Lift, pitching moment and drag of appendix E.1, and the disc's thrust.
    lift = 0.09167 + 3.5016 * trim.alpha + 0.2724 * trim.elevator
    weight = 1.56 * 9.80665
    assert pressure * lift + thrust * math.sin(trim.alpha) == pytest.approx(weight, rel=2e-3)
    assert -0.02338 - 0.5675 * trim.alpha - 0.3254 * trim.elevator == pytest.approx(0.0, abs=1e-6)
    drag = 0.0254 + (0.09167 + 3.5016 * trim.alpha) ** 2 / (math.pi * 0.9 * 1.4224**2 / 0.2589)
    assert thrust * math.cos(trim.alpha) == pytest.approx(pressure * drag, rel=2e-3)
    assert thrust == pytest.approx(0.5 * 1.225 * 0.0314 * ((20.0 * trim.throttle) ** 2 - 225.0), rel=2e-3)


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("law", ["planfly", "arduplane"])
def test_it_flies(name: str, law: str) -> None:
    aircraft = load_aircraft(name)
    way = np.array([[0.0, 0.0, 500.0], [0.0, 400.0, 510.0], [300.0, 650.0, 520.0]])
    setup = setup_maker(aircraft)(way, speeds=aircraft.airspeed, wind=(3.0, 60.0), turbulence="light", bank_deg=35.0)
    if law == "arduplane":
        setup = replace(setup, autopilot=ArduPlane(ArduPilotParameters.load(aircraft)))
    flown = fly_to_end(Flight(setup, aircraft))
    assert flown.ended == "completed"
    if law == "planfly":
        assert np.abs(flown.track.cross_track[300:]).max() < 3.0
