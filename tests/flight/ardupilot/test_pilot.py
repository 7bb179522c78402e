"""ArduPlane's law in flight: its airspeed with height, its bank's lag, its path, and what ArduPlane itself flew."""

import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from aircraft.catalog import Aircraft
from flight.ardupilot.parameters import ArduPilotParameters, load_parameters
from flight.ardupilot.pilot import ROLL_LAG, true_by_equivalent
from flight.mission_files.formats import parse_mission
from flight.simulation.simulate import Flight, simulate
from planfly.airframe import load_airframe
from planfly.pipeline import make_setup as setup_of
from tests.bench.against_arduplane import BINARY, compare, flown_figures
from tests.setups import MakeSetup
from tests.soak import SOAK
from world.scenario import from_spec

# What ArduPlane flew, written by `python -m tests.bench.against_arduplane --plans 3 --from 1001 --keep FILE`.
KEPT: list[dict[str, Any]] = json.loads(
    (Path(__file__).parents[2] / "authorities" / "arduplane_flights.json").read_text(encoding="utf-8")
)


@pytest.fixture(scope="module")
def usual(aerosonde: Aircraft) -> ArduPilotParameters:
    return load_parameters(aerosonde)


def test_true_airspeed_is_a_twentieth_more_at_a_thousand_metres() -> None:
    # Density of the standard atmosphere (ISO 2533): 1.2250 at sea level, 1.1117 at 1,000 m, 0.9093 at 3,000 m.
    for amsl, density in ((0.0, 1.2250), (1000.0, 1.1117), (3000.0, 0.9093)):
        assert true_by_equivalent(amsl) == pytest.approx(math.sqrt(1.2250 / density), rel=2e-4)


def test_it_holds_an_equivalent_airspeed(
    make_setup: MakeSetup, aerosonde: Aircraft, usual: ArduPilotParameters
) -> None:
    setup = make_setup([[0, 0, 2000.0], [0, 3000, 2000.0]], speeds=24.0)
    track = simulate(replace(setup, parameters=usual), aerosonde).track
    late = track.airspeed[track.time > 40.0]
    # Standard density at 2,000 m: 1.0066.
    assert float(late.mean()) == pytest.approx(24.0 * math.sqrt(1.2250 / 1.0066), rel=0.005)
    assert track.speed_command[-1] == pytest.approx(24.0 * math.sqrt(1.2250 / 1.0066), rel=0.001)


def test_a_climbing_leg_is_flown_a_time_constant_low(
    make_setup: MakeSetup, aerosonde: Aircraft, usual: ArduPilotParameters
) -> None:
    # 120 m in 3 km: 1 m/s of climb.
    setup = make_setup([[0, 0, 500.0], [0, 3000, 620.0]])
    for time in (1.0, 3.0):
        track = simulate(replace(setup, parameters=usual.changed(TECS_HDEM_TCONST=time)), aerosonde).track
        late = (track.time > 50.0) & (track.time < 100.0)
        climb = float(track.velocity[late, 2].mean())
        assert float(track.height_error[late].mean()) == pytest.approx(-time * climb, abs=0.15)


def test_bank_follows_its_demand_late(make_setup: MakeSetup, aerosonde: Aircraft, usual: ArduPilotParameters) -> None:
    setup = make_setup([[0, 0, 500.0], [0, 1000, 500.0], [1000, 1600, 500.0]])
    flight = Flight(replace(setup, parameters=usual), aerosonde)
    demanded, flown = [], []
    for _ in range(60 * 70):
        rows, ended = flight.block(1)
        if ended:
            break
        demanded.append(float(flight._work.ardupilot.roll_demand))
        flown.append(float(rows["attitude"][-1][0]))
    lag = round(ROLL_LAG * usual.roll_time * 60)

    # A ramp is followed by its lag, and most of a turn is one.
    def apart(ticks: int) -> float:
        return float(np.abs(np.array(demanded[: -ticks or None]) - np.array(flown[ticks:])).mean())

    best = min(range(60), key=apart)
    assert best == pytest.approx(lag, abs=0.12 * 60)
    assert math.degrees(max(flown)) < 31.0


def test_bank_keeps_roll_limit_deg(make_setup: MakeSetup, aerosonde: Aircraft, usual: ArduPilotParameters) -> None:
    setup = make_setup([[0, 0, 500.0], [0, 1000, 500.0], [1000, 1000, 500.0]])
    for limit in (20.0, 35.0):
        track = simulate(replace(setup, parameters=usual.changed(ROLL_LIMIT_DEG=limit)), aerosonde).track
        assert math.degrees(float(np.abs(track.attitude[:, 0]).max())) == pytest.approx(limit, abs=0.5)


def test_a_wider_radius_turns_earlier(make_setup: MakeSetup, aerosonde: Aircraft, usual: ArduPilotParameters) -> None:
    setup = make_setup([[0, 0, 500.0], [0, 1000, 500.0], [1000, 1000, 500.0]])
    past = []
    for radius in (20.0, 60.0, 90.0):
        track = simulate(replace(setup, parameters=usual.changed(WP_RADIUS=radius)), aerosonde).track
        past.append(float(track.position[:, 1].max()) - 1000.0)
    # Each metre of radius is a metre less overshot.
    assert past[0] - past[1] == pytest.approx(40.0, abs=6.0)
    assert past[1] - past[2] == pytest.approx(30.0, abs=6.0)


def test_the_same_setup_gives_the_same_flight(
    make_setup: MakeSetup, aerosonde: Aircraft, usual: ArduPilotParameters
) -> None:
    setup = replace(
        make_setup([[0, 0, 500.0], [0, 800, 520.0], [800, 1000, 500.0]], wind=(6.0, 200.0), turbulence="moderate"),
        parameters=usual, nav="gnss",
    )  # fmt: skip
    first, second = (simulate(setup, aerosonde) for _ in range(2))
    assert first.ended == "completed"
    assert np.array_equal(first.track.position, second.track.position)


@pytest.mark.parametrize("kept", KEPT, ids=[str(kept["seed"]) for kept in KEPT])
def test_it_flies_as_arduplane_flew(kept: dict[str, Any]) -> None:
    scenario = from_spec(kept["scenario"], "kept")
    airframe = load_airframe(scenario)
    setup = setup_of(scenario, airframe, parse_mission(kept["mission"], "kept.waypoints"), kept["seed"])
    law = simulate(setup, airframe.aircraft)
    ours, real = flown_figures(setup, law.track, law.ended), kept["real"]
    assert ours.ended == real["ended"] == "completed"
    assert ours.clearance == pytest.approx(real["clearance"], abs=3.0)
    ratios = [mine.overshoot / its["overshoot"] for mine, its in zip(ours.corners, real["corners"], strict=True)]
    assert all(0.8 < ratio < 1.25 for ratio in ratios), ratios


@pytest.mark.client
@pytest.mark.skipif(not BINARY.exists(), reason="PLANFLY_ARDUPLANE names no ArduPlane")
@pytest.mark.skipif(not SOAK, reason="beside flights that are kept of it, above: in make soak")
def test_it_flies_as_arduplane_flies() -> None:
    compared, _ = compare(7001)
    assert compared.law.ended == compared.real.ended == "completed"
    assert compared.law.clearance == pytest.approx(compared.real.clearance, abs=3.0)
    assert compared.apart_across[0] < 2.0
    assert compared.apart_up[0] < 4.0
