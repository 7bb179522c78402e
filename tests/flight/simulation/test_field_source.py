from flight.simulation.field_source import Damage, FieldSource


def test_a_cut_end_is_no_loss() -> None:
    """Every log that ends with the power ends within a message."""
    assert not Damage(cut=True).lossy
    assert Damage(places=1).lossy
    assert Damage(unreadable=1).lossy


def test_a_source_holds_nothing_that_is_not_stated() -> None:
    source = FieldSource("a.BIN", "", "")
    assert (source.holds, source.stretches, source.heights.datum, source.aircraft_known) == ((), (), "unstated", False)
