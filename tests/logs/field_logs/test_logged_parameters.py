from dataclasses import replace

from logs.field_logs.example_raw_log import example_raw_log
from logs.field_logs.logged_parameters import logged_parameters


def parameters(**values: float):
    return logged_parameters(replace(example_raw_log(), parameters=values))


def test_older_names_and_units_are_taken() -> None:
    found, notes = parameters(TRIM_ARSPD_CM=1800.0, LIM_ROLL_CD=4500.0)
    assert found is not None
    assert (found.airspeed_cruise, found.by_origin("file")["ROLL_LIMIT_DEG"], notes) == (18.0, 45.0, ())


def test_what_is_not_allowed_is_told_and_the_default_taken() -> None:
    found, notes = parameters(WP_RADIUS=-5.0, NAVL1_PERIOD=20.0)
    assert found is not None
    assert (found.wp_radius, found.navl1_period) == (90.0, 20.0)
    assert notes == ("WP_RADIUS -5 of the log is not allowed: the default is taken",)


def test_a_least_beyond_its_most_gives_way() -> None:
    found, notes = parameters(AIRSPEED_MIN=30.0, AIRSPEED_MAX=20.0)
    assert found is not None
    assert (found.airspeed_min, found.airspeed_max) == (9.0, 22.0)
    assert notes[0].startswith("AIRSPEED_MIN 30 and AIRSPEED_MAX 20")


def test_a_log_without_parameters_says_that_defaults_are_taken() -> None:
    found, notes = parameters()
    assert found is not None
    assert notes == ("the log holds no parameters: ArduPlane's defaults are taken",)


def test_another_autopilot_has_none() -> None:
    assert logged_parameters(replace(example_raw_log(), program="PX4 v1.14.0")) == (None, ())
