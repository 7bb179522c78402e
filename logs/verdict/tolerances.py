"""Define every tolerance and threshold of the verdict, with unit, reason and source.

If no source is named, the value is our own judgement of what matters to a flight.  The limits of the scenario and the
aircraft are not defined here; they are part of the flight's setup.
"""

import math

from aircraft import envelope

# Precision of a plan's numbers

# rad.  Tolerance of a planned angle. The positions of items are rounded to 1e-7 degrees (1 cm), which turns a leg of
# 130 m by this much.
PLAN_TOLERANCE_RAD = math.radians(0.01)
# m.  Tolerance of a planned position. A mission file states positions to 1e-7 degrees, and this rounding moves a
# waypoint by up to 1 cm in each direction.
ROUNDING_M = 0.02
# m.  A leg, a loiter or a return to launch may be this far below the required height above ground. On steep ground,
# `ROUNDING_M` has this effect.
CLEARANCE_TOLERANCE_M = 0.1
# m.  Without terrain data, a route is undecided if a waypoint is further below home than this. A smaller difference may
# be due to ground stations, which round home's altitude to whole metres.
BELOW_HOME_M = 1.0
# m.  A mission's home may be this far above or below the terrain. A difference occurs if home's altitude is above the
# ellipsoid instead of mean sea level, and if the elevation file has errors. Nearly everywhere, both together are less
# than this.
HOME_ERROR_M = 50.0
# m.  A leg may be this far above the maximum height above ground, or above the ceiling. On steep ground, `ROUNDING_M`
# has this effect.
HEIGHT_TOLERANCE_M = 0.1
# m.  The radius of a loiter may be this much smaller than the turn radius at the bank limit, because the center of the
# loiter is rounded to 1e-7 degrees.
LOITER_RADIUS_TOLERANCE_M = 0.02
# Laps.  If the autopilot steers to the center of a loiter, this many laps may be missing. Such an autopilot joins and
# leaves the circle on other courses than drawn. If it joins the circle on the other side, the difference is half a lap.
LOITER_LAPS_TOLERANCE = 0.5
# Fraction of the stated radius.  The mean radius of a flown loiter may exceed the stated radius by this, plus
# `WAYPOINT_PASS_MARGIN_M`.
LOITER_WIDENING_FRACTION = 0.25
# Radii of the arc at the bank limit.  An aircraft stays within this distance of a loiter's center, even if the loiter
# is too tight for its bank limit: in 20 flights of the simulated ArduPlane (loiters of 10 to 100 m, wind up to 12 m/s),
# the distance was at most 2.09 radii. If the simulated PX4 circles at the last waypoint, the aircraft stays within this
# distance of it too: in 54 flights, the distance was at most 2.06 radii of that arc or of the loiter, whichever radius
# is larger.
LOITER_SWING_RADII = 2.25
# m.  A leg that is horizontally shorter than this is a vertical climb or descent, and has no course of its own.
MIN_LEG_LENGTH_M = 0.5
# rad.  Largest bank that is assumed to be possible if the bank limit is only a guess. A lower limit of autopilot or
# scenario replaces it. What passes only with this bank is undecided. It is the steepest bank that a data sheet or a
# scenario may state.
POSSIBLE_BANK_RAD = math.radians(60.0)
# rad.  Turns that are sharper than this have no useful tangent length, because the tangent length of a U-turn is
# infinite.
U_TURN_RAD = math.pi - 1e-6
# Turn radii.  Largest distance at which a fly-by path is assumed to pass its waypoint. It replaces the larger distance
# of turns beyond about 176 degrees.
MAX_FLY_BY_OFFSET_RADII = 30.0

# The turn rule

# rad.  The bank, averaged over a second, may exceed the limit by this, because the roll that gusts cause is not part of
# the turn.
BANK_TOLERANCE_RAD = math.radians(5.0)
# m.  A turn may be flown this far outside its arc.
OVERSHOOT_TOLERANCE_M = 5.0
# m.  The aircraft has settled after a turn if its distance from the next leg, averaged over a second, is at most this.
SETTLED_CROSS_TRACK_M = 1.0
# m, by turbulence.  Because of gusts, `SETTLED_CROSS_TRACK_M` is increased by this.
GUST_OFFSET_M = {"none": 0.0, "light": 0.5, "moderate": 1.0}
# Fraction of the passing distance.  The arc at the bank limit passes the waypoint at some distance. A flown turn may
# pass the waypoint closer than this arc, by this fraction of that distance plus `CORNER_CUT_TOLERANCE_M`.
CORNER_CUT_FRACTION = 0.01
# m, by turbulence.  Cross-track error of an aircraft with good guidance. A flown turn may pass its waypoint closer than
# the arc at the bank limit, by this plus `CORNER_CUT_FRACTION` of the arc's distance. The rule `waypoint` adds this to
# its limit.
CORNER_CUT_TOLERANCE_M = {"none": 0.6, "light": 0.8, "moderate": 1.0}
# Standard deviations.  The rules allow for navigation errors of up to this.
NAVIGATION_SIGMAS = 3.0
# s.  A turn is measured until this time after the end of its arc.
SETTLING_WATCH_TIME_S = 10.0
# Radii of the planned arc.  If the flown radius is larger than this, the aircraft flew nearly straight, and the radius
# says nothing about the turn.
STRAIGHT_RADIUS_RATIO = 10.0

# Fraction of the corridor's half width.  A corner is negligible if a path that leaves out its waypoint passes the
# waypoint within this. An aircraft on that path is well inside the corridor, and so is an aircraft that is as far away
# on the other side of the waypoint.
KINK_FRACTION = 0.25
# Waypoints.  A turn or a step of altitude is negligible if a path that leaves out up to this many consecutive waypoints
# is flyable and near enough. The lines of a survey are longer than the part that is left out.
KINK_WAYPOINT_COUNT = 8

# The slope rule

# m.  A leg that is too steep is negligible if it rises or descends by no more than this, together with neighbouring
# legs that are too steep. An aircraft that begins such a step early or late is within this height of the leg. ArduPlane
# itself flies changes of altitude of less than ALT_SLOPE_MIN (15 m by default) as a step.
NEGLIGIBLE_STEP_M = 10.0
# rad.  The slope that is fitted to a flown leg may differ from the planned slope by this, in addition to the tolerance
# of the fit.
SLOPE_TOLERANCE_RAD = math.radians(0.5)
# m.  Largest accepted distance above or below the leg's line. The blends at the leg's ends, where the slope changes,
# are not judged.
HEIGHT_ERROR_LIMIT_M = 10.0
# m.  Largest accepted distance above or below the line of a leg that is so short that it consists only of the blends at
# its ends.
SHORT_LEG_HEIGHT_ERROR_LIMIT_M = 15.0
# rad.  The pitch is at the autopilot's limit if it is at most this far below the limit.
PITCH_LIMIT_TOLERANCE_RAD = math.radians(1.0)
# rad.  A leg with a gentler slope counts as level.
LEVEL_SLOPE_RAD = math.radians(0.5)
# m/s.  In messages, a weaker wind is called calm air.
CALM_WIND_MPS = 0.5
# m/s.  Tolerance of the mean airspeed while the throttle is at a limit, and of the airspeed on an arc. In turbulence,
# the standard deviation of the gusts is added.
SPEED_TOLERANCE_MPS = 1.0
# Fraction of the wind at 6 m.  Standard deviation of the gusts along the track. MIL-F-8785C states 0.1 at altitude and
# up to 0.2 at the ground.
GUST_SPEED_FRACTION = 0.15
# Standard deviations.  If the aircraft model is uncertain, a slope that is closer than this to the limit is undecided.
# This is the one-sided 95 % bound of a normal distribution. The planner keeps the same distance from the limit.
UNDECIDED_FRACTION = envelope.UNDECIDED_SIGMAS
# s.  To show the aircraft's ability, a climb at full throttle or a glide with closed throttle must last at least this
# long: the speed settles in 5 s, and gusts of 15 s average out.
MIN_EVIDENCE_FLIGHT_S = 20.0
# rad.  The ability is the steepest slope that a flight shows to be possible. It may be less than a leg's slope by this
# plus `ABILITY_SIGMAS` standard errors.
ABILITY_TOLERANCE_RAD = math.radians(0.1)
# Standard errors.  The rules allow for errors of a measured ability (steepest possible slope) of up to this.
ABILITY_SIGMAS = 3.0

# Measured slopes

# s.  To show that a leg is too steep, the throttle must be at a limit, with a mean airspeed off its command, for at
# least this long. Shorter times at a limit are normal.
SATURATED_TIME_S = 5.0
# s.  If an aircraft at airspeed V holds a constant slope, air that rises at the speed w increases the airspeed at the
# rate g w/V. Drag removes this gain with about this time constant.
SPEED_MEMORY_S = 12.0
# m/s.  Smallest airspeed V with which the rate g w/V of `SPEED_MEMORY_S` is computed, so that the rate stays finite for
# an aircraft that has nearly stopped.
MIN_AIRBORNE_AIRSPEED_MPS = 10.0
# Fraction of a time window.  The throttle counts as at its limit in a window if it is there for at least this fraction
# of the window.
SATURATED_FRACTION = 0.8
# Throttle, relative to the autopilot's limit.  A throttle of at least this counts as full throttle.
FULL_THROTTLE_FRACTION = 0.99
# Throttle 0..1.  A throttle of at most this counts as idle.
IDLE_THROTTLE_FRACTION = 0.01
# A.  The motor counts as off if the battery current is at most this.
ZERO_CURRENT_A = 0.02
# Throttle, relative to the autopilot's limit.  Only a throttle of at least this shows how steeply the aircraft can
# climb: 1 % of the Aerosonde's throttle changes its climb by 0.6 degrees.
SATURATED_THROTTLE_FRACTION = 0.999
# s.  An ability to climb or sink is measured over at least this time.
ABILITY_WINDOW_S = 1.5
# s.  The measurement of an ability to climb or sink begins this long after the throttle has reached its limit.
ABILITY_SETTLING_S = 0.5
# s.  Measured values that are this far apart in time are assumed to be independent.
ABILITY_SAMPLE_INTERVAL_S = 0.5
# m/s of climb.  Resolution of the climb rate that is computed from speed and acceleration.
CLIMB_RATE_RESOLUTION_MPS = 0.02
# Condition number.  If the equations of a fit to measured climb rates have a larger condition number, they do not
# determine the result, and the fit is not used.
MAX_CONDITION_NUMBER = 1e7
# rad.  A measured ability with a larger standard error is not used.
MAX_ABILITY_STD_ERROR_RAD = math.radians(0.3)
# m/s^2.  Assumed acceleration of the aircraft when it changes to another commanded airspeed.
MAX_STEADY_ACCELERATION_MPS2 = 0.5

# Courses and slopes by least squares

# m.  A fit of a leg's course or slope leaves out the turns, and this length at either end of the leg.
TURN_EXCLUSION_M = 100.0
# m.  A fit of a leg's slope leaves out this length next to a change of slope, and at the route's first waypoint.
BLEND_EXCLUSION_M = 20.0
# m.  Shortest piece of a leg to which a course is fitted.
MIN_COURSE_STRETCH_M = 60.0
# m.  Shortest piece of a leg to which a slope is fitted.
MIN_SLOPE_STRETCH_M = 100.0
# s.  Shortest time over which a slope is measured. Over shorter times, the measured slope is too steep by degrees.
MIN_STRETCH_TIME_S = 4.0
# rad.  Smallest assumed error of a fitted course, in calm air.
COURSE_ERROR_FLOOR_RAD = math.radians(0.02)
# rad.  Smallest assumed error of a fitted slope, in calm air.
SLOPE_ERROR_FLOOR_RAD = math.radians(0.1)
# rad.  Largest tolerance of a fitted course or slope, even if the flight was unsteady.
MAX_UNSTEADINESS_RAD = math.radians(0.5)
# rad.  Tolerance of a flown course on a leg that is too short for a fit.
ROUGH_COURSE_ERROR_RAD = math.radians(0.75)
# rad.  Tolerance of a flown slope on a leg that is too short for a fit.
ROUGH_SLOPE_ERROR_RAD = math.radians(0.5)

# The rules on waypoints, speed, departure and completion

# m.  If neither mission nor autopilot states an acceptance radius, the radius is the distance at which the fly-by path
# passes the waypoint, plus this. The corridor is also this much wider than the turns need.
WAYPOINT_PASS_MARGIN_M = 10.0
# m.  The first line of a verdict names a height error at a waypoint that is larger than this. At 106 waypoints of the
# simulated ArduPlane and PX4, on slopes of up to 5 degrees and in up to moderate turbulence, the error was at most 11.4
# m. After a launch, ArduPlane passed waypoints of a safe plan up to 49 m too low.
NOTABLE_HEIGHT_ERROR_M = 25.0
# Multiple of R (1 - cos turn).  Assumed largest distance beyond the next leg after a fly-over turn, if an autopilot
# turns by its own control law. It was up to 1.05 in 168 turns of the simulated ArduPlane, and up to 1.24 in 80 turns of
# PX4 (95 to 180 degrees, wind up to 12 m/s, light turbulence).
FLY_OVER_SWING_RATIO = 1.25
# m.  A path may pass a waypoint twice, at different altitudes. If the two horizontal distances differ by less than
# this, the pass that is nearer in altitude is judged.
EQUAL_DISTANCE_TOLERANCE_M = 0.5
# m/s.  Tolerance of the mean airspeed on a leg.
MEAN_SPEED_TOLERANCE_MPS = 1.0
# Fraction of the commanded airspeed.  The mean airspeed may differ from its command by this, or by
# `MEAN_SPEED_TOLERANCE_MPS` if that is more. Five aircraft with three control laws stayed within 10 % in still air,
# even after the command had increased by 10 m/s. With 10 % less airspeed, lift is a fifth less.
HELD_SPEED_FRACTION = 0.1
# m/s.  PX4 flies faster than commanded if the ground speed would otherwise be less than this (FW_GND_SPD_MIN).
MIN_GROUND_SPEED_MPS = 5.0
# Fraction.  The mean airspeed of a leg is judged if the leg is flown steadily for `SATURATED_TIME_S`, or for this
# fraction of its duration at `MIN_CONTROLLED_AIRSPEED_MPS` if that is shorter.
MEASURED_FRACTION = 0.5
# m.  An aircraft may begin a new slope this far before or after the waypoint, which affects the mean airspeed of a
# short leg.
SLOPE_CHANGE_LAG_M = 10.0
# s.  Assumed duration of a gust.
GUST_DURATION_S = 10.0
# Standard deviations.  The rules allow for effects of gusts on a leg's mean airspeed of up to this.
GUST_SIGMAS = 2.0
# rad.  A larger bank is a loss of control. The simulation has the same threshold (flight/simulation/tick.py).
MAX_CONTROLLED_BANK_RAD = math.radians(75.0)
# m/s.  For the Aerosonde, a lower airspeed is a loss of control.
MIN_CONTROLLED_AIRSPEED_MPS = 15.0
# Fraction of the slowest level speed.  A lower airspeed is a loss of control. (For the Aerosonde,
# `MIN_CONTROLLED_AIRSPEED_MPS` is the same limit.)
MIN_CONTROLLED_STALL_RATIO = 0.94
# s.  A log has lost rows if the pause between two rows is longer than this.
MAX_ROW_GAP_S = 0.5
# Median steps between rows.  To count as a loss of rows, a pause must also be longer than this many steps, because in a
# sparse log a step may be longer than `MAX_ROW_GAP_S`.
MAX_ROW_GAP_TICKS = 5.0
# m/s.  A log contradicts itself if the logged velocity differs from the change of the position by more than this.
MAX_VELOCITY_DISAGREEMENT_MPS = 10.0
# s.  For the comparison with the stall speed, airspeed, bank and load factor are averaged over this time.
STALL_AVERAGING_TIME_S = 1.0
# m/s.  A flown airspeed may be below the stall speed by this plus the standard deviation of the gusts. In calm air, the
# airspeed varies by this when the guidance rolls into a turn.
STALL_TOLERANCE_MPS = 0.2
# Fraction of the battery or the tank that must be left at the end: the reserve.
ENERGY_RESERVE_FRACTION = 0.2
# V.  Nominal voltage of a lithium polymer cell. The number of cells is the battery's voltage divided by this.
NOMINAL_CELL_VOLTAGE_V = 3.7
# V.  Loaded voltage of an empty cell, the default of PX4's BAT1_V_EMPTY. While the reserve is left, the loaded voltage
# of a healthy cell is higher than this. A battery failsafe with a threshold above this may act earlier.
EMPTY_CELL_VOLTAGE_V = 3.6
# V.  Voltage to which a lithium polymer cell is charged. ArduPlane does not arm if a threshold is higher than this for
# each cell.
FULL_CELL_VOLTAGE_V = 4.2

# Surveys

# Fraction of the photo line.  At least this must be usable: flown on the line, level, at the planned height above
# ground, and with the camera on. Photos still overlap as in usual surveys if one metre in twenty is lost.
PHOTO_COVERAGE_FRACTION = 0.95
# Fraction of the line spacing.  A photo may be taken this far to the side of its line. If two neighbouring lines are
# both off by this, their distance is 1.5 times the spacing, and an overlap of 60 % falls to 40 %.
PHOTO_OFFSET_FRACTION = 0.25
# rad.  Largest bank in a photo. At 60 m above ground, this bank moves the center of the photo 10 m to the side.
MAX_PHOTO_BANK_RAD = math.radians(10.0)
# Fraction of the planned height above ground.  A photo may be taken this much higher or lower than planned. The area
# that a photo shows, and its overlap with other photos, depend on the height.
PHOTO_HEIGHT_FRACTION = 0.1
# m.  The tolerance of a photo's height above ground is at least this.
MIN_PHOTO_HEIGHT_ERROR_M = 5.0
# rad.  An aircraft flies along a line if its course is within this of the line's course.
MAX_PHOTO_COURSE_ERROR_RAD = math.radians(30.0)
# m.  Step in which a photo line is checked.
PHOTO_STEP_M = 1.0
# Fraction of a photo.  Photos may overlap by this much less than required. If one line is off by a quarter of the
# spacing (`PHOTO_OFFSET_FRACTION`) and its neighbour is not, a side overlap of 60 % falls to 50 %.
PHOTO_OVERLAP_TOLERANCE = 0.1
# Radii of the bank limit's arc.  A turn-around that is too tight to be flown as drawn may lead this far beyond its
# waypoints: a turn back onto the next line takes 1 + sqrt(3) radii, and rolling takes the rest.
TURN_AROUND_RADII = 3.25

# Departures from the ground and approaches to it

# m.  Under a climb-out, terrain within this distance of home is ignored. The rail or the runway is there, and the
# distance is less than two pixels of the usual elevation files.
LAUNCH_RUN_M = 50.0
# m.  An aircraft climbs at least to this height above the ground at home before it descends to its first waypoint,
# because ArduPlane flies no slope below this height (`Plane::setup_glide_slope`).
FIRST_CLIMB_HEIGHT_M = 20.0
# Fraction of the steepest climb at the commanded airspeed.  A take-off is assumed to climb at least this steeply.
# ArduPlane's take-offs of an Aerosonde reached at least 0.76.
MIN_CLIMB_FRACTION = 0.7
# m.  Ground contact counts as a touchdown if it is at most this far short of the landing point. On ground that rises by
# 5 to 8 %, ArduPlane touched down 28 to 47 m early.
EARLY_TOUCHDOWN_DISTANCE_M = 60.0
# m.  A glide may be flown this much lower than drawn: 15 glides of ArduPlane, some of them in light turbulence, were at
# most 3.9 m below the straight line to the landing point.
GLIDE_PATH_TOLERANCE_M = 5.0
# m.  The glide tolerance applies down to this height above the landing point. Below this height, the flare may start.
FLARE_HEIGHT_MARGIN_M = 15.0
# m.  A landing point may be this far above or below the ground of the elevation file.  If it is further above, the
# aircraft flares too early and drops.  If it is further below, the aircraft flies into the ground.
LANDING_POINT_ERROR_M = 10.0
# m.  Required height above ground on a go-around, whose turns are not computed exactly.
GO_AROUND_CLEARANCE_M = 20.0
# m.  A waypoint of the landing sequence may be below the required height. Within this distance of such a waypoint, a
# go-around may be as low as the waypoint: a slope down to a waypoint that is 10 m lower needs this length.
LINE_UP_DISTANCE_M = 500.0
# m.  A go-around is undecided if its climb clears the ground beyond the landing point by less than this. In the only
# recorded go-around of ArduPlane, the error of the simulated height was less than this, but ArduPlane did not have to
# climb.
GO_AROUND_MODEL_ERROR_M = 6.0

# Flown take-offs and landings

# m.  Smallest accepted height above ground of a climb-out, beyond `LAUNCH_RUN_M`. It is less than the error of the
# usual elevation files, but more than the wing of a small aircraft reaches down in a bank.
LAUNCH_CLEARANCE_M = 2.0
# m.  A climb-out is undecided if it exceeds `LAUNCH_CLEARANCE_M` by less than this. In the first 14 s of five flights,
# the height of the simulated ArduPlane was within 2.3 m of the height of ArduPlane itself (SITL).
CLIMB_MODEL_ERROR_M = 2.5
# m.  Largest accepted loss of height after a launch. ArduPlane's catapult launches at 14 m/s and more lost no height.
# In a hand launch at 1.8 m, a larger loss leaves no room for a wing.
MAX_LAUNCH_HEIGHT_LOSS_M = 1.0
# m.  Least length of the runway that must be left where the aircraft leaves the ground. In the only known flight of
# this kind, the simulated ArduPlane left the ground after 34 m, and ArduPlane itself (SITL) after 37 m.
RUNWAY_MARGIN_M = 10.0
# m.  Required height above ground of the legs after a take-off and of a landing sequence, even if the scenario requires
# more, because these legs are always near the ground. It is the same as on a go-around (`GO_AROUND_CLEARANCE_M`).
GROUND_LEG_CLEARANCE_M = GO_AROUND_CLEARANCE_M
# m.  `GROUND_LEG_CLEARANCE_M` applies up to this distance from home, or from the landing point. It is the length of the
# longest final approach that a plan has. Beyond it, the scenario's requirement applies to these legs too.
FIELD_RADIUS_M = 2000.0
# rad.  After a take-off, the corridor of the first leg applies as soon as the aircraft's course is within this of the
# leg's course.
RUNWAY_COURSE_TOLERANCE_RAD = math.radians(10.0)
# m.  An aircraft that is at most this far above its standing height has touched down. (The rows of a log are 1/60 s
# apart.)
CONTACT_HEIGHT_M = 0.02
# m.  If a flight with landing gear ends early, lower above ground than this, the aircraft has hit the ground: wheels or
# belly touch it before the center of gravity does.
MAX_GEAR_HEIGHT_M = 1.0
# m.  Error of a simulated touchdown along the strip: 5 touchdowns of ArduPlane in steady wind were within 15 m of the
# simulated ones, and 38 of 42 in light turbulence within 30 m. At both ends, the strip must be longer than needed by
# this.
TOUCHDOWN_ERROR_M = 30.0
# m.  In turbulence, a landing is undecided if less of the strip is left than this. 42 touchdowns of ArduPlane were 27 m
# shorter to 46 m longer than simulated, with an 11 kg Aerosonde as well as a 2 kg wing.
GUST_TOUCHDOWN_ERROR_M = 50.0
# m.  A final approach is undecided if its simulated height above ground is less than this before the flare may begin.
# Five ArduPlane approaches reached their flares within 2 m of the simulated height.
FINAL_APPROACH_CLEARANCE_M = 3.0
# m/s.  A touchdown with a higher sink rate is undecided. In 15 ArduPlane landings, the sink rate was 0.5 to 4.2 m/s. An
# aircraft that flares too high and drops touches down faster than in any of them.
MAX_TOUCHDOWN_SINK_MPS = 5.0

# Alignment of a track with its route

# m.  A waypoint was not passed if it is further than this from the track.
CAPTURE_RADIUS_M = 500.0
# s.  To find which part of a track belongs to which waypoint, rows are left out so that the remaining rows are at least
# this far apart in time. Afterwards, the row nearest to each waypoint is searched among all rows.
CHORD_TIME_S = 0.25
# m.  A track that ends near a waypoint has passed it if the end is within this of the waypoint, plus the distance at
# which the fly-by path passes the waypoint.
FINAL_WAYPOINT_TOLERANCE_M = 10.0
# s.  If an imported flight continues for at least this long after its last waypoint, it has flown a part of the next
# leg.
PARTIAL_LEG_MIN_S = 2.0
# s.  In a longer pause of an imported log, the aircraft's position is unknown. In this time, an aircraft at a bank of
# 45 degrees can deviate by g t^2 / 16 = 61 m and return, and so stay within the corridor of a usual WP_RADIUS.
MAX_UNSEEN_TIME_S = 10.0
# m.  A flight that stays further than this from every waypoint of a plan is a flight of another plan.
PLAN_MISMATCH_DISTANCE_M = 1000.0
# m.  When the order of waypoints is checked, a waypoint counts as passed if its distance from the track is at most the
# half width of the corridor, or at most this if the half width is less.
MIN_NEAR_WAYPOINT_M = 50.0
# m.  When the order of waypoints is checked, a waypoint counts as passed if its distance from the track is at most the
# half width of the corridor, but at most this.
MAX_NEAR_WAYPOINT_M = 150.0
# Fraction of the passed waypoints.  At least this must be passed in the plan's order. Otherwise the log is a flight of
# another plan.
MIN_IN_ORDER_FRACTION = 0.8
# m.  Largest plausible distance from the origin. A row of the log with a larger distance is invalid.
MAX_PLAUSIBLE_POSITION_M = 1e7
# m/s.  Largest plausible speed. A row of the log with a larger speed is invalid.
MAX_PLAUSIBLE_SPEED_MPS = 1e4
# rad, deflection, m/s.  Largest plausible attitude, control or wind. A row of the log with a larger value is invalid.
MAX_PLAUSIBLE_VALUE = 1e3
# s.  Two stays in a sphere count as one if the pause between them is at most this. Rounding can cause such a pause.
SPHERE_STAY_TOLERANCE_S = 1e-6
# Diagonals of a block of segments.  When the exposure is computed, segments of the track that are further than this
# from a sphere's center are joined to longer segments. This changes the exposure by less than 0.1 %.
SPHERE_FAR_DIAGONALS = 30.0

# PX4's checks: constants of its `FeasibilityChecker` in addition to `flight.autopilots.parts.FeasibilityLimits`

# rad.  A landing approach may be steeper than FW_LND_ANG by this. The number comes from the source of PX4's checker.
PX4_LANDING_BUFFER_RAD = math.radians(0.1)
# m.  Largest allowed distance of the first waypoint from home: the default of PX4's MIS_DIST_1WP.
PX4_FIRST_WAYPOINT_DISTANCE_M = 10_000.0
# m.  Largest allowed distance between waypoints: the default of MIS_DIST_WPS, in the releases that had this parameter.
PX4_WAYPOINT_SPACING_M = 900.0
# m.  A condition gate that is nearer than this to a waypoint counts as at the waypoint.
PX4_GATE_SPACING_M = 0.05

# Suggestions

# rad.  A suggested angle is inside its limit by this much, so that rounding does not move it beyond the limit.
SUGGESTION_ANGLE_MARGIN_RAD = math.radians(0.1)
# m.  A suggested length is inside its limit by this much.
SUGGESTION_LENGTH_MARGIN_M = 1.0
# Fraction.  A suggested speed is inside its limit by this much.
SUGGESTION_SPEED_MARGIN_FRACTION = 0.03
# m/s.  Suggested speeds are multiples of this.
SUGGESTION_SPEED_STEP_MPS = 0.5
# Ratio to the slowest level speed.  Lowest speed that is suggested.
MIN_SUGGESTED_SPEED_RATIO = 1.1
# m.  A rise of less than this is not suggested.
MIN_SUGGESTED_RISE_M = 1.0
# Trials.  Largest number of gentler turns that are tried for a suggestion.
SUGGESTION_TRIAL_COUNT = 6
# Trials.  Largest number of shifts past a zone that are tried for a suggestion. Each trial comes nearer to the needed
# shift by a third or more.
ZONE_SUGGESTION_TRIAL_COUNT = 40
