"""The comparison of two flights as files: pictures, and a page that holds them."""

from pathlib import Path

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from logs.figures.comparison import NamedFlight, draw_both_on_map, draw_both_over_distance
from logs.figures.elements.scene_data import script_json
from logs.figures.elements.style import png_bytes, svg_bytes
from logs.report.captions import picture_address
from logs.report.charts.compare_charts import compare_charts
from logs.report.compare import Comparison, difference_rows
from logs.report.page_parts import CHART_SCRIPTS, page_library, script_digest, script_text, style_text
from world.atomic_files import write_whole

# Name of the chart that stands for each picture, and what it shows.
_PICTURES = {
    "compare-map.png": ("map", "Both flights from above, over the first one's map"),
    "compare-profile.png": (
        "along",
        "Height, height above ground, airspeed, bank, cross-track and throttle of both flights",
    ),
}


def write_comparison(out_dir: Path, comparison: Comparison, *, svg: bool = False) -> list[Path]:
    """Write ``compare-map.png``, ``compare-profile.png`` and ``compare.html`` into a folder, made if it is missing.

    svg: the pictures as SVG, too.  The map is left out where the flights' map origins differ.
    Returns the paths written.  Raises OSError.

    >>> import tempfile
    >>> from logs.recording.example_log import example_log
    >>> from logs.report.compare import compare_logs
    >>> log = example_log()
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     paths = write_comparison(Path(folder), compare_logs(log, log, names=("one", "other")))
    >>> [path.name for path in paths]
    ['compare-map.png', 'compare-profile.png', 'compare.html']
    """
    first, second = (
        NamedFlight(name, log.setup, log.track) for name, log in zip(comparison.names, comparison.logs, strict=True)
    )
    figures = {"compare-profile": draw_both_over_distance((first, second))}
    if first.setup.scenario.origin == second.setup.scenario.origin:
        figures = {"compare-map": draw_both_on_map((first, second)), **figures}
    files = {f"{name}.png": png_bytes(figure) for name, figure in figures.items()}
    page = _page(comparison, (first, second), files)
    if svg:
        files |= {f"{name}.svg": svg_bytes(figure) for name, figure in figures.items()}
    files["compare.html"] = page.encode("utf-8")
    out_dir.mkdir(parents=True, exist_ok=True)
    for name, data in files.items():
        write_whole(out_dir / name, data)
    return [out_dir / name for name in files]


def _page(comparison: Comparison, flights: tuple[NamedFlight, NamedFlight], files: dict[str, bytes]) -> str:
    """The page, its pictures, charts and scripts inside."""
    pictures = [(*_PICTURES[name], picture_address(data)) for name, data in files.items()]
    data, script = compare_charts(flights), script_text(CHART_SCRIPTS)
    verdicts = [
        (name, verdict.flyable, verdict.headline)
        for name, verdict in zip(comparison.names, comparison.verdicts, strict=True)
    ]
    environment = Environment(
        loader=PackageLoader("logs.report"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    return environment.get_template("compare.html").render(
        names=comparison.names,
        verdicts=verdicts,
        rows=difference_rows(comparison),
        notes=comparison.notes,
        pictures=pictures,
        style=Markup(style_text("style", "compare")),
        scene=Markup(script_json(data["scene"])),
        flight_data=Markup(script_json(data["flight"])),
        chart_data=Markup(script_json(data["charts"])),
        library=page_library(),
        script=Markup(script),
        script_digest=script_digest(script),
    )
