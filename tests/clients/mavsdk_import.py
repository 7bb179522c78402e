"""MAVSDK's mission importers, run as a program: files in, MISSION_ITEM_INT fields out, as JSON on standard output.

The importers want a vehicle's handle, so a thread plays a heartbeat; nothing else is sent.  MAVSDK is a C++ library in
this process, hence a process of its own.
"""

import json
import os
import random
import socket
import sys
import threading
import time

os.environ["MAVLINK20"] = "1"

from mavsdk import ComponentType, Configuration, Mavsdk
from mavsdk.plugins.mission_raw import MissionRaw
from pymavlink.dialects.v20 import common


def beat(port: int, stop: threading.Event) -> None:
    link = common.MAVLink(None, srcSystem=1, srcComponent=1)
    message = common.MAVLink_heartbeat_message(1, 12, 81, 0, 4, 3)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as out:
        while not stop.is_set():
            out.sendto(message.pack(link), ("127.0.0.1", port))
            time.sleep(0.1)


def main() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
        # Below the ports that systems hand out, one of which another test could be given in between.
        while True:
            port = random.SystemRandom().randrange(10_000, 30_000)
            try:
                free.bind(("127.0.0.1", port))
            except OSError:
                continue
            break
    sdk = Mavsdk(Configuration.create_with_component_type(ComponentType.GROUND_STATION))
    print(sdk.add_any_connection(f"udpin://127.0.0.1:{port}"), file=sys.stderr)
    stop = threading.Event()
    threading.Thread(target=beat, args=(port, stop), daemon=True).start()
    raw = MissionRaw(sdk.first_autopilot(120.0))
    out = []
    for name in sys.argv[1:]:
        reader = raw.import_qgroundcontrol_mission if name.endswith(".plan") else raw.import_mission_planner_mission
        data = reader(name)
        lists = (data.mission_items, data.geofence_items, data.rally_items)
        out.append([[[i.seq, i.frame, i.command, i.x, i.y, i.z] for i in items] for items in lists])
    print(json.dumps(out), flush=True)
    stop.set()
    # Its threads may outlive the library's own clean-up.
    os._exit(0)


main()
