"""Start ArduPlane's program for a flight, with its parameters."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

from aircraft.catalog import Aircraft
from flight.autopilots.arduplane.parameters import DEFINITIONS
from flight.autopilots.parameter_files import LONGEST_NAME, read_parameter_file
from flight.autopilots.parameter_set import AIRCRAFT_FILE
from flight.autopilots.sitl.exchange import LOOPBACK
from flight.autopilots.sitl.link import free_ports
from flight.autopilots.sitl.process import Launch
from flight.autopilots.sitl.servos import ServoMap
from flight.mission.items import Home
from flight.simulation.setup import FlightSetup

_DEFAULTS_FILE = "defaults.parm"
# Limit of the program's speed-up against the clock: it runs as fast as the physics answers.
_SPEEDUP = 1000


def arduplane_launch(
    home: Home, heading: float, parameters: Mapping[str, float], physics_port: int, link_port: int
) -> Callable[[Path], Launch]:
    """Return a function that prepares a folder for the ArduPlane program and returns its command line.

    home: start position of the aircraft.
    heading: heading at the start, degrees.
    parameters: the program's defaults for this flight, by name.
    physics_port, link_port: ports on this machine of the physics (UDP) and of planfly's MAVLink connection (TCP).
    """

    def prepare(folder: Path) -> Launch:
        """Write the program's defaults into a folder, and return its command line."""
        text = "".join(f"{name} {value:.9g}\n" for name, value in parameters.items())
        (folder / _DEFAULTS_FILE).write_text(text, encoding="ascii")
        start_position = f"{home.lat_deg:.9f},{home.lon_deg:.9f},{home.alt:.3f},{heading:.2f}"
        ports = free_ports(3)
        arguments = (
            *("--model", f"JSON:{LOOPBACK}"),
            *("--speedup", str(_SPEEDUP)),
            *("--home", start_position),
            *("--base-port", str(ports[0]), "-I", "0"),
            *("--sim-port-out", str(physics_port), "--sim-port-in", str(ports[1]), "--rc-in-port", str(ports[2])),
            *("--serial0", f"tcpclient:{LOOPBACK}:{link_port}"),
            *("--wipe", "--defaults", str(folder / _DEFAULTS_FILE)),
        )
        # By default the program stays in a loop after a panic.
        return Launch(arguments, {"SITL_PANIC_EXIT": "1"})

    return prepare


# Parameters for planfly's physics and a start in the air, for any aircraft.
SIMULATION = {
    # Rate of JSBSim's steps.
    "SIM_RATE_HZ": 120.0,
    # No radio, no terrain data, and no other serial ports, so that none of these can fail.
    "FLTMODE_CH": 0.0,
    "THR_FAILSAFE": 0.0,
    "FS_SHORT_ACTN": 3.0,
    "FS_LONG_ACTN": 0.0,
    "TERRAIN_ENABLE": 0.0,
    "SERIAL1_PROTOCOL": -1.0,
    "SERIAL2_PROTOCOL": -1.0,
    # The simulated airspeed sensor, with its wiring and calibration.
    "ARSPD_TYPE": 2.0,
    "ARSPD_USE": 1.0,
    "ARSPD_PIN": 1.0,
    "ARSPD_SKIP_CAL": 1.0,
    "ARSPD_OFFSET": 2013.0,
    # The autopilot is armed in the air.
    "ARMING_CHECK": 0.0,
    "LOG_FILE_DSRMROT": 0.0,
    # The autopilot sends only the requested messages.
    **dict.fromkeys(
        [f"SR0_{name}" for name in ("RAW_SENS", "EXT_STAT", "RC_CHAN", "POSITION", "EXTRA1", "EXTRA2", "EXTRA3")], 0.0
    ),
}
# Battery voltage and current are measured, so that the autopilot's log contains them (BAT). No battery failsafe ends a
# flight: the verdict judges energy.
_MEASURED = {"BATT_MONITOR": 4.0, "BATT_FS_LOW_ACT": 0.0, "BATT_FS_CRT_ACT": 0.0, "BATT_LOW_VOLT": 0.0}
_UNMEASURED = {"BATT_MONITOR": 0.0}
# Prefixes of the user's parameters for flight; others belong to the hardware of the file.
FLYING = (
    *("NAVL1_", "WP_", "TECS_", "AIRSPEED_", "ROLL_LIMIT_DEG", "PTCH_", "PTCH2SRV_", "RLL_", "RLL2SRV_", "YAW_"),
    *("YAW2SRV_", "KFF_", "THR_"),
    *("TRIM_THROTTLE", "SCALING_SPEED", "STALL_PREVENTION", "GLIDE_SLOPE_", "RTL_", "STAB_PITCH_DOWN", "LEVEL_ROLL_"),
    *("ALT_SLOPE_", "CLIMB_SLOPE_HGT", "RALLY_LIMIT_KM", "RALLY_INCL_HOME", "ARSPD_USE", "MIS_OPTIONS"),
    *("FLIGHT_OPTIONS", "TKOFF_", "LAND_", "USE_REV_THRUST", "ACRO_", "GUIDED_", "MIN_GROUNDSPEED", "AHRS_WIND_MAX"),
)


# Names in 4.7 by the names in 4.6, of the parameters that 4.7 renamed.
RENAMED_IN_4_7 = {"GLIDE_SLOPE_MIN": "ALT_SLOPE_MIN", "GLIDE_SLOPE_THR": "ALT_SLOPE_MAXHGT"}


@dataclass(frozen=True, slots=True)
class ArduPlaneFlightParameters:
    """Parameters of a flight of ArduPlane's program, by name.

    values: all parameters that replace ArduPlane's own defaults; a parameter that 4.7 renamed is contained under both
        names, of which a program knows one.
    changed: values that the user's file states and that differ from the aircraft's, or that the aircraft lacks.
    unused: names in the user's file that ArduPlane does not get, because they belong to other hardware.
    """

    values: Mapping[str, float]
    changed: Mapping[str, float]
    unused: tuple[str, ...] = ()


def collect_arduplane_parameters(
    setup: FlightSetup, aircraft: Aircraft, servos: ServoMap, user_parameters: Mapping[str, float]
) -> ArduPlaneFlightParameters:
    """Collect the parameters for a flight of the ArduPlane program.

    They come from the simulation, the aircraft and the user. AIRSPEED_CRUISE is the mission's airspeed, unless the user
    states a value. Raises ParameterError if a file is invalid.
    """
    battery = _MEASURED if aircraft.battery_voltage else _UNMEASURED
    base = SIMULATION | battery | servos.parameters() | load_aircraft_parameters(aircraft)
    base["AIRSPEED_CRUISE"] = setup.airspeed
    flight_values = {name: value for name, value in user_parameters.items() if name.startswith(FLYING)}
    changed_values = {name: value for name, value in flight_values.items() if base.get(name) != value}
    return ArduPlaneFlightParameters(
        with_names_of_4_6(base | flight_values),
        changed_values,
        tuple(sorted(user_parameters.keys() - flight_values.keys())),
    )


def with_names_of_4_6(values: Mapping[str, float]) -> dict[str, float]:
    """Add the 4.6 name, with the same value, for each parameter that 4.7 has renamed.

    >>> with_names_of_4_6({"ALT_SLOPE_MIN": 20.0, "WP_RADIUS": 90.0})
    {'ALT_SLOPE_MIN': 20.0, 'WP_RADIUS': 90.0, 'GLIDE_SLOPE_MIN': 20.0}
    """
    return {**values, **{name: values[new_name] for name, new_name in RENAMED_IN_4_7.items() if new_name in values}}


def load_aircraft_parameters(aircraft: Aircraft) -> dict[str, float]:
    """Return ArduPlane's parameters for an aircraft, from its folder.

    Raises ParameterError, in one line, if the file is invalid.
    """
    return {name: entry.value for name, entry in read_parameter_file(aircraft.folder / AIRCRAFT_FILE).items()}


def load_user_parameters(setup: FlightSetup) -> dict[str, float]:
    """Return the user's parameters from the scenario's parameter file and from its RTL settings.

    The result includes parameters that are assumed for a mission with a landing, because ArduPlane would otherwise not
    arm.

    The RTL settings have priority over the file. Older names, and names that are too long for MAVLink, are left out.

    Raises ParameterError, in one line, if the file cannot be read or states a value that is not allowed.
    """
    file, parameters = setup.scenario.flight.params, setup.autopilot.parameters
    scenario_values = {} if parameters is None else parameters.by_origin("assumed") | parameters.by_origin("file")
    if file is None:
        return scenario_values
    old_names = {definition.old[0] for definition in DEFINITIONS.values() if definition.old is not None}
    file_values = {
        name: entry.value
        for name, entry in read_parameter_file(Path(file)).items()
        if name not in old_names and len(name) <= LONGEST_NAME
    }
    return file_values | scenario_values
