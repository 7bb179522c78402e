"""Flying wings of known truth, flown by ArduPlane's law with elevons, as their autopilot's sensors would log them.

The truth is edited into the model's own text: the factors that it has, mass with inertia, and the power that its
propeller takes.  Nothing of what writes an identified model is used.
"""

import re
import shutil
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

import planfly
from aircraft.catalog import Aircraft, read_aircraft
from flight.dynamics.envelope_tables import load_envelope
from flight.mission_files.formats import waypoints_text
from flight.simulation.track import Track
from logs.importers.motion import MotionLog
from planfly.identification.manoeuvres import make_identification_mission
from tests.instrumented_flights import HOME, Sensors, sensed

MASS, TORQUE = "mass", "propeller-torque"
# Where a model has the power that its propeller takes: of a disc, and of a propeller's torque.
_POWERS = (
    r'(<function name="motor/battery-power-w">\s*<product>\s*<v> )([^ ]+)( </v> <p> motor/thrust-n)',
    r'(<function name="motor/q\d">\s*<product>\s*<v> )([^ ]+)( </v>)',
)


def changed_wing(base: Aircraft, folder: Path, truth: Mapping[str, float]) -> Aircraft:
    """The wing with these factors on what its model has, in a folder that must not exist."""
    shutil.copytree(base.folder, folder, ignore=shutil.ignore_patterns("__pycache__", "*.py"))
    for file in folder.glob(f"{base.name}.*"):
        file.rename(file.with_stem(folder.name))
    model, table = folder / f"{folder.name}.xml", folder / f"{folder.name}.toml"
    text = model.read_text(encoding="utf-8")
    for name, factor in truth.items():
        if name == MASS:
            text = _times(text, r'(<i\w\w unit="SLUG\*FT2"> )([^ ]+)( )', factor)
            text = _times(text, r'(<emptywt unit="LBS"> )([^ ]+)( )', factor)
            data = _times(table.read_text(encoding="utf-8"), r"(mass_kg = )([\d.]+)()", factor)
            table.write_text(data, encoding="utf-8")
        elif name == TORQUE:
            (pattern,) = (one for one in _POWERS if re.search(one, text))
            text = _times(text, pattern, factor)
        else:
            text = _times(text, rf'(<property value=")(1)("> ident/{name} )', factor)
    model.write_text(text, encoding="utf-8")
    return read_aircraft(folder)


def _times(text: str, pattern: str, factor: float) -> str:
    """Text with the second group of a pattern multiplied wherever it is found."""
    made, count = re.subn(pattern, lambda found: f"{found[1]}{float(found[2]) * factor:.12g}{found[3]}", text)
    assert count, pattern
    return made


def fly_wing(
    aircraft: Aircraft, folder: Path, seed: int, *, repeats: int = 2, wind: tuple[float, float] = (3.0, 40.0)
) -> Track:
    """The mission of manoeuvres in light turbulence; repeats: how often all of it (twice is twelve minutes)."""
    mission = make_identification_mission(aircraft, load_envelope(aircraft), *HOME, repeats=repeats)
    file = folder / f"identify-{seed}.waypoints"
    file.write_text(waypoints_text(mission), encoding="utf-8")
    made = planfly.fly(
        str(file),
        aircraft=str(aircraft.folder),
        seed=seed,
        wind=wind,
        turbulence="light",
        params=str(aircraft.folder / "ardupilot.parm"),
    )
    return made.track


def log_of_elevons(track: Track, aircraft: Aircraft, sensors: Sensors, seed: int) -> MotionLog:
    """The log of a flight, with the two elevons as outputs 1 and 2, and the motor's as 3."""
    log = sensed(track, aircraft, sensors, seed)
    commands = track.commands.astype(np.float64)[np.searchsorted(track.time + 20.0, log.outputs.time)]
    elevator, aileron, _, throttle = commands.T
    pulses = np.zeros_like(log.outputs.values)
    # The model's elevator is positive downwards, ArduPlane's elevons upwards; full travel is the largest deflection.
    pulses[:, 0] = 1500.0 + 400.0 * (-elevator - aileron) / aircraft.max_elevator
    pulses[:, 1] = 1500.0 + 400.0 * (-elevator + aileron) / aircraft.max_elevator
    pulses[:, 2] = 1000.0 + 1000.0 * throttle
    parameters = {
        "SERVO1_FUNCTION": 77.0,
        "SERVO2_FUNCTION": 78.0,
        "SERVO3_FUNCTION": 70.0,
        "SERVO3_MIN": 1000.0,
        "SERVO3_MAX": 2000.0,
        "AIRSPEED_MIN": aircraft.airspeed_min,
        "AIRSPEED_CRUISE": aircraft.airspeed,
        "AIRSPEED_MAX": aircraft.airspeed_max,
    }
    return replace(log, outputs=replace(log.outputs, values=np.round(pulses)), parameters=parameters)
