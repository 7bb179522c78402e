"""Comparing flights: the same measures for both, and nothing where nothing differs."""

import importlib.util
import inspect
import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest

from flight.simulation.flight_setup import FlightSetup
from flight.simulation.track import Track
from logs.recording.foxglove_layout import layout_text
from logs.recording.reader import FlightLog, read_log
from logs.recording.recorder import _CHANNELS
from logs.recording.state_channel import FIELDS, STATE_TOPIC
from logs.report.compare import Comparison, compare_logs, difference_lines
from logs.report.compare_page import write_comparison
from tests.clients import need
from tests.logs.made_flight import make_setup, record


def compared(first: FlightLog, second: FlightLog) -> tuple[Comparison, dict[str, Any]]:
    found = compare_logs(first, second, names=("a.mcap", "b.mcap"))
    return found, {item.name: item for item in found.differences}


@pytest.fixture
def other(tmp_path: Path, setup: FlightSetup, track: Track) -> FlightLog:
    """Half a second longer at its end, 10 m further north, with more energy."""
    position = track.position + np.array([0.0, 10.0, 0.0])
    energy = track.energy * 2
    time = track.time.copy()
    time[-1] += 0.5
    changed = replace(track, position=position, energy=energy, time=time)
    wind = make_setup(wind={"speed_mps": 0.0, "from_deg": 0.0})
    return read_log(record(tmp_path / "other.mcap", wind, changed))


def test_a_flight_and_itself(log_file: Path) -> None:
    log = read_log(log_file)
    found, items = compared(log, log)
    assert all(item.first == item.second or math.isnan(item.first) for item in items.values())
    assert found.notes == ("tracks: 0.00 m apart on average, 0.00 m at most",)
    assert compare_logs(log, log, names=("x", "x")).names == ("x (first)", "x (second)")


def test_what_differs_is_told(log_file: Path, other: FlightLog, track: Track) -> None:
    found, items = compared(read_log(log_file), other)
    assert items["time in the air"].second - items["time in the air"].first == pytest.approx(0.5)
    assert items["energy used"].second == pytest.approx(2 * items["energy used"].first)
    assert items["energy used"].first == pytest.approx(float(track.energy[-1]))
    assert any(note.startswith("wind: 3.3 m/s from 211°") for note in found.notes)
    assert "10.0 m at most" in found.notes[-1]
    lines = difference_lines(found)
    assert len({len(line) for line in lines[2:-4]}) == 1
    assert "energy used (Wh)" in "\n".join(lines)


def test_pictures_and_page(log_file: Path, other: FlightLog, tmp_path: Path) -> None:
    found, _ = compared(read_log(log_file), other)
    files = write_comparison(tmp_path / "out", found, svg=True)
    assert [file.name for file in files] == [
        "compare-map.png", "compare-profile.png", "compare-map.svg", "compare-profile.svg", "compare.html",
    ]  # fmt: skip
    first = [file.read_bytes() for file in files]
    assert all(data.startswith(b"\x89PNG") for data in first[:2])
    assert all(ElementTree.fromstring(data).tag.endswith("svg") for data in first[2:4])
    assert b"energy used" in first[4]
    # Both verdicts in a sentence first, and the pictures inside: the page can be sent alone.
    page = first[4].decode("utf-8")
    assert 0 < page.index("a.mcap:</strong>") < page.index("b.mcap:</strong>") < page.index("<table")
    assert page.count("data:image/png;base64,") == 2
    assert 'src="compare' not in page
    assert [file.read_bytes() for file in write_comparison(tmp_path / "out", found, svg=True)] == first


def test_the_layout_speaks_of_topics_and_fields_that_are_there() -> None:
    layout = json.loads(layout_text())
    fields = {name for name, *_ in FIELDS}
    topics = {*_CHANNELS, STATE_TOPIC}
    for name, panel in layout["configById"].items():
        for path in panel.get("paths", ()):
            topic, _, field = path["value"].partition(".")
            assert topic == STATE_TOPIC, name
            assert field in fields, name
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
        words = [name.split("_") for name in inspect.signature(kind).parameters]
        return {first + "".join(word.capitalize() for word in rest) for first, *rest in words}

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
        assert set(panel.get("scene", {}).get("transforms", ())) <= names(known.BaseRendererTransforms)
