"""The physics' end of the exchange: frames in order, the same frame told again, silence and other versions named."""

import socket
import struct
import threading
import time
from collections.abc import Iterator

import pytest

from flight.live import running_clock
from flight.real_autopilot import physics_port
from flight.real_autopilot.physics_port import PhysicsPort
from world.errors import FlightError


def packet(frame: int) -> bytes:
    return struct.pack("<HHI16H", 18458, 120, frame, *[1500] * 16)


@pytest.fixture
def port() -> Iterator[PhysicsPort]:
    opened = PhysicsPort()
    yield opened
    opened.close()


@pytest.fixture
def autopilot(port: PhysicsPort) -> Iterator[socket.socket]:
    opened = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    opened.connect(("127.0.0.1", port.port))
    opened.settimeout(5.0)
    yield opened
    opened.close()


def test_frames_are_taken_in_order_and_answered_to_their_sender(port: PhysicsPort, autopilot: socket.socket) -> None:
    for frame in (0, 1, 5):
        autopilot.send(packet(frame))
        assert port.receive().frame == frame
        port.answer(b"answer %d" % frame)
        assert autopilot.recv(100) == b"answer %d" % frame


def test_a_frame_that_is_asked_for_again_is_told_again_and_no_frame(
    port: PhysicsPort, autopilot: socket.socket
) -> None:
    autopilot.send(packet(3))
    port.receive()
    port.answer(b"the third")
    time.sleep(0.15)
    for frame in (3, 3, 4):
        autopilot.send(packet(frame))
    assert port.receive().frame == 4
    assert [autopilot.recv(100) for _ in range(3)] == [b"the third"] * 3


def test_what_was_asked_before_the_answer_came_has_had_it(port: PhysicsPort, autopilot: socket.socket) -> None:
    for frame in (3, 3, 3):
        autopilot.send(packet(frame))
    port.receive()
    port.answer(b"the third")
    autopilot.send(packet(4))
    assert port.receive().frame == 4
    port.answer(b"the fourth")
    assert [autopilot.recv(100) for _ in range(2)] == [b"the third", b"the fourth"]


def test_a_frame_that_was_before_is_a_new_beginning(port: PhysicsPort, autopilot: socket.socket) -> None:
    autopilot.send(packet(3))
    port.receive()
    autopilot.send(packet(2))
    with pytest.raises(FlightError, match="began anew in the air: frame 2 after frame 3"):
        port.receive()


def test_silence_ends_the_wait_and_not_sooner(port: PhysicsPort, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(physics_port, "SILENCE", 0.6)
    started = time.monotonic()
    with pytest.raises(FlightError, match="silent for 1 s; ended"):
        port.receive()
    assert 0.6 < time.monotonic() - started < 2.0


def test_a_sleeping_laptop_is_no_silence(port: PhysicsPort, monkeypatch: pytest.MonkeyPatch) -> None:
    """Its clock leaps by an hour in the middle of a wait: the program, which slept too, is still waited for."""
    leap = 0.0
    real = time.monotonic
    monkeypatch.setattr(running_clock.time, "monotonic", lambda: real() + leap)
    monkeypatch.setattr(physics_port, "SILENCE", 1.6)
    looks = 0

    def watch() -> None:
        nonlocal leap, looks
        looks += 1
        leap = 3600.0 if looks >= 2 else 0.0

    fresh = PhysicsPort()
    fresh.watch = watch
    with pytest.raises(FlightError, match="silent"):
        fresh.receive()
    fresh.close()
    # A look is a quarter of a second, and the leap counts as one second at most.
    assert looks >= 4


def test_the_same_question_without_end_is_no_understanding(
    port: PhysicsPort, autopilot: socket.socket, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(physics_port, "SILENCE", 0.5)
    autopilot.send(packet(7))
    port.receive()
    port.answer(b"what it does not understand")
    over = threading.Event()

    def ask() -> None:
        while not over.wait(0.05):
            autopilot.send(packet(7))

    asking = threading.Thread(target=ask)
    asking.start()
    try:
        with pytest.raises(FlightError, match="does not understand the physics it is sent: asked for frame 7 again"):
            port.receive()
    finally:
        over.set()
        asking.join()


def test_a_wait_watches_the_program(port: PhysicsPort) -> None:
    def gone() -> None:
        raise FlightError("ended")

    port.watch = gone
    with pytest.raises(FlightError, match="ended"):
        port.receive()
