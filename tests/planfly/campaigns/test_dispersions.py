"""What may vary."""

from pathlib import Path

import numpy as np
import pytest
from scipy import stats

from planfly.campaigns.dispersions import (
    NAMES,
    QUANTITIES,
    QUANTITY_BY_NAME,
    SpreadError,
    VaryingQuantity,
    default_dispersions,
    parse_dispersions,
    read_dispersions,
)


def test_names_are_unlike_and_nominals_lie_in_their_range() -> None:
    assert len(set(NAMES)) == len(QUANTITIES)
    for one in QUANTITIES:
        assert one.low < one.nominal < one.high
    assert (QUANTITY_BY_NAME["mass"].nominal, QUANTITY_BY_NAME["wind_speed"].nominal) == (1.0, 0.0)


# ----------------------------------------------------------------------
# Spread files: what is drawn, and one line for what cannot be.

GOOD = '[mass]\ndistribution = "norm"\nloc = 1.0\nscale = 0.05\nsource = "weighed"\n'


def test_every_number_of_the_default_has_a_source() -> None:
    spread = default_dispersions()
    assert {one.quantity.name for one in spread.varying} >= {"wind_speed", "wind_from", "mass", "drag", "battery"}
    for one in spread.varying:
        assert len(one.source) > 20
        # Who says it, and what.
        assert ":" in one.source
        assert "assumed" not in one.source


def test_values_are_the_distributions_own() -> None:
    (mass,) = parse_dispersions(GOOD, "x").varying
    for share in (0.01, 0.5, 0.9):
        assert mass.value(share) == pytest.approx(stats.norm.ppf(share, 1.0, 0.05), abs=1e-6)


def test_what_lies_beyond_the_range_is_never_drawn() -> None:
    wide = VaryingQuantity(QUANTITY_BY_NAME["mass"], "norm", (("loc", 1.0), ("scale", 0.2)), "by hand")
    values = [wide.value(share) for share in np.linspace(0.0, 1.0, 201)]
    assert min(values) == pytest.approx(0.5)
    assert max(values) == pytest.approx(2.0)


def test_turbulence_is_drawn_in_steps() -> None:
    (one,) = parse_dispersions('[turbulence]\ndistribution = "randint"\nlow = 0\nhigh = 2\nsource = "x"', "x").varying
    assert {one.value(share) for share in (0.1, 0.49, 0.51, 0.99)} == {0.0, 1.0}


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "nothing varies"),
        ("[mass", "Expected"),
        (GOOD.replace("[mass]", "[weight]"), "weight: unknown"),
        ("mass = 3", "expected a table"),
        (GOOD.replace('"norm"', '"normal"'), "'normal': expected a continuous distribution"),
        (GOOD.replace('"norm"', '"rv_continuous"'), "expected a continuous distribution"),
        (GOOD.replace('"norm"', '"poisson"'), "expected a continuous distribution"),
        (GOOD.replace('distribution = "norm"\n', ""), "distribution: missing"),
        (GOOD.replace('source = "weighed"', ""), "source: missing"),
        (GOOD.replace("scale = 0.05", "sigma = 0.05"), "mass.sigma: not a parameter of norm, which has loc, scale"),
        (GOOD.replace("scale = 0.05", "scale = nan"), "mass.scale: nan: expected a finite number"),
        (GOOD.replace("scale = 0.05", "scale = inf"), "finite"),
        (GOOD.replace("scale = 0.05", "scale = true"), "finite"),
        (GOOD.replace("scale = 0.05", "scale = -1.0"), "these parameters are invalid for norm"),
        (GOOD.replace('"norm"', '"gamma"'), "mass.a: missing; gamma needs a"),
        (GOOD.replace("loc = 1.0", "loc = 9.0"), "0.0 % of the distribution lies within 0.5..2"),
    ],
)
def test_bad_files_get_one_line(text: str, words: str) -> None:
    with pytest.raises(SpreadError) as told:
        parse_dispersions(text, "mine.toml")
    message = str(told.value)
    assert words in message
    assert message.startswith("mine.toml")
    assert "\n" not in message


def test_one_percent_outside_is_the_limit() -> None:
    # Normal about 1 with 0.5 as the range's near end: 2.326 sigma is one per cent.
    inside, outside = 0.5 / 2.33, 0.5 / 2.32
    assert parse_dispersions(GOOD.replace("0.05", str(inside)), "x")
    with pytest.raises(SpreadError):
        parse_dispersions(GOOD.replace("0.05", str(outside)), "x")


def test_a_file_that_is_not_there(tmp_path: Path) -> None:
    with pytest.raises(SpreadError, match="cannot be read"):
        read_dispersions(tmp_path / "none.toml")
    good = tmp_path / "good.toml"
    good.write_text(GOOD)
    assert read_dispersions(good).name == str(good)
    assert read_dispersions(good).without(("mass",)).varying == ()
    assert read_dispersions(good).to_json()["mass"]["source"] == "weighed"
