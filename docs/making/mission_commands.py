"""The table of the mission commands that ArduPlane and PX4 take, and what becomes of each."""

from flight.mission.commands import SUPPORT


def command_table() -> str:
    """Return a row for each command that one of the autopilots takes in a mission."""
    rows = [
        f"| {int(command)} | {command.name} | {one.arduplane} | {one.px4} | {one.reason.replace('|', '/')} |"
        for command, one in sorted(SUPPORT.items())
    ]
    return "\n".join(["| number | command | ArduPlane | PX4 | |", "|---|---|---|---|---|", *rows])
