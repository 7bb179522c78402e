from logs.field_logs.readers.vehicle_modes import plane_mode, px4_mode, px4_state


def test_auto_alone_follows_the_mission() -> None:
    assert [number for number in range(30) if plane_mode(number)[1]] == [10]
    assert plane_mode(99) == ("mode 99", False)


def test_of_px4_the_mission_state_alone_follows_it() -> None:
    assert [number for number in range(30) if px4_state(number)[1]] == [3]
    assert px4_mode(4 << 24 | 4 << 16) == ("MISSION", True)
    assert px4_mode(5 << 24 | 4 << 16) == ("RTL", False)
