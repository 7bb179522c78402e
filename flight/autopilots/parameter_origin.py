"""Find the autopilot and the vehicle that a parameter file was written for.

QGroundControl writes both as comments at the head of the file ("# Stack: PX4 Pro", "# Vehicle: Fixed Wing"). In other
files the names show them: PX4 and ArduPilot share hardly any, and ArduPilot's vehicles differ in the names of their
controllers (parameter references of ArduPilot and PX4).
"""

import re
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import NamedTuple

from flight.autopilots.parameter_files import MAX_BYTES, Entry, parse_parameters
from world.errors import ParameterError
from world.files import read_small_file, utf8_text

# Names of the autopilots in a scenario, and with `--autopilot`.
ARDUPILOT = "ardupilot"
PX4 = "px4"
TITLES: Mapping[str, str] = {ARDUPILOT: "ArduPilot", PX4: "PX4"}
_MODELS: Mapping[str, str] = {ARDUPILOT: "ArduPlane", PX4: "PX4", "planfly": "planfly's own guidance"}

# Weight of a header in parameter names; it is low because the parameters below the header may have been replaced.
_HEADER_WEIGHT = 3
# A file belongs to an autopilot if the file has this many times as many names of it as of the other autopilot.
_CLEAR_MAJORITY = 4
# Number of names that are shown as evidence.
_SHOWN_NAMES = 3

_STACK = re.compile(r"^\s*#+\s*stack\s*:\s*(.+?)\s*$", re.IGNORECASE | re.MULTILINE)
_VEHICLE = re.compile(r"^\s*#+\s*vehicle\s*:\s*(.+?)\s*$", re.IGNORECASE | re.MULTILINE)
_PROGRAM = re.compile(r"^\s*#.*\b(ArduPlane|ArduCopter|ArduRover|APMrover2|ArduSub|AntennaTracker)\b", re.I | re.M)


def _compile_names(names: str) -> re.Pattern[str]:
    """Compile a pattern that matches any of some names, which are separated by blanks.

    A name that ends with an underscore also matches names that begin with it.
    """
    return re.compile("|".join(f"{name}.*" if name.endswith("_") else name for name in names.split()))


_PX4_NAMES = _compile_names(
    "HIL_ACT_ PCA9685_ TAP_ESC_ VOXL2_IO_ VOXL_ESC_ "
    "ASPD_ BAT[0-9]?_ CAL_ CA_ CBRK_ COM_ CYPHAL_ EKF2_ FD_ FW_ GF_ GPS_[12]_ GND_L1_ GND_SPEED_ GND_THR_ IMU_ LNDFW_ "
    "LNDMC_ LPE_ MAN_ MAV_COMP_ID MAV_SYS_ID MAV_TYPE MAV_[0-9]_ MC_ MIS_COMMAND_TOUT MIS_DIST_ MIS_LTRMIN_ALT "
    "MIS_MNT_ MIS_TAKEOFF_ MIS_TKOFF_ MIS_TKO_ MIS_YAW MPC_ NAV_[A-BD-Z].* NPFG_ PWM_AUX_ PWM_MAIN_ PWM_MAX PWM_MIN "
    "RA_ RC_MAP_ RD_ RO_ RTL_CONE_ RTL_DESCEND_ALT RTL_LAND_DELAY RTL_LOITER_RAD RTL_MIN_DIST RTL_RETURN_ALT "
    "RTL_TIME_ RTL_TYPE RWTO_ SDLOG_ SENS_ SEP_ SER_ SIM_GZ_ SYS_ THR_MDL_FAC TRIG_ TRIM_PITCH TRIM_ROLL TRIM_YAW "
    "UAVCAN_ UUV_ VT_ WEIGHT_BASE WEIGHT_GROSS WV_"
)
# Names that only ArduPilot's aeroplanes have; ArduPlane's VTOL parameters begin with Q_.
_ARDUPLANE_NAMES = _compile_names(
    "AIRSPEED_CRUISE AIRSPEED_MAX AIRSPEED_MIN AIRSPEED_STALL ALT_CTRL_ALG ALT_HOLD_ ALT_OFFSET ALT_SLOPE_ "
    "ARSPD[2-6]?_ CLIMB_SLOPE_HGT CRUISE_ALT_FLOOR DSPOILER_ DSPOILR_ ELEVON_ FBW[AB]_ FLAP_ FS_LONG_ FS_SHORT_ "
    "FWD_BAT_ GLIDE_SLOPE_ GROUND_STEER_ KFF_ LAND_FLAP_PERCNT LAND_FLARE_ LAND_OPTIONS LAND_PF_ LAND_PITCH_ "
    "LAND_THR_SLEW LAND_TYPE LAND_WIND_COMP LEVEL_ROLL_LIMIT LIM_ MIN_GNDSPD_CM MIN_GROUNDSPEED MIXING_GAIN "
    "MIXING_OFFSET NAVL1_ PITCH_LIM_ PTCH2SRV_ PTCH_ Q_ RALLY_INCL_HOME RALLY_LIMIT_KM RLL2SRV_ RLL_RATE_ "
    "ROLL_LIMIT_DEG RTL_ALTITUDE RTL_AUTOLAND RTL_CLIMB_MIN RTL_RADIUS RUDDER_ONLY RUDD_DT_GAIN SCALING_SPEED SOAR_ "
    "STAB_PITCH_ STALL_PREVENTION STEER2SRV_ TECS_ TERRAIN_FOLLOW THROTTLE_NUDGE THR_FAILSAFE THR_FS_VALUE THR_MAX "
    "THR_MIN THR_PASS_ THR_SLEWRATE TKOFF_ TRIM_ARSPD_CM TRIM_PITCH_CD TRIM_THROTTLE USE_REV_THRUST WP_LOITER_RAD "
    "WP_MAX_RADIUS YAW2SRV_ YAW_RATE_"
)
_ARDUPILOT_NAMES = _compile_names(
    "ACRO_ AFS_ AHRS_ ARMING_ AUTOTUNE_ BATT[0-9A-G]?_ BRD_ CAM[0-9]?_ CAN_ CHUTE_ COMPASS_ EAHRS_ EK[23]_ FENCE_ "
    "FLIGHT_OPTIONS FLTMODE[0-9_].* FORMAT_VERSION FS_ GPS[12]_ GPS_AUTO_SWITCH GPS_PRIMARY GPS_TYPE.* GROUND_ "
    "ICE_ENABLE ICE_IDLE_ INS_ LOG_ MIS_OPTIONS MIS_RESTART MIS_TOTAL NTF_ RALLY_ RC[0-9]+_REVERSED RCMAP_ RNGFND "
    "RNGFND[0-9]?_ RSSI_ SCHED_ SERIAL[0-9]_ SERVO[0-9_].* SR[0-9]_ STAT_ SYSID_ TERRAIN_ WP_RADIUS"
)
# ArduPilot's other vehicles, by names of their own.
_ARDUPILOT_VEHICLES: Mapping[str, re.Pattern[str]] = {
    "a multicopter or helicopter": _compile_names(
        "ANGLE_MAX ATC_ACCEL_ ATC_ANG_ ATC_INPUT_TC ATC_RATE_ ATC_RAT_ ATC_THR_ CIRCLE_ FRAME FRAME_CLASS "
        "FRAME_TYPE FS_THR_ENABLE FS_THR_VALUE GND_EFFECT_COMP H_ IM_ LAND_ALT_LOW LAND_SPEED LAND_SPEED_HIGH "
        "LOIT_ MOT_ PHLD_ PILOT_ POS[XYZ]_ PSC_ RATE_PIT_ RATE_RLL_ RATE_YAW_ RTL_ALT RTL_ALT_FINAL "
        "RTL_LOIT_TIME RTL_SPEED SIMPLE STB_ SUPER_SIMPLE THROW_ THR_DZ THR_MID VEL[XYZ]_ WPNAV_ "
        "WP_YAW_BEHAVIOR"
    ),
    "a rover or boat": _compile_names(
        "ATC_BAL_ ATC_BRAKE ATC_DECEL_MAX ATC_SAIL_ ATC_SPEED_ ATC_STOP_SPEED ATC_STR_ ATC_TURN_MAX_G "
        "CRASH_ANGLE CRUISE_SPEED CRUISE_THROTTLE LEARN_CH MODE[1-6] MODE_CH PIVOT_TURN_ SAIL_ "
        "SPEED_TURN_GAIN TURN_MAX_G TURN_RADIUS WP_OVERSHOOT WP_PIVOT_ WP_SPEED"
    ),
    "a submarine": _compile_names("FS_LEAK_ENABLE FS_TERRAIN_ENAB JS_ MOT_[0-9]+_DIRECTION SURFACE_DEPTH"),
}
# PX4's other vehicles, by names of their controllers.
_PX4_PLANE = _compile_names("FW_ LNDFW_ NPFG_ RWTO_")
_PX4_VEHICLES: Mapping[str, re.Pattern[str]] = {
    "a multicopter or helicopter": _compile_names("LNDMC_ MC_ MPC_"),
    "a rover or boat": _compile_names("GND_ RA_ RD_ RO_"),
    "a submarine": _compile_names("UUV_"),
}
_VTOL = "a VTOL aircraft"
# Names that only a PX4 VTOL has: PX4's navigator reads VT_B_ in every vehicle.
_PX4_VTOL = _compile_names("VT_ARSP_ VT_FW_ VT_F_ VT_TRANS_ VT_TYPE")
# Words of a "# Vehicle:" header; the first match decides: vehicle names of QGroundControl and MAVLink.
_VEHICLE_WORDS: tuple[tuple[str, str], ...] = (
    (r"vtol|tail-?sitter|tilt-?rotor", _VTOL),
    (r"fixed|plane\b", ""),
    (r"multi|quad|hexa|octo|tri-?copter|copter|coaxial|heli", "a multicopter or helicopter"),
    (r"rover|boat|car\b", "a rover or boat"),
    (r"\bsub", "a submarine"),
    (r"airship|balloon|blimp|tracker", "another vehicle than an aeroplane"),
)
# MAV_TYPE and CA_AIRFRAME of PX4, by value: MAVLink's common.xml, PX4's parameter reference.
_PX4_TYPES: Mapping[str, Mapping[int, str]] = {
    "MAV_TYPE": dict.fromkeys((2, 3, 4, 13, 14, 15), "a multicopter or helicopter")
    | dict.fromkeys((10, 11), "a rover or boat")
    | dict.fromkeys(range(19, 26), _VTOL)
    | {12: "a submarine"},
    "CA_AIRFRAME": dict.fromkeys((2, 3, 4), _VTOL)
    | dict.fromkeys((5, 6, 13), "a rover or boat")
    | dict.fromkeys((8, 10, 11, 12), "a multicopter or helicopter"),
}
_PROGRAMS: Mapping[str, str] = {
    "arduplane": "",
    "arducopter": "a multicopter or helicopter",
    "ardurover": "a rover or boat",
    "apmrover2": "a rover or boat",
    "ardusub": "a submarine",
    "antennatracker": "another vehicle than an aeroplane",
}


class ParameterOrigin(NamedTuple):
    """Autopilot and vehicle that a parameter file was written for.

    autopilot: "ardupilot" or "px4"; "" if neither is clear.
    vehicle: the vehicle in words if it is not an aeroplane; "" for an aeroplane, or if unknown.
    evidence: the header or the names from which this follows.
    mixed: True for a file with names of both autopilots, in which neither has a clear majority.
    """

    autopilot: str
    vehicle: str = ""
    evidence: str = ""
    mixed: bool = False


def parameter_origin(text: str, entries: Mapping[str, Entry]) -> ParameterOrigin:
    r"""Return the autopilot and the vehicle for which a parameter file was written.

    Each parameter name is a vote for the autopilot that has such a parameter, and a header has `_HEADER_WEIGHT`
    votes. Without a majority of `_CLEAR_MAJORITY` to 1 the result is mixed.

    text: text of the file.
    entries: parameters of the file.

    >>> text = "FW_AIRSPD_TRIM 15\nNAV_ACC_RAD 30\n"
    >>> parameter_origin(text, parse_parameters(text, "a.params"))
    ParameterOrigin(autopilot='px4', vehicle='', evidence='FW_AIRSPD_TRIM, NAV_ACC_RAD', mixed=False)
    >>> text = "ATC_RAT_RLL_P,0.1\nWPNAV_SPEED,500\n"
    >>> parameter_origin(text, parse_parameters(text, "b.param")).vehicle
    'a multicopter or helicopter'
    """
    stack, program = _STACK.search(text), _PROGRAM.search(text)
    header = ""
    if stack is not None:
        header = PX4 if "px4" in stack[1].lower() else ARDUPILOT if re.search("ardu|apm", stack[1], re.I) else ""
    elif program is not None:
        header = ARDUPILOT
    # Names that look like parameters of PX4, and those that look like parameters of any ArduPilot vehicle.
    px4_names = _select_names(entries, _PX4_NAMES.fullmatch)
    patterns = (_ARDUPLANE_NAMES, _ARDUPILOT_NAMES, *_ARDUPILOT_VEHICLES.values())
    ardupilot_names = [
        name
        for name in entries
        if not _PX4_NAMES.fullmatch(name) and any(pattern.fullmatch(name) for pattern in patterns)
    ]
    names = {PX4: px4_names, ARDUPILOT: ardupilot_names}
    votes = {autopilot: len(names[autopilot]) + (_HEADER_WEIGHT if autopilot == header else 0) for autopilot in TITLES}
    winner = max(TITLES, key=lambda autopilot: votes[autopilot])
    min_votes = min(votes.values())
    if not votes[winner]:
        return ParameterOrigin("")
    if votes[winner] < _CLEAR_MAJORITY * min_votes:
        px4_text = f"{names[PX4][0] if names[PX4] else 'its header'} is PX4's"
        ardupilot_text = names[ARDUPILOT][0] if names[ARDUPILOT] else "its header"
        return ParameterOrigin("", "", f"{px4_text} and {ardupilot_text} is ArduPilot's", mixed=True)
    evidence = ", ".join(names[winner][:_SHOWN_NAMES])
    if winner == header:
        evidence = f'"# Stack: {stack[1][:40]}"' if stack is not None else program[1] if program is not None else ""
    if winner == ARDUPILOT:
        vehicle = _vehicle_by_majority(text, entries, _ARDUPLANE_NAMES, _ARDUPILOT_VEHICLES)
    else:
        # The first of the type parameters, the header and the names that shows another vehicle than an aeroplane
        # decides. A header comes before the names, because QGroundControl writes the vehicle that PX4 reports.
        types = (kinds.get(round(entries[name].value)) for name, kinds in _PX4_TYPES.items() if name in entries)
        vehicle = next(filter(None, types), "") or _header_vehicle(text) or ""
        if not vehicle and _select_names(entries, _PX4_VTOL.fullmatch):
            vehicle = _VTOL
        vehicle = vehicle or _vehicle_by_majority(text, entries, _PX4_PLANE, _PX4_VEHICLES)
    return ParameterOrigin(winner, vehicle, evidence)


def _select_names(names: Iterable[str], matches: Callable[[str], object]) -> list[str]:
    """Return the names for which ``matches`` returns a true value, such as a match of a pattern."""
    return [name for name in names if matches(name)]


def _header_vehicle(text: str) -> str | None:
    """Return the vehicle that a file's header states; "" for an aeroplane, None if it states no vehicle."""
    match = _VEHICLE.search(text)
    if match is not None:
        return next((kind for pattern, kind in _VEHICLE_WORDS if re.search(pattern, match[1], re.I)), None)
    program = _PROGRAM.search(text)
    return None if program is None else _PROGRAMS[program[1].lower()]


def _vehicle_by_majority(
    text: str, entries: Mapping[str, Entry], plane_names: re.Pattern[str], other_vehicles: Mapping[str, re.Pattern[str]]
) -> str:
    """Return the vehicle to which most parameter names of a file belong; "" for an aeroplane.

    In a tie the vehicle is an aeroplane. A header that states the vehicle has the weight of `_HEADER_WEIGHT` names.

    text: text of the file.
    entries: parameters of the file by name.
    plane_names: names that only an aeroplane has.
    other_vehicles: names that only another vehicle has, by vehicle.
    """
    header_kind = _header_vehicle(text)
    votes = {"": len(_select_names(entries, plane_names.fullmatch))}
    votes |= {kind: len(_select_names(entries, names.fullmatch)) for kind, names in other_vehicles.items()}
    if header_kind is not None:
        votes[header_kind] = votes.get(header_kind, 0) + _HEADER_WEIGHT
    return max(votes, key=lambda kind: votes[kind])


# ----------------------------------------------------------------------
# Parameter file for one autopilot.


def read_origin(path: Path) -> ParameterOrigin:
    """Return the autopilot and the vehicle for which the parameter file at a path was written.

    Raises ParameterError if the file cannot be read.
    """
    text = _read_text(path)
    return parameter_origin(text, parse_parameters(text, str(path)))


def read_parameters_for(path: Path, autopilot: str) -> dict[str, Entry]:
    """Read a parameter file for a flight with the autopilot of the given name.

    Raises ParameterError if the file cannot be read, or if it is for another autopilot or another vehicle.
    """
    text = _read_text(path)
    entries = parse_parameters(text, str(path))
    origin = parameter_origin(text, entries)
    if origin.autopilot not in ("", autopilot):
        raise other_autopilot_error(f"{path}", origin.autopilot, origin.evidence, autopilot)
    if origin.vehicle:
        allowed = "planfly simulates only fixed-wing aircraft"
        message = f"{path}: the parameters are for {origin.vehicle} ({TITLES[origin.autopilot]}): {allowed}"
        raise ParameterError(message, file=path, field="vehicle", value=origin.vehicle, allowed=allowed)
    return entries


class UnusedParametersError(ParameterError):
    """A parameter file of which the simulated autopilot uses no parameter.

    model: title of this autopilot.
    """

    model = ""


def refuse_unknown_parameters(
    path: Path, autopilot: str, entries: Mapping[str, Entry], used_values: Mapping[str, float]
) -> None:
    """Raise UnusedParametersError for a file of which the simulated autopilot uses no parameter.

    A file whose parameter names belong to this autopilot is accepted.

    used_values: values of the file that the simulated autopilot uses.
    """
    if used_values or parameter_origin("", entries).autopilot == autopilot:
        return
    names = ", ".join(list(entries)[:_SHOWN_NAMES])
    allowed = f"expected a parameter file of {TITLES[autopilot]}"
    message = f"{path}: {names}: not used by the simulated {_MODELS[autopilot]}; {allowed}"
    error = UnusedParametersError(message, file=path, value=names, allowed=allowed)
    error.model = _MODELS[autopilot]
    raise error


def other_autopilot_error(file_name: str, file_autopilot: str, evidence: str, flown_autopilot: str) -> ParameterError:
    """Return the error for a parameter file that was written for another autopilot.

    file_name: the file, for the message.
    file_autopilot, flown_autopilot: names of the autopilot of the file and of the autopilot that is to fly.
    evidence: header or names that show the autopilot of the file.
    """
    evidence_text = f" ({evidence})" if evidence else ""
    option_text = f"--autopilot {file_autopilot} simulates {_MODELS[file_autopilot]} instead"
    allowed = f"{_MODELS[flown_autopilot]} is to fly; {option_text}"
    message = f"{file_name}: written for {TITLES[file_autopilot]}{evidence_text}, but {allowed}"
    return ParameterError(message, file=file_name, field="autopilot", value=file_autopilot, allowed=allowed)


def _read_text(path: Path) -> str:
    """Return the text of a parameter file. Raises ParameterError if it cannot be read."""
    data = read_small_file(path, MAX_BYTES, "parameter", ParameterError)
    return utf8_text(data, path, ParameterError)
