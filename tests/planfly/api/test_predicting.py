"""Tests of `planfly.predict`: by the controls and by the mission, and which part of a log it may judge."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import planfly
from aircraft.catalog import Aircraft, load_aircraft
from logs.importers.motion_log import read_motion
from planfly.api import predicting
from planfly.workflow.imported_flights import DrawnFlight
from world.errors import LogError, PlanflyError

# A real flight.
THOR = Path(__file__).parents[3] / "examples" / "real" / "thor75" / "thor_flight75.columns.toml"
# Number of flights in a test of everything but the bands.
_FEW = 3
_drawn_flights = predicting.draw_flight_variations


@pytest.fixture
def few_draws(monkeypatch: pytest.MonkeyPatch) -> None:
    """Fly few draws."""
    monkeypatch.setattr(predicting, "draw_flight_variations", lambda aircraft: _drawn_flights(aircraft, _FEW))


def _with_posterior(aircraft: Aircraft, folder: Path, log: str) -> Aircraft:
    """Return an aircraft whose folder has a posterior with an entry for a log."""
    (folder / "posterior.toml").write_text(f"climb_sd_deg = 1\ndescent_sd_deg = 1\n{log}", encoding="utf-8")
    return replace(aircraft, folder=folder)


@pytest.mark.usefixtures("few_draws")
def test_a_real_flight_by_its_controls(tmp_path: Path) -> None:
    """The wind tunnel's Ultra Stick predicts the second half of a real flight; few draws only show the form."""
    result = planfly.predict(THOR, tmp_path / "out", aircraft="ultrastick25e")
    assert (result.by, result.source, result.aircraft) == ("controls", str(THOR), "ultrastick25e")
    names = [band.name for band in result.bands]
    assert names == ["bank", "pitch", "airspeed", "height rate", "height", "track", "power"]
    # 351 s of the log are usable, of which half is judged, in windows of 2 s.
    assert 84 <= result.windows <= 88
    assert result.bands[0].along.min() > result.start
    assert sorted(file.name for file in result.files) == ["predict.html", "predict.png"]
    page = (tmp_path / "out" / "predict.html").read_text(encoding="utf-8")
    assert "height rate (m/s)" in page
    assert result.lines[0].split(":")[0] in page


def test_draws_differ_in_all_that_is_not_known() -> None:
    """Aircraft, wind, turbulence and the error of logged positions differ, and the winds have the stated deviation."""
    draws = predicting.draw_flight_variations(load_aircraft("aerosonde"))
    assert len(draws) == 40
    assert {draw.turbulence for draw in draws} == {"none", "light", "moderate"}
    assert len({draw.variation.drag for draw in draws}) == 40
    winds = np.array([draw.wind for draw in draws])
    # The deviation of 80 numbers is known to 8 %; three of these.
    assert abs(winds.std() / predicting.LOGGED_WIND_SD_MPS - 1.0) < 0.24
    assert np.array([draw.offset for draw in draws]).std(axis=0).min() > 1.0
    assert isinstance(draws[0], DrawnFlight)


def test_the_part_that_identified_the_aircraft_is_not_judged(tmp_path: Path) -> None:
    """The judged part begins at the end of the used part, and not before it."""
    motion = read_motion(THOR)
    entry = f'[[log]]\nfile = "x"\nsha256 = "{motion.sha256}"\n'
    aircraft = load_aircraft("ultrastick25e")
    used = _with_posterior(aircraft, tmp_path, f"{entry}until_s = 400.0\n")
    assert predicting._choose_judged_start(motion, used, [], None) == 400.0
    assert predicting._choose_judged_start(motion, used, [], 450.0) == 450.0
    with pytest.raises(PlanflyError, match=r"399.*at least 400"):
        predicting._choose_judged_start(motion, used, [], 399.0)
    whole = _with_posterior(aircraft, tmp_path, entry)
    with pytest.raises(LogError, match=r"identified from the whole log.*--until"):
        predicting._choose_judged_start(motion, whole, [], 450.0)
    other = _with_posterior(aircraft, tmp_path, '[[log]]\nfile = "y"\nsha256 = "0"\n')
    assert predicting._choose_judged_start(motion, other, [], 300.0) == 300.0


def test_the_part_that_identified_the_aircraft_is_recognised_in_another_span_of_the_same_data(tmp_path: Path) -> None:
    """A table that reads the seconds 30 to 696 reads rows that were used before 400 s; one from 450 s on does not."""
    for path in (THOR, *THOR.parent.glob("*.mat")):
        (tmp_path / path.name).write_bytes(path.read_bytes())
    table = (tmp_path / THOR.name).read_text("utf-8")
    parts = {}
    for span in ("[30.0, 696.0]", "[450.0, 696.0]"):
        (tmp_path / THOR.name).write_text(f"span_s = {span}\n{table}", encoding="utf-8")
        parts[span] = read_motion(tmp_path / THOR.name)
    entry = f'[[log]]\nfile = "x"\nsha256 = "{read_motion(THOR).sha256}"\nuntil_s = 400.0\n'
    used = _with_posterior(load_aircraft("ultrastick25e"), tmp_path, entry)
    with pytest.raises(PlanflyError, match=r"399.*at least 400"):
        predicting._choose_judged_start(parts["[30.0, 696.0]"], used, [], 399.0)
    assert predicting._choose_judged_start(parts["[450.0, 696.0]"], used, [], 460.0) == 460.0


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({}, "aircraft: name the aircraft"),
        ({"aircraft": "ultrastick25e", "start": 230.0}, "start = 230|before 230"),
        ({"aircraft": "ultrastick25e", "start": 1e6}, "from 1000000"),
        ({"aircraft": "ultrastick25e", "plan": "nofile.waypoints"}, "plan nofile.waypoints: only for a prediction by"),
        ({"aircraft": "ultrastick25e", "flight": 7}, "flight.*7.*only for a prediction by mission"),
        ({"aircraft": "ultrastick25e", "wind": (30.0, 270.0)}, "wind.*only for a prediction by mission"),
        ({"aircraft": "ultrastick25e", "by": "mission", "start": 300.0}, "only for a prediction by controls"),
    ],
)
def test_refusals(tmp_path: Path, options: dict[str, object], message: str) -> None:
    """A prediction without an aircraft, or without 30 s on either side of its start, is refused, and writes nothing."""
    with pytest.raises(PlanflyError, match=message) as caught:
        planfly.predict(THOR, tmp_path / "out", **options)  # type: ignore[arg-type]
    assert "\n" not in str(caught.value)
    assert not (tmp_path / "out").exists()
