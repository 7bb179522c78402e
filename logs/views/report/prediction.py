"""Write the page of a blind prediction."""

from collections.abc import Sequence

from markupsafe import Markup

from aircraft.identification.blind import Band, uninformative_note
from logs.views.charts import Chart
from logs.views.figures import draw_pictures, view_json
from logs.views.report.page import (
    CHART_SCRIPTS,
    page_library,
    page_template,
    picture_data_url,
    script_digest,
    script_text,
    style_text,
)
from logs.views.scene import script_json


def prediction_page(heading: str, bands: Sequence[Band], chart: Chart) -> str:
    """Return the page of a blind prediction as self-contained HTML, with picture, chart and scripts.

    heading: sentence that describes the prediction.
    chart: chart of the bands, as returned by `band_chart`.
    """
    script = script_text(CHART_SCRIPTS)
    return page_template("prediction.html").render(
        title=chart.title,
        heading=heading,
        note=uninformative_note(bands),
        bands=[band for band in bands if band.inside == band.inside],
        picture=picture_data_url(draw_pictures({"bands": chart})["bands.png"]),
        style=Markup(style_text("style", "compare", "identification")),
        scene=Markup(script_json(data=None)),
        flight_data=Markup(script_json({"flights": []})),
        chart_data=Markup(script_json({"bands": view_json(chart)})),
        library=page_library(),
        script=Markup(script),
        script_digest=script_digest(script),
    )
