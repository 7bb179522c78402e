"""Predict the real flights of `examples/real/`, and count how often they are inside the bands of 95 %.

    python -m benchmarks.real_flights --out benchmarks/real_flights.json --pictures docs

The Ultra Stick 25e "Thor" is identified from the first 181 s of its usable flight, with a data sheet as base; the other
171 s are predicted.  ArduPlane's circle of 2013 is predicted from a data sheet alone, whose numbers are guesses: the
log names no aircraft.
"""

import argparse
import json
import shutil
import tempfile
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

import numpy as np

import planfly
from aircraft.catalog import find_aircraft
from aircraft.identification.base_model import BaseModel
from aircraft.identification.draws import draw_aircraft, sample_power_factors
from aircraft.identification.estimate import estimate_model, score_predictions
from aircraft.identification.flight_record import FlightRecord
from aircraft.identification.performance import performance
from logs.importers.motion_log import read_motion
from logs.views.drawing import draw_chart, png_bytes
from logs.views.prediction import band_chart
from planfly.identification.base_numbers import base_model, scale_base_model
from planfly.identification.folder import DENSITY
from planfly.identification.records import flight_records

# Real flights.
FLIGHTS = Path(__file__).parent.parent / "examples" / "real"
# Log of the Ultra Stick 25e.
THOR = FLIGHTS / "thor75" / "thor_flight75.columns.toml"
# Log of ArduPlane 2013.
CIRCLE = FLIGHTS / "arduplane2013" / "TestLog2.columns.toml"
# End of the part of Thor's log that identifies it, s: 181 s of usable flight, of which 180 s are needed.
THOR_UNTIL_S = 407.0
# Airspeed at which Thor's power is stated, m/s.
THOR_AIRSPEED_MPS = 17.0
# Time ahead of the scored predictions, s.
AHEAD_S = 0.5
# Aircraft with the wind tunnel's coefficients of Thor.
WIND_TUNNEL = "ultrastick25e"
# Axes of the scored rates.
AXES = ("roll", "pitch", "yaw")
# Quantities of the picture of the README.
SHOWN = ("bank", "airspeed", "power")


def predict_thor(folder: Path) -> tuple[dict[str, object], Path]:
    """Identify Thor from the first part of its flight, predict the rest, and return rows and the picture."""
    base = folder / "base"
    planfly.new_aircraft(base, mass=1.959, span=1.27, area=0.3097, cruise=17.0, stall=9.7, battery="11.1V,5Ah")
    half = folder / "half"
    planfly.identify_aircraft(
        THOR, half, mass=1.959, span=1.27, area=0.3097, battery="11.1V,55.5Wh", base=base, until=THOR_UNTIL_S
    )
    predicted = planfly.predict(THOR, folder / "thor", aircraft=str(half))
    sheet = find_aircraft(str(base))
    numbers = scale_base_model(base_model(sheet), 1.959, 1.27, 0.3097, 11.1)
    motion = read_motion(THOR)
    records = flight_records(motion, sheet)
    earlier = [record.part_between(0.0, THOR_UNTIL_S) for record in records]
    judged = [record.part_between(THOR_UNTIL_S, np.inf) for record in records]
    wind_tunnel = base_model(find_aircraft(WIND_TUNNEL))
    unknown = [replace(record, current=np.full_like(record.current, np.nan)) for record in records]
    without_current = estimate_model(unknown, numbers)
    powers = performance(numbers, draw_aircraft(without_current), THOR_AIRSPEED_MPS, DENSITY).power
    powers = powers * sample_power_factors(without_current)
    low, middle, high = np.percentile(powers, [2.5, 50.0, 97.5]).tolist()
    rows: dict[str, object] = {
        "inside": {band.name: round(band.inside, 3) for band in predicted.bands},
        "half_width": {band.name: round(band.half_width, 2) for band in predicted.bands},
        "unchanged": {band.name: round(band.unchanged, 2) for band in predicted.bands},
        **_score_rates(earlier, judged, numbers, ""),
        **_score_rates(earlier, judged, wind_tunnel, "_wind_tunnel"),
        "power_without_current": [round(low), round(middle), round(high)],
        "windows": predicted.windows,
    }
    shown = [band for band in predicted.bands if band.name in SHOWN]
    chart = band_chart(shown, "A real flight, predicted two seconds ahead by a model that has not seen it")
    picture = folder / "thor" / "predict.png"
    picture.with_name("shown.png").write_bytes(png_bytes(draw_chart(chart)))
    return rows, picture


def _score_rates(
    earlier: list[FlightRecord], judged: list[FlightRecord], base: BaseModel, suffix: str
) -> dict[str, dict[str, float]]:
    """Score predictions of roll, pitch and yaw rate by an identified model.

    The model is identified from the earlier part of a flight.

    Returns the errors relative to the errors of constant rates, for the identified model and for the base alone, and
    how white the innovations are (`aircraft.identification.prediction.whiteness`).

    earlier, judged: parts of the flight to identify a model with this base, and to predict.
    suffix: ending of the names of the rows.
    """
    null, alone, identified = score_predictions(estimate_model(earlier, base), judged, base, "base").predictions

    def by_axis(values: Iterable[float]) -> dict[str, float]:
        """Return rounded values by the name of their axis."""
        return {name: round(value, 3) for name, value in zip(AXES, values, strict=True)}

    return {
        f"ahead{suffix}": by_axis((identified.rms[AHEAD_S] / null.rms[AHEAD_S])[:3].tolist()),
        f"ahead_base_alone{suffix}": by_axis((alone.rms[AHEAD_S] / null.rms[AHEAD_S])[:3].tolist()),
        f"white{suffix}": by_axis(identified.whiteness),
    }


def predict_circle(folder: Path) -> tuple[dict[str, object], Path]:
    """Predict ArduPlane's circle from a data sheet alone, and return rows and the picture.

    The leg to the circle is left out of the rows of the circle.
    """
    guess = folder / "guess"
    planfly.new_aircraft(guess, mass=2.5, span=1.8, area=0.45, cruise=16.0, stall=10.0, battery="11.1V,5Ah")
    predicted = planfly.predict(CIRCLE, folder / "circle", aircraft=str(guess))
    known = [band for band in predicted.bands if not np.isnan(band.inside)]
    # The circle begins with leg 1; the flight gets back to the altitude of leg 0 only there.
    begin = predicted.leg_ends[0]
    on_circle = {}
    for band in known:
        rows_on_circle = band.along >= begin
        values = {name: getattr(band, name)[rows_on_circle] for name in ("along", "low", "high", "flown")}
        on_circle[band.name] = round(replace(band, **values).inside, 3)
    rows: dict[str, object] = {
        "inside": {band.name: round(band.inside, 3) for band in known},
        "half_width": {band.name: round(band.half_width, 2) for band in known},
        "on_circle": on_circle,
        "draws": predicted.draws,
    }
    return rows, folder / "circle" / "predict.png"


def main() -> None:
    """Predict both flights, print and write the rows, and copy the pictures."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, help="JSON file of the rows")
    parser.add_argument("--pictures", type=Path, help="folder for the pictures of the docs")
    args = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        results = {}
        for title, function in (("thor", predict_thor), ("circle", predict_circle)):
            results[title], picture = function(Path(name))
            if args.pictures is not None:
                shutil.copyfile(picture, args.pictures / f"real-{title}.png")
        if args.pictures is not None:
            shutil.copyfile(Path(name) / "thor" / "shown.png", args.pictures / "real-flight.png")
    text = json.dumps(results, indent=1)
    print(text)
    if args.out is not None:
        args.out.write_text(text + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
