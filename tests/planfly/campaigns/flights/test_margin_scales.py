"""Every rule has a scale, and those without a distance are rules."""

from logs.verdict.findings import RULES
from planfly.campaigns.flights.margin_scales import COUNTS, SCALES


def test_every_rule_has_a_scale() -> None:
    assert list(SCALES) == list(RULES)
    assert min(SCALES.values()) > 0.0
    assert set(COUNTS) < set(RULES)
