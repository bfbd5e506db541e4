"""Other texts for an expression of the definition, as a mistake would write it.

Most rewrites are independent of the method: another value of a constant, an omitted or confused operation, a comparison
with or without its end, a factor or term whose size is found from the outputs. Some are for vectors and quaternions.
"""

import ast
from collections.abc import Iterator, Sequence
from copy import deepcopy
from itertools import permutations, product
from typing import Any

import numpy as np

TWINS = (
    "sin cos", "exp exp2", "log log2", "log log10", "maximum minimum", "max min", "max mean", "max sum", "sum mean",
    "sum max", "mean sum", "median mean", "median min", "median max", "mean median", "ceil floor", "ceil rint",
    "round floor", "round ceil", "rint floor", "rint trunc", "trunc floor", "trunc rint", "tanh arctan", "cosh sinh",
    "tile repeat", "any all", "all any", "zeros ones", "ones zeros", "sign abs", "unique sort", "minimum maximum",
    "mean max", "mean min",
)  # fmt: skip
"""A function, and one that may be taken for it."""
OPERATORS: dict[type, str] = {
    ast.Add: "{l}; {r}; ({l}) - ({r}); ({r}) - ({l}); 2 * ({l}); 2 * ({r}); np.maximum({l}, {r}); ({l}) * (1 + ({r}))",
    ast.Sub: "{l}; -({r}); ({l}) + ({r}); ({r}) - ({l})",
    ast.Mult: "{l}; {r}; ({l}) / ({r}); ({r}) / ({l}); ({l}) + ({r})",
    ast.Div: "{l}; 1 / ({r}); ({l}) * ({r}); ({r}) / ({l}); ({l}) / ({r}) ** 2; ({l}) / np.sqrt({r}); ({l}) // ({r})",
    ast.FloorDiv: "{l}; ({l}) / ({r}); -(-({l}) // ({r})); round(({l}) / ({r}))",
    ast.Mod: "{l}; ({l}) // ({r})",
    ast.Pow: "{l}; ({l}) ** (({r}) + 1); ({l}) ** (({r}) - 1); ({l}) ** (2 * ({r})); np.abs({l}); np.sqrt({l}); "
    "1 + (({l}) - 1) * ({r})",
    ast.MatMult: "{l}; {r}; ({l}).T @ ({r}); ({l}) @ ({r}).T; ({r}) @ ({l}); (({l}) @ ({r})).T; ({l}).T @ ({r}).T; "
    "({l})[..., :-1] @ ({r})[:-1]; ({l})[..., 1:] @ ({r})[1:]",
    ast.BitAnd: "{l}; {r}; ({l}) | ({r})",
    ast.BitOr: "{l}; {r}; ({l}) & ({r})",
}
SMALL = ("1e-12", "1e-10", "1e-8", "1e-7", "1e-6", "1e-5", "1e-4", "1e-3", "1")
COUNTS = ("np.size({})", "np.shape({})[0]", "np.shape({})[-1]", "np.prod(np.shape({})[-2:])", "np.count_nonzero({})")
COMPARED = {ast.Lt: "<= >=", ast.LtE: "< >", ast.Gt: ">= <=", ast.GtE: "> <", ast.Eq: "!= > <", ast.NotEq: "=="}
SWAPS = ("[1, 0, 2]", "[2, 1, 0]", "[0, 2, 1]", "[1, 2, 0]", "[2, 0, 1]")


def rewrites(node: ast.expr | ast.stmt, values: Sequence[Any], truth: bool) -> Iterator[tuple[str, int]]:
    """Other texts for an expression, or the omission of a statement, each with its rank, 0 = the most likely.

    values   observed values of the expression; factors, terms and bounds that do not suit them are omitted
    truth    the expression is a condition
    """
    if isinstance(node, ast.stmt):
        yield "pass", 0
        return
    text = ast.unparse(node)
    yield from ((other, 0) for other in _fewer_digits(node))
    if (truth and not any(is_real(value) for value in values)) or isinstance(node, ast.Compare):
        yield from (("True", 0), ("False", 0), (f"~({text})", 2))
    yield from ((other, 1 if other in text else 2) for other in _rewrites(node))
    if not truth and not isinstance(node, ast.Constant | ast.Compare | ast.BoolOp):
        yield from ((pattern.format(*[text] * pattern.count("{}")), 3) for pattern in _wrapped(values))


def _rewrites(node: ast.expr) -> Iterator[str]:
    match node:
        case ast.Constant(value=bool() as v):
            yield str(not v)
        case ast.Constant(value=int() | float() as v):
            yield from dict.fromkeys(f"{k!r}" for k in (0, 1, 2, 3, -v, v + 1, v - 1, 2 * v, v / 2) if k != v)
        case ast.Constant(value=str() as v) if "->" in v:
            yield from _other_sums(v)
        case ast.BinOp():
            sides = {"l": ast.unparse(node.left), "r": ast.unparse(node.right)}
            yield from (pattern.format(**sides) for pattern in OPERATORS.get(type(node.op), "{l}").split("; "))
            yield from _other_counts(node)
        case ast.UnaryOp() | ast.Subscript() | ast.Attribute(attr="T"):
            yield ast.unparse(node.operand if isinstance(node, ast.UnaryOp) else node.value)
            yield from _shifted(node)
        case ast.BoolOp():
            yield from map(ast.unparse, node.values)
        case ast.IfExp():
            yield from (ast.unparse(node.body), ast.unparse(node.orelse))
        case ast.Compare():
            left, right = ast.unparse(node.left), ast.unparse(node.comparators[0])
            yield from (f"({left}) {sign} ({right})" for sign in COMPARED.get(type(node.ops[0]), "!=").split())
        case ast.Call():
            yield from _other_calls(node)
            yield from _other_guards(node)
    yield from map(ast.unparse, _regrouped(node))
    inner = [n for n in ast.walk(node) if isinstance(n, ast.BinOp | ast.Call | ast.Name | ast.Attribute)]
    yield from dict.fromkeys(ast.unparse(n) for n in inner[1:12] if "np" not in ast.unparse(n)[:3])


def _fewer_digits(node: ast.expr) -> Iterator[str]:
    """An irrational constant with a few digits, rounded or cut off: 3.14, 3.1415, 3.1416."""
    names = {n.id for n in ast.walk(node) if isinstance(n, ast.Name)}
    if names != {"np"} or not isinstance(node, ast.Attribute | ast.BinOp | ast.Call):
        return
    value = eval(compile(ast.Expression(ast.parse(ast.unparse(node), mode="eval").body), "", "eval"), {"np": np})
    if isinstance(value, float) and np.isfinite(value) and float(f"{value:.6g}") != value:
        tens = [10.0 ** (digits - 1 - int(np.floor(np.log10(abs(value))))) for digits in range(2, 9)]
        cut = [float(f"{round_to(value * ten) / ten:.12g}") for ten in tens for round_to in (np.round, np.trunc)]
        yield from dict.fromkeys(map(repr, cut))


def _regrouped(node: ast.expr) -> Iterator[ast.expr]:
    """Operands moved into or out of a product, power, clamp or function of one argument: a (b + c), sqrt(a + b)."""
    match node:
        case ast.BinOp(left=ast.BinOp(left=a, op=ast.Pow(), right=n), op=ast.Add() | ast.Sub(), right=c):
            yield ast.BinOp(ast.BinOp(a, node.op, c), ast.Pow(), n)
        case ast.BinOp(left=ast.BinOp(left=a, op=ast.Add() | ast.Sub() as sign, right=c), op=ast.Pow(), right=n):
            yield ast.BinOp(ast.BinOp(a, ast.Pow(), n), sign, c)
        case ast.Call(func=function, args=[ast.Call(func=clamp, args=[inner, *ends])], keywords=[]) if _clamps(clamp):
            yield ast.Call(clamp, [ast.Call(function, [inner], []), *ends], [])
        case ast.BinOp(left=ast.Call(func=clamp, args=[inner, *ends])) if _clamps(clamp):
            yield ast.Call(clamp, [ast.BinOp(inner, node.op, node.right), *ends], [])
        case ast.BinOp(left=ast.BinOp(left=a, op=ast.Mult(), right=b), op=ast.Add() | ast.Sub(), right=c):
            yield ast.BinOp(a, ast.Mult(), ast.BinOp(b, node.op, c))
            yield ast.BinOp(ast.BinOp(a, node.op, c), ast.Mult(), b)
        case ast.BinOp(left=ast.Call(func=function, args=[inner], keywords=[])):
            yield ast.Call(function, [ast.BinOp(inner, node.op, node.right)], [])
        case ast.Call(func=function, args=[ast.BinOp() as inner], keywords=[]):
            yield ast.BinOp(ast.Call(function, [inner.left], []), inner.op, inner.right)


def _shifted(node: ast.expr) -> Iterator[str]:
    """Slices of constant ends, one index earlier and one later, as with indices that start at another number."""
    places = [k for k, one in enumerate(ast.walk(node)) if isinstance(one, ast.Slice)]
    for k, step in product(places, (-1, 1)):
        other = deepcopy(node)
        part = list(ast.walk(other))[k]
        match part:
            case ast.Slice(lower=ast.Constant(value=int() as low), upper=ast.Constant(value=int() as high), step=None):
                part.lower, part.upper = ast.Constant(low + step), ast.Constant(high + step)
                yield ast.unparse(other)


def is_real(value: Any) -> bool:
    """Whether an observed value is a real number or an array of them."""
    return np.asarray(value).dtype.kind == "f"


def _clamps(function: ast.expr) -> bool:
    return ast.unparse(function) in ("np.clip", "np.maximum", "np.minimum", "max", "min")


def rounded(node: ast.expr | ast.stmt, values: Sequence[Any], lower: str) -> Iterator[tuple[str, int]]:
    """A real expression computed in a lower precision from here on, or only rounded to it."""
    if lower and isinstance(node, ast.expr) and any(is_real(value) for value in values):
        text = ast.unparse(node)
        yield f"np.{lower}({text})", 0
        yield f"np.float64(np.{lower}({text}))", 0


def with_number(node: ast.expr | ast.stmt, values: Sequence[Any]) -> Iterator[tuple[str, float]]:
    """Texts with an unknown number `_knob`, and its value that changes nothing."""
    if isinstance(node, ast.Constant) and type(node.value) is int:
        yield (f"{node.value} * _knob", 1.0) if node.value else ("_knob", 0.0)
    elif isinstance(node, ast.expr) and any(np.asarray(value).dtype.kind in "fiu" for value in values):
        text = ast.unparse(node)
        yield f"_knob * ({text})", 1.0
        if not isinstance(node, ast.Constant):
            yield f"({text}) + _knob", 0.0


def _wrapped(values: Sequence[Any]) -> Iterator[str]:
    """Patterns for values of this kind and shape, without some that would change none of them."""
    arrays = [np.asarray(value) for value in values if value is not None]
    if any(a.dtype.kind == "f" for a in arrays):
        yield from ("0 * ({})", "-({})", "2 * ({})", "({}) / 2", "({}) ** 2", "1 / ({})")
        yield from ["np.abs({})", "np.maximum({}, 0)"] * any((a < 0).any() for a in arrays)
        yield from ["np.minimum({}, 1)", "np.clip({}, -1, 1)"] * any((np.abs(a) > 1).any() for a in arrays)
        yield from ["np.clip({}, 0, 1)"] * any(((a < 0) | (a > 1)).any() for a in arrays)
        yield from ("1 / (1 + np.exp(-({})))", "np.tanh({})", "np.maximum({}, 1e-8)")
        yield from ["1.0"] * all(a.ndim == 0 for a in arrays)  # a weight that is left out
        yield from ["np.sqrt({})"] * all((a >= 0).all() for a in arrays)
    elif any(a.ndim == 0 and a.dtype.kind in "iu" for a in arrays):
        yield from ("({}) + 1", "({}) - 1", "0", "1")
    if any(a.ndim and a.dtype.kind == "b" for a in arrays):  # the elements that are counted or averaged
        yield from ("np.ones_like({})", "~({})")
    if any(a.ndim for a in arrays):
        yield from ("({})[::-1]", "np.mean({})")
        yield from ["({}).T", "np.swapaxes({}, 0, 1)"] * any(a.ndim > 1 for a in arrays)
        yield from [f"({{}})[{order}]" for order in SWAPS] * any(a.shape[:1] == (3,) for a in arrays)
        yield from ["({}) / np.linalg.norm({}, axis=0)"] * any(a.shape[:1] in ((3,), (4,)) for a in arrays)


def _other_calls(node: ast.Call) -> Iterator[str]:
    function, arguments = ast.unparse(node.func), [ast.unparse(a) for a in node.args]
    name = function.rpartition(".")[2]
    if isinstance(node.func, ast.Attribute) and function != f"np.{name}":
        owner = ast.unparse(node.func.value)
        yield owner
        if name in ("mean", "sum") and not arguments:
            yield f"np.mean(({owner})[({owner}) != 0])"
    yield from arguments
    if name == "exp":
        yield f"1 + ({arguments[0]})"
    if name == "einsum":
        yield from _shorter(node)
    if name == "median":  # one of the two in the middle, not their mean
        yield from (f"np.sort({arguments[0]}, axis=None)[(np.size({arguments[0]}) - {k}) // 2]" for k in (0, 1))
    if name == "linspace":  # other conventions of the sample positions
        a, b, n = arguments
        yield from (f"({a}) + (({b}) - ({a})) * (np.arange({n}) + {k}) / ({n})" for k in (0, 0.5, 1))
        yield f"np.linspace({a}, {b}, ({n}) + 2)[1:-1]"
    rest = ast.unparse(node)[len(function) :]
    if name == "any":
        yield f"{function[:-3]}sum{rest} > 1"
    words = [ast.unparse(word) for word in node.keywords]
    own = ", ".join([*arguments, *(word for word in words if not word.startswith("initial="))])
    for other in (pair.split()[1] for pair in TWINS if pair.split()[0] == name):
        yield from dict.fromkeys(function[: -len(name)] + other + given for given in (rest, f"({own})"))
    yield from (f"{function}({', '.join([*arguments, *words[:k], *words[k + 1 :]])})" for k in range(len(words)))
    for k in range(len(arguments) - 1):
        turned = [*arguments[:k], arguments[k + 1], arguments[k], *arguments[k + 2 :]]
        yield f"{function}({', '.join([*turned, *words])})"
    if name in ("sum", "mean"):
        yield from _fewer(node, function, arguments)


def _other_guards(node: ast.Call) -> Iterator[str]:
    """A small number added, in place of a case of `np.where` or a lower bound."""
    match ast.unparse(node.func), node.args:
        case "np.where", [condition, _, value]:
            guarded = ast.unparse(value)
            yield from (f"np.where({ast.unparse(condition)}, 0, {guarded}) + {small}" for small in SMALL)
        case "np.maximum" | "max", [value, ast.Constant()]:
            guarded = ast.unparse(value)
        case _:
            return
    yield from (f"({guarded}) + {small}" for small in SMALL)


def _other_counts(node: ast.BinOp) -> Iterator[str]:
    """A sum divided by the number of all its elements, of those of one axis, or of those that are not 0."""
    if not isinstance(node.op, ast.Div):
        return
    left = ast.unparse(node.left)
    for one in ast.walk(node.left):
        if isinstance(one, ast.Call) and isinstance(one.func, ast.Attribute) and one.func.attr == "sum":
            summed = ast.unparse(one.func.value) if ast.unparse(one.func) != "np.sum" else ast.unparse(one.args[0])
            for count in COUNTS:
                yield f"({left}) / {count.format(summed)}"


def _fewer(node: ast.Call, function: str, arguments: Sequence[str]) -> Iterator[str]:
    """A sum or mean without its first or last element, or of this one alone; a mean with one element less as divisor.

    A sum that is overwritten instead of added to has one element alone.
    """
    whole, own = ast.unparse(node), function in ("np.sum", "np.mean")
    summed = arguments[0] if own else function.rpartition(".")[0]
    axis = next((ast.unparse(word.value) for word in node.keywords if word.arg == "axis"), "")
    axis = arguments[-1] if not axis and len(arguments) > own else axis
    before = whole[: len(function) + 1] if own else ""
    after = whole[len(before) + len(summed) :]
    for end, along in product((-1, 0), axis.strip("()").split(", ")):
        cut = f"np.delete({summed}, {end}, {along})" if along else f"({summed})[{end + 1}:{end or ''}]"
        yield from (f"{before}{part}{after}" for part in (cut, f"np.take({summed}, [{end}], {along or 0})"))
    if function.endswith("mean"):
        yield f"{whole} * np.size({summed}) / (np.size({summed}) - np.size({whole}))"


def _shorter(node: ast.Call) -> Iterator[str]:
    """A sum of products without the first or the last value of one of its summed indices."""
    match node.args:
        case [ast.Constant(value=str() as text), *operands] if "->" in text:
            terms, _, result = text.partition("->")
        case _:
            return
    for letter in dict.fromkeys(c for c in terms if c not in f",{result}"):
        for part in (":-1", "1:"):
            cut = [
                f"({ast.unparse(one)})[{', '.join(part if c == letter else ':' for c in term)}]"
                for one, term in zip(operands, terms.split(","))
            ]
            yield f"np.einsum({text!r}, {', '.join(cut)})"


def _other_sums(text: str) -> Iterator[str]:
    """The indices of one operand of a sum, or of the result, in another order."""
    operands, result = text.split("->")
    parts = [*operands.split(","), result]
    for k, part in enumerate(parts):
        for order in ("".join(order) for order in permutations(part)):
            if order != part:
                turned = [*parts[:k], order, *parts[k + 1 :]]
                yield repr(f"{','.join(turned[:-1])}->{turned[-1]}")
