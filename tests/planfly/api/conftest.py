"""A plan, and its flight with a log, shared by the verbs' tests."""

import pytest

import planfly


@pytest.fixture(scope="session")
def path() -> planfly.Plan:
    return planfly.plan("paper-07", seed=1)


@pytest.fixture(scope="session")
def flown(path: planfly.Plan, tmp_path_factory: pytest.TempPathFactory) -> planfly.FlownMission:
    return planfly.fly(path, wind=(4, 270), log=tmp_path_factory.mktemp("api") / "flight.mcap", log_hz=10)
