"""Small wrong changes of one function: the syntax tree is changed in one place and compiled again.

A mutant is installed by exchanging the code object of the function, so that every name of the function runs the wrong
code. This requires uncompiled functions (NUMBA_DISABLE_JIT=1).

Not mutated: docstrings, annotations, messages, checks of arguments that only raise, and whether an array is copied.
"""

import ast
import contextlib
import inspect
import textwrap
from collections import Counter
from collections.abc import Callable, Iterator
from types import CodeType
from typing import NamedTuple

SWAPPED_OPERATORS: dict[type, type] = {
    ast.Add: ast.Sub,
    ast.Sub: ast.Add,
    ast.Mult: ast.Div,
    ast.Div: ast.Mult,
    ast.FloorDiv: ast.Mult,
    ast.Mod: ast.FloorDiv,
    ast.Pow: ast.Mult,
    ast.BitAnd: ast.BitOr,
    ast.BitOr: ast.BitAnd,
    ast.LShift: ast.RShift,
    ast.RShift: ast.LShift,
    ast.MatMult: ast.Mult,
}
COMPARISONS: dict[type, tuple[type, ...]] = {
    ast.Lt: (ast.LtE, ast.Gt),
    ast.LtE: (ast.Lt, ast.GtE),
    ast.Gt: (ast.GtE, ast.Lt),
    ast.GtE: (ast.Gt, ast.LtE),
    ast.Eq: (ast.NotEq,),
    ast.NotEq: (ast.Eq,),
}
SWAPPED_CALLS = {
    "sin": "cos", "cos": "sin", "min": "max", "max": "min", "floor": "ceil", "ceil": "floor", "log": "exp",
    "zeros": "ones", "zeros_like": "ones_like", "minimum": "maximum", "maximum": "minimum", "argmax": "argmin",
}  # fmt: skip
UNWRAPPED_CALLS = {"abs", "sqrt", "conj"}

Place = tuple[ast.AST, str, int | None]  # parent, field, position within a list


class Change(NamedTuple):
    """One place of a function and its replacement."""

    kind: str
    name: str  # unique within the function, unchanged when lines move
    place: Place
    node: ast.AST


class Mutant(NamedTuple):
    """A wrong version of one function."""

    kernel: str
    kind: str
    name: str
    code: CodeType


def mutants(kernel: str, function: Callable) -> list[Mutant]:
    """All mutants of a plain Python function, in the order of its source."""
    tree = _tree(function)
    found = []
    for change in changes(tree):
        with applied(change):
            code = _compiled(tree, function)
        found.append(Mutant(kernel, change.kind, f"{kernel}: {change.name}", code))
    return found


@contextlib.contextmanager
def in_place(function: Callable, code: CodeType) -> Iterator[None]:
    """The function runs `code` inside."""
    before = function.__code__
    function.__code__ = code  # type: ignore[attr-defined]
    try:
        yield
    finally:
        function.__code__ = before  # type: ignore[attr-defined]


def _tree(function: Callable) -> ast.FunctionDef:
    tree = ast.parse(textwrap.dedent(inspect.getsource(function))).body[0]
    assert isinstance(tree, ast.FunctionDef)
    ast.increment_lineno(tree, function.__code__.co_firstlineno - 1)
    tree.decorator_list = []
    return tree


def _compiled(tree: ast.FunctionDef, function: Callable) -> CodeType:
    module = ast.fix_missing_locations(ast.Module([tree], []))
    compiled = compile(module, function.__code__.co_filename, "exec")
    return next(c for c in compiled.co_consts if isinstance(c, CodeType) and c.co_name == tree.name)


def replaced(function: Callable, *changes: tuple[str, str]) -> CodeType:
    """The code of the function with pieces (old, new) of its source replaced; each old piece occurs exactly once."""
    source = textwrap.dedent(inspect.getsource(function))
    for old, new in changes:
        if source.count(old) != 1:
            raise ValueError(f"{function.__qualname__}: {old!r} occurs {source.count(old)} times")
        source = source.replace(old, new)
    tree = ast.parse(source).body[0]
    assert isinstance(tree, ast.FunctionDef)
    tree.decorator_list = []
    return _compiled(tree, function)


# ---- where a function can be changed ----


def changes(tree: ast.FunctionDef) -> list[Change]:
    """Every change, named by the changed expression and its statement."""
    found: list[Change] = []
    seen: Counter[str] = Counter()
    indices = _indices(tree)
    for statement, place, node in sites(tree):
        for kind, new in _alternatives(node, id(node) in indices):
            new = ast.fix_missing_locations(ast.copy_location(new, node))
            name = name_of(statement, node, new)
            seen[name] += 1
            found.append(Change(kind, name if seen[name] == 1 else f"{name} ({seen[name]})", place, new))
    return found


def name_of(statement: ast.stmt, node: ast.AST, new: ast.AST) -> str:
    """What a change does, as text: the old and the new expression and the first line of their statement."""
    if isinstance(new, ast.Pass):
        return f"`{_header(statement)}` dropped"
    return f"`{_text(node)}` -> `{_text(new)}` in `{_header(statement)}`"


def _text(node: ast.AST) -> str:
    return ast.unparse(node)


def _header(statement: ast.stmt) -> str:
    """The first line of a statement, without what it contains."""
    return _text(statement).splitlines()[0].rstrip(":")


def sites(tree: ast.FunctionDef) -> Iterator[tuple[ast.stmt, Place, ast.AST]]:
    """Every node of a function that a change may replace, with its statement and its place in the tree."""
    for k, statement in enumerate(tree.body):
        if k == 0 and isinstance(statement, ast.Expr) and isinstance(statement.value, ast.Constant):
            continue
        yield from _walk(statement, statement, (tree, "body", k))


def _walk(statement: ast.stmt, node: ast.AST, place: Place) -> Iterator[tuple[ast.stmt, Place, ast.AST]]:
    if isinstance(node, ast.stmt):
        statement = node
        if _only_checks(node):
            return
    if (
        isinstance(node, ast.JoinedStr)
        or _is_call_of(node, "reshape")
        or (isinstance(node, ast.keyword) and node.arg == "copy")
    ):
        return
    yield statement, place, node
    for field, value in ast.iter_fields(node):
        if field == "annotation":
            continue
        if isinstance(value, list):
            for k, item in enumerate(value):
                if isinstance(item, ast.expr | ast.stmt | ast.keyword):
                    yield from _walk(statement, item, (node, field, k))
        elif isinstance(value, ast.expr):
            yield from _walk(statement, value, (node, field, None))


def _is_call_of(node: ast.AST, name: str) -> bool:
    """Lengths of a reshape are left alone: NumPy reads any negative one as the unknown one."""
    return isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute) and node.func.attr == name


def _only_checks(node: ast.stmt) -> bool:
    if isinstance(node, ast.If):
        return not node.orelse and all(isinstance(s, ast.Raise) for s in node.body)
    return isinstance(node, ast.Raise | ast.Assert)


@contextlib.contextmanager
def applied(change: Change) -> Iterator[None]:
    """The tree with the change."""
    parent, field, position = change.place
    if position is None:
        before = getattr(parent, field)
        setattr(parent, field, change.node)
    else:
        before = getattr(parent, field)[position]
        getattr(parent, field)[position] = change.node
    try:
        yield
    finally:
        if position is None:
            setattr(parent, field, before)
        else:
            getattr(parent, field)[position] = before


def _indices(tree: ast.AST) -> set[int]:
    """Identities of the nodes that are an index by themselves: `0` and `i` of a[0, i]."""
    slices = [node.slice for node in ast.walk(tree) if isinstance(node, ast.Subscript)]
    return {id(e) for s in slices for e in (s.elts if isinstance(s, ast.Tuple) else [s])}


# ---- the replacements ----


def _alternatives(node: ast.AST, is_index: bool) -> Iterator[tuple[str, ast.AST]]:
    if isinstance(node, ast.BinOp):
        yield from _binary(node)
    elif isinstance(node, ast.AugAssign):
        yield from _augmented(node)
    elif isinstance(node, ast.Compare):
        for operator in COMPARISONS.get(type(node.ops[0]), ()):
            yield "comparison", ast.Compare(node.left, [operator(), *node.ops[1:]], node.comparators)
    elif isinstance(node, ast.BoolOp):
        yield "logic", ast.BoolOp(ast.Or() if isinstance(node.op, ast.And) else ast.And(), node.values)
    elif isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub | ast.Not | ast.Invert):
        yield ("sign" if isinstance(node.op, ast.USub) else "logic"), node.operand
    elif isinstance(node, ast.IfExp):
        yield "logic", ast.IfExp(node.test, node.orelse, node.body)
    elif isinstance(node, ast.Constant):
        yield from _constant(node, is_index)
    elif isinstance(node, ast.Name) and is_index:
        yield "index", ast.BinOp(node, ast.Sub(), ast.Constant(1))
    elif isinstance(node, ast.Call):
        yield from _call(node)
    if isinstance(node, ast.stmt) and _droppable(node):
        yield "dropped statement", ast.Pass()


def _binary(node: ast.BinOp) -> Iterator[tuple[str, ast.AST]]:
    other = SWAPPED_OPERATORS.get(type(node.op))
    if other is not None:
        yield "operator", ast.BinOp(node.left, other(), node.right)
    if isinstance(node.op, ast.Add | ast.Sub):
        yield "dropped term", node.left
        yield "dropped term", node.right if isinstance(node.op, ast.Add) else ast.UnaryOp(ast.USub(), node.right)


def _augmented(node: ast.AugAssign) -> Iterator[tuple[str, ast.AST]]:
    other = SWAPPED_OPERATORS.get(type(node.op))
    if other is not None:
        yield "operator", ast.AugAssign(node.target, other(), node.value)
    yield "operator", ast.Assign([node.target], node.value)


def _constant(node: ast.Constant, is_index: bool) -> Iterator[tuple[str, ast.AST]]:
    value = node.value
    if isinstance(value, bool):
        yield "constant", ast.Constant(not value)
    elif isinstance(value, int) and is_index:
        yield "index", ast.Constant(value - 1 if value > 0 else 1)
    elif isinstance(value, int):
        yield "constant", ast.Constant(value + 1)
    elif isinstance(value, float):
        yield "constant", ast.Constant(value / 2 if value else 1.0)


def _call(node: ast.Call) -> Iterator[tuple[str, ast.AST]]:
    name = node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", "")
    if name in SWAPPED_CALLS:
        other = SWAPPED_CALLS[name]
        function = (
            ast.Attribute(node.func.value, other, ast.Load())
            if isinstance(node.func, ast.Attribute)
            else ast.Name(other, ast.Load())
        )
        yield "function", ast.Call(function, node.args, node.keywords)
    if name in UNWRAPPED_CALLS and len(node.args) == 1 and not node.keywords:
        yield "function", node.args[0]


def _droppable(node: ast.stmt) -> bool:
    """Statements without which the function still runs: those that bind a new name are not among them."""
    if isinstance(node, ast.Assign):
        return any(isinstance(t, ast.Subscript) for t in node.targets) or any(
            isinstance(e, ast.Subscript) for t in node.targets if isinstance(t, ast.Tuple) for e in t.elts
        )
    plain_if = isinstance(node, ast.If) and not node.orelse
    return plain_if or isinstance(node, ast.AugAssign | ast.Expr | ast.Continue | ast.Break)
