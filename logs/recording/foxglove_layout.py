"""The layout for Foxglove that shows a flight log whole: 3-D, map, plots, events and the state."""

from importlib import resources


def layout_text() -> str:
    """Return the layout file that ships with the package, as JSON text.

    >>> import json
    >>> sorted(json.loads(layout_text()))
    ['configById', 'globalVariables', 'layout', 'playbackConfig', 'userNodes']
    """
    return resources.files("logs.recording").joinpath("templates", "foxglove-layout.json").read_text(encoding="utf-8")
