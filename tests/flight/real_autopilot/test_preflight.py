"""The conversation before a flight, with an autopilot that is a few answers made by hand."""

from collections.abc import Callable
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from flight.mission.items import Home, MissionItem
from flight.real_autopilot.autopilot_link import AutopilotNews
from flight.real_autopilot.preflight import AUTO, Preflight, Talk, version_text
from flight.real_autopilot.uploaded_mission import UploadedMission
from world.errors import FlightError

WAYPOINTS = tuple(MissionItem(k, 16, 0, (0.0, 20.0, 0.0, 0.0), 36.5 + 0.01 * k, -84.2, 500.0) for k in (1, 2, 3))
MISSION = UploadedMission(Home(36.5, -84.2, 300.0), WAYPOINTS)
EKF_GOOD = 831


class Autopilot:
    """A link's two ends in one: what is sent is answered at once."""

    def __init__(self) -> None:
        self.news = AutopilotNews(vehicle=1, ekf=EKF_GOOD)
        self.sent: list[Any] = []
        self.received: list[Any] = []
        self.results = [mavlink.MAV_MISSION_ACCEPTED]
        self.has: dict[str, float] = {}
        self.accepts: Callable[[int], int] = lambda command: mavlink.MAV_RESULT_ACCEPTED

    def send(self, message: Any) -> None:
        self.sent.append(message)
        kind = message.get_type()
        if kind in ("COMMAND_LONG", "COMMAND_INT"):
            result = self.news.acknowledged[message.command] = self.accepts(message.command)
            if message.command == 176 and result == 0:
                self.news.mode, self.news.armed = AUTO, True
        if kind == "PARAM_REQUEST_READ":
            self.news.parameters |= {name: self.has[name] for name in (message.param_id,) if name in self.has}
        if kind == "MISSION_COUNT":
            self.count, self.received, self.news.requested = message.count, [], 0
        if kind == "MISSION_ITEM_INT":
            self.received.append(message)
            if len(self.received) < self.count:
                self.news.requested = len(self.received)
            else:
                self.news.mission_result = self.results.pop(0)

    def commands(self) -> list[int]:
        return [message.command for message in self.sent if message.get_type().startswith("COMMAND")]


class Clock:
    """Time that goes on by a tenth of a second a turn."""

    def __init__(self) -> None:
        self.time = 0.0

    def go_through(self, talk: Talk) -> None:
        for _ in talk:
            self.time += 0.1


@pytest.fixture
def clock() -> Clock:
    return Clock()


@pytest.fixture
def autopilot() -> Autopilot:
    return Autopilot()


def preflight(autopilot: Autopilot, clock: Clock) -> Preflight:
    return Preflight(autopilot, lambda: clock.time, lambda: clock.time)  # type: ignore[arg-type]  # a link by hand


def test_it_is_given_the_mission_home_and_auto_in_order(autopilot: Autopilot, clock: Clock) -> None:
    clock.go_through(preflight(autopilot, clock).prepare(MISSION))
    assert [(item.seq, item.x, item.z) for item in autopilot.received] == [
        (0, 365000000, 300.0), (1, 365100000, 500.0), (2, 365200000, 500.0), (3, 365300000, 500.0)
    ]  # fmt: skip
    assert autopilot.commands()[-3:] == [179, 400, 176]
    home, arm, mode = autopilot.sent[-3:]
    assert (home.x, home.y, home.z, home.frame) == (365000000, -842000000, 300.0, 0)
    assert (arm.param1, arm.param2) == (1.0, 21196.0)
    assert mode.param2 == 10.0


def test_an_upload_before_there_is_space_is_offered_again(autopilot: Autopilot, clock: Clock) -> None:
    autopilot.results = [mavlink.MAV_MISSION_NO_SPACE, mavlink.MAV_MISSION_NO_SPACE, mavlink.MAV_MISSION_ACCEPTED]
    clock.go_through(preflight(autopilot, clock).prepare(MISSION))
    assert sum(message.get_type() == "MISSION_COUNT" for message in autopilot.sent) == 3
    assert len(autopilot.received) == 4
    assert 2.0 < clock.time < 4.0


def test_space_that_never_comes_is_a_refusal(autopilot: Autopilot, clock: Clock) -> None:
    autopilot.results = [mavlink.MAV_MISSION_NO_SPACE] * 100
    with pytest.raises(FlightError, match=r"refused the mission at item 3 \(NAV_WAYPOINT\): MAV_MISSION_NO_SPACE"):
        clock.go_through(preflight(autopilot, clock).prepare(MISSION))
    assert 30.0 < clock.time < 35.0


def test_an_estimator_without_a_place_is_waited_for_a_minute(autopilot: Autopilot, clock: Clock) -> None:
    # All but the place above the sea, then all, but without satellites.
    for flags in (EKF_GOOD & ~mavlink.ESTIMATOR_POS_VERT_ABS, EKF_GOOD | mavlink.ESTIMATOR_CONST_POS_MODE):
        autopilot.news.ekf, started = flags, clock.time
        with pytest.raises(FlightError, match=r"did not come to know where it is \(EKF\) within 60 s"):
            clock.go_through(preflight(autopilot, clock).prepare(MISSION))
        assert clock.time - started == pytest.approx(60.0, abs=0.3)


@pytest.mark.parametrize(("command", "said"), [(179, "home"), (400, "arming"), (176, "AUTO")])
def test_what_is_refused_is_named(autopilot: Autopilot, clock: Clock, command: int, said: str) -> None:
    autopilot.accepts = lambda asked: mavlink.MAV_RESULT_DENIED if asked == command else mavlink.MAV_RESULT_ACCEPTED
    autopilot.news.texts.append("not today")
    with pytest.raises(FlightError, match=rf"refused {said} \(.*\) within 5 s; it last said: not today"):
        clock.go_through(preflight(autopilot, clock).prepare(MISSION))


def test_it_is_met_by_its_parameters_those_it_does_not_have_left_out(autopilot: Autopilot, clock: Clock) -> None:
    autopilot.has = {f"P{k}": float(k) for k in range(25)}
    names = [*autopilot.has, "NO_SUCH"]
    clock.go_through(preflight(autopilot, clock).meet(names))
    assert autopilot.news.parameters == autopilot.has
    assert mavlink.MAV_CMD_DO_SEND_BANNER in autopilot.commands()


@pytest.mark.parametrize(
    ("vehicle", "said"), [(2, "is no ArduPlane: .* type 2; 1, a fixed"), (None, "said nothing over MAV")]
)
def test_who_is_no_plane_or_says_nothing_is_named(
    autopilot: Autopilot, clock: Clock, vehicle: int | None, said: str
) -> None:
    autopilot.news.vehicle = vehicle
    with pytest.raises(FlightError, match=said):
        clock.go_through(preflight(autopilot, clock).meet([]))


def test_a_version_without_a_name_is_its_number() -> None:
    assert version_text(["Barometer ready"], 0x04060000) == "ArduPlane 4.6.0"
    assert version_text([], None) == "ArduPlane, version unknown"


def test_time_that_flies_is_no_reason_to_give_up(autopilot: Autopilot) -> None:
    # A hundred times as fast as the clock: its answer comes after 2 s of its own time, 0.02 s by the clock.
    clock = Clock()
    autopilot.has, names = {"LATE": 1.0}, ["LATE"]
    talk = Preflight(autopilot, lambda: clock.time, lambda: 0.01 * clock.time).meet(names)  # type: ignore[arg-type]  # a link by hand
    autopilot.has = {}
    for _ in talk:
        clock.time += 0.1
        if clock.time > 2.0:
            autopilot.news.parameters["LATE"] = 1.0
    assert autopilot.news.parameters == {"LATE": 1.0}
    assert clock.time < 3.0
