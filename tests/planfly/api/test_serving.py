"""Who may talk to a vehicle, as a call states it."""

import pytest

from planfly.api.serving import link_access
from world.errors import FlightError

STATION, VEHICLE = "127.0.0.1:14550", "127.0.0.1:14580"


@pytest.mark.parametrize("to", ["127.0.0.1:14550, [::1]:65535", ["127.0.0.1:14550", "[::1]:65535"]])
def test_addresses_are_split_and_normalised(to: str | list[str]) -> None:
    access = link_access(to, "0.0.0.0:0", "192.168.1.7, 10.0.0.2,")
    assert access.bind == ("0.0.0.0", 0)
    assert access.to == (("127.0.0.1", 14550), ("::1", 65535))
    assert access.allowed == {"192.168.1.7", "10.0.0.2"}
    assert access.key is None


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ((STATION, "127.0.0.1"), "bind 127.0.0.1: expected IP:PORT"),
        ((STATION, "127.0.0.1:65536"), "bind 127.0.0.1:65536: expected IP:PORT"),
        ((f"{STATION},", VEHICLE), "to : expected IP:PORT"),
        (("14550", VEHICLE), "to 14550: expected IP:PORT, such as 127.0.0.1:14550"),
        (("localhost:14550", VEHICLE), "to localhost: expected an IP address"),
        ((STATION, VEHICLE, "me"), "allow me: expected an IP address"),
        # The link's own rule: nobody beyond this machine without a key or a list.
        ((STATION, "0.0.0.0:14580"), "bind 0.0.0.0:14580: other machines can reach this address"),
    ],
)
def test_what_is_no_address_names_its_argument(given: tuple[str, ...], message: str) -> None:
    with pytest.raises(FlightError) as caught:
        link_access(*given)
    assert str(caught.value).startswith(message)
    assert caught.value.field == message.partition(" ")[0]
