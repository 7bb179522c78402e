import numpy as np
from pymavlink.dialects.v20 import ardupilotmega as dialect

from logs.field_logs.readers.telemetry_rows import SystemMessages

link = dialect.MAVLink(None)


def attitude(millis: int) -> dialect.MAVLink_attitude_message:
    return link.attitude_encode(millis, 0.1, 0.2, 0.3, 0.0, 0.0, 0.0)


def test_rows_hold_their_numbers_and_fields() -> None:
    found = SystemMessages()
    found.add(1000.0, attitude(500))
    found.add(1000.5, link.heartbeat_encode(1, 3, 81, 10, 4))
    found.add(1001.0, attitude(1500))
    assert np.allclose(found.table("ATTITUDE"), [[0, 0.1, 0.2, 0.3], [2, 0.1, 0.2, 0.3]])
    assert [number for number, _ in found.named("HEARTBEAT")] == [1]
    assert len(found.table("WIND")) == 0


def test_a_message_without_a_time_of_its_own_comes_as_much_later_as_it_was_received() -> None:
    found = SystemMessages()
    found.add(1000.0, attitude(500))
    found.add(1000.25, link.heartbeat_encode(1, 3, 81, 10, 4))
    clock = found.boot_times()
    assert clock.offset == 999.5
    assert clock.time.tolist() == [0.5, 0.75]
