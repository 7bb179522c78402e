"""PX4's law for fixed wing as an autopilot, with the parameters that it flies by."""

import math
from dataclasses import dataclass, field, replace
from typing import ClassVar, Self

import numpy as np

from aircraft.catalog import Aircraft
from aircraft.tracking import TrackingError
from flight.autopilots.autopilot import (
    Autopilot,
    Floats,
    MissionChecks,
    SpeedLimits,
    StoredAutopilot,
    StoredParameters,
    Tick,
)
from flight.autopilots.gust_height import height_in_updrafts
from flight.autopilots.px4.lateral import MAX_SWITCH_DISTANCE
from flight.autopilots.px4.law import PX4, px4_tick
from flight.autopilots.px4.parameters import HEIGHT_CANDIDATES, SIDE_CANDIDATES, Px4Parameters
from flight.autopilots.px4.tracking_error import off_height_chance, tracking_error
from flight.guidance.equivalent_airspeed import true_by_equivalent
from flight.mission.loiter_circles import LoiterRules
from flight.mission.return_path import ReturnRules
from world.kernels import Record
from world.scenario_tables import NEWEST_PX4, FlightTable, Navigation, Px4Version
from world.wind import Turbulence

# By RTL_TYPE: what of it is not flown.
_OTHER_RETURNS = {
    2: "RTL_TYPE 2, along the mission to its landing or back: flown as 1, to the nearest rally point or home",
    3: "RTL_TYPE 3, to the nearest of home, rally points and the mission's landing: flown as 0, to no landing",
    4: "RTL_TYPE 4, along the mission to its landing or back: flown as 1, to the nearest rally point or home",
}

# What of `flight.autopilots.px4.law.PX4_MEMORY` belongs to the way that is flown, and not to the aircraft.
_OF_THE_WAY = ("leg", "reached_for", "at_rim", "circling", "returning", "climbed", "finished", "waited")


@dataclass(frozen=True)
class Px4(Autopilot):
    """PX4's law for fixed wing: NPFG along the legs, TECS for height and airspeed.

    >>> made = Px4(Px4Parameters.defaults("1.16"))
    >>> made.acceptance_radius, Px4(Px4Parameters.defaults("1.17")).acceptance_radius
    (33.6, 10.0)
    """

    name: ClassVar = "px4"
    title: ClassVar = "PX4"
    own: ClassVar[np.dtype[np.record] | None] = PX4
    cruise_parameter: ClassVar = "FW_AIRSPD_TRIM"
    equivalent_airspeeds: ClassVar = True
    refuses: ClassVar = True
    reads_as_px4: ClassVar = True
    height_parameter: ClassVar = "NAV_FW_ALT_RAD"
    height_candidates: ClassVar = HEIGHT_CANDIDATES
    side_candidates: ClassVar = SIDE_CANDIDATES
    parameters: Px4Parameters = field()

    @classmethod
    def load(cls, table: FlightTable, aircraft: Aircraft, scenario: str) -> Self:
        """Return the autopilot with the parameters of the user's file, of the aircraft, and PX4's defaults."""
        return cls(Px4Parameters.load(aircraft, table.params, table.px4_version or NEWEST_PX4))

    @classmethod
    def restore(cls, stored: StoredAutopilot) -> Self:
        """With the parameters and the version that a log stores."""
        version = stored.version or NEWEST_PX4
        if stored.parameters is None:
            return cls(Px4Parameters.defaults())
        return cls(Px4Parameters.restore(stored.parameters, version))

    def store(self) -> StoredAutopilot:
        """Its parameters and its version."""
        made = self.parameters
        stored = StoredParameters(made.values, made.unused, made.source)
        return StoredAutopilot(parameters=stored, version=made.version)

    def of_release(self, version: Px4Version) -> Self:
        """Return the same autopilot with the law of another release of PX4."""
        return replace(self, parameters=replace(self.parameters, version=version))

    @classmethod
    def missing_files(cls, aircraft: Aircraft) -> list[str]:
        """Return an empty list: what the aircraft does not state has PX4's defaults."""
        Px4Parameters.load(aircraft)
        return []

    @property
    def tick(self) -> Tick:
        """One tick of the law."""
        return px4_tick

    def begin(self, memory: Record, own: Record) -> None:
        """Hand over the parameters."""
        own.parameters = self.parameters.record()

    def take_over(self, before: Record, own: Record, here: Floats) -> None:
        """As a change of mode: energies and airspeed are kept, and the leg begins here."""
        own.memory = before.memory
        for name in _OF_THE_WAY:
            setattr(own.memory, name, 0)
        own.memory.from_east, own.memory.from_north, own.memory.from_up = here
        own.memory.nearest, own.memory.begun_up = math.inf, here[2]

    def described(self, aircraft: str) -> str:
        """The law with the parameters that decide most of a flight."""
        made = self.parameters
        whose = f"the parameters of {made.source}" if made.source else "its default parameters"
        return (
            f"PX4 {made.version}'s law with {whose} (NAV_ACC_RAD {made['NAV_ACC_RAD']:g} m, FW_T_CLMB_R_SP"
            f" {made['FW_T_CLMB_R_SP']:g} and FW_T_SINK_R_SP {made['FW_T_SINK_R_SP']:g} m/s)"
        )

    @property
    def version(self) -> str:
        """The release whose law it is."""
        return self.parameters.version

    @property
    def acceptance_radius(self) -> float | None:
        """NAV_ACC_RAD; up to 1.16 guidance's own switch distance at sea level where that is more."""
        return self.turn_distance(math.pi, 0.0)

    def settings_not_flown(self, *, returns: bool) -> list[str]:
        """GF_MAX_HOR_DIST and GF_MAX_VER_DIST where GF_ACTION acts, and COM_FLT_TIME_MAX."""
        made, names = self.parameters, ["COM_FLT_TIME_MAX"]
        if made["GF_ACTION"] > 0.0:
            names += ["GF_MAX_HOR_DIST", "GF_MAX_VER_DIST"]
        return [f"{name} {made[name]:g} ends a mission and is not judged" for name in names if made[name] > 0.0]

    @property
    def reads_acceptance(self) -> bool:
        """The second parameter of a waypoint is for PX4's multicopters alone."""
        return False

    def turn_distance(self, turn: float, amsl: float) -> float:
        """How far before a waypoint it turns in still air, whatever the turn: up to 1.16 more in thin air, m."""
        made = self.parameters
        if not made.anticipates:
            return made["NAV_ACC_RAD"]
        period = made["NPFG_PERIOD"]
        if made["NPFG_LB_PERIOD"] > 0.0:
            least = math.pi * made["NPFG_ROLL_TC"] / made["NPFG_DAMPING"] * made["NPFG_PERIOD_SF"]
            period = max(period, least)
        speed = made["FW_AIRSPD_TRIM"] * float(true_by_equivalent(amsl))
        early = made["NPFG_SW_DST_MLT"] * period * made["NPFG_DAMPING"] * speed
        return max(made["NAV_ACC_RAD"], round(min(MAX_SWITCH_DISTANCE, early), 6))

    def airspeed_factor(self, amsl: float) -> float:
        """True by equivalent airspeed."""
        return float(true_by_equivalent(amsl))

    @property
    def return_rules(self) -> ReturnRules:
        """By RTL_RETURN_ALT, above a rally point as above home, RTL_LOITER_RAD and RTL_TYPE, however far that is.

        Facts of PX4's `src/modules/navigator/rtl.cpp`.  RTL_TYPE 0 is the nearest of home and the rally points; 1 (the
        default of fixed wings) and 5 are the nearest rally point, and home where there is none.  The others, and 1,
        know a mission's landing too, which is not flown to.

        >>> rules = Px4(Px4Parameters.defaults()).return_rules
        >>> rules.includes_home, rules.rally_height, rules.instead
        (False, 100.0, '')
        """
        made = self.parameters
        kind = int(made["RTL_TYPE"])
        return ReturnRules(
            height=made["RTL_RETURN_ALT"],
            radius=made["RTL_LOITER_RAD"],
            sink=made["FW_T_SINK_R_SP"],
            rally_limit=0.0,
            includes_home=kind in (0, 3),
            holds_height=True,
            rally_height=made["RTL_RETURN_ALT"],
            landing_counts=kind == 1,
            instead=_OTHER_RETURNS.get(kind, ""),
        )

    @property
    def loiter_rules(self) -> LoiterRules:
        """By NAV_LOITER_RAD, and the rates of its reference height, until it is within NAV_FW_ALT_RAD.

        >>> Px4(Px4Parameters.defaults()).loiter_rules.radius
        80.0
        """
        made = self.parameters
        return LoiterRules(
            radius=made["NAV_LOITER_RAD"],
            radius_name="NAV_LOITER_RAD",
            at_middle=True,
            holds_height=True,
            climb=min(made["FW_T_CLMB_R_SP"], made["FW_T_CLMB_MAX"]),
            sink=min(made["FW_T_SINK_R_SP"], made["FW_T_SINK_MAX"]),
            short=made["NAV_FW_ALT_RAD"],
            ends_in_circle=True,
        )

    @property
    def mission_checks(self) -> MissionChecks:
        """By NAV_ACC_RAD, FW_LND_ANG and MIS_TKO_LAND_REQ, which a file of all parameters need not state.

        >>> Px4(Px4Parameters.defaults()).mission_checks.requires
        2
        """
        made = self.parameters
        stated = made.is_whole_set or "MIS_TKO_LAND_REQ" in made.by_origin("file")
        return MissionChecks(made["NAV_ACC_RAD"], made["FW_LND_ANG"], int(made["MIS_TKO_LAND_REQ"]), stated)

    @property
    def speed_limits(self) -> SpeedLimits | None:
        """FW_AIRSPD_MIN and FW_AIRSPD_MAX: of another speed it flies the nearer of them."""
        made = self.parameters
        low, high = made["FW_AIRSPD_MIN"], made["FW_AIRSPD_MAX"]
        return SpeedLimits(low, high, "FW_AIRSPD_MIN", "FW_AIRSPD_MAX", nearest=True)

    def speeds_flown(self, commanded: Floats, cruise: float) -> Floats:
        """The commanded speeds within its limits."""
        return np.clip(commanded, self.parameters["FW_AIRSPD_MIN"], self.parameters["FW_AIRSPD_MAX"])

    @property
    def stated_bank(self) -> float | None:
        """FW_R_LIM of a person's file."""
        return self.parameters["FW_R_LIM"] if "FW_R_LIM" in self.parameters.by_origin("file") else None

    @property
    def bank_limit(self) -> float:
        """FW_R_LIM, whoever states it."""
        return self.parameters["FW_R_LIM"]

    def tracking_error(
        self, airspeed: float, nav: Navigation, *, fly_over: bool = False, turbulence: Turbulence = "none"
    ) -> TrackingError | None:
        """How far its law strays with these parameters; it flies no waypoint over."""
        return tracking_error(self.parameters, airspeed, nav, turbulence=turbulence)

    def off_height_chance(self, climb: float, sink: float, turbulence: Turbulence) -> float:
        """More than NAV_FW_ALT_RAD, in moderate turbulence."""
        return off_height_chance(self.parameters["NAV_FW_ALT_RAD"], climb, sink, turbulence)

    def gust_rise(self, sink: float, turbulence: Turbulence) -> float:
        """It keeps its airspeed, and cannot sink faster than the aircraft does so."""
        return height_in_updrafts(sink, turbulence)

    def as_asked(
        self, rtl_altitude: float | None, rtl_autoland: int | None, *, lands: bool, lower: float = 0.0
    ) -> Autopilot:
        """With RTL_RETURN_ALT."""
        return self if rtl_altitude is None else Px4(self.parameters.changed(RTL_RETURN_ALT=rtl_altitude))

    def with_parameters(self, **values: float) -> "Px4":
        """The law with other parameters."""
        return Px4(self.parameters.changed(**values))
