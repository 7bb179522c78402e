import pytest

from planfly.identification.wide_quantities import wide_quantities


@pytest.mark.parametrize(("half", "titles"), [(0.09, []), (0.11, ["sink at idle"])])
def test_a_sink_is_wide_from_a_tenth_either_side(half: float, titles: list[str]) -> None:
    sink = (7.0 * (1.0 - half), 7.0, 7.0 * (1.0 + half))
    found = wide_quantities(sink, (500.0, 500.0, 500.0), with_current=True)
    assert [one.title for one in found] == titles
    assert all("glides of 20 s at idle" in one.text for one in found)


@pytest.mark.parametrize(("half", "count"), [(0.19, 0), (0.21, 1)])
def test_power_is_wide_from_a_fifth_and_asks_for_the_current(half: float, count: int) -> None:
    power = (500.0 * (1.0 - half), 500.0, 500.0 * (1.0 + half))
    found = wide_quantities((7.0, 7.0, 7.0), power, with_current=False)
    assert len(found) == count
    assert all(one.half == pytest.approx(half) for one in found)
    assert all(
        "known only to ±21 %; to improve this, fly with the battery's current logged (BAT)" in one.text for one in found
    )
    with_it = wide_quantities((7.0, 7.0, 7.0), power, with_current=True)
    assert all("level runs of 20 s at several speeds" in one.text for one in with_it)
