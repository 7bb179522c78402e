"""What PX4's feasibility checker refuses, found by the names of its checks, and which of it no autopilot flies."""

from dataclasses import replace

import pytest

from flight.autopilots.arduplane.autopilot import ArduPlane
from flight.autopilots.arduplane.parameters import ArduPilotParameters
from flight.autopilots.px4.autopilot import Px4
from flight.autopilots.px4.parameters import Px4Parameters
from flight.mission.items import MissionItem
from logs.recording.setup_schema import RouteTable
from logs.verdict.findings import Finding
from logs.verdict.judge_flight import judge_geometry
from logs.verdict.places import Place
from logs.verdict.rules.mission_rule import mission_findings
from tests.flight.autopilots.arduplane.kept_missions import setup_by_law
from tests.mission_lines import ORIGIN, mission, setup_of, wp
from world.frames import to_geo
from world.scenario_tables import Px4Version
from world.wind import Wind

GOOD = (wp(0, 500, command=22), wp(0, 1500), wp(1500, 1500))
HOME_FAR = "36.5 -84.0 300"


def of(check: str, *lines: str, home: str = "36.5 -84.2 300") -> Finding:
    """The finding of one check."""
    verdict = judge_geometry(setup_of(*lines, home=home))
    found = [item for item in verdict.findings if item.rule == "mission" and item.check == check]
    assert len(found) == 1, verdict.findings
    assert found[0].reason.endswith(f"(see PX4's function {check})"), found[0].reason
    assert not (verdict.flyable and found[0].ok is False)
    return found[0]


NOBODY = ("unsupported", "spline")  # of these: what ArduPlane does not take either
REFUSED = {
    "gate": (
        "checkDistancesBetweenWaypoints",
        (*GOOD[:2], wp(0, 1500, command=4501), GOOD[2]),
        3,
        "the gate and the neighbouring waypoint are too close together",
    ),
    "unsupported": (
        "checkMissionItemValidity",
        (*GOOD, "2 5000 0 0 0 0 0 0 0"),
        4,
        "no autopilot supports NAV_FENCE_RETURN_POINT",
    ),
    "spline": ("checkMissionItemValidity", (*GOOD, wp(1500, 0, command=82)), 4, "NAV_SPLINE_WAYPOINT"),
    "servo": (
        "checkMissionItemValidity",
        (*GOOD, "2 183 5 1500 0 0 0 0 0"),
        4,
        "PX4 does not support DO_SET_SERVO; ArduPlane accepts it",
    ),
    "takeoff-low": (
        "checkTakeoff",
        (wp(0, 500, 0, command=22), *GOOD[1:]),
        1,
        "the takeoff altitude is 0.0 m above home, but must be above 0 m",
    ),
    "takeoff-late": ("checkTakeoff", (GOOD[1], GOOD[0], GOOD[2]), 2, "the takeoff is not the first"),
    "two-land-starts": (
        "checkFixedWingLanding",
        (*GOOD, "2 189 0 0 0 0 0 0 0", "2 189 0 0 0 0 0 0 0", wp(1500, 0, 60), wp(0, 0, 0, command=21)),
        5,
        "more than one DO_LAND_START",
    ),
    "land-start-alone": ("checkFixedWingLanding", (*GOOD, "2 189 0 0 0 0 0 0 0", wp(1500, 0)), 4, "no landing follows"),
    "rtl-after-land-start": (
        "checkFixedWingLanding",
        (*GOOD, "2 189 0 0 0 0 0 0 0", wp(1500, 0, 60), "2 20 0 0 0 0 0 0 0", wp(0, 0, 0, command=21)),
        6,
        "a return to launch after DO_LAND_START",
    ),
    "approach-below": (
        "checkFixedWindLandApproach",
        (*GOOD, wp(1500, 0, 20), wp(0, 0, 20, command=21)),
        5,
        "the approach waypoint must be above the landing point",
    ),
    # 150 m down over 1500 m: 5.7 degrees.
    "too-steep": (
        "checkFixedWindLandApproach",
        (*GOOD, wp(1500, 0, 150), wp(0, 0, 0, command=21)),
        5,
        "the landing glide slope is 5.7°, more than the maximum of 5.0°",
    ),
    "inside-orbit": (
        "checkFixedWindLandApproach",
        (*GOOD, wp(200, 0, 60, command=31, p="1 250 0 0"), wp(0, 0, 0, command=21)),
        5,
        "outside the orbit radius",
    ),
    "approach-kind": (
        "checkFixedWindLandApproach",
        (*GOOD, wp(1500, 0, 60, command=18, p="1 0 150 0"), wp(0, 0, 0, command=21)),
        5,
        "the approach must begin with",
    ),
}


@pytest.mark.parametrize("case", sorted(REFUSED))
def test_px4_refuses(case: str) -> None:
    check, lines, item, words = REFUSED[case]
    finding = of(check, *lines)
    assert finding.ok is (False if case in NOBODY else None)
    assert finding.place == Place("mission", item=item)
    assert words in finding.reason


@pytest.mark.parametrize("case", sorted(REFUSED))
def test_px4s_own_limits_are_named_and_are_no_verdict_on_the_aircraft(case: str) -> None:
    check, lines, _, _ = REFUSED[case]
    verdict = judge_geometry(setup_of(*lines))
    named = [line for line in verdict.lines if line.startswith("PX4 would reject the mission: ") and check in line]
    assert len(named) == (0 if case in NOBODY else 1), verdict.lines
    failed = [item for item in verdict.findings if item.rule == "mission" and item.ok is False]
    # No autopilot reaches a landing behind a return.
    assert not failed or case in NOBODY or (case, failed[0].check) == ("rtl-after-land-start", "unreached")


@pytest.mark.parametrize("case", sorted(REFUSED))
def test_where_px4_flies_what_it_refuses_fails(case: str) -> None:
    check, lines, item, _ = REFUSED[case]
    verdict = judge_geometry(replace(setup_of(*lines), autopilot=Px4(Px4Parameters.defaults())))
    found = [one for one in verdict.findings if one.rule == "mission" and one.check == check]
    assert [(one.ok, one.place) for one in found] == [(False, Place("mission", item=item))]


def by_px4(text: str, *lines: str) -> list[Finding]:
    """The rule's findings where PX4 flies with a file of parameters, "" for none."""
    made = Px4Parameters.from_text(text, "a.params") if text else Px4Parameters.defaults()
    findings = judge_geometry(replace(setup_of(*lines), autopilot=Px4(made))).findings
    return [item for item in findings if item.rule == "mission"]


LANDING = (*GOOD, wp(1500, 0, 100), wp(0, 0, 0, command=21))
# As long as a station's file.
WHOLE = "".join(f"PARAMETER_{k} 1\n" for k in range(400))


@pytest.mark.parametrize(("line", "accepted"), [("2 178 0 20 -1 0 0 0 0", True), ("3 178 0 20 -1 0 0 0 0", False)])
def test_px4_takes_a_command_without_a_place_in_frame_2_only(line: str, accepted: bool) -> None:
    """PX4's `parse_mavlink_mission_item` answers MAV_MISSION_UNSUPPORTED; Mission Planner writes frame 3."""
    lines = (*GOOD[:2], line, GOOD[2])
    verdict = judge_geometry(replace(setup_of(*lines), autopilot=Px4(Px4Parameters.defaults())))
    (found,) = [item for item in verdict.findings if item.check == "checkMissionItemValidity"]
    assert found.ok is accepted
    assert accepted or (found.place.item == 3 and "DO_CHANGE_SPEED in frame 3" in found.reason)
    assert of("checkMissionItemValidity", *lines).ok is True  # ArduPlane takes both.


@pytest.mark.parametrize(
    ("text", "lines", "ok", "words"),
    [
        ("", GOOD, None, "PX4's fixed-wing default refuses a mission without a landing: add one, or set MIS_TKO_LA"),
        ("NAV_ACC_RAD 20", GOOD, None, "or set MIS_TKO_LAND_REQ 0"),
        ("", LANDING, True, "as MIS_TKO_LAND_REQ requires"),
        ("MIS_TKO_LAND_REQ 2", GOOD, False, "MIS_TKO_LAND_REQ 2 requires a landing, but this mission has a takeoff"),
        (WHOLE, GOOD, False, "MIS_TKO_LAND_REQ 2 requires a landing"),
        (WHOLE + "MIS_TKO_LAND_REQ 0", GOOD, True, "as MIS_TKO_LAND_REQ requires"),
        ("MIS_TKO_LAND_REQ 1", GOOD, True, ""),
        (
            "MIS_TKO_LAND_REQ 1",
            GOOD[1:],
            False,
            "requires a takeoff, but this mission has neither a takeoff nor a landing",
        ),
        ("MIS_TKO_LAND_REQ 3", GOOD, False, "a takeoff and a landing"),
        ("MIS_TKO_LAND_REQ 3", LANDING, True, ""),
        ("MIS_TKO_LAND_REQ 4", GOOD, False, "both or neither"),
        ("MIS_TKO_LAND_REQ 4", GOOD[1:], True, ""),
    ],
)
def test_px4_asks_for_a_takeoff_or_a_landing(text: str, lines: tuple[str, ...], ok: bool | None, words: str) -> None:
    (found,) = [item for item in by_px4(text, *lines) if item.check == "checkTakeoffLandAvailable"]
    assert found.ok is ok
    assert words in found.reason


def test_without_a_landing_a_default_px4_flies_and_the_verdict_says_so() -> None:
    verdict = judge_geometry(replace(setup_of(*GOOD), autopilot=Px4(Px4Parameters.defaults())))
    said = "PX4 would reject the mission: PX4's fixed-wing default refuses a mission without a landing"
    # Its take-off is not flown, and leaves the verdict open.
    assert verdict.undecided
    assert not verdict.failed
    assert [line for line in verdict.lines if line.startswith(said)]
    assert not [line for line in judge_geometry(setup_of(*GOOD)).lines if "MIS_TKO_LAND_REQ" in line]


def test_a_takeoff_may_be_lower_than_the_acceptance_radius() -> None:
    (found,) = [item for item in by_px4("NAV_ACC_RAD 105", *GOOD) if item.check == "checkTakeoff"]
    assert found.ok is True


@pytest.mark.parametrize(("degrees", "taken"), [(8.0, True), (7.5, False)])
def test_a_landing_is_as_steep_as_fw_lnd_ang(degrees: float, taken: bool) -> None:
    # 208.2 m down over 1,500 m: 7.9 degrees.
    lines = (*GOOD, wp(1500, 0, 208.2), wp(0, 0, 0, command=21))
    found = [item for item in by_px4(f"FW_LND_ANG {degrees}", *lines) if item.check == "checkFixedWindLandApproach"]
    assert [item.ok for item in found] == [taken]


def test_a_landing_that_is_too_steep_states_what_would_be_accepted() -> None:
    """208.2 m down over 1,500 m at 7.5 degrees: 208.2 / 0.13165 = 1581.4 m, and 1500 * 0.13165 = 197.5 m."""
    lines = (*GOOD, wp(1500, 0, 208.2), wp(0, 0, 0, command=21))
    (found,) = [item for item in by_px4("FW_LND_ANG 7.5", *lines) if item.check == "checkFixedWindLandApproach"]
    assert found.reason.startswith(
        "the landing glide slope is 7.9°, more than the maximum of 7.5° of FW_LND_ANG: begin the glide 1582 m instead"
        " of 1500 m before the landing point, or 197 m instead of 208 m above it (see PX4's"
    )


def test_first_waypoint_too_far() -> None:
    finding = of("checkDistanceToFirstWaypoint", wp(0, 500), wp(0, 1500), home=HOME_FAR)
    assert finding.ok is None
    assert judge_geometry(setup_of(wp(0, 500), wp(0, 1500), home=HOME_FAR)).flyable
    assert "the first waypoint is 179" in finding.reason


def test_a_good_landing_passes_every_check() -> None:
    lines = (*GOOD, "2 189 0 0 0 0 0 0 0", wp(1500, 0, 100, command=31, p="1 150 0 0"), wp(0, 0, 0, command=21))
    findings = [item for item in judge_geometry(setup_of(*lines)).findings if item.rule == "mission"]
    assert len(findings) == 9
    assert all(item.ok for item in findings), [item.reason for item in findings]
    assert not [item.reason for item in findings if "(and " in item.reason]


def test_what_px4_only_remarks_on_does_not_fail() -> None:
    assert of("checkMissionItemValidity", *GOOD, wp(1500, 0, command=18, p="1 0 150 0")).ok is None
    assert of("checkMissionItemValidity", *GOOD, wp(1500, 0, frame=10)).ok is None
    below = of("checkIfBelowHomeAltitude", *GOOD, wp(1500, 0, -5))
    assert below.ok
    assert "waypoint 4 is below home" in below.reason
    apart = of("checkDistancesBetweenWaypoints", *GOOD)
    assert apart.ok
    assert "MIS_DIST_WPS" in apart.reason


def test_geofence() -> None:
    """A square of 2 km around the origin, and a hole in it that the route's second place lies in."""
    setup, fence = setup_of(*GOOD), _fence
    square = fence(5001, 4, (-2000, -2000), (2000, -2000), (2000, 2000), (-2000, 2000))
    small = fence(5001, 4, (-1000, -1000), (1000, -1000), (1000, 1000), (-1000, 1000))
    hole, ring = fence(5004, 300, (100, 1500)), fence(5003, 3000, (0, 0))
    for fences, words in (
        ((*square, *ring), None),
        (small, "outside an inclusion polygon"),
        ((*square, *hole), "inside an exclusion circle of radius 300 m"),
        (fence(5003, 1000, (0, 0)), "outside an inclusion circle"),
        (fence(5002, 3, (-100, 1400), (100, 1400), (0, 1700)), "inside an exclusion polygon"),
    ):
        fenced = replace(setup, mission=replace(setup.mission, fences=fences))
        (finding,) = [item for item in judge_geometry(fenced).findings if item.check == "checkMissionAgainstGeofence"]
        assert finding.ok == (words is None)
        assert "(see PX4's function checkMissionAgainstGeofence)" in finding.reason
        assert words is None or words in finding.reason


def test_a_loiter_whose_circle_alone_leaves_the_fence_is_accepted_but_breaks_the_fence() -> None:
    """The circle of 200 m around east 1500 m reaches 1700 m, 50 m beyond the fence; PX4's upload tests its center."""
    setup = setup_of(*GOOD, wp(1500, 900, command=19, p="20 0 200 0"))
    fence = _fence(5001, 4, (-500, -500), (1650, -500), (1650, 2500), (-500, 2500))
    verdict = judge_geometry(replace(setup, mission=replace(setup.mission, fences=fence)))
    by_check = {finding.check: finding for finding in verdict.findings if finding.rule == "mission"}
    assert by_check["checkMissionAgainstGeofence"].ok
    failed = [finding for finding in verdict.findings if finding.ok is False]
    assert {finding.rule for finding in failed} == {"fence"}


def test_the_other_items_outside_the_fence_are_counted_as_items() -> None:
    fence = _fence(5003, 1000, (0, 0))
    setup = setup_of(*GOOD)
    findings = mission_findings(replace(setup, mission=replace(setup.mission, fences=fence)))
    (finding,) = [item for item in findings if item.check == "checkMissionAgainstGeofence"]
    assert "outside an inclusion circle of radius 1000 m (fence item 0) (and 1 more item) (see PX4's" in finding.reason


def test_px4_tests_the_positions_of_items_that_the_route_does_not_reach() -> None:
    """A waypoint after the RTL, 2.5 km outside a fence of 2.5 km, is no fault of a flight that PX4 does not refuse."""
    setup = setup_of(*GOOD, "3 20 0 0 0 0 0 0 0", wp(0, 5000))
    fenced = replace(setup, mission=replace(setup.mission, fences=_fence(5003, 2500, (0, 0))))
    for autopilot, ok in ((setup.autopilot, None), (Px4(Px4Parameters.defaults()), False)):
        findings = judge_geometry(replace(fenced, autopilot=autopilot)).findings
        (finding,) = [item for item in findings if item.check == "checkMissionAgainstGeofence"]
        assert (finding.ok, finding.place.item) == (ok, 5)


def test_a_rally_point_outside_the_fence_is_noted() -> None:
    """The first and the third rally point lie within 1,700 m of home, the second 1,800 m east of it."""
    fences = _fence(5003, 1700, (0, 0))
    rally = _fence(5100, 0, (0, 300), (1800, 0), (-1600, 0))
    setup = setup_of(*GOOD)
    noted = replace(setup, mission=replace(setup.mission, fences=fences, rally=rally))
    assert [note for note in judge_geometry(noted).notes if "rally" in note] == [
        "rally point 2 lies outside an inclusion circle of radius 1700 m (fence item 0): a return to it violates the"
        " fence"
    ]
    assert not [note for note in judge_geometry(setup).notes if "rally" in note]


def _fence(command: int, p1: float, *places: tuple[float, float]) -> tuple[MissionItem, ...]:
    """Fence items at places about home, which is the origin."""
    spots = [tuple(float(value) for value in to_geo(ORIGIN, *place)) for place in places]
    return tuple(MissionItem(k, command, 0, (p1, 0.0, 0.0, 0.0), lat, lon, 0.0) for k, (lat, lon) in enumerate(spots))


_EAST = _fence(5001, 4, (500, -2000), (3000, -2000), (3000, 2000), (500, 2000))
_AROUND = _fence(5003, 400, (0, 0))


@pytest.mark.parametrize(
    ("fences", "words"),
    [
        (_AROUND, ""),
        (_EAST, "FENCE_ENABLE 1 prevents arming, because home is outside an inclusion polygon"),
        (_fence(5004, 100, (0, 99)), "FENCE_ENABLE 1 prevents arming, because home is inside an exclusion circle of"),
        (_fence(5004, 100, (0, 101)), ""),
        # All inclusions, or with bit 1 of FENCE_OPTIONS any: `AC_PolyFence_loader::breached`.
        ((*_EAST, *_AROUND), "FENCE_ENABLE 1 prevents arming, because home is outside an inclusion polygon"),
        (
            _fence(5003, 1, (0, 0)),
            "FENCE_MARGIN 2 prevents arming: ArduPlane requires at most the 1 m of an inclusion circle",
        ),
    ],
)
def test_a_home_beyond_the_fence_leaves_the_verdict_open(fences: tuple[MissionItem, ...], words: str) -> None:
    """`AC_Fence::pre_arm_check`: the flight begins in the air, inside the fence or not."""
    setup = setup_of(wp(600, 0), wp(900, 900))
    texts = []
    for options in (1.0, 3.0):
        law = ArduPlane(ArduPilotParameters.defaults().changed(FENCE_ENABLE=1.0, FENCE_OPTIONS=options))
        fenced = replace(setup, autopilot=law, mission=replace(setup.mission, fences=fences))
        texts.append([item.reason for item in mission_findings(fenced) if item.check == "not flown"])
    assert [text.startswith(words) for text in texts[0]] == [True] * bool(words)
    assert texts[1] == ([] if fences == (*_EAST, *_AROUND) else texts[0])


@pytest.mark.parametrize(("north", "opens"), [(4900.0, False), (5100.0, True)])
def test_a_required_rally_point_is_near_home(north: float, opens: bool) -> None:
    """`AP_Rally::find_nearest_rally_point`: within RALLY_LIMIT_KM, by default 5."""
    setup = setup_of(wp(600, 0), wp(900, 900))
    law = ArduPlane(ArduPilotParameters.defaults().changed(ARMING_MIS_ITEMS=32.0))
    rally = tuple(replace(item, command=5100) for item in _fence(5004, 0, (0, 9000), (0, north)))
    made = replace(setup, autopilot=law, mission=replace(setup.mission, rally=rally))
    reasons = [item.reason for item in mission_findings(made) if item.check == "not flown"]
    assert [reason.startswith("ARMING_MIS_ITEMS 32 prevents arming") for reason in reasons] == [True] * opens


@pytest.mark.parametrize(("volts", "opens"), [(50.4, False), (50.5, True)])
def test_a_voltage_above_the_full_batterys_prevents_arming(volts: float, opens: bool) -> None:
    """The aircraft's battery of 44.4 V has 12 cells of 3.7 V, which are charged to 4.2 V: 50.4 V."""
    law = ArduPlane(ArduPilotParameters.defaults().changed(BATT_ARM_VOLT=volts))
    made = replace(setup_of(wp(600, 0), wp(900, 900)), autopilot=law)
    assert made.envelope.volts == 44.4
    reasons = [item.reason for item in mission_findings(made) if item.check == "not flown"]
    assert [reason.startswith("BATT_ARM_VOLT 50.5 prevents arming") for reason in reasons] == [True] * opens


def test_without_a_home_there_is_no_distance_to_the_first_waypoint() -> None:
    setup = setup_of(*GOOD)
    nowhere = replace(setup, mission=replace(setup.mission, home=None))
    (finding,) = [item for item in judge_geometry(nowhere).findings if item.check == "checkDistanceToFirstWaypoint"]
    assert finding.ok
    assert "no home, so no distance to the first waypoint" in finding.reason


# A waypoint 600 m from the middle of a circle of 1 km, after it and before it; circles of 200 m inside that of 1 km and
# about its middle; one of 1 km that is left for a waypoint 1.5 km off, two 5 km apart, and twice one circle.
_WIDE = wp(0, 0, 300, command=18, p="2 0 1000 0")
UNJOINED = {
    "after": (
        (_WIDE, wp(0, 600, 100), wp(5000, 0, 300)),
        (3, "lies inside the circle of item 2: ArduPlane flies there"),
    ),
    "before": (
        (wp(0, 600, 100), _WIDE, wp(5000, 0, 300)),
        (2, "lies inside the circle of item 3: ArduPlane flies there"),
    ),
    "inner": (
        (_WIDE, wp(300, 0, 300, command=18, p="1 0 200 0"), wp(5000, 0, 300)),
        (3, "no tangent joins its circle to the circle of item 2: ArduPlane flies it anyway"),
    ),
    "same-middle": (
        (_WIDE, wp(0, 0, 300, command=18, p="1 0 200 0"), wp(5000, 0, 300)),
        (3, "no tangent joins its circle to the circle of item 2"),
    ),
    # Nobody has to fly elsewhere for a loiter without a place of its own, or with that of the waypoint before.
    "at-the-place-before": ((wp(0, 0, 300), wp(0, 0, 300, command=18, p="1 0 150 0"), wp(5000, 0, 300)), None),
    "no-place": ((wp(0, 0, 300), "3 18 1 0 150 0 0 0 300", wp(5000, 0, 300)), None),
    "far-below-it": (
        (wp(0, 0, 100), wp(0, 0, 300, command=18, p="1 0 150 0"), wp(5000, 0, 300)),
        (2, "lies inside the circle of item 3: ArduPlane flies there"),
    ),
    # 150 m at 500 m are 153 m, and at 350 m 151 m.
    "down-one-place": (
        (wp(0, 0, 200, command=18, p="2 0 150 0"), wp(0, 0, 50, command=31, p="0 150 0 0"), wp(5000, 0, 50)),
        None,
    ),
    "down-the-other-way": (
        (wp(0, 0, 200, command=18, p="2 0 150 0"), wp(0, 0, 50, command=31, p="0 -150 0 0"), wp(5000, 0, 50)),
        (3, "no tangent joins its circle to the circle of item 2"),
    ),
    "outside": ((_WIDE, wp(1500, 0, 300), wp(5000, 0, 300)), None),
    "apart": ((_WIDE, wp(5000, 0, 300, command=18, p="1 0 200 0"), wp(9000, 0, 300)), None),
    "twice": ((_WIDE, _WIDE, wp(5000, 0, 300)), None),
}


@pytest.mark.parametrize("name", UNJOINED)
def test_what_no_tangent_joins_to_a_circle_fails_where_the_autopilot_flies_there(name: str) -> None:
    lines, expected = UNJOINED[name]
    setup = setup_by_law(mission(wp(0, -3000, 300), *lines))
    verdict = judge_geometry(setup)
    found = [(item.place.item, item.reason, item.ok) for item in verdict.findings if item.check == "unjoined"]
    assert RouteTable.from_dataclass(setup.route).to_route("a.json").unjoined_stops == setup.route.unjoined_stops
    if expected is None:
        assert not found
        return
    ((item, reason, ok),) = found
    assert (item, ok, verdict.flyable) == (expected[0], False, False)
    assert reason.startswith(expected[1])
    assert reason.endswith("on a path that is not judged")
    # planfly's own guidance flies on tangents, and leaves it out with a note.
    assert not setup_of(wp(0, -3000, 300), *lines).route.unjoined_stops


def test_a_take_off_inside_the_first_circle_is_no_fault() -> None:
    around = (_WIDE, wp(5000, 0, 300))
    assert not setup_by_law(mission(wp(0, 0, 300, command=22), *around)).route.unjoined_stops
    # Wherever in it that is; a waypoint there is flown to.
    assert not setup_by_law(mission(wp(0, 300, 300, command=22), *around)).route.unjoined_stops
    assert setup_by_law(mission(wp(0, 300, 300), *around)).route.unjoined_stops


@pytest.mark.parametrize(
    ("values", "said"),
    [
        ({}, ()),
        ({"ALT_OFFSET": -120.0}, ("ALT_OFFSET -120",)),
        ({"SOAR_ENABLE": 1.0, "Q_ENABLE": 1.0}, ("SOAR_ENABLE 1", "Q_ENABLE 1")),
        ({"FENCE_ENABLE": 1.0}, ("FENCE_ENABLE 1 prevents arming, because no fence",)),
        ({"FENCE_ENABLE": 1.0, "FENCE_TYPE": 2.0}, ("FENCE_TYPE 2",)),
        ({"FENCE_AUTOENABLE": 1.0, "FENCE_TYPE": 5.0}, ("FENCE_TYPE 5",)),
        ({"FENCE_ENABLE": 1.0, "FENCE_TYPE": 3.0, "FENCE_ACTION": 0.0}, ()),
        ({"FENCE_TYPE": 3.0}, ()),
        ({"TERRAIN_FOLLOW": 16.0}, ("TERRAIN_FOLLOW 16",)),
        ({"MIN_GROUNDSPEED": 30.0}, ()),
        ({"ARSPD_USE": 0.0}, ("ARSPD_USE 0",)),
        ({"RLL_RATE_P": 0.0, "RLL_RATE_FF": 0.0}, ("RLL_RATE_P 0, RLL_RATE_I 0.2, RLL_RATE_D 0, RLL_RATE_FF 0",)),
        ({"PTCH_RATE_P": 0.0}, ()),
    ],
)
def test_settings_of_arduplane_that_no_flight_shows_leave_the_verdict_open(
    values: dict[str, float], said: tuple[str, ...]
) -> None:
    law = ArduPlane(ArduPilotParameters.defaults().changed(**values))
    lines = wp(0, 0), wp(0, 900), "0 20 0 0 0 0 0 0 0"
    left = [item for item in mission_findings(replace(setup_of(*lines), autopilot=law)) if item.check == "not flown"]
    assert [item.ok for item in left] == [None] * len(said)
    assert all(words in item.reason for item, words in zip(left, said, strict=True))
    # The next step is in the reason, and not in the headline.
    assert [("--sitl" in item.reason, "--sitl" in item.brief) for item in left] == [
        ("ARSPD" in words, False) for words in said
    ]
    # Without a return the terrain is not followed: after any other last item ArduPlane returns by itself.
    alone = mission_findings(replace(setup_of(lines[0], wp(0, 900, command=17)), autopilot=law))
    assert not any("TERRAIN_FOLLOW" in item.reason for item in alone)


@pytest.mark.parametrize(
    ("lines", "said"),
    [
        # On its item 3 the mission switches on a fence that the file has off: FENCE_TYPE 1 limits the altitude.
        ((wp(0, 0), wp(0, 900), "2 207 1 0 0 0 0 0 0", wp(900, 900)), "FENCE_TYPE 1"),
        ((wp(0, 0), wp(0, 900), "2 207 0 0 0 0 0 0 0", wp(900, 900)), ""),
        # ArduPlane's RTL_AUTOLAND 4 returns along the items behind DO_RETURN_PATH_START, if there is one.
        ((wp(0, 0), wp(0, 900), "2 20 0 0 0 0 0 0 0", "2 188 0 0 0 0 0 0 0", wp(900, 900)), "RTL_AUTOLAND 4"),
        ((wp(0, 0), wp(0, 900), "2 20 0 0 0 0 0 0 0"), ""),
        ((wp(0, 0), wp(0, 900), "2 188 0 0 0 0 0 0 0", wp(900, 900)), "RTL_AUTOLAND 4"),
        ((wp(0, 0), wp(0, 900), "2 188 0 0 0 0 0 0 0", wp(900, 900, command=17)), ""),
    ],
)
def test_settings_leave_the_verdict_open_where_an_item_makes_them_matter(lines: tuple[str, ...], said: str) -> None:
    law = ArduPlane(ArduPilotParameters.defaults().changed(FENCE_TYPE=1.0, RTL_AUTOLAND=4.0))
    left = [item for item in mission_findings(replace(setup_of(*lines), autopilot=law)) if item.check == "not flown"]
    assert [item.ok for item in left] == [None] * bool(said)
    assert all(said in item.reason for item in left)


@pytest.mark.parametrize(
    ("values", "said"),
    [
        ({}, ()),
        ({"GF_MAX_HOR_DIST": 300.0, "GF_MAX_VER_DIST": 50.0}, ("GF_MAX_HOR_DIST 300", "GF_MAX_VER_DIST 50")),
        # Upload refuses items beyond it, whatever GF_ACTION is.
        ({"GF_MAX_HOR_DIST": 300.0, "GF_ACTION": 0.0}, ("GF_MAX_HOR_DIST 300",)),
        ({"COM_FLT_TIME_MAX": 60.0}, ("COM_FLT_TIME_MAX 60",)),
        ({"FW_USE_AIRSPD": 0.0}, ("FW_USE_AIRSPD 0",)),
        ({"WEIGHT_BASE": 2.0, "WEIGHT_GROSS": 2.5}, ("WEIGHT_BASE 2", "WEIGHT_GROSS 2.5")),
        # PX4 reads them above 0 alone.
        ({"WEIGHT_BASE": 0.0, "FW_SERVICE_CEIL": 0.0, "FW_T_F_ALT_ERR": 0.0, "NAV_MIN_GND_DIST": 0.0}, ()),
        ({"FW_SERVICE_CEIL": 3000.0, "FW_T_F_ALT_ERR": 20.0}, ("FW_SERVICE_CEIL 3000", "FW_T_F_ALT_ERR 20")),
        ({"FW_THR_ASPD_MIN": 0.3, "FW_THR_ASPD_MAX": 0.8}, ("FW_THR_ASPD_MIN 0.3", "FW_THR_ASPD_MAX 0.8")),
        # 0 is the ground speed less the wind, 3 the third sensor, 4 a computed airspeed, which TECS does not use.
        ({"ASPD_PRIMARY": 0.0}, ("ASPD_PRIMARY 0",)),
        ({"ASPD_PRIMARY": 4.0}, ("ASPD_PRIMARY 4",)),
        ({"ASPD_PRIMARY": 3.0}, ()),
        ({"NAV_MIN_GND_DIST": 15.0}, ("NAV_MIN_GND_DIST 15",)),
        # COM_WIND_MAX_ACT 1 only warns; the wind here is 6 m/s.
        ({"COM_WIND_MAX": 5.0, "COM_WIND_MAX_ACT": 2.0}, ("COM_WIND_MAX 5",)),
        ({"COM_WIND_MAX": 5.0, "COM_WIND_MAX_ACT": 1.0}, ()),
        ({"COM_WIND_MAX": 7.0, "COM_WIND_MAX_ACT": 2.0}, ()),
        # A slower pitch than the simulated 60 degrees per second; a faster one is not reached.
        ({"FW_P_RMAX_POS": 45.0, "FW_P_RMAX_NEG": 59.0}, ("FW_P_RMAX_POS 45", "FW_P_RMAX_NEG 59")),
        ({"FW_P_RMAX_POS": 120.0, "FW_P_RMAX_NEG": 60.0}, ()),
        # `checkLowHeightConditions`: both are needed.
        ({"FW_T_THR_LOW_HGT": 30.0, "FW_LND_THRTC_SC": 0.5}, ("FW_LND_THRTC_SC 0.5",)),
        ({"FW_T_THR_LOW_HGT": 30.0}, ()),
        ({"FW_LND_THRTC_SC": 0.5}, ()),
        # CBRK_FLIGHTTERM 121212, the default, terminates no flight; FW_R_LIM is 50, FW_P_LIM_MAX 30 degrees.
        ({"FD_FAIL_R": 45.0}, ()),
        ({"FD_FAIL_R": 45.0, "CBRK_FLIGHTTERM": 0.0}, ("FD_FAIL_R 45",)),
        ({"FD_FAIL_P": 30.0, "CBRK_FLIGHTTERM": 0.0}, ("FD_FAIL_P 30",)),
        ({"FD_FAIL_R": 51.0, "FD_FAIL_P": 0.0, "CBRK_FLIGHTTERM": 0.0}, ()),
        # The rule energy judges a return at a low remaining time.
        ({"BAT1_CAPACITY": 5000.0, "COM_FLTT_LOW_ACT": 3.0}, ()),
        # These matter in a return, and with a payload.
        ({"RTL_DESCEND_ALT": 50.0, "RTL_LAND_DELAY": 0.0, "RTL_TYPE": 2.0, "MIS_COMMAND_TOUT": 5.0}, ()),
        # 1.17 has no such parameter.
        ({"NPFG_EN_MIN_GSP": 0.0}, ()),
    ],
)
def test_settings_of_px4_that_no_flight_shows_leave_the_verdict_open(
    values: dict[str, float], said: tuple[str, ...]
) -> None:
    assert unflown_by_px4(values, wp(0, 0), wp(0, 900)) == [*said]


def unflown_by_px4(values: dict[str, float], *lines: str, version: Px4Version = "1.17") -> list[str]:
    """The settings that leave the verdict open where PX4 flies in 6 m/s of wind: name and value of each."""
    law = Px4(Px4Parameters.defaults(version).changed(**values))
    setup = setup_of(*lines)
    windy = replace(setup, scenario=replace(setup.scenario, wind=Wind(6.0, 0.0)), autopilot=law)
    left = [item for item in mission_findings(windy) if item.check == "not flown"]
    assert [item.ok for item in left] == [None] * len(left)
    return [" ".join(item.reason.split()[:2]) for item in left]


PAYLOAD = (wp(0, 0), wp(0, 900), "2 211 1 0 0 0 0 0 0", wp(900, 900))
RETURN = (wp(0, 0), wp(0, 900), "2 20 0 0 0 0 0 0 0")
LOITER = wp(1500, 0, 100, command=31, p="1 150 0 0")
LAND = wp(0, 0, 0, command=21)


@pytest.mark.parametrize(
    ("values", "lines", "said"),
    [
        ({"MIS_COMMAND_TOUT": 5.0}, PAYLOAD, ["MIS_COMMAND_TOUT 5"]),
        ({"MIS_COMMAND_TOUT": 0.0}, PAYLOAD, []),
        ({"FW_LND_EARLYCFG": 1.0}, (wp(0, 1500), LOITER, LAND), ["FW_LND_EARLYCFG 1"]),
        ({"FW_LND_EARLYCFG": 0.0}, (wp(0, 1500), LOITER, LAND), []),
        ({"FW_LND_EARLYCFG": 1.0}, (wp(0, 1500), LOITER, wp(1500, 1500), LAND), []),
        ({}, RETURN, []),
        ({"RTL_DESCEND_ALT": 50.0}, RETURN, []),
        ({"RTL_LAND_DELAY": 0.0}, RETURN, ["RTL_LAND_DELAY 0"]),
        ({"RTL_TYPE": 2.0}, RETURN, ["RTL_TYPE 2"]),
        ({"RTL_TYPE": 4.0}, RETURN, ["RTL_TYPE 4"]),
        ({"RTL_TYPE": 5.0}, RETURN, ["RTL_TYPE 5"]),
    ],
)
def test_settings_of_px4_leave_the_verdict_open_where_an_item_makes_them_matter(
    values: dict[str, float], lines: tuple[str, ...], said: list[str]
) -> None:
    assert unflown_by_px4(values, *lines) == said


def test_px4_1_16_may_keep_no_minimum_ground_speed() -> None:
    assert unflown_by_px4({"NPFG_EN_MIN_GSP": 0.0}, *RETURN[:2], version="1.16") == ["NPFG_EN_MIN_GSP 0"]


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ("0 50 60", "DO_CHANGE_SPEED to 50 m/s is outside AIRSPEED_MIN"),
        ("0 5 60", "DO_CHANGE_SPEED to 5 m/s is outside AIRSPEED_MIN"),
        ("0 15 60", ""),  # within AIRSPEED_MIN 9 to AIRSPEED_MAX 22: the airspeed, and no throttle
        ("0 50 -1", ""),
        ("1 50 60", ""),  # a minimum ground speed, and no throttle
    ],
)
def test_a_throttle_with_an_airspeed_beyond_the_limits_leaves_the_verdict_open(change: str, said: str) -> None:
    """`Plane::do_change_speed` of 4.6.3: the case of an airspeed that is not accepted falls through to the throttle."""
    lines = (wp(0, 0), wp(0, 900), f"2 178 {change} 0 0 0 0", wp(0, 1800))
    law = ArduPlane(ArduPilotParameters.defaults())
    left = [item for item in mission_findings(replace(setup_of(*lines), autopilot=law)) if item.check == "not flown"]
    assert [item.reason.startswith(said) for item in left] == [True] * bool(said)


RTL = "0 20 0 0 0 0 0 0 0"
UNLIMITED = wp(1500, 1500, command=17)
TOUCHDOWN = wp(0, 1500, 0, command=21)
MARK = "0 189 0 0 0 0 0 0 0"


@pytest.mark.parametrize(
    ("lines", "item", "ok"),
    [
        ((*GOOD, RTL), None, True),
        ((*GOOD, RTL, wp(0, 3000)), 5, False),
        ((*GOOD, RTL, "0 178 0 20 -1 0 0 0 0"), None, True),  # no navigation item
        ((*GOOD, RTL, MARK, wp(0, 3000), TOUCHDOWN), None, True),  # a landing sequence
        ((*GOOD, RTL, "0 188 0 0 0 0 0 0 0", wp(0, 3000)), None, True),  # a return path
        ((*GOOD, RTL, wp(0, 3000), MARK, wp(0, 4000), TOUCHDOWN), 5, False),
        ((*GOOD, UNLIMITED, wp(0, 3000)), 5, None),  # until someone sets the next item
        ((*GOOD, TOUCHDOWN, wp(0, 3000)), 5, None),
        ((GOOD[0], GOOD[1], "0 177 5 1 0 0 0 0 0", wp(0, 3000), wp(1500, 1500)), None, True),  # left out by a jump
        ((*GOOD, RTL, wp(0, 3000), "0 177 5 -1 0 0 0 0 0"), 5, False),
    ],
)
def test_items_behind_the_missions_end_are_never_reached(
    lines: tuple[str, ...], item: int | None, ok: bool | None
) -> None:
    """`verify_command` of an RTL and of an unlimited loiter never returns true; marks are reached by other ways."""
    found = [one for one in mission_findings(setup_of(*lines)) if "is never reached" in one.reason]
    assert [(one.place.item, one.ok) for one in found] == ([] if item is None else [(item, ok)])


@pytest.mark.parametrize("case", sorted(REFUSED))
def test_px4s_rules_are_not_cited_where_arduplane_flies(case: str) -> None:
    """An item that no autopilot accepts fails with either autopilot."""
    _, lines, item, words = REFUSED[case]
    verdict = judge_geometry(replace(setup_of(*lines), autopilot=ArduPlane(ArduPilotParameters.defaults())))
    found = [one for one in verdict.findings if one.rule == "mission" and words in one.reason and one.ok is not None]
    assert [(one.ok, one.place.item) for one in found] == ([(False, item)] if case in NOBODY else [])
    # An item that only ArduPlane refuses is said to be accepted by PX4.
    lines = [*verdict.lines, *(one.reason + one.limit_source for one in verdict.findings)]
    assert not [line for line in lines if "PX4" in line.replace("PX4 accepts it", "")]
