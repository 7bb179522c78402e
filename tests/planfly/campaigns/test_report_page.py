"""The page: whole, with its pictures inside and nothing fetched."""

import re
from dataclasses import replace
from xml.etree import ElementTree

import pytest

from planfly.campaigns.campaign_base import CampaignBase
from planfly.campaigns.report import campaign_page
from planfly.campaigns.summary import Sensitivity
from tests.planfly.campaigns.made_report import made_report


@pytest.fixture(scope="module")
def pages(base: CampaignBase, tmp_path_factory: pytest.TempPathFactory) -> list[str]:
    """Made twice, with a quantity that explains the margin of the made flights, which depends on none."""
    with made_report(base, tmp_path_factory.mktemp("page")) as (store, summary):
        assert not any(entry.drivers for entry in summary.deciding)
        explained = replace(summary.deciding[0], sensitivities=(Sensitivity("mass", 0.5, -0.7, p_value=1e-6),))
        summary = replace(summary, deciding=(explained,))
        return [campaign_page(base, summary, store, "planfly campaign <x>").decode() for _ in range(2)]


def test_it_holds_pictures_tables_and_no_link(pages: list[str]) -> None:
    page, again = pages
    assert page == again
    assert page.count('<svg role="img" aria-label="') == 2 * 5
    assert "planfly campaign &lt;x&gt;" in page
    assert "leg 1" in page
    assert not re.search(r'(src|href)="(?!data:|#)', page)


def test_its_pictures_are_dark_where_the_page_is(pages: list[str]) -> None:
    """Every colour that is drawn is a variable of the page's style, which has a light and a dark one for each."""
    page = pages[0]
    pictures = re.findall(r"<svg .*?</svg>", page, re.DOTALL)
    # Each twice: wide, and narrow for a phone.
    assert len(pictures) == 2 * 5
    assert page.count(' (narrow)"') == 5
    names = [set(re.findall(r' id="([^"]+)"', picture)) for picture in pictures]
    assert sum(map(len, names)) == len(set().union(*names))
    for picture in pictures:
        assert re.findall(r"#[0-9a-f]{6}\b", picture) == []
        used = set(re.findall(r"var\(--([a-z0-9-]+)\)", picture))
        assert {"paper", "ink"} <= used
        style = page[: page.index("</style>")]
        assert all(style.count(f"--{name}: #") == 2 for name in used)
        # Names of groups would come twice in the page.
        assert "<g id=" not in picture
        assert ElementTree.fromstring(picture.replace("&ndash;", "")).tag.endswith("svg")
