"""The page: whole, with its pictures inside and nothing fetched."""

import re
from pathlib import Path

from planfly.campaigns.campaign_base import CampaignBase
from planfly.campaigns.report import campaign_page
from tests.planfly.campaigns.made_report import made_report


def test_it_holds_pictures_tables_and_no_link(base: CampaignBase, tmp_path: Path) -> None:
    with made_report(base, tmp_path) as (store, summary):
        page = campaign_page(base, summary, store, "planfly campaign <x>").decode()
        assert page == campaign_page(base, summary, store, "planfly campaign <x>").decode()
    assert page.count('<img src="data:image/png;base64,') == 5
    assert "planfly campaign &lt;x&gt;" in page
    assert "leg 1" in page
    assert not re.search(r'(src|href)="(?!data:)', page)
