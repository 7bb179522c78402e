"""Which tests a mutant is put before, and which kernels have to be compiled anew for it."""

import ast
import re
from collections import defaultdict
from functools import cache
from pathlib import Path

from tests.mutations.mutant import ROOT, Mutant
from world.kernel_cache import DECORATORS

# Where the functions stand by which Python calls inner kernels: numba keeps them, kernel and all, by this file.
_WRAPPERS = "world/kernels.py"
PACKAGES = ("planfly", "logs", "flight", "planner", "aircraft", "world")
# Beside the tests of its own name: where what a part's modules do shows.
PART_TESTS: dict[str, tuple[str, ...]] = {
    "rules": ("tests/logs/verdict", "tests/docs/test_pages_hold.py"),
    "measures": ("tests/logs/verdict",),
    "physics": ("tests/flight/simulation/test_tick.py", "tests/flight/dynamics/test_fdm.py"),
}


def covering_tests(mutant: Mutant) -> list[list[str]]:
    """Test files and folders in stages: most mutants fall in the first, and only those that do not need the next.

    First those of the module's own name, of a limit those with its pair of cases; then the rest.
    """
    if mutant.part != "limits":
        own, rest = _own_tests(mutant.file), [place for place in PART_TESTS[mutant.part] if (ROOT / place).exists()]
        return [stage for stage in (own, rest) if stage]
    # A limit's pair of cases stands with a module that reads it, or with a rule that uses that module.
    users = _users(limits_at(mutant))
    rules = [rule for user in users for rule in sorted(_importers()[user]) if rule.startswith("logs/verdict/rules/")]
    tests = dict.fromkeys(test for module in (*users, *rules) for test in _own_tests(module))
    pairs = [test for test in tests if "/limits/" in test]
    return [stage for stage in (pairs, [test for test in tests if test not in pairs]) if stage]


def kernels_on(mutant: Mutant) -> list[str]:
    """Files with compiled code that rests on what a mutant changes, its own file left out.

    Numba compiles a cached kernel anew when its own file changes, not when a constant or a kernel of another does.
    """
    file = mutant.file
    ahead = _users(limits_at(mutant)) if mutant.part == "limits" else [file]
    seen = {file, *ahead}
    while ahead:
        for user in sorted(_importers()[ahead.pop()]):
            if user not in seen:
                seen.add(user)
                ahead.append(user)
    found = {user for user in seen if _has_kernels(user)}
    return sorted((found | {_WRAPPERS} if found else found) - {file})


def _own_tests(file: str) -> list[str]:
    """Tests of a module's name: tests/logs/verdict/rules/test_slope_rule.py, and limits/test_slope_rule_limits.py."""
    path = Path(file)
    # An aircraft's model stands in a folder of its own, its tests in that of all aircraft.
    folder = ROOT / "tests" / (path.parent if path.suffix == ".py" else path.parent.parent)
    return [str(found.relative_to(ROOT)) for found in sorted(folder.rglob(f"test_{path.stem}*.py"))]


def limits_at(mutant: Mutant) -> list[str]:
    """Names that the changed line of the tolerances gives a value to."""
    source = (ROOT / mutant.file).read_bytes()
    line = mutant.line(source)
    for node in ast.parse(source).body:
        if isinstance(node, ast.Assign) and node.lineno <= line <= (node.end_lineno or 0):
            return [name.id for target in node.targets for name in ast.walk(target) if isinstance(name, ast.Name)]
    raise ValueError(f"{mutant.file}:{line}: no limit")


def _users(names: list[str]) -> list[str]:
    """Modules that read one of some limits."""
    pattern = re.compile(rf"\b({'|'.join(names)})\b")
    return [file for file, text in _sources().items() if file.startswith("logs/verdict/") and pattern.search(text)]


@cache
def _sources() -> dict[str, str]:
    files = [file for package in PACKAGES for file in sorted((ROOT / package).rglob("*.py"))]
    return {str(file.relative_to(ROOT)): file.read_text(encoding="utf-8") for file in files}


@cache
def _importers() -> dict[str, set[str]]:
    """By file: the files that import from it."""
    found: dict[str, set[str]] = defaultdict(set)
    for file, text in _sources().items():
        for module in re.findall(r"^ *from ([\w.]+) import", text, re.MULTILINE):
            found[module.replace(".", "/") + ".py"].add(file)
    return found


def _has_kernels(file: str) -> bool:
    # An aircraft's model is no source of kernels.
    return re.search(rf"^@({'|'.join(DECORATORS)})$", _sources().get(file, ""), re.MULTILINE) is not None
