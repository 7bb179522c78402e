"""What a data sheet is made into, against plain sums, and what is refused."""

import math
from dataclasses import replace

import numpy as np
import pytest

from aircraft.data_sheet import RANGES, STALL_RATIO_RANGE, DataSheet, check_sheet, elliptic_slope, size_aircraft
from aircraft.propulsion import ElectricMotor, FuelEngine
from world.errors import FlightError

FOAM = DataSheet(mass=2.1, span=1.6, cruise=15.0, stall=10.0)
G = 9.80665


def test_the_wing_carries_the_mass_at_the_stall() -> None:
    for layout, lift in (("tail", 1.25), ("wing", 1.05)):
        made = size_aircraft(replace(FOAM, layout=layout))
        assert made.numbers.area == pytest.approx(2.1 * G / (0.5 * 1.225 * 100.0 * lift), rel=1e-9)
        aero = made.numbers.aero
        # With the elevator at 22 degrees up the lift is that, and the moment 0.
        alpha = (lift - aero.lift_0 + aero.lift_elevator * math.radians(22.0)) / aero.lift_alpha
        moment = aero.pitch_0 + aero.pitch_alpha * alpha - aero.pitch_elevator * math.radians(22.0)
        assert moment == pytest.approx(0.0, abs=1e-9)
        assert aero.stall_alpha > alpha


def test_level_at_cruise_it_stands_as_it_is_rigged() -> None:
    aero = size_aircraft(FOAM).numbers.aero
    lift = 2.1 * G / (0.5 * 1.1673 * 225.0 * size_aircraft(FOAM).numbers.area)
    assert aero.lift_0 + 0.05 * aero.lift_alpha - 0.035 * aero.lift_elevator == pytest.approx(lift)
    assert aero.pitch_0 + 0.05 * aero.pitch_alpha - 0.035 * aero.pitch_elevator == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize(
    "sheet",
    [
        FOAM,
        replace(FOAM, layout="wing", climb=math.radians(9.0), top=19.0),
        replace(FOAM, propeller=(0.28, 0.15)),
        replace(FOAM, volts=14.8, motor=900.0),
        replace(FOAM, fuel=0.3, climb=math.radians(14.0), top=26.0),
        replace(FOAM, fuel=0.3, climb=math.radians(9.0)),
    ],
)
def test_thrust_is_what_climb_and_top_speed_take(sheet: DataSheet) -> None:
    made = size_aircraft(check_sheet(sheet))
    numbers, motor = made.numbers, made.numbers.propulsion
    assert isinstance(motor, ElectricMotor | FuelEngine)

    def drag(speed: float) -> float:
        pressure = 0.5 * 1.1673 * speed**2 * numbers.area
        lift = 2.1 * G / pressure
        return pressure * (numbers.aero.drag_min + numbers.aero.drag_lift * lift**2)

    climb = sheet.climb or math.radians(12.0)
    assert motor.thrust(1.0, 15.0, 1.1673) == pytest.approx(drag(15.0) + 2.1 * G * math.sin(climb), rel=1e-6)
    # An engine's torque alone cannot meet both: the top speed follows from the climb where it is not stated.
    top = sheet.top or (made.sheet.top if sheet.fuel else 1.65 * 15.0)
    assert motor.thrust(1.0, top, 1.1673) == pytest.approx(drag(top), rel=1e-6)


def test_a_stated_motor_and_propeller_stay() -> None:
    made = size_aircraft(replace(FOAM, volts=11.1, motor=1000.0, propeller=(0.254, 0.127)))
    motor = made.numbers.propulsion
    assert isinstance(motor, ElectricMotor)
    assert motor.propeller.diameter == pytest.approx(0.254)
    assert motor.emf == pytest.approx(60.0 / (2.0 * math.pi * 1000.0))
    # It pulls no more where its pitch by its turns is the airspeed: at J of 5 by 10 inches.
    assert motor.propeller.zero_thrust_ratio == pytest.approx(0.5)
    pull = motor.thrust(1.0, 15.0, 1.1673)
    pressure = 0.5 * 1.1673 * 225.0 * made.numbers.area
    spare = pull - pressure * (made.numbers.aero.drag_min + made.numbers.aero.drag_lift * (2.1 * G / pressure) ** 2)
    assert made.sheet.climb == pytest.approx(math.asin(spare / (2.1 * G)), rel=1e-9)


@pytest.mark.parametrize("fuel", [0.0, 0.3])
def test_a_top_speed_alone_says_what_it_climbs(fuel: float) -> None:
    slow, fast = (size_aircraft(replace(FOAM, top=top, fuel=fuel)) for top in (18.0, 24.0))
    for made, top in ((slow, 18.0), (fast, 24.0)):
        motor = made.numbers.propulsion
        assert isinstance(motor, ElectricMotor | FuelEngine)
        pressure = 0.5 * 1.1673 * top**2 * made.numbers.area
        drag = pressure * (made.numbers.aero.drag_min + made.numbers.aero.drag_lift * (2.1 * G / pressure) ** 2)
        assert motor.thrust(1.0, top, 1.1673) == pytest.approx(drag, rel=1e-6)
        assert made.sheet.top == pytest.approx(top, rel=1e-6)
        assert "climb" in made.guessed
    assert slow.sheet.climb < fast.sheet.climb


def test_a_throttle_at_cruise_is_met() -> None:
    made = size_aircraft(replace(FOAM, trim_throttle=0.65))
    motor = made.numbers.propulsion
    assert isinstance(motor, ElectricMotor)
    pressure = 0.5 * 1.1673 * 225.0 * made.numbers.area
    drag = pressure * (made.numbers.aero.drag_min + made.numbers.aero.drag_lift * (2.1 * G / pressure) ** 2)
    assert motor.thrust(0.65, 15.0, 1.1673) == pytest.approx(drag, rel=1e-6)


@pytest.mark.parametrize("top", [0.0, 26.4])
def test_a_climb_at_less_throttle_is_kept_if_the_top_speed_is_free(top: float) -> None:
    """4 m/s at 16 m/s: a quarter of the weight and the drag, at three quarters of the throttle."""
    stated = DataSheet(1.45, 1.3, 16.0, 10.5, layout="wing", climb=math.asin(0.25), climb_throttle=0.75, top=top)
    made = size_aircraft(stated)
    motor, aero = made.numbers.propulsion, made.numbers.aero
    assert isinstance(motor, ElectricMotor)
    pressure = 0.5 * 1.1673 * 256.0 * made.numbers.area
    drag = pressure * (aero.drag_min + aero.drag_lift * (1.45 * G / pressure) ** 2)
    excess = (motor.thrust(0.75, 16.0, 1.1673) - drag) / (1.45 * G)
    assert made.sheet.climb <= math.radians(35.0) * 1.001
    assert made.climb_shortfall == pytest.approx(math.asin(0.25) - math.asin(excess), abs=1e-6)
    assert (made.climb_shortfall == 0.0) is (top == 0.0)


def test_a_sink_sets_the_drag_of_the_wing_and_its_idle_propeller() -> None:
    """1.5 m/s at 15 m/s: a tenth of the weight, which the idle propeller shares."""
    made = size_aircraft(replace(FOAM, sink=1.5))
    assert isinstance(made.numbers.propulsion, ElectricMotor)
    idle_drag = -made.numbers.propulsion.thrust(0.0, 15.0, 1.1673)
    assert idle_drag > 0.0
    pressure, angle = 0.5 * 1.1673 * 225.0 * made.numbers.area, math.asin(0.1)
    lift = 2.1 * G * math.cos(angle) / pressure
    drag = pressure * (made.numbers.aero.drag_min + made.numbers.aero.drag_lift * lift**2)
    assert drag + idle_drag == pytest.approx(2.1 * G * 0.1, rel=1e-6)


def test_drag_falls_with_the_reynolds_number_and_the_aspect_ratio() -> None:
    small, large = (
        size_aircraft(replace(FOAM, mass=m, span=s, cruise=v, stall=v / 1.5)).numbers
        for m, s, v in ((1.0, 1.2, 15.0), (20.0, 3.5, 25.0))
    )
    ratio = (25.0 * large.chord) / (15.0 * small.chord)
    aspects = (large.span / large.chord) / (small.span / small.chord)
    assert large.aero.drag_min / small.aero.drag_min == pytest.approx(ratio**-0.2 * aspects**-0.42)


def test_level_flight_takes_the_power_of_the_prior() -> None:
    """An efficiency of 0.75 / (1 + (2.1 / 1.32)^(-2/3)) = 0.433, and 3.2 W of avionics."""
    made = size_aircraft(FOAM)
    motor, aero = made.numbers.propulsion, made.numbers.aero
    assert isinstance(motor, ElectricMotor)
    pressure = 0.5 * 1.1673 * 225.0 * made.numbers.area
    drag = pressure * (aero.drag_min + aero.drag_lift * (2.1 * G / pressure) ** 2)
    throttles = np.linspace(0.3, 1.0, 2001)
    thrusts = [motor.thrust(throttle, 15.0, 1.1673) for throttle in throttles.tolist()]
    level = float(np.interp(drag, thrusts, throttles))
    assert motor.power(level, 15.0, 1.1673) == pytest.approx(drag * 15.0 / 0.433 + 3.2, rel=3e-3)


@pytest.mark.parametrize(
    "sheet",
    [
        # The SoLong, and the UX5 with the stall speed of its wing's best: real sheets that once had no model.
        DataSheet(12.7, 4.75, 13.0, 11.0, area=1.5, layout="vtail"),
        DataSheet(2.5, 1.0, 22.2, 10.6, area=0.34, layout="wing"),
    ],
)
def test_the_elevator_is_enough_for_all_speeds(sheet: DataSheet) -> None:
    """Within 0.9 of its stop of 25 degrees it holds zero lift, and the stall is within 0.33 rad."""
    aero = size_aircraft(check_sheet(sheet)).numbers.aero
    no_lift = -aero.lift_0 / aero.lift_alpha
    deflection = -(aero.pitch_0 + aero.pitch_alpha * no_lift) / aero.pitch_elevator
    assert abs(deflection) < 0.9 * math.radians(25.0) * 1.05
    lift = sheet.mass * G / (0.5 * 1.225 * sheet.stall**2 * sheet.area)
    stall = (lift - aero.lift_0 + aero.lift_elevator * math.radians(22.0)) / aero.lift_alpha
    assert stall < 0.33 + 1e-9


def test_a_stall_that_takes_too_steep_a_wing_is_refused_with_its_range() -> None:
    with pytest.raises(FlightError) as caught:
        size_aircraft(check_sheet(DataSheet(2.5, 1.0, 24.0, 9.5, area=0.34, layout="wing")))
    text = str(caught.value)
    assert text.startswith("stall 9.5 m/s: allowed ")
    lowest = float(text.split("allowed ")[1].split("..")[0])
    size_aircraft(check_sheet(DataSheet(2.5, 1.0, 24.0, lowest + 0.05, area=0.34, layout="wing")))
    with pytest.raises(FlightError):
        size_aircraft(check_sheet(DataSheet(2.5, 1.0, 24.0, lowest - 0.05, area=0.34, layout="wing")))


def test_a_fast_aircraft_has_the_climb_that_a_propeller_gives() -> None:
    """The eBee X flies 30 m/s at a cruise of 12.5: no propeller for that climbs only the usual 12 degrees."""
    made = size_aircraft(check_sheet(DataSheet(1.4, 1.16, 12.5, 7.8, area=0.351, top=30.0, layout="wing")))
    assert made.sheet.top == pytest.approx(30.0, rel=1e-6)
    assert math.radians(12.0) < made.sheet.climb <= math.radians(35.0) * 1.001


def test_the_slope_of_an_elliptic_wing() -> None:
    # Helmbold at an aspect ratio of 6: 2 pi 6 / (2 + sqrt(40)).
    assert elliptic_slope(6.0) == pytest.approx(37.6991 / 8.32456, rel=1e-4)


@pytest.mark.parametrize(
    ("changed", "told"),
    [
        ({"mass": 0.49}, "mass 0.49 kg: allowed 0.5..25 kg"),
        ({"mass": 25.01}, "mass 25.01 kg: allowed 0.5..25 kg"),
        ({"cruise": 7.9}, "cruise 7.9 m/s: allowed 8..45 m/s"),
        ({"stall": 13.06}, "stall 13.06 m/s: allowed 5.25..13.05 m/s at a cruise speed of 15 m/s"),
        ({"top": 15.7}, "top 15.7 m/s: allowed 15.75..37.5 m/s at a cruise speed of 15 m/s"),
        ({"climb": math.radians(36.0)}, "climb 36 degrees: allowed 2..35 degrees"),
        # 2.1 kg on 0.8 m2 at lift coefficients of 2.4 and 0.5; or areas for those at 10 m/s.
        (
            {"area": 0.8},
            "stall 10 m/s: allowed 4.18..9.17 m/s without flaps for 2.1 kg on 0.8 m2, or a wing area of 0.14..0.672",
        ),
        ({"span": 0.8}, "span 0.8 m: allowed 0.82..2.59 m with a wing of 0.269 m2"),
        ({"fuel": 1.3}, "fuel 1.3 kg: allowed up to 60 % of the mass, 1.26 kg"),
        ({"fuel": 0.3, "motor": 900.0}, "fuel 0.3 kg: cannot be combined with --motor"),
        ({"top": 15.9, "climb": math.radians(30.0)}, "climb 30 degrees: allowed about 2.."),
        ({"motor": 120.0, "volts": 7.4, "propeller": (0.2, 0.1)}, "motor 120 rpm per volt: allowed about "),
    ],
)
def test_what_is_no_small_aircraft_is_refused(changed: dict[str, float], told: str) -> None:
    with pytest.raises(FlightError) as caught:
        size_aircraft(check_sheet(replace(FOAM, **changed)))  # type: ignore[arg-type]
    assert told in str(caught.value)
    assert "\n" not in str(caught.value)
    assert caught.value.field


def refusal(sheet: DataSheet) -> str:
    """Return the message that refuses a sheet, or "" for one that is accepted."""
    try:
        check_sheet(sheet)
    except FlightError as error:
        return str(error)
    return ""


@pytest.mark.parametrize("field", RANGES)
@pytest.mark.parametrize("edge", [2, 3])
def test_both_edges_of_a_range_are_allowed(field: str, edge: int) -> None:
    _, unit, low, high, factor = RANGES[field]
    value = (low, high)[edge - 2]
    # Another number of the sheet may not go with it.
    assert f"allowed {low:g}..{high:g} {unit}" not in refusal(replace(FOAM, **{field: value * factor}))


def test_edges_that_depend_on_the_cruise_speed_are_allowed_as_printed() -> None:
    for cruise in range(9, 40):
        for share in STALL_RATIO_RANGE:
            stall = float(f"{share * cruise:.6g}")
            # The wing may not carry the mass at that speed, and `stall` alone has a range of its own.
            assert f"at a cruise speed of {cruise} m/s" not in refusal(DataSheet(2.1, 1.6, float(cruise), stall))
