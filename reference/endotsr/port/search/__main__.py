"""The process of a search: `python -m endotsr.port.search GOLDEN OUTPUTS PRECISION LEVEL OPERATION SECONDS`.

Prints the results as JSON; exits with code 1 if there is nothing to explain, or after an error.
"""

import contextlib
import json
import sys
import time
from pathlib import Path
from typing import Any

from endotsr.errors import InputError
from endotsr.port.judge.store import read_golden
from endotsr.port.search.find import apart, explained, sentences, together
from endotsr.port.search.inside import looked

MOST_MEMORY = 4 << 30  # bytes, if the system supports a limit


def main(words: list[str]) -> int:
    """One search."""
    folder, outputs, precision, level, operation, seconds = words
    given: Any = precision
    with contextlib.suppress(ImportError, ValueError, OSError):
        import resource

        resource.setrlimit(resource.RLIMIT_AS, (MOST_MEMORY, MOST_MEMORY))
    golden = read_golden(Path(folder), verify=False)
    try:
        found = explained(golden, Path(outputs), given, int(level), operation, float(seconds))
    except InputError:
        return 1
    inside, asked = looked(found.operation, found.cases)
    whole = sentences(found)
    began, more = time.process_time(), float(seconds) / 2  # for both that follow
    causes = together(found, more / 2)
    if not causes:
        causes = [*whole, *apart(found, whole, more - (time.process_time() - began))]
    print(json.dumps({"causes": causes, "inside": inside, "asked": asked}))
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
