"""What may vary."""

from planfly.campaigns.spread.quantities import BY_NAME, NAMES, QUANTITIES


def test_names_are_unlike_and_nominals_lie_in_their_range() -> None:
    assert len(set(NAMES)) == len(QUANTITIES)
    for one in QUANTITIES:
        assert one.low < one.nominal < one.high
    assert (BY_NAME["mass"].nominal, BY_NAME["wind_speed"].nominal) == (1.0, 0.0)
