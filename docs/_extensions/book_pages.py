"""Pages generated when the book is built: the map of the equations, the gradient checks, the golden cases.

They are Markdown files in the folder of the other pages, ignored by git, and rewritten only when they change.
"""

import hashlib
from collections.abc import Iterator
from pathlib import Path

from book_map import Equation, equations, golden_cases, has_derivation, names_of_tests
from package_names import PACKAGE, ROOT
from sphinx.application import Sphinx
from sphinx.errors import ExtensionError

from endotsr.port.gradcheck import PairReport, all_pairs, check_pair, one_thread, pair_stream
from endotsr.port.judge.store import read_golden
from endotsr.port.operations.registry import method_operations
from makers.twins import BOUND, BOUNDS, Distance, all_distances, golden_requests

DOCS = ROOT / "docs"
NOTE = "<!-- Written by docs/_extensions/book_pages.py. Do not edit. -->\n"


# ---- cells ----


def function_link(dotted: str) -> str:
    return f"{{py:obj}}`{dotted.split('.')[-1]} <{dotted}>`"


def function_links(row: Equation) -> str:
    return ", ".join(function_link(name) for name in row.functions)


def reverse_links(row: Equation) -> str:
    """The derivation in a notebook, then the functions; or the reason for none, with a link to its explanation."""
    anchors = [f"reverse-{name}" for name in row.notebooks if has_derivation(name)][:1]
    if row.without:
        return ", ".join([f"none: {row.without.reason}", *(f"{{ref}}`why <{anchor}>`" for anchor in anchors)])
    derivations = [f"{{ref}}`derivation <{anchor}>`" for anchor in anchors]
    return ", ".join([*derivations, *(function_link(name) for name in row.reverses)])


def check_links(row: Equation) -> str:
    if row.without:
        return f"{{ref}}`tests <check-{row.label}>`"
    names = [pair.name for pair in row.pairs]
    return ", ".join(f"{{ref}}`{shown} <check-{name}>`" for name, shown in zip(names, without_repetition(names)))


def without_repetition(names: list[str]) -> list[str]:
    """The first name in full, then only the differing parts if all start with the same operation."""
    first = names[0]
    operations = [pair.function.rpartition(".")[2].removesuffix("_forward") for pair in all_pairs().values()]
    operation = next((s for s in operations if all(name.startswith(f"{s}_") for name in names)), None)
    return [first, *(name.removeprefix(f"{operation}_") for name in names[1:])] if operation else names


def golden_links(row: Equation) -> str:
    found = [f"{{ref}}`{name} <golden-{name}>` ({len(golden_cases()[name])})" for name in row.golden]
    return ", ".join(found) if found else row.without.golden if row.without else ""


def notebook_links(row: Equation) -> str:
    found = [f"{{doc}}`{int(name[:2])} </notebooks/{name}>`" for name in row.notebooks]
    return ", ".join(found) if found else row.without.notebook if row.without else ""


def link_line(row: Equation) -> str:
    """One line below the heading of a specification page, with all links of one equation."""
    return (
        f"{{eq}}`eq-{row.label}`: code {function_links(row)}; reverse {reverse_links(row)}; check {check_links(row)}; "
        f"golden {golden_links(row)}; notebook {notebook_links(row)}; {{ref}}`all equations <equation-map>`."
    )


# ---- pages ----


def equation_page() -> str:
    lines = [
        "---",
        "html_theme.sidebar_secondary.remove: true",
        "---",
        NOTE,
        "(equation-map)=",
        "# Map of the equations",
        "",
        "For each equation the table links the function, the reverse pass, the gradient check, the golden cases and",
        "the notebook. It is made from the registry of operations; the number of cases is in brackets.",
        "",
        "| Equation | Function | Reverse | Check | Golden cases | Notebook |",
        "|---|---|---|---|---|---|",
    ]
    for row in equations():
        cells = (function_links(row), reverse_links(row), check_links(row), golden_links(row), notebook_links(row))
        lines.append(f"| {{eq}}`eq-{row.label}` | {' | '.join(cells)} |")
    return "\n".join(lines) + "\n"


def checks_page(reports: dict[str, PairReport]) -> str:
    lines = [
        "# Gradient checks",
        "",
        "Each reverse pass is compared with finite differences of its forward pass in float64, along random directions",
        "and single entries of each block. The numbers were measured when these pages were built; `endotsr gradcheck`",
        "measures them again, also in float32. A probe that cannot detect an error of 0.01 % counts as unresolved, and",
        "a probe whose two ends take different discrete decisions as refused.",
        "",
    ]
    for row in equations():
        lines += [f"## ({row.number[1:-1]})", ""]
        lines += [f"{{eq}}`eq-{row.label}`, {{doc}}`/specification/{row.page}`.", ""]
        if row.without:
            lines += list(_tests(row))
        for pair in row.pairs:
            lines += list(_report(pair.name, pair.function, reports[pair.name]))
    return "\n".join(lines)


def _tests(row: Equation) -> Iterator[str]:
    """The tests of an equation without a derivative."""
    assert row.without
    yield from (f"(check-{row.label})=", f"### {row.without.tests}", "")
    yield f"No gradient: {row.without.reason}. The tests of `{row.without.tests}`:"
    yield from ("", "```text", *names_of_tests(row.without.tests), "```", "")


def _report(name: str, function: str, report: PairReport) -> Iterator[str]:
    yield from (f"(check-{name})=", f"### {name}", "", function_link(function), "")
    yield from (
        "| Block | Probes | Refused | Unresolved | Worst relative error | Verdict |",
        "|---|---|---|---|---|---|",
    )
    for block in report.blocks:
        worst = f"{block.worst.relative_error:.1e}" if block.worst else "none"
        yield f"| `{block.block}` | {block.probes} | {block.refused} | {block.unresolved} | {worst} | {block.verdict} |"
    yield ""


def definition_page(found: list[Distance]) -> str:
    """The worst difference of every output from the definition. A difference above its bound stops the build."""
    if wrong := [
        f"{d.operation}.{d.output}: {d.distance:.1e} of {d.bound:.0e}" for d in found if not d.distance <= d.bound
    ]:
        raise ExtensionError("compiled functions differ from their definition\n" + "\n".join(wrong))
    lines = [
        "# The definition",
        "",
        "The package `endotsr.definition` is the method as text: plain NumPy in float64, one file per equation,",
        "forward and reverse. The pages of the {doc}`specification/index` show it below their displays,",
        "{doc}`api/definition` lists it, and {doc}`one_iteration` names the files in the order of an iteration.",
        "`python -m endotsr.definition` trains a small scene with it.",
        "",
        "The compiled functions compute the same values differently. The table gives the largest difference of each",
        "output and gradient in float64, over the generated inputs of the gradient checks (three seeds) and over",
        "the inputs of all {doc}`golden_cases`, in units of the largest magnitude of the array. It was measured",
        "when these pages were built; `python docs/_extensions/book_pages.py` prints the same numbers.",
        "",
        f"The bound is {BOUND:g} unless the last column gives another one:",
        "",
        *(f"- {name}: {reason} ({bound:g})." for name, (bound, reason) in BOUNDS.items()),
        "",
        "| Operation | Equation | Definition | Output | Largest difference | Bound |",
        "|---|---|---|---|---|---|",
    ]
    labels = {name: operation.equation.lower() for name, operation in method_operations().items()}
    for d in found:
        equation = f"{{eq}}`eq-{labels[d.operation.split()[0]]}`"
        cells = (d.operation, equation, function_link(d.function), f"`{d.output}`", f"{d.distance:.1e}", f"{d.bound:g}")
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines) + "\n"


def differences() -> list[Distance]:
    return all_distances(golden_requests(read_golden(ROOT / "golden")))


def golden_page() -> str:
    lines = [
        "# Golden cases",
        "",
        "These are stored inputs and outputs that a port must reproduce. `golden/README.md` explains how they are read",
        "and compared, and {doc}`guides/port` the order in which to use them. A case is the folder",
        "`golden/cases/FAMILY/CASE`.",
        "",
    ]
    by_family = {name: row.label for row in equations() for name in row.golden}
    for family, cases in golden_cases().items():
        label = by_family.get(family)
        lines += [f"(golden-{family})=", f"## {family}", ""]
        lines += [f"{{eq}}`eq-{label}`", ""] if label else []
        lines += ["| Case | What | Level | Inputs | Outputs |", "|---|---|---|---|---|"]
        for case in cases:
            inputs, outputs = (_arrays(case[key]) for key in ("inputs", "outputs"))
            lines.append(f"| `{case['case']}` | {case['title']} | {case['level']} | {inputs} | {outputs} |")
        lines.append("")
    return "\n".join(lines)


def _arrays(entries: dict) -> str:
    shape = lambda entry: "(" + ",".join(map(str, entry["shape"])) + ")"
    return ", ".join(f"`{name}` {shape(entry)}" for name, entry in entries.items()) or "none"


# ---- writing ----


def source_digest() -> str:
    """Digest of the sources on which the measured pages depend."""
    sources = [*sorted(PACKAGE.rglob("*.py")), *sorted(Path(__file__).parent.glob("*.py"))]
    return hashlib.sha256(b"".join(file.read_bytes() for file in sources)).hexdigest()


def gradient_reports() -> dict[str, PairReport]:
    """The check of every pair. A wrong gradient stops the build."""
    with one_thread():
        reports = {name: check_pair(pair, pair_stream(name, 0)) for name, pair in all_pairs().items()}
    failures = [f"{name}: {reason}" for name, report in reports.items() for reason in report.failures]
    if failures:
        raise ExtensionError("gradient check failed\n" + "\n".join(failures))
    return reports


def write(file: Path, text: str) -> None:
    """Write a changed file only: Sphinx rereads files with a new date."""
    if not file.is_file() or file.read_text(encoding="utf-8") != text:
        file.write_text(text, encoding="utf-8", newline="\n")


def write_pages(app: Sphinx) -> None:
    write(DOCS / "equations.md", equation_page())
    write(DOCS / "golden_cases.md", NOTE + golden_page())
    stamp = f"<!-- Sources {source_digest()}. -->\n"
    measured = {
        "gradient_checks": lambda: checks_page(gradient_reports()),
        "definition": lambda: definition_page(differences()),
    }
    for name, page in measured.items():
        file = DOCS / f"{name}.md"
        if not file.is_file() or stamp not in file.read_text(encoding="utf-8"):
            write(file, NOTE + stamp + page())


def setup(app: Sphinx) -> dict[str, bool]:
    app.connect("builder-inited", write_pages)
    return {"parallel_read_safe": True, "parallel_write_safe": True}


if __name__ == "__main__":
    for d in differences():
        print(f"{d.operation:24} {d.output:30} {d.distance:8.1e} of {d.bound:.0e}  {d.request}")
