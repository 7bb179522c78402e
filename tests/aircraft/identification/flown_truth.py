"""One flight of an aircraft of known truth with its battery logged, and what identification makes of it."""

import tempfile
from functools import cache
from pathlib import Path
from typing import NamedTuple

from aircraft.catalog import load_aircraft
from aircraft.identification.base_model import BaseModel
from aircraft.identification.estimate import Estimate, estimate_model
from aircraft.identification.flight_record import FlightRecord
from logs.importers.motion import MotionLog
from planfly.identification.base_numbers import base_model, scale_base_model
from planfly.identification.records import flight_records
from planfly.identification.servos import read_servos
from tests.instrumented_flights import Truth, drawn_sensors, fly_identification, sensed
from tests.shared import made_once

TRUTH = Truth(
    mass=1.2,
    lift_slope=0.9,
    lift_offset=0.046,
    zero_lift_drag=1.35,
    thrust=0.85,
    pitch_damping=0.7,
    aileron_power=0.75,
    weathercock=0.8,
    roll_inertia=1.1,
    pitch_inertia=0.95,
    yaw_inertia=1.05,
)

SENSORS = drawn_sensors(3, battery=True)


class Flown(NamedTuple):
    """The log, its stretches, the base scaled to the aircraft's mass, and the estimate."""

    log: MotionLog
    records: list[FlightRecord]
    base: BaseModel
    estimate: Estimate


@cache
def flown_truth() -> Flown:
    return made_once("flown-truth", _fly)


def _fly() -> Flown:
    with tempfile.TemporaryDirectory() as folder:
        track, changed = fly_identification(Path(folder), TRUTH, 3)
        log = sensed(track, changed, SENSORS, 3)
    prior = load_aircraft("aerosonde")
    base = scale_base_model(base_model(prior), changed.mass, prior.wing_span, prior.wing_area)
    records = flight_records(log, prior, read_servos(prior.folder / "ardupilot.toml"))
    return Flown(log, records, base, estimate_model(records, base))
