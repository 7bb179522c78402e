"""PX4's parameters that decide how a fixed wing flies a mission, in SI units and radians.

Names, units, ranges and defaults are those of PX4's parameter reference (docs.px4.io, v1.16 and v1.17), and of the
`*_params.c` files beside the modules that read them.  PX4 itself enforces no range: what can be flown is taken, and
said where it lies beyond the documented one (FW_R_LIM is documented from 35 degrees, and 30 is flown).  Of three
sources the first that states a parameter counts: the file that a person gives, the aircraft, PX4.  What an aircraft is,
its folder says once, in `ardupilot.parm`: `FROM_ARDUPILOT` lists which of those values are the same quantity in PX4.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar, NamedTuple, get_args

import numpy as np

from aircraft.catalog import Aircraft
from flight.autopilots.autopilot import Candidate, Origin, ParameterValue, StoredParameters, find_misfits
from flight.autopilots.parameter_files import Entry, parse_parameters, read_parameter_file
from flight.autopilots.parameter_origin import PX4, read_parameters_for, refuse_unknown
from world.errors import ParameterError
from world.files import TextLine
from world.kernels import Record, record_dtype
from world.scenario_tables import NEWEST_PX4, Px4Version

_VERSIONS: tuple[Px4Version, ...] = get_args(Px4Version)

_DEGREE = math.pi / 180.0


class Definition(NamedTuple):
    """One parameter.

    name: PX4's.
    default: PX4's, in its unit.
    low, high: what is taken, in that unit: what can be flown.
    to_si: factor to SI and radians.
    documented: the range of PX4's reference, where that is narrower.
    """

    name: str
    default: float
    low: float
    high: float
    to_si: float = 1.0
    documented: tuple[float, float] | None = None


# By the field of `PX4_PARAMETERS`; those that are not flown at the end.
DEFINITIONS = {
    # Lateral guidance.
    "npfg_period": Definition("NPFG_PERIOD", 10.0, 0.5, 1000.0, documented=(1.0, 100.0)),
    "npfg_damping": Definition("NPFG_DAMPING", 0.7, 0.05, 5.0, documented=(0.1, 1.0)),
    "npfg_lower_bound": Definition("NPFG_LB_PERIOD", 1.0, 0.0, 1.0),
    "npfg_upper_bound": Definition("NPFG_UB_PERIOD", 1.0, 0.0, 1.0),
    "npfg_roll_time": Definition("NPFG_ROLL_TC", 0.5, 0.0, 20.0, documented=(0.0, 2.0)),
    "npfg_switch_share": Definition("NPFG_SW_DST_MLT", 0.32, 0.0, 10.0, documented=(0.1, 1.0)),
    "npfg_period_safety": Definition("NPFG_PERIOD_SF", 1.5, 1.0, 10.0),
    "ground_speed_min": Definition("FW_GND_SPD_MIN", 5.0, 0.0, 40.0),
    "roll_limit": Definition("FW_R_LIM", 50.0, 5.0, 85.0, _DEGREE, (35.0, 75.0)),
    "roll_slew": Definition("FW_PN_R_SLEW_MAX", 90.0, 0.0, 1000.0, _DEGREE),
    "roll_time": Definition("FW_R_TC", 0.4, 0.02, 10.0, documented=(0.2, 1.0)),
    "roll_rate_max": Definition("FW_R_RMAX", 70.0, 0.0, 720.0, _DEGREE, (0.0, 180.0)),
    # When it turns to the next waypoint.
    "acceptance": Definition("NAV_ACC_RAD", 10.0, 0.05, 10_000.0, documented=(0.05, 200.0)),
    "height_acceptance": Definition("NAV_FW_ALT_RAD", 10.0, 0.05, 10_000.0, documented=(0.05, 200.0)),
    "loiter_radius": Definition("NAV_LOITER_RAD", 80.0, -10_000.0, 10_000.0),
    # Height and speed.
    "climb_reference": Definition("FW_T_CLMB_R_SP", 3.0, 0.1, 1000.0, documented=(0.5, 15.0)),
    "sink_reference": Definition("FW_T_SINK_R_SP", 2.0, 0.1, 1000.0, documented=(0.5, 15.0)),
    "climb_max": Definition("FW_T_CLMB_MAX", 5.0, 0.1, 100.0, documented=(1.0, 15.0)),
    "sink_min": Definition("FW_T_SINK_MIN", 2.0, 0.1, 100.0, documented=(1.0, 15.0)),
    "sink_max": Definition("FW_T_SINK_MAX", 5.0, 0.1, 100.0, documented=(1.0, 15.0)),
    "height_time": Definition("FW_T_ALT_TC", 5.0, 0.1, 1000.0, documented=(2.0, 50.0)),
    "height_rate_share": Definition("FW_T_HRATE_FF", 0.3, 0.0, 1.0),
    "speed_time": Definition("FW_T_TAS_TC", 5.0, 0.1, 1000.0, documented=(2.0, 50.0)),
    "pitch_integral": Definition("FW_T_I_GAIN_PIT", 0.1, 0.0, 20.0, documented=(0.0, 2.0)),
    "pitch_damping": Definition("FW_T_PTCH_DAMP", 0.1, 0.0, 20.0, documented=(0.0, 2.0)),
    "balance_share": Definition("FW_T_SEB_R_FF", 1.0, 0.0, 3.0, documented=(0.5, 1.5)),
    "throttle_damping": Definition("FW_T_THR_DAMPING", 0.05, 0.0, 10.0, documented=(0.0, 1.0)),
    "throttle_integral": Definition("FW_T_THR_INTEG", 0.02, 0.0, 10.0, documented=(0.0, 1.0)),
    "roll_to_throttle": Definition("FW_T_RLL2THR", 15.0, 0.0, 200.0, documented=(0.0, 20.0)),
    "speed_weight": Definition("FW_T_SPDWEIGHT", 1.0, 0.0, 2.0),
    "energy_rate_time": Definition("FW_T_STE_R_TC", 0.4, 0.0, 20.0, documented=(0.0, 2.0)),
    "vertical_acceleration": Definition("FW_T_VERT_ACC", 7.0, 0.1, 100.0, documented=(1.0, 10.0)),
    "speed_deviation": Definition("FW_T_SPD_STD", 0.07, 0.01, 10.0),
    "speed_rate_deviation": Definition("FW_T_SPD_DEV_STD", 0.2, 0.01, 10.0),
    "speed_process_deviation": Definition("FW_T_SPD_PRC_STD", 0.2, 0.01, 10.0),
    "airspeed_min": Definition("FW_AIRSPD_MIN", 10.0, 0.5, 500.0),
    "airspeed_trim": Definition("FW_AIRSPD_TRIM", 15.0, 0.5, 500.0),
    "airspeed_max": Definition("FW_AIRSPD_MAX", 20.0, 0.5, 500.0),
    "pitch_limit_min": Definition("FW_P_LIM_MIN", -30.0, -80.0, 0.0, _DEGREE, (-60.0, 0.0)),
    "pitch_limit_max": Definition("FW_P_LIM_MAX", 30.0, 0.0, 80.0, _DEGREE, (0.0, 60.0)),
    "pitch_trim": Definition("FW_PSP_OFF", 0.0, -90.0, 90.0, _DEGREE),
    "pitch_time": Definition("FW_P_TC", 0.4, 0.02, 10.0, documented=(0.2, 1.0)),
    "throttle_trim": Definition("FW_THR_TRIM", 0.6, 0.0, 1.0),
    "throttle_min": Definition("FW_THR_MIN", 0.0, 0.0, 1.0),
    "throttle_max": Definition("FW_THR_MAX", 1.0, 0.0, 1.0),
    "throttle_slew": Definition("FW_THR_SLEW_MAX", 0.0, 0.0, 100.0, documented=(0.0, 1.0)),
    # Return.
    "return_height": Definition("RTL_RETURN_ALT", 100.0, 0.0, 10_000.0),
    "return_radius": Definition("RTL_LOITER_RAD", 80.0, 1.0, 10_000.0),
    "return_type": Definition("RTL_TYPE", 1.0, 0.0, 5.0),
    # What a mission is taken by.
    "mission_requires": Definition("MIS_TKO_LAND_REQ", 2.0, 0.0, 5.0),
    "landing_angle": Definition("FW_LND_ANG", 5.0, 1.0, 45.0, _DEGREE),
    # Not flown.
    "uses_airspeed": Definition("FW_USE_AIRSPD", 1.0, 0.0, 1.0),
    "keeps_ground_speed": Definition("NPFG_EN_MIN_GSP", 1.0, 0.0, 1.0),
    "landing_height_acceptance": Definition("NAV_FW_ALTL_RAD", 5.0, 0.05, 200.0),
    "track_keeping": Definition("NPFG_TRACK_KEEP", 1.0, 0.0, 1.0),
    "excess_wind": Definition("NPFG_WIND_REG", 1.0, 0.0, 1.0),
    "track_keeping_speed": Definition("NPFG_GSP_MAX_TK", 5.0, 0.0, 50.0),
    "fast_descend": Definition("FW_T_F_ALT_ERR", -1.0, -1.0, 10_000.0),
    "throttle_slow": Definition("FW_THR_ASPD_MIN", 0.0, 0.0, 1.0),
    "throttle_fast": Definition("FW_THR_ASPD_MAX", 0.0, 0.0, 1.0),
    "wind_to_airspeed": Definition("FW_WIND_ARSP_SC", 0.0, 0.0, 10.0),
    "weight_base": Definition("WEIGHT_BASE", -1.0, -1.0, 10_000.0),
    "weight_gross": Definition("WEIGHT_GROSS", -1.0, -1.0, 10_000.0),
    "service_ceiling": Definition("FW_SERVICE_CEIL", -1.0, -1.0, 20_000.0),
    "return_descent": Definition("RTL_DESCEND_ALT", 100.0, 0.0, 10_000.0),
    "return_landing": Definition("RTL_LAND_DELAY", -1.0, -1.0, 10_000.0),
    "fence_action": Definition("GF_ACTION", 2.0, 0.0, 5.0),
    "fence_distance": Definition("GF_MAX_HOR_DIST", 0.0, 0.0, 1e6),
    "fence_height": Definition("GF_MAX_VER_DIST", 0.0, 0.0, 1e6),
    "longest_flight": Definition("COM_FLT_TIME_MAX", -1.0, -1.0, 1e6),
}
# Read, and no flight of ours shows what another value than PX4's own would do.
NOT_FLOWN = tuple(definition.name for definition in list(DEFINITIONS.values())[-19:])
_BY_NAME = {definition.name: definition for definition in DEFINITIONS.values()}
# A station saves every parameter of the vehicle, a thousand and more; a person writes down what is of interest.
_WHOLE_SET = 300
# What has to be in order, but that PX4 does not refuse.
_ORDERS = (
    ("FW_THR_MIN", "FW_THR_TRIM", "FW_THR_MAX"),
    ("FW_AIRSPD_MIN", "FW_AIRSPD_TRIM", "FW_AIRSPD_MAX"),
    ("FW_P_LIM_MIN", "FW_PSP_OFF", "FW_P_LIM_MAX"),
    ("FW_T_SINK_MIN", "FW_T_SINK_MAX"),
    ("FW_T_SINK_R_SP", "FW_T_SINK_MAX"),
    ("FW_T_CLMB_R_SP", "FW_T_CLMB_MAX"),
)
# What has to be in order.
_PAIRS = (("FW_THR_MIN", "FW_THR_MAX"), ("FW_AIRSPD_MIN", "FW_AIRSPD_MAX"))

PX4_PARAMETERS = record_dtype(
    *DEFINITIONS,
    ("anticipates", np.bool_),  # whether guidance's own switch distance counts for the navigator: up to 1.16
    # Gains (1/s, 1/s, 1/s^2, 1/s) of the airspeed filter: of its speed and of its rate, by what is amiss in each.
    "speed_by_speed",
    "speed_by_rate",
    "rate_by_speed",
    "rate_by_rate",
)
# ArduPlane's parameters of an aircraft that are PX4's by another name, and the factor to PX4's unit.
FROM_ARDUPILOT = {
    "AIRSPEED_CRUISE": ("FW_AIRSPD_TRIM", 1.0),
    "AIRSPEED_MIN": ("FW_AIRSPD_MIN", 1.0),
    "AIRSPEED_MAX": ("FW_AIRSPD_MAX", 1.0),
    "ROLL_LIMIT_DEG": ("FW_R_LIM", 1.0),
    "PTCH_LIM_MAX_DEG": ("FW_P_LIM_MAX", 1.0),
    "PTCH_LIM_MIN_DEG": ("FW_P_LIM_MIN", 1.0),
    "PTCH_TRIM_DEG": ("FW_PSP_OFF", 1.0),
    "TRIM_THROTTLE": ("FW_THR_TRIM", 0.01),
    "THR_MIN": ("FW_THR_MIN", 0.01),
    "THR_MAX": ("FW_THR_MAX", 0.01),
    "TECS_CLMB_MAX": ("FW_T_CLMB_MAX", 1.0),
    "TECS_SINK_MIN": ("FW_T_SINK_MIN", 1.0),
    "TECS_SINK_MAX": ("FW_T_SINK_MAX", 1.0),
}
# Of an aircraft, beside its model.
AIRCRAFT_FILE = "ardupilot.parm"


@dataclass(frozen=True, slots=True)
class Px4Parameters:
    """What PX4 flies with.

    values: every parameter that the law knows, in the order of `DEFINITIONS`.
    unused: names that the file states and the law has no use for.
    source: the file that a person gave, "" for none.
    version: of PX4.
    """

    not_flown: ClassVar[tuple[str, ...]] = NOT_FLOWN
    values: tuple[ParameterValue, ...]
    unused: tuple[str, ...] = ()
    source: str = ""
    version: Px4Version = NEWEST_PX4

    def __getitem__(self, name: str) -> float:
        """A parameter's value by PX4's name, in SI and radians.

        >>> round(default_parameters()["FW_R_LIM"], 3), default_parameters()["NAV_ACC_RAD"]
        (0.873, 10.0)
        """
        return next(value * _BY_NAME[name].to_si for known, value, _ in self.values if known == name)

    def changed(self, **values: float) -> "Px4Parameters":
        """The same parameters but for these, by PX4's names and in its units.

        >>> default_parameters().changed(NAV_ACC_RAD=56.0)["NAV_ACC_RAD"]
        56.0
        """
        if unknown := sorted(set(values) - set(_BY_NAME)):
            raise ValueError(f"{unknown[0]}: not a parameter of the law")
        made = tuple(
            parameter._replace(value=values[parameter.name], origin="file") if parameter.name in values else parameter
            for parameter in self.values
        )
        return Px4Parameters(made, self.unused, self.source, self.version)

    def by_origin(self, origin: Origin) -> dict[str, float]:
        """The values (in PX4's units) that one source states, by name."""
        return {name: value for name, value, stated in self.values if stated == origin}

    @property
    def beyond(self) -> tuple[str, ...]:
        """What the file states beyond PX4's documented ranges, which is flown all the same, with the range.

        >>> parameters_of("FW_R_LIM 30", "mine.params").beyond
        ('FW_R_LIM 30 (35..75)',)
        """
        found = []
        for name, value in self.by_origin("file").items():
            low, high = _BY_NAME[name].documented or (-math.inf, math.inf)
            if not low <= value <= high:
                found.append(f"{name} {value:g} ({low:g}..{high:g})")
        return tuple(found)

    @property
    def misfits(self) -> tuple[str, ...]:
        """Values of the file that contradict another parameter, in words; PX4 warns of some, and flies with them.

        >>> parameters_of("FW_AIRSPD_TRIM 25", "mine.params").misfits
        ('FW_AIRSPD_TRIM 25 of the file is above FW_AIRSPD_MAX 20 of the defaults',)
        """
        return find_misfits(self.values, _ORDERS)

    @property
    def is_whole_set(self) -> bool:
        """Whether the file holds all parameters of a vehicle: one that it does not state is the release's own."""
        return len(self.unused) + len(self.by_origin("file")) >= _WHOLE_SET

    @property
    def anticipates(self) -> bool:
        """Whether guidance's own switch distance counts for the navigator.

        To 1.16 the position controller published it; 1.17 split that one into modules, and none of them does any more.
        """
        return self.version == "1.16"

    def record(self) -> Record:
        """The parameters for compiled code, as a record of `PX4_PARAMETERS`."""
        record: Record = np.zeros(1, PX4_PARAMETERS)[0]
        for (field, definition), parameter in zip(DEFINITIONS.items(), self.values, strict=True):
            setattr(record, field, parameter.value * definition.to_si)
        record.anticipates = self.anticipates
        gains = speed_filter_gains(record.speed_deviation, record.speed_rate_deviation, record.speed_process_deviation)
        record.speed_by_speed, record.speed_by_rate, record.rate_by_speed, record.rate_by_rate = gains
        return record


def speed_filter_gains(speed: float, rate: float, process: float) -> tuple[float, float, float, float]:
    """Gains of the airspeed filter: of the speed by an error of speed and of its rate, of the rate by the same.

    speed, rate: standard deviations of the measured airspeed (m/s) and of its measured rate (m/s^2).  process: of the
    noise that moves the rate, m/s^2.  They are the steady gains of a Kalman-Bucy filter on an integrator chain
    (Kalman and Bucy 1961, J. Basic Eng. 83, 95-108), which is how PX4's parameters FW_T_SPD_* are described.

    >>> [round(gain, 2) for gain in speed_filter_gains(0.07, 0.2, 0.2)]
    [1.92, 0.26, 2.12, 0.67]
    """
    chain, precision = np.array([[0.0, 1.0], [0.0, 0.0]]), np.diag([speed**-2.0, rate**-2.0])
    # The Riccati equation by the stable eigenvectors of its Hamiltonian (Potter 1966, SIAM J. Appl. Math. 14, 496-501).
    hamiltonian = np.block([[chain.T, -precision], [-np.diag([0.0, process * process]), -chain]])
    roots, vectors = np.linalg.eig(hamiltonian)
    stable = vectors[:, roots.real < 0.0]
    gains = np.real(stable[2:] @ np.linalg.inv(stable[:2])) @ precision
    return float(gains[0, 0]), float(gains[0, 1]), float(gains[1, 0]), float(gains[1, 1])


def default_parameters(version: Px4Version = NEWEST_PX4) -> Px4Parameters:
    """PX4's own values, whatever it flies.

    >>> default_parameters()["FW_T_CLMB_R_SP"], default_parameters("1.16").anticipates
    (3.0, True)
    """
    return _parameters([], "", (), version)


def load_parameters(
    aircraft: Aircraft, path: Path | str | None = None, version: Px4Version = NEWEST_PX4
) -> Px4Parameters:
    """The parameters that an aircraft is flown with: of a file, of the aircraft, and PX4's defaults.

    Raises ParameterError, in one line, for a file that cannot be read or states what is not allowed.

    >>> from aircraft.catalog import load_aircraft
    >>> made = load_parameters(load_aircraft("aerosonde"))
    >>> made["FW_AIRSPD_TRIM"], made["FW_THR_TRIM"], made["NPFG_PERIOD"]
    (25.0, 0.77, 10.0)
    """
    stated: list[tuple[Origin, dict[str, float]]] = []
    unused: tuple[str, ...] = ()
    if path is not None:
        entries = read_parameters_for(Path(path), PX4)
        values, unused = _known(entries)
        refuse_unknown(Path(path), PX4, entries, values)
        stated.append(("file", values))
    stated.append(("aircraft", _of_aircraft(aircraft)))
    return _parameters(stated, "" if path is None else str(path), unused, version)


def parameters_of(text: str, source: str, version: Px4Version = NEWEST_PX4) -> Px4Parameters:
    r"""The parameters of a file's text alone, with PX4's defaults.  Raises ParameterError.

    >>> parameters_of("1\t1\tNAV_ACC_RAD\t30.0\t9\n1\t1\tBAT1_N_CELLS\t3\t6\n", "mine.params").unused
    ('BAT1_N_CELLS',)
    """
    values, unused = _known(parse_parameters(text, source))
    return _parameters([("file", values)], source, unused, version)


def stored_parameters(stored: StoredParameters, version: str) -> Px4Parameters:
    """Parameters that were recorded; those that were not yet known have their defaults.

    Raises ParameterError for a value or a version that is not allowed.

    >>> stored = StoredParameters((ParameterValue("NAV_ACC_RAD", 50.0, "file"),), (), "a.params")
    >>> stored_parameters(stored, "1.16")["NAV_ACC_RAD"]
    50.0
    """
    known = next((one for one in _VERSIONS if one == version), None)
    if known is None:
        allowed = f"{' or '.join(_VERSIONS)} is expected"
        message = f"px4_version: {version!r}: {allowed}"
        raise ParameterError(message, file=stored.source, field="px4_version", value=version, allowed=allowed)
    origins: dict[Origin, dict[str, float]] = {"file": {}, "aircraft": {}, "default": {}}
    for name, value, origin in stored.values:
        if name in _BY_NAME:
            _check(name, value, stored.source)
            origins[origin][name] = value
    return _parameters(list(origins.items()), stored.source, stored.unused, known)


def logged_parameters(
    logged: Mapping[str, float], source: str, version: Px4Version
) -> tuple[Px4Parameters, tuple[str, ...]]:
    """The parameters of a flight log, and what could not be used of them, in sentences.

    A log without parameters has PX4's defaults, and says so.  source: the log's file.

    >>> made, notes = logged_parameters({"NAV_ACC_RAD": -5.0, "FW_R_LIM": 45.0}, "a.ulg", "1.16")
    >>> made.by_origin("file"), notes
    ({'FW_R_LIM': 45.0}, ('NAV_ACC_RAD -5 of the log is not allowed: the default is taken',))
    """
    values: dict[str, float] = {}
    notes = []
    for name, definition in _BY_NAME.items():
        if name not in logged:
            continue
        # Logs hold single precision.
        value = float(f"{logged[name]:.6g}")
        if definition.low <= value <= definition.high:
            values[name] = value
        else:
            notes.append(f"{name} {value:g} of the log is not allowed: the default is taken")
    for low, high in _PAIRS:
        if low in values and high in values and values[low] >= values[high]:
            notes.append(f"{low} {values[low]:g} and {high} {values[high]:g} of the log: the defaults are taken")
            del values[low], values[high]
    if not values:
        notes.append("the log holds no parameters: PX4's defaults are taken")
    try:
        return _parameters([("file", values)], source, (), version), tuple(notes)
    except ParameterError as error:
        return default_parameters(version), (*notes, f"{error}: PX4's defaults are taken")


def _parameters(
    stated: list[tuple[Origin, dict[str, float]]], source: str, unused: tuple[str, ...], version: Px4Version
) -> Px4Parameters:
    """Parameters of the first source that states each, and PX4's default where none does."""

    def found(definition: Definition) -> ParameterValue:
        for origin, values in stated:
            value = values.get(definition.name)
            # A station saves every parameter: one that is not flown counts where it is not PX4's own value.
            usual = definition.name in NOT_FLOWN and value == definition.default
            if value is not None and not usual:
                return ParameterValue(definition.name, value, origin)
        return ParameterValue(definition.name, definition.default, "default")

    made = Px4Parameters(tuple(map(found, DEFINITIONS.values())), unused, source, version)
    values = {name: value for name, value, _ in made.values}
    for low, high in _PAIRS:
        if values[low] >= values[high]:
            value, allowed = values[low], f"must be below {high} {values[high]:g}"
            where = source or AIRCRAFT_FILE
            message = f"{where}: {low} {value:g}: {allowed}"
            raise ParameterError(message, file=where, field=low, value=value, allowed=allowed)
    return made


def _of_aircraft(aircraft: Aircraft) -> dict[str, float]:
    """What the aircraft's folder states for ArduPlane that is PX4's too, within PX4's ranges."""
    file = aircraft.folder / AIRCRAFT_FILE
    if not file.exists():
        return {}
    values = {}
    for name, entry in read_parameter_file(file).items():
        if name in FROM_ARDUPILOT:
            own, factor = FROM_ARDUPILOT[name]
            values[own] = min(_BY_NAME[own].high, max(_BY_NAME[own].low, entry.value * factor))
    return values


def _known(entries: Mapping[str, Entry]) -> tuple[dict[str, float], tuple[str, ...]]:
    """Values by their names, and the names that the law has no use for."""
    values: dict[str, float] = {}
    unused = []
    for name, entry in entries.items():
        if name not in _BY_NAME:
            unused.append(name)
            continue
        _check(name, entry.value, entry.where)
        values[name] = entry.value
    return values, tuple(unused)


def _check(name: str, value: float, where: TextLine | str) -> None:
    """Refuse a value out of its range.

    where: its line; of one that was recorded, the source, which the message does not name.
    """
    definition = _BY_NAME[name]
    if definition.low <= value <= definition.high:
        return
    allowed = f"allowed {definition.low:g}..{definition.high:g}"
    at, file = (f"{where}: ", where.file) if isinstance(where, TextLine) else ("", where)
    raise ParameterError(f"{at}{name}: {value:g}: {allowed}", file=file, field=name, value=value, allowed=allowed)


# ----------------------------------------------------------------------
# Parameters that may decide a flight that fails, with the steps and ranges of the parameter reference.

HEIGHT_CANDIDATES = (
    Candidate("FW_T_CLMB_R_SP", 0.5, 6.0, "m/s"),
    Candidate("FW_T_SINK_R_SP", 0.5, 6.0, "m/s"),
    Candidate("FW_T_HRATE_FF", 0.1, 1.0, ""),
    Candidate("FW_T_ALT_TC", 0.5, 2.0, "s"),
)
SIDE_CANDIDATES = (
    Candidate("NAV_ACC_RAD", 5.0, 60.0, "m"),
    Candidate("NAV_ACC_RAD", 5.0, 90.0, "m"),
    Candidate("NAV_ACC_RAD", 5.0, 120.0, "m"),
    Candidate("NPFG_PERIOD", 1.0, 5.0, "s"),
    Candidate("FW_R_LIM", 1.0, 60.0, "deg", least=35.0),
)
