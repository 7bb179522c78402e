"""The parameters that an autopilot gets for a flight: the simulation's, the aircraft's, and a person's on top."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from aircraft.catalog import Aircraft
from flight.ardupilot.parameter_file import read_parameter_file
from flight.ardupilot.parameters import AIRCRAFT_FILE, DEFINITIONS
from flight.real_autopilot.servo_map import ServoMap
from flight.simulation.flight_setup import FlightSetup

# What our physics and a start in the air need, whatever the aircraft.
SIMULATION = {
    # As often as JSBSim steps.
    "SIM_RATE_HZ": 120.0,
    # No radio, no battery monitor, no terrain data, and no other serial ports: nothing of these fails.
    "FLTMODE_CH": 0.0,
    "THR_FAILSAFE": 0.0,
    "FS_SHORT_ACTN": 3.0,
    "FS_LONG_ACTN": 0.0,
    "BATT_MONITOR": 0.0,
    "TERRAIN_ENABLE": 0.0,
    "SERIAL1_PROTOCOL": -1.0,
    "SERIAL2_PROTOCOL": -1.0,
    # The simulated airspeed sensor, as it is wired and set to zero.
    "ARSPD_TYPE": 2.0,
    "ARSPD_USE": 1.0,
    "ARSPD_PIN": 1.0,
    "ARSPD_SKIP_CAL": 1.0,
    "ARSPD_OFFSET": 2013.0,
    # It is armed in the air.
    "ARMING_CHECK": 0.0,
    "LOG_FILE_DSRMROT": 0.0,
    # It tells what it is asked for, and no more.
    **dict.fromkeys(
        [f"SR0_{name}" for name in ("RAW_SENS", "EXT_STAT", "RC_CHAN", "POSITION", "EXTRA1", "EXTRA2", "EXTRA3")], 0.0
    ),
}
# A person's parameters that say how an aircraft flies begin so; others belong to the hardware that they were read from.
FLYING = (
    *("NAVL1_", "WP_", "TECS_", "AIRSPEED_", "ROLL_LIMIT_DEG", "PTCH_", "RLL_", "YAW_", "YAW2SRV_", "KFF_", "THR_"),
    *("TRIM_THROTTLE", "SCALING_SPEED", "STALL_PREVENTION", "GLIDE_SLOPE_", "RTL_", "STAB_PITCH_DOWN", "LEVEL_ROLL_"),
    *("FLIGHT_OPTIONS", "TKOFF_", "LAND_", "USE_REV_THRUST", "ACRO_", "GUIDED_", "MIN_GROUNDSPEED", "AHRS_WIND_MAX"),
)


@dataclass(frozen=True, slots=True)
class AutopilotParameters:
    """Parameters by name.

    given: all that the autopilot gets over its own defaults.
    changed: of those the person's, where they differ from the aircraft's or are not among them.
    unused: the person's that belong to other hardware.
    """

    given: Mapping[str, float]
    changed: Mapping[str, float]
    unused: tuple[str, ...] = ()


def autopilot_parameters(
    setup: FlightSetup, aircraft: Aircraft, servos: ServoMap, own: Mapping[str, float]
) -> AutopilotParameters:
    """Put the parameters of a flight together; own: the person's.  Raises ParameterError for a bad file.

    The mission's speed is the cruise speed, unless the person has one.
    """
    base = SIMULATION | servos.parameters() | load_aircraft_parameters(aircraft)
    base["AIRSPEED_CRUISE"] = setup.airspeed
    flying = {name: value for name, value in own.items() if name.startswith(FLYING)}
    changed = {name: value for name, value in flying.items() if base.get(name) != value}
    return AutopilotParameters(base | flying, changed, tuple(sorted(own.keys() - flying.keys())))


def load_aircraft_parameters(aircraft: Aircraft) -> dict[str, float]:
    """ArduPlane's parameters for an aircraft, from its folder.  Raises ParameterError, in one line."""
    return {name: entry.value for name, entry in read_parameter_file(aircraft.folder / AIRCRAFT_FILE).items()}


def person_parameters(setup: FlightSetup) -> dict[str, float]:
    """What the scenario's file of parameters states, by present names and in their units.

    Raises ParameterError, in one line, for a file that cannot be read or states what is not allowed.
    """
    file = setup.scenario.flight.params
    if file is None:
        return {}
    old = {definition.old[0] for definition in DEFINITIONS.values() if definition.old is not None}
    stated = {name: entry.value for name, entry in read_parameter_file(Path(file)).items() if name not in old}
    return stated | ({} if setup.parameters is None else setup.parameters.by_origin("file"))
