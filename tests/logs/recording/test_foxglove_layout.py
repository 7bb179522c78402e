"""The layout speaks of topics, fields and settings that are there."""

import importlib.util
import inspect
import json
from pathlib import Path
from typing import Any

from logs.recording.foxglove_layout import layout_text
from logs.recording.foxglove_scene import AIRCRAFT
from logs.recording.recorder import _CHANNELS, ZONES_TOPIC
from logs.recording.state_channel import FIELDS, STATE_TOPIC
from logs.recording.viewers.aircraft_model import SPAN
from tests.clients import need


def test_the_layout_names_only_topics_and_fields_of_a_log() -> None:
    layout = json.loads(layout_text())
    fields = {field.name for field in FIELDS}
    topics = {*_CHANNELS, STATE_TOPIC, ZONES_TOPIC}
    assert set(layout["configById"]["3D!planfly"]["topics"]) <= topics
    for name, panel in layout["configById"].items():
        for path in panel.get("paths", ()):
            topic, _, field = path["value"].partition(".")
            field, _, function = field.partition(".@")
            assert topic == STATE_TOPIC, name
            assert field in fields, name
            # Angles are shown in degrees, and said to be.
            assert function == ("rad2deg" if field.endswith("_rad") else ""), name
            assert path["label"] == (field.removesuffix("_rad") + "_deg" if function else field)
        # A legend beside the curves covers none of them.
        assert panel.get("legendDisplay", "top") == "top", name
        named = [panel.get(key) for key in ("followTopic", "topicToRender", "topicPath") if key in panel]
        assert set(named) | set(panel.get("topics", ())) <= topics

    # A layout file as Foxglove exports one: these parts, and panels of these kinds.
    assert set(layout) == {"configById", "globalVariables", "userNodes", "playbackConfig", "layout"}
    assert {name.split("!")[0] for name in layout["configById"]} == {"3D", "map", "Plot", "RosOut", "RawMessages"}

    def leaves(node: Any) -> list[str]:
        return [node] if isinstance(node, str) else [*leaves(node["first"]), *leaves(node["second"])]

    assert sorted(leaves(layout["layout"])) == sorted(layout["configById"])


def test_the_layouts_settings_are_those_that_foxglove_knows() -> None:
    """By the classes that Foxglove publishes for making layouts."""
    need(
        None if importlib.util.find_spec("foxglove") is None else Path("/"), "foxglove-sdk", "pip package foxglove-sdk"
    )
    from foxglove import layouts as known

    def names(kind: Any) -> set[str]:
        """Its settings as JSON spells them."""
        parts = [name.split("_") for name in inspect.signature(kind).parameters]
        return {first + "".join(word.capitalize() for word in rest) for first, *rest in parts}

    kinds = {
        "3D": known.ThreeDeeConfig,
        "map": known.MapConfig,
        "Plot": known.PlotConfig,
        "RosOut": known.LogConfig,
        "RawMessages": known.RawMessagesConfig,
    }
    for name, panel in json.loads(layout_text())["configById"].items():
        # A panel's title stands beside its settings there.
        assert set(panel) - {"title"} <= names(kinds[name.split("!")[0]]), name
        for path in panel.get("paths", ()):
            assert set(path) <= names(known.PlotSeries)
        assert set(panel.get("cameraState", ())) <= names(known.ThreeDeeCameraState)
        assert set(panel.get("scene", ())) <= names(known.BaseRendererSceneSettings)
        # The 3D panel itself reads `axisScale` (FrameAxes.ts); the class of the SDK calls it otherwise.
        assert set(panel.get("scene", {}).get("transforms", ())) <= {"axisScale", *names(known.BaseRendererTransforms)}


def test_the_start_is_in_view() -> None:
    """Wherever on the map that is: the camera keeps to the aircraft, some ten of its drawn spans away."""
    panel = json.loads(layout_text())["configById"]["3D!planfly"]
    assert (panel["followTf"], panel["followMode"], panel["cameraState"]["target"]) == (
        AIRCRAFT, "follow-position", [0, 0, 0],
    )  # fmt: skip
    assert 8.0 < panel["cameraState"]["distance"] / SPAN < 20.0
    assert panel["scene"]["transforms"]["axisScale"] < SPAN
    assert panel["topics"]["/scene/aircraft"]["visible"]
