"""Results of a long measurement, stored one per line, with which an interrupted measurement continues.

The first line identifies the measurement: settings, and a hash of the sources. A file of another measurement is
rejected. The file has the name of the result with `.part`, until the result is written.
"""

import hashlib
import json
import multiprocessing
import os
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from pathlib import Path
from typing import Any

import endotsr
from endotsr.errors import InputError
from endotsr.method.kernels.machine import usable_cores

Run = tuple[Any, ...]  # names of what is compared, and a seed


def measured(
    result: Path,
    about: dict[str, Any],
    runs: Iterable[Run],
    measure: Callable[..., dict[str, Any]],
    jobs: int = 1,
) -> dict[Run, dict[str, Any]]:
    """What `measure(*run)` returns for every run, in their order; stored answers are read, the others are measured.

    about    JSON-serialisable identity of the measurement, which stored answers must match
    jobs     concurrent processes, which share the cores. More than one needs a picklable `measure`: a function of a
             module, or a `functools.partial` of one

    Raises: InputError with the name of the file if it belongs to another measurement or is damaged.
    """
    path, by_key = part_of(result), {key_of(run): run for run in runs}
    about = json.loads(json.dumps(about))
    found = _read(path, about)
    if not path.exists():
        path.write_text(json.dumps(about) + "\n", encoding="utf-8")
    missing = {key: run for key, run in by_key.items() if key not in found}
    with path.open("a", encoding="utf-8") as file:
        for key, answer in _answers(missing, measure, jobs):
            found[key] = answer
            file.write(json.dumps({"key": key, "answer": answer}) + "\n")
            file.flush()
            print(key, flush=True)
    return {run: found[key] for key, run in by_key.items()}


def key_of(run: Run) -> str:
    """A run as text: its names, and its seed as `seed 3`."""
    return ", ".join(f"seed {part}" if isinstance(part, int) else str(part) for part in run)


def nested(answers: dict[Run, dict[str, Any]]) -> dict[str, Any]:
    """Answers of runs (name, ..., seed) as dictionaries by name, with the list of the seeds innermost."""
    found: dict[str, Any] = {}
    for (*names, last, _), answer in answers.items():
        place = found
        for name in names:
            place = place.setdefault(name, {})
        place.setdefault(last, []).append(answer)
    return found


def _answers(
    missing: dict[str, Run], measure: Callable[..., dict[str, Any]], jobs: int
) -> Iterator[tuple[str, dict[str, Any]]]:
    """Keys and answers, in the order of their completion."""
    if jobs < 2:
        yield from ((key, measure(*run)) for key, run in missing.items())
        return
    with ProcessPoolExecutor(
        jobs, multiprocessing.get_context("spawn"), _with_threads, (usable_cores() // jobs,)
    ) as pool:
        running = {pool.submit(measure, *run): key for key, run in missing.items()}
        yield from ((running[done], done.result()) for done in as_completed(running))


def _with_threads(count: int) -> None:
    """For a new process, before Numba is imported."""
    os.environ["NUMBA_NUM_THREADS"] = str(max(1, count))


def sources(*rooms: str, beside: Iterable[str] = ()) -> str:
    """First 16 hex digits of the SHA-256 over the source files of rooms of the package; "" is the whole package.

    rooms   folders below the package, such as `clips/effects`
    beside  files below `docs/pages`, without their ending, that are part of the measurement

    Raises: FileNotFoundError for a room or a file that does not exist.
    """
    package, digest = Path(endotsr.__file__).parent, hashlib.sha256()
    for room in rooms:
        if not (package / room).is_dir():
            raise FileNotFoundError(package / room)
        for file in sorted((package / room).rglob("*.py")):
            digest.update(file.relative_to(package).as_posix().encode() + file.read_bytes())
    for name in beside:
        digest.update(name.encode() + (Path(__file__).parents[1] / f"{name}.py").read_bytes())
    return digest.hexdigest()[:16]


def part_of(result: Path) -> Path:
    """The file of the stored answers of a result."""
    return result.with_name(result.name + ".part")


def finished(result: Path) -> None:
    """Remove the stored answers of a written result."""
    part_of(result).unlink(missing_ok=True)


def _read(path: Path, about: dict[str, Any]) -> dict[str, dict[str, Any]]:
    """The stored answers. An incomplete last line is removed: the measurement stopped while writing it."""
    if not path.exists():
        return {}
    text = path.read_text(encoding="utf-8")
    whole = text[: text.rfind("\n") + 1]
    try:
        first, *lines = [json.loads(line) for line in whole.splitlines()] or [None]
        answers = {line["key"]: line["answer"] for line in lines}
    except (ValueError, TypeError, KeyError):
        raise InputError(f"{path}: damaged; use the answers of this command, or no file") from None
    if first != about:
        raise InputError(f"{path}: belongs to another measurement: {first}; use {about}, or no file")
    if whole != text:
        path.write_text(whole, encoding="utf-8")
    return answers


def with_row(record: Path, row: dict[str, Any], key: tuple[str, ...]) -> dict[str, Any]:
    """The rows of a record with one more, which replaces the row of the same key."""
    rows = json.loads(record.read_text(encoding="utf-8"))["rows"] if record.exists() else []
    others = [other for other in rows if any(other[name] != row[name] for name in key)]
    return {"rows": sorted([*others, row], key=lambda one: [one[name] for name in key])}
