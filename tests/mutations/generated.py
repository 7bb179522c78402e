"""Mutants made by walking through sources: every limit larger and smaller, every comparison and sign turned round."""

import ast
from collections.abc import Iterator
from itertools import accumulate

from tests.mutations.mutant import ROOT, Mutant

LIMITS = "logs/verdict/tolerances.py"
# A limit times this, and divided by it: what a pair of cases some per cent inside and outside must notice.  A count is
# one more, and one less.
STEP = 1.3
# Of bounds on garbage, condition numbers and rounding only the order of magnitude matters.
ORDERS = 1000.0
BY_ORDERS = (
    "MAX_PLAUSIBLE_POSITION_M",
    "MAX_PLAUSIBLE_SPEED_MPS",
    "MAX_PLAUSIBLE_VALUE",
    "SPHERE_STAY_TOLERANCE_S",
    "U_TURN_RAD",
    "CHORD_TIME_S",
    "SPHERE_FAR_DIAGONALS",
)
# Numbers that decide how much is computed, where more costs nothing but time: how each is changed.
EFFORTS = {"CHORD_TIME_S": "*", "SPHERE_FAR_DIAGONALS": "/", "SUGGESTION_TRIAL_COUNT": ""}

_COMPARISONS = {ast.Lt: ">=", ast.LtE: ">", ast.Gt: "<=", ast.GtE: "<", ast.Eq: "!=", ast.NotEq: "=="}
_SIGNS: dict[type[ast.operator], tuple[str, str]] = {
    ast.Add: ("+", "-"),
    ast.Sub: ("-", "+"),
    ast.Mult: ("*", "/"),
    ast.Div: ("/", "*"),
}
_NAMES = {
    "min": "max",
    "max": "min",
    "sin": "cos",
    "cos": "sin",
    "any": "all",
    "all": "any",
    "argmin": "argmax",
    "argmax": "argmin",
    "minimum": "maximum",
    "maximum": "minimum",
    "nanargmin": "nanargmax",
}


def limit_mutants() -> list[Mutant]:
    """Two mutants for every number of the verdict's tolerances: one larger, one smaller."""
    source = _Source("limits", LIMITS)
    found = []
    for node in source.tree.body:
        if not isinstance(node, ast.Assign):
            continue
        names = [name.id for target in node.targets for name in ast.walk(target) if isinstance(name, ast.Name)]
        factor = ORDERS if any(name in BY_ORDERS for name in names) else STEP
        for number in ast.walk(node.value):
            # A name or a key is no number, nor is what calm air adds to one.
            if not isinstance(number, ast.Constant) or not isinstance(number.value, int | float) or not number.value:
                continue
            whole = isinstance(number.value, int)
            signs = EFFORTS.get(names[0], "+-" if whole else "*/")
            found += [source.mutant(number, f"({number.value!r} {sign} {1 if whole else factor})") for sign in signs]
    return found


def walked_mutants(part: str, file: str) -> list[Mutant]:
    """Mutants of a module's code: comparisons, signs, choices and truths turned round, numbers half as large again."""
    source = _Source(part, file)
    return [mutant for node in _code(source.tree) for mutant in _of_node(source, node)]


class _Source:
    """A file's bytes and tree."""

    def __init__(self, part: str, file: str) -> None:
        self.part, self.file = part, file
        self.data = (ROOT / file).read_bytes()
        self.tree = ast.parse(self.data)
        self.starts = [0, *accumulate(len(line) for line in self.data.splitlines(keepends=True))]

    def span(self, node: ast.expr) -> tuple[int, int]:
        """First byte of a node, and the one after its last."""
        assert node.end_lineno is not None
        assert node.end_col_offset is not None
        return self.starts[node.lineno - 1] + node.col_offset, self.starts[node.end_lineno - 1] + node.end_col_offset

    def mutant(self, node: ast.expr, new: str) -> Mutant:
        return self.between(*self.span(node), new)

    def between(self, start: int, stop: int, new: str) -> Mutant:
        return Mutant(self.part, self.file, start, stop, self.data[start:stop].decode(), new)

    def operator(self, left: ast.expr, right: ast.expr, old: str, new: str) -> Mutant:
        """The operator that stands between two nodes replaced, with both of them for what it says."""
        (start, _), (_, stop) = self.span(left), self.span(right)
        before, after = self.span(left)[1], self.span(right)[0]
        gap = self.data[before:after].decode()
        return self.between(
            start, stop, self.data[start:before].decode() + gap.replace(old, new, 1) + self.data[after:stop].decode()
        )


def _code(node: ast.AST) -> Iterator[ast.expr]:
    """Expressions whose value decides something: no annotation, subscript, message or decorator."""
    for name, child in ast.iter_fields(node):
        if name in ("annotation", "returns", "decorator_list", "slice", "bases", "type_params"):
            continue
        for one in child if isinstance(child, list) else [child]:
            if isinstance(one, ast.JoinedStr) or not isinstance(one, ast.AST):
                continue
            if isinstance(one, ast.Call) and _name(one.func) in (
                "message",
                "range",
                "TypeVar",
                "dtype",
                "record_dtype",
            ):
                continue
            if isinstance(one, ast.keyword) and one.arg in ("dtype", "strict", "frozen", "slots", "axis", "ndigits"):
                continue
            if isinstance(one, ast.expr):
                yield one
            yield from _code(one)


def _name(node: ast.expr) -> str:
    return node.attr if isinstance(node, ast.Attribute) else node.id if isinstance(node, ast.Name) else ""


def _of_node(source: _Source, node: ast.expr) -> Iterator[Mutant]:
    if isinstance(node, ast.Compare) and len(node.ops) == 1 and type(node.ops[0]) in _COMPARISONS:
        new = _COMPARISONS[type(node.ops[0])]
        old = {">=": "<", ">": "<=", "<=": ">", "<": ">=", "!=": "==", "==": "!="}[new]
        yield source.operator(node.left, node.comparators[0], old, new)
    elif isinstance(node, ast.BinOp) and type(node.op) in _SIGNS and not _is_text(node):
        yield source.operator(node.left, node.right, *_SIGNS[type(node.op)])
    elif isinstance(node, ast.BoolOp):
        old, new = (" and ", " or ") if isinstance(node.op, ast.And) else (" or ", " and ")
        yield source.operator(node.values[0], node.values[1], old.strip(), new.strip())
    elif isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub | ast.Not):
        yield source.mutant(node, source.mutant(node.operand, "").old)
    elif isinstance(node, ast.Call) and _name(node.func) in _NAMES:
        end = source.span(node.func)[1]
        name = _name(node.func)
        yield source.between(end - len(name), end, _NAMES[name])
    elif isinstance(node, ast.Constant) and isinstance(node.value, float) and 0.0 < abs(node.value) < 1e6:
        yield source.mutant(node, repr(round(1.5 * node.value, 12)))


def _is_text(node: ast.expr) -> bool:
    """Whether a sum is of strings or lists, as far as it shows."""
    parts = [one for one in ast.walk(node) if isinstance(one, ast.JoinedStr | ast.List | ast.Tuple | ast.ListComp)]
    return bool(parts) or any(isinstance(one, ast.Constant) and isinstance(one.value, str) for one in ast.walk(node))
