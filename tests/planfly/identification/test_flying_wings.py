"""A flying wing of known truth, flown by ArduPlane's law with elevons, and identified by the command."""

import re
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import planfly
from aircraft.catalog import Aircraft, read_aircraft
from aircraft.uncertainty import read_uncertainty
from flight.dynamics.envelope_tables import load_envelope
from flight.mission_files.wpl import waypoints_text
from logs.importers.motion_log import MotionLog
from planfly.cli import main
from planfly.identification.manoeuvres import identification_mission
from tests.instrumented_flights import HOME, drawn_sensors, sensed, write_motion
from tests.soak import SOAK

# Factors of the data sheet's model, each over what it has.
TRUTH = {"zero-lift-drag": 1.25, "thrust": 0.9, "elevator-power": 0.8, "aileron-power": 0.85, "roll-damping": 1.2}
PARAMETERS = {
    "SERVO1_FUNCTION": 77.0, "SERVO2_FUNCTION": 78.0, "SERVO3_FUNCTION": 70.0, "SERVO3_MIN": 1000.0,
    "SERVO3_MAX": 2000.0, "AIRSPEED_MIN": 12.0, "AIRSPEED_CRUISE": 15.0, "AIRSPEED_MAX": 19.0,
}  # fmt: skip


def changed(sheet: Aircraft, folder: Path) -> Aircraft:
    """The wing with `TRUTH`, edited into its model's own factors."""
    shutil.copytree(sheet.folder, folder)
    for file in folder.glob(f"{sheet.name}.*"):
        file.rename(file.with_stem(folder.name))
    model = folder / f"{folder.name}.xml"
    text = model.read_text(encoding="utf-8")
    for name, factor in TRUTH.items():
        text, count = re.subn(
            rf'<property value="1"> ident/{name} ', f'<property value="{factor}"> ident/{name} ', text
        )
        assert count == 1, name
    model.write_text(text, encoding="utf-8")
    return read_aircraft(folder)


def flown(aircraft: Aircraft, folder: Path) -> MotionLog:
    """Twelve minutes of manoeuvres, with the two elevons as outputs 1 and 2."""
    mission = identification_mission(aircraft, load_envelope(aircraft), *HOME, repeats=2)
    file = folder / "identify.waypoints"
    file.write_text(waypoints_text(mission), encoding="utf-8")
    track = planfly.fly(
        str(file), aircraft=str(aircraft.folder), seed=5, wind=(3.0, 40.0), turbulence="light",
        params=str(aircraft.folder / "ardupilot.parm"),
    ).track  # fmt: skip
    log = sensed(track, aircraft, drawn_sensors(5, battery=True), 5)
    commands = track.commands.astype(np.float64)[np.searchsorted(track.time + 20.0, log.outputs.time)]
    elevator, aileron, _, throttle = commands.T
    pulses = np.zeros_like(log.outputs.values)
    # The model's elevator is positive downwards, ArduPlane's elevons upwards; full travel is the largest deflection.
    pulses[:, 0] = 1500.0 + 400.0 * (-elevator - aileron) / aircraft.max_elevator
    pulses[:, 1] = 1500.0 + 400.0 * (-elevator + aileron) / aircraft.max_elevator
    pulses[:, 2] = 1000.0 + 1000.0 * throttle
    outputs = replace(log.outputs, values=np.round(pulses))
    return replace(log, outputs=outputs, parameters=PARAMETERS)


@pytest.mark.skipif(not SOAK, reason="half a minute of computing")
def test_a_flying_wing_is_found_from_its_elevons(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    sheet = planfly.new_aircraft("foam", mass=2.1, span=1.6, cruise=15.0, stall=10.0, layout="wing")
    truth = changed(sheet, tmp_path / "truth")
    write_motion(tmp_path / "a.BIN", flown(truth, tmp_path))
    arguments = [
        "--mass",
        "2.1",
        "--span",
        "1.6",
        "--area",
        f"{sheet.wing_area}",
        "--base",
        "./foam",
        "--out",
        "./mine",
    ]
    assert main(["aircraft", "--identify", "a.BIN", *arguments]) == 0
    known = read_uncertainty(tmp_path / "mine")
    assert known is not None
    found = {one.name.removeprefix("ident/"): (one.estimate, one.sd) for one in known.quantities}
    for name, value in TRUTH.items():
        estimate, sd = found[name]
        assert abs(estimate - value) < 3.0 * sd, name
    for name in ("zero-lift-drag", "thrust"):
        assert found[name][0] == pytest.approx(TRUTH[name], abs=0.1), name
    # What the elevator does is seen best against the stiffness that it works against, which is the sheet's.
    assert found["elevator-power"][0] / found["pitch-stiffness"][0] == pytest.approx(TRUTH["elevator-power"], abs=0.08)
    best, right = (load_envelope(one).air_angles(15.0, 480.0) for one in (read_aircraft(tmp_path / "mine"), truth))
    assert np.degrees(best) == pytest.approx(np.degrees(right), abs=1.2)
    assert main(["check", "mine/identify.waypoints", "--aircraft", "./mine"]) in (0, 3)
