"""`endotsr gradcheck`: check every registered pair and print a table."""

import sys
from pathlib import Path

from endotsr.errors import InputError
from endotsr.training.runs.files import refuse_unwritable
from endotsr.untrusted.names import choice


def run_gradcheck(
    names: list[str] | None = None, seed: int = 0, json_path: Path | None = None, definition: bool = False
) -> int:
    """Check the named pairs (None or empty = all), print the table, return the exit code.

    names       pair names, as in the table
    seed        of the inputs, cotangents and directions; every pair has its own random stream
    json_path   file of the JSON report; None = no report
    definition  check the functions of `endotsr.definition` instead of the compiled ones, in float64 only
    returns     0 if every check passed, else 1
    Raises:     InputError for an unknown name, a seed below 0 or an unwritable file.
    """
    from endotsr.port.gradcheck.checker import check_pair
    from endotsr.port.gradcheck.precision import check_precision
    from endotsr.port.gradcheck.registry import all_pairs, definition_pairs, one_thread, pair_stream
    from endotsr.port.gradcheck.report import summary, table, to_json

    pairs = definition_pairs() if definition else all_pairs()
    for name in names or ():
        if name not in pairs:
            raise InputError(f"gradcheck: {name!r} is not a registered operation; use {choice(pairs)}")
    refuse_unwritable(json_path)
    chosen = [pairs[name] for name in (names or pairs)]
    reports, precisions = [], []
    with one_thread():
        for pair in chosen:
            reports.append(check_pair(pair, pair_stream(pair.name, seed)))
            if not definition:
                precisions.append(check_precision(pair, pair_stream(pair.name, seed)))
    print(table(reports, precisions, colour=sys.stdout.isatty()))
    print()
    print(summary(reports, precisions), flush=True)
    if json_path is not None:
        try:
            Path(json_path).write_text(to_json(reports, precisions, seed), encoding="utf-8", newline="\n")
        except OSError as error:
            raise InputError(f"{json_path}: cannot be written: {error.strerror}") from None
    return 0 if all(r.passed for r in (*reports, *precisions)) else 1
