from logs.field_logs.example_raw_log import example_raw_log
from logs.field_logs.raw_log import COLUMNS


def test_each_series_has_a_column_for_each_name() -> None:
    for name, series in example_raw_log().series.items():
        assert series.values.shape == (len(series.time), len(COLUMNS[name]))
