"""The architecture's rules: imports run downwards, functions are short, kernels name their data, help is quick."""

import ast
import re
import string
import subprocess
import sys
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from functools import cache
from pathlib import Path

import pytest

from planfly.cli import COMMANDS, main
from tests.conftest import COMPILING
from tests.soak import only_in_soak
from tests.stopwatch import Stopwatch
from world.kernel_cache import DECORATORS

ROOT = Path(__file__).parents[1]
PACKAGES = ("planfly", "logs", "flight", "planner", "aircraft", "world")
CODE = sorted(
    file for folder in (*PACKAGES, "benchmarks", "tests", "examples") for file in (ROOT / folder).rglob("*.py")
)
OURS = [file for file in CODE if file.relative_to(ROOT).parts[0] in PACKAGES]
# Lines of a function with its docstring: two screens.  Ruff counts its statements by PLR0915, and its branches by C901.
LONGEST = 80
# Functions that became longer when signatures and tables lost their `# fmt: skip`: to be split, and not to grow.
LONGER = {
    "flight/simulation/simulate.py:make_loop": 98,
    "logs/views/exports/log_files.py:_make_topics": 91,
}
KERNELS = set(DECORATORS)
INNER = {"inner", "inlined"}
# Phrases that lean on a text the reader does not have; taken apart, so that this file may hold them.
LEANING = ("Do the" + " same", "the design" + " document", "the" + " issue")
# A dotted name in single backquotes that begins with a folder of ours; a file such as flight.mcap is none.
_FIRST, _FILES = "|".join((*PACKAGES, "benchmarks", "tests")), "mcap|html|toml|json|md"
REFERENCE = re.compile(rf"(?<![`\w])`((?:{_FIRST})(?:\.(?!(?:{_FILES})\b)\w+)+)(?:\(\))?`(?!`)")

Function = ast.FunctionDef | ast.AsyncFunctionDef
# Where a statement holds others.
BLOCKS = ("body", "orelse", "handlers", "finalbody", "cases")


@cache
def text_of(file: Path) -> str:
    return file.read_text(encoding="utf-8")


@cache
def parsed(file: Path) -> ast.Module:
    return ast.parse(text_of(file))


@cache
def nodes_of(file: Path) -> tuple[ast.AST, ...]:
    return tuple(ast.walk(parsed(file)))


@cache
def functions(file: Path) -> tuple[Function, ...]:
    """Found among statements alone, which are few of a module's nodes."""
    statements: list[ast.AST] = [parsed(file)]
    for node in statements:
        for blocks in BLOCKS:
            statements += getattr(node, blocks, ())
    return tuple(node for node in statements if isinstance(node, Function))


def name_of(file: Path) -> str:
    return file.relative_to(ROOT).as_posix()


def is_kernel(function: Function) -> bool:
    """Whether numba compiles it."""
    for decorator in function.decorator_list:
        called = decorator.func if isinstance(decorator, ast.Call) else decorator
        if isinstance(called, ast.Name) and called.id in KERNELS:
            return True
    return False


def columns(function: Function) -> Iterator[str]:
    """Subscripts that stand for a name: a constant from 3 on, or two constants."""
    for node in ast.walk(function):
        if isinstance(node, ast.Subscript):
            parts = node.slice.elts if isinstance(node.slice, ast.Tuple) else [node.slice]
            numbers = [part.value for part in parts if isinstance(part, ast.Constant) and isinstance(part.value, int)]
            if any(number >= 3 for number in numbers) or len(numbers) >= 2:
                yield ast.unparse(node)


def test_the_import_contracts_hold() -> None:
    result = subprocess.run(
        [Path(sys.executable).with_name("lint-imports"), "--no-cache"],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
    )
    assert result.returncode == 0, result.stdout + result.stderr
    assert "0 broken" in result.stdout


def test_nothing_that_is_installed_imports_tests_or_benchmarks() -> None:
    apart = {"benchmarks", "examples", "tests"}
    found = [
        f"{name_of(file)}:{node.lineno}"
        for file in OURS
        for node in nodes_of(file)
        if (isinstance(node, ast.ImportFrom) and (node.module or "").partition(".")[0] in apart)
        or (isinstance(node, ast.Import) and apart & {alias.name.partition(".")[0] for alias in node.names})
    ]
    assert found == []


def imports_of_ours() -> dict[str, set[str]]:
    """Modules of ours that each module of ours imports: at its top, within functions, and for types alone."""
    names = {name_of(file).removesuffix(".py").replace("/", ".").removesuffix(".__init__"): file for file in OURS}
    graph: dict[str, set[str]] = {}
    for name, file in names.items():
        found: set[str] = set()
        for node in nodes_of(file):
            if isinstance(node, ast.ImportFrom) and node.module:
                found |= {f"{node.module}.{alias.name}" for alias in node.names} & names.keys()
                # `from package import name` imports the package itself, unless every name is a module of it.
                found |= {node.module} if any(f"{node.module}.{a.name}" not in names for a in node.names) else set()
            elif isinstance(node, ast.Import):
                found |= {alias.name for alias in node.names}
        graph[name] = found & names.keys() - {name}
    return graph


def cycles_of(graph: Mapping[str, set[str]]) -> list[set[str]]:
    """Find the groups of modules that import one another, by leaving out again and again what is in none."""
    left = {name: set(found) for name, found in graph.items()}
    while True:
        imported = set().union(*left.values()) if left else set()
        apart = {name for name, found in left.items() if not found or name not in imported}
        if not apart:
            break
        left = {name: found - apart for name, found in left.items() if name not in apart}

    def reached(start: str) -> set[str]:
        seen, todo = set(), [start]
        while todo:
            new = left[todo.pop()] - seen
            seen |= new
            todo += new
        return seen

    reach = {name: reached(name) for name in left}
    groups = {frozenset(other for other in reach[name] if name in reach[other]) for name in left if name in reach[name]}
    return sorted(map(set, groups), key=sorted)


def test_cycles_are_found_however_long_and_what_hangs_on_them_is_not() -> None:
    graph = {"a": {"b"}, "b": {"c"}, "c": {"a", "leaf"}, "leaf": set(), "d": {"e", "a"}, "e": {"d"}, "top": {"d"}}
    assert cycles_of(graph) == [{"a", "b", "c"}, {"d", "e"}]
    assert cycles_of({"a": {"b"}, "b": {"c"}, "c": set()}) == []


def test_no_modules_import_one_another() -> None:
    """Deferred imports and imports for types alone count: a cycle is read as one piece, whenever it is imported."""
    assert cycles_of(imports_of_ours()) == []


@only_in_soak
def test_help_answers_in_half_a_second() -> None:
    spent = []
    for _ in range(3):
        command = [sys.executable, "-m", "planfly", "--help"]
        process = subprocess.Popen(command, stdout=subprocess.PIPE, cwd=ROOT, start_new_session=True)
        with Stopwatch(process.pid) as watch:
            said, _ = process.communicate()
        assert b"campaign" in said
        spent.append(watch.seconds)
    assert min(spent) < 0.5


def test_help_imports_nothing_heavy() -> None:
    code = (
        "import sys, contextlib, io\nfrom planfly.cli import main\n"
        "with contextlib.redirect_stdout(io.StringIO()), contextlib.suppress(SystemExit):\n    main(['--help'])\n"
        "print([name for name in ('numpy', 'numba', 'jsbsim', 'matplotlib', 'pydantic', 'pymavlink', 'rich',"
        " 'argcomplete') if name in sys.modules])"
    )
    result = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True, cwd=ROOT)
    assert result.stdout.strip() == "[]"


@pytest.mark.parametrize("command", [command.name for command in COMMANDS])
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


def test_no_function_is_longer_than_80_lines() -> None:
    lengths = {
        f"{name_of(file)}:{function.name}": (function.end_lineno or 0) - function.lineno + 1
        for file in CODE
        for function in functions(file)
    }
    assert {function: length for function, length in lengths.items() if length > LONGER.get(function, LONGEST)} == {}
    # A function that was shortened leaves the list.
    assert [function for function in LONGER if lengths.get(function, 0) <= LONGEST] == []


def kernels_by_place() -> dict[tuple[str, str], str]:
    """The decorator of each kernel, by its module and name."""
    return {
        (module_name(file), node.name): decorator.id
        for file in CODE
        if file.relative_to(ROOT).parts[0] in PACKAGES
        for node in parsed(file).body
        if isinstance(node, ast.FunctionDef)
        for decorator in node.decorator_list
        if isinstance(decorator, ast.Name) and decorator.id in KERNELS
    }


def module_name(file: Path) -> str:
    return name_of(file).removesuffix(".py").removesuffix("/__init__").replace("/", ".")


def called_from_python(kernels: dict[tuple[str, str], str]) -> set[tuple[str, str]]:
    """Kernels that a function of ours names which is none itself, or that a module names outside its functions."""
    found = set()
    for file in CODE:
        module = module_name(file)
        if file.relative_to(ROOT).parts[0] not in PACKAGES:
            continue
        known = {
            alias.asname or alias.name: (node.module, alias.name)
            for node in nodes_of(file)
            if isinstance(node, ast.ImportFrom) and node.module
            for alias in node.names
        } | {name: (home, name) for home, name in kernels if home == module}
        for node in parsed(file).body:
            inside = isinstance(node, ast.FunctionDef) and (module, node.name) in kernels
            if not inside and not isinstance(node, ast.Import | ast.ImportFrom):
                names = {part.id for part in ast.walk(node) if isinstance(part, ast.Name)}
                found |= {known[name] for name in names & set(known) if known[name] in kernels}
    return found


def test_kernels_that_only_kernels_call_have_no_wrapper_for_python() -> None:
    """It is a seventh of what compiling takes."""
    kernels = kernels_by_place()
    called = called_from_python(kernels)
    assert len(called) > 50
    assert {place for place, decorator in kernels.items() if decorator in INNER} == set(kernels) - called


def test_kernels_name_what_they_read() -> None:
    """Coordinates 0, 1 and 2 of a row are what they are; a column from 3 on is a field that has a name."""
    numbered = [
        f"{name_of(file)}:{function.name}: {column}"
        for file in OURS
        for function in functions(file)
        if is_kernel(function)
        for column in columns(function)
    ]
    assert numbered == []


def assigned(function: Function) -> Iterator[tuple[str, ast.expr]]:
    """Names that a function assigns to, and what each is given."""
    for node in ast.walk(function):
        for target in node.targets if isinstance(node, ast.Assign) else ():
            assert isinstance(node, ast.Assign)
            if isinstance(target, ast.Tuple) and isinstance(node.value, ast.Tuple):
                pairs = zip(target.elts, node.value.elts, strict=True)
                yield from ((name.id, value) for name, value in pairs if isinstance(name, ast.Name))
            elif isinstance(target, ast.Name):
                yield target.id, node.value


def freed_early(function: Function) -> set[str]:
    """Records of a function's own arrays that it uses after the last use of their array: numba frees that before."""

    def is_new(value: ast.AST) -> bool:
        name = value.func.attr if isinstance(value, ast.Call) and isinstance(value.func, ast.Attribute) else ""
        return name in ("zeros", "empty") and ast.unparse(value).rstrip(")").endswith(tuple(string.ascii_uppercase))

    used: dict[str, int] = {}
    for node in ast.walk(function):
        if isinstance(node, ast.Name):
            used[node.id] = max(node.lineno, used.get(node.id, 0))
    given = list(assigned(function))
    arrays = {name for name, value in given if is_new(value)}
    taken = [(name, value.value) for name, value in given if isinstance(value, ast.Subscript)]
    kept = {name: source.id for name, source in taken if isinstance(source, ast.Name) and source.id in arrays}
    return {name for name, array in kept.items() if used[name] > used[array]} | {
        name for name, source in taken if is_new(source)
    }


FREED = """
def kernel(out):
    own, other, kept = np.zeros(2, MOTION), np.zeros(1, dtype=STATE), np.zeros(3, MOTION)
    here, there, third = own[0], other[0], kept[k]
    last = np.empty(1, MOTION)[0]
    out.east = here.east + third.east
    return kept.size + own.size + there.up
"""


def test_kernels_keep_the_arrays_of_their_records() -> None:
    """Compiled code frees an array after its last use, and a record of it does not count as one."""
    (example,) = (node for node in ast.walk(ast.parse(FREED)) if isinstance(node, ast.FunctionDef))
    assert freed_early(example) == {"there", "last"}
    found = {
        f"{name_of(file)}:{function.name}: {name}"
        for file in OURS
        for function in functions(file)
        if is_kernel(function)
        for name in freed_early(function)
    }
    assert found == set()


def test_docstrings_and_comments_lean_on_no_other_text() -> None:
    leaning = [
        f"{name_of(file)}: {phrase}"
        for file in CODE
        for phrase in LEANING
        if phrase in text_of(file) and re.search(rf"\b{phrase}\b", text_of(file))
    ]
    assert leaning == []


@cache
def names_of(file: Path) -> frozenset[str]:
    """What a module defines or imports, at any depth."""
    nodes = list(nodes_of(file))
    defined = {node.name for node in nodes if isinstance(node, Function | ast.ClassDef)}
    assigned = {node.id for node in nodes if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store)}
    attributes = {node.attr for node in nodes if isinstance(node, ast.Attribute) and isinstance(node.ctx, ast.Store)}
    imports = (node for node in nodes if isinstance(node, ast.ImportFrom))
    imported = {alias.asname or alias.name for node in imports for alias in node.names}
    return frozenset(defined | assigned | attributes | imported)


def resolves(reference: str) -> bool:
    """Whether a dotted name leads from a folder of ours to a module, and on to what it defines."""
    parts = reference.split(".")
    for k in range(len(parts), 0, -1):
        folder, rest = ROOT.joinpath(*parts[:k]), parts[k:]
        for module in (folder.with_suffix(".py"), folder / "__init__.py"):
            if module.is_file():
                return names_of(module).issuperset(rest)
    return ROOT.joinpath(*parts).is_dir()


def test_benchmarks_and_examples_import_what_there_is() -> None:
    """No test runs them all: a name that has gone would show when somebody does."""
    lost = [
        f"{name_of(file)}:{node.lineno}: {node.module}.{alias.name}"
        for file in CODE
        if file.relative_to(ROOT).parts[0] in ("benchmarks", "examples")
        for node in nodes_of(file)
        if isinstance(node, ast.ImportFrom) and node.module
        if node.module.partition(".")[0] in (*PACKAGES, "benchmarks", "tests") and node.module != "planfly"
        for alias in node.names
        if not resolves(f"{node.module}.{alias.name}")
    ]
    assert lost == []


def test_the_files_that_compile_kernels_first_are_there() -> None:
    assert not [file for file in COMPILING if not (ROOT / "tests" / file).is_file()]


def test_names_in_backquotes_lead_to_what_they_name() -> None:
    """A reference such as `world.raster.read_terrain`, in a docstring, a comment or a page, leads somewhere."""
    # The changelog tells of names that have gone.
    pages = [
        *ROOT.glob("*.md"),
        *ROOT.glob("docs/*.md"),
        *(file for package in PACKAGES for file in (ROOT / package).rglob("*.md")),
    ]
    pages.remove(ROOT / "CHANGELOG.md")
    lost = [
        f"{name_of(file)}: {reference}"
        for file in (*CODE, *pages)
        for reference in REFERENCE.findall(text_of(file))
        if not resolves(reference)
    ]
    assert lost == []


def test_optimisers_import_nothing_of_ours_but_kernels_and_array_types() -> None:
    """As a list of what is allowed: a contract names what is forbidden, and a new module would slip through."""
    files = [file for file in OURS if file.parent == ROOT / "planner" / "optimisers"]
    assert len(files) > 5
    imported = {
        node.module
        for file in files
        for node in nodes_of(file)
        if isinstance(node, ast.ImportFrom) and node.module and node.module.partition(".")[0] in PACKAGES
    }
    assert {module for module in imported if not module.startswith("planner.optimisers")} <= {
        "world.arrays",
        "world.kernels",
    }


def error_kinds() -> set[str]:
    """Names of `PlanflyError` and of all that is made of it."""
    kinds, before = {"PlanflyError"}, set[str]()
    classes = [node for file in OURS for node in nodes_of(file) if isinstance(node, ast.ClassDef)]
    derived = [(node.name, {ast.unparse(base) for base in node.bases}) for node in classes]
    while kinds != before:
        before = set(kinds)
        kinds |= {name for name, bases in derived if before & bases}
    return kinds


def placeless_errors(nodes: Iterable[ast.AST], kinds: set[str]) -> Iterator[str]:
    """Errors made without a file and a field; a kind that a function is handed, `error: type[PlanflyError]`, counts."""
    typed = {f"type[{kind}]" for kind in kinds}
    nodes = list(nodes)
    named = (node for node in nodes if isinstance(node, ast.arg) and isinstance(node.annotation, ast.Subscript))
    handed = {node.arg for node in named if node.annotation and ast.unparse(node.annotation) in typed}
    calls = (node for node in nodes if isinstance(node, ast.Call) and isinstance(node.func, ast.Name))
    for call in calls:
        # None: by **, of what a helper has put together.
        given = {"file", "field", None} & {keyword.arg for keyword in call.keywords}
        if isinstance(call.func, ast.Name) and call.func.id in kinds | handed and not given:
            yield f"{call.lineno}: {ast.unparse(call)[:80]}"


def test_every_error_carries_its_file_or_field_apart() -> None:
    """By keyword, or through `PlanflyError.at`, `of_argument` or `from_error`: programs need not parse the line."""
    # A flight that cannot begin: its first argument is the file.
    kinds = error_kinds() - {"StartError"}
    assert len(kinds) > 9
    errors = "def f(e: type[LogError]) -> None:\n    raise {}\n"
    bare = [f"{name}('a: b')" for name in (*kinds, "e")] + ["LogError('a', value=3, allowed='0..2')"]
    assert all(list(placeless_errors(ast.walk(ast.parse(errors.format(one))), kinds)) for one in bare)
    found = [f"{name_of(file)}:{one}" for file in OURS for one in placeless_errors(nodes_of(file), kinds)]
    assert found == []


def module_names(file: Path) -> Iterator[str]:
    """What a module binds at its top level, as often as it does."""
    for node in parsed(file).body:
        if isinstance(node, Function | ast.ClassDef):
            overload = any(isinstance(mark, ast.Name) and mark.id == "overload" for mark in node.decorator_list)
            yield from () if overload else (node.name,)
        elif isinstance(node, ast.Assign | ast.AnnAssign):
            targets = node.targets if isinstance(node, ast.Assign) else [node.target]
            for name in (part for target in targets for part in ast.walk(target)):
                if isinstance(name, ast.Name) and isinstance(name.ctx, ast.Store):
                    yield name.id


def test_no_module_defines_a_name_twice() -> None:
    """The later of two constants of a merged file would count for both."""
    doubled = {name_of(file): [name for name, n in Counter(module_names(file)).items() if n > 1] for file in CODE}
    assert {file: names for file, names in doubled.items() if names} == {}
