"""The page of a campaign: one HTML file that needs no other, its pictures inside."""

import base64
from collections.abc import Sequence
from importlib import resources

import numpy as np
from jinja2 import Environment, FunctionLoader, StrictUndefined
from matplotlib.figure import Figure

from logs.verdict.rules.registry import RULES
from logs.verdict.wording import place_text
from logs.views.drawing import png_bytes
from planfly.campaigns.flights.campaign_base import CampaignBase
from planfly.campaigns.flights.flight_row import STATIONS
from planfly.campaigns.pictures import (
    Bar,
    draw_clearance_fan,
    draw_crossings,
    draw_failures,
    draw_probability,
    draw_tornado,
    speed_bins,
)
from planfly.campaigns.report.summary import CampaignSummary, campaign_lines, closest_text, log_name
from planfly.campaigns.spread.spread_file import BY_NAME
from planfly.campaigns.storage.stores import Store
from planfly.pipeline import make_setup

# Flights whose way is drawn, at most: of more a picture shows no more.
_DRAWN = 3000


def campaign_page(base: CampaignBase, summary: CampaignSummary, store: Store, command: str) -> bytes:
    """The page's bytes; command: the line that flies it again."""
    pictures = [(_embedded(figure), words) for figure, words in _pictures(base, summary, store)]
    lines = campaign_lines(summary)
    text = _render(
        "campaign.html",
        name=summary.name,
        answer=summary.estimate.answer,
        lines=lines,
        failures=[
            (RULES[one.rule].title, place_text(place), number)
            for one in summary.by_rule
            for place, number in one.places
        ],
        flights=summary.estimate.tally.flown,
        worst=[
            (
                row.draw.index,
                row.outcome,
                "; ".join(f"{RULES[rule].title} at {place_text(place)}" for rule, place in row.failed[:4]) or row.ended,
                closest_text(row),
                log_name(row) if row.duration > 0.0 else "",
            )
            for row in summary.worst
        ],
        spread=[
            (
                BY_NAME[name].title,
                BY_NAME[name].combine if BY_NAME[name].combine == "factor" else BY_NAME[name].unit,
                ", ".join(f"{key} {value:g}" for key, value in table.items() if key not in ("distribution", "source")),
                table["distribution"],
                table["source"],
            )
            for name, table in summary.spread.items()
        ],
        pictures=pictures,
        command=command,
        made_of=summary.made_of,
        seed=summary.seed,
    )
    return text.encode("utf-8")


def _render(template: str, **values: object) -> str:
    folder = resources.files("planfly.campaigns.report") / "templates"
    environment = Environment(
        loader=FunctionLoader(lambda name: (folder / name).read_text(encoding="utf-8")),
        autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True,
    )  # fmt: skip
    return environment.get_template(template).render(**values)


def _embedded(figure: Figure) -> str:
    return "data:image/png;base64," + base64.b64encode(png_bytes(figure)).decode("ascii")


def winds_page(name: str, figure: Figure, lines: list[str], rows: Sequence[tuple[str, ...]], command: str) -> bytes:
    """The page of a go/no-go chart."""
    return _render("winds.html", name=name, picture=_embedded(figure), lines=lines, rows=rows, command=command).encode(
        "utf-8"
    )


def _pictures(base: CampaignBase, summary: CampaignSummary, store: Store) -> list[tuple[Figure, str]]:
    """Figures and their captions."""
    flyable = np.array([outcome == "flyable" for outcome in store.outcomes().values()])
    speed = np.maximum(0.0, base.scenario.wind.speed + store.column("wind_speed"))
    bins = speed_bins(speed, flyable, summary.goal.confidence)
    counts = [(RULES[one.rule].title, place_text(place), n) for one in summary.by_rule for place, n in one.places]
    out = [
        (draw_probability(bins, summary.goal.target), "Share of flyable flights against the mean wind's speed"),
    ]
    if summary.deciding:
        bars = [Bar(BY_NAME[one.quantity].title, one.index, one.slope) for one in summary.sensitivities]
        out.append((draw_tornado(bars, RULES[summary.deciding].title), "What the deciding margin depends on"))
    if counts:
        failures = draw_failures(counts, summary.estimate.tally.flown)
        out.append((failures, "In how many flights each rule failed, and where"))
    return out + _ways(base, store)


def _ways(base: CampaignBase, store: Store) -> list[tuple[Figure, str]]:
    """Fan and crossings of the flights that have a track."""
    setup = make_setup(base.scenario, base.airframe, base.mission, base.seed, plan=base.plan, placed=base.placed)
    points = setup.route.waypoints
    shapes = [np.frombuffer(data, np.float32) for data in store.blobs("clearance", _DRAWN)]
    if not shapes:
        return []
    outcomes = [one != "flyable" for one, there in zip(store.texts("outcome"), store.has_track(), strict=True) if there]
    failed = np.array(outcomes[: len(shapes)])
    out = []
    if base.scenario.terrain is not None:
        lengths = np.hypot(*np.diff(points[:, :2], axis=0).T)
        before = np.concatenate([[0.0], np.cumsum(lengths)])
        at = (np.arange(STATIONS) + 0.5) / STATIONS * before[-1]
        east, north = (np.interp(at, before, points[:, axis]) for axis in range(2))
        ground = base.scenario.terrain.height(east, north)
        least = base.scenario.limits.min_clearance_m
        figure = draw_clearance_fan(np.array(shapes, dtype=np.float64), failed, ground, float(before[-1]), least)
        out.append((figure, "Height above ground along the way, over all flights, and the ground itself"))
    crossings = np.array([np.frombuffer(data, np.float32).reshape(-1, 2) for data in store.blobs("crossings", _DRAWN)])
    out.append((draw_crossings(crossings.astype(np.float64), failed), "Where flights crossed each waypoint"))
    return out
