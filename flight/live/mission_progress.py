"""How far a flight is along its mission, in the numbers that stations have for its items."""

from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from flight.live.arming import ArmingState
from flight.live.downlink import Downlink
from flight.live.mavlink_items import MissionType
from flight.live.mission_server import MissionServer
from flight.live.telemetry import ACTIVE, COMPLETE, Status, telemetry_message


class MissionProgress:
    """Tells stations which item is flown to and which were reached.

    shift: what to add to an item's seq for the station's number.
    first: the station's number of the item that the next flight starts at; 0 for the whole mission.
    """

    def __init__(self, server: MissionServer, arming: ArmingState, status: Status, down: Downlink) -> None:
        """Start with a mission that is flown as a whole, from its first item."""
        self._server = server
        self._arming = arming
        self._status = status
        self._down = down
        self._leg = -1
        self.shift = 0
        self.first = 0

    def started(self) -> None:
        """A flight begins."""
        self._leg = -1

    def at_start(self) -> None:
        """The item that a mission that is not being flown starts with."""
        self._status.current = self.first or (self._item(0) if self._arming.judged is not None else 0)

    def refresh(self) -> None:
        """Bring what the status says of the mission up to date."""
        items = self._server.lists[MissionType.MISSION]
        self._status.total = max(0, len(items) - 1) if items else 0
        if self._arming.mission_state not in (ACTIVE, COMPLETE):
            self.at_start()

    def on_leg(self, leg: int) -> None:
        """Send the waypoints that were reached since the last snapshot."""
        if leg == self._leg or leg < 0:
            return
        for waypoint in range(max(0, self._leg + 1), leg + 1):
            self._reached(waypoint)
        self._leg = leg
        self._status.current = self._item(leg + 1)
        self.send_current()

    def completed(self) -> None:
        """The last waypoint is reached."""
        self._reached(len(self._items()) - 1)

    def send_current(self) -> None:
        """Send the item that is flown to."""
        message: Any = telemetry_message("MISSION_CURRENT", self._status)
        self._down.send_to_all(message)

    def _reached(self, waypoint: int) -> None:
        items = self._items()
        if 0 <= waypoint < len(items) and items[waypoint] >= 0:
            self._down.send_to_all(mavlink.MAVLink_mission_item_reached_message(self._item(waypoint)))

    def _items(self) -> tuple[int, ...]:
        """Seq of the item at each waypoint of the judged mission, -1 for none."""
        return () if self._arming.judged is None else self._arming.judged.items

    def _item(self, waypoint: int) -> int:
        """Station's number of the item at a waypoint, or of the next that is one."""
        items = self._items()
        following = [item for item in items[waypoint:] if item >= 0] or [item for item in items if item >= 0][-1:]
        return following[0] + self.shift if following else 0
