"""Ports as commands: requests for a port, execution of its command, and the folders of a call."""

import os
import shlex
import shutil
import subprocess
from pathlib import Path

import msgspec

from endotsr.errors import InputError
from endotsr.port.judge.about import axes_of, page_of
from endotsr.port.judge.format import (
    BITS,
    Case,
    Precision,
    Request,
    RequestInput,
    RequestOutput,
    Requests,
    read_struct,
    to_json,
)
from endotsr.port.judge.npy import write_npy
from endotsr.port.judge.profiles import last_level
from endotsr.port.judge.store import Golden

KEPT = ("requests", "outputs", "outputs_again")  # folders of one call of `golden run`


def clear_kept(root: Path) -> None:
    """Remove the folders of an earlier `golden run --keep`, because old outputs must not be judged.

    The folders in KEPT are removed if their requests have the format of `write_requests`.
    Raises: InputError if one of the names belongs to anything else; nothing is removed then.
    """
    taken = [path for path in (root / name for name in KEPT) if os.path.lexists(path)]
    if not taken:
        return
    try:
        read_struct(root / KEPT[0] / "requests.json", Requests)
        foreign = [path for path in taken if path.is_symlink() or not path.is_dir()]
    except (OSError, InputError, msgspec.DecodeError):
        foreign = taken
    if foreign:
        raise InputError(
            f"--keep: {foreign[0]} was not made by `endotsr golden run` and is left alone; "
            f"use a folder without {', '.join(KEPT)}, or one of an earlier run"
        )
    for path in taken:
        shutil.rmtree(path)


def write_requests(golden: Golden, folder: Path, precision: Precision, level: int) -> None:
    """Write the cases without answers: requests.json, <family>/<case>/request.json and inputs/*.npy."""
    wanted = [case for case in golden.cases if case.level <= level]
    for case in wanted:
        root = folder / case.family / case.case
        for array in case.inputs.values():
            write_npy(root / array.file, golden.array(case, array.file))
        request = _request(case, level)
        root.mkdir(parents=True, exist_ok=True)
        (root / "request.json").write_text(to_json(request), encoding="utf-8", newline="\n")
    head = Requests(
        version=golden.manifest.version, precision=precision, level=level,  # type: ignore[arg-type]
        cases=tuple(case.name for case in wanted),
    )  # fmt: skip
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "requests.json").write_text(to_json(head), encoding="utf-8", newline="\n")


def _request(case: Case, level: int) -> Request:
    """A case without its answers, with the outputs up to a level."""
    about = {name: RequestInput(unit=a.unit, axes=axes_of(name, len(a.shape))) for name, a in case.inputs.items()}
    outputs = {
        name: RequestOutput(level=o.level, unit=o.unit, axes=axes_of(name, len(o.shape)), dtype=o.dtype, shape=o.shape)
        for name, o in case.outputs.items()
        if o.level <= level
    }
    return Request(
        family=case.family, case=case.case, operation=case.operation, equation=case.equation,
        page=page_of(case.equation, case.operation), settings=case.settings,
        inputs={name: array.file for name, array in case.inputs.items()}, about=about, outputs=outputs,
    )  # fmt: skip


def refuse_folders(outputs: Path, again: Path | None, level: int, profile: str = "") -> None:
    """Raise InputError if a folder of outputs is missing, or `again` is the same one or has no use."""
    for folder in filter(None, (outputs, again)):
        if not folder.is_dir():
            raise InputError(f"{folder}: not a folder")
    if again and again.samefile(outputs):
        raise InputError(f"--again {again}: is OUTDIR itself; give the outputs of a second run")
    asked = min(level, last_level(profile)) if profile else level
    if again and asked < BITS:
        raise InputError(f"--again: two runs are compared at level {BITS}, and level {asked} is asked; leave it out")


def refuse_command(command: str, seconds: float) -> None:
    """Raise InputError if a port's command lacks {requests} or {outputs}, or if it gets no time."""
    if not seconds > 0:
        raise InputError(f"--timeout {seconds:g}; use seconds above 0, or inf")
    if "{requests}" not in command or "{outputs}" not in command:
        given = f"--port {command!r}" if command else "--port is missing"
        raise InputError(f"{given}: use the command of a port with the words {{requests}} and {{outputs}}")


def words_of(command: str, *, backslash_escapes: bool = os.name != "nt") -> list[str]:
    """The words of a command line, quoted as in a POSIX shell; on Windows a backslash is part of paths and is kept.

    Raises: ValueError for an unclosed quotation mark.
    """
    lexer = shlex.shlex(command, posix=True)
    lexer.whitespace_split, lexer.commenters = True, ""
    if not backslash_escapes:
        lexer.escape = ""
    return list(lexer)


def run_port(command: str, requests: Path, outputs: Path, seconds: float) -> str:
    """Run the port's command once, without a shell; returns a note if it failed.

    Raises: InputError if the command lacks {requests} or {outputs}, gets no time, or cannot be started.
    """
    refuse_command(command, seconds)
    outputs.mkdir(parents=True, exist_ok=True)
    try:
        split = words_of(command)
        words = [w.replace("{requests}", str(requests)).replace("{outputs}", str(outputs)) for w in split]
        done = subprocess.run(words, timeout=seconds, check=False)
    except subprocess.TimeoutExpired:
        return f"the port was stopped after {seconds:g} s"
    except (OSError, ValueError) as error:
        raise InputError(f"--port: cannot be started: {error}") from None
    return "" if done.returncode == 0 else f"the port ended with code {done.returncode}"
