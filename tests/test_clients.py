"""Tests that need a third-party client skip with the reason without it; under .ci/run they fail."""

from pathlib import Path

import pytest

from tests.clients import NEED_CLIENTS, ROOT, need


@pytest.mark.parametrize("ci", ["", "1", "true"])
def test_a_missing_client_skips_its_tests_whatever_ci_is(ci: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("CI", ci)
    monkeypatch.delenv(NEED_CLIENTS, raising=False)
    with pytest.raises(pytest.skip.Exception, match=r"^Chromium is not installed \(apt-get install chromium\)$"):
        need(None, "Chromium", "apt-get install chromium")


def test_a_missing_client_fails_its_tests_under_ci_run(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    assert f"export {NEED_CLIENTS}=1" in (ROOT / ".ci" / "run").read_text(encoding="utf-8")
    monkeypatch.setenv(NEED_CLIENTS, "1")
    with pytest.raises(pytest.fail.Exception, match="Chromium is not installed"):
        need(tmp_path / "chromium", "Chromium", "apt-get install chromium")
    (tmp_path / "chromium").touch()
    assert need(tmp_path / "chromium", "Chromium", "") == str(tmp_path / "chromium")
