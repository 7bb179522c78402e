"""Who may talk to a vehicle, from the command line, and how its command is ended."""

import argparse
import os
import signal

import pytest

from planfly.terminal.link_options import link_access, stop_signals
from world.errors import FlightError


def options(**changes: str | None) -> argparse.Namespace:
    return argparse.Namespace(
        **({"bind": "127.0.0.1:14580", "to": "127.0.0.1:14550", "allow": None, "sign_key": None} | changes)
    )


def test_addresses_are_split_and_normalised() -> None:
    access = link_access(options(bind="0.0.0.0:0", to="127.0.0.1:14550, [::1]:65535", allow="192.168.1.7, 10.0.0.2,"))
    assert access.bind == ("0.0.0.0", 0)
    assert access.to == (("127.0.0.1", 14550), ("::1", 65535))
    assert access.allowed == {"192.168.1.7", "10.0.0.2"}
    assert access.key is None


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"bind": "127.0.0.1"}, "--bind 127.0.0.1: IP:PORT is expected"),
        ({"bind": "127.0.0.1:65536"}, "--bind 127.0.0.1:65536: IP:PORT is expected"),
        ({"to": "127.0.0.1:14550,"}, "--to : IP:PORT is expected"),
        ({"to": "14550"}, "--to 14550: IP:PORT is expected, such as 127.0.0.1:14550"),
        ({"to": "localhost:14550"}, "--to localhost: an IP address is expected"),
        ({"allow": "me"}, "--allow me: an IP address is expected"),
        # The link's own rule: nobody beyond this machine without a key or a list.
        ({"bind": "0.0.0.0:14580"}, "--bind 0.0.0.0:14580: beyond this machine"),
    ],
)
def test_what_is_no_address_names_its_option(changes: dict[str, str], message: str) -> None:
    with pytest.raises(FlightError) as caught:
        link_access(options(**changes))
    assert str(caught.value).startswith(message)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_asks_to_stop_and_its_handler_comes_back(number: signal.Signals) -> None:
    before = signal.getsignal(number)
    with stop_signals() as stopped:
        assert not stopped()
        os.kill(os.getpid(), number)
        assert stopped()
    assert signal.getsignal(number) is before
    with pytest.raises(RuntimeError, match="inside"), stop_signals():
        raise RuntimeError("inside")
    assert signal.getsignal(number) is before
