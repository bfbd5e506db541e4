"""Cells, notes and places of the tables of all pages."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from endotsr.results.report.tables import fixed, markdown
from pages.store.intervals import shown

Columns = Sequence[tuple[str, int]]  # key and decimals


def noted(heads: Sequence[str], rows: Iterable[Sequence[str]], note: str) -> str:
    """A table with a paragraph below it."""
    return f"{markdown(heads, rows)}\n\n{note}"


def numbers(row: Mapping[str, Any], columns: Columns) -> list[str]:
    """The values of one row."""
    return [fixed(row[key], digits) for key, digits in columns]


def means(runs: Sequence[Mapping[str, Any]], columns: Columns) -> list[str]:
    """Means over the runs that have a value, with 95 % intervals."""
    return [shown([run[key] for run in runs if run.get(key) is not None], digits) for key, digits in columns]


def days(runs: Iterable[Mapping[str, Any]]) -> str:
    """The first and the last day of several measurements."""
    found = sorted({run["date"][:10] for run in runs})
    return found[0] if len(found) == 1 else f"{found[0]} to {found[-1]}"


def where(record: Mapping[str, Any]) -> str:
    """Processor and day of a measurement."""
    return f"{record['machine']['processor']}, {record['date'][:10]}"


def where_and_cores(record: Mapping[str, Any]) -> str:
    """Processor, number of cores and day, without brackets."""
    return f"{record['machine']['processor']}, {record['machine']['cores']} cores, {record['date'][:10]}"


def where_with_cores(record: Mapping[str, Any]) -> str:
    """Processor, number of cores and day of a measurement."""
    about = record["machine"]
    return f"{about['processor']} ({about['cores']} cores), {record['date'][:10]}"
