"""Every example in a docstring runs, and gives what it says."""

import doctest
import importlib
from pathlib import Path

import pytest

from tests.soak import SOAK

ROOT = Path(__file__).parents[1]
PACKAGES = ("planfly", "logs", "flight", "planner", "aircraft", "world")
MODULES = sorted(
    ".".join(file.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__")
    for package in PACKAGES
    for file in (ROOT / package).rglob("*.py")
    if ">>> " in file.read_text(encoding="utf-8")
)
# Each makes whole runs, many returns, or pages with pictures; other tests of these modules do, too.
LONG = {
    "planfly.api.running",
    "planfly.api.reporting",
    "planfly.api.flying",
    "planfly.api.returning",
    "planfly.api.fronts",
    "planfly.workflow.pipeline",
    "planner.search.plan_front",
    "logs.views.report.page",
    "logs.views.report.compare",
}


@pytest.mark.parametrize("module", [name for name in MODULES if SOAK or name not in LONG])
def test_examples_give_what_they_say(module: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    flags = doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE
    result = doctest.testmod(importlib.import_module(module), optionflags=flags)
    assert result.attempted > 0, "the examples stand where doctest does not look"
    assert result.failed == 0
    assert list(tmp_path.iterdir()) == [], "an example leaves files behind"
