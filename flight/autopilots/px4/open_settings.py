"""Describe PX4's settings that leave an aircraft without a position, without control, or not armed.

docs/px4-branches.md lists the functions that read them.
"""

import math
from collections.abc import Iterator

from aircraft.catalog import Aircraft
from flight.autopilots.parameter_files import read_parameter_file
from flight.autopilots.parameter_set import AIRCRAFT_FILE
from flight.autopilots.px4.parameters import OUTPUT_FUNCTION_NAMES, SLEW_NAMES, Px4Parameters
from flight.autopilots.rate_loop import RateGains, judge_rate_gains

# Bits of EKF2_GPS_CTRL: position and altitude.
_GPS_POSITION_BIT = 1 << 0
_GPS_ALTITUDE_BIT = 1 << 1
# Settings of which each that is not 0 connects a GPS, the last two in a simulator.
_GPS_CONNECTIONS = (
    *("GPS_1_CONFIG", "GPS_2_CONFIG", "SEP_PORT1_CFG", "UAVCAN_ENABLE", "CYPHAL_ENABLE"),
    *("SENS_EN_GPSSIM", "SIM_GZ_EN"),
)
# Values of CA_SV_CSn_TYPE by the part that they move: ailerons; elevator, V-tails; elevons and custom surfaces both.
_BOTH_AXES = (5.0, 6.0, 12.0)
_SURFACES_BY_PART = {
    "ailerons": (1.0, 2.0, 15.0, *_BOTH_AXES),
    "elevator": (3.0, 7.0, 8.0, 13.0, 14.0, *_BOTH_AXES),
}
# End of the name of a surface's torque by the part; without it the allocation does not move the surface.
_TORQUE_BY_PART = {"ailerons": "TRQ_R", "elevator": "TRQ_P"}
# CA_AIRFRAME of a fixed wing.
_FIXED_WING = 1.0
# First and last output function of each part.
_OUTPUT_FUNCTIONS_BY_PART = {"motor": (101.0, 112.0), "surface": (201.0, 208.0)}
# ArduPlane's gains of an aircraft that PX4 has under another name. ArduPlane's give degrees, of 45, per degree a
# second, PX4's fractions of the throw per radian a second; both apply at cruise speed.
_GAIN_NAMES = {
    "RLL_RATE_FF": "FW_RR_FF",
    "RLL_RATE_P": "FW_RR_P",
    "RLL_RATE_I": "FW_RR_I",
    "PTCH_RATE_FF": "FW_PR_FF",
    "PTCH_RATE_P": "FW_PR_P",
    "PTCH_RATE_I": "FW_PR_I",
}
_GAIN_FACTOR = math.degrees(1.0) / 45.0


def describe_open_settings(parameters: Px4Parameters, aircraft: Aircraft | None, *, by_program: bool) -> Iterator[str]:
    """Yield a sentence for each setting that leaves PX4 without a position, or without attitude control.

    Such settings leave controls unconnected, slow them down, or state gains that are too low or too high. The texts
    have no full stop.

    aircraft: None if the aircraft is not known.
    by_program: True if PX4's own program flies, which uses the gains of the rate controllers.
    """
    # Settings with which EKF2 has no position or no altitude.
    gps_bits = int(parameters["EKF2_GPS_CTRL"])
    if not gps_bits & _GPS_POSITION_BIT:
        yield f"EKF2_GPS_CTRL {gps_bits} takes no position from GPS, which is not simulated"
    has_barometer = parameters["EKF2_BARO_CTRL"] > 0.0 and parameters["SYS_HAS_BARO"] > 0.0
    if not has_barometer and not gps_bits & _GPS_ALTITUDE_BIT:
        yield f"EKF2_GPS_CTRL {gps_bits} without a barometer leaves no altitude, which is not simulated"
    if not any(parameters[name] for name in _GPS_CONNECTIONS):
        yield "GPS_1_CONFIG 0 connects no GPS, which is not simulated"
    # A control allocation of the file that is for another airframe, or lacks ailerons, elevator or motor. Parameters
    # without control allocation (SYS_CTRL_ALLOC 0) state no airframe.
    file_values = parameters.by_origin("file")
    if parameters["CA_AIRFRAME"] != _FIXED_WING:
        if "CA_AIRFRAME" in file_values and parameters["SYS_CTRL_ALLOC"] != 0.0:
            yield f"CA_AIRFRAME {parameters['CA_AIRFRAME']:g} is not a fixed wing, which is not simulated"
    else:
        if file_values.get("CA_ROTOR_COUNT", 1.0) == 0.0:
            yield "CA_ROTOR_COUNT 0 leaves no motor, which is not simulated"
        surfaces = [f"CA_SV_CS{surface}_TYPE" for surface in range(int(file_values.get("CA_SV_CS_COUNT", 0.0)))]
        if "CA_SV_CS_COUNT" in file_values and file_values.keys() >= set(surfaces):
            for part, types in _SURFACES_BY_PART.items():
                torque = _TORQUE_BY_PART[part]
                moved_types = {
                    file_values[name] for name in surfaces if file_values.get(name.replace("TYPE", torque), 1.0) != 0.0
                }
                if moved_types.isdisjoint(types):
                    yield f"CA_SV_CS_COUNT {len(surfaces)} and CA_SV_CS*_TYPE leave no {part}, which is not simulated"
    # Slew rate limits are given in s for the whole range (`ControlAllocation::applySlewRateLimit`).
    for name in SLEW_NAMES:
        if (value := file_values.get(name, 0.0)) > 0.0:
            yield f"{name} {value:g} s slows an actuator output, which is not simulated"
    # Output functions that connect no motor or no control surface.
    functions = {file_values[name] for name in OUTPUT_FUNCTION_NAMES if name in file_values}
    for part, (first_function, last_function) in _OUTPUT_FUNCTIONS_BY_PART.items():
        if functions and not any(first_function <= function <= last_function for function in functions):
            yield f"the output functions (PWM_MAIN_FUNC1 and others) connect no {part}, which is not simulated"
    if not by_program:
        # Gains of the user's file that are too low or too high to control the attitude. The gains in the aircraft's
        # file for ArduPlane, and PX4's defaults, are assumed to suit the aircraft.
        has_aircraft_gains = aircraft is not None and (aircraft.folder / AIRCRAFT_FILE).exists()
        aircraft_gains = rate_gains(aircraft) if aircraft is not None and has_aircraft_gains else {}
        for axis, time_constant in (("FW_RR", "FW_R_TC"), ("FW_PR", "FW_P_TC")):
            names = [f"{axis}_{gain}" for gain in ("FF", "P", "I", "D")]
            if file_values.keys().isdisjoint((*names, time_constant)):
                continue
            default = parameters.table.by_name[names[0]].default
            feed_forwards = (aircraft_gains.get(names[0]) or default, default)
            fault = judge_rate_gains(
                RateGains(*(parameters[name] for name in names)),
                (min(feed_forwards), max(feed_forwards)),
                parameters[time_constant],
            )
            if fault:
                gains_text = ", ".join(f"{name} {parameters[name]:g}" for name in [*names, time_constant])
                yield f"{gains_text}: these gains are {fault} to hold the attitude, which is not simulated"


def rate_gains(aircraft: Aircraft) -> dict[str, float]:
    """Return PX4's rate controller gains by name, converted from the aircraft's gains for ArduPlane.

    Raises ParameterError if the file is invalid.

    >>> from aircraft.catalog import load_aircraft
    >>> round(rate_gains(load_aircraft("aerosonde"))["FW_RR_FF"], 2)
    0.33
    """
    entries = read_parameter_file(aircraft.folder / AIRCRAFT_FILE)
    return {
        name: entries[arduplane_name].value * _GAIN_FACTOR
        for arduplane_name, name in _GAIN_NAMES.items()
        if arduplane_name in entries
    }
