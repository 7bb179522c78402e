"""What happens in flight stands in the log when it happens."""

from pathlib import Path

import numpy as np

from flight.simulation.flight_setup import FlightSetup
from flight.simulation.track import Track
from logs.recording.reader import read_log
from logs.recording.state_channel import EPOCH_NS
from tests.logs.made_flight import make_setup, make_track, record
from tests.logs.mcap_messages import messages


def noted(path: Path) -> list[tuple[float, int, str]]:
    found = messages(path)["/log"]
    return [((m.log_time - EPOCH_NS) / 1e9, said.level, said.message) for m, said in found if said.name == "flight"]


def test_legs_are_noted_at_the_row_that_begins_them(log_file: Path, track: Track) -> None:
    starts = [k for k in range(len(track)) if k == 0 or track.leg[k] != track.leg[k - 1]]
    legs = [(time, text) for time, _, text in noted(log_file) if text.startswith("leg ")]
    items = make_setup().route.items
    wanted = [
        (track.time[k], f"leg {leg}, to waypoint {leg + 1} (item {items[leg + 1]})")
        for k in starts
        for leg in [int(track.leg[k])]
    ]
    assert [text for _, text in legs] == [text for _, text in wanted]
    np.testing.assert_allclose([time for time, _ in legs], [time for time, _ in wanted], atol=1e-9)


def by_text(event: tuple[float, int, str]) -> str:
    return event[2]


def test_a_threat_is_noted_where_its_sphere_is_entered_and_left(
    log_file: Path, setup: FlightSetup, track: Track
) -> None:
    """To a fifth of a second, by the distance of each row."""
    threats = setup.scenario.threats
    told = [(time, level, text) for time, level, text in noted(log_file) if "range of" in text]
    wanted = []
    for radii, kind, level in ((threats.kill_radius, "missile", 3), (threats.detection_radius, "radar", 2)):
        for name, centre, radius in zip(threats.names, threats.position, radii, strict=True):
            inside = np.sqrt(((track.position - centre) ** 2).sum(axis=1)) < radius
            for k in np.flatnonzero(np.diff(inside.astype(int), prepend=0)).tolist():
                entered = bool(inside[k])
                text = f"{'inside' if entered else 'out of'} the {kind} range of {name}"
                wanted.append((float(track.time[k]), level if entered else 2, text))
    assert wanted
    told.sort(key=by_text)
    wanted.sort(key=by_text)
    assert [event[1:] for event in told] == [event[1:] for event in wanted]
    for (time, *_), (at, *_) in zip(told, wanted, strict=True):
        assert 0.0 <= time - at < 0.2


def test_they_do_not_hang_on_the_blocks_and_are_not_read_as_events(tmp_path: Path, setup: FlightSetup) -> None:
    track = make_track()
    one = record(tmp_path / "one.mcap", setup, track, rows_a_block=len(track))
    many = record(tmp_path / "many.mcap", setup, track, rows_a_block=7)
    assert one.read_bytes() == many.read_bytes()
    assert [event.text for event in read_log(one).events] == ["half way up", "arrived"]


def test_messages_stand_in_order_of_time(log_file: Path) -> None:
    times = [message.log_time for message, _ in messages(log_file)["/log"]]
    assert times == sorted(times)
