"""Pictures that are drawn, and not rendered."""

import pytest

from logs.views import drawing


@pytest.fixture
def unrendered(monkeypatch: pytest.MonkeyPatch) -> None:
    """PNGs without content, for tests that look at their names: rendering is most of what pictures take."""
    monkeypatch.setattr(drawing, "png_bytes", lambda _: b"\x89PNG")
