"""Messages and channels of a log are those that mcap's own reader finds."""

from pathlib import Path

from mcap.reader import make_reader

from logs.recording.messages import log_channels, log_messages


def test_every_message_is_given_as_it_was_written(log_file: Path) -> None:
    with log_file.open("rb") as file:
        found = [
            (channel.topic, message.log_time, message.data)
            for _, channel, message in make_reader(file).iter_messages(log_time_order=False)
        ]
    assert [(item.channel.topic, item.log_time, item.data) for item in log_messages(log_file)] == found


def test_the_first_chunk_declares_every_channel(log_file: Path) -> None:
    with log_file.open("rb") as file:
        summary = make_reader(file).get_summary()
    assert summary is not None
    schemas = {number: (schema.name, schema.encoding, schema.data) for number, schema in summary.schemas.items()}
    assert [
        (channel.topic, channel.encoding, (channel.schema, channel.schema_encoding, channel.schema_data))
        for channel in log_channels(log_file)
    ] == [
        (channel.topic, channel.message_encoding, schemas[channel.schema_id]) for channel in summary.channels.values()
    ]


def test_a_cut_log_gives_its_messages_up_to_the_cut(log_file: Path, tmp_path: Path) -> None:
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(log_file.read_bytes()[: log_file.stat().st_size * 3 // 4])
    whole, part = (list(log_messages(path)) for path in (log_file, cut))
    assert 0 < len(part) < len(whole)
    assert part == whole[: len(part)]
