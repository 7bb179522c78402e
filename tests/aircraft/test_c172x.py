"""JSBSim's c172x through the same wrapper: its engine, its controls, its fuel, and nothing that it writes."""

import math
import re
from pathlib import Path

import numpy as np
import pytest

from aircraft.catalog import jsbsim_folder, load_aircraft, read_aircraft
from flight.dynamics.fdm import Fdm, Variation
from flight.dynamics.model_check import check_model
from flight.dynamics.trim import fastest_level_flight, full_throttle_climb, idle_descent, steady_flight
from flight.guidance.gains import load_gains
from world.errors import FlightError

CESSNA = load_aircraft("c172x")


def test_a_trimmed_start_has_a_running_engine_and_no_transient(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    shipped = sorted(path.name for path in CESSNA.model_file.parent.iterdir())
    fdm = Fdm(CESSNA)
    trim = fdm.start(46.0, 8.0, 900.0, 1.0, 50.0, 0.02, (3.0, -4.0, 0.0), terrain_amsl=400.0)
    first = fdm.read()
    rpm = fdm.properties.getter("propulsion/engine/propeller-rpm")
    before = rpm()
    assert before > 1500.0
    fdm.write(trim.commands())
    fdm.step(240)
    last = fdm.read()
    assert first.airspeed == pytest.approx(50.0, abs=1e-6)
    assert rpm() == pytest.approx(before, rel=1e-3)
    assert last.airspeed == pytest.approx(50.0, abs=0.02)
    # Its elevator has play, which takes up 0.1 degrees.
    assert abs(last.velocity_down - first.velocity_down) < 0.1
    assert abs(last.roll - first.roll) < 0.01
    # The stock model writes JSBout172B.csv.
    assert not list(tmp_path.iterdir())
    assert sorted(path.name for path in CESSNA.model_file.parent.iterdir()) == shipped


def test_its_trims_are_those_of_a_cessna() -> None:
    # The 172P's manual: cruise at 75 % power, 2000 ft: 116 knots; climb at sea level 700 ft/min at 76 knots; both of a
    # clean and lighter aircraft than the model, which carries six loads.
    fdm = Fdm(CESSNA)
    level = [steady_flight(fdm, speed, 600.0) for speed in (40.0, 50.0, 60.0)]
    throttles = [trim.throttle for trim in level if trim]
    assert len(throttles) == 3
    assert throttles == sorted(throttles)
    climb, glide, fast = (
        full_throttle_climb(fdm, 39.0, 0.0),
        idle_descent(fdm, 39.0, 0.0),
        fastest_level_flight(fdm, 0.0),
    )
    assert climb is not None
    assert glide is not None
    assert fast is not None
    assert 39.0 * math.sin(climb.climb) == pytest.approx(700 * 0.3048 / 60, rel=0.5)
    # A windmilling propeller: the manual's glide ratio of 9 is with it.
    assert -1.0 / math.tan(glide.climb) == pytest.approx(9.0, rel=0.4)
    assert 60.0 < fast.airspeed < 70.0


def test_a_trim_does_not_depend_on_where_the_engine_was() -> None:
    fdm = Fdm(CESSNA)
    first = steady_flight(fdm, 50.0, 600.0)
    full_throttle_climb(fdm, 40.0, 3000.0)
    idle_descent(fdm, 60.0, 0.0)
    again = steady_flight(fdm, 50.0, 600.0)
    assert first is not None
    assert again is not None
    np.testing.assert_allclose(again.vector(), first.vector(), rtol=1e-6, atol=1e-9)


@pytest.mark.parametrize(
    ("control", "rate", "sign"),
    [("elevator", "pitch_rate", -1.0), ("aileron", "roll_rate", 1.0), ("rudder", "yaw_rate", -1.0)],
)
@pytest.mark.parametrize("way", [1.0, -1.0])
def test_commands_in_radians_move_the_surfaces_by_that(control: str, rate: str, sign: float, way: float) -> None:
    fdm = Fdm(CESSNA)
    commands = fdm.start(46.0, 8.0, 600.0, 0.0, 50.0).commands()
    size = way * 0.12
    fdm.write(commands._replace(**{control: getattr(commands, control) + size}))
    before = fdm.read()
    fdm.step(30)
    after = fdm.read()
    # The play of the actuators: 0.05 rad in the elevator, 0.005 in the ailerons.
    assert after[control] - before[control] == pytest.approx(size, abs=0.026)
    assert sign * way * after[rate] > 0.01


def test_power_is_the_heat_of_the_fuel_burned() -> None:
    fdm = Fdm(CESSNA)
    fdm.start(46.0, 8.0, 600.0, 0.0, 50.0)
    tanks = [fdm.properties.getter(f"propulsion/tank[{k}]/contents-lbs") for k in range(2)]
    assert sum(tank() for tank in tanks) * 0.45359237 == pytest.approx(117.9, abs=0.1)  # trimming burns nothing
    before, heat = sum(tank() for tank in tanks), 0.0
    for _ in range(1200):
        fdm.step()
        state = fdm.read()
        heat += state.power * fdm.dt
    burned = (before - sum(tank() for tank in tanks)) * 0.45359237
    assert burned > 0.01
    assert heat == pytest.approx(burned * 43.5e6, rel=2e-3)
    assert state.current == 0.0


def test_what_it_lacks_is_refused_only_where_it_is_asked_for() -> None:
    with pytest.raises(FlightError, match="the model does not define the property motor/braking, which"):
        Fdm(CESSNA, motor_braking=True)
    with pytest.raises(FlightError, match="the model does not define the property aero/drag-factor, which"):
        Fdm(CESSNA, variation=Variation(drag=1.1))
    heavy = steady_flight(Fdm(CESSNA, variation=Variation(mass=1.1)), 50.0, 600.0)
    usual = steady_flight(Fdm(CESSNA), 50.0, 600.0)
    assert heavy is not None
    assert usual is not None
    assert heavy.alpha > usual.alpha + 0.005


def test_its_channels_are_cut_out_and_its_lines_stay() -> None:
    files = check_model(CESSNA.model_file, lambda _: True, CESSNA.model_folders, shipped=True)
    text = CESSNA.model_file.read_bytes()
    cut = files["c172x.xml"]
    assert b'<output name="JSBout172B.csv"' in text
    assert b"JSBout172B" not in cut
    assert len(cut) == len(text)
    assert cut.count(b"\n") == text.count(b"\n")
    assert {"c172ap.xml", "Autopilot.xml", "eng_io320.xml", "prop_75in2f.xml"} < set(files)


def test_the_channels_of_another_stock_model_are_cut_out() -> None:
    # The 737 listens on a port, on all interfaces.
    model = jsbsim_folder() / "aircraft" / "737" / "737.xml"
    folders = (model.parent, jsbsim_folder() / "engine", jsbsim_folder() / "systems")
    assert b"<input port=" in model.read_bytes()
    assert b"<input port=" not in check_model(model, lambda _: True, folders, shipped=True)["737.xml"]
    with pytest.raises(FlightError, match=r"737\.xml:\d+: <(input|output)> opens a port or writes a file"):
        check_model(model, lambda _: True, folders)


def test_it_has_gains_of_its_own() -> None:
    assert load_gains(CESSNA).reference_airspeed == CESSNA.airspeed
    assert load_gains(CESSNA) != load_gains(load_aircraft("aerosonde"))


def test_a_model_of_ones_own_may_bring_in_files_of_its_folder(tmp_path: Path) -> None:
    # The Cessna again, as a person would keep it: engine, propeller and autopilot beside the model.
    folder = tmp_path / "mine"
    (folder / "Systems").mkdir(parents=True)
    for name, data in check_model(CESSNA.model_file, lambda _: True, CESSNA.model_folders, shipped=True).items():
        text = data.decode()
        # Entities are refused in a model that is not JSBSim's own.
        for entity, value in re.findall(r'<!ENTITY\s+(\w+)\s+"([^"]*)"', text):
            text = text.replace(f"&{entity};", value)
        text = re.sub(r"<!DOCTYPE.*?\]>", "", text, flags=re.DOTALL)
        inside = folder / "Systems" if name in {"Autopilot.xml", "GNCUtilities.xml"} else folder
        (inside / name.replace("c172x", "mine")).write_text(text, encoding="utf-8")
    table = (CESSNA.folder / "c172x.toml").read_text(encoding="utf-8").replace("shipped_by_jsbsim = true", "")
    (folder / "mine.toml").write_text(table, encoding="utf-8")
    mine, stock = steady_flight(Fdm(read_aircraft(folder)), 50.0, 600.0), steady_flight(Fdm(CESSNA), 50.0, 600.0)
    assert mine is not None
    assert mine == stock
