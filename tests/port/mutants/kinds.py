"""Single wrong changes of a function, as authors of ports make them: the kinds, by the syntax of the right text.

`tests/mutation/mutator.py` has the changes of one symbol: an operator, a comparison, a dropped term. Those here are the
changes of a habit: a clamp that is removed or added, a condition reduced to one of its parts, another reduction, a
small number added to a divisor, single precision, a neighbouring name, an assignment left out.
"""

import ast
import warnings
from collections import Counter
from collections.abc import Callable, Iterator
from itertools import pairwise
from types import CodeType
from typing import NamedTuple

from mutation.mutator import Change, Mutant, applied, changes, name_of, sites

OTHER_CALLS = {
    "sum": ("mean",), "mean": ("sum", "median"), "median": ("mean", "max"), "any": ("all",), "all": ("any",),
    "ceil": ("floor", "rint"), "floor": ("rint",), "trunc": ("floor",), "rint": ("floor",), "round": ("floor",),
    "tanh": ("sin",), "sign": ("asarray",), "abs": ("square",), "exp": ("exp2",), "log": ("log2",),
    "setdiff1d": ("union1d",), "argsort": ("argmax",),
}  # fmt: skip
IDENTITIES = {"sort", "unique", "tile", "conj", "cumsum", "square", "round", "rint", "reversed"}
PARTNERS = {"fx": "fy", "fy": "fx", "cx": "cy", "cy": "cx", "width": "height", "height": "width"}
EPSILON, SMALL = 1e-7, 1e-10


class Source(NamedTuple):
    """A module of a port as text, and its functions."""

    name: str
    text: str
    functions: dict[str, Callable]


def wrong_versions(source: Source) -> Iterator[tuple[Callable, Mutant]]:
    """Every function with each of its mutants, in the order of the source."""
    for tree in (node for node in ast.parse(source.text).body if isinstance(node, ast.FunctionDef)):
        function = source.functions.get(tree.name)
        if function is None:
            continue
        seen: set[str] = set()
        for change in [*changes(tree), *habits(tree)]:
            with applied(change):
                text = ast.unparse(tree)
                if text in seen:
                    continue
                seen.add(text)
                code = _compiled(tree, function)
            name = f"{source.name}.{tree.name}"
            yield function, Mutant(name, change.kind, f"{name}: {change.name}", code)


def _compiled(tree: ast.FunctionDef, function: Callable) -> CodeType:
    module = ast.fix_missing_locations(ast.Module([tree], []))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SyntaxWarning)  # a wrong version may index a number
        made = compile(module, function.__code__.co_filename, "exec")
    return next(c for c in made.co_consts if isinstance(c, CodeType) and c.co_name == tree.name)


def habits(tree: ast.FunctionDef) -> list[Change]:
    """The changes of this module, named as those of `changes`."""
    found: list[Change] = []
    seen: Counter[str] = Counter()
    neighbours = _neighbours(tree)
    bound: set[str] = {a.arg for a in (*tree.args.args, *tree.args.kwonlyargs)}
    for statement, place, node in sites(tree):
        options = [*_expressions(node), *_named(node, neighbours), *_statements(node, bound)]
        if isinstance(node, ast.Assign):
            bound |= {n.id for t in node.targets for n in ast.walk(t) if isinstance(n, ast.Name)}
        if _is_value(place):
            options += _added(node)
        for kind, new in options:
            new = ast.fix_missing_locations(ast.copy_location(new, node))
            name = name_of(statement, node, new)
            seen[name] += 1
            found.append(Change(kind, name if seen[name] == 1 else f"{name} ({seen[name]})", place, new))
    return found


def _is_value(place: tuple[ast.AST, str, int | None]) -> bool:
    """Whether a node is the value of an assignment or of a return, or an element of such a tuple or dictionary."""
    parent, field, _ = place
    if isinstance(parent, ast.Tuple):
        return field == "elts" and isinstance(parent.ctx, ast.Load)
    if isinstance(parent, ast.Dict):
        return field == "values"
    return field == "value" and isinstance(parent, ast.Assign | ast.Return | ast.AugAssign)


def _called(node: ast.AST) -> str:
    if not isinstance(node, ast.Call):
        return ""
    return node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", "")


def _numpy(name: str, *arguments: ast.expr) -> ast.Call:
    return ast.Call(ast.Attribute(ast.Name("np", ast.Load()), name, ast.Load()), list(arguments), [])


def _expressions(node: ast.AST) -> Iterator[tuple[str, ast.AST]]:
    if isinstance(node, ast.Call):
        yield from _bounds(node)
        yield from _calls(node)
    elif isinstance(node, ast.BinOp):
        yield from _operations(node)
    elif isinstance(node, ast.BoolOp):
        yield from (("part of a condition", one) for one in node.values)
    elif isinstance(node, ast.IfExp):
        yield from (("part of a condition", one) for one in (node.body, node.orelse))
    elif isinstance(node, ast.Constant) and not isinstance(node.value, bool):
        if isinstance(node.value, int):
            yield "constant", ast.Constant(node.value - 1)
        elif isinstance(node.value, float) and node.value:
            yield "constant", ast.Constant(node.value * 2)
            yield "constant", ast.Constant(node.value * 1.01)
    elif isinstance(node, ast.Attribute) and node.attr == "T":
        yield "transpose left out", node.value
    elif isinstance(node, ast.Subscript) and ast.unparse(node.slice).replace(" ", "") == "::-1":
        yield "call left out", node.value


def _bounds(node: ast.Call) -> Iterator[tuple[str, ast.AST]]:
    """Clamps removed, a selection without its condition."""
    name, arguments = _called(node), node.args
    if name in ("min", "max", "minimum", "maximum") and len(arguments) == 2:
        yield from (("clamp removed", one) for one in arguments)
    if name == "clip" and len(arguments) == 3:
        yield "clamp removed", arguments[0]
        yield "clamp removed", _numpy("maximum", arguments[0], arguments[1])
        yield "clamp removed", _numpy("minimum", arguments[0], arguments[2])
    if name == "where" and len(arguments) == 3:
        yield from (("selection", one) for one in arguments[1:])
        yield "selection", ast.Call(node.func, [arguments[0], arguments[2], arguments[1]], [])


def _calls(node: ast.Call) -> Iterator[tuple[str, ast.AST]]:
    """Another function, none, or its arguments in another order."""
    name, arguments = _called(node), node.args
    for other in OTHER_CALLS.get(name, ()) if isinstance(node.func, ast.Attribute) else ():
        target = node.func.value
        if other == "median" and not (isinstance(target, ast.Name) and target.id == "np"):
            yield "reduction", _numpy(other, target, *arguments)
        elif not node.keywords or other in ("mean", "sum"):
            yield "reduction", ast.Call(ast.Attribute(target, other, ast.Load()), arguments, node.keywords)
    if name in IDENTITIES and arguments:
        yield "call left out", arguments[0]
    if isinstance(node.func, ast.Name) and name not in ("min", "max"):
        for k in range(len(arguments) - 1):
            swapped = [*arguments[:k], arguments[k + 1], arguments[k], *arguments[k + 2 :]]
            yield "arguments exchanged", ast.Call(node.func, swapped, node.keywords)
    if name == "sqrt":
        yield "small number added", _numpy("sqrt", ast.BinOp(arguments[0], ast.Add(), ast.Constant(SMALL)))


def _operations(node: ast.BinOp) -> Iterator[tuple[str, ast.AST]]:
    """One side of a condition or a product, a small number in a divisor."""
    if isinstance(node.op, ast.BitAnd | ast.BitOr):
        yield from (("part of a condition", one) for one in (node.left, node.right))
    if isinstance(node.op, ast.Div):
        more = ast.BinOp(node.right, ast.Add(), ast.Constant(EPSILON))
        yield "small number added", ast.BinOp(node.left, ast.Div(), more)
    if isinstance(node.op, ast.Mult | ast.Div):
        yield "dropped factor", node.left
    if isinstance(node.op, ast.Mult):
        yield "dropped factor", node.right


def _neighbours(tree: ast.FunctionDef) -> dict[str, list[str]]:
    """The names that stand beside a name among the parameters or in an unpacked tuple."""
    groups = [[a.arg for a in tree.args.args]]
    for node in ast.walk(tree):
        if isinstance(node, ast.Tuple) and isinstance(node.ctx, ast.Store):
            groups.append([e.id for e in node.elts if isinstance(e, ast.Name)])
    found: dict[str, list[str]] = {}
    for group in groups:
        for one, other in pairwise(group):
            found.setdefault(one, []).append(other)
            found.setdefault(other, []).append(one)
    return found


def _named(node: ast.AST, neighbours: dict[str, list[str]]) -> Iterator[tuple[str, ast.AST]]:
    if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Load):
        yield from (("neighbouring name", ast.Name(other, ast.Load())) for other in neighbours.get(node.id, ()))
    if isinstance(node, ast.Attribute) and node.attr in PARTNERS and isinstance(node.ctx, ast.Load):
        yield "neighbouring name", ast.Attribute(node.value, PARTNERS[node.attr], ast.Load())
    if isinstance(node, ast.Subscript) and isinstance(node.slice, ast.Constant) and node.slice.value in PARTNERS:
        yield "neighbouring name", ast.Subscript(node.value, ast.Constant(PARTNERS[node.slice.value]), ast.Load())


def _statements(node: ast.AST, bound: set[str]) -> Iterator[tuple[str, ast.AST]]:
    if isinstance(node, ast.Assign) and all(isinstance(t, ast.Name) and t.id in bound for t in node.targets):
        yield "assignment left out", ast.Pass()


def _added(node: ast.AST) -> list[tuple[str, ast.AST]]:
    if not isinstance(node, ast.BinOp | ast.Call | ast.Name | ast.Attribute | ast.Subscript | ast.IfExp | ast.UnaryOp):
        return []
    single = ast.Call(ast.Attribute(_numpy("float32", node), "astype", ast.Load()), [ast.Name("float", ast.Load())], [])
    zero, one = ast.Constant(0.0), ast.Constant(1.0)
    return [
        ("clamp added", _numpy("maximum", node, zero)), ("clamp added", _numpy("minimum", node, one)),
        ("clamp added", _numpy("abs", node)), ("single precision", single),
    ]  # fmt: skip
