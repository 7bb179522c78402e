"""Drag of the models in flow from behind, as on an aircraft that has landed and stands in a tailwind."""

import numpy as np
import pytest

from aircraft.catalog import load_aircraft
from flight.dynamics.fdm import Fdm

# Wing areas of the models, m2.
WING_AREAS_M2 = {"aerosonde": 0.55, "x8": 0.75, "zagi": 0.2589, "ultrastick25e": 0.3097}
# Drag coefficient that no clean aircraft exceeds along its own axis: ten times the smallest drag of the X8 (0.018).
MAX_DRAG_COEFFICIENT = 0.2


@pytest.mark.parametrize("name", WING_AREAS_M2)
@pytest.mark.parametrize("speed", [2.5, 5.0])
def test_a_tailwind_does_not_push_a_standing_aircraft(name: str, speed: float) -> None:
    """A straight line of lift would give a drag coefficient of 5 to 16 at an angle of attack of 180 degrees."""
    fdm = Fdm(load_aircraft(name))
    fdm.move_to(0.0)
    # Speed along the body's axis, m/s; all other states and all commands are zero, the nose is level.
    forward_acceleration = fdm.derivatives(np.array([-speed, *7 * [0.0]]), np.zeros(4))[0]
    force = abs(forward_acceleration) * load_aircraft(name).mass
    assert force < MAX_DRAG_COEFFICIENT * 0.5 * 1.225 * speed**2 * WING_AREAS_M2[name]
