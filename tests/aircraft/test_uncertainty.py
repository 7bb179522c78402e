"""What is not known of an aircraft, written and read, its draws, and files that are refused."""

import math
from pathlib import Path

import numpy as np
import pytest

from aircraft.uncertainty import (
    UncertainQuantity,
    Uncertainty,
    draw_quantities,
    draws_text,
    read_draws,
    read_uncertainty,
    uncertainty_text,
)
from world.errors import FlightError

THRUST = UncertainQuantity("ident/thrust", "factor", 1.0, 0.2, "a guess")
KNOWN = "climb_sd_deg = 3\ndescent_sd_deg = 1\n"
LEVEL = UncertainQuantity("ident/level", "rad", -0.1, 0.02)


def test_it_is_read_as_written(tmp_path: Path) -> None:
    known = Uncertainty(
        "a data sheet",
        math.radians(5.0),
        math.radians(1.25),
        (THRUST, LEVEL),
        power_sd=0.3,
        battery_guessed=True,
        max_speed_sd=1.25,
        climb_guessed=True,
        bank_guessed=True,
        climb_shortfall=0.05,
    )
    (tmp_path / "uncertainty.toml").write_text(uncertainty_text(known), encoding="utf-8")
    found = read_uncertainty(tmp_path)
    assert found is not None
    assert found.source == "a data sheet"
    assert (found.climb_sd, found.descent_sd) == pytest.approx((known.climb_sd, known.descent_sd))
    assert found.quantities == (THRUST, LEVEL)
    assert found.battery_guessed
    assert found.climb_guessed
    assert found.bank_guessed
    assert found.climb_shortfall == pytest.approx(0.05, abs=1e-4)
    assert (found.power_sd, found.max_speed_sd) == (0.3, 1.25)
    assert read_uncertainty(tmp_path.parent) is None


def test_a_posterior_comes_first(tmp_path: Path) -> None:
    (tmp_path / "uncertainty.toml").write_text('source = "a data sheet"\n', encoding="utf-8")
    text = KNOWN + '[[quantity]]\nproperty = "ident/thrust"\nunit = "factor"\nestimate = 0.9\nsd = 0.1\n'
    (tmp_path / "posterior.toml").write_text(text, encoding="utf-8")
    found = read_uncertainty(tmp_path)
    assert found == Uncertainty(
        "flight logs", math.radians(3.0), math.radians(1.0), (UncertainQuantity("ident/thrust", "factor", 0.9, 0.1),)
    )


def test_draws_have_median_and_deviation_and_are_the_same_again(tmp_path: Path) -> None:
    drawn = draw_quantities((THRUST, LEVEL))
    assert drawn.values.shape == (512, 2)
    # Of 512 draws the mean is off by 3 sd / sqrt(512) = 0.13 sd at most, the deviation by a tenth.
    logarithms = np.log(drawn.values[:, 0])
    assert (logarithms.mean(), logarithms.std()) == pytest.approx((0.0, 0.2), abs=0.027)
    assert (drawn.values[:, 1].mean(), drawn.values[:, 1].std()) == pytest.approx((-0.1, 0.02), abs=0.0027)
    assert drawn.values[:, 0].min() > 0.0
    assert np.array_equal(drawn.values, draw_quantities((THRUST, LEVEL)).values)
    file = tmp_path / "draws.csv"
    file.write_text(draws_text(drawn), encoding="utf-8")
    again = read_draws(file)
    assert again.names == ("ident/thrust", "ident/level")
    assert again.values == pytest.approx(drawn.values)
    # One row a seed.
    assert again.properties(513) == tuple(zip(again.names, again.values[1].tolist(), strict=True))


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("", "expected a line of properties and at least one of values"),
        ("ident/thrust\n", "expected a line of properties and at least one of values"),
        ("thrust\n1\n", "expected a property ident/NAME"),
        ("ident/a b\n1\n", "expected a property ident/NAME"),
        ("ident/thrust\n1\nnan\n", ":3: nan: expected 1 finite numbers"),
        ("ident/thrust,ident/b\n1\n", ":2: 1: expected 2 finite numbers"),
        ("ident/thrust\n\n\nnan\n", ":4: nan: expected 1 finite numbers"),
        ("ident/thrust\r1\r", ":1: lines end with LF or CR LF"),
        ("ident/thrust\n" + 140_000 * "1" + "\n", ":2: lines end with LF or CR LF, and a field has at most 131072"),
    ],
)
def test_bad_draws_are_refused(tmp_path: Path, text: str, told: str) -> None:
    file = tmp_path / "draws.csv"
    file.write_bytes(text.encode())
    with pytest.raises(FlightError, match=r"draws\.csv") as caught:
        read_draws(file)
    assert told in str(caught.value)


@pytest.mark.parametrize(
    ("text", "told"),
    [
        (KNOWN + "fastest_sd_mps = -1", "fastest_sd_mps: -1: expected a number from 0 to 100"),
        ("climb_sd_deg = -1\ndescent_sd_deg = 1", "climb_sd_deg: -1: expected a number from 0 to 45"),
        ("source = 3", "source: 3: expected a text"),
        (KNOWN + '[[quantity]]\nproperty = "x"\n', "expected a property ident/NAME"),
        (KNOWN + "[[quantity]]\nsd = 1\n", "expected a property ident/NAME"),
        (KNOWN + '[[quantity]]\nproperty = "ident/thrust"\nestimate = 1\n', "sd: None: expected a number from 0 to"),
        (KNOWN + "quantity = 3", "quantity: 3: expected [[quantity]] tables"),
        # What is not stated is not known for certain.
        ("", "missing climb_sd_deg, descent_sd_deg"),
        ("climb_sd_deg = 3", "missing descent_sd_deg"),
        ("climb_sd_dg = 3\ndescent_sd_deg = 1", "unknown key climb_sd_dg: did you mean 'climb_sd_deg'?"),
        (KNOWN + "weather = 3", "unknown key weather"),
        (KNOWN + "power_sd = 2", "power_sd: 2: expected a number from 0 to 1"),
        (KNOWN + "battery_guessed = 1", "battery_guessed: 1: expected true or false"),
        (KNOWN + "climb_guessed = 'yes'", "climb_guessed: 'yes': expected true or false"),
        ("x = ", "uncertainty.toml"),
    ],
)
def test_bad_files_are_refused(tmp_path: Path, text: str, told: str) -> None:
    (tmp_path / "uncertainty.toml").write_text(text, encoding="utf-8")
    with pytest.raises(FlightError) as caught:
        read_uncertainty(tmp_path)
    assert told in str(caught.value)
