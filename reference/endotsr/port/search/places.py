"""Places in the source of the definition: the code that an operation executes, and its run with one place changed."""

import ast
import inspect
import re
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from types import CodeType, FunctionType, ModuleType
from typing import Any, NamedTuple

ROOM = "endotsr.definition"
EQUATION = re.compile(r"(?:quation|quations|everse of) \((B?M?\d+b?)\)")  # in the docstring of a function
WHOLE_FILE = re.compile(r"Equation \((B?M?\d+b?)\)")  # at the start of the docstring of a file
STEP = re.compile(r"#.*?(\(\d+\.\d+\)(?:, \(\d+\.\d+\))*)")  # at the end of a line


class Statement:
    """A function of the definition, or a constant with the later constants of its module that depend on it."""

    def __init__(self, module: ModuleType, statement: ast.FunctionDef | ast.Assign, phases: frozenset[str]) -> None:
        self.module, self.statement, self.phases = module, statement, phases
        self.name = f"{module.__name__.rpartition('.')[2]}.{getattr(statement, 'name', 'constants')}"
        self.file = Path(str(module.__file__))
        self.lines = self.file.read_text(encoding="utf-8").splitlines()

    @property
    def is_constant(self) -> bool:
        """Whether it is not a function."""
        return isinstance(self.statement, ast.Assign)

    def compiled(self) -> Callable[[], Any]:
        """A function that installs the current statement and returns a function that undoes this."""
        if isinstance(self.statement, ast.Assign):
            return self._constants(self.statement)
        name, function = self.statement.name, self.module.__dict__[self.statement.name]
        made = compile(ast.Module([self.statement], []), str(self.file), "exec")
        code = next(c for c in made.co_consts if isinstance(c, CodeType) and c.co_name == name)

        def install() -> Callable[[], None]:
            right, function.__code__ = function.__code__, code
            return lambda: setattr(function, "__code__", right)

        return install

    def _constants(self, statement: ast.Assign) -> Callable[[], Any]:
        changed: set[str] = set(_targets(statement))
        wanted: list[ast.stmt] = [statement]
        for one in (s for s in syntax(self.module).body if isinstance(s, ast.Assign)):
            used = {n.id for n in ast.walk(one.value) if isinstance(n, ast.Name)}
            if one.lineno > statement.lineno and used & changed:
                wanted.append(one)
                changed |= set(_targets(one))
        code = compile(ast.Module(wanted, []), str(self.file), "exec")

        def install() -> Callable[[], Any]:
            values = dict(self.module.__dict__)
            exec(code, values)
            before = [
                (room, name, room.__dict__[name])
                for room in definition_modules()
                for name in changed
                if room.__dict__.get(name) is self.module.__dict__[name]
            ]
            for room, name, _ in before:
                setattr(room, name, values[name])
            return lambda: [setattr(*one) for one in before]

        return install

    def where(self, node: ast.AST) -> str:
        """Equation and line of a node of the statement."""
        line = getattr(node, "lineno", self.statement.lineno)
        text = ast.get_docstring(self.statement) if isinstance(self.statement, ast.FunctionDef) else ""
        found = EQUATION.search(text or "") or WHOLE_FILE.match(ast.get_docstring(syntax(self.module)) or "")
        step = STEP.search(self.lines[line - 1])
        equation = f"equation ({found[1]}), " if found else ""
        return f"{equation}{f'step {step[1]}, ' if step else ''}definition/{self.file.name}:{line}"


class Spot(NamedTuple):
    """All expressions of one text in a place, or one of them, as (parent node, field, index in a list)."""

    place: Statement
    node: ast.expr | ast.stmt
    holders: tuple[tuple[ast.AST, str, int | None], ...]

    @property
    def truth(self) -> bool:
        """Whether it is a condition: a test, a logical operand, or the first argument of `np.where`."""
        holder, field, index = self.holders[0]
        match holder:
            case ast.Call():
                return index == 0 and ast.unparse(holder.func) == "np.where"
            case ast.BinOp(op=ast.BitAnd() | ast.BitOr()) | ast.UnaryOp(op=ast.Invert() | ast.Not()) | ast.BoolOp():
                return True
            case ast.AugAssign(op=ast.BitAnd() | ast.BitOr()):
                return True
        return field == "test"


@contextmanager
def written(spot: Spot, text: str) -> Iterator[None]:
    """The syntax tree of the place with another text at the spot, or without its statement.

    Afterwards each holder has its own node again: nodes of one text differ in their lines and in the spots inside them.
    Raises: SyntaxError if the text is no expression.
    """
    made = [ast.Pass() if isinstance(spot.node, ast.stmt) else ast.parse(text, mode="eval").body for _ in spot.holders]
    before = [_put(*holder, new) for holder, new in zip(spot.holders, made)]
    for new, old in zip(made, before):
        for node in ast.walk(new):
            ast.copy_location(node, old)
    try:
        yield
    finally:
        for holder, old in zip(spot.holders, before):
            _put(*holder, old)


def _put(holder: ast.AST, field: str, index: int | None, node: ast.AST) -> ast.AST:
    """Put a node into a field, and return the one that was there."""
    if index is None:
        before = getattr(holder, field)
        setattr(holder, field, node)
    else:
        nodes = getattr(holder, field)
        before, nodes[index] = nodes[index], node
    return before


def spots(place: Statement) -> list[Spot]:
    """The expressions that are read in a place, and the statements inside its loops and conditions.

    Left out are called functions, objects whose entries are assigned, tuples, lists, slices, and texts without indices
    of a sum. Repeated expressions are also changed together, in the whole place and in each statement of its body;
    constants that are an index, an entry of a tuple or a keyword argument are not.
    """
    found: dict[tuple[str, int], list[Spot]] = {}
    body = place.statement.body if isinstance(place.statement, ast.FunctionDef) else [place.statement]
    for number, statement in enumerate(body):
        for holder in ast.walk(statement):
            for field, value in ast.iter_fields(holder):
                stored = isinstance(holder, ast.Subscript) and isinstance(holder.ctx, ast.Store)
                if isinstance(holder, ast.Call) and ast.unparse(holder.func) == "type":
                    continue  # another type would be called with arrays
                if field in ("func", "annotation", "targets") or (stored and field == "value"):
                    continue
                for index, node in enumerate(value) if isinstance(value, list) else ((None, value),):
                    if _is_read(node):
                        spot = Spot(place, node, ((holder, field, index),))
                        found.setdefault((ast.unparse(node), number), []).append(spot)
    whole: dict[str, list[Spot]] = {}
    for (text, _), of in found.items():
        whole.setdefault(text, []).extend(of)
    together = [of for of in found.values() if len(of) < len(whole[ast.unparse(of[0].node)])] + list(whole.values())
    together = [[spot for spot in of if not _is_index(spot)] for of in together]
    groups = [Spot(place, of[0].node, tuple(s.holders[0] for s in of)) for of in together if len(of) > 1]
    return [spot for of in whole.values() for spot in of] + groups


def _is_index(spot: Spot) -> bool:
    return isinstance(spot.node, ast.Constant) and isinstance(
        spot.holders[0][0], ast.Subscript | ast.Slice | ast.Tuple | ast.keyword
    )


def _is_read(node: Any) -> bool:
    if not isinstance(node, ast.expr):
        return isinstance(node, ast.Assign | ast.AugAssign | ast.If)
    if isinstance(node, ast.Constant):
        return isinstance(node.value, int | float) or (isinstance(node.value, str) and "->" in node.value)
    if isinstance(node, ast.Name | ast.Attribute | ast.Subscript):
        return isinstance(node.ctx, ast.Load) and ast.unparse(node) != "np"
    return not isinstance(node, ast.Tuple | ast.List | ast.Dict | ast.Slice | ast.Lambda | ast.Starred)


def names_in(place: Statement) -> list[str]:
    """Parameters and local names of a function, and attributes of names other than `np`, as `settings.near`."""
    if not isinstance(place.statement, ast.FunctionDef):
        return []
    own = {a.arg for a in ast.walk(place.statement.args) if isinstance(a, ast.arg)}
    nodes = list(ast.walk(place.statement))
    own |= {n.id for n in nodes if isinstance(n, ast.Name) and isinstance(n.ctx, ast.Store)}
    return sorted(
        own
        | {
            ast.unparse(n)
            for n in nodes
            if isinstance(n, ast.Attribute) and isinstance(n.value, ast.Name) and n.value.id != "np"
        }
    )


def executed(phases: dict[str, Callable[[], Any]]) -> list[Statement]:
    """The functions of the definition that some calls execute, with the names of these calls, and their constants.

    phases   calls by name, such as `forward` and `reverse`
    The constants of a module have the phases of all of its executed functions.
    """
    codes: dict[CodeType, set[str]] = {}
    for phase, call in phases.items():

        def seen(frame: Any, event: str, argument: Any, phase: str = phase) -> None:
            if event == "call":
                codes.setdefault(frame.f_code, set()).add(phase)

        before = sys.getprofile()
        sys.setprofile(seen)
        try:
            call()
        finally:
            sys.setprofile(before)
    found = []
    for module in definition_modules():
        functions = {
            name: frozenset(codes[f.__code__])
            for name, f in inspect.getmembers(module, inspect.isfunction)
            if f.__module__ == module.__name__ and f.__code__ in codes
        }
        for statement in syntax(module).body:
            if isinstance(statement, ast.FunctionDef) and statement.name in functions:
                found.append(Statement(module, statement, functions[statement.name]))
            elif isinstance(statement, ast.Assign) and functions and _is_number(module, statement):
                found.append(Statement(module, statement, frozenset().union(*functions.values())))
    return found


def _is_number(module: ModuleType, statement: ast.Assign) -> bool:
    values = [module.__dict__[name] for name in _targets(statement)]
    return not any(isinstance(value, type | FunctionType) or hasattr(value, "_fields") for value in values)


def _targets(statement: ast.Assign) -> Sequence[str]:
    return [n.id for target in statement.targets for n in ast.walk(target) if isinstance(n, ast.Name)]


def definition_modules() -> list[ModuleType]:
    """The loaded modules of the definition."""
    return [m for name, m in sorted(sys.modules.items()) if name.startswith(f"{ROOM}.") and m is not None]


_trees: dict[str, ast.Module] = {}


def syntax(module: ModuleType) -> ast.Module:
    """The syntax tree of a module, cached."""
    if module.__name__ not in _trees:
        _trees[module.__name__] = ast.parse(Path(str(module.__file__)).read_text(encoding="utf-8"))
    return _trees[module.__name__]
