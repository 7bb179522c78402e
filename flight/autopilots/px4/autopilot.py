"""Define the simulated PX4 for fixed wing as an autopilot, with its parameters."""

import math
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from pathlib import Path
from typing import ClassVar, NamedTuple, Self, get_args

import numpy as np

from aircraft.catalog import Aircraft
from aircraft.tracking import TrackingError
from flight.autopilots.autopilot import Autopilot, Origin, StoredAutopilot, StoredParameters
from flight.autopilots.file_releases import choose_release_for_file, release_in_comments
from flight.autopilots.gust_height import updraft_altitude_gain
from flight.autopilots.parameter_files import MAX_BYTES
from flight.autopilots.parts import (
    BatteryFailsafe,
    Candidate,
    ControlLaw,
    Deviations,
    FeasibilityLimits,
    MissionChecks,
    MissionParts,
    RateLimit,
    ReturnBehaviour,
    ReturnMission,
    ReturnTimeFailsafe,
    ReturnTrials,
    SpeedLimits,
    SpeedRules,
    TurnRules,
)
from flight.autopilots.px4.failsafes import failsafe_causes, link_loss_reactions
from flight.autopilots.px4.lateral import MAX_SWITCH_DISTANCE_M
from flight.autopilots.px4.law import PX4, px4_loop, px4_tick
from flight.autopilots.px4.open_settings import describe_open_settings
from flight.autopilots.px4.parameters import (
    HEIGHT_CANDIDATES,
    MAX_TRIED_PITCH_RAD,
    PITCH_CANDIDATE,
    SIDE_CANDIDATES,
    Px4Parameters,
)
from flight.autopilots.px4.rtl_point_mass import fly_returns
from flight.autopilots.px4.tracking_error import altitude_miss_probability, tracking_error
from flight.guidance.equivalent_airspeed import eas_to_tas_ratio
from flight.mission.items import LANDINGS, Command
from flight.mission.loiter_circles import LoiterRules
from flight.mission.return_path import ReturnRules
from world.arrays import Floats
from world.errors import ParameterError
from world.files import read_small_file, utf8_text
from world.kernels import Record
from world.scenario_tables import NEWEST_PX4, FlightTable, Navigation, Px4Version
from world.wind import Turbulence

_VERSIONS: tuple[Px4Version, ...] = get_args(Px4Version)


class _NeutralRange(NamedTuple):
    """Range of a parameter in which PX4 flies as simulated.

    by_program: True if PX4's own program, with planfly's physics, also flies values outside the range.
    """

    lowest: float
    highest: float
    by_program: bool = True


# Parameters that change the flight of a mission and are not simulated; docs/px4-branches.md lists their functions.
_NEUTRAL = {
    # Throttle and pitch without an airspeed sensor.
    "FW_USE_AIRSPD": _NeutralRange(1.0, 1.0),
    "ASPD_PRIMARY": _NeutralRange(1.0, 3.0, by_program=False),
    # Airspeed in wind, and of another weight.
    "FW_WIND_ARSP_SC": _NeutralRange(-math.inf, 0.0),
    "WEIGHT_BASE": _NeutralRange(-math.inf, 0.0),
    "WEIGHT_GROSS": _NeutralRange(-math.inf, 0.0),
    # Climb rate in thin air, and throttle by airspeed (`PerformanceModel`).
    "FW_SERVICE_CEIL": _NeutralRange(-math.inf, 0.0),
    "FW_THR_ASPD_MIN": _NeutralRange(-math.inf, 0.0),
    "FW_THR_ASPD_MAX": _NeutralRange(-math.inf, 0.0),
    # Descents without throttle, at the highest airspeed (`TECS::_setFastDescend`).
    "FW_T_F_ALT_ERR": _NeutralRange(-math.inf, 0.0),
    # Descents that a distance sensor ends (`updateAltToAvoidTerrainCollisionAndRepublishTriplet`).
    "NAV_MIN_GND_DIST": _NeutralRange(-math.inf, 0.0, by_program=False),
    # Slower changes of pitch than simulated (`FixedwingAttitudeControl`).
    "FW_P_RMAX_POS": _NeutralRange(60.0, math.inf),
    "FW_P_RMAX_NEG": _NeutralRange(60.0, math.inf),
    # No roll at all: 0 is no exception in `RollController::control_roll`.
    "FW_R_RMAX": _NeutralRange(1e-9, math.inf),
    # A limit below the yaw rate of a turn, against which the rudder then steers (`YawController::control_yaw`).
    "FW_Y_RMAX": _NeutralRange(20.0, math.inf),
    # No position: estimator, GPS, and a vehicle that is not armed.
    "EKF2_EN": _NeutralRange(1.0, 1.0, by_program=False),
    "SYS_HAS_GPS": _NeutralRange(1.0, math.inf, by_program=False),
    "SYS_HITL": _NeutralRange(0.0, 0.0, by_program=False),
    "COM_ARMABLE": _NeutralRange(1.0, math.inf, by_program=False),
    "COM_ARM_AUTH_REQ": _NeutralRange(-math.inf, 0.0, by_program=False),
    # Altitude from range finder or vision.
    "EKF2_HGT_REF": _NeutralRange(0.0, 1.0, by_program=False),
}
# Part of an RTL that is not simulated, by RTL_TYPE.
_RTL_TYPES_NOT_FLOWN = {
    2: "RTL_TYPE 2 returns along the mission to its landing, or in reverse to home. This is not simulated. The "
    "simulated return follows RTL_TYPE 1, to the nearest rally point or home",
    3: "RTL_TYPE 3 returns to the nearest of home, rally points and the mission's landing. This is not simulated. The "
    "simulated return follows RTL_TYPE 0, which ignores the landing",
    4: "RTL_TYPE 4 returns along the mission to its landing, or in reverse to home. This is not simulated. The "
    "simulated return follows RTL_TYPE 1, to the nearest rally point or home",
}

# Values of RTL_TYPE for an RTL along the mission.
_ALONG_THE_MISSION = (2.0, 4.0)
# Values of RTL_TYPE for an RTL that may go to the mission's landing.
_TO_LANDING = (1.0, 3.0)
# Destination of an RTL by the value of RTL_TYPE.
_DESTINATION_TEXTS = {
    0: "the nearer of home and the nearest rally point",
    1: "the nearer of the mission's landing and the nearest rally point, or home if there is neither",
    2: "the mission's landing, or home, along the mission",
    3: "the nearest of home, the mission's landing and the rally points",
    4: "the mission's landing, or home, along the mission",
    5: "the nearest rally point",
}
# Value of RTL_TYPE for an RTL to a rally point alone.
_TO_RALLY_POINT = 5.0
# Distance from home within which PX4 ignores a rally point, m (`MAX_DIST_FROM_HOME_FOR_LAND_APPROACHES` in rtl.cpp).
_RALLY_HOME_DISTANCE_M = 10.0
# COM_WIND_MAX_ACT and GF_ACTION that only warn.
_WARN_OF_WIND = 1.0
_WARN_OF_FENCE = 1.0
# COM_LOW_BAT_ACT that leave a mission at BAT_CRIT_THR: to return, to land, to return and then land.
_LEAVE_AT_CRITICAL_CHARGE = (1.0, 2.0, 3.0)
# COM_FLTT_LOW_ACT that returns, and its default by release.
_RETURN_IN_TIME = 3.0
_RETURN_IN_TIME_DEFAULT = {"1.16": 3.0, "1.17": 0.0}
# CBRK_FLIGHTTERM that disables the termination of a flight.
_NO_TERMINATION = 121212.0

# Fields of `flight.autopilots.px4.law.PX4_MEMORY` that belong to the current leg or mission, not to the aircraft.
_LEG_FIELDS = (
    "leg",
    "time_since_reached",
    "rim_reached",
    "is_loitering",
    "is_in_rtl",
    "rtl_climb_complete",
    "mission_finished",
    "time_at_mission_end",
)


@dataclass(frozen=True)
class Px4(Autopilot):
    """Simulated PX4 for fixed wing: NPFG along the legs, TECS for altitude and airspeed.

    >>> [Px4(Px4Parameters.defaults(release)).turns.acceptance_radius for release in ("1.16", "1.17")]
    [33.6, 10.0]
    """

    name: ClassVar = "px4"
    title: ClassVar = "PX4"
    parameters: Px4Parameters = field()

    @classmethod
    def load(cls, table: FlightTable, aircraft: Aircraft, scenario: str) -> Self:
        """Return PX4 with parameters from the user's file, the aircraft's file, and the defaults.

        The PX4 release to simulate is the release that the [flight] table states, or else the release in the comment of
        the parameter file, or else the newest release.

        scenario: not used; it belongs to the interface of `Autopilot.load`.
        """
        writer_release = None
        if table.params is not None:
            file = Path(table.params)
            text = utf8_text(read_small_file(file, MAX_BYTES, "parameter", ParameterError), file, ParameterError)
            writer_release = release_in_comments(text, "PX4")
        version, notes = choose_release_for_file(_VERSIONS, table.px4_version, writer_release, str(table.params), "PX4")
        return cls(Px4Parameters.load(aircraft, table.params, version, notes))

    @classmethod
    def restore(cls, stored: StoredAutopilot) -> Self:
        """Return the autopilot with the parameters and the version that a log stores."""
        version = stored.version or NEWEST_PX4
        if stored.parameters is None:
            return cls(Px4Parameters.defaults())
        return cls(Px4Parameters.restore(stored.parameters, version))

    def store(self) -> StoredAutopilot:
        """Return the parameters and the version of PX4 for a log."""
        parameters = self.parameters
        stored = StoredParameters(parameters.values, parameters.unused, parameters.source)
        return StoredAutopilot(parameters=stored, version=parameters.version)

    def with_release(self, version: Px4Version) -> Self:
        """Return the same autopilot with the controllers of another PX4 release."""
        return replace(self, parameters=replace(self.parameters, version=version))

    @classmethod
    def missing_files(cls, aircraft: Aircraft) -> list[str]:
        """Return an empty list, because PX4 has a default for each parameter that the aircraft does not state.

        Raises ParameterError if the aircraft's own parameter file is invalid.
        """
        Px4Parameters.load(aircraft)
        return []

    @property
    def control_law(self) -> ControlLaw:
        """Control law of PX4 with these parameters."""
        return ControlLaw(px4_tick, px4_loop, PX4, self._initialise, _transfer_state)

    def _initialise(self, guidance: Record, record: Record) -> None:
        """Copy the parameters into the control law's record."""
        record.parameters = self.parameters.record()

    def describe(self, aircraft: str) -> str:
        """Return a description of the simulated PX4 with the parameters that matter most in a flight."""
        parameters = self.parameters
        source_text = f"the parameters of {parameters.source}" if parameters.source else "its default parameters"
        return (
            f"the simulated PX4 {parameters.version} with {source_text}"
            f" (NAV_ACC_RAD {parameters['NAV_ACC_RAD']:g} m, FW_T_CLMB_R_SP {parameters['FW_T_CLMB_R_SP']:g}"
            f" and FW_T_SINK_R_SP {parameters['FW_T_SINK_R_SP']:g} m/s)"
        )

    @property
    def version(self) -> str:
        """Simulated PX4 release."""
        return self.parameters.version

    @cached_property
    def checks(self) -> MissionChecks:
        """PX4's feasibility checks of a mission, which depend on FW_LND_ANG and MIS_TKO_LAND_REQ.

        If the user's file is a complete set of parameters, MIS_TKO_LAND_REQ is treated as stated.

        >>> Px4(Px4Parameters.defaults()).checks.feasibility.requires
        2
        >>> parameters = Px4Parameters.defaults().changed(COM_LOW_BAT_ACT=3.0, BAT1_CAPACITY=5000.0, BAT_CRIT_THR=0.1)
        >>> Px4(parameters).checks.battery_failsafes[0].used_charge
        4500.0
        """
        parameters, battery_failsafes = self.parameters, tuple[BatteryFailsafe, ...]()
        if parameters["COM_LOW_BAT_ACT"] in _LEAVE_AT_CRITICAL_CHARGE:
            # The failsafe that ends a mission first; the PX4 program flies without it. COM_LOW_BAT_ACT sets PX4's
            # reaction at both thresholds. `Battery::determineWarning` tests BAT_EMERGEN_THR first.
            name = max("BAT_CRIT_THR", "BAT_EMERGEN_THR", key=lambda threshold_name: parameters[threshold_name])
            threshold, capacity = parameters[name], parameters["BAT1_CAPACITY"]
            # Without a capacity the charge is estimated from the voltage.
            failsafe = BatteryFailsafe(name, threshold, remaining_fraction=threshold)
            if capacity > 0.0:
                failsafe = BatteryFailsafe(
                    name,
                    threshold,
                    (1.0 - threshold) * capacity,
                    capacity_parameter="BAT1_CAPACITY",
                    capacity=capacity,
                )
            battery_failsafes = (failsafe,)
        # The failsafe on the remaining flight time (`rtlEstimateCheck`). PX4 knows this time only if a battery capacity
        # is set.
        return_time_failsafe = None
        file_values = parameters.by_origin("file")
        action = file_values.get("COM_FLTT_LOW_ACT", _RETURN_IN_TIME_DEFAULT[parameters.version])
        if action == _RETURN_IN_TIME and parameters["BAT1_CAPACITY"] > 0.0:
            return_time_failsafe = ReturnTimeFailsafe(
                f"COM_FLTT_LOW_ACT {action:g}",
                remedy="COM_FLTT_LOW_ACT 0, or a larger battery (BAT1_CAPACITY), avoids it",
                capacity=parameters["BAT1_CAPACITY"],
                initial_current=parameters["BAT_AVRG_CURRENT"],
                time_factor=parameters["RTL_TIME_FACTOR"],
                time_margin=parameters["RTL_TIME_MARGIN"],
                airspeed=parameters["FW_AIRSPD_TRIM"],
                climb_rate=parameters["FW_T_CLMB_R_SP"],
                sink_rate=parameters["FW_T_SINK_R_SP"],
                altitude=parameters["RTL_RETURN_ALT"],
                delay=max(0.0, parameters["RTL_LAND_DELAY"]),
                follows_mission=parameters["RTL_TYPE"] in _ALONG_THE_MISSION,
            )
        is_stated = parameters.is_complete_set or "MIS_TKO_LAND_REQ" in file_values
        return MissionChecks(
            dialect="px4",
            feasibility=FeasibilityLimits(parameters["FW_LND_ANG"], int(parameters["MIS_TKO_LAND_REQ"]), is_stated),
            battery_failsafes=battery_failsafes,
            return_time_failsafe=return_time_failsafe,
            describe_unsimulated_settings=partial(self.describe_unsimulated_settings, by_program=False),
            parameter_notes=parameters.notes,
        )

    def describe_unsimulated_settings(self, mission: MissionParts, *, by_program: bool) -> list[str]:
        """Describe settings that would end a mission or change its flight, but are not simulated.

        by_program: True for a flight with the PX4 program, in which more settings have an effect.
        """
        # `FeasibilityChecker` refuses a mission beyond GF_MAX_* with any GF_ACTION.
        parameters, ending_names = self.parameters, ["COM_FLT_TIME_MAX", "GF_MAX_HOR_DIST", "GF_MAX_VER_DIST"]
        if parameters["COM_WIND_MAX_ACT"] > _WARN_OF_WIND and parameters["COM_WIND_MAX"] < mission.wind:
            ending_names += ["COM_WIND_MAX"]
        ending_texts = [
            f"{name} {parameters[name]:g} may end the mission, which is not judged"
            for name in ending_names
            if parameters[name] > 0.0
        ]
        changing_texts = [
            f"{name} {parameters[name]:g} affects the flight, but is not simulated"
            for name, neutral in _NEUTRAL.items()
            if not neutral.lowest <= parameters[name] <= neutral.highest and not (by_program and neutral.by_program)
        ]
        if mission.fence_at_home and parameters["GF_ACTION"] > 0.0:
            # `GeofenceChecks::checkAndReport`.
            home_text = f"prevents arming, because home is {mission.fence_at_home}"
            ending_texts.append(f"GF_ACTION {parameters['GF_ACTION']:g} {home_text}")
        if mission.has_fence and parameters["GF_PREDICT"] > 0.0 and parameters["GF_ACTION"] > _WARN_OF_FENCE:
            ending_texts.append("GF_PREDICT 1 leaves the mission before its fence is reached, which is not simulated")
        if parameters["CBRK_FLIGHTTERM"] != _NO_TERMINATION:
            ending_texts += [
                f"{name} {parameters[name]:g} terminates a flight at an angle that {limit} allows, which is not"
                " simulated"
                for name, limit in (("FD_FAIL_R", "FW_R_LIM"), ("FD_FAIL_P", "FW_P_LIM_MAX"))
                if 0.0 < parameters[name] <= round(math.degrees(parameters[limit]), 6)
            ]
        changing_texts += describe_open_settings(parameters, mission.aircraft, by_program=by_program)
        texts = [*ending_texts, *changing_texts]
        if by_program:
            return texts
        # Settings that matter only for some missions or releases.
        if parameters["NPFG_EN_MIN_GSP"] == 0.0 and self.version == "1.16":
            texts.append("NPFG_EN_MIN_GSP 0 disables the minimum ground speed, which is not simulated")
        if mission.moves_payload and parameters["MIS_COMMAND_TOUT"] > 0.0:
            wait_text = f"MIS_COMMAND_TOUT {parameters['MIS_COMMAND_TOUT']:g} s"
            texts.append(f"{wait_text} makes PX4 wait for the payload, which is not simulated")
        if parameters["FW_T_THR_LOW_HGT"] >= 0.0 and parameters["FW_LND_THRTC_SC"] != 1.0:
            scale_text = f"FW_LND_THRTC_SC {parameters['FW_LND_THRTC_SC']:g}"
            height_text = f"FW_T_THR_LOW_HGT {parameters['FW_T_THR_LOW_HGT']:g} m"
            texts.append(f"{scale_text} changes the altitude control below {height_text}, which is not simulated")
        if mission.loiters_to_land and parameters["FW_LND_EARLYCFG"] != 0.0:
            texts.append("FW_LND_EARLYCFG 1 affects the loiter before the landing, but is not simulated")
        if mission.returns:
            texts += self._describe_unsimulated_rtl_type(mission.rally_distance)
            return_type, landing_commands = parameters["RTL_TYPE"], (*LANDINGS, Command.DO_LAND_START)
            if return_type in _TO_LANDING and not mission.commands.isdisjoint(landing_commands):
                landing_text = "may return to the mission's landing, which is not simulated"
                texts.append(f"RTL_TYPE {return_type:g} {landing_text}")
            texts += self._describe_unsimulated_rtl_parts(mission.rally_distance)
        return texts

    def _describe_unsimulated_rtl_type(self, rally_distance: float) -> Iterator[str]:
        """Yield a text if no RTL is simulated with the value of RTL_TYPE, otherwise nothing.

        rally_distance: distance of the nearest rally point from home, m; infinite without one.
        """
        return_type = self.parameters["RTL_TYPE"]
        if return_type in _ALONG_THE_MISSION:
            yield f"RTL_TYPE {return_type:g} returns along the mission, which is not simulated"
        if return_type == _TO_RALLY_POINT and math.isinf(rally_distance):
            yield f"RTL_TYPE {return_type:g} without a rally point loiters where the RTL begins, which is not simulated"

    def _describe_unsimulated_rtl_parts(self, rally_distance: float) -> Iterator[str]:
        """Yield a text for each setting with which a part of an RTL, but not all of it, is not simulated.

        rally_distance: distance of the nearest rally point from home, m; infinite without one.
        """
        parameters = self.parameters
        if parameters["RTL_TYPE"] != _TO_RALLY_POINT and rally_distance <= _RALLY_HOME_DISTANCE_M:
            yield "PX4 ignores a rally point within 10 m of home, but the simulated return goes to it"
        if parameters["RTL_LAND_DELAY"] >= 0.0:
            yield f"RTL_LAND_DELAY {parameters['RTL_LAND_DELAY']:g} lands after the return, which is not simulated"

    @property
    def turns(self) -> TurnRules:
        """Rules of turns from NAV_ACC_RAD and FW_R_LIM.

        Up to 1.16 the acceptance radius is at least the switch distance of the guidance. PX4 ignores a waypoint's
        acceptance radius (its second parameter) on a fixed wing.
        """
        return TurnRules(
            acceptance_radius=self._turn_distance(math.pi, 0.0),
            distance=self._turn_distance,
            radii_at=self._acceptance_radii if self.parameters.uses_switch_distance else None,
            reads_acceptance=False,
            acceptance_parameter="NAV_ACC_RAD",
            max_bank=self.parameters["FW_R_LIM"],
            bank_parameter="FW_R_LIM",
        )

    def _turn_distance(self, turn: float, amsl: float) -> float:
        """Return the distance before a waypoint at which PX4 turns to the next leg in still air, m.

        turn: not used, because the distance is the same for all turns.
        amsl: altitude, m; up to 1.16 the distance grows with it.
        """
        parameters = self.parameters
        if not parameters.uses_switch_distance:
            return parameters["NAV_ACC_RAD"]
        speed = parameters["FW_AIRSPD_TRIM"] * float(eas_to_tas_ratio(amsl))
        return float(self._acceptance_radii(np.array([speed]))[0])

    def _acceptance_radii(self, ground_speeds: Floats) -> Floats:
        """Return the acceptance radius of a waypoint at each ground speed in PX4 up to 1.16, m, (n,).

        The radius is the switch distance of the guidance, but at least NAV_ACC_RAD.

        ground_speeds: m/s, (n,).
        """
        parameters = self.parameters
        period = parameters["NPFG_PERIOD"]
        if parameters["NPFG_LB_PERIOD"] > 0.0:
            min_period = (
                math.pi * parameters["NPFG_ROLL_TC"] / parameters["NPFG_DAMPING"] * parameters["NPFG_PERIOD_SF"]
            )
            period = max(period, min_period)
        switch_distances = parameters["NPFG_SW_DST_MLT"] * period * parameters["NPFG_DAMPING"] * ground_speeds
        limited_distances = np.minimum(MAX_SWITCH_DISTANCE_M, switch_distances).round(6)
        return np.maximum(parameters["NAV_ACC_RAD"], limited_distances)

    @property
    def speeds(self) -> SpeedRules:
        """Rules of airspeeds, throttle limit (FW_THR_MAX), and limits of climb and sink rates.

        A commanded speed outside FW_AIRSPD_MIN..FW_AIRSPD_MAX is replaced by the nearest limit.
        """
        min_airspeed, max_airspeed = self.parameters["FW_AIRSPD_MIN"], self.parameters["FW_AIRSPD_MAX"]
        limits = SpeedLimits(min_airspeed, max_airspeed, "FW_AIRSPD_MIN", "FW_AIRSPD_MAX", nearest=True)
        max_throttle = self.parameters["FW_THR_MAX"]
        return SpeedRules(
            limits,
            equivalent=True,
            cruise_parameter="FW_AIRSPD_TRIM",
            max_throttle=max_throttle,
            max_throttle_name=f"FW_THR_MAX {max_throttle:g}" if max_throttle < 1.0 else "",
            climb_limit=self._rate_limit("FW_T_CLMB_R_SP", "FW_T_CLMB_MAX"),
            sink_limit=self._rate_limit("FW_T_SINK_R_SP", "FW_T_SINK_MAX"),
            max_pitch=self.parameters["FW_P_LIM_MAX"],
            max_pitch_name=f"FW_P_LIM_MAX {math.degrees(self.parameters['FW_P_LIM_MAX']):g}°",
        )

    def _rate_limit(self, *names: str) -> RateLimit:
        """Return the rate limit that the smallest of the named parameters sets."""
        return RateLimit.from_parameters(**{name: self.parameters[name] for name in names})

    @property
    def returns(self) -> ReturnBehaviour:
        """Behaviour of PX4 in an RTL; a scenario's RTL altitude sets RTL_RETURN_ALT.

        >>> rules = Px4(Px4Parameters.defaults()).returns.rules
        >>> rules.includes_home, rules.transit_height, rules.rally_height, rules.deviation_note
        (False, 100.0, 100.0, '')
        """
        parameters = self.parameters
        # The rules are for an RTL that starts at any distance. Both altitudes are heights above the destination, which
        # is home or a rally point. Follows PX4's `src/modules/navigator/rtl.cpp`. RTL_TYPE 0 returns to the nearest of
        # home and the rally points; 1 (the default of fixed wings) and 5 return to the nearest rally point, or to home
        # without a rally point. Type 1 and all other types also use the landing of a mission. If the RTL is an item of
        # the mission itself, an RTL to that landing is not simulated.
        rules = ReturnRules(
            height=parameters["RTL_DESCEND_ALT"],
            radius=parameters["RTL_LOITER_RAD"],
            max_sink_rate=parameters["FW_T_SINK_R_SP"],
            rally_limit=0.0,
            includes_home=int(parameters["RTL_TYPE"]) in (0, 3),
            holds_height=True,
            transit_height=parameters["RTL_RETURN_ALT"],
            rally_height=parameters["RTL_DESCEND_ALT"],
            may_use_landing=int(parameters["RTL_TYPE"]) in (1, 3),
            deviation_note=_RTL_TYPES_NOT_FLOWN.get(int(parameters["RTL_TYPE"]), ""),
        )
        return_altitude, descend_altitude = ({name: parameters[name]} for name in ("RTL_RETURN_ALT", "RTL_DESCEND_ALT"))
        return_type = parameters["RTL_TYPE"]
        other_types = sorted({0.0, 1.0, 3.0} - {return_type})
        first_height, last_height = f"{parameters['RTL_RETURN_ALT']:g} m", f"{parameters['RTL_DESCEND_ALT']:g} m"
        path_text = (
            f"RTL_TYPE {return_type:g}: a return goes to {_DESTINATION_TEXTS[int(return_type)]}. An aircraft below"
            f" RTL_RETURN_ALT ({first_height} above the destination) first climbs to this height in a loiter. Then it"
            " flies level. Before a landing sequence, the climb may end up to NAV_FW_ALT_RAD"
            f" ({parameters['NAV_FW_ALT_RAD']:g} m) below this height. Over home or a rally point, the aircraft"
            f" descends in a loiter to RTL_DESCEND_ALT ({last_height})"
        )
        return ReturnBehaviour(
            rules,
            lambda settings: {} if settings.altitude is None else {"RTL_RETURN_ALT": settings.altitude},
            after_link_loss=partial(link_loss_reactions, self.parameters),
            fly=partial(fly_returns, parameters),
            causes=lambda mission: failsafe_causes(parameters, has_fence=mission.has_fence),
            unsimulated_text=self._unsimulated_rtl_reason,
            unsimulated_part_texts=self._unsimulated_rtl_parts,
            path_text=path_text,
            trials=ReturnTrials(
                (return_altitude, descend_altitude | return_altitude),
                tuple({"RTL_TYPE": value} for value in other_types),
                "RTL_RETURN_ALT, RTL_DESCEND_ALT, RTL_TYPE",
            ),
        )

    def _unsimulated_rtl_reason(self, mission: ReturnMission) -> str:
        """Return the reason why no RTL of a mission is simulated; "" if RTLs are simulated.

        The reason "landing" means that the landing sequence begins with the landing itself.
        """
        begins_with_landing = bool(mission.landings) and mission.landings[0].is_landing
        if begins_with_landing and self.parameters["RTL_TYPE"] in _TO_LANDING:
            return "landing"
        return next(self._describe_unsimulated_rtl_type(mission.rally_distance), "")

    def _unsimulated_rtl_parts(self, mission: ReturnMission) -> tuple[str, ...]:
        """Return texts on the parts of a mission's RTLs that are not simulated."""
        return_type, has_sequence = self.parameters["RTL_TYPE"], any(start.landing for start in mission.landings)
        is_unknown = return_type in _TO_LANDING and not has_sequence and not mission.commands.isdisjoint(LANDINGS)
        landing_text = f"RTL_TYPE {return_type:g} may return to a landing without DO_LAND_START, which is not simulated"
        return (*([landing_text] if is_unknown else []), *self._describe_unsimulated_rtl_parts(mission.rally_distance))

    @property
    def loiters(self) -> LoiterRules:
        """Rules of loiters from NAV_LOITER_RAD, NAV_FW_ALT_RAD, and the reference climb and sink rates.

        >>> Px4(Px4Parameters.defaults()).loiters.radius
        80.0
        """
        parameters = self.parameters
        return LoiterRules(
            radius=parameters["NAV_LOITER_RAD"],
            radius_name="NAV_LOITER_RAD",
            steers_to_center=True,
            holds_height=True,
            max_climb_rate=self.speeds.climb_limit.rate,
            max_sink_rate=self.speeds.sink_limit.rate,
            altitude_tolerance=parameters["NAV_FW_ALT_RAD"],
            ends_in_circle=True,
        )

    @property
    def deviations(self) -> Deviations:
        """Deviations from the legs, altitude gained in updrafts, and loiters that correct the altitude.

        PX4 loiters at a waypoint if its altitude error exceeds NAV_FW_ALT_RAD.
        """
        # FW_T_CLMB_MAX is tried if it is the smaller limit of the climb rate, up to the other one.
        largest_rate = self.parameters["FW_T_CLMB_R_SP"]
        is_smaller = self.parameters["FW_T_CLMB_MAX"] < largest_rate
        return Deviations(
            tracking_error=self._tracking_error,
            gust_rise=updraft_altitude_gain,
            altitude_miss_probability=partial(altitude_miss_probability, self.parameters["NAV_FW_ALT_RAD"]),
            altitude_parameter="NAV_FW_ALT_RAD",
            altitude_candidates=(
                *((Candidate("FW_T_CLMB_MAX", 0.5, largest_rate, "m/s"),) if is_smaller else ()),
                *HEIGHT_CANDIDATES,
            ),
            track_candidates=SIDE_CANDIDATES,
            pitch_candidates=() if self.parameters["FW_P_LIM_MAX"] >= MAX_TRIED_PITCH_RAD else (PITCH_CANDIDATE,),
        )

    def _tracking_error(
        self, airspeed: float, nav: Navigation, *, fly_over: bool = False, turbulence: Turbulence = "none"
    ) -> TrackingError | None:
        """Return PX4's deviations from a plan.

        ``fly_over`` has no effect, because PX4 turns before each waypoint.
        """
        return tracking_error(self.parameters, airspeed, nav, turbulence=turbulence)

    def with_parameters(self, origin: Origin = "file", /, **values: float) -> "Px4":
        """Return a copy with the given parameters changed."""
        return Px4(self.parameters.changed(origin, **values))


def _transfer_state(previous_record: Record, record: Record, start: Floats) -> None:
    """Start a new leg at ``start``, as after a change of mode.

    The state of TECS and of the airspeed filter is kept.

    previous_record, record: records of the control law before and after the change; the internal state in the second
        is set.
    start: position, (3,) m.
    """
    record.memory = previous_record.memory
    for name in _LEG_FIELDS:
        setattr(record.memory, name, 0)
    record.memory.from_east, record.memory.from_north, record.memory.from_up = start
    record.memory.min_distance_to_end, record.memory.leg_start_altitude = math.inf, start[2]
