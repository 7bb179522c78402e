"""Start PX4's program, with the files in its folder and its command line."""

import shutil
from collections.abc import Callable, Mapping
from pathlib import Path

from flight.autopilots.sitl.exchange import LOOPBACK
from flight.autopilots.sitl.process import Launch
from world.errors import FlightError

# Folder of the start-up files, next to the program or one folder above it, as a build leaves it.
STARTUP = "etc"
# The script in that folder that starts the program.
_STARTUP_SCRIPT = Path("init.d-posix", "rcS")
# Number of planfly's airframe, among PX4's own.
_AIRFRAME_ID = 22000
# Last line of PX4's start-up script.
STARTED = "Startup script returned successfully"
# Folder of PX4's temporary files, which does not depend on the system's settings.
_TEMPORARY_FOLDER = Path("/tmp")
# Prefixes of these files, before the number of the instance.
_TEMPORARY_PREFIXES = ("px4_lock-", "px4-sock-")


def startup_folder(program: Path) -> Path | None:
    """Return the folder of a program's start-up files, or None without one."""
    folder = program.resolve().parent
    candidates = (folder / STARTUP, folder.parent / STARTUP)
    return next((candidate for candidate in candidates if (candidate / _STARTUP_SCRIPT).is_file()), None)


def px4_launch(
    binary: Path, parameters: Mapping[str, float], simulator_port: int, own_port: int, link_port: int
) -> Callable[[Path], Launch]:
    """Return a function that prepares a folder for the PX4 program and returns its command line.

    parameters: values by name.
    simulator_port: port on this machine of the physics (TCP).
    own_port: port on which PX4 receives MAVLink (UDP).
    link_port: port to which PX4 sends MAVLink (UDP).

    Raises FlightError if the program has no start-up files.
    """
    source = startup_folder(binary)
    if source is None:
        allowed = f"expected PX4's start-up files next to the program, in the folder {STARTUP} of its build"
        raise FlightError(f"{binary}: {allowed}", file=binary, field=STARTUP, allowed=allowed)

    def prepare(folder: Path) -> Launch:
        """Write the start-up scripts into a folder, and return the command line of PX4."""
        scripts = Path(shutil.copytree(source, folder / STARTUP)) / "init.d-posix"
        lines = [
            ". ${R}etc/init.d/rc.fw_defaults",
            *(f"param set {parameter} {value:.9g}" for parameter, value in parameters.items()),
        ]
        _write_script(scripts / "airframes" / f"{_AIRFRAME_ID}_planfly", *lines)
        _write_script(
            scripts / "px4-rc.simulator",
            "param set MAV_SYS_ID 1",
            "param set IMU_INTEG_RATE 250",
            f"simulator_mavlink start -c {simulator_port}",
        )
        _write_script(
            scripts / "px4-rc.mavlink", f"mavlink start -x -u {own_port} -o {link_port} -t {LOOPBACK} -r 4000000 -f"
        )
        environment = {"PX4_SYS_AUTOSTART": str(_AIRFRAME_ID), "PX4_SIM_MODEL": "planfly"}
        # Each instance of PX4 on a machine needs its own number: the port number is unique.
        leftover_files = tuple(_TEMPORARY_FOLDER / f"{name}{simulator_port}" for name in _TEMPORARY_PREFIXES)
        return Launch(("-d", "-i", str(simulator_port), "-w", str(folder)), environment, "log/**/*.ulg", leftover_files)

    return prepare


def _write_script(file: Path, *lines: str) -> None:
    """Write a shell script of the given lines."""
    file.parent.mkdir(exist_ok=True)
    file.write_text("\n".join(("#!/bin/sh", *lines, "")), encoding="utf-8")
