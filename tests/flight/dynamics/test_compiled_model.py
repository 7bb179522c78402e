"""The compiled model steps as JSBSim does, to the last bit, and a difference is noticed."""

import math
from pathlib import Path

import numpy as np
import pytest

from aircraft.catalog import Aircraft, load_aircraft
from aircraft.data_sheet import DataSheet
from aircraft.model_writer import Layout
from flight.dynamics.compiled_frame import FCS_START, step_repeatedly
from flight.dynamics.compiled_model import CompiledModel
from flight.dynamics.fdm import Fdm, Variation
from flight.dynamics.instructions import Operation
from flight.dynamics.jsbsim_properties import GUST
from flight.dynamics.model_program import UnsupportedModel, frame_register
from flight.simulation.tick import READ_FIELDS
from planfly.workflow.data_sheets import make_data_sheet_folder
from tests.soak import SOAK

# Of flight, s.
SECONDS = 1200.0 if SOAK else 10.0
# JSBSim steps per second.
HZ = 120
STEPS = 2


def begun(aircraft: Aircraft, hz: int = HZ, variation: Variation | None = None) -> tuple[Fdm, CompiledModel]:
    fdm = Fdm(aircraft, rate_hz=hz, variation=variation)
    fdm.start(36.25, -84.14, 485.0, 1.0, aircraft.airspeed, 0.0, (1.0, 2.0, 0.0), 300.0)
    return fdm, CompiledModel(fdm, READ_FIELDS, STEPS, gusts=True, terrain=True)


def begun_aerosonde() -> tuple[Fdm, CompiledModel]:
    return begun(load_aircraft("aerosonde"))


def first_difference(fdm: Fdm, model: CompiledModel, seconds: float) -> tuple[int, list[str]] | None:
    """Fly both with doublets, sines and white gusts, and return the first tick with a difference, and in what."""
    random, rate = np.random.default_rng(3), 1.0 / (STEPS * fdm.dt)
    names = [command.name for command in fdm.aircraft.model.commands]
    trimmed = [fdm.properties.read(name) for name in names]
    for tick in range(round(seconds * rate)):
        time = tick / rate
        moves = [0.02 * math.sin(0.7 * time), 0.02 * math.sin(1.1 * time), 0.02 * math.sin(1.3 * time)]
        moves.append(0.1 * math.sin(0.2 * time))
        if int(time) % 7 == 3:
            moves[0] += math.copysign(0.05, 0.5 - time % 1.0)
        if int(time) % 11 == 5:
            moves[1] += math.copysign(0.1, 0.5 - time % 1.0)
        values = [*(before + move for before, move in zip(trimmed, moves, strict=True)), *random.normal(0.0, 2.0, 3)]
        for name, value in zip([*names, *GUST], values, strict=True):
            fdm.properties.set(name, value)
            model.numbers[model.properties[name]] = value
        fdm.step(STEPS)
        step_repeatedly(*model.arrays, STEPS)
        if found := model.differing_properties():
            return tick, found
    return None


@pytest.mark.parametrize("name", ["aerosonde", "zagi", "ultrastick25e", *(["x8"] if SOAK else [])])
@pytest.mark.parametrize("hz", [120, 60] if SOAK else [120])
def test_every_tick_equals_jsbsims(name: str, hz: int) -> None:
    fdm, model = begun(load_aircraft(name), hz)
    assert first_difference(fdm, model, SECONDS) is None
    # In the 20 minutes of a soak an open-loop flight may descend without end; there is no ground below it.
    assert SOAK or fdm.properties.read("position/h-sl-ft") > 1000.0


@pytest.mark.skipif(not SOAK, reason="takes seconds to make an aircraft: in make soak")
@pytest.mark.parametrize("layout", ["wing", "tail"])
@pytest.mark.parametrize("mass", [0.9, 2.1, 6.0])
def test_every_tick_of_an_aircraft_from_a_data_sheet_equals_jsbsims(
    layout: Layout, mass: float, tmp_path: Path
) -> None:
    span = 1.25 * mass ** (1.0 / 3.0)
    aircraft = make_data_sheet_folder(
        tmp_path / "own", DataSheet(mass=mass, span=span, cruise=15.0, stall=10.0, layout=layout)
    )
    fdm, model = begun(aircraft)
    assert first_difference(fdm, model, SECONDS) is None


def test_a_varied_aircraft_equals_jsbsims() -> None:
    variation = Variation(mass=1.2, drag=1.3, control=0.8, parasite_drag=0.05, volts=0.9)
    fdm, model = begun(load_aircraft("aerosonde"), 60, variation)
    assert model.frames[0].mass == pytest.approx(1.2 * 11.0 / 14.59390, rel=1e-5)
    assert first_difference(fdm, model, 2.0) is None


def test_proven_equal_the_state_is_as_before() -> None:
    _, model = begun_aerosonde()
    before = model.numbers.copy()
    assert model.find_differences() == []
    np.testing.assert_array_equal(model.numbers, before)


# ----------------------------------------------------------------------
# What the proof notices.


def test_the_last_bit_of_any_constant_of_the_aircraft_is_noticed() -> None:
    for field in ("mass", "inertia", "inverse_inertia", "wing_area", "wing_span", "wing_chord"):
        _, model = begun_aerosonde()
        register = frame_register(field)
        model.numbers[register] = np.nextafter(model.numbers[register], math.inf)
        assert model.find_differences(), field


def test_the_last_bit_of_the_attitude_is_noticed() -> None:
    _, model = begun_aerosonde()
    model.frames[0].attitude[1] = np.nextafter(model.frames[0].attitude[1], 1.0)
    assert model.find_differences()


@pytest.mark.parametrize("field", ["last_velocity", "second_last_velocity", "last_acceleration"])
def test_another_integrator_is_noticed(field: str) -> None:
    """Without its past, Adams and Bashforth's method is another one."""
    _, model = begun_aerosonde()
    model.frames[0][field][:] = 0.0
    assert model.find_differences()


def test_another_time_step_is_noticed() -> None:
    _, model = begun_aerosonde()
    model.frames[0].dt = np.nextafter(model.frames[0].dt, 1.0)
    assert model.find_differences()


def test_a_constant_of_a_function_is_noticed() -> None:
    """The last bit of each number of the model that its functions read, one at a time."""
    _, model = begun_aerosonde()
    program = model.numbers.copy()
    fixed = [
        k
        for k, value in enumerate(program)
        if k not in model.properties.values() and value in (4.481882984769055e-06, 0.042)
    ]
    assert len(fixed) == 2
    for register in fixed:
        _, model = begun_aerosonde()
        model.numbers[register] = np.nextafter(model.numbers[register], math.inf)
        assert model.find_differences(), model.numbers[register]


def test_a_wrong_register_is_noticed() -> None:
    """An instruction that reads or writes its neighbour: each of the flight controls."""
    _, model = begun_aerosonde()
    begin, count = int(model.code[FCS_START]), 4
    assert model.code[begin] == Operation.ACTUATOR
    for instruction in range(count):
        for part in (1, 3):
            _, model = begun_aerosonde()
            at = begin + 5 * instruction + part
            model.code[at] = model.code[begin + 5 * ((instruction + 1) % count) + part]
            assert model.find_differences(), (instruction, part)


def test_a_wrong_operation_is_noticed() -> None:
    _, model = begun_aerosonde()
    at = next(k for k in range(len(model.code)) if tuple(model.code[k : k + 3 : 2]) == (Operation.DIFFERENCE, 2))
    model.code[at] = Operation.SUM
    assert model.find_differences()


# ----------------------------------------------------------------------
# What is not covered.


def test_a_model_with_engine_and_wheels_is_not_covered() -> None:
    fdm = Fdm(load_aircraft("c172x"))
    with pytest.raises(UnsupportedModel):
        CompiledModel(fdm, READ_FIELDS, STEPS, gusts=True, terrain=True)


def test_the_flat_earth_is_not_covered() -> None:
    fdm = Fdm(load_aircraft("aerosonde"), flat_earth=True)
    with pytest.raises(UnsupportedModel, match="flat earth"):
        CompiledModel(fdm, READ_FIELDS, STEPS, gusts=True, terrain=True)
