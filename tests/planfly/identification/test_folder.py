"""The folder of an identified aircraft says how its log was flown, and where."""

import math
import tomllib
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from aircraft.catalog import load_aircraft
from aircraft.identification.estimate import Estimate
from aircraft.identification.parameters import INDEX, prior_means, prior_sds
from flight.dynamics.fdm import Fdm
from flight.dynamics.trim import fastest_level_flight
from logs.importers.motion import MotionLog
from planfly.identification.base_numbers import base_model
from planfly.identification.folder import (
    Identified,
    format_posterior,
    make_folder_files,
    make_identification,
    select_flown_parameters,
)
from planfly.identification.records import log_outputs
from tests.instrumented_flights import PARAMETERS, Truth, changed_aerosonde, short_motion

BASE = load_aircraft("aerosonde")
# As ArduPlane 4.4 and older call them, in their units.
OLD = {
    "TRIM_ARSPD_CM": 2400.0,
    "ARSPD_FBW_MIN": 17.0,
    "ARSPD_FBW_MAX": 30.0,
    "LIM_ROLL_CD": 4200.0,
    "NAVL1_PERIOD": 15.0,
}


def flown(parameters: Mapping[str, float], **fields: Any) -> MotionLog:
    rigged = {name: value for name, value in PARAMETERS.items() if name.startswith("SERVO")}
    return replace(short_motion(), parameters=rigged | dict(parameters), **fields)


def found(log: MotionLog) -> Identified:
    """As if its estimate were the prior, ten times as sure."""
    estimate = Estimate(prior_means(), np.diag(np.square(0.1 * prior_sds())), (), ())
    return make_identification(BASE, base_model(BASE), estimate, [log], log_outputs(log, BASE))


def files(log: MotionLog) -> dict[str, str]:
    return make_folder_files(found(log), "mine", (BASE.battery_voltage, BASE.battery_energy))


def test_parameters_of_an_old_release_count_by_their_present_names() -> None:
    stated = select_flown_parameters(flown(OLD))
    assert (stated["AIRSPEED_CRUISE"], stated["AIRSPEED_MIN"], stated["AIRSPEED_MAX"]) == (24.0, 17.0, 30.0)
    assert (stated["ROLL_LIMIT_DEG"], stated["NAVL1_PERIOD"]) == (42.0, 15.0)
    assert not (set(OLD) - {"NAVL1_PERIOD"}) & set(stated)


def test_the_folder_of_an_old_log_has_its_speeds_and_its_bank() -> None:
    made = files(flown(OLD, home=(48.0, 11.0, 520.0)))
    # Its mission begins where it flew.
    home = made["identify.waypoints"].splitlines()[1].split("\t")
    assert [float(value) for value in home[8:11]] == pytest.approx([48.0, 11.0, 520.0])
    table = tomllib.loads(made["mine.toml"])
    # The base's cruise is 25 m/s.  ArduPlane's airspeeds are equivalent: at 480 m the air has 0.9547 of
    # its density at sea level (ISO 2533), and true airspeeds are larger by the root of that.
    true = 1.0 / math.sqrt(0.9547)
    assert table["airspeed_mps"] == pytest.approx(24.0 * true, rel=1e-4)
    assert table["airspeed_min_mps"] == pytest.approx(17.0 * true, rel=1e-4)
    assert table["airspeed_max_mps"] == pytest.approx(30.0 * true, rel=1e-4)
    assert table["max_bank_deg"] == pytest.approx(42.0)
    assert math.degrees(BASE.max_bank) != pytest.approx(42.0)
    assert "AIRSPEED_CRUISE 24\n" in made["ardupilot.parm"]
    assert "TRIM_ARSPD_CM" not in made["ardupilot.parm"]


def test_a_log_without_parameters_flies_with_those_of_the_base() -> None:
    """A table of columns has no parameters; an empty file would be refused by every command that flies."""
    assert files(flown({}))["ardupilot.parm"] == (BASE.folder / "ardupilot.parm").read_text(encoding="utf-8")


def test_no_mission_is_made_of_a_log_that_does_not_say_where_it_flew() -> None:
    assert "identify.waypoints" not in files(flown(PARAMETERS))


@pytest.mark.parametrize(("with_current", "power_sd"), [(True, 0.05), (False, math.hypot(0.05, 0.29))])
def test_power_is_as_uncertain_as_torque_and_drive(with_current: bool, power_sd: float) -> None:
    """A propeller that needs 5 % more torque for the same thrust needs some 5 % more current, and power.

    Without the battery's current, the efficiency of the drive is known to 0.29 only, as that of real aircraft
    (`python -m benchmarks.real_power`).
    """
    sds = np.full(len(prior_sds()), 1e-6)
    sds[INDEX["propeller-torque"]] = 0.05
    covariance = np.diag(np.square(sds))
    estimate = Estimate(prior_means(), covariance, (), (), with_current=with_current, airspeed=(1.02, 0.003))
    log = flown({})
    found = make_identification(BASE, base_model(BASE), estimate, [log], log_outputs(log, BASE))
    table = tomllib.loads(format_posterior(found))
    assert table["power_sd"] == pytest.approx(power_sd, rel=0.3 if with_current else 0.1)
    assert (table["airspeed_factor"], table["airspeed_factor_sd"]) == (1.02, 0.003)
    names = [quantity["property"] for quantity in table["quantity"]]
    assert ("ident/drive-power" in names) is not with_current
    # Draws, quantities and correlations have one order.
    assert names == list(found.aircraft_draws().names)
    assert len(table["correlation"]["matrix"]) == len(table["correlation"]["matrix"][0]) == len(names)
    assert np.log(found.aircraft_draws().values[:, -1]).std() == pytest.approx(0.29, rel=0.1) or with_current


def test_the_fastest_is_as_sure_as_the_drag(tmp_path: Path) -> None:
    """A tenth of zero-lift drag either way, as JSBSim flies two Aerosondes that were edited by hand."""
    tops = []
    for factor in (0.9, 1.1):
        edited = changed_aerosonde(tmp_path / f"v{factor:g}", Truth(zero_lift_drag=factor))
        found = fastest_level_flight(Fdm(edited), 480.0)
        assert found is not None
        tops.append(found.airspeed)
    sds = np.full(len(prior_sds()), 1e-6)
    sds[INDEX["zero-lift-drag"]] = 0.1
    estimate = Estimate(prior_means(), np.diag(np.square(sds)), (), ())
    log = flown({})
    table = tomllib.loads(
        format_posterior(make_identification(BASE, base_model(BASE), estimate, [log], log_outputs(log, BASE)))
    )
    assert table["fastest_sd_mps"] == pytest.approx(0.5 * (tops[0] - tops[1]), rel=0.15)
