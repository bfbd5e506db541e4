"""The generated parts of the performance page: tables and sentences made from the JSON of `endotsr bench all`.

A page holds pairs of marks `<!-- bench:NAME:start -->` and `<!-- bench:NAME:end -->`; what stands between them is
replaced. All words around them are written by hand.
"""

import json
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from endotsr.bench import page_parts
from endotsr.bench.suite import PEERS_FILE, SCALING_FILE, STAGES_FILE, START_FILE
from endotsr.errors import InputError
from endotsr.runs.files import replace_file

FILES = {"stages": STAGES_FILE, "scaling": SCALING_FILE, "peers": PEERS_FILE, "start": START_FILE}


def write_page(folder: Path, page: Path) -> None:
    """Put what the JSON files of `folder` say between the marks of `page`.

    Raises: InputError if a file is missing or cannot be read, or the page has a mark without a partner or a name
            that is not known.
    """
    made = fragments({name: _read(folder / file) for name, file in FILES.items()}, _runs(folder))
    text = replaced(page.read_text(encoding="utf-8"), made, page)
    replace_file(page, lambda temporary: temporary.write_text(text, encoding="utf-8"))


def fragments(found: Mapping[str, dict[str, Any]], runs: Mapping[str, dict[str, Any]]) -> dict[str, str]:
    """Every generated part by name."""
    stages, scaling, peers, start = (found[name] for name in FILES)
    return {
        "machine": page_parts.machine(stages),
        "targets": page_parts.targets(stages, scaling, peers, start, runs),
        "stages": page_parts.stages(stages),
        "gain": page_parts.gain(stages),
        "cases": page_parts.cases(stages),
        "scaling": page_parts.scaling(scaling),
        "peers": page_parts.peers(peers),
        "start": page_parts.start(start),
        "runs": page_parts.runs(runs),
    }


def replaced(text: str, made: Mapping[str, str], page: Path, room: str = "bench") -> str:
    """The text with every part between marks of `room` replaced."""
    names = re.findall(rf"<!-- {room}:(\w+):start -->", text)
    for name in names:
        head, rest = text.split(f"<!-- {room}:{name}:start -->", 1)
        _, end, tail = rest.partition(f"<!-- {room}:{name}:end -->")
        if not end or name not in made:
            raise InputError(f"{page}: mark {room}:{name} has no end or no meaning; allowed: {', '.join(made)}")
        text = f"{head}<!-- {room}:{name}:start -->\n{made[name]}\n{end}{tail}"
    return text


def _read(path: Path) -> dict[str, Any]:
    try:
        return json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise InputError(f"{path}: cannot be read: {error}; made by `endotsr bench all --out FOLDER`") from None


def _runs(folder: Path) -> dict[str, dict[str, Any]]:
    """Records of whole runs that stand in the same folder, by name."""
    found = {path.stem: _read(path) for path in sorted(folder.glob("pulling*.json"))}
    return {name: record["run"] for name, record in found.items()}
