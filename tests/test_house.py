"""The rules of the house: imports run down, `--help` is quick, every command has an example."""

import subprocess
import sys
import time
from pathlib import Path

import pytest

from planfly.cli import main
from planfly.commands.registry import COMMANDS

ROOT = Path(__file__).parents[1]


def test_the_import_contracts_hold() -> None:
    result = subprocess.run(
        [Path(sys.executable).with_name("lint-imports"), "--no-cache"],
        cwd=ROOT, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert result.returncode == 0, result.stdout + result.stderr
    assert "0 broken" in result.stdout


def test_help_answers_in_half_a_second() -> None:
    spent = []
    for _ in range(3):
        started = time.perf_counter()
        subprocess.run([sys.executable, "-m", "planfly", "--help"], check=True, capture_output=True, cwd=ROOT)
        spent.append(time.perf_counter() - started)
    assert min(spent) < 0.5


def test_help_imports_nothing_heavy() -> None:
    code = (
        "import sys, contextlib, io\nfrom planfly.cli import main\n"
        "with contextlib.redirect_stdout(io.StringIO()), contextlib.suppress(SystemExit):\n    main(['--help'])\n"
        "print([name for name in ('numpy', 'numba', 'jsbsim', 'matplotlib', 'pydantic') if name in sys.modules])"
    )
    result = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True, cwd=ROOT)
    assert result.stdout.strip() == "[]"


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_has_help_with_an_example(command: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as stopped:
        main([command, "--help"])
    assert stopped.value.code == 0
    text = capsys.readouterr().out
    assert f"example: planfly {command}" in text
    assert "exit codes" in text


def test_package_inits_hold_a_docstring_only() -> None:
    for package in ("logs", "flight", "planner", "world", "aircraft"):
        text = (ROOT / package / "__init__.py").read_text(encoding="utf-8")
        assert text.startswith('"""')
        assert text.count("\n") <= 3
        assert "import" not in text.split('"""')[2]
