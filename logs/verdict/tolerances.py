"""Every tolerance and threshold of the verdict: its unit, its reason, its source.

Where no source is named the figure is chosen: our own judgement of what matters to a flight.  Limits of scenario and
aircraft are not here: they come with the flight.
"""

import math

from aircraft import envelope

# What a plan's numbers are known to

# rad.  A planned angle: 1e-7 degrees of latitude (1 cm) on a 130 m leg, and rounding.
PLAN_TOLERANCE = math.radians(0.01)
# m.  A mission file's 1e-7 degrees move a waypoint by up to 1 cm in each direction.
ROUNDING = 0.02
# m.  How far below the required height above ground a leg, a circle or a return may come: what `ROUNDING` of a waypoint
# comes to on steep ground.
CLEARANCE_TOLERANCE = 0.1
# m.  A waypoint further below home than this needs terrain: ground stations round home's altitude to whole metres.
BELOW_HOME_M = 1.0
# m.  The altitude of a mission's home may be above the terrain there by this: an ellipsoid's height instead of one
# above mean sea level, and what elevation files are off, come to less nearly everywhere that is flown at.
HOME_ERROR_M = 50.0
# m.  How far above the largest height above ground, or above the ceiling, a leg may rise: the same on steep ground.
HEIGHT_TOLERANCE = 0.1
# m.  A loiter's radius: 1e-7 degrees at the circle's middle.
RADIUS_TOLERANCE = 0.02
# Share.  How much wider than stated a circle may be flown on the mean around it, beside `PASS`.
WIDER_SHARE = 0.25
# How far from its middle an autopilot that flies at that may get on a circle too tight for its bank, in radii of the
# bank limit's arc: up to 2.09 on 20 flights of ArduPlane's law with circles of 10 to 100 m, in up to 12 m/s of wind.
# Also how far from a mission's last waypoint PX4 may get, which circles there, in radii of the wider of that circle and
# the bank limit's: up to 2.06 in 54 ends of missions by its law, with circles of 80 and 200 m, in up to 12 m/s of wind.
SWING = 2.25
# m.  A leg shorter than this is a climb on the spot, with no course of its own.
ON_THE_SPOT = 0.5
# rad.  A turn sharper than this has no useful tangent length; a U-turn's is infinite.  Between
# legs that are too short guidance leaves out the arc of a turn beyond a smaller limit of its own, SHARPEST_FLY_BY in
# flight/mission/route.py, which the turn rule takes from there.
U_TURN = math.pi - 1e-6
# Radii.  Largest fly-by offset that is taken of a turn, which is one of about 176 degrees.
LARGEST_OFFSET = 30.0

# The turn rule

# rad.  Bank beyond the limit, as a mean over a second: the roll of a gust is not the turn's.
BANK_TOLERANCE = math.radians(5.0)
# m.  How far outside its arc a turn may be flown.
OVERSHOOT = 5.0
# m.  Mean distance from the next leg in its last second.
SETTLED = 1.0
# m, by turbulence.  What gusts may add to that distance.
GUST_OFFSET = {"none": 0.0, "light": 0.5, "moderate": 1.0}
# Share, and m by turbulence.  How much closer than the arc at the bank limit a turn may pass its waypoint, which is as
# far as an aircraft with good guidance may be from its path.
CLOSER_SHARE = 0.01
CLOSER = {"none": 0.6, "light": 0.8, "moderate": 1.0}
# Standard deviations.  How far navigation may be off.
NAVIGATION_SIGMAS = 3.0
# s.  How long after its arc a turn is watched at most.
WATCHED = 10.0
# Radii of the planned arc.  A flown radius from this on is a nearly straight flight's, and says nothing of a turn.
STRAIGHT = 10.0

# Share of the corridor's half width.  A corner is a negligible kink where the way without it passes it within this: an
# aircraft that takes that way, or swings out as far again beyond it, is still well inside.
KINK_SHARE = 0.25
# Waypoints.  No more in a row are looked at as one kink, or as one step: a survey's shortest lines are longer.
KINK_WAYPOINTS = 8

# The slope rule

# m.  A leg beyond its limit is a step where all that is too steep in a row rises or falls by no more: an aircraft that
# begins it early or late is within this of it.  ArduPlane itself flies changes of height below GLIDE_SLOPE_MIN, 15 m
# by default, as a step (ArduPilot's parameter reference).
STEP = 10.0
# rad.  A fitted slope may differ from the plan's by this, beside the fit's own tolerance.
OFF_SLOPE = math.radians(0.5)
# m.  Height from the leg's line, away from the blends at its ends; more where no part of the leg is.
OFF_HEIGHT, OFF_HEIGHT_SHORT = 10.0, 15.0
# rad.  A leg within this of level is level.
LEVEL = math.radians(0.5)
# m/s.  Less wind than this is called calm air where a reason says what the wind does to a slope.
CALM = 0.5
# m/s.  Mean airspeed while the throttle is at a limit, or lost on an arc; a gust's standard deviation more in
# turbulence.
OFF_SPEED = 1.0
# Share of the wind at 6 m.  Standard deviation of the gust along the track: MIL-F-8785C has 0.1 high up to 0.2 at the
# ground.
GUST_SHARE = 0.15
# Standard deviations.  A slope is undecided where the limit of an aircraft that is not known for certain lies nearer:
# 95 % one-sided, of a normal distribution.  Plans keep as far away, so that it is the envelope's.
UNDECIDED = envelope.UNDECIDED
# s.  So long a climb at full throttle, or a glide without, tells what an aircraft can: the speed settles in 5 s, and
# the gusts of 15 s average out.
TELLING_FLIGHT = 20.0
# rad.  The ability that an aircraft showed may fall short of what a leg asks by this and `SURE` standard errors.
SHOWN_TOLERANCE = math.radians(0.1)
# Standard errors.  How far a measured ability may be out.
SURE = 3.0

# Slopes as measured

# s.  Throttle at a limit for this long in one leg, with the mean airspeed of as long off, is not flyable: a moment's
# saturation is normal.
SATURATED = 5.0
# s.  Rising air takes speed up with it on a held slope, by g w/V, until drag has eaten it up: about this long.
SPEED_MEMORY = 12.0
# m/s.  Least airspeed V in g w/V: an aircraft that has nearly stopped gains no speed without bound.
SLOWEST_LIFTED = 10.0
# Share of a window that counts as "at the limit throughout".
THROUGHOUT = 0.8
# Throttle 0..1, and battery current in A, that count as at a limit.
FULL, IDLE, NO_CURRENT = 0.99, 0.01, 0.02
# Throttle 0..1.  An aircraft's ability is seen at its whole throttle alone: 1 % of the Aerosonde's is 0.6 degrees of
# climb.
FULL_THROTTLE = 0.999
# s.  Least time over which an ability is measured; how long after the throttle came to its limit; after how long
# numbers are independent.
SHOWN_OVER, SETTLED_AFTER, INDEPENDENT = 1.5, 0.5, 0.5
# m/s of climb.  What speed and acceleration are known to.
KNOWN_TO = 0.02
# Condition number beyond which the moments of a plane do not determine it.
SINGULAR = 1e7
# rad.  A measured ability with a larger standard error says nothing.
UNSURE = math.radians(0.3)
# m/s^2.  What the aircraft is given to take up another commanded speed.
ACCELERATION = 0.5

# Courses and slopes by least squares

# m.  Ends of a leg that are left out of a fit, beyond the turns' tangents.
CLEAR_OF_TURN = 100.0
# m.  Ends of a leg that are left out of a fit, beyond the blend of slopes, and at a route's first waypoint.
CLEAR_OF_BLEND = 20.0
# m.  Shortest piece of a leg that a course, a slope is fitted to.
SHORTEST_COURSE, SHORTEST_SLOPE = 60.0, 100.0
# s.  Shortest time that a slope is measured over: shorter ones over-read by degrees.
SHORTEST_TIME = 4.0
# rad.  What a fit in calm air cannot resolve, of a course and a slope, and the most that unsteadiness adds.
COURSE_FLOOR, SLOPE_FLOOR, MAX_UNSTEADY = math.radians(0.02), math.radians(0.1), math.radians(0.5)
# rad.  Uncertainty of a course, a slope that was not fitted.
ROUGH_COURSE, ROUGH_SLOPE = math.radians(0.75), math.radians(0.5)

# The rules about waypoints, speed, departure and completion

# m.  Where neither mission nor autopilot says what counts as reached: this beside where the fly-by path passes; and the
# corridor is as much wider than a turn that needs more than it.
PASS = 10.0
# Ratio.  An autopilot that turns by a law of its own, at the waypoint or before it, swings up to this many times as far
# beyond the next leg as R (1 - cos turn): up to 1.05 in 168 turns of 95 to 180 degrees by ArduPlane's simulated control
# laws and up to 1.24 in 80 by PX4's, in wind of up to 12 m/s and light turbulence.
FLY_OVER_SWING_RATIO = 1.25
# m.  Approaches to a waypoint within this of the closest are equally close, as on a path that crosses itself above or
# below: of them the one nearest in height counts.
EQUALLY_CLOSE = 0.5
# m/s.  Mean airspeed of a leg off its command.
OFF_MEAN = 1.0
# Share of the commanded airspeed.  An airspeed that has settled further from its command than this, and no less than
# `OFF_MEAN`, is not held.  Five aircraft by three laws flew legs within 10 % of it in still air, those
# included on which they took up 10 m/s more; 10 % less airspeed is a fifth less lift.
HELD_SPEED_SHARE = 0.1
# m/s.  Where the commanded airspeed leaves less ground speed than this, PX4 flies faster on purpose (FW_GND_SPD_MIN).
LEAST_GROUND_SPEED = 5.0
# Share of the time that a leg takes at `SLOWEST`.  Steady flight for so long is enough for its mean airspeed, where the
# leg is too short for `SATURATED`.
MEASURED_SHARE = 0.5
# m.  Taking up another slope may put the aircraft this far ahead or behind: a short leg is mostly that.
TAKE_UP = 10.0
# s.  How long a gust lasts.
GUST_TIME = 10.0
# Standard deviations.  How far the gusts of a leg may carry its mean airspeed.
GUST_SIGMAS = 2.0
# rad.  Bank beyond this is a departure.  The simulation's own threshold (flight/simulation/tick.py).
MAX_BANK = math.radians(75.0)
# m/s.  Airspeed below this is a departure of the Aerosonde, and this share of its slowest level speed, which for the
# Aerosonde is the same, of every other aircraft.
SLOWEST, SLOWEST_SHARE = 15.0, 0.94
# s.  A log with a pause this long between rows has lost some.
LONGEST_GAP = 0.5
# Median steps between rows.  In a log of few rows a second, where `LONGEST_GAP` is an ordinary step, this many are a
# pause.
GAP_STEPS = 5.0
# m/s.  By how much position and velocity of one tick may disagree before the record contradicts itself.
CONTRADICTION = 10.0
# s.  Airspeed, bank and load factor are means over this long where they are held against the stall.
STALL_MEAN = 1.0
# m/s.  By how much a flown airspeed may be below the stall in a bank, and a gust's standard deviation more: guidance
# lets the speed swing by as much when it rolls into a turn in calm air.
STALL_TOLERANCE = 0.2
# Share of the battery or the tank that is to be left at the end: the reserve.
RESERVE = 0.2

# Surveys

# Share of a photo line that is to be flown as a photo needs it: on the line, level, at the planned height over ground,
# and with the camera on.  A line in twenty metres of which one is lost still overlaps as usual surveys do.
PHOTO_SHARE = 0.95
# Share of the spacing of lines.  So far beside its line a photo may be taken: two neighbours that are both off by it
# are half again as far apart, which of 60 % of overlap leaves 40 %.
PHOTO_ASIDE = 0.25
# rad.  So far a photo may be banked: at 60 m above ground its middle is then 10 m aside.
PHOTO_BANK = math.radians(10.0)
# Share of the planned height over ground, and m.  So far a photo may be above or below it: what a photo shows, and
# how much it overlaps, goes with the height.
PHOTO_HEIGHT, MIN_PHOTO_HEIGHT = 0.1, 5.0
# rad.  Whoever flies along a line flies on a course within this of the line's.
PHOTO_COURSE = math.radians(30.0)
# m.  Steps that a photo line is looked at in.
PHOTO_STEP = 1.0
# Share of a photo.  By so much less than asked for may photos overlap: of 60 % beside, a line that is a quarter of the
# spacing aside (`PHOTO_ASIDE`), next to one that is flown as drawn, leaves 50 %.
PHOTO_OVERLAP = 0.1
# Radii of the bank limit's arc.  So far beyond its waypoints a turn-around may lead that is too tight to be flown as
# drawn: a turn back onto a line beside the one before takes 1 + sqrt(3) radii, and rolling takes the rest.
TURN_AROUND_RADII = 3.25

# The ways from the ground and to it

# m.  So far from home no ground stands in the way of a climb-out: rail or runway are there, and it is less than what
# two pixels of the usual elevation files tell apart.
LAUNCH_RUN = 50.0
# m.  So high over the ground at home an aircraft climbs at the least before it sinks to its first waypoint: below that
# ArduPlane flies no slope (`Plane::setup_glide_slope`).
FIRST_CLIMB = 20.0
# Share of the steepest climb at the commanded airspeed.  A take-off climbs no less: ArduPlane's of an Aerosonde came to
# 0.76 of it and more.
MIN_CLIMB = 0.7
# m.  An aircraft that meets the ground so near before its landing point has landed: on ground that rises by 5 to 8 %
# ArduPlane touched down 28 to 47 m early.
EARLY_TOUCH = 60.0
# m.  A glide may be flown so much lower than it is laid out: 15 of ArduPlane's, some of them in light turbulence, were
# no more than 3.9 m below the straight line to the landing point.
GLIDE_ERROR = 5.0
# m.  So far above the landing point that counts; below, the flare may begin.
ABOVE_FLARE = 15.0
# m.  By so much home's height and an elevation file may differ at a landing point.  Further above the ground the
# aircraft flares too early, and falls; further below it, it flies into the ground.
POINT_ERROR = 10.0
# m.  Least height above ground of a go-around's way: it turns on it, and turns are not laid out.
GO_AROUND_ROOM = 20.0
# m.  So near to a place of the landing sequence that is lower itself a go-around may be as low: slopes down to one that
# is 10 m lower take as much.
NEAR_LINE_UP = 500.0
# m.  A climb of a go-around that passes the ground beyond the landing point by less is left open: the point mass met
# the one of ArduPlane's that was kept within so much of height, and that one did not have to climb.
GO_AROUND_ERROR = 6.0

# The take-off and the landing that are flown

# m.  Least height above ground of a climb-out beyond `LAUNCH_RUN`: less than the usual elevation files' own error, and
# more than the wing of a small aircraft banks down to.
LAUNCH_ROOM = 2.0
# m.  A climb-out that comes no further above that is left open: the law's height was within 2.3 m of ArduPlane's in the
# first 14 s of five flights.
CLIMB_ERROR = 2.5
# m.  So much height a launched aircraft may lose: those that ArduPlane flew from a catapult at 14 m/s and more lost
# none; from a hand at 1.8 m more than this leaves no room for a wing.
LAUNCH_SINK = 1.0
# m.  So much of a runway is to be left where the aircraft leaves the ground: the law left it after 34 m where ArduPlane
# did after 37 m, and one such flight is known.
RUNWAY_ROOM = 10.0
# m.  The legs that follow a take-off and those of a landing sequence are near the ground by nature: they need no more
# height above it than a go-around, `GO_AROUND_ROOM`, where the scenario asks for more.
GROUND_LEG_ROOM = GO_AROUND_ROOM
# m.  So far from home, or from the landing point, at most: as long as the longest final that a plan lays out.  Beyond,
# what the scenario asks for holds on them, too.
NEAR_FIELD = 2000.0
# rad.  A leg that follows a take-off is held to its corridor once the aircraft has come to its course within this.
ON_COURSE = math.radians(10.0)
# m.  So near to a contact's height over the ground the aircraft has touched it: rows stand 1/60 s apart.
TOUCHED = 0.02
# m.  A touch-down by the law is out by so much along the strip: 5 of ArduPlane's in steady wind were within 15 m of it,
# and 38 of 42 in light turbulence within 30 m.  The strip has to be as much longer either way.
TOUCH_ERROR = 30.0
# m.  In turbulence a landing that leaves less of the strip than this is left open: of these 42 ArduPlane's were 27 m
# shorter to 46 m longer than the law's, an 11 kg Aerosonde's as well as a 2 kg wing's.
GUST_TOUCH_ERROR = 50.0
# m.  A final that the law flies lower over the ground than this, before its flare may begin, is left open: five of
# ArduPlane's came to their flares within 2 m of the law's height.
FINAL_ROOM = 3.0
# m/s.  A faster sink towards the ground leaves a touch-down open: 15 landings of ArduPlane came down at 0.5 to 4.2 m/s,
# and an aircraft that a flare drops from a height comes down faster than any of them.
TOUCH_SINK = 5.0

# The track beside its route

# m.  A waypoint further than this from the track draws no row to itself.
CAPTURE_RADIUS = 500.0
# s.  To assign stretches of a track to waypoints its rows are thinned to no less than this between them; the row
# nearest to each waypoint is then looked for among all.
CHORD_TIME = 0.25
# m.  A waypoint that the track ends at is passed within this of its apex, beside the fly-by's own distance.
ARRIVED = 10.0
# s.  An imported flight that goes on for as long after its last waypoint has flown a part of the next leg.
PARTLY_FLOWN = 2.0
# s.  Where an imported log pauses for longer, nobody knows where the aircraft was: at a bank of 45 degrees it comes
# g t^2 / 16 = 61 m aside and back in that time, which is within the corridor of a usual WP_RADIUS.
LONGEST_UNSEEN = 10.0
# m.  A flight that comes no nearer than this to any waypoint of a plan was flown somewhere else.
ANOTHER_PLACE = 1000.0
# m.  How near to a waypoint counts as having passed it, where the order of waypoints is asked: the corridor's half
# width, within these.
MIN_NEAR, MAX_NEAR = 50.0, 150.0
# Share.  Of the waypoints that were passed at all this many were passed in the plan's order, if the plan is the one
# that was flown.
IN_ORDER = 0.8
# m, m/s.  No position or speed of ours is larger; what is, is garbage.
FARTHEST, FASTEST = 1e7, 1e4
# rad, deflection, m/s.  Nor is an attitude, a control or a wind larger.
MAX_PLAUSIBLE = 1e3
# s.  Stays in a sphere on neighbouring segments that touch to within this are one.  Rounding.
TOUCH = 1e-6
# Diagonals of a block of segments.  From this far from a sphere's centre the segments are joined to longer ones, which
# changes the exposure by less than 0.1 %.
FAR = 30.0

# PX4's checks: what its `FeasibilityChecker` goes by beside `flight.autopilots.autopilot.MissionChecks`

# m.  A takeoff's height is to be this much more than the acceptance radius; the checker has it as a literal.
PX4_TAKEOFF_BUFFER = 1.0
# rad.  A landing approach may be steeper than FW_LND_ANG by this; the checker has it as a literal.
PX4_LANDING_BUFFER = math.radians(0.1)
# m.  MIS_DIST_1WP.
PX4_FIRST_WAYPOINT = 10_000.0
# m.  MIS_DIST_WPS of the releases that had it.
PX4_BETWEEN_WAYPOINTS = 900.0
# m.  A condition gate nearer than this to a waypoint is at the same position.
PX4_GATE_APART = 0.05
# Highest actuator number and value of DO_SET_SERVO.
PX4_MAX_SERVO, PX4_MAX_PWM = 5, 2000.0

# Suggestions

# rad, m, share.  A change is asked for with this much beyond what passes, so that rounding does not undo it.
BUFFER_ANGLE, BUFFER_LENGTH, BUFFER_SPEED = math.radians(0.1), 1.0, 0.03
# m/s.  Steps of a suggested speed.
SPEED_STEP = 0.5
# Share by which a suggested speed stays above the slowest level one.
ABOVE_SLOWEST = 1.1
# m.  Least rise that is worth suggesting.
MIN_RISE = 1.0
# How often a gentler turn is tried, and a larger shift past a zone, which comes nearer by a third or more each time.
TRIES, ZONE_TRIES = 6, 40
