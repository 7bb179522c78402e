"""Serve a simulated MAVLink vehicle.

Ground stations connect to it to upload missions, arm and follow the flight.
"""

import ipaddress
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Unpack

from planfly.api.api_function import api_function
from planfly.arguments import check_arguments
from planfly.flight_options import MissionOptions
from planfly.kernel_units.unit_kernels import FLYING
from planfly.runtime.process_setup import end_repeated_call
from world.errors import FlightError, PlanflyError
from world.extras import requires_extra

if TYPE_CHECKING:
    from flight.live.link import Access


def _never_stop() -> bool:
    """Return False; default condition of a vehicle that is served until it is interrupted."""
    return False


def _ignore_message(_text: str) -> None:
    """Ignore a message of the served vehicle."""
    pass


@requires_extra("live", "serve needs")
@api_function(*FLYING)
def serve(
    mission: str | Path | None = None,
    *,
    to: str | Sequence[str] = "127.0.0.1:14550",
    bind: str = "127.0.0.1:14580",
    allow: str | Sequence[str] = (),
    sign_key: str | Path | None = None,
    speed: float = 1.0,
    log: str | Path = "runs/serve",
    stop: Callable[[], bool] = _never_stop,
    on_message: Callable[[str], None] = _ignore_message,
    **options: Unpack[MissionOptions],
) -> None:
    """Serve a MAVLink vehicle in a simulated world until ``stop`` returns True.

    Requires ``planfly[live]``.

    mission: the file of the first mission; None waits for an upload into the scenario that the options name.
    options: options of `planfly.fly`.
    to: addresses of ground stations, IP:PORT, one or several.  bind: address of the vehicle.
    allow: IP addresses of other machines that may connect.  sign_key: a file with a MAVLink signing key.
    speed: multiple of real time, 0.1 to 100.  log: the folder of the flight logs.
    stop: polled continuously.  on_message: called with one line for each event.

    A script must call this function under ``if __name__ == "__main__":``, because flight processes import the script.
    Raises a `planfly.PlanflyError` for bad input.
    """
    end_repeated_call()
    # Imported here: only this function needs MAVLink.
    from planfly.live.served_flights import ServeOptions, load_served_scenario
    from planfly.live.served_vehicle import serve_vehicle

    access = link_access(to, bind, allow, sign_key)
    check_arguments(served_speed=speed)
    serve_options = ServeOptions("" if mission is None else str(mission), speed, Path(log), options)
    flights = load_served_scenario(serve_options)
    if serve_options.logs.exists() and not serve_options.logs.is_dir():
        raise PlanflyError.of_argument("log", log, "is a file; expected a folder")
    serve_vehicle(access, serve_options, flights, stop, on_message)


# ----------------------------------------------------------------------
# Check the addresses that may access a vehicle.


def link_access(
    to: str | Sequence[str], bind: str, allow: str | Sequence[str] | None = (), sign_key: str | Path | None = None
) -> "Access":
    """Parse and check the addresses and the signing key of a MAVLink connection.

    Several addresses are a sequence, or separated by commas.  Raises FlightError or PlanflyError for invalid addresses.

    to: IP:PORT of each station.
    bind: IP:PORT of the vehicle.
    allow: IP addresses of stations on other machines.
    sign_key: a file with a MAVLink signing key.

    >>> link_access("127.0.0.1:14550", "127.0.0.1:0").to
    (('127.0.0.1', 14550),)
    """
    from flight.live.link import Access, check_access, read_key

    allowed = frozenset(_parse_ip("allow", part.strip()) for part in _split_addresses(allow or ()) if part.strip())
    key = read_key(Path(sign_key)) if sign_key else None
    access = Access(
        _parse_address("bind", bind), tuple(_parse_address("to", text) for text in _split_addresses(to)), allowed, key
    )
    check_access(access)
    return access


def _split_addresses(addresses: str | Sequence[str]) -> Sequence[str]:
    """Split a text of addresses at commas; a sequence is returned unchanged."""
    return addresses.split(",") if isinstance(addresses, str) else addresses


def _parse_address(argument: str, text: str) -> tuple[str, int]:
    """Parse an address IP:PORT.  Raises FlightError for invalid text.

    argument: name of the argument, for the message.
    """
    host, colon, port = text.strip().rpartition(":")
    if not colon and port.isdigit():
        raise FlightError.of_argument(argument, text, f"expected IP:PORT, such as 127.0.0.1:{port}")
    if not port.isdigit() or not 0 <= int(port) <= 65535:
        raise FlightError.of_argument(argument, text, "expected IP:PORT, with a port 0..65535")
    return _parse_ip(argument, host.strip("[]")), int(port)


def _parse_ip(argument: str, text: str) -> str:
    """Return an IP address in its normal form.  Raises FlightError for invalid text."""
    try:
        return str(ipaddress.ip_address(text))
    except ValueError as error:
        raise FlightError.of_argument(argument, text, "expected an IP address") from error
