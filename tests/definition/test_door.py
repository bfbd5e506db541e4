"""What the docstring of `endotsr.definition` says of its compiled twins is true."""

import ast
import re

import endotsr.definition
import house

DIFFERENT = {"composite_forward", "rotation_of", "rotation_reverse", "exponential", "calibrated_weight", "train"}
OTHER_FIELDS = {"Calibration", "ViewGradients"}
TREES = house.modules().items()


def parameters(function: ast.FunctionDef) -> list[str]:
    """Names of the arguments, in order."""
    return [a.arg for a in (*function.args.posonlyargs, *function.args.args, *function.args.kwonlyargs)]


def functions(compiled: bool) -> dict[str, list[str]]:
    """Arguments of the public functions of the method, by name; `legacy` repeats names of its own storey."""
    found = {}
    for name, tree in TREES:
        if house.room(name) in house.METHOD and (house.room(name) != "definition") == compiled and "legacy" not in name:
            public = [n for n in tree.body if isinstance(n, ast.FunctionDef) and n.name[0] != "_"]
            found |= {n.name: parameters(n) for n in public if n.name not in found}
    return found


def fields(compiled: bool) -> dict[str, list[str]]:
    """Fields of the named tuples of the method, by name."""
    found = {}
    for name, tree in TREES:
        if house.room(name) not in house.METHOD or (house.room(name) != "definition") != compiled:
            continue
        for node in tree.body:
            if isinstance(node, ast.ClassDef) and "NamedTuple" in map(ast.unparse, node.bases):
                found[node.name] = [ast.unparse(n.target) for n in node.body if isinstance(n, ast.AnnAssign)]
            elif isinstance(node, ast.Assign) and ast.unparse(node.value).startswith("namedtuple("):
                found[ast.unparse(node.targets[0])] = ast.literal_eval(node.value.args[1]).split()
    return found


def follows(short: list[str], long: list[str]) -> bool:
    """Whether `long` has all of `short`, in the same order."""
    rest = iter(long)
    return all(name in rest for name in short)


def test_compiled_functions_take_the_same_arguments_in_the_same_order():
    here, there = functions(compiled=False), functions(compiled=True)
    shared = here.keys() & there.keys()
    assert len(shared) > 70
    assert {name for name in shared if not follows(here[name], there[name])} == DIFFERENT, (
        "arguments of the definition differ in name or order from those of the compiled function"
    )
    assert all(f"`{name}`" in (endotsr.definition.__doc__ or "") for name in DIFFERENT | OTHER_FIELDS)


def equations(text: str) -> set[str]:
    """The labels in a text; a range stands for all of it."""
    found = set()
    for kind, first, letter, last in re.findall(r"\(([BM]?)(\d+)([a-z]?)\)(?:(?: to |-)\([BM]?(\d+)\))?", text):
        found |= {f"{kind}{number}{letter}" for number in range(int(first), int(last or first) + 1)}
    return found


def test_the_first_line_of_every_module_names_its_equations():
    """Beside those that hold no equation of their own. The docstring of the room gives each the same label."""
    first = {
        name.rpartition(".")[2]: (ast.get_docstring(tree) or "").split("\n")[0]
        for name, tree in TREES
        if house.room(name) == "definition"
    }
    without = {name for name, line in first.items() if not equations(line)}
    assert without == {"definition", "__main__", "settings", "simulate"}
    text = (endotsr.definition.__doc__ or "").partition("    dictionary")[1:]
    listed = re.findall(r"([a-z][\w, ]*?) (\(.+?\))(?=  |\n)", "".join(text).split("\n\n")[0])
    assert len(listed) > 15
    for names, labels in listed:
        for name in names.split(", "):
            assert equations(labels) <= equations(first[name]), f"{name} {labels}: {first[name]}"


def test_tuples_have_the_same_fields():
    here, there = fields(compiled=False), fields(compiled=True)
    shared = {name for name in here.keys() & there.keys() if not name.endswith("Saved")}
    assert len(shared) > 30
    assert {name for name in shared if here[name] != there[name]} == OTHER_FIELDS


def test_only_the_calibration_raises_an_error():
    raising = {
        f"{name.rpartition('.')[2]}.{function.name}"
        for name, tree in TREES
        if house.room(name) == "definition"
        for function in ast.walk(tree)
        if isinstance(function, ast.FunctionDef)
        and any(isinstance(n, ast.Raise | ast.Assert) for n in ast.walk(function))
    }
    assert raising == {"calibration.calibrate"}
