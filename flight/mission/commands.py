"""MAVLink commands, and their treatment by ArduPlane and PX4 in a fixed-wing mission.

One table serves the itinerary, which flies the items, the mission rule, which judges them, and the list in
docs/your-mission-file.md, which is generated from it. Both autopilots refuse a command that is not in the table.

ArduPlane 4.6: `AP_Mission::mavlink_int_to_mission_cmd` decides which commands are accepted, `AP_Mission::start_command`
and `Plane::start_command` (ArduPlane/commands_logic.cpp) what they do. PX4: `parse_mavlink_mission_item`
(mavlink_mission.cpp) and `FeasibilityChecker::checkMissionItemValidity` decide which commands are accepted,
`MissionBlock` (mission_block.cpp) what they do.
"""

from enum import IntEnum, StrEnum
from typing import NamedTuple


class Command(IntEnum):
    """All MAV_CMD of MAVLink's dialects common and ardupilotmega, by their names without MAV_CMD_."""

    NAV_WAYPOINT = 16
    NAV_LOITER_UNLIM = 17
    NAV_LOITER_TURNS = 18
    NAV_LOITER_TIME = 19
    NAV_RETURN_TO_LAUNCH = 20
    NAV_LAND = 21
    NAV_TAKEOFF = 22
    NAV_LAND_LOCAL = 23
    NAV_TAKEOFF_LOCAL = 24
    NAV_FOLLOW = 25
    NAV_CONTINUE_AND_CHANGE_ALT = 30
    NAV_LOITER_TO_ALT = 31
    DO_FOLLOW = 32
    DO_FOLLOW_REPOSITION = 33
    DO_ORBIT = 34
    DO_FIGURE_EIGHT = 35
    NAV_ARC_WAYPOINT = 36
    NAV_ROI = 80
    NAV_PATHPLANNING = 81
    NAV_SPLINE_WAYPOINT = 82
    NAV_ALTITUDE_WAIT = 83
    NAV_VTOL_TAKEOFF = 84
    NAV_VTOL_LAND = 85
    NAV_GUIDED_ENABLE = 92
    NAV_DELAY = 93
    NAV_PAYLOAD_PLACE = 94
    NAV_LAST = 95
    CONDITION_DELAY = 112
    CONDITION_CHANGE_ALT = 113
    CONDITION_DISTANCE = 114
    CONDITION_YAW = 115
    CONDITION_LAST = 159
    DO_SET_MODE = 176
    DO_JUMP = 177
    DO_CHANGE_SPEED = 178
    DO_SET_HOME = 179
    DO_SET_PARAMETER = 180
    DO_SET_RELAY = 181
    DO_REPEAT_RELAY = 182
    DO_SET_SERVO = 183
    DO_REPEAT_SERVO = 184
    DO_FLIGHTTERMINATION = 185
    DO_CHANGE_ALTITUDE = 186
    DO_SET_ACTUATOR = 187
    DO_RETURN_PATH_START = 188
    DO_LAND_START = 189
    DO_RALLY_LAND = 190
    DO_GO_AROUND = 191
    DO_REPOSITION = 192
    DO_PAUSE_CONTINUE = 193
    DO_SET_REVERSE = 194
    DO_SET_ROI_LOCATION = 195
    DO_SET_ROI_WPNEXT_OFFSET = 196
    DO_SET_ROI_NONE = 197
    DO_SET_ROI_SYSID = 198
    DO_CONTROL_VIDEO = 200
    DO_SET_ROI = 201
    DO_DIGICAM_CONFIGURE = 202
    DO_DIGICAM_CONTROL = 203
    DO_MOUNT_CONFIGURE = 204
    DO_MOUNT_CONTROL = 205
    DO_SET_CAM_TRIGG_DIST = 206
    DO_FENCE_ENABLE = 207
    DO_PARACHUTE = 208
    DO_MOTOR_TEST = 209
    DO_INVERTED_FLIGHT = 210
    DO_GRIPPER = 211
    DO_AUTOTUNE_ENABLE = 212
    NAV_SET_YAW_SPEED = 213
    DO_SET_CAM_TRIGG_INTERVAL = 214
    DO_SET_RESUME_REPEAT_DIST = 215
    DO_SPRAYER = 216
    DO_SEND_SCRIPT_MESSAGE = 217
    DO_AUX_FUNCTION = 218
    DO_MOUNT_CONTROL_QUAT = 220
    DO_GUIDED_MASTER = 221
    DO_GUIDED_LIMITS = 222
    DO_ENGINE_CONTROL = 223
    DO_SET_MISSION_CURRENT = 224
    DO_LAST = 240
    PREFLIGHT_CALIBRATION = 241
    PREFLIGHT_SET_SENSOR_OFFSETS = 242
    PREFLIGHT_UAVCAN = 243
    PREFLIGHT_STORAGE = 245
    PREFLIGHT_REBOOT_SHUTDOWN = 246
    OVERRIDE_GOTO = 252
    OBLIQUE_SURVEY = 260
    DO_SET_STANDARD_MODE = 262
    MISSION_START = 300
    ACTUATOR_TEST = 310
    CONFIGURE_ACTUATOR = 311
    COMPONENT_ARM_DISARM = 400
    RUN_PREARM_CHECKS = 401
    ILLUMINATOR_ON_OFF = 405
    DO_ILLUMINATOR_CONFIGURE = 406
    GET_HOME_POSITION = 410
    INJECT_FAILURE = 420
    START_RX_PAIR = 500
    GET_MESSAGE_INTERVAL = 510
    SET_MESSAGE_INTERVAL = 511
    REQUEST_MESSAGE = 512
    REQUEST_PROTOCOL_VERSION = 519
    REQUEST_AUTOPILOT_CAPABILITIES = 520
    REQUEST_CAMERA_INFORMATION = 521
    REQUEST_CAMERA_SETTINGS = 522
    REQUEST_STORAGE_INFORMATION = 525
    STORAGE_FORMAT = 526
    REQUEST_CAMERA_CAPTURE_STATUS = 527
    REQUEST_FLIGHT_INFORMATION = 528
    RESET_CAMERA_SETTINGS = 529
    SET_CAMERA_MODE = 530
    SET_CAMERA_ZOOM = 531
    SET_CAMERA_FOCUS = 532
    SET_STORAGE_USAGE = 533
    SET_CAMERA_SOURCE = 534
    JUMP_TAG = 600
    DO_JUMP_TAG = 601
    DO_GIMBAL_MANAGER_PITCHYAW = 1000
    DO_GIMBAL_MANAGER_CONFIGURE = 1001
    IMAGE_START_CAPTURE = 2000
    IMAGE_STOP_CAPTURE = 2001
    REQUEST_CAMERA_IMAGE_CAPTURE = 2002
    DO_TRIGGER_CONTROL = 2003
    CAMERA_TRACK_POINT = 2004
    CAMERA_TRACK_RECTANGLE = 2005
    CAMERA_STOP_TRACKING = 2010
    VIDEO_START_CAPTURE = 2500
    VIDEO_STOP_CAPTURE = 2501
    VIDEO_START_STREAMING = 2502
    VIDEO_STOP_STREAMING = 2503
    REQUEST_VIDEO_STREAM_INFORMATION = 2504
    REQUEST_VIDEO_STREAM_STATUS = 2505
    LOGGING_START = 2510
    LOGGING_STOP = 2511
    AIRFRAME_CONFIGURATION = 2520
    CONTROL_HIGH_LATENCY = 2600
    PANORAMA_CREATE = 2800
    DO_VTOL_TRANSITION = 3000
    ARM_AUTHORIZATION_REQUEST = 3001
    SET_GUIDED_SUBMODE_STANDARD = 4000
    SET_GUIDED_SUBMODE_CIRCLE = 4001
    CONDITION_GATE = 4501
    NAV_FENCE_RETURN_POINT = 5000
    NAV_FENCE_POLYGON_VERTEX_INCLUSION = 5001
    NAV_FENCE_POLYGON_VERTEX_EXCLUSION = 5002
    NAV_FENCE_CIRCLE_INCLUSION = 5003
    NAV_FENCE_CIRCLE_EXCLUSION = 5004
    NAV_RALLY_POINT = 5100
    UAVCAN_GET_NODE_INFO = 5200
    DO_SET_SAFETY_SWITCH_STATE = 5300
    DO_ADSB_OUT_IDENT = 10001
    LOWEHEISER_SET_STATE = 10151
    PAYLOAD_PREPARE_DEPLOY = 30001
    PAYLOAD_CONTROL_DEPLOY = 30002
    WAYPOINT_USER_1 = 31000
    WAYPOINT_USER_2 = 31001
    WAYPOINT_USER_3 = 31002
    WAYPOINT_USER_4 = 31003
    WAYPOINT_USER_5 = 31004
    SPATIAL_USER_1 = 31005
    SPATIAL_USER_2 = 31006
    SPATIAL_USER_3 = 31007
    SPATIAL_USER_4 = 31008
    SPATIAL_USER_5 = 31009
    USER_1 = 31010
    USER_2 = 31011
    USER_3 = 31012
    USER_4 = 31013
    USER_5 = 31014
    CAN_FORWARD = 32000
    POWER_OFF_INITIATED = 42000
    SOLO_BTN_FLY_CLICK = 42001
    SOLO_BTN_FLY_HOLD = 42002
    SOLO_BTN_PAUSE_CLICK = 42003
    FIXED_MAG_CAL = 42004
    FIXED_MAG_CAL_FIELD = 42005
    FIXED_MAG_CAL_YAW = 42006
    SET_EKF_SOURCE_SET = 42007
    DO_START_MAG_CAL = 42424
    DO_ACCEPT_MAG_CAL = 42425
    DO_CANCEL_MAG_CAL = 42426
    SET_FACTORY_TEST_MODE = 42427
    DO_SEND_BANNER = 42428
    ACCELCAL_VEHICLE_POS = 42429
    GIMBAL_RESET = 42501
    GIMBAL_AXIS_CALIBRATION_STATUS = 42502
    GIMBAL_REQUEST_AXIS_CALIBRATION = 42503
    GIMBAL_FULL_RESET = 42505
    DO_WINCH = 42600
    FLASH_BOOTLOADER = 42650
    BATTERY_RESET = 42651
    DEBUG_TRAP = 42700
    SCRIPTING = 42701
    NAV_SCRIPT_TIME = 42702
    NAV_ATTITUDE_TIME = 42703
    GUIDED_CHANGE_SPEED = 43000
    GUIDED_CHANGE_ALTITUDE = 43001
    GUIDED_CHANGE_HEADING = 43002
    EXTERNAL_POSITION_ESTIMATE = 43003
    SET_HAGL = 43005


class Treatment(StrEnum):
    """Effect of a mission command with one autopilot, as planfly simulates it."""

    # The flight does what the autopilot does.
    FLOWN = "flown"
    # The autopilot accepts it, and it does not change the flight path.
    NO_EFFECT = "no effect on the path"
    # The autopilot accepts it and it may change the flight path, but it is not simulated: the verdict is undecided.
    OPEN = "not judged"
    # The autopilot refuses a mission that contains it.
    REFUSED = "refused"


class Support(NamedTuple):
    """Treatment of a mission command with each autopilot, and a short reason for the user."""

    arduplane: Treatment
    px4: Treatment
    reason: str


C = Command
_FLOWN = Treatment.FLOWN
_NO_EFFECT = Treatment.NO_EFFECT
_OPEN = Treatment.OPEN
_REFUSED = Treatment.REFUSED

# Reason for commands of a camera.
CAMERA_REASON = "for the camera, nothing to fly"
# Reason for commands that point a gimbal.
_GIMBAL_REASON = "points a camera, not the aircraft"
# Reason for commands that ArduPlane's `Plane::start_command` does not know and `Plane::verify_command` reports as done.
SKIPPED_REASON = "ArduPlane accepts it and skips it"
# Reason for conditions, which delay other commands.
_DELAY_REASON = "delays the commands after it; the verdict is undecided if one of these commands is flown"

# Treatment of each command that at least one autopilot accepts; both refuse any other.
SUPPORT: dict[Command, Support] = {
    C.NAV_WAYPOINT: Support(_FLOWN, _FLOWN, "a position to fly to"),
    C.NAV_LOITER_UNLIM: Support(
        _FLOWN,
        _FLOWN,
        "an unlimited loiter, of which one minute and at least one lap are flown",
    ),
    C.NAV_LOITER_TURNS: Support(_FLOWN, _REFUSED, "a loiter for a number of turns"),
    C.NAV_LOITER_TIME: Support(_FLOWN, _FLOWN, "a loiter for a time"),
    C.NAV_RETURN_TO_LAUNCH: Support(_FLOWN, _FLOWN, "a return to launch"),
    C.NAV_LAND: Support(_FLOWN, _FLOWN, "a landing; flown to the ground if the scenario has a [landing]"),
    C.NAV_TAKEOFF: Support(_FLOWN, _FLOWN, "a take-off; flown from the ground if the scenario has a [launch]"),
    # `Plane::verify_continue_and_change_alt`: straight on at the aircraft's best climb rate until the altitude is
    # reached.
    C.NAV_CONTINUE_AND_CHANGE_ALT: Support(_OPEN, _REFUSED, "ArduPlane flies straight on to an altitude"),
    C.NAV_LOITER_TO_ALT: Support(_FLOWN, _FLOWN, "a loiter to an altitude"),
    # PX4 writes it as DO_SET_ROI.
    C.NAV_ROI: Support(_REFUSED, _NO_EFFECT, _GIMBAL_REASON),
    # `Plane::do_altitude_wait`: servos at trim and no throttle until an altitude or a sink rate is reached (balloon
    # launch).
    C.NAV_ALTITUDE_WAIT: Support(_OPEN, _REFUSED, "ArduPlane does not steer until an altitude is reached"),
    C.NAV_VTOL_TAKEOFF: Support(_OPEN, _OPEN, "a VTOL aircraft climbs straight up"),
    C.NAV_VTOL_LAND: Support(_OPEN, _OPEN, "a VTOL aircraft lands straight down"),
    C.NAV_GUIDED_ENABLE: Support(_NO_EFFECT, _REFUSED, SKIPPED_REASON),
    # `ModeAuto::verify_nav_delay` is done at once while the motor is armed; PX4 (NAV_CMD_DELAY) waits in flight.
    C.NAV_DELAY: Support(_NO_EFFECT, _OPEN, "ArduPlane does not wait in the air; PX4 does"),
    C.NAV_PAYLOAD_PLACE: Support(_OPEN, _REFUSED, "a QuadPlane lands to place its payload"),
    # They delay the DO commands after them, see `flight.mission.itinerary`; by themselves they do nothing.
    C.CONDITION_DELAY: Support(_FLOWN, _REFUSED, _DELAY_REASON),
    C.CONDITION_DISTANCE: Support(_FLOWN, _REFUSED, _DELAY_REASON),
    C.CONDITION_YAW: Support(_NO_EFFECT, _REFUSED, SKIPPED_REASON),
    C.DO_JUMP: Support(_FLOWN, _FLOWN, "a jump to another item"),
    C.DO_CHANGE_SPEED: Support(_FLOWN, _FLOWN, "changes the airspeed"),
    # `Plane::do_set_home`. PX4 accepts coordinates only in frame 2, where they are not coordinates.
    C.DO_SET_HOME: Support(_FLOWN, _OPEN, "sets another home for later altitudes and returns to launch"),
    # It switches only plain relays, not one with another function such as an ignition (AP_Relay).
    C.DO_SET_RELAY: Support(_NO_EFFECT, _REFUSED, "switches a plain relay"),
    C.DO_REPEAT_RELAY: Support(_NO_EFFECT, _REFUSED, "switches a plain relay"),
    # `AP_ServoRelayEvents::do_set_servo` moves only channels without a function: no control surface and no throttle.
    # PX4 removed it in 1.14, and has DO_SET_ACTUATOR instead.
    C.DO_SET_SERVO: Support(_NO_EFFECT, _REFUSED, "moves a servo that does not steer"),
    C.DO_SET_ACTUATOR: Support(_REFUSED, _NO_EFFECT, "moves a servo that does not steer"),
    C.DO_REPEAT_SERVO: Support(_NO_EFFECT, _REFUSED, "moves a servo that does not steer"),
    C.DO_RETURN_PATH_START: Support(_NO_EFFECT, _REFUSED, "marks where a return to launch may join the mission"),
    C.DO_LAND_START: Support(_FLOWN, _FLOWN, "marks the start of a landing sequence"),
    C.DO_GO_AROUND: Support(_NO_EFFECT, _REFUSED, "marks where an aborted landing continues"),
    C.DO_PAUSE_CONTINUE: Support(_NO_EFFECT, _REFUSED, SKIPPED_REASON),
    C.DO_SET_REVERSE: Support(_NO_EFFECT, _REFUSED, SKIPPED_REASON),
    C.DO_SET_ROI_LOCATION: Support(_NO_EFFECT, _NO_EFFECT, _GIMBAL_REASON),
    C.DO_SET_ROI_WPNEXT_OFFSET: Support(_REFUSED, _NO_EFFECT, _GIMBAL_REASON),
    C.DO_SET_ROI_NONE: Support(_NO_EFFECT, _NO_EFFECT, _GIMBAL_REASON),
    C.DO_CONTROL_VIDEO: Support(_REFUSED, _NO_EFFECT, CAMERA_REASON),
    C.DO_SET_ROI: Support(_NO_EFFECT, _NO_EFFECT, _GIMBAL_REASON),
    C.DO_DIGICAM_CONFIGURE: Support(_NO_EFFECT, _REFUSED, CAMERA_REASON),
    C.DO_DIGICAM_CONTROL: Support(_NO_EFFECT, _NO_EFFECT, CAMERA_REASON),
    C.DO_MOUNT_CONFIGURE: Support(_REFUSED, _NO_EFFECT, _GIMBAL_REASON),
    C.DO_MOUNT_CONTROL: Support(_NO_EFFECT, _NO_EFFECT, _GIMBAL_REASON),
    C.DO_SET_CAM_TRIGG_DIST: Support(_NO_EFFECT, _NO_EFFECT, CAMERA_REASON),
    # The mission's fence is judged, enabled or not.
    C.DO_FENCE_ENABLE: Support(_NO_EFFECT, _REFUSED, "switches the fence, which is judged in any case"),
    C.DO_PARACHUTE: Support(_OPEN, _REFUSED, "releases the parachute, or allows its release"),
    C.DO_INVERTED_FLIGHT: Support(_OPEN, _REFUSED, "ArduPlane continues in inverted flight"),
    C.DO_GRIPPER: Support(_NO_EFFECT, _NO_EFFECT, "for the payload; its mass is not simulated"),
    # `Plane::autotune_enable`: the roll and pitch gains change in flight. PX4 1.16 refuses it.
    C.DO_AUTOTUNE_ENABLE: Support(
        _OPEN, _OPEN, "the autopilot changes its own gains in flight; PX4 accepts it from 1.17 on"
    ),
    C.NAV_SET_YAW_SPEED: Support(_NO_EFFECT, _REFUSED, SKIPPED_REASON),
    C.DO_SET_CAM_TRIGG_INTERVAL: Support(_REFUSED, _NO_EFFECT, CAMERA_REASON),
    C.DO_SET_RESUME_REPEAT_DIST: Support(_NO_EFFECT, _REFUSED, "applies when an interrupted mission is resumed"),
    C.DO_SPRAYER: Support(_NO_EFFECT, _REFUSED, "for the payload, nothing to fly"),
    C.DO_SEND_SCRIPT_MESSAGE: Support(_OPEN, _REFUSED, "a script on board may do anything"),
    # `RC_Channel::run_aux_function`: its functions include modes, motor stop and returns.
    C.DO_AUX_FUNCTION: Support(_OPEN, _REFUSED, "an auxiliary switch, which may change the mode or stop the motor"),
    C.DO_GUIDED_LIMITS: Support(_NO_EFFECT, _REFUSED, SKIPPED_REASON),
    C.DO_ENGINE_CONTROL: Support(_OPEN, _REFUSED, "starts or stops the engine"),
    C.OBLIQUE_SURVEY: Support(_REFUSED, _NO_EFFECT, CAMERA_REASON),
    # PX4 1.16 refuses it.
    C.COMPONENT_ARM_DISARM: Support(_REFUSED, _OPEN, "can stop the motor; PX4 accepts this command from v1.17 on"),
    C.SET_CAMERA_MODE: Support(_REFUSED, _NO_EFFECT, CAMERA_REASON),
    # `parse_mavlink_mission_item` has no case for it.
    C.SET_CAMERA_ZOOM: Support(_NO_EFFECT, _REFUSED, CAMERA_REASON),
    C.SET_CAMERA_FOCUS: Support(_NO_EFFECT, _NO_EFFECT, CAMERA_REASON),
    C.SET_CAMERA_SOURCE: Support(_NO_EFFECT, _NO_EFFECT, CAMERA_REASON),
    C.JUMP_TAG: Support(_FLOWN, _REFUSED, "marks the target of DO_JUMP_TAG"),
    C.DO_JUMP_TAG: Support(_FLOWN, _REFUSED, "a jump to the first JUMP_TAG with its number"),
    C.DO_GIMBAL_MANAGER_PITCHYAW: Support(_NO_EFFECT, _NO_EFFECT, _GIMBAL_REASON),
    C.DO_GIMBAL_MANAGER_CONFIGURE: Support(_REFUSED, _NO_EFFECT, _GIMBAL_REASON),
    C.IMAGE_START_CAPTURE: Support(_NO_EFFECT, _NO_EFFECT, CAMERA_REASON),
    C.IMAGE_STOP_CAPTURE: Support(_NO_EFFECT, _NO_EFFECT, CAMERA_REASON),
    C.DO_TRIGGER_CONTROL: Support(_REFUSED, _NO_EFFECT, CAMERA_REASON),
    C.VIDEO_START_CAPTURE: Support(_NO_EFFECT, _NO_EFFECT, CAMERA_REASON),
    C.VIDEO_STOP_CAPTURE: Support(_NO_EFFECT, _NO_EFFECT, CAMERA_REASON),
    C.DO_VTOL_TRANSITION: Support(_OPEN, _OPEN, "a VTOL aircraft changes between rotors and wing"),
    C.CONDITION_GATE: Support(_REFUSED, _FLOWN, "PX4 applies later speed changes once the gate is passed"),
    C.DO_WINCH: Support(_NO_EFFECT, _NO_EFFECT, "for the payload, nothing to fly"),
    C.NAV_SCRIPT_TIME: Support(_OPEN, _REFUSED, "a script on board flies"),
    C.NAV_ATTITUDE_TIME: Support(_NO_EFFECT, _REFUSED, SKIPPED_REASON),
}

# Commands that only mark a place in the list of items; other commands or modes jump to them.
MARKS = frozenset({C.DO_RETURN_PATH_START, C.DO_LAND_START, C.DO_GO_AROUND, C.JUMP_TAG})

# Treatment of a command that is not in the table.
_UNKNOWN = Support(_REFUSED, _REFUSED, "no autopilot accepts it in a mission")


def command_support(command: int) -> Support:
    """Return the treatment of a mission command by ArduPlane and by PX4; unknown commands are refused.

    >>> command_support(Command.DO_JUMP).px4, command_support(Command.JUMP_TAG).px4, command_support(50_000).arduplane
    (<Treatment.FLOWN: 'flown'>, <Treatment.REFUSED: 'refused'>, <Treatment.REFUSED: 'refused'>)
    """
    return SUPPORT.get(command, _UNKNOWN)  # type: ignore[call-overload]
