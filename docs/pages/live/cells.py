"""Runs the cells of a chapter one by one and hands back what they print, draw and raise.

This file runs in the browser. A cell is Python; a formula is the text of one function of `endotsr.definition`. Running
a formula replaces the code of the function, so that everything that calls it, the gradient check included, calls the
new text.
"""

import ast
import base64
import contextlib
import importlib
import io
import linecache
import os
import sys
import traceback

os.environ.setdefault("MPLBACKEND", "Agg")
os.environ["ENDOTSR_NOTEBOOK_SIZE"] = "small"
NAMES = {"__name__": "__main__"}  # what the cells define


def run(source, title, formula=""):
    """Run a cell or, with the dotted name of its function, a formula.

    returns   text: what it printed; figures: PNG files in base64; error: the traceback from the cell on, or ""
    """
    linecache.cache[title] = (len(source), None, source.splitlines(keepends=True), title)
    printed, error = io.StringIO(), ""
    with contextlib.redirect_stdout(printed), contextlib.redirect_stderr(printed):
        try:
            if formula:
                define(source, title, formula)
            else:
                execute(source, title)
        except BaseException as failure:  # KeyboardInterrupt and SystemExit of a cell are shown as well
            error = told(failure, title)
    return {"text": printed.getvalue(), "figures": figures(), "error": error}


def execute(source, title):
    """Run a cell, and print the value of its last line if that is an expression."""
    tree = ast.parse(source, title)
    last = tree.body.pop() if tree.body and isinstance(tree.body[-1], ast.Expr) else None
    exec(compile(tree, title, "exec"), NAMES)
    if last is not None:
        value = eval(compile(ast.Expression(last.value), title, "eval"), NAMES)
        if value is not None:
            print(repr(value))


def define(source, title, dotted):
    """Give a function of the definition the code of this text.

    Raises: ValueError if the text does not define the function.
    """
    home, _, name = dotted.rpartition(".")
    scope = vars(importlib.import_module(home))
    known = scope.pop(name)
    try:
        exec(compile(source, title, "exec"), scope)
        if not callable(made := scope.get(name)):
            raise ValueError(f"this text has to define the function {name}")
        known.__code__, known.__defaults__ = made.__code__, made.__defaults__
    finally:
        scope[name] = known  # the same object, which other modules have imported by its name


def told(failure, title):
    """The traceback without the frames of this file."""
    trace = failure.__traceback__
    while trace is not None and trace.tb_frame.f_code.co_filename != title:
        trace = trace.tb_next
    return "".join(traceback.format_exception(type(failure), failure, trace))


def figures():
    """The open figures as PNG files in base64; they are closed."""
    plt = sys.modules.get("matplotlib.pyplot")
    if plt is None:
        return []
    found = []
    for number in plt.get_fignums():
        file = io.BytesIO()
        plt.figure(number).savefig(file, bbox_inches="tight")
        found.append(base64.b64encode(file.getvalue()).decode())
    plt.close("all")
    return found


def quiet():
    """Let `plt.show()` do nothing: `run` hands the figures back."""
    import matplotlib.pyplot as plt

    plt.show = lambda *_, **__: None
