"""Make docs/discrimination.md and its chart from docs/results/discrimination.json: python tests/mutation/page.py"""

import json
import sys
import textwrap
from collections.abc import Iterable
from pathlib import Path
from typing import Any, NamedTuple

ROOT = Path(__file__).parents[2]
sys.path.insert(0, str(ROOT / "tests"))

from mutation.equivalents import EQUIVALENT, reasons  # noqa: E402

RESULT = ROOT / "docs/results/discrimination.json"
PAGE = ROOT / "docs/discrimination.md"
CHART = ROOT / "docs/results/discrimination.svg"
COLUMNS = 120  # of a line of prose
CHANGED = 1e-6


class Row(NamedTuple):
    """One mutant of the report."""

    kernel: str
    name: str
    kind: str
    suites: tuple[str, ...]  # those that detected it
    change: float | None
    equivalent: bool


def rows(result: dict[str, Any]) -> list[Row]:
    """The mutants of the report, those declared equivalent marked."""
    known, suites = reasons(), result["suites"]
    return [
        Row(kernel, name, kind, tuple(s for s, c in zip(suites, found) if c >= 0), change, name in known)
        for kernel, mutants in result["kernels"].items()
        for name, (kind, found, change) in mutants.items()
    ]


def counted(found: list[Row]) -> list[Row]:
    """The mutants that a test can detect: all but those declared equivalent."""
    return [r for r in found if not r.equivalent]


def percent(part: int, whole: int) -> str:
    """A fraction as text; a hundred only if nothing is missing."""
    if whole == 0:
        return "-"
    shown = 100 * part / whole
    return f"{min(shown, 99.9) if part < whole else shown:.1f}\u00a0%".replace("100.0", "100")


def detected(found: list[Row], suites: Iterable[str]) -> dict[str, int]:
    """Number of mutants that each suite detects, and `any`."""
    return {s: sum(s in r.suites for r in found) for s in suites} | {"any": sum(bool(r.suites) for r in found)}


def table(title: str, groups: dict[str, list[Row]], suites: list[str]) -> list[str]:
    """One line a group: the detected fraction of the mutants that are not equivalent, and what is left."""
    head = [title, "any suite", *suites, "mutants", "survivors"]
    lines = ["| " + " | ".join(head) + " |", "|---" * len(head) + "|"]
    for name, group in groups.items():
        real = counted(group)
        found = detected(real, suites)
        parts = [percent(found[s], len(real)) for s in ("any", *suites)]
        left = [len(real), len(real) - found["any"]]
        lines.append("| " + " | ".join([f"`{name}`", *parts, *map(str, left)]) + " |")
    return lines


def grouped(found: list[Row], key) -> dict[str, list[Row]]:
    """Rows by key, in order of appearance."""
    out: dict[str, list[Row]] = {}
    for row in found:
        out.setdefault(key(row), []).append(row)
    return out


def defects(result: dict[str, Any]) -> list[str]:
    """The suites that detect each named defect."""
    suites = result["suites"]
    lines = ["| defect | function | " + " | ".join(suites) + " |", "|---" * (2 + len(suites)) + "|"]
    for name, (kernel, found) in result["defects"].items():
        marks = ["yes" if c >= 0 else "-" for c in found]
        lines.append(f"| {name} | `{kernel}` | " + " | ".join(marks) + " |")
    return lines


def reverse_part(found: list[Row]) -> list[str]:
    """The mutants that change a gradient, and how many of them the gradient checks alone detect."""
    changing = [r for r in found if r.change is not None and r.change > CHANGED and not r.equivalent]
    missed = [r for r in changing if "gradcheck" not in r.suites]
    lines = [
        f"Of the mutants that only the reverse pass runs, {len(changing)} change the gradient of some input by more "
        f"than {CHANGED:g} of its norm; the gradient checks alone detect {len(changing) - len(missed)} of them."
    ]
    return lines + ["", *(f"- {r.name}" for r in missed)] if missed else lines


def opening(result: dict[str, Any], found: list[Row]) -> list[str]:
    """The result in a sentence, in percentages, and as a chart."""
    real = counted(found)
    shares = detected(real, result["suites"])
    alive, known = len(real) - shares["any"], len(result["defects"])
    seen = sum(any(c >= 0 for c in codes) for _, codes in result["defects"].values())
    first = (
        f"On {result['run']['finished'][:10]} the tests detected {percent(shares['any'], len(real))} of {len(real)} "
        f"deliberate errors in the numerical modules of that day, and {seen} of {known} mistakes that a port could "
        "make. "
        + ("None survived." if not alive else f"{alive} survived and are listed below.")
        + f" {len(found) - len(real)} more changes are judged equivalent and are not counted."
    )
    alone = ", ".join(
        f"{s} {percent(shares[s], len(real))}" for s in sorted(result["suites"], key=lambda s: -shares[s])
    )
    second = f"Each suite alone detected: {alone}."
    return [*wrapped(first), "", *wrapped(second), "", "![Detected errors, by suite](results/discrimination.svg)", ""]


def wrapped(text: str, indent: str = "") -> list[str]:
    """Prose in lines of at most COLUMNS characters."""
    return textwrap.wrap(text, COLUMNS, subsequent_indent=indent, break_long_words=False, break_on_hyphens=False)


SUITES = (
    "- `gradcheck`: the public checker on the registered pairs. A mutant that only the reverse pass runs is compared "
    "with the differences of the correct forward pass, along every line of the checker. Any other mutant is compared "
    "along two joint lines, and along two lines of every block where the forward pass is fast.",
    "- `oracle`: tests that compare with the definition, with another independent formula or with a library.",
    "- `golden`: the reference against the stored answers of `golden/`, both paths in float64, the definition in "
    "float32.",
    "- `hard`: the tests named after the catalogue of hard cases.",
    "- `properties`: all other tests of the numerical modules.",
)


def method(result: dict[str, Any], found: list[Row]) -> list[str]:
    """How it was measured."""
    run = result["run"]
    machine, later = run["machine"], run.get("again", [])
    sample = f", at most {run['sample']} a function, evenly spread over its source" if run["sample"] else ""
    sample += f", as many as {run['minutes']:g} minutes allow" if run["minutes"] else ""
    again = ""
    if later:
        sample = sample.replace("at most", "at first at most")
        again = f" Survivors and new mutants were tested again with the tests of {later[-1]['commit']}"
        again += f" ({sum(r['seconds'] for r in later) / 60:.0f} minutes more)."
    words = " --sample " + str(run["sample"]) if run["sample"] else ""
    words += " --minutes " + format(run["minutes"], "g") if run["minutes"] else ""
    return [
        *wrapped(
            "Every function of the numerical modules is changed in one place at a time: another operator, a dropped "
            "term or statement, another constant, a shifted index, a flipped comparison, sign or branch, sine for "
            "cosine, smallest for largest. Five suites test each wrong version (mutant). A suite detects a mutant when "
            "one of its checks fails, raises or does not end. A mutant that no check detects is counted as a survivor, "
            "unless the list of equivalent mutants has a reason why its results are the same."
        ),
        "",
        *(line for text in SUITES for line in wrapped(text, "  ")),
        "",
        *wrapped(
            f"{run['finished'][:10]}, revision {run['commit']}; {len(found)} mutants of {len(result['kernels'])} "
            f"functions{sample}; {run['seconds'] / 60:.0f} minutes with {run['jobs']} process(es) on "
            f"{machine['processor']} ({machine['cores']} cores). Made by `python tests/mutation/discrimination.py"
            f"{words}`. The kernels run as plain Python here. Checks that take longer than {run['slow']:g} s that way "
            f"are left out ({len(result['left_out'])} of {len(result['left_out']) + len(result['checks'])}), so a "
            f"suite may detect more mutants than are counted.{again}"
        ),
        "",
    ]


def folded(title: str, lines: list[str]) -> list[str]:
    """Lines behind a heading that opens them."""
    return ["<details>", f"<summary>{title}</summary>", "", *lines, "", "</details>", ""]


def page(result: dict[str, Any]) -> str:
    """The whole page."""
    suites, found = result["suites"], rows(result)
    alive = [r for r in found if not r.suites and not r.equivalent]
    modules = grouped(found, lambda r: r.kernel.rsplit(".", 1)[0])
    functions = grouped(found, lambda r: r.kernel)
    lines = [
        "# What the tests can tell apart",
        "",
        *opening(result, found),
        "## By module",
        "",
        *table("module", {"all": found} | modules, suites),
        "",
        "## By kind of change",
        "",
        *table("kind", grouped(found, lambda r: r.kind), suites),
        "",
        "## Named defects",
        "",
        "Each is a mistake that a port could make, put into the source on purpose.",
        "",
        *defects(result),
        "",
        "## Reverse passes",
        "",
        *reverse_part(found),
        "",
        "## Survivors",
        "",
        *([f"- {r.name}" for r in alive] or ["None."]),
        "",
        "## How it was measured",
        "",
        *method(result, found),
        "## Equivalent mutants",
        "",
        *wrapped(
            f"These {len(found) - len(counted(found))} mutants are judged, one by one, to compute the same results, or "
            "to differ only in values on which no result depends. The reason names the few of which this is known for "
            "the tested inputs alone."
        ),
        "",
    ]
    tested = {r.name for r in found if r.equivalent}
    for group in EQUIVALENT:
        names = [n for n in group.names if n in tested]
        if names:
            lines += [f"**{group.reason}**", "", *folded(f"{len(names)} mutants", [f"- {n}" for n in names])]
    lines += ["## Every function", "", *folded(f"{len(functions)} functions", table("function", functions, suites))]
    return "\n".join(lines)


def draw(result: dict[str, Any]) -> None:
    """The chart: what each suite detects alone, and all of them together."""
    from endotsr.results.report.style import BLUE, GREY, INK, NORMAL, name_axes, new_figure, plain_axes, save

    real = counted(rows(result))
    shares = detected(real, result["suites"])
    names = ["any", *sorted(result["suites"], key=lambda s: -shares[s])]
    values = [100 * shares[name] / len(real) for name in names]
    figure = new_figure(7.2, 0.9 + 0.36 * len(names))
    axes = figure.subplots()
    colours = [BLUE if name == "any" else GREY for name in names]
    axes.barh(["all five together" if name == "any" else f"{name} alone" for name in names], values, color=colours)
    for row, name in enumerate(names):
        text = percent(shares[name], len(real))
        axes.text(values[row] + 1, row, text, va="center", color=INK, fontsize=NORMAL.text)
    axes.set_xlim(0, 112)
    axes.set_xticks(range(0, 101, 20))
    axes.invert_yaxis()
    name_axes(axes, "detected errors, %")
    plain_axes(axes, grid="x")
    save(figure, CHART)


def main() -> None:
    """The command."""
    result = json.loads(RESULT.read_text(encoding="utf-8"))
    PAGE.write_text(page(result), encoding="utf-8")
    draw(result)


if __name__ == "__main__":
    main()
