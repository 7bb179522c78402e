"""The options of commands that talk to ground stations, and how they are ended."""

import argparse
import contextlib
import ipaddress
import signal
from collections.abc import Iterator
from pathlib import Path
from types import FrameType

from flight.live.link import Access, check_access
from flight.live.signing import read_key
from world.errors import FlightError


class Stopped:
    """Whether a signal has asked the command to end."""

    def __init__(self) -> None:
        self._asked = False

    def __call__(self) -> bool:
        """Say whether to stop."""
        return self._asked

    def ask(self, _number: int, _frame: FrameType | None) -> None:
        """Handle the signal."""
        self._asked = True


@contextlib.contextmanager
def stop_signals() -> Iterator[Stopped]:
    """Turn SIGINT and SIGTERM into a question, so that logs are closed in order."""
    stopped = Stopped()
    kept = {number: signal.signal(number, stopped.ask) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield stopped
    finally:
        for number, handler in kept.items():
            signal.signal(number, handler)


def link_access(args: argparse.Namespace) -> Access:
    """Who may talk to us, from the command line.  Raises FlightError or PlanflyError."""
    allowed = frozenset(_ip("--allow", part.strip()) for part in (args.allow or "").split(",") if part.strip())
    key = read_key(Path(args.sign_key)) if args.sign_key else None
    access = Access(
        _address("--bind", args.bind), tuple(_address("--to", text) for text in args.to.split(",")), allowed, key
    )
    check_access(access)
    return access


def _address(option: str, text: str) -> tuple[str, int]:
    host, colon, port = text.strip().rpartition(":")
    if not colon and port.isdigit():
        raise FlightError.of_option(option, text, f"IP:PORT is expected, such as 127.0.0.1:{port}")
    if not port.isdigit() or not 0 <= int(port) <= 65535:
        raise FlightError.of_option(option, text, "IP:PORT is expected, with a port 0..65535")
    return _ip(option, host.strip("[]")), int(port)


def _ip(option: str, text: str) -> str:
    try:
        return str(ipaddress.ip_address(text))
    except ValueError as error:
        raise FlightError.of_option(option, text, "an IP address is expected") from error
