"""Two flights' charts hold both by name; without one map origin there is no map."""

from dataclasses import replace

from logs.figures.comparison import NamedFlight
from logs.report.charts.compare_charts import compare_charts
from tests.logs.report.report_data import make_setup, make_track


def test_both_flights_are_on_map_and_along_their_way() -> None:
    first = NamedFlight("a.mcap", make_setup(), make_track())
    made = compare_charts((first, replace(first, name="b.mcap")))
    assert [(one["name"], one["dashed"]) for one in made["flight"]["flights"]] == [("a.mcap", False), ("b.mcap", True)]
    names = [layer["name"] for layer in made["charts"]["along"]["panels"][0]["layers"]]
    assert names == ["a.mcap", "b.mcap"]
    origin = first.setup.scenario.origin
    away = replace(first.setup.scenario, origin=replace(origin, lat_deg=origin.lat_deg + 1.0))
    apart = compare_charts((first, replace(first, setup=replace(first.setup, scenario=away))))
    assert (apart["scene"], "map" in apart["charts"]) == (None, False)
