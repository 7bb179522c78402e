from flight.simulation.field_source import Damage, FieldSource, Heights, RowFaults
from logs.verdict.field.field_summary import damage_text, heights_text, rows_text


def test_each_fault_of_rows_is_counted_by_name() -> None:
    faults = RowFaults(doubled=1, unordered=2, unusable=3, glitches=4, clock_jumps=(5.0, 6.0))
    assert rows_text(faults, 2) == (
        "2 gaps, 1 doubled, 2 out of order, 3 without a place, 4 glitches of position,"
        " 2 jumps of the clock (at 5.0 s, 6.0 s)"
    )


def test_each_datum_is_named() -> None:
    said = {
        datum: heights_text(FieldSource("a", "", "", heights=Heights("POS", datum)))
        for datum in ("amsl", "ellipsoid", "pressure", "unstated")
    }
    assert len(set(said.values())) == 4
    assert said["ellipsoid"] == "POS, above the WGS 84 ellipsoid"


def test_what_is_lost_is_told() -> None:
    assert damage_text(Damage(places=1, size=1200, unreadable=2)) == (
        "1 place in the file (1,200 bytes) cannot be read; 2 messages hold nothing that can be used"
    )
