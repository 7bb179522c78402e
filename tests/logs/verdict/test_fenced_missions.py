"""Missions that pass a zone 5 m on its right side, or 5 m on its wrong side: none is judged wrongly.

200 of them with PLANFLY_SOAK=1, one of each feature and side otherwise.
"""

import pytest

from logs.verdict.judge_flight import judge_geometry
from tests.logs.verdict.fenced_missions import FEATURES, MARGIN, fenced_mission
from tests.logs.verdict.judging import judge
from tests.soak import scaled
from tests.synthetic import fly_path

NUMBERS = range(scaled(200, 2 * len(FEATURES)))


@pytest.mark.parametrize("number", NUMBERS)
def test_five_metres_decide(number: int) -> None:
    made = fenced_mission(number)
    verdicts = [judge_geometry(made.setup)]
    if made.plain:
        verdicts.append(judge(made.setup, fly_path(made.setup, rate=5.0)))
    for verdict in verdicts:
        mine = [item for item in verdict.findings if item.rule == made.rule]
        assert mine
        assert not any(item.ok is None for item in mine)
        assert any(item.ok is False for item in mine) == made.wrong, (made.feature, [item.reason for item in mine])
        depth = max(-item.margin for item in mine if item.margin is not None)
        assert depth == pytest.approx(MARGIN if made.wrong else -MARGIN, abs=0.5), made.feature


def test_half_of_each_feature_are_wrong() -> None:
    made = [fenced_mission(number) for number in range(2 * len(FEATURES))]
    assert [one.wrong for one in made] == [False, True] * len(FEATURES)
    assert [one.feature for one in made[::2]] == [feature.__name__ for feature in FEATURES]
