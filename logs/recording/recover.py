"""Recover the readable part of an unfinished or damaged log as a new log that any MCAP reader opens.

The new log contains a note on the loss, so that it is always read as incomplete.
"""

import io
import json
from dataclasses import dataclass
from pathlib import Path

from logs.recording.mcap_reader import MAGIC, PARSE_ERRORS, Container, read_chunks
from logs.recording.mcap_writer import ContainerWriter
from logs.recording.reader import FlightLog, read_log
from logs.recording.recorder import PROFILE
from logs.recording.setup_attachments import RECOVERY_FILE, RESULT_FILE, VERDICT_FILE, media_type

RECOVERY_SCHEMA = "planfly.recovery/1"


@dataclass(frozen=True, slots=True)
class RecoveredLog:
    """Recovered log.

    data: bytes of the new file.
    log: flight that the new file contains.
    """

    data: bytes
    log: FlightLog


def recover_log(path: Path) -> RecoveredLog | None:
    """Build a new log from the part of a log before its first damage; return None for a complete log.

    Chunks and attachments before the damage are copied.  The result of the flight and the verdict are omitted, because
    they may refer to lost rows.  Raises LogError for a file without a flight, as `read_log` does.

    >>> import tempfile
    >>> from logs.recording.example_log import write_example_log
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = write_example_log(Path(folder) / "example.mcap")
    ...     complete = recover_log(path)
    ...     _ = path.write_bytes(path.read_bytes()[: path.stat().st_size * 3 // 4])
    ...     recovered = recover_log(path)
    >>> complete is None, recovered.log.complete, 0 < len(recovered.log.track) < 366
    (True, False, True)
    """
    log = read_log(path)
    if log.complete:
        return None
    # The attachments and the chunks that precede the first damage.
    container = Container()
    with path.open("rb") as log_file:
        log_file.seek(len(MAGIC))
        chunks = list(read_chunks(log_file, container))
    file = io.BytesIO()
    writer = ContainerWriter(file, PROFILE)
    for name, data in container.attachments.items():
        if name not in (RESULT_FILE, VERDICT_FILE, RECOVERY_FILE):
            media, stamp = container.media[name]
            writer.write_attachment(name, media, data, stamp)
    for chunk in chunks:
        try:
            writer.copy_chunk(chunk)
        except PARSE_ERRORS:
            # `read_log` stopped at this chunk, too.
            break
    note = {"schema": RECOVERY_SCHEMA, "lost": log.lost, "rows": len(log.track), "end_time_s": log.end_time}
    text = (json.dumps(note, indent=1) + "\n").encode()
    writer.write_attachment(RECOVERY_FILE, media_type(RECOVERY_FILE), text, writer.last_time)
    writer.write_end()
    return RecoveredLog(file.getvalue(), log)
