"""What an autopilot's messages tell, and what comes of a connection that closes."""

import socket
from collections.abc import Iterator
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from flight.autopilots.sitl.link import AutopilotLink, TcpLink


class Program:
    """The other end."""

    def __init__(self, port: int) -> None:
        self.socket = socket.create_connection(("127.0.0.1", port))
        self.socket.settimeout(5.0)
        self.mav = mavlink.MAVLink(None, 1, 1)

    def say(self, *messages: Any) -> None:
        self.socket.sendall(b"".join(message.pack(self.mav) for message in messages))


@pytest.fixture
def link() -> Iterator[AutopilotLink]:
    opened = TcpLink()
    yield opened
    opened.close()


@pytest.fixture
def program(link: AutopilotLink) -> Iterator[Program]:
    opened = Program(link.port)
    yield opened
    opened.socket.close()


def test_news_are_what_the_messages_tell(link: AutopilotLink, program: Program) -> None:
    program.say(
        mavlink.MAVLink_heartbeat_message(1, 3, 1 | 128, 10, 4, 3),
        mavlink.MAVLink_ekf_status_report_message(831, 0, 0, 0, 0, 0),
        mavlink.MAVLink_mission_current_message(7),
        mavlink.MAVLink_statustext_message(6, b"first"),
        mavlink.MAVLink_statustext_message(6, b"second"),
        mavlink.MAVLink_param_value_message(b"WP_RADIUS", 90.0, 9, 1, 0),
        mavlink.MAVLink_command_ack_message(400, 4),
        mavlink.MAVLink_mission_request_int_message(255, 190, 3),
        mavlink.MAVLink_mission_ack_message(255, 190, 13),
        mavlink.MAVLink_scaled_imu2_message(0, 0, 0, 0, 0, 0, 0, 0, 0, 0),
    )
    link.poll()
    reported = link.reported
    assert (reported.vehicle, reported.mode, reported.armed, reported.ekf, reported.mission_item) == (
        1,
        10,
        True,
        831,
        7,
    )
    assert (reported.texts, reported.parameters, reported.acknowledged) == (
        ["first", "second"],
        {"WP_RADIUS": 90.0},
        {400: 4},
    )
    assert (reported.requested, reported.mission_result) == (3, 13)


def test_a_heartbeat_of_a_component_tells_nothing_of_the_vehicle(link: AutopilotLink, program: Program) -> None:
    program.mav.srcComponent = 154
    program.say(mavlink.MAVLink_heartbeat_message(26, 8, 0, 0, 4, 3))
    link.poll()
    assert link.reported.vehicle is None


def test_bytes_that_are_no_message_are_passed_over(link: AutopilotLink, program: Program) -> None:
    program.socket.sendall(b"\x00garbage")
    program.say(mavlink.MAVLink_heartbeat_message(1, 3, 1, 5, 4, 3))
    link.poll()
    assert link.reported.mode == 5


def test_what_is_sent_arrives(link: AutopilotLink, program: Program) -> None:
    link.poll()
    link.send(mavlink.MAVLink_param_request_read_message(1, 1, b"WP_RADIUS", -1))
    (message,) = mavlink.MAVLink(None).parse_buffer(program.socket.recv(1000))
    assert (message.get_type(), message.param_id, message.get_srcSystem()) == ("PARAM_REQUEST_READ", "WP_RADIUS", 255)


def test_nobody_there_is_no_error(link: AutopilotLink) -> None:
    link.poll()
    link.send(mavlink.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3))
    assert link.reported.vehicle is None


def test_a_closed_connection_is_silent(link: AutopilotLink, program: Program) -> None:
    link.poll()
    program.socket.close()
    for _ in range(3):
        link.poll()
        link.send(mavlink.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3))
    assert link.reported.vehicle is None
