"""The flight-dynamics model: one JSBSim instance behind packed arrays in SI units.

The only file that imports JSBSim; feet and slugs stay in it and in `flight.dynamics.jsbsim_properties`.  JSBSim never
says that anything is wrong: after a NaN, under ground or after a crash it runs on.  Whoever steps it checks the state
it reads.
"""

import math
import struct
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, cast

import jsbsim
import numpy as np

from aircraft.catalog import Aircraft
from aircraft.jsbsim_model import CommandProperty
from flight.dynamics.engine import Engine
from flight.dynamics.jsbsim_properties import (
    FLAT_DENSITY,
    FLAT_PLANET,
    FOOT,
    GUST,
    HEIGHT,
    IC_MOTION,
    IC_PLACE,
    OWN,
    POUND,
    RATE_FACTORS,
    RATES,
    SLUG_FT3,
    STATE,
    TERRAIN,
    WIND,
)
from flight.dynamics.model_check import check_model
from flight.dynamics.model_trial import try_model
from flight.dynamics.nodes import Links, addresses
from flight.dynamics.silence import silence
from flight.dynamics.state import STATE_SIZE, S
from flight.dynamics.trim import START, Floats, T, Trim, air_velocity, body_axes, euler, from_vector, solve
from world.errors import FlightError

JSBSIM_VERSION: str = jsbsim.__version__

_PACK: Callable[..., None] = struct.Struct(f"{STATE_SIZE}d").pack_into


@dataclass(frozen=True, slots=True)
class Variation:
    """What differs from the model as published, for validation and robustness: factors, and the parasite drag itself.

    parasite_drag: None keeps the model's own.  control: on the moments of the surfaces.  volts: of the battery.
    """

    mass: float = 1.0
    drag: float = 1.0
    control: float = 1.0
    parasite_drag: float | None = None
    volts: float = 1.0


class Fdm:
    """One aircraft in one JSBSim instance, from a trimmed start; make a new one for each flight.

    rate_hz: steps a second.  motor_braking: whether the motor may brake the propeller (current below zero).
    flat_earth: the book's world of constant density 1.2682 kg/m^3 and gravity 9.81 m/s^2 over a plane that does not
    turn, for validation; degrees of latitude are then 157 times longer.  Otherwise WGS84 and the standard atmosphere.
    tried: whether somebody's model is known not to abort JSBSim; otherwise `flight.dynamics.model_trial` finds out.

    Raises FlightError for a model that is missing, refused by `flight.dynamics.model_check`, or not loadable, and for a
    property that the model reads or we need and nobody defines.
    """

    def __init__(
        self,
        aircraft: Aircraft,
        *,
        rate_hz: float = 120.0,
        motor_braking: bool = False,
        flat_earth: bool = False,
        variation: Variation | None = None,
        tried: bool = False,
    ) -> None:
        if not 0.0 < rate_hz < math.inf:
            raise FlightError(f"rate_hz = {rate_hz} is not a positive number")
        self.aircraft = aircraft
        self.dt = 1.0 / rate_hz
        self._exec = _load(aircraft, self.dt, flat_earth, tried or aircraft.embedded)
        self._manager = self._exec.get_property_manager()
        if flat_earth:
            # The atmosphere looks for this name at every step, so here a new property is meant.
            self._exec.set_property_value("atmosphere/override/density", FLAT_DENSITY / SLUG_FT3)
        self._set("simulation/gravity-model", 0.0 if flat_earth else 1.0)
        self._knob("motor/braking", float(motor_braking), 0.0)
        self._vary(variation or Variation())
        state = STATE | {
            row: (reading.name, reading.factor) for row, reading in zip(OWN, aircraft.model.readings, strict=True)
        }
        self._names = [state[row][0] for row in S]
        self._readers = [self._getter(name) for name in self._names]
        self._factors = np.array([state[row][1] for row in S])
        self._writers = [self._commander(command) for command in aircraft.model.commands]
        self._winds = [self._setter(name) for name in WIND]
        self._gusts = [self._setter(name) for name in GUST]
        self._ic_place = [self._setter(name) for name in IC_PLACE]
        self._ic_motion = [self._setter(name) for name in IC_MOTION]
        self._rates = [self._getter(name) for name in RATES]
        self._terrain = self._setter(TERRAIN)
        self._height = self._getter(HEIGHT)
        self._run = self._exec.run
        self._engine = Engine(self._exec, self.dt, self._getter, self._setter) if aircraft.model.settles else None
        self._wind = np.zeros(3)
        self._heading = 0.0
        # lat_deg, lon_deg, terrain amsl: far below, where neither ground effect nor wheels matter.
        self._at = (45.0, 0.0, -1000.0)

    def _node(self, name: str) -> jsbsim.FGPropertyNode:
        node = self._manager.get_node(name) if self._manager.hasNode(name) else None
        if node is None:
            raise FlightError(f"{self.aircraft.model_file}: property {name} is needed and not defined")
        return node

    def _getter(self, name: str) -> Callable[[], float]:
        if not name:
            return _nothing
        getter: Callable[[], float] = self._node(name).get_double_value
        return getter

    def _setter(self, name: str) -> Callable[[float], object]:
        setter: Callable[[float], object] = self._node(name).set_double_value
        return setter

    def _commander(self, command: CommandProperty) -> Callable[[float], object]:
        """A setter in rad, or of the throttle, for a property that may count otherwise."""
        setter, above, below = self._setter(command.name), command.above, command.below
        if above == below == 1.0:
            return setter
        return lambda value: setter(value * (above if value > 0.0 else below))

    def _set(self, name: str, value: float) -> None:
        self._setter(name)(value)

    def _knob(self, name: str, value: float, usual: float) -> None:
        """Set a property that a model need not have while its value is the usual one."""
        if value != usual or self._manager.hasNode(name):
            self._set(name, value)

    def _vary(self, variation: Variation) -> None:
        if variation.mass != 1.0:
            extra = (variation.mass - 1.0) * self.aircraft.mass
            there = self._getter("inertia/pointmass-weight-lbs")()
            self._set("inertia/pointmass-weight-lbs", there + extra / POUND)
        self._knob("aero/drag-factor", variation.drag, 1.0)
        self._knob("aero/control-factor", variation.control, 1.0)
        if variation.parasite_drag is not None:
            self._set("aero/parasite-drag", variation.parasite_drag)
        if variation.volts != 1.0:
            self._set("motor/battery-v", variation.volts * self.aircraft.battery_voltage)

    def start(
        self,
        lat_deg: float,
        lon_deg: float,
        amsl: float,
        course: float,
        airspeed: float,
        climb_angle: float = 0.0,
        wind_ned: Sequence[float] = (0.0, 0.0, 0.0),
        terrain_amsl: float = 0.0,
    ) -> Trim:
        """Begin a flight in steady flight along this path over the ground, and return its trim.

        lat_deg: geodetic.  amsl, terrain_amsl: m.  course, climb_angle: rad, of the path over the ground.
        airspeed: m/s, true.  wind_ned: (3,) m/s, the way the air moves; it stays on as the steady wind.
        Surfaces and motor stand at their trimmed values, so holding the trim's commands starts no transient.
        Raises FlightError for values out of range, a wind that the airspeed cannot make way against, and a flight
        that the aircraft cannot hold.
        """
        wind = np.array(wind_ned, dtype=np.float64)
        numbers = (lat_deg, lon_deg, amsl, course, airspeed, climb_angle, *wind.tolist(), terrain_amsl)
        if len(numbers) != 10 or not all(math.isfinite(number) for number in numbers):
            raise FlightError(f"the start takes ten finite numbers, three of them the wind, and has {numbers}")
        if abs(lat_deg) >= 90.0 or abs(lon_deg) > 180.0:
            raise FlightError(f"start at latitude {lat_deg}, longitude {lon_deg}: not within +-90 and +-180 degrees")
        if not terrain_amsl < amsl < 11000.0:
            raise FlightError(f"start at {amsl} m above sea level: not between ground ({terrain_amsl} m) and 11000 m")
        velocity = air_velocity(course, climb_angle, airspeed, wind)
        climb = math.asin(-velocity[2] / airspeed)
        self._at = (lat_deg, lon_deg, terrain_amsl)
        self._wind = wind
        self._heading = math.atan2(velocity[1], velocity[0])
        self.place(amsl)
        held = {T.AIRSPEED: airspeed, T.CLIMB: climb}
        values = solve(self.balance, held, self.surface_limits(), self.first_guess())
        if values is None:
            raise FlightError(
                f"{self.aircraft.name} holds no steady flight at {airspeed:.1f} m/s,"
                f" {math.degrees(climb):+.1f} degrees to the air and {amsl:.0f} m above sea level"
            )
        self.balance(values)
        if self._engine:
            self._engine.release()
        self._exec.set_trim_status(False)
        self._exec.set_sim_time(0.0)
        # While the initial conditions ran, the wind stood in the gusts, because they overwrite the wind.
        self.set_wind(*wind)
        self.set_gust(0.0, 0.0, 0.0)
        return from_vector(values, amsl)

    def step(self, n: int = 1) -> None:
        """Advance by n steps of ``dt`` seconds."""
        run = self._run
        for _ in range(n):
            run()

    def read(self, out: Floats) -> None:
        """Fill the state, a contiguous float64 array (STATE_SIZE,), in the order of `flight.dynamics.state.S`."""
        # struct writes 26 floats in half the time of a slice assignment.
        _PACK(out, 0, *[reader() for reader in self._readers])
        np.multiply(out, self._factors, out)

    def write(self, commands: Floats) -> None:
        """Set the commands (COMMAND_SIZE,), in the order of `flight.dynamics.state.C`; they act in the next step."""
        for writer, value in zip(self._writers, commands.tolist(), strict=True):
            writer(value)

    def set_wind(self, north: float, east: float, down: float) -> None:
        """Set the steady wind, m/s, the way the air moves."""
        for setter, value in zip(self._winds, (north, east, down), strict=True):
            setter(value / FOOT)

    def set_gust(self, north: float, east: float, down: float) -> None:
        """Set what adds to the steady wind, m/s, the way the air moves."""
        for setter, value in zip(self._gusts, (north, east, down), strict=True):
            setter(value / FOOT)

    def set_terrain(self, amsl: float) -> None:
        """Set the ground's height below the aircraft, m above sea level."""
        self._terrain(amsl / FOOT)

    def links(self) -> Links:
        """The bound nodes of this instance."""
        commands = self.aircraft.model.commands
        names = [*self._names, *(command.name for command in commands), *GUST, TERRAIN]
        nodes = [self._node(name) if name else None for name in names]
        scales = [(command.above, command.below) for command in commands] + 4 * [(1.0 / FOOT, 1.0 / FOOT)]
        return Links(
            getters=tuple(self._readers),
            factors=self._factors,
            setters=tuple(node.set_double_value for node in nodes[STATE_SIZE:] if node is not None),
            scales=np.array(scales),
            nodes=addresses(nodes, JSBSIM_VERSION, Path(cast("Any", jsbsim)._jsbsim.__file__)),
            run=self._run,
        )

    def height(self) -> float:
        """Height above the ground last set, m; negative under ground, where JSBSim flies on."""
        return self._height() * FOOT

    # What trims and linearisation need.

    def surface_limits(self) -> tuple[float, float, float]:
        """Elevator, aileron and rudder limits, rad, either way."""
        return self.aircraft.max_elevator, self.aircraft.max_aileron, self.aircraft.max_rudder

    def first_guess(self) -> Floats:
        """(8,) a trim vector to start from: level at cruise."""
        guess = START.copy()
        guess[T.AIRSPEED] = self.aircraft.airspeed
        return guess

    def place(self, amsl: float) -> None:
        """Move the point of evaluation for `balance` and `derivatives` to this height; ends any flight."""
        lat_deg, lon_deg, terrain = self._at
        for setter, value in zip(self._ic_place, (lat_deg, lon_deg, terrain / FOOT, amsl / FOOT), strict=True):
            setter(value)
        self.set_gust(*self._wind)
        self._exec.set_trim_status(True)
        if self._engine:
            self._engine.hold()

    def balance(self, values: Floats) -> Floats:
        """(6,) body accelerations, m/s^2 and rad/s^2, of the steady flight with this trim vector (8,)."""
        axes = body_axes(self._heading, values[T.CLIMB], values[T.BANK], values[T.ALPHA])
        alpha = values[T.ALPHA]
        air = axes @ np.array([math.cos(alpha), 0.0, math.sin(alpha)]) * values[T.AIRSPEED]
        commands = values[[T.ELEVATOR, T.AILERON, T.RUDDER, T.THROTTLE]]
        return self._evaluate(euler(axes), air + self._wind, (0.0, 0.0, 0.0), commands, settle=True)[:6]

    def derivatives(self, states: Floats, commands: Floats) -> Floats:
        """(8,) rates of the states (u, v, w, p, q, r, roll, pitch) with surfaces and motor at their commands (4,).

        An engine keeps the speed at which the last `balance` left it.
        """
        roll, pitch = states[6], states[7]
        axes = body_axes(self._heading, pitch, roll, 0.0)
        return self._evaluate(
            (roll, pitch, self._heading), axes @ states[:3] + self._wind, tuple(states[3:6]), commands
        )

    def _evaluate(
        self,
        angles: Sequence[float],
        velocity: Floats,
        pqr: Sequence[float],
        commands: Floats,
        settle: bool = False,
    ) -> Floats:
        # Trim status lets the actuators through unlagged.
        self.write(commands)
        for setter, value in zip(self._ic_motion, (*angles, *(velocity / FOOT), *pqr), strict=True):
            setter(value)
        self._exec.run_ic()
        if self._engine:
            self._engine.settle(spin=settle)
            self._exec.run_ic()
        rates: Floats = np.array([rate() for rate in self._rates]) * RATE_FACTORS
        return rates


def _nothing() -> float:
    """What an aircraft without this quantity reads."""
    return 0.0


def _load(aircraft: Aircraft, dt: float, flat_earth: bool, tried: bool) -> jsbsim.FGFDMExec:
    with silence(), tempfile.TemporaryDirectory() as copy:
        fdm = jsbsim.FGFDMExec(copy)
        fdm.set_debug_level(0)
        files = check_model(
            aircraft.model_file,
            fdm.get_property_manager().hasNode,
            aircraft.model_folders,
            shipped=aircraft.model.shipped,
        )
        if not tried:
            try_model(aircraft)
        # JSBSim only ever sees a copy of what was checked: some models write files into their own folder.
        folder = Path(copy) / aircraft.name
        folder.mkdir()
        for name, data in files.items():
            (folder / name).write_bytes(data)
        fdm.set_aircraft_path(copy)
        fdm.set_engine_path(str(folder))
        fdm.set_systems_path(str(folder))
        fdm.set_dt(dt)
        if flat_earth:
            planet = Path(copy) / "flat.xml"
            planet.write_text(FLAT_PLANET, encoding="utf-8")
            fdm.load_planet(str(planet), False)
        try:
            loaded = fdm.load_model(aircraft.name)
        except (jsbsim.BaseError, RuntimeError, ValueError, OSError) as error:
            said = " ".join(str(error).split()).replace(str(folder), str(aircraft.model_file.parent))
            raise FlightError(f"{aircraft.model_file}: JSBSim: {said}") from None
    if not loaded:
        raise FlightError(f"{aircraft.model_file}: JSBSim cannot load this model")
    return fdm
