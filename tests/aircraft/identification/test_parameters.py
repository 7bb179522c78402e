"""The priors, which every interval rests on."""

import numpy as np

from aircraft.identification.parameters import INDEX, PARAMETERS, prior_means, prior_sds

# Of aircraft scaled from another of their class, as docs/your-aircraft.md states them: 1 standard deviation.
STATED = {
    "lift-slope": 0.12,
    "lift-offset": 0.15,
    "zero-lift-drag": 0.4,
    "induced-drag": 0.3,
    "thrust": 0.2,
    "motor-speed": 0.07,
    "propeller-torque": 0.1,
    "pitch-offset": 0.06,
    "pitch-stiffness": 0.5,
    "pitch-damping": 0.4,
    "elevator-power": 0.4,
    "dihedral-effect": 0.5,
    "roll-damping": 0.4,
    "roll-from-yaw": 0.4,
    "aileron-power": 0.4,
    "weathercock": 0.4,
    "yaw-from-roll": 0.6,
    "yaw-damping": 0.4,
    "adverse-yaw": 0.6,
    "rudder-power": 0.4,
}


def test_priors_are_as_stated() -> None:
    assert {parameter.name: parameter.sd for parameter in PARAMETERS} == STATED
    assert [prior_means()[INDEX[name]] for name in ("thrust", "lift-offset")] == [1.0, 0.0]


def test_bounds_leave_what_an_aircraft_can_be() -> None:
    for parameter, mean, sd in zip(PARAMETERS, prior_means(), prior_sds(), strict=True):
        low, high = parameter.bounds
        assert low < mean < high
        # A factor that would turn a control or a damping around is beyond its bound.
        if parameter.name in ("aileron-power", "elevator-power", "rudder-power", "thrust", "lift-slope"):
            assert low > 0.0
        assert high - mean > 2.0 * sd
        assert parameter.property_name == f"ident/{parameter.name}"
    assert np.isfinite(prior_sds()).all()
