"""The rows of a flight of the field as a track; what the log does not hold is NaN there."""

import math

import numpy as np
from numpy.typing import NDArray

from flight.simulation.track import THROTTLE, Track
from logs.field_logs.field_flight import FieldFlight
from world.frames import GeoOrigin, to_map

Floats = NDArray[np.float64]


def rows_of_flight(flight: FieldFlight, origin: GeoOrigin) -> Track:
    """A track on the map about ``origin``.

    Velocities that the log does not hold are the differences of its places.  A log without heights has 0 there, which
    no rule reads.

    >>> from logs.field_logs.example_raw_log import example_raw_log
    >>> from logs.field_logs.field_flight import make_flight
    >>> track = rows_of_flight(make_flight(example_raw_log()), GeoOrigin(46.0, 8.0))
    >>> track.position[-1].round(1).tolist(), float(track.airspeed[0]), float(track.current[0])
    ([1045.0, 1000.0, 500.0], 25.0, nan)
    """
    count = len(flight.time)
    east, north = to_map(origin, flight.lat, flight.lon)
    position = np.column_stack([east, north, np.nan_to_num(flight.up, nan=0.0)])
    velocity = flight.columns["velocity"].copy()
    missing = ~np.isfinite(velocity).all(axis=1)
    if missing.any() and count > 1:
        velocity[missing] = np.gradient(position, flight.time, axis=0)[missing]
    wind = np.column_stack([flight.columns["wind"], np.where(np.isfinite(flight.columns["wind"][:, 0]), 0.0, math.nan)])
    controls = np.full((count, 4), math.nan)
    controls[:, THROTTLE] = flight.columns["throttle"][:, 0]
    current, energy = flight.columns["battery"].T
    known = energy[np.isfinite(energy)]
    none = np.full(count, math.nan)
    return Track(
        time=flight.time,
        position=position,
        velocity=velocity.astype(np.float32),
        attitude=flight.columns["attitude"].astype(np.float32),
        rates=np.full((count, 3), math.nan),
        airspeed=flight.columns["airspeed"][:, 0].astype(np.float32),
        flow=np.full((count, 2), math.nan),
        controls=controls,
        commands=np.full((count, 4), math.nan),
        wind=wind,
        load_factor=none,
        current=current,
        energy=energy - known[0] if known.size else energy,
        leg=np.zeros(count, dtype=np.int32),
        cross_track=none,
        height_error=none,
        speed_command=none,
        clearance=none,
    )
