"""The pages build, without a warning and without a network."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.docs.page_blocks import PAGES, ROOT
from tests.soak import SOAK


@pytest.mark.skipif(not SOAK, reason="`make lint` builds them, in CI too; set PLANFLY_SOAK=1")
def test_pages_build_without_a_warning(tmp_path: Path) -> None:
    # No proxy leads anywhere: what would fetch something fails.
    nowhere = dict.fromkeys(("http_proxy", "https_proxy"), "http://127.0.0.1:9")
    command = [
        sys.executable,
        "-m",
        "sphinx",
        "-W",
        "-q",
        "-b",
        "html",
        "-d",
        tmp_path / "trees",
        ROOT / "docs",
        tmp_path / "html",
    ]
    subprocess.run(command, check=True, env={**os.environ, **nowhere, "PYTHONPATH": str(ROOT)})
    built = {file.stem for file in (tmp_path / "html").glob("*.html")}
    assert {page.stem for page in PAGES} <= built
    # A page needs no script and no font from elsewhere.
    page = (tmp_path / "html" / "verdict.html").read_text(encoding="utf-8")
    assert 'src="http' not in page
    assert page.count("<math") > 20
