"""Malformed .plan files: each is refused in one line that names the field and what is allowed."""

import json
from pathlib import Path

import pytest

from tests.flight.mission_files.malformed_files import BAD_PLAN, refused


@pytest.mark.parametrize("case", sorted(BAD_PLAN))
def test_malformed_plans_are_refused(case: str, tmp_path: Path) -> None:
    data, wanted = BAD_PLAN[case]
    file = tmp_path / "bad.plan"
    file.write_text(data if isinstance(data, str) else json.dumps(data), encoding="utf-8")
    refused(file, wanted)
