"""What a page says to type runs, from its first block to its last; reports with blank pictures outside the soak."""

from pathlib import Path

import pytest

from logs.views import figures
from logs.views.drawing import new_figure
from tests.docs.page_blocks import PAGES, ROOT, TYPED, Bench, blocks, parse
from tests.logs.blank_pictures import NAMES, draw_nothing
from tests.soak import SOAK

# What other libraries say among themselves is not the reader's fault.
pytestmark = pytest.mark.filterwarnings("ignore")


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory) -> Bench:
    return Bench(tmp_path_factory.mktemp("shared"))


@pytest.mark.parametrize("page", [ROOT / "README.md", *PAGES], ids=lambda page: page.stem)
def test_the_blocks_of_a_page_run(
    page: Path, bench: Bench, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    if not SOAK:
        draw_nothing(monkeypatch)
        monkeypatch.setattr(figures, "draw_figures", lambda *_: {name: new_figure(1.0) for name in NAMES})
    names: dict[str, object] = {"__name__": "__main__"}
    for block in blocks(page):
        if not block.file and block.language not in TYPED:
            continue
        left = "parse" in block.marks or ("soak" in block.marks and not SOAK)
        if left and block.language == "sh":
            parse(block)
        elif left:
            compile(block.text, page.name, "exec")
        else:
            # Outside the soak a reader's own lines fly a scenario that is a seventh as long.
            bench.run(block if SOAK else block._replace(text=block.text.replace('"jacksboro"', '"tight"')), names)
