"""State messages are whole rows of the track to readers that know only the schema in the file."""

from pathlib import Path

from flight.simulation.track import Track
from logs.recording.state_channel import EPOCH_NS
from tests.logs.mcap_messages import messages


def test_an_independent_reader_finds_every_row_with_its_values(log_file: Path, track: Track) -> None:
    rows = messages(log_file)["/state"]
    assert len(rows) == len(track)
    state = [row for _, row in rows]
    assert [row.row for row in state] == list(range(len(track)))
    assert [row.time_s for row in state] == track.time.tolist()
    assert [row.up_amsl_m for row in state] == track.position[:, 2].tolist()
    assert [row.north_m for row in state] == track.position[:, 1].tolist()
    assert [row.velocity_up_mps for row in state] == track.velocity[:, 2].tolist()
    assert [row.yaw_rate_rad_per_s for row in state] == track.rates[:, 2].tolist()
    assert [row.beta_rad for row in state] == track.flow[:, 1].tolist()
    assert [row.rudder_rad for row in state] == track.controls[:, 2].tolist()
    assert [row.throttle_command_fraction for row in state] == track.commands[:, 3].tolist()
    assert [row.leg_index for row in state] == track.leg.tolist()
    assert [row.clearance_seen_m for row in state] == track.clearance.tolist()
    for message, row in rows:
        assert message.log_time == EPOCH_NS + round(row.time_s * 1e9)


def test_every_state_field_is_filled_and_none_is_left_over(log_file: Path) -> None:
    _, row = messages(log_file)["/state"][100]
    names = {field.name for field, _ in row.ListFields()}
    # The first leg's number is 0.
    assert {field.name for field in row.DESCRIPTOR.fields} - names == {"leg_index"}
    assert len(row.SerializeToString()) <= len(messages(log_file)["/state"][100][0].data)
