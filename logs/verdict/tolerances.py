"""Define every tolerance and threshold of the verdict, with unit, reason and source.

If no source is named, the value is our own judgement of what matters to a flight.  The limits of the scenario and the
aircraft are not defined here; they are part of the flight's setup.
"""

import math

from aircraft import envelope

# Precision of a plan's numbers

# rad.  Tolerance of a planned angle. Items are rounded to 1e-7 degrees (1 cm), which turns a leg of 130 m by this much.
PLAN_TOLERANCE_RAD = math.radians(0.01)
# m.  A mission file states positions to 1e-7 degrees. This rounding moves a waypoint by up to 1 cm in each direction.
ROUNDING_M = 0.02
# m.  A leg, a loiter or a return may be this far below the required height above ground: the effect of `ROUNDING_M` on
# steep ground.
CLEARANCE_TOLERANCE_M = 0.1
# m.  Without terrain data, a route with a waypoint further below home than this is undecided. Ground stations round
# home's altitude to whole metres.
BELOW_HOME_M = 1.0
# m.  A mission's home may be this far above or below the terrain there. Such a difference comes from an altitude above
# the ellipsoid instead of mean sea level, and from errors of the elevation file. Nearly everywhere, both together are
# less than this.
HOME_ERROR_M = 50.0
# m.  A leg may be this far above the maximum height above ground, or above the ceiling: the effect of `ROUNDING_M` on
# steep ground.
HEIGHT_TOLERANCE_M = 0.1
# m.  A loiter's radius may be this much smaller than the radius at the bank limit: its center is rounded to 1e-7
# degrees.
LOITER_RADIUS_TOLERANCE_M = 0.02
# Laps.  A loiter may lack this many laps if the autopilot steers to its center. Such an autopilot joins and leaves the
# circle on other courses than drawn; joining it on the other side makes a difference of half a lap.
LOITER_LAPS_TOLERANCE = 0.5
# Fraction.  The mean radius of a flown loiter may exceed its stated radius by this, in addition to
# `WAYPOINT_PASS_MARGIN_M`.
LOITER_WIDENING_FRACTION = 0.25
# Radii of the arc at the bank limit.  An aircraft stays within this distance of a loiter's center, even if the loiter
# is too tight for its bank limit. In 20 flights of the simulated ArduPlane (loiters of 10 to 100 m, wind up to 12
# m/s) it reached up to 2.09. It also stays within this distance of the last waypoint that the simulated PX4 circles:
# up to 2.06 in 54 flights, in radii of that arc or of the loiter, whichever is larger.
LOITER_SWING_RADII = 2.25
# m.  A leg that is horizontally shorter than this is a vertical climb or descent, and has no course of its own.
MIN_LEG_LENGTH_M = 0.5
# rad.  Largest bank that is possible if the bank limit is only guessed; a lower limit of autopilot or scenario
# replaces it. What passes only with this bank is undecided. It is the steepest bank that a data sheet or a scenario
# may state.
POSSIBLE_BANK_RAD = math.radians(60.0)
# rad.  A sharper turn has no useful tangent length, because the tangent length of a U-turn is infinite.
U_TURN_RAD = math.pi - 1e-6
# Turn radii.  Maximum fly-by offset. Turns beyond about 176 degrees would need more, and are given this offset.
MAX_FLY_BY_OFFSET_RADII = 30.0

# The turn rule

# rad.  The mean bank over a second may exceed the limit by this: roll in gusts is not part of the turn.
BANK_TOLERANCE_RAD = math.radians(5.0)
# m.  A turn may be flown this far outside its arc.
OVERSHOOT_TOLERANCE_M = 5.0
# m.  A turn has settled if the mean distance from the next leg over a second is at most this.
SETTLED_CROSS_TRACK_M = 1.0
# m, by turbulence.  Increase of `SETTLED_CROSS_TRACK_M` by gusts.
GUST_OFFSET_M = {"none": 0.0, "light": 0.5, "moderate": 1.0}
# Fraction of the passing distance.  A turn may pass its waypoint closer than the arc at the bank limit does, by this
# fraction of the arc's distance plus `CORNER_CUT_TOLERANCE_M`.
CORNER_CUT_FRACTION = 0.01
# m, by turbulence.  Cross-track error of an aircraft with good guidance: a turn may pass its waypoint closer than the
# arc at the bank limit does, by this plus `CORNER_CUT_FRACTION` of the arc's distance.
CORNER_CUT_TOLERANCE_M = {"none": 0.6, "light": 0.8, "moderate": 1.0}
# Standard deviations.  Largest error of the navigation that the rules take into account.
NAVIGATION_SIGMAS = 3.0
# s.  A turn is measured for at most this long after its arc.
SETTLING_WATCH_TIME_S = 10.0
# Radii of the planned arc.  A larger flown radius is nearly straight flight, and says nothing about a turn.
STRAIGHT_RADIUS_RATIO = 10.0

# Fraction of the corridor's half width.  A corner is negligible if the path without its waypoint passes the waypoint
# within this. An aircraft on that path, or as far away on the waypoint's other side, is well inside the corridor.
KINK_FRACTION = 0.25
# Waypoints.  A turn or a step of altitude is negligible if a path without up to this many consecutive waypoints is
# flyable and near enough. The lines of a survey are longer than such a piece.
KINK_WAYPOINT_COUNT = 8

# The slope rule

# m.  A leg beyond its slope limit is negligible if it rises or descends by no more than this, together with its too
# steep neighbours. An aircraft that begins such a step early or late is within this height of it. ArduPlane itself
# flies altitude changes below ALT_SLOPE_MIN, 15 m by default, as a step.
NEGLIGIBLE_STEP_M = 10.0
# rad.  A fitted slope may differ from the plan by this, in addition to the fit's own tolerance.
SLOPE_TOLERANCE_RAD = math.radians(0.5)
# m.  Largest distance above or below the leg's line. The blends at the leg's ends, where the slope changes, are not
# judged.
HEIGHT_ERROR_LIMIT_M = 10.0
# m.  Largest distance above or below the line of a leg that is so short that it consists of blends only.
SHORT_LEG_HEIGHT_ERROR_LIMIT_M = 15.0
# rad.  The pitch is at the autopilot's limit if it is at most this far below the limit.
PITCH_LIMIT_TOLERANCE_RAD = math.radians(1.0)
# rad.  A leg with a gentler slope is level.
LEVEL_SLOPE_RAD = math.radians(0.5)
# m/s.  Texts call a wind below this calm air.
CALM_WIND_MPS = 0.5
# m/s.  Tolerance of the mean airspeed while the throttle is at a limit, or of the airspeed on an arc; in turbulence the
# standard deviation of the gusts is added.
SPEED_TOLERANCE_MPS = 1.0
# Fraction of the wind at 6 m.  Standard deviation of the gust along the track: MIL-F-8785C has 0.1 at altitude and up
# to 0.2 at the ground.
GUST_SPEED_FRACTION = 0.15
# Standard deviations.  A slope is undecided if it is closer than this to the limit of an uncertain aircraft model: 95 %
# one-sided, of a normal distribution.  The planner keeps the same distance from the limit.
UNDECIDED_FRACTION = envelope.UNDECIDED_SIGMAS
# s.  A climb at full throttle, or a glide with closed throttle, must last at least this long to show the aircraft's
# ability: the speed settles in 5 s, and the gusts of 15 s average out.
MIN_EVIDENCE_FLIGHT_S = 20.0
# rad.  The ability (the steepest slope that a flight shows to be possible) may be less than a leg's slope by the sum of
# this and `ABILITY_SIGMAS` standard errors.
ABILITY_TOLERANCE_RAD = math.radians(0.1)
# Standard errors.  Largest error of a measured ability (steepest possible slope) that the rules take into account.
ABILITY_SIGMAS = 3.0

# Measured slopes

# s.  Shortest time for which the throttle must be at a limit, while the mean airspeed is off its command, to show that
# a leg is too steep. Shorter times at a limit are normal.
SATURATED_TIME_S = 5.0
# s.  On a constant slope at airspeed V, air that rises at w adds airspeed at the rate g w/V. Drag removes this gain
# with about this time constant.
SPEED_MEMORY_S = 12.0
# m/s.  Smallest airspeed V with which the rate g w/V of `SPEED_MEMORY_S` is computed. It bounds the rate for an
# aircraft that has nearly stopped.
MIN_AIRBORNE_AIRSPEED_MPS = 10.0
# Fraction of a time window.  The throttle is at a limit in a window if it is at the limit for at least this fraction
# of the window.
SATURATED_FRACTION = 0.8
# Throttle, relative to the autopilot's limit.  A throttle of at least this is full throttle.
FULL_THROTTLE_FRACTION = 0.99
# Throttle 0..1.  A throttle of at most this is idle.
IDLE_THROTTLE_FRACTION = 0.01
# A.  The motor is off if the battery current is at most this.
ZERO_CURRENT_A = 0.02
# Throttle, relative to the autopilot's limit.  Only a throttle of at least this shows the ability to climb: 1 % of the
# Aerosonde's throttle makes 0.6 degrees of climb.
SATURATED_THROTTLE_FRACTION = 0.999
# s.  Shortest time over which a climb or sink ability is measured.
ABILITY_WINDOW_S = 1.5
# s.  An ability to climb or sink is measured from this time after the throttle has reached its limit.
ABILITY_SETTLING_S = 0.5
# s.  Values that are measured this far apart are assumed to be independent.
ABILITY_SAMPLE_INTERVAL_S = 0.5
# m/s of climb.  Resolution of the climb rate that follows from speed and acceleration.
CLIMB_RATE_RESOLUTION_MPS = 0.02
# Condition number.  A fit of measured climb rates is not used if its equations have a larger condition number, because
# they then do not determine the result.
MAX_CONDITION_NUMBER = 1e7
# rad.  A measured ability with a larger standard error is not used.
MAX_ABILITY_STD_ERROR_RAD = math.radians(0.3)
# m/s^2.  Acceleration with which the aircraft is assumed to change to another commanded airspeed.
MAX_STEADY_ACCELERATION_MPS2 = 0.5

# Courses and slopes by least squares

# m.  A fit of a leg's course or slope does not use this length at either end of the leg, beyond the turns.
TURN_EXCLUSION_M = 100.0
# m.  A fit of a leg's slope does not use this length next to a change of slope, and at the route's first waypoint.
BLEND_EXCLUSION_M = 20.0
# m.  Shortest piece of a leg to which a course is fitted.
MIN_COURSE_STRETCH_M = 60.0
# m.  Shortest piece of a leg to which a slope is fitted.
MIN_SLOPE_STRETCH_M = 100.0
# s.  Shortest time over which a slope is measured: over a shorter time the measured slope is too steep by degrees.
MIN_STRETCH_TIME_S = 4.0
# rad.  Smallest error of a fitted course, in calm air.
COURSE_ERROR_FLOOR_RAD = math.radians(0.02)
# rad.  Smallest error of a fitted slope, in calm air.
SLOPE_ERROR_FLOOR_RAD = math.radians(0.1)
# rad.  Largest tolerance of a fitted course or slope, even if the flight was unsteady.
MAX_UNSTEADINESS_RAD = math.radians(0.5)
# rad.  Tolerance of a flown course on a leg that is too short for a fit.
ROUGH_COURSE_ERROR_RAD = math.radians(0.75)
# rad.  Tolerance of a flown slope on a leg that is too short for a fit.
ROUGH_SLOPE_ERROR_RAD = math.radians(0.5)

# The rules on waypoints, speed, departure and completion

# m.  If neither mission nor autopilot states an acceptance radius, it is the distance at which the fly-by path passes
# the waypoint, plus this.  A corridor is also wider by this than its turns need.
WAYPOINT_PASS_MARGIN_M = 10.0
# m.  A larger height error at a waypoint is named in the first line of a verdict. At 106 waypoints of the simulated
# ArduPlane and PX4, on slopes of up to 5 degrees and in up to moderate turbulence, the error was at most 11.4 m. After
# a launch, ArduPlane passed waypoints of a safe plan up to 49 m too low.
NOTABLE_HEIGHT_ERROR_M = 25.0
# Ratio.  Assumed largest distance beyond the next leg after a fly-over turn, divided by R (1 - cos turn), if an
# autopilot turns by its own control law. It was up to 1.05 in 168 turns of the simulated ArduPlane, and up to 1.24 in
# 80 turns of PX4 (95 to 180 degrees, wind up to 12 m/s, light turbulence).
FLY_OVER_SWING_RATIO = 1.25
# m.  A path may pass a waypoint twice, at different altitudes. If both distances differ by less than this, the pass
# that is nearer in altitude is judged.
EQUAL_DISTANCE_TOLERANCE_M = 0.5
# m/s.  Tolerance of a leg's mean airspeed.
MEAN_SPEED_TOLERANCE_MPS = 1.0
# Fraction of the commanded airspeed.  A mean airspeed may differ from its command by this, or by
# `MEAN_SPEED_TOLERANCE_MPS` if that is more. Five aircraft with three control laws stayed within 10 % in still air,
# also after a command of 10 m/s more. With 10 % less airspeed, lift is a fifth less.
HELD_SPEED_FRACTION = 0.1
# m/s.  PX4 flies faster than commanded if the ground speed would otherwise be less than this (FW_GND_SPD_MIN).
MIN_GROUND_SPEED_MPS = 5.0
# Fraction of a leg's duration at `MIN_CONTROLLED_AIRSPEED_MPS`.  A mean airspeed is judged if the leg is flown steadily
# for `SATURATED_TIME_S`, or for this fraction of the leg's duration if that is shorter.
MEASURED_FRACTION = 0.5
# m.  An aircraft may begin a new slope this far before or after the waypoint, which matters on a short leg.
SLOPE_CHANGE_LAG_M = 10.0
# s.  Assumed duration of a gust.
GUST_DURATION_S = 10.0
# Standard deviations.  Largest effect of gusts on a leg's mean airspeed that the rules take into account.
GUST_SIGMAS = 2.0
# rad.  Bank beyond this is a loss of control.  The simulation's own threshold (flight/simulation/tick.py).
MAX_CONTROLLED_BANK_RAD = math.radians(75.0)
# m/s.  Airspeed below this is a loss of control of the Aerosonde.
MIN_CONTROLLED_AIRSPEED_MPS = 15.0
# Fraction of the slowest level speed.  A lower airspeed is a loss of control. (For the Aerosonde,
# `MIN_CONTROLLED_AIRSPEED_MPS` is the same limit.)
MIN_CONTROLLED_STALL_RATIO = 0.94
# s.  A log with a longer pause than this between rows has lost rows.
MAX_ROW_GAP_S = 0.5
# Median steps between rows.  A pause must also be longer than this many steps, because in a sparse log a step may be
# longer than `MAX_ROW_GAP_S`.
MAX_ROW_GAP_TICKS = 5.0
# m/s.  A log contradicts itself if the logged velocity differs from the change of the position by more than this.
MAX_VELOCITY_DISAGREEMENT_MPS = 10.0
# s.  Airspeed, bank and load factor are averaged over this time for comparison with the stall.
STALL_AVERAGING_TIME_S = 1.0
# m/s.  A flown airspeed may be below the stall speed in a bank by this plus the standard deviation of the gusts. In
# calm air, the airspeed varies by this when the guidance rolls into a turn.
STALL_TOLERANCE_MPS = 0.2
# Fraction of the battery or the tank that must be left at the end: the reserve.
ENERGY_RESERVE_FRACTION = 0.2
# V.  Nominal voltage of a lithium polymer cell, by which the cells of a battery are counted.
NOMINAL_CELL_VOLTAGE_V = 3.7
# V.  Loaded voltage of an empty cell, the default of PX4's BAT1_V_EMPTY: with the reserve left, the loaded voltage of a
# healthy cell is higher.  A battery failsafe with a higher threshold may act earlier.
EMPTY_CELL_VOLTAGE_V = 3.6
# V.  Voltage to which a lithium polymer cell is charged: ArduPlane does not arm with a higher threshold for each cell.
FULL_CELL_VOLTAGE_V = 4.2

# Surveys

# Fraction of a photo line that must be usable: flown on the line, level, at the planned height above ground, and with
# the camera on.  A line that loses one metre in twenty still overlaps as usual surveys do.
PHOTO_COVERAGE_FRACTION = 0.95
# Fraction of the line spacing.  A photo may be taken this far to the side of its line. If two neighbouring lines are
# both off by this, their distance is 1.5 times the spacing, and an overlap of 60 % falls to 40 %.
PHOTO_OFFSET_FRACTION = 0.25
# rad.  Largest bank in a photo: at 60 m above ground its center is then 10 m to the side.
MAX_PHOTO_BANK_RAD = math.radians(10.0)
# Fraction of the planned height above ground.  A photo may be taken this much higher or lower: the area that a photo
# shows, and its overlap, depend on the height.
PHOTO_HEIGHT_FRACTION = 0.1
# m.  Smallest tolerance of a photo's height above ground.
MIN_PHOTO_HEIGHT_ERROR_M = 5.0
# rad.  An aircraft flies along a line if its course is within this of the line's course.
MAX_PHOTO_COURSE_ERROR_RAD = math.radians(30.0)
# m.  Step in which a photo line is checked.
PHOTO_STEP_M = 1.0
# Fraction of a photo.  Photos may overlap by this much less than required. If one line is off by a quarter of the
# spacing (`PHOTO_OFFSET_FRACTION`) and its neighbour is not, a side overlap of 60 % falls to 50 %.
PHOTO_OVERLAP_TOLERANCE = 0.1
# Radii of the bank limit's arc.  A turn-around too tight to be flown as drawn may lead this far beyond its waypoints: a
# turn back onto the next line takes 1 + sqrt(3) radii, and rolling takes the rest.
TURN_AROUND_RADII = 3.25

# Departures from the ground and approaches to it

# m.  Terrain within this distance of home is ignored under a climb-out. The rail or the runway is there, and the
# distance is less than two pixels of the usual elevation files.
LAUNCH_RUN_M = 50.0
# m.  Least height above the ground at home to which an aircraft climbs before it descends to its first waypoint: below
# that ArduPlane flies no slope (`Plane::setup_glide_slope`).
FIRST_CLIMB_HEIGHT_M = 20.0
# Fraction of the steepest climb at the commanded airspeed.  A take-off climbs at least this steeply: ArduPlane's
# take-offs of an Aerosonde reached 0.76 of it and more.
MIN_CLIMB_FRACTION = 0.7
# m.  Ground contact up to this far short of the landing point is a touchdown: on ground that rises by 5 to 8 %
# ArduPlane touched down 28 to 47 m early.
EARLY_TOUCHDOWN_DISTANCE_M = 60.0
# m.  A glide may be flown this much lower than laid out: 15 glides of ArduPlane, some of them in light turbulence, were
# at most 3.9 m below the straight line to the landing point.
GLIDE_PATH_TOLERANCE_M = 5.0
# m.  The glide tolerance applies down to this height above the landing point; below it the flare may start.
FLARE_HEIGHT_MARGIN_M = 15.0
# m.  A landing point may be this far above or below the ground of the elevation file.  If it is further above, the
# aircraft flares too early and drops.  If it is further below, the aircraft flies into the ground.
LANDING_POINT_ERROR_M = 10.0
# m.  Required height above ground on a go-around.  Its turns are not laid out exactly.
GO_AROUND_CLEARANCE_M = 20.0
# m.  A waypoint of the landing sequence may be below the required height. Within this distance of it a go-around may
# be as low as the waypoint: a slope down to a waypoint that is 10 m lower needs this length.
LINE_UP_DISTANCE_M = 500.0
# m.  A go-around is undecided if its climb clears the ground beyond the landing point by less than this. The
# simulated height was within this of the one recorded go-around of ArduPlane, which did not have to climb.
GO_AROUND_MODEL_ERROR_M = 6.0

# Flown take-offs and landings

# m.  Least height above ground of a climb-out beyond `LAUNCH_RUN_M`: less than the usual elevation files' own error,
# and more than a small aircraft's banked wing reaches down.
LAUNCH_CLEARANCE_M = 2.0
# m.  A climb-out that exceeds `LAUNCH_CLEARANCE_M` by less than this is undecided: the simulated ArduPlane's height was
# within 2.3 m of ArduPlane's own (SITL) in the first 14 s of five flights.
CLIMB_MODEL_ERROR_M = 2.5
# m.  Largest height loss of a launched aircraft: ArduPlane's catapult launches at 14 m/s and more lost none; in a hand
# launch at 1.8 m a larger loss leaves no room for a wing.
MAX_LAUNCH_HEIGHT_LOSS_M = 1.0
# m.  Least runway length left where the aircraft leaves the ground: the simulated ArduPlane left it after 34 m, and
# ArduPlane itself (SITL) after 37 m, in the one such flight that is known.
RUNWAY_MARGIN_M = 10.0
# m.  Required height above ground of the legs after a take-off and of a landing sequence, even if the scenario requires
# more, because these legs are always near the ground. It equals the requirement on a go-around,
# `GO_AROUND_CLEARANCE_M`.
GROUND_LEG_CLEARANCE_M = GO_AROUND_CLEARANCE_M
# m.  Largest distance from home, or from the landing point, at which `GROUND_LEG_CLEARANCE_M` applies: the length of
# the longest final approach that a plan has.  Beyond it, the scenario's requirement applies to these legs, too.
FIELD_RADIUS_M = 2000.0
# rad.  After a take-off the first leg's corridor applies once the aircraft's course is within this of the leg's course.
RUNWAY_COURSE_TOLERANCE_RAD = math.radians(10.0)
# m.  An aircraft at most this far above its standing height has touched down.  Rows are 1/60 s apart.
CONTACT_HEIGHT_M = 0.02
# m.  A flight with landing gear that ends early below this height above ground has hit the ground: wheels or belly
# touch it before the center of gravity does.
MAX_GEAR_HEIGHT_M = 1.0
# m.  Error of a simulated touchdown along the strip: 5 touchdowns of ArduPlane in steady wind were within 15 m of the
# simulated ones, and 38 of 42 in light turbulence within 30 m.  The strip must be this much longer at either end.
TOUCHDOWN_ERROR_M = 30.0
# m.  In turbulence a landing is undecided if it leaves less of the strip than this. 42 touchdowns of ArduPlane were
# 27 m shorter to 46 m longer than simulated, with an 11 kg Aerosonde as well as a 2 kg wing.
GUST_TOUCHDOWN_ERROR_M = 50.0
# m.  A final approach that is simulated lower above ground than this, before its flare may begin, is undecided: five
# ArduPlane approaches reached their flares within 2 m of the simulated height.
FINAL_APPROACH_CLEARANCE_M = 3.0
# m/s.  A faster sink towards the ground leaves a touchdown undecided: 15 ArduPlane landings touched down at 0.5 to
# 4.2 m/s, and an aircraft that a flare drops from a height touches down faster than any of them.
MAX_TOUCHDOWN_SINK_MPS = 5.0

# Alignment of a track with its route

# m.  A waypoint further than this from the track was not passed.
CAPTURE_RADIUS_M = 500.0
# s.  Rows are thinned to at least this interval to find which part of a track belongs to which waypoint. The row
# nearest to each waypoint is then searched among all rows.
CHORD_TIME_S = 0.25
# m.  A track that ends near a waypoint has passed it if the distance is at most this plus the distance at which the
# fly-by path passes the waypoint.
FINAL_WAYPOINT_TOLERANCE_M = 10.0
# s.  An imported flight that continues this long after its last waypoint has flown a part of the next leg.
PARTIAL_LEG_MIN_S = 2.0
# s.  In a longer pause of an imported log the aircraft's position is unknown. At a bank of 45 degrees it deviates in
# this time by g t^2 / 16 = 61 m and returns, which is within the corridor of a usual WP_RADIUS.
MAX_UNSEEN_TIME_S = 10.0
# m.  A flight that stays further than this from every waypoint of a plan was flown somewhere else.
PLAN_MISMATCH_DISTANCE_M = 1000.0
# m.  When the order of waypoints is checked, the aircraft has passed a waypoint if its distance from the waypoint was
# at most the half width of the corridor. If the half width is less than this, this distance applies.
MIN_NEAR_WAYPOINT_M = 50.0
# m.  When the order of waypoints is checked, the aircraft has passed a waypoint if its distance from the waypoint was
# at most the half width of the corridor. If the half width is more than this, this distance applies.
MAX_NEAR_WAYPOINT_M = 150.0
# Fraction of the passed waypoints.  At least this many must be passed in the plan's order; otherwise the log is a
# flight of another plan.
MIN_IN_ORDER_FRACTION = 0.8
# m.  Largest plausible distance from the origin; a row with a larger one is invalid.
MAX_PLAUSIBLE_POSITION_M = 1e7
# m/s.  Largest plausible speed; a row with a larger one is invalid.
MAX_PLAUSIBLE_SPEED_MPS = 1e4
# rad, deflection, m/s.  Largest plausible attitude, control or wind; a row with a larger one is invalid.
MAX_PLAUSIBLE_VALUE = 1e3
# s.  Two stays in a sphere are one stay if the pause between them is at most this, which is the effect of rounding.
SPHERE_STAY_TOLERANCE_S = 1e-6
# Diagonals of a block of segments.  Segments of the track that are further than this from a sphere's center are joined
# to longer ones for the exposure, which changes it by less than 0.1 %.
SPHERE_FAR_DIAGONALS = 30.0

# PX4's checks: constants of its `FeasibilityChecker` in addition to `flight.autopilots.parts.FeasibilityLimits`

# rad.  A landing approach may be steeper than FW_LND_ANG by this; the number is in the source of PX4's checker.
PX4_LANDING_BUFFER_RAD = math.radians(0.1)
# m.  Largest distance of the first waypoint from home: the default of PX4's MIS_DIST_1WP.
PX4_FIRST_WAYPOINT_DISTANCE_M = 10_000.0
# m.  Largest distance between waypoints: the default of MIS_DIST_WPS, in the releases that had this parameter.
PX4_WAYPOINT_SPACING_M = 900.0
# m.  A condition gate nearer than this to a waypoint is at the waypoint.
PX4_GATE_SPACING_M = 0.05

# Suggestions

# rad.  A suggested angle keeps its limit by this much, so that rounding does not undo it.
SUGGESTION_ANGLE_MARGIN_RAD = math.radians(0.1)
# m.  A suggested length keeps its limit by this much.
SUGGESTION_LENGTH_MARGIN_M = 1.0
# Fraction.  A suggested speed keeps its limit by this much.
SUGGESTION_SPEED_MARGIN_FRACTION = 0.03
# m/s.  Step of a suggested speed.
SUGGESTION_SPEED_STEP_MPS = 0.5
# Ratio.  The least suggested speed is this times the slowest level speed.
MIN_SUGGESTED_SPEED_RATIO = 1.1
# m.  A smaller rise is not suggested.
MIN_SUGGESTED_RISE_M = 1.0
# Trials.  Largest number of gentler turns that are tried.
SUGGESTION_TRIAL_COUNT = 6
# Trials.  Largest number of larger shifts past a zone that are tried; each comes nearer by a third or more.
ZONE_SUGGESTION_TRIAL_COUNT = 40
