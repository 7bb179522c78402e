"""Wrap one JSBSim instance as a flight-dynamics model, with state and commands in SI units.

Only this module imports JSBSim; feet and slugs are used only here and in `flight.dynamics.jsbsim_properties`. JSBSim
never reports an error: after a NaN, below ground or after a crash it continues. The caller must check the state that it
reads.
"""

import itertools
import math
import struct
from array import array
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import jsbsim
import numpy as np
from numpy.typing import NDArray

from aircraft.catalog import Aircraft
from aircraft.contacts import Gear, with_contacts
from flight.dynamics.jsbsim_properties import (
    FLAT_DENSITY,
    FLAT_PLANET,
    FOOT,
    FORCES,
    GUST,
    HEIGHT,
    IC_MOTION,
    IC_POSITION,
    MASS,
    MODEL_FIELDS,
    POUND,
    RATE_FACTORS,
    RATES,
    SLUG_FT3,
    STATE_PROPERTIES,
    TERRAIN,
    WIND,
    Getter,
    PropertyAccess,
    Setter,
)
from flight.dynamics.model_check import check_model, jsbsim_reason, try_model
from flight.dynamics.state import STATE
from flight.dynamics.trim import Engine, Trim, air_velocity, body_axes, euler, first_guess, steady_flight
from world.arrays import Floats
from world.errors import FlightError
from world.files import temporary_folder
from world.kernels import Record, field_names
from world.silent_output import silence

# ----------------------------------------------------------------------
# Valid start of a flight: on the globe except its poles, in the air and below the tropopause.


def check_start_position(lat_deg: float, lon_deg: float, amsl: float, terrain_amsl: float) -> None:
    """Raise FlightError for a position where no flight can start.

    lat_deg, lon_deg: geodetic, degrees.
    amsl: altitude, m.
    terrain_amsl: altitude of the ground there, m.
    """
    if abs(lat_deg) >= 90.0 or abs(lon_deg) > 180.0:
        field, value = ("latitude", lat_deg) if abs(lat_deg) >= 90.0 else ("longitude", lon_deg)
        allowed = "the latitude must be within +-90 degrees, the longitude within +-180 degrees"
        text = f"start at latitude {lat_deg}, longitude {lon_deg}: {allowed}"
        raise FlightError(text, field=field, value=value, allowed=allowed)
    if not terrain_amsl < amsl < 11000.0:
        allowed = f"must be above the ground ({terrain_amsl} m) and below 11000 m"
        raise FlightError(f"start at {amsl} m above sea level: {allowed}", field="start", value=amsl, allowed=allowed)


# ----------------------------------------------------------------------
# Loading of an aircraft's model into a JSBSim instance, from a checked copy.

# Maximum relative difference between a stated mass and the model's mass.
MASS_TOLERANCE = 0.01


def load_model(
    instance: Any,
    copy: Path,
    aircraft: Aircraft,
    dt: float,
    read_output: Callable[[], str],
    *,
    flat_earth: bool,
    is_tested: bool,
    gear: Gear | None = None,
) -> None:
    """Check a model, copy it into an empty folder, and load it from there.

    The model is copied because some models write into their own folder.

    instance: a JSBSim instance without a model, created for the folder ``copy``.
    copy: the empty folder.
    dt: time step, s.
    read_output: function that returns the text that JSBSim has printed so far.
    flat_earth, is_tested, gear: see `Fdm`.

    Raises FlightError for a model that is missing, refused or not loadable.
    """
    instance.set_debug_level(0)
    files = check_model(
        aircraft.model_file,
        instance.get_property_manager().hasNode,
        aircraft.model_folders,
        shipped=bool(aircraft.model.shipped),
    )
    if not is_tested:
        try_model(aircraft)
    folder = copy / aircraft.name
    folder.mkdir()
    for name, data in files.items():
        # JSBSim looks for a file with the folder's name.
        is_main = name == aircraft.model_file.name
        target_name = f"{aircraft.name}.xml" if is_main else name
        (folder / target_name).write_bytes(
            with_contacts(data, aircraft, gear) if is_main and gear is not None else data
        )
    instance.set_aircraft_path(str(copy))
    instance.set_engine_path(str(folder))
    instance.set_systems_path(str(folder))
    instance.set_dt(dt)
    if flat_earth:
        planet = copy / "flat.xml"
        planet.write_text(FLAT_PLANET, encoding="utf-8")
        instance.load_planet(str(planet), False)
    try:
        loaded = instance.load_model(aircraft.name)
    # JSBSim's own errors are RuntimeErrors.
    except (RuntimeError, ValueError, OSError) as error:
        message = " ".join(str(error).split()).replace(str(folder), str(aircraft.model_file.parent))
        raise FlightError(f"{aircraft.model_file}: JSBSim: {message}", file=aircraft.model_file) from None
    if not loaded:
        reason = jsbsim_reason(read_output()) or "no reason is given"
        raise FlightError(f"{aircraft.model_file}: JSBSim cannot load this model: {reason}", file=aircraft.model_file)
    # JSBSim adds the fuel's mass when it first runs.
    tanks = (f"propulsion/tank[{k}]/contents-lbs" for k in itertools.count())
    tank_properties = itertools.takewhile(instance.get_property_manager().hasNode, tanks)
    pounds = sum(map(instance.get_property_value, tank_properties), instance.get_property_value("inertia/weight-lbs"))
    mass = pounds * POUND
    if not abs(aircraft.mass - mass) <= MASS_TOLERANCE * mass:
        file = aircraft.folder / f"{aircraft.name}.toml"
        raise FlightError(
            f"{file}: mass_kg = {aircraft.mass:g}: the model"
            f" {aircraft.model_file.name} has {mass:.5g} kg with its fuel; the two may differ by"
            f" at most {100.0 * MASS_TOLERANCE:g} %",
            file=file,
            field="mass_kg",
            value=aircraft.mass,
        )


# Version of JSBSim, part of the keys of cached results.
JSBSIM_VERSION: str = jsbsim.__version__

# Names of the fields of `STATE`, in order.
_STATE_FIELDS = field_names(STATE)
# Function that packs the state's values into an array.
_PACK_STATE: Callable[..., None] = struct.Struct(f"{len(_STATE_FIELDS)}d").pack_into


@dataclass(frozen=True, slots=True)
class Variation:
    """Changes to an aircraft's model, for validation and robustness tests.

    mass, drag: factors on the mass and drag of the whole aircraft.
    control: factor on the moments of the control surfaces.
    parasite_drag: parasite drag coefficient; None keeps the model's value.
    volts: factor on the battery's voltage.
    properties: names and values of further properties of the model, such as ``ident/thrust``.
    """

    mass: float = 1.0
    drag: float = 1.0
    control: float = 1.0
    parasite_drag: float | None = None
    volts: float = 1.0
    properties: tuple[tuple[str, float], ...] = ()


@dataclass(frozen=True, slots=True)
class LoopAccess:
    """Functions for a fast loop, bound once and in JSBSim's units, which avoid the conversions of `Fdm`.

    getters: getters of the state's fields; each value times its factor is SI.
    factors: (1,) of `STATE`.
    setters: setters of the commands, then of the gusts north, east and down, then of the ground's altitude.
    scales: for each setter the factors to JSBSim's units for values above zero, and for other values.
    run: function that advances by one step.
    """

    getters: dict[str, Getter]
    factors: NDArray[np.record]
    setters: tuple[Setter, ...]
    scales: tuple[tuple[float, float], ...]
    run: Callable[[], object]


class Fdm:
    """One aircraft in one JSBSim instance; create a new one for each flight.

    rate_hz: steps per second.
    motor_braking: True if the motor may brake the propeller (current below zero).
    flat_earth: True for a plane without rotation, with constant density 1.2682 kg/m^3 and gravity 9.81 m/s^2, for
        comparison with a textbook; degrees of latitude are then 157 times longer. False for WGS 84 and the standard
        atmosphere.
    is_tested: True if a user's model is known not to abort JSBSim; otherwise `flight.dynamics.model_check` tests it.
    gear: gear to add for ground contact if the model has none; None for a flight without ground contact.

    properties: JSBSim's own properties by name, in its units.
    dt: time step, s.

    Raises FlightError for a model that is missing, refused by `flight.dynamics.model_check`, or not loadable, and for
    an undefined property that the model or this class reads.
    """

    def __init__(
        self,
        aircraft: Aircraft,
        *,
        rate_hz: float = 120.0,
        motor_braking: bool = False,
        flat_earth: bool = False,
        variation: Variation | None = None,
        is_tested: bool = False,
        gear: Gear | None = None,
    ) -> None:
        if not 0.0 < rate_hz < math.inf:
            raise FlightError(f"rate_hz = {rate_hz} is not a positive number", field="rate_hz", value=rate_hz)
        self.aircraft = aircraft
        self.dt = 1.0 / rate_hz
        self.flat_earth = flat_earth
        self._gear = gear
        # Roll, pitch and yaw of all evaluations, one after the other.
        self._attitudes = array("d")
        is_tested = is_tested or aircraft.is_embedded
        with silence() as read_output, temporary_folder("planfly-model-") as folder:
            self._exec = jsbsim.FGFDMExec(str(folder))
            load_model(
                self._exec,
                folder,
                aircraft,
                self.dt,
                read_output,
                flat_earth=flat_earth,
                is_tested=is_tested,
                gear=gear,
            )
        access = PropertyAccess(self._exec.get_property_manager(), aircraft.model_file)
        self.properties = access
        if flat_earth:
            # The atmosphere looks for this name at every step, so a new property must be created here.
            self._exec.set_property_value("atmosphere/override/density", FLAT_DENSITY / SLUG_FT3)
        access.set("simulation/gravity-model", 0.0 if flat_earth else 1.0)
        access.set_optional("motor/braking", float(motor_braking), 0.0)
        variation = variation or Variation()
        if variation.mass != 1.0:
            extra_mass = (variation.mass - 1.0) * aircraft.mass
            point_mass = access.getter("inertia/pointmass-weight-lbs")()
            access.set("inertia/pointmass-weight-lbs", point_mass + extra_mass / POUND)
        access.set_optional("aero/drag-factor", variation.drag, 1.0)
        access.set_optional("aero/control-factor", variation.control, 1.0)
        if variation.parasite_drag is not None:
            access.set("aero/parasite-drag", variation.parasite_drag)
        if variation.volts != 1.0:
            access.set("motor/battery-v", variation.volts * aircraft.battery_voltage)
        for name, value in variation.properties:
            access.set(name, value)
        readings = zip(MODEL_FIELDS, aircraft.model.readings, strict=True)
        properties = STATE_PROPERTIES | {field: (reading.name, reading.factor) for field, reading in readings}
        self._state_getters = [access.getter(properties[field][0]) for field in _STATE_FIELDS]
        self._factors = np.array([properties[field][1] for field in _STATE_FIELDS])
        self._command_setters = [access.command_setter(command) for command in aircraft.model.commands]
        self._wind_setters = [access.setter(name) for name in WIND]
        self._gust_setters = [access.setter(name) for name in GUST]
        self._ic_position = [access.setter(name) for name in IC_POSITION]
        self._ic_motion = [access.setter(name) for name in IC_MOTION]
        self._rate_getters = [access.getter(name) for name in RATES]
        self._read_height = access.getter(HEIGHT)
        self._force_getters = [access.getter(name) for name in FORCES]
        self._read_mass = access.getter(MASS)
        self._run = self._exec.run
        self._engine = Engine(self._exec, self.dt, access.getter, access.setter) if aircraft.model.settles else None
        self._wind = np.zeros(3)
        self._heading = 0.0
        # lat_deg, lon_deg, terrain AMSL. The ground is far below, without ground effect or contact.
        self._start_position = (45.0, 0.0, -1000.0)

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
        """Start a steady flight along a straight path over the ground, and return its trim.

        lat_deg: geodetic.
        amsl, terrain_amsl: m.
        course, climb_angle: course and slope of the path over the ground, rad.
        airspeed: m/s, true.
        wind_ned: velocity of the air, north, east, down, m/s, (3,); it stays as the steady wind.

        Surfaces and motor start at their trimmed values, so that the trim's commands cause no transient. Raises
        FlightError for values out of range, for a wind stronger than the airspeed along the path, and for a flight that
        the aircraft cannot hold.
        """
        wind = np.array(wind_ned, dtype=np.float64)
        numbers = (lat_deg, lon_deg, amsl, course, airspeed, climb_angle, *wind.tolist(), terrain_amsl)
        if len(numbers) != 10 or not all(math.isfinite(number) for number in numbers):
            message = f"start: expected ten finite numbers, three of them the wind; found {numbers}"
            raise FlightError(message, field="start", value=numbers)
        check_start_position(lat_deg, lon_deg, amsl, terrain_amsl)
        velocity = air_velocity(course, climb_angle, airspeed, wind)
        climb = math.asin(-velocity[2] / airspeed)
        self._start_position = (lat_deg, lon_deg, terrain_amsl)
        self._wind = wind
        self._heading = math.atan2(velocity[1], velocity[0])
        trim = steady_flight(self, airspeed, amsl, climb)
        if trim is None:
            raise FlightError(
                f"{self.aircraft.name} cannot hold steady flight at {airspeed:.1f} m/s,"
                f" {math.degrees(climb):+.1f} degrees relative to the air and {amsl:.0f} m above sea level",
                file=self.aircraft.name,
                field="airspeed",
                value=airspeed,
            )
        self.apply_trim(trim.vector())
        self._release_motion()
        return trim

    def start_untrimmed(
        self,
        *,
        attitude: Sequence[float],
        velocity: Sequence[float],
        rates: Sequence[float],
        wind: Sequence[float],
        amsl: float,
        commands: Sequence[float],
    ) -> None:
        """Start a flight in any state, trimmed or not, with surfaces and motor at four commands (4,).

        attitude: roll, pitch, yaw, rad.
        velocity: north, east, down over the ground, m/s.
        rates: p, q, r, rad/s.
        wind: velocity of the air, north, east, down, m/s; it stays as the steady wind.
        amsl: m.
        """
        self._wind = np.array(wind, dtype=np.float64)
        self.move_to(amsl)
        self._evaluate(attitude, np.array(velocity, dtype=np.float64), rates, commands, settle=True)
        self._release_motion()

    def release(
        self,
        position: Sequence[float],
        attitude: Sequence[float],
        velocity: Sequence[float],
        *,
        wind: Sequence[float] = (0.0, 0.0, 0.0),
        terrain_amsl: float = 0.0,
        commands: Sequence[float] = (0.0, 0.0, 0.0, 0.0),
    ) -> None:
        """Release the aircraft in any state without a trim, such as at rest on the ground or at a hand launch.

        position: lat_deg, lon_deg (geodetic) and amsl (m).
        attitude: roll, pitch, yaw (true), rad.
        velocity: north, east, down over the ground, m/s.
        wind: velocity of the air, north, east, down, m/s, (3,); it stays as the steady wind.
        terrain_amsl: m.
        commands: (4,) commands at which surfaces and motor start.

        Raises FlightError for values that are not finite, and for an invalid position.
        """
        numbers = (*position, *attitude, *velocity, *wind, terrain_amsl, *commands)
        if len(numbers) != 17 or not all(math.isfinite(number) for number in numbers):
            raise FlightError(f"release: expected 17 finite numbers; found {numbers}", field="start", value=numbers)
        lat_deg, lon_deg, amsl = position
        # On the ground the aircraft's reference point may be at ground level: its contacts reach below it.
        check_start_position(lat_deg, lon_deg, amsl, min(terrain_amsl, amsl - 1.0))
        self._start_position = (lat_deg, lon_deg, terrain_amsl)
        self.start_untrimmed(
            attitude=attitude, velocity=velocity, rates=(0.0, 0.0, 0.0), wind=wind, amsl=amsl, commands=commands
        )

    def _release_motion(self) -> None:
        """Start the motion at time 0 from the initial conditions that have been set."""
        if self._engine:
            self._engine.release()
        self._exec.set_trim_status(False)
        self._exec.set_sim_time(0.0)
        # During the initial conditions the wind is set as a gust, because they overwrite the wind.
        self.set_wind(*self._wind)
        self.set_gust(0.0, 0.0, 0.0)

    def step(self, count: int = 1) -> None:
        """Advance by ``count`` steps of ``dt`` seconds."""
        run_step = self._run
        for _ in range(count):
            run_step()

    def read(self) -> Record:
        """Read the state, a record of `flight.dynamics.state.STATE`."""
        values = np.empty(len(_STATE_FIELDS))
        _PACK_STATE(values, 0, *[getter() for getter in self._state_getters])
        np.multiply(values, self._factors, values)
        return values.view(STATE)[0]

    def write(self, commands: Iterable[float]) -> None:
        """Set four commands, in the order of `flight.dynamics.state.Commands`; they act in the next step."""
        for setter, value in zip(self._command_setters, commands, strict=True):
            setter(value)

    def set_wind(self, north: float, east: float, down: float) -> None:
        """Set the steady wind by the velocity of the air, m/s: its north, east and down components."""
        for setter, value in zip(self._wind_setters, (north, east, down), strict=True):
            setter(value / FOOT)

    def set_gust(self, north: float, east: float, down: float) -> None:
        """Set the gust, which is added to the steady wind, by its north, east and down components, m/s."""
        for setter, value in zip(self._gust_setters, (north, east, down), strict=True):
            setter(value / FOOT)

    def loop_access(self) -> LoopAccess:
        """Return the functions that a fast loop needs to read, set and step this instance."""
        commands = self.aircraft.model.commands
        names = [*(command.name for command in commands), *GUST, TERRAIN]
        return LoopAccess(
            getters=dict(zip(_STATE_FIELDS, self._state_getters, strict=True)),
            factors=self._factors.view(STATE),
            setters=tuple(self.properties.setter(name) for name in names),
            scales=(*((command.above, command.below) for command in commands), *4 * [(1.0 / FOOT, 1.0 / FOOT)]),
            run=self._run,
        )

    @property
    def terrain_amsl(self) -> float:
        """Altitude of the ground in the initial conditions, m."""
        return self._start_position[2]

    def model_text(self) -> bytes:
        """Return the XML of the model, with the contacts of the gear if this instance has added one."""
        model = self.aircraft.model_file.read_bytes()
        return model if self._gear is None else with_contacts(model, self.aircraft, self._gear)

    def attitudes(self) -> Floats:
        """Return roll, pitch and yaw of the n initial conditions evaluated so far, in call order, rad, (n, 3)."""
        return np.array(self._attitudes).reshape(-1, 3)

    def specific_force(self) -> tuple[float, float, float]:
        """Return the specific force along the body axes, as measured at the center of gravity, m/s^2."""
        x, y, z = self._force_getters
        factor = FOOT / self._read_mass()
        return x() * factor, y() * factor, z() * factor

    def height(self) -> float:
        """Return the height above ground, m, negative below it; the ground has the altitude that was set last."""
        return self._read_height() * FOOT

    # Functions for trims and linearization.

    def surface_limits(self) -> tuple[float, float, float]:
        """Return the elevator, aileron and rudder limits in either direction, rad."""
        return self.aircraft.max_elevator, self.aircraft.max_aileron, self.aircraft.max_rudder

    def first_guess(self) -> Floats:
        """Return the trim vector from which a trim search starts, (8,): approximate level flight at cruise."""
        return first_guess(self.aircraft.airspeed)

    def move_to(self, amsl: float) -> None:
        """Move the aircraft to an altitude (m) for `apply_trim` and `derivatives`; this ends any flight."""
        lat_deg, lon_deg, terrain = self._start_position
        for setter, value in zip(self._ic_position, (lat_deg, lon_deg, terrain / FOOT, amsl / FOOT), strict=True):
            setter(value)
        self.set_gust(*self._wind)
        self._exec.set_trim_status(True)
        if self._engine:
            self._engine.hold()

    def apply_trim(self, values: Floats) -> Floats:
        """Set the state that a trim vector (8,) describes, and return its body accelerations (6,).

        The accelerations are m/s^2 and rad/s^2. A flight starts in this state, and `derivatives` takes the engine speed
        from it.
        """
        airspeed, climb, alpha, bank, *commands = values.tolist()
        axes = body_axes(self._heading, climb, bank, alpha)
        # Sums written out give the same result on every machine: see `world.least_squares`.
        air = (axes * np.array([math.cos(alpha), 0.0, math.sin(alpha)])).sum(axis=1) * airspeed
        return self._evaluate(euler(axes), air + self._wind, (0.0, 0.0, 0.0), commands, settle=True)[:6]

    def derivatives(self, states: Floats, commands: Floats) -> Floats:
        """Return the state derivatives (8,) of (u, v, w, p, q, r, roll, pitch) with these commands (4,).

        Surfaces and motor have their commanded values. An engine keeps its speed from the last `apply_trim`.
        """
        roll, pitch = states[6], states[7]
        axes = body_axes(self._heading, pitch, roll, 0.0)
        velocity = (axes * states[:3]).sum(axis=1) + self._wind
        return self._evaluate((roll, pitch, self._heading), velocity, tuple(states[3:6]), commands)

    def _evaluate(
        self,
        angles: Sequence[float],
        velocity: Floats,
        rotation_rates: Sequence[float],
        commands: Iterable[float],
        settle: bool = False,
    ) -> Floats:
        """Set JSBSim's initial conditions, and return the eight rates of `RATES` there, in SI units and rad.

        angles: roll, pitch, yaw, rad.
        velocity: (3,) north, east, down over the ground, m/s.
        rotation_rates: p, q, r, rad/s.
        commands: the four commands, which actuators follow without lag.
        settle: True to let an engine's speed settle, False to keep it.
        """
        self._attitudes.extend(angles)
        # Trim status bypasses the lag of the actuators.
        self.write(commands)
        for setter, value in zip(self._ic_motion, (*angles, *(velocity / FOOT), *rotation_rates), strict=True):
            setter(value)
        self._exec.run_ic()
        if self._engine:
            self._engine.settle(spin=settle)
            self._exec.run_ic()
        return np.array([getter() for getter in self._rate_getters]) * RATE_FACTORS
