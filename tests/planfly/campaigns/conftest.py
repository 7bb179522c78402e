"""What tests of campaigns share."""

import pytest

from planfly.campaigns.campaign_base import CampaignBase
from tests.planfly.campaigns.made_campaigns import short_base


@pytest.fixture(scope="session")
def base(tmp_path_factory: pytest.TempPathFactory) -> CampaignBase:
    return short_base(tmp_path_factory.mktemp("short"))
