"""The gallery of hard cases: naive formula, truth and endotsr, in float64 and float32.

    python docs/make.py hard_cases measure     in a few seconds

Every naive formula is executed, on the same rounded inputs as ours; the truth is exact or has 60 digits (mpmath), or
extended precision (X1).
"""

# A record of a page is complete, or the KeyError says what it lacks.
# pyright: reportTypedDictNotRequiredAccess=false

import argparse
import math
import warnings
from typing import Any

import numpy as np

from endotsr.results.report.style import save
from endotsr.training.runs.machine import machine, now, versions
from pages.hard_cases import pictures
from pages.hard_cases.gallery import CASES, DTYPES
from pages.store.program import RESULTS, Program


def error(value: float, truth: float) -> float:
    """Relative, or absolute where the truth is 0."""
    return abs(value - truth) / (abs(truth) or 1.0)


def measure() -> list[dict[str, Any]]:
    """All cases with the values and errors of both precisions."""
    rows = []
    with np.errstate(all="ignore"), warnings.catch_warnings():
        warnings.simplefilter("ignore")  # the naive formulas overflow and divide by zero: that is the point
        for entry in CASES:
            row: dict[str, Any] = {**entry._asdict(), "run": entry.run.__name__}
            for label, dtype in DTYPES.items():
                truth, naive, ours = (float(x) for x in entry.run(dtype))
                row[label] = {"truth": truth, "naive": naive, "ours": ours}
                row[label] |= {"naive_error": error(naive, truth), "ours_error": error(ours, truth)}
            rows.append(row)
    return rows


def cell(value: float, miss: float) -> str:
    """A value and its error."""
    return f"{value:.7g} ({f'{miss:.0e}' if miss else 'exact'})" if math.isfinite(value) else f"**{value}**"


def gallery(record: dict[str, Any]) -> str:
    """The gallery as Markdown, and where it was made."""
    lines, computer = [], record["machine"]
    about = (
        f"Made by `python docs/make.py hard_cases measure` on {record['made'][:10]}, {computer['processor']} "
        f"({computer['cores']} cores), {', '.join(f'{name} {v}' for name, v in record['versions'].items())}."
    )
    for row in map(numbers, record["cases"]):
        lines += [f"### {row['name']}: {row['title']}", "", row["why"], "", "| | float64 | float32 |", "|---|---|---|"]
        lines.append("| right | " + " | ".join(f"{row[d]['truth']:.7g}" for d in DTYPES) + " |")
        for label, key in ((row["naive"], "naive"), ("endotsr", "ours")):
            lines.append(f"| {label} | " + " | ".join(cell(row[d][key], row[d][f"{key}_error"]) for d in DTYPES) + " |")
        lines.append("")
    return "\n".join([*lines, about])


def promise(record: dict[str, Any]) -> str:
    """What the page shows, in one sentence: the worst error in float32 of both ways of computing."""
    rows = [numbers(row) for row in record["cases"]]
    usual = [row["float32"]["naive_error"] for row in rows]
    none = sum(not math.isfinite(value) for value in usual)
    coarse = sum(math.isfinite(value) and value >= 0.01 for value in usual)
    ours = max(row["float32"]["ours_error"] for row in rows)
    return (
        f"**Of {len(rows)} hard cases in float32, the textbook formula returns NaN or infinity in {none} and is at "
        f"least 1 % off in {coarse} more; endotsr is never off by more than {rounded_up(ours)}.**"
    )


def rounded_up(value: float) -> str:
    """Two digits that are not below the value."""
    digits = math.floor(math.log10(value))
    return f"{math.ceil(value / 10.0 ** (digits - 1)) / 10:.1f}e{digits:03d}"


def plain(data: Any) -> Any:
    """The same with words in place of numbers that JSON does not have."""
    if isinstance(data, dict):
        return {key: plain(value) for key, value in data.items()}
    return str(data) if isinstance(data, float) and not math.isfinite(data) else data


def numbers(row: dict[str, Any]) -> dict[str, Any]:
    """The reverse of `plain` for a case."""
    return row | {label: {key: float(value) for key, value in row[label].items()} for label in DTYPES}


def measured(options: argparse.Namespace | None = None) -> dict[str, Any]:
    """The record."""
    libraries = {name: version for name, version in versions().items() if name in ("python", "numpy", "numba")}
    return {"made": now(), "machine": machine(), "versions": libraries, "cases": [plain(row) for row in measure()]}


def draw(record: dict[str, Any]) -> None:
    """The three pictures."""
    save(pictures.drawn(pictures.measured()), RESULTS / "hard_cases.png")


PROGRAM = Program(
    __name__, "hard_cases.md", {"promise": promise, "gallery": gallery}, "hard_cases.json", measured, draw=draw,
    stamped=False,
)  # fmt: skip
