"""Reports with blank pictures, for tests that look at anything else: drawing is most of what a run takes."""

import pytest

from logs.views import figures
from logs.views.drawing import new_figure, png_bytes

NAMES = ("map", "profile", "scene", "turns", "envelope", "time", "exposure", "controls", "energy")


def draw_nothing(patch: pytest.MonkeyPatch) -> None:
    """Have a report all the pictures that it asks for, each of them blank."""
    blank = png_bytes(new_figure(1.0))
    patch.setattr(figures, "draw_pictures", lambda views, **_: {f"{name}.png": blank for name in views})
