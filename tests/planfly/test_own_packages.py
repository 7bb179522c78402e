"""A user's module that is called as a package of ours is told in one line, with both files and the way out."""

import subprocess
import sys
from pathlib import Path

import pytest

import planfly
from planfly.own_packages import PACKAGES, find_hidden_package

ROOT = Path(planfly.__file__).parents[1]
# The interpreter's own command: a script whose folder, not the current one, is on Python's path.
COMMAND = Path(sys.executable).with_name("planfly")
IMPORTS = "import planfly, logs.theme"


def run(folder: Path, *arguments: str, path: str = "") -> "subprocess.CompletedProcess[str]":
    environment = {"PYTHONPATH": f"{path}:{ROOT}" if path else str(ROOT), "PATH": "/usr/bin:/bin"}
    return subprocess.run(arguments, cwd=folder, env=environment, capture_output=True, text=True, check=False)


def python(folder: Path, *arguments: str, path: str = "") -> "subprocess.CompletedProcess[str]":
    return run(folder, sys.executable, *arguments, path=path)


def test_the_packages_are_those_that_lie_beside_planfly() -> None:
    beside = {file.parent.name for file in ROOT.glob("*/__init__.py")}
    assert beside - {"planfly", "tests", "benchmarks"} == set(PACKAGES)


@pytest.mark.parametrize("name", PACKAGES)
def test_a_module_in_the_current_folder_is_named_on_import(name: str, tmp_path: Path) -> None:
    (tmp_path / f"{name}.py").write_text("raise SystemExit('it was imported')\n")
    done = python(tmp_path, "-c", "import planfly")
    last = done.stderr.splitlines()[-1]
    assert done.returncode == 1
    assert last.startswith(f"ImportError: {tmp_path / name}.py: hides {ROOT / name / '__init__.py'},")
    assert "rename it" in last
    assert "No module named" not in done.stderr


def test_a_package_on_pythonpath_is_named_too(tmp_path: Path) -> None:
    mine = tmp_path / "mine" / "world"
    mine.mkdir(parents=True)
    (mine / "__init__.py").touch()
    done = python(tmp_path, "-c", "import planfly", path=str(mine.parent))
    assert f"ImportError: {mine / '__init__.py'}: hides" in done.stderr


def test_the_error_is_an_import_error_that_a_program_can_catch(tmp_path: Path) -> None:
    (tmp_path / "flight.py").touch()
    code = "try:\n    import planfly\nexcept ImportError as error:\n    print(error.name, error.path)"
    assert python(tmp_path, "-c", code).stdout.split() == ["planfly", str(tmp_path / "flight.py")]


def test_a_module_that_is_imported_already_is_named(tmp_path: Path) -> None:
    (tmp_path / "logs.py").touch()
    done = python(
        tmp_path, "-c", f"import logs, sys\nsys.path.remove('')\nsys.path.insert(0, {str(ROOT)!r})\nimport planfly"
    )
    assert f"ImportError: {tmp_path / 'logs.py'}: hides" in done.stderr


def test_a_script_of_such_a_name_is_named(tmp_path: Path) -> None:
    (tmp_path / "planner.py").write_text("import planfly\n")
    done = python(tmp_path, "planner.py")
    assert done.returncode == 1
    assert f"ImportError: {tmp_path / 'planner.py'}: hides" in done.stderr


def test_a_program_of_modules_that_uses_planfly_gets_the_exception(tmp_path: Path) -> None:
    (tmp_path / "logs.py").touch()
    (tmp_path / "mine").mkdir()
    # Python imports the package while it still looks for what to run.
    (tmp_path / "mine" / "__init__.py").write_text("import planfly\n")
    (tmp_path / "mine" / "__main__.py").touch()
    done = python(tmp_path, "-m", "mine")
    assert (done.returncode, "Traceback" in done.stderr) == (1, True)


def test_the_command_ends_with_exit_code_2_and_one_line(tmp_path: Path) -> None:
    (tmp_path / "logs.py").touch()
    done = python(tmp_path, "-m", "planfly", "scenarios")
    assert (done.returncode, done.stdout) == (2, "")
    assert len(done.stderr.splitlines()) == 1
    assert done.stderr.startswith(f"planfly: {tmp_path / 'logs.py'}: hides {ROOT / 'logs' / '__init__.py'},")


@pytest.mark.skipif(not COMMAND.exists(), reason="planfly's command is not installed")
def test_the_installed_command_does_so_for_pythonpath(tmp_path: Path) -> None:
    (tmp_path / "aircraft.py").touch()
    done = run(tmp_path, str(COMMAND), "scenarios", path=str(tmp_path))
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.startswith(f"planfly: {tmp_path / 'aircraft.py'}: hides")
    assert len(done.stderr.splitlines()) == 1
    # The current folder alone is not where a script's modules come from.
    assert run(tmp_path, str(COMMAND), "--version").returncode == 0


def test_the_way_out_that_the_line_names_leads_out(tmp_path: Path) -> None:
    (tmp_path / "logs.py").touch()
    assert python(tmp_path, "-P", "-c", IMPORTS).returncode == 0


def test_a_folder_of_files_hides_nothing(tmp_path: Path) -> None:
    (tmp_path / "logs").mkdir()
    (tmp_path / "logs" / "flight.mcap").touch()
    assert python(tmp_path, "-c", IMPORTS).returncode == 0


def test_a_link_to_our_own_files_hides_nothing(tmp_path: Path) -> None:
    (tmp_path / "planfly").symlink_to(ROOT / "planfly")
    for name in PACKAGES:
        (tmp_path / name).symlink_to(ROOT / name)
    assert find_hidden_package(tmp_path) is None
