"""The written model against the hand-written Aerosonde, which has the same numbers, and its mixers and factors."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from aircraft.catalog import Aircraft, load_aircraft, read_aircraft
from aircraft.model_writer import FACTORS, AeroCoefficients, ModelNumbers, model_xml
from aircraft.propulsion import BOOK_PROPELLER, ElectricMotor
from flight.dynamics.fdm import Fdm, Variation

# Beard and McLain, appendix E.2, as aircraft/aerosonde/aerosonde.xml has it.
BOOK = ModelNumbers(
    title="Aerosonde & its <numbers>",
    source="appendix E.2 -- of the book",
    mass=11.0,
    area=0.55,
    span=2.8956,
    chord=0.18994,
    inertia=(0.8244, 1.135, 1.759, 0.1204),
    aero=AeroCoefficients(
        lift_0=0.23,
        lift_alpha=5.61,
        lift_q=7.95,
        lift_elevator=0.13,
        drag_min=0.043,
        drag_lift=1.0 / (math.pi * 0.9 * 2.8956**2 / 0.55),
        pitch_0=0.0135,
        pitch_alpha=-2.74,
        pitch_q=-38.21,
        pitch_elevator=-0.99,
        side_beta=-0.98,
        side_aileron=0.075,
        side_rudder=0.19,
        roll_beta=-0.13,
        roll_p=-0.51,
        roll_r=0.25,
        roll_aileron=0.17,
        roll_rudder=0.0024,
        yaw_beta=0.073,
        yaw_p=0.069,
        yaw_r=-0.095,
        yaw_aileron=-0.011,
        yaw_rudder=-0.069,
        stall_alpha=0.47,
    ),
    propulsion=ElectricMotor(BOOK_PROPELLER, 44.4, 60.0 / (2.0 * math.pi * 145.0), 0.042, 1.5),
)


def _made(place: Path, numbers: ModelNumbers) -> Aircraft:
    """An aircraft with this model and the Aerosonde's metadata."""
    folder = place / "written"
    folder.mkdir()
    (folder / "written.xml").write_text(model_xml("written", numbers), encoding="utf-8")
    metadata = (load_aircraft("aerosonde").folder / "aerosonde.toml").read_text(encoding="utf-8")
    (folder / "written.toml").write_text(metadata, encoding="utf-8")
    return read_aircraft(folder)


def test_the_aerosondes_numbers_make_the_aerosonde(tmp_path: Path) -> None:
    theirs, ours = Fdm(load_aircraft("aerosonde")), Fdm(_made(tmp_path, BOOK), is_tested=True)
    random = np.random.default_rng(3)
    for fdm in (theirs, ours):
        fdm.move_to(700.0)
    for _ in range(20):
        states = random.uniform(-1.0, 1.0, 8) * [8.0, 2.0, 2.0, 1.0, 1.0, 1.0, 0.6, 0.3] + [24.0, 0, 1.0, *5 * [0.0]]
        # Nobody's motor drives by half, and elevator drag has a sign here and none there.
        commands = np.array([0.0, *random.uniform(-0.3, 0.3, 2), random.uniform(0.0, 1.0)])
        expected = theirs.derivatives(states, commands)
        assert ours.derivatives(states, commands) == pytest.approx(expected, rel=2e-5, abs=2e-5)


def test_power_is_the_aerosondes(tmp_path: Path) -> None:
    theirs, ours = Fdm(load_aircraft("aerosonde")), Fdm(_made(tmp_path, BOOK), is_tested=True)
    found = []
    for fdm in (theirs, ours):
        fdm.move_to(0.0)
        fdm.apply_trim(np.array([25.0, 0.0, 0.05, 0.0, -0.1, 0.0, 0.0, 0.8]))
        state = fdm.read()
        found.append((state.power, state.current))
    assert found[0] == pytest.approx(found[1], rel=1e-9)
    assert found[0][0] > 300.0


def test_each_factor_moves_what_it_is_named_for(tmp_path: Path) -> None:
    aircraft = _made(tmp_path, BOOK)
    level = np.array([25.0, 0.0, 0.05, 0.0, -0.1, 0.02, 0.0, 0.8])
    states = np.array([25.0, 0.0, 1.25, 0.3, 0.2, 0.0, 0.0, 0.05])

    def rates(name: str, factor: float, commands: np.ndarray) -> np.ndarray:
        fdm = Fdm(aircraft, is_tested=True, variation=Variation(properties=((f"ident/{name}", factor),)))
        fdm.move_to(500.0)
        return fdm.derivatives(states, commands)

    commands = level[4:]
    # Which accelerations (u, w, p, q) each factor moves; an idle propeller's drag only without throttle.
    moves = {
        "zero-lift-drag": "uw",
        "induced-drag": "uw",
        "thrust": "u",
        "motor-speed": "up",
        "windmill-drag": "u",
        "lift-slope": "uw",
        "pitch-stiffness": "q",
        "pitch-damping": "q",
        "elevator-power": "q",
        "roll-damping": "p",
        "aileron-power": "p",
    }
    assert set(moves) == set(FACTORS)
    for name, axes in moves.items():
        used = np.array([*commands[:3], 0.0]) if name == "windmill-drag" else commands
        change = np.abs(rates(name, 1.3, used) - rates(name, 1.0, used))
        moved = {axis for axis, k in zip("uwpq", (0, 2, 3, 4), strict=True) if change[k] > 1e-3}
        assert moved == set(axes), name


def test_elevons_mix_and_stop(tmp_path: Path) -> None:
    wing = replace(BOOK, layout="wing", throw=(0.4, 0.4, 0.0001))
    fdm = Fdm(_made(tmp_path, wing), is_tested=True)
    fdm.move_to(500.0)
    for elevator, aileron, expected in (
        (-0.2, 0.1, (-0.2, 0.1)),
        # The right one stops at 1.3 x 0.4: (-0.3 - 0.52) / 2 and (-0.3 + 0.52) / 2.
        (-0.45, 0.15, (-0.41, 0.11)),
    ):
        fdm.apply_trim(np.array([25.0, 0.0, 0.05, 0.0, elevator, aileron, 0.0, 0.8]))
        state = fdm.read()
        assert (float(state.elevator), float(state.aileron)) == pytest.approx(expected, abs=1e-9)


def test_a_v_tail_mixes_elevator_and_rudder(tmp_path: Path) -> None:
    fdm = Fdm(_made(tmp_path, replace(BOOK, layout="vtail")), is_tested=True)
    fdm.move_to(500.0)
    fdm.apply_trim(np.array([25.0, 0.0, 0.05, 0.0, -0.2, 0.05, 0.1, 0.8]))
    state = fdm.read()
    found = (float(state.elevator), float(state.aileron), float(state.rudder))
    assert found == pytest.approx((-0.2, 0.05, 0.1), abs=1e-9)
