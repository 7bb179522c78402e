"""Define every tolerance and threshold of the verdict: its unit, its reason, its source.

If no source is named, the value is our own judgement of what matters to a flight.  Limits of scenario and aircraft are
not here: they come with the flight.
"""

import math

from aircraft import envelope

# Precision of a plan's numbers

# rad.  A planned angle: 1e-7 degrees of latitude (1 cm) on a 130 m leg, and rounding.
PLAN_TOLERANCE = math.radians(0.01)
# m.  The 1e-7 degrees of a mission file move a waypoint by up to 1 cm in each direction.
ROUNDING = 0.02
# m.  A leg, a loiter or a return may be this far below the required height above ground: the effect of `ROUNDING` on
# steep ground.
CLEARANCE_TOLERANCE = 0.1
# m.  A waypoint further below home than this needs terrain: ground stations round home's altitude to whole metres.
BELOW_HOME_M = 1.0
# m.  The altitude of a mission's home may be this far above the terrain there: an ellipsoidal height instead of a
# height above mean sea level, together with errors of elevation files, is less than this nearly everywhere people fly.
HOME_ERROR_M = 50.0
# m.  A leg may be this far above the greatest height above ground, or above the ceiling: the same on steep ground.
HEIGHT_TOLERANCE = 0.1
# m.  Radius of a loiter: 1e-7 degrees at its center.
RADIUS_TOLERANCE = 0.02
# Fraction.  The mean radius of a flown loiter may exceed its stated radius by this, in addition to `PASS`.
WIDER_SHARE = 0.25
# Radii of the bank limit's arc.  Distance from its center that an autopilot that steers to it may reach on a loiter too
# tight for its bank: up to 2.09 on 20 flights of ArduPlane's law with loiters of 10 to 100 m, in up to 12 m/s of wind.
# Also the distance from a mission's last waypoint that PX4, which loiters there, may reach, in radii of the wider of
# that loiter and the bank limit: up to 2.06 in 54 ends of missions by its law, with loiters of 80 and 200 m, in up to
# 12 m/s of wind.
SWING = 2.25
# m.  A leg shorter than this is a vertical climb, with no course of its own.
ON_THE_SPOT = 0.5
# rad.  A turn sharper than this has no useful tangent length; the tangent length of a U-turn is infinite.  Between legs
# that are too short, guidance omits the arc of a turn beyond its own smaller limit, SHARPEST_FLY_BY in
# flight/mission/route.py, which the turn rule imports from there.
U_TURN = math.pi - 1e-6
# Radii.  Largest fly-by offset of a turn that is used, which is the offset of a turn of about 176 degrees.
LARGEST_OFFSET = 30.0

# The turn rule

# rad.  Tolerance for the mean bank over a second beyond the limit: roll in gusts is not part of the turn.
BANK_TOLERANCE = math.radians(5.0)
# m.  Tolerance for a turn flown outside its arc.
OVERSHOOT = 5.0
# m.  Mean distance from the next leg in the last second of a settled turn.
SETTLED = 1.0
# m, by turbulence.  Increase of that distance by gusts.
GUST_OFFSET = {"none": 0.0, "light": 0.5, "moderate": 1.0}
# Fraction of the passing distance, and m by turbulence.  A turn may pass its waypoint closer than the arc at the bank
# limit by the sum of both; the second is the cross-track error of an aircraft with good guidance.
CLOSER_SHARE = 0.01
CLOSER = {"none": 0.6, "light": 0.8, "moderate": 1.0}
# Standard deviations.  Largest navigation error that is allowed for.
NAVIGATION_SIGMAS = 3.0
# s.  A turn is measured for at most this long after its arc.
WATCHED = 10.0
# Radii of the planned arc.  A larger flown radius is nearly straight flight, and says nothing about a turn.
STRAIGHT = 10.0

# Fraction of the corridor's half width.  A corner is a negligible kink if the path without it passes it within this: an
# aircraft on that path, or one that swings out as far again beyond it, is still well inside.
KINK_SHARE = 0.25
# Waypoints.  At most this many in a row are treated as one kink, or as one step: a survey's shortest lines are longer.
KINK_WAYPOINTS = 8

# The slope rule

# m.  A leg beyond its limit is a step if everything too steep in a row rises or falls by no more than this: an aircraft
# that begins it early or late is within this of it.  ArduPlane itself flies altitude changes below GLIDE_SLOPE_MIN, 15
# m by default, as a step (ArduPilot's parameter reference).
STEP = 10.0
# rad.  A fitted slope may differ from the plan by this, in addition to the fit's own tolerance.
OFF_SLOPE = math.radians(0.5)
# m.  Height error from the leg's line, clear of the blends at its ends.
OFF_HEIGHT = 10.0
# m.  The same if no part of the leg is clear of the blends.
OFF_HEIGHT_SHORT = 15.0
# rad.  A leg within this of level is level.
LEVEL = math.radians(0.5)
# m/s.  Less wind than this is called calm air in a reason about the wind's effect on a slope.
CALM = 0.5
# m/s.  Error of the mean airspeed while the throttle is at a limit, or of the airspeed on an arc; in turbulence a
# gust's standard deviation more.
OFF_SPEED = 1.0
# Fraction of the wind at 6 m.  Standard deviation of the gust along the track: MIL-F-8785C has 0.1 at altitude and up
# to 0.2 at the ground.
GUST_SHARE = 0.15
# Standard deviations.  A slope is undecided if it is closer than this to the limit of an uncertain aircraft model: 95 %
# one-sided, of a normal distribution.  Plans keep the same distance, so the value is the envelope's.
UNDECIDED = envelope.UNDECIDED
# s.  A climb at full throttle, or a glide without throttle, of this length shows the aircraft's ability: the speed
# settles in 5 s, and the gusts of 15 s average out.
TELLING_FLIGHT = 20.0
# rad.  A shown ability may be less than a leg's slope by this and `SURE` standard errors.
SHOWN_TOLERANCE = math.radians(0.1)
# Standard errors.  Largest error of a measured ability that is allowed for.
SURE = 3.0

# Measured slopes

# s.  A leg with the throttle at a limit, and the mean airspeed off its command, for this long is not flyable: a short
# saturation is normal.
SATURATED = 5.0
# s.  On a held slope, rising air adds airspeed at the rate g w/V; drag removes it after about this time.
SPEED_MEMORY = 12.0
# m/s.  Least airspeed V in g w/V: it bounds the speed gain of an aircraft that has nearly stopped.
SLOWEST_LIFTED = 10.0
# Fraction of a window during which the throttle must be at a limit for the window to be saturated.
THROUGHOUT = 0.8
# Throttle 0..1.  The throttle is at its upper limit from this on.
FULL = 0.99
# Throttle 0..1.  The throttle is at its lower limit up to this.
IDLE = 0.01
# A.  The motor is off up to this battery current.
NO_CURRENT = 0.02
# Throttle 0..1.  An aircraft's ability shows only at its full throttle: 1 % of the Aerosonde's throttle is 0.6 degrees
# of climb.
FULL_THROTTLE = 0.999
# s.  Least time over which an ability is measured.
SHOWN_OVER = 1.5
# s.  Time after the throttle reaches its limit from which an ability is measured.
SETTLED_AFTER = 0.5
# s.  Time after which measured values are independent.
INDEPENDENT = 0.5
# m/s of climb.  Resolution of speed and acceleration.
KNOWN_TO = 0.02
# Condition number above which the moments of a plane do not determine it.
SINGULAR = 1e7
# rad.  A measured ability with a larger standard error is not used.
UNSURE = math.radians(0.3)
# m/s^2.  Acceleration with which the aircraft is assumed to take up another commanded speed.
ACCELERATION = 0.5

# Courses and slopes by least squares

# m.  Length at either end of a leg that is left out of a fit, beyond the turns' tangents.
CLEAR_OF_TURN = 100.0
# m.  Length that is left out of a fit, beyond the blend of slopes, and at a route's first waypoint.
CLEAR_OF_BLEND = 20.0
# m.  Shortest piece of a leg to which a course is fitted.
SHORTEST_COURSE = 60.0
# m.  Shortest piece of a leg to which a slope is fitted.
SHORTEST_SLOPE = 100.0
# s.  Shortest time over which a slope is measured: shorter ones over-read by degrees.
SHORTEST_TIME = 4.0
# rad.  Resolution of a fitted course in calm air.
COURSE_FLOOR = math.radians(0.02)
# rad.  Resolution of a fitted slope in calm air.
SLOPE_FLOOR = math.radians(0.1)
# rad.  Largest tolerance of a fit, including unsteady flight.
MAX_UNSTEADY = math.radians(0.5)
# rad.  Tolerance of a course that was not fitted.
ROUGH_COURSE = math.radians(0.75)
# rad.  Tolerance of a slope that was not fitted.
ROUGH_SLOPE = math.radians(0.5)

# The rules on waypoints, speed, departure and completion

# m.  Distance within which a waypoint is reached if neither mission nor autopilot states one: this in addition to the
# fly-by path's distance.  A corridor is wider than a turn needs by the same.
PASS = 10.0
# Ratio.  An autopilot that turns by its own control law, at the waypoint or before it, swings beyond the next leg by up
# to this many times R (1 - cos turn): up to 1.05 in 168 turns of 95 to 180 degrees by ArduPlane's simulated control
# laws and up to 1.24 in 80 by PX4's, in wind of up to 12 m/s and light turbulence.
FLY_OVER_SWING_RATIO = 1.25
# m.  Approaches to a waypoint within this of the closest are equally close, for example on a path that crosses itself
# above or below: of them the one nearest in altitude applies.
EQUALLY_CLOSE = 0.5
# m/s.  Error of a leg's mean airspeed.
OFF_MEAN = 1.0
# Fraction of the commanded airspeed.  An airspeed that has settled further from its command than this, and by at least
# `OFF_MEAN`, is not held.  Five aircraft with three control laws flew legs within 10 % of it in still air, including
# legs on which they took up 10 m/s more; 10 % less airspeed is a fifth less lift.
HELD_SPEED_SHARE = 0.1
# m/s.  PX4 flies faster on purpose if the commanded airspeed leaves less ground speed than this (FW_GND_SPD_MIN).
LEAST_GROUND_SPEED = 5.0
# Fraction of a leg's duration at `SLOWEST`.  Steady flight for this long is enough for the mean airspeed of a leg too
# short for `SATURATED`.
MEASURED_SHARE = 0.5
# m.  Taking up another slope may put the aircraft this far ahead or behind, which matters on a short leg.
TAKE_UP = 10.0
# s.  Duration of a gust.
GUST_TIME = 10.0
# Standard deviations.  Largest effect of gusts on a leg's mean airspeed that is allowed for.
GUST_SIGMAS = 2.0
# rad.  Bank beyond this is a loss of control.  The simulation's own threshold (flight/simulation/tick.py).
MAX_BANK = math.radians(75.0)
# m/s.  Airspeed below this is a loss of control of the Aerosonde.
SLOWEST = 15.0
# Fraction of the slowest level speed.  Airspeed below this is a loss of control of every other aircraft; for the
# Aerosonde both are the same.
SLOWEST_SHARE = 0.94
# s.  A log with a pause this long between rows has lost rows.
LONGEST_GAP = 0.5
# Median steps between rows.  In a sparse log, where `LONGEST_GAP` is an ordinary step, this many steps
# are a pause.
GAP_STEPS = 5.0
# m/s.  Largest disagreement between position and velocity in one tick; beyond it the record contradicts itself.
CONTRADICTION = 10.0
# s.  Airspeed, bank and load factor are averaged over this time for comparison with the stall.
STALL_MEAN = 1.0
# m/s.  A flown airspeed may be this far below the stall in a bank, and a gust's standard deviation more: guidance lets
# the speed swing by as much when it rolls into a turn in calm air.
STALL_TOLERANCE = 0.2
# Fraction of the battery or the tank that must be left at the end: the reserve.
RESERVE = 0.2

# Surveys

# Fraction of a photo line that must be flown as photos require: on the line, level, at the planned height above ground,
# and with the camera on.  A line that loses one metre in twenty still overlaps as usual surveys do.
PHOTO_SHARE = 0.95
# Fraction of the line spacing.  A photo may be taken this far to the side of its line: two neighbouring lines that are
# both off by it are half again as far apart, which leaves 40 % of 60 % overlap.
PHOTO_ASIDE = 0.25
# rad.  Largest bank in a photo: at 60 m above ground its center is then 10 m to the side.
PHOTO_BANK = math.radians(10.0)
# Fraction of the planned height above ground.  A photo may be this far above or below it: the area that a photo shows,
# and its overlap, depend on the height.
PHOTO_HEIGHT = 0.1
# m.  Least value of that tolerance.
MIN_PHOTO_HEIGHT = 5.0
# rad.  An aircraft flies along a line if its course is within this of the line's course.
PHOTO_COURSE = math.radians(30.0)
# m.  Step in which a photo line is checked.
PHOTO_STEP = 1.0
# Fraction of a photo.  Photos may overlap by this much less than required: of 60 % side overlap, a line that is a
# quarter of the spacing off (`PHOTO_ASIDE`), next to one that is flown as drawn, leaves 50 %.
PHOTO_OVERLAP = 0.1
# Radii of the bank limit's arc.  A turn-around too tight to be flown as drawn may lead this far beyond its waypoints: a
# turn back onto the next line takes 1 + sqrt(3) radii, and rolling takes the rest.
TURN_AROUND_RADII = 3.25

# Departures from the ground and approaches to it

# m.  Ignore terrain within this distance of home under a climb-out: rail or runway are there, and the usual elevation
# files do not resolve such a short distance, which is less than two of their pixels.
LAUNCH_RUN = 50.0
# m.  Least height above the ground at home to which an aircraft climbs before it descends to its first waypoint: below
# that ArduPlane flies no slope (`Plane::setup_glide_slope`).
FIRST_CLIMB = 20.0
# Fraction of the steepest climb at the commanded airspeed.  A take-off climbs at least this steeply: ArduPlane's
# take-offs of an Aerosonde reached 0.76 of it and more.
MIN_CLIMB = 0.7
# m.  Ground contact up to this far short of the landing point is a touchdown: on ground that rises by 5 to 8 %
# ArduPlane touched down 28 to 47 m early.
EARLY_TOUCH = 60.0
# m.  A glide may be flown this much lower than laid out: 15 glides of ArduPlane, some of them in light turbulence, were
# at most 3.9 m below the straight line to the landing point.
GLIDE_ERROR = 5.0
# m.  The glide tolerance applies down to this height above the landing point; below it the flare may start.
ABOVE_FLARE = 15.0
# m.  Home's altitude and an elevation file may differ by this at a landing point.  Further above the ground the
# aircraft flares too early, and falls; further below it, it flies into the ground.
POINT_ERROR = 10.0
# m.  Least height above ground on a go-around: it turns on that path, and turns are not laid out.
GO_AROUND_ROOM = 20.0
# m.  Within this distance of a place of the landing sequence that is lower itself, a go-around may be as low: slopes
# down to a place that is 10 m lower need this length.
NEAR_LINE_UP = 500.0
# m.  A go-around that passes the ground beyond the landing point by less in its climb is undecided: the point mass
# agreed within this in height with the one recorded go-around of ArduPlane, and that one did not have to climb.
GO_AROUND_ERROR = 6.0

# Flown take-offs and landings

# m.  Least height above ground of a climb-out beyond `LAUNCH_RUN`: less than the usual elevation files' own error, and
# more than a small aircraft's banked wing reaches down.
LAUNCH_ROOM = 2.0
# m.  A climb-out that exceeds that by less than this is undecided: the simulated law's height was within 2.3 m of
# ArduPlane's in the first 14 s of five flights.
CLIMB_ERROR = 2.5
# m.  Largest height loss of a launched aircraft: ArduPlane's catapult launches at 14 m/s and more lost none; in a hand
# launch at 1.8 m a larger loss leaves no room for a wing.
LAUNCH_SINK = 1.0
# m.  Least runway length left where the aircraft leaves the ground: the simulated law left it after 34 m where
# ArduPlane did after 37 m, in the one such flight that is known.
RUNWAY_ROOM = 10.0
# m.  The legs after a take-off and the legs of a landing sequence are near the ground by nature: they need no more
# height above ground than a go-around, `GO_AROUND_ROOM`, even if the scenario requires more.
GROUND_LEG_ROOM = GO_AROUND_ROOM
# m.  Largest distance from home, or from the landing point, at which that applies: the longest final that a plan lays
# out.  Beyond it, the scenario's requirement applies to these legs, too.
NEAR_FIELD = 2000.0
# rad.  A leg after a take-off has to stay in its corridor once the aircraft's course is within this of its own.
ON_COURSE = math.radians(10.0)
# m.  Within this of its contact height above ground the aircraft has touched down: rows are 1/60 s apart.
TOUCHED = 0.02
# m.  Error of a simulated touch-down along the strip: 5 touch-downs of ArduPlane in steady wind were within 15 m of it,
# and 38 of 42 in light turbulence within 30 m.  The strip must be this much longer at either end.
TOUCH_ERROR = 30.0
# m.  In turbulence a landing that leaves less of the strip than this is undecided: the 42 touch-downs of ArduPlane were
# 27 m shorter to 46 m longer than the law's, with an 11 kg Aerosonde as well as a 2 kg wing.
GUST_TOUCH_ERROR = 50.0
# m.  A final that the simulated law flies lower above ground than this, before its flare may begin, is undecided: five
# ArduPlane finals reached their flares within 2 m of the law's height.
FINAL_ROOM = 3.0
# m/s.  A faster sink towards the ground leaves a touch-down undecided: 15 ArduPlane landings touched down at 0.5 to
# 4.2 m/s, and an aircraft that a flare drops from a height touches down faster than any of them.
TOUCH_SINK = 5.0

# Alignment of a track with its route

# m.  A waypoint further than this from the track attracts no rows.
CAPTURE_RADIUS = 500.0
# s.  To assign stretches of a track to waypoints, rows are thinned to at least this interval; the row nearest to each
# waypoint is then searched among all rows.
CHORD_TIME = 0.25
# m.  A waypoint where the track ends is passed within this of its apex, in addition to the fly-by's own distance.
ARRIVED = 10.0
# s.  An imported flight that continues this long after its last waypoint has flown a part of the next leg.
PARTLY_FLOWN = 2.0
# s.  In a longer pause of an imported log the aircraft's position is unknown: at a bank of 45 degrees it deviates by
# g t^2 / 16 = 61 m and returns in that time, which is within the corridor of a usual WP_RADIUS.
LONGEST_UNSEEN = 10.0
# m.  A flight that stays further than this from every waypoint of a plan was flown somewhere else.
ANOTHER_PLACE = 1000.0
# m.  A waypoint is passed within the corridor's half width when the order of waypoints is checked, but at least this.
MIN_NEAR = 50.0
# m.  And at most this.
MAX_NEAR = 150.0
# Fraction.  If the plan is the one that was flown, this fraction of the passed waypoints was passed in the plan's
# order.
IN_ORDER = 0.8
# m.  Largest plausible position; anything larger is garbage.
FARTHEST = 1e7
# m/s.  Largest plausible speed.
FASTEST = 1e4
# rad, deflection, m/s.  Largest plausible attitude, control or wind.
MAX_PLAUSIBLE = 1e3
# s.  Stays in a sphere on neighbouring segments that touch within this are one.  Rounding.
TOUCH = 1e-6
# Diagonals of a block of segments.  At this distance from a sphere's center the segments are joined to longer ones,
# which changes the exposure by less than 0.1 %.
FAR = 30.0

# PX4's checks: constants of its `FeasibilityChecker` in addition to `flight.autopilots.autopilot.MissionChecks`

# m.  A takeoff's height must exceed the acceptance radius by this; a literal in the checker.
PX4_TAKEOFF_BUFFER = 1.0
# rad.  A landing approach may be steeper than FW_LND_ANG by this; a literal in the checker.
PX4_LANDING_BUFFER = math.radians(0.1)
# m.  MIS_DIST_1WP.
PX4_FIRST_WAYPOINT = 10_000.0
# m.  MIS_DIST_WPS of the releases that had it.
PX4_BETWEEN_WAYPOINTS = 900.0
# m.  A condition gate nearer than this to a waypoint is at the same position.
PX4_GATE_APART = 0.05
# Highest actuator number of DO_SET_SERVO.
PX4_MAX_SERVO = 5
# Highest value of DO_SET_SERVO.
PX4_MAX_PWM = 2000.0

# Suggestions

# rad.  A suggested angle passes by this much, so that rounding does not undo it.
BUFFER_ANGLE = math.radians(0.1)
# m.  A suggested length passes by this much.
BUFFER_LENGTH = 1.0
# Fraction.  A suggested speed passes by this much.
BUFFER_SPEED = 0.03
# m/s.  Step of a suggested speed.
SPEED_STEP = 0.5
# Ratio of the least suggested speed to the slowest level speed.
ABOVE_SLOWEST = 1.1
# m.  Least rise that is worth suggesting.
MIN_RISE = 1.0
# Number of times a gentler turn is tried.
TRIES = 6
# Number of times a larger shift past a zone is tried; each comes nearer by a third or more.
ZONE_TRIES = 40
