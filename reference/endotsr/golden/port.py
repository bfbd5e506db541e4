"""The two file doors: requests that a port answers, and the reference as a port of itself."""

import os
import shlex
import shutil
import subprocess
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from endotsr.errors import InputError
from endotsr.golden.format import Case, Precision, Request, RequestOutput, Requests, read_struct, to_json
from endotsr.golden.negative import Negative, answer
from endotsr.golden.negative import Request as WrongRequest
from endotsr.golden.npy import Refused, read_plain, write_npy
from endotsr.golden.solve import reference, stored
from endotsr.golden.store import Golden
from endotsr.stages.registry import all_stages
from endotsr.stages.stage import Outputs

KEPT = ("requests", "outputs", "outputs_again")  # folders of one call of `golden run`


def clear_kept(root: Path) -> None:
    """Remove what an earlier `golden run --keep` left in this folder, so that old outputs are never judged.

    Ours are the folders below, if the requests among them are such that `write_requests` made.
    Raises: InputError if one of the names is taken by anything else; nothing is removed then.
    """
    taken = [path for path in (root / name for name in KEPT) if os.path.lexists(path)]
    if not taken:
        return
    try:
        read_struct(root / KEPT[0] / "requests.json", Requests)
        foreign = [path for path in taken if path.is_symlink() or not path.is_dir()]
    except (OSError, msgspec.DecodeError):
        foreign = taken
    if foreign:
        raise InputError(
            f"--keep: {foreign[0]} was not made by `endotsr golden run` and is left alone; "
            f"allowed: a folder without {', '.join(KEPT)}, or one of an earlier run"
        )
    for path in taken:
        shutil.rmtree(path)


def write_requests(golden: Golden, folder: Path, precision: Precision, level: int) -> None:
    """The cases without their answers: requests.json, <family>/<case>/request.json and inputs/*.npy."""
    wanted = [case for case in golden.cases if case.level <= level]
    for case in wanted:
        root = folder / case.family / case.case
        for array in case.inputs.values():
            write_npy(root / array.file, golden.array(case, array.file))
        outputs = {
            name: RequestOutput(level=o.level, unit=o.unit, dtype=o.dtype, shape=o.shape)
            for name, o in case.outputs.items()
            if o.level <= level
        }
        request = Request(
            family=case.family, case=case.case, operation=case.operation, settings=case.settings,
            inputs={name: array.file for name, array in case.inputs.items()}, outputs=outputs,
        )  # fmt: skip
        root.mkdir(parents=True, exist_ok=True)
        (root / "request.json").write_text(to_json(request), encoding="utf-8")
    head = Requests(
        version=golden.manifest.version, precision=precision, level=level,  # type: ignore[arg-type]
        cases=tuple(case.name for case in wanted),
    )  # fmt: skip
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "requests.json").write_text(to_json(head), encoding="utf-8")


def refuse_command(command: str) -> None:
    """Raises InputError if a port's command does not say where {requests} and {outputs} go."""
    if "{requests}" not in command or "{outputs}" not in command:
        raise InputError(f"--port {command!r} must contain {{requests}} and {{outputs}}")


def run_port(command: str, requests: Path, outputs: Path, seconds: float) -> str:
    """Call the port's command once; returns a note when it failed. No shell is involved.

    Raises: InputError if the command names no {requests} or {outputs}, or cannot be started.
    """
    refuse_command(command)
    outputs.mkdir(parents=True, exist_ok=True)
    try:
        split = shlex.split(command)
        words = [w.replace("{requests}", str(requests)).replace("{outputs}", str(outputs)) for w in split]
        done = subprocess.run(words, timeout=seconds, check=False)
    except subprocess.TimeoutExpired:
        return f"the port was stopped after {seconds:g} s"
    except (OSError, ValueError) as error:
        raise InputError(f"--port: cannot be started: {error}") from None
    return "" if done.returncode == 0 else f"the port ended with code {done.returncode}"


def answer_requests(requests: Path, outputs: Path) -> int:
    """The reference behind the door: reads a folder of requests alone, writes outputs. Returns how many cases."""
    try:
        head = read_struct(requests / "requests.json", Requests)
        for name in head.cases:
            root = requests / name
            request = read_struct(root / "request.json", Request)
            inputs = {key: read_plain(root / file, requests) for key, file in request.inputs.items()}
            _write(outputs / name, _answer(request.operation, inputs, request.settings, head.precision),
                   list(request.outputs), head.precision)  # fmt: skip
    except (OSError, msgspec.DecodeError, Refused) as error:
        raise InputError(f"{requests}: {error}") from None
    return len(head.cases)


def answer_all(golden: Golden, outputs: Path, precision: Precision) -> int:
    """The reference's own outputs for every case."""
    for case in golden.cases:
        found = _answer(case.operation, _inputs(golden, case), case.settings, precision)
        _write(outputs / case.name, found, list(case.outputs), precision)
    return len(golden.cases)


def answer_wrongly(golden: Golden, outputs: Path, negative: Negative, *, spoiled_only: bool = False) -> int:
    """The outputs of a wrong port in float64; returns how many cases it spoils. Right answers are the expected ones.

    spoiled_only   write no case that the mistake leaves alone
    """
    operations, spoiled = all_stages(), 0
    for case in golden.cases:
        operation, inputs = operations[case.operation], _inputs(golden, case)
        right: Outputs = {name: golden.array(case, o.file) for name, o in case.outputs.items()}

        def run(arrays, settings, operation=operation) -> Outputs:
            return reference(operation, arrays, dict(settings), "float64", "definition")

        wrong = answer(negative, case.operation, WrongRequest(inputs, case.settings, run, right))
        spoiled += wrong is not None
        if wrong is None and spoiled_only:
            continue
        for name, value in (wrong or right).items():
            write_npy(outputs / case.name / f"{name}.npy", value)
    return spoiled


def _inputs(golden: Golden, case: Case) -> dict[str, np.ndarray]:
    return {name: golden.array(case, array.file) for name, array in case.inputs.items()}


def _answer(operation: str, inputs: dict, settings: dict[str, Any], precision: str) -> Outputs:
    """With the fast compositing where it applies: the expected values come from the other path."""
    return reference(all_stages()[operation], inputs, settings, precision, "blocks")


def _write(folder: Path, found: Outputs, names: list[str], precision: str) -> None:
    for name in names:
        if name in found:
            value = stored(found[name])
            real = value.dtype.kind == "f" and value.ndim > 0
            write_npy(folder / f"{name}.npy", value.astype(precision) if real else value)
