"""The go/no-go chart."""

import numpy as np

from logs.figures.elements.style import png_bytes
from planfly.campaigns.pictures.go_no_go import Spoke, draw_go_no_go

SPOKES = [Spoke(90.0 * k, 8.0 + k, 7.5 + k, 8.5 + k, False, ((6.0, 3, 3), (9.0, 3, 1))) for k in range(4)]


def test_the_boundary_passes_through_each_direction() -> None:
    figure = draw_go_no_go(SPOKES, 20.0, 0.99, 0.95, "demo", (5.0, 250.0))
    line = next(line for line in figure.axes[0].lines if len(line.get_xdata()) > 100)
    angle, speed = np.asarray(line.get_xdata(), dtype=float), np.asarray(line.get_ydata(), dtype=float)
    for one in SPOKES:
        assert abs(np.interp(np.radians(one.from_deg), angle, speed) - one.boundary) < 0.02
    # A mark for each wind flown in, and the star.
    assert len(figure.axes[0].lines) == 1 + 8 + 1
    assert png_bytes(figure) == png_bytes(draw_go_no_go(SPOKES, 20.0, 0.99, 0.95, "demo", (5.0, 250.0)))
