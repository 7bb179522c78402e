"""Write the folders of published small aircraft in ``aircraft/``: model, gains, ArduPlane's parameters.

``python -m benchmarks.tuning.published_aircraft`` writes ``NAME.xml``, ``gains.toml``, ``ardupilot.parm`` and
``ardupilot.toml`` of each folder again, from the numbers here and from ``NAME.toml``.  The folders' READMEs name each
source.
"""

import math
from pathlib import Path

from aircraft.catalog import load_aircraft
from aircraft.model_writer import AeroCoefficients, ModelNumbers, model_xml
from aircraft.propulsion import ActuatorDisc, ShaftPower
from flight.dynamics.fdm import Fdm
from flight.guidance.model_gains import gains_from_model, gains_text
from planfly.workflow.data_sheets import arduplane_parameters_text, measure_performance, servo_text

# Beard and McLain, first edition, appendix E.1.  The table's drag due to elevator is linear (0.30 a radian) and would
# propel an aircraft that trims with its elevons up; it is left out, as is the table's drag due to angle of attack,
# which the book's parabola replaces.  With the table's Cn_beta of -0.0004 and Cn_r of -0.00434 only a rudder could hold
# a bank: the zero from ailerons to roll is at +0.55 rad/s.  Both are replaced by the values of the X8.
_ZAGI_ASPECT = 1.4224**2 / 0.2589
ZAGI = ModelNumbers(
    title="Zagi flying wing (Beard and McLain)",
    source="R. W. Beard and T. W. McLain, Small Unmanned Aircraft, first edition (2012), appendix E.1.",
    mass=1.56,
    area=0.2589,
    span=1.4224,
    chord=0.3302,
    inertia=(0.1147, 0.0576, 0.1712, 0.0015),
    aero=AeroCoefficients(
        lift_0=0.09167,
        lift_alpha=3.5016,
        lift_q=2.8932,
        lift_elevator=0.2724,
        drag_min=0.0254,
        drag_lift=1.0 / (math.pi * 0.9 * _ZAGI_ASPECT),
        pitch_0=-0.02338,
        pitch_alpha=-0.5675,
        pitch_q=-1.3990,
        pitch_elevator=-0.3254,
        side_beta=-0.07359,
        roll_beta=-0.02854,
        roll_p=-0.3209,
        roll_r=0.03066,
        roll_aileron=0.1682,
        yaw_beta=0.0283,
        yaw_p=-0.01297,
        yaw_r=-0.072,
        yaw_aileron=-0.00328,
        stall_alpha=0.4712,
        stall_sharpness=50.0,
    ),
    propulsion=ActuatorDisc(area=0.0314, coefficient=1.0, exit_speed=20.0, volts=11.1, efficiency=0.6),
    layout="wing",
    throw=(math.radians(35.0), math.radians(35.0), math.radians(1.0)),
)

# CD = 0.01970 + 0.07909 alpha + 1.05547 alpha^2 as a parabola in the lift of the angle of attack.
_X8_D0, _X8_D1, _X8_D2 = 0.01970001181915082, 0.07909146315766297, 1.0554699867680841
_X8_L0, _X8_LA = 0.08673556671610734, 4.020328244000679
X8 = ModelNumbers(
    title="Skywalker X8 flying wing (Gryte et al.)",
    source=(
        "K. Gryte, R. Hann, M. Alam, J. Rohac, T. A. Johansen, T. I. Fossen, Aerodynamic modeling of the Skywalker X8"
        " Fixed-Wing Unmanned Aerial Vehicle, ICUAS 2018; numbers of github.com/krisgry/x8, x8_param.mat."
    ),
    mass=3.364,
    area=0.75,
    span=2.1,
    chord=0.75 / 2.1,
    inertia=(0.335, 0.140, 0.400, 0.029),
    aero=AeroCoefficients(
        lift_0=_X8_L0,
        lift_alpha=_X8_LA,
        lift_q=3.87,
        lift_elevator=0.2780736201734713,
        drag_min=_X8_D0 - _X8_D1**2 / (4.0 * _X8_D2),
        drag_lift=_X8_D2 / _X8_LA**2,
        lift_at_least_drag=_X8_L0 - _X8_LA * _X8_D1 / (2.0 * _X8_D2),
        drag_elevator_2=0.06334739678180232,
        drag_beta_2=0.14781193079241584,
        pitch_0=0.02275,
        pitch_alpha=-0.4629,
        pitch_q=-1.3012370370370372,
        pitch_elevator=-0.2292,
        side_beta=-0.22387215700254048,
        side_p=-0.13735505263157893,
        side_r=0.08386876842105263,
        side_aileron=0.043276402502774876,
        roll_beta=-0.08489628639662417,
        roll_p=-0.404198,
        roll_r=0.0555206,
        roll_aileron=0.12018814125782745,
        yaw_beta=0.0283,
        yaw_p=0.004365511578947368,
        yaw_r=-0.072,
        yaw_aileron=-0.00339,
        stall_alpha=0.36,
        stall_sharpness=60.0,
    ),
    propulsion=ActuatorDisc(
        area=0.10178760197630929, coefficient=0.248, exit_speed=37.42, volts=14.8, efficiency=0.6, ducted=True
    ),
    layout="wing",
    throw=(math.radians(25.0), math.radians(25.0), math.radians(1.0)),
)

# Positive ailerons roll to the right in planfly, and to the left in the university's file.  The polynomial of its motor
# is the power at the shaft.
_ULTRASTICK_ASPECT = 1.27**2 / 0.3097
ULTRASTICK = ModelNumbers(
    title="Ultra Stick 25e (University of Minnesota)",
    source=(
        "University of Minnesota UAV Lab, UltraStick25e_config.m of github.com/UASLab/OpenFlight, aircraft Thor;"
        " A. Dorobantu, A. Murch, B. Mettler, G. Balas, Journal of Aircraft 50 (2013)."
    ),
    mass=1.959,
    area=0.3097,
    span=1.27,
    chord=0.25,
    inertia=(0.07151, 0.08636, 0.15364, 0.014),
    aero=AeroCoefficients(
        lift_0=0.1086,
        lift_alpha=4.58,
        lift_q=6.1639,
        lift_elevator=0.0983,
        drag_min=0.0434,
        drag_lift=1.0 / (math.pi * 0.75 * _ULTRASTICK_ASPECT),
        lift_at_least_drag=0.23,
        drag_elevator=0.0135,
        pitch_0=-0.0278,
        pitch_alpha=-0.7230,
        pitch_q=-13.5664,
        pitch_elevator=-0.8488,
        side_beta=-0.4889,
        side_p=-0.0375,
        side_r=0.1500,
        side_rudder=0.1913,
        roll_beta=-0.0545,
        roll_p=-0.4496,
        roll_r=0.1086,
        roll_aileron=0.1646,
        roll_rudder=0.0115,
        yaw_beta=0.0723,
        yaw_p=0.1180,
        yaw_r=-0.1833,
        yaw_aileron=-0.0574,
        yaw_rudder=-0.1811,
        stall_alpha=0.36,
        stall_sharpness=60.0,
    ),
    propulsion=ShaftPower(
        diameter=0.3048,
        thrust=(0.0604, 0.1089, -0.896, 1.08, -0.4314),
        power=(0.0223, 0.01664, 0.0412, -0.5304, 0.5054),
        shaft=(-4.39, 70.135, 174.46),
        volts=11.1,
        efficiency=0.75,
        position=(-0.297, 0.0, -0.046),
    ),
    layout="tail",
    throw=(math.radians(15.0), math.radians(25.0), math.radians(25.0)),
    rate=math.radians(150.0),
    lag=(0.02, 0.1),
    lift_behind=0.0045,
)

PUBLISHED = {"zagi": ZAGI, "x8": X8, "ultrastick25e": ULTRASTICK}
FOLDER = Path(__file__).parents[2] / "aircraft"


def write(name: str) -> None:
    """Write the generated files of an aircraft's folder, which already has ``NAME.toml``."""
    folder = FOLDER / name
    (folder / f"{name}.xml").write_text(model_xml(name, PUBLISHED[name]), encoding="utf-8")
    aircraft = load_aircraft(name)
    fdm = Fdm(aircraft)
    flown = measure_performance(fdm, aircraft)
    climb, sink = math.degrees(flown.climb.climb), math.degrees(flown.idle.climb)
    slow, fast = flown.slowest.airspeed, flown.fastest.airspeed
    print(f"{name}: level {flown.level}\n  climb {climb:.1f}, idle {sink:.1f} degrees; {slow:.2f} to {fast:.2f} m/s")
    (folder / "gains.toml").write_text(gains_text(gains_from_model(aircraft, fdm)), encoding="utf-8")
    (folder / "ardupilot.parm").write_text(arduplane_parameters_text(aircraft, flown, fdm, {}), encoding="utf-8")
    (folder / "ardupilot.toml").write_text(servo_text(aircraft, flown), encoding="utf-8")


if __name__ == "__main__":
    for one in PUBLISHED:
        write(one)
