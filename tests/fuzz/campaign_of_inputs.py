"""Mutated files for every reader: python tests/fuzz/campaign_of_inputs.py --inputs 100000 --json FILE

Each input must be read or refused with an `InputError` of one printable line within a second, within the memory bound.
Anything else is a finding: its bytes are written to tests/fuzz/corpus/<reader>/, which the test suite reads again.
"""

import argparse
import contextlib
import datetime
import hashlib
import json
import os
import random
import sys
import tempfile
import time
import warnings
from pathlib import Path
from typing import Any

# The writers of good files are those of the tests of sequences.
CLIPS = Path(__file__).parents[1] / "clips"
sys.path[:0] = [str(CLIPS), str(CLIPS / "sequences" / "inputs")]

import mutate  # noqa: E402
from readers import CORPUS, READERS, Reader  # noqa: E402

SLOW = 1.0  # seconds of one input
MEMORY = 1 << 30  # bytes of address space above those at the start: a reader that asks for more fails


def tried(reader: Reader, path: Path, data: bytes) -> str:
    """What is wrong with the answer of a reader to these bytes; empty if it is right."""
    path.write_bytes(data)
    began = time.process_time()
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            reader.read(path)
    except reader.refuses as refusal:
        line = str(refusal)
        if "\n" in line.strip() or "\x1b" in line:
            return f"a message of several lines or with control characters: {line!r}"[:300]
    except BaseException as error:
        if isinstance(error, KeyboardInterrupt):
            raise
        return f"{type(error).__name__}: {error}"[:300]
    seconds = time.process_time() - began
    return f"{seconds:.1f} s" if seconds > SLOW else ""


def inputs(reader: Reader, seed: int, count: int):
    """Mutated files: three of four keep the structure of the format."""
    rng, seeds = random.Random(seed), reader.seeds()
    for _ in range(count):
        change = reader.mutate if rng.randrange(4) else mutate.plain
        yield change(rng, rng.choice(seeds))


@contextlib.contextmanager
def bounded_memory(extra: int = MEMORY):
    """The address space of this process may grow by `extra` bytes; without effect where the system has no limit."""
    try:
        import resource

        pages = int(Path("/proc/self/statm").read_text().split()[0])
    except (ImportError, OSError):
        yield
        return
    before = resource.getrlimit(resource.RLIMIT_AS)
    resource.setrlimit(resource.RLIMIT_AS, (pages * resource.getpagesize() + extra, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_AS, before)


def fuzz(name: str, count: int, seed: int, seconds: float, keep: bool = True) -> dict[str, Any]:
    """Fuzz one reader; returns a row of the report."""
    reader = READERS[name]
    reader.seeds()  # made once
    began, done = time.monotonic(), 0
    findings: dict[str, str] = {}
    base = Path("/dev/shm") if os.access("/dev/shm", os.W_OK) else None
    with tempfile.TemporaryDirectory(dir=base) as scratch:
        path = Path(scratch) / reader.name
        for seed_bytes in reader.seeds():
            assert not tried(reader, path, seed_bytes), f"{name}: a good file is refused"
        with bounded_memory():
            for data in inputs(reader, seed, count):
                done += 1
                if (wrong := tried(reader, path, data)) and wrong.split(":")[0] not in findings:
                    findings[wrong.split(":")[0]] = wrong
                    print(f"{name}: {wrong}", flush=True)
                    if keep:
                        place = CORPUS / name.split()[0] / f"{hashlib.sha256(data).hexdigest()[:16]}.bin"
                        place.parent.mkdir(parents=True, exist_ok=True)
                        place.write_bytes(data)
                if time.monotonic() - began > seconds:
                    break
    row = {"reader": name, "inputs": done, "seconds": round(time.monotonic() - began), "findings": len(findings)}
    print(f"{name}: {done} inputs, {row['seconds']} s, {len(findings)} findings", flush=True)
    return row


def kept_rows(file: Path, about: dict[str, Any], rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """The rows in the order of the readers, with those of other readers that the file has of this day and machine."""
    found = json.loads(file.read_text()) if file.exists() else {}
    if any(found.get(key) != value for key, value in about.items()):
        return rows
    by_reader = {row["reader"]: row for row in [*found["readers"], *rows]}
    return [by_reader[name] for name in READERS if name in by_reader]


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--inputs", type=int, default=100_000, help="of each reader")
    parser.add_argument("--seconds", type=float, default=1e9, help="most for each reader")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument(
        "--reader", choices=list(READERS), action="append", help="the rest of the record of today stays"
    )
    parser.add_argument("--json", type=Path)
    asked = parser.parse_args()
    rows = [fuzz(name, asked.inputs, asked.seed, asked.seconds) for name in asked.reader or READERS]
    if asked.json:
        from endotsr.training.runs.machine import machine

        about = {"date": datetime.date.today().isoformat(), "seed": asked.seed, "machine": machine(), "memory": MEMORY}
        rows = kept_rows(asked.json, about, rows) if asked.reader else rows
        asked.json.write_text(json.dumps(about | {"readers": rows}, indent=1) + "\n")
    return 1 if any(row["findings"] for row in rows) else 0


if __name__ == "__main__":
    sys.exit(main())
