"""List the parameters of fixed-wing aircraft that ArduPlane 4.5, 4.6 and 4.7 renamed.

The names are from ArduPlane's release notes, its parameter reference of 4.4 to 4.7, and the conversion tables of
ArduPlane/Parameters.cpp and libraries/AP_GPS/AP_GPS.cpp. Parameters of lift motors (Q_*) and of ArduPilot's own
simulator (SIM_*) are left out, as are parameters whose meaning changed with the name (ARMING_CHECK, SYSID_ENFORCE).
"""

from collections.abc import Iterable, Mapping
from itertools import chain

from world.scenario_tables import ArduPlaneVersion
from world.wording import count_text

_STREAMS = ("RAW_SENS", "EXT_STAT", "RC_CHAN", "RAW_CTRL", "POSITION", "EXTRA1", "EXTRA2", "EXTRA3", "PARAMS", "ADSB")
_RANGE_FINDERS = "123456789A"
_RANGES = {"MAX_CM": "MAX", "MIN_CM": "MIN", "GNDCLEAR": "GNDCLR"}
_GPS_SETTINGS = ("TYPE", "GNSS_MODE", "RATE_MS", "DELAY_MS", "COM_PORT")
_AXES = "XYZ"
# New name of each renamed parameter, by the release that renamed it.
RENAMED: Mapping[str, Mapping[str, str]] = {
    "4.5": {
        "ALT_HOLD_FBWCM": "CRUISE_ALT_FLOOR",
        "ALT_HOLD_RTL": "RTL_ALTITUDE",
        "ARSPD_FBW_MAX": "AIRSPEED_MAX",
        "ARSPD_FBW_MIN": "AIRSPEED_MIN",
        "COMPASS_TYPEMASK": "COMPASS_DISBLMSK",
        "LAND_PITCH_CD": "LAND_PITCH_DEG",
        "LIM_PITCH_MAX": "PTCH_LIM_MAX_DEG",
        "LIM_PITCH_MIN": "PTCH_LIM_MIN_DEG",
        "LIM_ROLL_CD": "ROLL_LIMIT_DEG",
        "MIN_GNDSPD_CM": "MIN_GROUNDSPEED",
        "SYS_NUM_RESETS": "STAT_BOOTCNT",
        "TRIM_ARSPD_CM": "AIRSPEED_CRUISE",
        "TRIM_PITCH_CD": "PTCH_TRIM_DEG",
        "RELAY_PIN": "RELAY1_PIN",
        **{f"RELAY_PIN{number}": f"RELAY{number}_PIN" for number in range(2, 7)},
    },
    "4.6": {
        **{f"GPS_{setting}": f"GPS1_{setting}" for setting in _GPS_SETTINGS},
        **{f"GPS_{setting}2": f"GPS2_{setting}" for setting in _GPS_SETTINGS},
        **{f"GPS_POS{number}_{axis}": f"GPS{number}_POS_{axis}" for number in (1, 2) for axis in _AXES},
        **{f"GPS_MB{number}_OFS_{axis}": f"GPS{number}_MB_OFS_{axis}" for number in (1, 2) for axis in _AXES},
        **{f"GPS_MB{number}_TYPE": f"GPS{number}_MB_TYPE" for number in (1, 2)},
        **{f"GPS_CAN_NODEID{number}": f"GPS{number}_CAN_NODEID" for number in (1, 2)},
    },
    "4.7": {
        "GLIDE_SLOPE_MIN": "ALT_SLOPE_MIN",
        "GLIDE_SLOPE_THR": "ALT_SLOPE_MAXHGT",
        "SYSID_MYGCS": "MAV_GCS_SYSID",
        "SYSID_THISMAV": "MAV_SYSID",
        "TELEM_DELAY": "MAV_TELEM_DELAY",
        **{f"SR{number}_{stream}": f"MAV{number + 1}_{stream}" for number in range(7) for stream in _STREAMS},
        **{
            f"RNGFND{finder}_{old}": f"RNGFND{finder}_{new}"
            for finder in _RANGE_FINDERS
            for old, new in _RANGES.items()
        },
    },
}
# Names that exist only before 4.7, and only from 4.7 on.
NAMES_BEFORE_4_7 = frozenset(chain.from_iterable(RENAMED.values()))
NAMES_SINCE_4_7 = frozenset({*RENAMED["4.7"].values(), "CLIMB_SLOPE_HGT"})


def name_in_release(name: str, version: ArduPlaneVersion) -> str:
    """Return the name of a parameter in a given release.

    The given name may be from any release. It is returned unchanged if no release renamed the parameter.

    >>> name_in_release("GLIDE_SLOPE_MIN", "4.7"), name_in_release("ALT_SLOPE_MIN", "4.6")
    ('ALT_SLOPE_MIN', 'GLIDE_SLOPE_MIN')
    >>> name_in_release("LIM_ROLL_CD", "4.6"), name_in_release("WP_RADIUS", "4.7")
    ('ROLL_LIMIT_DEG', 'WP_RADIUS')
    """
    for release, new_names in RENAMED.items():
        if release <= version:
            name = new_names.get(name, name)
        else:
            name = next((old_name for old_name, new_name in new_names.items() if new_name == name), name)
    return name


def describe_renamed(names: Iterable[str], used: Iterable[str], version: ArduPlaneVersion) -> str:
    """Describe in one line which of a file's parameters have another name in a release; "" for none.

    names: names in the file.
    used: names in the file that the control law reads. Of the other names, the text mentions only the first.

    >>> describe_renamed(["GLIDE_SLOPE_MIN", "WP_RADIUS"], ["GLIDE_SLOPE_MIN"], "4.7")
    'GLIDE_SLOPE_MIN is read as ALT_SLOPE_MIN, its name in ArduPlane 4.7'
    >>> describe_renamed(["SR0_ADSB", "SR1_ADSB"], [], "4.7")
    'SR0_ADSB (now MAV1_ADSB) and 1 more renamed parameter are not used'
    """
    used_names = set(used)
    renamed = {name: new_name for name in names if (new_name := name_in_release(name, version)) != name}
    texts = []
    if read_texts := [f"{name} is read as {new_name}" for name, new_name in renamed.items() if name in used_names]:
        texts.append(f"{', '.join(read_texts)}, its name in ArduPlane {version}")
    if unused_texts := [f"{name} (now {new_name})" for name, new_name in renamed.items() if name not in used_names]:
        others_text = count_text(len(unused_texts) - 1, "more renamed parameter")
        verb_text = f" and {others_text} are not used" if len(unused_texts) > 1 else " is not used"
        texts.append(unused_texts[0] + verb_text)
    return "; ".join(texts)
